"""The robot as tables: a grid of texts per table; cells with errors are red with a tooltip."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from nicegui import events, ui

from mbs.app.web.app import App
from mbs.app.web.document.document import Document
from mbs.app.web.document.tables import CHOICES, COLUMNS, GENERAL_ROWS, Cell, CellProblem, Tables
from mbs.errors import MbsError

# Columns of the grids: titles, widths, and meanings of the cells.


SHEETS: Mapping[str, str] = MappingProxyType(
    {
        "geometry": "Geometry",
        "inertia": "Inertia",
        "loops": "Loops",
        "symbols": "Symbols",
        "general": "General",
    }
)
"""Titles of the tables."""

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
        "Fs": "Coulomb friction, N m or N",
        "stiffness": "Stiffness of a spring in the joint, N m/rad or N/m",
        "Fs_width": "Velocity over which Coulomb friction changes sign, rad/s or m/s",
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
    "app-cell-bad": "data.bad && data.bad[colDef.field] !== undefined",
    "app-cell-zero": "colDef.field !== 'antecedent' && (value === '0' || value === '0.0')",
}
_TOOLTIP = "(p) => (p.data && p.data.bad && p.data.bad[p.colDef.field]) || null"


def columns(sheet: str, *, removable: bool) -> list[dict[str, Any]]:
    """Return the column definitions of the grid of a table.

    Args:
        sheet: name of the table, a key of `SHEETS`.
        removable: whether rows can be removed.
    """
    first = {"geometry": "frame", "inertia": "body", "loops": "loop"}.get(sheet, "name")
    lead = {
        "field": "row_name",
        "headerName": first,
        "pinned": "left",
        "width": 64 if sheet in ("geometry", "inertia", "loops") else 120,
        "editable": False,
        "cellClass": "app-cell-fixed",
    }
    made = [lead, *(_column(sheet, name) for name in COLUMNS[sheet])]
    if removable and sheet in ("geometry", "loops"):
        made.append(
            {
                "field": "remove",
                "headerName": "",
                "width": 38,
                "editable": False,
                "cellClass": "app-cell-remove",
                "headerTooltip": "Remove the row",
            }
        )
    return made


def _column(sheet: str, name: str) -> dict[str, Any]:
    """Return the definition of a column: title, width, tooltip and allowed words."""
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
    """Return the tooltip of a column."""
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
    """Return the rows of the grid of a table, with the error messages of their cells.

    Args:
        tables: cells of the robot.
        symbols: names of the symbols of the robot.
        sheet: name of the table, a key of `SHEETS`.
        problems: errors of cells.
    """
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
    """Return the rows of texts of the table `sheet`, with the values of the given symbols."""
    if sheet == "symbols":
        known = dict(tables.values)
        return tuple((known.get(name, ""),) for name in symbols)
    return tables.rows(sheet)


def _row_name(symbols: tuple[str, ...], sheet: str, k: int) -> str:
    """Return the label of row k: name of a symbol or quantity, else its number."""
    if sheet == "symbols":
        return symbols[k]
    return GENERAL_ROWS[k] if sheet == "general" else str(k + 1)


_EMPTY = {
    "symbols": "No symbols yet: write one, such as L2, in any cell of geometry or inertia.",
    "loops": "No loops: this robot is an open chain.",
}
_ROW_ID = "(p) => String(p.data.id)"


class TablePanel:
    """Left half of the app: the tables of the robot."""

    def __init__(self, app: App) -> None:
        self._app = app
        self._sheet = str(app.session.notes.get("sheet", "geometry"))
        self._is_locked = app.document.origin is not None
        self._tabs: dict[str, ui.element] = {}
        self._grids: dict[str, ui.aggrid] = {}
        self._panes: dict[str, ui.element] = {}
        with ui.element("div").classes("app-left"):
            with ui.element("div").classes("app-tabs"):
                for sheet, title in SHEETS.items():
                    self._tabs[sheet] = self._tab(sheet, title)
            with ui.element("div").classes("app-locked") as self._locked:
                self._reason = ui.label()
                ui.label(
                    "The tables show the links that it was assembled into; only values of symbols,"
                    " gravity and the mount can be changed. Robot ▸ Make it a table of frames lets"
                    " you change all."
                )
            for sheet in SHEETS:
                self._panes[sheet] = ui.element("div").classes("app-sheet")
            self._sentence = ui.label().classes("app-sentence app-bad")
        app.on_document(self.refresh)
        self.select(self._sheet)
        self.refresh()

    def select(self, sheet: str) -> None:
        """Show a table; its grid is created when it is shown for the first time.

        Args:
            sheet: name of the table, a key of `SHEETS`.
        """
        self._sheet = sheet
        self._app.session.notes["sheet"] = sheet
        for name, tab in self._tabs.items():
            tab.classes(add="app-tab-on") if name == sheet else tab.classes(remove="app-tab-on")
            self._panes[name].set_visibility(name == sheet)
        if sheet not in self._grids:
            with self._panes[sheet]:
                self._grids[sheet] = self._grid(sheet)
                self._row_bar(sheet)

    def refresh(self) -> None:
        """Show the present document and its errors."""
        document = self._app.document
        problems = document.problems
        for sheet, grid in self._grids.items():
            fresh = self._rows(document, sheet, problems)
            if fresh != grid.options["rowData"]:
                dict.__setitem__(grid.options, "rowData", fresh)
                grid.run_grid_method("setGridOption", "rowData", fresh)
        wrong = {problem.sheet for problem in problems}
        for sheet, tab in self._tabs.items():
            tab.classes(add="app-tab-bad") if sheet in wrong else tab.classes(remove="app-tab-bad")
        self._show_message(problems)
        reason = "" if document.origin is None else document.origin.reason
        self._reason.set_text(reason)
        self._locked.set_visibility(bool(reason))
        if self._is_locked != bool(reason):
            self._is_locked = bool(reason)
            self._rebuild()

    def _rebuild(self) -> None:
        """Create the grids again, because their cells became editable or read-only."""
        for sheet in self._grids:
            self._panes[sheet].clear()
        self._grids.clear()
        self.select(self._sheet)

    def _rows(
        self, document: Document, sheet: str, problems: tuple[CellProblem, ...]
    ) -> list[dict[str, Any]]:
        """Return the rows of the grid of the table `sheet`, with the problems of its cells."""
        return rows(self._app.session.shown_tables, document.symbols, sheet, problems)

    def _show_message(self, problems: tuple[CellProblem, ...]) -> None:
        """Show the first error message and the number of further messages."""
        sentences = [problem.sentence for problem in problems] or [self._app.session.refusal]
        more = f" (and {len(sentences) - 1} more)" if len(sentences) > 1 else ""
        self._sentence.set_text(sentences[0] + more)
        self._sentence.set_visibility(bool(sentences[0]))

    def _tab(self, sheet: str, title: str) -> ui.element:
        """Create the button that shows the table `sheet`."""
        with ui.element("button").classes("app-tab") as tab:
            ui.label(title)
        tab.on("click", lambda: self.select(sheet))
        return tab

    def _grid(self, sheet: str) -> ui.aggrid:
        """Create the grid of a table."""
        document = self._app.document
        grid = ui.aggrid(
            {
                "columnDefs": columns(sheet, removable=not self._is_locked),
                "rowData": self._rows(document, sheet, document.problems),
                "defaultColDef": {
                    "editable": document.origin is None or sheet in ("symbols", "general"),
                    "cellDataType": "text",
                    "sortable": False,
                    "resizable": True,
                    "suppressMovable": True,
                    "suppressHeaderMenuButton": True,
                },
                ":getRowId": _ROW_ID,
                "singleClickEdit": True,
                "stopEditingWhenCellsLoseFocus": True,
                "enterNavigatesVerticallyAfterEdit": True,
                "tooltipShowDelay": 250,
                "suppressFieldDotNotation": True,
                "animateRows": False,
                "overlayNoRowsTemplate": f"<span class='app-note'>{_EMPTY.get(sheet, '')}</span>",
            },
            auto_size_columns=False,
        ).classes("app-grid")
        grid.on(
            "cellValueChanged",
            lambda event: self._type(sheet, event),
            args=["colId", "newValue", "rowIndex"],
        )
        grid.on("cellClicked", lambda e: self._clicked(sheet, e), args=["colId", "rowIndex"])
        return grid

    def _row_bar(self, sheet: str) -> None:
        """Create the button that adds a frame or loop."""
        if sheet not in ("geometry", "loops") or self._is_locked:
            return
        word = "frame" if sheet == "geometry" else "loop"
        with ui.element("div").classes("app-row-bar"):
            add = ui.button(f"Add a {word}", on_click=lambda: self._add(sheet))
            add.props("flat dense no-caps")
            ui.label(
                "numbers, symbols such as L2, or pi/2"
                if sheet == "geometry"
                else "frames k and k+B coincide when the loop is closed"
            ).classes("app-note")

    async def _type(self, sheet: str, event: events.GenericEventArguments) -> None:
        """Change the cell that the user has edited, with the text that the event contains."""
        text = event.args.get("newValue")
        cell = Cell(sheet, int(event.args["rowIndex"]), str(event.args["colId"]))
        await self._app.edit(cell, "" if text is None else str(text))

    async def _clicked(self, sheet: str, event: events.GenericEventArguments) -> None:
        """Remove a frame or loop if the user clicked its remove button."""
        if event.args.get("colId") != "remove":
            return
        document, row = self._app.document, int(event.args["rowIndex"])
        try:
            remove = document.without_frame if sheet == "geometry" else document.without_loop
            fewer = remove(row)
        except MbsError as error:
            self._app.complain(error)
            return
        await self._app.change(fewer)

    async def _add(self, sheet: str) -> None:
        """Add a frame or loop."""
        document = self._app.document
        try:
            more = document.with_frame() if sheet == "geometry" else document.with_loop()
        except MbsError as error:
            self._app.complain(error)
            return
        await self._app.change(more)
