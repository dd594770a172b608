"""The unit motions of a joint and their rates, as seen by an observer at the joint.

A unit motion stays fixed in the link before the joint. Its first and second rates are what a
small displacement along it adds to the velocities and accelerations of everything behind it.

Source: Singh, Russell & Wensing 2022 (the vectors written there as Psi with one and two dots).
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi
from casadi import SX

from mbs.components.motion import Motion
from mbs.recursions.motion import unit_motions
from mbs.spatial import cross, vector, zeros


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

    def power(self, f: SX, m: SX) -> SX:
        """What a force f and a moment m about the same point do along the motion."""
        return casadi.dot(self.linear, f) + casadi.dot(self.angular, m)


@dataclass(frozen=True, slots=True, eq=False)
class Line:
    """One motion that a joint allows, about the origin of its axes.

    Attributes:
        unit: the motion for a unit velocity.
        spin: (3, 1) rate of its angular part, when it is fixed in the link before the joint.
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
    """Motion of the links around a joint, for an observer who moves with its origin.

    Attributes:
        v: (3, 1) velocity of the link before the joint [m/s].
        w: (3, 1) its angular velocity [rad/s].
        vd: (3, 1) its acceleration, minus gravity [m/s^2].
        wd: (3, 1) its angular acceleration [rad/s^2].
        w_behind: (3, 1) angular velocity of the link behind the joint.
    """

    v: SX
    w: SX
    vd: SX
    wd: SX
    w_behind: SX


def turning_line(dot: SX, ddot: SX, vd: SX) -> Line:
    """A turn about z.

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


def sliding_line(dot: SX, ddot: SX) -> Line:
    """A slide along z, for the rates of its direction."""
    return Line(
        unit=Twist(vector([0, 0, 1]), zeros()),
        spin=zeros(),
        second=Twist(ddot, zeros()),
        faster=Twist(2 * dot, zeros()),
    )


def free_lines(motion: Motion, seen: LineObserver) -> tuple[Line, ...]:
    """The unit motions of a joint with several velocities, fixed in the link behind it."""
    return tuple(_free_line(Twist(*unit), seen) for unit in unit_motions(motion))


def _free_line(unit: Twist, seen: LineObserver) -> Line:
    t, s = unit.linear, unit.angular
    t_dot, s_dot = cross(seen.w, t), cross(seen.w, s)
    rate = Twist(t_dot + cross(seen.v, s), s_dot)
    second = Twist(
        cross(seen.wd, t) + cross(seen.w, t_dot) + cross(seen.vd, s) + cross(2 * seen.v, s_dot),
        cross(seen.wd, s) + cross(seen.w, s_dot),
    )
    behind = Twist(cross(seen.w_behind, t), cross(seen.w_behind, s))
    return Line(unit, s_dot, second, rate + behind)
