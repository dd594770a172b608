"""Kinetic and potential energy.

Source: Khalil & Creusot 1997, eq. 49-50.
"""

import casadi
from casadi import SX

from mbs.assembly.tree import Tree
from mbs.recursions.link_motions import LinkPose, base_poses, link_velocities
from mbs.recursions.newton_euler import rotor_energy
from mbs.spatial import cross


def kinetic_energy(tree: Tree, poses: list[LinkPose], v: SX) -> SX:
    """Return the kinetic energy [J] of links and rotors.

    Args:
        tree: links, rotors included.
        poses: pose of each link relative to its antecedent.
        v: (nv, 1) joint velocities.
    """
    motions = link_velocities(tree, poses, v)
    total = rotor_energy(tree, v, [motion.w for motion in motions])
    for link, motion in zip(tree.links, motions, strict=True):
        V, w, body = motion.V, motion.w, link.inertia
        total += 0.5 * (
            casadi.dot(w, casadi.mtimes(body.J, w))
            + body.m * casadi.dot(V, V)
            + 2 * casadi.dot(body.ms, cross(V, w))
            + link.Ia * casadi.dot(v[link.v], v[link.v])
        )
    return total


def potential_energy(tree: Tree, poses: list[LinkPose]) -> SX:
    """Return the potential energy [J] of gravity. It is zero with all mass at the base origin.

    Args:
        tree: links; gravity is given in the base frame.
        poses: pose of each link relative to its antecedent.
    """
    total = SX(0)
    for link, pose in zip(tree.links, base_poses(tree, poses), strict=True):
        moment = link.inertia.m * pose.p + casadi.mtimes(pose.R, link.inertia.ms)
        total -= casadi.dot(tree.gravity, moment)
    return total
