"""Tracking of a path: blocks of a closed form, single poses, steps, and singularity crossings."""

from __future__ import annotations

import numpy as np

from mbs.models.inverse_geometry.path_branches import branch_block
from mbs.models.inverse_geometry.path_crossing import is_fair, singularity_crossing
from mbs.models.inverse_geometry.path_equations import (
    POSE_ERROR,
    SINGULAR,
    SMALL,
    PathPoint,
    smallest,
)
from mbs.models.inverse_geometry.path_poses import curve_segment
from mbs.models.inverse_geometry.path_state import PathState
from mbs.models.inverse_geometry.path_steps import FAIR, advance, lagrange, relative_correction
from mbs.models.inverse_geometry.path_stop import stop_reason

_TRAIL = 40
"""Number of last configurations in the trail: each step halves the remaining distance."""
_PARTS = 0.25, 0.5, 0.75, 1.0
"""Fractions of the segment to the next pose at which the pose must equal the current one for the
joints to stay at rest."""
_AFTER_STOP = 1e-3
"""First step after small steps, as a fraction of the next segment: ten doublings restore the full
segment."""
_TURN_OFF = 0.05
"""Prediction error of a step, relative to the step before, above which a crossing of a nearby
singular configuration is examined as a smoother continuation."""
_NEAR_STEPS = 3.0
"""Distance in steps within which a singular configuration is near. The smallest singular value
approximates the distance to a singular configuration."""


def track(state: PathState) -> str:
    """Track the path to its end or until it stops. Return the reason of a stop, or ""."""
    while state.number < state.poses.count:
        at_pose = state.u == state.number - 1 and state.number > 0
        if _stays(state) or (at_pose and (_follow_branch(state) or _smooth_step(state))):
            continue
        reason = _step_on(state)
        if reason:
            return reason
    return ""


def _stays(state: PathState) -> bool:
    """Keep a singular configuration if the next pose is equal; return whether it is."""
    if smallest(state.joints, state.point.J) > SINGULAR:
        return False
    way, x = state.number - state.u, state.point.x
    for part in _PARTS:
        rows = state.joints.rows(x, state.curve(state.u + part * way))[0]
        if np.max(np.abs(rows), initial=0.0) > POSE_ERROR:
            return False
    q = state.joints.whole(state.start, x)
    state.arrive(x[None], [state.joints.residual(q, state.poses.poses[state.number])])
    return True


def _follow_branch(state: PathState) -> bool:
    """Advance over poses on one branch of the closed form; return whether there are any."""
    state.block = branch_block(state.joints, state.poses, state.number - 1, state.block)
    if state.block is None:
        return False
    run, missed = state.block.after(state.number - 1, state.point.x)
    if len(run):
        state.arrive(run, missed)
    return bool(len(run))


def _smooth_step(state: PathState) -> bool:
    """Advance one pose if a closed-form solution continues smoothly; return whether so."""
    number, found, block = state.number, state.found, state.block
    if block is None or state.poses.function is not None or number < 3:
        return False
    nodes, x = [float(k) for k in range(number - 3, number)], found[number - 3 : number]
    predicted = lagrange(nodes, x, float(number))
    own = block.nearest(number, predicted)
    if (
        own is None
        or relative_correction(predicted, own[0], x[-1]) > FAIR
        or not state.joints.may(own[0])
    ):
        return False
    nodes, x = [*nodes[1:], float(number)], np.vstack([x[1:], own[0]])
    predicted = lagrange(nodes, x, number + 1.0)
    beyond = block.nearest(number + 1, predicted)
    if beyond is not None and relative_correction(predicted, beyond[0], own[0]) <= FAIR:
        nodes, x = [*nodes, number + 1.0], np.vstack([x, beyond[0]])
    if not is_fair(state, nodes, x, number):
        return False
    state.arrive(own[0][None], [own[1]])
    return True


def _step_on(state: PathState) -> str:
    """Step to the next pose or past a singularity. Return the reason of a stop, or ""."""
    joints, number, way = state.joints, state.number, list[tuple[float, PathPoint]]()
    allowed = not joints.redundant or state.joints.may(state.point.x)
    segment = curve_segment(state.curve, state.u, number)
    last, at = state.point, 0.0
    if allowed:
        curved, first = state.poses.function is not None, min(1.0, state.step)
        last, at, state.step = advance(state.joints, state.point, segment, first, way, curved)
    u, way_left = state.u, number - state.u
    state.trail = state.trail[-_TRAIL:] + [(u + s * way_left, passed) for s, passed in way]
    state.u = float(number) if at == 1.0 else u + at * way_left
    state.step = max(state.step, _AFTER_STOP)
    stopped = at < 1.0 or last.left > POSE_ERROR
    crossing = None
    if allowed and (stopped or _turns_off(state, last)):
        crossing = singularity_crossing(state, stopped)
    if crossing is not None:
        state.land(crossing)
        return ""
    state.point = last
    q = joints.whole(state.start, last.x)
    if stopped:
        return stop_reason(joints, state.poses, number, q, state.u - number + 1)
    state.found[number] = last.x
    state.residual[number] = joints.residual(q, state.poses.poses[number])
    state.number += 1
    return ""


def _turns_off(state: PathState, point: PathPoint) -> bool:
    """Whether a step near a singularity deviates from the extrapolated joint path."""
    number, found = state.number, state.found
    if number < 2:
        return False
    first = max(0, number - 3)
    known = found[first:number]
    predicted = lagrange(range(first, number), known, number)
    before = float(np.linalg.norm(known[-1] - known[-2]))
    if float(np.linalg.norm(point.x - predicted)) <= max(_TURN_OFF * before, SMALL):
        return False
    longest = max(before, float(np.linalg.norm(point.x - known[-1])))
    return smallest(state.joints, point.J) < _NEAR_STEPS * longest
