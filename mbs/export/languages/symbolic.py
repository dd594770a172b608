"""Nodes of a graph as expressions of sympy, in the order and with the numbers that they have."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import casadi
import sympy
from sympy import Add, Float, Integer, Mul, Pow, S, Symbol

from mbs.errors import ModelError
from mbs.export.languages.plan import CONDITIONS, LinePlan
from mbs.export.languages.unit import CodeLine
from mbs.operations.graph import Node
from mbs.operations.text import CODES, NAMES

Expr = Any

_SYMPY = {
    casadi.OP_FABS: sympy.Abs,
    **{
        CODES[name]: getattr(sympy, name)
        for name in (
            *("sin", "cos", "tan", "asin", "acos", "atan", "atan2", "exp", "log", "erf"),
            *("sinh", "cosh", "tanh", "asinh", "acosh", "atanh"),
        )
    },
}
_OURS = {
    **{casadi.OP_SIGN: "step", casadi.OP_FLOOR: "floor_", casadi.OP_CEIL: "ceil_"},
    **{
        CODES[name]: name
        for name in ("fmod", "copysign", "fmin", "fmax", "hypot", "log1p", "expm1")
    },
}
"""Functions that sympy has under other meanings, or not at all; see `Forms`."""

_JOINS = {casadi.OP_AND: "both", casadi.OP_OR: "either"}
"""Conditions that are joined; those of sympy drop, sort and simplify what they are given."""

_UNDEFINED = {name: sympy.Function(name) for name in (*_OURS.values(), *_JOINS.values(), "denied")}
_COMPARE = {
    casadi.OP_LT: sympy.Lt,
    casadi.OP_LE: sympy.Le,
    casadi.OP_EQ: sympy.Eq,
    casadi.OP_NE: sympy.Ne,
}
_OPPOSITE = {
    casadi.OP_EQ: casadi.OP_NE,
    casadi.OP_NE: casadi.OP_EQ,
    casadi.OP_AND: casadi.OP_OR,
    casadi.OP_OR: casadi.OP_AND,
}
"""What denies an operation; that of a < b is not a >= b, since NaN is neither."""

_MIRRORED = {
    sympy.Lt: sympy.Gt,
    sympy.Le: sympy.Ge,
    sympy.Gt: sympy.Lt,
    sympy.Ge: sympy.Le,
}
_LARGEST_INTEGER_POWER = 64


@dataclass(frozen=True, slots=True)
class SympyWriter:
    """What writes the lines of a plan as expressions.

    Attributes:
        plan: the lines.
        names: name of every line and of every element of an input, by node.
        squares_as_products: whether x^2 is x*x.
    """

    plan: LinePlan
    names: Mapping[int, str]
    squares_as_products: bool

    def line(self, number: int) -> CodeLine:
        """The line of a node."""
        name, node = self.names[number], self.plan.graph.nodes[number]
        choice = self.plan.choices.get(number)
        if choice:
            other = number_of(0.0) if choice.otherwise is None else self.value(choice.otherwise)
            return CodeLine(name, self.value(choice.value), self.condition(choice.condition), other)
        if node.op in CONDITIONS:
            return CodeLine(name, number_of(1.0), self.condition(number), number_of(0.0))
        return CodeLine(name, self._operation(node))

    def value(self, number: int) -> Expr:
        """A node inside of an expression: its name where it has one."""
        if number in self.names:
            return symbol(self.names[number])
        return self._operation(self.plan.graph.nodes[number])

    def condition(self, number: int, denied: bool = False) -> Expr:
        """A node as a condition, or its denial; a number is one where it is not zero."""
        node = self.plan.graph.nodes[number]
        if node.op == casadi.OP_NOT:
            return self.condition(node.args[0], not denied)
        op = _OPPOSITE.get(node.op, node.op) if denied else node.op
        if op in _JOINS:
            return _joined(_JOINS[op], [self.condition(k, denied) for k in node.args])
        if op not in _COMPARE:
            op = casadi.OP_EQ if denied else casadi.OP_NE
            return _COMPARE[op](self.value(number), number_of(0.0), evaluate=False)
        relation, (a, b) = _COMPARE[op], map(self.value, node.args)
        if a.is_Float:
            relation, a, b = _MIRRORED.get(relation, relation), b, a
        holds = relation(a, b, evaluate=False)
        return _UNDEFINED["denied"](holds) if denied and op == node.op else holds

    def _operation(self, node: Node) -> Expr:
        if node.op == casadi.OP_CONST:
            return number_of(node.value)
        values = [self.value(operand) for operand in node.args]
        rule = _RULES.get(node.op)
        if rule:
            return rule(*values)
        if node.op == casadi.OP_SQ:
            return self._square(values[0])
        if node.op in _SYMPY:
            return _SYMPY[node.op](*values, evaluate=False)
        if node.op == casadi.OP_FMOD and values[1].is_zero:
            values[1] = product(values[1], values[0])  # Fortran refuses to divide by a literal zero
        if node.op in _OURS:
            return _UNDEFINED[_OURS[node.op]](*values)
        raise ModelError(
            f"{self.plan.graph.name}: it has the operation {NAMES[node.op]}, which has"
            " no text; expand the Function and leave that operation out"
        )

    def _square(self, value: Expr) -> Expr:
        sign, factors = _factors(value)
        base = _product(1, factors) if sign < 0 else value
        return product(base, base) if self.squares_as_products else _pow(base, Integer(2))


def symbol(name: str) -> Expr:
    """The symbol of a name."""
    return Symbol(name, real=True)


def number_of(value: float) -> Expr:
    """A constant.

    Raises:
        ModelError: it is infinite or not a number.
    """
    if not math.isfinite(value):
        raise ModelError(
            f"the Function has the constant {value}, which source text cannot hold; give finite"
            " numbers"
        )
    return Float(value)


def total(*values: Expr) -> Expr:
    """Their sum, its numbers added up, a positive term first where there is one."""
    every = [term for value in values for term in Add.make_args(value)]
    terms = _gathered(every, math.fsum, 0.0)
    first = next((k for k, term in enumerate(terms) if _factors(term)[0] > 0), 0)
    terms = [terms[first], *terms[:first], *terms[first + 1 :]]
    return terms[0] if len(terms) == 1 else Add(*terms, evaluate=False)


def product(a: Expr, b: Expr) -> Expr:
    """Their product, the sign and its numbers, multiplied, first."""
    (sign_a, of_a), (sign_b, of_b) = _factors(a), _factors(b)
    return _product(sign_a * sign_b, _gathered([*of_a, *of_b], math.prod, 1.0))


def _gathered(
    parts: list[Expr], join: Callable[[list[float]], float], neutral: float
) -> list[Expr]:
    """The parts of a sum or product with one number at most, which comes last."""
    numbers = [float(part) for part in parts if part.is_Float]
    others = [part for part in parts if not part.is_Float]
    if len(numbers) < 2:
        return parts
    value = join(numbers)
    if not math.isfinite(value) or (value == 0 and neutral):
        return parts
    return others if others and value == neutral else [*others, number_of(value)]


def negative(value: Expr) -> Expr:
    """The opposite."""
    sign, factors = _factors(value)
    return _product(-sign, factors)


def difference(a: Expr, b: Expr) -> Expr:
    """A - b, term by term."""
    return total(a, *(negative(term) for term in Add.make_args(b)))


def _factors(value: Expr) -> tuple[int, list[Expr]]:
    """Sign and factors of a product; numbers among them are positive."""
    factors = list(value.args) if value.is_Mul else [value]
    head = factors[0]
    if head is S.NegativeOne and len(factors) > 1:
        return -1, factors[1:]
    if head.is_Float and head < 0:
        return -1, [-head, *factors[1:]]
    return 1, factors


def _product(sign: int, factors: list[Expr]) -> Expr:
    factors = sorted(factors, key=lambda factor: not factor.is_Float)
    if sign < 0:
        head = factors[0]
        factors = [-head, *factors[1:]] if head.is_Float else [S.NegativeOne, *factors]
    return factors[0] if len(factors) == 1 else Mul(*factors, evaluate=False)


def _pow(base: Expr, exponent: Expr) -> Expr:
    return Pow(base, exponent, evaluate=False)


def _joined(join: str, conditions: list[Expr]) -> Expr:
    """Conditions joined, those that are joined alike in one row."""
    parts = (c.args if type(c).__name__ == join else (c,) for c in conditions)
    return _UNDEFINED[join](*(part for some in parts for part in some))


def _inverse(value: Expr) -> Expr:
    sign, factors = _factors(value)
    return _product(sign, [_flipped(factor) for factor in factors])


def _flipped(factor: Expr) -> Expr:
    """1 / factor; a factor that stands below a fraction line comes up."""
    below = factor.is_Pow and factor.exp is S.NegativeOne
    return factor.base if below else _pow(factor, S.NegativeOne)


def _power(base: Expr, exponent: Expr) -> Expr:
    """A power; an exponent that is a small whole number is written as one."""
    whole = exponent.is_Float and float(exponent).is_integer()
    if whole and 2 <= abs(float(exponent)) <= _LARGEST_INTEGER_POWER:
        positive = _pow(base, Integer(abs(int(exponent))))
        return positive if exponent > 0 else _inverse(positive)
    return _pow(base, exponent)


_RULES: Mapping[int, Callable[..., Expr]] = {
    casadi.OP_ADD: total,
    casadi.OP_SUB: difference,
    casadi.OP_MUL: product,
    casadi.OP_DIV: lambda a, b: product(a, _inverse(b)),
    casadi.OP_INV: _inverse,
    casadi.OP_NEG: negative,
    casadi.OP_TWICE: lambda a: product(number_of(2.0), a),
    casadi.OP_SQRT: lambda a: _pow(a, S.Half),
    casadi.OP_POW: _power,
    casadi.OP_CONSTPOW: _power,
}
