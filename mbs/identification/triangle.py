"""Equations without their redundant rows: what a sum of squares depends on."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


def triangle(A: Array) -> Array:
    """(at most k, k) upper triangle R with R' R = A' A, by Householder reflections.

    Args:
        A: (n, k).
    """
    return np.asarray(np.linalg.qr(A, mode="r"), dtype=float)


def compressed(A: Array, b: Array) -> tuple[Array, Array]:
    """R and r in at most k + 1 rows with |R x - r| = |A x - b| for every x.

    Args:
        A: (n, k).
        b: (n,).
    """
    T = triangle(np.column_stack([A, b]))
    return T[:, :-1], T[:, -1]


def solve(A: Array, b: Array, freedom: int) -> tuple[Array, Array]:
    """Least squares by QR of columns scaled to length one.

    Args:
        A: (n, k) of full rank.
        b: (n,).
        freedom: equations less parameters, where rows were compressed before.

    Returns:
        (k,) solution and (k, k) its covariance, from the variance of the error.
    """
    k = A.shape[1]
    lengths = np.linalg.norm(A, axis=0)
    T = triangle(np.column_stack([A / lengths, b]))
    inverse = np.linalg.inv(T[:k, :k]) / lengths[:, None]
    variance = float(np.sum(T[k:, k] ** 2)) / max(freedom, 1)
    return inverse @ T[:k, k], variance * inverse @ inverse.T
