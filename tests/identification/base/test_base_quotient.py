"""Factors that cancel in quotients of expressions."""

import numpy as np
import pytest
from casadi import SX, Function

from mbs.identification.grouping.grouping import quotient

A, B = SX.sym("A"), SX.sym("B")


@pytest.mark.parametrize(
    ("value", "divisor", "text"),
    [
        (A * A, A, "A"),
        (A * B, B * A, "1"),
        (-A * A * B, A, "(-(A*B))"),
        (A, B, "(A/B)"),
        (A * (A + B), A + B, "A"),
        (SX(3) * A, SX(3), "A"),
        (A, -A, "-1"),
    ],
)
def test_shared_factors_leave(value, divisor, text):
    found = quotient(value, divisor)
    assert str(found) == text
    at = Function("at", [A, B], [found - value / divisor])
    assert np.abs(float(at(0.7, -1.3))) < 1e-15
