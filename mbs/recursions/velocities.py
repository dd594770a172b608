"""Velocities of the links, each in its own frame.

Source: Khalil & Creusot 1997, eq. 6.
"""

from __future__ import annotations

from dataclasses import dataclass

from casadi import SX

from mbs.assembly.tree import Tree
from mbs.recursions.motion import relative_motion
from mbs.recursions.poses import LinkPose
from mbs.spatial import cross, is_zero, zeros


@dataclass(frozen=True, slots=True, eq=False)
class Velocity:
    """Velocity of a link.

    Attributes:
        V: (3, 1) of the origin of frame j, in frame j [m/s].
        w: (3, 1) angular, in frame j [rad/s].
    """

    V: SX
    w: SX


def link_velocities(
    tree: Tree, poses: list[LinkPose], v: SX, base: Velocity | None = None
) -> list[Velocity]:
    """Velocity of every link for the joint velocities v, (nv, 1), and that of the base."""
    result: list[Velocity] = []
    for link, pose in zip(tree.links, poses, strict=True):
        i = link.antecedent
        before = result[i] if i >= 0 else (base or Velocity(zeros(), zeros()))
        linear, angular = relative_motion(link.motion, v[link.v])
        moved = before.V if is_zero(before.w) else before.V + cross(before.w, pose.p)
        result.append(
            Velocity(pose.apply_inverse(moved) + linear, pose.apply_inverse(before.w) + angular)
        )
    return result
