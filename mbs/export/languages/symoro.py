"""Output language of SYMORO listings: tables, lines `X = expression;`, and *=* at the end."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from sympy.printing.pycode import PythonCodePrinter

from mbs.export.languages.language import (
    CodeUnit,
    Language,
    kept_inside,
    plain_number,
    sections,
    value_text,
    wrap,
)
from mbs.export.languages.symbolic import printer_of
from mbs.text import in_bracket_comment

_SAME = "sin cos tan asin acos atan sinh cosh tanh asinh acosh atanh exp log sqrt erf"
_JOINS = {"both": " and ", "either": " or "}
_CHOICE = "Piecewise(({1}, {0}), ({2}, True))"
_FORMS = {
    **{name: f"{name}({{0}})" for name in _SAME.split()},
    **{"atan2": "atan2({0}, {1})", "step": "sign({0})", "Abs": "Abs({0})"},
    **{"floor_": "floor({0})", "ceil_": "ceiling({0})"},
    **{"fmin": "Min({0}, {1})", "fmax": "Max({0}, {1})"},
    "denied": "not {0}",
    "hypot": "sqrt({0}**2 + {1}**2)",
    "log1p": "log(1 + {0})",
    "expm1": "(exp({0}) - 1)",
    "fmod": "({0} - {1}*sign({0}/{1})*floor(Abs({0}/{1})))",
    "copysign": "Piecewise((-Abs({0}), {1} < 0), (Abs({0}), True))",
}


class Symoro(Language):
    """SYMORO listing, in the syntax of sympy."""

    title = "SYMORO"
    reserved = frozenset(["E", "I", "N", "O", "Q", "S", "pi"])

    def printer(self) -> Any:
        """Return a printer that writes sympy expressions in SYMORO."""
        return printer_of(
            PythonCodePrinter, self.title, plain_number, _FORMS, "{0}**{1}", joins=_JOINS
        )

    def lines(self, unit: CodeUnit, printer: Any) -> Iterator[str]:
        """Yield the lines of the SYMORO text of a function.

        Args:
            unit: function to write.
            printer: printer of sympy expressions from `printer`.
        """
        first, *others = kept_inside(unit.header, in_bracket_comment)
        yield f"(* {first}"
        yield from (f"   {line}".rstrip() for line in others)
        yield "*)"
        yield from unit.tables
        yield from ("", "Equations:", "")
        for _, lines in sections(unit):
            for line in lines:
                yield from wrap(f"{line.name} = {value_text(line, printer, _CHOICE)};")
        names = {line.name for line in (*unit.fixed, *unit.changing)}
        for out in unit.outputs:
            for store in unit.stores_of(out):
                if store.label not in names:
                    yield f"{store.label} = {printer.text(store.value)};"
        yield "*=*"
