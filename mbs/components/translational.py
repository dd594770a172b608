"""Lines of parts that slide: masses, springs, dampers and gaps along one direction.

Their flanges have a position, which is the same for all flanges that are connected, and a force,
and the forces of connected flanges add up to zero. They are connected to each other and to
`joint.flange` of prismatic joints; an IdealGear or ElasticGear leads from a shaft to a part that
slides.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from casadi import SX

from mbs.components import custom
from mbs.components.custom import Friction, Load
from mbs.components.drives import OneFlange, RigidPart, TwoFlanges
from mbs.components.forces import one_sided_damping, smooth_ramp
from mbs.components.rotational import capacity_of, friction_of
from mbs.expressions import Expression, expression

_TOUCH = 1e-4
"""Depth over which surfaces that touch become stiff [m]: a tenth of a millimetre, as rough ones."""
_CREEP = 1e-3
"""Speed below which a brake counts as closed [m/s], that of JointFriction: four metres an hour."""


class SlidingMass(RigidPart):
    """A mass that slides; its two flanges are the two ends of one rigid body without length.

    Gravity does not act on it, since a line of sliding parts has no direction in space.

    Attributes:
        mass: [kg].
    """

    flange_a = custom.flange(slides=True)
    flange_b = custom.flange(slides=True)
    mass = custom.parameter("kg", min=0)

    @property
    def own_inertia(self) -> Expression:
        """All of it."""
        return expression(self.mass)


class _BetweenSlides(TwoFlanges):
    """What acts on x = position_b - position_a by a force that draws the flanges together."""

    flange_a = custom.flange(slides=True)
    flange_b = custom.flange(slides=True)
    force = custom.output("N")

    def loads(self, at: Any) -> Mapping[str, Load]:
        """The tension, each flange towards the other."""
        F = self._tension(at)
        return {"flange_a": F, "flange_b": -F}

    def outputs(self, at: Any) -> Mapping[str, SX]:
        """The tension, less than zero where the flanges are pushed apart."""
        return {"force": self._tension(at)}

    def _tension(self, at: Any) -> SX:
        raise NotImplementedError

    def _extent(self, at: Any) -> SX:
        return SX(at.flange_b.position - at.flange_a.position)

    def _rate(self, at: Any) -> SX:
        return SX(at.flange_b.speed - at.flange_a.speed)


class SlidingSpring(_BetweenSlides):
    """A spring, with a damper beside it: tension stiffness (x - length) + damping dx/dt.

    x is the position of flange_b less that of flange_a.

    Attributes:
        stiffness: [N/m].
        length: x at which it is relaxed [m].
        damping: [N s/m].
    """

    stiffness = custom.parameter("N/m", min=0)
    length = custom.parameter("m", 0.0)
    damping = custom.parameter("N.s/m", 0.0, min=0)

    def __post_init__(self) -> None:
        TwoFlanges.__post_init__(self)
        self._require_effect("stiffness", "damping")

    def energy(self, at: Any) -> SX:
        """What it stores."""
        return SX(0.5 * at.stiffness * (self._extent(at) - at.length) ** 2)

    def dissipation(self, at: Any) -> SX:
        """What the damper takes."""
        return SX(at.damping * self._rate(at) ** 2)

    def _tension(self, at: Any) -> SX:
        stretch = self._extent(at) - at.length
        return SX(at.stiffness * stretch + at.damping * self._rate(at))


class SlidingDamper(_BetweenSlides):
    """A damper between two flanges that slide: tension damping dx/dt, x = position_b - position_a.

    Attributes:
        damping: [N s/m].
    """

    damping = custom.parameter("N.s/m", min=0)

    def dissipation(self, at: Any) -> SX:
        """All its power."""
        return SX(at.damping * self._rate(at) ** 2)

    def _tension(self, at: Any) -> SX:
        return SX(at.damping * self._rate(at))


class ElastoGap(_BetweenSlides):
    """A spring and a damper that push where two parts touch, and nothing where they do not.

    They touch where x = position_b - position_a is below `length`; with the depth
    d = length - x they are pushed apart by stiffness r(d) - damping s(d) dx/dt, with the ramp r and
    its slope s of a JointStop: over the first `width` the stiffness grows from zero to its full
    value, so that the force of the spring and two derivatives of it are continuous. The damper
    exerts at most as much as the spring, so that it never holds back parts that separate.

    Source: Modelica Association 2023 for the element.

    Attributes:
        stiffness: [N/m].
        length: x at which they touch [m].
        damping: while they touch [N s/m].
        width: over which the stiffness grows [m].
    """

    stiffness = custom.parameter("N/m", positive=True)
    length = custom.parameter("m", 0.0)
    damping = custom.parameter("N.s/m", 0.0, min=0)
    width = custom.parameter("m", _TOUCH, positive=True)

    def energy(self, at: Any) -> SX:
        """What is stored where they touch."""
        return SX(at.stiffness * self._contact(at)[2])

    def dissipation(self, at: Any) -> SX:
        """What the damper takes."""
        return SX(self._tensions(at)[1] * self._rate(at))

    def _tension(self, at: Any) -> SX:
        return sum(self._tensions(at), SX(0))

    def _tensions(self, at: Any) -> tuple[SX, SX]:
        """The tension of the spring, never above zero, and that of the damper."""
        slope, ramped, _ = self._contact(at)
        spring = at.stiffness * ramped
        return -spring, one_sided_damping(at.damping * slope * self._rate(at), spring)

    def _contact(self, at: Any) -> tuple[SX, SX, SX]:
        return smooth_ramp(at.length - self._extent(at), at.width)


class SlidingBrake(OneFlange):
    """A brake between a sliding part and its rail: force -capacity engagement tanh(v / width).

    The input `engagement` is the share of the normal force, from 0 for a brake that is released
    to 1; below zero it counts as zero. The law is smooth and has no event of sticking: a load
    below the capacity moves the part at a speed below `width`.

    Source: Modelica Association 2023 for the element.

    Attributes:
        capacity: force of the brake when it is fully engaged [N].
        width: speed over which the friction changes sign [m/s].
    """

    flange = custom.flange(slides=True)
    capacity = custom.parameter("N", min=0)
    width = custom.parameter("m/s", _CREEP, positive=True)
    engagement = custom.input()
    force = custom.output("N")

    def loads(self, at: Any) -> Mapping[str, Load]:
        """Against the speed."""
        return {"flange": -self._force(at)}

    def dissipation(self, at: Any) -> SX:
        """All its power."""
        return SX(self._force(at) * at.flange.speed)

    def outputs(self, at: Any) -> Mapping[str, SX]:
        """What the part loses."""
        return {"force": self._force(at)}

    def _force(self, at: Any) -> SX:
        return friction_of(at, at.flange.speed)


class RigidSlidingBrake(OneFlange):
    """A brake between a sliding part and its rail that sticks, as a `RigidBrake` on a shaft does.

    Source: Pfeiffer and Glocker 1996, chapter 5.

    Attributes:
        capacity: force of the brake when it is fully engaged [N].
        sticking: the largest force at which it sticks, for a unit force while it slides.
    """

    flange = custom.flange(slides=True)
    capacity = custom.parameter("N", min=0)
    sticking = custom.parameter("1", 1.0, min=1)
    engagement = custom.input()

    def frictions(self, at: Any) -> Mapping[str, Friction]:
        """On the speed of the part."""
        return {"": capacity_of(at, at.flange.speed)}
