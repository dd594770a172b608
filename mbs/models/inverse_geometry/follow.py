"""Paths followed on one branch."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.assembly.model_function import require_system
from mbs.closed_forms.arm import Arm, gap_to
from mbs.closed_forms.ring import spin_indices
from mbs.errors import ModelError
from mbs.loops.plan import regular_configuration, undetermined_beside
from mbs.loops.pose import Goal, goal
from mbs.models.geometry import terminal_frame
from mbs.models.inverse_geometry.chain import frame_chain, target_pose, target_poses
from mbs.models.inverse_geometry.solutions import WITHIN, CoordinateLimits, Given, apart, bounds
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
_MOST_STEPS = 200
"""Between two poses; a joint that turns all the way round takes some tens."""
_NOISE = 1e-14
"""Rounding of a row: some tens of 1e-16 from products of transforms; the step that it makes is as
much larger as the inverse of the Jacobian is."""


@dataclass(frozen=True, slots=True, eq=False)
class Tracker:
    """What follows the poses.

    Attributes:
        rows: what is missing, lengths and slides measured so that they compare with turns.
        slack: directions that no row sees, such as rods that spin.
        exact: whether every pose can be reached nearby, so that rows are brought to zero between
            the given poses as well; elsewhere they are made as small as they can be.
        may: None, or whether a configuration is allowed.
    """

    rows: Rows
    slack: int
    exact: bool
    may: Callable[[Array], bool]


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
    tracker: Tracker, start: PathPoint, pose: Callable[[float], Array], step: float
) -> tuple[PathPoint, float, float]:
    """The configuration carried on from the pose at 0 towards the pose at 1.

    Args:
        tracker: what follows.
        start: at 0.
        pose: the path of the pose, of a number between 0 and 1.
        step: first one to try.

    Returns:
        Where it ended, at which number, and the last step tried; the number is 1 unless it stopped
        at a singular configuration, a limit, or after many steps that hardly advance.
    """
    point, at = start, 0.0
    for _ in range(_MOST_STEPS):
        if at == 1.0 or step <= _SMALLEST_STEP or smallest(tracker, point.J) <= SINGULAR:
            break
        to = min(1.0, at + step)
        found = _step(tracker, point, pose(to))
        if found is None:
            step = (to - at) / 2
        else:
            point, at, step = found, to, 2 * (to - at)
    return point, at, step


def point_at(tracker: Tracker, x: Array, T: Array) -> PathPoint:
    """A configuration and what is missing there to the pose T."""
    r, J = tracker.rows(x, T)
    return PathPoint(x, J, float(np.max(np.abs(r))))


def smallest(tracker: Tracker, J: Array) -> float:
    """The smallest singular value that is not slack."""
    values = np.linalg.svd(J, compute_uv=False)
    return float(values[J.shape[1] - 1 - tracker.slack])


def _step(tracker: Tracker, point: PathPoint, T: Array) -> PathPoint | None:
    """The configuration at the next pose; None where the step is too long."""
    back, _ = _pseudo_inverse(tracker, point.J)
    led = point.x + back @ tracker.rows(point.x, T)[0]
    found = _correct(tracker, led, T)
    if found is None or not tracker.may(found.x):
        return None
    ahead, miss = np.linalg.norm(led - point.x), np.linalg.norm(found.x - led)
    near = np.max(np.abs(found.x - point.x)) < _LARGEST and miss <= _CHANGE * ahead + _SMALL
    change = np.max(np.abs(np.linalg.eigvals(back @ (found.J - point.J))))
    return found if near and change <= _CHANGE else None


def _correct(tracker: Tracker, x: Array, T: Array) -> PathPoint | None:
    """Newton's method; None where it does not contract, or leaves rows that should vanish."""
    before = np.inf
    r, J = tracker.rows(x, T)
    for _ in range(_ITERATIONS):
        back, gain = _pseudo_inverse(tracker, J)
        move, noise = back @ r, _NOISE * gain
        length = float(np.linalg.norm(move))
        if length > max(_CONTRACTION * before, noise):
            return None
        x, before = x + move, length
        r, J = tracker.rows(x, T)
        if length < noise:
            break
    left = float(np.max(np.abs(r)))
    return None if tracker.exact and left > _SMALL else PathPoint(x, J, left)


def _pseudo_inverse(tracker: Tracker, J: Array) -> tuple[Array, float]:
    """The inverse of J, and its norm."""
    U, values, V = np.linalg.svd(J, full_matrices=False)
    kept = J.shape[1] - tracker.slack
    inverse = 1 / np.maximum(values[:kept], NONZERO)
    back: Array = (V[:kept].T * inverse) @ U[:, :kept].T
    return back, float(inverse[-1])


# What follows a path: the joints of a chain, or those of a whole robot with its loops.


_WHOLE = 6


@dataclass(frozen=True, slots=True, eq=False)
class Follower:
    """The joints that follow, and what they are held against.

    Attributes:
        target: the frame, and the loops.
        indices: indices in q of the joints that move.
        scale: (n,) what one stands for in each [m]; 1 for angles.
        rows: what is missing to a pose, and how the joints change it.
        slack: directions that no row sees.
        exact: whether any pose nearby can be taken.
        bounds: limits of the coordinates; None where none holds them.
    """

    target: Goal
    indices: tuple[int, ...]
    scale: Array
    rows: Rows
    slack: int
    exact: bool
    bounds: CoordinateLimits | None

    @property
    def system(self) -> System:
        """Whose joints they are."""
        return self.target.closing.system

    @property
    def tracker(self) -> Tracker:
        """The numbers of it."""
        return Tracker(self.rows, self.slack, self.exact, self._may)

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

    def _may(self, x: Array) -> bool:
        return self.passed(x, -WITHIN) is None


def follower(
    target: Goal,
    start: Array,
    locked: Mapping[str, float] | None,
    limits: bool | Given | None,
) -> Follower:
    """What follows the poses of a frame.

    Args:
        target: the frame, and the loops.
        start: (nq,) configuration, in which joints that do not follow stay.
        locked: by name, joints that stay where they are.
        limits: as in `follow`.

    Raises:
        ModelError: a name is unknown, or the chain has more than six free joints.
    """
    system, frame = target.closing.system, target.frame
    ends = None if limits is False else bounds(system, limits)
    path = system.tree.path(system.frame(frame)[0])
    simple = all(system.tree.links[k].motion.nq == 1 for k in path)
    if simple and not system.is_closed:
        found = frame_chain(system, frame, locked)
        arm = found.arm(target.closing.p)
        scale = arm.units
        exact = arm.size == _WHOLE
        return Follower(target, found.indices, scale, _arm_rows(arm, scale), 0, exact, ends)
    return _closed_follower(target, start, list(locked or {}), ends)


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

    def rows(x: Array, T: Array) -> tuple[Array, Array]:
        at = start.copy()
        at[list(moving)] = x
        r, J = target.at(T).residual(at)
        return -r, J[:, moving]

    return Follower(target, moving, np.ones(len(moving)), rows, slack, free == _WHOLE, ends)


def _arm_rows(arm: Arm, scale: Array) -> Rows:
    lengths = np.array([arm.length] * 3 + [1.0] * 3)

    def rows(x: Array, T: Array) -> tuple[Array, Array]:
        pose, J = arm.pose_and_jacobian(x * scale)
        return gap_to(T, pose) / lengths, J * scale / lengths[:, None]

    return rows


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

    def segment(self, number: int, before: Array) -> Callable[[float], Array]:
        """The pose, of a number from 0 to 1, from the pose before (4, 4) to that of the number."""
        after, function = self.poses[number], self.function
        if function is None or number == 0:
            return straight(before, after)
        return lambda s: after if s == 1.0 else function((number - 1 + s) / (self.count - 1))


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

    numbers = np.linspace(0.0, 1.0, samples)
    return Path(np.array([function(float(s)) for s in numbers]), function)


def straight(before: Array, after: Array) -> Callable[[float], Array]:
    """The pose moved along a straight line and turned about a fixed axis, of a number 0 to 1."""
    gap = gap_to(after, before)

    def pose(s: float) -> Array:
        if s == 1.0:
            return after
        T = before.copy()
        T[:3, :3] = _turn(s * gap[3:]) @ before[:3, :3]
        T[:3, 3] = before[:3, 3] + s * gap[:3]
        return T

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
    where = f"between poses {number - 1} and {number}" if number else "between the start and pose 0"
    return f"stopped {where} of {poses.count}: singular configuration, {_singular(led, q)}"


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


# A path of poses followed on one branch: the joints move continuously, or stop with a reason.


_OFF = 1e-9
"""Largest row at a pose that was reached: solutions are found to 1e-12, and next to singular
configurations rounding is larger."""


@dataclass(frozen=True, slots=True, eq=False)
class Followed:
    """How far a path was followed.

    Attributes:
        q: (k, nq) configurations at the poses reached [rad or m]; angles go on beyond half a turn.
        reached: number of the last pose reached, counted from 0; -1 for none.
        reason: why it stopped there; empty where the path was followed to its end.
        residual: (k,) largest element by which the pose is missed, and row by which a loop is open.
        singular_values: (k,) the smallest of the Jacobian, lengths measured by the arm's.
        stopped_at: (nq,) the last configuration on the way, between two poses where it stopped.
    """

    q: Array
    reached: int
    reason: str
    residual: Array
    singular_values: Array
    stopped_at: Array


def follow(
    system: System,
    path: Any,
    start: Any,
    frame: str | int | None = None,
    *,
    samples: int = 101,
    locked: Mapping[str, float] | None = None,
    limits: bool | Given | None = None,
    parameters: Mapping[str, float] | None = None,
) -> Followed:
    """The configurations along a path of poses, on the branch of the first one.

    Between two poses the frame is led along a straight line and turned about a fixed axis, in
    steps so small that no other branch can be taken. Where the branch ends, or the joints can move
    while the frame stays, it stops before; also where the path could go on beyond. Fewer than six
    joints need poses that they can take; between these the frame is led as near to the line as they
    can.

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
        parameters: values of symbols, the others at their defaults.

    Returns:
        The configurations up to the last pose reached, and why it is not the last of the path.

    Raises:
        ModelError: a pose, a name or the start is not understood, or the chain has more than six
            free joints.
    """
    require_system(system)
    name = terminal_frame(system) if frame is None else frame
    poses = path_of(system, path, samples)
    q = _start(system, start, locked)
    target = goal(system, name, np.eye(4), None, parameters)
    return _follow(follower(target, q, locked, limits), poses, q)


def _follow(led: Follower, poses: Path, q: Array) -> Followed:
    tracker, x, T = led.tracker, led.scaled(q), led.pose(q)
    point, step = point_at(tracker, x, T), 1.0
    kept, reason = list[tuple[Array, float, float]](), ""
    for number in range(poses.count):
        segment = poses.segment(number, T)
        point, at, step = carried(tracker, point, segment, min(1.0, step))
        whole, T = led.whole(q, point.x), segment(1.0)
        if at < 1.0 or point.left > _OFF:
            reason = stop_reason(led, poses, number, whole, at)
            break
        # a part of the next segment: after a narrow passage ten doublings lead back to all of it
        step = max(step, 1e-3)
        kept.append((whole, led.residual(whole, T), smallest(tracker, point.J)))
    rows = np.array([whole for whole, _, _ in kept]).reshape(len(kept), q.size)
    numbers = np.array([other for _, *other in kept]).reshape(len(kept), 2)
    last = led.whole(q, point.x)
    return Followed(rows, len(kept) - 1, reason, numbers[:, 0], numbers[:, 1], last)


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
