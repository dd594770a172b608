"""Output language Rust: a function of slices, with column-major matrices."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from sympy.printing.rust import RustCodePrinter

from mbs.export.languages.language import (
    CodeUnit,
    Language,
    comment_lines,
    section_lines,
    value_text,
    wrap,
)
from mbs.export.languages.symbolic import printer_of

_METHODS = {
    **{name: name for name in ("sin", "cos", "tan", "asin", "acos", "atan")},
    **{name: name for name in ("sinh", "cosh", "tanh", "asinh", "acosh", "atanh")},
    **{"exp": "exp", "log": "ln", "Abs": "abs", "sqrt": "sqrt"},
    **{"floor_": "floor", "ceil_": "ceil", "log1p": "ln_1p", "expm1": "exp_m1"},
}
_OF_TWO = {"atan2": "atan2", "copysign": "copysign", "hypot": "hypot", "fmin": "min", "fmax": "max"}
_CHOICE = "if {0} {{ {1} }} else {{ {2} }}"
_FORMS = {
    **{name: f"{{0}}.{method}()" for name, method in _METHODS.items()},
    **{name: f"f64::{method}({{0}}, {{1}})" for name, method in _OF_TWO.items()},
    "fmod": "({0} % {1})",
    "powi": "{0}.powi({1})",
    "step": "(if {0} > 0.0 {{ 1.0_f64 }} else if {0} < 0.0 {{ -1.0 }} else {{ {0} }})",
    "erf": "",
}
_WORDS = """
as async await break const continue crate dyn else enum extern false fn for gen if impl in let loop
match mod move mut pub ref return self Self static struct super trait true type unsafe use where
while abstract become box do final macro override priv try typeof union unsized virtual yield f64
"""
_LINTS = "non_snake_case, unused_variables, unused_parens, clippy::all"


class Rust(Language):
    """Rust 2018 and later."""

    title = "Rust"
    suffix = ".rs"
    reserved = frozenset(_WORDS.split())
    scalars_by_name = False
    squares_as_products = True
    by_columns = True

    def printer(self) -> Any:
        """Return a printer that writes sympy expressions in Rust."""
        return printer_of(RustCodePrinter, self.title, repr, _FORMS, "f64::powf({0}, {1})")

    def lines(self, unit: CodeUnit, printer: Any) -> Iterator[str]:
        """Yield the lines of the Rust text of a function.

        Args:
            unit: function to write.
            printer: printer of sympy expressions from `printer`.
        """
        # Not `///`: cargo test compiles and runs examples in Rust documentation.
        yield from comment_lines(unit.header, "//")
        arguments = [f"{argument.name}: &[f64]" for argument in unit.inputs]
        arguments += [f"{argument.name}: &mut [f64]" for argument in unit.outputs]
        yield f"#[allow({_LINTS})]"
        yield from wrap(f"pub fn {unit.name}({', '.join(arguments)}) {{")
        yield from (f"    let {load};" for load in self.loads(unit))
        yield from section_lines(
            unit,
            "\n    // {}",
            lambda line: wrap(
                f"let {line.name}: f64 = {value_text(line, printer, _CHOICE)};", "    "
            ),
        )
        for out in unit.outputs:
            yield ""
            if unit.has_zeros(out):
                yield f"    {out.name}[..{out.size}].fill(0.0);"
            yield from (f"    {store};" for store in self.stores(unit, out, printer))
        yield "}"
