"""Constant forces and torques on a body."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi
from casadi import SX

from mbs.components.component import Component, Point
from mbs.components.forces import ForceElement
from mbs.components.inertia_rules import three
from mbs.components.placement import SymbolTable
from mbs.errors import DescriptionError
from mbs.expressions import Expression, to_sx
from mbs.messages import quoted
from mbs.spatial import vector, zeros

_AXES = ("world", "body")


@dataclass(frozen=True, slots=True)
class PointSource(ForceElement):
    """Something constant that acts on one point.

    Attributes:
        point: of a body, or a body for its reference frame.
    """

    point: Any

    @property
    def points(self) -> tuple[Point, ...]:
        """The one point."""
        return (self.point,)

    @property
    def follows(self) -> bool:
        """Whether its direction turns with the body."""
        raise NotImplementedError

    def wrench(self, R: SX, symbols: SymbolTable) -> tuple[SX, SX]:
        """Force and moment on the body about the point, in its axes.

        Args:
            R: (3, 3) orientation of the point's frame in the world.
            symbols: CasADi symbol of every parameter.
        """
        raise NotImplementedError

    def _settle(self, name: str) -> None:
        """Check what every source has; `name` is the field of its three components."""
        Component.__post_init__(self)
        self._take_point("point")
        object.__setattr__(self, name, three(getattr(self, name), f"{self.name}, {name}"))
        self._require_effect(name)
        axes = getattr(self, "axes", None)
        if axes not in _AXES:
            raise DescriptionError(
                f"{self.name}: axes is {quoted(axes)}; use 'world', or 'body' for those of the"
                " point, which turn with it"
            )


@dataclass(frozen=True, slots=True)
class Force(PointSource):
    """A constant force.

    Attributes:
        force: its three components [N].
        axes: "world" for a direction fixed in space, "body" for one that turns with the point.
    """

    force: Any
    axes: str = "world"

    def __post_init__(self) -> None:
        self._settle("force")

    @property
    def follows(self) -> bool:
        """Whether its direction turns with the body."""
        return self.axes == "body"

    def wrench(self, R: SX, symbols: SymbolTable) -> tuple[SX, SX]:
        """The force, without a moment about its point."""
        return _turned(self.force, self.follows, R, symbols), zeros()


@dataclass(frozen=True, slots=True)
class Torque(PointSource):
    """A constant torque.

    Attributes:
        torque: its three components [N m].
        axes: "world" for a direction fixed in space, "body" for one that turns with the point.
    """

    torque: Any
    axes: str = "world"

    def __post_init__(self) -> None:
        self._settle("torque")

    @property
    def follows(self) -> bool:
        """Whether its direction turns with the body."""
        return self.axes == "body"

    def wrench(self, R: SX, symbols: SymbolTable) -> tuple[SX, SX]:
        """The torque alone."""
        return zeros(), _turned(self.torque, self.follows, R, symbols)


def _turned(components: tuple[Expression, ...], follows: bool, R: SX, symbols: SymbolTable) -> SX:
    value = vector(to_sx(component, symbols) for component in components)
    return value if follows else casadi.densify(casadi.mtimes(R.T, value))
