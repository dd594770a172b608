"""Ranks, and which of several scores or rows is taken."""

import numpy as np
import pytest

from mbs.solvers.rank import first_best, independent_rows, null_space, rank


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
