"""Mount of the base of a mechanism in the world: its position and its rotation."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

from mbs.components.bodies import three
from mbs.components.component import ElementaryRotation, Rotation, Step, displacement
from mbs.components.notes import ImportNote
from mbs.errors import DescriptionError
from mbs.expressions import to_float
from mbs.text import quoted

Mounting = Rotation | Mapping[str, Any]
"""Rotation of a base, or a dict with its "position" (x, y, z) [m] and its "rotation"."""


def mount_of(mount: Any, where: str) -> tuple[tuple[Step, ...], Rotation | None]:
    """Return the displacement steps from the world to a mounted base, and its rotation.

    Args:
        mount: rotation, or a dict with "position" and "rotation", one of which may be left out.
        where: name of the mount in error messages.

    Raises:
        DescriptionError: the dict has other entries, or values that are no position or rotation.
    """
    if not isinstance(mount, Mapping):
        return displacement(where, 0.0, 0.0, 0.0, mount), mount
    known = ("position", "rotation")
    if not mount or not set(mount) <= set(known):
        raise DescriptionError(
            f"{where} is {quoted(dict(mount))}; give a rotation, or a dict with"
            " 'position': (x, y, z) and 'rotation': ('x', 'pi')"
        )
    x, y, z = three(mount.get("position", (0.0, 0.0, 0.0)), f"{where}, position")
    rotation = mount.get("rotation")
    return displacement(where, x, y, z, rotation), rotation


_REVOLUTION = 2 * math.pi
"""Angle [rad] above which a mount angle is noted as possible degrees: a mount needs no more."""


def notes_on_degrees(steps: Iterable[Step]) -> list[ImportNote]:
    """Return a note "doubted" for each rotation by more than one revolution.

    Its angle is probably in degrees.

    Args:
        steps: displacement steps of a mount.
    """
    angles = [
        (step.axis, to_float(step.angle)) for step in steps if isinstance(step, ElementaryRotation)
    ]
    return [
        ImportNote("doubted", "mount", f"{axis} = {angle:g} rad may be degrees; give radians")
        for axis, angle in angles
        if angle is not None and abs(angle) > _REVOLUTION
    ]
