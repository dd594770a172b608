"""Which of many solutions for one pose are the same posture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mbs.models.inverse_geometry.arm import Arm, Array
from mbs.models.inverse_geometry.numeric import core

_SAME, _CLOSE, _BETWEEN = 1e-6, 1e-2, 1e-13  # see `merged`
_REACHED = 1e-12


@dataclass(frozen=True, slots=True, eq=False)
class Merged:
    """Distinct solutions.

    Attributes:
        q: (m, n) postures [rad or m].
        hits: (m,) how many of the given postures are each of them.
    """

    q: Array
    hits: NDArray[np.int64]


def merged(arm: Arm, T: Array, q: Array) -> Merged:
    """The distinct ones of several solutions for one pose, in their order.

    Two are one when they are closer than 1e-6, or closer than 1e-2 with a solution half way, to
    1e-13 or as good as they are, as between scattered copies of a multiple root. Of two that are
    one the better stays. Angles that differ by whole turns are equal, slides are measured in arm
    lengths.

    Args:
        arm: whose postures.
        T: (4, 4) wanted pose.
        q: (m, n) solutions [rad or m].
    """
    library = core.core_of(arm)
    if library is not None:
        return Merged(*core.merged_by(library, arm, T, q))
    return merged_with_numpy(arm, T, q)


def merged_with_numpy(arm: Arm, T: Array, q: Array) -> Merged:
    """`merged` where there is no C compiler."""
    residual = relative_residual(arm, T, q)
    places, hits = list[int](), list[int]()
    for number, own in enumerate(q):
        twin = _twin(arm, T, q[places], own)
        if twin is None:
            places.append(number)
            hits.append(1)
            continue
        hits[twin] += 1
        if residual[number] < residual[places[twin]]:
            places[twin] = number
    return Merged(np.array(q[places], dtype=float), np.array(hits, dtype=np.int64))


def reached(arm: Arm, T: Array, q: Array) -> NDArray[np.bool_]:
    """(...,) whether postures have the pose but for rounding: a relative residual below 1e-12."""
    return relative_residual(arm, T, q) < _REACHED


def relative_residual(arm: Arm, T: Array, q: Array) -> Array:
    """(...,) max |arm.pose(q) - T| with lengths in arm lengths."""
    miss = np.abs(arm.pose(q) - T)
    miss[..., :3, 3] /= arm.length
    worst: Array = np.max(miss, axis=(-2, -1))
    return worst


def wrapped(arm: Arm, q: Array) -> Array:
    """Postures with all angles in (-pi, pi]."""
    turns = np.pi - np.mod(np.pi - q, 2 * np.pi)
    within = (q > -np.pi) & (q <= np.pi)
    return np.where(arm.prismatic | within, q, turns)


def _twin(arm: Arm, T: Array, found: Array, own: Array) -> int | None:
    if not len(found):
        return None
    way = own - found
    way = np.where(arm.prismatic, way, wrapped(arm, way))
    farthest = np.max(np.abs(way / arm.units), axis=-1)
    for number in np.flatnonzero(farthest < _CLOSE):
        half = found[number] + 0.5 * way[number]
        middle, *ends = relative_residual(arm, T, np.array([half, found[number], own]))
        if farthest[number] < _SAME or middle < max(_BETWEEN, *ends):
            return int(number)
    return None
