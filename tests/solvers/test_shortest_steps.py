"""The smallest solution in plain arithmetic against that of LAPACK."""

import numpy as np
import pytest

from mbs.solvers.least_squares import smallest_solution

GAP = 1e-9


@pytest.mark.parametrize(
    ("m", "n", "rank"),
    [(5, 3, 3), (3, 5, 3), (6, 5, 4), (4, 4, 4), (30, 45, 25), (1, 4, 1), (4, 1, 1), (4, 4, 0)],
)
def test_it_is_that_of_lapack(m, n, rank):
    rng = np.random.default_rng(m + 10 * n)
    A, b = rng.normal(size=(m, rank)) @ rng.normal(size=(rank, n)), rng.normal(size=m)
    A[:, rng.integers(n)] *= 1e-3
    wanted = np.linalg.lstsq(A, b, rcond=GAP)[0]
    size = np.abs(wanted).max()
    np.testing.assert_allclose(smallest_solution(A, b, GAP), wanted, atol=1e-10 * size)


@pytest.mark.parametrize("size", [(0, 3), (3, 0)])
def test_nothing_to_solve(size):
    assert smallest_solution(np.zeros(size), np.zeros(size[0]), GAP).tolist() == [0.0] * size[1]


@pytest.mark.parametrize(("small", "expected"), [(1e-8, 1e8), (1e-10, 0.0)])
def test_columns_below_the_gap_are_dependent(small, expected):
    A = np.array([[1.0, 1.0], [0.0, small]])
    x = smallest_solution(A, np.array([1.0, 1.0]), GAP)
    assert x[1] == pytest.approx(expected or 0.5, rel=1e-6)


def test_columns_that_tie_give_the_same_digits():
    """A sum over permuted rows is another sum; columns of equal length keep their order."""
    rng = np.random.default_rng(3)
    A = rng.normal(size=(8, 3))
    A /= np.sqrt(np.sum(A * A, axis=0))
    b = rng.normal(size=8)
    first = smallest_solution(A, b, GAP)
    shaken = smallest_solution(A * (1 + 1e-15 * rng.uniform(-1, 1, 3)), b, GAP)
    np.testing.assert_allclose(first, shaken, rtol=1e-13)
