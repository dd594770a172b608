"""Axes in which a joint is simple: its unit motions and their rates there.

They stand at the origin of link j and do not turn with joint j: what is computed there for the
joint needs no rotation about its own axis. Joints with parallel axes, one after the other, have the
same axes, so that what is between them is a translation.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi
from casadi import SX

from mbs.assembly.tree import Link, Tree
from mbs.components.joints import Motion
from mbs.recursions.poses import LinkPose
from mbs.recursions.velocities import Acceleration, motion_behind, unit_motions
from mbs.spatial import Displacement, Rotation, ScrewDisplacement, cross, is_zero, vector, zeros

# The unit motions of a joint and their rates, as seen by an observer at the joint.
#
# The unit motions of a joint are fixed in one of its two links, the carrier: in the link behind
# the joint, or, of a backward joint, in the link before it. A small displacement along a unit
# motion adds to the velocities and accelerations of everything behind the joint, as these see it,
# the first and second rate of the unit motion where it is fixed in the other link.
#
# Source: Singh, Russell & Wensing 2022 (the vectors written there as Psi with one and two dots).


@dataclass(frozen=True, slots=True, eq=False)
class Twist:
    """A motion about a point: linear and angular part, (3, 1) each."""

    linear: SX
    angular: SX

    def __add__(self, other: Twist) -> Twist:
        """The sum of two motions about the same point."""
        return Twist(self.linear + other.linear, self.angular + other.angular)

    def displaced(self, R: SX, p: SX) -> Twist:
        """About the origin of a frame in which the present axes stand at p, turned by R."""
        angular = casadi.mtimes(R, self.angular)
        return Twist(casadi.mtimes(R, self.linear) + cross(p, angular), angular)

    def rate_on(self, carrier: Twist) -> Twist:
        """Its rate where it is fixed on what moves with the velocity of the carrier."""
        turning = cross(carrier.angular, self.linear) + cross(carrier.linear, self.angular)
        return Twist(turning, cross(carrier.angular, self.angular))

    def power(self, f: SX, m: SX) -> SX:
        """What a force f and a moment m about the same point do along the motion."""
        return casadi.dot(self.linear, f) + casadi.dot(self.angular, m)


@dataclass(frozen=True, slots=True, eq=False)
class Line:
    """One motion that a joint allows, about the origin of its axes.

    Attributes:
        unit: the motion for a unit velocity.
        spin: (3, 1) rate of its angular part, when it is fixed in the link that is not its
            carrier.
        second: its second rate, fixed in the same link.
        faster: its rate fixed in the link before the joint, and fixed in the link behind it,
            added: what a unit of velocity adds to the accelerations.
    """

    unit: Twist
    spin: SX
    second: Twist
    faster: Twist

    def drifting(self, twice: SX) -> Line:
        """For an observer to whom everything has half of `twice` added to its velocity."""
        second = Twist(self.second.linear + cross(twice, self.spin), self.second.angular)
        linear = self.faster.linear + cross(twice, self.unit.angular)
        return Line(self.unit, self.spin, second, Twist(linear, self.faster.angular))

    def displaced(self, R: SX, p: SX) -> Line:
        """About the origin of a frame in which the present axes stand at p, turned by R."""
        twists = (twist.displaced(R, p) for twist in (self.unit, self.second, self.faster))
        unit, second, faster = twists
        return Line(unit, casadi.mtimes(R, self.spin), second, faster)


@dataclass(frozen=True, slots=True, eq=False)
class LineObserver:
    """Motion of the links of a joint, for an observer who moves with the origin of frame j.

    Attributes:
        v: (3, 1) velocity of the link that is not the carrier [m/s].
        w: (3, 1) its angular velocity [rad/s].
        vd: (3, 1) its acceleration, minus gravity [m/s^2].
        wd: (3, 1) its angular acceleration [rad/s^2].
        v_carrier: (3, 1) velocity of the carrier [m/s].
        w_carrier: (3, 1) its angular velocity [rad/s].
    """

    v: SX
    w: SX
    vd: SX
    wd: SX
    v_carrier: SX
    w_carrier: SX


def revolute_line(dot: SX, ddot: SX, vd: SX) -> Line:
    """Of a revolute joint, about z.

    Args:
        dot: (3, 1) rate of the direction of the axis [rad/s].
        ddot: (3, 1) its second rate [rad/s^2].
        vd: (3, 1) acceleration of the origin, which is on the axis [m/s^2].
    """
    return Line(
        unit=Twist(zeros(), vector([0, 0, 1])),
        spin=dot,
        second=Twist(vector([vd[1], -vd[0], 0]), ddot),
        faster=Twist(zeros(), 2 * dot),
    )


def prismatic_line(dot: SX, ddot: SX) -> Line:
    """Of a prismatic joint along z, for the rates of its direction."""
    return Line(
        unit=Twist(vector([0, 0, 1]), zeros()),
        spin=zeros(),
        second=Twist(ddot, zeros()),
        faster=Twist(2 * dot, zeros()),
    )


def free_lines(link: Link, pose: LinkPose, seen: LineObserver) -> tuple[Line, ...]:
    """The unit motions of a joint with several velocities."""
    return tuple(_free_line(Twist(*unit), seen) for unit in unit_motions(link, pose))


def _free_line(unit: Twist, seen: LineObserver) -> Line:
    t, s = unit.linear, unit.angular
    t_dot, s_dot = cross(seen.w, t), cross(seen.w, s)
    rate = Twist(t_dot + cross(seen.v, s), s_dot)
    second = Twist(
        cross(seen.wd, t) + cross(seen.w, t_dot) + cross(seen.vd, s) + cross(2 * seen.v, s_dot),
        cross(seen.wd, s) + cross(seen.w, s_dot),
    )
    carried = Twist(cross(seen.w_carrier, t) + cross(seen.v_carrier, s), cross(seen.w_carrier, s))
    return Line(unit, s_dot, second, rate + carried)


@dataclass(frozen=True, slots=True)
class Drift:
    """A change of observer, who moves with the velocity of a point of the links.

    Attributes:
        twice: (3, 1) twice the velocity of the point left relative to the point reached [m/s].
    """

    twice: SX


AxesStep = Displacement | Drift
"""An element of the path from the axes of one joint to those of the joint before."""


@dataclass(frozen=True, slots=True, eq=False)
class JointAxes:
    """The axes of joint j at the origin of link j.

    Attributes:
        rotation: from the frame of link j to the axes; None when they are the same.
        path: from the axes to those of the antecedent, when `parallel`, else to its frame.
        parallel: whether the axes of the antecedent are parallel to these.
        lines: the motions that the joint allows, in these axes.
        w: (3, 1) angular velocity of link j, in these axes.
    """

    rotation: Rotation | None
    path: tuple[AxesStep, ...]
    parallel: bool
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
            axes = _continue(poses[j], poses[i].spin, result[i], motions[j])
        else:
            axes = _of_one(link, poses[j], before, motions[j], v[link.v])
        result.append(axes)
    return result


def _of_several(
    link: Link, pose: LinkPose, before: Acceleration, own: Acceleration, v: SX
) -> JointAxes:
    """The frame of the link itself, for joints of several velocities."""
    linear, angular = motion_behind(link, pose, v)
    path: tuple[AxesStep, ...] = (
        *_drift(linear),
        *reversed(pose.steps),
        *_drift(cross(before.w, pose.p)),
    )
    if link.backward:
        seen = LineObserver(zeros(), own.w, own.vd, own.wd, -linear, own.w - angular)
    else:
        vd = pose.apply_inverse(before.vd + casadi.mtimes(before.rate.U, pose.p))
        wd = pose.apply_inverse(before.wd)
        seen = LineObserver(-linear, own.w - angular, vd, wd, zeros(), own.w)
    return JointAxes(None, path, False, free_lines(link, pose, seen), own.w)


def _of_one(
    link: Link, pose: LinkPose, before: Acceleration, own: Acceleration, v: SX
) -> JointAxes:
    """The seat of the joint, moved along the axis."""
    w, wd = pose.at_seat(before.w), pose.at_seat(before.wd)
    dot = vector([w[1], -w[0], 0])
    ddot = vector([wd[1] + w[0] * w[2], w[1] * w[2] - wd[0], own.rate.U[2, 2]])
    screw = pose.motion[0]
    assert isinstance(screw, ScrewDisplacement)
    linear, _ = motion_behind(link, pose, v)
    height = ScrewDisplacement.about("z", SX(0), screw.t)
    path: tuple[AxesStep, ...] = (
        *_drift(linear),
        height,
        *reversed(pose.seat),
        *_drift(cross(before.w, pose.p)),
    )
    if link.motion is Motion.PRISMATIC:
        line = prismatic_line(dot, ddot)
    else:
        vd = pose.at_seat(before.vd + casadi.mtimes(before.rate.U, pose.p))
        line = revolute_line(dot, ddot, vd)
    return JointAxes(pose.spin, path, False, (line,), vector([w[0], w[1], own.w[2]]))


def _continue(pose: LinkPose, rotation: Rotation, axes: JointAxes, own: Acceleration) -> JointAxes:
    """The axes of the joint before, at another point; `rotation` leads to them from its frame."""
    p = rotation.apply(pose.p)
    shift = tuple(ScrewDisplacement.about(axis, SX(0), p[k]) for k, axis in enumerate("xyz"))
    path: tuple[AxesStep, ...] = (*shift, *_drift(cross(axes.w, p)))
    before = axes.lines[0]
    line = revolute_line(before.spin, before.second.angular, pose.spin.apply(own.vd))
    w = vector([axes.w[0], axes.w[1], own.w[2]])
    return JointAxes(pose.spin, path, True, (line,), w)


def _drift(velocity: SX) -> tuple[Drift, ...]:
    return () if is_zero(velocity) else (Drift(2 * velocity),)
