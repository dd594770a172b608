"""Angles that look like degrees although angles are in radians."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

from mbs.assembly.tables import Coordinate
from mbs.numbers import numbers_given

_LARGEST = 20.0
"""Angle [rad] of about three revolutions, beyond which a start without limits looks like degrees:
designers write 30, 45 and 90 degrees, and few motions start after more revolutions."""
_REVOLUTION = 2 * math.pi
"""Angle [rad] beyond which a start outside the limits of its joint looks like degrees."""


def like_degrees(coordinates: Iterable[Coordinate], given: object) -> str:
    """Return a note on angles that look like degrees instead of radians; empty if none do.

    Args:
        coordinates: coordinates of the system.
        given: positions by name. The note is empty for an argument of another type.
    """
    if not isinstance(given, Mapping):
        return ""
    rows = {coordinate.name: coordinate for coordinate in coordinates}
    numbers = {name: numbers_given(value) for name, value in given.items() if name in rows}
    angles = {
        name: float(number.ravel()[0])
        for name, number in numbers.items()
        if not isinstance(number, str) and number.size == 1
    }
    found = [f"{name} = {x:g}" for name, x in angles.items() if _looks_like_degrees(rows[name], x)]
    return f"{', '.join(found)} rad may be degrees; give radians" if found else ""


def _looks_like_degrees(coordinate: Coordinate, angle: float) -> bool:
    """Whether an angle [rad] is far outside the limits of its coordinate, or very large."""
    if coordinate.unit != "rad":
        return False
    if coordinate.limits is None:
        return abs(angle) > _LARGEST
    low, high = coordinate.limits
    return abs(angle) > _REVOLUTION and not low <= angle <= high
