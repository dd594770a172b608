"""Jacobian of a frame: its velocity as a linear function of the joint velocities.

Source: Renaud 1980; Khalil & Creusot 1997, eq. 3 and 5.
"""

import casadi
from casadi import SX

from mbs.assembly.tree import Tree
from mbs.recursions.motion import unit_motions
from mbs.recursions.poses import LinkPose, base_poses
from mbs.spatial import Pose, cross, zeros


def jacobian(tree: Tree, poses: list[LinkPose], frame: tuple[int, Pose]) -> SX:
    """(6, nv) with [V; w] = J v: velocity of the frame's origin and angular, in the base frame.

    Args:
        tree: the links.
        poses: each with respect to its antecedent.
        frame: link (-1 for the base) and pose of the frame in it.
    """
    j, inside = frame
    J = zeros(6, tree.nv)
    if j < 0:
        return J
    placed = base_poses(tree, poses)
    origin = placed[j].p + casadi.mtimes(placed[j].R, inside.p)
    for k in tree.path(j):
        link, pose = tree.links[k], placed[k]
        arm = origin - pose.p
        for column, (linear, angular) in enumerate(unit_motions(link.motion)):
            w = casadi.mtimes(pose.R, angular)
            V = casadi.mtimes(pose.R, linear) + cross(w, arm)
            J[:, link.v.start + column] = casadi.vertcat(V, w)
    return J
