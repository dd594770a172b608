"""Path tracking in joint space: continuation of one inverse-geometry branch along poses."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

import mbs.closed_forms.arm_core as core
from mbs.assembly import System
from mbs.assembly.model_function import require_system
from mbs.closed_forms.arm import Arm, gap_to
from mbs.closed_forms.arm_search import examine_arm, polish
from mbs.closed_forms.ring import spin_indices
from mbs.errors import ModelError, NoClosedForm
from mbs.loops.plan import regular_configuration, undetermined_beside
from mbs.loops.pose import Goal, goal, pose_numbers
from mbs.models.geometry import terminal_frame
from mbs.models.inverse_geometry.chain import FrameChain, frame_chain, target_pose, target_poses
from mbs.models.inverse_geometry.closed_form import sequence_of
from mbs.models.inverse_geometry.gathering import NOT_VARIED
from mbs.models.inverse_geometry.many import batch
from mbs.models.inverse_geometry.solutions import WITHIN, CoordinateLimits, Given, apart, bounds
from mbs.models.inverse_geometry.solve import solve_at
from mbs.models.inverse_geometry.target import SOLVED
from mbs.numbers import NONZERO
from mbs.solvers.least_squares import gauss_newton, levenberg_marquardt
from mbs.solvers.rank import null_space
from mbs.text import did_you_mean, quoted

# Predictor-corrector continuation of a configuration while the target pose moves.
#
# The tangent of the path is the predictor and Newton's method is the corrector. A step is accepted
# if the corrector is shorter than the predictor and contracts, and if all eigenvalues of J^-1 J'
# are within 1/2 of 1, where J and J' are the Jacobians before and after the step. The eigenvalues
# do not depend on the units. An accepted step crosses no singular configuration and changes to no
# other branch. The step size tends to zero towards a singular configuration.
#
# Source: Deuflhard 2011, sections 2.1 and 5.1, with eigenvalues instead of a norm.


Array = NDArray[np.float64]
Rows = Callable[[Array, Array], tuple[Array, Array]]
"""(x, T) -> pose error (m,) from the configuration x to the target pose T, and Jacobian (m, n). To
first order a move dx reduces the error by J dx."""

SINGULAR = 1e-7
"""Smallest singular value below which a configuration counts as singular."""

_CHANGE = 0.5
_CONTRACTION = 0.5
_LARGEST = 0.35
"""Longest step of any joint [rad or arm lengths], 20 degrees. A longer step may change the branch
or add a full revolution."""
_ITERATIONS = 12
_SMALL = 1e-9
"""Error rows and moves [rad or arm lengths] that count as zero: 1000 times the 1e-12 of a solution,
because rounding errors grow towards a singular configuration."""
_SMALLEST_STEP = 1e-12
"""Smallest step, as a fraction of the segment between two poses. The rounding of 1 is 1e-16."""
_TANGENT = 1e-3
"""Fraction of a step over which a finite difference approximates the tangent of a pose curve."""
_MOST_STEPS = 200
"""Maximum number of steps between two poses. A full revolution of a joint takes some tens."""
_GAIN = 10.0
"""Step along the negative gradient per rad or arm length of frame motion. A cost whose second
derivative is about 1 decreases within a frame motion of a tenth of the arm length."""
_NOISE = 1e-14
"""Rounding error of an error row: some tens of 1e-16 from products of transforms. The norm of the
inverse Jacobian amplifies it in the Newton step."""


@dataclass(frozen=True, slots=True, eq=False)
class Tracker:
    """Equations, limits and redundancy of the predictor-corrector continuation.

    Attributes:
        rows: pose error and Jacobian of a scaled configuration x. Lengths are divided by a
            reference length, so that they compare with angles.
        slack: dimension of the null space of the Jacobian at a regular configuration: idle spins
            of rods and redundant freedoms.
        exact: whether every nearby pose can be reached. If so, the error is zero between the given
            poses too; if not, it is minimised.
        low, high: (n,) limits of x, infinite for unlimited coordinates.
        redundant: number of redundant freedoms, included in `slack`.
        slope: gradient (n,) of a cost that redundant joints decrease, as a function of x, or None.
    """

    rows: Rows
    slack: int
    exact: bool
    low: Array
    high: Array
    redundant: int = 0
    slope: Callable[[Array], Array] | None = None

    def may(self, x: Array) -> bool:
        """Whether a configuration is within the limits."""
        return not np.any(self.beyond(x))

    def beyond(self, x: Array) -> NDArray[np.bool_]:
        """Return (n,) whether each coordinate of x is beyond its limits."""
        return np.asarray((x < self.low - WITHIN) | (x > self.high + WITHIN))


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


def carried(
    tracker: Tracker,
    start: PathPoint,
    pose: Callable[[float], Array],
    step: float,
    trail: list[tuple[float, PathPoint]] | None = None,
    curved: bool = False,
) -> tuple[PathPoint, float, float]:
    """Continue a configuration along a pose curve from parameter 0 to parameter 1.

    Args:
        tracker: equations and limits of the continuation.
        start: point at parameter 0.
        pose: target pose (4, 4) as a function of the parameter in [0, 1].
        step: first step of the parameter.
        trail: list to which (parameter, point) of every accepted step is appended.
        curved: whether the pose curve is not a straight line.

    Returns:
        Last point, its parameter and the next step size. The parameter is below 1 if the
        continuation stopped at a singular configuration, at a limit, or after `_MOST_STEPS` steps.
    """
    point, at = start, 0.0
    for _ in range(_MOST_STEPS):
        if at == 1.0 or step <= _SMALLEST_STEP or smallest(tracker, point.J) <= SINGULAR:
            break
        to = min(1.0, at + step)
        T = pose(to)
        found = _step(tracker, point, T, tracker.rows(point.x, T)[0])
        if found is None and curved:
            # near a singular configuration the curvature is amplified: predict from the tangent
            part = _TANGENT * (to - at)
            found = _step(tracker, point, T, tracker.rows(point.x, pose(at + part))[0] / _TANGENT)
        if found is None:
            step = (to - at) / 2
        else:
            point, at, step = found, to, 2 * (to - at)
            if trail is not None:
                trail.append((at, point))
    return point, at, step


def point_at(tracker: Tracker, x: Array, T: Array) -> PathPoint:
    """Return the path point of a configuration x (n,), with its error to the pose T (4, 4)."""
    r, J = tracker.rows(x, T)
    return PathPoint(x, J, float(np.max(np.abs(r))))


def smallest(tracker: Tracker, J: Array) -> float:
    """Return the smallest singular value of J (m, n) outside its regular null space."""
    values = np.linalg.svd(J, compute_uv=False)
    return float(values[J.shape[1] - 1 - tracker.slack])


def _step(tracker: Tracker, point: PathPoint, T: Array, r: Array) -> PathPoint | None:
    """Return the configuration at the next pose, or None if the step is too long.

    A redundant joint that would exceed its limit stops at the limit, and the other joints move.

    Args:
        tracker: equations and limits of the continuation.
        point: configuration before the step.
        T: (4, 4) next pose.
        r: (m,) pose error from `point` to T, or its linear estimate.
    """
    free = np.ones(point.x.size, dtype=bool)
    aim = point.x.copy()
    for _ in range(tracker.redundant + 1):
        led, back = _predicted(tracker, point, r, free, aim)
        found = _correct(tracker, led, T, free)
        reached = led if found is None else found.x
        beyond = tracker.beyond(reached) & free
        if not np.any(beyond):
            break
        free &= ~beyond
        aim = np.clip(reached, tracker.low, tracker.high)
        found = None
    if found is None or not tracker.may(found.x):
        return None
    ahead, miss = np.linalg.norm(led - point.x), np.linalg.norm(found.x - led)
    near = np.max(np.abs(found.x - point.x)) < _LARGEST and miss <= _CHANGE * ahead + _SMALL
    change = np.max(np.abs(np.linalg.eigvals(back @ (found.J - point.J)[:, free])))
    return found if near and change <= _CHANGE else None


def _predicted(
    tracker: Tracker, point: PathPoint, r: Array, free: NDArray[np.bool_], aim: Array
) -> tuple[Array, Array]:
    """Return the predicted configuration and the pseudo-inverse of the free joints' Jacobian.

    Args:
        tracker: equations and limits of the continuation.
        point: configuration before the step.
        r: (m,) pose error from `point` to the next pose.
        free: (n,) whether each joint is not stopped at a limit.
        aim: (n,) positions, of which the stopped joints take theirs.
    """
    J, move = point.J[:, free], np.where(free, 0.0, aim - point.x)
    back, _ = _pseudo_inverse(tracker, J, int(np.sum(~free)))
    move[free] = back @ (r - point.J @ move)
    if tracker.slope is not None and np.sum(~free) < tracker.redundant:
        downhill = -_GAIN * float(np.linalg.norm(r)) * tracker.slope(point.x)[free]
        still = downhill - back @ (J @ downhill)
        # at most as long as the move along the path, which must dominate the step
        most, length = float(np.linalg.norm(move)), float(np.linalg.norm(still))
        move[free] += still * min(1.0, most / max(length, NONZERO))
    return point.x + move, back


def _correct(
    tracker: Tracker, x: Array, T: Array, free: NDArray[np.bool_] | None = None
) -> PathPoint | None:
    """Newton's method from x to pose T. None without contraction or with a residual error."""
    before, free = np.inf, np.ones(x.size, dtype=bool) if free is None else free
    stopped = int(np.sum(~free))
    x = x.copy()
    r, J = tracker.rows(x, T)
    for _ in range(_ITERATIONS):
        back, gain = _pseudo_inverse(tracker, J[:, free], stopped)
        move, noise = back @ r, _NOISE * gain
        length = float(np.linalg.norm(move))
        if length > max(_CONTRACTION * before, noise):
            return None
        x[free] += move
        before = length
        r, J = tracker.rows(x, T)
        if length < noise:
            break
    left = float(np.max(np.abs(r)))
    return None if tracker.exact and left > _SMALL else PathPoint(x, J, left)


def _pseudo_inverse(tracker: Tracker, J: Array, stopped: int = 0) -> tuple[Array, float]:
    """Return the pseudo-inverse of J, truncated to its regular rank, and its norm.

    J lacks the columns of `stopped` joints, which lowers the dimension of its null space.
    """
    U, values, V = np.linalg.svd(J, full_matrices=False)
    kept = J.shape[1] - max(tracker.slack - stopped, 0)
    inverse = 1 / np.maximum(values[:kept], NONZERO)
    back: Array = (V[:kept].T * inverse) @ U[:, :kept].T
    return back, float(inverse[-1])


# Equations of a path: joints of an open chain, or all joints of a robot with closed loops.


_WHOLE = 6
_TURN = 2 * math.pi


@dataclass(frozen=True, slots=True, eq=False)
class Follower:
    """Joints that track a path, and their equations. Scaled positions are x = q / scale.

    Attributes:
        target: tracked frame and loop closure of the system.
        indices: indices in q of the joints that move.
        scale: (n,) unit of each x: 1 for angles, reference length [m] for prismatic joints.
        rows: pose error and its Jacobian, as functions of x and the target pose.
        slack: dimension of the regular null space of the Jacobian, redundant freedoms included.
        exact: whether every nearby pose can be reached.
        bounds: limits of the coordinates, or None to ignore limits.
        chain: open chain of the joints, or None for a robot with loops.
        redundant: number of freedoms beyond those that the pose determines.
        slope: gradient (n,) of a cost that redundant joints decrease, or None.
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

    @property
    def system(self) -> System:
        """Robot that the joints belong to."""
        return self.target.closing.system

    @property
    def tracker(self) -> Tracker:
        """Equations and scaled limits for the continuation."""
        low, high = self.limits
        return Tracker(self.rows, self.slack, self.exact, low, high, self.redundant, self.slope)

    @property
    def length(self) -> float:
        """Reference length [m]: the length of the arm, or 1 m for a robot with loops."""
        return 1.0 if self.chain is None else self.chain.arm(self.target.closing.p).length

    @property
    def limits(self) -> tuple[Array, Array]:
        """Lower and upper limits (n,) of the moving joints, scaled."""
        if self.bounds is None:
            return np.full(len(self.indices), -np.inf), np.full(len(self.indices), np.inf)
        return self.scaled(self.bounds.low), self.scaled(self.bounds.high)

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


def follower(
    target: Goal,
    start: Array,
    locked: Mapping[str, float] | None,
    limits: bool | Given | None,
    redundancy: Redundancy | None = None,
) -> Follower:
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
        led = Follower(target, found.indices, arm.units, rows, more, exact, ends, found, more)
    else:
        led = _closed_follower(target, start, list(locked or {}), ends)
    slope = _slope_of(led, start, redundancy)
    return replace(led, slope=slope) if led.redundant else led


def _closed_follower(
    target: Goal, start: Array, locked: list[str], ends: CoordinateLimits | None
) -> Follower:
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
    return Follower(target, moving, scale, rows, slack + more, exact, ends, None, more)


def _arm_rows(arm: Arm) -> Rows:
    library = core.core_of(arm)

    def rows(x: Array, T: Array) -> tuple[Array, Array]:
        q = (x * arm.units)[None]
        gap, J = core.examined_by(library, arm, T, q)
        return gap[0], J[0]

    return rows


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


def _slope_of(
    led: Follower, start: Array, redundancy: Redundancy | None
) -> Callable[[Array], Array] | None:
    """Return the gradient function of the redundancy cost in scaled positions, or None.

    Raises:
        ModelError: the criterion is unknown.
    """
    if callable(redundancy):
        return _given_slope(led, start, redundancy)
    if redundancy is not None and redundancy not in CRITERIA:
        raise ModelError(
            f"{led.system.name}: redundancy is {quoted(redundancy)};"
            f" {did_you_mean(redundancy, CRITERIA)}, or give a function of q that returns the"
            " gradient of a cost"
        )
    if redundancy == "limits":
        return _from_limits(*led.limits)
    return _to_manipulability(led) if redundancy == "manipulability" else None


def _given_slope(
    led: Follower, start: Array, gradient: Callable[[Array], Array]
) -> Callable[[Array], Array]:
    def slope(x: Array) -> Array:
        found = np.asarray(gradient(led.whole(start, x)), dtype=float)
        if found.shape != (start.size,) or not np.all(np.isfinite(found)):
            raise ModelError(
                f"{led.system.name}: the function given as redundancy returned {quoted(found)};"
                f" return the gradient of a cost, {start.size} finite numbers"
            )
        scaled: Array = found[list(led.indices)] * led.scale
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


def _to_manipulability(led: Follower) -> Callable[[Array], Array]:
    """Return the gradient of -log(manipulability), the product of the singular values of J.

    Source: Yoshikawa 1985.
    """
    T = np.eye(4)  # the Jacobian does not depend on the target

    def value(x: Array) -> float:
        values = np.linalg.svd(led.rows(x, T)[1], compute_uv=False)
        kept = values[: x.size - led.slack]
        return -float(np.sum(np.log(np.maximum(kept, NONZERO))))

    def slope(x: Array) -> Array:
        moves = _DIFFERENCE * np.eye(x.size)
        rises = [value(x + move) - value(x - move) for move in moves]
        return np.array(rises) / (2 * _DIFFERENCE)

    return slope


# Path of poses: an array, or a function of a parameter between 0 and 1.


@dataclass(frozen=True, slots=True, eq=False)
class Path:
    """Sequence of poses with an interpolation between them.

    Attributes:
        poses: (N, 4, 4) poses [m].
        function: pose (4, 4) as a function of the parameter in [0, 1], or None. Without it, poses
            are interpolated by straight lines.
    """

    poses: Array
    function: Callable[[float], Array] | None = None

    @property
    def count(self) -> int:
        """Number of poses."""
        return len(self.poses)

    def curve(self, first: Array) -> Callable[[float], Array]:
        """Return the pose as a function of a real pose index u in [-1, count - 1].

        u = -1 is the pose `first` (4, 4), an integer u is a pose of the path.
        """
        lines = dict[int, Callable[[float], Array]]()

        def pose(u: float) -> Array:
            number = math.ceil(u)
            if number == u and number >= 0:
                return np.asarray(self.poses[number])
            if self.function is not None and number > 0:
                return self.function(u / (self.count - 1))
            if number not in lines:
                lines.clear()
                before = self.poses[number - 1] if number > 0 else first
                lines[number] = straight(before, self.poses[max(number, 0)])
            return lines[number](u - number + 1)

        return pose


def path_of(system: System, path: Any, samples: int) -> Path:
    """Convert the `path` argument of `follow` to a Path.

    Raises:
        ModelError: the path is empty, or neither an array of poses nor a function of poses.
    """
    if not callable(path):
        poses = target_poses(system, path)
        if not len(poses):
            raise ModelError(f"{system.name}: the path has no pose; give one at least")
        return Path(poses)
    if not (isinstance(samples, int) and samples >= 2):
        raise ModelError(
            f"{system.name}: samples is {quoted(samples)}; give a whole number above 1"
        )

    def function(s: float) -> Array:
        return target_pose(system, path(s))

    numbers = np.linspace(0.0, 1.0, samples).tolist()
    return Path(_sampled(system, path, numbers), function)


def _sampled(system: System, path: Callable[[float], Any], numbers: list[float]) -> Array:
    """Evaluate a pose function at N parameters and return the poses (N, 4, 4)."""
    poses = np.empty((len(numbers), 4, 4))
    for k, s in enumerate(numbers):
        given = path(s)
        T = given if isinstance(given, np.ndarray) else pose_numbers(given)
        if T is None or T.shape != (4, 4) or T.dtype != poses.dtype:
            T = target_pose(system, given)
        poses[k] = T  # a copy: the function may write the next pose over it
    return target_poses(system, poses)


def straight(before: Array, after: Array) -> Callable[[float], Array]:
    """Interpolate two poses (4, 4) by a straight line and a rotation about a fixed axis.

    The result is a function of a parameter in [0, 1].
    """
    gap = gap_to(after, before)

    return lambda s: after if s == 1.0 else moved(before, s * gap)


def moved(T: Array, gap: Array) -> Array:
    """Return the pose T (4, 4) displaced by `gap` (6,), in base axes.

    `gap` contains a translation of the origin [m] and a rotation vector [rad].
    """
    pose = T.copy()
    pose[:3, :3] = _turn(gap[3:]) @ T[:3, :3]
    pose[:3, 3] += gap[:3]
    return pose


def _turn(vector: Array) -> Array:
    """Return the rotation matrix (3, 3) of a rotation vector (3,) [rad].

    Source: Rodrigues 1840.
    """
    angle = float(np.linalg.norm(vector))
    x, y, z = vector / angle if angle > 0 else vector
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    turned: Array = np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K
    return turned


# Vectorised tracking of one branch of a closed form.
#
# A branch is a continuous function of the pose until one of its roots becomes double or a joint
# becomes undetermined, that is until an indicator of the closed form vanishes. It is assumed not to
# vanish between two poses if the smallest indicator is nearly equal at both, and also in the
# intervals before and after. All other intervals are tracked step by step.


_BLOCK = 20_000
"""Number of poses per block: some megabytes of memory for each branch."""
_SHORT = 20
"""Number of poses below which single steps (1 to 2 ms each) are faster than the derivation of the
closed form of a new robot."""
_RATIO = 2.0
"""Largest ratio of the branch indicator at two neighbouring poses: a change by `_CHANGE`."""
_NEARER = 0.25
"""Largest ratio of the distances of the nearest and the second nearest solution from a prediction
at which the nearest is selected."""
_ON = 1e-6
"""Largest difference [rad or arm lengths] between a tracked configuration and its branch of the
closed form. Tracked configurations have an error of at most 1e-9."""


@dataclass(frozen=True, slots=True, eq=False)
class Runs:
    """All branches of the closed form at a block of N poses.

    Attributes:
        first: index of the first pose of the block.
        q: (N, branches, n) scaled configurations.
        residual: (N, branches) pose error of each configuration.
        good: (N, branches) whether each configuration reaches the pose and is no double root.
        size: (N, branches) indicator that vanishes where branches meet.
        arm: open chain of the joints.
        limits: lower and upper limits (n,) of the scaled positions.
    """

    first: int
    q: Array
    residual: Array
    good: NDArray[np.bool_]
    size: Array
    arm: Arm
    limits: tuple[Array, Array]

    def after(self, number: int, x: Array) -> tuple[Array, Array]:
        """Continue x (n,) from pose `number` over the poses at which its branch is certain.

        Returns:
            Configurations (k, n) at the next k poses, and their pose errors (k,).
        """
        row = number - self.first
        apart = np.max(np.abs(self.arm.wrapped(self.q[row] - x)), axis=1)
        branch = int(np.argmin(apart))
        if apart[branch] > _ON:
            return _no_run(x.size)
        # include the preceding interval: all neighbours of an interval must be even as well
        first = max(row - 1, 0)
        q, size = self.q[first:, branch], self.size[first:, branch]
        good = self.good[first:, branch]
        move = self.arm.wrapped(np.diff(q, axis=0))
        even = good[:-1] & good[1:] & (np.max(np.abs(move), axis=1) < _LARGEST)
        even &= np.maximum(size[:-1], size[1:]) <= _RATIO * np.minimum(size[:-1], size[1:])
        certain = even.copy()
        certain[1:] &= even[:-1]
        certain[:-1] &= even[1:]
        q, move, certain = q[row - first :], move[row - first :], certain[row - first :]
        count = int(np.argmin(certain)) if not np.all(certain) else len(certain)
        led = x + np.cumsum(move[:count], axis=0)
        turns = np.where(self.arm.prismatic, 0.0, np.round((led - q[1 : count + 1]) / _TURN))
        led = q[1 : count + 1] + _TURN * turns
        low, high = self.limits
        within = np.all((led >= low - WITHIN) & (led <= high + WITHIN), axis=1)
        count = count if np.all(within) else int(np.argmin(within))
        return led[:count], self.residual[row + 1 : row + 1 + count, branch]

    def nearest(self, number: int, x: Array) -> tuple[Array, float] | None:
        """Return the solution at pose `number` that is much nearer to x (n,) than all others.

        Returns:
            Configuration (n,) and its pose error. None if no solution is much nearer, or if the
            pose is not in the block.
        """
        row = number - self.first
        if not 0 <= row < len(self.q) or not np.any(self.good[row]):
            return None
        branches = np.flatnonzero(self.good[row])
        away = self.arm.wrapped(self.q[row, branches] - x)
        distance = np.linalg.norm(away, axis=1)
        best = int(np.argmin(distance))
        others = distance[np.linalg.norm(away - away[best], axis=1) > _ON]
        if distance[best] > _NEARER * np.min(others, initial=np.inf):
            return None
        return x + away[best], float(self.residual[row, branches[best]])


def _no_run(joints: int) -> tuple[Array, Array]:
    return np.empty((0, joints)), np.empty(0)


def _runs(led: Follower, poses: Path, number: int, known: Runs | None) -> Runs | None:
    """Return the branches at a block of poses from index `number`, or None.

    None without a closed form, for redundant or few poses, and at the last pose.
    """
    if known is not None and known.first <= number < known.first + len(known.q) - 1:
        return known
    last = number == poses.count - 1
    if led.chain is None or led.redundant or last:
        return None
    if poses.count < _SHORT and known is None:
        return None
    p = led.target.closing.p
    try:
        sequence = sequence_of(led.chain, "auto", p)
    except NoClosedForm:
        return None
    T = poses.poses[number : number + _BLOCK]
    every = batch(led.chain, sequence, p, T, np.zeros((len(T), 0)))
    arm = led.chain.arm(p)
    good = every.residual <= SOLVED * max(1.0, arm.length)
    size = np.minimum(every.real, every.regular)
    good &= size > 0
    return Runs(number, every.q / led.scale, every.residual, good, size, arm, led.limits)


# Crossing of a singular configuration: smooth continuation of the joint path.
#
# On a smooth curve of poses the joint path before the singular configuration is extrapolated past
# it. Newton's method corrects the prediction. If the joint path is smooth, the ratio of the
# correction to the distance between the two sides tends to zero with this distance. If the joint
# path has a corner, the ratio is constant. If another branch is needed, the correction itself does
# not tend to zero.
#
# The motion of the frame between poses of an array is not specified. A smooth curve through the
# joints is accepted if its deviation from the straight line is at most that of a smooth curve
# through the poses.


_NEAREST = 1e-4
"""Smallest distance from a singular configuration, as a fraction of the segment between two poses:
amplified rounding errors are still far smaller than the distance itself."""
_SMOOTH = 0.4
"""Largest ratio of the relative corrections for half and full distance at a smooth crossing. The
ratio is 1/4 for a smooth joint path and at least 1 for a corner or jump."""
_LITTLE = 1e-6
"""Relative correction below which a joint path is smooth up to rounding errors."""
_FAIR, _HALF = 0.1, 0.5
"""Largest relative corrections: along the curve itself, and from pose to pose."""
_LONGEST_LEAP = 0.5
"""First distance to either side of a singular configuration, in segments between two poses."""
_LEAST_LEAP = 0.03
"""Smallest distance, in segments, for redundant joints near a singular configuration. They miss it
by rounding errors and the step length, so that their path turns aside close to it."""
_BESIDE = 0.1
"""Largest correction [rad or arm lengths] from an interpolated configuration to a solution."""
_AT_POSE = 1e-3
"""Distance before a pose, as a fraction of the segment between two poses, at which the pose itself
may be the singular one."""
_WATCHED = 1e-4
"""Smallest singular value above which a stopped path did not end at a singular configuration but
at a limit or out of reach."""
_ALIKE = 0.9
"""Cosine of the largest angle (26 degrees) between the null spaces before and after a crossing. The
angle is small in a crossing and 90 degrees if the path turns aside."""
_UNCERTAIN = 0.25
"""Largest pose error of interpolated joints, relative to the distance between the straight line and
a smooth curve through the poses: the joints must be as smooth as the poses."""
_TURN_OFF = 0.05
"""Prediction error of a step, relative to the step before, above which a crossing of a nearby
singular configuration is examined as a smoother continuation."""
_NEAR_STEPS = 3.0
"""Distance in steps within which a singular configuration is near. The smallest singular value
approximates the distance to a singular configuration."""


def _added(predicted: Array, found: Array, last: Array) -> float:
    """Return the correction |found - predicted| relative to the distance |found - last|."""
    way = max(float(np.linalg.norm(found - last)), NONZERO)
    return float(np.linalg.norm(found - predicted)) / way


def _settled(led: Follower, x: Array, T: Array) -> Array | None:
    """Return a solution (n,) of pose T near x, which may be singular, or None."""

    def residual(z: Array) -> tuple[Array, Array]:
        r, J = led.rows(z, T)
        return -r, J

    def missing(z: Array) -> float:
        return float(np.max(np.abs(led.rows(z, T)[0])))

    # singular directions keep their positions: moving along them changes rounding errors only
    y = gauss_newton(residual, x, rank_tolerance=SINGULAR).x
    most = _OFF if led.chain is None else SOLVED
    # otherwise use the full numerical rank, then damped least squares
    if missing(y) > most:
        y = gauss_newton(residual, y).x
    if missing(y) > most:
        y = _descended(led, x, T)
    near = float(np.max(np.abs(y - x))) < _BESIDE
    return y if near and missing(y) <= most else None


def _descended(led: Follower, x: Array, T: Array) -> Array:
    """Minimise the pose error from x, also if the Jacobian is rank-deficient; return (n,)."""
    if led.chain is not None:
        arm = led.chain.arm(led.target.closing.p)
        better = polish(arm, T, (x * led.scale)[None]).q[0]
        return x + arm.wrapped(better - x * led.scale) / led.scale

    def residual(z: Array) -> tuple[Array, Array]:
        r, J = led.rows(z, T)
        return -r, J

    return levenberg_marquardt(residual, x).x


def _goes_across(led: Follower, before: Array, behind: Array) -> bool:
    """Whether two configurations are on opposite sides of a singularity; True if not redundant.

    On opposite sides the null space of the Jacobian is nearly equal, and det([J; null space]) has
    opposite signs. Redundant joints that turn aside near a singularity stay on one side.
    """
    if not led.redundant:
        return True
    T = np.eye(4)  # the Jacobian does not depend on the target
    (_, J), (_, K), kept = led.rows(before, T), led.rows(behind, T), before.size - led.slack
    still = np.linalg.svd(J)[2][kept:]
    alike = np.linalg.svd(still @ np.linalg.svd(K)[2][kept:].T)[1][led.redundant - 1] > _ALIKE
    if len(J) != kept:  # closed loops have linearly dependent rows
        return bool(alike)
    signs = [np.linalg.slogdet(np.vstack([rows, still]))[0] for rows in (J, K)]
    return bool(alike) and signs[0] != signs[1]


def _nearest_solution(led: Follower, x: Array, T: Array) -> Array | None:
    """Return the solution (n,) of pose T nearest to x, or None. Open chains only."""
    if led.chain is None:
        return None
    if led.redundant:  # infinitely many solutions: take a local one
        return _settled(led, x, T)
    p = led.target.closing.p
    q = solve_at(led.chain, NOT_VARIED, T, "auto", p).q[:, list(led.indices)]
    if not len(q):
        return None
    away = led.chain.arm(p).wrapped(q / led.scale - x)
    nearest: Array = x + away[int(np.argmin(np.linalg.norm(away, axis=1)))]
    return nearest


def _lagrange(nodes: Sequence[float] | range, values: Array, u: float) -> Array:
    """Evaluate at u the interpolating polynomial through values (k, n) at k nodes."""
    total = np.zeros(values.shape[1])
    for k, own in enumerate(nodes):
        others = [other for m, other in enumerate(nodes) if m != k]
        total += values[k] * math.prod((u - other) / (own - other) for other in others)
    return total


# Error texts for a path that could not be followed to its end.


_AT_LIMIT = 1e-6
"""Distance from a joint limit [rad or m] below which the limit is the reason to stop. Step halving
ends much nearer, and a stop for another reason is rarely so near."""
_REACHED = 1e-6
"""Largest error row at a reachable pose: 1e-6 is the square root of 1e-12, the error of solutions,
and rounding has this effect at a double root."""
_STARTS, _SEED = 6, 20260109
_NUDGE = 1e-3
"""Move of a joint [rad or arm lengths] to find the joint that changes the smallest singular value
most: longer than the distance to the singular configuration (1e-7), shorter than to the next."""


def stop_reason(led: Follower, poses: Path, number: int, q: Array, at: float) -> str:
    """Return the text that explains why a pose was not reached.

    Args:
        led: joints that track the path.
        poses: path.
        number: index of the pose.
        q: (nq,) last configuration.
        at: position of the last configuration between the preceding pose (0) and this pose (1).
    """
    x, T = led.scaled(q), poses.poses[number]
    title = f"pose {number} of {poses.count}"
    if at == 1.0:
        return f"{title} is not one that the joints can take: {_miss(led, q, T)}"
    passed = led.passed(x, _AT_LIMIT)
    if passed is not None:
        index, limit = passed
        name = led.system.coordinates[index].name
        return f"joint {name} passes its limit {limit:.6g} before {title}"
    nearest, left = _nearest(led, x, T)
    if left > _REACHED:
        return f"{title} is out of reach: {_miss(led, led.whole(q, nearest), T)}"
    where = f"between the start and pose 0 of {poses.count}"
    if number:
        part = (number - 1 + at) / (poses.count - 1)
        where = (
            f"between poses {number - 1} and {number} of {poses.count}, at {part:.4g} of the path"
        )
    behind = _jump(led, x, poses.poses[min(number + (1 - at < _AT_POSE), poses.count - 1)])
    return f"stopped {where}: singular configuration, {_singular(led, q)}{behind}"


def _jump(led: Follower, x: Array, T: Array) -> str:
    """Text on the joint that would jump most to the solution past the singular configuration.

    For redundant joints: text if no solution near x was found.
    """
    behind = _nearest_solution(led, x, T)
    if led.redundant and behind is None and led.chain is not None:
        return (
            "; beside it no configuration was found for the pose behind, as where what is redundant"
            " has no room left; another redundancy or another start may lead past"
        )
    if led.redundant or behind is None:
        return ""
    farthest = int(np.argmax(np.abs(behind - x)))
    coordinate = led.system.coordinates[led.indices[farthest]]
    move = abs(float(behind[farthest] - x[farthest])) * float(led.scale[farthest])
    far = f"{math.degrees(move):.4g} degrees" if coordinate.unit == "rad" else f"{move:.4g} m"
    return (
        "; no configuration behind it goes on smoothly, in the nearest one"
        f" {coordinate.name} is {far} away"
    )


def _miss(led: Follower, q: Array, T: Array) -> str:
    gap = gap_to(T, led.pose(q))
    distance, angle = float(np.linalg.norm(gap[:3])), float(np.linalg.norm(gap[3:]))
    return f"the nearest configuration found leaves the frame {apart(distance, angle)}"


def _nearest(led: Follower, x: Array, T: Array) -> tuple[Array, float]:
    """Return the best least-squares configuration (n,) of several starts, and its pose error."""

    def residual(y: Array) -> tuple[Array, Array]:
        r, J = led.rows(y, T)
        return -r, J

    rng = np.random.default_rng(_SEED)
    best, least = x, np.inf
    for k in range(_STARTS):
        low = levenberg_marquardt(residual, x + rng.uniform(-1, 1, x.size) * k / _STARTS)
        root = gauss_newton(residual, low.x)
        left = float(np.max(np.abs(led.rows(root.x, T)[0])))
        if left < least:
            best, least = root.x, left
        if least < _REACHED:
            break
    return best, least


def _singular(led: Follower, q: Array) -> str:
    """Text with the smallest singular value and the joint on which it depends most."""
    x, T = led.scaled(q), led.pose(q)

    def value(y: Array) -> float:
        return smallest(led.tracker, led.rows(y, T)[1])

    moved = np.eye(x.size) * _NUDGE
    rises = [value(x + step) + value(x - step) for step in moved]
    index = led.indices[int(np.argmax(rises))]
    name = led.system.coordinates[index].name
    return f"{name} = {q[index]:.3f}, smallest singular value {round(value(x), 12):.1g}"


# Tracking of a path: blocks of a closed form, single poses, steps, and singularity crossings.


_TRAIL = 40
"""Number of configurations kept of the way: each step halves the remaining distance."""
_OFF = 1e-9
"""Largest error row at a reached pose. Solutions have an error of 1e-12, and rounding errors are
larger near singular configurations."""
_PARTS = 0.25, 0.5, 0.75, 1.0
"""Fractions of the segment to the next pose at which the pose must equal the current one for the
joints to stay at rest."""
_AFTER_STOP, _AFTER_LEAP = 1e-3, 1e-2
"""First steps, as fractions of the next segment. After small steps, ten doublings restore the full
segment; past a singular configuration steps are short."""


@dataclass(frozen=True, slots=True, eq=False)
class Leap:
    """Crossing of a singular configuration.

    Attributes:
        x: (k, n) scaled configurations at the next k poses.
        u: pose index at which the crossing ends; fractional between two poses.
        end: (n,) scaled configuration at u.
    """

    x: Array
    u: float
    end: Array


@dataclass(slots=True, eq=False)
class Walk:
    """State of the tracking of a path. `walk` creates it at the start.

    Attributes:
        led: joints that track the path.
        tracker: equations and limits of `led`.
        poses: path.
        curve: pose as a function of the real pose index u, -1 at the start.
        start: (nq,) configuration at u = -1.
        found: (N, n) scaled configurations; the rows below `number` are set.
        residual: (N,) pose errors; the elements below `number` are set.
        number: index of the next pose.
        u: current pose index; fractional between two poses.
        point: configuration at u.
        trail: last configurations on the path, each with its pose index.
        step: next step size, as a fraction of the segment to the next pose.
        runs: branches of the closed form at the current block of poses, or None.
    """

    led: Follower
    tracker: Tracker
    poses: Path
    curve: Callable[[float], Array]
    start: Array
    found: Array
    residual: Array
    number: int
    u: float
    point: PathPoint
    trail: list[tuple[float, PathPoint]]
    step: float = 1.0
    runs: Runs | None = None

    def go(self) -> str:
        """Track the path to its end or until it stops. Return the reason of a stop, or ""."""
        while self.number < self.poses.count:
            at_pose = self.u == self.number - 1 and self.number > 0
            if self._stays() or (at_pose and (self._run() or self._smooth_step())):
                continue
            reason = self._on()
            if reason:
                return reason
        return ""

    def _stays(self) -> bool:
        """Keep a singular configuration if the next pose is equal; return whether it is."""
        if smallest(self.tracker, self.point.J) > SINGULAR:
            return False
        way, x = self.number - self.u, self.point.x
        for part in _PARTS:
            rows = self.tracker.rows(x, self.curve(self.u + part * way))[0]
            if np.max(np.abs(rows), initial=0.0) > _OFF:
                return False
        q = self.led.whole(self.start, x)
        self._arrive(x[None], [self.led.residual(q, self.poses.poses[self.number])])
        return True

    def _arrive(self, x: Array, residual: Array | list[float]) -> None:
        """Store configurations x (k, n) and pose errors of the next k poses, and move there."""
        first, self.number = self.number, self.number + len(x)
        self.found[first : self.number], self.residual[first : self.number] = x, residual
        self.u, self.trail = self.number - 1.0, self._last_poses()
        self.point = self.trail[-1][1]

    def _last_poses(self) -> list[tuple[float, PathPoint]]:
        """Return the last three reached poses as a trail."""
        numbers = range(max(0, self.number - 3), self.number)
        found, T = self.found, self.poses.poses
        return [(float(k), point_at(self.tracker, found[k], T[k])) for k in numbers]

    # many poses at once, and single ones next to a singular configuration

    def _run(self) -> bool:
        """Advance over poses on one branch of the closed form; return whether there are any."""
        self.runs = _runs(self.led, self.poses, self.number - 1, self.runs)
        if self.runs is None:
            return False
        run, missed = self.runs.after(self.number - 1, self.point.x)
        if len(run):
            self._arrive(run, missed)
        return bool(len(run))

    def _smooth_step(self) -> bool:
        """Advance one pose if a closed-form solution continues smoothly; return whether so."""
        number, found, runs = self.number, self.found, self.runs
        if runs is None or self.poses.function is not None or number < 3:
            return False
        nodes, x = [float(k) for k in range(number - 3, number)], found[number - 3 : number]
        predicted = _lagrange(nodes, x, float(number))
        own = runs.nearest(number, predicted)
        if own is None or _added(predicted, own[0], x[-1]) > _FAIR or not self.tracker.may(own[0]):
            return False
        nodes, x = [*nodes[1:], float(number)], np.vstack([x[1:], own[0]])
        predicted = _lagrange(nodes, x, number + 1.0)
        beyond = runs.nearest(number + 1, predicted)
        if beyond is not None and _added(predicted, beyond[0], own[0]) <= _FAIR:
            nodes, x = [*nodes, number + 1.0], np.vstack([x, beyond[0]])
        if not self._is_fair(nodes, x, number):
            return False
        self._arrive(own[0][None], [own[1]])
        return True

    # step by step

    def _on(self) -> str:
        """Step to the next pose or past a singularity. Return the reason of a stop, or ""."""
        led, number, way = self.led, self.number, list[tuple[float, PathPoint]]()
        allowed = not led.redundant or self.tracker.may(self.point.x)
        segment = _segment(self.curve, self.u, number)
        last, at = self.point, 0.0
        if allowed:
            curved, first = self.poses.function is not None, min(1.0, self.step)
            last, at, self.step = carried(self.tracker, self.point, segment, first, way, curved)
        u, way_left = self.u, number - self.u
        self.trail = self.trail[-_TRAIL:] + [(u + s * way_left, passed) for s, passed in way]
        self.u = float(number) if at == 1.0 else u + at * way_left
        self.step = max(self.step, _AFTER_STOP)
        stopped = at < 1.0 or last.left > _OFF
        leap = self._leap(stopped) if allowed and (stopped or self._turns_off(last)) else None
        if leap is not None:
            self._land(leap)
            return ""
        self.point = last
        q = led.whole(self.start, last.x)
        if stopped:
            return stop_reason(led, self.poses, number, q, self.u - number + 1)
        self.found[number] = last.x
        self.residual[number] = led.residual(q, self.poses.poses[number])
        self.number += 1
        return ""

    def _turns_off(self, point: PathPoint) -> bool:
        """Whether a step near a singularity deviates from the extrapolated joint path."""
        number, found = self.number, self.found
        if number < 2:
            return False
        first = max(0, number - 3)
        known = found[first:number]
        predicted = _lagrange(range(first, number), known, number)
        before = float(np.linalg.norm(known[-1] - known[-2]))
        if float(np.linalg.norm(point.x - predicted)) <= max(_TURN_OFF * before, _SMALL):
            return False
        longest = max(before, float(np.linalg.norm(point.x - known[-1])))
        return smallest(self.tracker, point.J) < _NEAR_STEPS * longest

    def _land(self, leap: Leap) -> None:
        """Store the configurations of a crossing and move to its end."""
        passed = slice(self.number, self.number + len(leap.x))
        self.found[passed] = leap.x
        self.residual[passed] = [
            self.led.residual(self.led.whole(self.start, x), T)
            for x, T in zip(leap.x, self.poses.poses[passed], strict=True)
        ]
        self.number, self.u, self.step = self.number + len(leap.x), leap.u, _AFTER_LEAP
        self.point = point_at(self.tracker, leap.end, self.curve(self.u))
        at_pose = self.u == self.number - 1
        self.trail = self._last_poses() if at_pose else [(self.u, self.point)]

    # past a singular configuration

    def _leap(self, stopped: bool) -> Leap | None:
        """Return a smooth crossing of the singular configuration, or None.

        Args:
            stopped: whether the continuation stopped before the next pose.
        """
        near = self.trail[-1][1]
        if stopped and smallest(self.tracker, near.J) > _WATCHED:
            return None
        if self.poses.function is None and self.led.chain is not None:
            between = self._leap_between(stopped)
            if between is not None:
                return between
        if stopped:
            return self._leap_along(self.trail, _NEAREST)
        if self.led.redundant and self.poses.function is not None:
            singular = [smallest(self.tracker, point.J) for _, point in self.trail]
            return self._leap_along(self.trail[: int(np.argmin(singular)) + 1], _LEAST_LEAP)
        return None

    def _leap_along(self, trail: list[tuple[float, PathPoint]], least: float) -> Leap | None:
        """Cross the singular configuration along the pose curve; None if the path is not smooth.

        Args:
            trail: configurations up to the singular configuration.
            least: smallest distance to either side, in segments between poses.
        """
        tracker, poses, number = self.tracker, self.poses, self.number
        at, end = trail[-1][0], float(poses.count - 1)
        # straight lines between poses have corners at the poses
        start = max(trail[0][0], number - 1.0 if poses.function is None else min(0.0, at - 1.0))
        way, before = min((at - start) / 3, _LONGEST_LEAP), np.inf
        while way > least:
            nodes = [at - 3 * way, at - 2 * way, at - way]
            x = [self._configuration_at(trail, u) for u in nodes]
            if any(one is None for one in x):
                return None
            to = min(at + way, end)
            predicted = _lagrange(nodes, np.array(x), to)
            if to - at < _NEAREST:  # the path ends at the singular configuration
                behind = _settled(self.led, predicted, poses.poses[-1])
            else:
                corrected = _correct(tracker, predicted, self.curve(to))
                behind = None if corrected is None else corrected.x
            ratio = np.inf
            if behind is not None and tracker.may(behind):
                ratio = _added(predicted, behind, np.asarray(x[-1]))
            smooth = ratio < _FAIR and ratio < max(_LITTLE, _SMOOTH * before)
            if behind is not None and smooth and _goes_across(self.led, np.asarray(x[-1]), behind):
                numbers = range(number, math.floor(to) + 1)
                passed = self._passed([*nodes, to], np.array([*x, behind]), numbers)
                return None if passed is None else Leap(passed, to, behind)
            way, before = way / 2, ratio if ratio < _FAIR else 1.0
        return None

    def _configuration_at(self, trail: list[tuple[float, PathPoint]], u: float) -> Array | None:
        """Return the configuration (n,) at pose index u on the tracked path, or None."""
        known = [one for one in trail if one[0] <= u]
        if not known:
            return None
        at, point = known[-1]
        if at == u:
            return point.x
        segment = _segment(self.curve, at, u)
        last, reached, _ = carried(self.tracker, point, segment, 1.0, curved=True)
        return last.x if reached == 1.0 else None

    def _leap_between(self, stopped: bool) -> Leap | None:
        """Cross the singular configuration from pose to pose; None if the path is not smooth."""
        before, number = self._before(), self.number
        if before is None:
            return None
        # the next pose may be the singular one itself
        beyond = number + 1
        ends = [beyond if stopped and number - self.trail[-1][0] < _AT_POSE else number]
        if self.led.redundant and ends[0] < beyond < self.poses.count:
            ends.append(beyond)
        leaps = (self._leap_to(*before, to) for to in ends)
        return next((leap for leap in leaps if leap is not None), None)

    def _leap_to(self, nodes: list[float], x: Array, to: int) -> Leap | None:
        """Cross from configurations x (k, n) at pose indices `nodes` to the pose `to`, or None."""
        led, poses, number, may = self.led, self.poses, self.number, self.tracker.may
        predicted = _lagrange(nodes, x, float(min(to, poses.count - 1)))
        if to >= poses.count:  # the path ends at the singular configuration
            last = _settled(led, predicted, poses.poses[-1])
            if last is None or _added(predicted, last, x[-1]) > _FAIR or not may(last):
                return None
            return Leap(last[None], number, last)
        behind = self._smooth_solution(predicted, to, x[-1])
        if behind is None or not may(behind) or not _goes_across(led, x[-1], behind):
            return None
        nodes, x = [*nodes[-2:], float(to)], np.vstack([x[-2:], behind])
        beyond = None
        if to + 1 < poses.count:
            beyond = self._smooth_solution(_lagrange(nodes, x, to + 1.0), to + 1, behind)
        if beyond is not None:
            nodes, x = [*nodes, to + 1.0], np.vstack([x, beyond])
        if not self._is_fair(nodes, x, to):
            return None
        passed = self._passed(nodes, x, range(number, to + 1))
        return None if passed is None else Leap(passed, float(to), behind)

    def _before(self) -> tuple[list[float], Array] | None:
        """Return pose indices and configurations of two or three previous points, or None."""
        number, found = self.number, self.found
        if number >= 2:
            first = max(0, number - 3)
            return [float(k) for k in range(first, number)], found[first:number]
        at = self.trail[-1][0]
        inner = [one for one in self.trail if 0 < one[0] < at]
        if number == 0 or not inner:
            return None
        u, point = min(inner, key=lambda one: abs(one[0] - at / 2))
        return [0.0, u], np.array([found[0], point.x])

    def _smooth_solution(self, predicted: Array, number: int, last: Array) -> Array | None:
        """Return the solution (n,) at a pose nearest to the prediction, or None if too far."""
        found = _nearest_solution(self.led, predicted, self.poses.poses[number])
        most = _FAIR if self.led.redundant else _HALF
        return None if found is None or _added(predicted, found, last) > most else found

    def _passed(self, nodes: Sequence[float], x: Array, numbers: range) -> Array | None:
        """Interpolate configurations x (m, n) at nodes and solve the poses `numbers`.

        Return (k, n), or None if a pose has no solution nearby.
        """
        passed = list[Array]()
        for k in numbers:
            own = [y for u, y in zip(nodes, x, strict=True) if u == k]
            T, predicted = self.poses.poses[k], _lagrange(nodes, x, float(k))
            y = own[0] if own else _settled(self.led, predicted, T)
            if y is None or not self.tracker.may(y):
                return None
            passed.append(y)
        return np.array(passed).reshape(len(passed), x.shape[1])

    def _is_fair(self, nodes: Sequence[float], x: Array, to: int) -> bool:
        """Whether interpolated joints deviate from the path as little as interpolated poses do.

        Args:
            nodes: pose indices around the interval from the last pose to `to`.
            x: (k, n) configurations at the nodes.
            to: index of the pose at the end of the interval.
        """
        led, poses, before = self.led, self.poses.poses, self.number - 1
        T, middle = poses[before], (before + to) / 2
        rows = np.array([gap_to(self.curve(u), T) for u in nodes])
        middle_pose = moved(T, _lagrange(nodes, rows, middle))
        if to > self.number:
            middle_pose = poses[self.number]
        line = straight(T, poses[to])(0.5)
        units = np.array([led.length] * 3 + [1.0] * 3)
        chord = float(np.max(np.abs(gap_to(line, middle_pose) / units)))
        gap = float(np.max(np.abs(led.rows(_lagrange(nodes, x, middle), middle_pose)[0])))
        return gap <= _UNCERTAIN * chord + _OFF


def walk(led: Follower, poses: Path, q: Array) -> Walk:
    """Return the initial tracking state at a configuration q (nq,), before the first pose."""
    tracker, x, curve = led.tracker, led.scaled(q), poses.curve(led.pose(q))
    point = point_at(tracker, x, curve(-1.0))
    found, residual = np.empty((poses.count, x.size)), np.empty(poses.count)
    return Walk(led, tracker, poses, curve, q, found, residual, 0, -1.0, point, [(-1.0, point)])


def _segment(curve: Callable[[float], Array], u: float, to: float) -> Callable[[float], Array]:
    """Return the pose curve from pose index u to `to`, as a function of [0, 1]."""
    return lambda s: curve(to if s == 1.0 else u + s * (to - u))


# Public function: the joints move continuously along the path, or stop with a reason.


@dataclass(frozen=True, slots=True, eq=False)
class Conditioning:
    """Data from which the smallest singular values along a path are computed.

    Attributes:
        arm: open chain of the joints, or None if the singular values are already known.
        values: (k, n) scaled configurations of `arm`, or (k,) the singular values.
    """

    arm: Arm | None
    values: Array

    def smallest(self) -> Array:
        """Return the smallest singular values (k,)."""
        if self.arm is None:
            return self.values
        q = self.values * self.arm.units
        J = examine_arm(self.arm, np.eye(4), q)[2]  # the Jacobian does not depend on the target
        return np.asarray(np.linalg.svd(J, compute_uv=False)[:, -1], dtype=float)


@dataclass(frozen=True, eq=False)
class Followed:
    """Joint path along a sequence of poses.

    Attributes:
        q: (k, nq) configurations at the reached poses [rad or m]. Angles are continuous and may
            exceed half a revolution.
        reached: index of the last reached pose, counted from 0; -1 if no pose was reached.
        reason: text that explains why the path stopped; empty if its end was reached.
        residual: (k,) largest absolute pose error or loop closure error.
        stopped_at: (nq,) last configuration; between two poses if the path stopped there.
    """

    q: Array
    reached: int
    reason: str
    residual: Array
    stopped_at: Array
    _conditioning: Conditioning = field(repr=False)

    @functools.cached_property
    def singular_values(self) -> Array:
        """Smallest singular values (k,) of the Jacobian, lengths divided by the arm length."""
        return self._conditioning.smallest()


def follow(
    system: System,
    path: Any,
    start: Any,
    frame: str | int | None = None,
    *,
    samples: int = 101,
    locked: Mapping[str, float] | None = None,
    limits: bool | Given | None = None,
    redundancy: Redundancy | None = None,
    parameters: Mapping[str, float] | None = None,
) -> Followed:
    """Compute joint positions along a path of poses, on the branch of the start configuration.

    Between two poses of an array the frame moves along a straight line and rotates about a fixed
    axis; a function specifies any curve. Steps are small enough to stay on one branch. A singular
    configuration is crossed if the joint path is smooth there; otherwise the path stops before it,
    with a reason. With fewer than six joints every pose must be reachable, and between the poses
    the frame is as close to the line as possible.

    Args:
        system: robot, open or with closed loops. Loops keep the assembly mode of the start.
        path: (N, 4, 4) poses of the frame in the base [m], or a function that returns such a pose
            for a parameter in [0, 1].
        start: (nq,) positions near the first pose, a dict by name, or a solution with attribute
            `q`. The frame first moves from its pose at the start to the first pose.
        frame: name of a body or frame, or index of a link; default is the terminal frame.
        samples: number of poses at which a path function is evaluated.
        locked: positions of joints that do not move, by name [rad or m].
        limits: (lower, upper) by joint name, to replace limits of the model; None for an unlimited
            joint. False ignores all limits.
        redundancy: criterion for redundant joints: "minimum velocity" (default), "limits" (away
            from joint limits), "manipulability" (away from singular configurations), or a function
            that returns the gradient (nq,) of a cost at q.
        parameters: values of parameters by name; default values for all others.

    Returns:
        Configurations up to the last reached pose, and the reason if the path stopped before its
        end.

    Raises:
        ModelError: a pose, a name, a criterion or the start is invalid.
    """
    require_system(system)
    name = terminal_frame(system) if frame is None else frame
    poses = path_of(system, path, samples)
    q = _start(system, start, locked)
    target = goal(system, name, np.eye(4), None, parameters)
    led = follower(target, q, locked, limits, redundancy)
    way = walk(led, poses, q)
    reason, number = way.go(), way.number
    rows, x = np.tile(q, (number, 1)), way.found[:number]
    rows[:, list(led.indices)] = x * led.scale
    last, missed = led.whole(q, way.point.x), way.residual[:number]
    return Followed(rows, number - 1, reason, missed, last, _conditioning(led, poses, x))


def _conditioning(led: Follower, poses: Path, x: Array) -> Conditioning:
    """Return the data for the smallest singular values at scaled configurations x (k, n)."""
    if led.chain is not None:
        return Conditioning(led.chain.arm(led.target.closing.p), x)
    J = [led.rows(one, T)[1] for one, T in zip(x, poses.poses, strict=False)]
    return Conditioning(None, np.array([smallest(led.tracker, one) for one in J]))


def _start(system: System, start: Any, locked: Mapping[str, float] | None) -> Array:
    """Return the start configuration (nq,), with locked joints at their locked positions."""
    given = getattr(start, "q", start)
    q = np.array(system.position(given)) if isinstance(given, Mapping) else _numbers(system, given)
    held = np.array(system.position(locked))
    names = [coordinate.name for coordinate in system.coordinates]
    indices = [names.index(name) for name in locked or {}]
    q[indices] = held[indices]
    return q


def _numbers(system: System, given: Any) -> Array:
    try:
        q = np.array(given, dtype=float).ravel()
    except (TypeError, ValueError):
        q = np.zeros(0)
    if q.size != system.nq or not np.all(np.isfinite(q)):
        raise ModelError(
            f"{system.name}: the start is {quoted(given)}; give {system.nq} positions, or a dict of"
            " joint names to positions"
        )
    return q
