"""C text of Functions, made to run fast: straight lines in blocks, angles in vector lanes."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from importlib import resources
from itertools import groupby

from casadi import Function

from mbs.native.function_table import function_table
from mbs.native.operators import expression, operand
from mbs.native.schedule import LANES, Batch, Step, blocks, gives, needs, schedule
from mbs.native.slots import Slots, slots
from mbs.operations.graph import Graph, graph_of

BLOCK = 500
"""Assignments in one C function: longer ones compile slower and run no faster."""

_INLINE = 16  # batches of angles whose code stands in the function; more are called

_MANY_ZEROS = 4  # in a row, from which they are stored at once
_SHORT = 2500  # operations up to which gcc gains by reordering them before it assigns registers

_GCC = """\
#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC optimize("schedule-insns", "sched-pressure")
#endif
"""
_HEAD = """\
#include <math.h>
#include <string.h>
#include "sincos.h"
#define casadi_int long long int
#define NOINLINE __attribute__((noinline))
#define ALIGNED __attribute__((aligned(64)))
#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif
"""


def kernel_source(functions: Iterable[Function], block: int = BLOCK) -> dict[str, str]:
    """C files of Functions with different names, in CasADi's calling convention.

    The text is for compilers that know vector types (gcc, clang); results differ from those of
    the interpreter in the last digits.

    Args:
        functions: made of scalar operations, or to be expanded to them.
        block: assignments in one C function.

    Returns:
        file name to text: a C file for each Function, and what they include.

    Raises:
        ModelError: some Function has no scalar operations, or one that C does not have.
    """
    header = resources.files("mbs.native").joinpath("runtime/sincos.h").read_text("utf-8")
    files = {f"{function.name()}.c": _file(function, block) for function in functions}
    return {**files, "sincos.h": header}


def _file(function: Function, block: int) -> str:
    graph = graph_of(function)
    scheduling = _GCC if len(graph.nodes) <= _SHORT else ""
    return "\n".join([scheduling, _HEAD, _function(function, graph, block)])


def _function(function: Function, graph: Graph, block: int) -> str:
    name = function.name()
    order = schedule(graph)
    inline = sum(isinstance(step, Batch) for step in order) <= _INLINE
    pieces = blocks(graph, order, block)
    code = _Code(graph, slots(graph, pieces), "mbs_sincos8" if inline else "mbs_sincos8_call")
    spare = max((len(result) for result in graph.results), default=0)
    return "\n".join(
        [
            *(code.block(f"{name}_part{k}", k, steps) for k, steps in enumerate(pieces)),
            f"EXPORT int {name}(const double **arg, double **res, casadi_int *iw, double *w,"
            " int mem)",
            "{",
            *code.pointers(),
            *(f"  {name}_part{k}(in, out, w);" for k in range(len(pieces))),
            "  return 0;",
            "}",
            function_table(function, code.where.count + spare),
        ]
    )


@dataclass(frozen=True, slots=True)
class _Code:
    """The C functions of one graph.

    Attributes:
        graph: what is computed.
        where: what its blocks leave for each other.
        sincos: the C function for a batch of angles.
    """

    graph: Graph
    where: Slots
    sincos: str

    def pointers(self) -> list[str]:
        """Lines that replace what a caller left out: inputs are zero, outputs are lost."""
        graph = self.graph
        most = max((port.sparsity.nnz() for port in graph.inputs), default=0)
        inputs = (f"arg[{k}] ? arg[{k}] : zeros" for k in range(len(graph.inputs)))
        lost = f"w + {self.where.count}"
        outputs = (f"res[{k}] ? res[{k}] : {lost}" for k in range(len(graph.outputs)))
        return [
            f"  static const double zeros[{most or 1}];",
            f"  const double *const in[] = {{{', '.join(inputs) or '0'}}};",
            f"  double *const out[] = {{{', '.join(outputs) or '0'}}};",
        ]

    def block(self, name: str, number: int, steps: Sequence[Step]) -> str:
        """A C function: loads what earlier ones left, computes, stores what later ones need."""
        inputs, outputs = range(len(self.graph.inputs)), range(len(self.graph.outputs))
        lines = [
            f"static {'NOINLINE ' if self.where.blocks > 1 else ''}void {name}"
            "(const double *const *in, double *const *out, double *restrict w)",
            "{",
            *(f"  const double *restrict i{k} = in[{k}];" for k in inputs),
            *(f"  double *restrict o{k} = out[{k}];" for k in outputs),
        ]
        if number == 0:
            lines += self._stores(None)
        known: set[int] = set()
        of = self.where.of
        for step in steps:
            lines += self._loads(step, known)
            lines += self._values(step)
            known.update(gives(step))
            for n in gives(step):
                lines += [f"  w[{of[n]}] = t{n};"] if n in of else []
                lines += self._stores(n)
        return "\n".join([*lines, "}"])

    def _loads(self, step: Step, known: set[int]) -> list[str]:
        of = self.where.of
        wanted = [n for n in dict.fromkeys(needs(self.graph, step)) if n not in known and n in of]
        known.update(wanted)
        return [f"  const double t{n} = w[{of[n]}];" for n in wanted]

    def _values(self, step: Step) -> list[str]:
        if not isinstance(step, Batch):
            return [f"  const double t{step} = {expression(self.graph, step)};"]
        angles = [operand(self.graph, n) for n in step.angles]
        angles += ["0.0"] * (LANES - len(angles))
        array = f"sc{step.angles[0]}"
        return [
            f"  double {array}[{2 * LANES}] ALIGNED;",
            f"  {self.sincos}({', '.join(angles)}, {array});",
            *(f"  const double t{n} = {array}[{place}];" for n, place in step.results),
        ]

    def _stores(self, n: int | None) -> list[str]:
        """The outputs that are a node; with None those that are inputs and constants."""
        lines: list[str] = []
        for (k, text), elements in groupby(self._leaving(n), lambda row: (row[0], row[2])):
            places = [element for _, element, _ in elements]
            for first, last in _runs(places):
                target, length = f"o{k}[{first}]", last - first + 1
                if text == "0.0" and length >= _MANY_ZEROS:
                    lines.append(f"  memset(&{target}, 0, {length} * sizeof(double));")
                else:
                    lines += [f"  o{k}[{place}] = {text};" for place in range(first, last + 1)]
        return lines

    def _leaving(self, n: int | None) -> list[tuple[int, int, str]]:
        """Where a node leaves and what is written: number of the output, element, expression."""
        return [
            (k, element, operand(self.graph, node))
            for k, element, node in self.where.outputs.get(n, ())
        ]


def _runs(places: Sequence[int]) -> list[tuple[int, int]]:
    """First and last of each run of consecutive numbers."""
    runs: list[tuple[int, int]] = []
    for place in places:
        if runs and place == runs[-1][1] + 1:
            runs[-1] = (runs[-1][0], place)
        else:
            runs.append((place, place))
    return runs
