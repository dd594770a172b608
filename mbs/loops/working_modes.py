"""The postures that bring a frame to one pose, as far as random starts lead to them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mbs.assembly import System
from mbs.assembly.rates import quaternion_slices
from mbs.errors import LoopError, ModelError
from mbs.loops.alike import difference, within_half_turn
from mbs.loops.closing import CLOSED, Vector
from mbs.loops.goal import Goal, goal
from mbs.messages import quoted
from mbs.solvers.rank import rank

_TRIES, _LEAST, _SEED = 500, 60, 20260103
_SAME = 1e-6
_LOOSE = 1e-5


@dataclass(frozen=True, slots=True)
class WorkingMode:
    """A posture that closes the loops and brings a frame to a pose.

    Attributes:
        q: (nq) the posture [rad or m], angles within half a turn of zero, the first element of a
            quaternion not negative.
        residual: largest row of the loops and of the pose there.
        hits: how many starts led to it; where some mode has one alone, others are likely missing.
    """

    q: tuple[float, ...]
    residual: float
    hits: int


def working_modes(
    system: System,
    frame: str | int,
    T: Any,
    *,
    rows: Sequence[str] | None = None,
    guess: Mapping[str, float] | Sequence[float] | None = None,
    reach: float = np.pi,
    tries: int = _TRIES,
    parameters: Mapping[str, float] | None = None,
) -> list[WorkingMode]:
    """The postures with closed loops and this pose of a frame to which random starts lead.

    Nothing proves that the list is complete; `hits` tells how well it was searched. The starts are
    the same at every call. The search ends early after at least 60 of them, once the last three
    quarters led to nothing new and every mode was met twice.

    Args:
        system: as for `solve_pose`, and so are frame, T, rows and parameters.
        frame: likewise.
        T: likewise.
        rows: likewise.
        guess: about which posture the starts are taken, the assembled one when left out.
        reach: largest difference of a position between a start and the guess [rad or m]; smaller
            than half a turn, postures near the guess are looked for.
        tries: largest number of starts.
        parameters: likewise.

    Returns:
        The postures found, those near the guess first; empty when none was found.

    Raises:
        LoopError: in a posture found the joints can move while the frame stays, so that there may
            be postures without number.
        ModelError: as for `solve_pose`; or reach or tries is not above zero.
    """
    wanted = goal(system, frame, T, rows, parameters)
    if not (isinstance(tries, int) and tries >= 1 and isinstance(reach, int | float) and reach > 0):
        raise ModelError(
            f"{system.name}: reach is {quoted(reach)} and tries {quoted(tries)}; give a reach above"
            " zero and at least one try"
        )
    middle = np.array(system.position(guess))
    found: list[WorkingMode] = []
    newest = 0
    for number, start in enumerate(_starts(system, middle, reach, tries), start=1):
        posture, known = wanted.nearest(start), len(found)
        if posture.is_closed:
            _add(wanted, found, _tidy(wanted, posture.q))
        newest = number if len(found) > known else newest
        if number >= max(_LEAST, 4 * newest) and all(mode.hits > 1 for mode in found):
            break
    return sorted(found, key=lambda mode: _distance(system, np.array(mode.q), middle))


def _starts(system: System, middle: Vector, reach: float, tries: int) -> list[Vector]:
    rng = np.random.default_rng(_SEED)
    drawn = [middle, *(middle + rng.uniform(-reach, reach, middle.shape) for _ in range(tries - 1))]
    for q in drawn:
        for part in quaternion_slices(system.tree):
            q[part] /= np.linalg.norm(q[part])
    return drawn


def _add(wanted: Goal, found: list[WorkingMode], q: Vector) -> None:
    system = wanted.closing.system
    for number, mode in enumerate(found):
        if _distance(system, np.array(mode.q), q) < _SAME:
            found[number] = replace(mode, hits=mode.hits + 1)
            return
    _require_isolated(wanted, q)
    residual = float(np.max(np.abs(wanted.residual(q)[0])))
    found.append(WorkingMode(tuple(float(x) for x in q), residual, 1))


def _distance(system: System, q: Vector, other: Vector) -> float:
    return float(np.max(np.abs(difference(system, q, other)), initial=0.0))


def _tidy(wanted: Goal, q: Vector) -> Vector:
    """The posture with small angles where that is the same one: not so across a gear."""
    system = wanted.closing.system
    tidy = within_half_turn(system, q)
    for part in quaternion_slices(system.tree):
        tidy[part] *= -1.0 if tidy[part.start] < 0 else 1.0
    return tidy if wanted.openness(tidy) < CLOSED else q


def _require_isolated(wanted: Goal, q: Vector) -> None:
    """Refuse a posture that can move, at least to first order, while the frame stays.

    Raises:
        LoopError: names the joints that move most.
    """
    system = wanted.closing.system
    slope = wanted.residual(q)[1]
    if rank(slope, _LOOSE) == system.nq:
        return
    motion = np.abs(np.linalg.svd(slope)[2][-1])
    names = [c.name for k, c in enumerate(system.coordinates) if motion[k] > motion.max() / 10]
    raise LoopError(
        f"{system.name}: {', '.join(names)} can move while frame {quoted(wanted.frame)} stays at"
        " this pose, so postures cannot be counted; take another pose, name more rows, or use"
        " mbs.loops.solve_pose for one posture"
    )
