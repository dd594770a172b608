"""A mechanism that is placed inside another one, and the handle to it."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from mbs.components.component import Component, Point
from mbs.components.rigid_body import Mount, RigidBody
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


_SCOPE = re.compile(r"[A-Za-z_]\w*(?:\.[A-Za-z_]\w*)*", re.ASCII)


def place(outer: Mechanism, inner: Mechanism, name: str) -> Placed:
    """Copy the components of a mechanism into another one, their names scoped by its own.

    Raises:
        DescriptionError: the name is taken or cannot stand before those of parameters.
    """
    scope = Component(name).name
    if inner is outer:
        raise DescriptionError(
            f"{outer.name}: a mechanism cannot be added to itself; add it to another one"
        )
    if any(inner.used_parameters()) and not _SCOPE.fullmatch(scope):
        raise DescriptionError(
            f"{outer.name}: {scope!r} cannot stand before the names of parameters; write"
            " add(mechanism, name=...) with letters, digits and underscores"
        )
    if any(taken == scope or taken.startswith(f"{scope}.") for taken in outer.components):
        raise DescriptionError(f"{outer.name}: two components are named {scope!r}; rename one")
    placed: dict[str, Component] = {}
    for component in inner.components.values():
        if component is inner.world:
            placed[component.name] = outer.add(Mount(f"{scope}.{component.name}"))
        else:
            placed[component.name] = outer.add(component.scoped(scope))
    outer.connections.extend(
        (moved(a, placed, scope), moved(b, placed, scope)) for a, b in inner.connections
    )
    outer.shafts.extend(
        (replace(a, owner=placed[a.owner.name]), replace(b, owner=placed[b.owner.name]))
        for a, b in inner.shafts
    )
    for frame, point in inner.frames.items():
        outer.frames[f"{scope}.{frame}"] = moved(point, placed, scope)
    outer.cuts.extend(f"{scope}.{joint}" for joint in inner.cuts)
    outer.guess.update({f"{scope}.{name}": value for name, value in inner.guess.items()})
    used = {parameter.name for parameter in outer.used_parameters()}
    for symbol, value in inner.values.items():
        if (scoped := f"{scope}.{symbol}") in used:  # not what only its gravity used
            outer.values[scoped] = replace(value, name=scoped)
    return Placed(outer, scope)


def moved(point: Point, placed: Mapping[str, Component], scope: str) -> Point:
    """A point of the inner mechanism on the component that was placed for its owner."""
    owner = placed[point.owner.name]
    return replace(point, owner=owner, placement=point.placement.scoped(scope))
