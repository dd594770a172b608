"""Columns of the grids: titles, widths, and what their cells mean."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from mbs.app.desk.document.cells import CHOICES, COLUMNS, GENERAL_ROWS, CellProblem
from mbs.app.desk.document.tables import Tables

SHEETS: Mapping[str, str] = MappingProxyType(
    {
        "geometry": "Geometry",
        "inertia": "Inertia",
        "loops": "Loops",
        "symbols": "Symbols",
        "general": "General",
    }
)
"""Sheets and their titles."""

_TITLES: Mapping[str, str] = MappingProxyType(
    {
        "antecedent": "on",
        "actuated": "motor",
        "gamma": "γ",
        "alpha": "α",
        "theta": "θ",
        "guess": "start",
        "frame": "frame",
        "other": "meets",
        "Fs_width": "Fs width",
    }
)
_MEANINGS: Mapping[str, str] = MappingProxyType(
    {
        "antecedent": "Antecedent: the frame this one is placed on, 0 for the base",
        "joint": "Joint: revolute, prismatic or fixed",
        "actuated": "Motor: yes, no, or empty to leave it to the assembly",
        "gamma": "γ: angle about z of the antecedent, rad",
        "b": "b: distance along z of the antecedent, m",
        "alpha": "α: angle about x between the z axes, rad",
        "d": "d: distance along x between the z axes, m",
        "theta": "θ: angle about z, added to the variable of a revolute joint, rad",
        "r": "r: distance along z, added to the variable of a prismatic joint, m",
        "limits": "Limits of the joint variable: lower, upper; rad or m",
        "velocity": "Largest velocity, or lower, upper; rad/s or m/s",
        "effort": "Largest effort of the motor, or lower, upper; N m or N",
        "guess": "Where the robot is assembled, and near which loops are closed; rad or m",
        "name": "Name of the joint or body; empty for the usual one",
        "M": "Mass, kg",
        "Ia": "Inertia of the rotor seen at the joint, kg m² or kg",
        "Fv": "Viscous friction, N m s/rad or N s/m",
        "Fs": "Dry friction, N m or N",
        "stiffness": "Stiffness of a spring in the joint, N m/rad or N/m",
        "Fs_width": "Velocity over which dry friction changes sign, rad/s or m/s",
        "rest": "Position at which the spring is at rest, rad or m",
        "frame": "Frame that carries the variable of the cut joint",
        "other": "Fixed frame that it meets when the loop is closed",
    }
)
_MOMENTS = "Moments and products of inertia about the origin of the frame, kg m²"
_FIRST = "First moments, mass times centre of mass, kg m"
_WIDTHS: Mapping[str, int] = MappingProxyType(
    {
        "antecedent": 44,
        "joint": 84,
        "actuated": 66,
        "limits": 124,
        "velocity": 74,
        "effort": 68,
        "guess": 68,
        "name": 84,
        "stiffness": 86,
        "Fs_width": 86,
        "frame": 90,
        "other": 90,
        "value": 260,
    }
)
_USUAL: Mapping[str, int] = MappingProxyType({"geometry": 70, "inertia": 78, "loops": 90})
_RULES = {
    "desk-cell-bad": "data.bad && data.bad[colDef.field] !== undefined",
    "desk-cell-zero": "colDef.field !== 'antecedent' && (value === '0' || value === '0.0')",
}
_TOOLTIP = "(p) => (p.data && p.data.bad && p.data.bad[p.colDef.field]) || null"


def columns(sheet: str, *, removable: bool) -> list[dict[str, Any]]:
    """The column definitions of a sheet's grid.

    Args:
        sheet: which.
        removable: whether rows can be taken out.
    """
    first = {"geometry": "frame", "inertia": "body", "loops": "loop"}.get(sheet, "name")
    lead = {
        "field": "row_name",
        "headerName": first,
        "pinned": "left",
        "width": 64 if sheet in ("geometry", "inertia", "loops") else 120,
        "editable": False,
        "cellClass": "desk-cell-fixed",
    }
    made = [lead, *(_column(sheet, name) for name in COLUMNS[sheet])]
    if removable and sheet in ("geometry", "loops"):
        made.append(
            {
                "field": "remove",
                "headerName": "",
                "width": 38,
                "editable": False,
                "cellClass": "desk-cell-remove",
                "headerTooltip": "Remove the row",
            }
        )
    return made


def _column(sheet: str, name: str) -> dict[str, Any]:
    made: dict[str, Any] = {
        "field": name,
        "headerName": _TITLES.get(name, name),
        "headerTooltip": _meaning(sheet, name),
        "width": _WIDTHS.get(name, _USUAL.get(sheet, 90)),
        "cellClassRules": _RULES,
        ":tooltipValueGetter": _TOOLTIP,
    }
    if (sheet, name) in CHOICES:
        made["cellEditor"] = "agSelectCellEditor"
        made["cellEditorParams"] = {"values": list(CHOICES[sheet, name])}
    if name == "value":
        made["flex"] = 1
    return made


def _meaning(sheet: str, name: str) -> str:
    if sheet == "loops" and name == "joint":
        return "Type of the joint that was cut"
    if sheet == "inertia" and len(name) == 2 and name[0] in "XYZ":
        return _MOMENTS
    if sheet == "inertia" and len(name) == 2 and name[0] == "M":
        return _FIRST
    return _MEANINGS.get(name, name)


def rows(
    tables: Tables, symbols: tuple[str, ...], sheet: str, problems: tuple[CellProblem, ...]
) -> list[dict[str, Any]]:
    """The rows of a sheet's grid, with the sentences of their wrong cells."""
    made = []
    for k, row in enumerate(_texts(tables, symbols, sheet)):
        bad = {p.column: p.sentence for p in problems if p.sheet == sheet and p.row == k}
        if "" in bad:
            bad = {**dict.fromkeys(COLUMNS[sheet], bad[""]), **bad}
        cells = dict(zip(COLUMNS[sheet], row, strict=True))
        named = {"id": k, "row_name": _row_name(symbols, sheet, k), "remove": "✕"}
        made.append({**named, **cells, "bad": bad})
    return made


def _texts(tables: Tables, symbols: tuple[str, ...], sheet: str) -> tuple[tuple[str, ...], ...]:
    if sheet == "symbols":
        known = dict(tables.values)
        return tuple((known.get(name, ""),) for name in symbols)
    return tables.rows(sheet)


def _row_name(symbols: tuple[str, ...], sheet: str, k: int) -> str:
    if sheet == "symbols":
        return symbols[k]
    return GENERAL_ROWS[k] if sheet == "general" else str(k + 1)
