"""Wrenches and joint efforts of force elements, and wrenches that the joints transmit.

Source: Khalil & Creusot 1997, eq. 15-20, for the joint efforts of wrenches on links.
"""

from __future__ import annotations

from collections.abc import Container, Mapping

import casadi
from casadi import SX

from mbs.assembly.tree import Tree
from mbs.recursions.link_motions import (
    Acceleration,
    LinkPose,
    effort,
    link_accelerations,
)
from mbs.recursions.newton_euler import inertial_wrench, rotor_moments
from mbs.recursions.parts import PartsAt
from mbs.spatial import PseudoInertia, Wrench, add_wrenches, transform_wrench, zeros

# Wrenches that the joints of a tree transmit between the links of the description.
#
# The inverse dynamic model shifts frames and regroups inertial parameters to save operations. This
# keeps the joint efforts, but changes the wrenches between links. Here nothing is shifted.
#
# Source: Khalil & Creusot 1997, eq. 15-19.


def inertial_loads(
    tree: Tree, poses: list[LinkPose], v: SX, a: SX, base: Acceleration
) -> dict[int, Wrench]:
    """Return the wrench that accelerates each link and its rotors, by link index.

    Each wrench (force [N], moment [N m]) is about the origin of the link frame, in its axes.

    Args:
        tree: the links.
        poses: pose of each link relative to its antecedent.
        v: (nv, 1) joint velocities.
        a: (nv, 1) joint accelerations.
        base: motion of the base; its acceleration includes minus gravity.
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
    """Return the wrench that each joint transmits from the antecedent to its link.

    Wrenches (force [N], moment [N m]) are about the origin and in axes of the frame of the link.

    Args:
        tree: the links.
        poses: pose of each link relative to its antecedent.
        loads: wrench that a link requires for itself, by link index, in the frame of the link.
            Links without an entry require none.
    """
    carried = [loads.get(j, (zeros(), zeros())) for j in range(len(tree.links))]
    for j in reversed(range(len(tree.links))):
        i = tree.links[j].antecedent
        if i >= 0:
            carried[i] = add_wrenches(carried[i], poses[j].wrench(*carried[j]))
    return carried


def sum_wrenches(*parts: Mapping[int, Wrench]) -> dict[int, Wrench]:
    """Return the sum of wrenches on each link, by link index.

    Args:
        parts: wrenches about the origin and in axes of the link frames, by link index.
    """
    total: dict[int, Wrench] = {}
    for part in parts:
        for link, wrench in part.items():
            total[link] = add_wrenches(total[link], wrench) if link in total else wrench
    return total


def element_wrenches(
    acting: PartsAt, held: Container[tuple[str, str]] | None = None
) -> dict[int, Wrench]:
    """Return the wrench that each link exerts on components at its points, by link index.

    Wrenches (force [N], moment [N m]) are about the origin and in axes of the link frame.

    Args:
        acting: components at given positions and velocities.
        held: points (component name, port) whose wrenches are summed, including points on the base
            (link -1). By default all points on moving links.
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
    """Return the joint efforts (nv, 1) that balance all components [N m or N].

    They are added to the efforts of the inverse dynamic model.

    Args:
        acting: components at given positions and velocities.
        poses: pose of each link relative to its antecedent.
    """
    wrenches = element_wrenches(acting)
    return wrench_efforts(acting.tree, poses, wrenches) + acting.efforts()


def wrench_efforts(tree: Tree, poses: list[LinkPose], wrenches: Mapping[int, Wrench]) -> SX:
    """Return the joint efforts (nv, 1) [N m or N] with which the joints supply wrenches of links.

    Args:
        tree: the links.
        poses: pose of each link relative to its antecedent.
        wrenches: wrench that a link requires, by link index, about the origin and in axes of its
            frame.
    """
    carried = transmitted_wrenches(tree, poses, wrenches)
    at = zip(tree.links, poses, carried, strict=True)
    return casadi.vertcat(*(effort(link, pose, *wrench) for link, pose, wrench in at))
