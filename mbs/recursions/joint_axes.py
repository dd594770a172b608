"""Axes in which a joint is simple, and the way from them to those of the joint before.

They stand at the origin of link j and do not turn with joint j: what is computed there for the
joint needs no turn about its own axis. Joints with parallel axes, one after the other, have the
same axes, so that the way between them is a translation.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi
from casadi import SX

from mbs.assembly.tree import Link, Tree
from mbs.components.motion import Motion
from mbs.recursions.accelerations import Acceleration
from mbs.recursions.joint_lines import (
    Line,
    LineObserver,
    free_lines,
    sliding_line,
    turning_line,
)
from mbs.recursions.motion import relative_motion
from mbs.recursions.poses import LinkPose
from mbs.spatial import Displacement, Rotation, Screw, cross, is_zero, vector


@dataclass(frozen=True, slots=True)
class Drift:
    """A change of observer, who moves with the velocity of a point of the links.

    Attributes:
        twice: (3, 1) twice the velocity of the point left relative to the point reached [m/s].
    """

    twice: SX


Step = Displacement | Drift
"""An element of the way from the axes of one joint to those of the joint before."""


@dataclass(frozen=True, slots=True, eq=False)
class JointAxes:
    """The axes of joint j at the origin of link j.

    Attributes:
        turn: from the frame of link j to the axes; None when they are the same.
        way: from the axes to those of the antecedent, when `joined`, else to its frame.
        joined: whether the axes of the antecedent are parallel to these.
        lines: the motions that the joint allows, in these axes.
        w: (3, 1) angular velocity of link j, in these axes.
    """

    turn: Rotation | None
    way: tuple[Step, ...]
    joined: bool
    lines: tuple[Line, ...]
    w: SX


def joint_axes(
    tree: Tree, poses: list[LinkPose], v: SX, motions: list[Acceleration], base: Acceleration
) -> list[JointAxes]:
    """The axes of every joint.

    Args:
        tree: the links.
        poses: each with respect to its antecedent.
        v: (nv, 1) joint velocities.
        motions: of the links; see `link_accelerations`.
        base: motion of the base.
    """
    result: list[JointAxes] = []
    for j, link in enumerate(tree.links):
        i = link.antecedent
        before = motions[i] if i >= 0 else base
        if link.motion.nv > 1:
            axes = _of_several(link, poses[j], before, motions[j], v[link.v])
        elif len(poses[j].run) > 1:
            axes = _continued(poses[j], poses[i].spin, result[i], motions[j])
        else:
            axes = _of_one(link, poses[j], before, motions[j], v[link.v])
        result.append(axes)
    return result


def _of_several(
    link: Link, pose: LinkPose, before: Acceleration, own: Acceleration, v: SX
) -> JointAxes:
    """The frame of the link itself, for joints of several velocities."""
    linear, angular = relative_motion(link.motion, v)
    way: tuple[Step, ...] = (
        *_drift(linear),
        *reversed(pose.steps),
        *_drift(cross(before.w, pose.p)),
    )
    vd = pose.apply_inverse(before.vd + casadi.mtimes(before.rate.U, pose.p))
    seen = LineObserver(-linear, own.w - angular, vd, pose.apply_inverse(before.wd), own.w)
    return JointAxes(None, way, False, free_lines(link.motion, seen), own.w)


def _of_one(
    link: Link, pose: LinkPose, before: Acceleration, own: Acceleration, v: SX
) -> JointAxes:
    """The seat of the joint, moved along the axis."""
    w, wd = pose.at_seat(before.w), pose.at_seat(before.wd)
    dot = vector([w[1], -w[0], 0])
    ddot = vector([wd[1] + w[0] * w[2], w[1] * w[2] - wd[0], own.rate.U[2, 2]])
    screw = pose.motion[0]
    assert isinstance(screw, Screw)
    linear, _ = relative_motion(link.motion, v)
    slide = Screw.about("z", SX(0), screw.t)
    way: tuple[Step, ...] = (
        *_drift(linear),
        slide,
        *reversed(pose.seat),
        *_drift(cross(before.w, pose.p)),
    )
    if link.motion is Motion.PRISMATIC:
        line = sliding_line(dot, ddot)
    else:
        vd = pose.at_seat(before.vd + casadi.mtimes(before.rate.U, pose.p))
        line = turning_line(dot, ddot, vd)
    return JointAxes(pose.spin, way, False, (line,), vector([w[0], w[1], own.w[2]]))


def _continued(pose: LinkPose, turn: Rotation, axes: JointAxes, own: Acceleration) -> JointAxes:
    """The axes of the joint before, at another point; `turn` leads to them from its frame."""
    p = turn.apply(pose.p)
    shift = tuple(Screw.about(axis, SX(0), p[k]) for k, axis in enumerate("xyz"))
    way: tuple[Step, ...] = (*shift, *_drift(cross(axes.w, p)))
    before = axes.lines[0]
    line = turning_line(before.spin, before.second.angular, pose.spin.apply(own.vd))
    w = vector([axes.w[0], axes.w[1], own.w[2]])
    return JointAxes(pose.spin, way, True, (line,), w)


def _drift(velocity: SX) -> tuple[Drift, ...]:
    return () if is_zero(velocity) else (Drift(2 * velocity),)
