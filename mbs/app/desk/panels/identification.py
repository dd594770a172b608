"""The panel that identifies the robot from a record that its user uploads."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import dataclass, field
from functools import partial
from typing import Any, cast

from nicegui import ui

from mbs.app.desk.desk import Desk
from mbs.app.desk.panels.identification_results import show_results
from mbs.app.desk.panels.layout import Asking, tell_of_changes
from mbs.app.desk.panels.plots_fields import FieldLook, choice_field, several_field, text_field
from mbs.app.desk.panels.plots_look import add_look, come_into_view
from mbs.app.tasks.identification import (
    EQUATIONS,
    METHODS,
    VELOCITIES,
    IdentificationSettings,
    Identified,
    identify,
)
from mbs.app.tasks.identification_record import LARGEST, record_columns
from mbs.assembly import System
from mbs.messages import quoted

_NOTE = "identification"
_FOUND = "identified"
"""Note of the document and what was found last, for a reload."""
_LONGEST_LIST = 12
_COLUMNS = {"rotors": "rotors", "offsets": "offsets"}


@dataclass(slots=True)
class _IdentificationAsked:
    """What the form holds."""

    content: bytes = b""
    file: str = ""
    bandwidth: str = "10"
    method: str = "weighted"
    equations: str = "dynamic"
    velocities: str = "differences"
    columns: list[str] = field(default_factory=lambda: ["rotors"])

    def settings(self) -> IdentificationSettings:
        return IdentificationSettings(
            bandwidth=self.bandwidth,
            method=self.method,
            equations=self.equations,
            rotors="rotors" in self.columns,
            offsets="offsets" in self.columns,
            velocities=self.velocities,
        )


def open_identification(desk: Desk) -> None:
    """Open the panel for the present robot.

    Args:
        desk: of the page.
    """
    system = desk.checked_system()
    if system is None:
        return
    asked = deepcopy(
        cast(_IdentificationAsked, desk.session.notes.get(_NOTE, _IdentificationAsked()))
    )
    desk.session.notes[_NOTE] = asked
    add_look()
    with desk.open("Identify", key="identify"), ui.element("div").classes("desk-halves"):
        with ui.element("div").classes("desk-half").style("flex: 0 0 350px"):
            _explain(system)
            _upload(desk, asked)
            _form(asked)
            button = ui.button("Identify").props("unelevated no-caps dense").mark("identify")
            button.style("padding: 2px 22px; align-self: start")
        shown = ui.element("div").classes("desk-half desk-stays")
        with shown:
            kept = desk.session.notes.get(_FOUND)
            if isinstance(kept, tuple) and kept[0] == desk.document:
                show_results(desk, kept[1])
            else:
                ui.label("Estimates and residuals appear here.").classes("desk-note")

    async def run() -> None:
        await _run(desk, asked, button, shown)

    tell_of_changes(desk, shown)
    button.on_click(run)


async def _run(
    desk: Desk, asked: _IdentificationAsked, button: ui.button, shown: ui.element
) -> None:
    if not asked.content:
        desk.complain("there is no record yet; upload a file of comma-separated values first")
        return
    document = desk.document

    def show(found: Identified) -> None:
        desk.session.notes[_FOUND] = (document, found)
        show_results(desk, found)
        come_into_view(shown)

    task = partial(identify, quiet=True)
    await Asking(desk, button, shown, show).run(
        "Identifying", task, asked.content, asked.settings()
    )


def _explain(system: System) -> None:
    columns = record_columns(system)
    names = [*columns["time"], *columns["q"], *columns["tau"]]
    if system.is_closed:
        names = ["time", *(f"{system.speeds[k].name}.q" for k in system.active), *columns["tau"]]
    more = len(names) - _LONGEST_LIST
    listed = ", ".join(names[:_LONGEST_LIST]) + (f" and {more} more" if more > 0 else "")
    ui.label(
        f"A record is a file of comma-separated values whose first line names the columns {listed};"
        " in s, rad or m, N m or N, on the joints' side of the gears. Velocities such as"
        f" {columns['v'][0]} may be there too. What a simulation writes is such a record."
    ).classes("desk-note")


def _upload(desk: Desk, asked: _IdentificationAsked) -> None:
    async def uploaded(event: Any) -> None:
        upload.reset()
        if event.file.size() > LARGEST:
            desk.complain(f"the record has more than {LARGEST / 1e6:.0f} MB; cut it into pieces")
            return
        asked.content = await event.file.read()
        asked.file = str(event.file.name)
        told.set_text(_told(asked))

    def rejected() -> None:
        desk.complain(
            f"the file is not taken; upload one .csv file of at most {LARGEST / 1e6:.0f} MB"
        )

    upload = ui.upload(
        max_file_size=LARGEST,
        max_files=1,
        auto_upload=True,
        on_upload=uploaded,
        on_rejected=rejected,
    )
    upload.props('accept=".csv,.txt"').classes("hidden").mark("upload")
    with ui.element("div").classes("desk-result-head"):
        choose = ui.button("Upload a record…", icon="upload_file").props("outline no-caps dense")
        choose.style("padding: 2px 12px").on_click(lambda: upload.run_method("pickFiles"))
        told = ui.label(_told(asked)).classes("desk-note").mark("record")


def _told(asked: _IdentificationAsked) -> str:
    if not asked.content:
        return "No record yet."
    return f"{quoted(asked.file)[1:-1]}, {len(asked.content) / 1e3:.0f} kB"


def _form(asked: _IdentificationAsked) -> None:
    with ui.element("div").classes("desk-form"):
        look = FieldLook("Bandwidth [Hz]", "120px", "bandwidth")
        field = text_field(look, asked.bandwidth, partial(setattr, asked, "bandwidth"))
        field.tooltip("of the filters; five to ten times the highest frequency of the motion")
        _choice(asked, METHODS, FieldLook("Method", "190px", "method"))
        _choice(asked, EQUATIONS, FieldLook("Equations", "120px", "equations"))
        _choice(asked, VELOCITIES, FieldLook("Velocities", "190px", "velocities"))
        several_field(
            FieldLook("Beside bodies and friction", "324px", "columns"),
            _COLUMNS,
            asked.columns,
            partial(setattr, asked, "columns"),
        )


def _choice(asked: _IdentificationAsked, names: tuple[str, ...], look: FieldLook) -> None:
    options = {name: name.replace("_", " ") for name in names}
    chosen = getattr(asked, look.marker)
    choice_field(look, options, chosen, partial(setattr, asked, look.marker))
