"""Answer of one pose: solutions of the robot with branch names, or the reason if there is none."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mbs.closed_forms.arm import Array
from mbs.closed_forms.arm_search import Nearest, nearest
from mbs.models.inverse_geometry.branches import BranchLabels, anatomy, labels
from mbs.models.inverse_geometry.chain import FrameChain
from mbs.models.inverse_geometry.self_motions import Family
from mbs.models.inverse_geometry.solutions import (
    Solution,
    Solutions,
    SolveOptions,
    unreachable,
)
from mbs.models.inverse_geometry.target import SINGULAR_ERROR, Target, distinct
from mbs.models.inverse_geometry.verify import ChainIndices
from mbs.models.inverse_geometry.whole_robot import close, why_searched

NO_LOOP = "the loops stay open: the joints on the way to the frame reach the pose, the others not"


@dataclass(frozen=True, slots=True, eq=False)
class PoseProblem:
    """Inverse geometric problem: target pose of the end frame of a chain.

    Attributes:
        chain: chain of joints that is solved for.
        target: arm of the chain and its target pose.
        p: (np,) parameter values.
        options: options of the user in addition to the pose (limits, seed).
    """

    chain: FrameChain
    target: Target
    p: Array
    options: SolveOptions

    @property
    def chain_indices(self) -> ChainIndices:
        """Position of the chain in the robot."""
        return ChainIndices(self.chain.indices, self.whole)

    def whole(self, q: Array) -> Array:
        """Return a robot configuration (nq,) for chain positions q (n,), NaN if loops stay open."""
        configurations = self.closed(q)
        return configurations[0].q if configurations else np.full(self.chain.system.nq, np.nan)

    def closed(self, q: Array) -> list[Solution]:
        """Return all robot configurations for chain positions q (n,), one per loop branch."""
        near = self.options.near
        if self.chain.system.is_closed:
            return close(self.chain.system, self.chain, q[None, :], self.p, near)
        whole = near.copy()
        whole[list(self.chain.indices)] = q
        return [Solution(whole, "", 0.0)]


def answer(problem: PoseProblem, found: list[Solution], method: str) -> Solutions:
    """Return the solutions of the robot, or the reason if there is none.

    Args:
        problem: inverse geometric problem.
        found: solutions of the chain with branch names.
        method: name of the method that computed them.
    """
    if not found:
        closest = nearest(problem.target.arm, problem.target.T)
        reason = unreachable(problem.target, closest)
        return problem.options.solutions([], method, reason, _whole(problem, closest))
    whole = _completed(problem, found)
    if why_searched(problem.chain.system, problem.chain) is not None:
        method += ", loops by search"
    return problem.options.solutions(whole, method, "" if whole else NO_LOOP)


def _completed(problem: PoseProblem, found: list[Solution]) -> list[Solution]:
    """Return the solutions of the robot, one per chain solution and loop branch."""
    target = problem.target
    q = np.array([root.q for root in found])
    residual, sigma = target.residual(q), target.singular_values(q)[:, -1]
    return [
        replace(
            root,
            q=configuration.q,
            branch="; ".join(label for label in (root.branch, configuration.branch) if label),
            residual=max(float(residual[k]), configuration.residual),
            sigma_min=float(sigma[k]),
        )
        for k, root in enumerate(found)
        for configuration in problem.closed(q[k])
    ]


def with_names(
    problem: PoseProblem, found: list[Solution], branches: tuple[str, ...] = ()
) -> list[Solution]:
    """Return the roots with branch names or numbers, without repeated self-motions.

    Args:
        problem: inverse geometric problem.
        found: solutions of the chain; branches are the signs of the closed form, if any.
        branches: names of all branches of the closed form, empty without one. Other roots are
            named by shoulder, elbow and wrist.
    """
    found = _shown(problem, found)
    chain, arm = problem.chain, problem.target.arm
    key = ("anatomy", *chain.key, problem.p.tobytes())
    has: BranchLabels = chain.system.cached(key, lambda: anatomy(arm))
    meeting = np.array([root.multiplicity != 1 for root in found], dtype=bool)
    names = labels(arm, has, np.array([root.q for root in found]).reshape(-1, arm.size), meeting)
    # keep the closed-form label if it is a branch name, or if no other name exists
    names = [
        root.branch if root.branch in branches or not (name or branches) else name
        for name, root in zip(names, found, strict=True)
    ]
    seen = dict[str, int]()
    result = []
    for root, name in zip(found, names, strict=True):
        seen[name] = seen.get(name, 0) + 1
        again = f"{name} ({seen[name]})" if name and names.count(name) > 1 else name
        result.append(replace(root, branch=again or str(seen[name])))
    return result


def _shown(problem: PoseProblem, found: list[Solution]) -> list[Solution]:
    """Move each self-motion to its representative configuration and drop repeated ones."""
    shown = list[Solution]()
    for root in found:
        if root.family is None:
            shown.append(root)
            continue
        q = _representative(problem, root.family)
        if not any(_is_same(problem.target, other, root.family, q) for other in shown):
            shown.append(replace(root, q=q))
    return shown


def _is_same(target: Target, other: Solution, family: Family, q: Array) -> bool:
    """Whether `other` is a self-motion of the same joints through the same configuration q (n,)."""
    if other.family is None or other.family.moving != family.moving:
        return False
    return len(distinct(target, np.array([other.q, q]))) == 1


def _representative(problem: PoseProblem, family: Family) -> Array:
    """Return the configuration (n,) of a self-motion within limits, nearest to the seed.

    Nearness is measured at the free joint. A seed on the self-motion and within limits is returned.
    """
    indices, near = list(problem.chain.indices), problem.options.near
    outside = set(problem.options.bounds.outside(near)) & set(problem.chain.names)
    if problem.options.seeded and not outside and _is_of(problem, family, near[indices]):
        return np.asarray(near[indices])
    value = float(near[indices[problem.chain.names.index(family.free)]])
    first = family.nearest(value)
    for q in (first, *family.configurations_from(value)):
        whole = near.copy()
        whole[indices] = q
        if not set(problem.options.bounds.outside(whole)) & set(problem.chain.names):
            return np.asarray(q)
    return first


def _is_of(problem: PoseProblem, family: Family, q: Array) -> bool:
    """Whether a configuration q (n,) reaches the pose and belongs to a self-motion.

    For several freedoms only one curve is known, so the joints that do not move are compared.
    """
    target = problem.target
    if not target.residual(q) < target.tolerance:
        return False
    if family.dimension == 1:
        return bool(family.meets(q[None])[0])
    still = [k for k, name in enumerate(problem.chain.names) if name not in family.moving]
    away = target.wrapped((family.chain_samples[:1] - q) / target.unit)[0, still]
    return bool(np.max(np.abs(away), initial=0.0) < SINGULAR_ERROR)


def _whole(problem: PoseProblem, found: Nearest) -> Nearest:
    """Complete the nearest pose with the robot configuration (nq,), NaN if loops stay open."""
    whole = problem.whole(found.q)
    if not np.all(np.isfinite(whole)):
        return replace(found, q=whole)
    return replace(found, q=problem.options.bounds.wrap_to_limits(whole, problem.options.near))
