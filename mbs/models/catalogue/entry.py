"""Catalogue entries: models with their titles, options and builder functions."""

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
    """Function that returns the values or the default of an option for a system.

    `chosen` contains the values of other options by name.
    """

    def __call__(self, system: System, chosen: Chosen = NOTHING, /) -> Any:
        """Return the available values, or the default value."""


@dataclass(frozen=True, slots=True)
class Option:
    """Option of a model.

    Attributes:
        name: name of the argument of the builder function.
        title: label in forms.
        kind: "frame" for one frame, "choice" for one of some values, "flag" for a Boolean, or
            "several" for several values of a list.
        values: function that returns the available values.
        default: function that returns the default value.
        structures: mechanisms for which the option has an effect: all, open or closed.
    """

    name: str
    title: str
    kind: Kind
    values: Offer
    default: Offer
    structures: Structures = "all"

    def matters(self, system: System) -> bool:
        """Whether the option has an effect for this mechanism."""
        return _has(self.structures, system)


@dataclass(frozen=True, slots=True)
class Entry:
    """Model in the catalogue, as shown in menus.

    Attributes:
        key: short name, such as "idm".
        menu: menu of the model.
        title: full name.
        symbol: formula of the model, such as "q = igm(T)".
        options: options of the builder functions.
        function: builder of the casadi.Function, or None for text or configurations only.
        text: writer of the equations, or None if they are printed from `function`.
        solver: method of `inverse_geometry.solve` for this model, or None.
        structures: mechanisms with this model: all, open (without loops) or closed (with loops).
        writes: whether `function` is available for a mechanism.
        obstacle: reason why a mechanism of the right structure does not have the model, or "".
        numeric: builder of the casadi.Function for a C library if `function` is only one step of
            the algorithm, else None.
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
        """Whether the model is available for the mechanism."""
        return not self.refusal(system)

    def refusal(self, system: System) -> str:
        """Return the reason why the model is not available for the mechanism, "" if it is."""
        if not _has(self.structures, system):
            kind = "closed loops" if self.structures == "closed" else "no closed loop"
            own = "some" if system.is_closed else "none"
            return f"{self.title}: for mechanisms with {kind}; {system.name} has {own}"
        return self.obstacle(system)

    def has_function(self, system: System) -> bool:
        """Whether a casadi.Function is available, not only text or configurations."""
        return self.function is not None and self.writes(system)

    def choices(self, system: System, **given: Any) -> dict[str, Any]:
        """Return the values of all options by name: given values, else default values.

        Args:
            system: mechanism.
            **given: values by option name; None selects the default of an option of kind "several".

        Raises:
            ModelError: an option is unknown, or a value is not available for the system.
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
        """Build the casadi.Function of the model.

        Args:
            system: mechanism.
            **given: values of options by name; default values for all others.

        Raises:
            ModelError: the model has no Function, an option is unknown, or a value is not
                available.
        """
        if self.function is None or not self.has_function(system):
            raise ModelError(
                f"{self.key} of {system.name}: {self.title} is no Function; ask for its text or"
                " configurations"
            )
        return self.function(system, **self.choices(system, **given))

    def build_numeric(self, system: System, **given: Any) -> Function:
        """Build the casadi.Function for a C library, which contains the complete algorithm."""
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


# Default square submatrix of a Jacobian, if no rows and columns are named.


Array = NDArray[np.float64]
Jacobian = tuple[str | int, str | int, str]
"""Frame, frame in whose axes V and w are expressed, and coordinates ("independent" or "tree")."""

ROWS = ("Vx", "Vy", "Vz", "wx", "wy", "wz")
"""Names of the rows of [V; w]."""

_CONFIGURATIONS, _SEED = 3, 20260110
_STEP = 0.1
"""Largest random displacement of independent joints from the assembled configuration [rad or m]."""
_DEPENDENT = 1e-7
"""Smallest singular value of unit rows or columns below which they are linearly dependent."""


def regular_part(
    system: System,
    of: Jacobian,
    rows: Sequence[str] | None = None,
    columns: Sequence[str] | None = None,
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Select rows and columns of a Jacobian that form an invertible square matrix.

    The first rows of [V; w] that are independent at random configurations are selected, then the
    first columns that are independent in these rows. Given rows or columns are kept. For a frame
    with planar motion the rows are Vx, Vy and wz. For a frame that is moved by a single crank the
    row is the first nonzero row.

    Args:
        system: open or closed system.
        of: Jacobian: frame, frame of the axes, and coordinates.
        rows: names of given rows.
        columns: names of the velocities of given columns.

    Returns:
        Names of rows and names of columns. Their numbers differ if the given rows or columns do not
        allow a square matrix.

    Raises:
        ModelError: the frame or coordinates are unknown.
    """
    reduced = is_reduced(system, of[2])
    speeds = system.independent if reduced else range(system.nv)
    names = [system.velocity_coordinates[k].name for k in speeds]
    every = _values(system, of)
    kept = [names.index(n) for n in columns if n in names] if columns else [*range(len(names))]
    chosen = tuple(rows) if rows else tuple(ROWS[k] for k in _independent(every[:, :, kept], 6))
    own = [ROWS.index(name) for name in chosen if name in ROWS]
    if columns:
        return chosen, tuple(columns)
    found = _independent(np.swapaxes(every[:, own], 1, 2), len(own))
    return chosen, tuple(names[k] for k in found)


def _values(system: System, of: Jacobian) -> Array:
    """Return the Jacobian (configurations, 6, m), V scaled to a largest element of 1."""

    def find() -> Array:
        frame, axes, coordinates = of
        function = jacobian(system, frame, axes, coordinates=coordinates)
        every = list[Array]()
        for state in _states(system):
            with suppress(LoopError):  # singular there; the other configurations are sufficient
                every.append(np.array(function(*state)))
        J = np.array(every).reshape(len(every), 6, function.size2_out(0))
        J[:, :3] /= float(np.abs(J[:, :3]).max(initial=0.0)) or 1.0
        return J

    found: Array = system.cached(("values of the jacobian", *of), find)
    return found


def _states(system: System) -> Iterator[tuple[Array, ...]]:
    """Yield inputs of a Function: positions, and parameters if the system has any."""
    if not system.is_closed:
        for q, p in random_samples(system.tree, len(system.parameters)):
            yield (q, p) if system.parameters else (q,)
        return
    p = closure_parameters(system, None)
    for q in _closed_configurations(system):
        yield (q, p) if system.parameters else (q,)


def _closed_configurations(system: System) -> Iterator[Array]:
    """Yield the assembled configuration, and random configurations nearby with closed loops."""
    yield np.array(system.configuration)
    rng = np.random.default_rng(_SEED)
    names = [system.velocity_coordinates[k].name for k in system.chosen_coordinates]
    places = {c.name: x for c, x in zip(system.coordinates, system.configuration, strict=True)}
    own = [name for name in names if name in places]
    for _ in range(_CONFIGURATIONS):
        moved = {name: places[name] + rng.uniform(-_STEP, _STEP) for name in own}
        with suppress(LoopError):  # the loops cannot be closed there
            yield solve(system, moved)


def _independent(matrices: Array, most: int) -> list[int]:
    """Return indices of the first rows (samples, rows, columns) independent in any sample."""
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


# Options of several models.


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
    return tuple(
        system.velocity_coordinates[k].name
        for k in (range(system.nv) if every else system.independent)
    )


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
    """Return an option for one frame: index of a link, 0 for the base, or a name."""
    return Option(name, title, "frame", _frames, default)


def choice(name: str, title: str, *values: str) -> Option:
    """Return an option for one of several texts; the first is the default."""
    return Option(name, title, "choice", _constant(values), _constant(values[0]))


def flag(name: str, title: str) -> Option:
    """Return a Boolean option with default False."""
    return Option(name, title, "flag", _constant((False, True)), _constant(False))


def several(name: str, title: str, values: Offer, default: Offer) -> Option:
    """Return an option for several values of a list."""
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
