"""Inverse geometric model for one pose: all configurations at which a frame has this pose."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mbs.assembly import System
from mbs.assembly.model_function import require_system
from mbs.closed_forms.arm import Array
from mbs.closed_forms.arm_search import nearest
from mbs.errors import ModelError
from mbs.models.inverse_geometry.answer import PoseProblem, answer, with_names
from mbs.models.inverse_geometry.branches import branch_labels
from mbs.models.inverse_geometry.chain import FrameChain, frame_chain, target_pose
from mbs.models.inverse_geometry.closed_form import CLOSED_FORMS, require_method, sequence_or_none
from mbs.models.inverse_geometry.draft import (
    METHODS,
    extend_draft,
    join_drafts,
    pose_draft,
    search_draft,
    valley_draft,
)
from mbs.models.inverse_geometry.draft_compiled import PoseKernel, kernel_of
from mbs.models.inverse_geometry.redundancy import LockedSamples, Redundant, samples_of
from mbs.models.inverse_geometry.solutions import (
    Given,
    PoseDraft,
    Solution,
    Solutions,
    SolveOptions,
    bounds,
    leaves_out,
)
from mbs.models.inverse_geometry.target import Target, nearly_singular
from mbs.models.inverse_geometry.verify import Examined, merge_connected, new_among, verify
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
    redundant: Redundant | None = None,
    parameters: Mapping[str, float] | None = None,
) -> Solutions:
    """Compute all configurations at which a frame has a given pose (inverse kinematics).

    Each solution is verified with forward kinematics to 1e-12 of max(1 m, length of the robot).
    Near singular configurations the solutions of several methods are merged, to miss none.

    Args:
        system: serial robot, tree, or robot with closed loops.
        T: (4, 4) pose of the frame relative to the base [m].
        frame: name of a body or frame, index of a link, or None for the terminal frame.
        method: "auto" selects a closed form if one exists, else the general method, else the
            search. "pieper", "paul", "general" and "search" select one method.
        limits: None keeps all solutions and reports for each whether it is within the joint limits
            of the model. True drops solutions beyond these limits. A dict of (lower, upper) by
            joint name replaces limits and drops solutions beyond them.
        seed: configuration as a dict by name or (nq,) [rad or m]. Solutions are sorted by their
            distance from it, and angles are shifted by full revolutions towards it. Joints that do
            not move the frame take their positions from it.
        locked: positions of fixed joints, by name [rad or m].
        redundant: samples of joints beyond the six that a pose determines, by name: number of
            positions between the limits (or over one revolution), or array (S,) of positions [rad
            or m]. Solutions of all combinations are returned.
        parameters: parameter values by name; default values for all others.

    Returns:
        Solutions. If there is none, its `reason` explains why.

    Raises:
        ModelError: T is no rigid transform, a name or a method is unknown, or more than six
            joints are free.
        NoClosedForm: method is "pieper" or "paul" and does not apply to the robot.
    """
    require_system(system)
    if redundant is None:
        prepared = _prepared_frame(system, frame, method, limits, locked, parameters)
        found = None if prepared is None else prepared.solutions(T, seed)
        if found is not None:
            return found
    target = target_pose(system, T)
    return solve_rigid(
        system,
        target,
        frame,
        method,
        limits,
        seed,
        locked=locked,
        redundant=redundant,
        parameters=parameters,
    )


_KEPT = 256  # cached frames per system: one for each set of locked positions and parameter values
Seed = Mapping[str, float] | Sequence[float] | None


@dataclass(frozen=True, slots=True, eq=False)
class _PreparedFrame:
    """Data of a frame that `solve` reuses for all poses: solver for single poses, and options."""

    kernel: PoseKernel
    options: SolveOptions

    def solutions(self, T: Any, seed: Seed) -> Solutions | None:
        """Return the solutions of a regular pose, or None if `solve` must use other methods."""
        kernel, options = self.kernel, self.options
        draft = kernel.draft_of(T)
        if draft is None or not draft.certain or not len(draft.q):
            return None
        if seed is not None:
            near = _near(options.system, kernel.chain, seed)
            options = replace(options, near=near, seeded=True)
        return options.regular_solutions(draft, kernel.chain.indices, kernel.arm)


def _prepared_frame(
    system: System,
    frame: str | int | None,
    method: str,
    limits: bool | Given | None,
    locked: Mapping[str, float] | None,
    parameters: Mapping[str, float] | None,
) -> _PreparedFrame | None:
    """Return the cached data of a frame, or None if only the slow methods apply."""
    # an argument that is no dict keeps its type in the key; its reader raises the error
    given = (
        (type(x), tuple(x.items()) if isinstance(x, Mapping) else x)
        for x in (limits, locked, parameters)
    )
    key = (frame, method, *given)
    try:
        hash(key)
    except TypeError:  # unhashable arguments are not cached
        return None

    def made() -> _PreparedFrame | None:
        require_method(system, method, METHODS)
        p = np.array(system.parameter_values(parameters))
        chain = chain_or_none(system, frame, locked)
        kernel = None if chain is None or system.is_closed else kernel_of(chain, p, method)
        if chain is None or kernel is None:
            return None
        return _PreparedFrame(kernel, _options_of(system, chain, limits, None))

    prepared: _PreparedFrame | None = system.memoised("poses of a frame", key, made, _KEPT)
    return prepared


def solve_rigid(
    system: System,
    target: Array,
    frame: str | int | None,
    method: str,
    limits: bool | Given | None = None,
    seed: Mapping[str, float] | Sequence[float] | None = None,
    *,
    locked: Mapping[str, float] | None,
    redundant: Redundant | None = None,
    parameters: Mapping[str, float] | None,
) -> Solutions:
    """`solve` for a pose from `target_pose`, which is not projected to a rigid transform again.

    Args:
        system: argument of `solve`.
        target: (4, 4) result of `target_pose`. A second projection would change its rounding.
        frame: argument of `solve`.
        method: argument of `solve`.
        limits: argument of `solve`.
        seed: argument of `solve`.
        locked: argument of `solve`.
        redundant: argument of `solve`.
        parameters: argument of `solve`.
    """
    p = np.array(system.parameter_values(parameters))
    samples = samples_of(system, locked, redundant, limits, 1)
    chain = chain_or_none(system, frame, samples.locked, samples.varied)
    if chain is None:
        return parallel(_options_of(system, None, limits, seed), frame, target, p)
    if redundant is None:
        return solve_at(chain, samples.r[0, 0], target, method, p, limits, seed)
    solved = [_solve_chain(chain, r, target, method, p, limits, seed) for r in samples.r[0]]
    return _join_samples(solved, samples, None if seed is None else np.array(system.position(seed)))


def solve_at(
    chain: FrameChain,
    r: Array,
    T: Array,
    method: str,
    p: Array,
    limits: bool | Given | None = None,
    seed: Mapping[str, float] | Sequence[float] | None = None,
) -> Solutions:
    """Solve a pose of a chain for given positions of its varied (redundant) joints.

    Args:
        chain: chain whose closed form is valid for all positions of the varied joints.
        r: (k,) positions of the varied joints [rad or m].
        T: (4, 4) pose of the end frame relative to the base [m].
        method: argument of `solve`.
        p: (np,) parameter values.
        limits: argument of `solve`.
        seed: argument of `solve`.
    """
    return answer(*_solve_chain(chain, r, T, method, p, limits, seed))


_ChainSolutions = tuple[PoseProblem, list[Solution], str]
"""Problem, solutions of its chain, and name of the method that computed them."""


def _solve_chain(
    chain: FrameChain,
    r: Array,
    T: Array,
    method: str,
    p: Array,
    limits: bool | Given | None,
    seed: Mapping[str, float] | Sequence[float] | None,
) -> _ChainSolutions:
    require_method(chain.system, method, METHODS)
    own = chain.locked_at(r) if chain.varied else chain
    options = _options_of(chain.system, own, limits, seed)
    problem = PoseProblem(own, Target(own.arm(p), T), p, options)
    if chain.varied:  # one closed form serves all positions
        found, used = _distinct_solutions(problem, method, chain, r)
        sequence = sequence_or_none(chain, method, p)
        labels = branch_labels(chain, sequence, p) if sequence else ()
        return problem, with_names(problem, found, labels), used
    kernel = kernel_of(chain, p, method)
    draft = None if kernel is None else kernel.draft(T)
    if kernel is not None and draft is not None and draft.certain:
        certain = [Solution(q, name) for q, name in zip(draft.q, draft.labels, strict=True)]
        return problem, certain, kernel.method
    found, used = _distinct_solutions(problem, method, chain, r)
    return problem, with_names(problem, found, kernel.labels if kernel else ()), used


def _distinct_solutions(
    problem: PoseProblem, method: str, varied: FrameChain, r: Array
) -> tuple[list[Solution], str]:
    """Return the distinct solutions of a chain and the name of the method that computed them.

    Args:
        problem: chain and target pose.
        method: argument of `solve`.
        varied: the same chain with symbolic positions of the varied joints.
        r: (k,) positions of the varied joints in `problem` [rad or m].
    """
    chain, target, p = problem.chain, problem.target, problem.p
    draft = pose_draft(varied, target, method, p, r)
    if method not in ("auto", *CLOSED_FORMS) or not _is_doubtful(target, draft):
        return verify(target, draft, problem.chain_indices), draft.method
    draft = extend_draft(chain, target, draft, p)
    examined: Examined = {}
    found = verify(target, draft, problem.chain_indices, examined)
    for root in found:
        if root.family is not None and root.family.dimension == 1:
            samples = root.family.chain_samples / target.unit
            draft = join_drafts(draft, new_among(target, found, valley_draft(target, samples)))
    if any(root.family is not None for root in found):
        found = verify(target, draft, problem.chain_indices, examined)
    if draft.method == "search":
        return merge_connected(target, found), draft.method
    # a search also finds points of known self-motions, which are dropped here
    more = new_among(target, found, search_draft(target))
    if len(more.q):
        found = verify(target, join_drafts(draft, more), problem.chain_indices, examined)
    return merge_connected(target, found), draft.method


def _join_samples(
    solved: list[_ChainSolutions], samples: LockedSamples, near: Array | None
) -> Solutions:
    """Join the solutions of all samples of redundant joints, sorted by distance from `near`.

    Without any solution: the reason at the sample that comes nearest to the pose.
    """
    reached = [k for k, (_, found, _) in enumerate(solved) if found]
    if not reached:
        reached = [int(np.argmin([_away(problem) for problem, _, _ in solved]))]
    answers = [answer(*solved[k]) for k in reached]
    every = [solution for own in answers for solution in own]
    if near is not None:
        every.sort(key=lambda solution: float(np.linalg.norm(solution.q - near)))
    if every:
        return replace(answers[0], solutions=tuple(every), reason="", nearest=None)
    position = zip(samples.varied, samples.r[0, reached[0]], strict=True)
    at = ", ".join(f"{name} = {x:.6g}" for name, x in position)
    reason = f"none at {len(solved)} positions of redundant joints; at {at}: {answers[0].reason}"
    return replace(answers[0], reason=reason)


def _away(problem: PoseProblem) -> float:
    """Return the distance of the nearest reachable pose: [arm lengths] plus [rad]."""
    arm = problem.target.arm
    found = nearest(arm, problem.target.T)
    return found.distance / arm.length + found.angle


def chain_or_none(
    system: System,
    frame: str | int | None,
    locked: Mapping[str, float] | None,
    varied: tuple[str, ...] = (),
) -> FrameChain | None:
    """Return the chain to the frame, or None if loops prevent a separate solution of a chain."""
    try:
        return frame_chain(system, frame, locked, varied)
    except ModelError:
        if locked or varied or not system.is_closed:
            raise
        if frame is not None:
            system.frame(frame)
        return None


def _is_doubtful(target: Target, draft: PoseDraft) -> bool:
    """Whether solutions may be missing: none was found, or one is nearly singular."""
    if not draft.certain or not len(draft.q):
        return True
    return bool(np.any(nearly_singular(target.arm, draft.q)))


def _options_of(
    system: System,
    chain: FrameChain | None,
    limits: bool | Given | None,
    seed: Mapping[str, float] | Sequence[float] | None,
) -> SolveOptions:
    names = [coordinate.name for coordinate in system.coordinates]
    locked_indices = [] if chain is None else [names.index(name) for name in chain.locked]
    turning = None if chain is None or system.is_closed else chain.indices
    coupled = [k for c in system.couplings for k in c.coordinates]
    limited = bounds(system, limits, set(turning or range(system.nq)) - {*locked_indices, *coupled})
    near = _near(system, chain, seed)
    return SolveOptions(system, near, limited, leaves_out(limits), seed is not None)


def _near(system: System, chain: FrameChain | None, seed: Seed) -> Array:
    """Return the configuration (nq,) from which distances are measured: seed or default."""
    near = np.array(system.position(seed))
    if chain is None:
        return near
    if seed is None:
        near[list(chain.indices)] = 0.0
    names = [coordinate.name for coordinate in system.coordinates]
    near[[names.index(name) for name in chain.locked]] = list(chain.locked.values())
    return near
