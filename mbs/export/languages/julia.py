"""Output language Julia: a function of vectors that returns arrays, for any number type."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from sympy.printing.julia import JuliaCodePrinter

from mbs.export.languages.language import (
    Argument,
    CodeUnit,
    Language,
    comment_lines,
    grid_texts,
    section_lines,
    value_text,
    wrap,
)
from mbs.export.languages.symbolic import printer_of

_CHOICE = "({0}) ? {1} : {2}"
_FORMS = {
    "atan2": "atan({0}, {1})",
    "step": "sign({0})",
    "floor_": "floor({0})",
    "ceil_": "ceil({0})",
    "fmod": "rem({0}, {1})",
    "copysign": "copysign({0}, {1})",
    "fmin": "ifelse({0} <= {1} || isnan({1}), {0}, {1})",  # `min` of NaN and 1 is NaN
    "fmax": "ifelse({0} >= {1} || isnan({1}), {0}, {1})",
    "hypot": "hypot({0}, {1})",
    "log1p": "log1p({0})",
    "expm1": "expm1({0})",
    "erf": "",
}
_WORDS = """
sin cos tan asin acos atan sinh cosh tanh asinh acosh atanh exp log sqrt abs sign floor ceil rem
copysign ifelse isnan hypot log1p expm1 pi im NaN Inf
baremodule begin break catch const continue do else elseif end export false finally for function
global if import let local macro module quote return struct true try using while
abstract mutable primitive type where in isa outer
"""


class Julia(Language):
    """Julia 1."""

    title = "Julia"
    suffix = ".jl"
    reserved = frozenset(_WORDS.split())
    brackets = "[", "]"

    def printer(self) -> Any:
        """Return a printer that writes sympy expressions in Julia."""
        return printer_of(JuliaCodePrinter, self.title, repr, _FORMS, "{0}^{1}")

    def lines(self, unit: CodeUnit, printer: Any) -> Iterator[str]:
        """Yield the lines of the Julia text of a function.

        Args:
            unit: function to write.
            printer: printer of sympy expressions from `printer`.
        """
        yield from comment_lines(unit.header, "#")
        arguments = ", ".join(argument.name for argument in unit.inputs)
        yield from wrap(f"function {unit.name}({arguments})")
        yield from (f"    {load}" for load in self.loads(unit))
        yield from section_lines(
            unit,
            "\n    # {}",
            lambda line: wrap(f"{line.name} = {value_text(line, printer, _CHOICE)}", "    "),
        )
        yield ""
        for out in unit.outputs:
            yield from _output(unit, out, printer)
        yield f"    return {', '.join(argument.name for argument in unit.outputs)}"
        yield "end"


def _output(unit: CodeUnit, out: Argument, printer: Any) -> Iterator[str]:
    """Yield the lines that create an output."""
    grid = grid_texts(unit, out, printer, "0.0")
    if not out.size:
        yield f"    {out.name} = zeros({out.rows}, {out.columns})"
    elif out.scalar:
        if grid[0][0] != out.name:
            yield f"    {out.name} = {grid[0][0]}"
    elif out.is_vector:
        yield from wrap(f"{out.name} = [{', '.join(row[0] for row in grid)}]", "    ")
    else:
        yield f"    {out.name} = ["
        yield from (f"        {' '.join(row)}" for row in grid)
        yield "    ]"
