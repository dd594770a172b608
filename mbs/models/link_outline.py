"""The lines that stand for a rigid link: between the points at which it is held."""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_SAME = 1e-9
"""Points that are nearer than this part of the size of the link are one [1]."""

_WIDE = 1e-6
"""Points that lie off a line by less than this part of its length are on it [1]."""


def link_outline(points: Array, held: int) -> list[tuple[int, int]]:
    """Pairs of points that lines join.

    The joints are on a line from end to end, or on a polygon that goes round them where three or
    more are not in line. Each other point is joined to the nearest one, unless it lies between
    them.

    Args:
        points: (k, 3) in the frame of the link [m].
        held: how many of them, the first ones, are joints.

    Returns:
        numbers of points; of those that fall together the first one.
    """
    size = float(np.abs(points - points[0]).max())
    kept = [k for k in range(len(points)) if _is_new(points, k, _SAME * max(size, 1.0))]
    corners = [k for k in kept if k < held]
    lines = _polygon(points, corners) if corners else []
    for k in (k for k in kept if k >= held):
        if not corners:
            corners = [k]
            continue
        near = min(corners, key=lambda m: float(np.linalg.norm(points[m] - points[k])))
        middle = points[corners].mean(axis=0)
        reach = float(np.linalg.norm(points[near] - middle))
        if len(corners) < 3 or float(np.linalg.norm(points[k] - middle)) > reach:
            lines.append((near, k))
    return lines


def _is_new(points: Array, k: int, apart: float) -> bool:
    """Whether point k is none of those before it."""
    return bool(np.all(np.linalg.norm(points[:k] - points[k], axis=1) > apart))


def _polygon(points: Array, corners: list[int]) -> list[tuple[int, int]]:
    away = points[corners] - points[corners].mean(axis=0)
    _, sizes, axes = np.linalg.svd(away)
    flat = away @ axes[:2].T
    if len(sizes) < 2 or sizes[1] <= _WIDE * sizes[0]:
        path = [corners[k] for k in np.argsort(flat[:, 0], kind="stable")]
        return list(itertools.pairwise(path))
    path = [corners[k] for k in np.argsort(np.arctan2(flat[:, 1], flat[:, 0]), kind="stable")]
    return list(itertools.pairwise([*path, path[0]]))
