"""The passes by name, in the order in which they are made."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from mbs.operations.graph import Graph
from mbs.operations.passes.angles import angles
from mbs.operations.passes.drop import drop
from mbs.operations.passes.factor import factor
from mbs.operations.passes.fold import fold
from mbs.operations.passes.order import order
from mbs.operations.passes.parameters import parameters
from mbs.operations.passes.pythagoras import pythagoras
from mbs.operations.passes.share import share


@dataclass(frozen=True, slots=True)
class Pass:
    """A way to make a graph cheaper.

    Attributes:
        name: what it is called by.
        meaning: what it does, in a line.
        apply: takes a graph and the names of the inputs that are parameters, and gives an equal
            graph.
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
"""The passes in the order in which they are made."""
