"""Quotients of expressions without the factors that both sides share."""

from __future__ import annotations

from math import prod

import casadi
from casadi import SX

_DEPTH = 9


def quotient(value: SX, divisor: SX) -> SX:
    """The quotient of two scalars, such as A for A^2 / A."""
    above, below = _factors(value), _factors(divisor)
    rest: list[SX] = []
    for factor in above:
        same = (k for k, other in enumerate(below) if casadi.is_equal(factor, other, _DEPTH))
        place = next(same, None)
        if place is None:
            rest.append(factor)
        else:
            del below[place]
    return SX(prod(rest, start=SX(1)) / prod(below, start=SX(1)))


def _factors(value: SX) -> list[SX]:
    if value.is_op(casadi.OP_MUL):
        return _factors(value.dep(0)) + _factors(value.dep(1))
    if value.is_op(casadi.OP_SQ):
        return 2 * _factors(value.dep(0))
    if value.is_op(casadi.OP_NEG):
        return [SX(-1), *_factors(value.dep(0))]
    return [value]
