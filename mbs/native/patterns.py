"""C text that informs CasADi where the derivatives of compiled Functions have no elements.

CasADi asks the library of an external Function `f` for `jac_f_sparsity_out`. Without it every
element of a Jacobian counts, and a Hessian takes as many directions as there are variables.
"""

from collections.abc import Iterable

from casadi import Function

_HEAD = """\
#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif
"""


def patterns_source(functions: Iterable[Function]) -> str:
    """One C file with the sparsity of the Jacobians of Functions, in compressed columns.

    Args:
        functions: with different names.
    """
    return "\n".join([_HEAD, *map(_patterns, functions)])


def _patterns(function: Function) -> str:
    """Patterns of the blocks, all inputs of the first output before those of the second."""
    blocks = [
        function.jac_sparsity(row, column).compress()
        for row in range(function.n_out())
        for column in range(function.n_in())
    ]
    names = {tuple(block): f"{function.name()}_pattern{k}" for k, block in enumerate(blocks)}
    arrays = [
        f"static const long long int {name}[] = {{{', '.join(map(str, block))}}};"
        for block, name in names.items()
    ]
    cases = [f"    case {k}: return {names[tuple(block)]};" for k, block in enumerate(blocks)]
    return "\n".join(
        [
            *arrays,
            f"EXPORT const long long int *jac_{function.name()}_sparsity_out(long long int k)",
            "{",
            "  switch (k) {",
            *cases,
            "    default: return 0;",
            "  }",
            "}",
        ]
    )
