"""Components that know where they are: on points of bodies, or on a joint by its name."""

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
    """A component that is added, not connected, and names the points that it belongs to."""

    @property
    def points(self) -> tuple[Point, ...]:
        """Where it is."""
        return ()

    def scoped(self: P, prefix: str) -> P:
        """The same component inside a mechanism that is placed in another one."""
        return with_points(
            Component.scoped(self, prefix),
            lambda point: replace(point, owner=Component(f"{prefix}.{point.owner.name}")),
        )

    def _take_point(self, name: str) -> None:
        """Convert the body or point that a user gave to a point."""
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
        a, b: the points, or bodies for their reference frames.
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
