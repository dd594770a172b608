"""The options that several models share."""

from __future__ import annotations

from collections.abc import Callable

from mbs.assembly import System
from mbs.models.catalogue.entry import Option, Values
from mbs.models.geometry import terminal_frame

ROWS = ("Vx", "Vy", "Vz", "wx", "wy", "wz")


def _frames(system: System) -> Values:
    return (*range(len(system.tree.links) + 1), *system.frames)


def _speeds(system: System) -> Values:
    return tuple(system.speeds[k].name for k in system.active)


def one_frame(name: str, title: str, default: Callable[[System], str | int]) -> Option:
    """One frame of the system: the number of a link, 0 for the base, or a name."""
    return Option(name, title, "frame", _frames, default)


def choice(name: str, title: str, *values: str) -> Option:
    """One of some texts, the first when nothing is said."""
    return Option(name, title, "choice", lambda _: values, lambda _: values[0])


def flag(name: str, title: str) -> Option:
    """Yes or no, no when nothing is said."""
    return Option(name, title, "flag", lambda _: (False, True), lambda _: False)


def several(name: str, title: str, values: Callable[[System], Values]) -> Option:
    """Several values of a list; the builder chooses when nothing is said."""
    return Option(name, title, "several", values, lambda _: None)


TARGET = one_frame("frame", "frame", terminal_frame)
AXES = one_frame("expressed_in", "in the axes of frame", lambda _: 0)
COORDINATES = choice("coordinates", "coordinates", "independent", "tree")
F_EXT = flag("f_ext", "external wrenches on the bodies")
MOVING_BASE = flag("moving_base", "moving base")
SELECTION = (
    TARGET,
    several("rows", "rows", lambda _: ROWS),
    several("columns", "columns", _speeds),
    AXES,
    COORDINATES,
)
METHODS = choice("method", "method", "auto", "composite", "articulated")
