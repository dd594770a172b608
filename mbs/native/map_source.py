"""C text of a map: all columns by a loop, several at a time in vector lanes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import accumulate
from typing import NamedTuple, TypeAlias

import casadi

from mbs.native.lane_code import LaneCode
from mbs.native.schedule import LANES, blocks, schedule
from mbs.native.slots import slots
from mbs.native.staged import Mapped
from mbs.operations.graph import Graph, graph_of


class Place(NamedTuple):
    """Where a column goes: number of the output and of the first element in it."""

    output: int
    first: int


Columns: TypeAlias = Mapping[tuple[int, int], Place]
"""Of the inputs of a graph that are outputs of maps, the columns that are part of an output."""


def direct_columns(graph: Graph, maps: Sequence[Mapped], outputs: int) -> tuple[Columns, set[int]]:
    """The columns that need no copy, for each element of them is used once, in one output.

    Args:
        graph: the scalar operations around the maps.
        maps: give some of its inputs.
        outputs: how many of its outputs are those of the whole Function.

    Returns:
        where they go, and the nodes of their elements.
    """
    uses, node_of, places = graph.uses(), {}, {}
    for number, node in enumerate(graph.nodes):
        if node.op == casadi.OP_INPUT:
            node_of[node.args] = number
    for k, result in enumerate(graph.results[:outputs]):
        places.update({number: Place(k, element) for element, number in enumerate(result)})
    found: dict[tuple[int, int], Place] = {}
    nodes: set[int] = set()
    for m in maps:
        for k, port in enumerate(m.outputs):
            rows = m.column.nnz_out(k)
            for column in range(m.columns):
                numbers = [node_of.get((port, column * rows + row), -1) for row in range(rows)]
                at = places.get(numbers[0]) if numbers else None
                if at is None or not all(
                    uses[n] == 1 and places.get(n) == Place(at.output, at.first + row)
                    for row, n in enumerate(numbers)
                ):
                    continue
                found[port, column] = at
                nodes.update(numbers)
    return found, nodes


class MapSource(NamedTuple):
    """C text of a map.

    Attributes:
        text: functions, the last of which has the name of the map and takes `out`, the outputs of
            the scalar operations followed by those of the maps, and work space.
        work: doubles of work space.
    """

    text: str
    work: int


def map_source(
    name: str, mapped: Mapped, columns: Columns, buffers: Sequence[int], block: int
) -> MapSource:
    """The C functions of a map.

    Args:
        name: of the last of them.
        mapped: the map.
        columns: the columns that go to another place than the buffer of their output.
        buffers: for each output of the map its number in `out`.
        block: assignments in one C function.
    """
    graph = graph_of(mapped.column)
    pieces = blocks(graph, schedule(graph), block)
    where = slots(graph, pieces)
    code = LaneCode(graph, where, "mbs_sincos_wide", mapped.shared)
    sizes = [len(result) for result in graph.results]
    starts = list(accumulate(sizes, initial=where.count))
    rows = ", ".join(f"w + {start}" for start in starts[:-1])
    lines = [
        *(code.block(f"{name}_part{k}", k, steps) for k, steps in enumerate(pieces)),
        f"static NOINLINE void {name}(double *const *out, mbs_lanes *w)",
        "{",
        *_tables(mapped, columns, list(zip(buffers, sizes, strict=True))),
        f"  for (int c = 0; c < {mapped.columns}; c += MBS_LANES) {{",
        f"    const int left = {mapped.columns} - c, many = left < MBS_LANES ? left : MBS_LANES;",
        f"    const double *const in[] = {{{', '.join(_inputs(graph, mapped)) or '0'}}};",
        f"    mbs_lanes *const rows[] = {{{rows or '0'}}};",
        "    double *to[MBS_LANES];",
        *(f"    {name}_part{k}(in, rows, w);" for k in range(len(pieces))),
    ]
    for k, size in enumerate(sizes):
        lines += [
            f"    for (int l = 0; l < many; ++l) to[l] = out[place{k}[c + l].output]"
            f" + place{k}[c + l].first;",
            f"    mbs_columns(rows[{k}], {size}, many, to);",
        ]
    return MapSource("\n".join([*lines, "  }", "}"]), LANES * starts[-1])


def _tables(mapped: Mapped, columns: Columns, buffers: Sequence[tuple[int, int]]) -> list[str]:
    """Where the columns of each output go; of its buffer the number and the length of a column."""
    lines = []
    for k, (port, (buffer, size)) in enumerate(zip(mapped.outputs, buffers, strict=True)):
        places = [columns.get((port, c), Place(buffer, c * size)) for c in range(mapped.columns)]
        table = ", ".join(f"{{{place.output}, {place.first}}}" for place in places)
        lines.append(f"  static const struct {{ int output, first; }} place{k}[] = {{{table}}};")
    return lines


def _inputs(graph: Graph, mapped: Mapped) -> list[str]:
    """Where each input of a column begins."""
    result = []
    for k, port in enumerate(graph.inputs):
        text = f"out[{mapped.inputs[k]}]"
        if not mapped.shared[k]:
            size = port.sparsity.nnz() * LANES
            text += f" + c / MBS_GROUP * {size} + c % MBS_GROUP"
        result.append(text)
    return result
