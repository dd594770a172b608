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
from mbs.solvers.gauss_newton import gauss_newton

Vector = NDArray[np.float64]

TOLERANCE = 1e-12

OPEN = 1e-6
"""Largest closure row of a posture that counts as closed [m or 1]."""


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

    def nearest(self, q: Vector) -> Closed:
        """The posture that Gauss-Newton reaches from q (nq,)."""
        start = np.array(q, dtype=float)

        def residual(x: Vector) -> tuple[Vector, Vector]:
            return self.rows(_replaced(start, self.free, x))

        root = gauss_newton(residual, start[self.free], tolerance=TOLERANCE)
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

    def _functions(self) -> tuple[Function, Function]:
        functions: tuple[Function, Function] = self.system.cached(
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


def _functions(system: System) -> tuple[Function, Function]:
    q = SX.sym("q", system.nq)
    r = casadi.densify(casadi.vertcat(closure_rows(system, q), norm_rows(system.tree, q)))
    J = casadi.densify(casadi.jacobian(r, q))
    equations = Function("equations", [q, system.p], [r, J])
    return equations, Function("facing", [q, system.p], [facing(system, q)])


def _replaced(q: Vector, places: Sequence[int], values: Vector) -> Vector:
    result = q.copy()
    result[list(places)] = values
    return result
