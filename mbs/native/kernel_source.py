"""C text of Functions, made to run fast: straight lines in blocks, angles in vector lanes."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from importlib import resources
from itertools import accumulate

from casadi import Function

from mbs.native.block_code import BlockCode
from mbs.native.function_table import function_table
from mbs.native.map_source import direct_columns, map_source
from mbs.native.memory import Memory
from mbs.native.schedule import Batch, Step, blocks, gives, phases, schedule
from mbs.native.slots import slots
from mbs.native.staged import Mapped, Staged, staged
from mbs.operations.graph import Graph, graph_of

BLOCK = 500
"""Assignments in one C function: longer ones compile slower and run no faster."""

HEADERS = ("sincos.h", "lanes.h", "elementary.h")
"""What the text includes."""

_INLINE = 16  # batches of angles whose code stands in the function; more are called

_SHORT = 2500  # operations up to which gcc gains by reordering them before it assigns registers

_GCC = """\
#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC optimize("schedule-insns", "sched-pressure")
#endif
"""
_HEAD = """\
#include <math.h>
#include <string.h>
#include "elementary.h"
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
        functions: made of scalar operations and of maps of them, or to be expanded to them.
        block: assignments in one C function.

    Returns:
        file name to text: a C file for each Function, and what they include.

    Raises:
        ModelError: some Function has no scalar operations, or one that C does not have.
    """
    runtime = resources.files("mbs.native").joinpath("runtime")
    headers = {name: runtime.joinpath(name).read_text("utf-8") for name in HEADERS}
    return {**{f"{function.name()}.c": _file(function, block) for function in functions}, **headers}


def _file(function: Function, block: int) -> str:
    stages = staged(function) or Staged(function, ())
    graph = graph_of(stages.scalar)
    scheduling = _GCC if len(graph.nodes) <= _SHORT else ""
    return "\n".join([scheduling, _HEAD, _function(function, graph, stages.maps, block)])


def _function(function: Function, graph: Graph, maps: Sequence[Mapped], block: int) -> str:
    name = function.name()
    late = {port: k + 1 for k, m in enumerate(maps) for port in m.outputs}
    pieces = _pieces(graph, late, len(maps), block)
    begins = [0, *accumulate(map(len, pieces))]
    every = [steps for some in pieces for steps in some]
    columns, elsewhere = direct_columns(graph, maps, function.n_out())
    where = slots(graph, every, {port: begins[k] for port, k in late.items()}, elsewhere)
    batches = sum(isinstance(step, Batch) for steps in every for step in steps)
    code = BlockCode(graph, where, "mbs_sincos8" if batches <= _INLINE else "mbs_sincos8_call")
    memory = Memory(function, graph, where.count)
    sources = []
    for k, m in enumerate(maps):
        buffers = [memory.buffer(port) for port in m.outputs]
        sources.append(map_source(f"{name}_map{k}", m, columns, buffers, block))
    calls: list[str] = []
    for k in range(len(pieces)):
        calls += [f"  {name}_map{k - 1}(out, lanes);"] if k else []
        calls += [f"  {name}_part{j}(in, out, w);" for j in range(begins[k], begins[k + 1])]
    return "\n".join(
        [
            *(code.block(f"{name}_part{k}", k, steps) for k, steps in enumerate(every)),
            *(source.text for source in sources),
            f"EXPORT int {name}(const double **arg, double **res, casadi_int *iw, double *w,"
            " int mem)",
            "{",
            *memory.pointers(),
            *calls,
            "  return 0;",
            "}",
            function_table(function, memory.size + max((s.work for s in sources), default=0)),
        ]
    )


def _pieces(graph: Graph, late: dict[int, int], maps: int, block: int) -> list[list[list[Step]]]:
    """The blocks before the first map, between it and the second one, and so on."""
    phase = phases(graph, late)
    order = schedule(graph, phase)
    every: list[list[Step]] = [[] for _ in range(maps + 1)]
    for step in order:
        every[max(phase[n] for n in gives(step))].append(step)
    return [blocks(graph, steps, block) for steps in every]
