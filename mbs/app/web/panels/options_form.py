"""Form of the options of an action, derived from the fields of a dataclass."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

from nicegui import ui

from mbs.app.web.panels.plots import FieldLook, choice_field, several_field, text_field
from mbs.options import (
    OptionInfo,
    ValueKind,
    default_text,
    option_fields,
    title_of,
    value_kinds,
)

FormValues = dict[str, Any]
"""Values of a form by option: a text, a choice or a list of names. The names in a list that the
form does not offer are a text "more_..."."""

_WIDTH = "150px"
"""Width of text fields, enough for the label of an empty field."""
_CHOICE, _MENU, _LETTER = 160, 46, 7
"""Least width of a choice, and widths of its arrow with margins and of a letter [CSS pixels]."""


def first_values(options: type) -> FormValues:
    """Return the initial values of a form: the defaults of the options.

    Args:
        options: dataclass of the options.
    """
    values: FormValues = {}
    kinds = value_kinds(options)
    for name, (field, option) in option_fields(options).items():
        if option.in_form and kinds[name] == "names":
            values |= {name: [], f"more_{name}": ""}
        elif option.in_form:
            values[name] = default_text(field) if kinds[name] == "number" else field.default
    return values


def form_texts(options: type, values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the texts of options from the values of a form.

    The texts are arguments of `mbs.app.tasks.options.keywords`.

    Args:
        options: dataclass of the options.
        values: values of the form.
    """
    texts = {}
    for name, kind in value_kinds(options).items():
        if name in values:
            value = values[name]
            texts[name] = value.strip() if kind == "number" else value
            if kind == "names":
                texts[name] = (*value, *re.findall(r"[^,\s]+", values[f"more_{name}"]))
    return texts


def option_form(
    options: type, values: FormValues, offered: Mapping[str, Sequence[str]], joint: str
) -> None:
    """Create the fields of a form, which write into `values`.

    Args:
        options: dataclass of the options.
        values: values of the form, complete. They are updated while the user types.
        offered: names that are offered for lists, if they are not those of the option.
        joint: joint in examples.
    """
    lists = _options_in_form(options, "names")
    with ui.element("div").classes("app-form"):
        option_row(options, values)
    for name, option in lists.items():
        if option.offered:
            _several(values, name, option, offered.get(name, option.offered))
    with ui.element("div").classes("app-form"):
        for name, option in lists.items():
            field = _text(values, f"more_{name}", FieldLook(f"More {name}", _WIDTH, f"more_{name}"))
            field.tooltip(f"such as {option.example.format(joint=joint)}; commas between them")


def option_row(options: type, values: FormValues) -> None:
    """Create the fields of choices and numbers, in the present element.

    Args:
        options: dataclass of the options.
        values: values of the form, complete. They are updated while the user types.
    """
    choices: dict[str, ui.select] = {}
    for name, option in _options_in_form(options, "choice").items():
        choices[name] = _choice(values, name, option)
    for name, option in _options_in_form(options, "number").items():
        field = _text(values, name, FieldLook(title_of(name, option), _WIDTH, name))
        if option.only_with is not None:
            other, needed = option.only_with
            field.bind_visibility_from(choices[other], "value", needed.__contains__)


def flags_field(options: type, values: FormValues, look: FieldLook) -> None:
    """Create one field for all options that are either on or off.

    Args:
        options: dataclass of the options.
        values: values of the form, complete. They are updated when the user chooses.
        look: appearance of the field.
    """
    flags = {n: option.label or n for n, option in _options_in_form(options, "flag").items()}

    def take(chosen: Sequence[str]) -> None:
        values.update({name: name in chosen for name in flags})

    several_field(look, flags, [name for name in flags if values[name]], take)


def _options_in_form(options: type, kind: ValueKind) -> dict[str, OptionInfo]:
    """Return the options of a dataclass that the form shows and that have a kind of values."""
    kinds = value_kinds(options)
    return {
        name: option
        for name, (_, option) in option_fields(options).items()
        if option.in_form and kinds[name] == kind
    }


def _text(values: FormValues, key: str, look: FieldLook) -> ui.input:
    """Create a text field that writes into `values[key]`."""
    return text_field(look, values[key], partial(values.__setitem__, key))


def _choice(values: FormValues, name: str, option: OptionInfo) -> ui.select:
    """Create a field for the choice of an option."""
    labels = {
        one: f"{one}, {word}" if word else one.replace("_", " ")
        for one, word in option.choices.items()
    }
    width = max(_CHOICE, _MENU + _LETTER * max(map(len, labels.values())))
    look = FieldLook(title_of(name, option), f"{width}px", name)
    return choice_field(look, labels, values[name], partial(values.__setitem__, name))


def _several(values: FormValues, name: str, option: OptionInfo, offered: Sequence[str]) -> None:
    """Create a field for an option that is a list of names, which writes into `values[name]`.

    `offered` are the names to choose from.
    """
    values[name] = [one for one in values[name] if one in offered]
    labels = {one: one.replace("_", " ") for one in offered}
    look = FieldLook(title_of(name, option), "100%", name)
    several_field(look, labels, values[name], partial(values.__setitem__, name))
