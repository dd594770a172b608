"""3-vectors of SX scalars, sums and products with exact zeros, exact sines of quarter turns."""

import math
from collections.abc import Callable, Iterable
from functools import wraps
from typing import Any, ParamSpec, TypeVar, cast

import casadi
from casadi import SX, Function

_ROUNDING = 2e-15
"""Size of a sum relative to its terms below which it counts as rounding error: about ten units in
the last place, far above two or three rounding errors and far below an intended tilt."""


_SMALL = 1e-9
"""Magnitude above which a number is no rounding error of terms below 1000 km, and is not tested."""


Given = ParamSpec("Given")
Made = TypeVar("Made")


def formula(
    *shapes: tuple[int, int],
) -> Callable[[Callable[Given, Made]], Callable[Given, Made]]:
    """Return a decorator for functions of SX, which traces them once per case.

    Later calls evaluate the traced graph.

    The call creates the same operations as the Python code, with constants folded, about ten times
    faster.

    Args:
        shapes: shapes of the leading SX arguments. Further arguments are hashable and select the
            case; the code may branch on them.
    """

    def evaluated(text: Callable[Given, Made]) -> Callable[Given, Made]:
        functions: dict[tuple[Any, ...], tuple[Function, list[str]]] = {}
        count = len(shapes)
        names = [f"x{k}" for k in range(count)]

        def on_expressions(*arguments: Any) -> Any:
            case = arguments[count:]
            if case not in functions:
                symbols = [SX.sym(name, *shape) for name, shape in zip(names, shapes, strict=True)]
                found: Any = cast("Callable[..., Any]", text)(*symbols, *case)
                results = [*found] if isinstance(found, tuple) else [found]
                outs = [f"y{k}" for k in range(len(results))]
                title = text.__name__.strip("_")
                functions[case] = Function(title, symbols, results, names, outs), outs
            function, outs = functions[case]
            # call by name: for a list CasADi tries more types before it finds SX
            made = function.call(dict(zip(names, arguments, strict=False)))
            return made["y0"] if len(outs) == 1 else tuple(made[name] for name in outs)

        return cast("Callable[Given, Made]", wraps(text)(on_expressions))

    return evaluated


def vector(elements: Iterable[SX | float]) -> SX:
    """Return the column (n, 1) of n scalars, numbers or SX.

    Args:
        elements: n scalars.
    """
    scalars = (one if isinstance(one, SX) else SX(one) for one in elements)
    return casadi.vertcat(*scalars)


def zeros(rows: int = 3, columns: int = 1) -> SX:
    """Return a dense SX matrix (rows, columns) of zeros."""
    return SX.zeros(rows, columns)


@formula((3, 1))
def skew(a: SX) -> SX:
    """Return the (3, 3) matrix S of the cross product with a (3, 1): S b = a x b."""
    x, y, z = a[0], a[1], a[2]
    return casadi.vertcat(
        casadi.horzcat(0, -z, y), casadi.horzcat(z, 0, -x), casadi.horzcat(-y, x, 0)
    )


@formula((3, 1), (3, 1))
def cross(a: SX, b: SX) -> SX:
    """Return the cross product a x b (3, 1), computed by scalars so that zeros are folded."""
    (a_x, a_y, a_z), (b_x, b_y, b_z) = elements(a), elements(b)
    return casadi.vertcat(a_y * b_z - a_z * b_y, a_z * b_x - a_x * b_z, a_x * b_y - a_y * b_x)


def is_zero(value: SX) -> bool:
    """Return whether all elements are the constant zero; False for an expression with symbols.

    Args:
        value: matrix.
    """
    return value.is_zero()


def elements(value: SX) -> list[SX]:
    """Return the scalars of a matrix, column by column, including zeros, as 1 x 1 SX.

    Args:
        value: (m, n) matrix, possibly sparse.
    """
    dense = value if value.is_dense() else casadi.densify(value)
    return cast("list[SX]", dense.nonzeros())


def numbers(value: SX) -> list[float]:
    """Return the elements of a constant matrix as floats, column by column.

    Raise if it has symbols.

    Args:
        value: (m, n) matrix without symbols.
    """
    return [float(element) for element in elements(value)]


# Python operators of CasADi dispatch on the argument type, which takes several times as long as the
# operation. These functions skip the dispatch for SX arguments in frequently called code.


def plus(a: SX, b: SX) -> SX:
    """Return a + b elementwise, for SX of equal shape or a scalar.

    Faster than the Python operator.
    """
    return SX.binary(casadi.OP_ADD, a, b)


def times(a: SX, b: SX) -> SX:
    """Return a * b elementwise, for SX of equal shape or a scalar.

    Faster than the Python operator.
    """
    return SX.binary(casadi.OP_MUL, a, b)


def _sine_and_cosine(angle: SX) -> tuple[SX, SX]:
    """Return the expressions sin(angle) and cos(angle), without simplification."""
    return SX.unary(casadi.OP_SIN, angle), SX.unary(casadi.OP_COS, angle)


def exact_sum(a: SX, b: SX) -> SX:
    """Return the scalar a + b; zero if two numbers cancel up to rounding errors.

    Exact zeros let CasADi fold constants. A small sum of small numbers is not changed.
    """
    if not (a.is_constant() and b.is_constant()):
        return plus(a, b)
    first, second = float(a), float(b)
    total = first + second
    return SX(0 if abs(total) <= _ROUNDING * (abs(first) + abs(second)) else total)


@formula((3, 3), (3, 3))
def _product(A: SX, B: SX) -> SX:
    """Return A B for (3, 3) matrices."""
    return casadi.mtimes(A, B)


@formula((3, 3), (3, 1))
def product_with_vector(A: SX, b: SX) -> SX:
    """Return A b, (3, 1), for A (3, 3) and b (3, 1)."""
    return casadi.mtimes(A, b)


@formula((3, 3), (3, 1), (3, 1))
def _sum_with_product(A: SX, b: SX, c: SX) -> SX:
    """Return A b + c for A (3, 3), b (3, 1) and c (3, 1)."""
    return c + casadi.mtimes(A, b)


def exact_product(A: SX, B: SX, C: SX | None = None) -> SX:
    """Return A B + C; an element is zero if numbers cancel up to rounding errors.

    Inverse rotations leave values such as 1e-17, which CasADi cannot fold as zeros. Small numbers
    that are no rounding errors, such as the sine of a tilt of 1e-12, are not changed.

    Args:
        A: (3, 3) rotation; constant elements are at most 1.
        B: (3, 3), or (3, 1).
        C: (3, 1) with a (3, 1) B; zero by default.
    """
    if C is not None:
        dense = _sum_with_product(A, B, C)
    else:
        dense = _product(A, B) if B.is_square() else product_with_vector(A, B)
    if dense.is_constant() and not any(0 < abs(x) < _SMALL for x in numbers(dense)):
        return dense
    largest = _largest_number(B) if C is None else max(_largest_number(B), _largest_number(C))
    rows = dense.shape[0]
    for place, element in enumerate(elements(dense)):
        if not element.is_constant():
            continue
        number = abs(float(element))
        # elements of the rotation A are at most 1: a cheap bound excludes most elements
        if 0 < number <= 2 * _ROUNDING * largest:
            row, column = place % rows, place // rows
            terms = [times(A[row, k], B[k, column]) for k in range(A.shape[1])]
            if C is not None:
                terms.append(C[row, column])
            if number <= _ROUNDING * max(_largest_number(term) for term in terms):
                dense[place] = 0
    return dense


def _largest_number(value: SX) -> float:
    """Return the largest magnitude of the constant elements of a matrix; zero if it has none."""
    return max((abs(float(e)) for e in elements(value) if e.is_constant()), default=0.0)


# Sines and cosines with exact values at multiples of 90 degrees.


_QUARTER = math.pi / 2
_SNAP = 1e-14
"""Distance of an angle from a multiple of pi/2 below which it is set to the multiple [rad]: sums of
a few multiples have rounding errors of 4e-16 each, and intended tilts in files are larger."""


def sin_cos(angle: SX) -> tuple[SX, SX]:
    """Return sine and cosine of a scalar angle [rad], exact at multiples of 90 degrees.

    Multiples of 90 degrees are split off: sin(pi/2) is 1 and sin(pi/2 + q) is cos(q), so that
    constants are folded. A constant within 1e-14 rad of a multiple of pi/2 is set to the multiple.
    """
    constant, rest = _split(angle)
    quarters = round(constant / _QUARTER)
    if abs(constant - quarters * _QUARTER) > _SNAP:
        return _sine_and_cosine(plus(SX(constant), rest))
    s, c = (SX(0), SX(1)) if rest.is_zero() else _sine_and_cosine(rest)
    return ((s, c), (c, -s), (-s, -c), (-c, s))[quarters % 4]


def _split(angle: SX) -> tuple[float, SX]:
    """Split a scalar angle into a number and an expression without constant term.

    Their sum is the angle.
    """
    if angle.is_constant():
        return float(angle), SX(0)
    if angle.is_op(casadi.OP_ADD) or angle.is_op(casadi.OP_SUB):
        sign = -1.0 if angle.is_op(casadi.OP_SUB) else 1.0
        left, left_rest = _split(angle.dep(0))
        right, right_rest = _split(angle.dep(1))
        if left or right:
            return left + sign * right, plus(left_rest, times(SX(sign), right_rest))
    return 0.0, angle
