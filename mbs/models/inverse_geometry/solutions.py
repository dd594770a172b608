"""Result types of the inverse geometric model, joint limits and error reasons."""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, overload

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

# Joint limits, and shifts of angles by full revolutions within the limits.


Given = Mapping[str, tuple[float, float] | None]
"""Limits (lower, upper) by name of the coordinate [rad or m], None for an unlimited coordinate."""

_TURN = 2 * math.pi
WITHIN = 1e-9
"""Distance beyond a limit [rad or m] that counts as rounding: solutions on a limit are valid."""
_TURNS = 4
"""Maximum number of revolutions to either side of the nearest position of a coordinate."""
_MOST_WINDINGS = 64
"""Maximum number of configurations that differ by full revolutions, as six joints of two each."""


@dataclass(frozen=True, slots=True, eq=False)
class CoordinateLimits:
    """Limits of all coordinates of a system.

    Attributes:
        names: names of the coordinates.
        low, high: (nq,) limits [rad or m], infinite for unlimited coordinates.
        turns: (nq,) whether each coordinate may be shifted by full revolutions.
    """

    names: tuple[str, ...]
    low: Array
    high: Array
    turns: NDArray[np.bool_]

    def outside(self, q: Array) -> list[str]:
        """Return the names of the coordinates of q (nq,) that are outside in every revolution."""
        return [self.names[k] for k in range(q.size) if not self._options(k, q[k], 0.0)]

    def wound(self, q: Array, near: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Return `wrap_to_limits` of q (m, nq), and (m,) whether each is within the limits."""
        low, high = self.low - WITHIN, self.high + WITHIN
        away = (near - q) / _TURN
        # of two equally near positions the lower, as in `_options`
        free = np.isinf(low) & np.isinf(high)
        turns = np.where(free, np.rint(away), np.ceil(away - 0.5))
        first, last = np.ceil((low - q) / _TURN), np.floor((high - q) / _TURN)
        within = np.where(self.turns, first <= last, (low <= q) & (q <= high))
        turns = np.where(within, np.minimum(np.maximum(turns, first), last), np.rint(away))
        return np.where(self.turns, q + _TURN * turns, q), np.all(within, axis=1, keepdims=False)

    def windings(self, q: Array, near: Array) -> Array:
        """Return the configurations within limits that differ from q by full revolutions.

        Args:
            q: (nq,) configuration [rad or m].
            near: (nq,) configuration; the result is sorted by the distance from it.

        Returns:
            Configurations (w, nq), w at most 64; w = 0 if a coordinate is always outside.
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
        """Shift the angles of q (nq,) by full revolutions into the limits, nearest to `near`.

        Coordinates that are always outside are only shifted towards `near`.
        """
        wrapped: Array = self.wound(q[None], near)[0][0]
        return wrapped

    def _options(self, k: int, value: float, near: float) -> list[float]:
        """Return the positions of coordinate k within its limits, the nearest first."""
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
    """Return the limits of the coordinates of a system, with replacements.

    Args:
        system: system with its coordinate limits.
        given: (lower, upper) [rad or m] by name, or None for an unlimited coordinate. True, False
            and None replace nothing.
        turning: indices of the revolute coordinates that may be shifted by full revolutions;
            default is all.

    Raises:
        ModelError: a coordinate is unknown, or limits are no dict or no pair of numbers.
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
    """Whether the argument `limits` drops solutions beyond the limits."""
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


# Types that pass solutions through the pipeline: see the docstring of the package.


_MOST_ROWS = 64
"""Largest number of solutions in the text of `Solutions`."""


class PoseDraft:
    """Configurations of a chain for one pose, before they are verified.

    Attributes:
        q: (m, n) joint positions of the chain [rad or m], possibly with copies.
        residual: (m,) largest absolute difference of an element from the target pose.
        certain: whether the list is complete and without copies. It is not certified near a
            singular configuration.
        method: name of the method.
        near: (k, n) configurations with a small residual that Newton's method did not improve to
            solutions. They are starts of a search along a valley.
    """

    __slots__ = ("_branch", "_names", "certain", "method", "near", "q", "residual")

    def __init__(
        self,
        q: Array,
        residual: Array,
        names: Mapping[int, str] | Sequence[str],
        branch: NDArray[Any] | None,
        certain: bool,
        method: str,
        near: Array | None = None,
    ) -> None:
        """Store the configurations and their names.

        `names` are the names of the branches, by the index that `branch` (m,) contains for each
        configuration. Without `branch`, they are the names of the configurations.
        """
        self.q, self.residual, self.certain, self.method = q, residual, certain, method
        self._names, self._branch, self.near = names, branch, near

    def __len__(self) -> int:
        """Return the number of configurations."""
        return len(self.q)

    @property
    def labels(self) -> tuple[str, ...]:
        """Name of the branch of each configuration, "" without a branch."""
        if self._branch is None:
            return tuple(self._names)  # type: ignore[arg-type]
        return tuple([self._names[b] for b in self._branch.tolist()])


def _no_windings() -> Array:
    return np.empty((0, 0))


# Until `answer` completes it, q of a solution contains the positions (n,) of a chain, and residual,
# singular value and limits are not known.
@dataclass(frozen=True, slots=True, eq=False)
class Solution:
    """Configuration at which the frame has the target pose.

    Attributes:
        q: (nq,) positions [rad or m].
        branch: name of the branch: shoulder, elbow and wrist if the arm has them, else the signs
            of the closed form, else a number.
        residual: largest absolute element of pose(q) - T [m or 1].
        sigma_min: smallest singular value of the Jacobian of the joints that were solved for,
            lengths divided by the arm length; zero at a singular configuration.
        multiplicity: number of coinciding roots: 1 at a regular configuration, 0 on a self-motion;
            an upper bound if two singular configurations meet.
        within_limits: whether every joint is within its limits.
        family: self-motion through q, or None.
        undecided: whether double precision cannot decide if there are one, several or no solutions
            near q. Rounding of the pose may change the list of solutions.
    """

    q: Array
    branch: str
    residual: float = math.nan
    sigma_min: float = math.nan
    multiplicity: int = 1
    within_limits: bool = True
    _windings: Callable[[], Array] = field(default=_no_windings, repr=False)
    family: Family | None = None
    undecided: bool = False
    _meeting: frozenset[str] = field(default=frozenset(), repr=False)
    """Names of all closed-form branches that meet in q."""
    _at_most: bool = field(default=False, repr=False)
    """Whether the multiplicity is an upper bound."""

    @property
    def windings(self) -> Array:
        """Configurations (w, nq) within limits that differ from q by full revolutions.

        q itself is the first. Empty if a joint is outside its limits.
        """
        return self._windings()


class RegularSolutions(Sequence[Solution]):
    """Solutions of a certain draft, stored as arrays; each `Solution` is created on access."""

    __slots__ = (
        "_arm",
        "_draft",
        "_made",
        "_names",
        "_options",
        "_order",
        "_sigma",
        "_within",
        "q",
    )

    def __init__(
        self,
        q: Array,
        within: NDArray[np.bool_],
        draft: PoseDraft,
        order: NDArray[np.intp],
        arm: Arm,
        options: SolveOptions,
    ) -> None:
        """Store the solutions.

        Args:
            q: (k, nq) configuration of each row of the draft, shifted within limits [rad or m].
            within: (k,) whether each configuration is within limits.
            draft: configurations of the chain.
            order: (m,) rows of the draft that are solutions, in their order.
            arm: numeric geometry of the chain.
            options: limits, and the configuration towards which angles were shifted.
        """
        self.q, self._within, self._draft, self._order = q[order], within, draft, order
        self._arm, self._options = arm, options
        self._names: tuple[str, ...] = ()
        self._sigma = np.zeros(0)
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
        if not self._names:  # singular values do not depend on the pose
            self._names, own = self._draft.labels, self._draft.q[self._order]
            self._sigma = Target(self._arm, np.eye(4)).singular_values(own)[:, -1]
        row, options = int(self._order[k]), self._options
        return Solution(
            self.q[k],
            self._names[row],
            float(self._draft.residual[row]),
            float(self._sigma[k]),
            within_limits=bool(self._within[row]),
            _windings=partial(options.bounds.windings, self.q[k], options.near),
        )


@dataclass(frozen=True, slots=True, eq=False)
class Solutions(Sequence[Solution]):
    """All configurations at which the frame has the target pose: a sequence of `Solution`.

    Attributes:
        system: name of the robot.
        names: names of the coordinates, in the order of q.
        solutions: configurations, sorted by distance from the seed if there was one.
        method: method that computed them: pieper, paul, general or search. Near singular
            configurations other methods are used in addition.
        reason: text that explains why there is no solution, "" if there is one.
        nearest: reachable pose nearest to an unreachable target, with its configuration, or None.
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
        """Configurations (m, nq) of all solutions [rad or m]."""
        if isinstance(self.solutions, RegularSolutions):
            return self.solutions.q.copy()
        return np.array([s.q for s in self.solutions]).reshape(len(self), len(self.names))

    @property
    def undecided(self) -> bool:
        """Whether some solution is undecided: rounding of the pose may change the list."""
        return any(s.undecided for s in self.solutions)

    def closest(self, q: Sequence[float] | Array) -> Solution:
        """Return the solution nearest to a configuration q (nq,) [rad or m].

        Angles are shifted by full revolutions towards q, within the limits.

        Raises:
            ModelError: there is no solution, or q does not consist of nq finite numbers.
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


@dataclass(frozen=True, slots=True, eq=False)
class ManySolutions:
    """Solutions of N poses: one row per pose, one column per branch.

    With S positions of redundant joints, the columns of the first position are followed by the
    columns of the second position, and so on. Use `q.reshape(N, S, -1, nq)` to separate them.

    Attributes:
        q: (N, S branches, nq) configurations [rad or m]; arbitrary finite values if not valid.
        valid: (N, S branches) whether the column contains a solution.
        residual: (N, S branches) largest absolute difference of an element between the pose of q
            and the target, in m and 1; infinite in unused columns.
        labels: names of the columns; empty texts without a closed form.
        searched: (N,) whether the pose was solved individually at some position of redundant
            joints. Its configurations are in the columns of the nearest branches.
        undecided: (N,) whether double precision cannot decide the list of solutions at some
            position of redundant joints; see `Solutions.undecided`.
        samples: number S of positions of redundant joints, 1 without redundant joints.
    """

    q: Array
    valid: NDArray[np.bool_]
    residual: Array
    labels: tuple[str, ...]
    searched: NDArray[np.bool_]
    undecided: NDArray[np.bool_]
    samples: int = 1

    def __len__(self) -> int:
        """Return the number of poses."""
        return len(self.q)

    @property
    def count(self) -> NDArray[np.int64]:
        """Number of solutions of each pose, (N,)."""
        count: NDArray[np.int64] = np.sum(self.valid, axis=1, dtype=np.int64)
        return count

    def of(self, k: int) -> Array:
        """Return the solutions (m, nq) of pose k, counted from 0 [rad or m]."""
        configurations: Array = self.q[k, self.valid[k]]
        return configurations


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


# Reasons why a pose has no solution.


_REASON_STARTS, _STEPS, _SEED = 40, 60, 20260109
"""Random starts, and damped steps of each, that decide whether position or orientation alone can be
reached. They decide only between error texts. Seed of the random numbers."""
_REACHED = 1e-9
"""Largest dimensionless error of equations that have a solution. Damped steps end far below. A pose
that is out of reach by less (1 nm per metre) is reported by its distance."""
_SMALLEST = 1e-9
"""Smallest distance [m] and angle [rad] that are reported; smaller values are rounding."""


def unreachable(target: Target, nearest: Nearest) -> str:
    """Return the text that explains why a pose cannot be reached.

    Args:
        target: target pose of the arm.
        nearest: reachable pose nearest to the target.
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
    """Return the text of the difference of two poses, without values below `_SMALLEST`.

    Args:
        distance: distance of the origins [m].
        angle: rotation angle between the orientations [rad].
    """
    parts = [f"{distance:.4g} m away"] if distance > _SMALLEST else []
    if angle > _SMALLEST:
        parts.append(f"rotated by {math.degrees(angle):.4g} degrees")
    return " and ".join(parts) or "within rounding of it"


def excluded(outside: Sequence[Sequence[str]]) -> str:
    """Return the text that limits exclude all solutions.

    Args:
        outside: for each solution the names of the joints outside their limits.
    """
    count = len(outside)
    joints = Counter(name for names in outside for name in names)
    most = [f"{name} in {k} of {count}" for name, k in joints.most_common()]
    found = "the only solution is" if count == 1 else f"all {count} solutions are"
    return f"limits: {found} outside; {', '.join(most)}"


def reaches_position(target: Target) -> bool:
    """Whether the origin of the frame can reach the target position in any orientation."""
    return _reaches(target, slice(0, 3))


def reaches_orientation(target: Target) -> bool:
    """Whether the frame can reach the target orientation at any position."""
    return _reaches(target, slice(3, 6))


def _reaches(target: Target, rows: slice) -> bool:
    """Whether a subset of the pose equations has a solution: Levenberg-Marquardt, many starts."""
    n = target.arm.size
    rng = np.random.default_rng(_SEED)
    x = rng.uniform(-math.pi, math.pi, (_REASON_STARTS, n))
    # initial damping, relative to rows of size 1: small, because there are many starts
    damping = np.full(_REASON_STARTS, 1e-2)
    e, J = (part[:, rows] for part in target.excess(x))
    for _ in range(_STEPS):
        A = np.swapaxes(J, 1, 2) @ J + damping[:, None, None] * np.eye(n)
        step = np.linalg.solve(A, np.swapaxes(J, 1, 2) @ e[..., None])[..., 0]
        e_trial, J_trial = (part[:, rows] for part in target.excess(x - step))
        better = np.sum(e_trial**2, axis=1) < np.sum(e**2, axis=1)
        x = np.where(better[:, None], x - step, x)
        e, J = np.where(better[:, None], e_trial, e), np.where(better[:, None, None], J_trial, J)
        # below 1e-14 the damping vanishes in the rounding of J'J, whose entries are about 1
        damping = np.where(better, np.maximum(damping / 5, 1e-14), damping * 4)
    return bool(np.min(np.max(np.abs(e), axis=1)) < _REACHED)


# Selection, order and full revolutions of the solutions, according to the options of the user.


@dataclass(frozen=True, slots=True, eq=False)
class SolveOptions:
    """Options of an inverse geometric problem.

    Attributes:
        system: robot.
        near: (nq,) configuration towards which angles are shifted by full revolutions. Joints that
            do not move the frame take their positions from it.
        bounds: limits of the coordinates.
        strict: whether solutions outside the limits are dropped.
        seeded: whether solutions are sorted by their distance from `near`.
    """

    system: System
    near: Array
    bounds: CoordinateLimits
    strict: bool
    seeded: bool

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the coordinates of the robot."""
        return self.bounds.names

    def solutions(
        self,
        found: Sequence[Solution],
        method: str,
        reason: str = "",
        nearest: Nearest | None = None,
    ) -> Solutions:
        """Apply the limits and the order, and return the solutions for the user.

        Args:
            found: all solutions of the robot, without limits and full revolutions.
            method: name of the method that computed them.
            reason: explanation, if there is no solution.
            nearest: reachable pose nearest to the target, if there is no solution.
        """
        every = [self._within(solution) for solution in found]
        kept = [s for s in every if s.within_limits or not self.strict]
        if self.seeded:
            kept.sort(key=lambda s: float(np.linalg.norm(s.q - self.near)))
        if every and not kept:
            reason = excluded([self.bounds.outside(s.q) for s in every])
        return self._answer(tuple(kept), method, reason, nearest)

    def regular_solutions(
        self, draft: PoseDraft, indices: Sequence[int], arm: Arm
    ) -> Solutions | None:
        """Apply the limits and the order to a certain draft, and return its solutions.

        Args:
            draft: configurations of a chain.
            indices: indices of the joints of the chain in q.
            arm: numeric geometry of the chain.

        Returns:
            Solutions, or None if the limits leave none.
        """
        q = np.empty((len(draft), self.near.size))
        q[:] = self.near
        q[:, indices] = draft.q
        q, within = self.bounds.wound(q, self.near)
        order = np.flatnonzero(within) if self.strict else np.arange(len(q))
        if not len(order):
            return None
        if self.seeded:
            order = order[np.argsort(np.linalg.norm(q[order] - self.near, axis=1), kind="stable")]
        return self._answer(RegularSolutions(q, within, draft, order, arm, self), draft.method)

    def _answer(
        self,
        solutions: Sequence[Solution],
        method: str,
        reason: str = "",
        nearest: Nearest | None = None,
    ) -> Solutions:
        system = self.system.name
        return Solutions(system, self.names, solutions, method, reason, nearest, self.bounds)

    def _within(self, solution: Solution) -> Solution:
        """Return the solution shifted towards `near`, with its limits."""
        wound, within = self.bounds.wound(solution.q[None], self.near)
        windings = partial(self.bounds.windings, wound[0], self.near)
        return replace(solution, q=wound[0], within_limits=bool(within[0]), _windings=windings)
