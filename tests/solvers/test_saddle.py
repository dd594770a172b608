"""Constrained equations solved without pivoting, against numpy."""

import casadi
import numpy as np
import pytest
from casadi import DM, SX, Function
from hypothesis import given, settings
from hypothesis import strategies as st

from mbs.solvers.linear import elimination_order, solve_saddle


def solved(A, J, b, d, scale=1.0):
    symbols = [
        SX.sym(name, casadi.DM(DM(x)).sparsity())
        for name, x in zip("AJbd", (A, J, b, d), strict=True)
    ]
    f = Function("f", symbols, [*solve_saddle(*symbols, scale)])
    return [np.array(x).ravel() for x in f(A, J, b, d)]


def reference(A, J, b, d):
    m = len(J)
    whole = np.block([[A, -J.T], [J, np.zeros((m, m))]])
    found = np.linalg.solve(whole, np.concatenate([b, d]))
    return found[: len(A)], found[len(A) :]


def problem(seed, n, m):
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(n, n))
    return (
        root @ root.T + np.eye(n),
        rng.normal(size=(m, n)),
        rng.normal(size=n),
        rng.normal(size=m),
    )


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10_000), n=st.integers(1, 7), m=st.integers(0, 6))
def test_regular_equations_are_solved(seed, n, m):
    A, J, b, d = problem(seed, n, min(m, n))
    x, y = solved(A, J, b, d)
    x_ref, y_ref = reference(A, J, b, d)
    assert x == pytest.approx(x_ref, rel=1e-7, abs=1e-7)
    assert y == pytest.approx(y_ref, rel=1e-6, abs=1e-6)


def test_a_singular_matrix_is_made_regular_by_the_rows():
    A = np.diag([2.0, 0.0, 3.0])
    J = np.array([[1.0, -1.0, 0.0]])
    b, d = np.array([1.0, 2.0, 3.0]), np.array([0.5])
    x, y = solved(A, J, b, d, scale=2.0)
    x_ref, y_ref = reference(A, J, b, d)
    assert x == pytest.approx(x_ref, abs=1e-12)
    assert y == pytest.approx(y_ref, abs=1e-12)


def test_dependent_rows_share_their_effort_and_keep_the_solution():
    A, J, b, d = problem(3, 4, 1)
    twice = np.vstack([J, J])
    x, y = solved(A, twice, b, np.concatenate([d, d]))
    x_ref, y_ref = reference(A, J, b, d)
    assert x == pytest.approx(x_ref, abs=1e-9)
    assert twice.T @ y == pytest.approx(J.T @ y_ref, abs=1e-3)


def banded(links):
    """The pattern of a row of four-bars: a rod, a coupler on it, two rows to the next rod."""
    n, m = 2 * links + 1, 2 * links
    A, J = DM(n, n), DM(m, n)
    for k in range(links):
        A[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = 1
        J[2 * k : 2 * k + 2, 2 * k : 2 * k + 3] = 1
    A[n - 1, n - 1] = 1
    return A, J


def test_the_work_grows_with_the_number_of_loops_and_not_faster():
    def operations(links):
        A, J = (SX.sym("x", x.sparsity()) for x in banded(links))
        f = Function(
            "f", [A, J], [*solve_saddle(A, J, SX.ones(A.shape[0]), SX.ones(J.shape[0]), 1.0)]
        )
        return f.n_instructions()

    ten, twenty, forty = (operations(links) for links in (10, 20, 40))
    assert forty - twenty == pytest.approx(2 * (twenty - ten), rel=0.02)


def test_rows_come_after_the_columns_that_they_act_on():
    A, J = banded(5)
    n, m = A.shape[0], J.shape[0]
    whole = casadi.blockcat([[A + J.T @ J, J.T], [J, DM.eye(m)]])
    order = elimination_order(casadi.sparsify(whole).sparsity(), n)
    assert sorted(order) == list(range(n + m))
    for row in range(m):
        columns = casadi.sparsify(J[row, :]).sparsity().get_triplet()[1]
        assert all(order.index(column) < order.index(n + row) for column in columns)


@pytest.mark.parametrize("acting", [(1, 1), (1, 0), (0, 1), (0, 0)])
def test_switched_rows_act_where_they_are_on(acting):
    A, J, b, d = problem(7, 5, 3)
    on = np.array([1, *acting])
    switch = SX.sym("switch", 2)
    rows = casadi.diag(casadi.vertcat(1, switch))
    corner = casadi.vertcat(SX(1, 1), 1 - switch)
    x, y = solve_saddle(SX(A), casadi.mtimes(rows, J), SX(b), casadi.mtimes(rows, d), 1.0, corner)
    x, y = (np.array(z).ravel() for z in Function("f", [switch], [x, y])(acting))
    x_ref, y_ref = reference(A, J[on == 1], b, d[on == 1])
    assert x == pytest.approx(x_ref, abs=1e-12)
    assert y[on == 1] == pytest.approx(y_ref, abs=1e-11)
    assert np.all(y[on == 0] == 0)


def test_switched_rows_that_depend_on_others_share_to_many_digits():
    A, J, b, d = problem(3, 4, 1)
    corner = SX(DM([0.0]).sparsity(), 0.0)
    twice, right = np.vstack([J, J]), np.concatenate([d, d])
    both = casadi.vertcat(SX(1, 1), corner)
    x, y = (
        np.array(casadi.evalf(z)).ravel()
        for z in solve_saddle(SX(A), SX(twice), SX(b), SX(right), 1.0, both)
    )
    x_ref, y_ref = reference(A, J, b, d)
    assert x == pytest.approx(x_ref, abs=1e-9)
    assert twice.T @ y == pytest.approx(J.T @ y_ref, abs=1e-6)
