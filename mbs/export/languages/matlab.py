"""Output language Matlab and Octave: a function file."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from sympy.printing.octave import OctaveCodePrinter

from mbs.export.languages.language import (
    CodeUnit,
    Language,
    branches,
    comment_lines,
    plain_number,
    section_lines,
    wrap,
)
from mbs.export.languages.symbolic import printer_of

_CONTINUED = " ..."
_BRANCHES = "if {0}", "else", "end"
_FORMS = {
    "atan2": "atan2({0}, {1})",
    "step": "sign({0})",
    "floor_": "floor({0})",
    "ceil_": "ceil({0})",
    "fmod": "rem({0}, {1})",
    "copysign": "(abs({0})*(1 - 2*({1} < 0 || 1/{1} < 0)))",  # 1/-0 is minus infinity
    "denied": "~{0}",
    "fmin": "min({0}, {1})",
    "fmax": "max({0}, {1})",
    "hypot": "hypot({0}, {1})",
    "log1p": "log1p({0})",
    "expm1": "expm1({0})",
}
_WORDS = """
abs sign floor ceil rem min max hypot log1p expm1 sin cos tan asin acos atan atan2 sinh cosh tanh
asinh acosh atanh exp log sqrt erf zeros
break case catch classdef continue else elseif end for function global if otherwise parfor
persistent return spmd switch try while do until endif endfor endfunction endwhile endswitch
end_try_catch end_unwind_protect unwind_protect unwind_protect_cleanup __FILE__ __LINE__
"""


class Matlab(Language):
    """Matlab and Octave."""

    title = "Matlab"
    suffix = ".m"
    reserved = frozenset(_WORDS.split())
    longest_name = 63

    def printer(self) -> Any:
        """Return a printer that writes sympy expressions in Matlab."""
        signs = {"Unequality": "~="}
        return printer_of(OctaveCodePrinter, self.title, plain_number, _FORMS, "{0}^{1}", signs)

    def lines(self, unit: CodeUnit, printer: Any) -> Iterator[str]:
        """Yield the lines of the Matlab text of a function.

        Args:
            unit: function to write.
            printer: printer of sympy expressions from `printer`.
        """
        inside = ", ".join(argument.name for argument in unit.inputs)
        outside = ", ".join(argument.name for argument in unit.outputs)
        outside = outside if len(unit.outputs) == 1 else f"[{outside}]"
        yield from wrap(f"function {outside} = {unit.name}({inside})", mark=_CONTINUED)
        yield from comment_lines(unit.header, "%")
        yield ""
        yield from (f"  {load};" for load in self.loads(unit))
        yield from section_lines(
            unit, "\n  % {}", lambda line: branches(line, printer, _BRANCHES, _statement, ";")
        )
        yield from self._stores(unit, printer)
        yield "end"

    def _stores(self, unit: CodeUnit, printer: Any) -> Iterator[str]:
        """Yield the assignments of all outputs."""
        for out in unit.outputs:
            yield ""
            if not out.scalar or unit.has_zeros(out):
                yield f"  {out.name} = zeros({out.rows}, {out.columns});"
            yield from (f"  {store};" for store in self.stores(unit, out, printer))


def _statement(text: str, indent: str = "  ") -> list[str]:
    """Return a statement broken into lines with continuation marks."""
    return wrap(text, indent, _CONTINUED)
