"""Blocks of a graph as C functions that compute several columns at once, one in each lane."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import casadi

from mbs.native.block_code import BlockCode
from mbs.native.operators import VECTORS, expression, operand
from mbs.native.schedule import LANES, Batch, Step
from mbs.operations.graph import Graph


@dataclass(frozen=True, slots=True)
class LaneCode(BlockCode):
    """The C functions of one graph, its values vectors.

    Attributes:
        shared: for each input, whether all columns have the same.
    """

    shared: Sequence[bool]

    kind: ClassVar[str] = "mbs_lanes"

    def input(self, number: int) -> str:
        """See BlockCode."""
        if self.shared[number]:
            return f"const double *restrict i{number} = in[{number}]"
        return f"const mbs_lanes *restrict i{number} = (const mbs_lanes *)in[{number}]"

    def stored(self, number: int) -> str:
        """See BlockCode."""
        return self._vector(number)

    def values(self, step: Step) -> list[str]:
        """See BlockCode."""
        if isinstance(step, Batch):
            return [line for k in range(len(step.angles)) for line in self._sincos(step, k)]
        operands = self.graph.operands(step)
        vectors = any(not self._is_scalar(n) for n in operands)
        if not vectors:
            return [f"  const mbs_lanes t{step} = mbs_all({expression(self.graph, step)});"]
        op = self.graph.nodes[step].op
        if op in VECTORS:
            text = f"{VECTORS[op]}({', '.join(map(self._vector, operands))})"
        else:
            text = expression(self.graph, step, self._written)
        return [f"  const mbs_lanes t{step} = {text};"]

    def _sincos(self, batch: Batch, lane: int) -> list[str]:
        angle = batch.angles[lane]
        own = [(n, place) for n, place in batch.results if place % LANES == lane]
        names = f"s{angle}", f"c{angle}"
        return [
            f"  mbs_lanes {names[0]}, {names[1]};",
            f"  {self.sincos}({self._vector(angle)}, &{names[0]}, &{names[1]});",
            *(f"  const mbs_lanes t{n} = {names[place // LANES]};" for n, place in own),
        ]

    def _is_scalar(self, number: int) -> bool:
        node = self.graph.nodes[number]
        shared = node.op == casadi.OP_INPUT and self.shared[node.args[0]]
        return shared or node.op == casadi.OP_CONST

    def _vector(self, number: int) -> str:
        text = self._written(self.graph, number)
        return f"mbs_all({text})" if self._is_scalar(number) else text

    def _written(self, graph: Graph, number: int) -> str:
        node = graph.nodes[number]
        if node.op == casadi.OP_INPUT and not self.shared[node.args[0]]:
            return f"i{node.args[0]}[{node.args[1]} * MBS_ROW]"
        return operand(graph, number)
