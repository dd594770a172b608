"""Joints whose positions may be known together, and those that complete them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mbs.assembly import System
from mbs.errors import NoClosedForm
from mbs.loops.closed_form.places import spin_places
from mbs.loops.closing import Closing, Vector, closure_parameters
from mbs.solvers.rank import null_space, rank

_LOOSE = 1e-6
_REACH, _TRIES, _SEED = 0.2, 8, 20260106


@dataclass(frozen=True, slots=True)
class Known:
    """Positions from which all others follow.

    Attributes:
        independent: those of the given joints that do not depend on each other.
        dependent: the others of them.
        held: independent joints that nothing given determines.
    """

    independent: tuple[int, ...]
    dependent: tuple[int, ...] = ()
    held: tuple[int, ...] = ()

    @property
    def places(self) -> tuple[int, ...]:
        """What is known of q at the start."""
        return self.independent + self.held


def completed(system: System, given: Sequence[int]) -> Known:
    """The given joints, and independent joints that the loops leave free beside them.

    Args:
        system: the assembled mechanism.
        given: numbers in q of turns and slides.

    Raises:
        NoClosedForm: balls or free bodies beside them move in some of their ways only.
    """
    free = null_space(Closing(system, closure_parameters(system)).rows(regular_posture(system))[1])
    independent = _raising(free, given, ())
    dependent = tuple(k for k in given if k not in independent)
    return Known(independent, dependent, held_beside(system, free, independent))


def held_beside(system: System, free: Vector, first: tuple[int, ...]) -> tuple[int, ...]:
    """Joints that determine the rest of a motion: motors, other turns and slides, then balls.

    Args:
        system: the assembled mechanism.
        free: (nq, m) directions in which the positions can move.
        first: numbers in q of what is known, independent.

    Raises:
        NoClosedForm: balls or free bodies move in some of their ways only.
    """
    simple = [link for link in system.tree.links if link.motion.nq == 1]
    motors = [link.q.start for link in simple if link.v.start in system.free]
    others = [link.q.start for link in simple if link.q.start not in motors]
    held = _raising(free, [*motors, *others], first)
    left = free.shape[1] - len(first) - len(held) - len(spin_places(system))
    loose = [link for link in system.tree.links if link.motion.nq > 1]
    for link in loose:
        places = tuple(range(link.q.start, link.q.stop))
        if _gain(free, (*first, *held), places) == link.motion.nv:
            held, left = (*held, *places), left - link.motion.nv
    if left > 0:
        names = ", ".join(link.name for link in loose)
        raise NoClosedForm(
            f"{system.name}: {names or 'a joint'} can move while all turns and slides stay, in a"
            " way that no position tells; use mbs.loops.working_modes"
        )
    return held


def _gain(free: Vector, taken: tuple[int, ...], places: tuple[int, ...]) -> int:
    """How many more directions the positions tell."""
    return rank(free[[*taken, *places]], _LOOSE) - (rank(free[list(taken)], _LOOSE) if taken else 0)


def regular_posture(system: System) -> Vector:
    """A closed posture near the assembled one, where nothing is aligned by accident."""
    posture = np.array(system.posture)
    closing = Closing(system, closure_parameters(system))
    return next(closing.nearby(posture, _REACH, _TRIES, _SEED), posture)


def _raising(free: Vector, candidates: Sequence[int], first: tuple[int, ...]) -> tuple[int, ...]:
    """Of the candidates, in their order, those that are independent of what is there already."""
    taken = list(first)
    for k in candidates:
        if k not in taken and _gain(free, tuple(taken), (k,)):
            taken.append(k)
    return tuple(taken[len(first) :])
