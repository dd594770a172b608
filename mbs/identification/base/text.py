"""Grouping equations as text, in the names of the parameters."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import casadi
from casadi import SX

_SUM, _PRODUCT, _POWER = 1, 2, 3
_INFIX = {
    casadi.OP_ADD: (" + ", _SUM),
    casadi.OP_SUB: (" - ", _SUM),
    casadi.OP_MUL: ("*", _PRODUCT),
    casadi.OP_DIV: ("/", _PRODUCT),
    casadi.OP_POW: ("^", _POWER),
    casadi.OP_CONSTPOW: ("^", _POWER),
}
_CALLS = {
    casadi.OP_SIN: "sin",
    casadi.OP_COS: "cos",
    casadi.OP_TAN: "tan",
    casadi.OP_SQRT: "sqrt",
    casadi.OP_ATAN2: "atan2",
    casadi.OP_FABS: "abs",
}


def equation(name: str, terms: Mapping[str, SX]) -> str:
    """One grouped parameter, such as "XX2R = XX2 - YY2 + 0.25*M3".

    Args:
        name: of the grouped parameter.
        terms: coefficients of the parameters in it, its own first.
    """
    text = ""
    for parameter, coefficient in terms.items():
        sign, factor = _signed(coefficient)
        term = parameter if factor == "1" else f"{factor}*{parameter}"
        lead = ("-" if sign == "-" else "") if not text else f" {sign} "
        text += lead + term
    return f"{name} = {text or '0'}"


def _signed(coefficient: SX) -> tuple[str, str]:
    """The sign of a coefficient and the text of its size, a factor."""
    negative, size = _split(coefficient)
    return "-" if negative else "+", _within(size, _PRODUCT)


def _split(value: SX) -> tuple[bool, SX]:
    """Whether a factor is negative as it is written, and the rest of it."""
    if value.is_constant():
        return float(value) < 0, SX(abs(float(value)))
    if value.is_op(casadi.OP_NEG):
        negative, size = _split(value.dep(0))
        return not negative, size
    if value.is_op(casadi.OP_MUL):
        (left, first), (right, second) = _split(value.dep(0)), _split(value.dep(1))
        return left != right, first * second
    return False, value


def _number(value: float) -> str:
    return f"{value:.12g}"


def scalar_text(value: SX) -> str:
    """An expression of numbers and symbols as people write it."""
    return _written(value)[0]


def _within(value: SX, level: int) -> str:
    text, own = _written(value)
    return f"({text})" if own < level else text


def _written(value: SX) -> tuple[str, int]:
    """The text, and how tightly its outermost operation binds."""
    if value.is_constant():
        number = float(value)
        return _number(number), _SUM if number < 0 else 4
    if value.is_symbolic():
        return value.name(), 4
    parts = [value.dep(k) for k in range(value.n_dep())]
    operation = value.op()
    if operation in _INFIX:
        sign, level = _INFIX[operation]
        right = level if operation in (casadi.OP_ADD, casadi.OP_MUL) else level + 1
        return f"{_within(parts[0], level)}{sign}{_within(parts[1], right)}", level
    match operation:
        case casadi.OP_NEG:
            return f"-{_within(parts[0], _PRODUCT)}", _SUM
        case casadi.OP_SQ:
            return f"{_within(parts[0], 4)}^2", _POWER
        case casadi.OP_TWICE:
            return f"2*{_within(parts[0], _PRODUCT)}", _PRODUCT
        case casadi.OP_INV:
            return f"1/{_within(parts[0], _POWER)}", _PRODUCT
    if operation in _CALLS:
        return f"{_CALLS[operation]}({', '.join(map(scalar_text, parts))})", 4
    return str(value), _SUM


def table(rows: Sequence[tuple[str, str]]) -> Iterator[str]:
    """Lines of two columns, the first one as wide as its longest entry."""
    width = max((len(left) for left, _ in rows), default=0)
    yield from (f"{left:<{width}}  {right}".rstrip() for left, right in rows)
