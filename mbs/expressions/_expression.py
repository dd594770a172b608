"""Expressions: numbers, symbols with defaults, and operations on expressions."""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any, NoReturn, TypeVar

import casadi
import numpy as np
from casadi import DM, SX

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


# Values and parameters of expressions.


T = TypeVar("T")


def parameters_of(value: Expression) -> Iterator[Parameter]:
    """Yield the parameters of an expression in the order of the text, including repetitions.

    Args:
        value: expression.
    """
    if isinstance(value, Parameter):
        yield value
    elif isinstance(value, Operation):
        for argument in value.arguments:
            yield from parameters_of(argument)


def renamed(value: Expression, prefix: str) -> Expression:
    """Return the expression with a prefix on every parameter name: `L2` becomes `prefix.L2`.

    Args:
        value: expression.
        prefix: text before the names, without the dot.
    """
    if isinstance(value, Parameter):
        return replace(value, name=f"{prefix}.{value.name}")
    if isinstance(value, Operation):
        return replace(value, arguments=tuple(renamed(a, prefix) for a in value.arguments))
    return value


def without_defaults(value: Expression) -> Expression:
    """Return the expression with parameters that have no default value.

    Args:
        value: expression.
    """
    if isinstance(value, Parameter):
        return replace(value, default=None)
    if isinstance(value, Operation):
        return replace(value, arguments=tuple(map(without_defaults, value.arguments)))
    return value


def with_values(value: Expression, values: Mapping[str, float]) -> Expression:
    """Return the expression with numbers in place of the parameters with known values.

    The default of a parameter is its value if `values` does not contain it.

    Args:
        value: expression.
        values: value by parameter name. Parameters without value and default remain.

    Raises:
        ExpressionError: the expression has no finite value.
    """
    if isinstance(value, Parameter):
        known = values.get(value.name, value.default)
        return value if known is None else Number(known)
    if isinstance(value, Operation):
        return operation(value.operator, *(with_values(a, values) for a in value.arguments))
    return value


def to_sx(value: Scalar, symbols: Mapping[str, SX]) -> SX:
    """Return a number, text or expression as a CasADi expression.

    Args:
        value: number, text or expression.
        symbols: CasADi scalar of each parameter, by parameter name.

    Raises:
        KeyError: a parameter is not in `symbols`.
    """
    return _fold(expression(value), SX, lambda p: symbols[p.name], _apply_sx)


def to_float(value: Scalar, values: Mapping[str, float] | None = None) -> float | None:
    """Return the value of a number, text or expression.

    None if a parameter has no value, or if the result is not finite, such as 1/A with A = 0.

    Args:
        value: number, text or expression.
        values: value by parameter name; the default of a parameter is used if it is not contained.
    """
    known = values or {}

    def symbol(parameter: Parameter) -> float:
        given = known.get(parameter.name, parameter.default)
        return math.nan if given is None else given

    result = _fold(expression(value), float, symbol, apply_float)
    return result if math.isfinite(result) else None


def _fold(
    value: Expression,
    number: Callable[[float], T],
    symbol: Callable[[Parameter], T],
    apply: Callable[[str, list[T]], T],
) -> T:
    """Evaluate an expression bottom-up in a type T.

    `number` converts numbers, `symbol` converts parameters, and `apply` evaluates an operator (by
    its name) on operands of the type T.
    """
    if isinstance(value, Number):
        return number(value.value)
    if isinstance(value, Parameter):
        return symbol(value)
    assert isinstance(value, Operation)
    return apply(value.operator, [_fold(a, number, symbol, apply) for a in value.arguments])


def _apply_sx(operator: str, values: list[SX]) -> SX:
    """Return the result of an operator or function, by its name, on CasADi scalars."""
    result = arithmetic(operator, values)
    return SX(getattr(casadi, operator)(*values) if result is None else result)


# Numbers in text, by one rule for files, tables, the command line and the page.
#
# A number is a text of the grammar without symbols, such as 0.3 or pi/2. Formats whose own tools
# accept digits only use plain numbers. Infinite numbers are errors.


_PLAIN = re.compile(rf"[-+]?{NUMBER}", re.ASCII)


def number(value: Scalar, where: str) -> float:
    """Return the value of a number, of its text, or of an expression with known symbols.

    Args:
        value: number, text or expression as the user wrote it.
        where: name of the file, field or option, for the error message.

    Raises:
        ExpressionError: the text is not in the grammar, a symbol has no value, or the value is
            True or False.
    """
    found = _find(value, where)
    if found is None:
        raise ExpressionError(
            f"{where}: {_given(value)} is not a number; write one, such as 0.3 or pi/2"
        )
    return found


def whole_number(value: Scalar, where: str) -> int:
    """Return the value of a whole number, of its text, or of an expression with known symbols.

    Args:
        value: number, text or expression as the user wrote it.
        where: name of the file, field or option, for the error message.

    Raises:
        ExpressionError: the text is not in the grammar, a symbol has no value, or the value is not
            whole.
    """
    found = _find(value, where)
    if found is None or not found.is_integer():
        raise ExpressionError(f"{where}: {_given(value)} is not a whole number; write one")
    return int(found)


def _find(value: Scalar, where: str) -> float | None:
    """Return the value; None for True, False, unknown symbols and values that are not finite.

    `where` is named in the message of the ExpressionError that a wrong text raises.
    """
    return None if isinstance(value, bool) else to_float(expression(value, where))


def _given(value: Scalar) -> str:
    """Return the text of the value for error messages, in quotation marks."""
    return quoted(str(value) if isinstance(value, Expression) else value)


def plain_numbers(text: str, count: int, where: str) -> tuple[float, ...]:
    """Return numbers that are written in digits and separated by blanks.

    Args:
        text: text as the user wrote it.
        count: required number of numbers.
        where: name of the file, field or option, for the error message.

    Raises:
        ExpressionError: the text is not exactly `count` finite numbers.
    """
    words = text.split()
    values = tuple(float(word) for word in words if _PLAIN.fullmatch(word))
    if not len(values) == len(words) == count or not all(map(math.isfinite, values)):
        raise ExpressionError(
            f"{where}: {quoted(text)} is not {count} finite number(s); correct it"
        )
    return values
