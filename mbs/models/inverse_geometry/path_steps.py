"""Predictor-corrector continuation of a configuration while the target pose moves.

The tangent of the path is the predictor and Newton's method is the corrector. A step is accepted
if the corrector is shorter than the predictor and contracts, and if all eigenvalues of J^-1 J'
are within 1/2 of 1, where J and J' are the Jacobians before and after the step. The eigenvalues
do not depend on the units. An accepted step crosses no singular configuration and changes to no
other branch. The step size tends to zero towards a singular configuration.

Source: Deuflhard 2011, sections 2.1 and 5.1, with eigenvalues instead of a norm.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mbs.closed_forms.arm import Array
from mbs.models.inverse_geometry.path_correction import correct
from mbs.models.inverse_geometry.path_equations import (
    LARGEST_STEP,
    SINGULAR,
    SMALL,
    PathPoint,
    Tracker,
    smallest,
)
from mbs.models.inverse_geometry.path_prediction import predicted

_CHANGE = 0.5
_SMALLEST_STEP = 1e-12
"""Smallest step, as a fraction of the segment between two poses. The rounding of 1 is 1e-16."""
_TANGENT = 1e-3
"""Fraction of a step over which a finite difference approximates the tangent of a pose curve."""
_MOST_STEPS = 200
"""Maximum number of steps between two poses. A full revolution of a joint takes some tens."""


def advance(
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
        led, back = predicted(tracker, point, r, free, aim)
        found = correct(tracker, led, T, free)
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
    near = np.max(np.abs(found.x - point.x)) < LARGEST_STEP and miss <= _CHANGE * ahead + SMALL
    change = np.max(np.abs(np.linalg.eigvals(back @ (found.J - point.J)[:, free])))
    return found if near and change <= _CHANGE else None
