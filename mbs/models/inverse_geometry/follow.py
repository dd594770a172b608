"""Paths followed on one branch."""

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

# Predictor and corrector: a configuration carried on while the target pose moves.
#
# The tangent of the path predicts, Newton's method corrects. A step counts only where the
# corrector is shorter than the predictor and contracts, and where the Jacobian changes by less
# than itself: all eigenvalues of J^-1 J' are within 1/2 of 1, whatever the units. So no singular
# configuration lies between, and no other branch is met. Towards a singular configuration the
# steps shrink to nothing.
#
# Source: Deuflhard 2011, sections 2.1 and 5.1, with eigenvalues in the place of a norm.


Array = NDArray[np.float64]
Rows = Callable[[Array, Array], tuple[Array, Array]]
"""(x, T) -> what is missing to T, (m,), and the Jacobian (m, n) that leads there."""

SINGULAR = 1e-7
"""Smallest singular value below which a configuration counts as singular."""

_CHANGE = 0.5
_CONTRACTION = 0.5
_LARGEST = 0.35
"""Longest step of any joint [rad or arm lengths], 20 degrees: a longer one may lead to another
branch, or by a whole turn."""
_ITERATIONS = 12
_SMALL = 1e-9
"""Rows, and moves [rad or arm lengths], that count as nothing: a thousand times the 1e-12 of a
solution, as towards a singular configuration rounding is magnified."""
_SMALLEST_STEP = 1e-12
"""Part of the way between two poses that is not halved any more: next to one, 1e-16 is rounding."""
_TANGENT = 1e-3
"""Of a step, along which the tangent of a curve of poses is measured."""
_MOST_STEPS = 200
"""Between two poses; a joint that turns all the way round takes some tens."""
_GAIN = 10.0
"""Part of the slope that redundant joints go down per rad or arm length of the frame's way: a cost
whose second derivative is of about one is lowered within a tenth of the arm's length."""
_NOISE = 1e-14
"""Rounding of a row: some tens of 1e-16 from products of transforms; the step that it makes is as
much larger as the inverse of the Jacobian is."""


@dataclass(frozen=True, slots=True, eq=False)
class Tracker:
    """What follows the poses.

    Attributes:
        rows: what is missing, lengths and slides measured so that they compare with turns.
        slack: directions that no row sees, such as rods that spin, and those that redundant joints
            leave free.
        exact: whether every pose can be reached nearby, so that rows are brought to zero between
            the given poses as well; elsewhere they are made as small as they can be.
        low, high: (n,) limits of the configuration, infinite where there are none.
        redundant: how many of the slack directions move joints that can keep within limits.
        slope: None, or the gradient (n,) of a cost that redundant joints lower at x.
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
        """(n,) which joints are beyond their limits."""
        return np.asarray((x < self.low - WITHIN) | (x > self.high + WITHIN))


@dataclass(frozen=True, slots=True, eq=False)
class PathPoint:
    """A configuration on the way.

    Attributes:
        x: (n,) configuration, scaled.
        J: (m, n) Jacobian there.
        left: largest row that is missing there.
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
    """The configuration carried on from the pose at 0 towards the pose at 1.

    Args:
        tracker: what follows.
        start: at 0.
        pose: the path of the pose, of a number between 0 and 1.
        step: first one to try.
        trail: where the configurations on the way are left, each with its number.
        curved: whether the path of the pose is another one than a straight line.

    Returns:
        Where it ended, at which number, and the last step tried; the number is 1 unless it stopped
        at a singular configuration, a limit, or after many steps that hardly advance.
    """
    point, at = start, 0.0
    for _ in range(_MOST_STEPS):
        if at == 1.0 or step <= _SMALLEST_STEP or smallest(tracker, point.J) <= SINGULAR:
            break
        to = min(1.0, at + step)
        T = pose(to)
        found = _step(tracker, point, T, tracker.rows(point.x, T)[0])
        if found is None and curved:
            # what the curve bends is magnified next to a singular configuration
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
    """A configuration and what is missing there to the pose T."""
    r, J = tracker.rows(x, T)
    return PathPoint(x, J, float(np.max(np.abs(r))))


def smallest(tracker: Tracker, J: Array) -> float:
    """The smallest singular value that is not slack."""
    values = np.linalg.svd(J, compute_uv=False)
    return float(values[J.shape[1] - 1 - tracker.slack])


def _step(tracker: Tracker, point: PathPoint, T: Array, r: Array) -> PathPoint | None:
    """The configuration at the next pose; None where the step is too long.

    Of redundant joints those that would pass a limit stop there, and the others move instead.

    Args:
        tracker: what follows.
        point: the configuration before.
        T: the next pose.
        r: what leads to it from the one before.
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
    """The first guess of a step, and the inverse of the free joints' Jacobian.

    Args:
        tracker: what follows.
        point: the configuration before.
        r: what leads from it to the next pose.
        free: (n,) joints that are not stopped at a limit.
        aim: (n,) positions of those that are.
    """
    J, move = point.J[:, free], np.where(free, 0.0, aim - point.x)
    back, _ = _pseudo_inverse(tracker, J, int(np.sum(~free)))
    move[free] = back @ (r - point.J @ move)
    if tracker.slope is not None and np.sum(~free) < tracker.redundant:
        downhill = -_GAIN * float(np.linalg.norm(r)) * tracker.slope(point.x)[free]
        still = downhill - back @ (J @ downhill)
        # not longer than what the path asks for, so that the step stays one along the path
        most, length = float(np.linalg.norm(move)), float(np.linalg.norm(still))
        move[free] += still * min(1.0, most / max(length, NONZERO))
    return point.x + move, back


def _correct(
    tracker: Tracker, x: Array, T: Array, free: NDArray[np.bool_] | None = None
) -> PathPoint | None:
    """Newton's method; None where it does not contract, or leaves rows that should vanish."""
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
    """The inverse of J, of which some columns are left out, and its norm."""
    U, values, V = np.linalg.svd(J, full_matrices=False)
    kept = J.shape[1] - max(tracker.slack - stopped, 0)
    inverse = 1 / np.maximum(values[:kept], NONZERO)
    back: Array = (V[:kept].T * inverse) @ U[:, :kept].T
    return back, float(inverse[-1])


# What follows a path: the joints of a chain, or those of a whole robot with its loops.


_WHOLE = 6
_TURN = 2 * math.pi


@dataclass(frozen=True, slots=True, eq=False)
class Follower:
    """The joints that follow, and what they are held against.

    Attributes:
        target: the frame, and the loops.
        indices: indices in q of the joints that move.
        scale: (n,) what one stands for in each [m]; 1 for angles.
        rows: what is missing to a pose, and how the joints change it.
        slack: directions that no row sees, redundant ones included.
        exact: whether any pose nearby can be taken.
        bounds: limits of the coordinates; None where none holds them.
        chain: the joints in numbers, where they are those of an open chain.
        redundant: how many more freedoms there are than a pose determines.
        slope: None, or the gradient (n,) of a cost that these lower.
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
        """Whose joints they are."""
        return self.target.closing.system

    @property
    def tracker(self) -> Tracker:
        """The numbers of it."""
        low, high = self.limits
        return Tracker(self.rows, self.slack, self.exact, low, high, self.redundant, self.slope)

    @property
    def length(self) -> float:
        """By which lengths are measured [m]."""
        return 1.0 if self.chain is None else self.chain.arm(self.target.closing.p).length

    @property
    def limits(self) -> tuple[Array, Array]:
        """(n,) lowest and highest positions of the joints that move, scaled."""
        if self.bounds is None:
            return np.full(len(self.indices), -np.inf), np.full(len(self.indices), np.inf)
        return self.scaled(self.bounds.low), self.scaled(self.bounds.high)

    def scaled(self, q: Array) -> Array:
        """(n,) the joints that move in a configuration (nq,)."""
        x: Array = q[list(self.indices)] / self.scale
        return x

    def whole(self, q: Array, x: Array) -> Array:
        """(nq,) the configuration q with the joints that move elsewhere."""
        whole = q.copy()
        whole[list(self.indices)] = x * self.scale
        return whole

    def pose(self, q: Array) -> Array:
        """(4, 4) of the frame in a configuration (nq,)."""
        elements = self.target.pose(q)[0]
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = elements[3:].reshape(3, 3).T, elements[:3]
        return T

    def residual(self, q: Array, T: Array) -> float:
        """Largest element by which a configuration misses a pose, or opens a loop."""
        return float(np.max(np.abs(self.target.at(T).residual(q)[0])))

    def passed(self, x: Array, slack: float = 0.0) -> tuple[int, float] | None:
        """A joint, by its index in q, that comes within `slack` of its limit, and this limit."""
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
    """What follows the poses of a frame.

    Args:
        target: the frame, and the loops.
        start: (nq,) configuration, in which joints that do not follow stay.
        locked: by name, joints that stay where they are.
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
    """Every joint of the system, less those that stay where they are."""
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


# What redundant joints do beside following: a cost that they lower, by its gradient.
#
# dx = J+ dr - k (1 - J+ J) grad H: the joints move as little as they can, and in the directions
# that the frame does not see down the slope of a cost.
#
# Source: Liegeois 1977; Yoshikawa 1985 (manipulability). The motion does not repeat itself on
# closed paths: Klein & Huang 1983.


CRITERIA = ("minimum velocity", "limits", "manipulability")
"""What redundant joints may be asked for by name."""
Redundancy: TypeAlias = str | Callable[[Array], Array]
"""One of `CRITERIA`, or the gradient (nq,) of a cost at a configuration (nq,)."""

_DIFFERENCE = 1e-5
"""Move of a joint [rad or arm lengths] for differences of log manipulability, whose second
derivative is of about one but next to singular configurations."""


def _slope_of(
    led: Follower, start: Array, redundancy: Redundancy | None
) -> Callable[[Array], Array] | None:
    """The gradient of the cost that redundant joints lower, in scaled positions.

    Raises:
        ModelError: there is no such criterion.
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
    """The gradient of half the squares of distances from the middle, in half ranges.

    Source: Liegeois 1977.
    """
    limited = np.isfinite(low) & np.isfinite(high) & (high > low)
    low, high = np.where(limited, low, 0.0), np.where(limited, high, 0.0)
    half = np.where(limited, (high - low) / 2, np.inf)
    return lambda x: (x - (low + high) / 2) / half**2


def _to_manipulability(led: Follower) -> Callable[[Array], Array]:
    """The gradient of minus the logarithm of the manipulability, the product of singular values.

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


# A path of poses: given one by one, or as a function of a number between 0 and 1.


@dataclass(frozen=True, slots=True, eq=False)
class Path:
    """Poses one after the other, and how one leads to the next.

    Attributes:
        poses: (N, 4, 4).
        function: that gave them, or None.
    """

    poses: Array
    function: Callable[[float], Array] | None = None

    @property
    def count(self) -> int:
        """How many poses."""
        return len(self.poses)

    def curve(self, first: Array) -> Callable[[float], Array]:
        """The pose, of a number from -1, where it is `first` (4, 4), over 0 to count - 1."""
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
    """A path as a user gives it.

    Raises:
        ModelError: it is neither poses nor a function that gives poses, or there are none.
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
    """(N, 4, 4) poses that a function gives."""
    poses = np.empty((len(numbers), 4, 4))
    for k, s in enumerate(numbers):
        given = path(s)
        T = given if isinstance(given, np.ndarray) else pose_numbers(given)
        if T is None or T.shape != (4, 4) or T.dtype != poses.dtype:
            T = target_pose(system, given)
        poses[k] = T  # a copy: the function may write the next pose over it
    return target_poses(system, poses)


def straight(before: Array, after: Array) -> Callable[[float], Array]:
    """The pose moved along a straight line and turned about a fixed axis, of a number 0 to 1."""
    gap = gap_to(after, before)

    return lambda s: after if s == 1.0 else moved(before, s * gap)


def moved(T: Array, gap: Array) -> Array:
    """The pose T (4, 4) moved by a translation [m] and a rotation vector [rad], (6,)."""
    pose = T.copy()
    pose[:3, :3] = _turn(gap[3:]) @ T[:3, :3]
    pose[:3, 3] += gap[:3]
    return pose


def _turn(vector: Array) -> Array:
    """(3, 3) the turn about a vector by its length [rad].

    Source: Rodrigues 1840.
    """
    angle = float(np.linalg.norm(vector))
    x, y, z = vector / angle if angle > 0 else vector
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    turned: Array = np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K
    return turned


# Many poses at once, on one branch of a closed form.
#
# A branch is a continuous function of the pose as long as none of its roots becomes double and no
# joint is left undetermined: as long as none of the numbers that tell so vanishes. They do not
# between two poses at which the least of them is nearly the same, before and after as well; what
# is told otherwise is followed step by step.


_BLOCK = 20_000
"""Poses that are solved at once: some megabytes for each branch."""
_SHORT = 20
"""Poses below which steps, of a millisecond or two, are quicker than equations of a new robot."""
_RATIO = 2.0
"""Between two poses, of what vanishes where branches meet: `_CHANGE` of it."""
_NEARER = 0.25
"""Times the distance of the next configuration from a prediction, within which one is meant."""
_ON = 1e-6
"""Difference [rad or arm lengths] between a configuration that was followed and its branch: the
first is found to 1e-9 or better."""


@dataclass(frozen=True, slots=True, eq=False)
class Runs:
    """All branches at a block of poses.

    Attributes:
        first: number of the first pose.
        q: (N, branches, n) configurations, scaled.
        residual: (N, branches) by how much each misses the pose.
        good: (N, branches) whether each takes the pose and is no double root.
        size: (N, branches) what vanishes where branches meet.
        arm: the joints.
        limits: lowest and highest positions, scaled.
    """

    first: int
    q: Array
    residual: Array
    good: NDArray[np.bool_]
    size: Array
    arm: Arm
    limits: tuple[Array, Array]

    def after(self, number: int, x: Array) -> tuple[Array, Array]:
        """Configurations (k, n) at as many poses after a number as are certain, from x there.

        Returns:
            These, and (k,) by how much they miss the poses.
        """
        row = number - self.first
        apart = np.max(np.abs(self.arm.wrapped(self.q[row] - x)), axis=1)
        branch = int(np.argmin(apart))
        if apart[branch] > _ON:
            return _no_run(x.size)
        # from the pair of poses before on: what vanishes half way between two is told by the others
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
        """The configuration (n,) at a pose that is much nearer to x than all others.

        Returns:
            It and by how much it misses the pose; None where there is none, or the pose is beyond
            the block.
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
    """The branches at the poses from a number on; None where there is no closed form for them."""
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


# Behind a singular configuration: the joints that go on as they came.
#
# On a smooth curve of poses the joints before the singular configuration predict those behind it.
# Newton's method leads from the prediction to the pose there. What it has to add, beside the way
# from one side to the other, vanishes with this way if the joints are smooth there; if they have a
# corner it is in proportion, and where another branch would have to be taken it does not vanish.
#
# Of poses that are given one by one, it is open how the frame moves between two of them. A smooth
# curve through the joints is taken where it leaves the straight line by no more than a smooth curve
# through the poses does.


_NEAREST = 1e-4
"""Of the way between two poses, before a singular configuration: rounding, magnified there, is
still far below the way itself."""
_SMOOTH = 0.4
"""Of what is added to the prediction, relative to the way, when this is halved: a quarter if the
joints are smooth, the same or more if they have a corner or jump."""
_LITTLE = 1e-6
"""Of the way, added to the prediction: the joints are smooth but for rounding."""
_FAIR, _HALF = 0.1, 0.5
"""Of the way, added to the prediction, at most: along the curve itself, and from pose to pose."""
_LONGEST_LEAP = 0.5
"""Way to either side of a singular configuration, in those between two poses, tried first."""
_LEAST_LEAP = 0.03
"""The least way tried where redundant joints pass by a singular configuration: they do not meet it
but for rounding and the length of steps, so that close to it they turn aside."""
_BESIDE = 0.1
"""Move [rad or arm lengths] of a configuration between two sides of a leap to one that solves."""
_AT_POSE = 1e-3
"""Of the way between two poses, before a pose, at which it may be the singular one itself."""
_WATCHED = 1e-4
"""Smallest singular value above which no way ends at a singular configuration: it ends at a limit
or out of reach."""
_ALIKE = 0.9
"""Cosine of the angle, 26 degrees, by which the motion that a frame does not see may turn in a
leap: little where the joints go on, by a right angle where they turn aside."""
_UNCERTAIN = 0.25
"""Of the distance between the straight line and a smooth curve through the poses, by which joints
may leave the curve: they are as smooth as the poses."""
_TURN_OFF = 0.05
"""Times the step before, by which a step misses what was predicted, from which it is asked whether
joints that go through a singular configuration would go on more smoothly."""
_NEAR_STEPS = 3.0
"""Steps within which the smallest singular value, which is of the size of the distance to a
singular configuration, may vanish."""


def _added(predicted: Array, found: Array, last: Array) -> float:
    """What was added to a prediction, relative to the way."""
    way = max(float(np.linalg.norm(found - last)), NONZERO)
    return float(np.linalg.norm(found - predicted)) / way


def _settled(led: Follower, x: Array, T: Array) -> Array | None:
    """(n,) the configuration beside x that takes a pose, also a singular one; None if it is not."""

    def residual(z: Array) -> tuple[Array, Array]:
        r, J = led.rows(z, T)
        return -r, J

    def missing(z: Array) -> float:
        return float(np.max(np.abs(led.rows(z, T)[0])))

    # what a singular configuration leaves free stays: to move it changes rounding alone
    y = gauss_newton(residual, x, rank_tolerance=SINGULAR).x
    most = _OFF if led.chain is None else SOLVED
    # else by all that is left of its rank, or downhill
    if missing(y) > most:
        y = gauss_newton(residual, y).x
    if missing(y) > most:
        y = _descended(led, x, T)
    near = float(np.max(np.abs(y - x))) < _BESIDE
    return y if near and missing(y) <= most else None


def _descended(led: Follower, x: Array, T: Array) -> Array:
    """(n,) the configuration nearest to a pose beside x, also where the Jacobian loses rank."""
    if led.chain is not None:
        arm = led.chain.arm(led.target.closing.p)
        better = polish(arm, T, (x * led.scale)[None]).q[0]
        return x + arm.wrapped(better - x * led.scale) / led.scale

    def residual(z: Array) -> tuple[Array, Array]:
        r, J = led.rows(z, T)
        return -r, J

    return levenberg_marquardt(residual, x).x


def _goes_across(led: Follower, before: Array, behind: Array) -> bool:
    """Whether joints that are redundant come out on the other side of a singular configuration.

    There the determinant of the Jacobian and of the motion that the frame does not see has the
    other sign, and this motion is nearly the same. Beside a configuration that they only come near
    to they turn aside instead, on the same side.
    """
    if not led.redundant:
        return True
    T = np.eye(4)  # the Jacobian does not depend on the target
    (_, J), (_, K), kept = led.rows(before, T), led.rows(behind, T), before.size - led.slack
    still = np.linalg.svd(J)[2][kept:]
    alike = np.linalg.svd(still @ np.linalg.svd(K)[2][kept:].T)[1][led.redundant - 1] > _ALIKE
    if len(J) != kept:  # rows of loops depend on each other
        return bool(alike)
    signs = [np.linalg.slogdet(np.vstack([rows, still]))[0] for rows in (J, K)]
    return bool(alike) and signs[0] != signs[1]


def _nearest_solution(led: Follower, x: Array, T: Array) -> Array | None:
    """(n,) the configuration nearest to x of all that take a pose."""
    if led.chain is None:
        return None
    if led.redundant:  # of infinitely many the one beside it
        return _settled(led, x, T)
    p = led.target.closing.p
    q = solve_at(led.chain, NOT_VARIED, T, "auto", p).q[:, list(led.indices)]
    if not len(q):
        return None
    away = led.chain.arm(p).wrapped(q / led.scale - x)
    nearest: Array = x + away[int(np.argmin(np.linalg.norm(away, axis=1)))]
    return nearest


def _lagrange(nodes: Sequence[float] | range, values: Array, u: float) -> Array:
    """The polynomial through values (k, n) at k nodes, at u."""
    total = np.zeros(values.shape[1])
    for k, own in enumerate(nodes):
        others = [other for m, other in enumerate(nodes) if m != k]
        total += values[k] * math.prod((u - other) / (own - other) for other in others)
    return total


# Why a path could not be followed any further, in words and figures.


_AT_LIMIT = 1e-6
"""Distance from a limit [rad or m] at which it is the reason to stop: halved steps end much nearer,
and what stops for another reason is hardly ever so near."""
_REACHED = 1e-6
"""Largest row that is missing at a pose within reach: at a double root rounding leaves the root of
1e-12, to which solutions are found."""
_STARTS, _SEED = 6, 20260109
_NUDGE = 1e-3
"""Move of a joint [rad or arm lengths] that tells which one leads away from a singular
configuration: longer than the way to it, 1e-7, and short beside that to another one."""


def stop_reason(led: Follower, poses: Path, number: int, q: Array, at: float) -> str:
    """Why the pose of a number was not reached.

    Args:
        led: what follows.
        poses: the path.
        number: of the pose.
        q: (nq,) the last configuration.
        at: how far it is between the pose before, 0, and this one, 1.
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
    """The joint that is farthest from where it would have to be behind a singular configuration.

    Of redundant joints whether there is a configuration behind it that is near.
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
    """The configuration nearest to the pose that some starts lead to, and what is missing there."""

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
    """The joint on which the smallest singular value depends most, and this value."""
    x, T = led.scaled(q), led.pose(q)

    def value(y: Array) -> float:
        return smallest(led.tracker, led.rows(y, T)[1])

    moved = np.eye(x.size) * _NUDGE
    rises = [value(x + step) + value(x - step) for step in moved]
    index = led.indices[int(np.argmax(rises))]
    name = led.system.coordinates[index].name
    return f"{name} = {q[index]:.3f}, smallest singular value {round(value(x), 12):.1g}"


# The walk along a path: runs of a closed form, single poses, steps, and leaps.


_TRAIL = 40
"""Configurations on the way that are kept: from step to step the way left is halved."""
_OFF = 1e-9
"""Largest row at a pose that was reached: solutions are found to 1e-12, and next to singular
configurations rounding is larger."""
_PARTS = 0.25, 0.5, 0.75, 1.0
"""Parts of the way to the next pose at which the pose must be the present one, to stay there."""
_AFTER_STOP, _AFTER_LEAP = 1e-3, 1e-2
"""First steps, in parts of the next segment: after a narrow passage ten doublings lead back to all
of it; behind a singular configuration steps are short."""


@dataclass(frozen=True, slots=True, eq=False)
class Leap:
    """A way past a singular configuration.

    Attributes:
        x: (k, n) configurations at the next k poses.
        u: number at which it ends; between two poses it is broken.
        end: (n,) the configuration there.
    """

    x: Array
    u: float
    end: Array


@dataclass(slots=True, eq=False)
class Walk:
    """How far the joints have followed a path; `walk` makes it at the start.

    Attributes:
        led: what follows.
        tracker: the numbers of it.
        poses: the path.
        curve: the same as a function of the number of a pose, from -1 at the start.
        start: (nq,) the configuration there.
        found: (N, n) configurations at the poses before `number`.
        residual: (N,) by how much they miss them.
        number: of the next pose.
        u: number at which it stands, a broken one between two poses.
        point: the configuration there.
        trail: the last configurations on the way, each with its number.
        step: the next one to try, in parts of the way to the next pose.
        runs: the branches of the closed form at the poses around.
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
        """Walk to the end of the path, or to where it cannot be followed; the reason of that."""
        while self.number < self.poses.count:
            at_pose = self.u == self.number - 1 and self.number > 0
            if self._stays() or (at_pose and (self._run() or self._smooth_step())):
                continue
            reason = self._on()
            if reason:
                return reason
        return ""

    def _stays(self) -> bool:
        """Stay at a singular configuration if the pose does not change to the next; else False."""
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
        """Note configurations (k, n) at the next poses, and stand at the last one of them."""
        first, self.number = self.number, self.number + len(x)
        self.found[first : self.number], self.residual[first : self.number] = x, residual
        self.u, self.trail = self.number - 1.0, self._last_poses()
        self.point = self.trail[-1][1]

    def _last_poses(self) -> list[tuple[float, PathPoint]]:
        """The last poses that were reached, as a trail."""
        numbers = range(max(0, self.number - 3), self.number)
        found, T = self.found, self.poses.poses
        return [(float(k), point_at(self.tracker, found[k], T[k])) for k in numbers]

    # many poses at once, and single ones next to a singular configuration

    def _run(self) -> bool:
        """Take a run of poses on one branch of the closed form; whether there is one."""
        self.runs = _runs(self.led, self.poses, self.number - 1, self.runs)
        if self.runs is None:
            return False
        run, missed = self.runs.after(self.number - 1, self.point.x)
        if len(run):
            self._arrive(run, missed)
        return bool(len(run))

    def _smooth_step(self) -> bool:
        """Go to the next pose, where joints go on smoothly there by a closed form; else False."""
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
        """Go to the next pose, or past a singular configuration before it; why not, else ""."""
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
        """Whether a step beside a singular configuration goes elsewhere than those before lead."""
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
        """Go on from the end of a leap."""
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
        """The joints behind a singular configuration; None where they do not go on smoothly.

        Args:
            stopped: whether the way ends before the next pose.
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
        """Along the curve itself, from one side of the singular configuration to the other.

        Args:
            trail: the way up to the singular configuration.
            least: the shortest way to either side that is tried.
        """
        tracker, poses, number = self.tracker, self.poses, self.number
        at, end = trail[-1][0], float(poses.count - 1)
        # lines between given poses have corners there
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
        """(n,) the configuration at a number on the way that was followed."""
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
        """From the poses before a singular configuration to those behind it."""
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
        """From configurations (k, n) at nodes to the pose of a number."""
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
        """Two or three configurations before the next pose, and their numbers; None if only one."""
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
        """(n,) the configuration at a pose, near the prediction beside the way to it."""
        found = _nearest_solution(self.led, predicted, self.poses.poses[number])
        most = _FAIR if self.led.redundant else _HALF
        return None if found is None or _added(predicted, found, last) > most else found

    def _passed(self, nodes: Sequence[float], x: Array, numbers: range) -> Array | None:
        """(k, n) configurations at poses between those, (m, n), at nodes; None where one is not."""
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
        """Whether a smooth curve through joints leaves the path as little as one through the poses.

        Args:
            nodes: numbers around the way from the last pose to that of a number.
            x: (k, n) configurations there.
            to: this number.
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
    """What stands at a configuration (nq,) before the first pose."""
    tracker, x, curve = led.tracker, led.scaled(q), poses.curve(led.pose(q))
    point = point_at(tracker, x, curve(-1.0))
    found, residual = np.empty((poses.count, x.size)), np.empty(poses.count)
    return Walk(led, tracker, poses, curve, q, found, residual, 0, -1.0, point, [(-1.0, point)])


def _segment(curve: Callable[[float], Array], u: float, to: float) -> Callable[[float], Array]:
    """The poses from one number to another, of a number between 0 and 1."""
    return lambda s: curve(to if s == 1.0 else u + s * (to - u))


# A path of poses followed on one branch: the joints move continuously, or stop with a reason.


@dataclass(frozen=True, slots=True, eq=False)
class Conditioning:
    """What the smallest singular values on a path are computed from.

    Attributes:
        arm: the joints; None where the values are known.
        values: (k, n) their configurations, scaled; or (k,) the values.
    """

    arm: Arm | None
    values: Array

    def smallest(self) -> Array:
        """(k,) the values."""
        if self.arm is None:
            return self.values
        q = self.values * self.arm.units
        J = examine_arm(self.arm, np.eye(4), q)[2]  # which does not depend on the target
        return np.asarray(np.linalg.svd(J, compute_uv=False)[:, -1], dtype=float)


@dataclass(frozen=True, eq=False)
class Followed:
    """How far a path was followed.

    Attributes:
        q: (k, nq) configurations at the poses reached [rad or m]; angles go on beyond half a turn.
        reached: number of the last pose reached, counted from 0; -1 for none.
        reason: why it stopped there; empty where the path was followed to its end.
        residual: (k,) largest element by which the pose is missed, and row by which a loop is open.
        stopped_at: (nq,) the last configuration on the way, between two poses where it stopped.
    """

    q: Array
    reached: int
    reason: str
    residual: Array
    stopped_at: Array
    _conditioning: Conditioning = field(repr=False)

    @functools.cached_property
    def singular_values(self) -> Array:
        """(k,) the smallest of the Jacobian, lengths measured by the arm's."""
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
    """The configurations along a path of poses, on the branch of the first one.

    Between two poses the frame is led along a straight line and turned about a fixed axis, in
    steps so small that no other branch can be taken; the poses of a function need not be straight.
    Singular configurations are passed where the joints go on smoothly behind them; where they do
    not, it stops before, and says where and why. Fewer than six joints need poses that they can
    take; between these the frame is led as near to the line as they can.

    Args:
        system: open, or with closed loops, which stay closed in the way they are at the start.
        path: (N, 4, 4) poses of the frame in the base [m], or a function that makes such a pose of
            a number between 0 and 1.
        start: (nq,) positions near the first pose, by name or all of them, or a solution with such
            a `q`. The frame is led from where it is there to the first pose.
        frame: a body, a named frame, or the number of a link; the terminal frame when left out.
        samples: how many poses of a function are given back.
        locked: positions of joints that stay where they are, by name [rad or m].
        limits: (lowest, highest) by name replaces limits of the description, None for a joint
            without; False leaves all out of account.
        redundancy: what joints beyond the six that a pose determines do: "minimum velocity", which
            is taken when left out; "limits", to stay far from these; "manipulability", far from
            singular configurations; or a function that gives the gradient (nq,) of a cost at q.
        parameters: values of symbols, the others at their defaults.

    Returns:
        The configurations up to the last pose reached, and why it is not the last of the path.

    Raises:
        ModelError: a pose, a name, a criterion or the start is not understood.
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
    """What tells the singular values at configurations x, (k, n), when they are asked for."""
    if led.chain is not None:
        return Conditioning(led.chain.arm(led.target.closing.p), x)
    J = [led.rows(one, T)[1] for one, T in zip(x, poses.poses, strict=False)]
    return Conditioning(None, np.array([smallest(led.tracker, one) for one in J]))


def _start(system: System, start: Any, locked: Mapping[str, float] | None) -> Array:
    """(nq,) the start, with locked joints where they are locked."""
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
