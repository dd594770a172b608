"""Values that are given by the names of coordinates.

Names of variables of FMUs and results, such as j1.q, are alternatives to the names of coordinates.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping
from typing import Any

from mbs.assembly.tables import Coordinate
from mbs.errors import ModelError
from mbs.numbers import numbers_given

_KINDS = {
    "q": ("a position", "q0"),
    "v": ("a velocity", "v0"),
    "tau": ("an effort", "tau"),
    "solved": ("a guess", "guess"),
}
"""Quantity and argument of `run`, by the end of the name of a variable."""

POSITIONS = ("q",)
"""Ends of the names of positions."""

GUESSES = ("q", "solved")
"""Ends of the names of guesses: in FMUs, j2.solved is the guess of a dependent position."""

VELOCITIES = ("v",)
"""Ends of the names of velocities."""

EFFORTS = ("tau",)
"""Ends of the names of efforts."""


def by_coordinate(
    owner: str, values: Mapping[str, Any], names: Collection[str], kinds: Collection[str]
) -> dict[str, Any]:
    """Return values by the names of coordinates; unknown names stay as they are.

    Args:
        owner: name of the system, for messages.
        values: values by the names of coordinates, such as j1, or of variables, such as j1.q.
        names: names of the coordinates.
        kinds: ends of the names of variables that are accepted.

    Raises:
        ModelError: a value is given by both names, or the variable is another quantity.
    """
    found: dict[str, Any] = {}
    given: dict[str, str] = {}
    for name, value in values.items():
        base, _, kind = str(name).rpartition(".")
        plain = name
        if name not in names and base in names and kind in _KINDS:
            if kind not in kinds:
                what, argument = _KINDS[kind]
                raise ModelError(
                    f"{owner}: {name} is {what}, which has no effect here; give it in {argument}"
                )
            plain = base
        if plain in found:
            raise ModelError(
                f"{owner}: {given[plain]} and {name} are the same variable; give it once"
            )
        found[plain], given[plain] = value, str(name)
    return found


# Angles that look like degrees although angles are in radians.


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
