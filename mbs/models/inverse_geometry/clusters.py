"""Merging and marking of solutions that double precision cannot distinguish."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mbs.closed_forms.arm import Array
from mbs.models.inverse_geometry.gathering import along_valley
from mbs.models.inverse_geometry.root import MOST_ROOTS, ChainRoot
from mbs.models.inverse_geometry.target import (
    NEARLY_SINGULAR,
    ONE,
    SINGULAR,
    TWO,
    Target,
    middles,
)

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


def separated(target: Target, found: list[ChainRoot]) -> list[ChainRoot]:
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
    target: Target, found: list[ChainRoot], x: Array, singular: NDArray[np.bool_]
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
    target: Target, found: list[ChainRoot], x: Array, singular: NDArray[np.bool_]
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
    found: list[ChainRoot], first: NDArray[np.intp], second: NDArray[np.intp]
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


def _are_same(root: ChainRoot, other: ChainRoot) -> bool:
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


def _one(members: list[ChainRoot], residual: Array, undecided: bool, target: Target) -> ChainRoot:
    """Return the solution that represents a connected component."""
    if len(members) == 1:
        return replace(members[0], undecided=undecided)
    best = min(range(len(members)), key=lambda k: (members[k].family is None, residual[k]))
    root = members[best]
    branches = frozenset[str]().union(*(member.branches for member in members))
    label = next((member.label for member in members if member.label), "")
    if root.family is None:
        counts = [
            member.multiplicity
            for member, miss in zip(members, residual, strict=True)
            if miss <= target.decided
        ]
        # a multiple root already counts all coinciding roots
        roots = max(counts, default=1) if max(counts, default=1) > 1 else max(1, len(counts))
        most = max(1, len(branches)) if branches else MOST_ROOTS
        root = replace(root, multiplicity=min(roots, most), at_most=len(members) > 1)
    return replace(root, label=label, branches=branches, undecided=undecided)
