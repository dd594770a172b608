"""Trees and robots with loops: every joint from those on the way to the frame."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from mbs.assembly import System
from mbs.closed_forms.arm import Array
from mbs.closed_forms.ring import spin_indices
from mbs.errors import NoClosedForm
from mbs.loops.closing import CLOSED, TOLERANCE, Closing, difference
from mbs.loops.modes import closed_configurations, working_modes
from mbs.loops.plan import (
    Known,
    Posed,
    Stage,
    complete,
    every_configuration,
    plan_from,
    plan_to,
    started_at,
)
from mbs.loops.pose import Goal, goal
from mbs.models.geometry import terminal_frame
from mbs.models.inverse_geometry.chain import FrameChain
from mbs.models.inverse_geometry.solutions import RobotSolution, Solutions, Wishes

# Whole configurations of trees and of robots with closed loops, from the joints on the way to a
# frame.
#
# The chain from the base to the frame is solved as if it stood alone; with its joints known the
# loops give all others. Where balls or a free body stand in the chain, as in a parallel robot,
# the known pose closes one more loop instead.
#
# Source: Khalil & Creusot 1997, section 3.3.


_SAME = 1e-7
"""Difference [rad or m] of two configurations that are one: loops are closed to 1e-12, which
joints that they determine weakly magnify, and regular branches are farther apart."""
_SEED = 20260108
_AGREE = 1e-7
"""Difference [rad or m] of joints that both the chain and the loops determine, likewise."""
_MOVED = 1e-5
"""Move [rad or m] to the nearest closed configuration that only takes rounding away, up to that of
a double root, 1e-6; more is another configuration."""


@dataclass(frozen=True, slots=True, eq=False)
class ClosedConfiguration:
    """A configuration of the whole system that closes its loops.

    Attributes:
        q: (nq,) positions [rad or m].
        label: how the loops close, such as "q9:parallel, q3:+"; empty where they do so in one way
            only, or were closed by search.
        residual: largest row of the loops there, and of the pose where it closes one.
    """

    q: Array
    label: str
    residual: float


def close(
    system: System, chain: FrameChain, configurations: Array, p: Array, seed: Array | None = None
) -> list[ClosedConfiguration]:
    """The whole configurations that belong to configurations of a chain.

    The loops are closed in every way, by closed forms; by search from many starts where
    `why_searched` tells so. What neither chain nor loops determine stays as in the seed.

    Args:
        system: open or closed.
        chain: of its tree, to the frame that is wanted somewhere.
        configurations: (m, n) positions of the joints of the chain.
        p: (np,) parameters.
        seed: (nq,) configuration, the assembled one when left out.

    Returns:
        Those of the first configuration of the chain, then those of the second, and so on; none
        where the loops stay open.

    Raises:
        NoClosedForm: balls or free bodies beside the chain move in some of their ways only.
    """
    rest = np.array(system.configuration if seed is None else seed, dtype=float)
    given = _given(system, chain)
    found = list[ClosedConfiguration]()
    for configuration in np.atleast_2d(np.asarray(configurations, dtype=float)):
        if configuration.size:
            q = rest.copy()
            q[list(given)] = [*configuration, *chain.locked.values()]
            found += _complete(system, given, q, p)
    return found


def configurations_at(
    system: System, frame: str | int, T: Array, p: Array, seed: Array | None = None
) -> list[ClosedConfiguration]:
    """The whole configurations that bring a frame to a pose, where balls or free bodies carry it.

    By closed forms where every loop has one; by search from many starts where `why_searched` tells
    so. What the pose does not determine stays as in the seed.

    Args:
        system: open or closed.
        frame: a body, a named frame, or the number of a link.
        T: (4, 4) target pose, as `target_pose` gives it.
        p: (np,) parameters.
        seed: (nq,) configuration, the assembled one when left out.

    Returns:
        Those near the seed first.

    Raises:
        LoopError: by search, where joints can move while the frame stays.
    """
    rest = np.array(system.configuration if seed is None else seed, dtype=float)
    given = zip(system.parameters, p, strict=True)
    values = {symbol.name: float(x) for symbol, x in given if np.isfinite(x)}
    plan = _plan_to(system, frame)
    if isinstance(plan, str):
        modes = working_modes(system, frame, T, guess=list(rest), parameters=values)
        return [ClosedConfiguration(np.array(mode.q), "", mode.residual) for mode in modes]
    target = goal(system, frame, T, None, values)
    branches = every_configuration(plan.stages, plan.started(T, rest), p)
    found = _distinct(system, _reaching(target, branches))
    return sorted(found, key=lambda configuration: _distance(system, configuration.q, rest))


def why_searched(system: System, chain: FrameChain | str | int) -> str | None:
    """Why configurations are searched for, so that no proof of completeness stands behind them.

    Args:
        system: open or closed.
        chain: the one that `close` gets, or the frame that `configurations_at` gets.

    Returns:
        One sentence; None where all are found by closed forms.
    """
    outcome: object = None
    if not isinstance(chain, FrameChain):
        outcome = _plan_to(system, chain)
    elif system.is_closed:
        outcome = _stages(system, _given(system, chain))
    return outcome if isinstance(outcome, str) else None


def _given(system: System, chain: FrameChain) -> tuple[int, ...]:
    """The indices in q of the free joints of the chain, then of the locked ones."""
    starts = {link.name: link.q.start for link in system.tree.links}
    return (*chain.indices, *(starts[name] for name in chain.locked))


def _known(system: System, given: tuple[int, ...]) -> Known:
    known: Known = system.cached(("completed", given), lambda: complete(system, given))
    return known


def _stages(system: System, given: tuple[int, ...]) -> tuple[Stage, ...] | str:
    """How the loops are closed with the given positions; why by no closed form."""

    def find() -> tuple[Stage, ...] | str:
        try:
            indices = _known(system, given).indices
            return plan_from(system, (*indices, *spin_indices(system).values()))
        except NoClosedForm as error:
            return str(error)

    stages: tuple[Stage, ...] | str = system.cached(("stages or reason", given), find)
    return stages


def _plan_to(system: System, frame: str | int) -> Posed | str:
    """How the loops are closed with the pose of a frame; why by no closed form."""

    def find() -> Posed | str:
        try:
            return plan_to(system, frame)
        except NoClosedForm as error:
            return str(error)

    plan: Posed | str = system.cached(("plan or reason", frame), find)
    return plan


def _complete(
    system: System, given: tuple[int, ...], q: Array, p: Array
) -> Iterable[ClosedConfiguration]:
    """The closed configurations with the given positions as in q, and the held ones."""
    if not system.is_closed:
        return [ClosedConfiguration(q, "", 0.0)]
    known = _known(system, given)
    closing = Closing(system, p, known.indices)
    branches = _branches(closing, _stages(system, given), q)
    return _distinct(system, _closed(closing, _agreeing(system, known, q, branches)))


_Branches = Iterable[tuple[Array, tuple[str, ...]]]


def _branches(closing: Closing, stages: tuple[Stage, ...] | str, q: Array) -> _Branches:
    """All positions and the labels of the branch, by closed forms where every loop has one."""
    if isinstance(stages, str):
        return [(found, ()) for found in closed_configurations(closing, q)]
    return every_configuration(stages, started_at(closing.system, q, closing.locked), closing.p)


def _agreeing(system: System, known: Known, q: Array, branches: _Branches) -> _Branches:
    """Those whose dependent joints are where the chain has them."""
    indices = list(known.dependent)
    for found, branch in branches:
        whole = found[: system.nq].copy()
        if np.all(np.abs(difference(system, whole, q)[indices]) < _AGREE):
            whole[indices] = q[indices]
            yield whole, branch


def _closed(closing: Closing, branches: _Branches) -> Iterator[ClosedConfiguration]:
    """Those in which the loops are closed."""
    for found, branch in branches:
        q = found
        if closing.openness(q) > TOLERANCE:
            nearest = closing.nearest(found)
            if np.max(np.abs(nearest.q - found)) < _MOVED:
                q = nearest.q
        if closing.openness(q) < CLOSED and closing.faces(q):
            yield ClosedConfiguration(q, ", ".join(branch), _largest(closing.rows(q)[0]))


def _reaching(target: Goal, branches: _Branches) -> Iterator[ClosedConfiguration]:
    """Those in which the loops are closed and the frame is where it is wanted."""
    for found, branch in branches:
        q = found[: target.closing.system.nq]
        if TOLERANCE < target.openness(q) < _MOVED:
            nearest = target.nearest(q)
            if np.max(np.abs(nearest.q - q)) < _MOVED:
                q = nearest.q
        if target.openness(q) < CLOSED and target.closing.faces(q):
            yield ClosedConfiguration(q, ", ".join(branch), _largest(target.residual(q)[0]))


def _distinct(
    system: System, configurations: Iterable[ClosedConfiguration]
) -> list[ClosedConfiguration]:
    """Two that meet are listed once."""
    kept = list(configurations)
    along = [_mark(system, configuration.q) for configuration in kept]
    order = np.argsort(along, kind="stable")
    twins = set[int]()
    for k, number in enumerate(order):
        for other in order[k + 1 :]:
            if along[other] - along[number] > _SAME * system.nq:
                break
            if _distance(system, kept[other].q, kept[number].q) < _SAME:
                twins.add(max(other, number))
    return [configuration for number, configuration in enumerate(kept) if number not in twins]


def _mark(system: System, q: Array) -> float:
    """A number that is the same for the same configuration, and most often for no other one."""
    turns = np.array([coordinate.unit == "rad" for coordinate in system.coordinates])
    # of a joint, any that differ, none near zero
    weights = np.random.default_rng(_SEED).uniform(0.1, 0.5, (2, system.nq))
    return float(
        weights[0] @ np.where(turns, np.cos(q), np.abs(q)) + weights[1] @ (turns * np.sin(q))
    )


def _distance(system: System, q: Array, other: Array) -> float:
    return float(np.max(np.abs(difference(system, q, other)), initial=0.0))


def _largest(rows: Array) -> float:
    return float(np.max(np.abs(rows), initial=0.0))


# Robots whose frame hangs on balls or on more joints than a chain may have: legs solve it.


_SINGULAR = 1e-6
"""Singular value of pose and loops together at which roots meet and a solution counts for none: two
roots that lie 1e-6 apart are one."""


def parallel(wishes: Wishes, frame: str | int | None, T: Array, p: Array) -> Solutions:
    """Every configuration that takes a frame of a robot with loops to a pose.

    Args:
        wishes: the robot, and what is asked for beside the pose.
        frame: as for `solve`.
        T: (4, 4) the target pose.
        p: (np,) parameters.
    """
    system = wishes.system
    name = terminal_frame(system) if frame is None else frame
    searched = why_searched(system, name)
    found = configurations_at(system, name, T, p, wishes.near)
    method = "loops in closed form" if searched is None else "search"
    reason = "no configuration closes the loops and takes the frame to the pose"
    if searched is not None:
        reason += f"; it was searched for from many starts, which proves nothing: {searched}"
    values = {a.name: float(x) for a, x in zip(system.parameters, p, strict=True)}
    target = goal(system, name, T, None, values)
    drafts = [
        _draft(configuration, target.residual(configuration.q)[1], k)
        for k, configuration in enumerate(found)
    ]
    return wishes.solutions(drafts, method, "" if drafts else reason)


def _draft(configuration: ClosedConfiguration, slope: Array, number: int) -> RobotSolution:
    """A solution; its singular value is that of pose and loops together."""
    sigma = float(np.linalg.svd(slope, compute_uv=False)[-1])
    count = 1 if sigma > _SINGULAR else 0
    return RobotSolution(
        configuration.q,
        configuration.label or str(number + 1),
        configuration.residual,
        sigma,
        count,
    )
