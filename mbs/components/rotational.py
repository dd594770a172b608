"""Parts of drive lines with losses, play, friction and several shafts.

Most laws are smooth: they have no modes and no events, so that every model has them. A smooth brake
creeps where a real one sticks, at a speed below the width of its law, and a smooth freewheel
rotates back by nothing but lets its shafts slip a little where it locks. Those that are rigid stick
and lock at events, in simulations and FMUs.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import casadi
from casadi import SX

from mbs.components import custom
from mbs.components.custom import Friction, Load, OneWay, Row, Stop
from mbs.components.drives import OneFlange, TwoFlanges
from mbs.components.forces import one_sided_damping, smooth_ramp, smooth_sign
from mbs.errors import DescriptionError
from mbs.expressions import to_float

_FLANK = 1e-3
"""Depth of a flank over which it becomes stiff [rad]: a twentieth of a degree, below usual play."""
_CREEP = 1e-3
"""Speed below which a brake counts as closed [rad/s], as of JointFriction: 2 pi in two hours."""
_REVERSAL = 1e-2
"""Speed over which losses of a gear change sign [rad/s]: 2 pi in ten minutes."""
_UNLOADED = 1e-2
"""Torque over which they do [N m]: that of a gear of a watch, or a hundredth of a small robot's."""

# What acts on shafts by one torque.


class _BetweenShafts(TwoFlanges):
    """What gives a torque from flange_a to flange_b."""

    torque = custom.output("N.m")

    def loads(self, at: Any) -> Mapping[str, Load]:
        """The torque, which b gets and a gives."""
        T = self._torque(at)
        return {"flange_a": -T, "flange_b": T}

    def outputs(self, at: Any) -> Mapping[str, SX]:
        """The torque from a to b."""
        return {"torque": self._torque(at)}

    def _torque(self, at: Any) -> SX:
        raise NotImplementedError

    def _slip(self, at: Any) -> SX:
        return SX(at.flange_a.speed - at.flange_b.speed)


class _SlippingShafts(_BetweenShafts):
    """What takes all the power of its torque."""

    def dissipation(self, at: Any) -> SX:
        """What slipping takes."""
        return SX(self._torque(at) * self._slip(at))


class _BrakingTorque(OneFlange):
    """What holds back one shaft by a torque, and takes all its power."""

    torque = custom.output("N.m")

    def loads(self, at: Any) -> Mapping[str, Load]:
        """Against the speed."""
        return {"flange": -self._torque(at)}

    def dissipation(self, at: Any) -> SX:
        """All its power."""
        return SX(self._torque(at) * at.flange.speed)

    def outputs(self, at: Any) -> Mapping[str, SX]:
        """What it takes from the shaft."""
        return {"torque": self._torque(at)}

    def _torque(self, at: Any) -> SX:
        raise NotImplementedError


# Springs and dampers between two shafts.


class ShaftSpringDamperSeries(_BetweenShafts):
    """A spring in series with a damper between two shafts, a Maxwell element.

    With the twist x = angle_a - angle_b and the state z, the part of it in the damper, the torque
    from a to b is T = stiffness (x - z), and damping dz/dt = T - parallel z. A constant twist
    relaxes within the time damping / (stiffness + parallel).

    Source: Haug 1989 for springs and dampers in shafts.

    Attributes:
        stiffness: of the spring [N m/rad].
        damping: of the damper [N m s/rad].
        parallel: stiffness of a spring parallel to the damper [N m/rad].
    """

    stiffness = custom.parameter("N.m/rad", positive=True)
    damping = custom.parameter("N.m.s/rad", positive=True)
    twist = custom.state("rad")
    parallel = custom.parameter("N.m/rad", 0.0, min=0)

    def rates(self, at: Any) -> Mapping[str, SX]:
        """Of the part of the twist that is in the damper."""
        return {"twist": self._damper_torque(at) / at.damping}

    def energy(self, at: Any) -> SX:
        """Energy in the springs."""
        return SX(0.5 * (at.stiffness * self._stretch(at) ** 2 + at.parallel * at.twist**2))

    def dissipation(self, at: Any) -> SX:
        """What the damper takes."""
        return SX(self._damper_torque(at) ** 2 / at.damping)

    def _damper_torque(self, at: Any) -> SX:
        """Torque less that of the parallel spring, from the balance between the springs."""
        return SX(self._torque(at) - at.parallel * at.twist)

    def _stretch(self, at: Any) -> SX:
        return SX(at.flange_a.angle - at.flange_b.angle - at.twist)

    def _torque(self, at: Any) -> SX:
        return SX(at.stiffness * self._stretch(at))


class ElastoBacklash(_BetweenShafts):
    """An elastic shaft with play: no torque within the backlash, a spring and a damper beyond it.

    With the twist x = angle_a - angle_b, the depth beyond the play is d = |x| - backlash / 2. The
    torque from a to b is sign(x) stiffness r(d) + damping s(d) dx/dt, with the ramp r and its
    slope s of a JointStop: over the first `width` beyond the play the stiffness grows from zero
    to its full value, so that the torque of the spring and two derivatives of it are continuous.
    The damper exerts at most as much as the spring, so that a tooth never holds a flank back.

    Source: Modelica Association 2023 for the element.

    Attributes:
        stiffness: [N m/rad].
        backlash: from flank to flank [rad].
        damping: while the flanks touch [N m s/rad].
        width: over which the stiffness grows [rad].
    """

    stiffness = custom.parameter("N.m/rad", positive=True)
    backlash = custom.parameter("rad", min=0)
    damping = custom.parameter("N.m.s/rad", 0.0, min=0)
    width = custom.parameter("rad", _FLANK, positive=True)

    def energy(self, at: Any) -> SX:
        """What the flanks store."""
        return SX(
            at.stiffness * sum((smooth_ramp(d, at.width)[2] for _, d in self._sides(at)), SX(0))
        )

    def dissipation(self, at: Any) -> SX:
        """What the damper takes."""
        return SX(self._torques(at)[1] * self._slip(at))

    def _torque(self, at: Any) -> SX:
        return sum(self._torques(at), SX(0))

    def _torques(self, at: Any) -> tuple[SX, SX]:
        """The torque of the spring, and that of the damper."""
        elastic, damped = SX(0), SX(0)
        for sign, depth in self._sides(at):
            slope, ramped, _ = smooth_ramp(depth, at.width)
            spring = at.stiffness * ramped
            elastic += sign * spring
            damped += one_sided_damping(at.damping * slope * self._slip(at), spring)
        return elastic, damped

    def _sides(self, at: Any) -> list[tuple[float, SX]]:
        """Direction and depth beyond the play of the two flanks."""
        x = at.flange_a.angle - at.flange_b.angle
        return [(1.0, x - at.backlash / 2), (-1.0, -x - at.backlash / 2)]


# Gears of three shafts, and gears with losses.


class PlanetaryGear(custom.Custom):
    """An ideal planetary gear: (1 + ratio) angle_carrier = angle_sun + ratio angle_ring.

    It is a row on the three shafts, exact in positions and velocities, without inertia: every
    shaft is a joint or has an inertia of its own, or is locked by a FixedFlange. The torques on the
    shafts are in the ratios 1 : ratio : -(1 + ratio).

    Source: Modelica Association 2023 for the equation.

    Attributes:
        ratio: teeth of the ring for a tooth of the sun.
    """

    sun = custom.flange()
    ring = custom.flange()
    carrier = custom.flange()
    ratio = custom.parameter(positive=True)
    torque_sun = custom.output("N.m")
    torque_ring = custom.output("N.m")
    torque_carrier = custom.output("N.m")

    def rows(self, at: Any) -> Mapping[str, Row | SX]:
        """What the angles leave of the equation."""
        value = at.sun.angle + at.ratio * at.ring.angle - (1 + at.ratio) * at.carrier.angle
        return {"mesh": Row(value, "1")}

    def outputs(self, at: Any) -> Mapping[str, SX]:
        """What the gear does to its three shafts."""
        T = at.lam["mesh"]
        return {
            "torque_sun": T,
            "torque_ring": at.ratio * T,
            "torque_carrier": -(1 + at.ratio) * T,
        }


class LossyGear(TwoFlanges):
    """An elastic gear that loses a share of the power in the mesh, in both directions of it.

    With x = angle_a / ratio - angle_b and T = stiffness x + damping dx/dt, flange_b gets T and
    flange_a gets -T (1 + e) / ratio. The losses e are 1 / efficiency - 1 where flange_a drives,
    and efficiency_back - 1 where flange_b does. Between the two the sign of the power is
    s = tanh(w / width) tanh(T / torque_width), w being the speed of flange_a divided by ratio:
    e = e_1 s + e_2 s^2, which takes no energy at rest and never gives any.

    The gear must be elastic, since its losses depend on what it transmits; a stiff one is near a
    rigid gear.

    Source: Modelica Association 2023 for the efficiencies.

    Attributes:
        ratio: revolutions of flange_a per revolution of flange_b; less than zero when they rotate
            in opposite directions.
        stiffness: at flange_b [N m/rad].
        efficiency: power at flange_b for the power at flange_a, where flange_a drives.
        efficiency_back: power at flange_a for that at flange_b, where flange_b drives; the gear
            locks itself towards zero.
        damping: at flange_b [N m s/rad].
        width: speed at flange_b over which the losses change sign [rad/s].
        torque_width: torque at flange_b over which they do [N m].
    """

    ratio = custom.parameter()
    stiffness = custom.parameter("N.m/rad", positive=True)
    efficiency = custom.parameter(positive=True, max=1)
    efficiency_back = custom.parameter(min=0, max=1)
    damping = custom.parameter("N.m.s/rad", 0.0, min=0)
    width = custom.parameter("rad/s", _REVERSAL, positive=True)
    torque_width = custom.parameter("N.m", _UNLOADED, positive=True)
    torque = custom.output("N.m")
    loss = custom.output("W")

    def __post_init__(self) -> None:
        TwoFlanges.__post_init__(self)
        if to_float(self.ratio) == 0:
            raise DescriptionError(
                f"{self.name}: ratio is 0, which ties nothing; give the revolutions of flange_a per"
                " revolution of flange_b, less than zero where they rotate in opposite directions"
            )

    def loads(self, at: Any) -> Mapping[str, Load]:
        """The torque in the gear on b; on a the same with the losses, through the ratio."""
        T = self._torque(at)
        return {"flange_a": -T * (1 + self._losses(at)) / at.ratio, "flange_b": T}

    def energy(self, at: Any) -> SX:
        """What the twist stores."""
        return SX(0.5 * at.stiffness * self._twist(at) ** 2)

    def dissipation(self, at: Any) -> SX:
        """What the damper takes, and the mesh."""
        return SX(at.damping * self._rate(at) ** 2 + self._loss(at))

    def outputs(self, at: Any) -> Mapping[str, SX]:
        """The torque at flange_b, and the power that the mesh loses."""
        return {"torque": self._torque(at), "loss": self._loss(at)}

    def _twist(self, at: Any) -> SX:
        return SX(at.flange_a.angle / at.ratio - at.flange_b.angle)

    def _rate(self, at: Any) -> SX:
        return SX(at.flange_a.speed / at.ratio - at.flange_b.speed)

    def _torque(self, at: Any) -> SX:
        return SX(at.stiffness * self._twist(at) + at.damping * self._rate(at))

    def _loss(self, at: Any) -> SX:
        return SX(self._torque(at) * self._losses(at) * at.flange_a.speed / at.ratio)

    def _losses(self, at: Any) -> SX:
        w = at.flange_a.speed / at.ratio
        s = casadi.tanh(w / at.width) * casadi.tanh(self._torque(at) / at.torque_width)
        forward, back = 1 / at.efficiency - 1, at.efficiency_back - 1
        # |forward + back| <= forward - back, so that the losses have the sign of s
        return SX((forward - back) / 2 * s + (forward + back) / 2 * s**2)


# Loads, brakes and clutches.


class QuadraticSpeedTorque(_BrakingTorque):
    """The load of a fan, a propeller or a pump: torque -coefficient |w| w on its shaft.

    Source: Modelica Association 2023.

    Attributes:
        coefficient: [N m s^2/rad^2].
    """

    coefficient = custom.parameter("N.m.s2/rad2", min=0)

    def _torque(self, at: Any) -> SX:
        w = at.flange.speed
        return SX(at.coefficient * casadi.fabs(w) * w)


class Brake(_BrakingTorque):
    """A brake between a shaft and the housing: torque -capacity engagement tanh(w / width).

    The input `engagement` is the share of the normal force, from 0 for a brake that is released
    to 1; below zero it counts as zero. The law is smooth and has no event of sticking: a load
    below the capacity rotates the shaft at a speed below `width`.

    Source: Modelica Association 2023 for the element.

    Attributes:
        capacity: torque of the brake when it is fully engaged [N m].
        width: speed over which the friction changes sign [rad/s].
    """

    capacity = custom.parameter("N.m", min=0)
    width = custom.parameter("rad/s", _CREEP, positive=True)
    engagement = custom.input()

    def _torque(self, at: Any) -> SX:
        return friction_of(at, at.flange.speed)


class Clutch(_SlippingShafts):
    """A friction clutch: torque capacity engagement tanh((w_a - w_b) / width) from a to b.

    The input `engagement` is the share of the normal force, from 0 for a clutch that is open to 1;
    below zero it counts as zero. The law is smooth and has no event of sticking: an engaged
    clutch slips at a speed below `width`.

    Source: Modelica Association 2023 for the element.

    Attributes:
        capacity: torque of the clutch when it is fully engaged [N m].
        width: relative speed over which the friction changes sign [rad/s].
    """

    capacity = custom.parameter("N.m", min=0)
    width = custom.parameter("rad/s", _CREEP, positive=True)
    engagement = custom.input()

    def _torque(self, at: Any) -> SX:
        return friction_of(at, self._slip(at))


def friction_of(at: Any, w: SX) -> SX:
    """Coulomb friction of a brake or clutch at a speed, its sign smoothed."""
    return SX(at.capacity * casadi.fmax(at.engagement, 0) * smooth_sign(w, at.width))


class OneWayClutch(_SlippingShafts):
    """A freewheel: flange_a drives flange_b and never brakes it.

    The torque from a to b is damping r(w_a - w_b), with the ramp r of a JointStop over `width`:
    zero while b is faster, a stiff damper while a would be. The law is smooth and has no event of
    locking: where it locks against a torque T its shafts slip by T / damping + width / 2.

    Source: Modelica Association 2023 for the element.

    Attributes:
        damping: where it locks [N m s/rad].
        width: slip over which the damper sets in [rad/s].
    """

    damping = custom.parameter("N.m.s/rad", positive=True)
    width = custom.parameter("rad/s", _CREEP, positive=True)

    def _torque(self, at: Any) -> SX:
        return SX(at.damping * smooth_ramp(self._slip(at), at.width)[1])


# Brakes, clutches and freewheels that stick: they have events, in simulations and FMUs.


class RigidBrake(OneFlange):
    """A brake between a shaft and the housing that sticks: Coulomb friction of a chosen capacity.

    The shaft stands still until a torque beyond capacity times `engagement` moves it, and is
    braked by that torque while it rotates. The input `engagement` is the share of the normal force,
    from 0 for a brake that is released to 1; below zero it counts as zero.

    Source: Pfeiffer and Glocker 1996, chapter 5.

    Attributes:
        capacity: torque of the brake when it is fully engaged [N m].
        sticking: the largest torque at which it sticks, for a unit torque while it slides.
    """

    capacity = custom.parameter("N.m", min=0)
    sticking = custom.parameter("1", 1.0, min=1)
    engagement = custom.input()

    def frictions(self, at: Any) -> Mapping[str, Friction]:
        """On the speed of the shaft."""
        return {"": capacity_of(at, at.flange.speed)}


class RigidClutch(TwoFlanges):
    """A friction clutch that sticks: its shafts rotate as one up to its capacity.

    Beyond capacity times `engagement` they slip, with this torque between them, until their
    speeds are equal again. The input `engagement` is the share of the normal force, from 0 for a
    clutch that is open to 1; below zero it counts as zero. The effort is the torque from a to b.

    Source: Pfeiffer and Glocker 1996, chapter 5.

    Attributes:
        capacity: torque of the clutch when it is fully engaged [N m].
        sticking: the largest torque at which it sticks, for a unit torque while it slips.
    """

    capacity = custom.parameter("N.m", min=0)
    sticking = custom.parameter("1", 1.0, min=1)
    engagement = custom.input()

    def frictions(self, at: Any) -> Mapping[str, Friction]:
        """On the difference of the speeds."""
        return {"": capacity_of(at, at.flange_b.speed - at.flange_a.speed)}


def capacity_of(at: Any, slip: SX) -> Friction:
    """Coulomb friction of a brake or clutch on a velocity of slip."""
    sliding = at.capacity * casadi.fmax(at.engagement, 0)
    return Friction(slip, sliding, at.sticking * sliding)


class RigidOneWayClutch(TwoFlanges):
    """A freewheel that locks: flange_b is never slower than flange_a, which drives it then.

    It locks where the speeds become equal, without an impact, and frees where flange_a would have
    to brake flange_b. The effort is the torque from a to b, never below zero.

    Source: Pfeiffer and Glocker 1996, chapters 4 and 6.
    """

    def stops(self, at: Any) -> Mapping[str, Stop | OneWay]:
        """On the difference of the speeds."""
        return {"": OneWay(at.flange_b.speed - at.flange_a.speed)}
