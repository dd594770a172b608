"""Scalars of matrices, and constants put exactly where they are meant."""

import math

import casadi
from casadi import DM, SX

from mbs.spatial import elements, exact_product, formula, is_zero, vector

X = SX.sym("x")


def sparse():
    made = SX(2, 3)
    made[0, 1] = X
    made[1, 2] = 1e-14
    return made


def test_what_cancels_but_for_rounding_is_zero_and_what_is_small_stays():
    c, s = math.cos(0.7), math.sin(0.7)
    A = SX(DM([[c, s, 0], [-s, c, 0], [0, 0, 1]]))
    undone = exact_product(A, SX(DM([[c + 1e-16, -s, 0], [s, c, 0], [0, 0, 1]])))
    assert undone[0, 1].is_zero()
    assert undone[1, 0].is_zero()
    tilt = SX(DM([[1.0, -1e-15, 0], [1e-15, 1.0, 0], [0, 0, 1.0]]))
    assert float(exact_product(tilt, tilt)[1, 0]) == 2e-15
    tiny = SX(DM([1e-18, 2e-18, 0]))
    assert float(exact_product(SX(DM.eye(3)), tiny)[0]) == 1e-18
    shifted = exact_product(SX(DM.eye(3)), SX(DM([0.1, 3.0, 0])), SX(DM([0.2, -3.0, 0])))
    assert float(shifted[0]) == 0.1 + 0.2
    assert shifted[1].is_zero()


def test_symbols_in_a_product_stay():
    A = SX(DM([[0.6, 0.8, 0], [-0.8, 0.6, 0], [0, 0, 1]]))
    made = exact_product(A, casadi.vertcat(X, 1e-30, 0))
    value = casadi.Function("f", [X], [made[0]])
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


def test_a_formula_makes_the_operations_of_its_text_and_is_read_once_for_each_case():
    read = []

    @formula((2, 1), (1, 1))
    def scaled(v: SX, c: SX, sign: int) -> tuple[SX, SX]:
        """A product and a sum."""
        read.append(sign)
        return c * v, v[0] + sign * c

    y = SX.sym("y")
    v = casadi.vertcat(X, y)
    for sign in (1, -1, 1):
        product, total = scaled(v, X, sign)
        by_hand = (casadi.vertcat(X * X, X * y), X + X if sign > 0 else X - X)
        for made, expected in zip((product, total), by_hand, strict=True):
            assert casadi.is_equal(made, expected, 3)
    assert read == [1, -1]
    assert scaled.__doc__ == "A product and a sum."
    product, total = scaled(v, SX(0), 1)
    assert product.is_zero()
    assert casadi.is_equal(total, X)
    assert [str(one) for one in elements(scaled(v, SX(1), 1)[0])] == ["x", "y"]
