"""A model as menus show it, and the choices that it leaves to its user."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

from casadi import Function

from mbs.assembly import System
from mbs.errors import ModelError
from mbs.messages import did_you_mean

Menu = Literal["Geometric", "Kinematic", "Dynamic", "Identification"]
Kind = Literal["frame", "choice", "flag", "several"]
Values = tuple[Any, ...]


@dataclass(frozen=True, slots=True)
class Option:
    """A choice that a model leaves to its user.

    Attributes:
        name: of the argument of the builder.
        title: what a form calls it.
        kind: one frame, one of some values, yes or no, or several values of a list.
        values: what there is to choose from in a system.
        default: what is chosen when nothing is said; None of "several" means the builder's own.
    """

    name: str
    title: str
    kind: Kind
    values: Callable[[System], Values]
    default: Callable[[System], Any]


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
    """

    key: str
    menu: Menu
    title: str
    symbol: str
    options: tuple[Option, ...] = ()
    function: Callable[..., Function] | None = None
    text: Callable[..., str] | None = None
    solver: str | None = None
    structures: Literal["all", "open", "closed"] = "all"

    def applies(self, system: System) -> bool:
        """Whether a mechanism of this structure has the model."""
        return self.structures == "all" or system.is_closed == (self.structures == "closed")

    def choices(self, system: System, **given: Any) -> dict[str, Any]:
        """Values of all options: those that were given, the others by default.

        Args:
            system: the mechanism.
            **given: by the names of options.

        Raises:
            ModelError: there is no such option, or the system offers no such value.
        """
        known = {option.name: option for option in self.options}
        for name, value in given.items():
            if name not in known:
                raise ModelError(f"{self.key}: there is no option {name!r}; {_among(name, known)}")
            _require_offered(self, known[name], system, value)
        return {
            n: given[n] if n in given else option.default(system) for n, option in known.items()
        }

    def build(self, system: System, **given: Any) -> Function:
        """The model's Function for some of its options, the others by default.

        Args:
            system: the mechanism.
            **given: by the names of options.

        Raises:
            ModelError: the model has no Function, or an option does not fit.
        """
        if self.function is None:
            raise ModelError(
                f"{self.key}: {self.title} is no Function; ask for its text or postures"
            )
        return self.function(system, **self.choices(system, **given))


def _among(name: str, known: dict[str, Option]) -> str:
    return did_you_mean(name, known) if known else "it has none"


def _require_offered(entry: Entry, option: Option, system: System, value: Any) -> None:
    if value is None and option.kind == "several":
        return
    offered = option.values(system)
    for one in value if option.kind == "several" else (value,):
        if one not in offered:
            names = ", ".join(map(str, offered))
            raise ModelError(
                f"{entry.key} of {system.name}: {option.title} {one!r} is not offered; use one of"
                f" {names}"
            )
