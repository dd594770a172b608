"""Output language C: a function of pointers to doubles, with column-major matrices."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from sympy.printing.c import C99CodePrinter

from mbs.export._c_library import parameter_names
from mbs.export.languages.language import (
    CodeUnit,
    Language,
    kept_inside,
    section_lines,
    value_text,
    wrap,
)
from mbs.export.languages.symbolic import printer_of
from mbs.text import in_c_comment

_CHOICE = "({0}) ? {1} : {2}"
_FORMS = {
    "step": "({0} > 0 ? 1.0 : {0} < 0 ? -1.0 : {0})",
    "Abs": "fabs({0})",
    **{name: f"{name}({{0}}, {{1}})" for name in ("fmod", "copysign", "fmin", "fmax", "hypot")},
    **{"floor_": "floor({0})", "ceil_": "ceil({0})", "log1p": "log1p({0})", "expm1": "expm1({0})"},
}


class C(Language):
    """C99."""

    title = "C"
    suffix = ".c"
    scalars_by_name = False
    squares_as_products = True
    by_columns = True

    def printer(self) -> Any:
        """Return a printer that writes sympy expressions in C."""
        return printer_of(C99CodePrinter, self.title, repr, _FORMS, "pow({0}, {1})")

    def is_reserved(self, name: str) -> bool:
        """Whether C, its library or C++ reserves a name."""
        return parameter_names([name], ["k"]) != [name]

    def lines(self, unit: CodeUnit, printer: Any) -> Iterator[str]:
        """Yield the lines of the C text of a function.

        Args:
            unit: function to write.
            printer: printer of sympy expressions from `printer`.
        """
        yield "/*"
        yield from (f" * {line}".rstrip() for line in kept_inside(unit.header, in_c_comment))
        yield from (" */", "#include <math.h>", "")
        arguments = [f"const double *{argument.name}" for argument in unit.inputs]
        arguments += [f"double *{argument.name}" for argument in unit.outputs]
        yield from wrap(f"void {unit.name}({', '.join(arguments) or 'void'})")
        yield "{"
        yield from (f"    const double {load};" for load in self.loads(unit))
        yield from section_lines(
            unit,
            "\n    /* {} */",
            lambda line: wrap(
                f"const double {line.name} = {value_text(line, printer, _CHOICE)};", "    "
            ),
        )
        yield from self._stores(unit, printer)
        yield "}"

    def _stores(self, unit: CodeUnit, printer: Any) -> Iterator[str]:
        """Yield the assignments of all outputs."""
        for out in unit.outputs:
            yield ""
            if unit.has_zeros(out):
                yield f"    for (int k = 0; k < {out.size}; ++k) {out.name}[k] = 0.0;"
            yield from (f"    {store};" for store in self.stores(unit, out, printer))
