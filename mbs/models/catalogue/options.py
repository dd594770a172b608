"""The options that several models share."""

from __future__ import annotations

from mbs.assembly import System
from mbs.models.catalogue.entry import NOTHING, Chosen, Offer, Option, Values
from mbs.models.catalogue.regular_part import ROWS, regular_part
from mbs.models.geometry import terminal_frame


def _constant(value: object) -> Offer:
    def offer(system: System, chosen: Chosen = NOTHING, /) -> object:
        return value

    return offer


def _terminal(system: System, chosen: Chosen = NOTHING, /) -> str | int:
    return terminal_frame(system)


def _frames(system: System, chosen: Chosen = NOTHING, /) -> Values:
    return (*range(len(system.tree.links) + 1), *system.frames)


def _speeds(system: System, chosen: Chosen = NOTHING, /) -> Values:
    every = chosen.get("coordinates") == "tree"
    return tuple(system.speeds[k].name for k in (range(system.nv) if every else system.active))


def _rows(system: System, chosen: Chosen = NOTHING, /) -> tuple[str, ...]:
    return _part(system, chosen)[0]


def _columns(system: System, chosen: Chosen = NOTHING, /) -> tuple[str, ...]:
    return _part(system, chosen)[1]


def _part(system: System, chosen: Chosen) -> tuple[tuple[str, ...], tuple[str, ...]]:
    frame = chosen.get("frame", terminal_frame(system))
    axes, coordinates = chosen.get("expressed_in", 0), chosen.get("coordinates", "independent")
    return regular_part(
        system, (frame, axes, coordinates), chosen.get("rows"), chosen.get("columns")
    )


def one_frame(name: str, title: str, default: Offer) -> Option:
    """One frame of the system: the number of a link, 0 for the base, or a name."""
    return Option(name, title, "frame", _frames, default)


def choice(name: str, title: str, *values: str) -> Option:
    """One of some texts, the first when nothing is said."""
    return Option(name, title, "choice", _constant(values), _constant(values[0]))


def flag(name: str, title: str) -> Option:
    """Yes or no, no when nothing is said."""
    return Option(name, title, "flag", _constant((False, True)), _constant(False))


def several(name: str, title: str, values: Offer, default: Offer) -> Option:
    """Several values of a list."""
    return Option(name, title, "several", values, default)


BASE = _constant(0)
TARGET = one_frame("frame", "frame", _terminal)
AXES = one_frame("expressed_in", "axes of frame", BASE)
COORDINATES = Option(
    "coordinates",
    "coordinates",
    "choice",
    _constant(("independent", "tree")),
    _constant("independent"),
    structures="closed",
)
F_EXT = flag("f_ext", "external wrenches on the bodies")
MOVING_BASE = flag("moving_base", "moving base")
SELECTION = (
    TARGET,
    AXES,
    COORDINATES,
    several("rows", "rows", _constant(ROWS), _rows),
    several("columns", "columns", _speeds, _columns),
)
METHODS = choice("method", "method", "auto", "composite", "articulated")
