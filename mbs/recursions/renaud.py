"""Renaud's factors of a Jacobian, and the frame in the middle that makes the last one simple.

J = [R 0; 0 R] [I -L^; 0 I] J_i: the velocity of a reference point in the axes of an intermediate
frame i, moved to the origin of the frame, turned into the axes that are wanted.

Source: Renaud 1980; Khalil & Creusot 1997, eq. 4.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from operator import itemgetter

import casadi
import numpy as np
from casadi import DM, SX

from mbs.recursions.cost import cost
from mbs.recursions.jacobian import VelocityTarget, jacobian, outlook
from mbs.recursions.route import expressed, relative_pose
from mbs.recursions.survey import Survey, nonzero, survey, varying
from mbs.spatial import Pose, skew, zeros

_HOME = Pose.identity()
_COUNTED = 6
"""How many candidates are built and counted; the survey has ranked them. One in a long chain."""
_MOST_TURNS = 24
"""Branches with more turns than this take orientations for all of them."""
_MOST_PLACES = 16
"""A longer chain is looked at from so many of its frames only."""


@dataclass(frozen=True, slots=True, eq=False)
class Renaud:
    """The three factors of a Jacobian.

    Attributes:
        intermediate: link in whose axes J is, -1 for the base.
        reference: link whose origin V belongs to, None for the frame's own origin.
        R: (3, 3) orientation of the intermediate frame in the axes that are wanted.
        L: (3, 1) from the reference to the frame's origin, in the intermediate axes [m].
        J: (6, nv) in the intermediate axes.
    """

    intermediate: int
    reference: int | None
    R: SX
    L: SX
    J: SX

    @property
    def rotation(self) -> SX:
        """(6, 6) the first factor."""
        Z = SX.zeros(3, 3)
        return casadi.vertcat(casadi.horzcat(self.R, Z), casadi.horzcat(Z, self.R))

    @property
    def displacement(self) -> SX:
        """(6, 6) the second factor."""
        eye = casadi.densify(SX(DM.eye(3)))
        return casadi.vertcat(
            casadi.horzcat(eye, -skew(self.L)), casadi.horzcat(SX.zeros(3, 3), eye)
        )


def cheapest_jacobian(target: VelocityTarget, reference: int | None = None) -> SX:
    """(6, nv) Jacobian, of the ways to form it the one with the fewest operations.

    Args:
        target: the frame that moves, and the axes.
        reference: link whose origin V belongs to, None for the frame's own origin.
    """
    seen = outlook(target)
    most = seen.turns
    numbers = [most] if most > _MOST_TURNS else sorted({*range(0, most, 2), most})
    candidates = (jacobian(seen, reference, number) for number in numbers)
    return min(candidates, key=lambda J: cost(J, target.q, target.p))


def renaud(
    target: VelocityTarget, intermediate: int | None = None, reference: int | None = None
) -> Renaud:
    """The three factors; what is not asked for is chosen for the fewest operations of J.

    Args:
        target: the frame that moves, and the axes that are wanted.
        intermediate: link on the way to the frame, -1 for the base, or None for the best.
        reference: link on the way whose origin the velocity J v belongs to, or None for the best.
    """
    found = survey(target)
    ranked = _ranked(found, intermediate, reference)
    counted = _COUNTED if len(found.frames) <= _MOST_PLACES else 1
    candidates = [
        (i, r, cheapest_jacobian(target.along((i, _HOME)), r)) for i, r in ranked[:counted]
    ]
    i, r, J = min(candidates, key=lambda found: cost(found[2], target.q, target.p))
    R = relative_pose(target.tree, target.q, target.axes, (i, _HOME)).R
    return Renaud(i, r, R, arm_from(target.along((i, _HOME)), r), J)


def arm_from(target: VelocityTarget, reference: int | None) -> SX:
    """(3, 1) from the origin of a link's frame to that of the frame that moves [m]."""
    if reference is None:
        return zeros()
    place = reference, _HOME
    p = relative_pose(target.tree, target.q, place, target.frame).p
    return expressed(target.tree, target.q, target.axes, place, [p])[0]


def _ranked(
    found: Survey, intermediate: int | None, reference: int | None
) -> list[tuple[int, int | None]]:
    """Pairs of axes and reference, those with the fewest entries that vary first."""
    links = [found.frames[k][0] for k in found.on_the_way]
    places = spread(found.on_the_way)
    axes = places if intermediate is None else [links.index(intermediate)]
    own: list[int | None] = [None, *spread(found.separate_origins())]
    references = own if reference is None else [links.index(reference)]
    rank: list[tuple[tuple[int, int, float], int, int | None]] = []
    for i, r in product(axes, references):
        J = np.concatenate([found.linear(i, r), found.angular(i)], axis=1)
        key = int(varying(J).sum()), int(nonzero(J).sum()), abs(i - len(links) / 2)
        rank.append((key, links[i], None if r is None else links[r]))
    rank.sort(key=itemgetter(0))
    return [(i, r) for _, i, r in rank]


def spread(places: Sequence[int]) -> list[int]:
    """Some of many places, evenly."""
    picks = np.linspace(0, len(places) - 1, min(len(places), _MOST_PLACES)).round().astype(int)
    return [places[k] for k in picks]
