"""The postures that solve the inverse geometry as a table whose rows move the picture."""

from __future__ import annotations

import csv
import io
import math
from typing import Any

from nicegui import events, ui

from mbs.app.desk.desk import Desk
from mbs.app.desk.panels.count_table import column
from mbs.app.desk.panels.layout import in_a_row
from mbs.app.tasks.postures import Posture, PostureList

_PAGE = 32
_DEGREES = 180 / math.pi
RAD, DEG = "rad", "deg"


def show_postures(desk: Desk, made: PostureList) -> None:
    """The postures where the slot is, or why there are none.

    Args:
        desk: of the page.
        made: what was found.
    """
    ui.label(_headline(made)).style("font-weight: 600").mark("headline")
    if not made.rows:
        _nothing(desk, made)
        return
    with in_a_row():
        unit = ui.toggle([RAD, DEG], value=RAD).props("dense flat no-caps").mark("unit")
        ui.button(
            "CSV",
            icon="download",
            on_click=lambda: desk.download(csv_of(made), f"{made.system}_postures.csv"),
        ).props("flat dense no-caps")
        ui.label("Click a row to move the picture there.").classes("desk-note")
    table = ui.table(
        columns=_columns(made),
        rows=_rows(made, RAD),
        row_key="number",
        pagination=_PAGE if len(made.rows) > _PAGE else 0,
    )
    few = "" if len(made.rows) > _PAGE else "hide-bottom"
    table.props(f"dense flat bordered {few}").classes("desk-table").mark("postures")
    table.props(f':table-row-style-fn="{_ROW_STYLE}"')
    table.add_slot("body-cell-limits", _LIMITS)

    shown = [0]

    def fill() -> None:
        rows = _rows(made, str(unit.value))
        table.update_rows([row | {"shown": row["number"] == shown[0]} for row in rows])

    async def clicked(event: events.GenericEventArguments) -> None:
        shown[0] = int(event.args[1]["number"])
        fill()
        await desk.set_posture(made.rows[shown[0] - 1].q)

    table.on("rowClick", clicked)
    unit.on_value_change(fill)
    ui.label(_MEANINGS).classes("desk-note")


def csv_of(made: PostureList) -> bytes:
    """The postures as comma-separated values, a header first; positions in rad and m."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    units = zip(made.names, made.units, strict=True)
    writer.writerow(
        [
            "number",
            *(f"{name} [{unit}]" for name, unit in units),
            *("residual", "sigma", "roots", "within_limits", "label", "family"),
        ]
    )
    for number, row in enumerate(made.rows, 1):
        writer.writerow(
            [
                number,
                *map(repr, row.q),
                *(row.residual, row.sigma, row.multiplicity, row.within_limits),
                *(row.label, row.family),
            ]
        )
    return stream.getvalue().encode()


_ROW_STYLE = "row => 'cursor: pointer' + (row.shown ? '; background: var(--d-accent-soft)' : '')"
_MEANINGS = (
    "Residual: of the pose [m or 1]. Sigma: smallest singular value of the Jacobian, 0 at a"
    " singular posture. Roots: how many solutions meet there, any along a self-motion."
)
_LIMITS = """
<q-td :props="props" :class="props.row.inside ? '' : 'desk-bad'">{{ props.value }}</q-td>
"""


def _headline(made: PostureList) -> str:
    count = len(made.rows)
    if not count:
        return f"{made.system}: no posture takes frame {made.frame} there"
    outside = sum(not row.within_limits for row in made.rows)
    told = f"{made.system}, frame {made.frame}: {count} posture{'s' if count > 1 else ''}"
    told += f" by {made.method}"
    if made.locked:
        told += "; held: " + ", ".join(f"{name} = {x:.4g}" for name, x in made.locked)
    return told + (f"; {outside} outside of limits" if outside else "")


def _nothing(desk: Desk, made: PostureList) -> None:
    ui.label(made.reason[:1].upper() + made.reason[1:] + ".").mark("reason")
    near = made.nearest
    if near is None:
        return
    angle = round(near.angle * _DEGREES, 6)
    away = f"{round(near.distance, 9):.4g} m away and turned by {angle:.4g} degrees"
    with in_a_row():
        show = ui.button("Show the nearest posture", on_click=lambda: desk.set_posture(near.q))
        show.props("outline no-caps dense").style("padding: 2px 12px").mark("nearest")
        ui.label(f"Its frame is {away}.").classes("desk-note")


def _columns(made: PostureList) -> list[dict[str, Any]]:
    heads = [("number", "", "right"), ("label", "which one", "left")]
    heads += [(f"q{k}", name, "right") for k, name in enumerate(made.names)]
    heads += [("residual", "residual", "right"), ("sigma", "sigma", "right")]
    heads += [("roots", "roots", "right"), ("limits", "limits", "left")]
    columns = [column(*head) | {"sortable": True} for head in heads]
    columns[1]["style"] = "min-width: 210px; white-space: normal"
    return columns


def _rows(made: PostureList, unit: str) -> list[dict[str, Any]]:
    return [_row(made, number, row, unit) for number, row in enumerate(made.rows, 1)]


def _row(made: PostureList, number: int, row: Posture, unit: str) -> dict[str, Any]:
    factors = [_DEGREES if unit == DEG and u == "rad" else 1.0 for u in made.units]
    digits = 2 if unit == DEG else 4
    values = {
        f"q{k}": f"{round(x * factor, digits) + 0.0:.{digits if factor != 1 else 4}f}"
        for k, (x, factor) in enumerate(zip(row.q, factors, strict=True))
    }
    return {
        "number": number,
        "label": f"{row.label} ({row.family})" if row.family else row.label,
        **values,
        "residual": f"{row.residual:.1e}",
        "sigma": f"{row.sigma:.2g}",
        "roots": "any" if row.family else row.multiplicity,
        "limits": "within" if row.within_limits else _outside(row),
        "inside": row.within_limits,
    }


def _outside(row: Posture) -> str:
    return f"outside: {', '.join(row.outside)}" if row.outside else "outside"
