"""The answer of an inverse geometric model: every configuration that takes the frame to a pose."""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import overload

import numpy as np
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.closed_forms.arm import Arm, Array
from mbs.closed_forms.arm_search import Nearest
from mbs.errors import ModelError
from mbs.models.inverse_geometry.self_motions import Family
from mbs.models.inverse_geometry.target import Target
from mbs.numbers import has_boolean
from mbs.text import did_you_mean, quoted

# Joint limits, and the whole turns by which a configuration may be wound within them.


Given = Mapping[str, tuple[float, float] | None]
"""Limits by the name of the coordinate, None for a coordinate without."""

_TURN = 2 * math.pi
WITHIN = 1e-9
"""Distance beyond a limit [rad or m] that is rounding: solutions that lie on a limit are within."""
_TURNS = 4
"""To either side of the position nearest the wanted one, at most."""
_MOST_WINDINGS = 64


@dataclass(frozen=True, slots=True, eq=False)
class CoordinateLimits:
    """Limits of every coordinate of a system.

    Attributes:
        names: of the coordinates.
        low, high: (nq,) limits [rad or m], infinite where there is none.
        turns: (nq,) which of them may be changed by whole turns.
    """

    names: tuple[str, ...]
    low: Array
    high: Array
    turns: NDArray[np.bool_]

    def outside(self, q: Array) -> list[str]:
        """The names of the coordinates that no whole number of turns brings within limits."""
        return [self.names[k] for k in range(q.size) if not self._options(k, q[k], 0.0)]

    def wound(self, q: Array, near: Array) -> tuple[Array, NDArray[np.bool_]]:
        """`wrap_to_limits` of configurations (m, nq), and (m,) which of them are within limits."""
        low, high = self.low - WITHIN, self.high + WITHIN
        away = (near - q) / _TURN
        # of two that are as near, the lower one as in `_options`
        free = np.isinf(low) & np.isinf(high)
        turns = np.where(free, np.rint(away), np.ceil(away - 0.5))
        first, last = np.ceil((low - q) / _TURN), np.floor((high - q) / _TURN)
        within = np.where(self.turns, first <= last, (low <= q) & (q <= high))
        turns = np.where(within, np.minimum(np.maximum(turns, first), last), np.rint(away))
        return np.where(self.turns, q + _TURN * turns, q), np.all(within, axis=1, keepdims=False)

    def windings(self, q: Array, near: Array) -> Array:
        """Configurations that differ from q by whole turns and are within the limits.

        Args:
            q: (nq,) configuration [rad or m].
            near: (nq,) configuration by whose distance they are sorted.

        Returns:
            (w, nq), at most 64 of them; none where a coordinate cannot be brought within.
        """
        options = [self._options(k, q[k], near[k]) for k in range(q.size)]
        while math.prod(len(option) for option in options) > _MOST_WINDINGS**2:
            longest = max(range(q.size), key=lambda k: len(options[k]))
            options[longest] = options[longest][:-1]
        found = np.array(list(itertools.product(*options))).reshape(-1, q.size)
        order = np.argsort(np.linalg.norm(found - near, axis=1), kind="stable")
        nearest: Array = found[order[:_MOST_WINDINGS]]
        return nearest

    def wrap_to_limits(self, q: Array, near: Array) -> Array:
        """(nq,) q changed by whole turns: each coordinate within limits if it can, near `near`."""
        wrapped: Array = self.wound(q[None], near)[0][0]
        return wrapped

    def _options(self, k: int, value: float, near: float) -> list[float]:
        """Positions of one coordinate within its limits, the nearest first."""
        low, high = self.low[k] - WITHIN, self.high[k] + WITHIN
        if not self.turns[k]:
            return [value] if low <= value <= high else []
        if math.isinf(low) and math.isinf(high):
            return [value + _TURN * round((near - value) / _TURN)]
        first = -math.inf if math.isinf(low) else math.ceil((low - value) / _TURN)
        last = math.inf if math.isinf(high) else math.floor((high - value) / _TURN)
        if first > last:
            return []
        if first == last:
            return [value + _TURN * first]
        nearest = min(max(round((near - value) / _TURN), first), last)
        turns = range(int(max(first, nearest - _TURNS)), int(min(last, nearest + _TURNS)) + 1)
        return sorted((value + _TURN * m for m in turns), key=lambda x: abs(x - near))


def bounds(
    system: System, given: bool | Given | None = None, turning: Iterable[int] | None = None
) -> CoordinateLimits:
    """The limits of a system's coordinates, some of them replaced.

    Args:
        system: whose coordinates.
        given: (lowest, highest) [rad or m] by name, None for a coordinate that has none; True,
            False and None replace nothing.
        turning: numbers of the revolute coordinates that may be changed by whole turns, all of
            them when left out.

    Raises:
        ModelError: there is no such coordinate, or limits are no dict or no pair of numbers.
    """
    names = tuple(coordinate.name for coordinate in system.coordinates)
    own = {c.name: c.limits for c in system.coordinates}
    for name, pair in _replacing(system, given).items():
        if name not in own:
            raise ModelError(
                f"{system.name}: limits are given for {quoted(name)}, which is no coordinate;"
                f" {did_you_mean(name, names)}"
            )
        own[name] = None if pair is None else _pair(system, name, pair)
    pairs = [own[name] or (-math.inf, math.inf) for name in names]
    low, high = (np.array([pair[k] for pair in pairs]) for k in (0, 1))
    indices = set(range(len(names)) if turning is None else turning)
    turns = [c.kind == "revolute" and k in indices for k, c in enumerate(system.coordinates)]
    return CoordinateLimits(names, low, high, np.array(turns, dtype=bool))


def leaves_out(given: bool | Given | None) -> bool:
    """Whether limits that a user gives leave out what is beyond them."""
    return given is not None and given is not False


def _replacing(system: System, given: object) -> Given:
    if isinstance(given, Mapping):
        return given
    if given is None or isinstance(given, bool):
        return {}
    raise ModelError(
        f"{system.name}: limits is {quoted(given)}; give True for those of the robot, or a dict of"
        " names to (lowest, highest)"
    )


def _pair(system: System, name: str, pair: object) -> tuple[float, float]:
    try:
        low, high = (math.nan if has_boolean(x) else float(x) for x in pair)  # type: ignore[attr-defined]
    except (TypeError, ValueError):
        low = high = math.nan
    if not low <= high:
        raise ModelError(
            f"{system.name}: the limits of {name} are {quoted(pair)}; give (lowest, highest), or"
            " None for none"
        )
    return low, high


def _remainder(x: Array) -> Array:
    return np.asarray(np.mod(x + np.pi, _TURN) - np.pi)


_MOST_ROWS = 64


@dataclass(frozen=True, slots=True, eq=False)
class Solution:
    """One configuration that takes the frame to the target pose.

    Attributes:
        q: (nq,) positions [rad or m].
        branch: what tells it from the others: shoulder, elbow and wrist of an arm that has them,
            else the signs of the closed form, else a number.
        residual: largest element of pose(q) - T [m or 1].
        sigma_min: smallest singular value of the Jacobian of the joints that were solved for,
            lengths divided by the arm's length; zero at a singular configuration.
        multiplicity: how many roots meet in it; 1 but at a singular configuration, 0 where it is
            one of a self-motion; an upper bound where two singular configurations meet.
        within_limits: whether every joint is within its limits.
        family: the self-motion that it stands for, or None.
        undecided: whether double precision does not decide whether it is one solution, several or
            none; rounding of the pose may change the list there.
    """

    q: Array
    branch: str
    residual: float
    sigma_min: float
    multiplicity: int
    within_limits: bool
    _windings: Callable[[], Array] = field(repr=False)
    family: Family | None = None
    undecided: bool = False

    @property
    def windings(self) -> Array:
        """(w, nq) what is within limits and differs from q by whole turns, q itself the first.

        None where a joint is outside.
        """
        return self._windings()


class RegularSolutions(Sequence[Solution]):
    """The solutions of a regular pose as arrays; each is a `Solution` when it is asked for."""

    __slots__ = (
        "_arm",
        "_bounds",
        "_branches",
        "_made",
        "_near",
        "_own",
        "_residual",
        "_sigma",
        "_within",
        "q",
    )

    def __init__(
        self,
        q: Array,
        branches: Sequence[str],
        residual: Array,
        arm: Arm,
        own: Array,
        bounds: CoordinateLimits,
        near: Array,
        within: NDArray[np.bool_],
    ) -> None:
        """Take them.

        Args:
            q: (m, nq) configurations, wound towards `near` within limits [rad or m].
            branches: (m,) their names.
            residual: (m,) largest element of pose(q) - T [m or 1].
            arm: the chain in numbers.
            own: (m, n) configurations of the chain [rad or m].
            bounds: limits of the coordinates.
            near: (nq,) configuration that others are wound towards.
            within: (m,) whether each is within limits.
        """
        self.q, self._branches, self._residual = q, branches, residual
        self._arm, self._own, self._bounds, self._near = arm, own, bounds, near
        self._within = within
        self._sigma: Array | None = None
        self._made: dict[int, Solution] = {}

    def __len__(self) -> int:
        return len(self.q)

    @overload
    def __getitem__(self, k: int) -> Solution: ...
    @overload
    def __getitem__(self, k: slice) -> Sequence[Solution]: ...
    def __getitem__(self, k: int | slice) -> Solution | Sequence[Solution]:
        if isinstance(k, slice):
            return tuple(self[m] for m in range(len(self))[k])
        number = range(len(self))[k]
        if number not in self._made:
            self._made[number] = self._solution(number)
        return self._made[number]

    def _solution(self, k: int) -> Solution:
        if self._sigma is None:  # which does not depend on the pose
            self._sigma = Target(self._arm, np.eye(4)).singular_values(self._own)[:, -1]
        return Solution(
            self.q[k],
            self._branches[k],
            float(self._residual[k]),
            float(self._sigma[k]),
            1,
            bool(self._within[k]),
            partial(self._bounds.windings, self.q[k], self._near),
        )


@dataclass(frozen=True, slots=True, eq=False)
class Solutions(Sequence[Solution]):
    """Every configuration that takes the frame to the target pose, a sequence of `Solution`.

    Attributes:
        system: name of the robot.
        names: of its coordinates, in the order of q.
        solutions: the configurations; nearest to the seed first where there was one.
        method: that found them: pieper, paul, general or search; next to singular configurations
            the others complete it.
        reason: why there is none, "" where there is one.
        nearest: the reachable pose nearest to the wanted one, and its configuration, where there
            is no solution at all.
    """

    system: str
    names: tuple[str, ...]
    solutions: Sequence[Solution]
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
        """(m, nq) the configurations [rad or m]."""
        if isinstance(self.solutions, RegularSolutions):
            return self.solutions.q.copy()
        return np.array([s.q for s in self.solutions]).reshape(len(self), len(self.names))

    @property
    def undecided(self) -> bool:
        """Whether some solution is undecided: rounding of the pose may change the list."""
        return any(s.undecided for s in self.solutions)

    def closest(self, q: Sequence[float] | Array) -> Solution:
        """The solution nearest a configuration (nq,) [rad or m], wound as limits allow.

        Raises:
            ModelError: there is no solution, or the configuration is not that many finite numbers.
        """
        if not self.solutions:
            raise ModelError(f"{self.system}: there is no solution; {self.reason}")
        near = _numbers(self.system, q)
        if near.size != len(self.names):
            raise ModelError(
                f"{self.system}: the configuration has {near.size} values, the robot has"
                f" {len(self.names)}: {', '.join(self.names)}"
            )
        wound = [replace(s, q=self._bounds.wrap_to_limits(s.q, near)) for s in self.solutions]
        best = min(wound, key=lambda s: float(np.linalg.norm(s.q - near)))
        return replace(best, _windings=partial(self._bounds.windings, best.q, near))

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
        note += ", undecided" if s.undecided else ""
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
            f"{system}: the configuration is {quoted(q)}; give a finite number for each coordinate"
        )
    return near


# Why no configuration takes the frame to a pose.


_REASON_STARTS, _STEPS, _SEED = 40, 60, 20260109
_REACHED = 1e-9
"""Largest row, free of units, of equations that have a solution: damped steps end far below, and a
pose out of reach by less, a nanometre of a metre, is told by its distance."""
_SMALLEST = 1e-9
"""Distance [m] and angle [rad] that are told; below it is rounding."""


def unreachable(target: Target, nearest: Nearest) -> str:
    """Why a pose has no solution at all.

    Args:
        target: the target pose.
        nearest: the reachable pose nearest to it.
    """
    arm = target.arm
    away = f"the nearest reachable pose is {apart(nearest.distance, nearest.angle)}"
    position, orientation = reaches_position(target), reaches_orientation(target)
    if arm.size < 6 and position:
        joints = "1 joint" if arm.size == 1 else f"{arm.size} joints"
        also = "and so is the orientation alone" if orientation else "but not the orientation"
        return (
            f"the pose is off the manifold that {joints} can reach: its position alone is"
            f" reached, {also}; {away}"
        )
    if position:
        return f"out of reach: the position is reached, but not with this orientation; {away}"
    also = "is reached alone" if orientation else "is not reached either"
    return f"out of reach: the position is too far or too near, the orientation {also}; {away}"


def apart(distance: float, angle: float) -> str:
    """How far two poses are apart, in words; what is but rounding is left out.

    Args:
        distance: between their origins [m].
        angle: between their orientations [rad].
    """
    parts = [f"{distance:.4g} m away"] if distance > _SMALLEST else []
    if angle > _SMALLEST:
        parts.append(f"rotated by {math.degrees(angle):.4g} degrees")
    return " and ".join(parts) or "within rounding of it"


def excluded(outside: Sequence[Sequence[str]]) -> str:
    """Why no solution is left, from the names of the joints outside their limits in each."""
    count = len(outside)
    joints = Counter(name for names in outside for name in names)
    most = [f"{name} in {k} of {count}" for name, k in joints.most_common()]
    found = "the only solution is" if count == 1 else f"all {count} solutions are"
    return f"limits: {found} outside; {', '.join(most)}"


def reaches_position(target: Target) -> bool:
    """Whether the frame's origin can get to the wanted place, however it is turned."""
    return _reaches(target, slice(0, 3))


def reaches_orientation(target: Target) -> bool:
    """Whether the frame can be turned as wanted, wherever it is."""
    return _reaches(target, slice(3, 6))


def _reaches(target: Target, rows: slice) -> bool:
    """Whether some rows of the equations alone have a solution.

    Levenberg-Marquardt from several configurations at once.
    """
    n = target.arm.size
    rng = np.random.default_rng(_SEED)
    x = rng.uniform(-math.pi, math.pi, (_REASON_STARTS, n))
    # of rows of about one: little, as starts are many
    damping = np.full(_REASON_STARTS, 1e-2)
    e, J = (part[:, rows] for part in target.excess(x))
    for _ in range(_STEPS):
        A = np.swapaxes(J, 1, 2) @ J + damping[:, None, None] * np.eye(n)
        step = np.linalg.solve(A, np.swapaxes(J, 1, 2) @ e[..., None])[..., 0]
        e_trial, J_trial = (part[:, rows] for part in target.excess(x - step))
        better = np.sum(e_trial**2, axis=1) < np.sum(e**2, axis=1)
        x = np.where(better[:, None], x - step, x)
        e, J = np.where(better[:, None], e_trial, e), np.where(better[:, None, None], J_trial, J)
        # less would be rounding beside entries of J'J of about one
        damping = np.where(better, np.maximum(damping / 5, 1e-14), damping * 4)
    return bool(np.min(np.max(np.abs(e), axis=1)) < _REACHED)


# Which of the solutions a user wants, in which order, and wound by how many turns.


@dataclass(frozen=True, slots=True, eq=False)
class RobotSolution:
    """A solution of the whole robot before whole turns and limits are looked at; see `Solution`."""

    q: Array
    branch: str
    residual: float
    sigma_min: float
    multiplicity: int
    family: Family | None = None
    undecided: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Wishes:
    """What a user asks for beside the pose.

    Attributes:
        system: the robot.
        near: (nq,) the configuration that solutions are wound towards; it places the joints that
            the frame does not depend on.
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
        wound, within = self.bounds.wound(draft.q[None], self.near)
        q = wound[0]
        return Solution(
            q,
            draft.branch,
            draft.residual,
            draft.sigma_min,
            draft.multiplicity,
            bool(within[0]),
            partial(self.bounds.windings, q, self.near),
            draft.family,
            draft.undecided,
        )
