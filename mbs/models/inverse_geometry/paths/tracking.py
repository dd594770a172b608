"""Predictor and corrector: a posture carried on while the pose that is wanted moves.

The tangent of the path predicts, Newton's method corrects. A step counts only where the corrector
is shorter than the predictor and contracts, and where the Jacobian changes by less than itself: all
eigenvalues of J^-1 J' are within 1/2 of 1, whatever the units. So no singular posture lies between,
and no other branch is met. Towards a singular posture the steps shrink to nothing.

Source: Deuflhard 2011, sections 2.1 and 5.1, with eigenvalues in the place of a norm.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Rows = Callable[[Array, Array], tuple[Array, Array]]
"""(x, T) -> what is missing to T, (m,), and the Jacobian (m, n) that leads there."""

SINGULAR = 1e-7
"""Smallest singular value below which a posture counts as singular."""

_CHANGE = 0.5
_CONTRACTION = 0.5
_LARGEST = 0.35
_ITERATIONS = 12
_SMALL = 1e-9
_SMALLEST_STEP = 1e-12
_MOST_STEPS = 200
"""Between two poses; a joint that turns all the way round takes some tens."""
_NOISE = 1e-14


@dataclass(frozen=True, slots=True, eq=False)
class Tracker:
    """What follows the poses.

    Attributes:
        rows: what is missing, lengths and slides measured so that they compare with turns.
        slack: directions that no row sees, such as rods that spin.
        exact: whether every pose can be reached nearby, so that rows are brought to zero between
            the given poses as well; elsewhere they are made as small as they can be.
        may: None, or whether a posture is allowed.
    """

    rows: Rows
    slack: int
    exact: bool
    may: Callable[[Array], bool]


@dataclass(frozen=True, slots=True, eq=False)
class PathPoint:
    """A posture on the way.

    Attributes:
        x: (n,) posture, scaled.
        J: (m, n) Jacobian there.
        left: largest row that is missing there.
    """

    x: Array
    J: Array
    left: float


def carried(
    tracker: Tracker, start: PathPoint, pose: Callable[[float], Array], step: float
) -> tuple[PathPoint, float, float]:
    """The posture carried on from the pose at 0 towards the pose at 1.

    Args:
        tracker: what follows.
        start: at 0.
        pose: the way of the pose, of a number between 0 and 1.
        step: first one to try.

    Returns:
        Where it ended, at which number, and the last step tried; the number is 1 unless it stopped
        at a singular posture, a limit, or after many steps that hardly advance.
    """
    point, at = start, 0.0
    for _ in range(_MOST_STEPS):
        if at == 1.0 or step <= _SMALLEST_STEP or smallest(tracker, point.J) <= SINGULAR:
            break
        to = min(1.0, at + step)
        found = _stepped(tracker, point, pose(to))
        if found is None:
            step = (to - at) / 2
        else:
            point, at, step = found, to, 2 * (to - at)
    return point, at, step


def point_at(tracker: Tracker, x: Array, T: Array) -> PathPoint:
    """A posture and what is missing there to the pose T."""
    r, J = tracker.rows(x, T)
    return PathPoint(x, J, float(np.max(np.abs(r))))


def smallest(tracker: Tracker, J: Array) -> float:
    """The smallest singular value that is not slack."""
    values = np.linalg.svd(J, compute_uv=False)
    return float(values[J.shape[1] - 1 - tracker.slack])


def _stepped(tracker: Tracker, point: PathPoint, T: Array) -> PathPoint | None:
    """The posture at the next pose; None where the step is too long."""
    back, _ = _pseudo_inverse(tracker, point.J)
    led = point.x + back @ tracker.rows(point.x, T)[0]
    found = _corrected(tracker, led, T)
    if found is None or not tracker.may(found.x):
        return None
    way, miss = np.linalg.norm(led - point.x), np.linalg.norm(found.x - led)
    near = np.max(np.abs(found.x - point.x)) < _LARGEST and miss <= _CHANGE * way + _SMALL
    change = np.max(np.abs(np.linalg.eigvals(back @ (found.J - point.J))))
    return found if near and change <= _CHANGE else None


def _corrected(tracker: Tracker, x: Array, T: Array) -> PathPoint | None:
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
    inverse = 1 / np.maximum(values[:kept], 1e-300)
    back: Array = (V[:kept].T * inverse) @ U[:, :kept].T
    return back, float(inverse[-1])
