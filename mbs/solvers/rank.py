"""Rank and independent rows of matrices that depend on a configuration."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from casadi import DM
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


def dense(matrix: DM) -> Matrix:
    """A sparse matrix with its zeros; CasADi's own conversion makes a list of all elements."""
    full = np.zeros(matrix.shape)
    rows, columns = matrix.sparsity().get_triplet()
    full[rows, columns] = matrix.nonzeros()
    return full


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
    lengths = np.array([np.linalg.norm(matrix, axis=1) for matrix in rest])
    score, chosen = _mean_lengths(lengths), list[int]()
    left = np.flatnonzero(lengths.any(axis=0))  # rows that may still change
    for k in range(count):
        pivot = first[k] if k < len(first) else first_best(score)
        left = left[left != pivot]
        changed = np.zeros(len(score), dtype=bool)
        for number, matrix in enumerate(rest):
            direction = matrix[pivot] / max(float(lengths[number, pivot]), _FLOOR)
            # a row without a column in common stays as it is
            common = matrix[np.ix_(left, direction.nonzero()[0])].any(axis=1)
            rows = left[common]
            along = np.sum(matrix[rows] * direction, axis=1)
            matrix[rows] -= along[:, None] * direction
            lengths[number, rows] = np.linalg.norm(matrix[rows], axis=1)
            changed[rows] = True
        score[changed] = _mean_lengths(lengths[:, changed])
        score[pivot] = -np.inf
        chosen.append(pivot)
    return sorted(chosen)


def _mean_lengths(lengths: Matrix) -> Matrix:
    """The geometric mean of each column."""
    mean: Matrix = np.exp(np.mean(np.log(lengths + _FLOOR), axis=0))
    return mean
