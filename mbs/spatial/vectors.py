"""3-vectors of SX scalars, and constants made exact."""

from collections.abc import Iterable

import casadi
from casadi import SX

_SNAP = 1e-12
_ROUNDING = 2e-15


def vector(elements: Iterable[SX | float]) -> SX:
    """The column of these scalars."""
    return casadi.vertcat(*(SX(element) for element in elements))


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
    return casadi.vertcat(
        a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
    )


def is_zero(value: SX) -> bool:
    """Whether every element is the constant zero (a symbol is not)."""
    return all(element.is_zero() for element in elements(value))


def elements(value: SX) -> list[SX]:
    """The scalars of a matrix, column by column, zeros included."""
    dense = casadi.densify(value)
    return [SX(dense[k]) for k in range(dense.numel())]


def exact_sum(a: SX, b: SX) -> SX:
    """The scalar a + b; zero where two numbers cancel but for the rounding of their last digits.

    Constants that ought to cancel fold only so; what is small by itself stays.
    """
    total = SX(a + b)
    if not (a.is_constant() and b.is_constant()):
        return total
    return SX(0) if abs(float(total)) <= _ROUNDING * (abs(float(a)) + abs(float(b))) else total


def snapped(value: SX) -> SX:
    """The same matrix with constants within 1e-12 of -1, 0 or 1 put exactly there.

    Rotations that come from files carry pi/2 with a dozen digits; without this their zeros
    never fold.
    """
    return casadi.reshape(
        casadi.vertcat(*(_snapped(element) for element in elements(value))),
        *value.shape,
    )


def _snapped(element: SX) -> SX:
    if not element.is_constant():
        return element
    number = float(element)
    nearest = round(number)
    return SX(nearest) if abs(nearest) <= 1 and abs(number - nearest) < _SNAP else SX(number)
