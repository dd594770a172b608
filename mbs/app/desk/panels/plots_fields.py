"""Small fields of forms that hand on what is typed or chosen, without polling."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from nicegui import ui

_PROPS = "dense outlined hide-bottom-space"
_MENU = f"{_PROPS} options-dense"

Take = Callable[[Any], object]


@dataclass(frozen=True, slots=True)
class FieldLook:
    """How a field looks, and what tests find it by.

    Attributes:
        label: in its frame, "" for none.
        width: of CSS.
        marker: its name in the page.
    """

    label: str
    width: str
    marker: str


def text_field(look: FieldLook, value: str, take: Take) -> ui.input:
    """A line of text.

    Args:
        look: of the field.
        value: at first.
        take: called with each text.
    """
    field = ui.input(look.label or None, value=value, on_change=lambda e: take(e.value or ""))
    field.props(_PROPS).style(f"width: {look.width}").mark(look.marker)
    _named(field, look)
    return field


def choice_field(look: FieldLook, options: Mapping[str, str], value: str, take: Take) -> ui.select:
    """One of some values.

    Args:
        look: of the field.
        options: value to what is shown for it.
        value: at first.
        take: called with each choice.
    """
    field = ui.select(
        dict(options), label=look.label or None, value=value, on_change=lambda e: take(e.value)
    )
    field.props(_MENU).style(f"width: {look.width}").mark(look.marker)
    _named(field, look)
    return field


def several_field(
    look: FieldLook, options: Mapping[str, str], value: Sequence[str], take: Take
) -> ui.select:
    """Some of several values.

    Args:
        look: of the field.
        options: value to what is shown for it.
        value: at first.
        take: called with a list at each choice.
    """
    field = ui.select(
        dict(options),
        label=look.label or None,
        value=list(value),
        multiple=True,
        on_change=lambda e: take(list(e.value)),
    )
    field.props(f"{_MENU} use-chips").style(f"width: {look.width}").mark(look.marker)
    return field


def _named(field: ui.element, look: FieldLook) -> None:
    """A name for those who do not see the field, where it has no label."""
    if not look.label:
        field.props(f'aria-label="{look.marker}"')
