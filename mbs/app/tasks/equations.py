"""Equations of a model as text, with operation counts before and after the optimizer."""

from __future__ import annotations

import re
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from casadi import Function

from mbs.assembly import System
from mbs.errors import MbsError, ModelError
from mbs.export import code
from mbs.export.languages import LANGUAGES, language_of
from mbs.identification.catalogue import entries as identification_entries
from mbs.models import catalogue
from mbs.models.catalogue import Entry, Option
from mbs.operations import PASSES, Count, Step, count, simplification, simplify
from mbs.progress import progress
from mbs.text import did_you_mean, quoted

# Options of a model: as rows of a form, and read from texts.


_FLAGS = {"yes": True, "true": True, "1": True, "on": True}
_FLAGS |= {"no": False, "false": False, "0": False, "off": False}
_NO_OPTIONS: Mapping[str, Any] = MappingProxyType({})


@dataclass(frozen=True, slots=True)
class OptionRow:
    """Option of a model, as data for a form.

    Attributes:
        name: name of the option.
        title: title in the form.
        kind: "frame", "choice", "flag" or "several".
        values: values to choose from.
        chosen: present value, given or default; a tuple for "several".
    """

    name: str
    title: str
    kind: str
    values: tuple[Any, ...]
    chosen: Any


def option_values(
    system: System, entry: Entry, given: Mapping[str, Any] = _NO_OPTIONS
) -> tuple[OptionRow, ...]:
    """Return the options of a model that have an effect for a mechanism.

    Args:
        system: the mechanism.
        entry: the model.
        given: values by name of the option; defaults of other options may depend on them.

    Raises:
        ModelError: an option is unknown, or a value is not available for the mechanism.
    """
    chosen = entry.choices(system, **given)
    return tuple(
        OptionRow(o.name, o.title, o.kind, tuple(o.values(system, chosen)), chosen[o.name])
        for o in entry.options
        if o.matters(system)
    )


def parsed_options(system: System, entry: Entry, texts: Mapping[str, str]) -> dict[str, Any]:
    """Return the values of options of a model from texts.

    Args:
        system: the mechanism.
        entry: the model.
        texts: text by name of the option, such as {"frame": "6", "rows": "Vx, Vy", "f_ext": "yes"}.
            Empty texts are ignored.

    Raises:
        ModelError: an option is unknown, or a value is not available for the mechanism.
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
    """Return the value of an option from its text; `chosen` are the values of previous options.

    Raise a ModelError if the value is not available for the mechanism.
    """
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


__all__ = [
    "EVERY_PASS",
    "MENUS",
    "WORDS",
    "OptionRow",
    "WrittenEquations",
    "entries",
    "entry",
    "equations",
    "languages",
    "option_values",
    "parsed_options",
]

WORDS = "words"
"""Language name for entries that provide their own plain text."""

EVERY_PASS = tuple(one.name for one in PASSES)
"""Names of the passes of the optimizer, in the order in which they are applied."""

MENUS = ("Geometric", "Kinematic", "Dynamic", "Identification")


@dataclass(frozen=True, slots=True)
class WrittenEquations:
    """Equations of a model as text.

    Attributes:
        key: key of the model.
        title: title of the model.
        system: name of the mechanism.
        symbol: formula symbol of the result.
        language: language of the text.
        text: the equations.
        choices: all options and their values.
        before: operations of the model as its recursion computes it. Constants are folded and equal
            parts computed once, but the optimizer has not been applied. None for plain text.
        after: operations of the Function in the text; None for plain text.
        steps: passes of the optimizer.
        inputs, outputs: names and sizes of the inputs and outputs, such as "q (6, 1)".
        seconds: computing time [s].
    """

    key: str
    title: str
    system: str
    symbol: str
    language: str
    text: str
    choices: tuple[tuple[str, Any], ...]
    before: Count | None
    after: Count | None
    steps: tuple[Step, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    seconds: float

    @property
    def suffix(self) -> str:
        """File name suffix for the text."""
        return ".txt" if self.language == WORDS else language_of(self.language).suffix

    @property
    def file_name(self) -> str:
        """File name for the text."""
        return re.sub(r"\W+", "_", f"{self.system}_{self.key}") + self.suffix


def entries() -> tuple[Entry, ...]:
    """Return all models in the order of the menus."""
    return (*catalogue.entries(), *identification_entries())


def entry(key: str) -> Entry:
    """Return the model with a key.

    Args:
        key: key of the model, such as "idm".

    Raises:
        ModelError: no model has this key.
    """
    known = {one.key: one for one in entries()}
    if key not in known:
        raise ModelError(f"there is no model {key!r}; {did_you_mean(key, known)}")
    return known[key]


def languages(one: Entry, system: System) -> tuple[str, ...]:
    """Return the languages in which `equations` can write a model, the default first.

    Args:
        one: the model.
        system: the mechanism.
    """
    words = (WORDS,) if one.text is not None else ()
    return (*(LANGUAGES if one.has_function(system) else ()), *words)


def equations(
    system: System,
    key: str,
    options: Mapping[str, Any] = _NO_OPTIONS,
    language: str | None = None,
    passes: Sequence[str] = EVERY_PASS,
    *,
    name: str | None = None,
) -> WrittenEquations:
    """Write the equations of a model as text.

    Args:
        system: the mechanism.
        key: key of the model.
        options: values of its options by name. Default: the default values.
        language: language in `languages`. Default: the first of them.
        passes: names of the passes of the optimizer; empty for the model as built.
        name: name of the function in the text. Default: the name of the model.

    Raises:
        ModelError: the model, an option, the language or a pass is unknown, or the mechanism does
            not have the model.
        NoClosedForm: the model requires a closed form that does not exist.
    """
    one = entry(key)
    refusal = one.refusal(system)
    if refusal:
        raise ModelError(refusal)
    chosen = one.choices(system, **options)
    spoken = _language(one, system, language)
    started = time.perf_counter()
    if spoken == WORDS:
        assert one.text is not None
        return _write(system, one, chosen, one.text(system, **chosen), started)
    model = one.build(system, **chosen)
    final, steps = _optimise(model, passes)
    return WrittenEquations(
        **_about(system, one, chosen),
        language=spoken,
        text=code(final, spoken, name=name),
        before=count(model),
        after=count(final),
        steps=steps,
        inputs=tuple(f"{port} {final.size_in(port)}" for port in final.name_in()),
        outputs=tuple(f"{port} {final.size_out(port)}" for port in final.name_out()),
        seconds=time.perf_counter() - started,
    )


def _optimise(model: Function, passes: Sequence[str]) -> tuple[Function, tuple[Step, ...]]:
    """Return the Function after the given passes and a report of each pass."""
    if not passes:
        return model, ()
    made = simplification(model, passes)
    return made.function, made.steps


def _write(
    system: System, one: Entry, chosen: Mapping[str, Any], text: str, started: float
) -> WrittenEquations:
    """Return the equations of a model that provides plain text only.

    `chosen` are its options, `text` is the text, `started` the time at which the computation began
    [s].
    """
    return WrittenEquations(
        **_about(system, one, chosen),
        language=WORDS,
        text=text,
        before=None,
        after=None,
        steps=(),
        inputs=(),
        outputs=(),
        seconds=time.perf_counter() - started,
    )


def _about(system: System, one: Entry, chosen: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields of `WrittenEquations` that describe the model and its chosen options."""
    return {
        "key": one.key,
        "title": one.title,
        "system": system.name,
        "symbol": one.symbol,
        "choices": tuple(chosen.items()),
    }


def _language(one: Entry, system: System, language: str | None) -> str:
    """Return the language of the text; raise a ModelError if the model is not written in it."""
    offered = languages(one, system)
    spoken = offered[0] if language is None else str(language).lower()
    if spoken not in offered:
        raise ModelError(
            f"{one.key} of {system.name} is not written in {language!r};"
            f" {did_you_mean(spoken, offered)}"
        )
    return spoken


# Operation counts of several models, before and after the optimizer.


@dataclass(frozen=True, slots=True)
class CountRow:
    """Operation counts of a model.

    Attributes:
        key: key of the model.
        title: title of the model.
        before: operations as its recursion computes it; None if the mechanism lacks the model.
        after: operations after the optimizer; None if the mechanism lacks the model.
        reason: reason why there are no counts; "" if there are.
    """

    key: str
    title: str
    before: Count | None
    after: Count | None
    reason: str


def counts(
    system: System,
    keys: Sequence[str] = (),
    passes: Sequence[str] = EVERY_PASS,
    options: Mapping[str, str] = _NO_OPTIONS,
) -> tuple[CountRow, ...]:
    """Count the operations of models.

    Args:
        system: the mechanism.
        keys: keys of the models. Default: all models that are Functions.
        passes: names of the passes of the optimizer.
        options: texts of options of all these models, see `parsed_options`. Default: the default
            values.

    Raises:
        ModelError: a model, an option or a pass is unknown.
    """
    chosen = [entry(key) for key in keys] or [one for one in entries() if one.function is not None]
    rows = list[CountRow]()
    with progress(f"Counting operations of {system.name}", 0, len(chosen)) as reached:
        for number, one in enumerate(chosen):
            rows.append(_row(system, one.key, passes, options))
            reached(number + 1)
    return tuple(rows)


def _row(system: System, key: str, passes: Sequence[str], options: Mapping[str, str]) -> CountRow:
    """Return the operation counts of a model, or the reason why there are none.

    `key` is the model, `passes` are passes of the optimizer, `options` are texts of its options.
    """
    one = entry(key)
    reason = one.refusal(system)
    if not reason and not one.has_function(system):
        reason = f"{one.title}: {system.name} has it as text or configurations only"
    if reason:
        return CountRow(key, one.title, None, None, reason)
    given = parsed_options(system, one, options)
    try:
        model = one.build(system, **given)
    except MbsError as error:
        return CountRow(key, one.title, None, None, str(error))
    final = simplify(model, passes) if passes else model
    return CountRow(key, one.title, count(model), count(final), "")
