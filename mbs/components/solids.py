"""Homogeneous solids along x: their inertia follows from dimensions and density."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from mbs.components.component import Component, Point
from mbs.components.inertia_rules import check_mass
from mbs.components.placement import SymbolTable
from mbs.components.rigid_body import RigidBody
from mbs.errors import DescriptionError
from mbs.expressions import Expression, Number, Scalar, expression, to_float, to_sx
from mbs.spatial import Inertia, vector


@dataclass(frozen=True, slots=True)
class _Bar(RigidBody):
    """A solid that runs along x from its left to its right end; the reference frame is at the left.

    Either a density or a mass is given; with neither the solid has no mass.
    """

    length: Scalar = 1.0

    @property
    def left(self) -> Point:
        """The end where the solid starts: its reference frame."""
        return self.frame

    @property
    def right(self) -> Point:
        """The end at x = length."""
        return self.at(self.length)

    @property
    def center(self) -> Point:
        """The middle of the solid, its centre of mass."""
        return self.at(expression(self.length) / 2)

    def _check_solid(self, positive: Iterable[str]) -> None:
        for name in positive:
            value = to_float(getattr(self, name))
            if value is not None and value <= 0:
                raise DescriptionError(
                    f"{self.name}: {name} is {value:g}; give a length above zero"
                )

    def _mass(self, mass: Scalar | None, density: Scalar | None, volume: Expression) -> Expression:
        if mass is not None and density is not None:
            raise DescriptionError(
                f"{self.name}: both mass and density are given; give only one of them"
            )
        if mass is not None:
            return expression(mass)
        return expression(density) * volume if density is not None else Number(0.0)

    def _solid_inertia(
        self, symbols: SymbolTable, mass: Expression, radii: list[Expression]
    ) -> Inertia:
        com = vector([to_sx(expression(self.length) / 2, symbols), 0, 0])
        Ixx, Iyy, Izz = (to_sx(mass * radius, symbols) for radius in radii)
        tensor = Inertia.from_parameters(vector([Ixx, 0, 0, Iyy, 0, Izz, 0, 0, 0, 0])).J
        return Inertia.about_com(to_sx(mass, symbols), com, tensor)


@dataclass(frozen=True, slots=True)
class Box(_Bar):
    """A homogeneous cuboid along x.

    Attributes:
        length, width, height: along x, y and z [m]; the height is the width if not given.
        density: [kg/m^3].
        mass: [kg], instead of the density.
    """

    width: Scalar = 0.1
    height: Scalar | None = None
    density: Scalar | None = None
    mass: Scalar | None = None

    def __post_init__(self) -> None:
        Component.__post_init__(self)
        if self.height is None:
            object.__setattr__(self, "height", self.width)
        self._normalise(*_given(self, "length", "width", "height", "density", "mass"))
        self._check_solid(("length", "width", "height"))
        check_mass(self.name, self.solid_mass)

    @property
    def solid_mass(self) -> Expression:
        """Mass of the solid [kg]."""
        volume = expression(self.length) * self.width * expression(self.height or 0)
        return self._mass(self.mass, self.density, volume)

    def inertial(self, symbols: SymbolTable) -> Inertia:
        """Inertia about the left end."""
        l2, w2, h2 = (expression(side or 0) ** 2 for side in (self.length, self.width, self.height))
        radii = [(w2 + h2) / 12, (l2 + h2) / 12, (l2 + w2) / 12]
        return self._solid_inertia(symbols, self.solid_mass, radii)


@dataclass(frozen=True, slots=True)
class Cylinder(_Bar):
    """A homogeneous round bar or tube along x.

    Attributes:
        length: along x [m].
        radius: outer radius [m].
        inner_radius: of the bore [m].
        density: [kg/m^3].
        mass: [kg], instead of the density.
    """

    radius: Scalar = 0.05
    inner_radius: Scalar = 0.0
    density: Scalar | None = None
    mass: Scalar | None = None

    def __post_init__(self) -> None:
        Component.__post_init__(self)
        self._normalise(*_given(self, "length", "radius", "inner_radius", "density", "mass"))
        self._check_solid(("length", "radius"))
        inner, outer = to_float(self.inner_radius), to_float(self.radius)
        if inner is not None and (inner < 0 or (outer is not None and inner >= outer)):
            raise DescriptionError(
                f"{self.name}: inner_radius is {inner:g}; give 0 <= inner_radius < radius"
            )
        check_mass(self.name, self.solid_mass)

    @property
    def solid_mass(self) -> Expression:
        """Mass of the solid [kg]."""
        area = (expression(self.radius) ** 2 - expression(self.inner_radius) ** 2) * math.pi
        return self._mass(self.mass, self.density, area * self.length)

    def inertial(self, symbols: SymbolTable) -> Inertia:
        """Inertia about the left end."""
        squares = expression(self.radius) ** 2 + expression(self.inner_radius) ** 2
        across = squares / 4 + expression(self.length) ** 2 / 12
        return self._solid_inertia(symbols, self.solid_mass, [squares / 2, across, across])


def _given(component: Component, *names: str) -> list[str]:
    return [name for name in names if getattr(component, name) is not None]
