"""C99 text of Functions in short pieces, with the numbers of CasADi's own text to the last bit.

Compilers take minutes for a straight line of fifty thousand statements; pieces take them a time
that is linear in the length, at any level of optimization.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

from casadi import Function

from mbs.native.c_code import BlockCode, Memory, blocks, plain_order, slots
from mbs.native.compiler import FLAGS
from mbs.native.kernel import BLOCK, EXPORT, function_table
from mbs.native.repeats import LEAST, with_calls
from mbs.operations.graph import graph_of

_HEAD = """\
#include <math.h>
#include <string.h>
#undef NOINLINE
#ifdef __GNUC__
#define NOINLINE __attribute__((noinline))
#else
#define NOINLINE
#endif
"""

_LONG = 100_000  # lines for which -O2 takes a minute


class Work(NamedTuple):
    """How many elements the arrays that a C function takes must have at least."""

    arg: int = 0
    res: int = 0
    iw: int = 0
    w: int = 0

    def covering(self, other: Work) -> Work:
        """Enough for both."""
        return Work(*map(max, self, other))


def plain_source(
    functions: Iterable[Function], block: int = BLOCK, least: int = LEAST
) -> tuple[str, Work]:
    """One C file of Functions with different names, in CasADi's calling convention.

    It holds `int NAME(const double **arg, double **res, long long *iw, double *w, int mem)` for
    each.

    Args:
        functions: made of scalar operations, or to be expanded to them.
        block: assignments in one piece.
        least: operations of a Function from which sequences of them that recur are written once.

    Returns:
        the text, and what is enough for each of them.

    Raises:
        ModelError: some Function calls another that has no scalar operations, or has an operation
            that C does not have.
    """
    texts, most = [_HEAD], Work()
    for function in functions:
        text, work = _function(function, block, least)
        texts.append(text)
        most = most.covering(work)
    return "\n".join(texts), most


def external_source(functions: Sequence[Function]) -> str:
    """The same text with what CasADi's `external` asks of each Function.

    Args:
        functions: with different names, made of scalar operations.

    Raises:
        ModelError: some Function has an operation that C does not have.
    """
    texts = [plain_source([function]) for function in functions]
    lines = [EXPORT]
    for function, (text, work) in zip(functions, texts, strict=True):
        name = function.name()
        lines += [
            f"EXPORT int {name}"
            "(const double **arg, double **res, casadi_int *iw, double *w, int mem);",
            text,
            function_table(function, work.w),
        ]
    return "\n".join(lines)


def plain_flags(source: str) -> tuple[str, ...]:
    """The flags to compile such text with.

    Args:
        source: text of the longest C file.

    Returns:
        FLAGS with a lower level of optimization for very long text; the numbers are the same.
    """
    return ("-O1" if source.count("\n") > _LONG else FLAGS[0], *FLAGS[1:])


def _function(function: Function, block: int, least: int) -> tuple[str, Work]:
    name, graph = function.name(), graph_of(function)
    pieces = blocks(graph, with_calls(graph, plain_order(graph), least), block)
    where = slots(graph, pieces)
    code = BlockCode(graph, where, "")
    memory = Memory(function, graph, where.count)
    text = "\n".join(
        [
            *code.repeats(),
            *(code.block(f"{name}_part{k}", k, steps) for k, steps in enumerate(pieces)),
            f"int {name}(const double **arg, double **res, long long *iw, double *w, int mem) {{",
            "  (void)iw, (void)mem;",
            *memory.pointers(),
            *(f"  {name}_part{k}(in, out, w);" for k in range(len(pieces))),
            "  return 0;",
            "}\n",
        ]
    )
    return text, Work(len(graph.inputs), len(graph.outputs), 0, memory.size)
