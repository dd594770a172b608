"""What a search knows of a loop: joints, and sums of the angles of joints."""

from __future__ import annotations

from dataclasses import dataclass, replace

import casadi
import numpy as np
from casadi import SX, Function
from numpy.typing import NDArray

from mbs.loops.closed_form.ring import Ring
from mbs.loops.sequence import Problem

Matrix = NDArray[np.float64]
Members = tuple[tuple[int, int], ...]


@dataclass(frozen=True, slots=True)
class Variable:
    """A slide, an angle, or a sum of angles with signs.

    Attributes:
        slides: whether it is the length of a slide.
        members: number of each joint in the ring, and its sign; the first sign is +1.
    """

    slides: bool
    members: Members

    @property
    def single(self) -> bool:
        """Whether it is the variable of one joint."""
        return len(self.members) == 1


@dataclass(frozen=True, slots=True, eq=False)
class Samples:
    """The loop in numbers, lengths divided by one of its own.

    Attributes:
        gaps: (samples, n, 4, 4) poses of the gaps.
        q: (samples, n) positions of the joints, in the order of the ring.
    """

    gaps: Matrix
    q: Matrix


@dataclass(frozen=True, slots=True, eq=False)
class Knowledge:
    """What is known at one stage of the search.

    Attributes:
        problem: of the loop, whose joints stand in the order of `ring`.
        ring: the loop, the origins of its frames where neighbouring axes are nearest.
        samples: the same in numbers.
        known: numbers of the known joints in the ring.
        sums: known sums of angles, and their places in x.
    """

    problem: Problem
    ring: Ring
    samples: Samples
    known: frozenset[int] = frozenset()
    sums: tuple[tuple[Variable, int], ...] = ()

    @property
    def unknown(self) -> list[int]:
        """Numbers of the unknown joints."""
        return [k for k in range(len(self.ring.joints)) if k not in self.known]

    def place(self, variable: Variable) -> int:
        """The place of a variable in x; of a sum the next free one."""
        if variable.single:
            place = self.ring.joints[variable.members[0][0]].place
            return -1 if place is None else place
        return self.problem.size + len(self.sums)

    def can_hold(self, variable: Variable) -> bool:
        """Whether a variable is new, and there is a place for it."""
        held = [known.members for known, _, _ in self.open_sums()]
        return variable.single or (
            variable.members not in held and self.place(variable) < self.problem.x.numel()
        )

    def name(self, variable: Variable) -> str:
        """The name of a variable as an equation shows it."""
        if variable.single:
            return self.ring.joints[variable.members[0][0]].name
        return str(self.problem.x[self.place(variable)])

    def with_joint(self, variable: Variable) -> Knowledge:
        """The same with one more variable."""
        if variable.single:
            return replace(self, known=self.known | {variable.members[0][0]})
        return replace(self, sums=(*self.sums, (variable, self.place(variable))))

    def open_sums(self) -> list[tuple[Variable, SX, Matrix]]:
        """Known sums of the unknown joints: expression, and values at the samples."""
        return [_rest(self, *known) for known in self.sums]

    def position(self, k: int) -> SX:
        """The symbol of joint number k."""
        return SX(self.problem.x[self.place(Variable(False, ((k, 1),)))])


def _rest(knowledge: Knowledge, variable: Variable, place: int) -> tuple[Variable, SX, Matrix]:
    """What is left of a sum when its known members are taken away."""
    value = SX(knowledge.problem.x[place])
    members = [member for member in variable.members if member[0] not in knowledge.known]
    for k, sign in variable.members:
        if k in knowledge.known:
            value -= sign * knowledge.position(k)
    if members and members[0][1] < 0:
        members, value = [(k, -sign) for k, sign in members], -value
    at_samples = np.zeros(len(knowledge.samples.q))
    for k, sign in members:
        at_samples = at_samples + sign * knowledge.samples.q[:, k]
    return Variable(False, tuple(members)), value, at_samples


def beginning(problem: Problem, ring: Ring) -> Knowledge:
    """Nothing is known yet."""
    return Knowledge(problem, ring, _samples(problem, ring))


def _samples(problem: Problem, ring: Ring) -> Samples:
    stacked = casadi.vertcat(*(gap.pose.matrix for gap in ring.gaps))
    function = Function("gaps", [problem.given], [casadi.densify(stacked)])
    n, places = len(ring.joints), [joint.place or 0 for joint in ring.joints]
    gaps = np.array([np.array(function(given)).reshape(n, 4, 4) for _, given in problem.samples])
    q = np.array([x[places] for x, _ in problem.samples])
    length = float(np.mean(np.linalg.norm(gaps[..., :3, 3], axis=-1))) or 1.0
    gaps[..., :3, 3] /= length
    slides = [not joint.turns for joint in ring.joints]
    return Samples(gaps, np.where(slides, q / length, q))
