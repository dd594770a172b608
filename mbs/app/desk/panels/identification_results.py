"""What an identification found: tables, residuals, and files to keep."""

from __future__ import annotations

import math
from typing import Any

from nicegui import ui

from mbs.app.desk.desk import Desk
from mbs.app.desk.panels.count_table import column
from mbs.app.desk.panels.plots import line_chart
from mbs.app.tasks.identification import EstimateRow, Identified

_POOR = 30.0
_NOTHING = 1000.0
"""Deviation that says nothing about a value [%]."""
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


def show_results(desk: Desk, found: Identified) -> None:
    """Fill the present place of the page.

    Args:
        desk: of the page.
        found: by the task.
    """
    with ui.element("div").classes("desk-result-head"):
        choice = (
            ui.toggle(["Estimates", "Residuals", "Report"], value="Estimates")
            .props("dense flat no-caps size=12.5px padding='3px 10px'")
            .mark("found")
        )
        ui.space()
        _files(desk, found)
    ui.label(
        f"{len(found.rows)} base parameters; error {found.total_percent:.3g} % of all efforts,"
        f" {found.held_out_percent:.3g} % in the last quarter of the record when the parameters"
        " come from the rest"
    ).classes("desk-note").mark("identified")
    place = ui.column().classes("full-width").style("gap: 10px")

    def draw() -> None:
        place.clear()
        with place:
            _VIEWS[str(choice.value)](found)

    choice.on_value_change(draw)
    draw()


def _files(desk: Desk, found: Identified) -> None:
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
        button.on_click(lambda text=text, name=name: desk.download(text().encode(), name))


def _estimates(found: Identified) -> None:
    rows = [
        {
            "name": row.name,
            "value": f"{row.value:.6g}",
            "deviation": f"{row.deviation:.2g}",
            "percent": f"{_percent(row.percent)}{' *' if row.percent > _POOR else ''}",
            "unit": row.unit,
            "essential": "yes" if row.essential else "no",
            "grouping": _terms(row),
        }
        for row in found.rows
    ]
    _table(_PARAMETERS, rows)
    ui.label(
        f"* a deviation of more than {_POOR:g} %: the record does not show this parameter well"
    ).classes("desk-note")
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
    with ui.element("div").classes("desk-residuals"):
        for k, effort in enumerate(found.efforts):
            measured, predicted = found.measured[:, k], found.predicted[:, k]
            both = {f"{effort.name} measured": measured, "predicted": predicted}
            error = {f"{effort.name} measured - predicted": measured - predicted}
            for series in (both, error):
                chart = line_chart(found.time, series, effort.unit)
                ui.echart(chart).style("width: 100%; height: 200px").mark("residual-chart")


def _report(found: Identified) -> None:
    ui.label(found.text).classes("desk-code").style("max-height: 420px")


_VIEWS = {"Estimates": _estimates, "Residuals": _residuals, "Report": _report}


def _table(columns: tuple[tuple[str, str, str], ...], rows: list[dict[str, Any]]) -> None:
    heads = [column(*one) for one in columns]
    table = ui.table(rows=rows, columns=heads, row_key="name").props("dense flat hide-bottom")
    table.classes("desk-table")


def _terms(row: EstimateRow) -> str:
    """The sum that a grouped parameter stands for; empty for one that stands for itself."""
    terms = row.grouping.partition(" = ")[2]
    return "" if terms == row.name else terms


def _percent(value: float) -> str:
    if not math.isfinite(value) or value >= _NOTHING:
        return "-"
    return f"{value:.0f}" if value >= 10 else f"{value:.2g}"
