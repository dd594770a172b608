"""Why a path could not be followed any further, in words and figures."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbs.models.inverse_geometry.answers.reasons import apart
from mbs.models.inverse_geometry.arm import gap_to
from mbs.models.inverse_geometry.paths.follower import Follower
from mbs.models.inverse_geometry.paths.path import Path
from mbs.models.inverse_geometry.paths.tracking import smallest
from mbs.solvers.gauss_newton import gauss_newton
from mbs.solvers.levenberg_marquardt import levenberg_marquardt

Array = NDArray[np.float64]

_AT_LIMIT = 1e-6
_REACHED = 1e-6
_STARTS, _SEED = 6, 20260109
_NUDGE = 1e-3


def stop_reason(led: Follower, poses: Path, number: int, q: Array, at: float) -> str:
    """Why the pose of a number was not reached.

    Args:
        led: what follows.
        poses: the path.
        number: of the pose.
        q: (nq,) the last posture.
        at: how far it is between the pose before, 0, and this one, 1.
    """
    x, T = led.scaled(q), poses.poses[number]
    title = f"pose {number} of {poses.count}"
    if at == 1.0:
        return f"{title} is not one that the joints can take: {_miss(led, q, T)}"
    passed = led.passed(x, _AT_LIMIT)
    if passed is not None:
        place, limit = passed
        name = led.system.coordinates[place].name
        return f"joint {name} passes its limit {limit:.6g} before {title}"
    nearest, left = _nearest(led, x, T)
    if left > _REACHED:
        return f"{title} is out of reach: {_miss(led, led.whole(q, nearest), T)}"
    where = f"between poses {number - 1} and {number}" if number else "between the start and pose 0"
    return f"stopped {where} of {poses.count}: singular posture, {_singular(led, q)}"


def _miss(led: Follower, q: Array, T: Array) -> str:
    gap = gap_to(T, led.pose(q))
    distance, angle = float(np.linalg.norm(gap[:3])), float(np.linalg.norm(gap[3:]))
    return f"the nearest posture found leaves the frame {apart(distance, angle)}"


def _nearest(led: Follower, x: Array, T: Array) -> tuple[Array, float]:
    """The posture nearest to the pose that some starts lead to, and what is missing there."""

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
    place = led.places[int(np.argmax(rises))]
    name = led.system.coordinates[place].name
    return f"{name} = {q[place]:.3f}, smallest singular value {round(value(x), 12):.1g}"
