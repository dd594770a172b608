"""Simplify Functions: equal Functions with fewer operations, by a sequence of passes."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import casadi
import numpy as np
from casadi import DM, SX, Function, Sparsity
from numpy.typing import NDArray

from mbs.errors import ModelError
from mbs.operations.counts import Count, count_graph
from mbs.operations.graph import Graph, Node, Port, drop, function_of, graph_of
from mbs.operations.passes import angles, factor, fold, order, parameters, pythagoras, share
from mbs.text import did_you_mean, quoted

# Passes by name, in the order in which they are applied.


@dataclass(frozen=True, slots=True)
class Pass:
    """Transformation that makes a graph cheaper.

    Attributes:
        name: name of the pass, for the argument `passes` of `simplify`.
        meaning: description of the pass in one line.
        apply: callable (graph, names of the inputs that are parameters) -> equivalent graph.
    """

    name: str
    meaning: str
    apply: Callable[[Graph, tuple[str, ...]], Graph]


PASSES = (
    Pass("drop", "leave out what no output needs", drop),
    Pass("fold", "compute constants, remove 0 and 1, move signs outwards", fold),
    Pass("parameters", "gather parameters: c1 (x c2) is (c1 c2) x", parameters),
    Pass("angles", "join parallel axes: c2 c3 - s2 s3 is cos(q2 + q3)", angles),
    Pass("factor", "put common factors outside: a b + a c is a (b + c)", factor),
    Pass("pythagoras", "s s x + c c x is x", pythagoras),
    Pass("share", "compute common parts of sums and products once", share),
    Pass("order", "order the operations so that few values wait at a time", order),
)
"""Passes in the order in which they are applied."""


_MOST_ROUNDS = 6


@dataclass(frozen=True, slots=True)
class PassReport:
    """Result of a single pass over a Function.

    Attributes:
        name: name of the pass.
        seconds: duration of the pass and of the numeric comparison [s].
        before: operations before the pass.
        after: operations after the pass, even if its result was discarded.
        kept: whether the result was kept.
    """

    name: str
    seconds: float
    before: Count
    after: Count
    kept: bool


Step = PassReport
"""Former name of `PassReport`."""


@dataclass(frozen=True, slots=True)
class Simplification:
    """Simplified Function and the passes that were applied.

    Attributes:
        function: simplified Function.
        graph: operations of the Function, in the order of the last pass.
        steps: reports of the passes, in order.
    """

    function: Function
    graph: Graph
    steps: tuple[PassReport, ...]

    def __str__(self) -> str:
        """Return a table of the passes: multiplications/additions before and after, seconds."""
        rows = [("pass", "before", "after", "seconds")]
        rows += [
            (
                s.name,
                str(s.before),
                str(s.after) + ("" if s.kept else " undone"),
                f"{s.seconds:.3f}",
            )
            for s in self.steps
        ]
        widths = [max(len(row[k]) for row in rows) for k in range(4)]
        lines = ("  ".join(c.ljust(w) for c, w in zip(r, widths, strict=True)) for r in rows)
        return "\n".join(line.rstrip() for line in lines)


def simplify(
    function: Function,
    passes: Iterable[str] | None = None,
    parameters: Iterable[str] = ("p",),
) -> Function:
    """Return an equivalent Function with fewer operations.

    Divisions and roots are never added, so derivatives are finite wherever the derivatives of the
    given Function are.

    Args:
        function: Function of scalar operations, or a Function that can be expanded to them.
        passes: names of passes, see `PASSES`; they are applied in the order of that table.
            Default: all passes.
        parameters: names of inputs that are constant from call to call. Operations on these
            inputs alone are not counted, see `split`.

    Returns:
        a Function with the same name, inputs, outputs and default inputs. Models keep their
        checks, their parameter defaults and the names of the intermediate quantities that are
        still computed.

    Raises:
        ModelError: the Function has no scalar operations or no finite values, or a pass is
            unknown.
    """
    return simplification(function, passes, parameters).function


def simplification(
    function: Function,
    passes: Iterable[str] | None = None,
    parameters: Iterable[str] = ("p",),
) -> Simplification:
    """Simplify a Function as `simplify` does, and report the operations that each pass saves.

    Passes are repeated until none saves further operations. Each result is compared with the given
    Function at random points. It is discarded if it needs more operations.

    Args:
        function: Function of scalar operations, or a Function that can be expanded to them.
        passes: names of passes, see `PASSES`; default: all.
        parameters: names of inputs that are constant from call to call.

    Raises:
        ModelError: the Function has no scalar operations or no finite values, or a pass is unknown.
    """
    chosen, names = _select_passes(passes), tuple(parameters)
    graph, steps = graph_of(function), list[PassReport]()
    proof = witness(function)
    simplifying = [p for p in chosen if p.name != "order"]
    idle = 0
    for number in range(_MOST_ROUNDS * len(simplifying)):
        graph, step = _try_pass(simplifying[number % len(simplifying)], graph, names, proof)
        steps.append(step)
        idle = 0 if step.kept and step.after.total < step.before.total else idle + 1
        if idle == len(simplifying):
            break
    for last in (p for p in chosen if p.name == "order"):
        graph, step = _try_pass(last, graph, names, proof)
        steps.append(step)
    return Simplification(_function_like(function, graph), graph, tuple(steps))


def _select_passes(passes: Iterable[str] | None) -> Sequence[Pass]:
    """Return the passes with the given names, in the order of PASSES; all passes for None.

    Raise ModelError if a name is unknown.
    """
    if passes is None:
        return PASSES
    chosen, known = set(passes), [p.name for p in PASSES]
    for name in chosen - set(known):
        raise ModelError(f"there is no pass {quoted(name)}; {did_you_mean(name, known)}")
    return [p for p in PASSES if p.name in chosen]


def _try_pass(
    one: Pass, graph: Graph, parameters: tuple[str, ...], proof: Witness
) -> tuple[Graph, PassReport]:
    """Apply the pass `one` to a graph; return the graph to continue with, and a report.

    The result is kept if it is cheaper. A kept result whose values differ from `proof` raises
    ModelError.
    """
    started = time.perf_counter()
    made = one.apply(graph, parameters)
    before, after = count_graph(graph, parameters), count_graph(made, parameters)
    kept = (after.total, len(made.nodes)) < (before.total, len(graph.nodes))
    if one.name == "order":
        kept = after.total == before.total
    if kept:
        proof.require_equal(function_of(made), f"the pass {one.name}")
    seconds = time.perf_counter() - started
    return made if kept else graph, PassReport(one.name, seconds, before, after, kept)


def _function_like(function: Function, graph: Graph) -> Function:
    """Return the Function of a graph, with the default inputs of `function`.

    A model also keeps its checks.
    """
    defaults = [function.default_in(k) for k in range(function.n_in())]
    made = function_of(graph, defaults)
    rewritten: Any = getattr(function, "rewritten", None)
    return made if rewritten is None else rewritten(made)


# Separation of the operations on parameters from the operations of every call.


_CONSTANTS = "c"


@dataclass(frozen=True, slots=True)
class Split:
    """Function that is split in two: operations done once, and operations done at every call.

    Attributes:
        setup: Function from the parameters to c, a column of all values that `main` needs.
        main: Function from the other inputs and c to the outputs.
        inputs: names of the inputs of the original Function, in order.
    """

    setup: Function
    main: Function
    inputs: tuple[str, ...]

    def joined(self) -> Function:
        """Return the original Function: `main` after `setup`."""
        sparsity = {
            f.name_in(k): f.sparsity_in(k) for f in (self.main, self.setup) for k in range(f.n_in())
        }
        symbols = {name: SX.sym(name, sparsity[name]) for name in self.inputs}
        constants = self.setup.call([symbols[n] for n in self.setup.name_in()])
        given = [symbols[n] for n in self.main.name_in()[:-1]]
        outputs = self.main.call([*given, *constants])
        names = self.main.name_out()
        return Function(self.main.name(), list(symbols.values()), outputs, self.inputs, names)


def split(function: Function, parameters: Iterable[str] = ("p",)) -> Split:
    """Split a Function in two, so that operations on parameters are not repeated.

    c contains the parameters and the parameter-only results that `main` uses. Constants are part
    of `main`. Simplify the Function first to reduce both.

    Args:
        function: Function of scalar operations, or a Function that can be expanded to them.
        parameters: names of inputs that are constant from call to call. Unknown names are ignored.

    Returns:
        `setup(p) -> c` and `main(..., c) -> ...`. `setup` has the parameters of the Function in
        their order; for a model also their defaults. `main` has the other inputs and all outputs.

    Raises:
        ModelError: the Function has no scalar operations, or an input is named c.
    """
    graph, names = drop(graph_of(function)), set(parameters)
    if any(port.name == _CONSTANTS for port in graph.inputs):
        raise ModelError(
            f"{function.name()}: its input c has the name of what is computed once; rename it"
        )
    kept = _parameter_nodes(graph, names)
    column = Port(_CONSTANTS, Sparsity.dense(len(kept), 1))
    setup = function_of(_setup(graph, names, kept, column))
    like = getattr(function, "like", None)
    return Split(
        setup if like is None else like(setup),
        function_of(_main(graph, names, kept, column)),
        tuple(port.name for port in graph.inputs),
    )


def _parameter_nodes(graph: Graph, names: set[str]) -> list[int]:
    """Return the parameter-only nodes that outputs or other nodes use, without constants.

    `names` are the names of the parameters.
    """
    fixed = graph.fixed_by(names)
    used = [number for result in graph.results for number in result]
    for number in range(len(graph.nodes)):
        if not fixed[number]:
            used += graph.operands(number)
    return sorted({n for n in used if fixed[n] and graph.nodes[n].op != casadi.OP_CONST})


def _setup(graph: Graph, names: set[str], kept: list[int], column: Port) -> Graph:
    """Return the graph that computes the nodes `kept` from the parameters, as the output `column`.

    `names` are the names of the parameters.
    """
    inputs = tuple(port for port in graph.inputs if port.name in names)
    nodes = _renumber(graph, [port.name for port in inputs])
    return Graph(f"{graph.name}_setup", inputs, (column,), nodes, (tuple(kept),))


def _main(graph: Graph, names: set[str], kept: list[int], column: Port) -> Graph:
    """Return the graph of the other operations, whose last input `column` has the nodes `kept`.

    `names` are the names of the parameters.
    """
    inputs = tuple(port for port in graph.inputs if port.name not in names)
    nodes = list(_renumber(graph, [port.name for port in inputs]))
    for position, number in enumerate(kept):
        nodes[number] = Node(casadi.OP_INPUT, (len(inputs), position))
    return drop(Graph(graph.name, (*inputs, column), graph.outputs, tuple(nodes), graph.results))


def _renumber(graph: Graph, names: list[str]) -> tuple[Node, ...]:
    """Return the nodes of a graph for the inputs `names` in this order.

    Other inputs are unchanged.
    """
    index = {k: names.index(p.name) for k, p in enumerate(graph.inputs) if p.name in names}

    def renumber(node: Node) -> Node:
        if node.op != casadi.OP_INPUT or node.args[0] not in index:
            return node
        return Node(node.op, (index[node.args[0]], node.args[1]))

    return tuple(renumber(node) for node in graph.nodes)


# Named scalars of a Function, identified in an equivalent Function with other operations.


_SAME = 1e-9
"""Relative difference up to which two scalars are equal, at every test point."""


def names_found(function: Function, named: Function) -> Function:
    """Add outputs to a Function: its scalars that have a name in an equivalent Function.

    Scalars are identified by equal values at random points. Only sign changes are added as
    operations. A named scalar is omitted if the Function computes neither it nor its opposite, or
    if it is constant.

    Args:
        function: Function of scalar operations, such as a simplified model.
        named: Function with the same inputs. Its outputs are the outputs of `function`, followed
            by the named scalars.

    Returns:
        the Function with the identified scalars of `named` as additional outputs.
    """
    graph, count = graph_of(function), function.n_out()
    points = witness(named).points
    target = np.array([_scalars(named, point, count) for point in points]).T
    computed = _values(graph, points)
    same = _match_scalars(graph, target, computed)
    others = _match_scalars(graph, -target, computed)
    known = set(same.values())
    nodes, named_nodes = list(graph.nodes), dict(same)
    for k, number in others.items():
        if k not in same and number not in known:
            named_nodes[k] = len(nodes)
            nodes.append(Node(casadi.OP_NEG, (number,)))
    names, scalar = named.name_out()[count:], Sparsity.dense(1, 1)
    order = sorted(named_nodes)
    more = replace(
        graph,
        nodes=tuple(nodes),
        outputs=(*graph.outputs, *(Port(names[k], scalar) for k in order)),
        results=(*graph.results, *((named_nodes[k],) for k in order)),
    )
    return function_of(more, [function.default_in(k) for k in range(function.n_in())])


def _scalars(named: Function, point: Sequence[DM], count: int) -> NDArray[np.float64]:
    """Return the named scalars at a point; NaN for outputs that are not scalar.

    `count` is the number of outputs of `named` before the named scalars.
    """
    outputs = Function.call(named, list(point))[count:]
    return np.array([float(x) if x.shape == (1, 1) else np.nan for x in outputs])


def _values(graph: Graph, points: Sequence[Sequence[DM]]) -> NDArray[np.float64]:
    """Return the non-zero elements of each output of a Function at a point.

    `point` has one value per input.
    """
    size = len(graph.nodes)
    port, numbers = Port("nodes", Sparsity.dense(size, 1)), tuple(range(size))
    every = function_of(replace(graph, outputs=(port,), results=(numbers,)))
    return np.hstack([np.array(Function.call(every, list(point))[0]) for point in points])


def _match_scalars(
    graph: Graph, target: NDArray[np.float64], computed: NDArray[np.float64]
) -> dict[int, int]:
    """Return the first node with the same values for each named scalar that is not constant.

    Named scalars without such a node are omitted.

    Args:
        graph: graph whose live operations are searched.
        target: (names, points) values of the named scalars.
        computed: (nodes, points) values of the nodes.
    """
    alive = graph.live()
    leaves = casadi.OP_CONST, casadi.OP_INPUT, casadi.OP_NEG
    numbers = [n for n, node in enumerate(graph.nodes) if alive[n] and node.op not in leaves]
    order = np.array(sorted(numbers, key=lambda n: computed[n, 0]), dtype=int)
    keys = computed[order, 0]
    found: dict[int, int] = {}
    for k, values in enumerate(target):
        margin = _SAME * np.abs(values)
        if not np.all(np.isfinite(values)) or np.ptp(values) <= margin.max():
            continue
        first = np.searchsorted(keys, values[0] - margin[0], "left")
        last = np.searchsorted(keys, values[0] + margin[0], "right")
        near = order[first:last]
        same = np.all(np.abs(computed[near] - values) <= margin, axis=1)
        if same.any():
            found[k] = int(near[same].min())
    return found


# Numeric comparison of Functions at random points.


_POINTS = 3
"""Number of test points: an error that is hidden at one point is visible at another."""
_BOXES = ((0.1, 0.9), (-1.0, 1.0), (-3.0, 3.0), (0.5, 2.0), (1.0, 30.0), (-100.0, 100.0))
"""Ranges of the inputs, tried in order until the Function is finite: first the domain of arcsines,
roots and logarithms, then ranges for functions that need larger or negative inputs."""
_TRIES = 4
_OF_THE_LARGEST, _OF_ALL = 1e-9, 1e-12
"""Allowed differences, relative to the largest element of the output and of all outputs. A new
order of sums changes values by 1e-15 times their condition; a wrong term by a large fraction."""
_NUDGES, _NUDGE, _MARGIN = 16, 1e-12, 10.0
"""Rounding test if these are exceeded, such as for an output that is zero except for rounding:
number of perturbations, relative size (some thousand roundings), factor on the largest effect."""

Values = tuple[np.ndarray, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Witness:
    """Values of a Function at test points.

    Attributes:
        function: Function that was evaluated.
        points: values of all inputs, for each point.
        values: non-zero elements of all outputs, for each point.
    """

    function: Function
    points: tuple[tuple[DM, ...], ...]
    values: tuple[Values, ...]

    def require_equal(self, function: Function, what: str) -> None:
        """Raise if another Function has different values where this Function is finite.

        Args:
            function: Function to compare.
            what: name of the transformation that made it, for the error message.

        Raises:
            ModelError: an output differs. The message gives the output and `what`.
        """
        for point, expected in zip(self.points, self.values, strict=True):
            got = _evaluated(function, point)
            scale = max((_largest(v) for v in expected), default=0.0)
            for k, (one, other) in enumerate(zip(expected, got, strict=True)):
                allowed = max(_OF_THE_LARGEST * _largest(one), _OF_ALL * scale)
                if _within(one, other, allowed) or _within(one, other, self._rounding(k)):
                    continue
                raise ModelError(
                    f"{self.function.name()}: {function.name_out(k)} is no longer the same after"
                    f" {what}; leave that pass out, and please report it"
                )

    def _rounding(self, output: int) -> float:
        """Return the largest change of an output, times 10, by tiny random changes of the inputs.

        It bounds the rounding error of an output that should be zero. `output` is its index.
        """
        random, found = np.random.default_rng(0), 0.0
        for point, expected in zip(self.points, self.values, strict=True):
            for _ in range(_NUDGES):
                nudged = [x * (1 + random.uniform(-_NUDGE, _NUDGE, x.shape)) for x in point]
                change = _evaluated(self.function, nudged)[output] - expected[output]
                found = max(found, _largest(change))
        return _MARGIN * found


def witness(function: Function, seed: int = 0) -> Witness:
    """Evaluate a Function at three random points at which all, or most, of its elements are finite.

    Args:
        function: Function to evaluate.
        seed: seed of the random numbers.

    Raises:
        ModelError: no output element is finite at any of many points.
    """
    random = np.random.default_rng(seed)
    tried: list[tuple[int, tuple[DM, ...], Values]] = []
    for low, high in _BOXES * _TRIES:
        point = tuple(
            DM(function.sparsity_in(k), random.uniform(low, high, function.nnz_in(k)))
            for k in range(function.n_in())
        )
        values = _evaluated(function, point)
        tried.append((sum(int(np.isfinite(v).sum()) for v in values), point, values))
        elements = sum(v.size for v in values)
        if sum(1 for finite, _, _ in tried if finite == elements) == _POINTS:
            break
    tried.sort(key=lambda trial: -trial[0])
    best = tried[:_POINTS]
    if elements and not best[0][0]:
        raise ModelError(
            f"{function.name()}: it gives no number at any of {len(tried)} points, so that a"
            " simpler Function cannot be compared with it; check it for divisions by zero"
        )
    return Witness(function, tuple(p for _, p, _ in best), tuple(v for _, _, v in best))


def _evaluated(function: Function, point: Sequence[DM]) -> Values:
    """Return the non-zero elements of each output of a Function at a point.

    `point` has one value per input.
    """
    outputs = Function.call(function, list(point))
    return tuple(np.array(DM(output).nonzeros(), dtype=float) for output in outputs)


def _within(one: np.ndarray, other: np.ndarray, allowed: float) -> bool:
    """Return whether two arrays differ by at most `allowed`.

    Elements where `one` is not finite pass.
    """
    known = np.isfinite(one)
    return bool(np.all(np.abs(one[known] - other[known]) <= allowed))


def _largest(values: np.ndarray) -> float:
    """Return the largest magnitude of the finite elements; zero if there are none."""
    return float(np.max(np.abs(values[np.isfinite(values)]), initial=0.0))
