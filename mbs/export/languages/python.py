"""Output language Python: a function of arrays. Additional axes evaluate many states at once."""

from __future__ import annotations

import keyword
from collections.abc import Iterator
from typing import Any

from sympy.printing.pycode import PythonCodePrinter

from mbs.export.languages.language import (
    CodeUnit,
    Language,
    kept_inside,
    plain_number,
    section_lines,
    value_text,
    wrap,
)
from mbs.export.languages.symbolic import printer_of
from mbs.text import in_docstring

_NUMPY = {
    **{name: name for name in ("sin", "cos", "tan", "sinh", "cosh", "tanh", "exp", "log", "sqrt")},
    **{f"a{name}": f"arc{name}" for name in ("sin", "cos", "tan", "sinh", "cosh", "tanh")},
    **{"Abs": "abs", "step": "sign", "floor_": "floor", "ceil_": "ceil"},
    **{"log1p": "log1p", "expm1": "expm1"},
}
_OF_TWO = {
    **{"atan2": "arctan2", "fmod": "fmod", "copysign": "copysign", "hypot": "hypot"},
    **{"fmin": "fmin", "fmax": "fmax"},
}
_JOINS = {"both": " & ", "either": " | "}
_CHOICE = "np.where({0}, {1}, {2})"
_FORMS = {
    **{name: f"np.{function}({{0}})" for name, function in _NUMPY.items()},
    **{name: f"np.{function}({{0}}, {{1}})" for name, function in _OF_TWO.items()},
    "denied": "np.logical_not({0})",
    "erf": "np.vectorize(math.erf, [float])({0})",
}
_WORDS = (*keyword.kwlist, "np", "math", "float", "shape")


class Python(Language):
    """Python 3 with numpy."""

    title = "Python"
    suffix = ".py"
    reserved = frozenset(_WORDS)
    brackets = "[", "]"
    first = 0

    def printer(self) -> Any:
        """Return a printer that writes sympy expressions in Python."""
        return printer_of(
            PythonCodePrinter, self.title, plain_number, _FORMS, "{0}**{1}", joins=_JOINS
        )

    def lines(self, unit: CodeUnit, printer: Any) -> Iterator[str]:
        """Yield the lines of the Python text of a function.

        Args:
            unit: function to write.
            printer: printer of sympy expressions from `printer`.
        """
        body = list(self._body(unit, printer))
        if any("math." in line for line in body):
            yield "import math"
            yield ""
        yield from ("import numpy as np", "", "")
        arguments = ", ".join(argument.name for argument in unit.inputs)
        yield from wrap(f"def {unit.name}({arguments}):")
        first, *others = kept_inside(unit.header, in_docstring)
        yield f'    """{first}'
        yield from (f"    {line}".rstrip() for line in others)
        yield '    """'
        yield from body

    def _body(self, unit: CodeUnit, printer: Any) -> Iterator[str]:
        """Yield the lines of the body of the function."""
        shapes = []
        for argument in unit.inputs:
            yield f"    {argument.name} = np.asarray({argument.name}, dtype=float)"
            axes = 0 if argument.scalar else 1 if argument.is_vector else 2
            shapes.append(f"{argument.name}.shape" + (f"[{axes}:]" if axes else ""))
        yield from _statement("shape", f"np.broadcast_shapes({', '.join(shapes)})")
        yield from (f"    {load}" for load in self.loads(unit))
        yield from section_lines(
            unit,
            "\n    # {}",
            lambda line: _statement(line.name, value_text(line, printer, _CHOICE)),
        )
        for out in unit.outputs:
            yield ""
            yield from self._output(unit, out, printer)
        yield f"    return {', '.join(argument.name for argument in unit.outputs)}"

    def _output(self, unit: CodeUnit, out: Any, printer: Any) -> Iterator[str]:
        """Yield the lines that create an output."""
        if not out.scalar:
            sizes = f"{out.rows}" if out.is_vector else f"{out.rows}, {out.columns}"
            yield f"    {out.name} = np.zeros(({sizes}, *shape))"
        elif unit.has_zeros(out):
            yield f"    {out.name} = np.zeros(shape)"
        yield from (f"    {store}" for store in self.stores(unit, out, printer))


def _statement(name: str, value: str) -> list[str]:
    """Return an assignment as lines, in parentheses if it is long."""
    lines = wrap(f"{name} = {value}", "    ")
    if len(lines) == 1:
        return lines
    return [f"    {name} = (", *wrap(value, "        "), "    )"]
