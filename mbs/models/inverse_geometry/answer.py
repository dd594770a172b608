"""Conversion of the roots of a serial chain to the solutions of the robot."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import compress

import numpy as np
from numpy.typing import NDArray

from mbs.closed_forms.arm import Array
from mbs.closed_forms.arm_search import Nearest, nearest
from mbs.models.inverse_geometry.branches import BranchLabels, anatomy, labels
from mbs.models.inverse_geometry.chain import FrameChain
from mbs.models.inverse_geometry.gathering import Gathered
from mbs.models.inverse_geometry.root import MOST_ROOTS, ChainRoot
from mbs.models.inverse_geometry.self_motions import Family, connected, curve, family, freedoms
from mbs.models.inverse_geometry.solutions import (
    RobotSolution,
    Solutions,
    SolveOptions,
    unreachable,
)
from mbs.models.inverse_geometry.target import (
    ONE,
    SINGULAR,
    Target,
    distinct,
    highest_between,
    multiplicity,
    reduction,
)
from mbs.models.inverse_geometry.whole_robot import ClosedConfiguration, close, why_searched

# Distinct solutions of a pose, with their multiplicities and self-motions.


_REFINEMENTS = 8
_SETTLED = 1e-7
"""Move [rad or arm lengths] below which the centre of a multiple root has converged. Rounding moves
a double root by 1e-8, the square root of 1e-16."""
_ONE_ROOT = 1e-6
"""Distance [rad or arm lengths] from a known root below which a solution is a copy of the root. At
a larger distance it is another root, however small the difference of their poses."""
_EXACT = 0.06
"""Rounding error as a fraction of the tolerance of solutions (6e-14 of the length). A singular root
of multiplicity 1 with a larger residual is not certain to be isolated."""


@dataclass(frozen=True, slots=True, eq=False)
class ChainIndices:
    """Position of a chain in its system.

    Attributes:
        indices: indices of the joints of the chain in q.
        whole: function from a configuration of the chain (n,) to the configuration of the system
            (nq,); NaN if the loops cannot be closed.
    """

    indices: tuple[int, ...]
    whole: Callable[[Array], Array]


Examined = dict[bytes, tuple[ChainRoot, bool]]
"""Cache: bytes of a singular configuration -> (examined root, whether the result is certain)."""


def roots(
    target: Target, gathered: Gathered, chain: ChainIndices, examined: Examined | None = None
) -> list[ChainRoot]:
    """Merge copies of solutions and determine multiplicities and self-motions.

    Args:
        target: target pose of the arm.
        gathered: solutions, possibly with copies. Their order is kept.
        chain: position of the arm's joints in the system.
        examined: cache of examined singular solutions, extended in place.

    Returns:
        Distinct solutions. A self-motion is represented by one of its configurations.
    """
    known = {} if examined is None else examined
    found = _merge(target, gathered)
    singular = [int(k) for k in np.flatnonzero(_singular(target, found))]
    unsettled = list[int]()
    dropped = set[int]()
    for k in singular:
        if k in dropped:
            continue
        key = found[k].q.tobytes()
        if key not in known:
            known[key] = _examine(target, found[k], chain)
        root, settled = known[key]
        found[k] = replace(
            root,
            label=found[k].label,
            branches=found[k].branches,
            undecided=found[k].undecided,
        )
        if not settled:
            unsettled.append(k)
        dropped |= _on(target, found, k, [m for m in singular if m > k])
    alone = [k for k in singular if k not in unsettled and found[k].family is None]
    for k in unsettled:
        if k in dropped:
            continue
        nearly = _nearly_moving(target, found[k], chain)
        if nearly is None:
            continue
        found[k] = nearly
        if _on(target, found, k, [m for m in alone if m not in dropped]):
            dropped.add(k)
        dropped |= _on(target, found, k, [m for m in unsettled if m != k])
    left = [root for k, root in enumerate(found) if k not in dropped]
    return _merged_again(target, _without_points(target, left))


def _without_points(target: Target, found: list[ChainRoot]) -> list[ChainRoot]:
    """Drop the isolated solutions that lie on a self-motion in the list.

    If a self-motion holds the pose only within the tolerance, rounding decides whether one of its
    configurations is first classified as isolated. The test here does not depend on that.
    """
    alone = [m for m, root in enumerate(found) if root.family is None]
    points = set[int]()
    for k, root in enumerate(found):
        if root.family is not None:
            points |= _on(target, found, k, [m for m in alone if m not in points])
    return [root for m, root in enumerate(found) if m not in points]


def new_among(target: Target, found: list[ChainRoot], more: Gathered) -> Gathered:
    """Return the solutions that are no copies of known roots and on no known self-motion.

    Args:
        target: target pose of the arm.
        found: known roots.
        more: further solutions.
    """
    known = np.zeros(len(more.q), dtype=bool)
    for root in found:
        if root.family is None:
            away = target.wrapped((more.q - root.q) / target.unit)
            known |= np.max(np.abs(away), axis=1, initial=0.0) < _ONE_ROOT
        elif root.family.dimension == 1:
            asked = np.flatnonzero(~known)
            known[asked] = root.family.meets(more.q[asked])
    q, labels = more.q[~known], tuple(compress(more.labels, ~known))
    return Gathered(q, labels, more.method, more.doubtful)


def _merge(target: Target, gathered: Gathered) -> list[ChainRoot]:
    residual = target.residual(gathered.q) if len(gathered.q) else np.zeros(0)
    found = []
    for group in distinct(target, gathered.q, gathered.labels):
        # prefer a branch of a closed form, then the smaller residual
        best = min(group, key=lambda k: (not gathered.labels[k], float(residual[k])))
        label = next((gathered.labels[k] for k in group if gathered.labels[k]), "")
        branches = frozenset(gathered.labels[k] for k in group) - {""}
        own = gathered.q[[best, *(k for k in group if residual[k] < target.decided and k != best)]]
        undecided = highest_between(target, own) > ONE * max(1.0, target.arm.length)
        root = ChainRoot(gathered.q[best], label, 1, branches=branches, undecided=undecided)
        found.append(root)
    return found


def _singular(target: Target, found: list[ChainRoot]) -> NDArray[np.bool_]:
    """Return (m,) whether the Jacobian is rank-deficient at each of the m roots."""
    q = np.array([root.q for root in found]).reshape(len(found), target.arm.size)
    return np.asarray(target.singular_values(q)[:, -1] < SINGULAR)


def _examine(target: Target, root: ChainRoot, chain: ChainIndices) -> tuple[ChainRoot, bool]:
    """Return a singular root with its multiplicity or self-motion, and whether it is certain."""
    dimension, direction = freedoms(reduction(target, root.q))
    found = curve(target, root.q, direction, dimension) if dimension else None
    if found is None:
        return _isolate(target, root)
    of = family(target, found, dimension, chain.indices, chain.whole)
    return replace(root, multiplicity=0, family=of), True


def _nearly_moving(target: Target, root: ChainRoot, chain: ChainIndices) -> ChainRoot | None:
    """Return the root with a self-motion that holds the pose within the tolerance, or None.

    Residuals on such a self-motion are of the size of rounding errors.
    """
    dimension, direction = freedoms(reduction(target, root.q))
    found = curve(target, root.q, direction, dimension, 1.0) if dimension else None
    if found is None:
        return None
    of = family(target, found, dimension, chain.indices, chain.whole)
    return replace(root, multiplicity=0, family=of)


def _isolate(target: Target, root: ChainRoot) -> tuple[ChainRoot, bool]:
    """Return the root at the centre of its cluster with its multiplicity, and whether certain."""
    q, count = root.q, 1
    for _ in range(_REFINEMENTS):
        count, better, exact = multiplicity(reduction(target, q))
        if not exact:
            return replace(root, multiplicity=count, at_most=True), False
        moved = float(np.max(np.abs(target.wrapped((better - q) / target.unit))))
        q = better
        if moved < _SETTLED:
            settled = count > 1 or float(target.residual(q)) < _EXACT * target.tolerance
            return replace(root, q=q, multiplicity=count), settled
    return replace(root, q=q, multiplicity=count), False


def _on(target: Target, found: list[ChainRoot], k: int, others: list[int]) -> set[int]:
    """Return the indices in `others` of the roots that lie on the self-motion of root k."""
    of = found[k].family
    if of is None or not others:
        return set()
    q = np.array([found[m].q for m in others])
    meets = connected(target, q, found[k].q) if of.dimension > 1 else of.meets(q)
    return {m for m, met in zip(others, meets, strict=True) if met}


def _merged_again(target: Target, found: list[ChainRoot]) -> list[ChainRoot]:
    """Merge the copies of a multiple root that were moved to its centre.

    The multiplicity is at most the number of branches of a closed form that meet in the root.
    """
    q = np.array([root.q for root in found]).reshape(len(found), target.arm.size)
    closed_form = any(root.branches for root in found)
    result = []
    for group in distinct(target, q, [root.label for root in found]):
        root, met = found[group[0]], frozenset[str]().union(*(found[k].branches for k in group))
        if met or root.at_most:
            most = max(1, len(met)) if closed_form else MOST_ROOTS
            root = replace(root, multiplicity=min(root.multiplicity, most))
        root = replace(root, undecided=any(found[k].undecided for k in group))
        result.append(root)
    return result


# From chain solutions to robot solutions: branch names, loop closure, error reasons.


NO_LOOP = "the loops stay open: the joints on the way to the frame reach the pose, the others not"


@dataclass(frozen=True, slots=True, eq=False)
class PoseProblem:
    """Inverse geometric problem: target pose of the end frame of a chain.

    Attributes:
        chain: chain of joints that is solved for.
        target: arm of the chain and its target pose.
        p: (np,) parameter values.
        wishes: options of the user in addition to the pose (limits, seed).
    """

    chain: FrameChain
    target: Target
    p: Array
    wishes: SolveOptions

    @property
    def chain_indices(self) -> ChainIndices:
        """Position of the chain in the robot."""
        return ChainIndices(self.chain.indices, self.whole)

    def whole(self, q: Array) -> Array:
        """Return a robot configuration (nq,) for chain positions q (n,), NaN if loops stay open."""
        configurations = self.closed(q)
        return configurations[0].q if configurations else np.full(self.chain.system.nq, np.nan)

    def closed(self, q: Array) -> list[ClosedConfiguration]:
        """Return all robot configurations for chain positions q (n,), one per loop branch."""
        near = self.wishes.near
        if self.chain.system.is_closed:
            return close(self.chain.system, self.chain, q[None, :], self.p, near)
        whole = near.copy()
        whole[list(self.chain.indices)] = q
        return [ClosedConfiguration(whole, "", 0.0)]


def answer(question: PoseProblem, found: list[ChainRoot], method: str) -> Solutions:
    """Return the solutions of the robot, or the reason if there is none.

    Args:
        question: inverse geometric problem.
        found: solutions of the chain with branch names.
        method: name of the method that computed them.
    """
    if not found:
        closest = nearest(question.target.arm, question.target.T)
        reason = unreachable(question.target, closest)
        return question.wishes.solutions([], method, reason, _whole(question, closest))
    drafts = _drafts(question, found)
    if why_searched(question.chain.system, question.chain) is not None:
        method += ", loops by search"
    return question.wishes.solutions(drafts, method, "" if drafts else NO_LOOP)


def _drafts(question: PoseProblem, found: list[ChainRoot]) -> list[RobotSolution]:
    """Return the solutions of the robot, one per chain solution and loop branch."""
    target = question.target
    q = np.array([root.q for root in found])
    residual, sigma = target.residual(q), target.singular_values(q)[:, -1]
    return [
        RobotSolution(
            configuration.q,
            "; ".join(label for label in (root.label, configuration.label) if label),
            max(float(residual[k]), configuration.residual),
            float(sigma[k]),
            root.multiplicity,
            root.family,
            root.undecided,
        )
        for k, root in enumerate(found)
        for configuration in question.closed(q[k])
    ]


def named(
    question: PoseProblem, found: list[ChainRoot], branches: tuple[str, ...] = ()
) -> list[ChainRoot]:
    """Return the roots with branch names or numbers, without repeated self-motions.

    Args:
        question: inverse geometric problem.
        found: solutions of the chain; labels contain the signs of the closed form, if any.
        branches: names of all branches of the closed form, empty without one. Other roots are
            named by shoulder, elbow and wrist.
    """
    found = _shown(question, found)
    chain, arm = question.chain, question.target.arm
    key = ("anatomy", *chain.key, question.p.tobytes())
    has: BranchLabels = chain.system.cached(key, lambda: anatomy(arm))
    meeting = np.array([root.multiplicity != 1 for root in found], dtype=bool)
    names = labels(arm, has, np.array([root.q for root in found]).reshape(-1, arm.size), meeting)
    # keep the closed-form label if it is a branch name, or if no other name exists
    names = [
        root.label if root.label in branches or not (name or branches) else name
        for name, root in zip(names, found, strict=True)
    ]
    seen = dict[str, int]()
    result = []
    for root, name in zip(found, names, strict=True):
        seen[name] = seen.get(name, 0) + 1
        again = f"{name} ({seen[name]})" if name and names.count(name) > 1 else name
        result.append(replace(root, label=again or str(seen[name])))
    return result


def _shown(question: PoseProblem, found: list[ChainRoot]) -> list[ChainRoot]:
    """Move each self-motion to its representative configuration and drop repeated ones."""
    shown = list[ChainRoot]()
    for root in found:
        if root.family is None:
            shown.append(root)
            continue
        q = _representative(question, root.family)
        if not any(_is_same(question.target, other, root.family, q) for other in shown):
            shown.append(replace(root, q=q))
    return shown


def _is_same(target: Target, other: ChainRoot, family: Family, q: Array) -> bool:
    """Whether `other` is a self-motion of the same joints through the same configuration q (n,)."""
    if other.family is None or other.family.moving != family.moving:
        return False
    return len(distinct(target, np.array([other.q, q]))) == 1


_SEEDED = 1e-6
"""Largest difference [rad or arm lengths] of joints that do not move in a self-motion: the accuracy
of singular solutions."""


def _representative(question: PoseProblem, family: Family) -> Array:
    """Return the configuration (n,) of a self-motion within limits, nearest to the seed.

    Nearness is measured at the free joint. A seed on the self-motion and within limits is returned.
    """
    indices, near = list(question.chain.indices), question.wishes.near
    outside = set(question.wishes.bounds.outside(near)) & set(question.chain.names)
    if question.wishes.seeded and not outside and _is_of(question, family, near[indices]):
        return np.asarray(near[indices])
    value = float(near[indices[question.chain.names.index(family.free)]])
    first = family.nearest(value)
    for q in (first, *family.configurations_from(value)):
        whole = near.copy()
        whole[indices] = q
        if not set(question.wishes.bounds.outside(whole)) & set(question.chain.names):
            return np.asarray(q)
    return first


def _is_of(question: PoseProblem, family: Family, q: Array) -> bool:
    """Whether a configuration q (n,) reaches the pose and belongs to a self-motion.

    For several freedoms only one curve is known, so the joints that do not move are compared.
    """
    target = question.target
    if not target.residual(q) < target.tolerance:
        return False
    if family.dimension == 1:
        return bool(family.meets(q[None])[0])
    still = [k for k, name in enumerate(question.chain.names) if name not in family.moving]
    away = target.wrapped((family.chain_samples[:1] - q) / target.unit)[0, still]
    return bool(np.max(np.abs(away), initial=0.0) < _SEEDED)


def _whole(question: PoseProblem, found: Nearest) -> Nearest:
    """Complete the nearest pose with the robot configuration (nq,), NaN if loops stay open."""
    whole = question.whole(found.q)
    if not np.all(np.isfinite(whole)):
        return replace(found, q=whole)
    return replace(found, q=question.wishes.bounds.wrap_to_limits(whole, question.wishes.near))
