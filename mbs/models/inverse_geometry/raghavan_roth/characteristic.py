"""The matrix of one joint that is singular at every posture of a pose, as expressions of the pose.

The numeric method takes null rows from singular values; here joints 1 and 2 of the loop are
eliminated with pivots chosen once, at the samples, so that the matrix is plain arithmetic.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi
import numpy as np
from casadi import SX

from mbs.errors import NoClosedForm
from mbs.loops.closed_form.ring import Ring, Unknown
from mbs.loops.sequence import Problem
from mbs.models.inverse_geometry.raghavan_roth.arithmetic import (
    dialytic,
    eliminated,
    independent_rows,
    table,
)
from mbs.models.inverse_geometry.raghavan_roth.elimination import at, eliminations
from mbs.models.inverse_geometry.raghavan_roth.pairs import Array
from mbs.models.inverse_geometry.raghavan_roth.pencil import Pencil, pencil, regularity
from mbs.solvers.rank import graded
from mbs.spatial import Pose

_REGULAR = 1e-10
_ANGLES = (0.3, 1.4, -2.1)
_FOLDED, _TRIED = 10.0, 3


@dataclass(frozen=True, slots=True, eq=False)
class Characteristic:
    """A square matrix of the position of one joint, singular wherever the loop closes.

    It is M_0 + M_1 cos q + M_2 sin q of a joint that turns, and M_0 + M_1 r + M_2 r^2, or without
    the last term, of one that slides.

    Attributes:
        matrices: the parts M_k, (n, n) expressions of the problem's given.
        joint: name of the joint.
        place: its number in the problem's x.
        slides: whether it slides.
        regularity: reciprocal condition of the matrix at positions that are no solutions.
    """

    matrices: tuple[SX, ...]
    joint: str
    place: int
    slides: bool
    regularity: float

    def matrix(self, q: SX) -> SX:
        """(n, n) the matrix at a position of the joint [rad or m]."""
        first, *others = self.matrices
        factors = (q, q * q) if self.slides else (casadi.cos(q), casadi.sin(q))
        parts = [SX(f * part) for f, part in zip(factors, others, strict=False)]
        return SX(sum(parts, first))


@dataclass(frozen=True, slots=True, eq=False)
class _Loop:
    """One arrangement of the ring, and its ways at the samples."""

    ring: Ring
    pencil: Pencil
    length: float

    @property
    def merit(self) -> float:
        """More where the pose is not in what is eliminated, which then folds to numbers."""
        constant = all(self.ring.gaps[k].pose.matrix.is_constant() for k in (0, 1, 2))
        return self.pencil.merit * (_FOLDED if constant else 1.0)

    @property
    def ways(self) -> list[Pose]:
        """The ways in units of the length: number k follows joint k."""
        gaps = (*self.ring.gaps[1:], self.ring.gaps[0])
        return [Pose(gap.pose.R, gap.pose.p / self.length) for gap in gaps]


def characteristic(problem: Problem) -> Characteristic:
    """The matrix of the arrangement in which it is farthest from singular.

    Source: Raghavan & Roth 1993; Manocha & Canny 1994.

    Args:
        problem: of six joints.

    Raises:
        NoClosedForm: the problem has not six joints, or the matrix is singular at every position.
    """
    if problem.size != 6:
        raise NoClosedForm(
            f"the loop has {problem.size} joints; the characteristic matrix is for six"
        )
    loops = sorted(_loops(problem), key=lambda loop: graded(loop.merit), reverse=True)
    for loop in loops[:_TRIED]:
        found = _characteristic(problem, loop)
        if found.regularity > _REGULAR:
            return found
    raise NoClosedForm(
        "the matrix of the general inverse geometric model is singular at every posture of joints"
        f" {' '.join(joint.name for joint in problem.ring.joints)}; use method='search'"
    )


def _loops(problem: Problem) -> list[_Loop]:
    """Every arrangement and elimination whose matrix is not singular."""
    length, found = _length(problem), list[_Loop]()
    for ring in (problem.ring, problem.ring.reversed()):
        for first in range(6):
            own = ring.rotated(first)
            slides = np.array([not joint.turns for joint in own.joints])
            if slides[5]:
                continue
            ways = _numbers(problem, own, length)
            pencils = (pencil(elimination, ways) for elimination in eliminations(slides))
            found += [_Loop(own, one, length) for one in pencils if one.regularity > _REGULAR]
    return found


def _length(problem: Problem) -> float:
    """A power of two of about the size of the loop at the samples [m]."""
    places = casadi.horzcat(*(gap.pose.p for gap in problem.ring.gaps))
    total = [float(np.sum(np.linalg.norm(p, axis=0))) for p in problem.at_samples(SX(places))]
    mean = float(np.mean(total))
    return float(2.0 ** round(np.log2(mean))) if mean > 0 else 1.0


def _numbers(problem: Problem, ring: Ring, length: float) -> Array:
    """(samples, 6, 4, 4) the ways of a loop at the samples."""
    gaps = (*ring.gaps[1:], ring.gaps[0])
    stacked = problem.at_samples(SX(casadi.vertcat(*(gap.pose.matrix for gap in gaps))))
    ways = np.array(stacked).reshape(len(stacked), 6, 4, 4)
    ways[..., :3, 3] /= length
    return ways


def _characteristic(problem: Problem, loop: _Loop) -> Characteristic:
    elimination, joint = loop.pencil.elimination, loop.ring.joints[2]
    A = table(elimination, loop.ways)
    columns = len(elimination.first) * len(elimination.second) - 1
    E, values = eliminated(A, np.array(problem.at_samples(A)), columns, loop.pencil.rank)
    count = len(elimination.third)
    parts = [dialytic(elimination, part) for part in casadi.horzsplit(E, E.size2() // count)]
    numbers = elimination.dialytic(np.stack(np.split(values, count, axis=-1), axis=1))
    rows = independent_rows(_spread(numbers), elimination.size)
    return Characteristic(
        _in_joint([part[rows, :] for part in parts], loop),
        joint.name,
        _place(joint),
        not joint.turns,
        regularity(numbers[:, :, rows]),
    )


def _spread(parts: Array) -> Array:
    """The matrices at some angles, one after the other."""
    count = len(_ANGLES)
    return at(np.repeat(parts, count, axis=0), np.tile(np.array(_ANGLES), len(parts)))


def _in_joint(parts: list[SX], loop: _Loop) -> tuple[SX, ...]:
    """The parts with 1, cos q, sin q, or with the powers of r in metres."""
    joint = loop.ring.joints[2]
    if joint.turns:
        return parts[0], parts[1], joint.sign * parts[2]
    if len(parts) == 3:
        parts = [parts[0] + parts[1], 2 * parts[2], parts[0] - parts[1]]
    return tuple((joint.sign / loop.length) ** k * part for k, part in enumerate(parts))


def _place(joint: Unknown) -> int:
    if joint.place is None:
        raise NoClosedForm(f"joint {joint.name} has no place among the unknowns of the problem")
    return joint.place
