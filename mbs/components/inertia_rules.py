"""What masses and inertias a body may have, and the forms in which a user may write them."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import numpy as np

from mbs.errors import DescriptionError
from mbs.expressions import Expression, Number, Scalar, expression, to_float
from mbs.messages import quoted

_TOLERANCE = 1e-6


def check_mass(name: str, mass: Scalar) -> None:
    """Refuse a mass that is a negative number."""
    value = to_float(mass)
    if value is not None and value < 0:
        raise DescriptionError(f"{name}: mass is {value:g} kg; give zero or more")


def check_tensor(name: str, six: Iterable[Scalar], scale: float = 0.0) -> None:
    """Refuse moments of inertia about the centre of mass that no distribution of mass has.

    Args:
        name: the body, for the message.
        six: Ixx Ixy Ixz Iyy Iyz Izz.
        scale: size of the numbers that were subtracted to get these, which rounding comes from.
    """
    numbers = [value for value in map(to_float, six) if value is not None]
    if len(numbers) < 6:
        return
    low, middle, high = np.linalg.eigvalsh(tensor_matrix(numbers))
    slack = _TOLERANCE * max(abs(high), scale)
    if low < -slack:
        raise DescriptionError(
            f"{name}: the inertia about the centre of mass has the negative principal moment"
            f" {low:g} kg m^2; give a positive inertia tensor"
        )
    if low + middle < high - slack:
        raise DescriptionError(
            f"{name}: the principal moments {low:g}, {middle:g}, {high:g} kg m^2 break the triangle"
            " inequality; the largest must not exceed the sum of the other two"
        )


def tensor_matrix(six: list[float]) -> Any:
    """The (3, 3) symmetric matrix of Ixx Ixy Ixz Iyy Iyz Izz."""
    XX, XY, XZ, YY, YZ, ZZ = six
    return np.array([[XX, XY, XZ], [XY, YY, YZ], [XZ, YZ, ZZ]])


def three(values: Any, where: str) -> tuple[Expression, ...]:
    """The three scalars (x, y, z) that a user wrote."""
    try:
        x, y, z = [] if isinstance(values, str) else list(values)
    except (TypeError, ValueError):
        raise DescriptionError(
            f"{where}: {quoted(values)} has not three values; give (x, y, z)"
        ) from None
    return tuple(expression(v, f"{where}, {n}") for n, v in zip("xyz", (x, y, z), strict=True))


def six_of(values: Any, where: str) -> tuple[Expression, ...]:
    """Ixx Ixy Ixz Iyy Iyz Izz of an inertia that a user wrote in any of the accepted forms."""
    flat: list[Any] = []
    for value in values if hasattr(values, "__len__") and not isinstance(values, str) else [values]:
        nested = hasattr(value, "__len__") and not isinstance(value, str)
        flat.extend(value if nested else [value])
    elements = [expression(value, where) for value in flat]
    zero: Expression = Number(0.0)
    if len(elements) == 3:
        return elements[0], zero, zero, elements[1], zero, elements[2]
    if len(elements) == 6:
        return tuple(elements)
    if len(elements) == 9 and all(_equal(elements[a], elements[b]) for a, b in _TWINS):
        return tuple(elements[k] for k in (0, 1, 2, 4, 5, 8))
    raise DescriptionError(
        f"{where}: {quoted(values)} is not an inertia; give three principal moments,"
        " Ixx Ixy Ixz Iyy Iyz Izz, or a symmetric (3, 3) matrix"
    )


_TWINS = ((1, 3), (2, 6), (5, 7))


def _equal(a: Expression, b: Expression) -> bool:
    """Whether two elements of a tensor are the same, up to the rounding of numbers."""
    if isinstance(a, Number) and isinstance(b, Number):
        return math.isclose(a.value, b.value, rel_tol=_TOLERANCE, abs_tol=1e-12)
    return a == b
