"""What the method needs to know of an arm: its best arrangement, chosen once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mbs.errors import ModelError
from mbs.models.inverse_geometry.arm import Arm
from mbs.models.inverse_geometry.raghavan_roth.arrangement import (
    Arrangement,
    arrangements,
    loop_length,
)
from mbs.models.inverse_geometry.raghavan_roth.elimination import eliminations
from mbs.models.inverse_geometry.raghavan_roth.pairs import Array
from mbs.models.inverse_geometry.raghavan_roth.pencil import Pencil, pencil

_SEED, _POSES = 20260211, 2
_OFFSETS = np.array([0.0, 0.0, 0.0, 0.7345, -1.1127, 0.0])
_REGULAR = 1e-10


@dataclass(frozen=True, slots=True, eq=False)
class Prepared:
    """An arm, and the arrangement of its loop in which the matrix is farthest from singular.

    Attributes:
        arrangement: of the loop.
        pencil: that makes the matrix.
    """

    arrangement: Arrangement
    pencil: Pencil

    @property
    def regularity(self) -> float:
        """Reciprocal condition of the matrix at angles that are no solutions, in [0, 1]."""
        return self.pencil.regularity

    @property
    def regular(self) -> bool:
        """Whether the method holds for the arm; where not, use another one.

        It may hold for an arm that is redundant in one direction and short of another, such as one
        with four parallel axes: its postures make families, of which candidates are samples.
        """
        return self.regularity > _REGULAR


def prepare(arm: Arm) -> Prepared:
    """The best arrangement of an arm, by the condition of its matrix at poses that it reaches.

    Source: Raghavan & Roth 1993; the choice by condition is new here.

    Args:
        arm: of six joints.

    Raises:
        ModelError: the arm has not six joints, or none that turns.
    """
    if arm.size != 6 or bool(np.all(arm.prismatic)):
        raise ModelError(
            f"arm {' '.join(arm.names)}: the general inverse geometric model is for six joints of"
            " which one turns at least; use method='search'"
        )
    T = _reached(arm)
    tried = [
        Prepared(loop, pencil(elimination, loop.all_ways(T)))
        for loop in arrangements(arm, _OFFSETS)
        for elimination in eliminations(loop.prismatic)
    ]
    return max(tried, key=lambda prepared: prepared.pencil.merit)


def _reached(arm: Arm) -> Array:
    """(2, 4, 4) poses of generic postures."""
    rng = np.random.default_rng(_SEED)
    turns = rng.uniform(-np.pi, np.pi, (_POSES, 6))
    slides = loop_length(arm) * rng.uniform(0.2, 0.8, (_POSES, 6))
    return arm.pose(np.where(arm.prismatic, slides, turns))
