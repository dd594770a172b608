"""Every configuration that takes a frame of a robot to a pose."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from mbs.assembly import System
from mbs.assembly.model_function import require_system
from mbs.closed_forms.arm import Array
from mbs.errors import ModelError
from mbs.models.inverse_geometry.answer import ChainRoot, Question, answer, named, new_among, roots
from mbs.models.inverse_geometry.chain import FrameChain, frame_chain, target_pose
from mbs.models.inverse_geometry.closed_form import CLOSED_FORMS, require_method
from mbs.models.inverse_geometry.gathering import (
    METHODS,
    Gathered,
    by_search,
    gather,
    gather_further,
    joined,
)
from mbs.models.inverse_geometry.kernel import kernel_of
from mbs.models.inverse_geometry.solutions import Given, Solutions, Wishes, bounds, leaves_out
from mbs.models.inverse_geometry.target import Target, nearly_singular
from mbs.models.inverse_geometry.whole_robot import parallel


def solve(
    system: System,
    T: Any,
    frame: str | int | None = None,
    method: str = "auto",
    limits: bool | Given | None = None,
    seed: Mapping[str, float] | Sequence[float] | None = None,
    *,
    locked: Mapping[str, float] | None = None,
    parameters: Mapping[str, float] | None = None,
) -> Solutions:
    """Every configuration that takes a frame to a pose.

    Each is checked with the forward model to 1e-12 of max(1 m, the robot's length). Next to
    singular configurations several methods are joined so that none is missed.

    Args:
        system: a serial robot, a tree, or a robot with loops.
        T: (4, 4) the pose of the frame seen from the base [m].
        frame: a body, a named frame, the number of a link, or None for the terminal frame.
        method: "auto" for a closed form where there is one, else the general method, else the
            search; or one of "pieper", "paul", "general", "search".
        limits: None leaves out no solution and says of each whether it is within the robot's own
            limits; True leaves out those that are not; (lowest, highest) by name replaces limits
            and leaves out likewise.
        seed: a configuration by name or (nq,) [rad or m]; solutions are sorted by their distance
            from it and wound towards it, and it places the joints that the frame does not depend
            on.
        locked: positions of joints that stay where they are, by name [rad or m].
        parameters: values of symbols, the others at their defaults.

    Returns:
        Solutions, which say why they are empty where they are.

    Raises:
        ModelError: T is no rigid transform, a name or a method is unknown, or more than six
            joints are free.
        NoClosedForm: "pieper" or "paul" was asked for and does not fit.
    """
    require_system(system)
    target = target_pose(system, T)
    return solve_rigid(
        system, target, frame, method, limits, seed, locked=locked, parameters=parameters
    )


def solve_rigid(
    system: System,
    target: Array,
    frame: str | int | None,
    method: str,
    limits: bool | Given | None = None,
    seed: Mapping[str, float] | Sequence[float] | None = None,
    *,
    locked: Mapping[str, float] | None,
    parameters: Mapping[str, float] | None,
) -> Solutions:
    """`solve` for a transform that is rigid to the last digit: rounded twice it would be another.

    Args:
        system: as of `solve`.
        target: (4, 4) as `target_pose` gives it.
        frame: as of `solve`.
        method: likewise.
        limits: likewise.
        seed: likewise.
        locked: likewise.
        parameters: likewise.
    """
    p = np.array(system.parameter_values(parameters))
    chain = chain_or_none(system, frame, locked)
    wishes = _wishes(system, chain, limits, seed)
    if chain is None:
        return parallel(wishes, frame, target, p)
    require_method(system, method, METHODS)
    question = Question(chain, Target(chain.arm(p), target), p, wishes)
    kernel = kernel_of(chain, p, method)
    draft = None if kernel is None else kernel.draft(target)
    if kernel is not None and draft is not None and draft.certain:
        labels = [kernel.labels[b] for b in draft.branch]
        found = [ChainRoot(q, name, 1) for q, name in zip(draft.q, labels, strict=True)]
        return answer(question, found, kernel.method)
    found, used = solved(question, method)
    return answer(question, named(question, found, kernel.labels if kernel else ()), used)


def solved(question: Question, method: str) -> tuple[list[ChainRoot], str]:
    """The solutions of a chain, and the method that gave them.

    Args:
        question: the chain and the pose.
        method: as in `solve`.
    """
    chain, target, p = question.chain, question.target, question.p
    gathered = gather(chain, target, method, p)
    if method not in ("auto", *CLOSED_FORMS) or not _is_doubtful(target, gathered):
        return roots(target, gathered, question.chain_indices), gathered.method
    gathered = gather_further(chain, target, gathered, p)
    found = roots(target, gathered, question.chain_indices)
    if gathered.method == "search":
        return found, gathered.method
    # where an arm moves, a search gives points of what is known already
    more = new_among(target, found, by_search(target))
    if len(more.q):
        found = roots(target, joined(gathered, more), question.chain_indices)
    return found, gathered.method


def chain_or_none(
    system: System, frame: str | int | None, locked: Mapping[str, float] | None
) -> FrameChain | None:
    """The chain to the frame; None where a robot with loops has none that can stand alone."""
    try:
        return frame_chain(system, frame, locked)
    except ModelError:
        if locked or not system.is_closed:
            raise
        if frame is not None:
            system.frame(frame)
        return None


def _is_doubtful(target: Target, gathered: Gathered) -> bool:
    """Whether a solution may be missing: none was found, or next to a singular configuration."""
    if gathered.doubtful or not len(gathered.q):
        return True
    return bool(np.any(nearly_singular(target.arm, gathered.q)))


def _wishes(
    system: System,
    chain: FrameChain | None,
    limits: bool | Given | None,
    seed: Mapping[str, float] | Sequence[float] | None,
) -> Wishes:
    near = np.array(system.position(seed))
    names = [coordinate.name for coordinate in system.coordinates]
    locked_indices = [] if chain is None else [names.index(name) for name in chain.locked]
    if chain is not None:
        if seed is None:
            near[list(chain.indices)] = 0.0
        near[locked_indices] = list(chain.locked.values())
    turning = None if chain is None or system.is_closed else chain.indices
    coupled = [k for c in system.couplings for k in c.coordinates]
    limited = bounds(system, limits, set(turning or range(system.nq)) - {*locked_indices, *coupled})
    return Wishes(system, near, limited, leaves_out(limits), seed is not None)
