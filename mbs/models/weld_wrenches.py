"""Wrenches of joints that weld two bodies into one link, as a force sensor between them feels."""

from __future__ import annotations

import casadi
from casadi import SX

from mbs.assembly import System
from mbs.assembly.joint_rows import JointRow, WeldedPart
from mbs.models.surroundings import Surroundings, wrenches_on_links
from mbs.models.symbols import ModelSymbols
from mbs.recursions.accelerations import Acceleration, link_accelerations
from mbs.recursions.force_elements import element_wrenches
from mbs.recursions.newton_euler import inertial_wrench
from mbs.recursions.route import relative_pose
from mbs.spatial import Pose, PseudoInertia, Wrench, add_wrenches, carried, cross, zeros


def weld_wrench(
    system: System,
    s: ModelSymbols,
    a: SX,
    around: Surroundings,
    joint: JointRow,
    others: dict[str, Wrench],
) -> Wrench:
    """The wrench of a Fixed joint on the body of frame_b, about and in frame_b.

    It moves the part that the joint holds, and passes on what this exerts on joints, force elements
    and its environment.

    Args:
        system: open or closed.
        s: its symbols.
        a: (nv, 1) accelerations of the tree.
        around: what acts from outside.
        joint: a row with a part.
        others: wrenches of the joints that do not weld, by their names, about and in frame_b.
    """
    part, (link, pose) = joint.part, joint.frame_b
    assert part is not None
    motions = link_accelerations(system.tree, s.poses, s.v_tree, a, around.base)
    motion = motions[link] if link >= 0 else around.base
    total = inertial_wrench(PseudoInertia.of(part.inertia), motion)
    total = add_wrenches(total, (zeros(), _spin(system, part, s.v_tree, a, motion)))
    elements = element_wrenches(system.tree, system.forces, s.poses, s.q, s.v_tree, held=part.ports)
    exerted = [elements.get(link), _outside(system, part, around).get(link)]
    exerted += [
        _on_joint(system, s.q, row, link, side, others[row.name])
        for row in system.joints
        for side in "ab"
        if row.name in others and (row.name, side) in part.ports
    ]
    for wrench in exerted:
        if wrench is not None:
            total = add_wrenches(total, wrench)
    f, m = carried(pose.inverse(), total)
    return part.sign * f, part.sign * m


def _on_joint(system: System, q: SX, row: JointRow, link: int, side: str, wrench: Wrench) -> Wrench:
    """What the body of frame_a or frame_b, `side`, exerts on a joint, in the frame of its link."""
    T = relative_pose(system.tree, q, (link, Pose.identity()), row.frame_b)
    sign = 1 if side == "a" else -1
    f, m = carried(T, wrench)
    return sign * f, sign * m


def _outside(system: System, part: WeldedPart, around: Surroundings) -> dict[int, Wrench]:
    """What the bodies of the part exert on their environment."""
    f_ext = dict(around.inputs).get("f_ext")
    if f_ext is None:
        return {}
    keep = SX([float((row.name, "") in part.ports) for row in system.bodies])
    return wrenches_on_links(system, casadi.mtimes(f_ext, casadi.diag(keep)))


def _spin(system: System, part: WeldedPart, v: SX, a: SX, motion: Acceleration) -> SX:
    """The moment (3, 1) that turns the spin of rotors on the part, in the frame of its link."""
    total = zeros()
    for link in system.tree.links:
        if link.rotor is not None and (link.name, "a") in part.ports:
            momentum = link.rotor.momentum
            total += momentum * a[link.v] + cross(motion.w, momentum * v[link.v])
    return total
