"""Components that contain their attachment: points of bodies, or the name of a joint."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, TypeVar

from mbs.components.bodies import RigidBody
from mbs.components.component import Component, Point, with_points
from mbs.errors import DescriptionError
from mbs.text import quoted

P = TypeVar("P", bound="OnPoints")


@dataclass(frozen=True, slots=True)
class OnPoints(Component):
    """Base of components that contain their points: added by `add` without `connect`."""

    @property
    def points(self) -> tuple[Point, ...]:
        """Points that the component is attached to."""
        return ()

    def scoped(self: P, prefix: str) -> P:
        """Return the component with prefixed names, for a nested mechanism."""
        return with_points(
            Component.scoped(self, prefix),
            lambda point: replace(point, owner=Component(f"{prefix}.{point.owner.name}")),
        )

    def _take_point(self, name: str) -> None:
        """Convert the field `name`, a body or a point, to a point."""
        object.__setattr__(self, name, self._as_point(getattr(self, name), name))

    def _as_point(self, value: Any, name: str) -> Point:
        if isinstance(value, RigidBody):
            value = value.frame
        if not isinstance(value, Point):
            raise DescriptionError(
                f"{self.name}: {name} is {quoted(value)}; give a body, body.at(...) or"
                " joint.frame_a"
            )
        return value


@dataclass(frozen=True, slots=True)
class OnPair(OnPoints):
    """A component between two points.

    Attributes:
        a, b: two points. A body stands for its reference frame.
    """

    a: Any
    b: Any

    def __post_init__(self) -> None:
        Component.__post_init__(self)
        self._take_point("a")
        self._take_point("b")

    @property
    def points(self) -> tuple[Point, ...]:
        """The two points."""
        return (self.a, self.b)
