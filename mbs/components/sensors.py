"""Sensors on points and on joints: motions, wrenches, power.

A sensor is a component that knows where it is: `m.add(AbsoluteSensor("tip", arm.right))`. It takes
no part in the motion; `mbs.models.measurements` says what it reads.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar, TypeVar

from mbs.components.component import Component, Point
from mbs.components.on_points import OnPair, OnPoints
from mbs.errors import DescriptionError
from mbs.text import did_you_mean, quoted


@dataclass(frozen=True, slots=True)
class Quantity:
    """Something that a sensor reads.

    Attributes:
        name: short, as it ends the name of an output.
        unit: of each element.
        shape: rows and columns.
    """

    name: str
    unit: str
    shape: tuple[int, int] = (1, 1)

    @property
    def elements(self) -> tuple[str, ...]:
        """The ends of the names of its elements, column by column; empty for a scalar."""
        rows, columns = self.shape
        if (rows, columns) == (1, 1):
            return ("",)
        if columns == 1:
            return tuple("xyz"[:rows])
        return tuple(f"{r}{c}" for c in "xyz"[:columns] for r in "xyz"[:rows])


_VECTOR = (3, 1)
_MOTION = (
    Quantity("p", "m", _VECTOR),
    Quantity("R", "1", (3, 3)),
    Quantity("v", "m/s", _VECTOR),
    Quantity("w", "rad/s", _VECTOR),
    Quantity("a", "m/s2", _VECTOR),
    Quantity("wd", "rad/s2", _VECTOR),
)
_DISTANCE = (Quantity("L", "m"), Quantity("Ld", "m/s"))


@dataclass(frozen=True, slots=True)
class Sensor(OnPoints):
    """A component that reads something and changes nothing.

    What a sensor of a user's own reads are the outputs of a `Custom` component.
    """

    reads: ClassVar[str] = ""
    """What kind of reading it is: absolute, relative, distance, coordinate, wrench or power."""

    @property
    def measured(self) -> tuple[Quantity, ...]:
        """What it reads; what depends on the joint that it is on, the assembly finds out."""
        raise NotImplementedError

    def _check_axes(self, allowed: tuple[str, ...], meaning: str) -> None:
        axes = getattr(self, "axes", None)
        if axes not in allowed:
            raise DescriptionError(f"{self.name}: axes is {quoted(axes)}; use {meaning}")


@dataclass(frozen=True, slots=True)
class MotionSensor(Sensor):
    """A sensor of position, orientation, velocities and accelerations of a frame."""

    @property
    def measured(self) -> tuple[Quantity, ...]:
        """Those that were asked for."""
        names = getattr(self, "quantities", ())
        return tuple(quantity for quantity in _MOTION if quantity.name in names)

    def _check_quantities(self) -> None:
        given = getattr(self, "quantities", None)
        known = [quantity.name for quantity in _MOTION]
        if given is None:
            given = tuple(known)
        if isinstance(given, str) or not hasattr(given, "__iter__") or not list(given):
            raise DescriptionError(
                f"{self.name}: quantities is {quoted(given)}; give some of {', '.join(known)}"
            )
        for name in given:
            if name not in known:
                raise DescriptionError(
                    f"{self.name}: there is no quantity {quoted(name)}; {did_you_mean(name, known)}"
                )
        object.__setattr__(self, "quantities", tuple(given))


@dataclass(frozen=True, slots=True)
class AbsoluteSensor(MotionSensor):
    """How a point moves in the world.

    Position p, velocity v, angular velocity w, acceleration a, angular acceleration wd, as an
    observer at rest sees them, and orientation R, whose columns are the axes of the point. Gravity
    has no part in a.

    Attributes:
        point: of a body, or a body for its reference frame.
        axes: in which vectors are: "world", or "body" for those of the point.
        quantities: those to read, some of p, R, v, w, a, wd; all of them when left out.
    """

    reads = "absolute"

    point: Any
    axes: str = "world"
    quantities: Any = None

    def __post_init__(self) -> None:
        Component.__post_init__(self)
        self._take_point("point")
        self._check_axes(
            ("world", "body"), "'world', or 'body' for those of the point, which rotate with it"
        )
        self._check_quantities()

    @property
    def points(self) -> tuple[Point, ...]:
        """The one point."""
        return (self.point,)


@dataclass(frozen=True, slots=True)
class RelativeSensor(OnPair, MotionSensor):
    """How a frame b moves for an observer who moves and rotates with a frame a.

    Position p of b, velocity v and acceleration a as that observer sees them, angular velocity w
    and its rate wd for him, and orientation R, whose columns are the axes of b in a.

    Attributes:
        a, b: points of bodies, or bodies for their reference frames.
        axes: in which vectors are: "a", "b" or "world".
        quantities: those to read, some of p, R, v, w, a, wd; all of them when left out.
    """

    reads = "relative"

    axes: str = "a"
    quantities: Any = None

    def __post_init__(self) -> None:
        OnPair.__post_init__(self)
        self._check_axes(("a", "b", "world"), "'a', 'b' or 'world'")
        self._check_quantities()


@dataclass(frozen=True, slots=True)
class DistanceSensor(OnPair, Sensor):
    """Distance L between two points and its rate Ld; where they coincide the rate is zero.

    Attributes:
        a, b: the points, or bodies for their reference frames.
    """

    reads = "distance"

    @property
    def measured(self) -> tuple[Quantity, ...]:
        """Distance and rate."""
        return _DISTANCE


# Sensors on joints: coordinates, transmitted wrench, power.


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

    reads = "coordinate"

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

    reads = "wrench"

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

    reads = "power"

    @property
    def measured(self) -> tuple[Quantity, ...]:
        """The power."""
        return (Quantity("P", "W"),)
