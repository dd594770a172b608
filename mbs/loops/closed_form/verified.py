"""A plan held against postures: it must give them back, and none of its ways may leave loops open.

Kernels use what must hold where a loop closes. In loops that move by their special measures alone
that may not be enough: such a plan is refused, and a way that never closes is left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import islice

import casadi
import numpy as np
from casadi import Function

from mbs.assembly import System
from mbs.errors import NoClosedForm
from mbs.loops.closed_form.places import extent
from mbs.loops.closed_form.stage import Stage, started_at, ways_at
from mbs.loops.closing import OPEN, Closing, Vector, closure_parameters

_SEED = 20260104
_MOVE = 0.2
_TRIES = 8
_CHECKS = 3


def verified(system: System, stages: Sequence[Stage]) -> tuple[Stage, ...]:
    """The stages with the ways of the assembled posture, seen to hold at others as well.

    Raises:
        NoClosedForm: a loop does not close so.
    """
    p = closure_parameters(system)
    posture = np.array(system.posture)
    nearby = Closing(system, p).nearby(posture, _MOVE, _TRIES, _SEED)
    postures = [posture, *islice(nearby, _CHECKS)]
    ways = [ways_at(system, stages, q, p) for q in postures]
    shortest = min(ways, key=len)
    if len(shortest) < len(stages):
        raise NoClosedForm(
            f"{system.name}: the loop of {stages[len(shortest)].name} does not close as the"
            " directions of its axes suggest; use mbs.loops.solve without branch"
        )
    chosen = [replace(stage, chosen=way) for stage, way in zip(stages, ways[0], strict=True)]
    return tuple(_without_open_ways(system, chosen, postures, p))


def _without_open_ways(
    system: System, stages: Sequence[Stage], postures: Sequence[Vector], p: Vector
) -> list[Stage]:
    result = list[Stage]()
    for number, stage in enumerate(stages):
        kept = [
            way
            for way in range(len(stage.labels))
            if way == stage.chosen
            or any(_may_close(system, stages, number, way, q, p) for q in postures)
        ]
        result.append(stage if len(kept) == len(stage.labels) else _only(system, stage, kept))
    return result


def _may_close(
    system: System, stages: Sequence[Stage], number: int, way: int, q: Vector, p: Vector
) -> bool:
    """Whether another way of one stage closes the loops or leads nowhere, the others as chosen."""
    reached = started_at(system, q)
    for k, stage in enumerate(stages):
        values = np.array(stage.values(reached, p))
        reached[list(stage.places)] = values[:, way if k == number else stage.chosen]
    if not np.all(np.isfinite(reached)):
        return True
    rows, _ = Closing(system, p).rows(reached[: system.nq])
    return float(np.max(np.abs(rows), initial=0.0)) < OPEN


def _only(system: System, stage: Stage, kept: Sequence[int]) -> Stage:
    """The stage with these ways alone."""
    q, p = casadi.SX.sym("q", extent(system)), system.p
    values = Function("ways", [q, p], [stage.values(q, p)[:, list(kept)]])
    labels = tuple(stage.labels[way] for way in kept)
    return replace(stage, labels=labels, values=values, chosen=kept.index(stage.chosen))
