"""The options of a model: as rows of a form, and from texts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from mbs.assembly import System
from mbs.errors import ModelError
from mbs.messages import did_you_mean, quoted
from mbs.models.catalogue import Entry, Option

_FLAGS = {"yes": True, "true": True, "1": True, "on": True}
_FLAGS |= {"no": False, "false": False, "0": False, "off": False}
_NOTHING: Mapping[str, Any] = MappingProxyType({})


@dataclass(frozen=True, slots=True)
class OptionRow:
    """An option of a model as a form shows it.

    Attributes:
        name: of the option.
        title: for people.
        kind: "frame", "choice", "flag" or "several".
        values: what there is to choose from.
        chosen: the value that was given, else the default; a tuple of "several".
    """

    name: str
    title: str
    kind: str
    values: tuple[Any, ...]
    chosen: Any


def option_values(
    system: System, entry: Entry, given: Mapping[str, Any] = _NOTHING
) -> tuple[OptionRow, ...]:
    """The options of a model that make a difference to a mechanism.

    Args:
        system: the mechanism.
        entry: the model.
        given: values by the names of options, from which defaults of others may follow.

    Raises:
        ModelError: there is no such option, or the mechanism offers no such value.
    """
    chosen = entry.choices(system, **given)
    return tuple(
        OptionRow(o.name, o.title, o.kind, tuple(o.values(system, chosen)), chosen[o.name])
        for o in entry.options
        if o.matters(system)
    )


def parsed_options(system: System, entry: Entry, texts: Mapping[str, str]) -> dict[str, Any]:
    """Values of options from texts such as {"frame": "6", "rows": "Vx, Vy", "f_ext": "yes"}.

    Raises:
        ModelError: there is no such option, or the mechanism offers no such value.
    """
    known = {option.name: option for option in entry.options}
    chosen = dict[str, Any]()
    for name, text in texts.items():
        if name not in known:
            names = did_you_mean(name, known) if known else "it has none"
            raise ModelError(f"{entry.key}: there is no option {name!r}; {names}")
        if text.strip():
            chosen[name] = _value(system, entry, known[name], text.strip(), chosen)
    return chosen


def _value(
    system: System, entry: Entry, option: Option, text: str, chosen: Mapping[str, Any]
) -> Any:
    if option.kind == "flag":
        if text.lower() not in _FLAGS:
            raise ModelError(f"{entry.key}: {option.title} is {quoted(text)}; write yes or no")
        return _FLAGS[text.lower()]
    offered = {str(value): value for value in option.values(system, chosen)}
    parts = [part.strip() for part in text.split(",")] if option.kind == "several" else [text]
    for part in parts:
        if part not in offered:
            raise ModelError(
                f"{entry.key} of {system.name}: {option.title} {part!r} is not offered;"
                f" {did_you_mean(part, offered)}"
            )
    values = tuple(offered[part] for part in parts)
    return values if option.kind == "several" else values[0]
