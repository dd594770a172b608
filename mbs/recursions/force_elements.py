"""Force elements in the equations of a tree: wrenches on links, efforts on joints, energy.

Source: Khalil & Creusot 1997, eq. 15-20, for how wrenches on links become joint efforts.
"""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence

import casadi
from casadi import SX

from mbs.assembly.tables import AttachedForce
from mbs.assembly.tree import Frame, Tree
from mbs.components.forces import CoordinateForce, PairForce, PointSource, RelativeMotion
from mbs.recursions.newton_euler import inertial_wrench, rotor_moments
from mbs.recursions.poses import LinkPose
from mbs.recursions.route import BASE, relative_motion, relative_pose
from mbs.recursions.velocities import (
    Acceleration,
    Velocity,
    effort,
    link_accelerations,
    link_velocities,
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
    tree: Tree,
    forces: Sequence[AttachedForce],
    poses: list[LinkPose],
    q: SX,
    v: SX,
    held: Container[tuple[str, str]] | None = None,
) -> dict[int, Wrench]:
    """For some links, the wrench that they exert on force elements, about and in their frames.

    Args:
        tree: the links.
        forces: those that act on joints are left out.
        poses: each with respect to its antecedent.
        q: (nq, 1) positions.
        v: (nv, 1) velocities.
        held: points, by component and port, whose wrenches alone count, those on the base (-1)
            too; without it all on moving links.
    """
    on_points = [force for force in forces if force.frames]
    if not on_points:
        return {}
    moving = link_velocities(tree, poses, v)
    exerted: list[dict[int, Wrench]] = []
    for force in on_points:
        acting = zip(force.element.points, _on_frames(tree, force, q, moving), strict=True)
        for point, ((link, pose), wrench) in acting:
            if link >= 0 if held is None else (point.owner.name, point.port) in held:
                f, m = transform_wrench(pose, wrench)
                exerted.append({link: (-f, -m)})
    return sum_wrenches(*exerted)


def coordinate_efforts(tree: Tree, forces: Sequence[AttachedForce], q: SX, v: SX) -> SX:
    """(nv, 1) what joints need of effort to overcome stops, friction, elastic shafts."""
    total = SX.zeros(tree.nv)
    for force in forces:
        if isinstance(force.element, CoordinateForce):
            rate = sum((lever.factor * v[lever.velocity] for lever in force.levers), SX(0))
            own = force.element.effort(_position(force, q), rate, force.symbols)
            for lever in force.levers:
                total[lever.velocity] += lever.factor * own
    return total


def element_efforts(
    tree: Tree, forces: Sequence[AttachedForce], poses: list[LinkPose], q: SX, v: SX
) -> SX:
    """(nv, 1) joint efforts that hold all force elements, the links at rest or not [N m or N].

    It is the part that they have in the efforts of the inverse dynamic model.
    """
    wrenches = element_wrenches(tree, forces, poses, q, v)
    return wrench_efforts(tree, poses, wrenches) + coordinate_efforts(tree, forces, q, v)


def element_energy(tree: Tree, forces: Sequence[AttachedForce], q: SX) -> SX:
    """Energy stored in force elements [J]; dampers, friction and sources store nothing."""
    total = SX(0)
    for force in forces:
        if isinstance(force.element, CoordinateForce):
            total += force.element.energy(_position(force, q), force.symbols)
        elif isinstance(force.element, PairForce):
            T = relative_pose(tree, q, *force.frames)
            still = RelativeMotion(T.p, T.R, zeros(), zeros())
            total += force.element.energy(still, force.symbols)
    return total


def _position(force: AttachedForce, q: SX) -> SX | None:
    """What an element on coordinates acts on, None where one of them is no position."""
    total = SX(0)
    for lever in force.levers:
        if lever.position is None:
            return None
        total += lever.factor * q[lever.position]
    return total


def _on_frames(
    tree: Tree, force: AttachedForce, q: SX, moving: list[Velocity]
) -> list[tuple[Frame, Wrench]]:
    """What an element does to each of its frames: force and moment about it, in its axes."""
    if isinstance(force.element, PointSource):
        (frame,) = force.frames
        R = relative_pose(tree, q, BASE, frame).R
        return [(frame, force.element.wrench(R, force.symbols))]
    assert isinstance(force.element, PairForce)
    a, b = force.frames
    motion = relative_motion(tree, a, b, q, moving)
    pull = force.element.pull(motion, force.symbols)
    opposite = casadi.mtimes(motion.R.T, -pull.force), casadi.mtimes(motion.R.T, pull.moment_b)
    return [(a, (pull.force, pull.moment_a)), (b, opposite)]


def wrench_efforts(tree: Tree, poses: list[LinkPose], wrenches: Mapping[int, Wrench]) -> SX:
    """(nv, 1) efforts along the motions that transmit wrenches of links to the base."""
    carried = transmitted_wrenches(tree, poses, wrenches)
    efforts = (effort(link.motion, f, m) for link, (f, m) in zip(tree.links, carried, strict=True))
    return casadi.vertcat(*efforts)
