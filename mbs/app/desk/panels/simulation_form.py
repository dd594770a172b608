"""The form of a simulation: times, start, and what drives the joints."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

from nicegui import ui

from mbs.app.desk.panels.plots_fields import FieldLook, choice_field, text_field
from mbs.app.desk.panels.simulation_settings import KINDS, PICTURE, TYPED, Row, Texts, chosen_rows
from mbs.assembly import System

_METHODS = {"dopri5": "dopri5, explicit", "rodas": "rodas, for stiff systems"}
_LAWS = (
    "Laws are numbers, or texts of t, of positions and velocities such as {0}.q and {0}.v, and of"
    " symbols: 5*sin(2*t) - 0.3*{0}.v"
)


def build_form(system: System, texts: Texts) -> ui.button:
    """Fields that write into `texts` as they are typed, and the button that runs.

    Args:
        system: that is to move.
        texts: of the form, at first and later.

    Returns:
        the button.
    """
    with ui.element("div").classes("desk-form"):
        _text(texts, "duration", "Duration [s]", "96px")
        _text(texts, "step", "Row every [s]", "104px")
        _text(texts, "tolerance", "Tolerance", "96px")
        _choice(texts, "method", _METHODS, "Method", "214px")
    with ui.element("div").classes("desk-form").style("align-items: center"):
        start = _choice(texts, "start", {x: x for x in (PICTURE, TYPED)}, "Starts at", "240px")
        button = ui.button("Run").props("unelevated no-caps dense").mark("simulate")
        button.style("padding: 3px 26px")
    rows = chosen_rows(system)
    kind = "Independent joints" if system.is_closed else "Joints"
    ui.label(f"{kind}: start and drive; empty fields are zero").classes("desk-note")
    with ui.element("div").classes("desk-laws desk-small"):
        for title in ("", "q at start", "v at start", "driven by", "law of time"):
            ui.label(title).classes("desk-note")
        for row in rows:
            _joint(texts, start, row)
    for device in system.devices:
        name, unit = device.input
        _text(texts, f"u.{device.name}", f"{name} [{unit}]", "220px")
    if rows:
        ui.label(_LAWS.format(rows[0][0])).classes("desk-note")
    return button


def _joint(texts: Texts, start: ui.select, row: Row) -> None:
    name, unit, rate, actuated = row
    ui.label(name).style("font-weight: 600").tooltip(f"position [{unit or 'none'}], rate [{rate}]")
    position = _text(texts, f"q0.{name}")
    if unit:
        position.bind_enabled_from(start, "value", lambda chosen: chosen == TYPED)
    else:
        position.disable()
    _text(texts, f"v0.{name}")
    kinds = {key: word for key, word in KINDS.items() if actuated or key != "tau"}
    if texts.get(f"kind.{name}") not in kinds:
        texts[f"kind.{name}"] = next(iter(kinds))
    _choice(texts, f"kind.{name}", kinds)
    _text(texts, f"law.{name}")


def _text(texts: Texts, key: str, label: str = "", width: str = "100%") -> ui.input:
    look = FieldLook(label, width, key)
    return text_field(look, texts.get(key, ""), partial(texts.__setitem__, key))


def _choice(
    texts: Texts, key: str, options: Mapping[str, str], label: str = "", width: str = "100%"
) -> ui.select:
    look = FieldLook(label, width, key)
    return choice_field(look, options, texts[key], partial(texts.__setitem__, key))
