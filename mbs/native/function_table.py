"""What CasADi asks a compiled function about itself: names, shapes, defaults, work space."""

from __future__ import annotations

import math
from collections.abc import Sequence

from casadi import Function, Sparsity


def function_table(function: Function, work: int) -> str:
    """C text of the functions beside `name` through which CasADi's `external` learns its shape.

    Args:
        function: described; its text declares EXPORT and casadi_int.
        work: doubles of work space that the code needs.
    """
    name, n_in, n_out = function.name(), function.n_in(), function.n_out()
    shape = "const casadi_int *"
    tables = {
        "sparsity_in": [function.sparsity_in(k) for k in range(n_in)],
        "sparsity_out": [function.sparsity_out(k) for k in range(n_out)],
    }
    lines = [
        f"EXPORT casadi_int {name}_n_in(void) {{ return {n_in}; }}",
        f"EXPORT casadi_int {name}_n_out(void) {{ return {n_out}; }}",
        _chosen("double ", f"{name}_default_in", _defaults(function)),
        _chosen("const char *", f"{name}_name_in", [f'"{s}"' for s in function.name_in()]),
        _chosen("const char *", f"{name}_name_out", [f'"{s}"' for s in function.name_out()]),
    ]
    for kind, patterns in tables.items():
        names = [f"{name}_{kind}_{k}" for k in range(len(patterns))]
        lines += [_table(*row) for row in zip(names, patterns, strict=True)]
        lines.append(_chosen(shape, f"{name}_{kind}", names))
    return "\n".join([*lines, _work(name, n_in, n_out, work)])


def _defaults(function: Function) -> list[str]:
    values = [float(function.default_in(k)) for k in range(function.n_in())]
    return [repr(x) if math.isfinite(x) else "NAN" for x in values]


def _chosen(kind: str, name: str, answers: Sequence[str]) -> str:
    """A C function of a number that gives the answer of that number, else 0."""
    cases = "".join(f" case {k}: return {answer};" for k, answer in enumerate(answers))
    return f"EXPORT {kind}{name}(casadi_int i) {{ switch (i) {{{cases} default: return 0; }} }}"


def _table(name: str, pattern: Sparsity) -> str:
    numbers = [int(k) for k in pattern.compress()]
    values = ", ".join(map(str, numbers))
    return f"static const casadi_int {name}[{len(numbers)}] = {{{values}}};"


def _work(name: str, n_in: int, n_out: int, work: int) -> str:
    sizes = {"arg": n_in, "res": n_out, "iw": 0, "w": work}
    pointers = ", ".join(f"casadi_int *{kind}" for kind in sizes)
    sets = " ".join(f"if ({kind}) *{kind} = {size};" for kind, size in sizes.items())
    return f"EXPORT int {name}_work({pointers}) {{ {sets} return 0; }}"
