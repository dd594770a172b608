"""Output language Maple: a procedure of vectors, for symbols and numbers."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from sympy.printing.maple import MapleCodePrinter

from mbs.export.languages.language import (
    Argument,
    CodeUnit,
    Language,
    comment_lines,
    grid_texts,
    plain_number,
    section_lines,
    value_text,
    wrap,
)
from mbs.export.languages.symbolic import printer_of

_JOINS = {"both": " and ", "either": " or "}
_CHOICE = "piecewise({0}, {1}, {2})"
_FORMS = {
    "atan2": "arctan({0}, {1})",
    "step": "signum({0})",
    "denied": "not {0}",
    "Abs": "abs({0})",
    "floor_": "floor({0})",
    "ceil_": "ceil({0})",
    "fmod": "({0} - {1}*trunc({0}/{1}))",
    "copysign": "piecewise({1} < 0, -abs({0}), abs({0}))",
    "fmin": "min({0}, {1})",
    "fmax": "max({0}, {1})",
    "hypot": "sqrt({0}^2 + {1}^2)",
    "log1p": "ln(1 + {0})",
    "expm1": "(exp({0}) - 1)",
}
_WORDS = """
sin cos tan arcsin arccos arctan sinh cosh tanh arcsinh arccosh arctanh exp ln log sqrt abs signum
floor ceil trunc min max piecewise erf
D I Pi O E gamma Gamma GAMMA Catalan infinity true false FAIL undefined Digits Order Psi Zeta Beta W
Im Re Vector Matrix Array Chi Ci Si Ei Ai Bi
and assuming break by catch description do done elif else end error export fi finally for from
global if implies in intersect local minus mod module next not od option options or proc quit read
return save stop subset then to try union use uses while xor
"""


class Maple(Language):
    """Maple."""

    title = "Maple"
    suffix = ".mpl"
    reserved = frozenset(_WORDS.split())
    brackets = "[", "]"

    def printer(self) -> Any:
        """Return a printer that writes sympy expressions in Maple."""
        signs = {"Equality": "=", "Unequality": "<>"}
        return printer_of(
            MapleCodePrinter, self.title, plain_number, _FORMS, "{0}^{1}", signs, _JOINS
        )

    def lines(self, unit: CodeUnit, printer: Any) -> Iterator[str]:
        """Yield the lines of the Maple text of a function.

        Args:
            unit: function to write.
            printer: printer of sympy expressions from `printer`.
        """
        yield from comment_lines(unit.header, "#")
        arguments = ", ".join(argument.name for argument in unit.inputs)
        yield from wrap(f"{unit.name} := proc({arguments})")
        outputs = [argument.name for argument in unit.outputs]
        yield from wrap(f"local {', '.join([*unit.locals, *outputs])};", "  ")
        yield from (f"  {load.replace(' = ', ' := ', 1)};" for load in self.loads(unit))
        yield from section_lines(
            unit,
            "\n  # {}",
            lambda line: wrap(f"{line.name} := {value_text(line, printer, _CHOICE)};", "  "),
        )
        yield ""
        for out in unit.outputs:
            yield from _output(unit, out, printer)
        yield f"  return {', '.join(outputs)};"
        yield "end proc:"


def _output(unit: CodeUnit, out: Argument, printer: Any) -> Iterator[str]:
    """Yield the lines that create an output."""
    grid = grid_texts(unit, out, printer, "0")
    if out.scalar:
        value = grid[0][0]
    elif not out.size:
        value = f"Matrix({out.rows}, {out.columns})"
    elif out.is_vector:
        value = f"Vector([{', '.join(row[0] for row in grid)}])"
    else:
        rows = ", ".join(f"[{', '.join(row)}]" for row in grid)
        value = f"Matrix([{rows}])"
    if value != out.name:
        yield from wrap(f"{out.name} := {value};", "  ")
