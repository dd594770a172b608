"""Values and parameters of expressions."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import TypeVar

import casadi
from casadi import SX

from mbs.expressions._expression import (
    Expression,
    Number,
    Operation,
    Parameter,
    Scalar,
    apply_float,
    arithmetic,
    expression,
    operation,
)

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
