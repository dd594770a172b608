"""Printers of sympy that keep expressions as they are: no reordering, every digit of numbers."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from itertools import accumulate
from typing import Any

from sympy import S
from sympy.printing.codeprinter import CodePrinter
from sympy.printing.precedence import precedence

from mbs.errors import ModelError

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
    """Put before a printer of sympy: sums, products and numbers are written as they stand.

    Attributes:
        forms: how functions are called, by the name of the function.
        power: how a power is written.
        comparisons: how comparisons are written.
        joins: how conditions are joined, by "both" and "either".
        number: how a number is written.
        title: of the language, for messages.
    """

    forms: Mapping[str, str]
    power: str
    comparisons: Mapping[str, str]
    joins: Mapping[str, str]
    number: Callable[[float], str]
    title: str

    def text(self, expr: Any) -> str:
        """An expression in the language."""
        return self._print(expr)

    def _print(self, expr: Any, **kwargs: Any) -> str:
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
        return _called(form, [self._print(arg) for arg in expr.args])

    def _print_Symbol(self, expr: Any) -> str:
        return str(expr.name)

    def _print_Float(self, expr: Any, **kwargs: Any) -> str:
        return type(self).number(float(expr))

    def _print_One(self, expr: Any) -> str:
        return type(self).number(1.0)

    def _print_Add(self, expr: Any, order: Any = None) -> str:
        return str(CodePrinter._print_Add(self, expr, order="none"))

    def _print_Mul(self, expr: Any) -> str:
        return str(CodePrinter._print_Mul(self, expr))

    def _print_Pow(self, expr: Any, **kwargs: Any) -> str:
        base, exponent = expr.args
        if exponent is S.Half:  # and not the number 0.5, whose power of minus infinity is no NaN
            return _called(self.forms["sqrt"], [self._print(base)])
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
        level = precedence(expr)
        left, right = (self.parenthesize(side, level) for side in expr.args)
        return f"{left} {self.comparisons[type(expr).__name__]} {right}"


def _called(form: str, arguments: Sequence[str]) -> str:
    """A form filled in; arguments are in brackets unless they have them as those of a call."""
    texts = []
    for k, text in enumerate(arguments):
        bare = len(re.findall(rf"[\[(,] ?\{{{k}\}}[,)\]]", form)) == form.count(f"{{{k}}}")
        texts.append(text if bare or _is_closed(text) else f"({text})")
    return form.format(*texts)


def _is_closed(text: str) -> bool:
    """Whether the text is a name, or all of it stands in one pair of brackets."""
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
    """A printer of sympy made readable.

    Args:
        base: class of the printer.
        title: of the language.
        number: writes a constant.
        forms: how functions are called where the printer of sympy does not know it, or knows it
            for other arguments; an empty text for those that the language does not have.
        power: how a power is written, such as `{0}^{1}`.
        comparisons: signs that differ from those of C.
        joins: of conditions, put between brackets, for "both" and "either"; those of C when left
            out. A condition that is denied is the form "denied".
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
