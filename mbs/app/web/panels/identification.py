"""Panel that identifies the parameters of the robot from an uploaded record."""

from __future__ import annotations

import math
from copy import deepcopy
from dataclasses import dataclass, field
from functools import partial
from typing import Any, cast

from nicegui import ui

from mbs.app.tasks.identification import (
    LARGEST,
    VELOCITIES,
    EstimateRow,
    IdentificationSettings,
    Identified,
    identify,
    record_columns,
)
from mbs.app.web.app import App
from mbs.app.web.panels.layout import TaskButton, warn_of_changes
from mbs.app.web.panels.options_form import (
    FormValues,
    first_values,
    flags_field,
    form_texts,
    option_row,
)
from mbs.app.web.panels.plots import (
    FieldLook,
    add_look,
    choice_field,
    come_into_view,
    line_chart,
    text_field,
)
from mbs.app.web.panels.text_view import column
from mbs.assembly import System
from mbs.identification._identify import POOR
from mbs.identification.options import IdentifyArguments
from mbs.text import quoted

# Results of an identification: tables, residuals, and files to download.


_NOTHING = 1000.0
"""Relative deviation [%] from which it is not shown, because the value is not significant."""
_PARAMETERS = (
    ("name", "Parameter", "left"),
    ("value", "Value", "right"),
    ("deviation", "Deviation", "right"),
    ("percent", "%", "right"),
    ("unit", "Unit", "left"),
    ("essential", "Needed", "left"),
    ("grouping", "Stands for", "left"),
)
_EFFORTS = (
    ("name", "Effort", "left"),
    ("rms", "Error, rms", "right"),
    ("percent", "%", "right"),
    ("held_out_rms", "Last quarter, rms", "right"),
    ("held_out_percent", "%", "right"),
    ("unit", "Unit", "left"),
)


def show_results(app: App, found: Identified) -> None:
    """Show the result of an identification at the present position of the page.

    Args:
        app: app of the page.
        found: result of the identification.
    """
    with ui.element("div").classes("app-result-head"):
        choice = (
            ui.toggle(["Estimates", "Residuals", "Report"], value="Estimates")
            .props("dense flat no-caps size=12.5px padding='3px 10px'")
            .mark("found")
        )
        ui.space()
        _files(app, found)
    ui.label(
        f"{len(found.rows)} base parameters; error {found.total_percent:.3g} % of all efforts,"
        f" {found.held_out_percent:.3g} % in the last quarter of the record when the parameters"
        " come from the rest"
    ).classes("app-note").mark("identified")
    place = ui.column().classes("full-width").style("gap: 10px")

    def draw() -> None:
        place.clear()
        with place:
            _VIEWS[str(choice.value)](found)

    choice.on_value_change(draw)
    draw()


def _files(app: App, found: Identified) -> None:
    """Create the buttons that download estimates, residuals and report."""
    stem = found.name
    files = {
        "Estimates": (lambda: found.csv(), f"{stem}_estimates.csv"),
        "Residuals": (lambda: found.residuals_csv(), f"{stem}_residuals.csv"),
        "Report": (lambda: found.text, f"{stem}_report.txt"),
    }
    for title, (text, name) in files.items():
        button = (
            ui.button(title, icon="download")
            .props("flat dense no-caps")
            .mark(f"file-{title.lower()}")
        )
        button.on_click(lambda text=text, name=name: app.download(text().encode(), name))


def _estimates(found: Identified) -> None:
    """Show the tables of estimates and of the errors of the efforts."""
    rows = [
        {
            "name": row.name,
            "value": f"{row.value:.6g}",
            "deviation": f"{row.deviation:.2g}",
            "percent": f"{_percent(row.percent)}{' *' if row.percent > POOR else ''}",
            "unit": row.unit,
            "essential": "yes" if row.essential else "no",
            "grouping": _terms(row),
        }
        for row in found.rows
    ]
    _table(_PARAMETERS, rows)
    ui.label(
        f"* a deviation of more than {POOR:g} %: the record does not show this parameter well"
    ).classes("app-note")
    errors = [
        {
            "name": e.name,
            "rms": f"{e.rms:.4g}",
            "percent": _percent(e.percent),
            "held_out_rms": f"{e.held_out_rms:.4g}",
            "held_out_percent": _percent(e.held_out_percent),
            "unit": e.unit,
        }
        for e in found.efforts
    ]
    _table(_EFFORTS, errors)


def _residuals(found: Identified) -> None:
    """Show charts of measured and predicted efforts and of their differences."""
    with ui.element("div").classes("app-residuals"):
        for k, effort in enumerate(found.efforts):
            measured, predicted = found.measured[:, k], found.predicted[:, k]
            both = {f"{effort.name} measured": measured, "predicted": predicted}
            error = {f"{effort.name} measured - predicted": measured - predicted}
            for series in (both, error):
                chart = line_chart(found.time, series, effort.unit)
                ui.echart(chart).style("width: 100%; height: 200px").mark("residual-chart")


def _report(found: Identified) -> None:
    """Show the report as text."""
    ui.label(found.text).classes("app-code").style("max-height: 420px")


_VIEWS = {"Estimates": _estimates, "Residuals": _residuals, "Report": _report}


def _table(columns: tuple[tuple[str, str, str], ...], rows: list[dict[str, Any]]) -> None:
    """Create a table; `columns` are (field, title, alignment)."""
    heads = [column(*one) for one in columns]
    table = ui.table(rows=rows, columns=heads, row_key="name").props("dense flat hide-bottom")
    table.classes("app-table")


def _terms(row: EstimateRow) -> str:
    """Return the sum that a grouped parameter represents; empty if it is not grouped."""
    terms = row.grouping.partition(" = ")[2]
    return "" if terms == row.name else terms


def _percent(value: float) -> str:
    """Return a percentage as text, "-" if it is very large or not finite."""
    if not math.isfinite(value) or value >= _NOTHING:
        return "-"
    return f"{value:.0f}" if value >= 10 else f"{value:.2g}"


_NOTE = "identification"
_FOUND = "identified"
"""Name of the session note with the document and the last result, for a reload of the page."""
_LONGEST_LIST = 12


@dataclass(slots=True)
class _IdentificationForm:
    """Values of the form of the identification panel.

    Attributes:
        content, file: content and name of the uploaded record.
        bandwidth: bandwidth of the filters [Hz].
        velocities: source of velocities, a name in `VELOCITIES`.
        options: values of further options.
    """

    content: bytes = b""
    file: str = ""
    bandwidth: str = "10"
    velocities: str = "differences"
    options: FormValues = field(default_factory=lambda: first_values(IdentifyArguments))

    def settings(self) -> IdentificationSettings:
        """Return the settings that the form specifies."""
        options = form_texts(IdentifyArguments, self.options)
        return IdentificationSettings(self.bandwidth, self.velocities, options)


def open_identification(app: App) -> None:
    """Open the panel that identifies the parameters of the present robot.

    Args:
        app: app of the page.
    """
    system = app.checked_system()
    if system is None:
        return
    form = deepcopy(cast(_IdentificationForm, app.session.notes.get(_NOTE, _IdentificationForm())))
    app.session.notes[_NOTE] = form
    add_look()
    with app.open("Identify", key="identify"), ui.element("div").classes("app-halves"):
        with ui.element("div").classes("app-half").style("flex: 0 0 350px"):
            _explain(system)
            _upload(app, form)
            _form(form)
            button = ui.button("Identify").props("unelevated no-caps dense").mark("identify")
            button.style("padding: 2px 22px; align-self: start")
        shown = ui.element("div").classes("app-half app-stays")
        with shown:
            kept = app.session.notes.get(_FOUND)
            if isinstance(kept, tuple) and kept[0] == app.document:
                show_results(app, kept[1])
            else:
                ui.label("Estimates and residuals appear here.").classes("app-note")

    async def run() -> None:
        await _run(app, form, button, shown)

    warn_of_changes(app, shown)
    button.on_click(run)


async def _run(app: App, form: _IdentificationForm, button: ui.button, shown: ui.element) -> None:
    """Identify the robot from the record in the form, and show the result in `shown`.

    `button` is disabled meanwhile. An error is shown if there is no record.
    """
    if not form.content:
        app.complain("there is no record yet; upload a file of comma-separated values first")
        return
    document = app.document

    def show(found: Identified) -> None:
        app.session.notes[_FOUND] = (document, found)
        show_results(app, found)
        come_into_view(shown)

    task = partial(identify, quiet=True)
    await TaskButton(app, button, shown, show).run(
        "Identifying", task, form.content, form.settings()
    )


def _explain(system: System) -> None:
    """Show a note about the columns that a record must have."""
    columns = record_columns(system)
    names = [*columns["time"], *columns["q"], *columns["tau"]]
    if system.is_closed:
        names = [
            "time",
            *(f"{system.velocity_coordinates[k].name}.q" for k in system.independent),
            *columns["tau"],
        ]
    more = len(names) - _LONGEST_LIST
    listed = ", ".join(names[:_LONGEST_LIST]) + (f" and {more} more" if more > 0 else "")
    ui.label(
        f"A record is a file of comma-separated values whose first line names the columns {listed};"
        " in s, rad or m, N m or N, on the joints' side of the gears. Velocities such as"
        f" {columns['v'][0]} may be there too. What a simulation writes is such a record."
    ).classes("app-note")


def _upload(app: App, form: _IdentificationForm) -> None:
    """Create the button that uploads a record into the form."""

    async def uploaded(event: Any) -> None:
        upload.reset()
        if event.file.size() > LARGEST:
            app.complain(f"the record has more than {LARGEST / 1e6:.0f} MB; cut it into pieces")
            return
        form.content = await event.file.read()
        form.file = str(event.file.name)
        label.set_text(_record_text(form))

    def rejected() -> None:
        app.complain(
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
    with ui.element("div").classes("app-result-head"):
        choose = ui.button("Upload a record…", icon="upload_file").props("outline no-caps dense")
        choose.style("padding: 2px 12px").on_click(lambda: upload.run_method("pickFiles"))
        label = ui.label(_record_text(form)).classes("app-note").mark("record")


def _record_text(form: _IdentificationForm) -> str:
    """Return name and size of the uploaded record as text."""
    if not form.content:
        return "No record yet."
    return f"{quoted(form.file)[1:-1]}, {len(form.content) / 1e3:.0f} kB"


def _form(form: _IdentificationForm) -> None:
    """Create the fields of the settings."""
    with ui.element("div").classes("app-form"):
        look = FieldLook("Bandwidth [Hz]", "120px", "bandwidth")
        field = text_field(look, form.bandwidth, partial(setattr, form, "bandwidth"))
        field.tooltip("of the filters; five to ten times the highest frequency of the motion")
        option_row(IdentifyArguments, form.options)
        choice_field(
            FieldLook("Velocities", "160px", "velocities"),
            {name: name for name in VELOCITIES},
            form.velocities,
            partial(setattr, form, "velocities"),
        )
        look = FieldLook("Beside bodies and friction", "324px", "columns")
        flags_field(IdentifyArguments, form.options, look)
