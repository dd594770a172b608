"""A model as menus show it, and the choices that it leaves to its user."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Literal, Protocol

from casadi import Function

from mbs.assembly import System
from mbs.errors import ModelError
from mbs.messages import did_you_mean

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
        function: builds its casadi.Function; None where it is text or postures only.
        text: writes its equations in words of their own; None where they are those of `function`.
        solver: the method of `inverse_geometry.solve` that it stands for, if any.
        structures: the mechanisms that have it: all, those without loops, or those with loops.
        writes: whether it has a Function of a mechanism, where `function` is given.
        obstacle: says why a mechanism of the right structure does not have it, "" where it does.
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
        """Whether it is a Function of this mechanism, and not text or postures only."""
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
                " postures"
            )
        return self.function(system, **self.choices(system, **given))


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
