"""Compression of least-squares equations by QR."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


def triangle(A: Array) -> Array:
    """Return R (at most k, k), upper triangular with R' R = A' A, by Householder reflections.

    Args:
        A: (n, k) matrix.
    """
    return np.asarray(np.linalg.qr(A, mode="r"), dtype=float)


def compressed(A: Array, b: Array) -> tuple[Array, Array]:
    """Return R and r with at most k + 1 rows and |R x - r| = |A x - b| for every x.

    Args:
        A: (n, k) matrix.
        b: (n,) right-hand side.
    """
    T = triangle(np.column_stack([A, b]))
    return T[:, :-1], T[:, -1]


def triangle_solved(A: Array, b: Array) -> Array:
    """Solve a least-squares problem (k,) by QR.

    Args:
        A: (n, k) matrix of full rank, with columns of similar length.
        b: (n,) right-hand side.
    """
    k = A.shape[1]
    T = triangle(np.column_stack([A, b]))
    return np.asarray(np.linalg.solve(T[:k, :k], T[:k, k]), dtype=float)
