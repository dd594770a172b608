import numpy as np
import pytest
from support.runtime import call, runtime

from mbs.native import compiler_found

pytestmark = pytest.mark.skipif(not compiler_found(), reason="no C compiler")


@pytest.fixture(scope="module")
def library():
    return runtime("eigenvalues")


@pytest.mark.parametrize("n", [1, 2, 3, 5, 8, 13, 24, 32])
def test_random_matrices(library, n):
    rng = np.random.default_rng(n)
    for _ in range(10):
        A = rng.standard_normal((n, n))
        assert distance(eigenvalues(library, A), np.linalg.eigvals(A)) < 1e-12


@pytest.mark.parametrize("scale", [1e-200, 1e-3, 1e200])
def test_rows_and_columns_of_very_different_size(library, scale):
    rng = np.random.default_rng(1)
    A = scale * rng.standard_normal((12, 12))
    d = 10.0 ** rng.integers(-6, 7, 12)
    found = eigenvalues(library, A / d[:, None] * d)
    assert distance(found / scale, np.linalg.eigvals(A / scale)) < 1e-10


@pytest.mark.parametrize("n", [2, 3, 8, 24])
def test_a_cyclic_permutation(library, n):
    A = np.roll(np.eye(n), 1, axis=1)
    assert distance(eigenvalues(library, A), np.exp(2j * np.pi * np.arange(n) / n)) < 1e-13


def test_eigenvalues_that_many_directions_share(library):
    rng = np.random.default_rng(2)
    for n in range(4, 25):
        k = int(rng.integers(2, n + 1))
        values = np.concatenate([np.full(k, rng.standard_normal()), rng.standard_normal(n - k)])
        Q = np.linalg.qr(rng.standard_normal((n, n)))[0]
        assert distance(eigenvalues(library, Q * values @ Q.T), values) < 1e-12
        S = rng.standard_normal((n, n))
        A = S * values @ np.linalg.inv(S)
        bound = 1e-14 * np.linalg.cond(S) * np.linalg.norm(A)
        assert distance(eigenvalues(library, A), values) < bound


@pytest.mark.parametrize("n", [2, 3, 4])
def test_a_single_direction_for_all(library, n):
    Q = np.linalg.qr(np.random.default_rng(n).standard_normal((n, n)))[0]
    A = Q @ (2 * np.eye(n) + np.eye(n, k=1)) @ Q.T
    found = eigenvalues(library, A)
    assert distance(found, np.full(n, 2.0)) < 10 * (1e-15) ** (1 / n)
    assert np.sum(found) == pytest.approx(2 * n, abs=1e-13)


def test_zero_and_one(library):
    assert not eigenvalues(library, np.zeros((6, 6))).any()
    assert np.array_equal(eigenvalues(library, np.eye(6)), np.ones(6))


def test_pairs_follow_each_other(library):
    rng = np.random.default_rng(5)
    values = eigenvalues(library, rng.standard_normal((24, 24)))
    upper = np.flatnonzero(values.imag > 0)
    assert len(upper) > 3
    assert np.array_equal(values[upper + 1], np.conj(values[upper]))


def eigenvalues(library, A):
    A = np.array(A, dtype=float, order="C")
    real, imaginary = np.empty(len(A)), np.empty(len(A))
    assert call(library.eigenvalues, len(A), A, real, imaginary) == 0
    return real + 1j * imaginary


def distance(found, expected):
    """The largest between pairs, the nearest ones first."""
    left, worst = list(expected), 0.0
    for value in found:
        gaps = np.abs(np.array(left) - value)
        worst = max(worst, gaps.min())
        left.pop(int(gaps.argmin()))
    return worst
