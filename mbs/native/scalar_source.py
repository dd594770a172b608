"""C99 code of Functions of scalar operations, in double or single precision.

In double precision the values are bit-identical to the interpreted Functions. Long functions are
split into several C functions: compilers need minutes for fifty thousand statements in a single
function, and a time proportional to the length if it is split.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Literal

import casadi
from casadi import Function

from mbs.native.c_code import (
    BLOCK,
    ELEMENTWISE,
    BlockCode,
    FloatCode,
    Real,
    blocks,
    plain_order,
    slots,
)
from mbs.native.compiler import FLAGS
from mbs.native.frames import EXPORT, HEAD, GraphCode, Memory, WorkSize, entry, function_table
from mbs.native.repeats import LEAST, with_calls
from mbs.operations.graph import graph_of

Target = Literal["hosted", "bare"]
"""Platform of C code: with an operating system, or without."""

_LONG = 100_000  # lines of C text for which gcc -O2 needs about one minute
_WRITTEN = ELEMENTWISE | {casadi.OP_INPUT, casadi.OP_OUTPUT, casadi.OP_CONST}


def is_scalar(function: Function) -> bool:
    """Whether a Function consists of scalar operations that C has, without an expansion.

    The values of its C code are then bit-identical to the interpreted Function. An expansion may
    simplify operations, which changes the last bits.

    Args:
        function: any Function.
    """
    operations = range(function.n_instructions()) if function.is_a("SXFunction") else ()
    return bool(operations) and all(function.instruction_id(k) in _WRITTEN for k in operations)


def plain_source(
    functions: Iterable[Function], block: int = BLOCK, least: int = LEAST
) -> tuple[str, WorkSize]:
    """Return one C file of Functions in CasADi's calling convention.

    The file contains for each Function
    `int NAME(const double **arg, double **res, long long *iw, double *w, int mem)`.
    Pointers in `arg` and `res` may be NULL.

    Args:
        functions: Functions of scalar operations, or Functions that can be expanded to them. Their
            names are different.
        block: maximum number of assignments in one C function.
        least: minimum number of operations of a Function for which recurring sequences of
            operations are written once.

    Returns:
        the text, and lengths of the arrays that are enough for each function.

    Raises:
        ModelError: a Function cannot be expanded to scalar operations, or has an operation without
            an equivalent in C.
    """
    texts, most = [HEAD], WorkSize()
    for function in functions:
        lines, work = _null_safe_lines(function, "", block, least)
        texts += [*lines, ""]
        most = most.covering(work)
    return "\n".join(texts), most


def external_source(functions: Iterable[Function]) -> str:
    """Return the C code of `plain_source` and the functions by which CasADi's `external` loads it.

    Args:
        functions: Functions of scalar operations with different names.

    Raises:
        ModelError: a Function has an operation without an equivalent in C.
    """
    texts = [HEAD + EXPORT]
    for function in functions:
        lines, work = _null_safe_lines(function, "EXPORT ", BLOCK, LEAST)
        texts += [*lines, function_table(function, work.w), ""]
    return "\n".join(texts)


def bare_source(functions: Iterable[Function], real: Real = "double") -> tuple[str, int]:
    """Return static C functions for processors without an operating system.

    Each is `static int NAME(const REAL **arg, REAL **res, long long *iw, REAL *w, int mem)`. No
    pointer in `arg` and `res` may be NULL; `iw` and `mem` are not used. The functions call math.h,
    memset and memcpy only, and the text does not mention CasADi.

    Args:
        functions: Functions of scalar operations, or Functions that can be expanded to them, with
            dense inputs and outputs.
        real: C type of numbers.

    Returns:
        the text, and a length of w that is enough for each function.

    Raises:
        ModelError: a Function cannot be expanded to scalar operations, or has an operation without
            an equivalent in C.
    """
    texts, most = [], 1
    for function in functions:
        body = _body(function, real, BLOCK, LEAST)
        calls = body.calls(inputs="arg", outputs="res")
        texts += [*body.texts(), *entry(function.name(), calls, "static ", real), ""]
        most = max(most, body.code.where.count)
    return "\n".join(texts), most


def plain_flags(source: str) -> tuple[str, ...]:
    """Return the compiler flags for C text of `plain_source`.

    Args:
        source: text of the longest C file.

    Returns:
        FLAGS, with -O1 for text of more than 100,000 lines. The values are the same.
    """
    return ("-O1" if source.count("\n") > _LONG else FLAGS[0], *FLAGS[1:])


def _body(function: Function, real: Real, block: int, least: int) -> GraphCode:
    """Return the C functions of a Function, in the order of its operations.

    `real` is the C type of numbers; `block` and `least` are as in `plain_source`.
    """
    graph = graph_of(function)
    pieces = blocks(graph, with_calls(graph, plain_order(graph), least), block)
    code = (BlockCode if real == "double" else FloatCode)(graph, slots(graph, pieces), "")
    return GraphCode(function.name(), code, pieces)


def _null_safe_lines(
    function: Function, linkage: str, block: int, least: int
) -> tuple[list[str], WorkSize]:
    """Return the C lines of a Function whose arguments may be NULL, and its work sizes.

    `linkage` is the text before the type; `block` and `least` are as in `plain_source`.
    """
    body = _body(function, "double", block, least)
    memory = Memory(function, body.code.graph, body.code.where.count)
    lines = [*memory.declarations(), *body.calls()]
    work = WorkSize(function.n_in(), function.n_out(), 0, memory.size)
    return [*body.texts(), *entry(function.name(), lines, linkage)], work
