"""The named scalars of a Function found again in an equal one that computes them otherwise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import casadi
import numpy as np
from casadi import DM, Function, Sparsity
from numpy.typing import NDArray

from mbs.operations.graph import Graph, Node, Port, function_of, graph_of
from mbs.operations.verification import witness

_SAME = 1e-9
"""Two scalars are equal whose values at every point differ by no more than this part of them."""


def names_found(function: Function, named: Function) -> Function:
    """A Function with further outputs: those of its scalars that bear a name in an equal one.

    Scalars are the same where their values at random points are. No operation but signs is
    added: a name whose scalar, or its opposite, the Function does not compute is left out, and
    so is one of a constant.

    Args:
        function: of scalar operations, such as a simplified model.
        named: of the same inputs; its outputs are those of the Function, then named scalars.

    Returns:
        the Function; after its own outputs come those scalars of `named` that were found.
    """
    graph, count = graph_of(function), function.n_out()
    points = witness(named).points
    wanted = np.array([_scalars(named, point, count) for point in points]).T
    computed = _values(graph, points)
    same = _found(graph, wanted, computed)
    others = _found(graph, -wanted, computed)
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
    """The named scalars at a point; no number where an output is not one scalar."""
    outputs = Function.call(named, list(point))[count:]
    return np.array([float(x) if x.shape == (1, 1) else np.nan for x in outputs])


def _values(graph: Graph, points: Sequence[Sequence[DM]]) -> NDArray[np.float64]:
    """(nodes, points) the value of every node."""
    size = len(graph.nodes)
    port, numbers = Port("nodes", Sparsity.dense(size, 1)), tuple(range(size))
    every = function_of(replace(graph, outputs=(port,), results=(numbers,)))
    return np.hstack([np.array(Function.call(every, list(point))[0]) for point in points])


def _found(
    graph: Graph, wanted: NDArray[np.float64], computed: NDArray[np.float64]
) -> dict[int, int]:
    """For named scalars that vary, where there is one, the first node that has their values.

    Args:
        graph: its operations that an output needs are looked through.
        wanted: (names, points) values of the named scalars.
        computed: (nodes, points) values of the nodes.
    """
    alive = graph.live()
    leaves = casadi.OP_CONST, casadi.OP_INPUT, casadi.OP_NEG
    numbers = [n for n, node in enumerate(graph.nodes) if alive[n] and node.op not in leaves]
    order = np.array(sorted(numbers, key=lambda n: computed[n, 0]), dtype=int)
    keys = computed[order, 0]
    found: dict[int, int] = {}
    for k, values in enumerate(wanted):
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
