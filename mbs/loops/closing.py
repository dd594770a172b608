"""The numbers of a closure: its residual, the nearest configuration that closes, and sizes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import casadi
import numpy as np
from casadi import SX, Function
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.assembly.tree import norm_rows, quaternion_slices
from mbs.errors import Unclosable
from mbs.loops.closure import closure_rows, facing, position_rows, velocity_row_units
from mbs.numbers import OnArrays, on_arrays
from mbs.solvers.least_squares import MANY, Entries, NewtonEquations, gauss_newton

# What rows of a closure are measured by: lengths by the size of the mechanism, cosines as such.
#
# How far a loop is open says nothing by itself: 1e-6 m is nothing for a crane, and 1 % of a link
# of 100 um.


_ROUNDING = 1e-9
"""Length [m] below which levers are rounding, which is 1e-13 of a mechanism of 1 km."""
_SAMPLES, _SEED = 3, 20260201
"""Configurations at which levers are measured, the zero configuration among them."""


def mechanism_size(system: System) -> SX:
    """The longest lever by which an angle moves the ends of a loop, or their largest distance [m].

    It is taken at some configurations, always the same and open as a rule, so that it is known
    before a loop is closed; 1 m where nothing tells a small mechanism from a large one.

    Returns:
        (1, 1) expression of the parameters p.
    """

    def build() -> SX:
        indices = [k for k, is_length in enumerate(_lengths(system)) if is_length]
        if not indices:
            return SX(1)
        q = SX.sym("q", system.nq)
        rows = closure_rows(system, q)[indices]
        turns = [k for k, c in enumerate(system.coordinates) if not c.unit.startswith("m")]
        levers = casadi.jacobian(rows, q)[:, turns]
        lengths = casadi.vertcat(rows, casadi.vec(levers.nz[:])) if levers.nnz() else rows
        found = Function("lengths", [q, system.p], [lengths])
        every = casadi.vertcat(
            *(found(configuration, system.p) for configuration in _configurations(system))
        )
        size = SX(casadi.mmax(casadi.fabs(every)))
        # around the centre of a sphere levers are rounding
        return SX(casadi.if_else(size > _ROUNDING, size, 1))

    size: SX = system.cached("mechanism size", build)
    return size


def row_sizes(system: System) -> SX:
    """(m, 1) what each closure row is measured by [m or 1], as a function of p."""
    size = mechanism_size(system)
    return casadi.vertcat(SX(0, 1), *(size if own else SX(1) for own in _lengths(system)))


def constraint_sizes(system: System) -> SX:
    """(m, 1) the same of the rows of J: those of the closure, then slips of discs [m or 1]."""
    slips = velocity_row_units(system)
    size = mechanism_size(system)
    return casadi.vertcat(row_sizes(system), *(size if u == "m" else SX(1) for u in slips))


def relative_rows(system: System, q: SX) -> SX:
    """(m + k, 1) closure rows as parts of what they are measured by, then norms of quaternions."""
    return casadi.vertcat(closure_rows(system, q) / row_sizes(system), norm_rows(system.tree, q))


def _lengths(system: System) -> list[bool]:
    """Whether each closure row is a length."""
    return [unit == "m" for *_, unit in position_rows(system)]


def _configurations(system: System) -> list[list[float]]:
    """The zero configuration and random ones; displacements zero, quaternions of unit length."""
    rng, configurations = np.random.default_rng(_SEED), list[list[float]]()
    for number in range(_SAMPLES):
        reach = np.pi if number else 0.0
        q = [
            0.0 if c.unit.startswith("m") else float(rng.uniform(-reach, reach))
            for c in system.coordinates
        ]
        for part in quaternion_slices(system.tree):
            q[part] = [1.0, 0.0, 0.0, 0.0]
        configurations.append(q)
    return configurations


Vector = NDArray[np.float64]

TOLERANCE = 1e-12
"""Largest closure row where an iteration ends, in parts of the size of the mechanism: rounding of
sums of some tens of terms of size one stays below it, what Newton's method leaves before its last
step, 1e-8 or more, does not."""

CLOSED = 1e-10
"""The same of configurations that formulas or others give: hundreds of roundings, no missing
step."""

OPEN = 1e-6
"""The same of configurations that a user gives, with seven digits; forces are wrong by as
little."""


_KEPT = 8
"""Values of parameters of which sizes are kept: a line between two has as many steps."""


@dataclass(frozen=True, slots=True, eq=False)
class Closed:
    """Where an attempt to close the loops ended.

    Attributes:
        q: (nq,) positions.
        residual: Euclidean norm of all rows there.
        is_closed: whether every row is closed and no axis is opposed.
    """

    q: Vector
    residual: float
    is_closed: bool


@dataclass(frozen=True, slots=True, eq=False)
class Closing:
    """The closure rows and quaternion norms of a system, some positions locked.

    Attributes:
        system: with loops, not necessarily analysed.
        p: (np,) values of its parameters.
        locked: positions that must not change.
    """

    system: System
    p: Vector
    locked: tuple[int, ...] = ()

    @property
    def free(self) -> list[int]:
        """The positions that may change."""
        locked = set(self.locked)
        return [k for k in range(self.system.nq) if k not in locked]

    def rows(self, q: Vector) -> tuple[Vector, Vector]:
        """Residual (m,) and its derivative by the free positions (m, n)."""
        r, J = self._functions().equations(q, self.p)
        return r.ravel(), J[:, self.free] if self.locked else J

    def _sparse_rows(self, q: Vector, free: Sequence[int]) -> tuple[Vector, Entries]:
        """The same as `rows`, for many positions."""
        functions = self._functions()
        r, values = functions.elements(q, self.p)
        number = np.full(self.system.nq, -1)
        number[free] = np.arange(len(free))
        rows, columns = functions.places
        columns = number[columns]
        kept = columns >= 0
        entries = Entries(rows[kept], columns[kept], values.ravel()[kept], (r.size, len(free)))
        return r.ravel(), entries

    @property
    def size(self) -> float:
        """The size of the mechanism [m]."""
        return float(self._sizes[0][0, 0])

    @property
    def sizes(self) -> Vector:
        """(m,) what the rows are measured by: the size of the mechanism for lengths [m], or 1."""
        return self._sizes[1].ravel()

    @property
    def _sizes(self) -> list[Vector]:
        """The size of the mechanism and those of the rows; starts have the same p as a rule."""

        def build() -> list[Vector]:
            return self._functions().sizes(self.p)

        found: list[Vector] = self.system.recent("closing sizes", self.p.tobytes(), build, _KEPT)
        return found

    def openness(self, q: Vector) -> float:
        """The largest row at q, (nq,), in parts of the size of the mechanism."""
        return float(np.max(np.abs(self.rows(q)[0]) / self.sizes, initial=0.0))

    def nearest(self, q: Vector) -> Closed:
        """The configuration that Gauss-Newton reaches from q (nq,)."""
        start, free = np.array(q, dtype=float), self.free

        def residual(x: Vector) -> tuple[Vector, Vector | Entries]:
            at = _replace(start, free, x)
            return self.rows(at) if len(free) < MANY else self._sparse_rows(at, free)

        def values(x: Vector) -> Vector:
            return self._functions().values(_replace(start, free, x), self.p)[0].ravel()

        tolerance = TOLERANCE * self.sizes
        compiled = self._functions().newton.near(start, self.p, free, tolerance)
        if compiled is not None:
            found, root = compiled
            return Closed(found, root.residual, root.converged and self.faces(found))
        root = gauss_newton(residual, start[free], tolerance=tolerance, values=values)
        found = _replace(start, free, root.x)
        return Closed(found, root.residual, root.converged and self.faces(found))

    def nearby(self, q: Vector, reach: float, tries: int, seed: int) -> Iterator[Vector]:
        """Closed configurations that Gauss-Newton reaches from random ones around q (nq,).

        Args:
            q: around which they are taken.
            reach: largest difference of a position at the start [rad or m].
            tries: how many starts are taken at most.
            seed: of the random numbers.
        """
        rng = np.random.default_rng(seed)
        for _ in range(tries):
            closed = self.nearest(q + rng.uniform(-reach, reach, q.shape))
            if closed.is_closed:
                yield closed.q

    def faces(self, q: Vector) -> bool:
        """Whether no axis of a closing joint is opposed at q (nq,)."""
        return bool(np.all(self._functions().facing(q, self.p)[0] > 0))

    def gap(self, q: Vector) -> str:
        """Which joint stays open most at q, in words and figures."""
        units = [(name, unit) for name, _, unit in position_rows(self.system)]
        gaps: dict[str, list[float]] = {}
        for (name, unit), value in zip(units, self.rows(q)[0], strict=False):
            gap = gaps.setdefault(name, [0.0, 0.0])
            kind = 0 if unit == "m" else 1
            gap[kind] = float(np.hypot(gap[kind], value))
        name = max(gaps, key=lambda loop: max(gaps[loop]))
        distance, other = gaps[name]
        return f"{name} open by {distance:.3g} m and {other:.3g} in direction cosines"

    def locked_positions(self, q: Vector) -> str:
        """The locked positions at q in words; empty when none is locked."""
        names = [coordinate.name for coordinate in self.system.coordinates]
        return ", ".join(f"{names[k]} = {q[k]:.4g}" for k in self.locked)

    def _functions(self) -> ClosingFunctions:
        functions: ClosingFunctions = self.system.cached("closing", lambda: _functions(self.system))
        return functions


class ClosingFunctions(NamedTuple):
    """What is computed of the closure of a system.

    Attributes:
        equations: ``(q, p) -> r, J``: all rows, and their derivative by q.
        elements: ``(q, p) -> r, e``: of the derivative the elements that need not be zero.
        places: their rows and columns.
        values: ``(q, p) -> r`` alone.
        facing: ``(q, p)``, positive where no axis is opposed.
        sizes: ``(p)``, the size of the mechanism and what each row is measured by.
        newton: the rows, to be solved in machine code.
    """

    equations: OnArrays
    elements: OnArrays
    places: NDArray[np.int64]
    values: OnArrays
    facing: OnArrays
    sizes: OnArrays
    newton: NewtonEquations


def closure_parameters(system: System, values: Mapping[str, float] | None = None) -> Vector:
    """Values of the parameters; NaN for one without value that has no part in the closure.

    Raises:
        ModelError: a name is unknown, or a symbol of the closure has no value.
    """

    def names() -> set[str]:
        rows = closure_rows(system, SX.sym("q", system.nq))
        return {symbol.name() for symbol in casadi.symvar(rows)}

    needed: set[str] = system.cached("closure parameters", names)
    return np.array(system.parameter_values(values, needed), dtype=float)


def _functions(system: System) -> ClosingFunctions:
    q = SX.sym("q", system.nq)
    r = casadi.densify(casadi.vertcat(closure_rows(system, q), norm_rows(system.tree, q)))
    norms = norm_rows(system.tree, q)
    sizes = casadi.vertcat(row_sizes(system), SX.ones(norms.shape))
    J = casadi.jacobian(r, q)

    def arrays(name: str, inputs: list[SX], outputs: list[SX]) -> OnArrays:
        return on_arrays(Function(name, inputs, outputs))

    equations = Function("equations", [q, system.p], [r, J])
    values = Function("values", [q, system.p], [r])
    return ClosingFunctions(
        equations=on_arrays(equations),
        elements=arrays("elements", [q, system.p], [r, casadi.densify(J.nz[:])]),
        places=np.array(J.sparsity().get_triplet(), dtype=np.int64).reshape(2, -1),
        values=on_arrays(values),
        facing=arrays("facing", [q, system.p], [facing(system, q)]),
        sizes=arrays("sizes", [system.p], [mechanism_size(system), sizes]),
        newton=NewtonEquations(equations, values),
    )


def _replace(q: Vector, indices: Sequence[int], values: Vector) -> Vector:
    result = q.copy()
    result[list(indices)] = values
    return result


# When two configurations are the same: up to whole turns, and to the sign of quaternions.


def difference(system: System, q: Vector, other: Vector) -> Vector:
    """(nq,) difference of two configurations: angles up to whole turns, quaternions up to sign."""
    gap = within_half_turn(system, q - other)
    for part in quaternion_slices(system.tree):
        opposite = q[part] + other[part]
        gap[part] = min(q[part] - other[part], opposite, key=lambda x: float(np.abs(x).max()))
    return gap


def within_half_turn(system: System, q: Vector) -> Vector:
    """(nq,) the positions, or differences of them, with angles within half a turn of zero."""
    turned = np.array(q, dtype=float)
    turns = [coordinate.unit == "rad" for coordinate in system.coordinates]
    turned[turns] = np.remainder(turned[turns] + np.pi, 2 * np.pi) - np.pi
    return turned


# Moving a closed configuration along a line in small steps, so that it stays on its branch.


_LARGEST_STEP = 0.2
"""Of a locked position in one step [rad or m]."""
LARGEST_MOVE = 0.3
"""Of any other position from where its slope led; more may be another branch [rad or m]."""
_LONGEST_LINE = 400.0
"""Of a locked position, in all [rad or m]."""
_SMALLEST_PART = 1e-4
"""Of the whole line, below which it is said to end."""


def follow_configuration(
    system: System, target: Vector, locked: tuple[int, ...], p: Vector
) -> Vector:
    """The configuration reached from the assembled one while locked positions, and p, move.

    Args:
        system: with loops; its configuration is where the line starts.
        target: (nq,) of which the locked positions count.
        locked: indices in q.
        p: (np,) values of the parameters at the end of the line.

    Returns:
        q (nq,), its locked positions equal to the target's.

    Raises:
        Unclosable: the line leaves what this branch can reach; the message says where.
    """
    start, p_start = np.array(system.configuration), closure_parameters(system)
    indices, free = list(locked), [k for k in range(system.nq) if k not in locked]
    change = target[indices] - start[indices]
    length = float(np.max(np.abs(change), initial=0.0))
    if length > _LONGEST_LINE:
        raise Unclosable(
            f"{system.name}: a position is {length:.3g} rad or m away from the assembled"
            " configuration;"
            f" give one less than {_LONGEST_LINE:g} away"
        )
    largest = _LARGEST_STEP / length if length > _LARGEST_STEP else 1.0
    q, slope, done, part = start, np.zeros(len(free)), 0.0, largest
    while done < 1.0:
        to = min(1.0, done + part)
        trial = q.copy()
        trial[indices] = target[indices] if to == 1.0 else start[indices] + to * change
        trial[free] += (to - done) * slope
        closing = Closing(system, p if to == 1.0 else p_start + to * (p - p_start), locked)
        found = closing.nearest(trial)
        if found.is_closed and np.max(np.abs(found.q - trial), initial=0.0) < LARGEST_MOVE:
            slope = (found.q[free] - q[free]) / (to - done)
            q, done, part = found.q, to, min(2 * part, largest)
        else:
            part, slope = part / 2, slope if part > 8 * _SMALLEST_PART else np.zeros(len(free))
            if part < _SMALLEST_PART:
                raise Unclosable(
                    f"{system.name}: {closing.locked_positions(target) or 'the configuration'}"
                    " cannot be reached from the assembled configuration, whose branch ends near"
                    f" {closing.locked_positions(q) or 'it'}; give a guess of other joints to"
                    " choose another branch, or other positions"
                )
    return q
