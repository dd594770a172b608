"""Output language Mathematica: a function of lists, for symbols and numbers."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from sympy.printing.mathematica import MCodePrinter

from mbs.export.languages.language import (
    Argument,
    CodeUnit,
    Language,
    grid_texts,
    kept_inside,
    plain_number,
    section_lines,
    value_text,
    wrap,
)
from mbs.export.languages.symbolic import printer_of
from mbs.text import in_wolfram_comment

_NAMES = {
    **{"sin": "Sin", "cos": "Cos", "tan": "Tan", "asin": "ArcSin", "acos": "ArcCos"},
    **{"atan": "ArcTan", "sinh": "Sinh", "cosh": "Cosh", "tanh": "Tanh", "asinh": "ArcSinh"},
    **{"acosh": "ArcCosh", "atanh": "ArcTanh", "exp": "Exp", "log": "Log", "sqrt": "Sqrt"},
    **{"Abs": "Abs", "erf": "Erf", "step": "Sign", "floor_": "Floor", "ceil_": "Ceiling"},
}
_CHOICE = "If[{0}, {1}, {2}]"
_FORMS = {
    **{name: f"{function}[{{0}}]" for name, function in _NAMES.items()},
    "atan2": "ArcTan[{1}, {0}]",
    "fmod": "({0} - {1}*IntegerPart[{0}/{1}])",
    "copysign": "If[{1} < 0, -Abs[{0}], Abs[{0}]]",
    "fmin": "Min[{0}, {1}]",
    "fmax": "Max[{0}, {1}]",
    "denied": "Not[{0}]",
    "hypot": "Sqrt[{0}^2 + {1}^2]",
    "log1p": "Log[1 + {0}]",
    "expm1": "(Exp[{0}] - 1)",
}
_SYSTEM = """
C D E I K N O Pi Re Im If Do Or Up Dt Do Min Max Abs Sin Cos Tan Log Exp Sign Sqrt Table Floor
Ceiling True False Null List Module Block With Function Degree Infinity Print Return Map Apply Plus
Times Power Slot Sum Product Solve Limit Series Integrate Norm Cross Dot Det Tr Inverse Transpose
"""


class Mathematica(Language):
    """Mathematica and the Wolfram language."""

    title = "Mathematica"
    suffix = ".wl"
    reserved = frozenset(_SYSTEM.split())
    brackets = "[[", "]]"
    tail = "x"

    def printer(self) -> Any:
        """Return a printer that writes sympy expressions in Mathematica."""
        return printer_of(MCodePrinter, self.title, _number, _FORMS, "{0}^{1}")

    def legal(self, name: str) -> str:
        """Return a name without "_", which marks patterns: a_b becomes aB, A1_12 becomes A1x12."""
        parts = re.sub(r"(?<=\d)_(?=\d)", "x", super().legal(name)).split("_")
        return parts[0] + "".join(part[:1].upper() + part[1:] for part in parts[1:])

    def lines(self, unit: CodeUnit, printer: Any) -> Iterator[str]:
        """Yield the lines of the Mathematica text of a function.

        Args:
            unit: function to write.
            printer: printer of sympy expressions from `printer`.
        """
        first, *others = kept_inside(unit.header, in_wolfram_comment)
        yield f"(* {first}"
        yield from (f"   {line}".rstrip() for line in others)
        yield "*)"
        arguments = ", ".join(f"{argument.name}_" for argument in unit.inputs)
        names = ", ".join(unit.locals)
        yield from wrap(f"{unit.name}[{arguments}] := Module[{{{names}}},")
        yield from (f"  {load};" for load in self.loads(unit))
        yield from section_lines(
            unit,
            "\n  (* {} *)",
            lambda line: wrap(f"{line.name} = {value_text(line, printer, _CHOICE)};", "  "),
        )
        yield ""
        outputs = [_output(unit, out, printer) for out in unit.outputs]
        result = outputs[0] if len(outputs) == 1 else f"{{{', '.join(outputs)}}}"
        yield from wrap(result, "  ")
        yield "]"


def _number(value: float) -> str:
    """Return a constant with `*^` before its exponent."""
    text = plain_number(value)
    mantissa, _, exponent = text.partition("e")
    return f"{mantissa}*^{int(exponent)}" if exponent else text


def _output(unit: CodeUnit, out: Argument, printer: Any) -> str:
    """Return the expression of an output."""
    grid = grid_texts(unit, out, printer, "0")
    if out.scalar:
        return grid[0][0]
    if out.is_vector:
        return f"{{{', '.join(row[0] for row in grid)}}}"
    rows = (f"{{{', '.join(row)}}}" for row in grid)
    return f"{{{', '.join(rows)}}}"
