"""What a joint must know of everything behind it: inertia, its rate, and the wrench it takes.

Source: Khalil, Bennis & Gautier 1990 (composite links); Singh, Russell & Wensing 2022 (their
composite matrix B, of which twelve numbers are left for an observer at rest or in steady motion).
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi
from casadi import SX

from mbs.assembly.tree import Tree
from mbs.recursions.accelerations import Acceleration
from mbs.recursions.joint_axes import Drift, JointAxes, Step
from mbs.recursions.joint_lines import Twist
from mbs.recursions.newton_euler import inertial_wrench
from mbs.spatial import Inertia, PseudoInertia, Rotation, Wrench, cross, skew, zeros


@dataclass(frozen=True, slots=True, eq=False)
class SubtreeMotion:
    """Links that move together, about a point and for an observer who moves with it.

    With r and r_dot the place and velocity of an element of mass dm, N = integral of r_dot r' dm.

    Attributes:
        body: their inertia.
        K: (3, 3) 2 (tr(N) - N): times an angular velocity, the moment that it adds to bodies
            that move [kg m^2/s].
        n: (3, 1) twice their linear momentum [kg m/s].
        f: (3, 1) force that they take [N].
        m: (3, 1) moment that they take [N m].
    """

    body: Inertia
    K: SX
    n: SX
    f: SX
    m: SX

    @staticmethod
    def zero() -> SubtreeMotion:
        """No link at all."""
        return SubtreeMotion(Inertia.zero(), zeros(3, 3), zeros(), zeros(), zeros())

    @staticmethod
    def of_link(pseudo: PseudoInertia, motion: Acceleration, spin: SX, moment: SX) -> SubtreeMotion:
        """One link, for an observer at the origin of its frame.

        Args:
            pseudo: of the link, about and in its frame.
            motion: of the link.
            spin: (3, 1) angular momentum of rotors on the link, seen from it, in its frame.
            moment: (3, 1) moment that their spin takes.
        """
        twice = 2 * motion.w
        f, m = inertial_wrench(pseudo, motion)
        return SubtreeMotion(
            pseudo.inertia(),
            -casadi.mtimes(skew(twice), pseudo.S) - skew(spin),
            cross(twice, pseudo.ms),
            f,
            m + moment,
        )

    def __add__(self, other: SubtreeMotion) -> SubtreeMotion:
        """Both, about the same point."""
        return SubtreeMotion(
            self.body + other.body,
            self.K + other.K,
            self.n + other.n,
            self.f + other.f,
            self.m + other.m,
        )

    def turned(self, R: Rotation) -> SubtreeMotion:
        """In the axes of frame i, R being the orientation of the present ones in i."""
        f, m = R.apply(self.f), R.apply(self.m)
        return SubtreeMotion(self.body.turned(R), R.apply_to_square(self.K), R.apply(self.n), f, m)

    def slid(self, axis: int, t: SX) -> SubtreeMotion:
        """Displaced by t [m] along a coordinate axis."""
        if t.is_zero():
            return self
        K, m = SX(self.K), SX(self.m)
        k, h = (axis + 1) % 3, (axis + 2) % 3
        across = t * self.n[axis]
        for row in (k, h):
            K[row, row] += across
            K[row, axis] -= t * self.n[row]
        m[k] -= t * self.f[h]
        m[h] += t * self.f[k]
        return SubtreeMotion(self.body.slid(axis, t), K, self.n, self.f, m)

    def drifting(self, twice: SX) -> SubtreeMotion:
        """For an observer to whom everything has half of `twice` added to its velocity."""
        ms, K = self.body.ms, SX(self.K)
        for k in range(3):
            for h in {0, 1, 2} - {k}:
                K[k, k] += twice[h] * ms[h]
                K[k, h] -= twice[k] * ms[h]
        return SubtreeMotion(self.body, K, self.n + self.body.m * twice, self.f, self.m)

    def through(self, step: Step) -> SubtreeMotion:
        """Seen from the other end of a step."""
        if isinstance(step, Drift):
            return self.drifting(step.twice)
        return step.body(self)

    def wrench_of(self, twist: Twist) -> Wrench:
        """Momentum for a velocity; force and moment for an acceleration."""
        return self.body.momentum(twist.linear, twist.angular)

    def wrench_of_spin(self, s: SX) -> Wrench:
        """What an angular velocity added to all of them adds to the wrench."""
        return cross(s, self.n), casadi.mtimes(self.K, s)

    def wrench_of_displacement(self, unit: Twist) -> Wrench:
        """What a displacement changes of the wrench that goes with it."""
        t, s = unit.linear, unit.angular
        return cross(s, self.f), cross(s, self.m) + cross(t, self.f)

    def spin_of(self, unit: Twist) -> SX:
        """(3, 1) times an angular velocity: the effort that it adds along a unit motion."""
        return casadi.mtimes(self.K.T, unit.angular) + cross(self.n, unit.linear)


def subtree_motions(
    tree: Tree, axes: list[JointAxes], own: list[SubtreeMotion]
) -> list[SubtreeMotion]:
    """Everything behind each joint, in its axes.

    Args:
        tree: the links.
        axes: of the joints.
        own: of each link alone, in its frame.
    """
    in_frame, parallel = list(own), [SubtreeMotion.zero()] * len(own)
    result = list(own)
    for j in reversed(range(len(own))):
        turn, i = axes[j].turn, tree.links[j].antecedent
        here = in_frame[j] if turn is None else in_frame[j].turned(turn)
        here = result[j] = here + parallel[j]
        if i < 0:
            continue
        for step in axes[j].way:
            here = here.through(step)
        if axes[j].joined:
            parallel[i] += here
        else:
            in_frame[i] += here
    return result
