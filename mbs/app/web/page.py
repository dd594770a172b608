"""The page: menus at the top, tables at the left, the picture at the right, results below."""

from __future__ import annotations

from collections.abc import Awaitable, Callable

from nicegui import app as server
from nicegui import events, ui

from mbs.app.web.app import App
from mbs.app.web.document.document import Document
from mbs.app.web.menus import FilesMenu, build_menus
from mbs.app.web.open_again import open_again
from mbs.app.web.picture_panel import PicturePanel
from mbs.app.web.session import Session
from mbs.app.web.style import add_head
from mbs.app.web.tables import TablePanel

_KEY = "app"
_DRAWER = 58.0
"""Height of the upper half in percent while results are shown."""


def page_of(first: Document) -> Callable[[], Awaitable[None]]:
    """Return the function that builds the page of the app for each visitor.

    Args:
        first: robot with which new visitors start.
    """

    async def app_page() -> None:
        add_head()
        ui.colors(primary="#2559c4", negative="#c0352b")
        with ui.element("div").classes("app") as frame:
            ui.label("The app is starting…").classes("app-note").style("padding: 14px")
        await ui.context.client.connected(timeout=30)
        session = session_of(first)
        frame.clear()
        with frame:
            app = App(session)
            _build(app)
        await app.start()
        await open_again(app)

    return app_page


async def app_page() -> None:
    """Build the page of the app with the robot RX90."""
    await page_of(Document.of_name("rx90"))()


def session_of(first: Document) -> Session:
    """Return the session of this browser tab; a duplicated tab gets its own copy.

    Args:
        first: robot with which a new session starts.
    """
    tab = ui.context.client.tab_id
    kept = server.storage.tab.get(_KEY)
    if kept is None:
        session = Session(first)
    else:
        owner, session = kept
        if owner != tab:
            session = session.doubled()
    server.storage.tab[_KEY] = (tab, session)
    return session


def _build(app: App) -> None:
    """Create menus, tables, picture and drawer of the page."""
    with ui.element("div").classes("app-bar"):
        ui.label("mbs").classes("app-brand")
        with ui.element("div").classes("app-menus"):
            FilesMenu(app)
            build_menus(app)
        ui.element("div").classes("app-space")
        _Head(app)
    with (
        ui.element("div").classes("app-work"),
        ui.splitter(horizontal=True, value=100, limits=(20, 100)) as rows,
    ):
        with rows.before, ui.splitter(value=50, limits=(15, 85)) as columns:
            with columns.before:
                TablePanel(app)
            with columns.after:
                PicturePanel(app)
        with rows.after:
            app.drawer.build(lambda filled: _make_room(rows, filled))
    app.build_cards()
    _keys(app)


class _Head:
    """Name and size of the robot, with buttons for undo and redo, at the right of the menus."""

    def __init__(self, app: App) -> None:
        self._app = app
        self._facts = ui.label().classes("app-facts")
        self._name = ui.label().classes("app-robot")
        self._undo = _small("↶", "Undo (Ctrl+Z)", app.undo)
        self._redo = _small("↷", "Redo (Ctrl+Shift+Z)", app.redo)
        app.on_document(self.refresh)
        self.refresh()

    def refresh(self) -> None:
        """Show the name and size of the present robot."""
        session = self._app.session
        self._name.set_text(session.document.name)
        self._facts.set_text(_facts(session))
        self._undo.set_enabled(bool(session.past))
        self._redo.set_enabled(bool(session.future))


def _facts(session: Session) -> str:
    """Return the numbers of links, coordinates and loops of the robot as text."""
    if session.system is None:
        return ""
    system = session.system
    loops = len(system.loops)
    kind = "open" if not system.is_closed else f"{loops} loop{'' if loops == 1 else 's'}"
    return f"{len(system.links)} links · {system.nq} coordinates · {kind}"


def _small(text: str, words: str, act: Callable[[], Awaitable[None]]) -> ui.button:
    """Create a small button with a tooltip `words`."""
    button = ui.button(text, on_click=act).props("flat dense no-caps")
    button.tooltip(words)
    return button


def _make_room(rows: ui.splitter, filled: bool) -> None:
    """Show the lower half of the page if there are results (`filled`), else hide it.

    `rows` is the splitter between the halves.
    """
    if filled and rows.value > 99:
        rows.set_value(_DRAWER)
    elif not filled:
        rows.set_value(100)


def _keys(app: App) -> None:
    """Handle the keyboard shortcuts of undo and redo."""

    async def pressed(event: events.KeyEventArguments) -> None:
        if not (event.action.keydown and (event.modifiers.ctrl or event.modifiers.meta)):
            return
        key = str(event.key).lower()
        if key == "z":
            await (app.redo() if event.modifiers.shift else app.undo())
        elif key == "y":
            await app.redo()

    ui.keyboard(on_key=pressed)
