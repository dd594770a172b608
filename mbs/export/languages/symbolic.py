"""Conversion of graph nodes to sympy expressions without reordering or rounding, and printers."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate
from typing import Any

import casadi
import sympy
from sympy import Add, Float, Integer, Mul, Pow, S, Symbol
from sympy.printing.codeprinter import CodePrinter
from sympy.printing.precedence import precedence

from mbs.errors import ModelError
from mbs.export.languages.language import CodeLine
from mbs.export.languages.plan import CONDITIONS, LinePlan
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
"""Functions that sympy does not have, or has with another meaning. See `Readable.forms`."""

_JOINS = {casadi.OP_AND: "both", casadi.OP_OR: "either"}
"""Logical operations. `And` and `Or` of sympy are not used, because they reorder and simplify."""

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
"""Negation of operations. The negation of a < b is not a >= b, because both are false for NaN."""

_MIRRORED = {
    sympy.Lt: sympy.Gt,
    sympy.Le: sympy.Ge,
    sympy.Gt: sympy.Lt,
    sympy.Ge: sympy.Le,
}
_LARGEST_INTEGER_POWER = 64


@dataclass(frozen=True, slots=True)
class SympyWriter:
    """Writer of the lines of a plan as sympy expressions.

    Attributes:
        plan: division of the graph into lines.
        names: dict from node index to name, for all lines and elements of inputs.
        squares_as_products: whether x^2 is written x*x.
    """

    plan: LinePlan
    names: Mapping[int, str]
    squares_as_products: bool

    def line(self, number: int) -> CodeLine:
        """Return the line of code that computes a node.

        Args:
            number: index of the node.
        """
        name, node = self.names[number], self.plan.graph.nodes[number]
        choice = self.plan.choices.get(number)
        if choice:
            other = number_of(0.0) if choice.otherwise is None else self.value(choice.otherwise)
            return CodeLine(name, self.value(choice.value), self.condition(choice.condition), other)
        if node.op in CONDITIONS:
            return CodeLine(name, number_of(1.0), self.condition(number), number_of(0.0))
        return CodeLine(name, self._operation(node))

    def value(self, number: int) -> Expr:
        """Return a node as an operand: the symbol of a named node, else its full expression.

        Args:
            number: index of the node.
        """
        if number in self.names:
            return symbol(self.names[number])
        return self._operation(self.plan.graph.nodes[number])

    def condition(self, number: int, denied: bool = False) -> Expr:
        """Return a node as a condition; a number is true if it is not zero.

        Args:
            number: index of the node.
            denied: whether to return the negation.
        """
        node = self.plan.graph.nodes[number]
        if node.op == casadi.OP_NOT:
            return self.condition(node.args[0], not denied)
        op = _OPPOSITE.get(node.op, node.op) if denied else node.op
        if op in _JOINS:
            return _join(_JOINS[op], [self.condition(k, denied) for k in node.args])
        if op not in _COMPARE:
            op = casadi.OP_EQ if denied else casadi.OP_NE
            return _COMPARE[op](self.value(number), number_of(0.0), evaluate=False)
        relation, (a, b) = _COMPARE[op], map(self.value, node.args)
        if a.is_Float:
            relation, a, b = _MIRRORED.get(relation, relation), b, a
        holds = relation(a, b, evaluate=False)
        return _UNDEFINED["denied"](holds) if denied and op == node.op else holds

    def _operation(self, node: Node) -> Expr:
        """Return a node as an operation on its operands; raise a ModelError if it has no text."""
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
            values[1] = product(values[1], values[0])  # division by literal 0 fails in Fortran
        if node.op in _OURS:
            return _UNDEFINED[_OURS[node.op]](*values)
        raise ModelError(
            f"{self.plan.graph.name}: it has the operation {NAMES[node.op]}, which has"
            " no text; expand the Function and leave that operation out"
        )

    def _square(self, value: Expr) -> Expr:
        """Return the square of a value as a product or power, without its sign."""
        sign, factors = _factors(value)
        base = _product(1, factors) if sign < 0 else value
        return product(base, base) if self.squares_as_products else _pow(base, Integer(2))


def symbol(name: str) -> Expr:
    """Return the real sympy symbol with a name."""
    return Symbol(name, real=True)


def number_of(value: float) -> Expr:
    """Return a constant as a sympy number.

    Args:
        value: constant.

    Raises:
        ModelError: the value is infinite or NaN.
    """
    if not math.isfinite(value):
        raise ModelError(
            f"the Function has the constant {value}, which source text cannot hold; give finite"
            " numbers"
        )
    return Float(value)


def total(*values: Expr) -> Expr:
    """Return the sum of values, with numbers added up and a positive term first if possible.

    Args:
        *values: sympy expressions.
    """
    every = [term for value in values for term in Add.make_args(value)]
    terms = _gather(every, math.fsum, 0.0)
    first = next((k for k, term in enumerate(terms) if _factors(term)[0] > 0), 0)
    terms = [terms[first], *terms[:first], *terms[first + 1 :]]
    return terms[0] if len(terms) == 1 else Add(*terms, evaluate=False)


def product(a: Expr, b: Expr) -> Expr:
    """Return the product of a and b, with the sign and the product of its numbers first."""
    (sign_a, of_a), (sign_b, of_b) = _factors(a), _factors(b)
    return _product(sign_a * sign_b, _gather([*of_a, *of_b], math.prod, 1.0))


def _gather(parts: list[Expr], join: Callable[[list[float]], float], neutral: float) -> list[Expr]:
    """Return the parts of a sum or product with its numbers combined into one, placed last.

    `join` combines numbers, `neutral` is 0 for a sum and 1 for a product.
    """
    numbers = [float(part) for part in parts if part.is_Float]
    others = [part for part in parts if not part.is_Float]
    if len(numbers) < 2:
        return parts
    value = join(numbers)
    if not math.isfinite(value) or (value == 0 and neutral):
        return parts
    return others if others and value == neutral else [*others, number_of(value)]


def negative(value: Expr) -> Expr:
    """Return -value."""
    sign, factors = _factors(value)
    return _product(-sign, factors)


def difference(a: Expr, b: Expr) -> Expr:
    """Return a - b, term by term."""
    return total(a, *(negative(term) for term in Add.make_args(b)))


def _factors(value: Expr) -> tuple[int, list[Expr]]:
    """Return sign and factors of a product. A leading number becomes positive."""
    factors = list(value.args) if value.is_Mul else [value]
    head = factors[0]
    if head is S.NegativeOne and len(factors) > 1:
        return -1, factors[1:]
    if head.is_Float and head < 0:
        return -1, [-head, *factors[1:]]
    return 1, factors


def _product(sign: int, factors: list[Expr]) -> Expr:
    """Return the product of factors with a sign, numbers first."""
    factors = sorted(factors, key=lambda factor: not factor.is_Float)
    if sign < 0:
        head = factors[0]
        factors = [-head, *factors[1:]] if head.is_Float else [S.NegativeOne, *factors]
    return factors[0] if len(factors) == 1 else Mul(*factors, evaluate=False)


def _pow(base: Expr, exponent: Expr) -> Expr:
    """Return base^exponent as a sympy power that is not evaluated."""
    return Pow(base, exponent, evaluate=False)


def _join(join: str, conditions: list[Expr]) -> Expr:
    """Return conditions joined by "both" (and) or "either" (or); nested joins are flattened."""
    parts = (c.args if type(c).__name__ == join else (c,) for c in conditions)
    return _UNDEFINED[join](*(part for some in parts for part in some))


def _inverse(value: Expr) -> Expr:
    """Return 1 / value."""
    sign, factors = _factors(value)
    return _product(sign, [_flip(factor) for factor in factors])


def _flip(factor: Expr) -> Expr:
    """Return 1 / factor. The inverse of 1/x is x."""
    below = factor.is_Pow and factor.exp is S.NegativeOne
    return factor.base if below else _pow(factor, S.NegativeOne)


def _power(base: Expr, exponent: Expr) -> Expr:
    """Return base^exponent; an integer exponent of magnitude 2 to 64 becomes a sympy integer."""
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


# Printers of sympy that do not reorder expressions and write all digits of numbers.


_ORDER = {"order": "none"}
_COMPARISONS = {
    "StrictLessThan": "<",
    "LessThan": "<=",
    "StrictGreaterThan": ">",
    "GreaterThan": ">=",
    "Equality": "==",
    "Unequality": "!=",
}


class Readable(CodePrinter):  # type: ignore[misc]
    """Mixin of a sympy code printer that does not reorder sums and products.

    Attributes:
        forms: dict from function name to call format, such as "atan2({0}, {1})". An empty format
            means that the language does not have the function.
        power: format of a power.
        comparisons: dict from sympy class name to comparison sign.
        joins: signs of the logical operations "both" (and) and "either" (or).
        number: function that writes a number.
        title: name of the language, for error messages.
    """

    forms: Mapping[str, str]
    power: str
    comparisons: Mapping[str, str]
    joins: Mapping[str, str]
    number: Callable[[float], str]
    title: str

    def text(self, expr: Any) -> str:
        """Return the text of an expression in the language."""
        return self._print(expr)

    def _print(self, expr: Any, **kwargs: Any) -> str:
        """Return the text of an expression, with the formats of the language.

        Raise a ModelError if the language does not have a function.
        """
        name = type(expr).__name__
        if name in self.comparisons:
            return self._comparison(expr)
        if name in self.joins:
            return self.joins[name].join(f"({self._print(arg)})" for arg in expr.args)
        form = self.forms.get(name)
        if form is None:
            return str(super()._print(expr, **kwargs))
        if not form:
            raise ModelError(
                f"{self.title} has no function {name.rstrip('_')}; choose another language"
            )
        return _call_text(form, [self._print(arg) for arg in expr.args])

    def _print_Symbol(self, expr: Any) -> str:
        """Return the name of a symbol."""
        return str(expr.name)

    def _print_Float(self, expr: Any, **kwargs: Any) -> str:
        """Return a number with all digits."""
        return type(self).number(float(expr))

    def _print_One(self, expr: Any) -> str:
        """Return the number one."""
        return type(self).number(1.0)

    def _print_Add(self, expr: Any, order: Any = None) -> str:
        """Return a sum in the given order."""
        return str(CodePrinter._print_Add(self, expr, order="none"))

    def _print_Mul(self, expr: Any) -> str:
        """Return a product in the given order."""
        return str(CodePrinter._print_Mul(self, expr))

    def _print_Pow(self, expr: Any, **kwargs: Any) -> str:
        """Return a power, a square root or a reciprocal."""
        base, exponent = expr.args
        if exponent is S.Half:  # sqrt. Not for the number 0.5: only sqrt of -infinity is NaN
            return _call_text(self.forms["sqrt"], [self._print(base)])
        level = precedence(expr)
        if exponent == S.NegativeOne:
            return f"{type(self).number(1.0)}/{self.parenthesize(base, level)}"
        if exponent.is_Integer and "powi" in self.forms:
            return self.forms["powi"].format(self.parenthesize(base, level), exponent)
        if "(" in self.power:
            return self.power.format(self._print(base), self._print(exponent))
        return self.power.format(
            self.parenthesize(base, level, strict=False), self.parenthesize(exponent, level)
        )

    def _comparison(self, expr: Any) -> str:
        """Return a comparison with the sign of the language."""
        level = precedence(expr)
        left, right = (self.parenthesize(side, level) for side in expr.args)
        return f"{left} {self.comparisons[type(expr).__name__]} {right}"


def _call_text(form: str, arguments: Sequence[str]) -> str:
    """Insert arguments into a call format, in parentheses unless the format encloses them."""
    texts = []
    for k, text in enumerate(arguments):
        bare = len(re.findall(rf"[\[(,] ?\{{{k}\}}[,)\]]", form)) == form.count(f"{{{k}}}")
        texts.append(text if bare or _is_closed(text) else f"({text})")
    return form.format(*texts)


def _is_closed(text: str) -> bool:
    """Whether the text is a name, or enclosed in a pair of matching parentheses."""
    if re.fullmatch(r"\w+", text):
        return True
    depths = accumulate((c == "(") - (c == ")") for c in text)
    return text.startswith("(") and 0 not in list(depths)[:-1]


def printer_of(
    base: Any,
    title: str,
    number: Callable[[float], str],
    forms: Mapping[str, str],
    power: str,
    comparisons: Mapping[str, str] | None = None,
    joins: Mapping[str, str] | None = None,
) -> Any:
    """Return a printer that combines `Readable` with a printer class of sympy.

    Args:
        base: printer class of sympy.
        title: name of the language.
        number: function that writes a constant.
        forms: call formats of functions that the sympy printer writes differently, by name. An
            empty text means that the language does not have the function. "denied" is the negation.
        power: format of a power, such as `{0}^{1}`.
        comparisons: comparison signs that differ from C, by sympy class name.
        joins: signs of "both" (and) and "either" (or) between parenthesised conditions. Defaults:
            the signs of C.
    """
    values = {
        "forms": {"sqrt": "sqrt({0})", "denied": "!{0}", **forms},
        "power": power,
        "comparisons": {**_COMPARISONS, **(comparisons or {})},
        "joins": joins or {"both": " && ", "either": " || "},
        "number": staticmethod(number),
        "title": title,
    }
    return type("Printer", (Readable, base), values)(dict(_ORDER))
