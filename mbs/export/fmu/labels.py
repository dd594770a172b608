"""Names beside points, where they do not cover each other."""

from __future__ import annotations

import itertools
from collections.abc import Iterable

from mbs.export.fmu.figure import Label, Point, Style

SIZE = 3.2
"""Height of the letters, in units of the drawing."""

_WIDTH = 0.58  # of a letter, in heights
_Box = tuple[float, float, float, float]
_SIGNS: tuple[Style, ...] = ("joint", "closing")
_SHIFTS = ((3.0, 2.2), (3.0, -4.6), (-3.0, 2.2), (-3.0, -4.6), (0.0, 5.0), (0.0, -7.4))
_FURTHER = (1.0, 1.8, 2.8)
_SIGN = 2.2  # half the side of a square about the sign of a joint


def placed(names: Iterable[tuple[Style, str, Point]]) -> tuple[Label, ...]:
    """A label for each name; names of one style at one point share it.

    Args:
        names: style, text and point of what it names.
    """
    groups: dict[tuple[Style, Point], list[str]] = {}
    for style, text, point in names:
        key = style, (round(point[0], 1), round(point[1], 1))
        groups.setdefault(key, []).append(text)
    taken: list[_Box] = [_about(point) for style, point in groups if style in _SIGNS]
    labels = []
    for (style, point), texts in groups.items():
        text = ", ".join(dict.fromkeys(texts))
        place, box = _free_place(text, point, taken)
        taken.append(box)
        labels.append(Label(style, text, place))
    return tuple(labels)


def _free_place(text: str, point: Point, taken: list[_Box]) -> tuple[Point, _Box]:
    """The first place about the point that is free, else the first one."""
    tried = [
        _at(text, point, (dx * far, dy * far))
        for far, (dx, dy) in itertools.product(_FURTHER, _SHIFTS)
    ]
    return next((t for t in tried if not any(_meet(t[1], box) for box in taken)), tried[0])


def _at(text: str, point: Point, shift: Point) -> tuple[Point, _Box]:
    width = _WIDTH * SIZE * len(text)
    x, y = point[0] + shift[0], point[1] + shift[1]
    x -= width if shift[0] < 0 else width / 2 if shift[0] == 0 else 0.0
    return (x, y), (x, y, x + width, y + SIZE)


def _about(point: Point) -> _Box:
    return point[0] - _SIGN, point[1] - _SIGN, point[0] + _SIGN, point[1] + _SIGN


def _meet(a: _Box, b: _Box) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]
