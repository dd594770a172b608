"""Scalars of matrices, and constants put exactly where they are meant."""

import math

import casadi
from casadi import DM, SX

from mbs.spatial import elements, exact_product, is_zero, vector

X = SX.sym("x")


def sparse():
    made = SX(2, 3)
    made[0, 1] = X
    made[1, 2] = 1e-14
    return made


def test_what_cancels_but_for_rounding_is_zero_and_what_is_small_stays():
    c, s = math.cos(0.7), math.sin(0.7)
    A = SX(DM([[c, s], [-s, c]]))
    undone = exact_product(A, SX(DM([[c + 1e-16, -s], [s, c]])))
    assert undone[0, 1].is_zero()
    assert undone[1, 0].is_zero()
    tilt = SX(DM([[1.0, -1e-15], [1e-15, 1.0]]))
    assert float(exact_product(tilt, tilt)[1, 0]) == 2e-15
    tiny = SX(DM([1e-18, 2e-18]))
    assert float(exact_product(SX(DM.eye(2)), tiny)[0]) == 1e-18
    shifted = exact_product(SX(DM.eye(2)), SX(DM([0.1, 3.0])), SX(DM([0.2, -3.0])))
    assert float(shifted[0]) == 0.1 + 0.2
    assert shifted[1].is_zero()


def test_symbols_in_a_product_stay():
    made = exact_product(SX(DM([[0.6, 0.8]])), casadi.vertcat(X, 1e-30))
    value = casadi.Function("f", [X], [made])
    assert float(value(0)) == 0.8e-30
    assert made.is_dense()


def test_elements_go_column_by_column_zeros_included():
    told = [str(element) for element in elements(sparse())]
    assert told == ["0", "0", "x", "0", "0", "1e-14"]
    assert all(element.shape == (1, 1) for element in elements(sparse()))
    assert not is_zero(sparse())
    assert is_zero(SX(4, 2))


def test_a_vector_takes_scalars_and_numbers():
    made = vector([X, 2, 0.5])
    assert made.shape == (3, 1)
    assert str(made) == "[x, 2, 0.5]"
    assert vector([1.0, 2.0]).shape == (2, 1)
    assert isinstance(vector([1.0, 2.0]), SX)
