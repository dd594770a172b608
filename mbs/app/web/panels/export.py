"""Panel that provides files of the robot: for C, for other programs, and as a picture."""

from __future__ import annotations

from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass, field
from functools import partial
from typing import Any, cast

from nicegui import ui

from mbs.app.tasks import exporting
from mbs.app.tasks.equations import entries
from mbs.app.web.app import App
from mbs.app.web.panels.options_form import FormValues, first_values, form_texts, option_form
from mbs.app.web.panels.plots import FieldLook, add_look, several_field
from mbs.assembly import System
from mbs.errors import MbsError
from mbs.export.fmu.options import FmuOptions
from mbs.options import option_fields

_NOTE = "export"


@dataclass(slots=True)
class _ExportForm:
    """Values of the form of the export panel.

    Attributes:
        models: keys of the models in the C library.
        fmu: values of the options of the FMU.
    """

    models: list[str] = field(default_factory=lambda: list(exporting.MODELS))
    fmu: FormValues = field(default_factory=lambda: first_values(FmuOptions))


def open_export(app: App) -> None:
    """Open the panel that exports files of the present robot.

    Args:
        app: app of the page.
    """
    system = app.checked_system()
    if system is None:
        return
    form = deepcopy(cast(_ExportForm, app.session.notes.get(_NOTE, _ExportForm())))
    app.session.notes[_NOTE] = form
    add_look()
    with app.open("Export", key="export"), ui.element("div").classes("app-cards"):
        _fmu_card(app, system, form)
        with ui.element("div").style("display: grid; gap: 14px"):
            _c_card(app, system, form)
            _files_card(app)


def _fmu_card(app: App, system: System, form: _ExportForm) -> None:
    """Create the form of the FMU and its download button."""
    with ui.element("div").classes("app-card"):
        _head(
            "FMU",
            "for Simulink, Modelica tools, FMPy and others: Model Exchange and"
            " Co-Simulation, with sources and a library for this computer",
        )
        outputs = option_fields(FmuOptions)["outputs"][1].offered
        offered = {"outputs": [name for name in outputs if _is_offered(system, name)]}
        joint = (
            system.velocity_coordinates[system.independent[0]].name if system.independent else "j1"
        )
        option_form(FmuOptions, form.fmu, offered, joint)

        async def make() -> None:
            texts = form_texts(FmuOptions, form.fmu)
            await _run_and_download(app, ".fmu", "Writing the FMU", exporting.fmu, texts)

        _button("Download FMU", "fmu", make)


def _is_offered(system: System, output: str) -> bool:
    """Whether the system has an output group of the FMU, such as "closure" or "sensors"."""
    if output == "closure":
        return system.is_closed
    return output != "sensors" or bool(system.sensors)


def _c_card(app: App, system: System, form: _ExportForm) -> None:
    """Create the form of the C library and its download button."""
    with ui.element("div").classes("app-card"):
        _head(
            "C library",
            "a zip with one .c, one .h with documented prototypes, CMakeLists.txt"
            " and a program that runs every function once",
        )
        models = _models(system)
        form.models = [key for key in form.models if key in models]
        several_field(
            FieldLook("Models", "100%", "models"),
            models,
            form.models,
            partial(setattr, form, "models"),
        )

        async def make() -> None:
            keys = tuple(form.models)
            await _run_and_download(app, ".zip", "Writing C", exporting.c_library, keys)

        _button("Download C library", "c-library", make)


def _files_card(app: App) -> None:
    """Create the download buttons of robot files and of the picture."""
    with ui.element("div").classes("app-card"):
        _head(
            "Robot and picture",
            "the description as text, and the mechanism in the present"
            " configuration as one file that any browser opens",
        )
        with ui.row().style("gap: 8px"):
            _button("TOML", "toml", lambda: _robot_file(app, ".toml"))
            _button("SYMORO .par", "par", lambda: _robot_file(app, ".par"))
            _button("HTML picture", "html", lambda: _picture(app))


async def _robot_file(app: App, suffix: str) -> None:
    """Download the document as typed if it is a table, else a file of the assembled system."""
    document = app.document
    if document.is_table:
        try:
            text = await app.aside(document.toml if suffix == ".toml" else document.par)
        except MbsError as error:
            app.complain(error)
            return
        app.download(cast(str, text).encode("utf-8"), f"{document.file_name}{suffix}")
    else:
        task = exporting.toml if suffix == ".toml" else exporting.par
        await _run_and_download(app, suffix, f"Writing {suffix}", task)


async def _picture(app: App) -> None:
    """Download the picture in the present configuration as an HTML file."""
    await _run_and_download(app, ".html", "Drawing", exporting.html, tuple(app.q))


async def _run_and_download(
    app: App, suffix: str, label: str, task: Callable[..., bytes], *args: Any
) -> None:
    """Run `task(system, *args)` and download the bytes that it returns.

    The file has the name of the robot and a suffix; `label` describes the task to the user.
    """
    name = f"{app.document.file_name}{suffix}"
    made = await app.run(label, task, *args)
    if made is not None:
        app.download(made, name)


def _models(system: System) -> dict[str, str]:
    """Return the keys and titles of the models that are Functions of the system."""
    return {
        one.key: one.title for one in entries() if one.has_function(system) and one.applies(system)
    }


def _head(title: str, note: str) -> None:
    """Show the title of a card and a note below it."""
    ui.label(title).classes("app-card-title")
    ui.label(note).classes("app-note")


def _button(title: str, marker: str, handler: Callable[[], Any]) -> None:
    """Create a download button that calls `handler` and is disabled while it runs."""
    button = ui.button(title, icon="download").props("outline no-caps dense").mark(marker)
    button.style("padding: 2px 12px")

    async def once() -> None:
        button.disable()
        try:
            await handler()
        finally:
            button.enable()

    button.on_click(once)
