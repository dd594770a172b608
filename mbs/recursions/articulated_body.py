"""Accelerations of a tree in a number of operations linear in its links: articulated bodies.

An articulated body is a link with everything behind it, its joints free to move. Taken together
from the leaves to the base, their inertias solve A x = tau without the inertia matrix A.

Source: Featherstone 1983; Brandl, Johanni & Otter 1988; Khalil & Creusot 1997, section 5.4.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import casadi
from casadi import SX

from mbs.assembly.tree import Link, Tree
from mbs.components.motion import Motion
from mbs.recursions.accelerations import Acceleration, link_accelerations
from mbs.recursions.articulated_inertia import ArticulatedInertia, Pivot, RotorDrive
from mbs.recursions.newton_euler import inertial_wrench
from mbs.recursions.poses import LinkPose
from mbs.recursions.regrouping import regrouped
from mbs.recursions.rotors import rotor_efforts, rotor_moments
from mbs.recursions.sliding import slid
from mbs.spatial import (
    Displacement,
    Inertia,
    PseudoInertia,
    Wrench,
    body_through,
    cross,
    is_zero,
    wrench_through,
    zeros,
)

_DIRECTIONS = {
    Motion.REVOLUTE: (5,),
    Motion.PRISMATIC: (2,),
    Motion.SPHERICAL: (3, 4, 5),
    Motion.FREE: (0, 1, 2, 3, 4, 5),
}
"""Where each velocity of a motion stands in a twist [linear; angular] of frame j."""


@dataclass(frozen=True, slots=True, eq=False)
class JointElimination:
    """A joint taken out of the equations, in the frame where this is cheapest.

    Attributes:
        inner: displacements from that frame to the frame of the link.
        outer: displacements from the antecedent to it.
        pivots: in the order in which they were taken.
    """

    inner: tuple[Displacement, ...]
    outer: tuple[Displacement, ...]
    pivots: tuple[Pivot, ...]


def solve_inertia(tree: Tree, poses: list[LinkPose], right: SX) -> SX:
    """(nv, m) solution of A x = right, without the inertia matrix A.

    Args:
        tree: the links, rotors included.
        poses: each with respect to its antecedent.
        right: (nv, m) efforts.
    """
    poses, bodies = slid(tree, poses, [link.inertia for link in tree.links])
    eliminations = _eliminations(tree, poses, bodies)
    rest = [zeros(6)] * len(tree.links)
    columns = (_solution(tree, eliminations, rest, right[:, k]) for k in range(right.shape[1]))
    return casadi.horzcat(*columns) if right.shape[1] else SX(tree.nv, 0)


def articulated_accelerations(
    tree: Tree,
    poses: list[LinkPose],
    v: SX,
    efforts: SX,
    base: Acceleration,
    external: Mapping[int, Wrench],
) -> SX:
    """(nv, 1) joint accelerations that efforts produce, friction and springs left out.

    The links move with zero joint accelerations first; what the wrenches of this motion leave of
    the efforts accelerates the articulated bodies.

    Args:
        tree: the links, rotors included.
        poses: each with respect to its antecedent.
        v: (nv, 1) joint velocities.
        efforts: (nv, 1) without those of friction and springs.
        base: motion of the base; see `resting_base`.
        external: for some links the wrench that they exert on their environment.
    """
    inertias = [link.inertia for link in tree.links]
    if not external:
        poses, inertias = slid(tree, poses, inertias, base_rests=is_zero(base.w))
    bodies = [PseudoInertia.of(inertia) for inertia in inertias]
    still = SX.zeros(tree.nv)
    motions = link_accelerations(tree, poses, v, still, base)
    wrenches = [
        casadi.vertcat(*inertial_wrench(body, motion))
        for body, motion in zip(regrouped(tree, poses, bodies), motions, strict=True)
    ]
    for j, wrench in external.items():
        wrenches[j] += casadi.vertcat(*wrench)
    for carrier, moment in rotor_moments(tree, v, still, motions).items():
        wrenches[carrier] += casadi.vertcat(zeros(), moment)
    left = efforts - rotor_efforts(tree, still, motions, base)
    return _solution(tree, _eliminations(tree, poses, inertias), wrenches, left)


def inertia_pivots(tree: Tree, poses: list[LinkPose]) -> tuple[SX, SX]:
    """(nv, 1) inertia that each velocity moves: with those behind it free, and locked.

    Where the first is a vanishing part of the second, the inertia matrix is singular.
    """
    poses, bodies = slid(tree, poses, [link.inertia for link in tree.links])
    rigid = regrouped(tree, poses, bodies)
    free, locked = zeros(tree.nv), zeros(tree.nv)
    for link, elimination in zip(tree.links, _eliminations(tree, poses, bodies), strict=True):
        free[link.v] = casadi.vertcat(*(pivot.size for pivot in elimination.pivots))
    for j in reversed(range(len(tree.links))):
        link, body = tree.links[j], rigid[j]
        whole, drive = ArticulatedInertia.of(body), _drive(tree, poses, j)
        for number, direction in zip(_numbers(link), _DIRECTIONS[link.motion], strict=True):
            locked[number] = Pivot.of(whole, direction, drive).size
        if link.antecedent >= 0:
            rigid[link.antecedent] += body_through(poses[j].steps, body)
    return free, locked


def _numbers(link: Link) -> range:
    """Where the velocities of a link stand in v."""
    return range(link.v.start, link.v.stop)


def _eliminations(
    tree: Tree, poses: list[LinkPose], bodies: Sequence[Inertia]
) -> list[JointElimination]:
    """Every joint taken out, from the leaves to the base."""
    regroup = regrouped(tree, poses, list(bodies))
    articulated = [ArticulatedInertia.of(body) for body in regroup]
    leaves = set(range(len(tree.links))) - {link.antecedent for link in tree.links}
    result: list[JointElimination] = []
    for j in reversed(range(len(tree.links))):
        link, pose = tree.links[j], poses[j]
        inner: tuple[Displacement, ...] = ()
        outer, body = pose.steps, articulated[j]
        if j in leaves and link.motion.nv == 1:
            inner, outer = pose.motion, pose.seat
            body = ArticulatedInertia.of(pose.motion[0].body(regroup[j]))
        drive, pivots = _drive(tree, poses, j), list[Pivot]()
        if inner:
            drive = replace(drive, momentum=inner[0].turn.apply(drive.momentum))
        for direction in _DIRECTIONS[link.motion]:
            pivots.append(Pivot.of(body, direction, drive))
            body = body.without(pivots[-1])
        result.append(JointElimination(inner, outer, tuple(pivots)))
        if link.antecedent >= 0:
            articulated[link.antecedent] += body_through(outer, body)
    return result[::-1]


def _drive(tree: Tree, poses: list[LinkPose], j: int) -> RotorDrive:
    """What drives joint j, in the frame of its link."""
    link = tree.links[j]
    if link.rotor is None:
        return RotorDrive(link.Ia, zeros())
    on_link = link.rotor.carrier == j
    momentum = link.rotor.momentum if on_link else poses[j].apply_inverse(link.rotor.momentum)
    along = momentum[2] if link.motion is Motion.REVOLUTE else SX(0)
    inertia = link.Ia + link.rotor.seen_at_joint + (along if on_link else -along)
    return RotorDrive(inertia, momentum)


def _solution(
    tree: Tree, joints: list[JointElimination], wrenches: Sequence[SX], efforts: SX
) -> SX:
    """(nv, 1) accelerations; `wrenches` are those that the links need already."""
    needed, left = list(wrenches), zeros(tree.nv)
    for j in reversed(range(len(tree.links))):
        link, joint = tree.links[j], joints[j]
        wrench = _moved_wrench(joint.inner, needed[j])
        for number, pivot in zip(_numbers(link), joint.pivots, strict=True):
            wrench, left[number] = pivot.transmitted(wrench, efforts[number])
        if link.antecedent >= 0:
            needed[link.antecedent] += _moved_wrench(joint.outer, wrench)
    x, twists = zeros(tree.nv), [zeros(6)] * (len(tree.links) + 1)
    for j, link in enumerate(tree.links):
        twist = _moved_twist(joints[j].outer, twists[link.antecedent])
        for number, pivot in reversed(list(zip(_numbers(link), joints[j].pivots, strict=True))):
            twist, x[number] = pivot.accelerated(twist, left[number])
        twists[j] = _moved_twist(joints[j].inner, twist)
    return x


def _moved_wrench(steps: Sequence[Displacement], wrench: SX) -> SX:
    return casadi.vertcat(*wrench_through(steps, wrench[:3], wrench[3:]))


def _moved_twist(steps: Sequence[Displacement], twist: SX) -> SX:
    """A twist about the origin of the frame before the steps, about the origin behind them."""
    v, w = twist[:3], twist[3:]
    for step in steps:
        p = step.point(zeros())
        v, w = step.turn.apply_inverse(v + cross(w, p)), step.turn.apply_inverse(w)
    return casadi.vertcat(v, w)
