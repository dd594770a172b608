"""Rigid displacements as 15 x 15 matrices that act on products of a point and a direction.

A point p and a direction l give fifteen numbers w(p, l) = (1, p.p, p.l, p, l, p x l, p.p l -
2 (p.l) p). A displacement D maps p to R p + t and l to R l. Then w(D p, D l) = rho(D) w(p, l), with
rho(D D') = rho(D) rho(D').

Source: Raghavan & Roth 1993, the fourteen equations; here as a representation of the group.
"""

from __future__ import annotations

import casadi
import numpy as np
from casadi import SX
from numpy.typing import NDArray

from mbs.closed_forms.arm import Field
from mbs.spatial import Pose

Array = NDArray[np.float64]

SIZE = 15
POWERS = (0, 2, 1, 1, 1, 1, 0, 0, 0, 1, 1, 1, 2, 2, 2)
"""Power of a length in each element of w."""

_P, _L, _X, _M = slice(3, 6), slice(6, 9), slice(9, 12), slice(12, 15)

#: Indices of the elements without p.p and p.p l - 2 (p.l) p, in which a displacement r appears
# without r^2.
LINEAR = np.array([0, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11])


def _skew(t: Array) -> Array:
    """Return the matrix (3, 3) of the cross product with t (3,): skew(t) a = t x a."""
    return np.array([[0, -t[2], t[1]], [t[2], 0, -t[0]], [-t[1], t[0], 0]])


def _rho_derivative(t: Array) -> Array:
    """Return the derivative (15, 15) of rho along a translation t."""
    X = np.zeros((SIZE, SIZE))
    X[1, 3:6] = 2 * t
    X[2, 6:9] = t
    X[3:6, 0] = t
    X[9:12, 6:9] = _skew(t)
    X[12:15, 9:12] = -2 * _skew(t)
    X[12:15, 2] = -2 * t
    return X


def _rho_rotation_parts() -> Array:
    """Return parts (3, 15, 15) of rho of a rotation about z: constant, cosine and sine."""
    Z = np.zeros((3, SIZE, SIZE))
    Z[0, range(3), range(3)] = 1.0
    for k in (3, 6, 9, 12):
        Z[0, k + 2, k + 2] = Z[1, k, k] = Z[1, k + 1, k + 1] = Z[2, k + 1, k] = 1.0
        Z[2, k, k + 1] = -1.0
    return Z


#: (3, 15, 15) derivatives X of rho along x, y, z. For a translation, rho is 1 + X + X X / 2.
SLOPES = np.array([_rho_derivative(axis) for axis in np.eye(3)])
#: (3, 15, 15) parts of rho of a rotation q about z, with 1, cos q, sin q.
TURN = _rho_rotation_parts()
#: (3, 15, 15) parts of rho of a displacement r along z, with 1, r, r^2.
SLIDE = np.array([np.eye(SIZE), SLOPES[2], 0.5 * SLOPES[2] @ SLOPES[2]])

#: (6,) indices of the elements that are invariant under a rotation about z, and (6,) of elements
# that are invariant under a translation along z.
KEPT_BY_TURN = np.array([1, 2, 5, 8, 11, 14])
KEPT_BY_SLIDE = np.array([3, 4, 6, 7, 8, 11])


def frame_products(T: Field) -> Field:
    """Return the 15 products w (..., 15) of the origin p and the z axis l of frames.

    They are 1, p.p, p.l, p, l, p x l and p.p l - 2 (p.l) p. A displacement maps them linearly.

    Args:
        T: (..., 4, 4) poses.
    """
    p, z = T[..., :3, 3], T[..., :3, 2]
    pp, pz = np.sum(p * p, axis=-1)[..., None], np.sum(p * z, axis=-1)[..., None]
    bent = pp * z - 2 * pz * p
    return np.concatenate([np.ones_like(pp), pp, pz, p, z, np.cross(p, z), bent], axis=-1)


def rho(T: Array) -> Array:
    """Return the matrices (..., 15, 15) of displacements that act on w; see `frame_products`.

    Args:
        T: (..., 4, 4) rigid displacements.
    """
    X = np.tensordot(T[..., :3, 3], SLOPES, axes=1)
    turned = np.zeros((*T.shape[:-2], SIZE, SIZE), T.dtype)
    turned[..., range(3), range(3)] = 1.0
    for k in (3, 6, 9, 12):
        turned[..., k : k + 3, k : k + 3] = T[..., :3, :3]
    moved: Array = (np.eye(SIZE) + X + 0.5 * X @ X) @ turned
    return moved


def motion_parts(prismatic: bool) -> Array:
    """Return parts (3, 15, 15) of rho of a joint motion.

    They are factors of 1, cos q, sin q for a revolute joint, of 1, r, r^2 for a prismatic joint.

    Args:
        prismatic: whether the joint is prismatic.
    """
    return SLIDE if prismatic else TURN


def back_parts(prismatic: bool) -> Array:
    """Return parts (3, 15, 15) of rho of the inverse motion of a joint, as in `motion_parts`.

    Args:
        prismatic: whether the joint is prismatic.
    """
    signs = np.array([1.0, -1.0, 1.0] if prismatic else [1.0, 1.0, -1.0])
    back: Array = signs[:, None, None] * motion_parts(prismatic)
    return back


def half_parts(prismatic: bool) -> Array:
    """Return parts (3, 15, 15) of rho of a joint with 1, x, x^2: (1 + x^2) rho for a rotation.

    The variable x is tan(q/2) for a rotation, and the displacement r for a translation.

    Args:
        prismatic: whether the joint is prismatic.
    """
    if prismatic:
        return SLIDE
    return np.array([TURN[0] + TURN[1], 2 * TURN[2], TURN[0] - TURN[1]])


def symbolic_rho(pose: Pose, opposite: Pose) -> SX:
    """Return the matrix (15, 15) of a pose that acts on w of `frame_products`, a sparse expression.

    Args:
        pose: pose of a frame.
        opposite: its inverse, whose expressions may be shorter.
    """
    R, t, back = pose.R, pose.p, -opposite.p
    tt = min((casadi.sumsqr(p) for p in (t, opposite.p)), key=casadi.n_nodes)
    cross = casadi.skew(t)
    turned = casadi.mtimes(cross, R)
    D = SX(SIZE, SIZE)
    D[0, 0] = D[1, 1] = D[2, 2] = 1
    for block in (_P, _L, _X, _M):
        D[block, block] = R
    D[1, 0], D[1, _P], D[2, _L] = tt, 2 * back.T, back.T
    D[_P, 0], D[_X, _L], D[_M, 2] = t, turned, -2 * t
    D[_M, _X] = -2 * turned
    D[_M, _L] = tt * R - 2 * casadi.mtimes(t, back.T)
    return SX(casadi.sparsify(D))
