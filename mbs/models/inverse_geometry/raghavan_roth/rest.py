"""Joints 2, 1 and 6 when joints 3, 4 and 5 of the loop are known.

The pair of the origin and the z axis beyond joint 5 must come, by joints 2 and 1, to where joint 6
turns. What the motion of joint 1 leaves alone are six equations linear in (cos q2, sin q2), or in
(r2, r2^2). Joint 1 then aligns the pairs, and joint 6 is what remains.

Source: Raghavan & Roth 1993, section 4.
"""

from __future__ import annotations

import numpy as np

from mbs.models.inverse_geometry.arm import inverse, motion
from mbs.models.inverse_geometry.raghavan_roth.elimination import Joints
from mbs.models.inverse_geometry.raghavan_roth.pairs import (
    KEPT_BY_SLIDE,
    KEPT_BY_TURN,
    Array,
    motion_parts,
    pair,
    rho,
)

_FLAT = 1e-4  # ratio of singular values below which joint 2 has two roots too
_NONE = 1e-9  # and below which it has no single root
_NOTHING = 1e-12  # singular values, in lengths of the loop, that are rounding


def completed(ways: Array, prismatic: Joints, middle: Array) -> tuple[Array, Array]:
    """All positions of the loop's joints.

    Args:
        ways: (n, 6, 4, 4) of the loop.
        prismatic: (6,) whether each joint slides.
        middle: (n, 3) positions of joints 3, 4 and 5.

    Returns:
        (m,) numbers of the rows of `middle` that the solutions belong to, and (m, 6) positions.
    """
    beyond = ways[:, 1]
    for k in (2, 3, 4):
        beyond = beyond @ motion(middle[:, k - 2], bool(prismatic[k])) @ ways[:, k]
    goal = inverse(ways[:, 5])
    number, second = _second(ways[:, 0], prismatic, beyond, goal)
    near = ways[number, 0] @ motion(second, bool(prismatic[1])) @ beyond[number]
    first = _first(bool(prismatic[0]), near, goal[number])
    left = inverse(motion(first, bool(prismatic[0])) @ near) @ goal[number]
    sixth = np.arctan2(left[:, 1, 0] - left[:, 0, 1], left[:, 0, 0] + left[:, 1, 1])
    return number, np.column_stack([first, second, middle[number], sixth])


def _first(prismatic: bool, near: Array, goal: Array) -> Array:
    """(n,) the position of joint 1 that takes the origin and z axis of frames near to the goal."""
    if prismatic:
        slide: Array = goal[:, 2, 3] - near[:, 2, 3]
        return slide
    x, y = near[:, 0, 2:], near[:, 1, 2:]
    X, Y = goal[:, 0, 2:], goal[:, 1, 2:]
    turn: Array = np.arctan2(np.sum(x * Y - y * X, axis=1), np.sum(x * X + y * Y, axis=1))
    return turn


def _second(way: Array, prismatic: Joints, beyond: Array, goal: Array) -> tuple[Array, Array]:
    """Numbers of the rows, and positions of joint 2: two more where there is but one equation."""
    kept = KEPT_BY_SLIDE if prismatic[0] else KEPT_BY_TURN
    moved = np.einsum("iab,nb->nai", motion_parts(bool(prismatic[1])), pair(beyond))
    A = (rho(way) @ moved)[:, kept]
    U, s, V = np.linalg.svd(A[:, :, 1:], full_matrices=False)
    g = np.einsum("nai,na->ni", U, pair(goal)[:, kept] - A[:, :, 0])
    regular = s > np.maximum(_NONE * s[:, :1], _NOTHING)
    sharp, flat = regular[:, 1], s[:, 1] <= np.maximum(_FLAT * s[:, 0], _NOTHING)
    g = np.where(regular, g / np.where(regular, s, 1.0), 0.0)
    f = np.einsum("nij,ni->nj", V, g)
    single = f[:, 0] if prismatic[1] else np.arctan2(f[:, 1], f[:, 0])
    low, high = _crossings(bool(prismatic[1]), V[:, 0], g[:, 0])
    rows = [np.nonzero(mask)[0] for mask in (sharp, flat, flat)]
    positions = [root[own] for root, own in zip((single, low, high), rows, strict=True)]
    return np.concatenate(rows), np.concatenate(positions)


def _crossings(prismatic: bool, n: Array, g: Array) -> tuple[Array, Array]:
    """Both roots of n_x cos q + n_y sin q = g, or of n_x r + n_y r^2 = g; the fold if not real."""
    if not prismatic:
        middle = np.arctan2(n[:, 1], n[:, 0])
        half = np.arccos(np.clip(g / np.maximum(np.linalg.norm(n, axis=1), 1e-300), -1, 1))
        return middle - half, middle + half
    root = np.sqrt(np.maximum(n[:, 0] ** 2 + 4 * n[:, 1] * g, 0))
    larger = -0.5 * (n[:, 0] + np.copysign(root, n[:, 0]))
    low = -g / np.where(np.abs(larger) > 1e-300, larger, 1e-300)
    curved = np.abs(n[:, 1]) > 1e-9 * np.abs(n[:, 0])
    high = np.where(curved, larger / np.where(curved, n[:, 1], 1.0), low)
    return low, high
