import ctypes

import numpy as np
import pytest
from support.runtime import call, runtime

from mbs.native import compiler_found

pytestmark = pytest.mark.skipif(not compiler_found(), reason="no C compiler")

_MOST = 32


class _QR(ctypes.Structure):
    _fields_ = (
        ("rows", ctypes.c_int),
        ("columns", ctypes.c_int),
        ("steps", ctypes.c_int),
        ("A", ctypes.c_void_p),
        ("weight", ctypes.c_double * _MOST),
        ("order", ctypes.c_int * _MOST),
    )


@pytest.fixture(scope="module")
def library():
    made = runtime("dense")
    made.dense_regularity.restype = ctypes.c_double
    return made


@pytest.mark.parametrize("shape", [(1, 1), (3, 3), (14, 8), (12, 12), (32, 32), (9, 2)])
def test_the_factors_multiply_to_the_matrix(library, shape):
    A = np.random.default_rng(1).standard_normal(shape)
    f, R = factorized(library, A, shape[1])
    whole = np.asfortranarray(np.eye(shape[0]))
    call(library.dense_turn, ctypes.byref(f), whole, shape[0])
    Q = whole.T
    assert np.max(np.abs(Q.T @ Q - np.eye(shape[0]))) < 1e-14
    assert np.max(np.abs(Q @ np.triu(R) - A[:, f.order[: shape[1]]])) < 1e-13
    diagonal = np.abs(np.diag(R))
    assert np.all(diagonal[1:] <= diagonal[:-1] * (1 + 1e-14))


def test_least_squares(library):
    rng = np.random.default_rng(2)
    for rows, columns in ((12, 12), (24, 5), (9, 6)):
        A, B = rng.standard_normal((rows, columns)), rng.standard_normal((rows, 4))
        f, _ = factorized(library, A, columns)
        X = np.asfortranarray(B)
        library.dense_solve(
            ctypes.byref(f), ctypes.c_void_p(X.ctypes.data), 4, ctypes.c_double(1e-15)
        )
        expected = np.linalg.lstsq(A, B, rcond=None)[0]
        assert np.max(np.abs(X[:columns] - expected)) < 1e-12


def test_pivots_are_no_smaller_than_asked(library):
    A = np.array([[1.0, 1.0], [1.0, 1.0]])
    f, _ = factorized(library, A, 2)
    X = np.asfortranarray(np.array([[1.0], [1.0]]))
    library.dense_solve(ctypes.byref(f), ctypes.c_void_p(X.ctypes.data), 1, ctypes.c_double(1e-9))
    assert np.max(np.abs(A @ X - 1.0)) < 1e-6
    assert np.max(np.abs(X)) < 10


@pytest.mark.parametrize("count", [1, 2, 4])
def test_what_is_orthogonal_to_the_columns(library, count):
    rng = np.random.default_rng(count)
    A = rng.standard_normal((12, 12 - count)) @ rng.standard_normal((12 - count, 12))
    f, _ = factorized(library, A, 12 - count)
    V = np.empty((12, count), order="F")
    call(library.dense_complement, ctypes.byref(f), V, count)
    assert np.max(np.abs(A.T @ V)) < 1e-13
    assert np.max(np.abs(V.T @ V - np.eye(count))) < 1e-14


def test_regularity_follows_the_condition(library):
    rng = np.random.default_rng(4)
    for power in (0, 3, 9):
        Q, P = (np.linalg.qr(rng.standard_normal((12, 12)))[0] for _ in range(2))
        f, _ = factorized(library, Q * np.geomspace(1, 10.0**-power, 12) @ P, 12)
        regularity = call(library.dense_regularity, ctypes.byref(f))
        assert 10.0**-power / 5 < regularity < 30 * 10.0**-power
    f, _ = factorized(library, np.zeros((3, 3)), 3)
    assert call(library.dense_regularity, ctypes.byref(f)) == 0.0


def factorized(library, A, steps):
    """The C factors, and the array of R that they point to."""
    own = A.copy(order="F")
    f = _QR(A.shape[0], A.shape[1], steps, own.ctypes.data)
    library.dense_factorize(ctypes.byref(f))
    return f, own
