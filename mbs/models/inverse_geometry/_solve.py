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
from mbs.errors import ModelError, NoClosedForm
from mbs.models.inverse_geometry.answer import (
    Examined,
    PoseProblem,
    answer,
    named,
    new_among,
    roots,
)
from mbs.models.inverse_geometry.branches import branch_labels
from mbs.models.inverse_geometry.chain import FrameChain, frame_chain, target_pose
from mbs.models.inverse_geometry.closed_form import CLOSED_FORMS, require_method, sequence_of
from mbs.models.inverse_geometry.clusters import separated
from mbs.models.inverse_geometry.gathering import (
    METHODS,
    Gathered,
    beside,
    by_search,
    gather,
    gather_further,
    joined,
)
from mbs.models.inverse_geometry.kernel import PoseKernel, kernel_of
from mbs.models.inverse_geometry.redundancy import LockedSamples, Redundant, samples_of
from mbs.models.inverse_geometry.root import ChainRoot
from mbs.models.inverse_geometry.solutions import (
    Given,
    RegularSolutions,
    Solutions,
    SolveOptions,
    bounds,
    leaves_out,
)
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
        shell = _shell_of(system, frame, method, limits, locked, parameters)
        found = None if shell is None else shell.solutions(T, seed)
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


_KEPT = 256  # cached shells per system: one for each set of locked positions and parameter values
Seed = Mapping[str, float] | Sequence[float] | None


@dataclass(frozen=True, slots=True, eq=False)
class _Shell:
    """Data of a frame that `solve` reuses for all poses.

    Attributes:
        kernel: solver for single poses.
        names: names of the coordinates of the system.
        plain: options without a seed.
    """

    kernel: PoseKernel
    names: tuple[str, ...]
    plain: SolveOptions

    def solutions(self, T: Any, seed: Seed) -> Solutions | None:
        """Return the solutions of a regular pose, or None if `solve` must use other methods."""
        kernel, wishes = self.kernel, self.plain
        draft = kernel.draft_of(T)
        if draft is None or not draft.certain or not len(draft.q):
            return None
        if seed is not None:
            wishes = replace(wishes, near=_near(wishes.system, kernel.chain, seed), seeded=True)
        q = np.empty((len(draft.q), len(self.names)))
        q[:] = wishes.near
        q[:, kernel.chain.indices] = draft.q
        q, within = wishes.bounds.wound(q, wishes.near)
        order = np.flatnonzero(within) if wishes.strict else np.arange(len(q))
        if not len(order):
            return None
        if wishes.seeded:
            order = order[np.argsort(np.linalg.norm(q[order] - wishes.near, axis=1), kind="stable")]
        names = [kernel.labels[b] for b in draft.branch[order].tolist()]
        rows = RegularSolutions(
            q[order],
            names,
            draft.residual[order],
            kernel.arm,
            draft.q[order],
            wishes.bounds,
            wishes.near,
            within[order],
        )
        system = wishes.system
        return Solutions(system.name, self.names, rows, kernel.method, "", None, wishes.bounds)


def _shell_of(
    system: System,
    frame: str | int | None,
    method: str,
    limits: bool | Given | None,
    locked: Mapping[str, float] | None,
    parameters: Mapping[str, float] | None,
) -> _Shell | None:
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

    def made() -> _Shell | None:
        require_method(system, method, METHODS)
        p = np.array(system.parameter_values(parameters))
        chain = chain_or_none(system, frame, locked)
        kernel = None if chain is None or system.is_closed else kernel_of(chain, p, method)
        if chain is None or kernel is None:
            return None
        names = tuple(coordinate.name for coordinate in system.coordinates)
        return _Shell(kernel, names, _wishes(system, chain, limits, None))

    shell: _Shell | None = system.recent("poses of a frame", key, made, _KEPT)
    return shell


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
        return parallel(_wishes(system, None, limits, seed), frame, target, p)
    if redundant is None:
        return solve_at(chain, samples.r[0, 0], target, method, p, limits, seed)
    asked = [_asked(chain, r, target, method, p, limits, seed) for r in samples.r[0]]
    return _joined(asked, samples, None if seed is None else np.array(system.position(seed)))


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
    return answer(*_asked(chain, r, T, method, p, limits, seed))


_Asked = tuple[PoseProblem, list[ChainRoot], str]
"""Problem, solutions of its chain, and name of the method that computed them."""


def _asked(
    chain: FrameChain,
    r: Array,
    T: Array,
    method: str,
    p: Array,
    limits: bool | Given | None,
    seed: Mapping[str, float] | Sequence[float] | None,
) -> _Asked:
    require_method(chain.system, method, METHODS)
    own = chain.locked_at(r) if chain.varied else chain
    wishes = _wishes(chain.system, own, limits, seed)
    question = PoseProblem(own, Target(own.arm(p), T), p, wishes)
    if chain.varied:  # one closed form serves all positions
        found, used = solved(question, method, chain, r)
        return question, named(question, found, _signs(chain, method, p)), used
    kernel = kernel_of(chain, p, method)
    draft = None if kernel is None else kernel.draft(T)
    if kernel is not None and draft is not None and draft.certain:
        labels = [kernel.labels[b] for b in draft.branch]
        certain = [ChainRoot(q, name, 1) for q, name in zip(draft.q, labels, strict=True)]
        return question, certain, kernel.method
    found, used = solved(question, method, chain, r)
    return question, named(question, found, kernel.labels if kernel else ()), used


def _signs(chain: FrameChain, method: str, p: Array) -> tuple[str, ...]:
    """Return the branch names of the closed form, empty without one."""
    if method not in ("auto", *CLOSED_FORMS):
        return ()
    try:
        return branch_labels(chain, sequence_of(chain, method, p), p)
    except NoClosedForm:
        return ()


def solved(
    question: PoseProblem, method: str, varied: FrameChain, r: Array
) -> tuple[list[ChainRoot], str]:
    """Return the distinct solutions of a chain and the name of the method that computed them.

    Args:
        question: chain and target pose.
        method: argument of `solve`.
        varied: the same chain with symbolic positions of the varied joints.
        r: (k,) positions of the varied joints in `question` [rad or m].
    """
    chain, target, p = question.chain, question.target, question.p
    gathered = gather(varied, target, method, p, r)
    if method not in ("auto", *CLOSED_FORMS) or not _is_doubtful(target, gathered):
        return roots(target, gathered, question.chain_indices), gathered.method
    gathered = gather_further(chain, target, gathered, p)
    examined: Examined = {}
    found = roots(target, gathered, question.chain_indices, examined)
    for root in found:
        if root.family is not None and root.family.dimension == 1:
            samples = root.family.chain_samples / target.unit
            gathered = joined(gathered, new_among(target, found, beside(target, samples)))
    if any(root.family is not None for root in found):
        found = roots(target, gathered, question.chain_indices, examined)
    if gathered.method == "search":
        return separated(target, found), gathered.method
    # a search also finds points of known self-motions, which are dropped here
    more = new_among(target, found, by_search(target))
    if len(more.q):
        found = roots(target, joined(gathered, more), question.chain_indices, examined)
    return separated(target, found), gathered.method


def _joined(asked: list[_Asked], samples: LockedSamples, near: Array | None) -> Solutions:
    """Join the solutions of all samples of redundant joints, sorted by distance from `near`.

    Without any solution: the reason at the sample that comes nearest to the pose.
    """
    reached = [k for k, (_, found, _) in enumerate(asked) if found]
    if not reached:
        reached = [int(np.argmin([_away(question) for question, _, _ in asked]))]
    answers = [answer(*asked[k]) for k in reached]
    every = [solution for own in answers for solution in own]
    if near is not None:
        every.sort(key=lambda solution: float(np.linalg.norm(solution.q - near)))
    if every:
        return replace(answers[0], solutions=tuple(every), reason="", nearest=None)
    position = zip(samples.varied, samples.r[0, reached[0]], strict=True)
    at = ", ".join(f"{name} = {x:.6g}" for name, x in position)
    reason = f"none at {len(asked)} positions of redundant joints; at {at}: {answers[0].reason}"
    return replace(answers[0], reason=reason)


def _away(question: PoseProblem) -> float:
    """Return the distance of the nearest reachable pose: [arm lengths] plus [rad]."""
    arm = question.target.arm
    found = nearest(arm, question.target.T)
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


def _is_doubtful(target: Target, gathered: Gathered) -> bool:
    """Whether solutions may be missing: none was found, or one is nearly singular."""
    if gathered.doubtful or not len(gathered.q):
        return True
    return bool(np.any(nearly_singular(target.arm, gathered.q)))


def _wishes(
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
