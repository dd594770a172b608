"""Sensors on joints: coordinates, transmitted wrench, power."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TypeVar

from mbs.components.component import Component
from mbs.components.sensors import Quantity, Sensor
from mbs.errors import DescriptionError
from mbs.messages import quoted

S = TypeVar("S", bound="OnJoint")


@dataclass(frozen=True, slots=True)
class OnJoint(Sensor):
    """A sensor on a joint.

    Attributes:
        joint: name of the joint, or of one of its coordinates for a sensor of coordinates.
    """

    joint: str

    def __post_init__(self) -> None:
        Component.__post_init__(self)
        if not isinstance(self.joint, str) or not self.joint:
            raise DescriptionError(
                f"{self.name}: joint is {quoted(self.joint)}; give the name of a joint"
            )

    def scoped(self: S, prefix: str) -> S:
        """The same sensor inside a mechanism that is placed in another one."""
        return replace(Component.scoped(self, prefix), joint=f"{prefix}.{self.joint}")


@dataclass(frozen=True, slots=True)
class JointSensor(OnJoint):
    """Position q, velocity v and acceleration a of a coordinate, of a cut joint too.

    A quaternion has elements q alone, an angular velocity v and a alone.

    Attributes:
        joint: name of the coordinate, such as "j1" or "slide.s".
    """

    @property
    def measured(self) -> tuple[Quantity, ...]:
        """Depends on the coordinate."""
        return ()


@dataclass(frozen=True, slots=True)
class WrenchSensor(OnJoint):
    """Force f and moment m that a joint or constraint transmits, the cut force.

    It is what the body of frame_a exerts on the body of frame_b, about the origin of frame_b.

    Attributes:
        joint: its name.
        axes: in which they are: "a" or "b" for those of the joint's frame_a or frame_b, or
            "world".
    """

    axes: str = "b"

    def __post_init__(self) -> None:
        OnJoint.__post_init__(self)
        self._check_axes(("a", "b", "world"), "'a', 'b' or 'world'")

    @property
    def measured(self) -> tuple[Quantity, ...]:
        """Force and moment."""
        return Quantity("f", "N", (3, 1)), Quantity("m", "N.m", (3, 1))


@dataclass(frozen=True, slots=True)
class PowerSensor(OnJoint):
    """Power P that the body of frame_b takes through a joint or constraint [W].

    It is the transmitted wrench times the velocity of frame_b in the world.

    Attributes:
        joint: its name.
    """

    @property
    def measured(self) -> tuple[Quantity, ...]:
        """The power."""
        return (Quantity("P", "W"),)
