"""Blocks of a graph as C functions: straight lines of scalars."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import ClassVar

from mbs.native.operators import expression, operand
from mbs.native.schedule import LANES, Batch, Step, gives, needs
from mbs.native.slots import Leaving, Slots
from mbs.operations.graph import Graph

_POINTERS = re.compile(r"\b[io]\d+\b")  # of inputs and outputs

_MANY_ZEROS = 4  # in a row, from which they are stored at once


@dataclass(frozen=True, slots=True)
class BlockCode:
    """The C functions of one graph: its blocks.

    Attributes:
        graph: what is computed.
        where: what its blocks leave for each other.
        sincos: the C function for a batch of angles.
    """

    graph: Graph
    where: Slots
    sincos: str

    kind: ClassVar[str] = "double"
    scalar: ClassVar[str] = "double"
    zero: ClassVar[str] = "0.0"

    def block(self, name: str, number: int, steps: Sequence[Step]) -> str:
        """A C function: loads what earlier ones left, computes, stores what later ones need."""
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

    def _body(self, number: int, steps: Sequence[Step]) -> list[str]:
        lines = self._stores(self.where.moved.get(number, ()))
        known: set[int] = set()
        of = self.where.of
        for step in steps:
            lines += self._loads(step, known)
            lines += self.values(step)
            known.update(gives(step))
            for n in gives(step):
                lines += [f"  w[{of[n]}] = t{n};"] if n in of else []
                lines += self._stores(self.where.outputs.get(n, ()))
        return lines

    def _loads(self, step: Step, known: set[int]) -> list[str]:
        of = self.where.of
        wanted = [n for n in dict.fromkeys(needs(self.graph, step)) if n not in known and n in of]
        known.update(wanted)
        return [f"  const {self.kind} t{n} = w[{of[n]}];" for n in wanted]

    def input(self, number: int) -> str:
        """The declaration of an input."""
        return f"const {self.scalar} *restrict i{number} = in[{number}]"

    def stored(self, number: int) -> str:
        """A node as an output takes it."""
        return operand(self.graph, number)

    def values(self, step: Step) -> list[str]:
        """Lines that declare what a step gives."""
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

    def _stores(self, leaving: Sequence[Leaving]) -> list[str]:
        """The elements of outputs that are known now."""
        rows = [(k, element, self.stored(node)) for k, element, node in leaving]
        lines: list[str] = []
        for (k, text), elements in groupby(rows, lambda row: (row[0], row[2])):
            places = [element for _, element, _ in elements]
            for first, last in _runs(places):
                target, length = f"o{k}[{first}]", last - first + 1
                if text == self.zero and length >= _MANY_ZEROS:
                    size = f"{length} * sizeof({self.scalar})"
                    lines.append(f"  memset(&{target}, 0, {size});")
                else:
                    lines += [f"  o{k}[{place}] = {text};" for place in range(first, last + 1)]
        return lines


def _runs(places: Sequence[int]) -> list[tuple[int, int]]:
    """First and last of each run of consecutive numbers."""
    runs: list[tuple[int, int]] = []
    for place in places:
        if runs and place == runs[-1][1] + 1:
            runs[-1] = (runs[-1][0], place)
        else:
            runs.append((place, place))
    return runs
