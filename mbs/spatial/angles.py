"""Sines and cosines whose quarter turns are exact."""

import math

import casadi
from casadi import SX

_QUARTER = math.pi / 2
_SNAP = 1e-14
"""An angle this near to a quarter turn is one [rad]: sums of a few multiples of pi/2 are off by
some 4e-16 each. A tilt that a file describes is larger, and stays."""


def sin_cos(angle: SX) -> tuple[SX, SX]:
    """Sine and cosine of an angle [rad], with the quarter turns in it taken out exactly.

    sin(pi/2) is 1 and sin(pi/2 + q) is cos(q), so that constants fold. An angle within rounding
    of a quarter turn is the quarter turn.
    """
    constant, rest = _split(angle)
    quarters = round(constant / _QUARTER)
    if abs(constant - quarters * _QUARTER) > _SNAP:
        total = SX(constant) + rest
        return casadi.sin(total), casadi.cos(total)
    s, c = (SX(0), SX(1)) if rest.is_zero() else (casadi.sin(rest), casadi.cos(rest))
    return ((s, c), (c, -s), (-s, -c), (-c, s))[quarters % 4]


def _split(angle: SX) -> tuple[float, SX]:
    """The angle as a number plus a rest that has no constant term."""
    if angle.is_constant():
        return float(angle), SX(0)
    if angle.is_op(casadi.OP_ADD) or angle.is_op(casadi.OP_SUB):
        sign = -1.0 if angle.is_op(casadi.OP_SUB) else 1.0
        left, left_rest = _split(angle.dep(0))
        right, right_rest = _split(angle.dep(1))
        if left or right:
            return left + sign * right, SX(left_rest + sign * right_rest)
    return 0.0, angle
