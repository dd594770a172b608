"""Which of the postures that were found are one solution."""

from __future__ import annotations

import numpy as np

from mbs.models.inverse_geometry.answers.target import Target
from mbs.models.inverse_geometry.arm import Array

_SAME, _CLOSE, _BETWEEN = 1e-9, 1e-2, 1e-13


def distinct(target: Target, q: Array) -> list[list[int]]:
    """The postures in groups of equal ones, the groups and their members in the given order.

    Two are one solution when they are closer than 1e-9, or closer than 1e-2 and the posture half
    way between solves too, as copies of a multiple root do. Whole turns do not count.

    Args:
        target: the pose they take.
        q: (m, n) solutions [rad or m].
    """
    groups: list[list[int]] = []
    x, scale = q / target.unit, max(1.0, target.arm.length)
    apart = np.max(np.abs(target.wrapped(x[:, None] - x)), axis=2, initial=0.0)
    if np.sum(apart < _CLOSE) == len(q):  # each is close to itself alone
        return [[k] for k in range(len(q))]
    for k in range(len(q)):
        first = [group[0] for group in groups]
        way = target.wrapped(x[k] - x[first])
        far = np.max(np.abs(way), axis=1, initial=0.0)
        near = np.flatnonzero(far < _CLOSE)
        half = (x[[first[m] for m in near]] + 0.5 * way[near]) * target.unit
        between = target.residual(half) < _BETWEEN * scale if len(near) else np.zeros(0, bool)
        same = near[(far[near] < _SAME) | between]
        if len(same):
            groups[int(same[np.argmin(far[same])])].append(k)
        else:
            groups.append([k])
    return groups
