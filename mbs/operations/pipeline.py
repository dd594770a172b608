"""Equal Functions that take fewer operations, pass by pass."""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from casadi import Function

from mbs.errors import ModelError
from mbs.messages import did_you_mean, quoted
from mbs.operations.catalogue import PASSES, Pass
from mbs.operations.counts import Count, count_graph
from mbs.operations.graph import Graph, function_of, graph_of
from mbs.operations.verification import Witness, witness

_MOST_ROUNDS = 6


@dataclass(frozen=True, slots=True)
class Step:
    """One pass over a Function.

    Attributes:
        name: of the pass.
        seconds: how long it took, with the comparison afterwards.
        before: operations before it.
        after: operations after it; more than before when it was undone.
        kept: whether its result was kept.
    """

    name: str
    seconds: float
    before: Count
    after: Count
    kept: bool


@dataclass(frozen=True, slots=True)
class Simplification:
    """What the passes made of a Function.

    Attributes:
        function: the simplified one.
        graph: its operations, in the order of the last pass.
        steps: the passes, as they were made.
    """

    function: Function
    graph: Graph
    steps: tuple[Step, ...]

    def __str__(self) -> str:
        """A table of the passes: multiplications/additions before and after, seconds."""
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
    """An equal Function that takes fewer operations.

    Its derivatives are finite where those of the given one are: no division and no root is new.

    Args:
        function: made of scalar operations, or a Function that can be expanded to them.
        passes: names of passes, see `PASSES`, made in the order of that table; all by default.
        parameters: names of inputs that do not change from call to call; operations on them
            alone are free, see `split`.

    Returns:
        a Function with the same name, inputs, outputs and default inputs; of a model, with its
        checks and its parameter defaults too, and with the names of those intermediate
        quantities that it still computes.

    Raises:
        ModelError: the Function has no scalar operations, gives no numbers, or a pass has no
            such name.
    """
    return simplification(function, passes, parameters).function


def simplification(
    function: Function,
    passes: Iterable[str] | None = None,
    parameters: Iterable[str] = ("p",),
) -> Simplification:
    """What `simplify` does, with the operations that each pass saved.

    The passes are made in turn until none saves anything more. Each result is compared with the
    given Function at random points, and undone if it takes more operations.
    """
    chosen, names = _chosen(passes), tuple(parameters)
    graph, steps = graph_of(function), list[Step]()
    proof = witness(function)
    simplifying = [p for p in chosen if p.name != "order"]
    idle = 0
    for number in range(_MOST_ROUNDS * len(simplifying)):
        graph, step = _made(simplifying[number % len(simplifying)], graph, names, proof)
        steps.append(step)
        idle = 0 if step.kept and step.after.total < step.before.total else idle + 1
        if idle == len(simplifying):
            break
    for last in (p for p in chosen if p.name == "order"):
        graph, step = _made(last, graph, names, proof)
        steps.append(step)
    return Simplification(_function_like(function, graph), graph, tuple(steps))


def _chosen(passes: Iterable[str] | None) -> Sequence[Pass]:
    if passes is None:
        return PASSES
    wanted, known = set(passes), [p.name for p in PASSES]
    for name in wanted - set(known):
        raise ModelError(f"there is no pass {quoted(name)}; {did_you_mean(name, known)}")
    return [p for p in PASSES if p.name in wanted]


def _made(
    one: Pass, graph: Graph, parameters: tuple[str, ...], proof: Witness
) -> tuple[Graph, Step]:
    started = time.perf_counter()
    made = one.apply(graph, parameters)
    before, after = count_graph(graph, parameters), count_graph(made, parameters)
    kept = (after.total, len(made.nodes)) < (before.total, len(graph.nodes))
    if one.name == "order":
        kept = after.total == before.total
    if kept:
        proof.require_equal(function_of(made), f"the pass {one.name}")
    seconds = time.perf_counter() - started
    return made if kept else graph, Step(one.name, seconds, before, after, kept)


def _function_like(function: Function, graph: Graph) -> Function:
    """The Function of a graph, with the defaults of another and, of a model, checks and names."""
    defaults = [function.default_in(k) for k in range(function.n_in())]
    made = function_of(graph, defaults)
    rewritten: Any = getattr(function, "rewritten", None)
    return made if rewritten is None else rewritten(made)
