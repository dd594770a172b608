"""Iterative inverse kinematics: a configuration that moves a frame to a given pose."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import casadi
import numpy as np
from casadi import DM, SX, Function
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.assembly.model_function import require_system
from mbs.errors import ModelError, Unclosable
from mbs.loops.closing import TOLERANCE, Closed, Closing, Vector, closure_parameters
from mbs.loops.configuration import starts
from mbs.numbers import OnArrays, on_arrays
from mbs.recursions.route import relative_pose
from mbs.solvers.least_squares import gauss_newton, levenberg_marquardt
from mbs.spatial import Pose
from mbs.text import did_you_mean, quoted

# Target pose of the user: a rigid transform, or an error message for the row or axis that is wrong.


Array = NDArray[np.float64]

SKEWED = 1e-6
"""Largest error of an element of a transform that is still rounded to a rigid transform."""

_ROUNDINGS = 2
_LAST = np.array([0.0, 0.0, 0.0, 1.0])
_WANTED = (
    "give a pose, (4, 4) with an orthonormal right-handed orientation and the last row 0, 0, 0, 1"
)


def target_pose(system: System, T: Any) -> Array:
    """Return the target pose with an exactly orthonormal orientation.

    Args:
        system: system whose name appears in error messages.
        T: (4, 4) homogeneous transform [m], as an array, nested lists, a numeric CasADi matrix or a
            Pose. Orientations within 1e-6 of orthonormal are rounded to the nearest rotation.

    Returns:
        (4, 4) numeric transform.

    Raises:
        ModelError: T is not a rigid transform. The message contains the wrong row or axis.
    """
    matrix = pose_numbers(T)
    if matrix is None or matrix.shape != (4, 4):
        shape = "" if matrix is None else f" of shape {matrix.shape}"
        raise ModelError(f"{system.name}: T is {quoted(T)}{shape}; {_WANTED}")
    pose, good = rounded(matrix)
    if not good:
        raise ModelError(f"{system.name}: {defect(matrix)}; {_WANTED}")
    return pose


def pose_numbers(T: Any) -> Array | None:
    """Return a transform as a numeric array of any shape; None if it is not numeric.

    Args:
        T: array, nested lists, CasADi matrix or Pose.
    """
    try:
        if isinstance(T, Pose):
            T = T.matrix
        if isinstance(T, SX | DM):
            return np.array(DM(T)) if SX(T).is_constant() else None
        numbers = np.asarray(T)
        return None if np.iscomplexobj(numbers) else numbers.astype(float)
    except (RuntimeError, TypeError, ValueError, NotImplementedError):
        return None


def rounded(T: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Return the nearest rigid transforms, and whether each matrix is within 1e-6 of its result.

    Source: Higham 2008, chapter 8, the Newton-Schulz iteration for the polar factor.

    Args:
        T: (..., 4, 4) matrices.

    Returns:
        Transforms (..., 4, 4) and mask (...).
    """
    with np.errstate(all="ignore"):
        R = T[..., :3, :3]
        skew = np.max(np.abs(np.swapaxes(R, -1, -2) @ R - np.eye(3)), axis=(-1, -2))
        for _ in range(_ROUNDINGS):
            R = 1.5 * R - 0.5 * R @ np.swapaxes(R, -1, -2) @ R
        pose = np.array(T)
        pose[..., :3, :3], pose[..., 3, :] = R, _LAST
        near = np.max(np.abs(pose - T), axis=(-1, -2)) < SKEWED
        right = np.linalg.det(T[..., :3, :3]) > 0
    return pose, near & right & (skew < 10 * SKEWED)


def defect(T: Array, name: str = "T") -> str:
    """Return text that describes why a matrix is not a rigid transform.

    Args:
        T: (4, 4) matrix.
        name: name of the matrix in the text.
    """
    open_places = np.argwhere(~np.isfinite(T))
    if len(open_places):
        r, c = (int(k) for k in open_places[0])
        return f"{name}[{r}, {c}] is {T[r, c]} (row {r + 1}, column {c + 1})"
    if np.any(np.abs(T[3] - _LAST) >= SKEWED):
        return f"the last row of {name} is {', '.join(f'{x:.6g}' for x in T[3])}"
    return _skewed_axes(T[:3, :3], name)


def _skewed_axes(R: Array, name: str) -> str:
    """Return text on the worst error of R (3, 3): length of an axis, angle, or handedness."""
    with np.errstate(over="ignore"):
        lengths = np.linalg.norm(R, axis=0)
    faults = {
        abs(length - 1): f"the {axis} axis of {name}, column {k + 1}, has length {length:.9g}"
        for k, (axis, length) in enumerate(zip("xyz", lengths.tolist(), strict=True))
    }
    units = R / np.where(lengths > 0, lengths, 1.0)
    for k, m in combinations(range(3), 2):
        cosine = float(units[:, k] @ units[:, m])
        faults[abs(cosine)] = (
            f"the {'xyz'[k]} and {'xyz'[m]} axes of {name} are not perpendicular, the cosine"
            f" between them is {cosine:.3g}"
        )
    worst = max(faults)
    if worst < SKEWED / 2:
        return f"the axes of {name} are left-handed, z points against x times y"
    return faults[worst]


# Requirements on a frame: its pose, or some rows of the pose, in addition to the loop closure.


ROWS = {"x": (0,), "y": (1,), "z": (2,), "orientation": tuple(range(3, 12)), "axis": (9, 10, 11)}
"""Elements of each named row of a pose, as indices in [origin; x axis; y axis; z axis]."""

WHOLE = ("x", "y", "z", "orientation")
_CLOSURE_WEIGHT = 1e2
"""Weight of closure rows against an unreachable pose: the loops are then open by less than 1e-4 of
the pose error, near enough to be closed afterwards. Larger weights slow down the iteration."""
_ITERATIONS = 50
"""Maximum Gauss-Newton iterations from one start: convergence is quadratic near a root, so that
after 50 iterations the next start is more promising."""


@dataclass(frozen=True, slots=True, eq=False)
class Goal:
    """Pose that a frame must reach while the loops are closed.

    Attributes:
        closing: closure rows of the loops, without locked positions.
        frame: name of a body or frame, or index of a link.
        rows: names of the rows of the pose that must agree, keys of `ROWS`.
        target: (12,) target origin [m] and axes x, y, z of the frame, in the base.
    """

    closing: Closing
    frame: str | int
    rows: tuple[str, ...]
    target: Vector

    @property
    def elements(self) -> list[int]:
        """Sorted indices of the elements of the pose (12,) that must agree."""
        return sorted({k for name in self.rows for k in ROWS[name]})

    def at(self, T: Vector) -> Goal:
        """Return the same goal for another target pose.

        Args:
            T: (4, 4) target pose [m].
        """
        return replace(self, target=_elements(T))

    def gap(self, q: Vector) -> tuple[float, float]:
        """Return the errors of the required rows: distance [m] and angle [rad].

        Args:
            q: (nq,) positions.
        """
        index = self.pose(q)[0] - self.target
        own = [k for k in self.elements if k < 3]
        axes = np.where(np.isin(range(12), self.elements), index, 0.0)[3:].reshape(3, 3)
        chord = float(np.linalg.norm(axes)) / (np.sqrt(2) if "orientation" in self.rows else 1)
        return float(np.linalg.norm(index[own])), 2 * float(np.arcsin(min(1.0, chord / 2)))

    def residual(self, q: Vector, weight: float = 1.0) -> tuple[Vector, Vector]:
        """Return the residual (m,) of loops and pose, and its derivative by q (m, nq).

        Args:
            q: (nq,) positions.
            weight: factor of the closure rows, which come first.
        """
        r, J = self.closing.rows(q)
        pose, slope = self.pose(q)
        e = self.elements
        return (
            np.concatenate([weight * r, pose[e] - self.target[e]]),
            np.vstack([weight * J, slope[e]]),
        )

    @property
    def sizes(self) -> Vector:
        """(m,) divisors of the rows of `residual`: size of the mechanism for lengths, else 1."""
        pose = [self.closing.size if k < 3 else 1.0 for k in self.elements]
        return np.concatenate([self.closing.sizes, pose])

    def openness(self, q: Vector) -> float:
        """Return the largest row of the residual, divided by `sizes`.

        Args:
            q: (nq,) positions.
        """
        return float(np.max(np.abs(self.residual(q)[0]) / self.sizes, initial=0.0))

    def nearest(self, q: Vector) -> Closed:
        """Return the result of Gauss-Newton on the loops and the pose together.

        Args:
            q: (nq,) start.
        """
        tolerance = TOLERANCE * self.sizes
        root = gauss_newton(self.residual, q, tolerance=tolerance, iterations=_ITERATIONS)
        return Closed(root.x, root.residual, root.converged and self.closing.faces(root.x))

    def approach(self, q: Vector) -> Closed:
        """Return a configuration with closed loops that is as close to the pose as possible.

        Args:
            q: (nq,) start of a Levenberg-Marquardt iteration.
        """
        root = levenberg_marquardt(lambda x: self.residual(x, _CLOSURE_WEIGHT), q)
        return self.closing.nearest(root.x)

    def pose(self, q: Vector) -> tuple[Vector, Vector]:
        """Return the elements of the pose of the frame (12,), and their derivative by q (12, nq).

        Args:
            q: (nq,) positions.
        """
        system = self.closing.system
        function: OnArrays = system.cached(
            ("pose and slope", self.frame), lambda: on_arrays(_pose_and_slope(system, self.frame))
        )
        pose, slope = function(q, self.closing.p)
        return pose.ravel(), slope


def goal(
    system: System,
    frame: str | int,
    T: Any,
    rows: Sequence[str] | None,
    parameters: Mapping[str, float] | None,
) -> Goal:
    """Return the goal for inputs of the user.

    Args:
        system: open or closed mechanism.
        frame: name of a body, name of a frame, or index of a link.
        T: (4, 4) target pose of the frame in the base [m].
        rows: names of the rows of the pose that must agree; None for all.
        parameters: values of symbols by name.

    Raises:
        ModelError: the frame or a row does not exist, or T is not a rigid transform.
    """
    require_system(system)
    system.frame(frame)
    closing = Closing(system, closure_parameters(system, parameters))
    chosen = WHOLE if rows is None else _named(system, rows)
    return Goal(closing, frame, chosen, _elements(target_pose(system, T)))


def _named(system: System, rows: Sequence[str]) -> tuple[str, ...]:
    """Return the names of pose rows from the user as a tuple.

    Raise ModelError for unknown names.
    """
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
    """Return the origin and the axes x, y, z of a pose (4, 4) as one vector (12,)."""
    return np.concatenate([T[:3, 3], T[:3, :3].ravel(order="F")])


def _pose_and_slope(system: System, frame: str | int) -> Function:
    """Return ``pose(q, p) -> x, s``: origin and axes (12,) of a frame, derivative (12, nq) by q."""
    q = SX.sym("q", system.nq)
    pose = relative_pose(system.tree, q, system.frame("base"), system.frame(frame))
    elements = casadi.densify(casadi.vertcat(pose.p, casadi.vec(pose.R)))
    slope = casadi.densify(casadi.jacobian(elements, q))
    return Function("pose", [q, system.p], [elements, slope], {"cse": True})


_FEWEST = 3
"""Number of best attempts from which the nearest configuration to an unreachable pose is
computed."""


def solve_pose(
    system: System,
    frame: str | int,
    T: Any,
    *,
    rows: Sequence[str] | None = None,
    guess: Mapping[str, float] | Sequence[float] | None = None,
    parameters: Mapping[str, float] | None = None,
) -> Vector:
    """Return a configuration that closes the loops and moves a frame to a given pose.

    Gauss-Newton solves the closure rows and the pose rows together, with all tree positions free.
    It starts from the guess, then from random starts at increasing distances, the same at each
    call. The guess decides which of several configurations is found. `working_modes` finds the
    others.

    Args:
        system: open or closed mechanism.
        frame: name of a body, name of a frame, or index of a link.
        T: (4, 4) homogeneous target pose in the base [m]. An orientation within 1e-6 of orthonormal
            is rounded to the nearest rotation.
        rows: names of the rows of the pose that must agree: "x", "y", "z", "orientation", and
            "axis" for the direction of the z axis only. The default is the whole pose. A robot with
            less than six freedoms needs a reachable pose, or names such as ["x", "y"] in a plane.
        guess: approximate positions, by name or all of them. Missing positions have their values of
            the assembled configuration.
        parameters: values of symbols by name. Missing symbols have their default values.

    Returns:
        q (nq,) [rad or m]. The rows of the loops and of the pose are below 1e-12 in it, with
        lengths divided by the size of the mechanism.

    Raises:
        Unclosable: no configuration was found. The message contains the smallest pose error.
        ModelError: the frame, a row or a coordinate does not exist, or T is not a rigid transform.
    """
    target = goal(system, frame, T, rows, parameters)
    start = np.array(system.position(guess))
    tried: list[Closed] = []
    for q in starts(start, target.closing.free):
        found = target.nearest(q)
        if found.is_closed:
            return found.q
        tried.append(found)
    raise Unclosable(_refusal(target, start, tried))


def _refusal(target: Goal, start: Vector, tried: Sequence[Closed]) -> str:
    """Return the error message for an unreachable goal: loops that stay open, or the nearest pose.

    `start` is the first configuration, `tried` are the results of all starts.
    """
    closing = target.closing
    best = sorted(tried, key=lambda found: found.residual)[:_FEWEST]
    near = [target.approach(q) for q in (*(found.q for found in best), start)]
    gaps = [target.gap(found.q) for found in near if found.is_closed]
    title = f"{closing.system.name}: frame {quoted(target.frame)} cannot be brought to this pose"
    if not gaps:
        left = closing.gap(best[0].q)
        return f"{title}; the best configuration found leaves {left}; change the guess"
    distance, angle = min(gaps, key=lambda gap: gap[0] ** 2 + gap[1] ** 2)
    away = [f"{round(distance, 6):.4g} m away"] * bool(set(target.rows) & set("xyz"))
    away += [f"rotated by {round(angle, 6):.4g} rad"] * bool(
        set(target.rows) & {"orientation", "axis"}
    )
    named = target.rows != WHOLE or len(closing.system.independent) >= 6
    remedy = "" if named else f"name the rows=[...] that count, of {', '.join(ROWS)}, or "
    return (
        f"{title}; the nearest configuration found with closed loops leaves it"
        f" {' and '.join(away)};"
        f" {remedy}give another pose or guess"
    )
