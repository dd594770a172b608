"""Crossing of a singular configuration: smooth continuation of the joint path.

On a smooth curve of poses the joint path before the singular configuration is extrapolated past
it. Newton's method corrects the prediction. If the joint path is smooth, the ratio of the
correction to the distance between the two sides tends to zero with this distance. If the joint
path has a corner, the ratio is constant. If another branch is needed, the correction itself does
not tend to zero.

The motion of the frame between poses of an array is not specified. A smooth curve through the
joints is accepted if its deviation from the straight line is at most that of a smooth curve
through the poses.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from mbs.closed_forms.arm import Array, gap_to
from mbs.models.inverse_geometry.path_equations import (
    AT_POSE,
    POSE_ERROR,
    PathJoints,
    PathPoint,
    smallest,
)
from mbs.models.inverse_geometry.path_poses import curve_segment, moved, straight
from mbs.models.inverse_geometry.path_state import PathState, SingularityCrossing
from mbs.models.inverse_geometry.path_steps import (
    FAIR,
    advance,
    correct,
    lagrange,
    nearby_solution,
    nearest_solution,
    relative_correction,
)

_NEAREST = 1e-4
"""Smallest distance from a singular configuration, as a fraction of the segment between two poses:
amplified rounding errors are still far smaller than the distance itself."""
_SMOOTH = 0.4
"""Largest ratio of the relative corrections for half and full distance at a smooth crossing. The
ratio is 1/4 for a smooth joint path and at least 1 for a corner or jump."""
_LITTLE = 1e-6
"""Relative correction below which a joint path is smooth up to rounding errors."""
_LARGEST_DISTANCE = 0.5
"""First distance to either side of a singular configuration, in segments between two poses."""
_LEAST_DISTANCE = 0.03
"""Smallest distance, in segments, for redundant joints near a singular configuration. They miss it
by rounding errors and the step length, so that their path turns aside close to it."""
_WATCHED = 1e-4
"""Smallest singular value above which a stopped path did not end at a singular configuration but
at a limit or out of reach."""
_ALIKE = 0.9
"""Cosine of the largest angle (26 degrees) between the null spaces before and after a crossing. The
angle is small in a crossing and 90 degrees if the path turns aside."""
_UNCERTAIN = 0.25
"""Largest pose error of interpolated joints, relative to the distance between the straight line and
a smooth curve through the poses: the joints must be as smooth as the poses."""
_HALF = 0.5
"""Largest relative correction from pose to pose."""


def singularity_crossing(state: PathState, stopped: bool) -> SingularityCrossing | None:
    """Return a smooth crossing of the singular configuration, or None.

    Args:
        state: state of the tracking.
        stopped: whether the continuation stopped before the next pose.
    """
    near = state.trail[-1][1]
    if stopped and smallest(state.joints, near.J) > _WATCHED:
        return None
    if state.poses.function is None and state.joints.chain is not None:
        between = _crossing_between_poses(state, stopped)
        if between is not None:
            return between
    if stopped:
        return _crossing_along_curve(state, state.trail, _NEAREST)
    if state.joints.redundant and state.poses.function is not None:
        singular = [smallest(state.joints, point.J) for _, point in state.trail]
        trail = state.trail[: int(np.argmin(singular)) + 1]
        return _crossing_along_curve(state, trail, _LEAST_DISTANCE)
    return None


def _crossing_along_curve(
    state: PathState, trail: list[tuple[float, PathPoint]], least: float
) -> SingularityCrossing | None:
    """Cross the singular configuration along the pose curve; None if the path is not smooth.

    Args:
        state: state of the tracking.
        trail: configurations up to the singular configuration.
        least: smallest distance to either side, in segments between poses.
    """
    joints, poses, number = state.joints, state.poses, state.number
    at, end = trail[-1][0], float(poses.count - 1)
    # straight lines between poses have corners at the poses
    start = max(trail[0][0], number - 1.0 if poses.function is None else min(0.0, at - 1.0))
    way, before = min((at - start) / 3, _LARGEST_DISTANCE), np.inf
    while way > least:
        nodes = [at - 3 * way, at - 2 * way, at - way]
        x = [_configuration_at(state, trail, u) for u in nodes]
        if any(one is None for one in x):
            return None
        to = min(at + way, end)
        predicted = lagrange(nodes, np.array(x), to)
        if to - at < _NEAREST:  # the path ends at the singular configuration
            behind = nearby_solution(state.joints, predicted, poses.poses[-1])
        else:
            corrected = correct(joints, predicted, state.curve(to))
            behind = None if corrected is None else corrected.x
        ratio = np.inf
        if behind is not None and joints.may(behind):
            ratio = relative_correction(predicted, behind, np.asarray(x[-1]))
        smooth = ratio < FAIR and ratio < max(_LITTLE, _SMOOTH * before)
        if behind is not None and smooth and _goes_across(state.joints, np.asarray(x[-1]), behind):
            numbers = range(number, math.floor(to) + 1)
            passed = _passed_poses(state, [*nodes, to], np.array([*x, behind]), numbers)
            return None if passed is None else SingularityCrossing(passed, to, behind)
        way, before = way / 2, ratio if ratio < FAIR else 1.0
    return None


def _configuration_at(
    state: PathState, trail: list[tuple[float, PathPoint]], u: float
) -> Array | None:
    """Return the configuration (n,) at pose index u on the tracked path, or None."""
    known = [one for one in trail if one[0] <= u]
    if not known:
        return None
    at, point = known[-1]
    if at == u:
        return point.x
    segment = curve_segment(state.curve, at, u)
    last, reached, _ = advance(state.joints, point, segment, 1.0, curved=True)
    return last.x if reached == 1.0 else None


def _crossing_between_poses(state: PathState, stopped: bool) -> SingularityCrossing | None:
    """Cross the singular configuration from pose to pose; None if the path is not smooth."""
    before, number = _points_before(state), state.number
    if before is None:
        return None
    # the next pose may be the singular one itself
    beyond = number + 1
    ends = [beyond if stopped and number - state.trail[-1][0] < AT_POSE else number]
    if state.joints.redundant and ends[0] < beyond < state.poses.count:
        ends.append(beyond)
    crossings = (_crossing_to(state, *before, to) for to in ends)
    return next((crossing for crossing in crossings if crossing is not None), None)


def _crossing_to(
    state: PathState, nodes: list[float], x: Array, to: int
) -> SingularityCrossing | None:
    """Cross from configurations x (k, n) at pose indices `nodes` to the pose `to`, or None."""
    joints, poses, number, may = state.joints, state.poses, state.number, state.joints.may
    predicted = lagrange(nodes, x, float(min(to, poses.count - 1)))
    if to >= poses.count:  # the path ends at the singular configuration
        last = nearby_solution(joints, predicted, poses.poses[-1])
        if last is None or relative_correction(predicted, last, x[-1]) > FAIR or not may(last):
            return None
        return SingularityCrossing(last[None], number, last)
    behind = _smooth_solution(state, predicted, to, x[-1])
    if behind is None or not may(behind) or not _goes_across(joints, x[-1], behind):
        return None
    nodes, x = [*nodes[-2:], float(to)], np.vstack([x[-2:], behind])
    beyond = None
    if to + 1 < poses.count:
        beyond = _smooth_solution(state, lagrange(nodes, x, to + 1.0), to + 1, behind)
    if beyond is not None:
        nodes, x = [*nodes, to + 1.0], np.vstack([x, beyond])
    if not is_fair(state, nodes, x, to):
        return None
    passed = _passed_poses(state, nodes, x, range(number, to + 1))
    return None if passed is None else SingularityCrossing(passed, float(to), behind)


def _points_before(state: PathState) -> tuple[list[float], Array] | None:
    """Return pose indices and configurations of two or three previous points, or None."""
    number, found = state.number, state.found
    if number >= 2:
        first = max(0, number - 3)
        return [float(k) for k in range(first, number)], found[first:number]
    at = state.trail[-1][0]
    inner = [one for one in state.trail if 0 < one[0] < at]
    if number == 0 or not inner:
        return None
    u, point = min(inner, key=lambda one: abs(one[0] - at / 2))
    return [0.0, u], np.array([found[0], point.x])


def _smooth_solution(state: PathState, predicted: Array, number: int, last: Array) -> Array | None:
    """Return the solution (n,) at a pose nearest to the prediction, or None if too far."""
    found = nearest_solution(state.joints, predicted, state.poses.poses[number])
    most = FAIR if state.joints.redundant else _HALF
    return None if found is None or relative_correction(predicted, found, last) > most else found


def _passed_poses(
    state: PathState, nodes: Sequence[float], x: Array, numbers: range
) -> Array | None:
    """Interpolate configurations x (m, n) at nodes and solve the poses `numbers`.

    Return (k, n), or None if a pose has no solution nearby.
    """
    passed = list[Array]()
    for k in numbers:
        own = [y for u, y in zip(nodes, x, strict=True) if u == k]
        T, predicted = state.poses.poses[k], lagrange(nodes, x, float(k))
        y = own[0] if own else nearby_solution(state.joints, predicted, T)
        if y is None or not state.joints.may(y):
            return None
        passed.append(y)
    return np.array(passed).reshape(len(passed), x.shape[1])


def is_fair(state: PathState, nodes: Sequence[float], x: Array, to: int) -> bool:
    """Whether interpolated joints deviate from the path as little as interpolated poses do.

    Args:
        state: state of the tracking.
        nodes: pose indices around the interval from the last pose to `to`.
        x: (k, n) configurations at the nodes.
        to: index of the pose at the end of the interval.
    """
    joints, poses, before = state.joints, state.poses.poses, state.number - 1
    T, middle = poses[before], (before + to) / 2
    rows = np.array([gap_to(state.curve(u), T) for u in nodes])
    middle_pose = moved(T, lagrange(nodes, rows, middle))
    if to > state.number:
        middle_pose = poses[state.number]
    line = straight(T, poses[to])(0.5)
    units = np.array([joints.length] * 3 + [1.0] * 3)
    chord = float(np.max(np.abs(gap_to(line, middle_pose) / units)))
    gap = float(np.max(np.abs(joints.rows(lagrange(nodes, x, middle), middle_pose)[0])))
    return gap <= _UNCERTAIN * chord + POSE_ERROR


def _goes_across(joints: PathJoints, before: Array, behind: Array) -> bool:
    """Whether two configurations are on opposite sides of a singularity; True if not redundant.

    On opposite sides the null space of the Jacobian is nearly equal, and det([J; null space]) has
    opposite signs. Redundant joints that turn aside near a singularity stay on one side.
    """
    if not joints.redundant:
        return True
    T = np.eye(4)  # the Jacobian does not depend on the target
    (_, J), (_, K), kept = (
        joints.rows(before, T),
        joints.rows(behind, T),
        before.size - joints.slack,
    )
    still = np.linalg.svd(J)[2][kept:]
    alike = np.linalg.svd(still @ np.linalg.svd(K)[2][kept:].T)[1][joints.redundant - 1] > _ALIKE
    if len(J) != kept:  # closed loops have linearly dependent rows
        return bool(alike)
    signs = [np.linalg.slogdet(np.vstack([rows, still]))[0] for rows in (J, K)]
    return bool(alike) and signs[0] != signs[1]
