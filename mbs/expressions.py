"""Numbers that may be symbols: the grammar of every number a user or a file writes.

A scalar is a number, a `Parameter`, or a text such as `"pi/2 + A"`. Texts are parsed here, by a
grammar of numbers, symbols, `+ - * / ^`, sin, cos, tan, sqrt, atan2 and pi; they are never run.

    sum      := product (("+" | "-") product)*
    product  := unary (("*" | "/") unary)*
    unary    := ("+" | "-") unary | power
    power    := atom (("^" | "**") unary)?
    atom     := number | symbol | function "(" sum ("," sum)* ")" | "(" sum ")"
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any, NoReturn, TypeVar

import casadi
import numpy as np
from casadi import SX

from mbs.errors import ExpressionError
from mbs.units import UNITS

T = TypeVar("T")

_FUNCTIONS = {"sin": 1, "cos": 1, "tan": 1, "sqrt": 1, "atan2": 2}
_CONSTANTS = {"pi": math.pi, "Pi": math.pi}
_TOKEN = re.compile(
    r"\s*(?:(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)"
    r"|(?P<name>[A-Za-z_][A-Za-z0-9_]*(?:\.[A-Za-z_][A-Za-z0-9_]*)*)"
    r"|(?P<mark>\*\*|[-+*/^(),]))",
    re.ASCII,
)
_NOT_NUMBERS = ("nan", "inf", "infinity")
_ROUNDING = 4e-16
"""Functions of quarter turns miss -1, 0 and 1 by this much; they are put exactly there."""
_PRECEDENCE = {"+": 1, "-": 1, "*": 2, "/": 2, "negate": 3, "^": 4}
_DEEPEST_NESTING = 100
_LONGEST_CHAIN = 200
_LONGEST_QUOTE = 80


class Expression:
    """A number, a symbol, or an operation on expressions; arithmetic on it gives expressions."""

    __slots__ = ()

    def __add__(self, other: Scalar) -> Expression:
        return _operation("+", self, other)

    def __radd__(self, other: Scalar) -> Expression:
        return _operation("+", other, self)

    def __sub__(self, other: Scalar) -> Expression:
        return _operation("-", self, other)

    def __rsub__(self, other: Scalar) -> Expression:
        return _operation("-", other, self)

    def __mul__(self, other: Scalar) -> Expression:
        return _operation("*", self, other)

    def __rmul__(self, other: Scalar) -> Expression:
        return _operation("*", other, self)

    def __truediv__(self, other: Scalar) -> Expression:
        return _operation("/", self, other)

    def __rtruediv__(self, other: Scalar) -> Expression:
        return _operation("/", other, self)

    def __pow__(self, other: Scalar) -> Expression:
        return _operation("^", self, other)

    def __rpow__(self, other: Scalar) -> Expression:
        return _operation("^", other, self)

    def __neg__(self) -> Expression:
        return _operation("negate", self)

    def __pos__(self) -> Expression:
        return self

    def __str__(self) -> str:
        return _text(self)


@dataclass(frozen=True, slots=True)
class Number(Expression):
    """A number that is known."""

    value: float

    __str__ = Expression.__str__


@dataclass(frozen=True, slots=True)
class Parameter(Expression):
    """A symbol that stays in the equations, with the value used when none is given.

    Attributes:
        name: letters, digits and underscores; a dot separates the names of nested mechanisms.
        default: its value in `default_in` of the Functions, or None when it has none.
        unit: a unit of `mbs.units.UNITS`.
        description: what it means, for tables and FMUs.
    """

    name: str
    default: float | None = None
    unit: str = "1"
    description: str = ""

    def __post_init__(self) -> None:
        match = _TOKEN.fullmatch(self.name) if isinstance(self.name, str) else None
        if match is None or match["name"] != self.name or _is_reserved(self.name):
            raise ExpressionError(
                f"parameter {self.name!r}: a name is letters, digits and underscores, not the name"
                " of a function or constant; choose another name"
            )
        if self.default is not None:
            object.__setattr__(self, "default", _finite(self.default, f"parameter {self.name}"))
        if self.unit not in UNITS:
            raise ExpressionError(
                f"parameter {self.name}: unit {self.unit!r} is unknown; use one of "
                + ", ".join(UNITS)
            )

    __str__ = Expression.__str__


@dataclass(frozen=True, slots=True)
class Operation(Expression):
    """An operator or function applied to expressions."""

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
"""What a user may write where a number is wanted."""


def expression(value: Scalar, where: str = "value") -> Expression:
    """The expression that a number, a text or an expression stands for.

    Args:
        value: the scalar as the user wrote it.
        where: which field of which component, for the error message.

    Raises:
        ExpressionError: it is not a finite number and not a text of the grammar.
    """
    if isinstance(value, Expression):
        return value
    if isinstance(value, str):
        try:
            return _parse(value)
        except ExpressionError as error:
            raise ExpressionError(f"{where}: {error}") from None
    return Number(_finite(value, where))


def parameters_of(value: Expression) -> Iterator[Parameter]:
    """Every parameter in the expression, in the order of the text, repeats included."""
    if isinstance(value, Parameter):
        yield value
    elif isinstance(value, Operation):
        for argument in value.arguments:
            yield from parameters_of(argument)


def renamed(value: Expression, prefix: str) -> Expression:
    """The expression with every parameter name put in a scope: L2 becomes prefix.L2."""
    if isinstance(value, Parameter):
        return replace(value, name=f"{prefix}.{value.name}")
    if isinstance(value, Operation):
        return replace(value, arguments=tuple(renamed(a, prefix) for a in value.arguments))
    return value


def to_sx(value: Scalar, symbols: Mapping[str, SX]) -> SX:
    """The expression on CasADi symbols, one per parameter name."""
    return _fold(expression(value), SX, lambda p: symbols[p.name], _apply_sx)


def to_float(value: Scalar, values: Mapping[str, float] | None = None) -> float | None:
    """The number, with `values` or the defaults for its parameters; None if it is not known.

    It is not known either where the expression has no finite value, such as 1/A with A = 0.
    """
    known = values or {}

    def symbol(parameter: Parameter) -> float:
        given = known.get(parameter.name, parameter.default)
        return math.nan if given is None else given

    result = _fold(expression(value), float, symbol, _apply_float)
    return result if math.isfinite(result) else None


def _fold(
    value: Expression,
    number: Callable[[float], T],
    symbol: Callable[[Parameter], T],
    apply: Callable[[str, list[T]], T],
) -> T:
    if isinstance(value, Number):
        return number(value.value)
    if isinstance(value, Parameter):
        return symbol(value)
    assert isinstance(value, Operation)
    return apply(value.operator, [_fold(a, number, symbol, apply) for a in value.arguments])


def _apply_sx(operator: str, values: list[SX]) -> SX:
    result = _arithmetic(operator, values)
    return SX(getattr(casadi, operator)(*values) if result is None else result)


def _apply_float(operator: str, values: list[float]) -> float:
    try:
        with np.errstate(all="ignore"):
            result = _arithmetic(operator, [np.float64(v) for v in values])
        if result is None:
            result = getattr(math, operator)(*values)
            nearest = round(result)
            result = nearest if abs(result - nearest) < _ROUNDING else result
        return float(result)
    except (ArithmeticError, ValueError):
        return math.nan


def _arithmetic(operator: str, values: list[Any]) -> Any:
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


def _operation(operator: str, *operands: Scalar) -> Expression:
    arguments = tuple(expression(operand) for operand in operands)
    if all(isinstance(argument, Number) for argument in arguments):
        result = _apply_float(operator, [a.value for a in arguments])  # type: ignore[attr-defined]
        if not math.isfinite(result):
            raise ExpressionError(
                f"{_text(Operation(operator, arguments))!r} is not a finite number; correct it"
            )
        return Number(result)
    return Operation(operator, arguments)


def _finite(value: object, where: str) -> float:
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


def quoted(value: object) -> str:
    """The value as Python writes it, on one line, its middle left out when it is long."""
    try:
        text = " ".join(repr(value).split())
    except ValueError:  # an integer of more digits than Python converts
        text = f"a {type(value).__name__} of more digits than can be read"
    half = _LONGEST_QUOTE // 2
    return text if len(text) <= _LONGEST_QUOTE else f"{text[:half]}...{text[-half:]}"


def _is_reserved(name: str) -> bool:
    return name in (*_FUNCTIONS, *_CONSTANTS) or name.lower() in _NOT_NUMBERS


def _text(value: Expression, outer: int = 0) -> str:
    if isinstance(value, Number):
        text = repr(value.value)
        text = text.removesuffix(".0")
        return f"({text})" if value.value < 0 and outer else text
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


@lru_cache(maxsize=4096)
def _parse(text: str) -> Expression:
    parser = _Parser(text)
    value = parser.sum()
    if parser.token is not None:
        parser.fail(f"unexpected {parser.token!r}")
    return value


class _Parser:
    """Recursive descent over the grammar at the top of this file."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.depth = 0
        self.tokens = self._tokens()
        self.token: str | None = None
        self.kind: str | None = None
        self.advance()

    def _tokens(self) -> Iterator[tuple[str, str]]:
        position, text = 0, self.text.rstrip()
        while position < len(text):
            match = _TOKEN.match(text, position)
            if match is None or match.lastgroup is None:
                self.fail(f"unexpected {text[position:].strip()[:1]!r}")
            yield match.lastgroup, match[match.lastgroup]
            position = match.end()

    def fail(self, reason: str) -> NoReturn:
        raise ExpressionError(
            f"cannot read {quoted(self.text)}: {reason}; write numbers, symbols, + - * / ^,"
            " sin, cos, tan, sqrt, atan2 and pi"
        )

    def advance(self) -> None:
        self.kind, self.token = next(self.tokens, (None, None))

    def accept(self, *marks: str) -> str | None:
        if self.kind == "mark" and self.token in marks:
            mark = self.token
            self.advance()
            return mark
        return None

    def expect(self, mark: str) -> None:
        if not self.accept(mark):
            self.fail(f"{mark!r} is missing")

    def deeper(self) -> None:
        self.depth += 1
        if self.depth > _DEEPEST_NESTING:
            self.fail("it is nested too deeply")

    def sum(self) -> Expression:
        self.deeper()
        value = self.product()
        while mark := self.accept("+", "-"):
            value = _operation(mark, value, self.product())
        self.depth -= 1
        return value

    def product(self) -> Expression:
        value = self.unary()
        while mark := self.accept("*", "/"):
            value = _operation(mark, value, self.unary())
        return value

    def unary(self) -> Expression:
        negative = False
        while mark := self.accept("-", "+"):
            negative ^= mark == "-"
        value = self.power()
        return -value if negative else value

    def power(self) -> Expression:
        base = self.atom()
        if not self.accept("^", "**"):
            return base
        self.deeper()
        exponent = self.unary()
        self.depth -= 1
        return _operation("^", base, exponent)

    def atom(self) -> Expression:
        kind, token = self.kind, self.token
        if kind is None or token is None:
            self.fail("it ends too early")
        if self.accept("("):
            value = self.sum()
            self.expect(")")
            return value
        self.advance()
        if kind == "number":
            return Number(_finite(float(token), quoted(token)))
        if kind != "name":
            self.fail(f"unexpected {token!r}")
        return self._named(token)

    def _named(self, name: str) -> Expression:
        if name in _CONSTANTS:
            return Number(_CONSTANTS[name])
        if not self.accept("("):
            if name in _FUNCTIONS:
                self.fail(f"{name} needs its arguments in brackets")
            if _is_reserved(name):
                self.fail(f"{name} is not a finite number")
            return Parameter(name)
        if name not in _FUNCTIONS:
            self.fail(f"{quoted(name)} is not a function here")
        arguments = [self.sum()]
        while self.accept(","):
            arguments.append(self.sum())
        self.expect(")")
        if len(arguments) != _FUNCTIONS[name]:
            self.fail(f"{name} takes {_FUNCTIONS[name]} argument(s), not {len(arguments)}")
        return _operation(name, *arguments)
