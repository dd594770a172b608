"""What every rigid body has, and the two bodies without inertia: the world and a mount."""

from __future__ import annotations

from dataclasses import dataclass

from mbs.components.component import Component, Point
from mbs.components.inertia_rules import three
from mbs.components.placement import Rotation, SymbolTable
from mbs.expressions import Scalar
from mbs.spatial import Inertia


@dataclass(frozen=True, slots=True)
class RigidBody(Component):
    """A component with a reference frame on which other frames are placed."""

    @property
    def frame(self) -> Point:
        """The reference frame."""
        return Point(self)

    def at(
        self, x: Scalar = 0, y: Scalar = 0, z: Scalar = 0, *, rotation: Rotation | None = None
    ) -> Point:
        """The point (x, y, z) [m] of the reference frame, its axes turned by `rotation`."""
        return self.frame.at(x, y, z, rotation=rotation)

    def at_khalil(self, **parameters: Scalar) -> Point:
        """The frame with these Khalil parameters gamma, b, alpha, d, theta, r."""
        return self.frame.at_khalil(**parameters)

    def inertial(self, symbols: SymbolTable) -> Inertia:
        """Inertia about the origin of the reference frame, on CasADi symbols."""
        raise NotImplementedError


@dataclass(frozen=True, slots=True)
class World(RigidBody):
    """The ground, the frame in which gravity is given.

    Attributes:
        gravity: gravity acceleration in the world frame [m/s^2].
    """

    name: str = "world"
    gravity: tuple[Scalar, ...] = (0.0, 0.0, -9.81)

    def __post_init__(self) -> None:
        Component.__post_init__(self)
        object.__setattr__(self, "gravity", three(self.gravity, f"{self.name}, gravity"))

    def inertial(self, symbols: SymbolTable) -> Inertia:
        """The ground does not move: no inertia."""
        return Inertia.zero()


@dataclass(frozen=True, slots=True)
class Mount(RigidBody):
    """A frame without mass: the ground of a nested mechanism, to be connected to something."""

    def inertial(self, symbols: SymbolTable) -> Inertia:
        """No inertia."""
        return Inertia.zero()
