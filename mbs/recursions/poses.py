"""Poses of link frames: the direct geometric model, link by link.

Source: Khalil & Kleinfinger 1986; Khalil & Creusot 1997, eq. 1.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi
from casadi import SX

from mbs.assembly.tree import Link, Tree
from mbs.components.motion import Motion
from mbs.spatial import (
    MatrixTurn,
    Pose,
    Rotation,
    axis_turn,
    quaternion_rotation,
)


@dataclass(frozen=True, slots=True, eq=False)
class LinkPose:
    """Frame j seen from its antecedent i, as turns that are cheap to apply.

    Attributes:
        turns: from frame i towards frame j.
        p: (3, 1) origin of j in frame i [m].
    """

    turns: tuple[Rotation, ...]
    p: SX

    @property
    def matrix(self) -> SX:
        """(3, 3) orientation of j in i."""
        R = Pose.identity().R
        for turn in self.turns:
            R = casadi.mtimes(R, turn.matrix)
        return R

    def apply(self, vector: SX) -> SX:
        """A vector of frame j in frame i."""
        for turn in reversed(self.turns):
            vector = turn.apply(vector)
        return vector

    def apply_inverse(self, vector: SX) -> SX:
        """A vector of frame i in frame j."""
        for turn in self.turns:
            vector = turn.apply_inverse(vector)
        return vector

    def apply_to_tensor(self, tensor: SX) -> SX:
        """A symmetric tensor of frame j in frame i."""
        for turn in reversed(self.turns):
            tensor = turn.apply_to_tensor(tensor)
        return tensor

    def after(self, pose: Pose) -> Pose:
        """Frame j seen from the frame in which frame i has this pose."""
        rows = pose.R.T
        for turn in self.turns:
            rows = casadi.horzcat(*(turn.apply_inverse(rows[:, k]) for k in range(3)))
        return Pose(rows.T, pose.p + casadi.mtimes(pose.R, self.p))


def link_poses(tree: Tree, q: SX) -> list[LinkPose]:
    """Every link frame seen from its antecedent at the positions q, (nq, 1)."""
    return [_link_pose(link, q[link.q]) for link in tree.links]


def base_poses(tree: Tree, poses: list[LinkPose]) -> list[Pose]:
    """Every link frame seen from the base."""
    result: list[Pose] = []
    for link, pose in zip(tree.links, poses, strict=True):
        i = link.antecedent
        result.append(pose.after(result[i] if i >= 0 else Pose.identity()))
    return result


def chain_pose(poses: list[LinkPose], links: list[int]) -> Pose:
    """The last of consecutive links seen from the frame before the first; identity when empty."""
    pose = Pose.identity()
    for j in links:
        pose = poses[j].after(pose)
    return pose


def relative_pose(
    tree: Tree, poses: list[LinkPose], a: tuple[int, Pose], b: tuple[int, Pose]
) -> Pose:
    """Frame b seen from frame a, through their common ancestor only.

    Args:
        tree: the links.
        poses: of every link with respect to its antecedent.
        a: link (-1 for the base) and pose of the frame in it.
        b: likewise.
    """
    path_a, path_b = tree.path(a[0]), tree.path(b[0])
    while path_a and path_b and path_a[0] == path_b[0]:
        path_a, path_b = path_a[1:], path_b[1:]
    to_a = chain_pose(poses, path_a) @ a[1]
    to_b = chain_pose(poses, path_b) @ b[1]
    return to_b if to_a.is_identity() else to_a.inverse() @ to_b


def _link_pose(link: Link, q: SX) -> LinkPose:
    placement = link.placement
    match link.motion:
        case Motion.REVOLUTE:
            placement = placement.turned(q)
        case Motion.PRISMATIC:
            placement = placement.slid(q)
    turns: list[Rotation] = [
        axis_turn(axis, angle)
        for axis, angle in (
            ("z", placement.gamma),
            ("x", placement.alpha),
            ("z", placement.theta),
        )
        if not angle.is_zero()
    ]
    p = placement.position()
    if link.motion is Motion.FREE:
        p = p + LinkPose(tuple(turns), p).apply(q[0:3])
    if link.motion in (Motion.SPHERICAL, Motion.FREE):
        turns.append(MatrixTurn(quaternion_rotation(q[link.motion.nq - 4 :])))
    return LinkPose(tuple(turns), p)
