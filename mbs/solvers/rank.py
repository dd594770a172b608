"""Rank and independent rows of matrices that depend on a configuration."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Matrix = NDArray[np.float64]

RELATIVE_GAP = 1e-8
"""Singular values below this part of the largest count as zero: rounding leaves 1e-16 of it, and
there are as many orders between it and the gap as between the gap and one."""

EQUAL = 1e-6
"""Relative difference below which two scores are equal, and the first of them is taken.

It is orders wider than the rounding that scores carry (1e-15, and 1e-12 where configurations closed
by iteration are behind them), and orders narrower than what makes one choice better than another.
"""

_FLOOR = 1e-12
"""Length of a row that counts as none: rounding of rows of about unit length leaves 1e-16."""


def first_best(scores: Sequence[float] | Matrix, equal: float = EQUAL) -> int:
    """The number of the largest score; of those that are equal but for rounding, the first.

    Args:
        scores: not all of them -inf, none NaN.
        equal: a score counts as the largest when it is less by this part of it at most.
    """
    values = np.asarray(scores, dtype=float)
    largest = float(values.max())
    return int(np.argmax(values >= largest - equal * abs(largest)))


def graded(score: float) -> float:
    """A score without the digits that are rounding, for sorting: six digits are left."""
    return float(f"{score:.6g}")


def rank(matrix: Matrix, gap: float = RELATIVE_GAP) -> int:
    """Number of singular values above `gap` times the largest."""
    if matrix.size == 0:
        return 0
    values = np.linalg.svd(matrix, compute_uv=False)
    return int(np.sum(values > gap * values[0]))


def null_space(matrix: Matrix, gap: float = RELATIVE_GAP) -> Matrix:
    """(n, n - rank) orthonormal columns that the matrix (m, n) takes to zero."""
    return null_space_of(matrix, matrix.shape[1] - rank(matrix, gap))


def null_space_of(matrix: Matrix, dimension: int) -> Matrix:
    """(n, dimension) orthonormal columns that the matrix (m, n) shortens most."""
    return np.array(np.linalg.svd(matrix)[2][matrix.shape[1] - dimension :].T)


def independent_rows(
    matrices: Sequence[Matrix], count: int, first: tuple[int, ...] = ()
) -> list[int]:
    """The `count` rows that stay independent in every one of the matrices, in increasing order.

    Gram-Schmidt with pivoting on all matrices at once: the next row is the one that the rows
    before it leave longest, by the geometric mean over the matrices, so that a row which
    depends on them in a single matrix is avoided.

    Args:
        matrices: (m, n) each, the same rows at several configurations.
        count: how many rows.
        first: rows to take before all others, in this order.
    """
    rest = [np.array(matrix, dtype=float) for matrix in matrices]
    chosen: list[int] = []
    for k in range(count):
        lengths = np.array([np.linalg.norm(matrix, axis=1) for matrix in rest])
        score = np.exp(np.mean(np.log(lengths + _FLOOR), axis=0))
        score[chosen] = -np.inf
        pivot = first[k] if k < len(first) else first_best(score)
        for number, matrix in enumerate(rest):
            direction = matrix[pivot] / max(float(lengths[number, pivot]), _FLOOR)
            along = np.sum(matrix * direction, axis=1)
            rest[number] = matrix - along[:, None] * direction
        chosen.append(pivot)
    return sorted(chosen)
