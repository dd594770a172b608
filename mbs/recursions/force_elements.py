"""Force elements in the equations of a tree: wrenches on links, efforts on joints, energy.

Source: Khalil & Creusot 1997, eq. 15-20, for how wrenches on links become joint efforts.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import casadi
from casadi import SX

from mbs.assembly.tables import AttachedForce
from mbs.assembly.tree import Tree
from mbs.components.forces import JointForce, PairForce, RelativeMotion
from mbs.components.forces_source import Source
from mbs.recursions.motion import effort
from mbs.recursions.newton_euler import Wrench
from mbs.recursions.poses import LinkPose
from mbs.recursions.route import relative_pose
from mbs.recursions.velocities import Velocity, link_velocities
from mbs.spatial import Pose, cross, zeros

_BASE = (-1, Pose.identity())
_Frame = tuple[int, Pose]


def element_wrenches(
    tree: Tree, forces: Sequence[AttachedForce], poses: list[LinkPose], q: SX, v: SX
) -> dict[int, Wrench]:
    """For some links, the wrench that they exert on force elements, about and in their frames.

    Args:
        tree: the links.
        forces: those that act on joints are left out.
        poses: each with respect to its antecedent.
        q: (nq, 1) positions.
        v: (nv, 1) velocities.
    """
    on_points = [force for force in forces if force.frames]
    if not on_points:
        return {}
    moving = link_velocities(tree, poses, v)
    result: dict[int, Wrench] = {}
    for force in on_points:
        for (link, pose), (f, m) in _on_frames(tree, force, q, moving):
            if link >= 0:
                turned = casadi.mtimes(pose.R, f)
                moment = casadi.mtimes(pose.R, m) + cross(pose.p, turned)
                before = result.get(link, (zeros(), zeros()))
                result[link] = (before[0] - turned, before[1] - moment)
    return result


def coordinate_efforts(tree: Tree, forces: Sequence[AttachedForce], q: SX, v: SX) -> SX:
    """(nv, 1) what joints need of effort to overcome stops and friction [N m or N]."""
    total = SX.zeros(tree.nv)
    for force in forces:
        if isinstance(force.element, JointForce):
            assert force.velocity is not None
            own = force.element.effort(_position(force, q), v[force.velocity], force.symbols)
            total[force.velocity] += own
    return total


def element_efforts(
    tree: Tree, forces: Sequence[AttachedForce], poses: list[LinkPose], q: SX, v: SX
) -> SX:
    """(nv, 1) joint efforts that hold all force elements, the links at rest or not [N m or N].

    It is the part that they have in the efforts of the inverse dynamic model.
    """
    wrenches = element_wrenches(tree, forces, poses, q, v)
    return _transmitted(tree, poses, wrenches) + coordinate_efforts(tree, forces, q, v)


def element_energy(tree: Tree, forces: Sequence[AttachedForce], q: SX) -> SX:
    """Energy stored in force elements [J]; dampers, friction and sources store nothing."""
    total = SX(0)
    for force in forces:
        if isinstance(force.element, JointForce):
            total += force.element.energy(_position(force, q), force.symbols)
        elif isinstance(force.element, PairForce):
            T = relative_pose(tree, q, *force.frames)
            still = RelativeMotion(T.p, T.R, zeros(), zeros())
            total += force.element.energy(still, force.symbols)
    return total


def _position(force: AttachedForce, q: SX) -> SX | None:
    return None if force.position is None else q[force.position]


def _on_frames(
    tree: Tree, force: AttachedForce, q: SX, moving: list[Velocity]
) -> list[tuple[_Frame, Wrench]]:
    """What an element does to each of its frames: force and moment about it, in its axes."""
    if isinstance(force.element, Source):
        (frame,) = force.frames
        R = relative_pose(tree, q, _BASE, frame).R
        return [(frame, force.element.wrench(R, force.symbols))]
    assert isinstance(force.element, PairForce)
    a, b = force.frames
    motion = _relative_motion(tree, a, b, q, moving)
    pull = force.element.pull(motion, force.symbols)
    opposite = casadi.mtimes(motion.R.T, -pull.force), casadi.mtimes(motion.R.T, pull.moment_b)
    return [(a, (pull.force, pull.moment_a)), (b, opposite)]


def _relative_motion(
    tree: Tree, a: _Frame, b: _Frame, q: SX, moving: list[Velocity]
) -> RelativeMotion:
    T = relative_pose(tree, q, a, b)
    V_a, w_a = _velocity(a, moving)
    V_b, w_b = _velocity(b, moving)
    V = casadi.mtimes(T.R, V_b) - V_a - cross(w_a, T.p)
    return RelativeMotion(T.p, T.R, V, casadi.mtimes(T.R, w_b) - w_a)


def _velocity(frame: _Frame, moving: list[Velocity]) -> tuple[SX, SX]:
    """Linear and angular velocity of a frame, in its axes."""
    link, pose = frame
    if link < 0:
        return zeros(), zeros()
    V, w = moving[link].V, moving[link].w
    return casadi.mtimes(pose.R.T, V + cross(w, pose.p)), casadi.mtimes(pose.R.T, w)


def _transmitted(tree: Tree, poses: list[LinkPose], wrenches: Mapping[int, Wrench]) -> SX:
    """(nv, 1) efforts along the motions that transmit wrenches of links to the base."""
    carried = [wrenches.get(j, (zeros(), zeros())) for j in range(len(tree.links))]
    for j in reversed(range(len(tree.links))):
        i = tree.links[j].antecedent
        if i >= 0:
            f, m = poses[j].wrench(*carried[j])
            carried[i] = carried[i][0] + f, carried[i][1] + m
    efforts = (effort(link.motion, f, m) for link, (f, m) in zip(tree.links, carried, strict=True))
    return casadi.vertcat(*efforts)
