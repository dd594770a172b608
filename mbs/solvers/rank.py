"""Rank and independent rows of matrices that depend on a posture."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Matrix = NDArray[np.float64]

RELATIVE_GAP = 1e-8
"""Singular values below this part of the largest count as zero."""


def rank(matrix: Matrix) -> int:
    """Number of singular values above `RELATIVE_GAP` times the largest."""
    if matrix.size == 0:
        return 0
    values = np.linalg.svd(matrix, compute_uv=False)
    return int(np.sum(values > RELATIVE_GAP * max(values[0], 1e-30)))


def independent_rows(matrix: Matrix, count: int, first: tuple[int, ...] = ()) -> list[int]:
    """The `count` rows that span the matrix best, by QR with pivoting, in increasing order.

    Args:
        matrix: (m, n).
        count: how many rows.
        first: rows to take before all others, in this order.
    """
    work = np.array(matrix, dtype=float)
    chosen: list[int] = []
    for k in range(count):
        norms = np.linalg.norm(work, axis=1)
        norms[chosen] = -1.0
        pivot = first[k] if k < len(first) else int(np.argmax(norms))
        direction = work[pivot] / max(norms[pivot], 1e-300)
        work = work - np.outer(work @ direction, direction)
        chosen.append(pivot)
    return sorted(chosen)
