"""A Gough-Stewart platform on six telescopic legs."""

from __future__ import annotations

from math import acos, atan2, hypot, pi

import numpy as np
from numpy.typing import NDArray

from mbs.components import (
    Body,
    Prismatic,
    Spherical,
    Universal,
)
from mbs.mechanism import Mechanism

_SOURCE = (
    "Structure: Gough & Whitehall 1962, Stewart 1965; lengths, masses and inertias are illustrative"
)
_BASE, _TOP, _HEIGHT = 0.6, 0.3, 0.7
_HALF_ANGLE = 0.2
_BARREL, _PISTON = 0.4, 0.4

Points = NDArray[np.float64]


def stewart_platform() -> Mechanism:
    """Gough-Stewart platform on six legs with one prismatic motor each.

    Each leg has a universal joint at the base, the actuated prismatic joint leg1 .. leg6, and a
    spherical joint at the platform. The lower joints lie in pairs on a circle of 0.6 m radius, the
    upper joints in pairs on a circle of 0.3 m, with each upper pair between two lower pairs. The
    platform is assembled level, 0.7 m above the base. In this configuration all coordinates of the
    legs are zero: leg<k> is the extension of leg k from there. The frame `centre` is in the middle
    of the upper circle.

    Source: structure of Gough & Whitehall 1962 and Stewart 1965. Lengths, masses and inertias are
    illustrative.
    """
    m = Mechanism("stewart_platform", source=_SOURCE)
    platform = m.add(Body("platform", mass=10, com=(0, 0, 0.02), inertia=(0.24, 0.24, 0.45)))
    m.add_frame("centre", platform)
    base, top = leg_ends()
    for k, (low, high) in enumerate(zip(base, top, strict=True)):
        x, y, z = high - low
        length = hypot(x, y, z)
        along = [("z", atan2(y, x)), ("y", acos(z / length))]
        barrel = m.add(_tube(f"barrel{k + 1}", 2.0, (0, 0, _BARREL / 2), _BARREL))
        piston = m.add(_tube(f"piston{k + 1}", 0.8, (0, 0, -_PISTON / 2), _PISTON))
        foot = m.world.at(*low, rotation=along)
        head = platform.at(*(high - [0, 0, _HEIGHT]), rotation=along)
        m.connect(foot, Universal(f"foot{k + 1}"), barrel)
        motor = Prismatic(f"leg{k + 1}", axis="z", actuated=True)
        m.connect(barrel.at(0, 0, length), motor, piston)
        m.connect(piston, Spherical(f"head{k + 1}"), head)
    return m


def leg_ends() -> tuple[Points, Points]:
    """Return the lower and upper ends of the six legs in the assembled configuration.

    Returns:
        Two arrays (6, 3) of positions in the base frame [m].
    """
    thirds = np.repeat(2 * pi / 3 * np.arange(3), 2)
    sides = np.tile([-1.0, 1.0], 3)
    low, high = thirds + sides * (pi / 3 - _HALF_ANGLE), thirds + sides * _HALF_ANGLE
    return _circle(_BASE, low, 0.0), _circle(_TOP, high, _HEIGHT)


def _circle(radius: float, angles: Points, height: float) -> Points:
    """Return points (k, 3) on a horizontal circle, with `radius` and `height` in [m].

    Their positions on the circle are the `angles` (k,) [rad].
    """
    heights = np.full(len(angles), height)
    return np.column_stack([radius * np.cos(angles), radius * np.sin(angles), heights])


def _tube(name: str, mass: float, com: tuple[float, float, float], length: float) -> Body:
    """Return a slender tube along z of the given length [m]; `com` is its centre of mass [m]."""
    across = mass * length**2 / 12
    return Body(name, mass=mass, com=com, inertia=(across, across, 5e-4 * mass))
