"""Wrenches that the joints of a tree transmit, link by link as the description has them.

The inverse dynamic model moves frames and inertial parameters to where they save operations; its
efforts stay the same, but not the wrenches between links. Here nothing is moved.

Source: Khalil & Creusot 1997, eq. 15-19.
"""

from __future__ import annotations

from collections.abc import Mapping

from casadi import SX

from mbs.assembly.tree import Tree
from mbs.recursions.accelerations import Acceleration, link_accelerations
from mbs.recursions.newton_euler import inertial_wrench
from mbs.recursions.poses import LinkPose
from mbs.recursions.rotors import rotor_moments
from mbs.spatial import PseudoInertia, Wrench, add_wrenches, zeros


def inertial_loads(
    tree: Tree, poses: list[LinkPose], v: SX, a: SX, base: Acceleration
) -> dict[int, Wrench]:
    """For every link the wrench that moves its bodies and turns its rotors, about and in its frame.

    Args:
        tree: the links.
        poses: each with respect to its antecedent.
        v: (nv, 1) joint velocities.
        a: (nv, 1) joint accelerations.
        base: motion of the base, gravity included.
    """
    motions = link_accelerations(tree, poses, v, a, base)
    spins = rotor_moments(tree, v, a, motions)
    loads = {}
    for j, (link, motion) in enumerate(zip(tree.links, motions, strict=True)):
        f, m = inertial_wrench(PseudoInertia.of(link.inertia), motion)
        loads[j] = f, m + spins.get(j, zeros())
    return loads


def transmitted(tree: Tree, poses: list[LinkPose], loads: Mapping[int, Wrench]) -> list[Wrench]:
    """The wrench that each link takes from its antecedent, about and in its frame.

    Args:
        tree: the links.
        poses: each with respect to its antecedent.
        loads: for some links the wrench that they need themselves, about and in their frames.
    """
    carried = [loads.get(j, (zeros(), zeros())) for j in range(len(tree.links))]
    for j in reversed(range(len(tree.links))):
        i = tree.links[j].antecedent
        if i >= 0:
            carried[i] = add_wrenches(carried[i], poses[j].wrench(*carried[j]))
    return carried


def summed(*parts: Mapping[int, Wrench]) -> dict[int, Wrench]:
    """Wrenches on links added link by link."""
    total: dict[int, Wrench] = {}
    for part in parts:
        for link, wrench in part.items():
            total[link] = add_wrenches(total[link], wrench) if link in total else wrench
    return total
