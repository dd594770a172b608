"""Every configuration that closes the loops, and every one that brings a frame to a pose."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mbs.assembly import System
from mbs.assembly.model_function import require_system
from mbs.assembly.tree import quaternion_slices
from mbs.closed_forms.ring import extent, independent_indices, spin_indices
from mbs.components.joints import Motion
from mbs.errors import LoopError, ModelError
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
from mbs.loops.function import Given, independent_positions
from mbs.loops.plan import Roots, Stage, every_configuration
from mbs.loops.pose import Goal, goal
from mbs.solvers.rank import rank
from mbs.text import quoted

_SAME = 1e-9
"""Difference of positions [rad or m] below which two modes are one: a formula gives the same mode
again to some roundings, and modes that differ by less are one for every use."""
_MOST = 4096
"""Branches that are listed at most: each is evaluated and kept."""


@dataclass(frozen=True, slots=True)
class Mode:
    """One way to assemble a mechanism.

    Attributes:
        q: (nq) the configuration [rad or m], angles that a loop gives are within half a turn
            of zero.
        branch: what tells it from the others, such as ("j3:+",); one label for each loop that
            closes in two ways.
        residual: largest closure row there.
    """

    q: tuple[float, ...]
    branch: tuple[str, ...]
    residual: float


class ModeList(list[Mode]):
    """Modes, and what is known of whether they are all.

    Attributes:
        complete: whether these are all modes that there are.
        proof: why, in words: "closed forms", or what was solved in numbers.
    """

    def __init__(
        self, found: Iterable[Mode] = (), *, complete: bool = True, proof: str = ""
    ) -> None:
        super().__init__(found)
        self.complete = complete
        self.proof = proof


def modes(
    system: System,
    q_active: Given = None,
    *,
    parameters: Mapping[str, float] | None = None,
) -> ModeList:
    """All configurations with these positions of the independent joints.

    By closed forms where the loops have them; else loops that depend on each other, such as those
    of a platform on three or six legs, are solved together in numbers, and the modes have no
    labels. Each mode is checked with every closure row and for joints that face the right way. The
    list is empty where the mechanism cannot be assembled; two modes that meet are listed once.

    Args:
        system: the assembled mechanism.
        q_active: positions of the independent joints, by name or in the order of
            `system.free`; those left out stay as in the assembled configuration.
        parameters: values of symbols, the others at their defaults.

    Returns:
        The modes; `complete` and `proof` tell whether they are all.

    Raises:
        NoClosedForm: a loop is solved by iteration only.
        LoopError: there are more than 4096 branches; or joints can move while the independent ones
            stay, so that modes cannot be counted.
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
    found: list[Mode] = []
    for mode in modes:
        if mode is not None and not any(_same(mode, other) for other in found):
            found.append(mode)
    return found


def _checked(system: System, q: Vector, branch: tuple[str, ...], p: Vector) -> Mode | None:
    residual = 0.0
    if system.is_closed:
        closing = Closing(system, p)
        residual = float(np.max(np.abs(closing.rows(q)[0]), initial=0.0))
        if closing.openness(q) > CLOSED or not closing.faces(q):
            return None
    return Mode(tuple(float(x) for x in q), branch, residual)


def _same(mode: Mode, other: Mode) -> bool:
    return bool(np.max(np.abs(np.subtract(mode.q, other.q)), initial=0.0) < _SAME)


# Modes of loops that are solved in numbers, one step after the other.


_REFINED = 1e-4
"""Distance [rad or m] over which a root is refined with all rows: at a fold roots of polynomials
are known to 1e-6, and other modes are farther away."""
_SINGULAR = 1e-6
"""Singular value, as a part of the largest, below which a mode may move while the independent
joints stay, or lies at a fold: modes are closed to 1e-12, whose root that is."""
_PUSH = 0.01
"""By how much such a mode is pushed along that motion [rad, or sizes of the mechanism]: from a fold
it comes back, to 1e-6."""


def _of_blocks(system: System, steps: Sequence[Step], start: Vector, p: Vector) -> ModeList:
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
        # one that can move ends the search, which would find ever others
        for q in _closed_configurations(closing, start[: system.nq]):
            if not any(_near(system, q, mode) for mode in found):
                _require_locked(closing, q)
                more.append(_checked(system, q, (), p))
        proofs.append(f"a search from random starts found {len(more)} more")
        found += _distinct(more)
    return ModeList(found, complete=complete, proof="; ".join(proofs))


def _near(system: System, q: Vector, mode: Mode) -> bool:
    gap = difference(system, q, np.array(mode.q))
    return bool(np.max(np.abs(gap), initial=0.0) < _SAME_START)


def _every(steps: Sequence[Step], q: Vector, p: Vector, told: list[Roots]) -> Iterator[Vector]:
    """All positions, one step after the other; what blocks tell is added to a list."""
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
    if closing.openness(q) <= TOLERANCE:
        return q
    near = closing.nearest(q)
    moved = np.max(np.abs(difference(closing.system, near.q, q)), initial=0.0)
    return near.q if near.is_closed and moved < _REFINED else q


_REMEDY = (
    "modes cannot be counted there; give other positions or lengths, or use mbs.loops.solve with a"
    " guess for one configuration"
)


def _require_locked(closing: Closing, q: Vector) -> None:
    """Refuse a mode that can move while the independent joints stay.

    Raises:
        LoopError: names the joints that move most.
    """
    system, free = closing.system, closing.free
    spins = spin_indices(system)
    J = closing.rows(q)[1]
    _, values, V = np.linalg.svd(J)
    count = len(free) - int(np.sum(values > _SINGULAR * values[0]))
    if count <= len(spins):
        return
    # the motion that turns rods about their lines least
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


# The configurations that bring a frame to one pose, as far as random starts lead to them.


_TRIES, _LEAST, _SEED = 500, 60, 20260103
_SAME_WORKING_MODE = 1e-6
"""Difference of positions [rad or m] below which two ends of the search are one mode: closed to
1e-12, they agree to that away from singular configurations and to its square root near them."""
_LOOSE = 1e-5
"""Singular values below this part of the largest let the joints move: closed to 1e-12, a mode that
can move is found with an error of the square root, 1e-6, and its slope is as large."""


@dataclass(frozen=True, slots=True)
class WorkingMode:
    """A configuration that closes the loops and brings a frame to a pose.

    Attributes:
        q: (nq) the configuration [rad or m], angles within half a turn of zero, the first element
            of a quaternion not negative.
        residual: largest row of the loops and of the pose there.
        hits: how many starts ended there; where some mode has one alone, others are likely
            missing.
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
    """The configurations with closed loops and this pose of a frame to which random starts lead.

    Nothing proves that the list is complete; `hits` tells how well it was searched. The starts are
    the same at every call. The search ends early after at least 60 of them, once the last three
    quarters found nothing new and every mode was met twice.

    Args:
        system: as for `solve_pose`, and so are frame, T, rows and parameters.
        frame: likewise.
        T: likewise.
        rows: likewise.
        guess: about which configuration the starts are taken, the assembled one when left out.
        reach: largest difference of a position between a start and the guess [rad or m]; smaller
            than half a turn, configurations near the guess are looked for.
        tries: largest number of starts.
        parameters: likewise.

    Returns:
        The configurations found, those near the guess first; empty when none was found.

    Raises:
        LoopError: in a configuration found the joints can move while the frame stays, so that
            there may be configurations without number.
        ModelError: as for `solve_pose`; or reach or tries is not above zero.
    """
    target = goal(system, frame, T, rows, parameters)
    if not (isinstance(tries, int) and tries >= 1 and isinstance(reach, int | float) and reach > 0):
        raise ModelError(
            f"{system.name}: reach is {quoted(reach)} and tries {quoted(tries)}; give a reach above"
            " zero and at least one try"
        )
    middle = np.array(system.position(guess))
    found: list[WorkingMode] = []
    newest = 0
    for number, start in enumerate(_starts(system, middle, reach, tries), start=1):
        configuration, known = target.nearest(start), len(found)
        if configuration.is_closed:
            _add(target, found, _tidy(target, configuration.q))
        newest = number if len(found) > known else newest
        if number >= max(_LEAST, 4 * newest) and all(mode.hits > 1 for mode in found):
            break
    return sorted(found, key=lambda mode: _distance(system, np.array(mode.q), middle))


def _starts(system: System, middle: Vector, reach: float, tries: int) -> list[Vector]:
    rng = np.random.default_rng(_SEED)
    drawn = [middle, *(middle + rng.uniform(-reach, reach, middle.shape) for _ in range(tries - 1))]
    for q in drawn:
        for part in quaternion_slices(system.tree):
            q[part] /= np.linalg.norm(q[part])
    return drawn


def _add(target: Goal, found: list[WorkingMode], q: Vector) -> None:
    system = target.closing.system
    for number, mode in enumerate(found):
        if _distance(system, np.array(mode.q), q) < _SAME_WORKING_MODE:
            found[number] = replace(mode, hits=mode.hits + 1)
            return
    _require_isolated(target, q)
    residual = float(np.max(np.abs(target.residual(q)[0])))
    found.append(WorkingMode(tuple(float(x) for x in q), residual, 1))


def _distance(system: System, q: Vector, other: Vector) -> float:
    return float(np.max(np.abs(difference(system, q, other)), initial=0.0))


def _tidy(target: Goal, q: Vector) -> Vector:
    """The configuration with small angles where that is the same one: not so across a gear."""
    system = target.closing.system
    tidy = within_half_turn(system, q)
    for part in quaternion_slices(system.tree):
        tidy[part] *= -1.0 if tidy[part.start] < 0 else 1.0
    return tidy if target.openness(tidy) < CLOSED else q


def _require_isolated(target: Goal, q: Vector) -> None:
    """Refuse a configuration that can move, at least to first order, while the frame stays.

    Raises:
        LoopError: names the joints that move most.
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


# Configurations that close the loops with some positions locked, as far as random starts lead
# there.


_START_TRIES, _LEAST_STARTS, _START_SEED = 300, 40, 20260107
_REACH = np.pi
"""Of a random start from the given positions: all angles, and as many metres."""
_SAME_START = 1e-6
"""As `_SAME_WORKING_MODE`, with positions locked in place of a pose."""


def closed_configurations(closing: Closing, start: Vector) -> list[Vector]:
    """Configurations found by Gauss-Newton from random starts, always the same ones.

    The search ends early after at least 40 starts, once the last three quarters found
    nothing new and every configuration was met twice.

    Args:
        closing: the rows, and the positions that are locked.
        start: (nq,) of which the locked positions count; the starts are taken about the others.

    Returns:
        Configurations (nq,) with angles within half a turn of zero; nothing proves that these are
        all.
    """
    return list(_closed_configurations(closing, start))


def _closed_configurations(closing: Closing, start: Vector) -> Iterator[Vector]:
    """Each as soon as it is found."""
    rng = np.random.default_rng(_START_SEED)
    found, hits, newest = list[Vector](), list[int](), 0
    for number in range(1, _START_TRIES + 1):
        closed = closing.nearest(_moved(closing, start, rng) if number > 1 else start)
        if closed.is_closed:
            q = _tidy_start(closing, closed.q)
            met = [
                k
                for k, other in enumerate(found)
                if _start_distance(closing, q, other) < _SAME_START
            ]
            for k in met[:1]:
                hits[k] += 1
            if not met:
                found, hits, newest = [*found, q], [*hits, 1], number
                yield q
        if number >= max(_LEAST_STARTS, 4 * newest) and all(count > 1 for count in hits):
            break


def _moved(closing: Closing, start: Vector, rng: np.random.Generator) -> Vector:
    q = start.copy()
    q[closing.free] += rng.uniform(-_REACH, _REACH, len(closing.free))
    for part in quaternion_slices(closing.system.tree):
        q[part] /= np.linalg.norm(q[part])
    return q


def _tidy_start(closing: Closing, q: Vector) -> Vector:
    """The configuration with small angles where that is the same one: not so across a gear."""
    tidy = within_half_turn(closing.system, q)
    tidy[list(closing.locked)] = q[list(closing.locked)]
    return tidy if closing.openness(tidy) < OPEN else q


def _start_distance(closing: Closing, q: Vector, other: Vector) -> float:
    return float(np.max(np.abs(difference(closing.system, q, other)), initial=0.0))
