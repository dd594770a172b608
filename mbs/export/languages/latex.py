"""Output language LaTeX: a document with one equation per line."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from sympy.printing.latex import LatexPrinter

from mbs.export.languages.language import (
    CodeLine,
    CodeUnit,
    Language,
    comment_lines,
    plain_number,
    sections,
)

_ACCENTS = {"QP": r"\dot{q}", "QDP": r"\ddot{q}", "GAM": r"\Gamma"}
_FORMS = {
    "step": r"\operatorname{sgn}\left(%s\right)",
    "floor_": r"\left\lfloor %s\right\rfloor",
    "ceil_": r"\left\lceil %s\right\rceil",
    "fmod": r"\operatorname{fmod}\left(%s, %s\right)",
    "copysign": r"\left|%s\right| \operatorname{sgn}\left(%s\right)",
    "fmin": r"\min\left(%s, %s\right)",
    "fmax": r"\max\left(%s, %s\right)",
    "hypot": r"\operatorname{hypot}\left(%s, %s\right)",
    "log1p": r"\log\left(1 + %s\right)",
    "expm1": r"\left(e^{%s} - 1\right)",
    "denied": r"\neg \left(%s\right)",
    "atan2": r"\operatorname{atan2}\left(%s, %s\right)",
}
_JOINS = {"both": r" \wedge ", "either": r" \vee "}
_LONGEST = 150
_DEEPER, _SHALLOWER = ("{", r"\left", r"\begin"), ("}", r"\right", r"\end")


class _Printer(LatexPrinter):  # type: ignore[misc]
    """Printer of sympy with all digits of numbers, dotted q for QP and QDP, and Gamma for GAM."""

    def text(self, expr: Any) -> str:
        """Return an expression in LaTeX notation."""
        return str(self._print(expr))

    def _print(self, expr: Any, **kwargs: Any) -> Any:
        """Return an expression in LaTeX notation, with the forms of this module."""
        name = type(expr).__name__
        if name in _JOINS:
            parts = (rf"\left({self._print(arg)}\right)" for arg in expr.args)
            return _JOINS[name].join(parts)
        form = _FORMS.get(name)
        if form is None:
            return super()._print(expr, **kwargs)
        return form % tuple(self._print(arg) for arg in expr.args)

    def _print_Symbol(self, expr: Any, style: str = "plain") -> str:
        """Return a symbol in LaTeX notation, such as a dotted q for QP2."""
        return symbol_text(expr.name)

    def _print_Float(self, expr: Any) -> str:
        """Return a number with all digits, with a power of ten for its exponent."""
        mantissa, _, exponent = plain_number(float(expr)).partition("e")
        return rf"{mantissa} \cdot 10^{{{int(exponent)}}}" if exponent else mantissa


class Latex(Language):
    """LaTeX with amsmath."""

    title = "LaTeX"
    suffix = ".tex"

    def printer(self) -> Any:
        """Return a printer that writes sympy expressions in LaTeX."""
        return _Printer({"order": "none", "mul_symbol": r" \, ", "fold_short_frac": False})

    def lines(self, unit: CodeUnit, printer: Any) -> Iterator[str]:
        """Yield the lines of the LaTeX text of a function.

        Args:
            unit: function to write.
            printer: printer of sympy expressions from `printer`.
        """
        yield from comment_lines(unit.header, "%")
        yield from (r"\documentclass{article}", r"\usepackage{amsmath}", r"\allowdisplaybreaks")
        yield r"\begin{document}"
        names = {line.name for line in (*unit.fixed, *unit.changing)}
        for title, lines in sections(unit):
            if title:
                yield f"\n{title}"
            if lines:
                yield from _align(rf"{_left(line.name)}{_value(line, printer)}" for line in lines)
        rest = [store for store in unit.stores if store.label not in names]
        if rest:
            yield "\nThe outputs."
            yield from _align(_left(s.label) + printer.text(s.value) for s in rest)
        yield r"\end{document}"


def symbol_text(name: str) -> str:
    """Return a name in LaTeX notation: a dotted q for QP2, index 23 for S23.

    Args:
        name: name of a scalar.
    """
    rate = re.fullmatch(r"(QP|QDP|GAM)(\w+)", name)
    if rate:
        return f"{_ACCENTS[rate[1]]}_{{{_escape(rate[2])}}}"
    indexed = re.fullmatch(r"([A-Za-z]+)(\d\w*)", name)
    if indexed:
        return f"{_letters(indexed[1])}_{{{_escape(indexed[2])}}}"
    return _letters(name)


def _letters(name: str) -> str:
    """Return a name in italics, escaped."""
    return name if len(name) == 1 else rf"\mathit{{{_escape(name)}}}"


def _escape(name: str) -> str:
    """Return a name with escaped underscores."""
    return name.replace("_", r"\_")


def _left(name: str) -> str:
    """Return the left-hand side of an equation with the alignment mark."""
    return f"{symbol_text(name)} &= "


def _align(equations: Iterator[str]) -> Iterator[str]:
    """Yield an align* environment of equations."""
    yield r"\begin{align*}"
    yield " \\\\\n".join("\n".join(_break_lines(equation)) for equation in equations)
    yield r"\end{align*}"


def _value(line: CodeLine, printer: Any) -> str:
    """Return the right-hand side of an equation; a condition becomes a cases environment."""
    value = printer.text(line.value)
    if line.condition is None:
        return str(value)
    condition, other = printer.text(line.condition), printer.text(line.otherwise)
    return (
        rf"\begin{{cases}} {value} & \text{{if }} {condition} \\"
        rf" {other} & \text{{otherwise}} \end{{cases}}"
    )


def _break_lines(equation: str) -> Iterator[str]:
    """Yield the lines of a long equation, broken before + and - outside brackets."""
    line, depth = "", 0
    for piece in re.split(r"(?= [+-] )", equation):
        if len(line) + len(piece) > _LONGEST and line and depth == 0:
            yield line + r" \\"
            line = r"&\quad{}"
        line += piece
        depth += sum(piece.count(mark) for mark in _DEEPER)
        depth -= sum(piece.count(mark) for mark in _SHALLOWER)
    yield line
