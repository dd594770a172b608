"""A Function as machine code, equal to the interpreted one to the last bit."""

import casadi

from mbs.errors import CompilerError
from mbs.native.cache import cached_library
from mbs.native.compiler import find_compiler, flags_for


def compiled(function: casadi.Function, *, derivatives: bool = True) -> casadi.Function:
    """The same Function backed by a cached shared library.

    Without a compiler, or when the Function holds a node that CasADi cannot write as C, the
    given Function is returned: the answers are the same, only slower.

    Args:
        function: any Function without free symbols.
        derivatives: compile its Jacobian, forward and reverse derivatives too, so that the
            answer can be differentiated once.

    Returns:
        a Function with the same name, inputs, outputs and default inputs.
    """
    try:
        find_compiler()
    except CompilerError:
        return function
    source = c_source(function, derivatives=derivatives)
    if "#error" in source:
        return function
    library = cached_library({"function.c": source}, flags_for(source))
    return casadi.external(function.name(), str(library))


def c_source(function: casadi.Function, *, derivatives: bool = False) -> str:
    """C text of a Function, with the derivative functions that an external Function looks for.

    Args:
        function: any Function without free symbols.
        derivatives: add `jac_`, `fwd1_` and `adj1_` of it.

    Returns:
        one C file.
    """
    generator = casadi.CodeGenerator(f"{function.name()}_code")
    generator.add(function)
    if derivatives:
        for derivative in _derivatives(function):
            generator.add(derivative)
    return str(generator.dump())


def _derivatives(function: casadi.Function) -> tuple[casadi.Function, ...]:
    return (function.jacobian(), function.forward(1), function.reverse(1))
