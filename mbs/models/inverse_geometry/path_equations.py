"""Equations of path tracking: joints that move, pose error, limits and redundancy."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

import mbs.closed_forms.arm_core as core
from mbs.assembly import System
from mbs.closed_forms.arm import Arm, Array
from mbs.closed_forms.ring import spin_indices
from mbs.errors import ModelError
from mbs.loops.plan import regular_configuration, undetermined_beside
from mbs.loops.pose import Goal
from mbs.models.inverse_geometry.chain import FrameChain, frame_chain
from mbs.models.inverse_geometry.solutions import WITHIN, CoordinateLimits, Given, bounds
from mbs.numbers import NONZERO
from mbs.solvers.rank import null_space
from mbs.text import did_you_mean, quoted

Rows = Callable[[Array, Array], tuple[Array, Array]]
"""(x, T) -> pose error (m,) from the configuration x to the target pose T, and Jacobian (m, n). To
first order a move dx reduces the error by J dx."""
SINGULAR = 1e-7
"""Smallest singular value below which a configuration counts as singular."""
LARGEST_STEP = 0.35
"""Longest step of any joint [rad or arm lengths], 20 degrees. A longer step may change the branch
or add a full revolution."""
SMALL = 1e-9
"""Error rows and moves [rad or arm lengths] that count as zero: 1000 times the 1e-12 of a solution,
because rounding errors grow towards a singular configuration."""
POSE_ERROR = 1e-9
"""Largest error row at a reached pose. Solutions have an error of 1e-12, and rounding errors are
larger near singular configurations."""
AT_POSE = 1e-3
"""Distance before a pose, as a fraction of the segment between two poses, at which the pose itself
may be the singular one."""


@dataclass(frozen=True, slots=True, eq=False)
class PathJoints:
    """Joints that track a path, and their equations. Scaled positions are x = q / scale.

    Attributes:
        target: tracked frame and loop closure of the system.
        indices: indices in q of the joints that move.
        scale: (n,) unit of each x: 1 for angles, reference length [m] for prismatic joints.
        rows: pose error and its Jacobian, as functions of x and the target pose.
        slack: dimension of the null space of the Jacobian at a regular configuration: idle spins
            of rods and redundant freedoms.
        exact: whether every nearby pose can be reached. If so, the error is zero between the given
            poses too; if not, it is minimised.
        bounds: limits of the coordinates, or None to ignore limits.
        chain: open chain of the joints, or None for a robot with loops.
        redundant: number of freedoms beyond those that the pose determines.
        slope: gradient (n,) of a cost that redundant joints decrease, as a function of x, or None.
        low, high: (n,) limits of x, infinite for unlimited coordinates.
    """

    target: Goal
    indices: tuple[int, ...]
    scale: Array
    rows: Rows
    slack: int
    exact: bool
    bounds: CoordinateLimits | None
    chain: FrameChain | None = None
    redundant: int = 0
    slope: Callable[[Array], Array] | None = None
    low: Array = field(init=False)
    high: Array = field(init=False)

    def __post_init__(self) -> None:
        free = np.full(len(self.indices), np.inf)
        low = -free if self.bounds is None else self.scaled(self.bounds.low)
        high = free if self.bounds is None else self.scaled(self.bounds.high)
        object.__setattr__(self, "low", low)
        object.__setattr__(self, "high", high)

    @property
    def system(self) -> System:
        """Robot that the joints belong to."""
        return self.target.closing.system

    @property
    def length(self) -> float:
        """Reference length [m]: the length of the arm, or 1 m for a robot with loops."""
        return 1.0 if self.chain is None else self.chain.arm(self.target.closing.p).length

    def may(self, x: Array) -> bool:
        """Whether a configuration is within the limits."""
        return not np.any(self.beyond(x))

    def beyond(self, x: Array) -> NDArray[np.bool_]:
        """Return (n,) whether each coordinate of x is beyond its limits."""
        return np.asarray((x < self.low - WITHIN) | (x > self.high + WITHIN))

    def scaled(self, q: Array) -> Array:
        """Return the scaled positions (n,) of the moving joints in a configuration q (nq,)."""
        x: Array = q[list(self.indices)] / self.scale
        return x

    def whole(self, q: Array, x: Array) -> Array:
        """Return the configuration q (nq,) with the moving joints at scaled positions x (n,)."""
        whole = q.copy()
        whole[list(self.indices)] = x * self.scale
        return whole

    def pose(self, q: Array) -> Array:
        """Return the pose (4, 4) of the frame in the base at a configuration q (nq,)."""
        elements = self.target.pose(q)[0]
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = elements[3:].reshape(3, 3).T, elements[:3]
        return T

    def residual(self, q: Array, T: Array) -> float:
        """Return the largest absolute pose error or loop closure error at q (nq,)."""
        return float(np.max(np.abs(self.target.at(T).residual(q)[0])))

    def passed(self, x: Array, slack: float = 0.0) -> tuple[int, float] | None:
        """Return (index in q, limit) of the first joint within `slack` of its limit, or None.

        x (n,) are scaled positions. The limit and `slack` are in rad or m.
        """
        if self.bounds is None:
            return None
        for index, value in zip(self.indices, x * self.scale, strict=True):
            low, high = float(self.bounds.low[index]), float(self.bounds.high[index])
            if value > high - slack:
                return index, high
            if value < low + slack:
                return index, low
        return None


@dataclass(frozen=True, slots=True, eq=False)
class PathPoint:
    """Configuration on a path, with its Jacobian and pose error.

    Attributes:
        x: (n,) scaled configuration.
        J: (m, n) Jacobian at x.
        left: largest absolute error row at x.
    """

    x: Array
    J: Array
    left: float


def point_at(joints: PathJoints, x: Array, T: Array) -> PathPoint:
    """Return the path point of a configuration x (n,), with its error to the pose T (4, 4)."""
    r, J = joints.rows(x, T)
    return PathPoint(x, J, float(np.max(np.abs(r))))


def smallest(joints: PathJoints, J: Array) -> float:
    """Return the smallest singular value of J (m, n) outside its regular null space."""
    values = np.linalg.svd(J, compute_uv=False)
    return float(values[J.shape[1] - 1 - joints.slack])


def pseudo_inverse(joints: PathJoints, J: Array, stopped: int = 0) -> tuple[Array, float]:
    """Return the pseudo-inverse of J, truncated to its regular rank, and its norm.

    J lacks the columns of `stopped` joints, which lowers the dimension of its null space.
    """
    U, values, V = np.linalg.svd(J, full_matrices=False)
    kept = J.shape[1] - max(joints.slack - stopped, 0)
    inverse = 1 / np.maximum(values[:kept], NONZERO)
    back: Array = (V[:kept].T * inverse) @ U[:, :kept].T
    return back, float(inverse[-1])


# Redundancy resolution: minimum-norm motion, plus gradient descent of a cost in the null space.
#
# dx = J+ dr - k (1 - J+ J) grad H
#
# Source: Liegeois 1977; Yoshikawa 1985 (manipulability). Closed paths of the frame do not result in
# closed paths of the joints: Klein & Huang 1983.


CRITERIA = ("minimum velocity", "limits", "manipulability")
"""Names of the built-in criteria of redundancy resolution."""
Redundancy: TypeAlias = str | Callable[[Array], Array]
"""Name from `CRITERIA`, or a function q (nq,) -> gradient (nq,) of a cost."""
_DIFFERENCE = 1e-5
"""Step of a joint [rad or arm lengths] for central differences of log manipulability. Its second
derivative is about 1 except near singular configurations."""


def slope_of(
    joints: PathJoints, start: Array, redundancy: Redundancy | None
) -> Callable[[Array], Array] | None:
    """Return the gradient function of the redundancy cost in scaled positions, or None.

    Raises:
        ModelError: the criterion is unknown.
    """
    if callable(redundancy):
        return _given_slope(joints, start, redundancy)
    if redundancy is not None and redundancy not in CRITERIA:
        raise ModelError(
            f"{joints.system.name}: redundancy is {quoted(redundancy)};"
            f" {did_you_mean(redundancy, CRITERIA)}, or give a function of q that returns the"
            " gradient of a cost"
        )
    if redundancy == "limits":
        return _from_limits(joints.low, joints.high)
    return _to_manipulability(joints) if redundancy == "manipulability" else None


def _given_slope(
    joints: PathJoints, start: Array, gradient: Callable[[Array], Array]
) -> Callable[[Array], Array]:
    def slope(x: Array) -> Array:
        found = np.asarray(gradient(joints.whole(start, x)), dtype=float)
        if found.shape != (start.size,) or not np.all(np.isfinite(found)):
            raise ModelError(
                f"{joints.system.name}: the function given as redundancy returned {quoted(found)};"
                f" return the gradient of a cost, {start.size} finite numbers"
            )
        scaled: Array = found[list(joints.indices)] * joints.scale
        return scaled

    return slope


def _from_limits(low: Array, high: Array) -> Callable[[Array], Array]:
    """Return the gradient of 1/2 sum ((x - middle) / half range)^2 over the limited joints.

    Source: Liegeois 1977.
    """
    limited = np.isfinite(low) & np.isfinite(high) & (high > low)
    low, high = np.where(limited, low, 0.0), np.where(limited, high, 0.0)
    half = np.where(limited, (high - low) / 2, np.inf)
    return lambda x: (x - (low + high) / 2) / half**2


def _to_manipulability(joints: PathJoints) -> Callable[[Array], Array]:
    """Return the gradient of -log(manipulability), the product of the singular values of J.

    Source: Yoshikawa 1985.
    """
    T = np.eye(4)  # the Jacobian does not depend on the target

    def value(x: Array) -> float:
        values = np.linalg.svd(joints.rows(x, T)[1], compute_uv=False)
        kept = values[: x.size - joints.slack]
        return -float(np.sum(np.log(np.maximum(kept, NONZERO))))

    def slope(x: Array) -> Array:
        moves = _DIFFERENCE * np.eye(x.size)
        rises = [value(x + move) - value(x - move) for move in moves]
        return np.array(rises) / (2 * _DIFFERENCE)

    return slope


# Joints and equations that track poses of a frame, from the options of the user.


_WHOLE = 6  # freedoms of a rigid body, all of which a pose determines


def path_joints(
    target: Goal,
    start: Array,
    locked: Mapping[str, float] | None,
    limits: bool | Given | None,
    redundancy: Redundancy | None = None,
) -> PathJoints:
    """Set up the joints and equations that track poses of a frame.

    Args:
        target: tracked frame and loop closure of the system.
        start: (nq,) configuration; joints that do not move keep their positions in it.
        locked: joints that do not move, by name.
        limits: as in `follow`.
        redundancy: as in `follow`.

    Raises:
        ModelError: a name or a criterion is unknown.
    """
    system, frame = target.closing.system, target.frame
    ends = None if limits is False else bounds(system, limits)
    path = system.tree.path(system.frame(frame)[0])
    simple = all(system.tree.links[k].motion.nq == 1 for k in path)
    if simple and not system.is_closed:
        found = frame_chain(system, frame, locked, most=len(path))
        arm = found.arm(target.closing.p)
        more, exact = max(0, arm.size - _WHOLE), arm.size >= _WHOLE
        rows = _arm_rows(arm)
        joints = PathJoints(target, found.indices, arm.units, rows, more, exact, ends, found, more)
    else:
        joints = _closed_joints(target, start, list(locked or {}), ends)
    slope = slope_of(joints, start, redundancy)
    return replace(joints, slope=slope) if joints.redundant else joints


def _closed_joints(
    target: Goal, start: Array, locked: list[str], ends: CoordinateLimits | None
) -> PathJoints:
    """Set up a robot with loops: all joints move, except locked and undetermined joints."""
    system = target.closing.system
    indices = {link.name: link.q.start for link in system.tree.links if link.motion.nq == 1}
    for name in locked:
        if name not in indices:
            raise ModelError(
                f"{system.name}: joint {quoted(name)} cannot be locked;"
                f" {did_you_mean(name, indices)}"
            )
    q = regular_configuration(system)
    stays = tuple(indices[name] for name in locked)
    still = null_space(np.vstack([target.residual(q)[1], np.eye(system.nq)[list(stays)]]))
    held = {*stays, *undetermined_beside(system, still, ())}
    moving = tuple(k for k in range(system.nq) if k not in held)
    slack = len(spin_indices(system))
    free = null_space(target.closing.rows(q)[1][:, moving]).shape[1] - slack
    more = max(0, free - _WHOLE)

    def rows(x: Array, T: Array) -> tuple[Array, Array]:
        at = start.copy()
        at[list(moving)] = x
        r, J = target.at(T).residual(at)
        return -r, J[:, moving]

    exact, scale = free >= _WHOLE, np.ones(len(moving))
    return PathJoints(target, moving, scale, rows, slack + more, exact, ends, None, more)


def _arm_rows(arm: Arm) -> Rows:
    library = core.core_of(arm)

    def rows(x: Array, T: Array) -> tuple[Array, Array]:
        q = (x * arm.units)[None]
        gap, J = core.examined_by(library, arm, T, q)
        return gap[0], J[0]

    return rows
