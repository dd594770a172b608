"""C99 code of Functions of scalar operations, in double or single precision.

In double precision the values are bit-identical to the C code that CasADi generates. Long functions
are split into several C functions: compilers need minutes for fifty thousand statements in a single
function, and a time proportional to the length if it is split.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from typing import ClassVar, Literal, NamedTuple

import numpy as np
from casadi import Function

from mbs.native.c_code import (
    BlockCode,
    Memory,
    SinCosGroup,
    Step,
    blocks,
    constant,
    form_of,
    operand,
    plain_order,
    slots,
)
from mbs.native.compiler import FLAGS
from mbs.native.kernel import BLOCK, EXPORT, function_table
from mbs.native.repeats import LEAST, with_calls
from mbs.operations.graph import Graph, Node, graph_of

Real = Literal["double", "float"]
"""C type of numbers."""

Target = Literal["hosted", "bare"]
"""Platform of C code: with an operating system, or without."""

_CALL = re.compile(r"\b([a-z]\w*)\(")
_LITERAL = re.compile(r"\b\d+\.\d+\b")
_LEAST = float(np.finfo(np.float32).tiny)
_LONG = 100_000  # lines of C text for which gcc -O2 needs about one minute

_NOINLINE = """\
#undef NOINLINE
#ifdef __GNUC__
#define NOINLINE __attribute__((noinline))
#else
#define NOINLINE
#endif
"""
NOINLINE = f"""\
{_NOINLINE}\
#if defined __cplusplus || (defined _MSC_VER && !defined __clang__)
#undef restrict
#define restrict __restrict
#endif
"""
"""Definitions before the text of `bare_source`: parts of a function are not inlined, and `restrict`
is defined for compilers of C++ and for MSVC."""
_HEAD = f"""\
#include <math.h>
#include <string.h>
{_NOINLINE}"""


class Work(NamedTuple):
    """Minimum lengths of the work arrays that a C function needs."""

    arg: int = 0
    res: int = 0
    iw: int = 0
    w: int = 0

    def covering(self, other: Work) -> Work:
        """Return the elementwise maximum of the lengths."""
        return Work(*map(max, self, other))


def plain_source(
    functions: Iterable[Function], block: int = BLOCK, least: int = LEAST
) -> tuple[str, Work]:
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
    texts, most = [_HEAD], Work()
    for function in functions:
        name, parts = function.name(), _Parts(function, "double", block, least)
        memory = Memory(function, parts.graph, parts.count)
        texts += [
            *parts.texts,
            f"int {name}(const double **arg, double **res, long long *iw, double *w, int mem) {{",
            "  (void)iw, (void)mem;",
            *memory.pointers(),
            *parts.calls("in", "out"),
            "  return 0;",
            "}\n",
        ]
        most = most.covering(
            Work(len(parts.graph.inputs), len(parts.graph.outputs), 0, memory.size)
        )
    return "\n".join(texts), most


def external_source(functions: Sequence[Function]) -> str:
    """Return the text of `plain_source` with the functions that CasADi's `external` needs.

    Args:
        functions: Functions of scalar operations with different names.

    Raises:
        ModelError: a Function has an operation without an equivalent in C.
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
    """Return the compiler flags for C text of `plain_source`.

    Args:
        source: text of the longest C file.

    Returns:
        FLAGS, with -O1 for text of more than 100,000 lines. The values are the same.
    """
    return ("-O1" if source.count("\n") > _LONG else FLAGS[0], *FLAGS[1:])


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
        name, parts = function.name(), _Parts(function, real, BLOCK, LEAST)
        texts += [
            *parts.texts,
            f"static int {name}(const {real} **arg, {real} **res, long long *iw, {real} *w,"
            " int mem)",
            "{",
            "  (void)arg, (void)res, (void)iw, (void)w, (void)mem;",
            *parts.calls("arg", "res"),
            "  return 0;",
            "}\n",
        ]
        most = max(most, parts.count)
    return "\n".join(texts), most


def literal(value: float, real: Real) -> str:
    """Return C text of a number that a compiler reads as the nearest number of the type.

    In single precision a value other than zero remains different from zero, so that a bound such as
    1e-308 still separates positive lengths from zero.

    Args:
        value: any number, also infinity and NaN.
        real: C type of the number.
    """
    if real == "double" or not math.isfinite(value):
        return constant(Node(-1, (), float(value)))
    with np.errstate(over="ignore", under="ignore"):
        nearest = float(np.float32(value))
    if math.isinf(nearest):
        return constant(Node(-1, (), nearest))
    if value and abs(nearest) < _LEAST:
        nearest = math.copysign(_LEAST, value)
    text = str(np.float32(nearest)) + "f"
    return f"({text})" if text.startswith("-") else text


class FloatCode(BlockCode):
    """Writer of the C functions of one graph in single precision."""

    kind: ClassVar[str] = "float"
    scalar: ClassVar[str] = "float"
    zero: ClassVar[str] = "0.0f"

    def stored(self, number: int) -> str:
        """See BlockCode."""
        return _float_operand(self.graph, number)

    def number(self, number: int) -> str:
        """See BlockCode."""
        return _float_operand(self.graph, number)

    def values(self, step: Step) -> list[str]:
        """See BlockCode."""
        assert not isinstance(step, SinCosGroup)
        form = _LITERAL.sub(r"\g<0>f", _CALL.sub(r"\1f(", form_of(self.graph, step)))
        text = form.format(*(_float_operand(self.graph, n) for n in self.graph.operands(step)))
        return [f"  const float t{step} = {text};"]


def _float_operand(graph: Graph, number: int) -> str:
    text = operand(graph, number)
    return text if text[0] in "it" else literal(graph.nodes[number].value, "float")


class _Parts:
    """C functions into which a Function is split.

    Attributes:
        graph: scalar operations of the Function.
        texts: texts of the C functions.
        count: length of the work array.
    """

    def __init__(self, function: Function, real: Real, block: int, least: int) -> None:
        self.graph = graph_of(function)
        pieces = blocks(self.graph, with_calls(self.graph, plain_order(self.graph), least), block)
        where = slots(self.graph, pieces)
        code = (BlockCode if real == "double" else FloatCode)(self.graph, where, "")
        self.count = where.count
        self._names = [f"{function.name()}_part{k}" for k in range(len(pieces))]
        parts = zip(self._names, pieces, strict=True)
        self.texts = [
            *code.repeats(),
            *(code.block(name, k, steps) for k, (name, steps) in enumerate(parts)),
        ]

    def calls(self, inputs: str, outputs: str) -> list[str]:
        """Return the lines that call the parts with these arrays of pointers."""
        return [f"  {name}({inputs}, {outputs}, w);" for name in self._names]
