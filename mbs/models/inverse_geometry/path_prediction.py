"""Prediction of the next configuration on a path: by the tangent, or by a polynomial."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mbs.closed_forms.arm import Array
from mbs.models.inverse_geometry.path_equations import (
    PathPoint,
    Tracker,
    pseudo_inverse,
)
from mbs.numbers import NONZERO

_GAIN = 10.0
"""Step along the negative gradient per rad or arm length of frame motion. A cost whose second
derivative is about 1 decreases within a frame motion of a tenth of the arm length."""
FAIR = 0.1
"""Largest relative correction of a predicted configuration along a smooth joint path."""


def predicted(
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
    back, _ = pseudo_inverse(tracker, J, int(np.sum(~free)))
    move[free] = back @ (r - point.J @ move)
    if tracker.slope is not None and np.sum(~free) < tracker.redundant:
        downhill = -_GAIN * float(np.linalg.norm(r)) * tracker.slope(point.x)[free]
        still = downhill - back @ (J @ downhill)
        # at most as long as the move along the path, which must dominate the step
        most, length = float(np.linalg.norm(move)), float(np.linalg.norm(still))
        move[free] += still * min(1.0, most / max(length, NONZERO))
    return point.x + move, back


def lagrange(nodes: Sequence[float] | range, values: Array, u: float) -> Array:
    """Evaluate at u the interpolating polynomial through values (k, n) at k nodes."""
    total = np.zeros(values.shape[1])
    for k, own in enumerate(nodes):
        others = [other for m, other in enumerate(nodes) if m != k]
        total += values[k] * math.prod((u - other) / (own - other) for other in others)
    return total


def relative_correction(predicted: Array, found: Array, last: Array) -> float:
    """Return the correction |found - predicted| relative to the distance |found - last|."""
    way = max(float(np.linalg.norm(found - last)), NONZERO)
    return float(np.linalg.norm(found - predicted)) / way
