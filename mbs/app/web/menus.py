"""Menus: models from the catalogue, optimizer, simulation, export and robot files."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from functools import partial
from pathlib import PurePath
from typing import Any

from nicegui import events, ui

from mbs.app.tasks.equations import MENUS, entries
from mbs.app.web.app import App
from mbs.app.web.document.document import Document
from mbs.app.web.document.reading import LARGEST_UPLOAD, READERS
from mbs.app.web.panels import base as base_panel
from mbs.app.web.panels import singular as singular_panel
from mbs.app.web.panels.configurations import open_configurations
from mbs.app.web.panels.equations import open_equations
from mbs.app.web.panels.export import open_export
from mbs.app.web.panels.identification import open_identification
from mbs.app.web.panels.optimizer import open_optimizer, optimizer_switch
from mbs.app.web.panels.simulation import open_simulation
from mbs.errors import MbsError
from mbs.models.catalogue import Entry
from mbs.robots import catalogue

Act = Callable[[], Awaitable[None] | None]


def build_menus(app: App) -> None:
    """Create the menus at the present position; models that the robot lacks are greyed out.

    Args:
        app: app of the page.
    """
    items = dict[str, _Item]()
    for menu in MENUS:
        with _menu(menu):
            for one in entries():
                if one.menu == menu:
                    items[one.key] = _Item(one, _act(app, one))
            if menu == "Identification":
                ui.separator()
                _plain("From a record…", partial(open_identification, app))
    with _menu("Optimizer"):
        _plain("Passes and counts…", partial(open_optimizer, app)).mark("passes")
        ui.separator()
        switch = optimizer_switch(app.session, "Optimize the equations")
        switch.style("padding: 4px 14px").mark("switch")
    with _menu("Simulate"):
        _plain("Motion…", partial(open_simulation, app))
    with _menu("Export"):
        _plain("Files…", partial(open_export, app))

    def refresh() -> None:
        system = app.session.system
        for item in items.values():
            item.refuse("" if system is None else item.entry.refusal(system))

    app.on_robot(refresh)
    refresh()


class _Item:
    """Menu entry of a model. If the robot does not have the model, it is greyed with a reason."""

    def __init__(self, entry: Entry, act: Act) -> None:
        self.entry = entry
        self._item = _plain(entry.title, act).mark(f"menu {entry.key}")
        with self._item:
            self._why = ui.tooltip("")
        self._why.set_visibility(False)

    def refuse(self, reason: str) -> None:
        """Disable the entry and show the reason; enable it if the reason is empty.

        Args:
            reason: reason why the robot does not have the model.
        """
        self._item.set_enabled(not reason)
        self._why.set_text(reason)
        self._why.set_visibility(bool(reason))


def _act(app: App, one: Entry) -> Act:
    """Return the function that opens the panel of a model."""
    if one.solver is not None:
        return partial(open_configurations, app, one.key)
    if one.key == singular_panel.KEY:
        return partial(singular_panel.open_singular, app)
    if one.key == base_panel.KEY:
        return partial(base_panel.open_base, app)
    return partial(open_equations, app, one.key)


def _menu(title: str) -> Any:
    """Create the button of a menu, and return its menu."""
    with ui.button(title).props("flat no-caps dense").classes("app-menu"):
        return ui.menu()


def _plain(title: str, act: Act) -> ui.menu_item:
    """Create a menu entry with a title and an action."""
    return ui.menu_item(title, on_click=act)


# Menu Robot: new, open, save, undo.


_SUFFIXES = ",".join(READERS)


class FilesMenu:
    """Menu Robot with the dialogs that open and save robots."""

    def __init__(self, app: App) -> None:
        self._app = app
        with ui.button("Robot").props("flat no-caps dense").classes("app-menu"), ui.menu():
            self._item("catalogue", "From the catalogue…", self.choose)
            self._item("open", "Open a file…", self.upload)
            self._item("new", "New, one joint", self._blank)
            ui.separator()
            self._item("toml", "Save as TOML", lambda: self._save("toml"))
            self._item("par", "Save as SYMORO .par", lambda: self._save("par"))
            self._convert = self._item("table", "Make it a table of frames", self._to_table)
            ui.separator()
            self._undo = self._item("undo", "Undo", app.undo, "Ctrl+Z")
            self._redo = self._item("redo", "Redo", app.redo, "Ctrl+Shift+Z")
            ui.separator()
            self._item("report", "What was assembled", self._report)
        app.on_document(self.refresh)
        self.refresh()

    def refresh(self) -> None:
        """Disable the entries that are not available at present."""
        session = self._app.session
        self._undo.set_enabled(bool(session.past))
        self._redo.set_enabled(bool(session.future))
        self._convert.set_visibility(not session.document.is_table)

    def choose(self) -> None:
        """Open a dialog that lists the robots of the catalogue to choose from."""
        with ui.dialog() as dialog, ui.card().style("width: 640px; max-width: 92vw"):
            ui.label("From the catalogue").classes("app-robot")
            field = ui.input(placeholder="Search").props("dense outlined autofocus clearable")
            field.style("width: 100%")
            rows: dict[str, ui.element] = {}
            with ui.element("div").classes("app-list"):
                for name, make in catalogue().items():
                    rows[name] = self._row(dialog, name, _first_line(make))

        def narrow() -> None:
            text = str(field.value or "").lower()
            for name, row in rows.items():
                row.set_visibility(text in f"{name} {_first_line(catalogue()[name])}".lower())

        field.on_value_change(narrow)
        dialog.on("hide", dialog.delete)
        dialog.open()

    def upload(self) -> None:
        """Open a dialog for uploading a robot file."""
        with ui.dialog() as dialog, ui.card().style("width: 460px"):
            ui.label("Open a robot file").classes("app-robot")
            ui.label(
                ".toml, SYMORO .par, .urdf, .sdf, .world, or MJCF .xml; at most"
                f" {LARGEST_UPLOAD // 1_000_000} MB. Meshes are not needed."
            ).classes("app-note")

            async def take(event: events.UploadEventArguments) -> None:
                dialog.close()
                await self.open_upload(event.file.name, await event.file.read())

            ui.upload(
                label="Drop a file here, or press +",
                auto_upload=True,
                max_files=1,
                max_file_size=LARGEST_UPLOAD,
                on_upload=take,
                on_rejected=lambda: self._app.complain(
                    f"the file is of another kind than {_SUFFIXES}, or larger than"
                    f" {LARGEST_UPLOAD} bytes; choose another one"
                ),
            ).props(f'accept="{_SUFFIXES}" flat bordered').style("width: 100%")
        dialog.on("hide", dialog.delete)
        dialog.open()

    async def open_upload(self, name: str, content: bytes) -> None:
        """Open the robot in an uploaded file; an error is shown.

        Args:
            name: file name, of which only the suffix is used.
            content: content of the file.
        """
        suffix = PurePath(name.replace("\\", "/")).suffix
        if await self._app.open_robot(Document.of_upload, content, suffix):
            self._app.tell(f"{self._app.document.name} is open")

    def _row(self, dialog: ui.dialog, name: str, words: str) -> ui.element:
        """Create the row of a robot in the list of the catalogue; `words` describes the robot."""

        async def take() -> None:
            dialog.close()
            await self._app.open_robot(Document.of_name, name)

        with ui.element("div").classes("app-list-row").mark(f"catalogue-{name}") as row:
            ui.label(name).classes("app-list-name")
            ui.label(words).classes("app-note")
        row.on("click", take)
        return row

    def _item(self, key: str, title: str, act: Any, keys: str = "") -> ui.menu_item:
        """Create a menu entry with a title and an action `act`, marked by `key` for tests.

        `keys` is the text of its keyboard shortcut.
        """
        with ui.menu_item(on_click=act).mark(f"robot-{key}") as item:
            ui.label(title)
            if keys:
                ui.element("div").classes("app-space")
                ui.label(keys).classes("app-note").style("padding-left: 26px")
        return item

    async def _blank(self) -> None:
        """Open a new robot with a single joint."""
        await self._app.open_robot(Document.blank)

    async def _to_table(self) -> None:
        """Convert the robot to a table of frames, whose cells can be changed."""
        if await self._app.show_other_description(self._app.document.as_table):
            self._app.tell("Its links are rows of a table now, and can be changed")

    async def _save(self, kind: str) -> None:
        """Download the robot as a "toml" or "par" file."""
        document = self._app.document
        try:
            text = await self._app.aside(_text, document, kind)
        except MbsError as error:
            self._app.complain(error)
            return
        self._app.download(text.encode(), f"{document.file_name}.{kind}")

    async def _report(self) -> None:
        """Open a tab with the report of the assembly."""
        try:
            system = self._app.system()
        except MbsError as error:
            self._app.complain(error)
            return
        text = await self._app.aside(system.report)
        with self._app.open(f"{system.name}: assembled", "report"):
            ui.label(text).classes("app-code")


def _text(document: Document, kind: str) -> str:
    """Return a robot as the text of a "toml" or "par" file."""
    table = document.as_table()
    return table.toml() if kind == "toml" else table.par()


def _first_line(make: Any) -> str:
    """Return the first line of the docstring of a catalogue function."""
    return (make.__doc__ or "").strip().partition("\n")[0]
