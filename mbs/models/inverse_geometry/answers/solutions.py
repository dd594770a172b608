"""The answer of an inverse geometric model: every posture that takes the frame to a pose."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import overload

import numpy as np

from mbs.errors import ModelError
from mbs.messages import quoted
from mbs.models.inverse_geometry.answers.families import Family
from mbs.models.inverse_geometry.answers.limits import CoordinateLimits
from mbs.models.inverse_geometry.arm import Array
from mbs.models.inverse_geometry.numeric.nearest import Nearest

_MOST_ROWS = 64


@dataclass(frozen=True, slots=True, eq=False)
class Solution:
    """One posture that takes the frame to the wanted pose.

    Attributes:
        q: (nq,) positions [rad or m].
        branch: what tells it from the others: shoulder, elbow and wrist of an arm that has them,
            else the signs of the closed form, else a number.
        residual: largest element of pose(q) - T [m or 1].
        sigma_min: smallest singular value of the Jacobian of the joints that were solved for,
            lengths divided by the arm's length; zero at a singular posture.
        multiplicity: how many roots meet in it; 1 but at a singular posture, 0 where it is one
            of a self-motion.
        within_limits: whether every joint is within its limits.
        windings: (w, nq) postures within the limits that differ from it by whole turns, q
            itself the first; none where a joint is outside.
        family: the self-motion that it stands for, or None.
    """

    q: Array
    branch: str
    residual: float
    sigma_min: float
    multiplicity: int
    within_limits: bool
    windings: Array
    family: Family | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Solutions(Sequence[Solution]):
    """Every posture that takes the frame to the wanted pose, a sequence of `Solution`.

    Attributes:
        system: name of the robot.
        names: of its coordinates, in the order of q.
        solutions: the postures; nearest to the seed first where there was one.
        method: that found them: pieper, paul, general or search; next to singular postures the
            others complete it.
        reason: why there is none, "" where there is one.
        nearest: the reachable pose nearest to the wanted one, and its posture, where there is no
            solution at all.
    """

    system: str
    names: tuple[str, ...]
    solutions: tuple[Solution, ...]
    method: str
    reason: str
    nearest: Nearest | None
    _bounds: CoordinateLimits = field(repr=False)

    def __len__(self) -> int:
        return len(self.solutions)

    @overload
    def __getitem__(self, k: int) -> Solution: ...
    @overload
    def __getitem__(self, k: slice) -> Sequence[Solution]: ...
    def __getitem__(self, k: int | slice) -> Solution | Sequence[Solution]:
        return self.solutions[k]

    @property
    def q(self) -> Array:
        """(m, nq) the postures [rad or m]."""
        return np.array([s.q for s in self.solutions]).reshape(len(self), len(self.names))

    def closest(self, q: Sequence[float] | Array) -> Solution:
        """The solution nearest a posture (nq,) [rad or m], wound as near to it as limits allow.

        Raises:
            ModelError: there is no solution, or the posture is not that many finite numbers.
        """
        if not self.solutions:
            raise ModelError(f"{self.system}: there is no solution; {self.reason}")
        near = _numbers(self.system, q)
        if near.size != len(self.names):
            raise ModelError(
                f"{self.system}: the posture has {near.size} values, the robot has"
                f" {len(self.names)}: {', '.join(self.names)}"
            )
        wound = [replace(s, q=self._bounds.wound(s.q, near)) for s in self.solutions]
        best = min(wound, key=lambda s: float(np.linalg.norm(s.q - near)))
        return replace(best, windings=self._bounds.windings(best.q, near))

    def __str__(self) -> str:
        if not self.solutions:
            return f"{self.system}: no solution. {self.reason}"
        count = "1 solution" if len(self) == 1 else f"{len(self)} solutions"
        head = ("", *self.names, "residual", "sigma", "roots", "limits", "branch")
        rows = [head, *(self._row(k) for k in range(min(len(self), _MOST_ROWS)))]
        widths = [max(len(row[c]) for row in rows) for c in range(len(head) - 1)]
        lines = [
            "  ".join([*(x.rjust(w) for x, w in zip(row[:-1], widths, strict=True)), row[-1]])
            for row in rows
        ]
        if len(self) > _MOST_ROWS:
            lines.append(f"and {len(self) - _MOST_ROWS} more")
        return "\n".join([f"{self.system}: {count} by {self.method}", *(x.rstrip() for x in lines)])

    def _row(self, k: int) -> tuple[str, ...]:
        s = self.solutions[k]
        roots = "any" if s.family else str(s.multiplicity)
        note = s.branch if s.family is None else f"{s.branch} ({s.family})".strip()
        return (
            str(k),
            *(f"{x:.4f}" for x in s.q),
            f"{s.residual:.1e}",
            f"{s.sigma_min:.1e}",
            roots,
            "within" if s.within_limits else "outside",
            note,
        )


def _numbers(system: str, q: object) -> Array:
    try:
        near = np.asarray(q, dtype=float).ravel()
    except (TypeError, ValueError):
        near = np.full(1, np.nan)
    if not np.all(np.isfinite(near)):
        raise ModelError(
            f"{system}: the posture is {quoted(q)}; give a finite number for each coordinate"
        )
    return near
