"""Names of the branches of an arm with a spherical wrist: shoulder, elbow, wrist.

Source: Lee & Ziegler 1984, definitions of the arm, elbow and wrist indicators.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mbs.models.inverse_geometry.arm import Arm, Array

_PARALLEL = 1e-9
_UNDECIDED = 1e-9


@dataclass(frozen=True, slots=True)
class Anatomy:
    """Which branches of an arm have a name.

    Attributes:
        shoulder: axes 1 and 2 are at right angles, so that the wrist centre is before or behind
            the shoulder.
        elbow: axes 2 and 3 are parallel, so that the elbow is above or below the line from the
            shoulder to the wrist centre.
        wrist: axes 4, 5 and 6 meet.
    """

    shoulder: bool
    elbow: bool
    wrist: bool


def anatomy(arm: Arm) -> Anatomy:
    """What an arm has of shoulder, elbow and wrist."""
    if arm.size != 6 or any(arm.prismatic[3:]) or not _wrist_meets(arm):
        return Anatomy(False, False, False)
    axes, origins = arm.lines(np.zeros(6))
    shoulder = not any(arm.prismatic[:2]) and abs(axes[0] @ axes[1]) < _PARALLEL
    parallel = np.linalg.norm(np.cross(axes[1], axes[2])) < _PARALLEL
    apart = np.linalg.norm(np.cross(axes[1], origins[2] - origins[1])) > _PARALLEL * arm.length
    elbow = shoulder and not arm.prismatic[2] and bool(parallel and apart)
    return Anatomy(bool(shoulder), elbow, True)


def labels(arm: Arm, has: Anatomy, q: Array) -> list[str]:
    """The names of postures' branches, such as "shoulder right, elbow up, no flip".

    A name is left out where the posture stands between two branches; an arm without a spherical
    wrist has none.

    Args:
        arm: its joints.
        has: what it has of shoulder, elbow and wrist.
        q: (m, n) postures [rad or m].
    """
    if not has.wrist:
        return [""] * len(q)
    axes, points = arm.lines(q)
    a, p = np.moveaxis(axes, 1, 0), np.moveaxis(points, 1, 0)
    reach = _meeting(a[4], p[4], a[5], p[5]) - p[1]
    right = _dot(a[0], np.cross(a[1], reach)) / arm.length
    bend = _dot(a[1], np.cross(reach, p[2] - p[1])) / arm.length**2
    turn = _dot(np.cross(a[3], a[5]), a[4])
    return [_label(has, *three) for three in zip(right, bend, turn, strict=True)]


def _label(has: Anatomy, right: float, bend: float, turn: float) -> str:
    names = []
    if has.shoulder and abs(right) > _UNDECIDED:
        names.append("shoulder right" if right > 0 else "shoulder left")
    if has.elbow:
        names.append(_elbow(bend, right))
    if abs(turn) > _UNDECIDED:
        names.append("no flip" if turn > 0 else "flip")
    return ", ".join(name for name in names if name)


def _elbow(bend: float, right: float) -> str:
    if abs(bend) <= _UNDECIDED:
        return "elbow straight"
    if abs(right) <= _UNDECIDED:
        return ""
    return "elbow up" if bend * right > 0 else "elbow down"


def _wrist_meets(arm: Arm) -> bool:
    """Whether axes 4, 5, 6 meet in one point; they do so in every posture if in two."""
    return all(_meet(arm, q) for q in (np.full(6, 0.3), np.full(6, 1.1)))


def _meet(arm: Arm, q: Array) -> bool:
    axes, points = arm.lines(q)
    if min(np.linalg.norm(np.cross(axes[k], axes[k + 1])) for k in (3, 4)) < _PARALLEL:
        return False
    centre = _meeting(axes[4], points[4], axes[5], points[5])
    away = [np.linalg.norm(np.cross(axes[k], centre - points[k])) for k in (3, 4, 5)]
    return bool(max(away) < _PARALLEL * arm.length)


def _meeting(a: Array, p: Array, b: Array, r: Array) -> Array:
    """The point of the line (p, a) nearest the line (r, b), (..., 3)."""
    n = np.cross(a, b)
    s = _dot(np.cross(r - p, b), n) / _dot(n, n)
    return np.asarray(p + s[..., None] * a, dtype=float)


def _dot(a: Array, b: Array) -> Array:
    return np.asarray(np.sum(a * b, axis=-1), dtype=float)
