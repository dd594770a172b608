"""Energy as a row times the inertial parameters of the links.

Source: Gautier & Khalil 1988; Khalil & Creusot 1997, eq. 52.
"""

from __future__ import annotations

import casadi
from casadi import SX

from mbs.assembly.tree import Tree
from mbs.recursions.poses import LinkPose
from mbs.recursions.regressor import axis
from mbs.recursions.regressor_sums import Elements, filled
from mbs.recursions.regressor_twists import seen_by_links
from mbs.recursions.velocities import Velocity
from mbs.spatial import cross


def inertial_energy(tree: Tree, poses: list[LinkPose], velocities: list[Velocity]) -> list[SX]:
    """For every link the row (1, 10) whose product with its parameters is its energy E + U.

    Args:
        tree: the links.
        poses: each with respect to its antecedent.
        velocities: of the links; see `link_velocities`.
    """
    ups = seen_by_links(tree, poses, -tree.gravity)
    heights: list[SX] = []
    links: list[Elements] = []
    for j, pose in enumerate(poses):
        i = tree.links[j].antecedent
        below, up = (heights[i], ups[i]) if i >= 0 else (SX(0), -tree.gravity)
        heights.append(below + casadi.dot(up, pose.p))
        row = unit_energies(velocities[j], ups[j], heights[j])
        links.append({0: row.__getitem__})
    return filled(tree, poses, 1, links)


def unit_energies(velocity: Velocity, up: SX, height: SX) -> list[SX]:
    """Energies of a link of which one inertial parameter is one, in their order.

    Args:
        velocity: of the link.
        up: (3, 1) the opposite of gravity, in its frame.
        height: potential energy of a unit of mass at its origin.
    """
    V, w = velocity.V, velocity.w
    x, y, z = w[0], w[1], w[2]
    turning = [0.5 * x * x, x * y, x * z, 0.5 * y * y, y * z, 0.5 * z * z]
    firsts = [casadi.dot(axis(k), cross(V, w) + up) for k in range(3)]
    return [*turning, *firsts, 0.5 * casadi.dot(V, V) + height]
