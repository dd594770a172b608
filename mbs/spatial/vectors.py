"""3-vectors of SX scalars, constants made exact, sines and cosines of quarter turns."""

import math
from collections.abc import Callable, Iterable
from functools import wraps
from typing import Any, ParamSpec, TypeVar, cast

import casadi
from casadi import SX, Function

_ROUNDING = 2e-15
"""Part of its terms that a sum may have left from their rounding: some ten units of their last
digit, far above what two or three roundings leave and far below any tilt that was meant."""


_SMALL = 1e-9
"""What is larger in numbers is no rounding of anything smaller than 1000 km, and needs no look."""


Given = ParamSpec("Given")
Made = TypeVar("Made")


def formula(
    *shapes: tuple[int, int],
) -> Callable[[Callable[Given, Made]], Callable[Given, Made]]:
    """A formula that is written on symbols once for each of its cases, then evaluated.

    Evaluated on expressions it makes the operations that its text makes, constants folded; ten of
    them take the time that one takes from Python.

    Args:
        shapes: of its leading arguments, which are SX; what follows them is the case, to which
            the text may look.
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
            # by name: of a list CasADi looks at more types before it is known to be one of SX
            made = function.call(dict(zip(names, arguments, strict=False)))
            return made["y0"] if len(outs) == 1 else tuple(made[name] for name in outs)

        return cast("Callable[Given, Made]", wraps(text)(on_expressions))

    return evaluated


def vector(elements: Iterable[SX | float]) -> SX:
    """The column of these scalars."""
    scalars = (one if isinstance(one, SX) else SX(one) for one in elements)
    return casadi.vertcat(*scalars)


def zeros(rows: int = 3, columns: int = 1) -> SX:
    """A dense matrix of zeros."""
    return SX.zeros(rows, columns)


@formula((3, 1))
def skew(a: SX) -> SX:
    """(3, 3) matrix of the vector product: times b it is a x b."""
    x, y, z = a[0], a[1], a[2]
    return casadi.vertcat(
        casadi.horzcat(0, -z, y), casadi.horzcat(z, 0, -x), casadi.horzcat(-y, x, 0)
    )


@formula((3, 1), (3, 1))
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


def numbers(value: SX) -> list[float]:
    """The elements of a matrix of constants, column by column."""
    return [float(element) for element in elements(value)]


# Operators and functions of CasADi look through its types for what they are given, which takes
# several times as long as the operation. What is known to be SX goes by these where much is made.


def plus(a: SX, b: SX) -> SX:
    """The expression a + b."""
    return SX.binary(casadi.OP_ADD, a, b)


def times(a: SX, b: SX) -> SX:
    """The expression a * b, element by element."""
    return SX.binary(casadi.OP_MUL, a, b)


def _sine_and_cosine(angle: SX) -> tuple[SX, SX]:
    return SX.unary(casadi.OP_SIN, angle), SX.unary(casadi.OP_COS, angle)


def exact_sum(a: SX, b: SX) -> SX:
    """The scalar a + b; zero where two numbers cancel but for the rounding of their last digits.

    Constants that ought to cancel fold only so; what is small by itself stays.
    """
    if not (a.is_constant() and b.is_constant()):
        return plus(a, b)
    first, second = float(a), float(b)
    total = first + second
    return SX(0 if abs(total) <= _ROUNDING * (abs(first) + abs(second)) else total)


@formula((3, 3), (3, 3))
def _product(A: SX, B: SX) -> SX:
    return casadi.mtimes(A, B)


@formula((3, 3), (3, 1))
def product_with_vector(A: SX, b: SX) -> SX:
    """A b, (3, 1)."""
    return casadi.mtimes(A, b)


@formula((3, 3), (3, 1), (3, 1))
def _sum_with_product(A: SX, b: SX, c: SX) -> SX:
    return c + casadi.mtimes(A, b)


def exact_product(A: SX, B: SX, C: SX | None = None) -> SX:
    """A B + C; an element is zero where numbers cancel but for their last digits.

    A is (3, 3), B is (3, 3) or, as C always, (3, 1).

    Rotations that undo each other leave 1e-17 in the place of a zero, which would never fold. What
    is small by itself, such as the sine of a tilt of 1e-12, stays.
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
        # elements of A, a rotation, are at most one: most sums are told by the largest number
        if 0 < number <= 2 * _ROUNDING * largest:
            row, column = place % rows, place // rows
            terms = [times(A[row, k], B[k, column]) for k in range(A.shape[1])]
            if C is not None:
                terms.append(C[row, column])
            if number <= _ROUNDING * max(_largest_number(term) for term in terms):
                dense[place] = 0
    return dense


def _largest_number(value: SX) -> float:
    """The largest constant element, by its size; zero where there is none."""
    return max((abs(float(e)) for e in elements(value) if e.is_constant()), default=0.0)


# Sines and cosines whose quarter turns are exact.


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
        return _sine_and_cosine(plus(SX(constant), rest))
    s, c = (SX(0), SX(1)) if rest.is_zero() else _sine_and_cosine(rest)
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
            return left + sign * right, plus(left_rest, times(SX(sign), right_rest))
    return 0.0, angle
