"""Output language Fortran 90: a subroutine in free form."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from sympy.printing.fortran import FCodePrinter

from mbs.export.languages.language import (
    Argument,
    CodeUnit,
    Language,
    branches,
    comment_lines,
    section_lines,
    wrap,
)
from mbs.export.languages.symbolic import printer_of

_COLUMNS, _CONTINUED = 100, " &"
_NAMES_A_LINE = 8
_BRANCHES = "if ({0}) then", "else", "end if"
_SAME = "sin cos tan asin acos atan sinh cosh tanh asinh acosh atanh exp log erf"
_FORMS = {
    **{name: f"{name}({{0}})" for name in _SAME.split()},
    **{"atan2": "atan2({0}, {1})", "Abs": "abs({0})", "hypot": "hypot({0}, {1})"},
    **{"fmod": "mod({0}, {1})", "copysign": "sign({0}, {1})"},
    # the standard does not define the result of `min` and `max` with NaN
    "fmin": "merge({0}, {1}, {0} <= {1} .or. {1} /= {1})",
    "fmax": "merge({0}, {1}, {0} >= {1} .or. {1} /= {1})",
    "step": "merge(sign(1.0d0, {0}), {0}, abs({0}) > 0.0d0)",
    "denied": ".not. {0}",
    "floor_": "(aint({0}) - merge(1.0d0, 0.0d0, {0} < aint({0})))",
    "ceil_": "(aint({0}) + merge(1.0d0, 0.0d0, {0} > aint({0})))",
    "log1p": "log(1.0d0 + {0})",
    "expm1": "(exp({0}) - 1.0d0)",
}
_JOINS = {"both": " .and. ", "either": " .or. "}
_WORDS = """
abs aint asin acos atan sinh cosh tanh asinh acosh atanh exp log erf atan2 hypot mod sign min max
merge sin cos tan sqrt
allocatable allocate assign assignment block call case character common complex contains continue
cycle data deallocate default do double else elseif elsewhere end endif enddo endfile entry
equivalence exit external file forall format function goto if implicit in inout integer intent
interface intrinsic kind len logical module namelist none nullify only operator optional out
parameter pause pointer precision print private procedure program public pure read real recursive
result return rewind save select sequence stop subroutine target then to type use where while write
"""


class Fortran(Language):
    """Fortran 90. Inverse hyperbolic functions, erf and hypot need Fortran 2008."""

    title = "Fortran"
    suffix = ".f90"
    reserved = frozenset(_WORDS.split())
    folds_case = True
    longest_name = 31

    def printer(self) -> Any:
        """Return a printer that writes sympy expressions in Fortran."""
        signs = {"Unequality": "/="}
        return printer_of(FCodePrinter, self.title, _number, _FORMS, "{0}**{1}", signs, _JOINS)

    def lines(self, unit: CodeUnit, printer: Any) -> Iterator[str]:
        """Yield the lines of the Fortran text of a function.

        Args:
            unit: function to write.
            printer: printer of sympy expressions from `printer`.
        """
        yield from comment_lines(unit.header, "!")
        arguments = [*unit.inputs, *unit.outputs]
        names = ", ".join(argument.name for argument in arguments)
        yield from _title(unit.name, names)
        yield "  implicit none"
        for intent, some in (("in", unit.inputs), ("out", unit.outputs)):
            for argument in some:
                declared = f"double precision, intent({intent}) :: {_declare(argument)}"
                yield from _statement(declared)
        yield from _declarations(unit.locals)
        yield ""
        for load in self.loads(unit):
            yield from _statement(load)
        yield from section_lines(
            unit, "\n  ! {}", lambda line: branches(line, printer, _BRANCHES, _statement)
        )
        yield from self._stores(unit, printer)
        yield f"end subroutine {unit.name}"

    def _stores(self, unit: CodeUnit, printer: Any) -> Iterator[str]:
        """Yield the assignments of all outputs."""
        for out in unit.outputs:
            yield ""
            if unit.has_zeros(out):
                yield f"  {out.name} = 0.0d0"
            for store in self.stores(unit, out, printer):
                yield from _statement(store)


def _number(value: float) -> str:
    """Return a constant in double precision."""
    text = repr(value)
    return text.replace("e", "d") if "e" in text else f"{text}d0"


def _statement(text: str, indent: str = "  ") -> list[str]:
    """Return a statement broken into lines with continuation marks."""
    return wrap(text, indent, _CONTINUED, _COLUMNS)


def _title(name: str, arguments: str) -> list[str]:
    """Return the subroutine statement as lines."""
    line = f"subroutine {name}({arguments})"
    if len(line) <= _COLUMNS:
        return [line]
    return [f"subroutine {name}(&", *_statement(f"{arguments})", "    ")]


def _declare(argument: Argument) -> str:
    """Return the declaration of an argument: its name with its shape."""
    if argument.scalar:
        return argument.name
    shape = f"{argument.rows}" if argument.is_vector else f"{argument.rows},{argument.columns}"
    return f"{argument.name}({shape})"


def _declarations(names: Sequence[str]) -> Iterator[str]:
    """Yield the declarations of local variables."""
    for k in range(0, len(names), _NAMES_A_LINE):
        yield from _statement(f"double precision :: {', '.join(names[k : k + _NAMES_A_LINE])}")
