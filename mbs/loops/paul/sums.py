"""The last angle of a sum that is known."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import casadi
from casadi import SX

from mbs.loops.paul.candidate import Candidate, Stage
from mbs.loops.paul.knowledge import Knowledge, Variable
from mbs.loops.sequence import Step, step
from mbs.loops.sequence.step import Found


def sums(stage: Stage) -> Iterator[Candidate]:
    """Steps that take known angles away from a known sum, or one sum away from another."""
    for rest, value, text in _alone(stage):

        def build(rest: Variable = rest, value: SX = value, text: str = text) -> Step:
            turns = casadi.floor((value + casadi.pi) / (2 * casadi.pi))
            found = Found({stage.knowledge.place(rest): SX(value - 2 * casadi.pi * turns)})
            return step(stage.knowledge.problem, "sum", text, {}, found)

        yield Candidate((0.0,), (rest,), build)


def _alone(stage: Stage) -> Iterator[tuple[Variable, SX, str]]:
    """Single angles, their values, and the equation."""
    knowledge = stage.knowledge
    opened = [
        (rest, value, f"{stage.term(whole)} = {knowledge.problem.x[place]}")
        for (rest, value, _), (whole, place) in zip(
            knowledge.open_sums(), knowledge.sums, strict=True
        )
    ]
    yield from (own for own in opened if own[0].single)
    for (first, a, text), (second, b, other) in combinations(opened, 2):
        for way in (1, -1):
            rest = _combined(first, second, way)
            if len(rest) == 1:
                ((k, sign),) = rest.items()
                value = SX(a + way * b) / sign
                yield _angle(knowledge, k), value, f"{text}, {other}"


def _angle(knowledge: Knowledge, k: int) -> Variable:
    return Variable(not knowledge.ring.joints[k].turns, ((k, 1),))


def _combined(first: Variable, second: Variable, way: int) -> dict[int, int]:
    total = dict(first.members)
    for k, sign in second.members:
        total[k] = total.get(k, 0) + way * sign
    return {k: sign for k, sign in total.items() if sign in (1, -1)} if _unit(total) else {}


def _unit(total: dict[int, int]) -> bool:
    return all(abs(sign) <= 1 for sign in total.values())
