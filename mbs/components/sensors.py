"""Sensors on points and on joints: motion, wrench, power.

A sensor is added with its point or joint: `m.add(AbsoluteSensor("tip", arm.right))`. It has no
effect on the motion. `mbs.models.measurements` computes its readings.
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
    """Quantity that a sensor measures.

    Attributes:
        name: short name, which ends the names of outputs.
        unit: unit of each element.
        shape: rows and columns.
    """

    name: str
    unit: str
    shape: tuple[int, int] = (1, 1)

    @property
    def elements(self) -> tuple[str, ...]:
        """Suffixes of the names of the elements, column by column: "" for a scalar.

        Vectors have "x", "y", "z". Matrices have row and column, such as "yx".
        """
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
    """Base of components that measure and have no effect on the motion.

    The readings of a user-defined sensor are the outputs of a `Custom` component.
    """

    reads: ClassVar[str] = ""
    """Kind of sensor: absolute, relative, distance, coordinate, wrench or power."""

    @property
    def measured(self) -> tuple[Quantity, ...]:
        """Measured quantities, in the order of the readings.

        Empty for a joint sensor, whose quantities depend on the type of the coordinate.
        """
        raise NotImplementedError


@dataclass(frozen=True, slots=True)
class MotionSensor(Sensor):
    """A sensor of position, orientation, velocities and accelerations of a frame."""

    @property
    def measured(self) -> tuple[Quantity, ...]:
        """The quantities in `quantities`, in the order p, R, v, w, a, wd."""
        names = getattr(self, "quantities", ())
        return tuple(quantity for quantity in _MOTION if quantity.name in names)

    def _check_quantities(self) -> None:
        """Replace the field `quantities` by a tuple of names, in place; None becomes all names.

        Raise DescriptionError for unknown names.
        """
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
    """Motion of a point in the world.

    Position p, velocity v, angular velocity w, acceleration a and angular acceleration wd relative
    to the world, and orientation R, whose columns are the axes of the point. a does not include
    gravity.

    Attributes:
        point: point of a body. A body stands for its reference frame.
        axes: axes of the vectors: "world", or "body" for the axes of the point.
        quantities: quantities to measure, some of p, R, v, w, a, wd. The default is all of them.
    """

    reads = "absolute"

    point: Any
    axes: str = "world"
    quantities: Any = None

    def __post_init__(self) -> None:
        Component.__post_init__(self)
        self._take_point("point")
        self._require_axes()
        self._check_quantities()

    @property
    def points(self) -> tuple[Point, ...]:
        """The measured point, as a tuple."""
        return (self.point,)


@dataclass(frozen=True, slots=True)
class RelativeSensor(OnPair, MotionSensor):
    """Motion of a frame b relative to an observer who moves and rotates with a frame a.

    Position p of b, its velocity v and acceleration a, its angular velocity w and the rate wd of w,
    all relative to the observer, and orientation R, whose columns are the axes of b in a.

    Attributes:
        a, b: points of bodies. A body stands for its reference frame.
        axes: axes of the vectors: "a", "b" or "world".
        quantities: quantities to measure, some of p, R, v, w, a, wd. The default is all of them.
    """

    reads = "relative"

    axes: str = "a"
    quantities: Any = None

    def __post_init__(self) -> None:
        OnPair.__post_init__(self)
        self._require_axes(("a", "b", "world"), "'a', 'b' or 'world'")
        self._check_quantities()


@dataclass(frozen=True, slots=True)
class DistanceSensor(OnPair, Sensor):
    """Distance L between two points and its rate Ld, which is zero if they coincide.

    Attributes:
        a, b: two points. A body stands for its reference frame.
    """

    reads = "distance"

    @property
    def measured(self) -> tuple[Quantity, ...]:
        """Distance L [m] and its rate Ld [m/s]."""
        return _DISTANCE


# Sensors on joints: coordinates, transmitted wrench, power.


S = TypeVar("S", bound="OnJoint")


@dataclass(frozen=True, slots=True)
class OnJoint(Sensor):
    """Base of sensors on a joint.

    Attributes:
        joint: name of the joint, or of a coordinate for a coordinate sensor.
    """

    joint: str

    def __post_init__(self) -> None:
        Component.__post_init__(self)
        if not isinstance(self.joint, str) or not self.joint:
            raise DescriptionError(
                f"{self.name}: joint is {quoted(self.joint)}; give the name of a joint"
            )

    def scoped(self: S, prefix: str) -> S:
        """Return a copy whose name and joint have the prefix "`prefix`.".

        Args:
            prefix: text before the names, without the dot.
        """
        return replace(Component.scoped(self, prefix), joint=f"{prefix}.{self.joint}")


@dataclass(frozen=True, slots=True)
class JointSensor(OnJoint):
    """Position q, velocity v and acceleration a of a coordinate, also of a cut joint.

    The elements of a quaternion have q only. The angular velocity of its joint has v and a only.

    Attributes:
        joint: name of the coordinate, such as "j1" or "slide.s".
    """

    reads = "coordinate"

    @property
    def measured(self) -> tuple[Quantity, ...]:
        """Empty: the assembly determines q, v and a from the type of the coordinate."""
        return ()


@dataclass(frozen=True, slots=True)
class WrenchSensor(OnJoint):
    """Constraint wrench of a joint or constraint: force f and moment m (the cut force).

    It is the wrench that the body of frame_a exerts ON the body of frame_b, about the origin of
    frame_b.

    Attributes:
        joint: name of the joint or constraint.
        axes: axes of the vectors: "a" for frame_a of the joint, "b" for frame_b, or "world".
    """

    reads = "wrench"

    axes: str = "b"

    def __post_init__(self) -> None:
        OnJoint.__post_init__(self)
        self._require_axes(("a", "b", "world"), "'a', 'b' or 'world'")

    @property
    def measured(self) -> tuple[Quantity, ...]:
        """Force f [N] and moment m [N m], (3, 1) each."""
        return Quantity("f", "N", (3, 1)), Quantity("m", "N.m", (3, 1))


@dataclass(frozen=True, slots=True)
class PowerSensor(OnJoint):
    """Power P that the body of frame_b receives through a joint or constraint [W].

    It is the transmitted wrench times the velocity of frame_b in the world.

    Attributes:
        joint: name of the joint or constraint.
    """

    reads = "power"

    @property
    def measured(self) -> tuple[Quantity, ...]:
        """The power P [W]."""
        return (Quantity("P", "W"),)
