"""Ranks, and which of several scores or rows is taken."""

import casadi
import numpy as np
import pytest

from mbs.solvers.rank import dense, first_best, independent_rows, null_space, rank


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9])
@pytest.mark.parametrize(("more", "best"), [(3e-7, 0), (3e-6, 1)])
def test_scores_are_equal_to_a_millionth(scale, more, best):
    assert first_best([scale, scale * (1 + more)]) == best


@pytest.mark.parametrize(("small", "found"), [(3e-9, 1), (3e-8, 2)])
def test_a_singular_value_counts_from_1e_8_of_the_largest(small, found):
    assert rank(1e3 * np.diag([1.0, small])) == found
    assert null_space(np.diag([1.0, small])).shape == (2, 2 - found)


def test_a_row_that_one_matrix_lacks_is_avoided():
    whole, lacking = np.diag([3.0, 2.0, 1.0]), np.diag([3.0, 0.0, 1.0])
    assert independent_rows([whole, whole], 2) == [0, 1]
    assert independent_rows([whole, lacking], 2) == [0, 2]
    assert independent_rows([whole, lacking], 2, (1,)) == [0, 1]


def rows_of_all(matrices, count, first):
    """The same, every row taken at every step."""
    rest, chosen = [np.array(matrix) for matrix in matrices], []
    for k in range(count):
        lengths = np.array([np.linalg.norm(matrix, axis=1) for matrix in rest])
        score = np.exp(np.mean(np.log(lengths + 1e-12), axis=0))
        score[chosen] = -np.inf
        pivot = first[k] if k < len(first) else first_best(score)
        for number, matrix in enumerate(rest):
            direction = matrix[pivot] / max(float(lengths[number, pivot]), 1e-12)
            rest[number] = matrix - np.sum(matrix * direction, axis=1)[:, None] * direction
        chosen.append(pivot)
    return sorted(chosen)


@pytest.mark.parametrize("seed", range(40))
def test_rows_without_a_common_column_are_passed_over(seed):
    rng = np.random.default_rng(seed)
    m, n = rng.integers(6, 40), rng.integers(3, 25)
    shown = rng.random((m, n)) < rng.choice([0.1, 0.3, 1.0])
    base = np.round(rng.normal(size=(m, n)), int(seed % 3))
    matrices = [(base + 0.3 * (seed % 2) * rng.normal(size=(m, n))) * shown for _ in range(3)]
    for matrix in matrices:
        matrix[3], matrix[0] = matrix[1] + matrix[2], 0.0
    count = min(map(rank, matrices))
    first = tuple(rng.permutation(m)[: min(2, count)].tolist())
    for begins in ((), first):
        assert independent_rows(matrices, count, begins) == rows_of_all(matrices, count, begins)


def test_zeros_of_a_sparse_matrix_are_filled_in():
    matrix = casadi.DM.triplet([0, 2, 1], [1, 0, 1], [1.5, -2.0, 0.0], 3, 2)
    assert dense(matrix).tolist() == [[0, 1.5], [0, 0], [-2, 0]]
    assert dense(casadi.DM(0, 3)).shape == (0, 3)
