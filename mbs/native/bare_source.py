"""C99 text of Functions for processors without heap and files, in double or single precision.

In double precision the numbers are those of CasADi's own text, to the last bit.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from typing import ClassVar, Literal

import numpy as np
from casadi import Function

from mbs.native.c_code import (
    BlockCode,
    SinCosGroup,
    Step,
    blocks,
    constant,
    form_of,
    operand,
    plain_order,
    slots,
)
from mbs.native.kernel import BLOCK
from mbs.native.repeats import with_calls
from mbs.operations.graph import Graph, Node, graph_of

Real = Literal["double", "float"]
"""The C type of numbers."""

Target = Literal["hosted", "bare"]
"""What C is for: an operating system, or none."""

_CALL = re.compile(r"\b([a-z]\w*)\(")
_LITERAL = re.compile(r"\b\d+\.\d+\b")
_LEAST = float(np.finfo(np.float32).tiny)

NOINLINE = """\
#undef NOINLINE
#ifdef __GNUC__
#define NOINLINE __attribute__((noinline))
#else
#define NOINLINE
#endif
#if defined __cplusplus || (defined _MSC_VER && !defined __clang__)
#undef restrict
#define restrict __restrict
#endif
"""
"""What stands before such text: parts of long functions stay apart, and compilers of C++ and old
ones know `restrict` by another name."""


class FloatCode(BlockCode):
    """The C functions of one graph in single precision."""

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


def bare_source(functions: Iterable[Function], real: Real = "double") -> tuple[str, int]:
    """Functions in CasADi's calling convention, static, without a word on CasADi.

    Each is ``static int NAME(const REAL **arg, REAL **res, long long *iw, REAL *w, int mem)``,
    where no pointer in `arg` and `res` may be NULL and `iw` is not looked at. It calls the
    functions of math.h, memset and memcpy at most.

    Args:
        functions: made of scalar operations, or to be expanded to them, their inputs and outputs
            dense.
        real: type of numbers.

    Returns:
        the text, and how many numbers w must have for each of them.

    Raises:
        ModelError: some Function calls another that has no scalar operations, or has an operation
            that C does not have.
    """
    texts, most = [], 1
    for function in functions:
        text, size = _function(function, real)
        texts.append(text)
        most = max(most, size)
    return "\n".join(texts), most


def literal(value: float, real: Real) -> str:
    """A number as C reads it back to the last bit of its type.

    In single precision what is no zero stays none: where a length must be more than zero, a bound
    of 1e-308 shows it.

    Args:
        value: any, also one that is not finite.
        real: type of the number.
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


def _float_operand(graph: Graph, number: int) -> str:
    text = operand(graph, number)
    return text if text[0] in "it" else literal(graph.nodes[number].value, "float")


def _function(function: Function, real: Real) -> tuple[str, int]:
    name, graph = function.name(), graph_of(function)
    pieces = blocks(graph, with_calls(graph, plain_order(graph)), BLOCK)
    where = slots(graph, pieces)
    code = (BlockCode if real == "double" else FloatCode)(graph, where, "")
    text = "\n".join(
        [
            *code.repeats(),
            *(code.block(f"{name}_part{k}", k, steps) for k, steps in enumerate(pieces)),
            f"static int {name}(const {real} **arg, {real} **res, long long *iw, {real} *w,"
            " int mem)",
            "{",
            "  (void)arg, (void)res, (void)iw, (void)w, (void)mem;",
            *(f"  {name}_part{k}(arg, res, w);" for k in range(len(pieces))),
            "  return 0;",
            "}\n",
        ]
    )
    return text, where.count
