"""Rotational parts of drive lines: losses, backlash, friction, and gears with several shafts.

Most laws are smooth, without modes and events, so that all models contain them. A smooth brake
creeps at a speed below the width of its law instead of sticking. A smooth freewheel slips a little
while it locks. The rigid elements stick and lock at events, in simulations and FMUs.
"""

from __future__ import annotations

from collections.abc import Mapping

import casadi
from casadi import SX

from mbs.components import custom
from mbs.components.custom import At, Friction, Load, OneWay, Row, Stop
from mbs.components.drives import OneFlange, TwoFlanges
from mbs.components.forces import one_sided_damping, smooth_ramp
from mbs.components.joints import smooth_sign
from mbs.errors import DescriptionError
from mbs.expressions import to_float

_FLANK = 1e-3
"""Depth of a tooth flank over which it becomes stiff [rad]: 0.06 degrees, below usual backlash."""
_CREEP = 1e-3
"""Speed below which a brake counts as closed [rad/s], as in JointFriction: 2 pi in two hours."""
_REVERSAL = 1e-2
"""Speed over which losses of a gear change sign [rad/s]: 2 pi in ten minutes."""
_UNLOADED = 1e-2
"""Torque over which losses of a gear change sign [N m]: the torque in the gear of a watch, or one
hundredth of the torque in a small robot's."""

# Elements that exert one torque on shafts.


class _BetweenShafts(TwoFlanges):
    """Base of elements that transmit a torque from flange_a to flange_b."""

    torque = custom.output("N.m")

    def loads(self, at: At) -> Mapping[str, Load]:
        """Return {"flange_a": -T, "flange_b": T}: torques ON the shafts [N m]; `torque` is T.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        T = self._torque(at)
        return {"flange_a": -T, "flange_b": T}

    def outputs(self, at: At) -> Mapping[str, SX]:
        """Return {"torque": torque that flange_b gets from flange_a [N m]}.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return {"torque": self._torque(at)}

    def _torque(self, at: At) -> SX:
        """Return the torque ON flange_b [N m]; flange_a gets the opposite torque."""
        raise NotImplementedError

    def _slip(self, at: At) -> SX:
        """Return the speed of flange_a minus the speed of flange_b [rad/s]."""
        return SX(at.flange_a.speed - at.flange_b.speed)


class _SlippingShafts(_BetweenShafts):
    """Base of elements that dissipate all the power of their torque."""

    def dissipation(self, at: At) -> SX:
        """Return the torque from a to b times the slip speed w_a - w_b [W].

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return SX(self._torque(at) * self._slip(at))


class BrakingForce(OneFlange):
    """Base of elements that brake one shaft or sliding part and dissipate all the power.

    A subclass declares one output: the braking torque or force.
    """

    def loads(self, at: At) -> Mapping[str, Load]:
        """Return {"flange": -T}: torque or force ON the flange [N m or N], opposed to its speed.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return {"flange": -self._effort(at)}

    def dissipation(self, at: At) -> SX:
        """Return the braking torque or force T times the speed of the flange [W].

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return SX(self._effort(at) * at.flange.speed)

    def outputs(self, at: At) -> Mapping[str, SX]:
        """Return the braking torque or force T [N m or N], by the name of the output.

        It has the sign of the speed. The flange gets -T.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return {self.output_names[0]: self._effort(at)}

    def _effort(self, at: At) -> SX:
        """Return the braking torque or force T [N m or N], with the sign of the speed."""
        raise NotImplementedError


# Springs and dampers between two shafts.


class ShaftSpringDamperSeries(_BetweenShafts):
    """A spring in series with a damper between two shafts, a Maxwell element.

    With the twist x = angle_a - angle_b and the state z, the twist of the damper, the torque
    from a to b is T = stiffness (x - z), and damping dz/dt = T - parallel z. At a constant twist it
    relaxes with the time constant damping / (stiffness + parallel).

    Source: Haug 1989 for springs and dampers in shafts.

    Attributes:
        stiffness: stiffness of the spring in series [N m/rad].
        damping: damping of the damper [N m s/rad].
        parallel: stiffness of a spring parallel to the damper [N m/rad].
    """

    stiffness = custom.parameter("N.m/rad", positive=True)
    damping = custom.parameter("N.m.s/rad", positive=True)
    twist = custom.state("rad")
    parallel = custom.parameter("N.m/rad", 0.0, min=0)

    def rates(self, at: At) -> Mapping[str, SX]:
        """Return {"twist": dz/dt [rad/s]}, the damper torque divided by `damping`.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return {"twist": self._damper_torque(at) / at.damping}

    def energy(self, at: At) -> SX:
        """Return the energy of both springs, stiffness (x - z)^2 / 2 + parallel z^2 / 2 [J].

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return SX(0.5 * (at.stiffness * self._stretch(at) ** 2 + at.parallel * at.twist**2))

    def dissipation(self, at: At) -> SX:
        """Return the power dissipated by the damper, damper torque^2 / damping [W].

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return SX(self._damper_torque(at) ** 2 / at.damping)

    def _damper_torque(self, at: At) -> SX:
        """Return the damper torque T - parallel z [N m], from the balance at the massless node."""
        return SX(self._torque(at) - at.parallel * at.twist)

    def _stretch(self, at: At) -> SX:
        """Return the twist x - z of the series spring [rad]."""
        return SX(at.flange_a.angle - at.flange_b.angle - at.twist)

    def _torque(self, at: At) -> SX:
        """Return the torque T = stiffness (x - z) from a to b [N m]."""
        return SX(at.stiffness * self._stretch(at))


class ElastoBacklash(_BetweenShafts):
    """An elastic shaft with backlash: no torque within the backlash, spring and damper beyond it.

    With the twist x = angle_a - angle_b, the depth beyond the backlash is d = |x| - backlash / 2.
    The torque from a to b is sign(x) stiffness r(d) + damping s(d) dx/dt, with the ramp r and its
    slope s of a JointStop: over the first `width` beyond the backlash the stiffness grows from zero
    to its full value, so that the spring torque and its first two derivatives are continuous.
    The damping torque is at most as large as the spring torque, so that flanks never pull.

    Source: Modelica Association 2023 for the element.

    Attributes:
        stiffness: stiffness in contact [N m/rad].
        backlash: angle from flank to flank [rad].
        damping: damping in contact [N m s/rad].
        width: depth over which the stiffness grows [rad].
    """

    stiffness = custom.parameter("N.m/rad", positive=True)
    backlash = custom.parameter("rad", min=0)
    damping = custom.parameter("N.m.s/rad", 0.0, min=0)
    width = custom.parameter("rad", _FLANK, positive=True)

    def energy(self, at: At) -> SX:
        """Return the energy of the flanks in contact [J]; zero within the backlash.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return SX(
            at.stiffness
            * sum((smooth_ramp(d, at.width)[2] for _, d in self._flank_depths(at)), SX(0))
        )

    def dissipation(self, at: At) -> SX:
        """Return the power dissipated by the damper [W]; zero within the backlash.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return SX(self._torques(at)[1] * self._slip(at))

    def _torque(self, at: At) -> SX:
        """Return the torque of spring and damper from a to b [N m]."""
        return sum(self._torques(at), SX(0))

    def _torques(self, at: At) -> tuple[SX, SX]:
        """Return the torques of spring and damper from a to b [N m], zero within the backlash."""
        elastic, damped = SX(0), SX(0)
        for sign, depth in self._flank_depths(at):
            slope, ramped, _ = smooth_ramp(depth, at.width)
            spring = at.stiffness * ramped
            elastic += sign * spring
            damped += one_sided_damping(at.damping * slope * self._slip(at), spring)
        return elastic, damped

    def _flank_depths(self, at: At) -> list[tuple[float, SX]]:
        """Return (sign of the torque, depth beyond the backlash [rad]) of both flanks.

        The depth is negative if the flank is not in contact.
        """
        x = at.flange_a.angle - at.flange_b.angle
        return [(1.0, x - at.backlash / 2), (-1.0, -x - at.backlash / 2)]


# Gears with three shafts, and gears with losses.


class PlanetaryGear(custom.Custom):
    """An ideal planetary gear: (1 + ratio) angle_carrier = angle_sun + ratio angle_ring.

    It is one constraint row on the three shafts, exact in positions and velocities, without
    inertia: every shaft is a joint, has an inertia of its own, or is locked by a FixedFlange. The
    torques on the shafts have the ratios 1 : ratio : -(1 + ratio).

    Source: Modelica Association 2023 for the equation.

    Attributes:
        ratio: number of teeth of the ring divided by that of the sun.
    """

    sun = custom.flange()
    ring = custom.flange()
    carrier = custom.flange()
    ratio = custom.parameter(positive=True)
    torque_sun = custom.output("N.m")
    torque_ring = custom.output("N.m")
    torque_carrier = custom.output("N.m")

    def rows(self, at: At) -> Mapping[str, Row | SX]:
        """Return {"mesh": angle_sun + ratio angle_ring - (1 + ratio) angle_carrier [rad]}.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        value = at.sun.angle + at.ratio * at.ring.angle - (1 + at.ratio) * at.carrier.angle
        return {"mesh": Row(value, "1")}

    def outputs(self, at: At) -> Mapping[str, SX]:
        """Return the constraint torques ON the three shafts [N m].

        They are named torque_sun, torque_ring and torque_carrier.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        T = at.lam["mesh"]
        return {
            "torque_sun": T,
            "torque_ring": at.ratio * T,
            "torque_carrier": -(1 + at.ratio) * T,
        }


class LossyGear(TwoFlanges):
    """An elastic gear that loses a fraction of the power in the mesh, in both power directions.

    With x = angle_a / ratio - angle_b and T = stiffness x + damping dx/dt, flange_b gets T and
    flange_a gets -T (1 + e) / ratio. The loss e is e_a = 1 / efficiency - 1 if flange_a drives, and
    e_b = efficiency_back - 1 if flange_b drives. The smoothed sign of the power is
    s = tanh(w / width) tanh(T / torque_width), with the speed w of flange_a divided by ratio, and
    e = (e_a - e_b) s / 2 + (e_a + e_b) s^2 / 2. It is zero at rest and never generates energy.

    The gear must be elastic, since its losses depend on the transmitted torque. A large stiffness
    approximates a rigid gear.

    Source: Modelica Association 2023 for the efficiencies.

    Attributes:
        ratio: revolutions of flange_a per revolution of flange_b; negative for opposite directions.
        stiffness: stiffness at flange_b [N m/rad].
        efficiency: power at flange_b divided by power at flange_a, if flange_a drives.
        efficiency_back: power at flange_a divided by power at flange_b, if flange_b drives. The
            gear is self-locking at zero.
        damping: damping at flange_b [N m s/rad].
        width: speed at flange_b over which the losses change sign [rad/s].
        torque_width: torque at flange_b over which the losses change sign [N m].
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

    def loads(self, at: At) -> Mapping[str, Load]:
        """Return the torques ON the shafts [N m]: "flange_b": T, "flange_a": -T (1 + e) / ratio.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        T = self._torque(at)
        return {"flange_a": -T * (1 + self._losses(at)) / at.ratio, "flange_b": T}

    def energy(self, at: At) -> SX:
        """Return stiffness x^2 / 2 of the twist x at flange_b [J].

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return SX(0.5 * at.stiffness * self._twist(at) ** 2)

    def dissipation(self, at: At) -> SX:
        """Return the power lost in the damper and in the mesh [W].

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return SX(at.damping * self._rate(at) ** 2 + self._loss(at))

    def outputs(self, at: At) -> Mapping[str, SX]:
        """Return "torque": T ON flange_b [N m], and "loss": power lost in the mesh only [W].

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return {"torque": self._torque(at), "loss": self._loss(at)}

    def _twist(self, at: At) -> SX:
        """Return the twist x = angle_a / ratio - angle_b [rad]."""
        return SX(at.flange_a.angle / at.ratio - at.flange_b.angle)

    def _rate(self, at: At) -> SX:
        """Return the rate of the twist x [rad/s]."""
        return SX(at.flange_a.speed / at.ratio - at.flange_b.speed)

    def _torque(self, at: At) -> SX:
        """Return T, the torque ON flange_b [N m]."""
        return SX(at.stiffness * self._twist(at) + at.damping * self._rate(at))

    def _loss(self, at: At) -> SX:
        """Return the power lost in the mesh [W], never negative."""
        return SX(self._torque(at) * self._losses(at) * at.flange_a.speed / at.ratio)

    def _losses(self, at: At) -> SX:
        """Return the loss e of the mesh: lost power as a fraction of the power T w.

        See the class.
        """
        w = at.flange_a.speed / at.ratio
        s = casadi.tanh(w / at.width) * casadi.tanh(self._torque(at) / at.torque_width)
        forward, back = 1 / at.efficiency - 1, at.efficiency_back - 1
        # |forward + back| <= forward - back, so that the losses have the sign of s
        return SX((forward - back) / 2 * s + (forward + back) / 2 * s**2)


# Loads, brakes and clutches.


class QuadraticSpeedTorque(BrakingForce):
    """Load of a fan, a propeller or a pump: torque -coefficient |w| w at the shaft speed w.

    Source: Modelica Association 2023.

    Attributes:
        coefficient: coefficient of the squared speed [N m s^2/rad^2].
    """

    coefficient = custom.parameter("N.m.s2/rad2", min=0)
    torque = custom.output("N.m")

    def _effort(self, at: At) -> SX:
        """Return coefficient abs(w) w [N m] at the shaft speed w."""
        w = at.flange.speed
        return SX(at.coefficient * casadi.fabs(w) * w)


class Brake(BrakingForce):
    """A brake between a shaft and the housing: torque -capacity engagement tanh(w / width).

    The input `engagement` is the fraction of the normal force, from 0 for a released brake
    to 1. Negative values count as zero. The law is smooth, without sticking: a load below the
    capacity rotates the shaft at a speed below `width`.

    Source: Modelica Association 2023 for the element.

    Attributes:
        capacity: torque of the fully engaged brake [N m].
        width: speed over which the friction changes sign [rad/s].
    """

    capacity = custom.parameter("N.m", min=0)
    width = custom.parameter("rad/s", _CREEP, positive=True)
    engagement = custom.input()
    torque = custom.output("N.m")

    def _effort(self, at: At) -> SX:
        """Return the smooth friction torque of the brake [N m], with the sign of the speed."""
        return friction_of(at, at.flange.speed)


class Clutch(_SlippingShafts):
    """A friction clutch: torque capacity engagement tanh((w_a - w_b) / width) from a to b.

    The input `engagement` is the fraction of the normal force, from 0 for an open clutch to 1.
    Negative values count as zero. The law is smooth, without sticking: an engaged clutch slips at a
    speed below `width`.

    Source: Modelica Association 2023 for the element.

    Attributes:
        capacity: torque of the fully engaged clutch [N m].
        width: relative speed over which the friction changes sign [rad/s].
    """

    capacity = custom.parameter("N.m", min=0)
    width = custom.parameter("rad/s", _CREEP, positive=True)
    engagement = custom.input()

    def _torque(self, at: At) -> SX:
        """Return the smooth friction torque from a to b [N m], with the sign of the slip speed."""
        return friction_of(at, self._slip(at))


def friction_of(at: At, w: SX) -> SX:
    """Return the smooth Coulomb friction of a brake or clutch [N m or N].

    Its sign is that of the slip velocity w.

    Its size is capacity max(engagement, 0) tanh(abs(w) / width).

    Args:
        at: values of capacity, engagement and width of the component.
        w: (1, 1) slip velocity [rad/s or m/s].
    """
    return SX(at.capacity * casadi.fmax(at.engagement, 0) * smooth_sign(w, at.width))


class OneWayClutch(_SlippingShafts):
    """A freewheel: flange_a drives flange_b and never brakes it.

    The torque from a to b is damping r(w_a - w_b), with the ramp r of a JointStop over `width`. It
    is zero while b is faster. Otherwise it is a stiff damper. The law is smooth, without events:
    while it locks against a torque T its shafts slip by T / damping + width / 2.

    Source: Modelica Association 2023 for the element.

    Attributes:
        damping: damping while it locks [N m s/rad].
        width: slip speed over which the damping sets in [rad/s].
    """

    damping = custom.parameter("N.m.s/rad", positive=True)
    width = custom.parameter("rad/s", _CREEP, positive=True)

    def _torque(self, at: At) -> SX:
        """Return the torque from a to b [N m], zero while b is faster."""
        return SX(at.damping * smooth_ramp(self._slip(at), at.width)[1])


# Brakes, clutches and freewheels with sticking. They have events, in simulations and FMUs.


class RigidBrake(OneFlange):
    """A brake with sticking between a shaft and the housing: Coulomb friction of variable capacity.

    The shaft is at rest until the load exceeds capacity times `engagement` (times `sticking`), and
    is braked by capacity times `engagement` while it rotates. The input `engagement` is the
    fraction of the normal force, from 0 for a released brake to 1. Negative values count as zero.

    Source: Pfeiffer and Glocker 1996, chapter 5.

    Attributes:
        capacity: torque of the fully engaged brake [N m].
        sticking: largest sticking torque divided by the sliding torque.
    """

    capacity = custom.parameter("N.m", min=0)
    sticking = custom.parameter("1", 1.0, min=1)
    engagement = custom.input()

    def frictions(self, at: At) -> Mapping[str, Friction]:
        """Return {"": Friction} whose slip is the speed of the flange [rad/s or m/s].

        Its limit is capacity times max(engagement, 0).

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return {"": capacity_of(at, at.flange.speed)}


class RigidClutch(TwoFlanges):
    """A friction clutch with sticking: its shafts rotate together up to its capacity.

    Beyond capacity times `engagement` (times `sticking`) they slip, with the torque capacity times
    `engagement` between them, until their speeds are equal again. The input `engagement` is the
    fraction of the normal force, from 0 for an open clutch to 1. Negative values count as zero. The
    effort is the torque from a to b.

    Source: Pfeiffer and Glocker 1996, chapter 5.

    Attributes:
        capacity: torque of the fully engaged clutch [N m].
        sticking: largest sticking torque divided by the sliding torque.
    """

    capacity = custom.parameter("N.m", min=0)
    sticking = custom.parameter("1", 1.0, min=1)
    engagement = custom.input()

    def frictions(self, at: At) -> Mapping[str, Friction]:
        """Return {"": Friction} whose slip is the speed of flange_b minus that of flange_a [rad/s].

        Its effort is the torque ON flange_b [N m].

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return {"": capacity_of(at, at.flange_b.speed - at.flange_a.speed)}


def capacity_of(at: At, slip: SX) -> Friction:
    """Return the Coulomb friction with sticking of a brake or clutch.

    The sliding limit is capacity times max(engagement, 0), the sticking limit `sticking` times
    that.

    Args:
        at: values of capacity, engagement and sticking of the component.
        slip: (1, 1) slip velocity [rad/s or m/s].
    """
    sliding = at.capacity * casadi.fmax(at.engagement, 0)
    return Friction(slip, sliding, at.sticking * sliding)


class RigidOneWayClutch(TwoFlanges):
    """A freewheel with locking: flange_b is never slower than flange_a and is driven when equal.

    It locks when the speeds become equal, without an impact. It unlocks when flange_a would have
    to brake flange_b. The effort is the torque from a to b, never negative.

    Source: Pfeiffer and Glocker 1996, chapters 4 and 6.
    """

    def stops(self, at: At) -> Mapping[str, Stop | OneWay]:
        """Return {"": OneWay}: the speed of flange_b minus that of flange_a stays at least zero.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return {"": OneWay(at.flange_b.speed - at.flange_a.speed)}
