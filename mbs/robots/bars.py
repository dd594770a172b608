"""Homogeneous bars by the vector from end to end, in the axes of their surroundings."""

from __future__ import annotations

import math
from math import pi

import numpy as np

from mbs.components import Body

Vector = tuple[float, float, float]


def round_bar(name: str, r: Vector, diameter: float, density: float) -> Body:
    """A round bar from the reference frame to r [m]; diameter [m], density [kg/m^3]."""
    along = np.array(r)
    length, radius = math.hypot(*r), diameter / 2
    mass = density * pi * radius**2 * length
    axis = np.outer(along, along) / length**2
    across = mass * (3 * radius**2 + length**2) / 12
    inertia = across * np.eye(3) + (mass * radius**2 / 2 - across) * axis
    return Body(name, mass=mass, com=tuple(along / 2), inertia=inertia)


def square_bar(name: str, r: Vector, sides: Vector, density: float) -> Body:
    """A cuboid with its middle at r / 2 [m] and these sides along x, y, z [m]."""
    x, y, z = (side**2 for side in sides)
    mass = density * float(np.prod(sides))
    inertia = tuple(mass * square / 12 for square in (y + z, x + z, x + y))
    return Body(name, mass=mass, com=tuple(np.array(r) / 2), inertia=inertia)
