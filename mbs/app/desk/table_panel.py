"""The robot as tables: a grid of texts for each sheet, wrong cells red with their sentence."""

from __future__ import annotations

from typing import Any

from nicegui import events, ui

from mbs.app.desk.desk import Desk
from mbs.app.desk.document.cells import Cell, CellProblem
from mbs.app.desk.document.document import Document
from mbs.app.desk.table_columns import SHEETS, columns, rows
from mbs.errors import MbsError

_EMPTY = {
    "symbols": "No symbols yet: write one, such as L2, in any cell of geometry or inertia.",
    "loops": "No loops: this robot is an open chain.",
}
_ROW_ID = "(p) => String(p.data.id)"


class TablePanel:
    """The left half of the desk."""

    def __init__(self, desk: Desk) -> None:
        self._desk = desk
        self._sheet = str(desk.session.notes.get("sheet", "geometry"))
        self._is_locked = desk.document.origin is not None
        self._tabs: dict[str, ui.element] = {}
        self._grids: dict[str, ui.aggrid] = {}
        self._panes: dict[str, ui.element] = {}
        with ui.element("div").classes("desk-left"):
            with ui.element("div").classes("desk-tabs"):
                for sheet, title in SHEETS.items():
                    self._tabs[sheet] = self._tab(sheet, title)
            with ui.element("div").classes("desk-locked") as self._locked:
                self._reason = ui.label()
                ui.label(
                    "The tables show the links that it was assembled into; only values of symbols"
                    " can be changed. Robot ▸ Make it a table of frames lets you change all."
                )
            for sheet in SHEETS:
                self._panes[sheet] = ui.element("div").classes("desk-sheet")
            self._sentence = ui.label().classes("desk-sentence desk-bad")
        desk.on_document(self.refresh)
        self.select(self._sheet)
        self.refresh()

    def select(self, sheet: str) -> None:
        """Show a sheet; its grid is made the first time."""
        self._sheet = sheet
        self._desk.session.notes["sheet"] = sheet
        for name, tab in self._tabs.items():
            tab.classes(add="desk-tab-on") if name == sheet else tab.classes(remove="desk-tab-on")
            self._panes[name].set_visibility(name == sheet)
        if sheet not in self._grids:
            with self._panes[sheet]:
                self._grids[sheet] = self._grid(sheet)
                self._row_bar(sheet)

    def refresh(self) -> None:
        """Show the document as it is, and what is wrong in it."""
        document = self._desk.document
        problems = document.problems
        for sheet, grid in self._grids.items():
            fresh = self._rows(document, sheet, problems)
            if fresh != grid.options["rowData"]:
                dict.__setitem__(grid.options, "rowData", fresh)
                grid.run_grid_method("setGridOption", "rowData", fresh)
        wrong = {problem.sheet for problem in problems}
        for sheet, tab in self._tabs.items():
            tab.classes(add="desk-tab-bad") if sheet in wrong else tab.classes(
                remove="desk-tab-bad"
            )
        self._say(problems)
        reason = "" if document.origin is None else document.origin.reason
        self._reason.set_text(reason)
        self._locked.set_visibility(bool(reason))
        if self._is_locked != bool(reason):
            self._is_locked = bool(reason)
            self._rebuild()

    def _rebuild(self) -> None:
        """Make the grids anew, for cells that can or cannot be changed."""
        for sheet in self._grids:
            self._panes[sheet].clear()
        self._grids.clear()
        self.select(self._sheet)

    def _rows(
        self, document: Document, sheet: str, problems: tuple[CellProblem, ...]
    ) -> list[dict[str, Any]]:
        return rows(self._desk.session.shown_tables, document.symbols, sheet, problems)

    def _say(self, problems: tuple[CellProblem, ...]) -> None:
        sentences = [problem.sentence for problem in problems] or [self._desk.session.refusal]
        more = f" (and {len(sentences) - 1} more)" if len(sentences) > 1 else ""
        self._sentence.set_text(sentences[0] + more)
        self._sentence.set_visibility(bool(sentences[0]))

    def _tab(self, sheet: str, title: str) -> ui.element:
        with ui.element("button").classes("desk-tab") as tab:
            ui.label(title)
        tab.on("click", lambda: self.select(sheet))
        return tab

    def _grid(self, sheet: str) -> ui.aggrid:
        document = self._desk.document
        grid = ui.aggrid(
            {
                "columnDefs": columns(sheet, removable=not self._is_locked),
                "rowData": self._rows(document, sheet, document.problems),
                "defaultColDef": {
                    "editable": document.origin is None or sheet == "symbols",
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
                "overlayNoRowsTemplate": f"<span class='desk-note'>{_EMPTY.get(sheet, '')}</span>",
            },
            auto_size_columns=False,
        ).classes("desk-grid")
        grid.on(
            "cellValueChanged",
            lambda event: self._typed(sheet, event),
            args=["colId", "newValue", "rowIndex"],
        )
        grid.on("cellClicked", lambda e: self._clicked(sheet, e), args=["colId", "rowIndex"])
        return grid

    def _row_bar(self, sheet: str) -> None:
        if sheet not in ("geometry", "loops") or self._is_locked:
            return
        word = "frame" if sheet == "geometry" else "loop"
        with ui.element("div").classes("desk-row-bar"):
            add = ui.button(f"Add a {word}", on_click=lambda: self._add(sheet))
            add.props("flat dense no-caps")
            ui.label(
                "numbers, symbols such as L2, or pi/2"
                if sheet == "geometry"
                else "frames k and k+B coincide when the loop is closed"
            ).classes("desk-note")

    async def _typed(self, sheet: str, event: events.GenericEventArguments) -> None:
        text = event.args.get("newValue")
        cell = Cell(sheet, int(event.args["rowIndex"]), str(event.args["colId"]))
        await self._desk.edit(cell, "" if text is None else str(text))

    async def _clicked(self, sheet: str, event: events.GenericEventArguments) -> None:
        if event.args.get("colId") != "remove":
            return
        document, row = self._desk.document, int(event.args["rowIndex"])
        try:
            remove = document.without_frame if sheet == "geometry" else document.without_loop
            fewer = remove(row)
        except MbsError as error:
            self._desk.complain(error)
            return
        await self._desk.change(fewer)

    async def _add(self, sheet: str) -> None:
        document = self._desk.document
        try:
            more = document.with_frame() if sheet == "geometry" else document.with_loop()
        except MbsError as error:
            self._desk.complain(error)
            return
        await self._desk.change(more)
