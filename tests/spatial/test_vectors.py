"""Scalars of matrices, and constants put exactly where they are meant."""

import casadi
import pytest
from casadi import DM, SX

from mbs.spatial import elements, is_zero, snapped, vector

X, Y = SX.sym("x"), SX.sym("y")


def sparse():
    made = SX(2, 3)
    made[0, 1] = X
    made[1, 2] = 1e-14
    return made


MATRICES = [
    SX(DM([[1 + 1e-13, -1e-13, 0.5], [1e-12, 1 - 2e-12, -1 - 9e-13], [2 + 1e-14, 1e-300, 0]])),
    casadi.vertcat(casadi.horzcat(X, 1e-13), casadi.horzcat(-1 + 1e-15, casadi.sin(Y))),
    sparse(),
    SX(3, 1),
    SX(1 - 1e-15),
]


def one_by_one(number):
    """What the rule says for a single number."""
    nearest = round(number)
    return nearest if abs(nearest) <= 1 and abs(number - nearest) < 1e-12 else number


@pytest.mark.parametrize("matrix", MATRICES)
def test_every_constant_is_snapped_by_itself_and_the_rest_stays(matrix):
    made = snapped(matrix)
    assert made.shape == matrix.shape
    assert made.is_dense()
    for k in range(matrix.numel()):
        before, after = SX(casadi.densify(matrix)[k]), SX(made[k])
        if before.is_constant():
            assert float(after) == one_by_one(float(before))
        else:
            assert casadi.is_equal(before, after, 0)


def test_what_is_snapped_is_another_matrix():
    matrix = SX(DM([[1.0, 0.0]]))
    made = snapped(matrix)
    made[0] = 7
    assert float(matrix[0]) == 1.0


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
