"""Panel that provides files of the robot: for C, for other programs, and as a picture."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from copy import deepcopy
from dataclasses import dataclass, field
from functools import partial
from typing import Any, cast

from nicegui import ui

from mbs.app.tasks import exporting
from mbs.app.tasks.equations import entries
from mbs.app.tasks.exporting import SOLVERS, FmuSettings
from mbs.app.web.app import App
from mbs.app.web.panels.plots import FieldLook, add_look, choice_field, several_field, text_field
from mbs.assembly import System
from mbs.errors import MbsError

# Options of an FMU as a form.


_SOLVERS = {
    "dopri5": "dopri5, explicit",
    "rodas": "rodas, stiff",
    "rk4": "rk4, fixed step",
}
_OUTPUTS = ("energy", "closure", "poses", "cut_forces", "sensors")
_PARAMETERS = (
    "masses", "first_moments", "inertias", "lengths", "angles", "friction", "rotors", "gravity"
)  # fmt: skip


@dataclass(slots=True)
class FmuAsked:
    """Values of the form, see `FmuSettings`; `more_...` are additional names as typed."""

    fmi: str = "2.0"
    solver: str = "dopri5"
    stop_time: str = "10"
    step_size: str = "0.01"
    tolerance: str = "1e-8"
    internal_step: str = "0.001"
    max_step: str = ""
    outputs: list[str] = field(default_factory=list)
    parameters: list[str] = field(default_factory=list)
    more_inputs: str = ""
    more_outputs: str = ""
    more_parameters: str = ""

    def settings(self) -> FmuSettings:
        """Return the settings that the form specifies."""
        return FmuSettings(
            fmi=self.fmi,
            inputs=_names(self.more_inputs),
            outputs=(*self.outputs, *_names(self.more_outputs)),
            parameters=(*self.parameters, *_names(self.more_parameters)),
            stop_time=self.stop_time,
            step_size=self.step_size,
            tolerance=self.tolerance,
            solver=self.solver,
            internal_step=self.internal_step,
            max_step=self.max_step.strip(),
        )


def fmu_form(system: System, asked: FmuAsked) -> None:
    """Create the fields of the form, which write into `asked`.

    Args:
        system: system to export.
        asked: values of the form; they are updated while the user types.
    """
    offered = [name for name in _OUTPUTS if _is_offered(system, name)]
    asked.outputs = [name for name in asked.outputs if name in offered]
    joint = system.speeds[system.active[0]].name if system.active else "j1"
    with ui.element("div").classes("app-form"):
        _choice(asked, {"2.0": "2.0", "3.0": "3.0"}, FieldLook("FMI", "84px", "fmi"))
        solvers = {name: _SOLVERS.get(name, name) for name in SOLVERS}
        solver = _choice(asked, solvers, FieldLook("Solver", "160px", "solver"))
        _input("Stop time [s]", asked, "stop_time", "100px")
        _input("Step [s]", asked, "step_size", "84px")
        _input("Tolerance", asked, "tolerance", "90px")
        inner = _input("Step of rk4 [s]", asked, "internal_step", "110px")
        inner.bind_visibility_from(solver, "value", value="rk4")
        longest = _input("Longest step [s]", asked, "max_step", "112px")
        longest.bind_visibility_from(solver, "value", lambda name: name != "rk4")
    beside = "Outputs beside the motion of joints and tool"
    _several(asked, offered, FieldLook(beside, "100%", "outputs"))
    _several(asked, _PARAMETERS, FieldLook("Numbers that become parameters", "100%", "parameters"))
    with ui.element("div").classes("app-form"):
        _input("More inputs", asked, "more_inputs", "150px").tooltip(
            f"such as {joint}.q, {joint}.a or tool.wrench; commas between them"
        )
        _input("More outputs", asked, "more_outputs", "150px").tooltip(
            f"such as pose:tool or wrench:{joint}; commas between them"
        )
        _input("More parameters", asked, "more_parameters", "150px").tooltip(
            "such as M3 or d4, or the name of a body; commas between them"
        )


def _is_offered(system: System, output: str) -> bool:
    if output == "closure":
        return system.is_closed
    return output != "sensors" or bool(system.sensors)


def _names(text: str) -> tuple[str, ...]:
    return tuple(part for part in re.split(r"[,\s]+", text) if part)


def _input(label: str, asked: FmuAsked, key: str, width: str) -> ui.input:
    look = FieldLook(label, width, key)
    return text_field(look, getattr(asked, key), partial(setattr, asked, key))


def _choice(asked: FmuAsked, options: dict[str, str], look: FieldLook) -> ui.select:
    key = look.marker
    return choice_field(look, options, getattr(asked, key), partial(setattr, asked, key))


def _several(asked: FmuAsked, names: Sequence[str], look: FieldLook) -> None:
    key, options = look.marker, {name: name.replace("_", " ") for name in names}
    several_field(look, options, getattr(asked, key), partial(setattr, asked, key))


_NOTE = "export"


@dataclass(slots=True)
class _ExportAsked:
    """Values of the form."""

    models: list[str] = field(default_factory=lambda: list(exporting.MODELS))
    fmu: FmuAsked = field(default_factory=FmuAsked)


def open_export(app: App) -> None:
    """Open the panel for the present robot.

    Args:
        app: app of the page.
    """
    system = app.checked_system()
    if system is None:
        return
    asked = deepcopy(cast(_ExportAsked, app.session.notes.get(_NOTE, _ExportAsked())))
    app.session.notes[_NOTE] = asked
    add_look()
    with app.open("Export", key="export"), ui.element("div").classes("app-cards"):
        _fmu_card(app, system, asked)
        with ui.element("div").style("display: grid; gap: 14px"):
            _c_card(app, system, asked)
            _files_card(app)


def _fmu_card(app: App, system: System, asked: _ExportAsked) -> None:
    with ui.element("div").classes("app-card"):
        _head(
            "FMU",
            "for Simulink, Modelica tools, FMPy and others: Model Exchange and"
            " Co-Simulation, with sources and a library for this computer",
        )
        fmu_form(system, asked.fmu)

        async def make() -> None:
            await _hand_out(app, ".fmu", "Writing the FMU", exporting.fmu, asked.fmu.settings())

        _button("Download FMU", "fmu", make)


def _c_card(app: App, system: System, asked: _ExportAsked) -> None:
    with ui.element("div").classes("app-card"):
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
            await _hand_out(app, ".zip", "Writing C", exporting.c_library, keys)

        _button("Download C library", "c-library", make)


def _files_card(app: App) -> None:
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
        await _hand_out(app, suffix, f"Writing {suffix}", task)


async def _picture(app: App) -> None:
    await _hand_out(app, ".html", "Drawing", exporting.html, tuple(app.q))


async def _hand_out(
    app: App, suffix: str, label: str, task: Callable[..., bytes], *args: Any
) -> None:
    """Run a task and download its result, with the file name of the present robot."""
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
    ui.label(title).classes("app-card-title")
    ui.label(note).classes("app-note")


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
