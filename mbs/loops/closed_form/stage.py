"""One step of a plan, and which of its ways lead to a posture."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from casadi import Function

from mbs.assembly import System
from mbs.loops.alike import difference
from mbs.loops.closed_form.places import extent, independent_places
from mbs.loops.closing import Vector

_NEAR = 1e-5


@dataclass(frozen=True, slots=True, eq=False)
class Stage:
    """One loop, or one coupling, solved for some of its unknown positions.

    Attributes:
        name: of the cut joint or of the coupling.
        places: numbers in q of what it gives; beyond the end of q those of cut joints.
        labels: of the ways to close it; one empty label where there is a single way.
        values: Function of q with the positions of cut joints, of which known ones are used, and
            p; one row a place, one column a way.
        spun: place of the spin on which these depend, and Function of the same arguments that
            gives it where the quaternion is known; None where there is none.
        chosen: number of the way in which the system was assembled.
    """

    name: str
    places: tuple[int, ...]
    labels: tuple[str, ...]
    values: Function
    spun: tuple[int, Function] | None = None
    chosen: int = 0


def ways_at(system: System, stages: Sequence[Stage], q: Vector, p: Vector) -> tuple[int, ...]:
    """The ways of all stages that lead to the closed posture q; as far as they do.

    What a stage gives of cut joints is not in q: whether it fits is seen in later stages.
    """
    return ways_from(system, stages, started_at(system, q), q, p)


def started_at(system: System, q: Vector, known: Collection[int] | None = None) -> Vector:
    """All positions, the known ones as in the posture q and the others zero.

    Args:
        system: whose positions they are.
        q: (nq,) the posture.
        known: their places, those of the independent joints when left out.
    """
    start = np.zeros(extent(system))
    given = independent_places(system) if known is None else known
    places = [k for k in given if k < system.nq]
    start[places] = q[places]
    return start


def ways_from(
    system: System, stages: Sequence[Stage], start: Vector, q: Vector, p: Vector
) -> tuple[int, ...]:
    """The ways of all stages that lead to the closed posture q; as far as they do.

    Args:
        system: whose loops they are.
        stages: in their order.
        start: all positions, the known ones as in q; spins are written into it.
        q: (nq,) the posture.
        p: (np,) parameters.
    """
    if not stages:
        return ()
    stage, longest = stages[0], tuple[int, ...]()
    if stage.spun:
        place, angle = stage.spun
        start[place] = float(angle(np.concatenate([q, start[system.nq :]]), p))
    values = np.array(stage.values(start, p))
    for way in range(len(stage.labels)):
        reached = start.copy()
        reached[list(stage.places)] = values[:, way]
        if _agree(system, stage.places, reached, q):
            ways = (way, *ways_from(system, stages[1:], reached, q, p))
            longest = max(longest, ways, key=len)
            if len(longest) == len(stages):
                break
    return longest


def every_posture(
    stages: Sequence[Stage], q: Vector, p: Vector, branch: tuple[str, ...] = ()
) -> Iterator[tuple[Vector, tuple[str, ...]]]:
    """All positions and the labels of the branch, one loop after the other; NaN ends a branch.

    Args:
        stages: in their order.
        q: all positions, of which the known ones count.
        p: (np,) parameters.
        branch: labels so far.
    """
    if not stages:
        yield q, branch
        return
    stage, rest = stages[0], stages[1:]
    values = np.array(stage.values(q, p))
    for way, label in enumerate(stage.labels):
        if np.all(np.isfinite(values[:, way])):
            longer = q.copy()
            longer[list(stage.places)] = values[:, way]
            yield from every_posture(rest, longer, p, branch + ((label,) if label else ()))


def _agree(system: System, places: Sequence[int], reached: Vector, q: Vector) -> bool:
    """Whether the positions of the tree are those of q, up to whole turns and signs."""
    gap = difference(system, reached[: system.nq], q)
    return bool(np.all(np.abs(gap[[k for k in places if k < system.nq]]) < _NEAR))
