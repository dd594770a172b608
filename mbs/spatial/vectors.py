"""3-vectors of SX scalars, and constants made exact."""

from collections.abc import Iterable
from typing import cast

import casadi
from casadi import SX

_SNAP = 1e-12
_ROUNDING = 2e-15


def vector(elements: Iterable[SX | float]) -> SX:
    """The column of these scalars."""
    scalars = (one if isinstance(one, SX) else SX(one) for one in elements)
    return casadi.vertcat(*scalars)


def zeros(rows: int = 3, columns: int = 1) -> SX:
    """A dense matrix of zeros."""
    return SX.zeros(rows, columns)


def skew(a: SX) -> SX:
    """(3, 3) matrix of the vector product: times b it is a x b."""
    x, y, z = a[0], a[1], a[2]
    return casadi.vertcat(
        casadi.horzcat(0, -z, y), casadi.horzcat(z, 0, -x), casadi.horzcat(-y, x, 0)
    )


def cross(a: SX, b: SX) -> SX:
    """Vector product of a and b, (3, 1), scalar by scalar so that zeros fold."""
    (a_x, a_y, a_z), (b_x, b_y, b_z) = elements(a), elements(b)
    return casadi.vertcat(a_y * b_z - a_z * b_y, a_z * b_x - a_x * b_z, a_x * b_y - a_y * b_x)


def is_zero(value: SX) -> bool:
    """Whether every element is the constant zero (a symbol is not)."""
    return value.is_zero()


def elements(value: SX) -> list[SX]:
    """The scalars of a matrix, column by column, zeros included."""
    dense = value if value.is_dense() else casadi.densify(value)
    return cast("list[SX]", dense.nonzeros())


def exact_sum(a: SX, b: SX) -> SX:
    """The scalar a + b; zero where two numbers cancel but for the rounding of their last digits.

    Constants that ought to cancel fold only so; what is small by itself stays.
    """
    if not (a.is_constant() and b.is_constant()):
        return a + b
    first, second = float(a), float(b)
    total = first + second
    return SX(0 if abs(total) <= _ROUNDING * (abs(first) + abs(second)) else total)


def snapped(value: SX) -> SX:
    """The same matrix, dense, with constants within 1e-12 of -1, 0 or 1 put exactly there.

    Rotations that come from files carry pi/2 with a dozen digits; without this their zeros
    never fold.
    """
    exact = casadi.densify(value)
    for place, element in enumerate(elements(exact)):
        if element.is_constant():
            number = float(element)
            nearest = round(number)
            if number != nearest and abs(nearest) <= 1 and abs(number - nearest) < _SNAP:
                exact[place] = nearest
    return exact
