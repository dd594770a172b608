"""The numbers of a closure: its residual at a posture, and the nearest posture that closes it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import casadi
import numpy as np
from casadi import SX, Function
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.assembly.rates import norm_rows
from mbs.loops.closure import closure_rows, facing, row_labels
from mbs.loops.sizes import mechanism_size, row_sizes
from mbs.solvers.gauss_newton import gauss_newton

Vector = NDArray[np.float64]

TOLERANCE = 1e-12
"""Largest closure row where an iteration ends, in parts of the size of the mechanism: rounding of
sums of some tens of terms of size one stays below it, what Newton's method leaves before its last
step, 1e-8 or more, does not."""

CLOSED = 1e-10
"""The same of postures that formulas or others give: hundreds of roundings, no missing step."""

OPEN = 1e-6
"""The same of postures that a user gives, with seven digits; forces are wrong by as little."""


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
    """The closure rows and quaternion norms of a system, some positions held.

    Attributes:
        system: with loops, not necessarily analysed.
        p: (np,) values of its parameters.
        held: positions that must not change.
    """

    system: System
    p: Vector
    held: tuple[int, ...] = ()

    @property
    def free(self) -> list[int]:
        """The positions that may change."""
        return [k for k in range(self.system.nq) if k not in self.held]

    def rows(self, q: Vector) -> tuple[Vector, Vector]:
        """Residual (m,) and its derivative by the free positions (m, n)."""
        r, J = (np.array(m) for m in self._functions()[0](q, self.p))
        return r.ravel(), J[:, self.free]

    @property
    def size(self) -> float:
        """The size of the mechanism [m]."""
        return float(self._functions()[2](self.p)[0])

    @property
    def sizes(self) -> Vector:
        """(m,) what the rows are measured by: the size of the mechanism for lengths [m], or 1."""
        return np.array(self._functions()[2](self.p)[1]).ravel()

    def openness(self, q: Vector) -> float:
        """The largest row at q, (nq,), in parts of the size of the mechanism."""
        return float(np.max(np.abs(self.rows(q)[0]) / self.sizes, initial=0.0))

    def nearest(self, q: Vector) -> Closed:
        """The posture that Gauss-Newton reaches from q (nq,)."""
        start = np.array(q, dtype=float)

        def residual(x: Vector) -> tuple[Vector, Vector]:
            return self.rows(_replaced(start, self.free, x))

        root = gauss_newton(residual, start[self.free], tolerance=TOLERANCE * self.sizes)
        found = _replaced(start, self.free, root.x)
        return Closed(found, root.residual, root.converged and self.faces(found))

    def nearby(self, q: Vector, reach: float, tries: int, seed: int) -> Iterator[Vector]:
        """Closed postures that Gauss-Newton reaches from random ones around q (nq,).

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
        return bool(np.all(np.array(self._functions()[1](q, self.p)) > 0))

    def gap(self, q: Vector) -> str:
        """Which joint stays open most at q, in words and figures."""
        labels = [(name, row) for name, rows in row_labels(self.system) for row in rows]
        gaps: dict[str, list[float]] = {}
        for (name, label), value in zip(labels, self.rows(q)[0], strict=False):
            gap = gaps.setdefault(name, [0.0, 0.0])
            kind = 0 if label.startswith("force") else 1
            gap[kind] = float(np.hypot(gap[kind], value))
        name = max(gaps, key=lambda loop: max(gaps[loop]))
        distance, other = gaps[name]
        return f"{name} open by {distance:.3g} m and {other:.3g} in direction cosines"

    def held_positions(self, q: Vector) -> str:
        """The held positions at q in words; empty when none is held."""
        names = [coordinate.name for coordinate in self.system.coordinates]
        return ", ".join(f"{names[k]} = {q[k]:.4g}" for k in self.held)

    def _functions(self) -> tuple[Function, Function, Function]:
        functions: tuple[Function, Function, Function] = self.system.cached(
            "closing", lambda: _functions(self.system)
        )
        return functions


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


def _functions(system: System) -> tuple[Function, Function, Function]:
    q = SX.sym("q", system.nq)
    r = casadi.densify(casadi.vertcat(closure_rows(system, q), norm_rows(system.tree, q)))
    J = casadi.densify(casadi.jacobian(r, q))
    equations = Function("equations", [q, system.p], [r, J])
    norms = norm_rows(system.tree, q)
    sizes = casadi.vertcat(row_sizes(system), SX.ones(norms.shape))
    return (
        equations,
        Function("facing", [q, system.p], [facing(system, q)]),
        Function("sizes", [system.p], [mechanism_size(system), sizes]),
    )


def _replaced(q: Vector, places: Sequence[int], values: Vector) -> Vector:
    result = q.copy()
    result[list(places)] = values
    return result
