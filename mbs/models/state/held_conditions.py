"""State equations whose conditions are constant during a step.

The conditions of the laws are identified in the graph of a state equation by their values at random
points, and are replaced by the modes of the crossings. A step past an event then continues the law
of its start smoothly.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import casadi
import numpy as np
from casadi import SX, Function
from numpy.typing import NDArray

from mbs.errors import ModelError
from mbs.operations.graph import Graph, Node, Port, function_of, graph_of, value_of

_POINTS, _KNOWN, _SEED = 24, 12, 20261124
"""Number of random points at which conditions are compared, number of points that must have finite
values, and seed. Many points are needed: |x| and x are equal at half of them."""
_SIZES = -2.0, 3.0
"""Decimal exponents of the coordinates of these points: fmin(x, 5) and x differ only above 5."""
_EQUAL = 1e-9
"""Largest relative difference of equal conditions: far above rounding, far below the difference of
unequal conditions."""
_COMPARISONS = {casadi.OP_LT, casadi.OP_LE}
_ROUNDED = {casadi.OP_FLOOR: 1.0, casadi.OP_CEIL: -1.0}
"""Rounding operations, with the sign of their operand in the count."""


def hold_sides(
    function: Function,
    at: Sequence[SX],
    values: SX,
    modes: SX,
    counts: int,
    inputs: Sequence[SX],
    *,
    loose: int = 0,
) -> Function:
    """Replace the conditions in a function by the places of crossings, which are modes.

    Args:
        function: state equation.
        at: symbols of the inputs of `function`.
        values: (k, 1) expressions of the crossings in these symbols, counts last.
        modes: symbols of the modes of the crossings, as in `guard`.
        counts: number of counts.
        inputs: inputs of the result: symbols that include the symbols of `at` and the modes.
        loose: number of the first crossings whose conditions are not replaced.

    Returns:
        Function of `inputs`. Conditions that match no crossing are not replaced.
    """
    k, rest = values.numel(), modes.numel()
    try:
        graph = graph_of(function)
    except ModelError:  # the graph contains calls of other Functions
        graph = None
    watched = {*_COMPARISONS, casadi.OP_SIGN, *_ROUNDED}
    if graph is None or not any(node.op in watched for node in graph.nodes):
        return Function(function.name(), list(inputs), function.call(list(at)))
    elements = [[SX(value.nz[j]) for j in range(value.nnz())] for value in at]
    places, asleep, _ = casadi.vertsplit(modes, [0, k, 2 * k, rest])
    crossed = Function("c", list(at), [values])
    found = _found_again(graph, [n.numel() for n in at], crossed, counts, loose)
    nodes = list[SX]()
    for number, node in enumerate(graph.nodes):
        value = value_of(node, nodes, elements)
        if number in found:
            j, sign = found[number]
            free = casadi.logic_or(asleep[j], places[j] == 0) if j < k - counts else asleep[j]
            held = sign * places[j]
            if node.op in _COMPARISONS:
                held = held < 0
            value = casadi.if_else(free, value, held)
        nodes.append(value)
    outputs = [
        SX(port.sparsity, casadi.vertcat(*(nodes[j] for j in result)))
        if result
        else SX(port.sparsity)
        for port, result in zip(graph.outputs, graph.results, strict=True)
    ]
    return Function(function.name(), list(inputs), outputs)


def _found_again(
    graph: Graph, sizes: Sequence[int], crossings: Function, counts: int, loose: int
) -> dict[int, tuple[int, float]]:
    """Match the conditions in a graph with crossings: node -> (index of the crossing, sign)."""
    nodes, numbers, of_counts = list(graph.nodes), list[int](), list[bool]()
    places = list[int]()
    for number, node in enumerate(graph.nodes):
        if node.op in _COMPARISONS:
            nodes.append(Node(casadi.OP_SUB, node.args))
            places.append(len(nodes) - 1)
        elif node.op == casadi.OP_SIGN or node.op in _ROUNDED:
            places.append(node.args[0])
        else:
            continue
        numbers.append(number)
        of_counts.append(node.op in _ROUNDED)
    column = Port("conditions", casadi.Sparsity.dense(len(places), 1))
    probe = function_of(
        replace(graph, outputs=(column,), nodes=tuple(nodes), results=(tuple(places),))
    )
    random = np.random.default_rng(_SEED)
    points = [[_anywhere(random, size) for size in sizes] for _ in range(_POINTS)]
    for point in points[:_KNOWN]:  # positive parameters, whose roots are real
        point[-1] = np.abs(point[-1])
    seen, wanted = (
        np.array([np.array(f(*point)).ravel() for point in points]) for f in (probe, crossings)
    )
    sides = wanted.shape[1] - counts
    found: dict[int, tuple[int, float]] = {}
    for column_of, number in enumerate(numbers):
        op = graph.nodes[number].op
        for j in range(loose, wanted.shape[1]):
            signs = (_ROUNDED[op],) if op in _ROUNDED else (1.0, -1.0)
            for sign in signs:
                off = np.abs(seen[:, column_of] - sign * wanted[:, j])
                known = np.isfinite(off)
                same = np.all(off[known] <= _EQUAL * (1 + np.abs(wanted[known, j])))
                if of_counts[column_of] == (j >= sides) and known.sum() >= _KNOWN and same:
                    found.setdefault(number, (j, sign))
    return found


def _anywhere(random: np.random.Generator, size: int) -> NDArray[np.float64]:
    """Return random numbers of many orders of magnitude and both signs."""
    return random.choice([-1.0, 1.0], size) * 10 ** random.uniform(*_SIZES, size)
