"""Shared libraries of fast code for the processor of this computer."""

from __future__ import annotations

import functools
import hashlib
import os
import platform
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from importlib import resources
from importlib.resources.abc import Traversable
from itertools import accumulate
from pathlib import Path
from typing import NamedTuple, TypeAlias

import casadi
from casadi import Function

from mbs.errors import ModelError
from mbs.native.c_code import (
    BLOCK,
    LANES,
    BlockCode,
    Item,
    LaneCode,
    SinCosGroup,
    Step,
    blocks,
    gives,
    phases,
    schedule,
    slots,
)
from mbs.native.compiler import (
    BUILD,
    cache_dir,
    cached_library,
    chosen_flags,
    find_compiler,
    is_whole,
)
from mbs.native.frames import (
    EXPORT,
    HEAD,
    GraphCode,
    Memory,
    entry,
    function_table,
    lane_loop,
    pointers,
)
from mbs.native.repeats import with_calls
from mbs.native.staged import Mapped, StagedFunction, staged
from mbs.operations.graph import Graph, graph_of

# C code of a map: a loop over all columns, several columns at a time in SIMD lanes.


class OutputSlot(NamedTuple):
    """Destination of a column: index of the output and index of its first element there."""

    output: int
    first: int


Columns: TypeAlias = Mapping[tuple[int, int], OutputSlot]
"""Destinations of map columns: (graph input that is a map result, column index) to its place in
an output. Only columns that are copied unchanged to an output are in the table."""


def direct_columns(graph: Graph, maps: Sequence[Mapped], outputs: int) -> tuple[Columns, set[int]]:
    """Return the columns of maps that can be written directly to an output of the Function.

    Each element of such a column is used only once: as an element of that output.

    Args:
        graph: graph of the scalar operations around the maps.
        maps: maps, whose results are inputs of the graph.
        outputs: number of graph outputs that are outputs of the whole Function.

    Returns:
        destination of each such column, and the graph nodes of their elements.
    """
    uses, node_of, places = graph.uses(), {}, {}
    for number, node in enumerate(graph.nodes):
        if node.op == casadi.OP_INPUT:
            node_of[node.args] = number
    for k, result in enumerate(graph.results[:outputs]):
        places.update({number: OutputSlot(k, element) for element, number in enumerate(result)})
    found: dict[tuple[int, int], OutputSlot] = {}
    nodes: set[int] = set()
    for m in maps:
        for k, port in enumerate(m.outputs):
            rows = m.column.nnz_out(k)
            for column in range(m.columns):
                numbers = [node_of.get((port, column * rows + row), -1) for row in range(rows)]
                at = places.get(numbers[0]) if numbers else None
                if at is None or not all(
                    uses[n] == 1 and places.get(n) == OutputSlot(at.output, at.first + row)
                    for row, n in enumerate(numbers)
                ):
                    continue
                found[port, column] = at
                nodes.update(numbers)
    return found, nodes


class MapSource(NamedTuple):
    """C code of a map.

    Attributes:
        text: C functions. The last function has the name of the map. Its arguments are the pointer
            array `out` (outputs of the Function, then arguments and results of the maps) and the
            work space.
        work: length of the work space in doubles.
    """

    text: str
    work: int


def map_source(
    name: str, mapped: Mapped, columns: Columns, buffers: Sequence[int], block: int
) -> MapSource:
    """Return the C functions of a map.

    Args:
        name: name of the last C function.
        mapped: map to write.
        columns: columns that are written to an output instead of the buffer of the map result.
        buffers: index in `out` of the buffer of each map output.
        block: maximum number of assignments in a C function.
    """
    graph = graph_of(mapped.column)
    pieces = blocks(graph, schedule(graph), block)
    where = slots(graph, pieces)
    body = GraphCode(
        name, LaneCode(graph, where, "mbs_sincos_wide", mapped.shared, "MBS_ROW"), pieces
    )
    sizes = [len(result) for result in graph.results]
    starts = list(accumulate(sizes, initial=where.count))
    once = [
        pointers("const double", "in", _inputs(graph, mapped)),
        pointers("mbs_lanes", "rows", [f"w + {start}" for start in starts[:-1]]),
        "  double *to[MBS_LANES];",
        *body.calls(outputs="rows"),
    ]
    for k, size in enumerate(sizes):
        once += [
            f"  for (int l = 0; l < many; ++l) to[l] = out[place{k}[c + l].output]"
            f" + place{k}[c + l].first;",
            f"  mbs_columns(rows[{k}], {size}, many, to);",
        ]
    lines = [
        *body.texts(),
        f"static NOINLINE void {name}(double *const *out, mbs_lanes *w)",
        "{",
        *_tables(mapped, columns, list(zip(buffers, sizes, strict=True))),
        *lane_loop("0", str(mapped.columns), once),
        "}",
    ]
    return MapSource("\n".join(lines), LANES * starts[-1])


def _tables(mapped: Mapped, columns: Columns, buffers: Sequence[tuple[int, int]]) -> list[str]:
    """Return C tables with the destination of each column, for each output of a map.

    `columns` are the columns that are written to an output directly. `buffers` contains the index
    in `out` and the column length of each output of the map.
    """
    lines = []
    for k, (port, (buffer, size)) in enumerate(zip(mapped.outputs, buffers, strict=True)):
        places = [
            columns.get((port, c), OutputSlot(buffer, c * size)) for c in range(mapped.columns)
        ]
        table = ", ".join(f"{{{place.output}, {place.first}}}" for place in places)
        lines.append(f"  static const struct {{ int output, first; }} place{k}[] = {{{table}}};")
    return lines


def _inputs(graph: Graph, mapped: Mapped) -> list[str]:
    """Return C expressions of the pointers to the inputs of a map, at the columns that start at c.

    `graph` is the graph of one column, `mapped` the map.
    """
    result = []
    for k, port in enumerate(graph.inputs):
        text = f"out[{mapped.inputs[k]}]"
        if not mapped.shared[k]:
            size = port.sparsity.nnz() * LANES
            text += f" + c / MBS_GROUP * {size} + c % MBS_GROUP"
        result.append(text)
    return result


# Fast C code of Functions: straight-line code in blocks, sines and cosines in SIMD lanes.


HEADERS = ("sincos.h", "lanes.h", "elementary.h")
"""Headers that the C text includes."""

_INLINE = 16  # sine and cosine batches up to which their code is inlined; else it is called

_SHORT = 2500  # operations up to which gcc gains by reordering them before register allocation

_GCC = """\
#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC optimize("schedule-insns", "sched-pressure")
#endif
"""
_HEAD = f"""\
{HEAD}\
#include "elementary.h"
#define ALIGNED __attribute__((aligned(64)))
{EXPORT}"""


def kernel_source(functions: Iterable[Function], block: int = BLOCK) -> dict[str, str]:
    """Return C files of Functions with different names, in CasADi's calling convention.

    The text requires a compiler with vector types (gcc, clang). Results differ from the
    interpreter in the last digits.

    Args:
        functions: Functions of scalar operations and maps of them, or expandable to such.
        block: maximum number of assignments in a C function.

    Returns:
        file name to text: a C file for each Function, and the headers that they include.

    Raises:
        ModelError: a Function does not consist of scalar operations, or C lacks an operation.
    """
    runtime = resources.files("mbs.native").joinpath("runtime")
    headers = {name: runtime.joinpath(name).read_text("utf-8") for name in HEADERS}
    return {**{f"{function.name()}.c": _file(function, block) for function in functions}, **headers}


def _file(function: Function, block: int) -> str:
    """Return text of the C file of a Function, with at most `block` assignments per C function."""
    stages = staged(function) or StagedFunction(function, ())
    graph = graph_of(stages.scalar)
    scheduling = _GCC if len(graph.nodes) <= _SHORT else ""
    return "\n".join([scheduling, _HEAD, *_function(function, graph, stages.maps, block)])


def _function(function: Function, graph: Graph, maps: Sequence[Mapped], block: int) -> list[str]:
    """Return the C functions of a Function: its scalar operations, its maps, and its entry.

    `graph` contains the scalar operations; `block` is the maximum of assignments per C function.
    """
    name = function.name()
    late = {port: k + 1 for k, m in enumerate(maps) for port in m.outputs}
    pieces = _blocks_between_maps(graph, late, len(maps), block)
    begins = [0, *accumulate(map(len, pieces))]
    every = [steps for some in pieces for steps in some]
    columns, elsewhere = direct_columns(graph, maps, function.n_out())
    where = slots(graph, every, {port: begins[k] for port, k in late.items()}, elsewhere)
    batches = sum(isinstance(step, SinCosGroup) for steps in every for step in steps)
    sincos = "mbs_sincos8" if batches <= _INLINE else "mbs_sincos8_call"
    body = GraphCode(name, BlockCode(graph, where, sincos), every)
    memory = Memory(function, graph, where.count)
    sources = []
    for k, m in enumerate(maps):
        buffers = [memory.buffer(port) for port in m.outputs]
        sources.append(map_source(f"{name}_map{k}", m, columns, buffers, block))
    calls: list[str] = []
    for k in range(len(pieces)):
        calls += [f"  {name}_map{k - 1}(out, lanes);"] if k else []
        calls += body.calls(range(begins[k], begins[k + 1]))
    return [
        *body.texts(),
        *(source.text for source in sources),
        *entry(name, [*memory.declarations(), *calls], "EXPORT "),
        function_table(function, memory.size + max((s.work for s in sources), default=0)),
    ]


def _blocks_between_maps(
    graph: Graph, late: dict[int, int], maps: int, block: int
) -> list[list[list[Item]]]:
    """Return the blocks before the first map, between the first and the second map, and so on.

    `late` maps a graph input to the number of maps after which it is known.
    """
    phase = phases(graph, late)
    order = schedule(graph, phase)
    every: list[list[Step]] = [[] for _ in range(maps + 1)]
    for step in order:
        every[max(phase[n] for n in gives(step))].append(step)
    # recurring sequences need all inputs from the start, but map results are known later
    return [blocks(graph, steps if maps else with_calls(graph, steps), block) for steps in every]


_NATIVE = "-march=native" if platform.machine().lower() in ("x86_64", "amd64") else "-mcpu=native"
FAST_FLAGS = (
    "-O2",
    _NATIVE,
    "-ffp-contract=fast",
    "-fno-math-errno",
    "-fno-tree-slp-vectorize",
    "-Wno-psabi",
    "-fPIC",
    "-shared",
)
"""Flags of fast code. Contraction permits fused multiply-add. Nothing is assumed about NaN."""


class LoopCode(NamedTuple):
    """C code of a model that loops over its links, instead of written-out equations.

    Attributes:
        files: file name to text, for `FAST_FLAGS`.
        common: names of C files that many libraries contain.
        value: whether the code contains the Function itself.
        jacobian: whether the code contains the Jacobian `jac_f`.
        by_parameters: whether `jac_f` calls `byp_f` for the derivatives with respect to the last
            input. The code does not contain `byp_f`.
    """

    files: Mapping[str, str]
    common: Sequence[str]
    value: bool
    jacobian: bool
    by_parameters: bool

    def library(self, further: Mapping[str, str]) -> Path:
        """Return the library of this code and of additional C files.

        Args:
            further: file name to text of the additional files.

        Raises:
            CompilerError: there is no compiler, or it rejects the code.
        """
        return cached_library({**self.files, **further}, FAST_FLAGS, common=self.common)


def kernel_library(
    functions: Sequence[Function], further: Mapping[str, str] | None = None
) -> Path | None:
    """Return the library of fast code of Functions with different names.

    Args:
        functions: Functions to compile.
        further: additional files of the library: file name to text.

    Returns:
        path of the library; None if a Function does not consist of scalar operations with C
        equivalents and of maps of such operations.

    Raises:
        CompilerError: there is no compiler, or it rejects the code.
    """
    try:
        files = kernel_source(functions)
    except ModelError:
        return None
    notes = {"processor.h": f"/* {processor()} */\n"}
    return cached_library({**files, **(further or {}), **notes}, FAST_FLAGS)


@functools.cache
def processor() -> str:
    """Return text that identifies model and features of the processor of this computer.

    Fast code is valid only on processors with an equal text.
    """
    try:
        lines = Path("/proc/cpuinfo").read_text("utf-8", "replace").splitlines()
    except OSError:
        return f"{platform.processor()} of {platform.node()}"
    keys = ("model name", "flags", "Features", "CPU part", "CPU architecture")
    return " ".join(dict.fromkeys(line for line in lines if line.startswith(keys)))


# Index of the cache: finds the library of a Function without writing its C text again.
#
# Writing the text of a Function and its derivatives may take far longer than loading the library.
# A small file contains the name of the library. It is named by a hash of the serialised Function
# and of everything else that determines the text.


_SUFFIX = ".library"
_SOURCES = (".py", ".h", ".c")


def index_key(function: casadi.Function, options: str) -> tuple[str, str] | None:
    """Return the key of a Function in the index of the cache, and its serialised text.

    Args:
        function: Function to compile.
        options: text that distinguishes different libraries of the same Function.

    Returns:
        key and text; None if the Function contains a callback, which cannot be serialised.
    """
    try:
        text = function.serialize()
    except (RuntimeError, NotImplementedError):
        return None
    return _index_key(text, options), text


def indexed_library(key: str, make: Callable[[], Path | None]) -> Path | None:
    """Return the library with a key from the cache, or make it and store the key.

    Several processes may call this at once. A damaged or deleted library is made again.

    Args:
        key: key from `index_key`.
        make: callable that writes and compiles the library. It returns None if that is
            impossible, which is not stored.

    Returns:
        path of the library; None if `make` returns None.
    """
    folder = cache_dir()
    entry = folder / f"{key}{_SUFFIX}"
    known = _indexed_library(entry)
    if known is not None:
        return known
    library = make()
    if library is not None and library.parent == folder:
        _write_entry(entry, library.name)
    return library


def _indexed_library(entry: Path) -> Path | None:
    """Return the library that an index entry names; None if a file is missing or damaged."""
    try:
        name = entry.read_text("utf-8")
        library = entry.parent / name
        return library if Path(name).name == name and is_whole(library) else None
    except (OSError, ValueError):
        return None


def _write_entry(entry: Path, name: str) -> None:
    """Write the library name to an index entry; if that fails, the C text is generated again."""
    try:
        with tempfile.TemporaryDirectory(dir=entry.parent, prefix=BUILD) as folder:
            written = Path(folder) / entry.name
            written.write_text(name, encoding="utf-8")
            os.replace(written, entry)
    except OSError:  # the disk is full, or another process holds the entry open
        return


def _index_key(text: str, options: str) -> str:
    """Return hash of compiler, flags, generator, processor, `options` and the Function `text`."""
    compiler = find_compiler()
    facts = (casadi.CasadiMeta.version(), *compiler.command, compiler.version, processor())
    digest = hashlib.sha256()
    for part in (*facts, *chosen_flags(FAST_FLAGS), _generator_hash(), options, text):
        digest.update(part.encode())
        digest.update(b"\0")
    return digest.hexdigest()[:40]


@functools.cache
def _generator_hash() -> str:
    """Return a hash of the files of the code generator, as part of cache keys."""
    digest = hashlib.sha256()
    for package in ("mbs.native", "mbs.operations"):
        for name, data in sorted(_files(resources.files(package), package)):
            digest.update(name.encode() + b"\0" + data + b"\0")
    return digest.hexdigest()


def _files(folder: Traversable, path: str) -> Iterator[tuple[str, bytes]]:
    """Yield path and content of the source files in a folder and its subfolders."""
    for item in folder.iterdir():
        if item.is_dir() and item.name != "__pycache__":
            yield from _files(item, f"{path}/{item.name}")
        elif item.name.endswith(_SOURCES):
            yield f"{path}/{item.name}", item.read_bytes()
