"""The distinct solutions of a pose, how often each counts, and the self-motions among them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mbs.models.inverse_geometry.answers.curves import curve, freedoms
from mbs.models.inverse_geometry.answers.distinct import distinct
from mbs.models.inverse_geometry.answers.families import Family, family
from mbs.models.inverse_geometry.answers.gathering import Gathered
from mbs.models.inverse_geometry.answers.multiplicity import SINGULAR, multiplicity, reduction
from mbs.models.inverse_geometry.answers.surfaces import connected
from mbs.models.inverse_geometry.answers.target import Target
from mbs.models.inverse_geometry.arm import Array

_REFINEMENTS, _SETTLED, _EXACT = 8, 1e-7, 0.02


@dataclass(frozen=True, slots=True, eq=False)
class ChainRoot:
    """A solution of the chain.

    Attributes:
        q: (n,) posture [rad or m].
        label: of the branch it comes from, "" where it comes from none.
        multiplicity: how many roots meet in it, 0 on a self-motion.
        family: the self-motion that it stands for.
    """

    q: Array
    label: str
    multiplicity: int
    family: Family | None = None


@dataclass(frozen=True, slots=True, eq=False)
class ChainPlace:
    """Where a chain stands in its system.

    Attributes:
        places: numbers of its joints in q.
        whole: the posture (nq,) of the system for one of the chain, (n,); NaN where there is none.
    """

    places: tuple[int, ...]
    whole: Callable[[Array], Array]


def roots(target: Target, gathered: Gathered, place: ChainPlace) -> list[ChainRoot]:
    """The distinct solutions, in the order in which they were gathered.

    Args:
        target: the pose that is wanted.
        gathered: solutions, some of them more than once.
        place: of the chain in the system.
    """
    found = _merged(target, gathered)
    singular = [int(k) for k in np.flatnonzero(_singular(target, found))]
    unsettled = list[int]()
    dropped = set[int]()
    for k in singular:
        if k in dropped:
            continue
        found[k], settled = _examined(target, found[k], place)
        if not settled:
            unsettled.append(k)
        dropped |= _on(target, found, k, [m for m in singular if m > k])
    alone = [k for k in singular if k not in unsettled and found[k].family is None]
    for k in unsettled:
        if k in dropped:
            continue
        nearly = _nearly_moving(target, found[k], place)
        if nearly is None:
            continue
        found[k] = nearly
        if _on(target, found, k, [m for m in alone if m not in dropped]):
            dropped.add(k)
        dropped |= _on(target, found, k, [m for m in unsettled if m != k])
    return _merged_again(target, [root for k, root in enumerate(found) if k not in dropped])


def _merged(target: Target, gathered: Gathered) -> list[ChainRoot]:
    residual = target.residual(gathered.q) if len(gathered.q) else np.zeros(0)
    found = []
    for group in distinct(target, gathered.q):
        best = min(group, key=lambda k: float(residual[k]))
        label = next((gathered.labels[k] for k in group if gathered.labels[k]), "")
        found.append(ChainRoot(gathered.q[best], label, 1))
    return found


def _singular(target: Target, found: list[ChainRoot]) -> NDArray[np.bool_]:
    """Whether the Jacobian of each loses rank."""
    q = np.array([root.q for root in found]).reshape(len(found), target.arm.size)
    return np.asarray(target.singular_values(q)[:, -1] < SINGULAR)


def _examined(target: Target, root: ChainRoot, place: ChainPlace) -> tuple[ChainRoot, bool]:
    """With its multiplicity or its self-motion, and whether that is certain."""
    dimension, direction = freedoms(reduction(target, root.q))
    found = curve(target, root.q, direction, dimension) if dimension else None
    if found is None:
        return _isolated(target, root)
    of = family(target, found, dimension, place.places, place.whole)
    return replace(root, multiplicity=0, family=of), True


def _nearly_moving(target: Target, root: ChainRoot, place: ChainPlace) -> ChainRoot | None:
    """With the self-motion along which the pose is held within the tolerance of solutions.

    It is one of rounding: no posture on it can be told to be better than the others.
    """
    dimension, direction = freedoms(reduction(target, root.q))
    found = curve(target, root.q, direction, dimension, 1.0) if dimension else None
    if found is None:
        return None
    of = family(target, found, dimension, place.places, place.whole)
    return replace(root, multiplicity=0, family=of)


def _isolated(target: Target, root: ChainRoot) -> tuple[ChainRoot, bool]:
    """With its multiplicity, moved to where its roots meet, and whether it stays there."""
    q, count = root.q, 1
    for _ in range(_REFINEMENTS):
        count, better = multiplicity(reduction(target, q))
        moved = float(np.max(np.abs(target.wrapped((better - q) / target.unit))))
        q = better
        if moved < _SETTLED:
            exact = count > 1 or float(target.residual(q)) < _EXACT * target.tolerance
            return replace(root, q=q, multiplicity=count), exact
    return replace(root, q=q, multiplicity=count), False


def _on(target: Target, found: list[ChainRoot], k: int, others: list[int]) -> set[int]:
    """Which of the others are postures of the self-motion of root k, if it has one."""
    of = found[k].family
    if of is None or not others:
        return set()
    q = np.array([found[m].q for m in others])
    meets = connected(target, q, found[k].q) if of.dimension > 1 else of.meets(q)
    return {m for m, met in zip(others, meets, strict=True) if met}


def _merged_again(target: Target, found: list[ChainRoot]) -> list[ChainRoot]:
    """Without the copies of a multiple root that were moved to its middle."""
    q = np.array([root.q for root in found]).reshape(len(found), target.arm.size)
    return [found[group[0]] for group in distinct(target, q)]
