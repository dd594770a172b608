"""Expressions: numbers, symbols with defaults, and operations on expressions."""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, NoReturn

import numpy as np
from casadi import DM

from mbs.errors import ExpressionError
from mbs.text import quoted
from mbs.units import UNITS

# Operators of the grammar, on floats or on any type with arithmetic.


_ROUNDING = 4e-16
"""Error of functions at multiples of pi/2; results this close to an integer are rounded to it."""


def apply_float(operator: str, values: list[float]) -> float:
    """Return the value of an operator or function on numbers; NaN if it is undefined.

    Args:
        operator: "+", "-", "*", "/", "^", "negate", or a function in FUNCTIONS.
        values: values of the one or two operands.
    """
    try:
        with np.errstate(all="ignore"):
            result = arithmetic(operator, [np.float64(v) for v in values])
        if result is None:
            result = getattr(math, operator)(*values)
            nearest = round(result)
            result = nearest if abs(result - nearest) < _ROUNDING else result
        return float(result)
    except (ArithmeticError, ValueError):
        return math.nan


def arithmetic(operator: str, values: list[Any]) -> Any:
    """Return the result of an operator on values of any type with arithmetic; None for a function.

    `operator` is "+", "-", "*", "/", "^" or "negate"; `values` are its one or two operands.
    """
    first, *rest = values
    match operator:
        case "+":
            return first + rest[0]
        case "-":
            return first - rest[0]
        case "*":
            return first * rest[0]
        case "/":
            return first / rest[0]
        case "^":
            return first ** rest[0]
        case "negate":
            return -first
    return None


# Tokens of the grammar: names, functions and constants.


FUNCTIONS = {"sin": 1, "cos": 1, "tan": 1, "sqrt": 1, "atan2": 2}
CONSTANTS = {"pi": math.pi, "Pi": math.pi}
NUMBER = r"(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
"""Regular expression of a number without sign."""

TOKEN = re.compile(
    rf"\s*(?:(?P<number>{NUMBER})"
    r"|(?P<name>[A-Za-z_][A-Za-z0-9_]*(?:\.[A-Za-z_][A-Za-z0-9_]*)*)"
    r"|(?P<mark>\*\*|[-+*/^(),]))",
    re.ASCII,
)
_NOT_NUMBERS = ("nan", "inf", "infinity")


def is_reserved(name: str) -> bool:
    """Return whether a name is a function, a constant or "nan", "inf", "infinity"."""
    return name in (*FUNCTIONS, *CONSTANTS) or name.lower() in _NOT_NUMBERS


_PRECEDENCE = {"+": 1, "-": 1, "*": 2, "/": 2, "negate": 3, "^": 4}
_LONGEST_CHAIN = 200


class Expression:
    """Number, symbol, or operation on expressions. Arithmetic on expressions gives expressions."""

    __slots__ = ()

    def __add__(self, other: Scalar) -> Expression:
        return operation("+", self, other)

    def __radd__(self, other: Scalar) -> Expression:
        return operation("+", other, self)

    def __sub__(self, other: Scalar) -> Expression:
        return operation("-", self, other)

    def __rsub__(self, other: Scalar) -> Expression:
        return operation("-", other, self)

    def __mul__(self, other: Scalar) -> Expression:
        return operation("*", self, other)

    def __rmul__(self, other: Scalar) -> Expression:
        return operation("*", other, self)

    def __truediv__(self, other: Scalar) -> Expression:
        return operation("/", self, other)

    def __rtruediv__(self, other: Scalar) -> Expression:
        return operation("/", other, self)

    def __pow__(self, other: Scalar) -> Expression:
        return operation("^", self, other)

    def __rpow__(self, other: Scalar) -> Expression:
        return operation("^", other, self)

    def __neg__(self) -> Expression:
        return operation("negate", self)

    def __pos__(self) -> Expression:
        return self

    def __str__(self) -> str:
        return _text(self)


MORE_THAN_ZERO = sys.float_info.min
"""Lower bound of values that must be greater than zero: the smallest normal number."""


@dataclass(frozen=True, slots=True)
class Number(Expression):
    """Expression that is a known number."""

    value: float

    __str__ = Expression.__str__


def out_of_bounds(value: float, low: float | None, high: float | None) -> str:
    """Return advice such as "give 2 or less" for a value out of bounds; empty if it is within them.

    Args:
        value: value to check. NaN counts as out of bounds.
        low: smallest valid value, or None.
        high: largest valid value, or None.
    """
    if low is not None and not value >= low:
        least = "more than zero" if low == MORE_THAN_ZERO else f"{low:g} or more"
        return f"give {'zero or more' if low == 0 else least}"
    if high is not None and not value <= high:
        return f"give {high:g} or less"
    return ""


@dataclass(frozen=True, slots=True)
class Parameter(Expression):
    """Symbol that remains in the equations, with a default value.

    Attributes:
        name: letters, digits and underscores; a dot separates the names of nested mechanisms.
        default: value in `default_in` of the Functions; None if it must be given.
        unit: unit, a key of `mbs.units.UNITS`.
        description: meaning, for tables and FMUs.
        min: smallest valid value, or None. Components add their own rules, for example for masses.
        max: largest valid value, or None.
    """

    name: str
    default: float | None = None
    unit: str = "1"
    description: str = ""
    min: float | None = None
    max: float | None = None

    def __post_init__(self) -> None:
        match = TOKEN.fullmatch(self.name) if isinstance(self.name, str) else None
        if match is None or match["name"] != self.name or is_reserved(self.name):
            raise ExpressionError(
                f"parameter {self.name!r}: a name is letters, digits and underscores, not the name"
                " of a function or constant; choose another name"
            )
        if self.default is not None:
            object.__setattr__(self, "default", finite(self.default, f"parameter {self.name}"))
        if self.unit not in UNITS:
            raise ExpressionError(
                f"parameter {self.name}: unit {self.unit!r} is unknown; use one of "
                + ", ".join(UNITS)
            )
        for bound in ("min", "max"):
            if getattr(self, bound) is not None:
                value = finite(getattr(self, bound), f"parameter {self.name}, {bound}")
                object.__setattr__(self, bound, value)
        if self.min is not None and self.max is not None and self.min > self.max:
            raise ExpressionError(
                f"parameter {self.name}: min is {self.min:g} and max is {self.max:g}; give a min"
                " that is not above max"
            )
        if self.default is not None and (fault := out_of_bounds(self.default, self.min, self.max)):
            raise ExpressionError(f"parameter {self.name} is {self.default:g}; {fault}")

    __str__ = Expression.__str__


@dataclass(frozen=True, slots=True)
class Operation(Expression):
    """Operator or function applied to expressions.

    Attributes:
        operator: "+", "-", "*", "/", "^", "negate", or a function in FUNCTIONS.
        arguments: one or two operands.
        depth: length of the longest chain of nested operations, at most 200.
    """

    operator: str
    arguments: tuple[Expression, ...]
    depth: int = field(init=False, compare=False, repr=False)

    def __post_init__(self) -> None:
        depth = 1 + max(getattr(argument, "depth", 0) for argument in self.arguments)
        if depth > _LONGEST_CHAIN:
            raise ExpressionError(
                f"an expression applies more than {_LONGEST_CHAIN} operations one after the other;"
                " split it into shorter ones"
            )
        object.__setattr__(self, "depth", depth)

    __str__ = Expression.__str__


Scalar = float | int | str | Expression
"""Types that a user may write instead of a number."""


def expression(value: Scalar, where: str = "value") -> Expression:
    """Return the expression of a number, a text or an expression.

    Args:
        value: number, text or expression as the user wrote it.
        where: component and field, for the error message.

    Raises:
        ExpressionError: the value is neither a finite number nor a text of the grammar.
    """
    if isinstance(value, Expression):
        return value
    if isinstance(value, str):
        try:
            return parse(value)
        except ExpressionError as error:
            raise ExpressionError(f"{where}: {error}") from None
    return Number(finite(value, where))


def operation(operator: str, *operands: Scalar) -> Expression:
    """Apply an operator or function to operands.

    Args:
        operator: "+", "-", "*", "/", "^", "negate", or a function in FUNCTIONS.
        operands: its one or two operands.

    Returns:
        the operation; its value as a `Number` if all operands are numbers.

    Raises:
        ExpressionError: the value is not finite, or operations are nested more than 200 deep.
    """
    arguments = tuple(expression(operand) for operand in operands)
    if all(isinstance(argument, Number) for argument in arguments):
        result = apply_float(operator, [a.value for a in arguments])  # type: ignore[attr-defined]
        if not math.isfinite(result):
            raise ExpressionError(
                f"{_text(Operation(operator, arguments))!r} is not a finite number; correct it"
            )
        return Number(result)
    return Operation(operator, arguments)


def finite(value: object, where: str) -> float:
    """Return a finite value as a float, also from a 0-dimensional array or a 1 x 1 DM.

    Args:
        value: value as the user wrote it.
        where: component and field, for the error message.

    Raises:
        ExpressionError: the value is not a number, not finite, or True or False.
    """
    if isinstance(value, np.ndarray) and value.ndim == 0:
        value = value[()]
    elif isinstance(value, DM) and value.is_scalar():
        value = float(value)
    if isinstance(value, (int, float, np.integer, np.floating)) and not isinstance(value, bool):
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
        if math.isfinite(number):
            return number
    raise ExpressionError(
        f"{where}: {quoted(value)} is not a finite number; give a number, a Parameter or a text"
        " such as 'pi/2 + A'"
    )


def _text(value: Expression, outer: int = 0) -> str:
    """Return the text of an expression, in brackets if it binds weaker than the level `outer`.

    Levels are those of `_PRECEDENCE`; 0 never adds brackets.
    """
    if isinstance(value, Number):
        text = repr(value.value)
        text = text.removesuffix(".0")
        # -0.0 also has a sign, in its text only. Brackets are needed: minus binds weaker than ^.
        return f"({text})" if math.copysign(1.0, value.value) < 0 and outer else text
    if isinstance(value, Parameter):
        return value.name
    assert isinstance(value, Operation)
    level = _PRECEDENCE.get(value.operator)
    if level is None:
        return f"{value.operator}({', '.join(_text(a) for a in value.arguments)})"
    if value.operator == "negate":
        text = f"-{_text(value.arguments[0], level)}"
    else:
        left, right = value.arguments
        tight = level + (value.operator in "-/")
        text = (
            f"{_text(left, level + (value.operator == '^'))}{value.operator}{_text(right, tight)}"
        )
    return f"({text})" if level < outer else text


# Parser: recursive descent over the grammar of the package. Texts are never run.


_DEEPEST_NESTING = 100


@lru_cache(maxsize=4096)
def parse(text: str) -> Expression:
    """Parse a text of the grammar to an expression, with parameters for its symbols.

    Raises:
        ExpressionError: the text is not in the grammar, or is nested too deeply.
    """
    parser = _Parser(text)
    value = parser.sum()
    if parser.token is not None:
        parser.fail(f"unexpected {parser.token!r}")
    return value


class _Parser:
    """Recursive-descent parser of a text with one token of lookahead, `token`."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.depth = 0
        self.tokens = self._tokens()
        self.token: str | None = None
        self.kind: str | None = None
        self.advance()

    def _tokens(self) -> Iterator[tuple[str, str]]:
        """Yield (kind, text) of each token.

        Kind is "number", "name" or "mark" (an operator or bracket).
        """
        position, text = 0, self.text.rstrip()
        while position < len(text):
            match = TOKEN.match(text, position)
            if match is None or match.lastgroup is None:
                self.fail(f"unexpected {text[position:].strip()[:1]!r}")
            yield match.lastgroup, match[match.lastgroup]
            position = match.end()

    def fail(self, reason: str) -> NoReturn:
        """Raise ExpressionError with the text and the reason."""
        raise ExpressionError(
            f"cannot read {quoted(self.text)}: {reason}; write numbers, symbols, + - * / ^,"
            " sin, cos, tan, sqrt, atan2 and pi"
        )

    def advance(self) -> None:
        """Read the next token into `kind` and `token`; both are None at the end."""
        self.kind, self.token = next(self.tokens, (None, None))

    def accept(self, *marks: str) -> str | None:
        """Read past the current token and return it if it is one of `marks`; else return None."""
        if self.kind == "mark" and self.token in marks:
            mark = self.token
            self.advance()
            return mark
        return None

    def expect(self, mark: str) -> None:
        """Read past the operator or bracket `mark`; raise ExpressionError if it is not there."""
        if not self.accept(mark):
            self.fail(f"{mark!r} is missing")

    def deeper(self) -> None:
        """Count one more level of nesting; raise ExpressionError beyond 100 levels."""
        self.depth += 1
        if self.depth > _DEEPEST_NESTING:
            self.fail("it is nested too deeply")

    def sum(self) -> Expression:
        """Parse the rule `sum` of the grammar: products joined by + and -."""
        self.deeper()
        value = self.product()
        while mark := self.accept("+", "-"):
            value = operation(mark, value, self.product())
        self.depth -= 1
        return value

    def product(self) -> Expression:
        """Parse the rule `product` of the grammar: unary terms joined by * and /."""
        value = self.unary()
        while mark := self.accept("*", "/"):
            value = operation(mark, value, self.unary())
        return value

    def unary(self) -> Expression:
        """Parse the rule `unary` of the grammar: a power with any number of signs."""
        negative = False
        while mark := self.accept("-", "+"):
            negative ^= mark == "-"
        value = self.power()
        return -value if negative else value

    def power(self) -> Expression:
        """Parse the rule `power` of the grammar: an atom, with an optional exponent."""
        base = self.atom()
        if not self.accept("^", "**"):
            return base
        self.deeper()
        exponent = self.unary()
        self.depth -= 1
        return operation("^", base, exponent)

    def atom(self) -> Expression:
        """Parse the rule `atom` of the grammar: a number, a name, a function call, or brackets."""
        kind, token = self.kind, self.token
        if kind is None or token is None:
            self.fail("it ends too early")
        if self.accept("("):
            value = self.sum()
            self.expect(")")
            return value
        self.advance()
        if kind == "number":
            return Number(finite(float(token), quoted(token)))
        if kind != "name":
            self.fail(f"unexpected {token!r}")
        return self._named(token)

    def _named(self, name: str) -> Expression:
        """Return the constant, the parameter or the function call that starts with `name`."""
        if name in CONSTANTS:
            return Number(CONSTANTS[name])
        if not self.accept("("):
            if name in FUNCTIONS:
                self.fail(f"{name} needs its arguments in brackets")
            if is_reserved(name):
                self.fail(f"{name} is not a finite number")
            return Parameter(name)
        if name not in FUNCTIONS:
            self.fail(f"{quoted(name)} is not a function here")
        arguments = [self.sum()]
        while self.accept(","):
            arguments.append(self.sum())
        self.expect(")")
        if len(arguments) != FUNCTIONS[name]:
            self.fail(f"{name} takes {FUNCTIONS[name]} argument(s), not {len(arguments)}")
        return operation(name, *arguments)
