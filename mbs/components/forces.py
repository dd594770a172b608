"""What force elements have in common: they act on points or on a joint and constrain nothing.

A force element is a component that knows where it acts: `m.add(Spring("s", a.right, b, ...))`. Its
law is written once, on CasADi scalars; the recursions know where its points are.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any, TypeVar

from casadi import SX

from mbs.components.component import Component, Point
from mbs.components.placement import SymbolTable
from mbs.components.rigid_body import RigidBody
from mbs.errors import DescriptionError
from mbs.expressions import Number, to_float
from mbs.messages import quoted

F = TypeVar("F", bound="ForceElement")
J = TypeVar("J", bound="JointForce")


@dataclass(frozen=True, slots=True, eq=False)
class RelativeMotion:
    """How a frame b moves, seen from a frame a and in its axes.

    Attributes:
        p: (3, 1) origin of b [m].
        R: (3, 3) orientation of b.
        V: (3, 1) rate of p [m/s].
        w: (3, 1) angular velocity of b relative to a [rad/s].
    """

    p: SX
    R: SX
    V: SX
    w: SX


@dataclass(frozen=True, slots=True, eq=False)
class Pull:
    """What an element between the frames a and b does to the body of a, in the axes of a.

    The body of b gets the opposite force at its origin.

    Attributes:
        force: (3, 1) on a [N].
        moment_a: (3, 1) on a about the origin of a [N m].
        moment_b: (3, 1) on b about the origin of b [N m].
    """

    force: SX
    moment_a: SX
    moment_b: SX


@dataclass(frozen=True, slots=True)
class ForceElement(Component):
    """A component that acts on others without constraining them."""

    @property
    def points(self) -> tuple[Point, ...]:
        """Where it acts."""
        return ()

    @property
    def coordinate(self) -> str:
        """Name of the joint coordinate that it acts on, or nothing."""
        return ""

    def scoped(self: F, prefix: str) -> F:
        """The same element inside a mechanism that is placed in another one."""
        inner = Component.scoped(self, prefix)
        changed: dict[str, Any] = {}
        for f in fields(self):
            point = getattr(inner, f.name)
            if isinstance(point, Point):
                owner = Component(f"{prefix}.{getattr(self, f.name).owner.name}")
                changed[f.name] = replace(point, owner=owner)
        return replace(inner, **changed)

    def _take_point(self, name: str) -> None:
        """Turn the body or point that a user gave into a point."""
        value = getattr(self, name)
        if isinstance(value, RigidBody):
            value = value.frame
        if not isinstance(value, Point):
            raise DescriptionError(
                f"{self.name}: {name} is {quoted(value)}; give a body, body.at(...) or"
                " joint.frame_a"
            )
        object.__setattr__(self, name, value)

    def _require_magnitudes(self, *names: str) -> None:
        """Refuse numbers below zero in these fields."""
        for name in names:
            given = getattr(self, name)
            for scalar in given if isinstance(given, tuple) else (given,):
                value = to_float(scalar)
                if value is not None and value < 0:
                    raise DescriptionError(f"{self.name}: {name} is {value:g}; give zero or more")

    def _require_positive(self, *names: str) -> None:
        """Refuse zero and numbers below it in these fields."""
        for name in names:
            value = to_float(getattr(self, name))
            if value is not None and value <= 0:
                raise DescriptionError(f"{self.name}: {name} is {value:g}; give more than zero")

    def _require_effect(self, *names: str) -> None:
        """Refuse an element all of whose strengths are zero."""
        values = [getattr(self, name) for name in names]
        flat = [v for value in values for v in (value if isinstance(value, tuple) else (value,))]
        if all(value == Number(0.0) for value in flat):
            raise DescriptionError(
                f"{self.name}: {' and '.join(names)} {'are' if len(names) > 1 else 'is'} zero, so"
                f" that the {type(self).__name__} does nothing; give a strength or leave it out"
            )


@dataclass(frozen=True, slots=True)
class PairForce(ForceElement):
    """An element between two points of two bodies.

    Attributes:
        a, b: the points, or bodies for their reference frames.
    """

    a: Any
    b: Any

    @property
    def points(self) -> tuple[Point, ...]:
        """The two points."""
        return (self.a, self.b)

    def pull(self, motion: RelativeMotion, symbols: SymbolTable) -> Pull:
        """What it does to the body of a."""
        raise NotImplementedError

    def energy(self, motion: RelativeMotion, symbols: SymbolTable) -> SX:
        """Elastic energy stored in it [J]."""
        raise NotImplementedError


@dataclass(frozen=True, slots=True)
class JointForce(ForceElement):
    """An element that acts along a coordinate of a joint.

    Attributes:
        joint: name of the coordinate: the joint, with a suffix when it has several.
    """

    joint: str

    @property
    def coordinate(self) -> str:
        """The name of the coordinate."""
        return self.joint

    def scoped(self: J, prefix: str) -> J:
        """The same element inside a mechanism that is placed in another one."""
        return replace(Component.scoped(self, prefix), joint=f"{prefix}.{self.joint}")

    def _require_joint(self) -> None:
        if not isinstance(self.joint, str) or not self.joint:
            raise DescriptionError(
                f"{self.name}: joint is {quoted(self.joint)}; give the name of a coordinate, such"
                " as 'j1' or 'slide.s'"
            )

    def effort(self, q: SX | None, v: SX, symbols: SymbolTable) -> SX:
        """What the joint needs of effort to overcome it [N m or N]."""
        raise NotImplementedError

    def energy(self, q: SX | None, symbols: SymbolTable) -> SX:
        """Elastic energy stored in it [J]."""
        raise NotImplementedError

    @property
    def needs_position(self) -> bool:
        """Whether the coordinate must be a position, which those of a ball joint are not."""
        return False
