"""Translational parts of drive lines: masses, springs, dampers and gaps along one direction.

Connected flanges have the same position, and their forces add up to zero. They are connected to
each other and to `joint.flange` of prismatic joints. An IdealGear or ElasticGear connects a shaft
to a sliding part.
"""

from __future__ import annotations

from collections.abc import Mapping

from casadi import SX

from mbs.components import custom
from mbs.components.custom import At, Load
from mbs.components.drives import RigidPart, TwoFlanges
from mbs.components.forces import one_sided_damping, smooth_ramp
from mbs.components.rotational import BrakingForce, RigidBrake, friction_of
from mbs.expressions import Expression, expression

_TOUCH = 1e-4
"""Depth over which surfaces in contact become stiff [m]: 0.1 mm, as for rough surfaces."""
_CREEP = 1e-3
"""Speed below which a brake counts as closed [m/s], as in JointFriction: four metres an hour."""


class SlidingMass(RigidPart):
    """A sliding mass: one rigid body of zero length with a flange at each end.

    Gravity does not act on it, since a line of sliding parts has no direction in space.

    Attributes:
        mass: mass [kg].
    """

    flange_a = custom.flange(slides=True)
    flange_b = custom.flange(slides=True)
    mass = custom.parameter("kg", min=0)

    @property
    def own_inertia(self) -> Expression:
        """The mass [kg], which the assembly adds to the sliding line of its flanges."""
        return expression(self.mass)


class _BetweenSlides(TwoFlanges):
    """Base of elements that pull two flanges together.

    Their tension is a function of x = position_b - position_a and its rate.
    """

    flange_a = custom.flange(slides=True)
    flange_b = custom.flange(slides=True)
    force = custom.output("N")

    def loads(self, at: At) -> Mapping[str, Load]:
        """Return the forces ON the flanges [N]: "flange_a": tension, "flange_b": -tension.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        F = self._tension(at)
        return {"flange_a": F, "flange_b": -F}

    def outputs(self, at: At) -> Mapping[str, SX]:
        """Return {"force": tension [N]}, negative if the flanges are pushed apart.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return {"force": self._tension(at)}

    def _tension(self, at: At) -> SX:
        """Return the tension [N] that pulls the flanges together; negative if it pushes."""
        raise NotImplementedError

    def _extent(self, at: At) -> SX:
        """Return x = position_b - position_a [m]."""
        return SX(at.flange_b.position - at.flange_a.position)

    def _rate(self, at: At) -> SX:
        """Return dx/dt, the speed of flange_b minus that of flange_a [m/s]."""
        return SX(at.flange_b.speed - at.flange_a.speed)


class SlidingSpring(_BetweenSlides):
    """A spring with a parallel damper: tension stiffness (x - length) + damping dx/dt.

    x is position_b - position_a.

    Attributes:
        stiffness: stiffness of the spring [N/m].
        length: x at which the spring is relaxed [m].
        damping: damping of the damper [N s/m].
    """

    stiffness = custom.parameter("N/m", min=0)
    length = custom.parameter("m", 0.0)
    damping = custom.parameter("N.s/m", 0.0, min=0)

    def __post_init__(self) -> None:
        TwoFlanges.__post_init__(self)
        self._require_effect("stiffness", "damping")

    def energy(self, at: At) -> SX:
        """Return stiffness (x - length)^2 / 2 [J].

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return SX(0.5 * at.stiffness * (self._extent(at) - at.length) ** 2)

    def dissipation(self, at: At) -> SX:
        """Return damping (dx/dt)^2 [W].

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return SX(at.damping * self._rate(at) ** 2)

    def _tension(self, at: At) -> SX:
        """Return stiffness (x - length) + damping dx/dt [N]; negative if it pushes."""
        stretch = self._extent(at) - at.length
        return SX(at.stiffness * stretch + at.damping * self._rate(at))


class SlidingDamper(_BetweenSlides):
    """A damper between two sliding flanges: tension damping dx/dt, x = position_b - position_a.

    Attributes:
        damping: damping [N s/m].
    """

    damping = custom.parameter("N.s/m", min=0)

    def dissipation(self, at: At) -> SX:
        """Return damping (dx/dt)^2 [W].

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return SX(at.damping * self._rate(at) ** 2)

    def _tension(self, at: At) -> SX:
        """Return damping dx/dt [N]; positive if the flanges move apart."""
        return SX(at.damping * self._rate(at))


class ElastoGap(_BetweenSlides):
    """A spring and a damper that push two parts apart in contact, with no force otherwise.

    The parts are in contact if x = position_b - position_a is below `length`. With the depth
    d = length - x they are pushed apart by stiffness r(d) - damping s(d) dx/dt, with the ramp r and
    its slope s of a JointStop: over the first `width` the stiffness grows from zero to its full
    value, so that the spring force and its first two derivatives are continuous. The damping force
    is at most as large as the spring force, so that separating parts are never pulled.

    Source: Modelica Association 2023 for the element.

    Attributes:
        stiffness: stiffness in contact [N/m].
        length: x at which contact begins [m].
        damping: damping in contact [N s/m].
        width: depth over which the stiffness grows [m].
    """

    stiffness = custom.parameter("N/m", positive=True)
    length = custom.parameter("m", 0.0)
    damping = custom.parameter("N.s/m", 0.0, min=0)
    width = custom.parameter("m", _TOUCH, positive=True)

    def energy(self, at: At) -> SX:
        """Return the energy of the contact spring [J]; zero without contact.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return SX(at.stiffness * self._contact(at)[2])

    def dissipation(self, at: At) -> SX:
        """Return the power dissipated by the damper [W]; zero without contact.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return SX(self._tensions(at)[1] * self._rate(at))

    def _tension(self, at: At) -> SX:
        """Return the tension of spring and damper [N], never positive."""
        return sum(self._tensions(at), SX(0))

    def _tensions(self, at: At) -> tuple[SX, SX]:
        """Return the tensions of spring and damper [N]; both zero without contact.

        The tension of the spring is negative in contact: the spring pushes the parts apart.
        """
        slope, ramped, _ = self._contact(at)
        spring = at.stiffness * ramped
        return -spring, one_sided_damping(at.damping * slope * self._rate(at), spring)

    def _contact(self, at: At) -> tuple[SX, SX, SX]:
        """Return (slope, ramp [m], integral of the ramp [m^2]) of `smooth_ramp` at the depth.

        All are zero without contact.
        """
        return smooth_ramp(at.length - self._extent(at), at.width)


class SlidingBrake(BrakingForce):
    """A brake between a sliding part and its rail: force -capacity engagement tanh(v / width).

    The input `engagement` is the fraction of the normal force, from 0 for a released brake
    to 1. Negative values count as zero. The law is smooth, without sticking: a load below the
    capacity moves the part at a speed below `width`.

    Source: Modelica Association 2023 for the element.

    Attributes:
        capacity: force of the fully engaged brake [N].
        width: speed over which the friction changes sign [m/s].
    """

    flange = custom.flange(slides=True)
    capacity = custom.parameter("N", min=0)
    width = custom.parameter("m/s", _CREEP, positive=True)
    engagement = custom.input()
    force = custom.output("N")

    def _effort(self, at: At) -> SX:
        """Return the smooth friction force of the brake [N], with the sign of the speed."""
        return friction_of(at, at.flange.speed)


class RigidSlidingBrake(RigidBrake):
    """A brake with sticking between a sliding part and its rail, as a `RigidBrake` on a shaft.

    Source: Pfeiffer and Glocker 1996, chapter 5.

    Attributes:
        capacity: force of the fully engaged brake [N].
        sticking: largest sticking force divided by the sliding force.
    """

    flange = custom.flange(slides=True)
    capacity = custom.parameter("N", min=0)
