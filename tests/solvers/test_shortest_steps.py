"""The smallest solution in plain arithmetic against that of LAPACK."""

import casadi
import numpy as np
import pytest

from mbs.solvers.least_squares import (
    Entries,
    NewtonEquations,
    gauss_newton,
    smallest_solution,
    sparse_solution,
)

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


def windows(count, seed=0):
    """Two rows on three neighbours each, a third that depends on them, and a row of zeros."""
    rng = np.random.default_rng(seed)
    A = np.zeros((4 * count, 2 * count + 1))
    for k in range(count):
        A[4 * k : 4 * k + 2, 2 * k : 2 * k + 3] = rng.uniform(0.5, 1, (2, 3)) * [1, -1, 0.3]
        A[4 * k + 1, 2 * k] *= -1
        A[4 * k + 2] = A[4 * k] - 2 * A[4 * k + 1]
    return A, rng


@pytest.mark.parametrize("count", [1, 20, 100])
def test_a_sparse_solution_is_that_of_lapack(count):
    A, rng = windows(count)
    b = A @ rng.normal(size=A.shape[1])
    for target in (b, rng.normal(size=len(b))):
        wanted = np.linalg.lstsq(A, target, rcond=GAP)[0]
        size = np.abs(wanted).max()
        np.testing.assert_allclose(sparse_solution(entries(A), target), wanted, atol=1e-9 * size)


def test_a_sparse_solution_leaves_what_is_not_seen():
    A = np.zeros((3, 4))
    A[0, 1] = 2.0
    x = sparse_solution(entries(A), np.array([1.0, 5.0, 0.0]))
    assert x == pytest.approx([0, 0.5, 0, 0], abs=1e-12)


def entries(A):
    """All elements of the windows, some of which are zero."""
    rows, columns = np.nonzero(A + np.eye(*A.shape))
    return Entries(rows, columns, A[rows, columns], A.shape)


@pytest.mark.parametrize("whole", [True, False])
@pytest.mark.parametrize("count", [3, 80])
def test_large_and_small_ones_reach_the_same_root(count, whole):
    """Lengths 1 of a chain of points on a line, from a start nearby; 80 take the sparse steps."""
    rng = np.random.default_rng(1)
    start = np.column_stack([np.arange(count + 1.0), np.zeros(count + 1)])
    start += rng.uniform(-0.05, 0.05, start.shape)
    asked = []

    def values(x):
        d = np.diff(x.reshape(-1, 2), axis=0)
        return (d * d).sum(axis=1) - 1

    def both(x):
        asked.append(x)
        d = np.diff(x.reshape(-1, 2), axis=0)
        J = np.zeros((count, x.size))
        for k in range(count):
            J[k, 2 * k : 2 * k + 4] = [*(-2 * d[k]), *(2 * d[k])]
        return values(x), J if whole else entries(J)

    found = gauss_newton(both, start.ravel(), values=values)
    assert found.converged
    assert len(asked) < 8
    plain = start.ravel().copy()
    for _ in range(8):
        r, J = both(plain)
        J = J if whole else J.dense()
        plain -= np.linalg.pinv(J) @ r
    np.testing.assert_allclose(found.x, plain, atol=1e-10)


def test_a_residual_of_its_own_changes_no_digit():
    def values(x):
        return np.array([x[0] ** 2 + x[1] ** 2 - 1, np.sin(3 * x[0]) - x[1]])

    def both(x):
        return values(x), np.array([[2 * x[0], 2 * x[1]], [3 * np.cos(3 * x[0]), -1]])

    start = np.array([2.0, -3.0])
    first, other = gauss_newton(both, start), gauss_newton(both, start, values=values)
    assert first.converged
    assert first.x.tolist() == other.x.tolist()


def test_errors_of_equations_pass_through_the_library():
    """An error that a Function raises ends the iteration."""

    class Broken(casadi.Callback):
        def __init__(self):
            casadi.Callback.__init__(self)
            self.construct("broken", {})

        def get_n_in(self):
            return 2

        def get_n_out(self):
            return 1

        def eval(self, arguments):
            raise ValueError("no value at all")

    q, p = casadi.SX.sym("q"), casadi.SX.sym("p")
    equations = casadi.Function("equations", [q, p], [q - 1, casadi.SX(1)])
    values, one = Broken(), np.ones(1)
    with pytest.raises(RuntimeError):
        NewtonEquations(equations, values).near(2 * one, one, [0], 1e-12 * one)
    found = NewtonEquations(equations, equations).near(2 * one, one, [0], 1e-12 * one)
    assert found[0] == 1.0
