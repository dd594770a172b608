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


def triangle_solved(A: Array, b: Array) -> Array:
    """(k,) least squares by QR.

    Args:
        A: (n, k) of full rank, its columns alike in length.
        b: (n,).
    """
    k = A.shape[1]
    T = triangle(np.column_stack([A, b]))
    return np.asarray(np.linalg.solve(T[:k, :k], T[:k, k]), dtype=float)
