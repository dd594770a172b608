"""Homogeneous bars by the vector from end to end, in the axes of their surroundings."""

from __future__ import annotations

import math
from math import pi

import numpy as np

from mbs.components import Body

Vector = tuple[float, float, float]


def round_bar(name: str, r: Vector, diameter: float, density: float) -> Body:
    """Return a homogeneous round bar between two points.

    Args:
        name: name of the body.
        r: vector from the origin of the reference frame, where the bar begins, to its end [m].
        diameter: diameter [m].
        density: density [kg/m^3].
    """
    along = np.array(r)
    length, radius = math.hypot(*r), diameter / 2
    mass = density * pi * radius**2 * length
    axis = np.outer(along, along) / length**2
    across = mass * (3 * radius**2 + length**2) / 12
    inertia = across * np.eye(3) + (mass * radius**2 / 2 - across) * axis
    return Body(name, mass=mass, com=tuple(along / 2), inertia=inertia)


def square_bar(name: str, r: Vector, sides: Vector, density: float) -> Body:
    """Return a homogeneous cuboid with its centre at r / 2.

    Args:
        name: name of the body.
        r: twice the vector from the origin of the reference frame to the centre [m].
        sides: lengths along x, y, z of the reference frame [m].
        density: density [kg/m^3].
    """
    x, y, z = (side**2 for side in sides)
    mass = density * float(np.prod(sides))
    inertia = tuple(mass * square / 12 for square in (y + z, x + z, x + y))
    return Body(name, mass=mass, com=tuple(np.array(r) / 2), inertia=inertia)
