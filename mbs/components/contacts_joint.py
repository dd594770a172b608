"""Contacts along a coordinate of a joint: rigid stops and dry friction that really sticks.

They hold the coordinate at times and let it go at others. Simulations change between the two at
events; smooth models, such as the inverse dynamic one, leave contacts out.
"""

from __future__ import annotations

from dataclasses import dataclass

from casadi import SX

from mbs.components.forces import JointForce
from mbs.components.placement import SymbolTable
from mbs.errors import DescriptionError
from mbs.expressions import Number, Scalar, to_float


@dataclass(frozen=True, slots=True, kw_only=True)
class JointContact(JointForce):
    """What may hold a coordinate of a joint at rest, in simulations alone."""

    @property
    def scope(self) -> str:
        """Which models know it."""
        return ", in simulations; the other models leave it out"

    def effort(self, q: SX | None, v: SX, symbols: SymbolTable) -> SX:
        """Nothing in smooth models."""
        return SX(0)

    def energy(self, q: SX | None, symbols: SymbolTable) -> SX:
        """A contact stores nothing."""
        return SX(0)


@dataclass(frozen=True, slots=True, kw_only=True)
class RigidStop(JointContact):
    """Rigid limits of a coordinate, with impacts and contact.

    The velocity v of an impact becomes -restitution v. Where that is slower than `rest_speed` the
    coordinate stays at the limit until something pulls it off.

    Attributes:
        lower: limit [rad or m]; None for no stop on that side.
        upper: likewise.
        restitution: Newton's, between 0 and 1.
        rest_speed: of the slowest rebound [rad/s or m/s].
    """

    lower: Scalar | None = None
    upper: Scalar | None = None
    restitution: Scalar = 0.0
    rest_speed: Scalar = 1e-4

    def __post_init__(self) -> None:
        JointForce.__post_init__(self)
        self._take_limits()
        self._normalise("restitution", "rest_speed")
        self._require_magnitudes("restitution")
        self._require_positive("rest_speed")
        restitution = to_float(self.restitution)
        if restitution is not None and restitution > 1:
            raise DescriptionError(
                f"{self.name}: restitution is {restitution:g}, an impact that gives energy; give a"
                " number between 0 and 1"
            )

    @property
    def needs_position(self) -> bool:
        """A limit is one of a position."""
        return True


@dataclass(frozen=True, slots=True, kw_only=True)
class CoulombFriction(JointContact):
    """Dry friction that holds a coordinate at rest up to an effort and brakes it when it slides.

    Attributes:
        sliding: friction while it slides [N m or N].
        sticking: the largest effort that holds it at rest, at least `sliding`, and as large when
            left out [N m or N].
    """

    sliding: Scalar
    sticking: Scalar | None = None

    def __post_init__(self) -> None:
        JointForce.__post_init__(self)
        if self.sticking is None:
            object.__setattr__(self, "sticking", self.sliding)
        self._normalise("sliding", "sticking")
        self._require_magnitudes("sliding", "sticking")
        assert self.sticking is not None
        low, high = to_float(self.sliding), to_float(self.sticking)
        if low is not None and high is not None and high < low:
            raise DescriptionError(
                f"{self.name}: sticking is {high:g} and sliding is {low:g}; at rest dry friction"
                " holds at least as much, so give sticking >= sliding"
            )
        if self.sticking == Number(0.0):
            raise DescriptionError(
                f"{self.name}: sliding and sticking are zero, so that the CoulombFriction does"
                " nothing; give a strength or leave it out"
            )
