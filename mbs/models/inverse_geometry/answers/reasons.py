"""Why no posture takes the frame to a pose."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence

import numpy as np

from mbs.models.inverse_geometry.answers.target import Target
from mbs.models.inverse_geometry.numeric.nearest import Nearest

_STARTS, _STEPS, _SEED = 40, 60, 20260109
_REACHED = 1e-9
_SMALLEST = 1e-9
"""Distance [m] and angle [rad] that are told; below it is rounding."""


def unreachable(target: Target, nearest: Nearest) -> str:
    """Why a pose has no solution at all.

    Args:
        target: the pose that is wanted.
        nearest: the reachable pose nearest to it.
    """
    arm = target.arm
    away = f"the nearest reachable pose is {apart(nearest.distance, nearest.angle)}"
    position, orientation = reaches_position(target), reaches_orientation(target)
    if arm.size < 6 and position:
        joints = "1 joint" if arm.size == 1 else f"{arm.size} joints"
        also = "and so is the orientation alone" if orientation else "but not the orientation"
        return (
            f"the pose is off the manifold that {joints} can reach: its position alone is"
            f" reached, {also}; {away}"
        )
    if position:
        return f"out of reach: the position is reached, but not with this orientation; {away}"
    also = "is reached alone" if orientation else "is not reached either"
    return f"out of reach: the position is too far or too near, the orientation {also}; {away}"


def apart(distance: float, angle: float) -> str:
    """How far two poses are apart, in words; what is but rounding is left out.

    Args:
        distance: between their origins [m].
        angle: between their orientations [rad].
    """
    parts = [f"{distance:.4g} m away"] if distance > _SMALLEST else []
    if angle > _SMALLEST:
        parts.append(f"turned by {math.degrees(angle):.4g} degrees")
    return " and ".join(parts) or "within rounding of it"


def excluded(outside: Sequence[Sequence[str]]) -> str:
    """Why no solution is left, from the names of the joints outside their limits in each."""
    count = len(outside)
    joints = Counter(name for names in outside for name in names)
    most = [f"{name} in {k} of {count}" for name, k in joints.most_common()]
    found = "the only solution is" if count == 1 else f"all {count} solutions are"
    return f"limits: {found} outside; {', '.join(most)}"


def reaches_position(target: Target) -> bool:
    """Whether the frame's origin can get to the wanted place, however it is turned."""
    return _reaches(target, slice(0, 3))


def reaches_orientation(target: Target) -> bool:
    """Whether the frame can be turned as wanted, wherever it is."""
    return _reaches(target, slice(3, 6))


def _reaches(target: Target, rows: slice) -> bool:
    """Whether some rows of the equations alone have a solution.

    Levenberg-Marquardt from several postures at once.
    """
    n = target.arm.size
    rng = np.random.default_rng(_SEED)
    x = rng.uniform(-math.pi, math.pi, (_STARTS, n))
    damping = np.full(_STARTS, 1e-2)
    e, J = (part[:, rows] for part in target.excess(x))
    for _ in range(_STEPS):
        A = np.swapaxes(J, 1, 2) @ J + damping[:, None, None] * np.eye(n)
        step = np.linalg.solve(A, np.swapaxes(J, 1, 2) @ e[..., None])[..., 0]
        e_trial, J_trial = (part[:, rows] for part in target.excess(x - step))
        better = np.sum(e_trial**2, axis=1) < np.sum(e**2, axis=1)
        x = np.where(better[:, None], x - step, x)
        e, J = np.where(better[:, None], e_trial, e), np.where(better[:, None, None], J_trial, J)
        damping = np.where(better, np.maximum(damping / 5, 1e-14), damping * 4)
    return bool(np.min(np.max(np.abs(e), axis=1)) < _REACHED)
