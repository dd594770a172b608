"""Numeric closure of loops: residuals, nearest closed configuration, continuation, row scales."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import NamedTuple

import casadi
import numpy as np
from casadi import SX, Function
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.assembly.tables import Coordinate
from mbs.assembly.tree import norm_rows, quaternion_slices
from mbs.errors import Unclosable
from mbs.loops.closure_equations import closure_rows, facing, position_rows, velocity_row_units
from mbs.loops.cut_positions import cut_positions
from mbs.numbers import OnArrays, on_arrays
from mbs.solvers.least_squares import MANY, NewtonEquations

# Units of closure rows: the size of the mechanism for lengths, 1 for cosines.
#
# The opening of a loop has no meaning without a size: 1e-6 m is negligible for a crane, and 1 % of
# a link of 100 um.


_ROUNDING = 1e-9
"""Length [m] below which moment arms are rounding: 1e-12 of a mechanism of 1 km."""
_SAMPLES, _SEED = 3, 20260201
"""Number of configurations at which moment arms are evaluated, with the zero configuration as the
first, and seed of the random numbers."""


def mechanism_size(system: System) -> SX:
    """Return the size of a mechanism [m], the unit of lengths in its closure rows.

    It is the longest moment arm of an angle on the closure rows, or the largest closure distance.
    The configurations of this evaluation are fixed and in general open, so that the size is known
    before a loop is closed. It is 1 m if the mechanism has no length.

    Args:
        system: mechanism with loops.

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
        # moment arms about the centre of a sphere are zero, up to rounding
        return SX(casadi.if_else(size > _ROUNDING, size, 1))

    size: SX = system.cached("mechanism size", build)
    return size


def row_sizes(system: System) -> SX:
    """Return the unit of each closure row, (m, 1), as an expression of p.

    It is the size of the mechanism [m] for a length, and 1 for a cosine.

    Args:
        system: mechanism with loops.
    """
    size = mechanism_size(system)
    return casadi.vertcat(SX(0, 1), *(size if own else SX(1) for own in _lengths(system)))


def distance_units(units: Iterable[str], size: float) -> Vector:
    """Return divisors (n,) of position differences: 1, or for lengths the mechanism's size [m].

    Args:
        units: units of the positions.
        size: size of the mechanism [m].
    """
    return np.array([size if unit.startswith("m") else 1.0 for unit in units])


def constraint_sizes(system: System) -> SX:
    """Return the unit of each constraint row, (m, 1), as an expression of p.

    Closure rows come first, then velocity rows. The unit is the size of the mechanism [m] for
    lengths, else 1.

    Args:
        system: mechanism with loops.
    """
    slips = velocity_row_units(system)
    size = mechanism_size(system)
    return casadi.vertcat(row_sizes(system), *(size if u == "m" else SX(1) for u in slips))


def relative_rows(system: System, q: SX) -> SX:
    """Return dimensionless closure rows, then quaternion norm rows, (m + k, 1).

    Args:
        system: mechanism with loops.
        q: (nq, 1) positions.
    """
    return casadi.vertcat(closure_rows(system, q) / row_sizes(system), norm_rows(system.tree, q))


def _lengths(system: System) -> list[bool]:
    """Return a list with True for each closure row that is a length, False for a cosine."""
    return [unit == "m" for *_, unit in position_rows(system)]


def _configurations(system: System) -> list[list[float]]:
    """Return the configurations (nq,) at which moment arms are evaluated: zero, then random angles.

    Prismatic displacements are zero and quaternions are 1 in all of them.
    """
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
"""Largest closure row at the end of an iteration, in sizes of the mechanism: rounding of sums of
some tens of terms of size one is below it; the error before the last Newton step, 1e-8 or more, is
not."""

CLOSED = 1e-10
"""Largest row of a closed configuration from formulas or other sources, in sizes of the mechanism:
it allows hundreds of rounding errors, but no missing iteration step."""

_DEPENDENT = 1e-9
"""Relative singular value below which a row of the loops is redundant."""

OPEN = 1e-6
"""Largest row of a closed configuration from the user, in sizes of the mechanism: seven digits.
Forces have errors of the same relative size."""


_KEPT = 8
"""Number of parameter sets whose row units are cached: continuation visits about as many."""


@dataclass(frozen=True, slots=True, eq=False)
class Closed:
    """Result of an attempt to close the loops.

    Attributes:
        q: (nq,) positions.
        residual: Euclidean norm of all rows at q.
        is_closed: whether every row is closed and no axis is opposed.
    """

    q: Vector
    residual: float
    is_closed: bool


@dataclass(frozen=True, slots=True, eq=False)
class Closing:
    """Closure rows and quaternion norms of a system, with some positions locked.

    Attributes:
        system: mechanism with loops, with or without their analysis.
        p: (np,) values of the parameters.
        locked: indices in q of positions that must not change.
        kept: indices of the rows that count; None for all rows.
        axes: indices of the facing cosines that count; None for all.
        aims: indices in `system.cut_coordinates` of positions with a required value. Each adds a
            row.
        cut: (c,) values of `system.cut_coordinates`. Only the values of the aims count.
    """

    system: System
    p: Vector
    locked: tuple[int, ...] = ()
    kept: tuple[int, ...] | None = None
    axes: tuple[int, ...] | None = None
    aims: tuple[int, ...] = ()
    cut: Vector | None = None

    @property
    def free(self) -> list[int]:
        """Indices in q of the positions that may change."""
        locked = set(self.locked)
        return [k for k in range(self.system.nq) if k not in locked]

    def rows(self, q: Vector) -> tuple[Vector, Vector]:
        """Return the residual (m,) and its derivative by the free positions (m, n).

        Args:
            q: (nq,) positions.
        """
        r, J = self._functions().equations(q, self._given)
        if self.kept is not None:
            r, J = r[list(self.kept)], J[list(self.kept)]
        return r.ravel(), J[:, self.free] if self.locked else J

    @property
    def size(self) -> float:
        """Size of the mechanism [m]."""
        return float(self._sizes[0][0, 0])

    @property
    def sizes(self) -> Vector:
        """Divisors (m,) that make the rows dimensionless: mechanism size [m] for lengths, or 1."""
        sizes = self._sizes[1].ravel()
        return sizes if self.kept is None else sizes[list(self.kept)]

    @property
    def position_units(self) -> Vector:
        """(nq,) divisors of differences of positions: 1 for angles, else the size [m]."""
        return distance_units((row.unit for row in self.system.coordinates), self.size)

    @property
    def _sizes(self) -> list[Vector]:
        """Size of the mechanism and units of the rows, cached for the last values of p."""

        def build() -> list[Vector]:
            return self._functions().sizes(self._given)

        key = self.p.tobytes(), self.aims
        found: list[Vector] = self.system.memoised("closing sizes", key, build, _KEPT)
        return found

    def openness(self, q: Vector) -> float:
        """Return the largest closure error, in sizes of the mechanism.

        Args:
            q: (nq,) positions.
        """
        return float(np.max(np.abs(self.rows(q)[0]) / self.sizes, initial=0.0))

    def nearest(self, q: Vector) -> Closed:
        """Return the result of Gauss-Newton, which changes the free positions to close the loops.

        Args:
            q: (nq,) start. Its locked positions are kept.
        """
        tolerance = TOLERANCE * self.sizes
        found, root = self._newton().near(q, self._given, self.free, tolerance)
        return Closed(found, root.residual, root.converged and self.faces(found))

    def polished(self, q: Vector, steps: int) -> Vector:
        """Return a configuration closed to rounding, by minimum-norm Newton steps.

        `nearest` ends at `TOLERANCE`, above the rounding of the rows.

        Args:
            q: (nq,) nearly closed configuration.
            steps: number of Newton steps.
        """
        found, free = np.array(q, dtype=float), self.free
        for _ in range(steps):
            r, J = self.rows(found)
            if r.size:
                sizes = self.sizes
                move = np.linalg.lstsq(J / sizes[:, None], r / sizes, rcond=_DEPENDENT)[0]
                found[free] -= move
        return found

    def nearby(self, q: Vector, reach: float, tries: int, seed: int) -> Iterator[Vector]:
        """Yield closed configurations that Gauss-Newton reaches from random starts around q (nq,).

        Args:
            q: centre of the starts.
            reach: largest difference of a position at the start [rad or m].
            tries: largest number of starts.
            seed: seed of the random numbers.
        """
        rng = np.random.default_rng(seed)
        for _ in range(tries):
            closed = self.nearest(q + rng.uniform(-reach, reach, q.shape))
            if closed.is_closed:
                yield closed.q

    def acting(self, *, norms: bool) -> NDArray[np.bool_]:
        """Return a mask (nq,) of the positions on which a closure row depends.

        Args:
            norms: whether the unit-norm rows of quaternions, which are no loops, count too.
        """
        acting = np.zeros(self.system.nq, dtype=bool)
        rows, columns = self._functions().places
        acting[columns if norms else columns[rows < len(position_rows(self.system))]] = True
        return acting

    def faces(self, q: Vector) -> bool:
        """Whether no axis of a closing joint points the opposite way.

        Args:
            q: (nq,) positions.
        """
        cosines = self._functions().facing(q, self._given)[0]
        return bool(np.all((cosines if self.axes is None else cosines[list(self.axes)]) > 0))

    def gap(self, q: Vector) -> str:
        """Return text on the joint with the largest closure error, and the error.

        Args:
            q: (nq,) positions.
        """
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
        """Return names and values of the locked positions as text; empty if no position is locked.

        Args:
            q: (nq,) positions.
        """
        names = [coordinate.name for coordinate in self.system.coordinates]
        return ", ".join(f"{names[k]} = {q[k]:.4g}" for k in self.locked)

    def _newton(self) -> NewtonEquations:
        """Return the closure rows as equations for the free positions; rows `kept` only, if set."""
        kept = self.kept
        if kept is None:
            return self._functions().newton

        def build() -> NewtonEquations:
            return _equations_of(self.system, self.aims, kept)

        found: NewtonEquations = self.system.cached(("closing rows", self.aims, kept), build)
        return found

    def _functions(self) -> ClosingFunctions:
        """Return the compiled functions of the closure, cached in the system."""
        functions: ClosingFunctions = self.system.cached(
            ("closing", self.aims), lambda: _functions(self.system, self.aims)
        )
        return functions

    @property
    def _given(self) -> Vector:
        """Second argument of compiled functions: parameters, then targets of cut joints."""
        return self.p if self.cut is None or not self.aims else np.concatenate([self.p, self.cut])


class ClosingFunctions(NamedTuple):
    """Compiled functions of the closure of a system.

    Attributes:
        equations: ``(q, p) -> r, J``: all rows, then position errors of cut joints that have aims;
            derivative of the rows by q.
        places: row and column indices of the structurally nonzero elements of J.
        facing: ``(q, p) -> c``: cosines, positive if no axis is opposed.
        sizes: ``(p) -> s, u``: size of the mechanism, and unit of each row.
        newton: all rows, as equations for the free positions.
    """

    equations: OnArrays
    places: NDArray[np.int64]
    facing: OnArrays
    sizes: OnArrays
    newton: NewtonEquations


def closure_parameters(system: System, values: Mapping[str, float] | None = None) -> Vector:
    """Return values (np,) of the parameters; NaN for one without value on which no loop depends.

    Args:
        system: mechanism with or without loops.
        values: values by name; others are default values.

    Raises:
        ModelError: a name is unknown, or a parameter of the closure has no value.
    """

    def names() -> set[str]:
        rows = closure_rows(system, SX.sym("q", system.nq))
        return {symbol.name() for symbol in casadi.symvar(rows)}

    needed: set[str] = system.cached("closure parameters", names)
    return np.array(system.parameter_values(values, needed), dtype=float)


def _symbolic_rows(system: System, aims: tuple[int, ...]) -> tuple[SX, SX, SX, SX]:
    """Return symbols q, symbols p with targets of cut joints, all closure rows, and row units.

    Args:
        system: mechanism with loops.
        aims: indices of cut-joint coordinates with a target. Each adds one row.
    """
    q, p = SX.sym("q", system.nq), system.p
    norms = norm_rows(system.tree, q)
    sizes = casadi.vertcat(row_sizes(system), SX.ones(norms.shape))
    more = SX(0, 1)
    if aims:
        target = SX.sym("c", len(system.cut_coordinates))
        p = casadi.vertcat(p, target)
        more = _cut_moves(system, q, target)[list(aims)]
        lengths = [system.cut_coordinates[k].unit.startswith("m") for k in aims]
        own = (mechanism_size(system) if is_length else SX(1) for is_length in lengths)
        sizes = casadi.vertcat(sizes, *own)
    return q, p, casadi.densify(casadi.vertcat(closure_rows(system, q), norms, more)), sizes


def _equations_of(system: System, aims: tuple[int, ...], kept: Sequence[int]) -> NewtonEquations:
    """Return the closure rows with indices `kept` as equations for the positions."""
    q, p, r, _ = _symbolic_rows(system, aims)
    r = r[list(kept)]
    equations = Function("equations", [q, p], [r, casadi.jacobian(r, q)])
    return NewtonEquations(equations, Function("values", [q, p], [r]))


def _functions(system: System, aims: tuple[int, ...]) -> ClosingFunctions:
    """Return the compiled closure functions, with one row for each cut-joint target `aims`."""
    q, p, r, sizes = _symbolic_rows(system, aims)
    J = casadi.jacobian(r, q)

    def arrays(name: str, inputs: list[SX], outputs: list[SX]) -> OnArrays:
        return on_arrays(Function(name, inputs, outputs))

    equations = Function("equations", [q, p], [r, J])
    return ClosingFunctions(
        equations=on_arrays(equations),
        places=np.array(J.sparsity().get_triplet(), dtype=np.int64).reshape(2, -1),
        facing=arrays("facing", [q, p], [facing(system, q)]),
        sizes=arrays("sizes", [p], [mechanism_size(system), sizes]),
        newton=NewtonEquations(equations, Function("values", [q, p], [r])),
    )


def _cut_moves(system: System, q: SX, target: SX) -> SX:
    """Return differences (c, 1) of cut-joint positions from a target (c, 1).

    Angles are within half a rotation of zero, and quaternions are compared up to their sign.
    """
    found, rows = cut_positions(system)(q, system.p), system.cut_coordinates
    for first in [k for k, row in enumerate(rows) if row.kind == "quaternion"][::4]:
        part = slice(first, first + 4)
        found[part] *= casadi.if_else(casadi.dot(found[part], target[part]) < 0, -1, 1)
    moves = found - target
    for k, row in enumerate(rows):
        if row.unit == "rad":
            moves[k] -= 2 * casadi.pi * casadi.floor(moves[k] / (2 * casadi.pi) + 0.5)
    return moves


def _replace(q: Vector, indices: Sequence[int], values: Vector) -> Vector:
    """Return a copy of q with `values` at `indices`."""
    result = q.copy()
    result[list(indices)] = values
    return result


# Equality of two configurations: up to full rotations, and up to the sign of quaternions.


def difference(system: System, q: Vector, other: Vector) -> Vector:
    """Return the difference q - other of two configurations (nq,).

    Angles are within half a rotation of zero, and quaternions have the nearer sign.

    Args:
        system: mechanism with these coordinates.
        q: (nq,) first configuration.
        other: (nq,) second configuration.
    """
    return row_difference(system.coordinates, q, other)


def row_difference(rows: Sequence[Coordinate], q: Vector, other: Vector) -> Vector:
    """Return the difference q - other (n,) of the positions of any coordinates.

    Angles are within half a rotation of zero, and quaternions have the nearer sign.

    Args:
        rows: the n coordinates.
        q: (n,) first positions.
        other: (n,) second positions.
    """
    gap = _within_half_turn(rows, q - other)
    for first in [k for k, row in enumerate(rows) if row.kind == "quaternion"][::4]:
        part = slice(first, first + 4)
        opposite = q[part] + other[part]
        gap[part] = min(q[part] - other[part], opposite, key=lambda x: float(np.abs(x).max()))
    return gap


def within_half_turn(system: System, q: Vector) -> Vector:
    """Return positions (nq,), or their differences, with angles within half a rotation of zero.

    Args:
        system: mechanism with these coordinates.
        q: (nq,) positions.
    """
    return _within_half_turn(system.coordinates, q)


def _within_half_turn(rows: Sequence[Coordinate], q: Vector) -> Vector:
    """Return the values q (n,) of the coordinates `rows`, with angles within [-pi, pi]."""
    turned = np.array(q, dtype=float)
    turns = np.array([row.unit == "rad" for row in rows], dtype=bool)
    turned[turns] = np.remainder(turned[turns] + np.pi, 2 * np.pi) - np.pi
    turned[turns & (turned < _HALF_TURN - np.pi)] += 2 * np.pi  # no sign from rounding
    return turned


# Continuation of a closed configuration on the constraint manifold.


_LARGEST_STEP = 0.5
"""Largest change of a locked position in one step [rad, or sizes of the mechanism]."""
LARGEST_MOVE = 0.3
"""Largest distance of a free position from its prediction [rad, or sizes of the mechanism]: a
larger distance may mean another branch."""
_CURVED = 0.002
"""Largest difference between a step and the mean of the slopes at its two ends, relative to the
largest change in the step: smooth branches give 1e-4 to 1e-3, a change of branch gives about 1."""
_CROSSING = 1e-3
"""Longest step through a configuration at which the determinant of the loops changes its sign
[rad or sizes]: a branch that continues is smooth at this length, a branch that turns is not."""
_OFFSET = 1e-7
"""Change of locked positions for a finite-difference slope [rad or sizes]: closed configurations
are accurate to 1e-12, so that a slope is accurate to 1e-5."""
_POLISHINGS = 2
"""Newton steps that make a configuration accurate to rounding: it is closed to 1e-12 before."""
_STEEP = 1e4
"""Slope above which the locked positions do not determine the free ones: the branch turns."""
_LONGEST_LINE = 400.0
"""Largest change of a locked position in total [rad or m]: about sixty revolutions."""
_SMALLEST_STEP = 1e-6
"""Shortest step [rad or sizes]: ten times the offset of slopes."""
_SINGULAR = 1e-7
"""Relative singular value below which a configuration is singular and has no slope: rounding leaves
1e-8 of a value that vanishes with the square root, regular mechanisms have 1e-4 or more."""
_BEFORE_END = 1e-3
"""Distance between the configurations from which a singular end is extrapolated [rad or sizes]:
rounding is 1e-13 there, and the fifth power of the distance is below it."""
_EXTRAPOLATION = np.array([5.0, -10.0, 10.0, -5.0, 1.0])
"""Weights of five equidistant configurations that extrapolate the next one to the fourth order."""
_ROOT_OF_ROUNDING = 1e-6
"""Largest correction of a singular end [rad or sizes]: closing rows determine it to 1e-9 to
1e-7."""
_CANDIDATES, _TRIES = 6, 60
"""Largest number of configurations in an error message, and number of starts of their search."""
_REACHES = 1.0, 0.3
"""Fractions of half a rotation, and of the size, for alternating ranges of random starts."""


@dataclass(frozen=True, slots=True, eq=False)
class _Line:
    """Straight path of the locked positions and of the parameters during a continuation.

    The path is a function of its arc length s.

    Attributes:
        system: mechanism with loops.
        locked: indices in q of the locked positions.
        ends: (nq,) configurations at the start and at the end. Only locked positions count.
        parameters: (np,) values at the start and at the end.
        length: length of the line [rad or sizes of the mechanism].
        scales: (nq,) unit of each position: 1 rad, or the size of the mechanism [m].
    """

    system: System
    locked: tuple[int, ...]
    ends: tuple[Vector, Vector]
    parameters: tuple[Vector, Vector]
    length: float
    scales: Vector

    def closing(self, s: float) -> Closing:
        """Return the closure rows with the parameters at arc length s of the path."""
        first, last = self.parameters
        p = last if s == self.length else first + s / self.length * (last - first)
        return Closing(self.system, p, self.locked)

    def placed(self, q: Vector, s: float) -> Vector:
        """Return configuration q (nq,) with its locked positions at arc length s of the path."""
        (first, last), indices = self.ends, list(self.locked)
        if s == self.length:
            at = last
        else:
            at = first + s / self.length * (last - first)
            for turn in quaternion_slices(self.system.tree):
                if turn.start in self.locked:
                    at[turn] /= np.linalg.norm(at[turn])
        return _replace(q, indices, at[indices])

    def slope(self, q: Vector, s: float) -> Vector | None:
        """Return the tangent dq/ds (nq,) at a closed q, path length s; None at a turning point."""
        if 0 < len(self.closing(s).free) < MANY:
            return self._exact_slope(q, s)
        ahead = s + _OFFSET if s + _OFFSET <= self.length else s - _OFFSET
        near = self.closing(ahead).nearest(self.placed(q, ahead))
        if not near.is_closed:
            return None
        slope: Vector = (near.q - q) / (ahead - s)
        return slope if np.max(np.abs(slope / self.scales), initial=0.0) < _STEEP else None

    def _exact_slope(self, q: Vector, s: float) -> Vector | None:
        """Return the tangent dq/ds (nq,) at a closed q, arc length s, from derivatives of the rows.

        It is accurate near singular branches. None if q is singular or the slope too steep.
        """
        low, high = max(s - _OFFSET, 0.0), min(s + _OFFSET, self.length)
        before, after = self.placed(q, low), self.placed(q, high)
        rows = replace(self.closing(s), locked=()).rows(q)[1] @ (after - before)
        if not np.array_equal(*self.parameters):
            rows += self.closing(high).rows(q)[0] - self.closing(low).rows(q)[0]
        move = self._shortest(q, s, -rows)
        if move is None:
            return None
        slope: Vector = (after - before + move) / (high - low)
        return slope if np.max(np.abs(slope / self.scales), initial=0.0) < _STEEP else None

    def _shortest(self, q: Vector, s: float, rows: Vector) -> Vector | None:
        """Return the smallest change (nq,) of free positions that changes the rows by `rows` (m,).

        q is closed at arc length s. None if the closure is singular there.
        """
        closing = self.closing(s)
        scales = self.scales[closing.free]
        J = closing.rows(q)[1] / closing.sizes[:, None] * scales
        U, values, V = np.linalg.svd(J, full_matrices=False)
        rank = self._rank(len(J), len(values))
        if not rank or values[rank - 1] <= _SINGULAR * values[0]:
            return None
        parts = (U.T @ (rows / closing.sizes))[:rank] / values[:rank]
        move = np.zeros(self.system.nq)
        move[closing.free] = scales * (V[:rank].T @ parts)
        return move

    def _rank(self, rows: int, most: int) -> int:
        """Return the rank that the closure rows have at regular configurations.

        Args:
            rows: number of all rows, with those of quaternion norms last.
            most: number of singular values, an upper limit.
        """
        closure = self.system.closure
        return (
            most if closure is None else min(len(closure.rows) + len(self._free_norms(rows)), most)
        )

    def polished(self, q: Vector) -> Vector:
        """Return the end configuration, polished to rounding if the loops are nearly singular."""
        closing = self.closing(self.length)
        if not 0 < len(closing.free) < MANY:
            return q
        for _ in range(_POLISHINGS):
            move = self._shortest(q, self.length, -closing.rows(q)[0])
            if move is None or np.max(np.abs(move / self.scales)) > _ROOT_OF_ROUNDING:
                return q
            q = q + move
        return q

    def side(self, q: Vector, s: float) -> float:
        """Return the sign of det of the closure Jacobian by free positions at q, arc length s.

        It is 0 if the Jacobian is not square. The sign changes if a continuation passes a singular
        configuration.
        """
        closure, closing = self.system.closure, self.closing(s)
        free = closing.free
        if closure is None or closure.varies or not 0 < len(free) < MANY:
            return 0.0
        J = closing.rows(q)[1]
        kept = [*closure.rows, *self._free_norms(len(J))]
        return float(np.linalg.slogdet(J[kept])[0]) if len(kept) == len(free) else 0.0

    def _free_norms(self, count: int) -> list[int]:
        """Return indices of the quaternion norm rows of quaternions that are not entirely locked.

        Args:
            count: number of all rows, norm rows last.
        """
        parts = [range(turn.start, turn.stop) for turn in quaternion_slices(self.system.tree)]
        first, locked = count - len(parts), set(self.locked)
        return [first + k for k, part in enumerate(parts) if not locked >= set(part)]

    def is_singular(self, q: Vector, s: float) -> bool:
        """Whether the free positions at q, path length s, are undetermined to first order."""
        closing = self.closing(s)
        if not 0 < len(closing.free) < MANY:
            return False
        J = closing.rows(q)[1] / closing.sizes[:, None] * self.scales[closing.free]
        values = np.linalg.svd(J, compute_uv=False)
        rank = self._rank(len(J), len(values))
        return bool(rank and values[rank - 1] <= _SINGULAR * values[0])


def follow_configuration(
    system: System,
    target: Vector,
    locked: tuple[int, ...],
    p: Vector,
    origin: tuple[Vector, Vector] | None = None,
) -> Vector:
    """Return the configuration that is reached while locked positions, and p, move to a target.

    Locked positions move on a straight line. The free ones follow on the constraint manifold. A
    step is accepted if it agrees with the slopes at both its ends, which excludes jumps to another
    branch. At a crossing with another branch, the branch continues straight. If the branch does not
    reach the target, but the loops are closed there with the free positions of the start, these
    positions are returned.

    Source: Allgower and Georg 1990, chapters 2 and 8, for prediction, correction and crossings.

    Args:
        system: mechanism with loops.
        target: (nq,) configuration. Only the locked positions count.
        locked: indices in q of the locked positions.
        p: (np,) values of the parameters at the end of the line.
        origin: closed configuration at which the line starts, and the parameters there. The default
            is the assembled configuration with default parameters.

    Returns:
        q (nq,), its locked positions equal to the target's.

    Raises:
        Unclosable: the branch turns or the start is singular; the message lists the configurations
            with the required positions.
    """
    start, p_start = origin or (np.array(system.configuration), closure_parameters(system))
    start, whole = _with_whole_quaternions(system, start, target, locked)
    if whole != locked:
        with suppress(Unclosable):
            return follow_configuration(system, target, whole, p, (start, p_start))
    line = _line(system, (start, target), locked, (p_start, p))
    try:
        return _end_of_branch(line, start)
    except Unclosable:
        unchanged, closing = line.placed(start, line.length), line.closing(line.length)
        if closing.openness(unchanged) <= OPEN and closing.faces(unchanged):
            return unchanged
        raise


def _end_of_branch(line: _Line, start: Vector) -> Vector:
    """Return the configuration (nq,) at the end of a path, by continuation from the closed `start`.

    Raises:
        Unclosable: the branch turns or the start is singular.
    """
    if line.length <= _SMALLEST_STEP:
        found = line.closing(line.length).nearest(line.placed(start, line.length))
        moves = (np.abs(found.q - start) / line.scales)[line.closing(0.0).free]
        if found.is_closed and np.max(moves, initial=0.0) < LARGEST_MOVE:
            return found.q
        raise Unclosable(_ended(line, start, line.length, "ends"))
    q = line.placed(start, 0.0)
    slope = None if line.is_singular(q, 0.0) else line.slope(q, 0.0)
    if slope is None:
        raise Unclosable(_ended(line, q, 0.0, "meets others"))
    side, s, step = line.side(q, 0.0), 0.0, min(_LARGEST_STEP, line.length)
    while s < line.length:
        # a remaining part below 1 % of a step belongs to this step
        to = line.length if s + 1.01 * step >= line.length else s + step
        reached = _step(line, (q, slope, side), s, to)
        if reached is not None:
            (q, slope, side), s, step = reached, to, min(2 * (to - s), _LARGEST_STEP)
            continue
        step = (to - s) / 2
        if step < _SMALLEST_STEP:
            raise Unclosable(_ended(line, q, s, "ends"))
    return _singular_end(line, q) if line.is_singular(q, line.length) else line.polished(q)


def _singular_end(line: _Line, q: Vector) -> Vector:
    """Return a more accurate singular configuration (nq,) at the end of a path.

    It is extrapolated from five closed configurations before the end, since closure rows determine
    a singular configuration to the square root of rounding only. q is returned if this fails.
    """
    points = list[Vector]()
    for s in line.length - _BEFORE_END * np.arange(1, len(_EXTRAPOLATION) + 1):
        if s <= 0:
            return q
        near = line.closing(float(s)).nearest(line.placed(q, float(s)))
        if not near.is_closed:
            return q
        points.append(near.q)
    end = line.placed(q + _EXTRAPOLATION @ (np.array(points) - q), line.length)
    is_near = np.max(np.abs(end - q) / line.scales) < _ROOT_OF_ROUNDING
    return end if is_near and line.closing(line.length).openness(end) <= CLOSED else q


def _with_whole_quaternions(
    system: System, start: Vector, target: Vector, locked: tuple[int, ...]
) -> tuple[Vector, tuple[int, ...]]:
    """Return the start with quaternion signs nearest to the target, and the locked positions.

    A quaternion is locked as a whole if some of its elements are locked and the target has unit
    length: the norm changes along a line of single elements.
    """
    first, whole = start.copy(), set(locked)
    for turn in quaternion_slices(system.tree):
        indices = set(range(turn.start, turn.stop))
        if indices & whole and abs(np.linalg.norm(target[turn]) - 1) < OPEN:
            whole |= indices
            first[turn] *= 1.0 if start[turn] @ target[turn] >= 0 else -1.0
    return first, tuple(sorted(whole))


def _line(
    system: System,
    ends: tuple[Vector, Vector],
    locked: tuple[int, ...],
    parameters: tuple[Vector, Vector],
) -> _Line:
    """Return the straight path of locked positions and parameters between two configurations.

    Positions on which no loop depends have their final value from the start.

    Raises:
        Unclosable: the line is too long.

    Args:
        system: mechanism with loops.
        ends: (nq,) configurations at the start and at the end.
        locked: indices in q of the positions that move on the path.
        parameters: (np,) parameters at the start and at the end.
    """
    closing = Closing(system, parameters[1])
    size = closing.size
    lengths = np.array([c.unit.startswith("m") for c in system.coordinates])
    scales = np.where(lengths, size, 1.0)
    acting = closing.acting(norms=True)
    first = np.where(acting, ends[0], ends[1])
    change = np.zeros(system.nq)
    change[list(locked)] = np.abs(ends[1] - first)[list(locked)]
    longest = float(np.max(np.minimum(change, change / scales), initial=0.0))
    if longest > _LONGEST_LINE:
        raise Unclosable(
            f"{system.name}: a position is {longest:.3g} rad or m away from the assembled"
            f" configuration; give one less than {_LONGEST_LINE:g} away"
        )
    length = float(np.max(change / scales, initial=0.0))
    if not np.array_equal(*parameters):
        largest = np.maximum(np.abs(parameters[0]), np.abs(parameters[1]))
        moved = np.abs(parameters[1] - parameters[0])[largest > 0] / largest[largest > 0]
        length = max(length, float(np.nanmax(moved, initial=0.0)))
    return _Line(system, locked, (first, ends[1]), parameters, length, scales)


_Point = tuple[Vector, Vector, float]
"""Closed configuration (nq,), tangent dq/ds (nq,), and sign of the determinant of the closure
Jacobian by free positions."""


def _step(line: _Line, point: _Point, s: float, to: float) -> _Point | None:
    """Return the point after a continuation step from s to `to`; None if it may leave the branch.

    Args:
        line: path of the continuation.
        point: closed configuration at s, its tangent dq/ds, and the sign of the determinant.
        s: path position at the start of the step.
        to: path position at the end of the step.
    """
    (q, slope, side), h = point, to - s
    predicted = line.placed(q + h * slope, to)
    found = line.closing(to).nearest(predicted)
    if not found.is_closed:
        return None
    if np.max(np.abs(found.q - predicted) / line.scales, initial=0.0) >= LARGEST_MOVE:
        return None
    after = line.slope(found.q, to)
    is_last = to == line.length
    if after is None:
        # the target may be a configuration at which the branch turns or crosses
        near = np.max(np.abs(found.q - predicted) / line.scales, initial=0.0)
        return (found.q, slope, side) if is_last and near < _CURVED * h else None
    missed = np.abs(found.q - q - h / 2 * (slope + after)) / line.scales
    change = np.max(np.abs(found.q - q) / line.scales)
    if np.max(missed[line.closing(to).free], initial=0.0) > _CURVED * max(h, change):
        return None
    now = line.side(found.q, to)
    if now * side < 0 and h > _CROSSING:
        return None
    return found.q, after, now


def _ended(line: _Line, q: Vector, s: float, what: str) -> str:
    """Return the error message for a continuation that cannot reach its target.

    Args:
        line: path of the continuation.
        q: (nq,) last configuration.
        s: path position of q.
        what: verb of the branch: "ends" or "meets others".
    """
    system, closing, target = line.system, line.closing(line.length), line.ends[1]
    where = closing.locked_positions(q) or "it"
    text = (
        f"{system.name}: {closing.locked_positions(target) or 'the configuration'} cannot be"
        f" reached from the assembled configuration, whose branch {what} near {where}"
    )
    found = candidates(closing, line.placed(q, line.length))
    remedy = "give a guess of other joints to choose another branch, or other positions"
    if not found:
        return f"{text}; {remedy}"
    names = [c.name for c in system.coordinates]
    listed = (
        "(" + ", ".join(f"{names[k]} = {one[k]:.4g}" for k in closing.free) + ")" for one in found
    )
    return (
        f"{text}; configurations with these positions: {' or '.join(listed)}; choose one by a guess"
        " of its joints, or give other positions"
    )


def unwound(closing: Closing, q: Vector, start: Vector) -> Vector:
    """Return a closed configuration with angles within half a rotation of a start.

    A quaternion gets the sign nearer to the start. If both signs are equally near, its first
    nonzero element is positive. q is returned unchanged if the loops were then open, as with gears.

    Args:
        closing: closure rows and the locked positions.
        q: (nq,) closed configuration.
        start: (nq,) configuration to which angles are near.
    """
    near: Vector = start + difference(closing.system, q, start)
    for part in quaternion_slices(closing.system.tree):
        near[part] = quaternion_sign(q[part], start[part]) * q[part]
    near[list(closing.locked)] = q[list(closing.locked)]
    return near if closing.openness(near) < CLOSED else q


def quaternion_sign(quaternion: Vector, start: Vector | None = None) -> float:
    """Return -1 if the negative of a unit quaternion is nearer to the quaternion `start`, else 1.

    If both are equally near, or without a start, the sign makes the first nonzero element positive.

    Args:
        quaternion: (4,) unit quaternion.
        start: (4,) unit quaternion, or None.
    """
    near = () if start is None else (float(quaternion @ start),)
    for value in (*near, *quaternion):
        if abs(value) > _HALF_TURN:
            return float(np.sign(value))
    return 1.0


def candidates(closing: Closing, start: Vector, most: int = _CANDIDATES) -> list[Vector]:
    """Return closed configurations with the locked positions of the start, nearest first.

    Positions that no loop depends on stay at the start.

    Args:
        closing: closure rows and the locked positions.
        start: (nq,) configuration around which the search starts. Every second random start is near
            it.
        most: number of configurations at which the search ends.
    """
    rng, bound = np.random.default_rng(_SEED), closing.acting(norms=False)
    free = [k for k in closing.free if bound[k]]
    lengths = [closing.system.coordinates[k].unit.startswith("m") for k in free]
    reach = np.where(lengths, closing.size, np.pi)
    turning = [
        part
        for part in quaternion_slices(closing.system.tree)
        if set(range(part.start, part.stop)) <= set(free)
    ]
    found: list[Vector] = []
    for number in range(_TRIES):
        trial = start.copy()
        reach_of = _REACHES[number % 2]
        if number:
            trial[free] += reach_of * reach * rng.uniform(-1, 1, len(free))
        for part in turning if number and reach_of == 1 else ():
            quaternion = rng.standard_normal(4)
            trial[part] = quaternion / np.linalg.norm(quaternion)
        closed = closing.nearest(trial)
        if not closed.is_closed:
            continue
        q = unwound(closing, closed.q, start)
        if all(np.max(np.abs(difference(closing.system, q, one))) > _OTHER for one in found):
            found.append(q)
        if len(found) == most:
            break
    found.sort(key=lambda q: float(np.max(np.abs(difference(closing.system, q, start)))))
    return found


_HALF_TURN = 1e-6
"""Size below which elements and scalar products of unit quaternions, and differences from half a
rotation [rad], are rounding and decide no sign: bars in one line have angles of half a rotation."""
_OTHER = 1e-4
"""Smallest difference between two listed configurations [rad or m]: iterations leave 1e-10."""
