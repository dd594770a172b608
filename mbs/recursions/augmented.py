"""The augmented body of a link: everything behind its joint, and how it changes.

Source: Renaud 1986 (augmented bodies); Echeandia & Wensing 2021.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi
from casadi import SX

from mbs.assembly.tree import Link
from mbs.components.motion import Motion
from mbs.recursions.motion import effort
from mbs.recursions.rotors import momentum_on
from mbs.spatial import Displacement, PseudoInertia, cross, skew, zeros


@dataclass(frozen=True, slots=True, eq=False)
class VelocityField:
    """What the velocity field u of a unit joint velocity does, about an origin and in its axes.

    With r a particle seen from the origin and u its velocity:

    Attributes:
        f, m: (3, 1) integrals of u and r x u over the mass, the momenta.
        f_rate, m_rate: (3, 1) of du/dt and r x du/dt.
        drag: (3, 1) of dr/dt x u.
    """

    f: SX
    m: SX
    f_rate: SX
    m_rate: SX
    drag: SX

    @staticmethod
    def nothing() -> VelocityField:
        """The column of no mass."""
        return VelocityField(zeros(), zeros(), zeros(), zeros(), zeros())

    def __add__(self, other: VelocityField) -> VelocityField:
        """The column of two masses that move with the same velocity."""
        return VelocityField(
            self.f + other.f,
            self.m + other.m,
            self.f_rate + other.f_rate,
            self.m_rate + other.m_rate,
            self.drag + other.drag,
        )

    def through(self, step: Displacement, velocity: SX) -> VelocityField:
        """The column in the frame before a displacement whose translation has this velocity."""
        f, m = step.wrench(self.f, self.m)
        f_rate, m_rate = step.wrench(self.f_rate, self.m_rate)
        drag = step.turn.apply(self.drag) + cross(velocity, f)
        return VelocityField(f, m, f_rate, m_rate, drag)

    def row(self, motion: Motion, w: SX) -> SX:
        """Entries of B in the row of u for the velocities of a link that turns at w."""
        return effort(motion, cross(self.f, w), cross(self.m, w) + self.drag)


@dataclass(frozen=True, slots=True, eq=False)
class Augmented:
    """The mass behind a joint, about the origin of a frame and in its axes.

    Attributes:
        mass: its moments.
        rate: half the rate of these moments, seen from the frame.
        spin: (3, 1) half the angular momentum about the origin, seen from the frame.
    """

    mass: PseudoInertia
    rate: PseudoInertia
    spin: SX

    @staticmethod
    def of(body: PseudoInertia, spin: SX) -> Augmented:
        """A body at rest in the frame, with half the angular momentum of rotors in it."""
        return Augmented(body, PseudoInertia(zeros(3, 3), zeros(), SX(0)), spin)

    @staticmethod
    def nothing() -> Augmented:
        """No mass at all."""
        return Augmented.of(PseudoInertia(zeros(3, 3), zeros(), SX(0)), zeros())

    def __add__(self, other: Augmented) -> Augmented:
        """Two bodies in one frame."""
        return Augmented(self.mass + other.mass, self.rate + other.rate, self.spin + other.spin)

    def through(self, step: Displacement) -> Augmented:
        """The same mass about and in the frame before a displacement, which stands still."""
        _, spin = step.wrench(self.rate.ms, self.spin)
        return Augmented(step.body(self.mass), step.body(self.rate), spin)

    def moved(self, linear: SX, angular: SX) -> Augmented:
        """Seen from a frame in which this one moves, at twice these velocities (3, 1)."""
        S, ms, m = self.mass.S, self.mass.ms, self.mass.m
        flow = casadi.mtimes(linear, ms.T) + casadi.mtimes(skew(angular), S)
        rate = PseudoInertia(
            self.rate.S + flow + flow.T,
            self.rate.ms + m * linear + cross(angular, ms),
            SX(0),
        )
        spin = self.spin + cross(ms, linear) + _inertia_times(S, angular)
        return Augmented(self.mass, rate, spin)

    def column(self, w: SX, linear: SX, angular: SX) -> VelocityField:
        """The column of the velocity field linear + angular x r.

        Args:
            w: (3, 1) angular velocity of the frame.
            linear: (3, 1) velocity at the origin, fixed in the frame.
            angular: (3, 1) likewise.
        """
        S, ms = self.mass.S, self.mass.ms
        f = self.mass.m * linear + cross(angular, ms)
        change, twist = _inertia_times(self.rate.S, angular), cross(angular, self.spin)
        flow = cross(w, ms) + 2 * self.rate.ms
        return VelocityField(
            f=f,
            m=cross(ms, linear) + _inertia_times(S, angular),
            f_rate=cross(w, f) + 2 * cross(angular, self.rate.ms),
            m_rate=cross(ms, cross(w, linear))
            - cross(angular, casadi.mtimes(S, w))
            + change
            + twist,
            drag=cross(flow, linear) + casadi.mtimes(S, cross(w, angular)) + change - twist,
        )


def rotor_column(link: Link, carrier: int, w: SX) -> VelocityField:
    """The column of the joint's velocity in the rotor that it spins on a carrier.

    Args:
        link: of the joint.
        carrier: number of the link; the column is zero where the rotor is on another one.
        w: (3, 1) angular velocity of the carrier.
    """
    momentum = momentum_on(link, carrier)
    half_turn = 0.5 * cross(w, momentum)
    return VelocityField(zeros(), momentum, zeros(), half_turn, half_turn)


def _inertia_times(S: SX, a: SX) -> SX:
    """J a of the inertia tensor J = tr(S) - S, without the squares that cancel."""
    rows = []
    for k in range(3):
        m, n = (k + 1) % 3, (k + 2) % 3
        rows.append(S[m, m] * a[k] + S[n, n] * a[k] - S[k, m] * a[m] - S[k, n] * a[n])
    return casadi.vertcat(*rows)
