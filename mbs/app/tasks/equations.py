"""Equations of a model as text, with the operations they take before and after the optimizer."""

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

# The options of a model: as rows of a form, and from texts.


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
"""The language of entries that have a text of their own."""

EVERY_PASS = tuple(one.name for one in PASSES)
"""Names of the passes of the optimizer, in the order in which they are made."""

MENUS = ("Geometric", "Kinematic", "Dynamic", "Identification")

_NO_OPTIONS: Mapping[str, Any] = MappingProxyType({})


@dataclass(frozen=True, slots=True)
class WrittenEquations:
    """A model written down.

    Attributes:
        key: of the entry.
        title: of the entry.
        system: name of the mechanism.
        symbol: what the formula is.
        language: of the text.
        text: the equations.
        choices: every option and its value.
        before: operations of the model as its recursion made it: constants are folded and equal
            parts computed once, no pass of the optimizer was made; None of words.
        after: operations of the Function whose text it is; None of words.
        steps: passes of the optimizer.
        inputs, outputs: of the Function, such as "q (6, 1)".
        seconds: that it took.
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
        """The end of the name of a file for the text."""
        return ".txt" if self.language == WORDS else language_of(self.language).suffix

    @property
    def file_name(self) -> str:
        """A name of a file for the text."""
        return re.sub(r"\W+", "_", f"{self.system}_{self.key}") + self.suffix


def entries() -> tuple[Entry, ...]:
    """Every model, in the order of the menus."""
    return (*catalogue.entries(), *identification_entries())


def entry(key: str) -> Entry:
    """The model of this short name.

    Raises:
        ModelError: there is none.
    """
    known = {one.key: one for one in entries()}
    if key not in known:
        raise ModelError(f"there is no model {key!r}; {did_you_mean(key, known)}")
    return known[key]


def languages(one: Entry, system: System) -> tuple[str, ...]:
    """What `equations` can write the model in, what it takes by default first."""
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
    """The equations of a model as text.

    Args:
        system: the mechanism.
        key: of the model.
        options: values of its options, the others at their defaults.
        language: one of `languages`; the first of them when left out.
        passes: names of the passes of the optimizer; none for the model as it was built.
        name: of the function in the text, the model's own when left out.

    Raises:
        ModelError: no such model, option, language or pass, or the mechanism does not have it.
        NoClosedForm: a closed form was asked for and there is none.
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
    """The model after the passes, and what each did; itself where there are none."""
    if not passes:
        return model, ()
    made = simplification(model, passes)
    return made.function, made.steps


def _write(
    system: System, one: Entry, chosen: Mapping[str, Any], text: str, started: float
) -> WrittenEquations:
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
    return {
        "key": one.key,
        "title": one.title,
        "system": system.name,
        "symbol": one.symbol,
        "choices": tuple(chosen.items()),
    }


def _language(one: Entry, system: System, language: str | None) -> str:
    offered = languages(one, system)
    spoken = offered[0] if language is None else str(language).lower()
    if spoken not in offered:
        raise ModelError(
            f"{one.key} of {system.name} is not written in {language!r};"
            f" {did_you_mean(spoken, offered)}"
        )
    return spoken


# Operations of many models, before and after the optimizer.


_NO_COUNT_OPTIONS: Mapping[str, str] = MappingProxyType({})


@dataclass(frozen=True, slots=True)
class CountRow:
    """The operations of a model.

    Attributes:
        key: of the model.
        title: of the model.
        before: as its recursion made it; None where the mechanism does not have it.
        after: after the optimizer; None likewise.
        reason: why there is none, "" where there is one.
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
    options: Mapping[str, str] = _NO_COUNT_OPTIONS,
) -> tuple[CountRow, ...]:
    """The operations of models.

    Args:
        system: the mechanism.
        keys: of the models; every one that is a Function when left out.
        passes: names of the passes of the optimizer.
        options: texts of options of all these models, as `parsed_options` takes them; the others
            at their defaults.

    Raises:
        ModelError: there is no such model, option or pass.
    """
    chosen = [entry(key) for key in keys] or [one for one in entries() if one.function is not None]
    rows = list[CountRow]()
    with progress(f"Counting operations of {system.name}", 0, len(chosen)) as reached:
        for number, one in enumerate(chosen):
            rows.append(_row(system, one.key, passes, options))
            reached(number + 1)
    return tuple(rows)


def _row(system: System, key: str, passes: Sequence[str], options: Mapping[str, str]) -> CountRow:
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
