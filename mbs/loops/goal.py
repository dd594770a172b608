"""What a frame is wanted to do: its pose, or some rows of it, beside the closure of the loops."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import casadi
import numpy as np
from casadi import SX, Function

from mbs.assembly import System
from mbs.assembly.model_function import require_system
from mbs.errors import ModelError
from mbs.loops.closing import TOLERANCE, Closed, Closing, Vector, closure_parameters
from mbs.loops.wanted import wanted_pose
from mbs.messages import did_you_mean, quoted
from mbs.recursions.route import relative_pose
from mbs.solvers.gauss_newton import gauss_newton
from mbs.solvers.levenberg_marquardt import levenberg_marquardt

ROWS = {"x": (0,), "y": (1,), "z": (2,), "orientation": tuple(range(3, 12)), "axis": (9, 10, 11)}
"""The rows of a pose by name, and their elements among [origin; x axis; y axis; z axis]."""

WHOLE = ("x", "y", "z", "orientation")
_CLOSURE_WEIGHT = 1e2
_ITERATIONS = 50


@dataclass(frozen=True, slots=True, eq=False)
class Goal:
    """A pose that a frame is wanted to have while the loops are closed.

    Attributes:
        closing: the closure rows; no position is held.
        frame: that is wanted there.
        rows: names of the rows of the pose that count.
        wanted: (12,) origin [m], then the axes x, y, z of the frame, in the base.
    """

    closing: Closing
    frame: str | int
    rows: tuple[str, ...]
    wanted: Vector

    @property
    def elements(self) -> list[int]:
        """The elements of the pose that count."""
        return sorted({k for name in self.rows for k in ROWS[name]})

    def at(self, T: Vector) -> Goal:
        """The same goal at another pose (4, 4)."""
        return replace(self, wanted=_elements(T))

    def gap(self, q: Vector) -> tuple[float, float]:
        """How far the frame is away at q, (nq,): distance [m] and angle [rad] of what counts."""
        place = self.pose(q)[0] - self.wanted
        own = [k for k in self.elements if k < 3]
        axes = np.where(np.isin(range(12), self.elements), place, 0.0)[3:].reshape(3, 3)
        chord = float(np.linalg.norm(axes)) / (np.sqrt(2) if "orientation" in self.rows else 1)
        return float(np.linalg.norm(place[own])), 2 * float(np.arcsin(min(1.0, chord / 2)))

    def residual(self, q: Vector, weight: float = 1.0) -> tuple[Vector, Vector]:
        """Closure rows times a weight, then those of the pose, and the slope by q, (m, nq)."""
        r, J = self.closing.rows(q)
        pose, slope = self.pose(q)
        e = self.elements
        return (
            np.concatenate([weight * r, pose[e] - self.wanted[e]]),
            np.vstack([weight * J, slope[e]]),
        )

    @property
    def sizes(self) -> Vector:
        """(m,) what the rows of `residual` are measured by: lengths by the size of the loops."""
        pose = [self.closing.size if k < 3 else 1.0 for k in self.elements]
        return np.concatenate([self.closing.sizes, pose])

    def openness(self, q: Vector) -> float:
        """The largest row at q, (nq,), in parts of the size of the mechanism."""
        return float(np.max(np.abs(self.residual(q)[0]) / self.sizes, initial=0.0))

    def nearest(self, q: Vector) -> Closed:
        """The posture that Gauss-Newton reaches from q, (nq,), with loops and pose together."""
        tolerance = TOLERANCE * self.sizes
        root = gauss_newton(self.residual, q, tolerance=tolerance, iterations=_ITERATIONS)
        return Closed(root.x, root.residual, root.converged and self.closing.faces(root.x))

    def approached(self, q: Vector) -> Closed:
        """The posture with closed loops that is, next to q, as near to the pose as it can be."""
        root = levenberg_marquardt(lambda x: self.residual(x, _CLOSURE_WEIGHT), q)
        return self.closing.nearest(root.x)

    def pose(self, q: Vector) -> tuple[Vector, Vector]:
        """The elements of the pose of the frame, (12,), and their slope by q, (12, nq)."""
        system = self.closing.system
        function: Function = system.cached(
            ("pose and slope", self.frame), lambda: _pose_and_slope(system, self.frame)
        )
        pose, slope = (np.array(m) for m in function(q, self.closing.p))
        return pose.ravel(), slope


def goal(
    system: System,
    frame: str | int,
    T: Any,
    rows: Sequence[str] | None,
    parameters: Mapping[str, float] | None,
) -> Goal:
    """A goal from what a user gives.

    Raises:
        ModelError: there is no such frame or row, or T is no pose.
    """
    require_system(system)
    system.frame(frame)
    closing = Closing(system, closure_parameters(system, parameters))
    chosen = WHOLE if rows is None else _named(system, rows)
    return Goal(closing, frame, chosen, _elements(wanted_pose(system, T)))


def _named(system: System, rows: Sequence[str]) -> tuple[str, ...]:
    given = [rows] if isinstance(rows, str) or not isinstance(rows, Iterable) else list(rows)
    for name in given:
        if not isinstance(name, str) or name not in ROWS:
            raise ModelError(
                f"{system.name}: there is no row {quoted(name)} of a pose;"
                f" {did_you_mean(name, ROWS)}"
            )
    if not given:
        raise ModelError(f"{system.name}: no rows were named; give some of {', '.join(ROWS)}")
    return tuple(given)


def _elements(T: Vector) -> Vector:
    return np.concatenate([T[:3, 3], T[:3, :3].ravel(order="F")])


def _pose_and_slope(system: System, frame: str | int) -> Function:
    q = SX.sym("q", system.nq)
    pose = relative_pose(system.tree, q, system.frame("base"), system.frame(frame))
    elements = casadi.densify(casadi.vertcat(pose.p, casadi.vec(pose.R)))
    slope = casadi.densify(casadi.jacobian(elements, q))
    return Function("pose", [q, system.p], [elements, slope], {"cse": True})
