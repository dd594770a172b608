"""All configurations that close the loops, and those that also move a frame to a given pose."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Any

import numpy as np

from mbs.assembly import System
from mbs.assembly.model_function import require_system
from mbs.assembly.tree import quaternion_slices
from mbs.closed_forms.ring import extent, independent_indices, spin_indices
from mbs.closed_forms.roots import Roots
from mbs.components.joints import Motion
from mbs.errors import LoopError, ModelError
from mbs.loops._function import Given, independent_positions
from mbs.loops.blocks import Step, steps_of
from mbs.loops.closing import (
    CLOSED,
    OPEN,
    TOLERANCE,
    Closing,
    Vector,
    closure_parameters,
    difference,
    within_half_turn,
)
from mbs.loops.plan import Stage, every_configuration
from mbs.loops.pose import Goal, goal
from mbs.solvers.rank import rank
from mbs.text import quoted

_SAME = 1e-9
"""Difference of positions [rad or m] below which two modes are the same: a formula reproduces a
mode up to rounding, and a smaller difference has no effect in use."""
_MOST = 4096
"""Largest number of branches of a list: each branch is evaluated and stored."""


@dataclass(frozen=True, slots=True)
class Mode:
    """One assembly mode of a mechanism.

    Attributes:
        q: (nq,) configuration [rad or m]. Angles that a loop determines are within half a rotation
            of zero.
        branch: labels that distinguish the mode, such as ("j3:+",); one label for each loop with
            two solutions.
        residual: largest absolute closure row at q.
    """

    q: tuple[float, ...]
    branch: tuple[str, ...]
    residual: float


class ModeList(list[Mode]):
    """List of assembly modes, with a statement on its completeness.

    Attributes:
        complete: whether the list is proved to contain all modes.
        proof: text with the reason: "closed forms", or the numerical methods.
    """

    def __init__(
        self, found: Iterable[Mode] = (), *, complete: bool = True, proof: str = ""
    ) -> None:
        super().__init__(found)
        self.complete = complete
        self.proof = proof


def assembly_modes(
    system: System,
    q_active: Given = None,
    *,
    parameters: Mapping[str, float] | None = None,
) -> ModeList:
    """Return all configurations (assembly modes) for given positions of the independent joints.

    Loops with a closed form are solved by it. Coupled loops, such as those of a platform on three
    or six legs, are solved together numerically. Their modes have no labels. Each mode satisfies
    all closure rows and orientations of axes. The list is empty if the mechanism cannot be
    assembled. Two modes that coincide appear once.

    Args:
        system: assembled mechanism.
        q_active: positions of the independent joints, by name or in the order of
            `system.chosen_coordinates`. Missing positions keep their values of
            the assembled configuration.
        parameters: values of symbols by name. Missing symbols have their default values.

    Returns:
        Modes, with the attributes `complete` and `proof`.

    Raises:
        NoClosedForm: a loop can be solved by iteration only.
        LoopError: more than 4096 branches; or joints can move while the independent joints are
            fixed, so that the number of modes is infinite.
        ModelError: a joint is unknown or not independent, or a value is not finite.
    """
    require_system(system)
    steps = steps_of(system)
    stages = [step for step in steps if isinstance(step, Stage)]
    count = math.prod(len(stage.labels) for stage in stages)
    if count > _MOST:
        raise LoopError(
            f"{system.name}: {count} branches are too many to list; name one in mbs.loops.solve"
        )
    p = closure_parameters(system, parameters)
    start = np.zeros(extent(system))
    start[independent_indices(system)] = independent_positions(system, q_active)
    if len(stages) == len(steps):
        every = every_configuration(stages, start, p)
        return ModeList(
            _distinct(_checked(system, q[: system.nq], branch, p) for q, branch in every),
            proof="closed forms",
        )
    return _of_blocks(system, steps, start, p)


def _distinct(modes: Iterable[Mode | None]) -> list[Mode]:
    """Return the modes without repeated configurations; None is skipped."""
    found: list[Mode] = []
    for mode in modes:
        if mode is not None and not any(_same(mode, other) for other in found):
            found.append(mode)
    return found


def _checked(system: System, q: Vector, branch: tuple[str, ...], p: Vector) -> Mode | None:
    """Return the mode with positions q (nq,); None if q does not close the loops."""
    residual = 0.0
    if system.is_closed:
        closing = Closing(system, p)
        residual = _largest_row(closing.rows(q)[0])
        if closing.openness(q) > CLOSED or not closing.faces(q):
            return None
    return Mode(tuple(float(x) for x in q), branch, residual)


def _largest_row(rows: Vector) -> float:
    return float(np.max(np.abs(rows), initial=0.0))


def _same(mode: Mode, other: Mode) -> bool:
    """Whether the positions of two modes are equal to 1e-9 rad or m."""
    return bool(np.max(np.abs(np.subtract(mode.q, other.q)), initial=0.0) < _SAME)


# Modes of loops that are solved numerically, step by step.


_REFINED = 1e-4
"""Largest correction [rad or m] of a root by Newton steps on all closure rows: a polynomial root at
a fold is accurate to 1e-6, and other modes are farther away."""
_SINGULAR = 1e-6
"""Relative singular value below which a mode may move with fixed independent joints, or is at a
fold: modes are closed to 1e-12, and 1e-6 is its square root."""
_PUSH = 0.01
"""Displacement along that motion [rad, or sizes of the mechanism] that distinguishes the two: from
a fold, the closing iteration returns to the mode, to 1e-6."""


def _of_blocks(system: System, steps: Sequence[Step], start: Vector, p: Vector) -> ModeList:
    """Return all modes of loops that are solved stage by stage and block by block.

    `steps` are closed forms and numerical blocks in their order of solution, `start` all positions
    with the independent ones known, p (np,) the parameters. Raises LoopError if the number of modes
    is infinite.
    """
    told = list[Roots]()
    try:
        every = list(_every(steps, start, p, told))
    except LoopError as error:
        if str(error).startswith(system.name):
            raise
        raise LoopError(f"{system.name}: {error}; {_REMEDY}") from None
    locked = tuple(k for k in independent_indices(system) if k < system.nq)
    closing = Closing(system, p, locked)
    found = _distinct(_checked(system, _refined(closing, q[: system.nq]), (), p) for q in every)
    for mode in found:
        _require_locked(closing, np.array(mode.q))
    complete = all(roots.complete for roots in told)
    proofs = list(dict.fromkeys(roots.proof for roots in told))
    if not complete:
        more = list[Mode | None]()
        # a mode that can move raises here; otherwise the search would find infinitely many
        for q in closed_configurations(closing, start[: system.nq]):
            if not any(distance(system, q, np.array(mode.q)) < _SAME_FOUND for mode in found):
                _require_locked(closing, q)
                more.append(_checked(system, q, (), p))
        proofs.append(f"a search from random starts found {len(more)} more")
        found += _distinct(more)
    return ModeList(found, complete=complete, proof="; ".join(proofs))


def _every(steps: Sequence[Step], q: Vector, p: Vector, told: list[Roots]) -> Iterator[Vector]:
    """Yield all positions of each combination of solutions of the steps.

    Args:
        steps: closed forms and numerical blocks, in their order of solution.
        q: all positions, of which the known ones count.
        p: (np,) parameters.
        told: list to which the solutions of each block are appended.
    """
    if not steps:
        yield q
        return
    step, rest = steps[0], steps[1:]
    if isinstance(step, Stage):
        values = np.array(step.values(q, p)).T
    else:
        told.append(step.solve(q, p))
        values = told[-1].values
    for row in values:
        if np.all(np.isfinite(row)):
            longer = q.copy()
            longer[list(step.indices)] = row
            yield from _every(rest, longer, p, told)


def _refined(closing: Closing, q: Vector) -> Vector:
    """Return a root q (nq,) corrected by Newton steps on all closure rows.

    If the correction is larger than 1e-4, q is returned unchanged.
    """
    if closing.openness(q) <= TOLERANCE:
        return q
    near = closing.nearest(q)
    moved = distance(closing.system, near.q, q)
    return near.q if near.is_closed and moved < _REFINED else q


_REMEDY = (
    "modes cannot be counted there; give other positions or lengths, or use mbs.loops.solve with a"
    " guess for one configuration"
)


def _require_locked(closing: Closing, q: Vector) -> None:
    """Raise if the loops allow a motion at a mode q (nq,) while the independent joints are fixed.

    Raises:
        LoopError: the mode moves. The message contains the joints that move most.
    """
    system, free = closing.system, closing.free
    spins = spin_indices(system)
    J = closing.rows(q)[1]
    _, values, V = np.linalg.svd(J)
    count = len(free) - int(np.sum(values > _SINGULAR * values[0]))
    if count <= len(spins):
        return
    # motion with the least rotation of rods about their own axes
    spinning = {index + k for index in spins for k in range(Motion.SPHERICAL.nq)}
    others = [k for k, index in enumerate(free) if index not in spinning]
    loose = V[-count:].T
    along = loose @ np.linalg.svd(loose[others])[2][0]
    pushed = q.copy()
    pushed[free] += _PUSH * along
    near = closing.nearest(pushed)
    moved = np.abs(difference(system, near.q, q))[[free[k] for k in others]]
    if not near.is_closed or np.max(moved, initial=0.0) < _PUSH / 10:
        return
    motion = np.abs(along)
    names = [
        system.coordinates[k].name
        for k, x in zip(free, motion, strict=True)
        if x > motion.max() / 10
    ]
    raise LoopError(
        f"{system.name}: {', '.join(names)} can move while the independent joints stay; {_REMEDY}"
    )


# Configurations found from random starts, the same at each call.


_SAME_FOUND = 1e-6
"""Difference of positions [rad or m] below which two results of a search are the same: closed to
1e-12, they agree to 1e-12 at regular configurations and to its square root at singular ones."""


def distance(system: System, q: Vector, other: Vector) -> float:
    """Return the largest difference of a position of two configurations (nq,) [rad or m]."""
    return float(np.max(np.abs(difference(system, q, other)), initial=0.0))


def _search(
    system: System,
    starts: Iterable[Vector],
    solution: Callable[[Vector], Vector | None],
    least: int,
    hits: list[int],
) -> Iterator[Vector]:
    """Yield each distinct solution that an iteration finds from some start, as soon as found.

    The search ends early if the last three quarters of the starts found no new solution and every
    solution was found twice. Completeness is not proved.

    Args:
        system: mechanism of the configurations.
        starts: configurations (nq,) from which the iteration starts.
        solution: function from a start to a solution (nq,), or None if the iteration fails.
        least: smallest number of starts.
        hits: empty list, filled with the number of starts that led to each solution.
    """
    found, newest = list[Vector](), 0
    for number, start in enumerate(starts, start=1):
        q = solution(start)
        if q is not None:
            known = (k for k, own in enumerate(found) if distance(system, own, q) < _SAME_FOUND)
            met = next(known, None)
            if met is not None:
                hits[met] += 1
            else:
                found.append(q)
                hits.append(1)
                newest = number
                yield q
        if number >= max(least, 4 * newest) and all(count > 1 for count in hits):
            break


def _random_starts(
    system: System, middle: Vector, moving: list[int], reach: float, count: int, seed: int
) -> Iterator[Vector]:
    """Yield configurations with random changes of the moving positions.

    Args:
        system: mechanism of the configurations.
        middle: (nq,) configuration that is changed.
        moving: indices of the positions that change.
        reach: largest change [rad or m]; quaternions are normalised afterwards.
        count: number of configurations.
        seed: seed of the random numbers.
    """
    rng = np.random.default_rng(seed)
    for _ in range(count):
        q = middle.copy()
        q[moving] += rng.uniform(-reach, reach, len(moving))
        for part in quaternion_slices(system.tree):
            q[part] /= np.linalg.norm(q[part])
        yield q


# Configurations that move a frame to a given pose.


_TRIES, _LEAST, _SEED = 500, 60, 20260103
"""Largest and smallest number of starts, and seed of the random numbers. A mode that every twelfth
start reaches is missed by 60 starts with a probability of half a percent."""
_LOOSE = 1e-5
"""Relative singular value below which joints can move: closed to 1e-12, a mode that can move has an
error of the square root, 1e-6, and its singular value has the same size."""


@dataclass(frozen=True, slots=True)
class WorkingMode:
    """Configuration that closes the loops and moves a frame to a given pose.

    Attributes:
        q: (nq,) configuration [rad or m]. Angles are within half a rotation of zero; the first
            element of a quaternion is not negative.
        residual: largest absolute row of the loops and of the pose at q.
        hits: number of starts that converged to q. If a mode has one hit only, other modes are
            probably missing.
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
    """Return configurations (working modes) with closed loops and a given pose of a frame.

    They are found by Gauss-Newton from random starts, the same at each call. Completeness is not
    proved; `hits` indicates how thorough the search was. The search ends early after at least 60
    starts, if the last three quarters found no new mode and every mode was found twice.

    Args:
        system: open or closed mechanism, as for `solve_pose`.
        frame: name of a body, name of a frame, or index of a link.
        T: (4, 4) target pose of the frame in the base [m].
        rows: names of the rows of the pose that must agree, as for `solve_pose`.
        guess: configuration around which the starts are chosen. The default is the assembled one.
        reach: largest difference of a position between a start and the guess [rad or m]. Below half
            a rotation, the search is limited to configurations near the guess.
        tries: largest number of starts.
        parameters: values of symbols by name. Missing symbols have their default values.

    Returns:
        Configurations, sorted by distance from the guess; empty if none was found.

    Raises:
        LoopError: joints can move at a found configuration while the frame is at rest, so that the
            number of configurations may be infinite.
        ModelError: an input is invalid, as for `solve_pose`; or reach or tries is not positive.
    """
    target = goal(system, frame, T, rows, parameters)
    if not (isinstance(tries, int) and tries >= 1 and isinstance(reach, int | float) and reach > 0):
        raise ModelError(
            f"{system.name}: reach is {quoted(reach)} and tries {quoted(tries)}; give a reach above"
            " zero and at least one try"
        )
    middle = np.array(system.position(guess))
    first = middle.copy()
    for part in quaternion_slices(system.tree):
        first[part] /= np.linalg.norm(first[part])

    def solution(start: Vector) -> Vector | None:
        near = target.nearest(start)
        return _tidy(target, near.q) if near.is_closed else None

    hits, found = list[int](), list[Vector]()
    others = _random_starts(system, middle, list(range(system.nq)), reach, tries - 1, _SEED)
    for q in _search(system, chain([first], others), solution, _LEAST, hits):
        _require_isolated(target, q)
        found.append(q)
    modes = [
        WorkingMode(tuple(float(x) for x in q), _largest_row(target.residual(q)[0]), count)
        for q, count in zip(found, hits, strict=True)
    ]
    return sorted(modes, key=lambda mode: distance(system, np.array(mode.q), first))


def _tidy(target: Goal, q: Vector) -> Vector:
    """Return q (nq,) with angles in [-pi, pi] and quaternions with nonnegative first elements.

    q is unchanged if the changed positions do not close the loops of `target`.
    """
    system = target.closing.system
    tidy = within_half_turn(system, q)
    for part in quaternion_slices(system.tree):
        tidy[part] *= -1.0 if tidy[part.start] < 0 else 1.0
    return tidy if target.openness(tidy) < CLOSED else q


def _require_isolated(target: Goal, q: Vector) -> None:
    """Raise if the joints can move, to first order, while the frame is at rest.

    Raises:
        LoopError: the joints can move. The message contains the joints that move most.
    """
    system = target.closing.system
    slope = target.residual(q)[1]
    if rank(slope, _LOOSE) == system.nq:
        return
    motion = np.abs(np.linalg.svd(slope)[2][-1])
    names = [c.name for k, c in enumerate(system.coordinates) if motion[k] > motion.max() / 10]
    raise LoopError(
        f"{system.name}: {', '.join(names)} can move while frame {quoted(target.frame)} stays at"
        " this pose, so configurations cannot be counted; take another pose, name more rows, or use"
        " mbs.loops.solve_pose for one configuration"
    )


# Configurations that close the loops with some positions locked.


_START_TRIES, _LEAST_STARTS, _START_SEED = 300, 40, 20260107
"""Largest and smallest number of starts, fewer than for `working_modes` because locked positions
leave fewer configurations; and seed of the random numbers."""
_REACH = np.pi
"""Largest difference of a random start from the given positions [rad or m]: half a rotation covers
all angles."""


def closed_configurations(closing: Closing, start: Vector) -> Iterator[Vector]:
    """Yield configurations found by Gauss-Newton from random starts, the same at each call.

    At least 40 of 300 starts are used, until the search ends early, see `_search`.

    Args:
        closing: closure rows and the indices of the locked positions.
        start: (nq,) configuration. Its locked positions are kept, and random starts are around its
            other positions.

    Yields:
        Configurations (nq,) with angles within half a rotation of zero.
    """

    def solution(q: Vector) -> Vector | None:
        near = closing.nearest(q)
        return _tidy_start(closing, near.q) if near.is_closed else None

    system = closing.system
    count = _START_TRIES - 1
    others = _random_starts(system, start, closing.free, _REACH, count, _START_SEED)
    return _search(system, chain([start], others), solution, _LEAST_STARTS, [])


def _tidy_start(closing: Closing, q: Vector) -> Vector:
    """Return the positions q (nq,) with the free angles in [-pi, pi].

    q is unchanged if the changed positions do not close the loops.
    """
    tidy = within_half_turn(closing.system, q)
    tidy[list(closing.locked)] = q[list(closing.locked)]
    return tidy if closing.openness(tidy) < OPEN else q
