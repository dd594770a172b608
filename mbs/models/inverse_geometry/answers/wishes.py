"""Which of the solutions a user wants, in which order, and wound by how many turns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mbs.assembly import System
from mbs.models.inverse_geometry.answers.families import Family
from mbs.models.inverse_geometry.answers.limits import CoordinateLimits
from mbs.models.inverse_geometry.answers.reasons import excluded
from mbs.models.inverse_geometry.answers.solutions import Solution, Solutions
from mbs.models.inverse_geometry.arm import Array
from mbs.models.inverse_geometry.numeric.nearest import Nearest


@dataclass(frozen=True, slots=True, eq=False)
class RobotSolution:
    """A solution of the whole robot before whole turns and limits are looked at; see `Solution`."""

    q: Array
    branch: str
    residual: float
    sigma_min: float
    multiplicity: int
    family: Family | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Wishes:
    """What a user asks for beside the pose.

    Attributes:
        system: the robot.
        near: (nq,) the posture that solutions are wound towards; it places the joints that the
            frame does not depend on.
        bounds: limits of the coordinates.
        strict: whether solutions outside the limits are left out.
        seeded: whether the nearest solution comes first.
    """

    system: System
    near: Array
    bounds: CoordinateLimits
    strict: bool
    seeded: bool

    def solutions(
        self,
        drafts: Sequence[RobotSolution],
        method: str,
        reason: str = "",
        nearest: Nearest | None = None,
    ) -> Solutions:
        """The answer.

        Args:
            drafts: every solution.
            method: that found them.
            reason: why there is none, where there is none.
            nearest: the reachable pose nearest to the wanted one, where there is none.
        """
        every = [self._solution(draft) for draft in drafts]
        kept = [s for s in every if s.within_limits or not self.strict]
        if self.seeded:
            kept.sort(key=lambda s: float(np.linalg.norm(s.q - self.near)))
        if every and not kept:
            reason = excluded([self.bounds.outside(s.q) for s in every])
        names = tuple(coordinate.name for coordinate in self.system.coordinates)
        return Solutions(self.system.name, names, tuple(kept), method, reason, nearest, self.bounds)

    def _solution(self, draft: RobotSolution) -> Solution:
        q = self.bounds.wound(draft.q, self.near)
        windings = self.bounds.windings(q, self.near)
        return Solution(
            q,
            draft.branch,
            draft.residual,
            draft.sigma_min,
            draft.multiplicity,
            len(windings) > 0,
            windings,
            draft.family,
        )
