"""What one joint changes of the wrench behind it, on its way to the joints before.

Source: Singh, Russell & Wensing 2022.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi
from casadi import SX

from mbs.assembly.tree import CarriedRotor
from mbs.recursions.joint_axes import Drift, JointAxes, Step
from mbs.recursions.joint_lines import Line
from mbs.recursions.subtree_motion import SubtreeMotion
from mbs.spatial import Rotation, Wrench, add_wrenches, cross


@dataclass(frozen=True, slots=True, eq=False)
class Couple:
    """What a rotor that spins with a joint takes of its carrier, (3, 1) each.

    Attributes:
        dv: moment for a unit velocity of the joint.
        da: for a unit acceleration.
    """

    dv: SX
    da: SX

    def turned(self, R: Rotation) -> Couple:
        """In the axes of frame i, R being the orientation of the present ones in i."""
        return Couple(R.apply(self.dv), R.apply(self.da))


@dataclass(frozen=True, slots=True, eq=False)
class EffortColumn:
    """How the wrench of a subtree changes with its joint, and its effort with other joints.

    Attributes:
        dq: change of the wrench with the position of the joint.
        dv: with its velocity.
        momentum: with its acceleration; its power with an acceleration of everything behind the
            joint is the effort that this takes.
        spin: (3, 1) times an angular velocity given to everything behind the joint: the effort.
    """

    dq: Wrench
    dv: Wrench
    momentum: Wrench
    spin: SX

    def through(self, step: Step) -> EffortColumn:
        """Seen from the other end of a step."""
        if isinstance(step, Drift):
            return self.drifting(step.twice)
        return EffortColumn(
            step.wrench(*self.dq),
            step.wrench(*self.dv),
            step.wrench(*self.momentum),
            step.turn.apply(self.spin),
        )

    def turned(self, R: Rotation) -> EffortColumn:
        """In the axes of frame i, R being the orientation of the present ones in i."""
        dq, dv, momentum = ((R.apply(f), R.apply(m)) for f, m in (self.dq, self.dv, self.momentum))
        return EffortColumn(dq, dv, momentum, R.apply(self.spin))

    def drifting(self, twice: SX) -> EffortColumn:
        """For an observer to whom everything has half of `twice` added to its velocity."""
        spin = self.spin + cross(twice, self.momentum[0])
        return EffortColumn(self.dq, self.dv, self.momentum, spin)

    def with_couple(self, couple: Couple) -> EffortColumn:
        """With couples that velocity and acceleration of the joint take besides."""
        (f_v, m_v), (f_a, m_a) = self.dv, self.momentum
        return EffortColumn(
            self.dq, (f_v, m_v + couple.dv), (f_a, m_a + couple.da), self.spin + couple.dv
        )

    def row(self, line: Line) -> tuple[SX, SX, SX]:
        """Effort of the column's joint for position, velocity and acceleration along a line."""
        return (
            line.second.power(*self.momentum) + casadi.dot(self.spin, line.spin),
            line.faster.power(*self.momentum) + casadi.dot(self.spin, line.unit.angular),
            line.unit.power(*self.momentum),
        )

    def efforts(self, line: Line) -> tuple[SX, SX, SX]:
        """Effort along a line for position, velocity and acceleration of the column's joint."""
        unit = line.unit
        return unit.power(*self.dq), unit.power(*self.dv), unit.power(*self.momentum)


def effort_column(subtree: SubtreeMotion, line: Line) -> EffortColumn:
    """What a joint changes that moves a subtree along a line, in the axes of both."""
    spinning = add_wrenches(subtree.wrench_of(line.second), subtree.wrench_of_spin(line.spin))
    return EffortColumn(
        dq=add_wrenches(spinning, subtree.wrench_of_displacement(line.unit)),
        dv=add_wrenches(subtree.wrench_of(line.faster), subtree.wrench_of_spin(line.unit.angular)),
        momentum=subtree.wrench_of(line.unit),
        spin=subtree.spin_of(line.unit),
    )


def rotor_couple(rotor: CarriedRotor, axes: JointAxes) -> Couple:
    """The couple of a rotor, in the axes of the joint of the link that carries it."""
    momentum = rotor.momentum if axes.turn is None else axes.turn.apply(rotor.momentum)
    return Couple(cross(axes.w, momentum), momentum)
