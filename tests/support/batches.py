"""What the tests of batches share."""

import casadi as ca
import numpy as np


def example(rows=5, columns=3):
    """Two inputs, one of them a matrix, and a vector and a matrix out."""
    x, m = ca.SX.sym("x", rows), ca.SX.sym("m", rows, columns)
    return ca.Function("f", [x, m], [ca.sin(x) + m[:, 1], x * m], ["x", "m"], ["y", "z"])


def bits(array):
    return np.ascontiguousarray(array).view(np.int64)
