"""Force elements in the equations of a tree: wrenches on links, efforts on joints, energy.

Source: Khalil & Creusot 1997, eq. 15-20, for how wrenches on links become joint efforts.
"""

from __future__ import annotations

from collections.abc import Container, Mapping

import casadi
from casadi import SX

from mbs.assembly.tree import Tree
from mbs.recursions.newton_euler import inertial_wrench, rotor_moments
from mbs.recursions.parts import PartsAt
from mbs.recursions.poses import LinkPose
from mbs.recursions.velocities import (
    Acceleration,
    effort,
    link_accelerations,
)
from mbs.spatial import PseudoInertia, Wrench, add_wrenches, transform_wrench, zeros

# Wrenches that the joints of a tree transmit, link by link as the description has them.
#
# The inverse dynamic model moves frames and inertial parameters to where they save operations;
# its efforts stay the same, but not the wrenches between links. Here nothing is moved.
#
# Source: Khalil & Creusot 1997, eq. 15-19.


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


def transmitted_wrenches(
    tree: Tree, poses: list[LinkPose], loads: Mapping[int, Wrench]
) -> list[Wrench]:
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


def sum_wrenches(*parts: Mapping[int, Wrench]) -> dict[int, Wrench]:
    """Wrenches on links added link by link."""
    total: dict[int, Wrench] = {}
    for part in parts:
        for link, wrench in part.items():
            total[link] = add_wrenches(total[link], wrench) if link in total else wrench
    return total


def element_wrenches(
    acting: PartsAt, held: Container[tuple[str, str]] | None = None
) -> dict[int, Wrench]:
    """For some links, the wrench that they exert on components, about and in their frames.

    Args:
        acting: the components at positions and velocities.
        held: points, by component and port, whose wrenches alone count, those on the base (-1)
            too; without it all on moving links.
    """
    exerted: list[dict[int, Wrench]] = []
    for part in acting.parts:
        if part.frames and part.element.acts:
            for port, (link, pose), load in acting.frame_loads(part):
                point = part.element.frames[port]
                if link >= 0 if held is None else (point.owner.name, point.port) in held:
                    f, m = transform_wrench(pose, (load.force, load.moment))
                    exerted.append({link: (-f, -m)})
    return sum_wrenches(*exerted)


def element_efforts(acting: PartsAt, poses: list[LinkPose]) -> SX:
    """(nv, 1) joint efforts that hold all components, the links at rest or not [N m or N].

    It is the part that they have in the efforts of the inverse dynamic model.
    """
    wrenches = element_wrenches(acting)
    return wrench_efforts(acting.tree, poses, wrenches) + acting.efforts()


def wrench_efforts(tree: Tree, poses: list[LinkPose], wrenches: Mapping[int, Wrench]) -> SX:
    """(nv, 1) efforts along the motions that transmit wrenches of links to the base."""
    carried = transmitted_wrenches(tree, poses, wrenches)
    at = zip(tree.links, poses, carried, strict=True)
    return casadi.vertcat(*(effort(link, pose, *wrench) for link, pose, wrench in at))
