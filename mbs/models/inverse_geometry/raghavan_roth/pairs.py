"""A point and a direction as fifteen numbers that every rigid displacement maps linearly.

w(p, l) = (1, p.p, p.l, p, l, p x l, p.p l - 2 (p.l) p). A displacement D takes p to R p + t and l
to R l, and then w(D p, D l) = rho(D) w(p, l), with rho(D D') = rho(D) rho(D').

Source: Raghavan & Roth 1993, the fourteen equations; here as a representation of the group.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SIZE = 15

#: Numbers of the elements without p.p and p.p l - 2 (p.l) p: a slide r is in them without r^2.
LINEAR = np.array([0, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11])


def _skew(t: Array) -> Array:
    return np.array([[0, -t[2], t[1]], [t[2], 0, -t[0]], [-t[1], t[0], 0]])


def _slope(t: Array) -> Array:
    """(15, 15) derivative of rho along a translation t."""
    X = np.zeros((SIZE, SIZE))
    X[1, 3:6] = 2 * t
    X[2, 6:9] = t
    X[3:6, 0] = t
    X[9:12, 6:9] = _skew(t)
    X[12:15, 9:12] = -2 * _skew(t)
    X[12:15, 2] = -2 * t
    return X


def _turning() -> Array:
    """(3, 15, 15) the parts of rho of a turn about z with 1, its cosine and its sine."""
    Z = np.zeros((3, SIZE, SIZE))
    Z[0, range(3), range(3)] = 1.0
    for k in (3, 6, 9, 12):
        Z[0, k + 2, k + 2] = Z[1, k, k] = Z[1, k + 1, k + 1] = Z[2, k + 1, k] = 1.0
        Z[2, k, k + 1] = -1.0
    return Z


#: (3, 15, 15) slopes X of rho along x, y, z; along a translation rho is 1 + X + X X / 2.
SLOPES = np.array([_slope(axis) for axis in np.eye(3)])
#: (3, 15, 15) parts of rho of a turn q about z, with 1, cos q, sin q.
TURN = _turning()
#: (3, 15, 15) parts of rho of a slide r along z, with 1, r, r^2.
SLIDE = np.array([np.eye(SIZE), SLOPES[2], 0.5 * SLOPES[2] @ SLOPES[2]])

#: (6,) elements that a turn about z leaves alone, and (6,) those that a slide along z leaves alone.
KEPT_BY_TURN = np.array([1, 2, 5, 8, 11, 14])
KEPT_BY_SLIDE = np.array([3, 4, 6, 7, 8, 11])


def pair(T: Array) -> Array:
    """(..., 15) w of the origin and the z axis of the frames T, (..., 4, 4)."""
    p, z = T[..., :3, 3], T[..., :3, 2]
    pp, pz = np.sum(p * p, axis=-1)[..., None], np.sum(p * z, axis=-1)[..., None]
    bent = pp * z - 2 * pz * p
    return np.concatenate([np.ones_like(pp), pp, pz, p, z, np.cross(p, z), bent], axis=-1)


def rho(T: Array) -> Array:
    """(..., 15, 15) the linear map of w for displacements T, (..., 4, 4)."""
    X = np.tensordot(T[..., :3, 3], SLOPES, axes=1)
    turned = np.zeros((*T.shape[:-2], SIZE, SIZE))
    turned[..., range(3), range(3)] = 1.0
    for k in (3, 6, 9, 12):
        turned[..., k : k + 3, k : k + 3] = T[..., :3, :3]
    moved: Array = (np.eye(SIZE) + X + 0.5 * X @ X) @ turned
    return moved


def motion_parts(prismatic: bool) -> Array:
    """(3, 15, 15) parts of rho of a joint, with 1, cos q, sin q or with 1, r, r^2."""
    return SLIDE if prismatic else TURN


def back_parts(prismatic: bool) -> Array:
    """(3, 15, 15) likewise, of the inverse of the joint's motion."""
    signs = np.array([1.0, -1.0, 1.0] if prismatic else [1.0, 1.0, -1.0])
    back: Array = signs[:, None, None] * motion_parts(prismatic)
    return back


def half_parts(prismatic: bool) -> Array:
    """(3, 15, 15) parts with 1, x, x^2 of rho of a joint: x = tan(q/2), times 1 + x^2, or x = r."""
    if prismatic:
        return SLIDE
    return np.array([TURN[0] + TURN[1], 2 * TURN[2], TURN[0] - TURN[1]])
