"""Verification of a draft: distinct solutions, their multiplicities and self-motions.

Copies are merged, solutions that double precision cannot distinguish are merged or marked, and
points of a self-motion are represented by one configuration.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import compress

import numpy as np
from numpy.typing import NDArray

from mbs.closed_forms.arm import Array
from mbs.models.inverse_geometry.draft import along_valley
from mbs.models.inverse_geometry.self_motions import connected, curve, family, freedoms
from mbs.models.inverse_geometry.solutions import PoseDraft, Solution
from mbs.models.inverse_geometry.target import (
    NEARLY_SINGULAR,
    ONE,
    SINGULAR,
    SINGULAR_ERROR,
    TWO,
    Target,
    distinct,
    highest_between,
    middles,
    multiplicity,
    reduction,
)

# Distinct solutions of a pose, with their multiplicities and self-motions.


MOST_ROOTS = 16
"""Largest number of isolated solutions of a six-joint chain for one pose (16); shorter chains have
fewer."""
_REFINEMENTS = 8  # maximum number of moves to the centre of a multiple root, until `_SETTLED`
_SETTLED = 1e-7
"""Move [rad or arm lengths] below which the centre of a multiple root has converged. Rounding moves
a double root by 1e-8, the square root of 1e-16."""
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


Examined = dict[bytes, tuple[Solution, bool]]
"""Cache: bytes of a singular configuration -> (examined root, whether the result is certain)."""


def verify(
    target: Target, draft: PoseDraft, chain: ChainIndices, examined: Examined | None = None
) -> list[Solution]:
    """Merge copies of solutions and determine multiplicities and self-motions.

    Args:
        target: target pose of the arm.
        draft: solutions, possibly with copies. Their order is kept.
        chain: position of the arm's joints in the system.
        examined: cache of examined singular solutions, extended in place.

    Returns:
        Distinct solutions. A self-motion is represented by one of its configurations.
    """
    known = {} if examined is None else examined
    found = _merge(target, draft)
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
            branch=found[k].branch,
            _meeting=found[k]._meeting,
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


def _without_points(target: Target, found: list[Solution]) -> list[Solution]:
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


def new_among(target: Target, found: list[Solution], more: PoseDraft) -> PoseDraft:
    """Return the solutions that are no copies of known ones and on no known self-motion.

    Args:
        target: target pose of the arm.
        found: known solutions.
        more: further solutions.
    """
    known = np.zeros(len(more.q), dtype=bool)
    for root in found:
        if root.family is None:
            away = target.wrapped((more.q - root.q) / target.unit)
            # farther away it is another solution, however small the difference of the poses
            known |= np.max(np.abs(away), axis=1, initial=0.0) < SINGULAR_ERROR
        elif root.family.dimension == 1:
            asked = np.flatnonzero(~known)
            known[asked] = root.family.meets(more.q[asked])
    q, labels = more.q[~known], tuple(compress(more.labels, ~known))
    return PoseDraft(q, more.residual[~known], labels, None, more.certain, more.method)


def _merge(target: Target, draft: PoseDraft) -> list[Solution]:
    residual, labels = draft.residual, draft.labels
    found = []
    for group in distinct(target, draft.q, labels):
        # prefer a branch of a closed form, then the smaller residual
        best = min(group, key=lambda k: (not labels[k], float(residual[k])))
        label = next((labels[k] for k in group if labels[k]), "")
        branches = frozenset(labels[k] for k in group) - {""}
        own = draft.q[[best, *(k for k in group if residual[k] < target.decided and k != best)]]
        undecided = highest_between(target, own) > ONE * max(1.0, target.arm.length)
        found.append(Solution(draft.q[best], label, undecided=undecided, _meeting=branches))
    return found


def _singular(target: Target, found: list[Solution]) -> NDArray[np.bool_]:
    """Return (m,) whether the Jacobian is rank-deficient at each of the m roots."""
    q = np.array([root.q for root in found]).reshape(len(found), target.arm.size)
    return np.asarray(target.singular_values(q)[:, -1] < SINGULAR)


def _examine(target: Target, root: Solution, chain: ChainIndices) -> tuple[Solution, bool]:
    """Return a singular root with its multiplicity or self-motion, and whether it is certain."""
    dimension, direction = freedoms(reduction(target, root.q))
    found = curve(target, root.q, direction, dimension) if dimension else None
    if found is None:
        return _isolate(target, root)
    of = family(target, found, dimension, chain.indices, chain.whole)
    return replace(root, multiplicity=0, family=of), True


def _nearly_moving(target: Target, root: Solution, chain: ChainIndices) -> Solution | None:
    """Return the root with a self-motion that holds the pose within the tolerance, or None.

    Residuals on such a self-motion are of the size of rounding errors.
    """
    dimension, direction = freedoms(reduction(target, root.q))
    found = curve(target, root.q, direction, dimension, 1.0) if dimension else None
    if found is None:
        return None
    of = family(target, found, dimension, chain.indices, chain.whole)
    return replace(root, multiplicity=0, family=of)


def _isolate(target: Target, root: Solution) -> tuple[Solution, bool]:
    """Return the root at the centre of its cluster with its multiplicity, and whether certain."""
    q, count = root.q, 1
    for _ in range(_REFINEMENTS):
        count, better, exact = multiplicity(reduction(target, q))
        if not exact:
            return replace(root, multiplicity=count, _at_most=True), False
        moved = float(np.max(np.abs(target.wrapped((better - q) / target.unit))))
        q = better
        if moved < _SETTLED:
            settled = count > 1 or float(target.residual(q)) < _EXACT * target.tolerance
            return replace(root, q=q, multiplicity=count), settled
    return replace(root, q=q, multiplicity=count), False


def _on(target: Target, found: list[Solution], k: int, others: list[int]) -> set[int]:
    """Return the indices in `others` of the roots that lie on the self-motion of root k."""
    of = found[k].family
    if of is None or not others:
        return set()
    q = np.array([found[m].q for m in others])
    meets = connected(target, q, found[k].q) if of.dimension > 1 else of.meets(q)
    return {m for m, met in zip(others, meets, strict=True) if met}


def _merged_again(target: Target, found: list[Solution]) -> list[Solution]:
    """Merge the copies of a multiple root that were moved to its centre.

    The multiplicity is at most the number of branches of a closed form that meet in the root.
    """
    q = np.array([root.q for root in found]).reshape(len(found), target.arm.size)
    closed_form = any(root._meeting for root in found)
    result = []
    for group in distinct(target, q, [root.branch for root in found]):
        root, met = found[group[0]], frozenset[str]().union(*(found[k]._meeting for k in group))
        if met or root._at_most:
            most = max(1, len(met)) if closed_form else MOST_ROOTS
            root = replace(root, multiplicity=min(root.multiplicity, most))
        root = replace(root, undecided=any(found[k].undecided for k in group))
        result.append(root)
    return result


# Merging and marking of solutions that double precision cannot distinguish.


_FAR = 0.7
"""Largest difference of a joint [rad or arm lengths] of two solutions whose path is examined: a
valley is nearly straight within 40 degrees."""
_HALVINGS = 3  # bisections of a path: seven points give its highest residual to some percent
_SLOPE = 1.05
"""Largest residual on a path between two joined solutions, relative to the worse of both."""
_FEW = 4  # minima of a singular value along a self-motion that are examined
_SECTIONS, _GOLDEN = 24, 0.618
"""Iterations and ratio of the golden-section search: it reduces a step along a self-motion by a
factor of 1e5."""
_KNOWN = 1e-2
"""Largest error [rad or arm lengths] of a decided simple root, estimated as `ONE` over the smallest
singular value."""
_TWICE = 1e-5
"""Second smallest singular value below which two singular configurations are near: ten times the
value at which rounding of the pose moves solutions along both directions."""


def merge_connected(target: Target, found: list[Solution]) -> list[Solution]:
    """Merge solutions that are connected by nearly solved configurations, and mark undecided ones.

    Two solutions are equal if a path connects them on which the residual stays below `DECIDED` or
    below the residual of the worse of both. A perturbation of the pose changes this largest
    residual by at most its own size. A solution is marked as undecided

    - if the highest residual on the path to another solution is between `ONE` and `TWO`,
    - if rounding of the pose moves it by more than a hundredth of a radian,
    - if its own residual is above `ONE`, so that no configuration may have exactly this pose,
    - if two singular configurations are near it.

    Args:
        target: target pose of the arm.
        found: solutions and self-motions.
    """
    if not found:
        return found
    q = np.array([root.q for root in found])
    x, scale = q / target.unit, max(1.0, target.arm.length)
    s, own = target.singular_values(q), target.residual(q)
    for k, root in enumerate(found):
        if root.family is not None:
            own[k] = np.max(target.residual(root.family.chain_samples), initial=own[k])
            s[k, -2:] = np.minimum(s[k, -2:], _least_second(target, root.family.chain_samples))
    singular = s[:, -1] < NEARLY_SINGULAR
    undecided = (own > ONE * scale) | (singular & (_second(s) < _TWICE))
    undecided |= [root.undecided for root in found]
    simple = np.array([root.family is None and root.multiplicity == 1 for root in found])
    undecided |= simple & (s[:, -1] * _KNOWN < ONE)
    undecided |= _nearly_moves(target, found, x, s[:, -1] < SINGULAR)
    first, second, begin, end = _pairs(target, found, x, singular)
    height = heights(target, begin, end, TWO * scale, own[first], own[second])
    open_ = (height > ONE * scale) & (height < TWO * scale)
    undecided[first[open_]] = undecided[second[open_]] = True
    limit = np.maximum(target.decided, _SLOPE * np.maximum(own[first], own[second]))
    group = _groups(found, first[height < limit], second[height < limit])
    return [
        _one([found[k] for k in members], own[members], bool(np.any(undecided[members])), target)
        for members in (np.flatnonzero(group == g) for g in np.unique(group))
    ]


def _nearly_moves(
    target: Target, found: list[Solution], x: Array, singular: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Return (m,) whether a singular solution has a near self-motion.

    No self-motion was found at such a solution, but the residual stays below `TWO` up to a distance
    of one radian.
    """
    alone = np.array([root.family is None for root in found], dtype=bool)
    nearly: NDArray[np.bool_] = np.logical_and(singular, alone)
    rows = np.flatnonzero(nearly)
    if not len(rows) or x.shape[1] != 6:
        return np.zeros_like(nearly)
    nearly[rows] = along_valley(target, x[rows]) < TWO * max(1.0, target.arm.length)
    return nearly


def _least_second(target: Target, q: Array) -> float:
    """Return the minimum of the second smallest singular value along a self-motion.

    The minimum is zero if another motion crosses the self-motion. q (k, n) are its samples.
    """
    if q.shape[1] < 2 or len(q) < 3:
        return np.inf
    second = target.singular_values(q)[:, -2]
    inner = np.arange(1, len(q) - 1)
    lowest = inner[(second[1:-1] <= second[:-2]) & (second[1:-1] <= second[2:])]
    lowest = lowest[np.argsort(second[lowest], kind="stable")][:_FEW]
    low, high = q[lowest - 1], q[lowest + 1]
    for _ in range(_SECTIONS):
        a, b = high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)
        left = (target.singular_values(a)[:, -2] < target.singular_values(b)[:, -2])[:, None]
        low, high = np.where(left, low, a), np.where(left, b, high)
    middle = target.singular_values(0.5 * (low + high))[:, -2]
    return float(min(np.min(second), np.min(middle, initial=np.inf)))


def _second(s: Array) -> Array:
    """Return the second smallest singular values, infinite for an arm of one joint."""
    return s[:, -2] if s.shape[1] > 1 else np.full(len(s), np.inf)


def _pairs(
    target: Target, found: list[Solution], x: Array, singular: NDArray[np.bool_]
) -> tuple[NDArray[np.intp], NDArray[np.intp], Array, Array]:
    """Return pairs of solutions that a valley may connect: indices, and the ends of the path.

    A path to a self-motion ends at its nearest sample.
    """
    samples = [
        x[k][None] if root.family is None else root.family.chain_samples / target.unit
        for k, root in enumerate(found)
    ]
    pairs = list[tuple[int, int]]()
    ends = list[tuple[Array, Array]]()
    for i in np.flatnonzero(singular):
        for j in np.flatnonzero(singular[:i]):
            away = target.wrapped(samples[i][:, None] - samples[j])
            apart = np.max(np.abs(away), axis=2)
            a, b = np.unravel_index(np.argmin(apart), apart.shape)
            if apart[a, b] < _FAR:
                pairs.append((int(j), int(i)))
                ends.append((samples[j][b], samples[i][a]))
    first, second = np.array(pairs, dtype=np.intp).reshape(-1, 2).T
    points = np.array(ends).reshape(-1, 2, x.shape[1])
    return first, second, points[:, 0], points[:, 1]


def heights(
    target: Target, x: Array, other: Array, most: float, own: Array, others: Array
) -> Array:
    """Return the largest residuals (m,) on paths between configurations x and `other` (m, n).

    The points of a path are found by bisection: a point half way is moved, normal to the line
    between its neighbours, to the least residual. Paths above the limit are not refined.

    Args:
        target: target pose of the arm.
        x: (m, n) scaled configurations, see `Target`.
        other: (m, n) scaled configurations at the other ends.
        most: residual above which two configurations are not connected.
        own: (m,) residuals of x.
        others: (m,) residuals of `other`.
    """
    highest = np.zeros(len(x))
    if not len(x):
        return highest
    points = np.stack([x, x + target.wrapped(other - x)], axis=1)
    limit = np.maximum(most, _SLOPE * np.maximum(own, others))
    for _ in range(_HALVINGS):
        rows = np.flatnonzero(highest < limit)
        if not len(rows):
            break
        a, b = points[rows, :-1], points[rows, 1:]
        middle, residual = middles(target, a.reshape(-1, a.shape[-1]), b.reshape(-1, a.shape[-1]))
        highest[rows] = np.maximum(highest[rows], np.max(residual.reshape(a.shape[:2]), axis=1))
        finer = np.empty((len(x), 2 * points.shape[1] - 1, points.shape[2]))
        finer[:, ::2] = points
        finer[:, 1::2] = 0.5 * (points[:, :-1] + points[:, 1:])
        finer[rows, 1::2] = middle.reshape(a.shape)
        points = finer
    return highest


def _groups(
    found: list[Solution], first: NDArray[np.intp], second: NDArray[np.intp]
) -> NDArray[np.intp]:
    """Return the group index of each solution, from connected pairs (first, second).

    Self-motions that cross each other stay separate. An isolated solution that is connected to
    several self-motions belongs to the first.
    """
    families = [root.family for root in found]
    moving = np.array([family is not None for family in families], dtype=bool)
    both = moving[first] & moving[second]
    same = [_are_same(found[i], found[j]) for i, j in zip(first[both], second[both], strict=True)]
    motion = _components(len(found), first[both][same], second[both][same])
    group = _components(len(found), first, second)
    for g in np.unique(group):
        members = np.flatnonzero((group == g) & moving)
        for other in np.unique(motion[members])[1:]:
            apart = members[motion[members] == other]
            group[apart] = apart[0]
    return group


def _are_same(root: Solution, other: Solution) -> bool:
    """Whether two self-motions are equal: one contains the configuration of the other."""
    assert root.family is not None
    assert other.family is not None
    return bool(root.family.meets(other.q[None])[0] or other.family.meets(root.q[None])[0])


def _components(count: int, first: NDArray[np.intp], second: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return (count,) the lowest index of the connected component of each point."""
    group = np.arange(count)
    for i, j in zip(first, second, strict=True):
        a, b = sorted((group[i], group[j]))
        group[group == b] = a
    return group


def _one(members: list[Solution], residual: Array, undecided: bool, target: Target) -> Solution:
    """Return the solution that represents a connected component."""
    if len(members) == 1:
        return replace(members[0], undecided=undecided)
    best = min(range(len(members)), key=lambda k: (members[k].family is None, residual[k]))
    root = members[best]
    branches = frozenset[str]().union(*(member._meeting for member in members))
    label = next((member.branch for member in members if member.branch), "")
    if root.family is None:
        counts = [
            member.multiplicity
            for member, miss in zip(members, residual, strict=True)
            if miss <= target.decided
        ]
        # a multiple root already counts all coinciding roots
        roots = max(counts, default=1) if max(counts, default=1) > 1 else max(1, len(counts))
        most = max(1, len(branches)) if branches else MOST_ROOTS
        root = replace(root, multiplicity=min(roots, most))
    return replace(root, branch=label, _meeting=branches, undecided=undecided)
