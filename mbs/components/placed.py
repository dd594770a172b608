"""A handle to a mechanism that was placed inside another one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from mbs.components.component import Component, Point
from mbs.components.rigid_body import RigidBody
from mbs.errors import DescriptionError

if TYPE_CHECKING:
    from mbs.components.mechanism import Mechanism


@dataclass(frozen=True, slots=True)
class Placed:
    """A mechanism inside another one: `arm["forearm"]` is its component, `arm.base` its ground."""

    outer: Mechanism
    scope: str

    def __getitem__(self, name: str) -> Component:
        full = f"{self.scope}.{name}"
        if full not in self.outer.components:
            inside = sorted(n for n in self.outer.components if n.startswith(f"{self.scope}."))
            raise DescriptionError(f"{full!r} does not exist; the components are {inside}")
        return self.outer.components[full]

    def body(self, name: str) -> RigidBody:
        """The body of that name."""
        component = self[name]
        if not isinstance(component, RigidBody):
            raise DescriptionError(
                f"{component.name} is a {type(component).__name__}, not a body; name a body"
            )
        return component

    def point(self, name: str) -> Point:
        """The frame that the inner mechanism gave this name."""
        full = f"{self.scope}.{name}"
        if full not in self.outer.frames:
            inside = sorted(n for n in self.outer.frames if n.startswith(f"{self.scope}."))
            raise DescriptionError(f"{full!r} is not a frame; the frames are {inside}")
        return self.outer.frames[full]

    @property
    def base(self) -> RigidBody:
        """The ground of the inner mechanism, to be connected to something."""
        return self.body("world")


def moved(point: Point, placed: Mapping[str, Component], scope: str) -> Point:
    """A point of the inner mechanism on the component that was placed for its owner."""
    owner = placed[point.owner.name]
    return replace(point, owner=owner, placement=point.placement.scoped(scope))
