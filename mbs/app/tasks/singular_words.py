"""When a factor of a determinant is zero, in words."""

from __future__ import annotations

import re
from collections.abc import Sequence

_SHORT = re.compile(r"([SC])(\d+)")
_CALLED = re.compile(r"(sin|cos)\(([^()]*)\)")
_BLOCK = re.compile(r"determinant of the (\d+ x \d+) block of (.*)")


def condition(text: str, coordinates: Sequence[tuple[str, bool]]) -> str:
    """When a factor is zero, such as "q3 is -pi/2 or pi/2 (C3 = 0)".

    Args:
        text: of the factor; S23 is sin(q2 + q3).
        coordinates: name of each position, and whether it turns.
    """
    block = _BLOCK.fullmatch(text)
    if block:
        return f"the {block[1]} block of {block[2]} is singular"
    found = _angle(text, [name for name, turns in coordinates if turns])
    if found is not None:
        kind, angle = found
        zeros = "0 or pi" if kind == "s" else "-pi/2 or pi/2"
        return f"{angle} is {zeros} ({text} = 0)"
    if text in [name for name, _ in coordinates]:
        return f"{text} is 0"
    return f"{text} = 0"


def _angle(text: str, turning: Sequence[str]) -> tuple[str, str] | None:
    """Either "s" or "c" and the angle, where the text is one sine or cosine of positions."""
    short = _SHORT.fullmatch(text)
    if short:
        names = [f"q{digit}" for digit in short[2]]
        return (short[1].lower(), " + ".join(names)) if set(names) <= set(turning) else None
    called = _CALLED.fullmatch(text)
    return (called[1][0], called[2]) if called else None
