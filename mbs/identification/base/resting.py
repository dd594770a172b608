"""Where all axes before a joint meet its own axis: a point of the link that never moves."""

from __future__ import annotations

import casadi
import numpy as np
from casadi import SX

from mbs.components.motion import Motion
from mbs.identification.base.structure import Array, Structure
from mbs.spatial import cross


def resting_height(structure: Structure, j: int) -> SX | None:
    """Where on axis j a point rests, from the origin of frame j [m]; None when no point does.

    Args:
        structure: of the tree.
        j: number of a revolute link, from 0.
    """
    if structure.point_rests(j, structure.origins[:, j]):
        return SX(0)
    for k in structure.before(j):
        turns = structure.tree.links[k].motion is Motion.REVOLUTE
        if turns and structure.never_parallel(j, k):
            return _height_where_all_meet(structure, j, k)
    return None


def _height_where_all_meet(structure: Structure, j: int, k: int) -> SX | None:
    axes = structure.axes
    between = structure.origins[:, k] - structure.origins[:, j]
    normal = np.cross(axes[:, j], axes[:, k])
    square: Array = np.sum(normal**2, axis=1)
    height = np.sum(np.cross(between, axes[:, k]) * normal, axis=1) / square
    points = structure.origins[:, j] + height[:, None] * axes[:, j]
    if not structure.point_rests(j, points):
        return None
    pose = structure.seen_from_link(k, j)
    u = pose.R[:, 2]
    across = casadi.vertcat(-u[1], u[0], 0)
    return casadi.dot(cross(pose.p, u), across) / casadi.dot(across, across)
