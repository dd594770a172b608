"""The panel that hands out files of the robot: for C, for other tools, as a picture."""

from __future__ import annotations

from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass, field
from functools import partial
from typing import Any, cast

from nicegui import ui

from mbs.app.desk.desk import Desk
from mbs.app.desk.panels.export_fmu import FmuAsked, fmu_form
from mbs.app.desk.panels.plots_fields import FieldLook, several_field
from mbs.app.desk.panels.plots_look import add_look
from mbs.app.tasks import exporting
from mbs.app.tasks.equations import entries
from mbs.assembly import System
from mbs.errors import MbsError

_NOTE = "export"


@dataclass(slots=True)
class _ExportAsked:
    """What the form holds."""

    models: list[str] = field(default_factory=lambda: list(exporting.MODELS))
    fmu: FmuAsked = field(default_factory=FmuAsked)


def open_export(desk: Desk) -> None:
    """Open the panel for the present robot.

    Args:
        desk: of the page.
    """
    system = desk.checked_system()
    if system is None:
        return
    asked = deepcopy(cast(_ExportAsked, desk.session.notes.get(_NOTE, _ExportAsked())))
    desk.session.notes[_NOTE] = asked
    add_look()
    with desk.open("Export", key="export"), ui.element("div").classes("desk-cards"):
        _fmu_card(desk, system, asked)
        with ui.element("div").style("display: grid; gap: 14px"):
            _c_card(desk, system, asked)
            _files_card(desk)


def _fmu_card(desk: Desk, system: System, asked: _ExportAsked) -> None:
    with ui.element("div").classes("desk-card"):
        _head(
            "FMU",
            "for Simulink, Modelica tools, FMPy and others: Model Exchange and"
            " Co-Simulation, with sources and a library for this computer",
        )
        fmu_form(system, asked.fmu)

        async def make() -> None:
            await _hand_out(desk, ".fmu", "Writing the FMU", exporting.fmu, asked.fmu.settings())

        _button("Download FMU", "fmu", make)


def _c_card(desk: Desk, system: System, asked: _ExportAsked) -> None:
    with ui.element("div").classes("desk-card"):
        _head(
            "C library",
            "a zip with one .c, one .h with documented prototypes, CMakeLists.txt"
            " and a program that runs every function once",
        )
        models = _models(system)
        asked.models = [key for key in asked.models if key in models]
        several_field(
            FieldLook("Models", "100%", "models"),
            models,
            asked.models,
            partial(setattr, asked, "models"),
        )

        async def make() -> None:
            keys = tuple(asked.models)
            await _hand_out(desk, ".zip", "Writing C", exporting.c_library, keys)

        _button("Download C library", "c-library", make)


def _files_card(desk: Desk) -> None:
    with ui.element("div").classes("desk-card"):
        _head(
            "Robot and picture",
            "the description as text, and the mechanism in the present"
            " posture as one file that any browser opens",
        )
        with ui.row().style("gap: 8px"):
            _button("TOML", "toml", lambda: _robot_file(desk, ".toml"))
            _button("SYMORO .par", "par", lambda: _robot_file(desk, ".par"))
            _button("HTML picture", "html", lambda: _picture(desk))


async def _robot_file(desk: Desk, suffix: str) -> None:
    """The document as typed where a table says it, else what the system says."""
    document = desk.document
    if document.is_table:
        try:
            text = await desk.aside(document.toml if suffix == ".toml" else document.par)
        except MbsError as error:
            desk.complain(error)
            return
        desk.download(cast(str, text).encode("utf-8"), f"{document.file_name}{suffix}")
    else:
        task = exporting.toml if suffix == ".toml" else exporting.par
        await _hand_out(desk, suffix, f"Writing {suffix}", task)


async def _picture(desk: Desk) -> None:
    await _hand_out(desk, ".html", "Drawing", exporting.html, tuple(desk.q))


async def _hand_out(
    desk: Desk, suffix: str, label: str, task: Callable[..., bytes], *args: Any
) -> None:
    """Download what a task makes, under the name of the robot that it was asked for."""
    name = f"{desk.document.file_name}{suffix}"
    made = await desk.run(label, task, *args)
    if made is not None:
        desk.download(made, name)


def _models(system: System) -> dict[str, str]:
    """Keys of the models that are Functions of the system, with their titles."""
    return {
        one.key: one.title for one in entries() if one.has_function(system) and one.applies(system)
    }


def _head(title: str, note: str) -> None:
    ui.label(title).classes("desk-card-title")
    ui.label(note).classes("desk-note")


def _button(title: str, marker: str, handler: Callable[[], Any]) -> None:
    button = ui.button(title, icon="download").props("outline no-caps dense").mark(marker)
    button.style("padding: 2px 12px")

    async def once() -> None:
        button.disable()
        try:
            await handler()
        finally:
            button.enable()

    button.on_click(once)
