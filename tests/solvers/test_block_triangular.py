"""Blocks of sparse matrices against numpy."""

import casadi
import numpy as np
import pytest
from casadi import DM, SX
from hypothesis import given, settings
from hypothesis import strategies as st

from mbs.solvers.block_triangular import (
    block_triangular,
    determinant,
    solve_blocks,
    solve_large,
)


def sparse(seed, n, density):
    rng = np.random.default_rng(seed)
    return rng.standard_normal((n, n)) * (rng.random((n, n)) < density)


def symbols(A):
    return casadi.densify(SX(DM(A)))


@settings(max_examples=100, deadline=None, derandomize=True)
@given(st.integers(0, 10**6), st.integers(1, 9), st.floats(0.15, 0.8))
def test_blocks_cover_the_matrix_and_nothing_stands_after_them(seed, n, density):
    A = sparse(seed, n, density)
    blocks = block_triangular(A != 0)
    if blocks is None:
        assert abs(np.linalg.det(A)) < 1e-12
        return
    assert sorted(r for b in blocks for r in b.rows) == list(range(n))
    assert sorted(c for b in blocks for c in b.columns) == list(range(n))
    solved = set()
    for block in blocks:
        solved |= set(block.columns)
        for row in block.rows:
            assert set(np.flatnonzero(A[row])) <= solved


@settings(max_examples=40, deadline=None, derandomize=True)
@given(st.integers(0, 10**6), st.integers(1, 9), st.floats(0.2, 1.0))
def test_determinant_and_solution(seed, n, density):
    A = sparse(seed, n, density)
    expected = np.linalg.det(A)
    assert float(determinant(symbols(A))) == pytest.approx(expected, rel=1e-9, abs=1e-10)
    blocks = block_triangular(A != 0)
    if blocks is None or np.linalg.cond(A) > 1e6:
        return
    X = np.array(casadi.evalf(solve_blocks(symbols(A), blocks, symbols(np.eye(n)))))
    np.testing.assert_allclose(X @ A, np.eye(n), rtol=0, atol=1e-15 * np.linalg.cond(A) * 100)


def test_triangular_matrix_is_all_blocks_of_one():
    A = np.tril(np.ones((5, 5)))[::-1]
    assert [block.size for block in block_triangular(A != 0)] == [1] * 5
    assert [block.size for block in block_triangular(np.ones((4, 4), bool))] == [4]
    assert block_triangular(np.zeros((2, 2), bool)) is None


@pytest.mark.parametrize("pairs", [15, 30, 60])
def test_operations_of_many_equations_in_blocks_are_proportional(pairs):
    """Pairs of equations, each after the one before it; up to forty CasADi solves the whole."""
    n = 2 * pairs
    rng = np.random.default_rng(pairs)
    near = np.subtract.outer(np.arange(n) // 2, np.arange(n) // 2)
    A = (rng.standard_normal((n, n)) + 3 * np.eye(n)) * ((near == 0) | (near == 1))
    order = rng.permutation(n)
    A = A[order]
    b = rng.standard_normal((n, 2))
    entries = SX.sym("a", casadi.sparsify(DM(A)).sparsity())
    right = SX.sym("b", n, 2)
    solve = casadi.Function("solve", [entries, right], [solve_large(entries, right)])
    found = solve(casadi.sparsify(DM(A)), b).full()
    assert np.allclose(found, np.linalg.solve(A, b), rtol=0, atol=1e-9)
    if pairs > 20:
        assert solve.n_instructions() < 60 * pairs
