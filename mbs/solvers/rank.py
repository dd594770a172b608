"""Rank, null space and independent rows of matrices that depend on a configuration."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from casadi import DM
from numpy.typing import NDArray

Matrix = NDArray[np.float64]

RELATIVE_GAP = 1e-8
"""Fraction of the largest singular value below which others count as zero. It is as many orders
above the rounding error (1e-16) as below one."""

EQUAL = 1e-6
"""Relative difference below which two scores are equal; the first of them is then chosen.

It is orders of magnitude above the rounding of scores (1e-15, or 1e-12 for configurations that were
closed by iteration), and orders below differences that matter for the choice.
"""

_FLOOR = 1e-12
"""Length of a row that counts as zero: rounding of rows of about unit length leaves 1e-16."""


def dense(matrix: DM) -> Matrix:
    """Return a DM matrix as a dense array of the same shape."""
    full = np.zeros(matrix.shape)
    rows, columns = matrix.sparsity().get_triplet()
    full[rows, columns] = matrix.nonzeros()
    return full


def first_best(scores: Sequence[float] | Matrix, equal: float = EQUAL) -> int:
    """Return the index of the largest score; the first one if several differ by rounding only.

    Args:
        scores: scores without NaN; at least one is finite.
        equal: relative difference from the largest score below which a score is equal to it.
    """
    values = np.asarray(scores, dtype=float)
    largest = float(values.max())
    return int(np.argmax(values >= largest - equal * abs(largest)))


def graded(score: float) -> float:
    """Return a score rounded to six digits, so that rounding errors do not affect sorting."""
    return float(f"{score:.6g}")


def rank(matrix: Matrix, gap: float = RELATIVE_GAP) -> int:
    """Return the number of singular values above `gap` times the largest; 0 for an empty matrix."""
    if matrix.size == 0:
        return 0
    values = np.linalg.svd(matrix, compute_uv=False)
    return int(np.sum(values > gap * values[0]))


def null_space(matrix: Matrix, gap: float = RELATIVE_GAP) -> Matrix:
    """Return orthonormal columns (n, n - rank) that span the null space of a matrix (m, n).

    Singular values up to `gap` times the largest count as zero.
    """
    return null_space_of(matrix, matrix.shape[1] - rank(matrix, gap))


def null_space_of(matrix: Matrix, dimension: int) -> Matrix:
    """Return orthonormal columns (n, dimension) of an approximate null space of a matrix (m, n).

    They are the right singular vectors of the smallest singular values.
    """
    return np.array(np.linalg.svd(matrix)[2][matrix.shape[1] - dimension :].T)


def independent_rows(
    matrices: Sequence[Matrix], count: int, first: tuple[int, ...] = ()
) -> list[int]:
    """Return `count` row indices whose rows are independent in all matrices, in increasing order.

    Gram-Schmidt with pivoting on all matrices at once. The next row has the longest part orthogonal
    to the previous rows, by the geometric mean over the matrices, so that rows which are dependent
    in a single matrix are avoided.

    Args:
        matrices: (m, n) each, the same rows at several configurations.
        count: number of rows.
        first: rows to select before all others, in this order.
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
            # a row without a column in common remains unchanged
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
    """Return the geometric mean over the matrices (m,) of row lengths (matrices, m)."""
    mean: Matrix = np.exp(np.mean(np.log(lengths + _FLOOR), axis=0))
    return mean
