"""A model as menus show it, and the choices that it leaves to its user."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Literal, Protocol

import numpy as np
from casadi import Function
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.errors import LoopError, ModelError
from mbs.loops.closing import closure_parameters
from mbs.loops.configuration import solve
from mbs.models.geometry import terminal_frame
from mbs.models.kinematics import jacobian
from mbs.models.symbols import is_reduced
from mbs.recursions.jacobian import random_samples
from mbs.text import did_you_mean

Menu = Literal["Geometric", "Kinematic", "Dynamic", "Identification"]
Kind = Literal["frame", "choice", "flag", "several"]
Values = tuple[Any, ...]
Structures = Literal["all", "open", "closed"]
Chosen = Mapping[str, Any]
NOTHING: Chosen = MappingProxyType({})


class Offer(Protocol):
    """What an option has in a system, where other options have these values."""

    def __call__(self, system: System, chosen: Chosen = NOTHING, /) -> Any:
        """The values, or the default."""


@dataclass(frozen=True, slots=True)
class Option:
    """A choice that a model leaves to its user.

    Attributes:
        name: of the argument of the builder.
        title: what a form calls it.
        kind: one frame, one of some values, yes or no, or several values of a list.
        values: what there is to choose from.
        default: what is chosen when nothing is said.
        structures: the mechanisms to which it makes a difference.
    """

    name: str
    title: str
    kind: Kind
    values: Offer
    default: Offer
    structures: Structures = "all"

    def matters(self, system: System) -> bool:
        """Whether it makes a difference to this mechanism."""
        return _has(self.structures, system)


@dataclass(frozen=True, slots=True)
class Entry:
    """A model as menus show it.

    Attributes:
        key: short name, such as "idm".
        menu: where it stands.
        title: full name.
        symbol: what its formula is, in the signs of the notation.
        options: what its builders take besides the system.
        function: builds its casadi.Function; None where it is text or configurations only.
        text: writes its equations in words of their own; None where they are those of `function`.
        solver: the method of `inverse_geometry.solve` that it stands for, if any.
        structures: the mechanisms that have it: all, those without loops, or those with loops.
        writes: whether it has a Function of a mechanism, where `function` is given.
        obstacle: says why a mechanism of the right structure does not have it, "" where it does.
        numeric: builds the casadi.Function of a C library where `function` is a step of it; None
            where that one serves there too.
    """

    key: str
    menu: Menu
    title: str
    symbol: str
    options: tuple[Option, ...] = ()
    function: Callable[..., Function] | None = None
    text: Callable[..., str] | None = None
    solver: str | None = None
    structures: Structures = "all"
    writes: Callable[[System], bool] = lambda _: True
    obstacle: Callable[[System], str] = lambda _: ""
    numeric: Callable[..., Function] | None = None

    def applies(self, system: System) -> bool:
        """Whether the mechanism has the model."""
        return not self.refusal(system)

    def refusal(self, system: System) -> str:
        """Why the mechanism does not have the model, in a sentence; "" where it does."""
        if not _has(self.structures, system):
            kind = "closed loops" if self.structures == "closed" else "no closed loop"
            own = "some" if system.is_closed else "none"
            return f"{self.title}: for mechanisms with {kind}; {system.name} has {own}"
        return self.obstacle(system)

    def has_function(self, system: System) -> bool:
        """Whether it is a Function of this mechanism, and not text or configurations only."""
        return self.function is not None and self.writes(system)

    def choices(self, system: System, **given: Any) -> dict[str, Any]:
        """Values of all options: those that were given, the others by default.

        Args:
            system: the mechanism.
            **given: by the names of options; None of "several" stands for the default.

        Raises:
            ModelError: there is no such option, or the system offers no such value.
        """
        known = {option.name: option for option in self.options}
        for name in given:
            if name not in known:
                raise ModelError(f"{self.key}: there is no option {name!r}; {_among(name, known)}")
            _require_offered(self, known[name], system, given)
        chosen = {n: value for n, value in given.items() if value is not None}
        for name, option in known.items():
            if name not in chosen:
                chosen[name] = option.default(system, chosen)
        return {name: chosen[name] for name in known}

    def build(self, system: System, **given: Any) -> Function:
        """The model's Function for some of its options, the others by default.

        Args:
            system: the mechanism.
            **given: by the names of options.

        Raises:
            ModelError: the model has no Function, or an option does not fit.
        """
        if self.function is None or not self.has_function(system):
            raise ModelError(
                f"{self.key} of {system.name}: {self.title} is no Function; ask for its text or"
                " configurations"
            )
        return self.function(system, **self.choices(system, **given))

    def build_numeric(self, system: System, **given: Any) -> Function:
        """`build` for a C library: of an algorithm the whole of it."""
        if self.numeric is None:
            return self.build(system, **given)
        return self.numeric(system, **self.choices(system, **given))


def _has(structures: Structures, system: System) -> bool:
    return structures == "all" or system.is_closed == (structures == "closed")


def _among(name: str, known: dict[str, Option]) -> str:
    return did_you_mean(name, known) if known else "it has none"


def _require_offered(entry: Entry, option: Option, system: System, chosen: Chosen) -> None:
    value = chosen[option.name]
    if value is None and option.kind == "several":
        return
    offered = option.values(system, chosen)
    for one in value if option.kind == "several" else (value,):
        if one not in offered:
            names = ", ".join(map(str, offered))
            raise ModelError(
                f"{entry.key} of {system.name}: {option.title} {one!r} is not offered; use one of"
                f" {names}"
            )


# The square part of a frame's Jacobian that one asks for when no rows and columns are named.


Array = NDArray[np.float64]
Jacobian = tuple[str | int, str | int, str]
"""Frame, the frame in whose axes V and w are, and coordinates."""

ROWS = ("Vx", "Vy", "Vz", "wx", "wy", "wz")
"""Names of the rows of [V; w]."""

_CONFIGURATIONS, _SEED = 3, 20260110
_STEP = 0.1
"""By how much independent joints leave the assembled configuration [rad or m]."""
_DEPENDENT = 1e-7
"""Sine of the angle to the others below which a row or column depends on them."""


def regular_part(
    system: System,
    of: Jacobian,
    rows: Sequence[str] | None = None,
    columns: Sequence[str] | None = None,
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Rows and as many columns that have an inverse where the configuration is not singular.

    The first rows of [V; w] that are independent at random configurations, then the first columns
    that are so in these rows; what is given stays. A frame that moves in a plane gets Vx, Vy and
    wz; one that a crank alone moves, the first row that it moves.

    Args:
        system: open or closed.
        of: whose Jacobian.
        rows: names of rows that are chosen already.
        columns: names of velocities that are chosen already.

    Returns:
        names of rows and of columns; not as many of either where the given ones do not allow it.

    Raises:
        ModelError: there is no such frame or coordinate.
    """
    reduced = is_reduced(system, of[2])
    speeds = system.active if reduced else range(system.nv)
    names = [system.speeds[k].name for k in speeds]
    every = _values(system, of)
    kept = [names.index(n) for n in columns if n in names] if columns else [*range(len(names))]
    chosen = tuple(rows) if rows else tuple(ROWS[k] for k in _independent(every[:, :, kept], 6))
    own = [ROWS.index(name) for name in chosen if name in ROWS]
    if columns:
        return chosen, tuple(columns)
    found = _independent(np.swapaxes(every[:, own], 1, 2), len(own))
    return chosen, tuple(names[k] for k in found)


def _values(system: System, of: Jacobian) -> Array:
    """(configurations, 6, m) the Jacobian at some configurations, lengths by the longest one."""

    def find() -> Array:
        frame, axes, coordinates = of
        function = jacobian(system, frame, axes, coordinates=coordinates)
        every = list[Array]()
        for state in _states(system):
            with suppress(LoopError):  # singular there; the other configurations tell enough
                every.append(np.array(function(*state)))
        J = np.array(every).reshape(len(every), 6, function.size2_out(0))
        J[:, :3] /= float(np.abs(J[:, :3]).max(initial=0.0)) or 1.0
        return J

    found: Array = system.cached(("values of the jacobian", *of), find)
    return found


def _states(system: System) -> Iterator[tuple[Array, ...]]:
    """Positions, and parameters where there are some, as the inputs of a Function."""
    if not system.is_closed:
        for q, p in random_samples(system.tree, len(system.parameters)):
            yield (q, p) if system.parameters else (q,)
        return
    p = closure_parameters(system, None)
    for q in _closed_configurations(system):
        yield (q, p) if system.parameters else (q,)


def _closed_configurations(system: System) -> Iterator[Array]:
    """The assembled configuration, and others near it as far as the loops close there."""
    yield np.array(system.configuration)
    rng = np.random.default_rng(_SEED)
    names = [system.speeds[k].name for k in system.free]
    places = {c.name: x for c, x in zip(system.coordinates, system.configuration, strict=True)}
    own = [name for name in names if name in places]
    for _ in range(_CONFIGURATIONS):
        moved = {name: places[name] + rng.uniform(-_STEP, _STEP) for name in own}
        with suppress(LoopError):  # it does not reach so far
            yield solve(system, moved)


def _independent(matrices: Array, most: int) -> list[int]:
    """Numbers of the first rows of (samples, rows, columns) that are independent somewhere."""
    kept = list[int]()
    for row in range(matrices.shape[1]):
        trial = [*kept, row]
        if len(kept) < most and any(_is_regular(M[trial]) for M in matrices):
            kept = trial
    return kept


def _is_regular(rows: Array) -> bool:
    sizes = np.linalg.norm(rows, axis=1)
    if np.any(sizes < _DEPENDENT):
        return False
    sines = np.linalg.svd(rows / sizes[:, None], compute_uv=False)
    return len(sines) == len(rows) and bool(sines[-1] > _DEPENDENT)


# The options that several models share.


def _constant(value: object) -> Offer:
    def offer(system: System, chosen: Chosen = NOTHING, /) -> object:
        return value

    return offer


def _terminal(system: System, chosen: Chosen = NOTHING, /) -> str | int:
    return terminal_frame(system)


def _frames(system: System, chosen: Chosen = NOTHING, /) -> Values:
    numbers = (0, *system.numbered) if system.numbered else range(len(system.tree.links) + 1)
    return (*numbers, *system.frames)


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
