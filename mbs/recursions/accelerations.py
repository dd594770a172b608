"""Accelerations of the links, each in its own frame.

Source: Khalil & Creusot 1997, eq. 6 and 8-10.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi
from casadi import SX

from mbs.assembly.tree import Tree
from mbs.components.motion import Motion
from mbs.recursions.motion import relative_motion
from mbs.recursions.poses import LinkPose
from mbs.recursions.rotation_rate import RotationRate, rotation_rate
from mbs.spatial import Screw, cross, vector, zeros


@dataclass(frozen=True, slots=True, eq=False)
class Acceleration:
    """What the equations of a link need of its motion.

    Attributes:
        w: (3, 1) angular velocity in frame j [rad/s].
        wd: (3, 1) angular acceleration in frame j [rad/s^2].
        rate: of rotation, in frame j.
        vd: (3, 1) acceleration of the origin of frame j, minus gravity, in frame j [m/s^2].
    """

    w: SX
    wd: SX
    rate: RotationRate
    vd: SX


def resting_base(gravity: SX) -> Acceleration:
    """A base at rest; gravity, (3, 1) in its frame, enters as an upward acceleration."""
    return moving_base(zeros(), zeros(), -gravity)


def moving_base(w: SX, wd: SX, vd: SX) -> Acceleration:
    """A base with a given motion, all (3, 1) in its frame; vd is minus gravity."""
    return Acceleration(w, wd, rotation_rate(w, wd), vd)


def link_accelerations(
    tree: Tree, poses: list[LinkPose], v: SX, a: SX, base: Acceleration
) -> list[Acceleration]:
    """Acceleration of every link.

    Args:
        tree: the links.
        poses: each with respect to its antecedent.
        v: (nv, 1) joint velocities.
        a: (nv, 1) joint accelerations.
        base: motion of the base; see `resting_base`.
    """
    result: list[Acceleration] = []
    for j, link in enumerate(tree.links):
        pose = poses[j]
        before = result[link.antecedent] if link.antecedent >= 0 else base
        linear, angular = relative_motion(link.motion, v[link.v])
        linear_rate, _ = relative_motion(link.motion, a[link.v])
        w, wd, rate = _rotation(tree, poses, j, v, a, [*result, base])
        vd = _moved(pose, before, rate.U) + linear_rate
        vd += cross(2 * pose.apply_inverse(before.w) + angular, linear)
        result.append(Acceleration(w, wd, rate, vd))
    return result


def _rotation(
    tree: Tree, poses: list[LinkPose], j: int, v: SX, a: SX, motions: list[Acceleration]
) -> tuple[SX, SX, RotationRate]:
    """w, wd and U of link j; `motions` are those of the links before it and, last, of the base."""
    link, pose = tree.links[j], poses[j]
    before = motions[link.antecedent]
    if link.motion.nv > 1:
        _, angular = relative_motion(link.motion, v[link.v])
        _, angular_rate = relative_motion(link.motion, a[link.v])
        w_i = pose.apply_inverse(before.w)
        w = w_i + angular
        wd = pose.apply_inverse(before.wd) + angular_rate + cross(w_i, angular)
        return w, wd, rotation_rate(w, wd)
    run = _run(tree, poses, j, motions)
    first = poses[run[0]]
    root = motions[tree.links[run[0]].antecedent]
    w_seat, wd_seat = first.at_seat(root.w), first.at_seat(root.wd)
    turn = pose.spin if len(run) > 1 else pose.motion[0].turn
    speed, acceleration = SX(0), SX(0)
    if link.motion is Motion.REVOLUTE:
        for k in run:
            speed, acceleration = speed + v[tree.links[k].v], acceleration + a[tree.links[k].v]
    w = turn.apply_inverse(w_seat) + vector([0, 0, speed])
    carried = turn.apply_inverse(wd_seat)
    wd = carried + vector([w[1] * speed, -w[0] * speed, acceleration])
    still = carried if w_seat[2].is_zero() else None
    return w, wd, rotation_rate(w, wd, _square_across(before, pose), still)


def _run(tree: Tree, poses: list[LinkPose], j: int, motions: list[Acceleration]) -> tuple[int, ...]:
    """The joints that turn the angular velocity of link j.

    Those of a run of parallel axes turn it once, by the sum of their angles, where it has a zero
    before the first of them: the zero would be lost from joint to joint.
    """
    run = poses[j].run
    w = poses[run[0]].at_seat(motions[tree.links[run[0]].antecedent].w)
    return run if w[0].is_zero() or w[1].is_zero() else (j,)


def _square_across(before: Acceleration, pose: LinkPose) -> SX | None:
    """The square of the angular velocity across axis j, where an entry of U_i already holds it.

    It is the same for both links of the joint. When the axis is coordinate axis k of frame i,
    it is -U_i[k, k].
    """
    axis = vector([0, 0, 1])
    for step in reversed(pose.seat):
        axis = step.turn.apply(axis)
    for k in range(3):
        if axis[(k + 1) % 3].is_zero() and axis[(k + 2) % 3].is_zero():
            return SX(-before.rate.U[k, k])
    return None


def _moved(pose: LinkPose, before: Acceleration, U: SX) -> SX:
    """Acceleration of the point of link i at the origin of frame j, in frame j.

    A point on the axis of a joint is a point of both links: its distance r from the foot of the
    axis may be multiplied by U_j instead of U_i, whichever has fewer entries.
    """
    screw, U_i = pose.motion[0], before.rate.U
    if isinstance(screw, Screw):
        slide = pose.p - pose.foot
        if _products(U_i, slide) > _products(U, vector([0, 0, screw.t])):
            carried = pose.apply_inverse(before.vd + casadi.mtimes(U_i, pose.foot))
            return carried + screw.t * U[:, 2]
    return pose.apply_inverse(before.vd + casadi.mtimes(U_i, pose.p))


def _products(U: SX, p: SX) -> int:
    """How many multiplications U p takes."""
    moved = [k for k in range(3) if not p[k].is_zero()]
    return sum(not U[row, k].is_zero() for row in range(3) for k in moved)
