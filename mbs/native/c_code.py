"""Writes C code for operation graphs, on scalars of type double or float, or on SIMD lanes."""

from __future__ import annotations

import math
import re
from bisect import bisect_right
from collections import Counter
from collections.abc import Callable, Container, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import accumulate, chain, groupby, pairwise
from typing import ClassVar, Literal, Self, TypeAlias

import casadi
import numpy as np

from mbs.errors import ModelError
from mbs.native.repeats import Calls, CallTable, Repeat, table_of
from mbs.operations.graph import Graph, Node
from mbs.operations.text import CODES, NAMES
from mbs.text import in_c_comment

# A single operation of a graph as a C expression, on scalars and on SIMD vectors.


_OF_TWO = ("fmod", "remainder", "copysign", "fmin", "fmax", "atan2", "hypot")
_OF_ONE = (
    *("exp", "log", "sqrt", "sin", "cos", "tan", "asin", "acos", "atan", "floor", "ceil"),
    *("fabs", "erf", "sinh", "cosh", "tanh", "asinh", "acosh", "atanh", "log1p", "expm1"),
)
BINARY: Mapping[int, str] = {
    casadi.OP_ADD: "{} + {}",
    casadi.OP_SUB: "{} - {}",
    casadi.OP_MUL: "{} * {}",
    casadi.OP_DIV: "{} / {}",
    casadi.OP_LT: "{} < {}",
    casadi.OP_LE: "{} <= {}",
    casadi.OP_EQ: "{} == {}",
    casadi.OP_NE: "{} != {}",
    casadi.OP_AND: "{} && {}",
    casadi.OP_OR: "{} || {}",
    casadi.OP_IF_ELSE_ZERO: "{} ? {} : 0.0",
    casadi.OP_POW: "pow({}, {})",
    casadi.OP_CONSTPOW: "pow({}, {})",
    **{CODES[name]: f"{name}({{}}, {{}})" for name in _OF_TWO},
}
"""C expression templates of the operations with two operands, by CasADi operation code."""

_UNARY: Mapping[int, str] = {
    casadi.OP_ASSIGN: "{0}",
    casadi.OP_NEG: "-{0}",
    casadi.OP_SQ: "{0} * {0}",
    casadi.OP_TWICE: "{0} + {0}",
    casadi.OP_INV: "1.0 / {0}",
    casadi.OP_NOT: "!{0}",
    casadi.OP_SIGN: "({0} > 0.0 ? 1.0 : {0} < 0.0 ? -1.0 : {0})",
    **{CODES[name]: f"{name}({{0}})" for name in _OF_ONE},
}


ELEMENTWISE = frozenset((*BINARY, *_UNARY))
"""CasADi operation codes that have a C expression."""

_SIGNS_OF_VECTORS = ("add", "sub", "mul", "div", "assign", "neg", "sq", "twice", "inv")
_IN_EACH_LANE = ("erf", "asinh", "acosh", "atanh", "log1p")
VECTORS: Mapping[int, str] = {
    **{
        op: f"mbs_each_{NAMES[op]}" if NAMES[op] in _IN_EACH_LANE else f"mbs_{NAMES[op]}"
        for op in ELEMENTWISE - {CODES[name] for name in (*_SIGNS_OF_VECTORS, "sin", "cos")}
    },
    casadi.OP_CONSTPOW: "mbs_pow",
}
"""C functions of elementary.h for the operations on vectors that have no C operator, by operation
code. The sine and cosine of one angle are computed together and are not in this table."""


def expression(
    graph: Graph, number: int, written: Callable[[Graph, int], str] | None = None
) -> str:
    """Return the C expression of a node.

    Args:
        graph: operation graph that contains the node.
        number: index of the node.
        written: callable (graph, node index) -> C text of an operand. Default: `operand`.

    Raises:
        ModelError: the operation has no equivalent in the C library.
    """
    write = written or operand
    return form_of(graph, number).format(*(write(graph, n) for n in graph.operands(number)))


def form_of(graph: Graph, number: int) -> str:
    """Return the C expression of a node, with `str.format` placeholders for its operands.

    Args:
        graph: operation graph that contains the node.
        number: index of the node.

    Raises:
        ModelError: the operation has no equivalent in the C library.
    """
    op = graph.nodes[number].op
    form = BINARY.get(op) or _UNARY.get(op)
    if form is None:
        raise ModelError(
            f"{graph.name}: operation {op} of CasADi has no C equivalent; compile without fast"
        )
    return form


def operand(graph: Graph, number: int) -> str:
    """Return the C text of a node as an operand: array element, constant or variable name.

    Args:
        graph: operation graph that contains the node.
        number: index of the node.
    """
    node = graph.nodes[number]
    if node.op == casadi.OP_INPUT:
        return f"i{node.args[0]}[{node.args[1]}]"
    return constant(node) if node.op == casadi.OP_CONST else f"t{number}"


def constant(node: Node) -> str:
    """Return the C literal of a constant. C reads exactly the same double.

    Args:
        node: node whose value is written.
    """
    if math.isnan(node.value):
        return "NAN"
    if math.isinf(node.value):
        return "INFINITY" if node.value > 0 else "(-INFINITY)"
    text = repr(node.value)
    return f"({text})" if text.startswith("-") else text


# Order of the operations in C: sines and cosines as early as possible, in blocks.


LANES = 8
"""Angles whose sines and cosines are computed at once, in one batch."""

BLOCK = 500
"""Maximum assignments in a C function: longer functions compile slower and run no faster."""

_ONE_PIECE = 4000  # operations up to which a single C function compiles fast and runs fastest
_BATCH_SIZE = 50  # operations that take as long to compile as one sine and cosine batch

_FREE = (casadi.OP_INPUT, casadi.OP_CONST)


@dataclass(frozen=True, slots=True)
class SinCosGroup:
    """Batch of up to LANES angles whose sines and cosines are computed at once.

    Attributes:
        angles: node indices of the angles, at most LANES.
        results: pairs of node index and element of the result array. The sine of angle `lane` is
            element `lane`, the cosine is element LANES + lane.
    """

    angles: tuple[int, ...]
    results: tuple[tuple[int, int], ...]

    def taken(self) -> tuple[int, ...]:
        """Return the node indices of the operands."""
        return self.angles

    def given(self) -> tuple[int, ...]:
        """Return the node indices of the results."""
        return tuple(number for number, _ in self.results)


Step: TypeAlias = int | SinCosGroup
"""Index of a node that is computed by its own operation, or a sine and cosine batch."""

Item: TypeAlias = Step | Calls
"""Step of the schedule, or consecutive calls of a recurring sequence of steps."""


def schedule(graph: Graph, phase: Sequence[int] | None = None) -> list[Step]:
    """Return all steps that the outputs need, in an executable order.

    Sines and cosines are grouped into batches. The batches whose angles depend on inputs only are
    first, then the batches that depend on these results, and so on. The remaining nodes follow in
    the order of the graph.

    Args:
        graph: operation graph.
        phase: phase of each node, from `phases`. Nodes of different phases share no batch.
    """
    phase = phase or [0] * len(graph.nodes)
    pending = graph.live()
    for number, node in enumerate(graph.nodes):
        pending[number] = pending[number] and node.op not in _FREE
    steps: list[Step] = []
    for batches in _batches(graph, pending, phase):
        angles = [angle for batch in batches for angle in batch.angles]
        steps += _pending_among(_ancestors(graph, angles, pending), pending)
        for batch in batches:
            steps.append(batch)
            for number, _ in batch.results:
                pending[number] = False
    return [*steps, *_pending_among(range(len(graph.nodes)), pending)]


def plain_order(graph: Graph) -> list[Step]:
    """Return the computed nodes that the outputs need, in the order of the graph.

    Args:
        graph: operation graph.
    """
    live = graph.live()
    return [k for k, node in enumerate(graph.nodes) if live[k] and node.op not in _FREE]


def phases(graph: Graph, late: Mapping[int, int]) -> list[int]:
    """Return the first phase in which each node can be computed.

    Args:
        graph: operation graph.
        late: input index to the phase from which the input is known. Other inputs have phase 0.
    """
    phase: list[int] = []
    for number, node in enumerate(graph.nodes):
        if node.op == casadi.OP_INPUT:
            phase.append(late.get(node.args[0], 0))
        else:
            phase.append(max((phase[k] for k in graph.operands(number)), default=0))
    return phase


def blocks(graph: Graph, steps: Sequence[Item], size: int) -> list[list[Item]]:
    """Split steps into blocks of about `size` operations. Short graphs are one block.

    Args:
        graph: operation graph.
        steps: steps in order of execution.
        size: number of operations of a block, which becomes a C function.

    Returns:
        Steps of each block.
    """
    leaves = Counter(number for result in graph.results for number in result)
    ends = list(accumulate(_weight(step, leaves) for step in steps))
    total = ends[-1] if ends else 0
    one = total <= _ONE_PIECE and leaves.total() <= size
    pieces = 1 if one else round(total / size) or 1
    cuts = [bisect_right(ends, total * k // pieces) for k in range(pieces)]
    return [list(steps[a:b]) for a, b in pairwise([*cuts, len(steps)])]


def _weight(step: Item, leaves: Mapping[int, int]) -> int:
    """Return the number of C lines of a step, or of lines that compile in the same time.

    `leaves` counts the output elements of each node. Outputs that a recurring sequence computes are
    copied by a table and add nothing.
    """
    if isinstance(step, Calls):
        return 2
    size = _BATCH_SIZE if isinstance(step, SinCosGroup) else 1
    return size + sum(leaves[n] for n in gives(step))


def needs(graph: Graph, step: Item) -> tuple[int, ...]:
    """Return the node indices of the operands of a step.

    Args:
        graph: operation graph.
        step: node index, sine and cosine batch, or calls of a recurring sequence.
    """
    return graph.operands(step) if isinstance(step, int) else step.taken()


def gives(step: Item) -> tuple[int, ...]:
    """Return the node indices that a step computes.

    Args:
        step: node index, sine and cosine batch, or calls of a recurring sequence.
    """
    return (step,) if isinstance(step, int) else step.given()


def _pending_among(numbers: Iterable[int], pending: list[bool]) -> list[int]:
    """Return the nodes of `numbers` that are pending, and clear their flags in `pending`."""
    taken = [number for number in numbers if pending[number]]
    for number in taken:
        pending[number] = False
    return taken


def _ancestors(graph: Graph, numbers: Iterable[int], pending: Sequence[bool]) -> list[int]:
    """Return the pending nodes of `numbers` and all pending nodes they depend on, sorted."""
    needed: set[int] = set()
    stack = list(numbers)
    while stack:
        number = stack.pop()
        if pending[number] and number not in needed:
            needed.add(number)
            stack += graph.operands(number)
    return sorted(needed)


def _batches(graph: Graph, alive: Sequence[bool], phase: Sequence[int]) -> list[list[SinCosGroup]]:
    """Return the sine and cosine batches, grouped by phase and by depth of nested sines.

    `alive` masks the nodes to compute; `phase` is the phase of each node.
    """
    depth = [0] * len(graph.nodes)
    levels: dict[tuple[int, int], dict[int, list[tuple[int, int]]]] = {}
    for number, node in enumerate(graph.nodes):
        operands = graph.operands(number)
        depth[number] = max((depth[k] for k in operands), default=0)
        if node.op in (casadi.OP_SIN, casadi.OP_COS) and alive[number]:
            part = 0 if node.op == casadi.OP_SIN else LANES
            angles = levels.setdefault((phase[number], depth[number]), {})
            angles.setdefault(operands[0], []).append((number, part))
            depth[number] += 1
    return [_lane_batches(levels[level]) for level in sorted(levels)]


def _lane_batches(angles: dict[int, list[tuple[int, int]]]) -> list[SinCosGroup]:
    """Return batches of up to LANES angles.

    `angles` maps the node of an angle to its results: node and 0 for the sine, LANES for the
    cosine.
    """
    result = []
    every = list(angles.items())
    for k in range(0, len(every), LANES):
        some = every[k : k + LANES]
        places = [
            (number, part + lane) for lane, (_, uses) in enumerate(some) for number, part in uses
        ]
        result.append(SinCosGroup(tuple(angle for angle, _ in some), tuple(places)))
    return result


# Work array: values that a block computes and later blocks need.


Leaving: TypeAlias = tuple[int, int, int]
"""Element of an output: index of the output, index of the element in it, index of the node."""


@dataclass(frozen=True, slots=True)
class Slots:
    """Layout of the work array that the blocks of a graph share.

    Attributes:
        of: node index to the C text of its index in the work array, for the nodes that are used
            outside their block.
        outputs: node index to the output elements that the node is stored to.
        copied: block index to the output elements that are inputs or constants, copied there.
        count: length of the work array.
        blocks: number of blocks.
        inputs: input index to the first index of its copy in the work array, for the inputs that
            recurring sequences read.
        tables: index tables of the calls of each recurring sequence.
        last: output elements that recurring sequences compute: index of the output, index of the
            element in it, index in the work array.
    """

    of: Mapping[int, str]
    outputs: Mapping[int, Sequence[Leaving]]
    copied: Mapping[int, Sequence[Leaving]]
    count: int
    blocks: int
    inputs: Mapping[int, int] = field(default_factory=dict)
    tables: Mapping[Repeat, CallTable] = field(default_factory=dict)
    last: Sequence[tuple[int, int, int]] = ()


def slots(
    graph: Graph,
    blocks: Sequence[Sequence[Item]],
    begins: Mapping[int, int] | None = None,
    elsewhere: Container[int] = (),
) -> Slots:
    """Assign a work array index to each value that is used outside its block.

    The index is free again after the last use of the value.

    Args:
        graph: operation graph.
        blocks: steps of each block, in order.
        begins: input index to the first block in which the input is known. Default: block 0.
            Recurring sequences cannot read such inputs.
        elsewhere: nodes of inputs that are written to the outputs without a copy.
    """
    home = {n: k for k, steps in enumerate(blocks) for step in steps for n in gives(step)}
    calls = [step for steps in blocks for step in steps if isinstance(step, Calls)]
    inputs, first = _input_places(graph, calls)
    of, count = _places(graph, blocks, home, first)
    outputs: dict[int, list[Leaving]] = {}
    copied: dict[int, list[Leaving]] = {}
    last: list[tuple[int, int, int]] = []
    stored = {n for step in calls for n in step.given()}
    for k, nodes in enumerate(graph.results):
        for element, n in enumerate(nodes):
            if n in stored:
                last.append((k, element, of[n]))
            elif n in home:
                outputs.setdefault(n, []).append((k, element, n))
            elif n not in elsewhere:
                copied.setdefault(_first_block(graph, n, begins or {}), []).append((k, element, n))

    def place(n: int) -> int:
        if n in of:
            return of[n]
        port, element = graph.nodes[n].args
        return inputs[port] + element

    repeats = dict.fromkeys(step.repeat for step in calls)
    tables = {repeat: table_of(repeat, place) for repeat in repeats}
    texts = {n: str(k) for n, k in of.items()}
    return Slots(texts, outputs, copied, count, len(blocks), inputs, tables, last)


def _input_places(graph: Graph, calls: Sequence[Calls]) -> tuple[dict[int, int], int]:
    """Return the offset in the work array of each input of `graph` that recurring sequences read.

    The second result is the total length of these inputs.

    `calls` are the calls of the sequences.
    """
    repeats = {step.repeat for step in calls}
    taken = {n for repeat in repeats for column in repeat.taken for n in column.nodes}
    nodes = (graph.nodes[n] for n in taken)
    ports = sorted({node.args[0] for node in nodes if node.op == casadi.OP_INPUT})
    ends = list(accumulate((graph.inputs[k].sparsity.nnz() for k in ports), initial=0))
    return dict(zip(ports, ends, strict=False)), ends[-1]


def _places(
    graph: Graph, blocks: Sequence[Sequence[Item]], home: Mapping[int, int], count: int
) -> tuple[dict[int, int], int]:
    """Return the work array index of each node that is used outside its block, and the length.

    The results of an occurrence of a recurring sequence are contiguous. Lifetimes are counted in
    a time that increases from block to block and at each `Calls` step.

    Args:
        graph: operation graph.
        blocks: steps of each block, in order.
        home: node index to the index of the block that computes it.
        count: number of work array elements that are already in use.
    """
    results = {n for result in graph.results for n in result}
    together: dict[int, tuple[int, ...]] = {}  # node to all results of its occurrence (contiguous)
    born: dict[int, int] = {}
    last: dict[int, int] = {}
    time = 0
    for k, steps in enumerate(blocks):
        for step in steps:
            if isinstance(step, Calls):
                time += 1
                last.update(dict.fromkeys(step.taken(), time))
                for occurrence in range(step.first, step.first + step.count):
                    nodes = step.gives(occurrence)
                    together.update(dict.fromkeys(nodes, nodes))
                    last.update(dict.fromkeys(nodes, time))
            else:
                near = (n for n in needs(graph, step) if n in together or home.get(n, k) < k)
                last.update(dict.fromkeys(near, time))
            born.update(dict.fromkeys(gives(step), time))
            time += isinstance(step, Calls)
        time += 1
    last.update((n, time) for n in together if n in results)
    starts: list[list[tuple[int, ...]]] = [[] for _ in range(time + 1)]
    ends: list[list[tuple[int, ...]]] = [[] for _ in range(time + 1)]
    for nodes in dict.fromkeys(together.get(n, (n,)) for n in sorted(last) if n in home):
        starts[born[nodes[0]]].append(nodes)
        ends[max(last[n] for n in nodes)].append(nodes)
    of: dict[int, int] = {}
    free: dict[int, list[int]] = {}
    for entering, leaving in zip(starts, ends, strict=True):
        for nodes in entering:
            same = free.get(len(nodes))
            first = same.pop() if same else count
            count += 0 if first < count else len(nodes)
            of.update((n, first + k) for k, n in enumerate(nodes))
        for nodes in leaving:
            free.setdefault(len(nodes), []).append(of[nodes[0]])
    return of, count


def _first_block(graph: Graph, number: int, begins: Mapping[int, int]) -> int:
    """Return the index of the first block in which the input or constant `number` is known.

    `begins` is as in `slots`.
    """
    node = graph.nodes[number]
    return begins.get(node.args[0], 0) if node.op == casadi.OP_INPUT else 0


_POINTERS = re.compile(r"\b[io]\d+\b")  # C names of the pointers to inputs and outputs

_MANY_ZEROS = 4  # consecutive zeros of an output from which one memset stores them
_MANY_LEFT = 8  # output elements from which a loop with an index table copies them


@dataclass(frozen=True, slots=True)
class BlockCode:
    """Writer of the C functions of a graph on doubles: a function per block.

    Attributes:
        graph: operation graph.
        where: layout of the work array.
        sincos: name of the C function that computes a sine and cosine batch.
    """

    graph: Graph
    where: Slots
    sincos: str

    kind: ClassVar[str] = "double"
    scalar: ClassVar[str] = "double"
    zero: ClassVar[str] = "0.0"

    def block(self, name: str, number: int, steps: Sequence[Item]) -> str:
        """Return the C function of a block: load from the work array, compute, store.

        Args:
            name: name of the C function.
            number: index of the block.
            steps: steps of the block.
        """
        lines = self._body(number, steps)
        used = set(_POINTERS.findall("\n".join(lines)))
        inputs = (k for k in range(len(self.graph.inputs)) if f"i{k}" in used)
        outputs = (k for k in range(len(self.graph.outputs)) if f"o{k}" in used)
        head = [
            f"static {'NOINLINE ' if self.where.blocks > 1 else ''}void {name}"
            f"(const {self.scalar} *const *in, {self.kind} *const *out, {self.kind} *restrict w)",
            "{",
            "  (void)in, (void)out, (void)w;",
            *(f"  {self.input(k)};" for k in inputs),
            *(f"  {self.kind} *restrict o{k} = out[{k}];" for k in outputs),
        ]
        return "\n".join([*head, *lines, "}"])

    def repeats(self) -> list[str]:
        """Return the C functions of the recurring sequences of operations, with their tables."""
        return [self._repeat(*item) for item in self.where.tables.items()]

    def _repeat(self, repeat: Repeat, table: CallTable) -> str:
        """Return the C function of a recurring sequence and its tables of indices and constants.

        `repeat` is the sequence, `table` the work indices that each occurrence uses.
        """
        index, name = _index(self.where.count), self._repeat_name(repeat)
        columns = (taken.nodes for taken in repeat.constants)
        constants = (map(self.number, row) for row in zip(*columns, strict=True))
        places = (map(str, row) for row in table.rows)
        count = f"{len(repeat.steps)} operations, done {repeat.count} times"
        own = Slots(table.texts, {}, {}, self.where.count, 0)
        return "\n".join(
            [
                f"/* {count}{self._access_comment(repeat)}. */",
                *_table(index, f"{name}_at", places),
                *_table(self.scalar, f"{name}_of", constants),
                f"static NOINLINE void {name}"
                f"(const {index} *restrict at, const {self.scalar} *restrict i0,"
                f" {self.kind} *restrict w)",
                "{",
                "  (void)at, (void)i0, (void)w;",
                *self.of(repeat.graph, own)._body(0, repeat.steps),
                "}",
            ]
        )

    def _repeat_name(self, repeat: Repeat) -> str:
        """Return the name of the C function of a recurring sequence."""
        return f"{self.graph.name}_repeat{list(self.where.tables).index(repeat)}"

    def _access_comment(self, repeat: Repeat) -> str:
        """Return comment text that names the inputs and outputs that a sequence accesses.

        `repeat` is the sequence.
        """
        taken = {n for column in repeat.taken for n in column.nodes}
        given = {n for column in repeat.given for n in column.nodes}
        nodes = (self.graph.nodes[n] for n in taken)
        ports = {node.args[0] for node in nodes if node.op == casadi.OP_INPUT}
        inputs = [port.name for k, port in enumerate(self.graph.inputs) if k in ports]
        results = zip(self.graph.outputs, self.graph.results, strict=True)
        outputs = [port.name for port, nodes in results if not given.isdisjoint(nodes)]
        words = {"takes": ", ".join(inputs), "gives": ", ".join(outputs)}
        return "".join(f"; {verb} {in_c_comment(names)}" for verb, names in words.items() if names)

    def _calls(self, step: Calls) -> str:
        """Return the C line of a `step` that calls consecutive occurrences of a sequence."""
        name, table = self._repeat_name(step.repeat), self.where.tables[step.repeat]
        loop = f"for (int k = {step.first}; k < {step.first + step.count}; ++k) "
        index = "k" if step.count > 1 else str(step.first)
        sizes = {"at": len(table.rows[0]), "of": len(step.repeat.constants)}
        rows = [f"{name}_{end} + {size} * {index}" if size else "0" for end, size in sizes.items()]
        return f"  {loop if step.count > 1 else ''}{name}({', '.join(rows)}, w);"

    def _inputs(self) -> list[str]:
        """Return C lines that copy the inputs of recurring sequences to the work array."""
        sizes = {k: self.graph.inputs[k].sparsity.nnz() for k in self.where.inputs}
        return [
            f"  memcpy(w + {place}, i{k}, {sizes[k]} * sizeof({self.kind}));"
            for k, place in self.where.inputs.items()
        ]

    def _output_lines(self) -> list[str]:
        """Return C lines that store the output elements that recurring sequences computed."""
        lines: list[str] = []
        for k, leaving in groupby(self.where.last, lambda leaving: leaving[0]):
            pairs = [row[1:] for row in leaving]
            if len(pairs) < _MANY_LEFT:
                lines += [f"  o{k}[{element}] = w[{place}];" for element, place in pairs]
                continue
            parts = (pairs[n : n + _MANY_LEFT] for n in range(0, len(pairs), _MANY_LEFT))
            rows = (map(str, chain(*part)) for part in parts)
            lines += _table(_index(max(map(max, pairs))), f"left{k}", rows)
            loop = f"for (int k = 0; k < {2 * len(pairs)}; k += 2)"
            lines.append(f"  {loop} o{k}[left{k}[k]] = w[left{k}[k + 1]];")
        return lines

    def of(self, graph: Graph, where: Slots) -> Self:
        """Return the writer of the graph of a recurring sequence.

        Args:
            graph: graph whose only input is a table of constants.
            where: layout of the work array for this graph.
        """
        return replace(self, graph=graph, where=where)

    def number(self, number: int) -> str:
        """Return the C text of a constant in a table.

        Args:
            number: node index of the constant.
        """
        return operand(self.graph, number)

    def _body(self, number: int, steps: Sequence[Item]) -> list[str]:
        """Return the C lines of block `number`: loads, operations and stores of its steps."""
        lines = [] if number else self._inputs()
        lines += self._stores(self.where.copied.get(number, ()))
        known: set[int] = set()
        of = self.where.of
        for step in steps:
            if isinstance(step, Calls):
                lines.append(self._calls(step))
                continue
            lines += self._loads(step, known)
            lines += self.values(step)
            known.update(gives(step))
            for n in gives(step):
                lines += [f"  w[{of[n]}] = t{n};"] if n in of else []
                lines += self._stores(self.where.outputs.get(n, ()))
        return lines + (self._output_lines() if number == self.where.blocks - 1 else [])

    def _loads(self, step: Step, known: set[int]) -> list[str]:
        """Return C lines that load the operands of a step; nodes in `known` are loaded already."""
        of = self.where.of
        needed = [n for n in dict.fromkeys(needs(self.graph, step)) if n not in known and n in of]
        known.update(needed)
        return [f"  const {self.kind} t{n} = w[{of[n]}];" for n in needed]

    def input(self, number: int) -> str:
        """Return the C declaration of the pointer to an input.

        Args:
            number: index of the input.
        """
        return f"const {self.scalar} *restrict i{number} = in[{number}]"

    def stored(self, number: int) -> str:
        """Return the C text of a node that is stored to an output.

        Args:
            number: index of the node.
        """
        return operand(self.graph, number)

    def values(self, step: Step) -> list[str]:
        """Return C lines that declare the results of a step.

        Args:
            step: node index, or sine and cosine batch.
        """
        if not isinstance(step, SinCosGroup):
            return [f"  const double t{step} = {expression(self.graph, step)};"]
        angles = [operand(self.graph, n) for n in step.angles]
        angles += ["0.0"] * (LANES - len(angles))
        array = f"sc{step.angles[0]}"
        return [
            f"  double {array}[{2 * LANES}] ALIGNED;",
            f"  {self.sincos}({', '.join(angles)}, {array});",
            *(f"  const double t{n} = {array}[{place}];" for n, place in step.results),
        ]

    def _stores(self, leaving: Sequence[Leaving]) -> list[str]:
        """Return C lines that store the elements `leaving`, as (output, element, node).

        Runs of zeros are stored by memset.
        """
        rows = [(k, element, self.stored(node)) for k, element, node in leaving]
        lines: list[str] = []
        for (k, text), elements in groupby(rows, lambda row: (row[0], row[2])):
            indices = [element for _, element, _ in elements]
            for first, last in _runs(indices):
                target, length = f"o{k}[{first}]", last - first + 1
                if text == self.zero and length >= _MANY_ZEROS:
                    size = f"{length} * sizeof({self.scalar})"
                    lines.append(f"  memset(&{target}, 0, {size});")
                else:
                    lines += [f"  o{k}[{place}] = {text};" for place in range(first, last + 1)]
        return lines


def _index(largest: int) -> str:
    """Return the C type of an index: "unsigned short" if `largest` is below 2^16, else "int"."""
    return "unsigned short" if largest < 1 << 16 else "int"


def _table(kind: str, name: str, rows: Iterable[Iterable[str]]) -> list[str]:
    """Return C lines that declare a constant array with elements of type `kind`.

    `rows` are texts of the elements, one row per line. Empty if there are no elements.
    """
    lines = [f"  {', '.join(row)}," for row in rows]
    declared = f"static const {kind} {name}[] = {{"
    return [declared, *lines, "};"] if any(line.strip(" ,") for line in lines) else []


def _runs(indices: Sequence[int]) -> list[tuple[int, int]]:
    """Return the first and last number of each run of consecutive numbers in `indices`."""
    runs: list[tuple[int, int]] = []
    for index in indices:
        if runs and index == runs[-1][1] + 1:
            runs[-1] = (runs[-1][0], index)
        else:
            runs.append((index, index))
    return runs


# C functions of a graph in single precision.


Real = Literal["double", "float"]
"""C type of numbers."""

_CALL = re.compile(r"\b([a-z]\w*)\(")
_LITERAL = re.compile(r"\b\d+\.\d+\b")
_LEAST = float(np.finfo(np.float32).tiny)


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


@dataclass(frozen=True, slots=True)
class FloatCode(BlockCode):
    """Writer of the C functions of one graph in single precision."""

    kind: ClassVar[str] = "float"
    scalar: ClassVar[str] = "float"
    zero: ClassVar[str] = "0.0f"

    def stored(self, number: int) -> str:
        """Return the C text of a node that is stored to an output; see `BlockCode.stored`.

        Args:
            number: index of the node.
        """
        return _float_operand(self.graph, number)

    def number(self, number: int) -> str:
        """Return the C text of a constant in a table; see `BlockCode.number`."""
        return _float_operand(self.graph, number)

    def values(self, step: Step) -> list[str]:
        """Return C lines that declare the results of a step; see `BlockCode.values`."""
        assert not isinstance(step, SinCosGroup)
        form = _LITERAL.sub(r"\g<0>f", _CALL.sub(r"\1f(", form_of(self.graph, step)))
        text = form.format(*(_float_operand(self.graph, n) for n in self.graph.operands(step)))
        return [f"  const float t{step} = {text};"]


def _float_operand(graph: Graph, number: int) -> str:
    """Return the C text of node `number` as an operand in single precision."""
    text = operand(graph, number)
    return text if text[0] in "it" else literal(graph.nodes[number].value, "float")


# C functions of a graph that compute several columns or states at once, one in each SIMD lane.


@dataclass(frozen=True, slots=True)
class LaneCode(BlockCode):
    """Writer of the C functions of a graph on SIMD vectors: a column or state per lane.

    Attributes:
        shared: whether an input has the same value for all lanes, for each input.
        stride: C text of the number of vectors from an element of an input to the next one.
    """

    shared: Sequence[bool]
    stride: str = "1"

    kind: ClassVar[str] = "mbs_lanes"

    def of(self, graph: Graph, where: Slots) -> Self:
        """Return the writer of the graph of a recurring sequence; see `BlockCode.of`.

        Args:
            graph: graph of the sequence.
            where: places of its nodes in the work array.
        """
        return replace(self, graph=graph, where=where, shared=[True])

    def input(self, number: int) -> str:
        """Return the C declaration of the pointer to an input; see `BlockCode.input`.

        Args:
            number: index of the input.
        """
        if self.shared[number]:
            return f"const double *restrict i{number} = in[{number}]"
        return f"const mbs_lanes *restrict i{number} = (const mbs_lanes *)in[{number}]"

    def stored(self, number: int) -> str:
        """Return the C text of a node that is stored to an output; see `BlockCode.stored`.

        Args:
            number: index of the node.
        """
        return self._vector(number)

    def values(self, step: Step) -> list[str]:
        """Return C lines that declare the results of a step; see `BlockCode.values`."""
        if isinstance(step, SinCosGroup):
            return [line for k in range(len(step.angles)) for line in self._sincos(step, k)]
        operands = self.graph.operands(step)
        vectors = any(not self._is_scalar(n) for n in operands)
        if not vectors:
            return [f"  const mbs_lanes t{step} = mbs_all({expression(self.graph, step)});"]
        op = self.graph.nodes[step].op
        if op in VECTORS:
            text = f"{VECTORS[op]}({', '.join(map(self._vector, operands))})"
        else:
            text = expression(self.graph, step, self._operand)
        return [f"  const mbs_lanes t{step} = {text};"]

    def _sincos(self, batch: SinCosGroup, lane: int) -> list[str]:
        """Return C lines that compute sine and cosine of the angle with index `lane` of a batch."""
        angle = batch.angles[lane]
        own = [(n, place) for n, place in batch.results if place % LANES == lane]
        names = f"s{angle}", f"c{angle}"
        return [
            f"  mbs_lanes {names[0]}, {names[1]};",
            f"  {self.sincos}({self._vector(angle)}, &{names[0]}, &{names[1]});",
            *(f"  const mbs_lanes t{n} = {names[place // LANES]};" for n, place in own),
        ]

    def _is_scalar(self, number: int) -> bool:
        """Whether node `number` has the same value in all lanes: a constant or a shared input."""
        node = self.graph.nodes[number]
        shared = node.op == casadi.OP_INPUT and self.shared[node.args[0]]
        return shared or node.op == casadi.OP_CONST

    def _vector(self, number: int) -> str:
        """Return the C text of node `number` as a SIMD vector."""
        text = self._operand(self.graph, number)
        return f"mbs_all({text})" if self._is_scalar(number) else text

    def _operand(self, graph: Graph, number: int) -> str:
        """Return the C text of node `number` as an operand, a vector or a scalar."""
        node = graph.nodes[number]
        if node.op == casadi.OP_INPUT and not self.shared[node.args[0]]:
            return f"i{node.args[0]}[{node.args[1]} * {self.stride}]"
        return operand(graph, number)
