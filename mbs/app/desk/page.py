"""The page: menus above, tables left, the picture right, results below."""

from __future__ import annotations

from collections.abc import Awaitable, Callable

from nicegui import app, events, ui

from mbs.app.desk.desk import Desk
from mbs.app.desk.document.document import Document
from mbs.app.desk.menus import FilesMenu, build_menus
from mbs.app.desk.open_again import open_again
from mbs.app.desk.picture_panel import PicturePanel
from mbs.app.desk.session import Session
from mbs.app.desk.style import add_head
from mbs.app.desk.tables import TablePanel

_KEY = "desk"
_DRAWER = 58.0
"""Height of the upper half when results are shown, %."""


def page_of(first: Document) -> Callable[[], Awaitable[None]]:
    """The page function for a robot that new visitors find."""

    async def desk_page() -> None:
        add_head()
        ui.colors(primary="#2559c4", negative="#c0352b")
        with ui.element("div").classes("desk") as frame:
            ui.label("The desk is being laid…").classes("desk-note").style("padding: 14px")
        await ui.context.client.connected(timeout=30)
        session = session_of(first)
        frame.clear()
        with frame:
            desk = Desk(session)
            _build(desk)
        await desk.start()
        await open_again(desk)

    return desk_page


async def desk_page() -> None:
    """The page with the RX90."""
    await page_of(Document.of_name("rx90"))()


def session_of(first: Document) -> Session:
    """The session of this browser tab; a duplicated tab gets a copy of its own."""
    tab = ui.context.client.tab_id
    kept = app.storage.tab.get(_KEY)
    if kept is None:
        session = Session(first)
    else:
        owner, session = kept
        if owner != tab:
            session = session.doubled()
    app.storage.tab[_KEY] = (tab, session)
    return session


def _build(desk: Desk) -> None:
    with ui.element("div").classes("desk-bar"):
        ui.label("mbs").classes("desk-brand")
        with ui.element("div").classes("desk-menus"):
            FilesMenu(desk)
            build_menus(desk)
        ui.element("div").classes("desk-space")
        _Head(desk)
    with (
        ui.element("div").classes("desk-work"),
        ui.splitter(horizontal=True, value=100, limits=(20, 100)) as rows,
    ):
        with rows.before, ui.splitter(value=50, limits=(15, 85)) as columns:
            with columns.before:
                TablePanel(desk)
            with columns.after:
                PicturePanel(desk)
        with rows.after:
            desk.drawer.build(lambda filled: _make_room(rows, filled))
    desk.build_cards()
    _keys(desk)


class _Head:
    """The robot's name, what it is, and undo, at the right of the menus."""

    def __init__(self, desk: Desk) -> None:
        self._desk = desk
        self._facts = ui.label().classes("desk-facts")
        self._name = ui.label().classes("desk-robot")
        self._undo = _small("↶", "Undo (Ctrl+Z)", desk.undo)
        self._redo = _small("↷", "Redo (Ctrl+Shift+Z)", desk.redo)
        desk.on_document(self.refresh)
        self.refresh()

    def refresh(self) -> None:
        """Say what is on the desk."""
        session = self._desk.session
        self._name.set_text(session.document.name)
        self._facts.set_text(_facts(session))
        self._undo.set_enabled(bool(session.past))
        self._redo.set_enabled(bool(session.future))


def _facts(session: Session) -> str:
    if session.system is None:
        return ""
    system = session.system
    loops = len(system.loops)
    kind = "open" if not system.is_closed else f"{loops} loop{'' if loops == 1 else 's'}"
    return f"{len(system.links)} links · {system.nq} coordinates · {kind}"


def _small(text: str, words: str, act: Callable[[], Awaitable[None]]) -> ui.button:
    button = ui.button(text, on_click=act).props("flat dense no-caps")
    button.tooltip(words)
    return button


def _make_room(rows: ui.splitter, filled: bool) -> None:
    if filled and rows.value > 99:
        rows.set_value(_DRAWER)
    elif not filled:
        rows.set_value(100)


def _keys(desk: Desk) -> None:
    async def pressed(event: events.KeyEventArguments) -> None:
        if not (event.action.keydown and (event.modifiers.ctrl or event.modifiers.meta)):
            return
        key = str(event.key).lower()
        if key == "z":
            await (desk.redo() if event.modifiers.shift else desk.undo())
        elif key == "y":
            await desk.redo()

    ui.keyboard(on_key=pressed)
