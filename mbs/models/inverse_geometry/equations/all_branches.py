"""All branches of the inverse geometric model at once, in one graph without sines of angles."""

from __future__ import annotations

import functools

import casadi
import numpy as np
from casadi import SX, Function
from numpy.typing import NDArray

from mbs.loops.sequence import Leaf, Sequence
from mbs.models.inverse_geometry.chain import Chain
from mbs.models.inverse_geometry.equations.closed_form import given_of
from mbs.models.inverse_geometry.equations.forward import forward
from mbs.operations.graph import Graph, Node, function_of, graph_of

_TINY = 1e-300
_SEED = 20260111
_OUTPUTS = ("q", "residual", "real", "regular", "mark")


def all_branches(
    chain: Chain, sequence: Sequence, p: NDArray[np.float64] | None = None
) -> Function:
    """``igm_all(T) -> q, residual, real, regular, mark``: a column for every branch.

    Args:
        chain: what is solved for.
        sequence: its steps, for the same p.
        p: (np,) numbers in the place of the parameters; else they are a second input p.

    Returns:
        Function of T (4, 4); q (n, branches) of the chain's joints [rad or m], finite; residual
        (branches, 1), the largest difference of an element between the forward model and T, in m
        and 1; real and regular (branches, 1), the smallest of each kind in `Leaf`; mark
        (branches, 1), a number that is the same for equal postures, and hardly for others.
    """
    T = SX.sym("T", 4, 4)
    given = given_of(chain, T) if p is None else SX(casadi.vec(T[:3, :]))
    leaves = sequence.leaves(given)
    columns = [_column(chain, leaf, T, p) for leaf in leaves]
    values = [casadi.horzcat(*(leaf.x for leaf in leaves))]
    values += [casadi.vertcat(*column) for column in zip(*columns, strict=True)]
    inputs = {"T": T} | ({"p": chain.system.p} if p is None and chain.system.parameters else {})
    outputs = {name: casadi.densify(v) for name, v in zip(_OUTPUTS, values, strict=True)}
    every = [*inputs.values()], [*outputs.values()], [*inputs], [*outputs]
    return function_of(without_sines(graph_of(Function("igm_all", *every, {"cse": True}))))


def _column(chain: Chain, leaf: Leaf, T: SX, p: NDArray[np.float64] | None) -> list[SX]:
    pose = forward(chain, leaf.x, p)
    differences = casadi.vertcat(casadi.vec(pose.R - T[:3, :3]), pose.p - T[:3, 3])
    largest = functools.reduce(_larger, casadi.vertsplit(casadi.fabs(differences)))
    return [
        largest,
        _smallest(leaf.real),
        _smallest(casadi.fabs(leaf.regular)),
        _mark(chain, leaf.x),
    ]


def _mark(chain: Chain, x: SX) -> SX:
    """A generic combination of slides and of sines and cosines of turns."""
    weights = np.random.default_rng(_SEED).uniform(0.5, 1.0, (len(chain.names), 2))
    mark = SX(0)
    for k, (a, b) in enumerate(weights):
        mark += a * x[k] if chain.prismatic[k] else a * casadi.sin(x[k]) + b * casadi.cos(x[k])
    return mark


def _larger(a: SX, b: SX) -> SX:
    """The larger number, in operations that processors have in vectors."""
    return SX(0.5 * (a + b + casadi.fabs(a - b)))


def _smallest(values: SX) -> SX:
    """The smallest of numbers, and 1."""
    return functools.reduce(_smaller, casadi.vertsplit(values), SX(1))


def _smaller(a: SX, b: SX) -> SX:
    return SX(0.5 * (a + b - casadi.fabs(a - b)))


def without_sines(graph: Graph) -> Graph:
    """The same Function with y/hypot(x, y) and x/hypot(x, y) in the place of sin, cos of atan2.

    Where x and y both vanish it has zeros.
    """
    nodes: list[Node] = []
    new: list[int] = []
    scales: dict[int, int] = {}

    def add(op: int, *args: int, value: float = 0.0) -> int:
        nodes.append(Node(op, args, value))
        return len(nodes) - 1

    for number, node in enumerate(graph.nodes):
        operands = graph.operands(number)
        angle = operands[0] if operands else -1
        of = graph.nodes[angle]
        if node.op not in (casadi.OP_SIN, casadi.OP_COS) or of.op != casadi.OP_ATAN2:
            args = tuple(new[k] for k in operands) if operands else node.args
            nodes.append(Node(node.op, args, node.value))
            new.append(len(nodes) - 1)
            continue
        y, x = (new[k] for k in of.args)
        if angle not in scales:
            square = add(casadi.OP_ADD, add(casadi.OP_SQ, x), add(casadi.OP_SQ, y))
            tiny = add(casadi.OP_CONST, value=_TINY)
            scales[angle] = add(
                casadi.OP_INV, add(casadi.OP_SQRT, add(casadi.OP_ADD, square, tiny))
            )
        new.append(add(casadi.OP_MUL, y if node.op == casadi.OP_SIN else x, scales[angle]))
    return graph.with_nodes(nodes, [[new[k] for k in result] for result in graph.results])
