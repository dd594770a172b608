"""C code that gives CasADi the sparsity of the Jacobians of compiled Functions.

CasADi reads `jac_f_sparsity_out` from the library of an external Function `f`. Without it,
Jacobians are dense, and a Hessian needs as many directions as there are variables.
"""

from collections.abc import Iterable

from casadi import Function, Sparsity

from mbs.native.frames import EXPORT


def patterns_source(functions: Iterable[Function]) -> str:
    """Return a C file with the Jacobian sparsity of Functions, in compressed column format.

    Args:
        functions: Functions with different names.
    """
    return "\n".join([EXPORT, *(_pattern(f.name(), _blocks(f)) for f in functions)])


def pattern_source(jacobian: Function) -> str:
    """Return a C file with the sparsity of the outputs of a Jacobian, in compressed columns.

    Args:
        jacobian: Jacobian with the name `jac_f` that CasADi gives it.
    """
    blocks = [jacobian.sparsity_out(k) for k in range(jacobian.n_out())]
    return "\n".join([EXPORT, _pattern(jacobian.name().removeprefix("jac_"), blocks)])


def _blocks(function: Function) -> list[Sparsity]:
    """Return the sparsity of each Jacobian block: all inputs of output 0, then of output 1, ..."""
    return [
        function.jac_sparsity(row, column)
        for row in range(function.n_out())
        for column in range(function.n_in())
    ]


def _pattern(name: str, patterns: Iterable[Sparsity]) -> str:
    """Return C arrays of the patterns, and the function jac_NAME_sparsity_out that returns them.

    `patterns` are the sparsities of the blocks of the Jacobian, `name` that of the Function.
    """
    blocks = [tuple(pattern.compress()) for pattern in patterns]
    names = {block: f"{name}_pattern{k}" for k, block in enumerate(blocks)}
    arrays = [
        f"static const long long int {array}[] = {{{', '.join(map(str, block))}}};"
        for block, array in names.items()
    ]
    cases = [f"    case {k}: return {names[block]};" for k, block in enumerate(blocks)]
    return "\n".join(
        [
            *arrays,
            f"EXPORT const long long int *jac_{name}_sparsity_out(long long int k)",
            "{",
            "  switch (k) {",
            *cases,
            "    default: return 0;",
            "  }",
            "}",
        ]
    )
