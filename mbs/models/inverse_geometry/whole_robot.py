"""Configurations of trees and robots with loops from the joints of one chain or from a pose."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np

from mbs.assembly import System
from mbs.closed_forms.arm import Array
from mbs.closed_forms.ring import spin_indices
from mbs.errors import NoClosedForm
from mbs.loops.closing import CLOSED, TOLERANCE, Closing, difference
from mbs.loops.mode_search import closed_configurations, distance, working_modes
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
from mbs.models.inverse_geometry.solutions import Solution, Solutions, SolveOptions
from mbs.models.inverse_geometry.target import SINGULAR_ERROR

# Configurations of trees and of robots with closed loops, from the joints between base and frame.
#
# The chain from the base to the frame is solved separately. Its joints are then known, and loop
# closure determines all other joints. If the chain has spherical or free joints, as in a parallel
# robot, the known pose of the frame closes one more loop instead.
#
# Source: Khalil & Creusot 1997, section 3.3.


_SAME = 1e-7
"""Difference [rad or m] below which two configurations are equal. Loops are closed to 1e-12, an
error that weakly determined joints amplify. Regular branches are farther apart."""
_SEED = 20260108
_AGREE = 1e-7
"""Largest difference [rad or m] of joints that both the chain and the loops determine: closure
errors of 1e-12, amplified by weakly determined joints."""
_MOVED = 1e-5
"""Largest move [rad or m] to the nearest closed configuration that corrects rounding errors, which
are up to 1e-6 at a double root. A larger move results in another configuration."""


def close(
    system: System, chain: FrameChain, configurations: Array, p: Array, seed: Array | None = None
) -> list[Solution]:
    """Return all system configurations with given positions of the joints of a chain.

    All branches of the loop closure are computed by closed forms, or by a search from many starts
    if `why_searched` gives a reason. Joints that neither the chain nor the loops determine keep
    their positions in the seed.

    Args:
        system: open or closed system.
        chain: chain of joints from the base to a frame.
        configurations: (m, n) positions of the joints of the chain [rad or m].
        p: (np,) parameter values.
        seed: (nq,) reference configuration; default is the assembled configuration.

    Returns:
        Configurations with their loop branches, such as "q9:parallel, q3:+", and largest closure
        errors, in the order of `configurations`. Empty if the loops cannot be closed.

    Raises:
        NoClosedForm: a spherical or free joint outside the chain keeps only some of its freedoms.
    """
    rest = np.array(system.configuration if seed is None else seed, dtype=float)
    given = _given(system, chain)
    found = list[Solution]()
    for configuration in np.atleast_2d(np.asarray(configurations, dtype=float)):
        if configuration.size:
            q = rest.copy()
            q[list(given)] = [*configuration, *chain.locked.values()]
            found += _complete(system, given, q, p)
    return found


def configurations_at(
    system: System, frame: str | int, T: Array, p: Array, seed: Array | None = None
) -> list[Solution]:
    """Return all system configurations with a given pose of a frame, as for a parallel robot.

    The frame may be supported by spherical or free joints. The configurations are computed by
    closed forms, or by a search from many starts if `why_searched` gives a reason. Joints that the
    pose does not determine keep their positions in the seed.

    Args:
        system: open or closed system.
        frame: name of a body or frame, or index of a link.
        T: (4, 4) target pose, a result of `target_pose`.
        p: (np,) parameter values.
        seed: (nq,) reference configuration; default is the assembled configuration.

    Returns:
        Configurations with their loop branches and largest errors, sorted by distance from the
        seed.

    Raises:
        LoopError: the search is used, and joints can move while the frame is fixed.
    """
    rest = np.array(system.configuration if seed is None else seed, dtype=float)
    given = zip(system.parameters, p, strict=True)
    values = {symbol.name: float(x) for symbol, x in given if np.isfinite(x)}
    plan = _plan_to(system, frame)
    if isinstance(plan, str):
        modes = working_modes(system, frame, T, guess=list(rest), parameters=values)
        return [Solution(np.array(mode.q), "", mode.residual) for mode in modes]
    target = goal(system, frame, T, None, values)
    branches = every_configuration(plan.stages, plan.started(T, rest), p)
    found = _distinct(system, _reaching(target, branches))
    return sorted(found, key=lambda configuration: distance(system, configuration.q, rest))


def why_searched(system: System, chain: FrameChain | str | int) -> str | None:
    """Return the reason why a search is used, whose list of configurations may be incomplete.

    Args:
        system: open or closed system.
        chain: argument `chain` of `close`, or argument `frame` of `configurations_at`.

    Returns:
        Error text, or None if closed forms find all configurations.
    """
    outcome: object = None
    if not isinstance(chain, FrameChain):
        outcome = _plan_to(system, chain)
    elif system.is_closed:
        outcome = _stages(system, _given(system, chain))
    return outcome if isinstance(outcome, str) else None


def _given(system: System, chain: FrameChain) -> tuple[int, ...]:
    """Return the indices in q of the free joints of the chain, then of its locked joints."""
    starts = {link.name: link.q.start for link in system.tree.links}
    return (*chain.indices, *(starts[name] for name in chain.locked))


def _known(system: System, given: tuple[int, ...]) -> Known:
    known: Known = system.cached(("completed", given), lambda: complete(system, given))
    return known


def _stages(system: System, given: tuple[int, ...]) -> tuple[Stage, ...] | str:
    """Return the closed-form stages that close the loops, or the reason if there are none."""

    def find() -> tuple[Stage, ...] | str:
        try:
            indices = _known(system, given).indices
            return plan_from(system, (*indices, *spin_indices(system).values()))
        except NoClosedForm as error:
            return str(error)

    stages: tuple[Stage, ...] | str = system.cached(("stages or reason", given), find)
    return stages


def _plan_to(system: System, frame: str | int) -> Posed | str:
    """Return the closed-form plan for a known frame pose, or the reason if there is none."""

    def find() -> Posed | str:
        try:
            return plan_to(system, frame)
        except NoClosedForm as error:
            return str(error)

    plan: Posed | str = system.cached(("plan or reason", frame), find)
    return plan


def _complete(system: System, given: tuple[int, ...], q: Array, p: Array) -> Iterable[Solution]:
    """Return the closed configurations with the positions `given` as in q (nq,)."""
    if not system.is_closed:
        return [Solution(q, "", 0.0)]
    known = _known(system, given)
    closing = Closing(system, p, known.indices)
    branches = _branches(closing, _stages(system, given), q)
    return _distinct(system, _closed(closing, _agreeing(system, known, q, branches)))


_Branches = Iterable[tuple[Array, tuple[str, ...]]]


def _branches(closing: Closing, stages: tuple[Stage, ...] | str, q: Array) -> _Branches:
    """Return positions and branch labels of all closures, by closed forms or by search."""
    if isinstance(stages, str):
        return [(found, ()) for found in closed_configurations(closing, q)]
    return every_configuration(stages, started_at(closing.system, q, closing.locked), closing.p)


def _agreeing(system: System, known: Known, q: Array, branches: _Branches) -> _Branches:
    """Keep the branches whose dependent joints agree with the chain positions in q."""
    indices = list(known.dependent)
    for found, branch in branches:
        whole = found[: system.nq].copy()
        if np.all(np.abs(difference(system, whole, q)[indices]) < _AGREE):
            whole[indices] = q[indices]
            yield whole, branch


def _closed(closing: Closing, branches: _Branches) -> Iterator[Solution]:
    """Keep the branches with closed loops, after correction of rounding errors."""
    for found, branch in branches:
        q = found
        if closing.openness(q) > TOLERANCE:
            nearest = closing.nearest(found)
            if np.max(np.abs(nearest.q - found)) < _MOVED:
                q = nearest.q
        if closing.openness(q) < CLOSED and closing.faces(q):
            yield Solution(q, ", ".join(branch), _largest(closing.rows(q)[0]))


def _reaching(target: Goal, branches: _Branches) -> Iterator[Solution]:
    """Keep the branches with closed loops and the frame at its target pose."""
    for found, branch in branches:
        q = found[: target.closing.system.nq]
        if TOLERANCE < target.openness(q) < _MOVED:
            nearest = target.nearest(q)
            if np.max(np.abs(nearest.q - q)) < _MOVED:
                q = nearest.q
        if target.openness(q) < CLOSED and target.closing.faces(q):
            yield Solution(q, ", ".join(branch), _largest(target.residual(q)[0]))


def _distinct(system: System, configurations: Iterable[Solution]) -> list[Solution]:
    """Remove copies of equal configurations."""
    kept = list(configurations)
    along = [_mark(system, configuration.q) for configuration in kept]
    order = np.argsort(along, kind="stable")
    twins = set[int]()
    for k, number in enumerate(order):
        for other in order[k + 1 :]:
            if along[other] - along[number] > _SAME * system.nq:
                break
            if distance(system, kept[other].q, kept[number].q) < _SAME:
                twins.add(max(other, number))
    return [configuration for number, configuration in enumerate(kept) if number not in twins]


def _mark(system: System, q: Array) -> float:
    """Return a number that is equal for equal configurations and usually differs otherwise."""
    turns = np.array([coordinate.unit == "rad" for coordinate in system.coordinates])
    # arbitrary different weights of the joints, none near zero
    weights = np.random.default_rng(_SEED).uniform(0.1, 0.5, (2, system.nq))
    return float(
        weights[0] @ np.where(turns, np.cos(q), np.abs(q)) + weights[1] @ (turns * np.sin(q))
    )


def _largest(rows: Array) -> float:
    return float(np.max(np.abs(rows), initial=0.0))


# Robots whose frame has spherical joints or too many joints in its chain: closure of the legs.


def parallel(options: SolveOptions, frame: str | int | None, T: Array, p: Array) -> Solutions:
    """Compute all configurations of a robot with loops for a pose of a frame.

    Args:
        options: robot and options of the user (limits, seed).
        frame: argument of `solve`.
        T: (4, 4) target pose relative to the base [m].
        p: (np,) parameter values.
    """
    system = options.system
    name = terminal_frame(system) if frame is None else frame
    searched = why_searched(system, name)
    found = configurations_at(system, name, T, p, options.near)
    method = "loops in closed form" if searched is None else "search"
    reason = "no configuration closes the loops and takes the frame to the pose"
    if searched is not None:
        reason += f"; it was searched for from many starts, which proves nothing: {searched}"
    values = {a.name: float(x) for a, x in zip(system.parameters, p, strict=True)}
    target = goal(system, name, T, None, values)
    whole = [
        _completed(solution, target.residual(solution.q)[1], k) for k, solution in enumerate(found)
    ]
    return options.solutions(whole, method, "" if whole else reason)


def _completed(solution: Solution, slope: Array, number: int) -> Solution:
    """Return a solution with the smallest singular value of pose and loop equations."""
    sigma = float(np.linalg.svd(slope, compute_uv=False)[-1])
    count = 1 if sigma > SINGULAR_ERROR else 0  # two roots at this distance count as one
    name = solution.branch or str(number + 1)
    return replace(solution, branch=name, sigma_min=sigma, multiplicity=count)
