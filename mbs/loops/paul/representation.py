"""Rigid transforms as 15 x 15 matrices that act on the invariants of a point and a line.

For a point p and a direction l the vector w = (1, p.p, p.l, p, l, p x l, (p.p) l - 2 (p.l) p) is
linear in its image under any rigid transform, so that a product of transforms is one of matrices.

Source: Raghavan & Roth 1993, section 4, whose fourteen equations are the rows of w.
"""

from __future__ import annotations

import casadi
import numpy as np
from casadi import SX
from numpy.typing import NDArray

from mbs.spatial import Pose

Matrix = NDArray[np.float64]

SIZE = 15
POWERS = (0, 2, 1, 1, 1, 1, 0, 0, 0, 1, 1, 1, 2, 2, 2)
"""The powers of a length in the elements of w."""

_P, _L, _X, _M = slice(3, 6), slice(6, 9), slice(9, 12), slice(12, 15)


def represented(T: Matrix) -> Matrix:
    """(..., 15, 15) of rigid transforms (..., 4, 4)."""
    R, t = T[..., :3, :3], T[..., :3, 3]
    tt, cross = np.sum(t * t, axis=-1)[..., None, None], _skew(t)
    back = np.einsum("...ji,...j->...i", R, t)
    D = np.zeros((*T.shape[:-2], SIZE, SIZE))
    D[..., range(3), range(3)] = 1.0
    for block in (_P, _L, _X, _M):
        D[..., block, block] = R
    D[..., 1, 0], D[..., 1, _P] = tt[..., 0, 0], 2 * back
    D[..., 2, _L], D[..., _P, 0], D[..., _X, _L] = back, t, cross @ R
    outer = t[..., :, None] * back[..., None, :]
    D[..., _M, _X], D[..., _M, _L], D[..., _M, 2] = -2 * cross @ R, tt * R - 2 * outer, -2 * t
    return D


def represented_pose(pose: Pose, opposite: Pose) -> SX:
    """(15, 15) of a pose, sparse; its inverse is given too, which may be shorter to write."""
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


def joint_basis(slides: bool) -> Matrix:
    """(3, 15, 15) factors of 1, cos q, sin q of a turn about z; of 1, r, r^2 of a slide along z."""
    T = np.broadcast_to(np.eye(4), (3, 4, 4)).copy()
    if slides:
        T[1, 2, 3], T[2, 2, 3] = 1.0, -1.0
        one, up, down = represented(T)
        return np.array([one, (up - down) / 2, (up + down) / 2 - one])
    T[1, :2, :2], T[2, :2, :2] = [[0, -1], [1, 0]], [[-1, 0], [0, -1]]
    one, quarter, half = represented(T)
    mean = (one + half) / 2
    return np.array([mean, (one - half) / 2, quarter - mean])


def motion(q: Matrix, slides: bool) -> Matrix:
    """(..., 4, 4) slide along z, or turn about z."""
    T = np.zeros((*q.shape, 4, 4))
    T[..., range(4), range(4)] = 1.0
    if slides:
        T[..., 2, 3] = q
        return T
    c, s = np.cos(q), np.sin(q)
    T[..., 0, 0], T[..., 0, 1], T[..., 1, 0], T[..., 1, 1] = c, -s, s, c
    return T


def inverse(T: Matrix) -> Matrix:
    """(..., 4, 4) inverse of rigid transforms."""
    back = np.zeros_like(T)
    R = np.swapaxes(T[..., :3, :3], -1, -2)
    back[..., :3, :3], back[..., 3, 3] = R, 1.0
    back[..., :3, 3] = -np.einsum("...ij,...j->...i", R, T[..., :3, 3])
    return back


def _skew(t: Matrix) -> Matrix:
    S = np.zeros((*t.shape, 3))
    S[..., 0, 1], S[..., 0, 2], S[..., 1, 2] = -t[..., 2], t[..., 1], -t[..., 0]
    return S - np.swapaxes(S, -1, -2)
