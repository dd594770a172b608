"""Unit motions of joints and their rates, in joint axes that need few operations.

The joint axes have their origin at the origin of link j but do not rotate with joint j, so that
quantities of the joint need no rotation about its own axis. Successive joints with parallel axes
have parallel joint axes. The transform between them is a translation.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi
from casadi import SX

from mbs.assembly.tree import Link, Tree
from mbs.components.joints import Motion
from mbs.recursions.link_motions import Acceleration, LinkPose, motion_behind, unit_motions
from mbs.spatial import Displacement, Rotation, ScrewDisplacement, cross, is_zero, vector, zeros

# Unit motions of a joint and their rates, relative to an observer at the joint.
#
# The unit motions of a joint are constant in the axes of its carrier: the link after the joint or,
# for a backward joint, the link before it. A small displacement along a unit motion changes the
# velocities and accelerations of all descendants, expressed in their own frames, by the first and
# second rate of the unit motion that is fixed in the link that is not the carrier.
#
# Source: Singh, Russell & Wensing 2022 (the vectors written there as Psi with one and two dots).


@dataclass(frozen=True, slots=True, eq=False)
class Twist:
    """Spatial velocity about a point, or a derivative of it: linear and angular part (3, 1)."""

    linear: SX
    angular: SX

    def __add__(self, other: Twist) -> Twist:
        """Add a motion about the same point."""
        return Twist(self.linear + other.linear, self.angular + other.angular)

    def displaced(self, R: SX, p: SX) -> Twist:
        """Transform to the origin and axes of a frame i.

        Args:
            R: (3, 3) orientation of the current axes relative to i.
            p: (3, 1) current origin in i [m].
        """
        angular = casadi.mtimes(R, self.angular)
        return Twist(casadi.mtimes(R, self.linear) + cross(p, angular), angular)

    def rate_on(self, carrier: Twist) -> Twist:
        """Return the rate of this motion if it is fixed on a body that moves.

        Args:
            carrier: velocity of the body, about the same point.
        """
        turning = cross(carrier.angular, self.linear) + cross(carrier.linear, self.angular)
        return Twist(turning, cross(carrier.angular, self.angular))

    def power(self, f: SX, m: SX) -> SX:
        """Return the power of a force and a moment along this motion.

        Args:
            f: (3, 1) force.
            m: (3, 1) moment about the point of this motion.
        """
        return casadi.dot(self.linear, f) + casadi.dot(self.angular, m)


@dataclass(frozen=True, slots=True, eq=False)
class Line:
    """Unit motion of a joint velocity and its rates, about the origin of the joint axes.

    Attributes:
        unit: motion for a unit velocity.
        spin: (3, 1) rate of the angular part of `unit`, if fixed in the link that is not the
            carrier.
        second: second rate of `unit`, if fixed in the link that is not the carrier.
        faster: derivative of the acceleration with respect to the joint velocity: sum of the rates
            of `unit` if fixed in the link before the joint and if fixed in the link after it.
    """

    unit: Twist
    spin: SX
    second: Twist
    faster: Twist

    def drifting(self, twice: SX) -> Line:
        """Transform to an observer that moves differently, in place of the present observer.

        Args:
            twice: (3, 1) twice the velocity by which all velocities become larger [m/s].
        """
        second = Twist(self.second.linear + cross(twice, self.spin), self.second.angular)
        linear = self.faster.linear + cross(twice, self.unit.angular)
        return Line(self.unit, self.spin, second, Twist(linear, self.faster.angular))

    def displaced(self, R: SX, p: SX) -> Line:
        """Transform to the origin and axes of a frame i.

        Args:
            R: (3, 3) orientation of the current axes relative to i.
            p: (3, 1) current origin in i [m].
        """
        twists = (twist.displaced(R, p) for twist in (self.unit, self.second, self.faster))
        unit, second, faster = twists
        return Line(unit, casadi.mtimes(R, self.spin), second, faster)


@dataclass(frozen=True, slots=True, eq=False)
class LineObserver:
    """Motion of the two links of a joint, for an observer that moves with the origin of frame j.

    Attributes:
        v: (3, 1) velocity of the link that is not the carrier [m/s].
        w: (3, 1) angular velocity of this link [rad/s].
        vd: (3, 1) acceleration of this link, minus gravity [m/s^2].
        wd: (3, 1) angular acceleration of this link [rad/s^2].
        v_carrier: (3, 1) velocity of the carrier [m/s].
        w_carrier: (3, 1) angular velocity of the carrier [rad/s].
    """

    v: SX
    w: SX
    vd: SX
    wd: SX
    v_carrier: SX
    w_carrier: SX


def revolute_line(dot: SX, ddot: SX, vd: SX) -> Line:
    """Return the unit motion of a revolute joint about z, and its rates.

    Args:
        dot: (3, 1) rate of the direction of the axis [rad/s].
        ddot: (3, 1) second rate of the direction of the axis [rad/s^2].
        vd: (3, 1) acceleration of the origin, which is on the axis [m/s^2].
    """
    return Line(
        unit=Twist(zeros(), vector([0, 0, 1])),
        spin=dot,
        second=Twist(vector([vd[1], -vd[0], 0]), ddot),
        faster=Twist(zeros(), 2 * dot),
    )


def prismatic_line(dot: SX, ddot: SX) -> Line:
    """Return the unit motion of a prismatic joint along z, and its rates.

    Args:
        dot: (3, 1) rate of the direction of the axis [rad/s].
        ddot: (3, 1) second rate of the direction of the axis [rad/s^2].
    """
    return Line(
        unit=Twist(vector([0, 0, 1]), zeros()),
        spin=zeros(),
        second=Twist(ddot, zeros()),
        faster=Twist(2 * dot, zeros()),
    )


def free_lines(link: Link, pose: LinkPose, seen: LineObserver) -> tuple[Line, ...]:
    """Return the unit motions of a joint with several velocities, and their rates.

    Args:
        link: link after the joint.
        pose: pose of the link relative to its antecedent.
        seen: motion of the two links of the joint.
    """
    return tuple(_free_line(Twist(*unit), seen) for unit in unit_motions(link, pose))


def _free_line(unit: Twist, seen: LineObserver) -> Line:
    """Return the line of a joint with several velocities from its unit motion `unit`.

    `seen` is the motion of the two links of the joint.
    """
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
class MovingFrame:
    """Change of observer between two points of the links; an observer moves with its point.

    Attributes:
        twice: (3, 1) twice the velocity of the old point relative to the new point [m/s].
    """

    twice: SX


AxesStep = Displacement | MovingFrame
"""Element of the path from the axes of a joint to the axes or frame of its antecedent."""


@dataclass(frozen=True, slots=True, eq=False)
class JointAxes:
    """Axes of joint j at the origin of link j.

    Attributes:
        rotation: rotation from the frame of link j to the joint axes. None if both are the same.
        path: displacements and changes of observer from the joint axes to the joint axes of the
            antecedent if `parallel`, else to the frame of the antecedent.
        parallel: Whether the joint axes of the antecedent are parallel to the axes of joint j.
        lines: unit motions of the joint and their rates, in the joint axes.
        w: (3, 1) angular velocity of link j, in the joint axes [rad/s].
    """

    rotation: Rotation | None
    path: tuple[AxesStep, ...]
    parallel: bool
    lines: tuple[Line, ...]
    w: SX


def joint_axes(
    tree: Tree, poses: list[LinkPose], v: SX, motions: list[Acceleration], base: Acceleration
) -> list[JointAxes]:
    """Return the axes, unit motions and rates of every joint.

    Args:
        tree: the links.
        poses: pose of each link relative to its antecedent.
        v: (nv, 1) joint velocities.
        motions: velocities and accelerations of the links, see `link_accelerations`.
        base: motion of the base.
    """
    result: list[JointAxes] = []
    for j, link in enumerate(tree.links):
        i = link.antecedent
        before = motions[i] if i >= 0 else base
        if link.motion.nv > 1:
            axes = _link_frame_axes(link, poses[j], before, motions[j], v[link.v])
        elif len(poses[j].run) > 1:
            axes = _parallel_axes(poses[j], poses[i].spin, result[i], motions[j])
        else:
            axes = _single_axis(link, poses[j], before, motions[j], v[link.v])
        result.append(axes)
    return result


def _link_frame_axes(
    link: Link, pose: LinkPose, before: Acceleration, own: Acceleration, v: SX
) -> JointAxes:
    """Return the joint axes of a joint with several velocities: the axes of the link frame.

    Args:
        link: link after the joint.
        pose: pose of the link relative to its antecedent.
        before: motion of the antecedent.
        own: motion of the link.
        v: joint velocities.
    """
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


def _single_axis(
    link: Link, pose: LinkPose, before: Acceleration, own: Acceleration, v: SX
) -> JointAxes:
    """Return the axes of a joint with one velocity: its frame on the antecedent, shifted along z.

    Args:
        link: link after the joint.
        pose: pose of the link relative to its antecedent.
        before: motion of the antecedent.
        own: motion of the link.
        v: (1, 1) joint velocity.
    """
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


def _parallel_axes(
    pose: LinkPose, rotation: Rotation, axes: JointAxes, own: Acceleration
) -> JointAxes:
    """Return joint axes parallel to those of the antecedent, for a joint with a parallel axis.

    Args:
        pose: pose of the link relative to its antecedent.
        rotation: rotation from the frame of the antecedent to its joint axes.
        axes: joint axes of the antecedent.
        own: motion of the link.
    """
    p = rotation.apply(pose.p)
    shift = tuple(ScrewDisplacement.about(axis, SX(0), p[k]) for k, axis in enumerate("xyz"))
    path: tuple[AxesStep, ...] = (*shift, *_drift(cross(axes.w, p)))
    before = axes.lines[0]
    line = revolute_line(before.spin, before.second.angular, pose.spin.apply(own.vd))
    w = vector([axes.w[0], axes.w[1], own.w[2]])
    return JointAxes(pose.spin, path, True, (line,), w)


def _drift(velocity: SX) -> tuple[MovingFrame, ...]:
    """Return the change of observer for a relative velocity (3, 1); () if it is zero."""
    return () if is_zero(velocity) else (MovingFrame(2 * velocity),)
