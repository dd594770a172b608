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
    """Base of components that have attachment points as fields.

    They are placed by `Mechanism.add` alone, without a connection.
    """

    @property
    def points(self) -> tuple[Point, ...]:
        """Points of bodies to which the component is attached; empty without such points."""
        return ()

    def scoped(self: P, prefix: str) -> P:
        """Return a copy whose name, parameters and owners of points have the prefix "`prefix`.".

        Args:
            prefix: text before the names, without the dot.
        """
        return with_points(
            Component.scoped(self, prefix),
            lambda point: replace(point, owner=Component(f"{prefix}.{point.owner.name}")),
        )

    def _take_point(self, name: str) -> None:
        """Replace a body in the field `name` by its reference frame, in place.

        Raise DescriptionError if the field is neither a body nor a point.
        """
        object.__setattr__(self, name, self._as_point(getattr(self, name), name))

    def _as_point(self, value: Any, name: str) -> Point:
        """Return a point, or the reference frame of a body.

        Raise DescriptionError for other values. `name` is the field in the message.
        """
        if isinstance(value, RigidBody):
            value = value.frame
        if not isinstance(value, Point):
            raise DescriptionError(
                f"{self.name}: {name} is {quoted(value)}; give a body, body.at(...) or"
                " joint.frame_a"
            )
        return value

    def _require_axes(
        self,
        allowed: tuple[str, ...] = ("world", "body"),
        meaning: str = "'world', or 'body' for those of the point, which rotate with it",
    ) -> None:
        """Raise DescriptionError if the field `axes` is not allowed; `meaning` is the advice."""
        axes = getattr(self, "axes", None)
        if axes not in allowed:
            raise DescriptionError(f"{self.name}: axes is {quoted(axes)}; use {meaning}")


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
        """The two attachment points (a, b)."""
        return (self.a, self.b)
