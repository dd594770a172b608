"""Gravity and mount of a robot, from texts of the command line or the app."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from mbs.errors import DescriptionError
from mbs.text import quoted

_AXES = ("x", "y", "z")


def mounting_of(
    gravity: str = "", mount: Sequence[str] = (), *, names: tuple[str, str] = ("gravity", "mount")
) -> dict[str, Any]:
    """Return the arguments `gravity` and `mount` of `mbs.load`; an empty text is omitted.

    Args:
        gravity: three numbers or expressions, such as "0, 0, -1.62" [m/s^2].
        mount: rotations about axes such as "x=pi", in order, and "position=0, 0, 2.5" [m].
        names: names of the two texts, for error messages.

    Raises:
        DescriptionError: a text has another form.
    """
    found: dict[str, Any] = {}
    if gravity.strip():
        found["gravity"] = _three(gravity, names[0])
    if mount:
        found["mount"] = _mount(mount, names[1])
    return found


def _mount(texts: Sequence[str], where: str) -> dict[str, Any]:
    """Return the argument `mount` of `mbs.load`: rotations about axes in order, and a position.

    Raise a DescriptionError that begins with `where` if a text is not a step of a mount.
    """
    rotation, position = list[tuple[str, str]](), list[list[str]]()
    for text in texts:
        name, _, value = (part.strip() for part in text.partition("="))
        if name in _AXES and value:
            rotation.append((name, value))
        elif name == "position" and value:
            position.append(_three(value, f"{where} position"))
        else:
            raise DescriptionError(
                f"{where}: {quoted(text)} is no step of a mount; write a rotation as x=pi/2 and a"
                " position as position=0,0,2.5"
            )
    if len(position) > 1:
        raise DescriptionError(f"{where}: the position is given twice; give it once")
    found: dict[str, Any] = {"rotation": rotation} if rotation else {}
    return found | ({"position": position[0]} if position else {})


def _three(text: str, where: str) -> list[str]:
    """Return the three texts that commas separate; raise a DescriptionError for another number."""
    parts = [part.strip() for part in text.split(",")]
    if len(parts) != 3 or not all(parts):
        raise DescriptionError(
            f"{where}: {quoted(text)} has not three values; write them as 0,0,-9.81"
        )
    return parts
