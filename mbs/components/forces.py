"""What force elements have in common: they act on points or on a joint and constrain nothing.

A force element is a component that knows where it acts: `m.add(Spring("s", a.right, b, ...))`. Its
law is written once, on CasADi scalars; the recursions know where its points are.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TypeVar

from casadi import SX

from mbs.components.component import Component
from mbs.components.on_points import OnPair, OnPoints
from mbs.components.placement import SymbolTable
from mbs.errors import DescriptionError
from mbs.expressions import Number, Scalar, to_float
from mbs.messages import quoted

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
class ForceElement(OnPoints):
    """A component that acts on others without constraining them."""

    @property
    def levers(self) -> tuple[tuple[str, Scalar], ...]:
        """The joint coordinates that it acts on, and how much of each; none for one on points."""
        return ()

    @property
    def scope(self) -> str:
        """Where it counts, in words; nothing for an element of all models."""
        return ""

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
class PairForce(OnPair, ForceElement):
    """An element between two points of two bodies.

    Attributes:
        a, b: the points, or bodies for their reference frames.
    """

    def pull(self, motion: RelativeMotion, symbols: SymbolTable) -> Pull:
        """What it does to the body of a."""
        raise NotImplementedError

    def energy(self, motion: RelativeMotion, symbols: SymbolTable) -> SX:
        """Elastic energy stored in it [J]."""
        raise NotImplementedError


@dataclass(frozen=True, slots=True)
class CoordinateForce(ForceElement):
    """An element that acts on x, the sum of some joint coordinates, each times its lever."""

    def effort(self, x: SX | None, rate: SX, symbols: SymbolTable) -> SX:
        """What x needs of effort to overcome it [N m or N]; every coordinate its lever times it."""
        raise NotImplementedError

    def energy(self, x: SX | None, symbols: SymbolTable) -> SX:
        """Elastic energy stored in it [J]."""
        raise NotImplementedError

    @property
    def needs_position(self) -> bool:
        """Whether the coordinates must be positions, which those of a ball joint are not."""
        return False


@dataclass(frozen=True, slots=True)
class JointForce(CoordinateForce):
    """An element that acts along a coordinate of a joint.

    Attributes:
        joint: name of the coordinate: the joint, with a suffix when it has several.
    """

    joint: str

    def __post_init__(self) -> None:
        Component.__post_init__(self)
        if not isinstance(self.joint, str) or not self.joint:
            raise DescriptionError(
                f"{self.name}: joint is {quoted(self.joint)}; give the name of a coordinate, such"
                " as 'j1' or 'slide.s'"
            )

    @property
    def levers(self) -> tuple[tuple[str, Scalar], ...]:
        """The coordinate itself."""
        return ((self.joint, Number(1.0)),)

    def _take_limits(self) -> None:
        """Turn the fields lower and upper of a stop into expressions, checking them."""
        sides = [name for name in ("lower", "upper") if getattr(self, name) is not None]
        if not sides:
            raise DescriptionError(
                f"{self.name}: a stop has neither lower nor upper; give one limit or both"
            )
        self._normalise(*sides)
        low, high = (to_float(getattr(self, s)) if s in sides else None for s in ("lower", "upper"))
        if low is not None and high is not None and low >= high:
            raise DescriptionError(
                f"{self.name}: lower is {low:g} and upper is {high:g}; give them in order"
            )

    def scoped(self: J, prefix: str) -> J:
        """The same element inside a mechanism that is placed in another one."""
        return replace(Component.scoped(self, prefix), joint=f"{prefix}.{self.joint}")
