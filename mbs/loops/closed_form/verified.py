"""A plan held against postures: it must give them back, and none of its ways may leave loops open.

Kernels use what must hold where a loop closes. In loops that move by their special measures alone
that may not be enough: such a plan is refused, and a way that never closes is left out.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import islice

import casadi
import numpy as np
from casadi import Function

from mbs.assembly import System
from mbs.errors import NoClosedForm
from mbs.loops.closed_form.stage import Stage, started_at, ways_from
from mbs.loops.closing import OPEN, Closing, Vector, closure_parameters

_SEED = 20260104
_MOVE = 0.2
_TRIES = 8
_CHECKS = 3


Start = Callable[[Vector], Vector]
"""All positions from a posture (nq,), of which the known ones count."""


def verified(
    system: System, stages: Sequence[Stage], started: Start | None = None
) -> tuple[Stage, ...]:
    """The stages with the ways of the assembled posture, seen to hold at others as well.

    Args:
        system: whose loops they are.
        stages: in their order.
        started: where the stages start from; from the independent joints when left out.

    Raises:
        NoClosedForm: a loop does not close so.
    """
    start = started or (lambda posture: started_at(system, posture))
    p = closure_parameters(system)
    posture = np.array(system.posture)
    nearby = Closing(system, p).nearby(posture, _MOVE, _TRIES, _SEED)
    postures = [posture, *islice(nearby, _CHECKS)]
    ways = [ways_from(system, stages, start(q), q, p) for q in postures]
    shortest = min(ways, key=len)
    if len(shortest) < len(stages):
        raise NoClosedForm(
            f"{system.name}: the loop of {stages[len(shortest)].name} does not close as the"
            " directions of its axes suggest; use mbs.loops.solve without branch"
        )
    chosen = [replace(stage, chosen=way) for stage, way in zip(stages, ways[0], strict=True)]
    starts = [start(q) for q in postures]
    return tuple(_without_open_ways(system, chosen, starts, p))


def _without_open_ways(
    system: System, stages: Sequence[Stage], starts: Sequence[Vector], p: Vector
) -> list[Stage]:
    result = list[Stage]()
    for number, stage in enumerate(stages):
        kept = [
            way
            for way in range(len(stage.labels))
            if way == stage.chosen
            or any(_may_close(system, stages, number, way, start, p) for start in starts)
        ]
        result.append(stage if len(kept) == len(stage.labels) else _only(stage, kept))
    return result


def _may_close(
    system: System, stages: Sequence[Stage], number: int, way: int, start: Vector, p: Vector
) -> bool:
    """Whether another way of one stage closes the loops or leads nowhere, the others as chosen."""
    reached = start.copy()
    for k, stage in enumerate(stages):
        values = np.array(stage.values(reached, p))
        reached[list(stage.places)] = values[:, way if k == number else stage.chosen]
    if not np.all(np.isfinite(reached)):
        return True
    return Closing(system, p).openness(reached[: system.nq]) < OPEN


def _only(stage: Stage, kept: Sequence[int]) -> Stage:
    """The stage with these ways alone."""
    q, p = (casadi.SX.sym(name, stage.values.size1_in(k)) for k, name in enumerate("qp"))
    values = Function("ways", [q, p], [stage.values(q, p)[:, list(kept)]])
    labels = tuple(stage.labels[way] for way in kept)
    return replace(stage, labels=labels, values=values, chosen=kept.index(stage.chosen))
