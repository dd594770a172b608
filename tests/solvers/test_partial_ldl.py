"""L D L' without rows that nearly depend on others, against the same rows left out."""

import casadi
import numpy as np
from casadi import DM, SX, Function

from mbs.solvers.linear import partial_ldl

LEAST = 1e-6


def solved(S, b):
    """x of S x = b by the rows that count, and which these are."""
    n = len(b)
    X, y = SX.sym("S", casadi.sparsify(DM(S)).sparsity()), SX.sym("b", n)
    D, LT, order, good = partial_ldl(X, SX.ones(n) * LEAST)
    x = casadi.ldl_solve(y, casadi.if_else(good, D, 1e300), LT, order)
    places = [order.index(k) for k in range(n)]
    f = Function("f", [X, y], [x, good[places]])
    return [np.array(value).ravel() for value in f(DM(S)[X.sparsity()], b)]


def rows(nearly):
    """Seven unit rows; row 4 is the sum of others but for `nearly`."""
    rng = np.random.default_rng(1)
    J = rng.normal(size=(7, 10)) * (rng.random((7, 10)) < 0.5)
    J[4] = J[1] - 2 * J[2] + nearly * rng.normal(size=10)
    return J


def test_independent_rows_are_solved():
    J = rows(1.0)
    S, b = J @ J.T, np.arange(7.0)
    x, good = solved(S, b)
    assert good.tolist() == [1] * 7
    np.testing.assert_allclose(S @ x, b, atol=1e-11)


def test_a_row_that_nearly_depends_on_others_harms_none():
    """What is left of it is rounding; the step of the other rows is what it is without it."""
    J = rows(1e-9)
    b = J @ np.linspace(-1, 1, 10) + 1e-9 * np.cos(np.arange(7))
    x, good = solved(J @ J.T, b)
    assert sorted(good.tolist()) == [0] + [1] * 6
    kept = good > 0
    step = J[kept].T @ np.linalg.solve(J[kept] @ J[kept].T, b[kept])
    np.testing.assert_allclose(J.T @ x, step, atol=1e-12)
    np.testing.assert_allclose(J[kept] @ J.T @ x, b[kept], atol=1e-13)
