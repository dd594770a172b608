"""Grouping equations as text, in the names of the parameters."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import casadi
from casadi import SX, Function

from mbs.operations.graph import graph_of
from mbs.operations.text import PRODUCT, Infix


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
    return "-" if negative else "+", _factor(size)


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


class _FactorText(Infix):
    """A factor, absolute values as in mathematics."""

    def _called(self, op: int) -> str:
        return "abs" if op == casadi.OP_FABS else super()._called(op)


def _factor(value: SX) -> str:
    """An expression of numbers and symbols, in brackets where it is a sum."""
    symbols = casadi.symvar(value)
    graph = graph_of(Function("value", [casadi.vertcat(SX(0, 1), *symbols)], [value], ["p"], ["y"]))
    return _FactorText(graph, {"p": [s.name() for s in symbols]}).text(graph.results[0][0], PRODUCT)


def table(rows: Sequence[tuple[str, str]]) -> Iterator[str]:
    """Lines of two columns, the first one as wide as its longest entry."""
    width = max((len(left) for left, _ in rows), default=0)
    yield from (f"{left:<{width}}  {right}".rstrip() for left, right in rows)
