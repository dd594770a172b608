"""State and operations of a page of the app, used by menus and panels."""

from __future__ import annotations

import asyncio
import json
import logging
from collections.abc import Callable, Coroutine, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager
from typing import Any

import numpy as np
from nicegui import background_tasks, ui
from nicegui.client import Client

import mbs.app.web.jobs as jobs
from mbs.app.web.document.document import Document
from mbs.app.web.document.tables import Cell
from mbs.app.web.drawer import Drawer
from mbs.app.web.jobs import JobCards
from mbs.app.web.session import Session, Vector, carried, handles, moved
from mbs.app.web.style import VIEW
from mbs.assembly import System
from mbs.errors import MbsError
from mbs.view import Scene, scene
from mbs.view.posed import picture_symbols

# Basis of every part of the app: session, page, graph thread, notifications and listeners.


_LOG = logging.getLogger(__name__)
_ASIDE = ThreadPoolExecutor(max_workers=1, thread_name_prefix="mbs-app")
"""Single thread that builds CasADi graphs, so that graphs are never built concurrently."""

Listener = Callable[[], Coroutine[Any, Any, None] | None]


async def aside(function: Callable[..., Any], *args: Any) -> Any:
    """Call a short function in the thread that builds CasADi graphs, and return its result.

    Args:
        function: function to call.
        *args: its arguments.
    """
    return await asyncio.get_running_loop().run_in_executor(_ASIDE, function, *args)


class AppBase:
    """Session of a visitor and the browser page that shows it.

    Attributes:
        session: the robot, its history and its configuration.
    """

    def __init__(self, session: Session) -> None:
        self.session = session
        self._client: Client = ui.context.client
        self._on_robot: list[Listener] = []
        self._on_configuration: list[Listener] = []
        self._on_document: list[Listener] = []
        self._on_clear: list[Listener] = []

    @property
    def document(self) -> Document:
        """Description of the robot as typed."""
        return self.session.document

    @property
    def q(self) -> Vector:
        """Present configuration (nq,) [rad or m]."""
        return self.session.q

    @property
    def is_left(self) -> bool:
        """Whether the page was closed and can no longer show anything."""
        return self._client.is_deleted

    def system(self) -> System:
        """Return the assembled robot as typed.

        Raises:
            MbsError: the description has an error. The message gives it.
        """
        return self.session.require_system()

    def checked_system(self) -> System | None:
        """Return the assembled robot; if its description has an error, show it and return None."""
        try:
            return self.system()
        except MbsError as error:
            self.complain(error)
            return None

    async def aside(self, function: Callable[..., Any], *args: Any) -> Any:
        """Call a short function in the thread that builds CasADi graphs, and return its result.

        Args:
            function: function to call.
            *args: its arguments.
        """
        return await aside(function, *args)

    def complain(self, error: Exception | str) -> None:
        """Show an error as a notification in the browser; do nothing if the page was closed.

        Args:
            error: error message, or exception. An exception that is not an MbsError is logged.
        """
        sentence = self._error_text(error)
        if self.is_left:
            return
        with self._client:
            ui.notify(
                sentence,
                type="negative",
                multi_line=True,
                timeout=9000,
                close_button="Close",
                position="bottom",
            )

    def tell(self, sentence: str) -> None:
        """Show a short message in the browser for a few seconds; do nothing if the page was closed.

        Args:
            sentence: message.
        """
        if self.is_left:
            return
        with self._client:
            ui.notify(sentence, position="bottom", timeout=3500)

    def download(self, data: bytes, name: str) -> None:
        """Send a file to the browser, which stores it; do nothing if the page was closed.

        Args:
            data: content of the file.
            name: file name.
        """
        if self.is_left:
            return
        with self._client:
            ui.download(data, name)

    @staticmethod
    def _error_text(error: Exception | str) -> str:
        """Return the message of an error; an exception that is not an MbsError is logged."""
        if isinstance(error, (str, MbsError)):
            return str(error)
        _LOG.error("the app could not go on", exc_info=error)
        return (
            f"this did not work ({type(error).__name__}); the log has the details, please report it"
        )

    def on_robot(self, listener: Listener) -> None:
        """Add a listener that is called after each successful assembly of a robot.

        Args:
            listener: function without arguments, or coroutine function.
        """
        self._on_robot.append(listener)

    def on_clear(self, listener: Listener) -> None:
        """Add a listener that is called when another robot is opened, before its assembly.

        Args:
            listener: function without arguments, or coroutine function.
        """
        self._on_clear.append(listener)

    def on_configuration(self, listener: Listener) -> None:
        """Add a listener that is called after each change of the configuration.

        Args:
            listener: function without arguments, or coroutine function.
        """
        self._on_configuration.append(listener)

    def on_document(self, listener: Listener) -> None:
        """Add a listener that is called after each edit of the robot, valid or not.

        Args:
            listener: function without arguments, or coroutine function.
        """
        self._on_document.append(listener)

    def on_time(self, listener: Callable[[float], Any]) -> None:
        """Add a listener that is called ten times per second while a movie plays.

        Args:
            listener: function of the time of the movie [s].
        """
        ui.on("app-time", lambda event: listener(float(event.args)))

    def _notify(self, listeners: Sequence[Listener]) -> None:
        """Call listeners, unless the page was closed; coroutines run in the background."""
        if self.is_left:
            return
        with self._client:
            for listener in listeners:
                answer = listener()
                if answer is not None:
                    background_tasks.create(answer)


# Configuration of the mechanism, and the picture that shows it in the browser.


class AppPicture(AppBase):
    """App with a picture of the mechanism, whose configuration the user can change."""

    def __init__(self, session: Session) -> None:
        super().__init__(session)
        self._scene: Scene | None = None
        self._robot = session.robot
        self._camera: str | None = "iso"
        self._wanted: dict[int, float] = {}
        self._is_moving = False

    @property
    def is_moving(self) -> bool:
        """Whether the user is moving a joint at present."""
        return self._is_moving

    def _draw(self, drawn: Scene) -> None:
        """Replace the present scene by another scene."""
        self._scene = drawn
        self._send("mount", VIEW, drawn.as_dict(), self._camera)
        self._camera = None

    def _clear(self) -> None:
        """Remove the picture and the joints of the previous robot."""
        self._robot, self._scene, self._camera = self.session.robot, None, "iso"
        self._wanted.clear()
        self._send("clear")
        self._notify(self._on_clear)

    async def set_configuration(self, q: Sequence[float]) -> None:
        """Show the mechanism in another configuration.

        Args:
            q: (nq,) positions that close the loops [rad or m].
        """
        system = self.session.system
        if system is None or len(q) != system.nq:
            self.complain(
                "the configuration is of a robot with other joints; make it anew for this one"
            )
            return
        self.session.q = tuple(float(x) for x in q)
        await self._pose(self.session.q)
        self._notify(self._on_configuration)

    async def move(self, index: int, value: float) -> None:
        """Move a coordinate to a position, with the loops closed.

        Of several moves of a coordinate that arrive during a computation, only the last is made.

        Args:
            index: index of the coordinate in q.
            value: target position [rad or m].
        """
        self._wanted[index] = value
        if self._is_moving:
            return
        self._is_moving = True
        try:
            while self._wanted:
                await self._move_once()
        finally:
            self._is_moving = False

    async def _move_once(self) -> None:
        """Make one pending move with closed loops; an error is stored as `session.refusal`."""
        index = next(iter(self._wanted))
        value = self._wanted.pop(index)
        system, q = self.session.system, self.session.q
        if system is None or not 0 <= index < len(q):
            return
        try:
            q = await self.aside(moved, system, q, index, value)
        except Exception as error:
            self.session.refusal = self._error_text(error)
            self._notify(self._on_configuration)
            return
        if self.session.system is system:
            if self._scene is not None:  # else the refusal explains why there is no picture
                self.session.refusal = ""
            await self.set_configuration(q)

    async def _pose(self, q: Vector) -> None:
        """Send the poses of the links at a configuration (nq,) to the browser."""
        drawn = self._scene
        if drawn is not None and len(q) == drawn.system.nq:
            flat = await self.aside(drawn.poses, q)
            self._send("poses", flat)

    async def play(self, times: Sequence[float], configurations: Any, speed: float = 1.0) -> None:
        """Play a motion repeatedly until `pause` is called.

        Args:
            times: (n,) times of the configurations [s].
            configurations: (n, nq) configurations [rad or m].
            speed: playback speed; 1 is real time.
        """
        drawn = self._scene
        film_of = np.asarray(configurations, dtype=float)
        if drawn is None or film_of.shape[1:] != (drawn.system.nq,):
            self.complain("the motion is of a robot with other joints; simulate this one")
            return
        poses = await self.aside(drawn.motion, film_of)
        film = {"times": [float(t) for t in times], "poses": poses.tolist(), "speed": speed}
        self._send("play", film)

    def pause(self) -> None:
        """Pause the movie at its present time."""
        self._send("pause")

    def look(self, camera: str) -> None:
        """Set the view direction of the picture.

        Args:
            camera: "iso", "front", "top", "side", or "fit" (whole mechanism in the present
                direction).
        """
        self._send("camera", camera)

    def show(self, role: str, shown: bool) -> None:
        """Show or hide a kind of elements of the picture.

        Args:
            role: kind of elements, such as "frame".
            shown: whether to show them.
        """
        self.session.shown[role] = shown
        self._send("visible", role, shown)

    def screenshot(self) -> None:
        """Download the picture as a PNG file."""
        self._send("screenshot", f"{self.document.name}.png")

    def _send(self, method: str, *args: Any) -> None:
        """Call a method of the picture in the browser with arguments that JSON can express."""
        if self.is_left:
            return
        values = ", ".join(json.dumps(value) for value in args)
        self._client.run_javascript(f"appView.{method}({values})")


class App(AppPicture):
    """Page of the app: the session of its visitor and all operations on it.

    Attributes:
        drawer: tabs of results.
    """

    def __init__(self, session: Session) -> None:
        super().__init__(session)
        self.drawer = Drawer()
        self._cards = JobCards()
        self._edit = 0
        self._works: set[asyncio.Future[Any]] = set()
        self._client.on_delete(self._stop_works)

    def build_cards(self) -> None:
        """Create the corner of the page that shows running jobs."""
        self._cards.build()

    async def start(self) -> None:
        """Assemble the document of the session and show it in the configuration of the session."""
        await self._assemble_and_draw()

    async def edit(self, cell: Cell, text: str) -> None:
        """Change the text of a cell, then assemble and draw the robot.

        An error is shown if the cell cannot be changed.

        Args:
            cell: position of the cell.
            text: new text.
        """
        try:
            document = self.document.changed(cell, text)
        except MbsError as error:
            self.complain(error)
            return
        await self.change(document)

    async def change(self, document: Document) -> None:
        """Replace the present document, then assemble and draw the new one.

        Args:
            document: another description of the same robot.
        """
        self.session.change(document)
        await self._assemble_and_draw()

    async def open_robot(self, make: Callable[..., Document], *args: Any) -> bool:
        """Open the robot that `make(*args)` describes, without any state of the present robot.

        An error of `make` is shown.

        Args:
            make: function that returns a document.
            *args: its arguments.

        Returns:
            Whether `make` returned a document; if not, the present robot remains.
        """
        document = await self._made(make, *args)
        if document is None:
            return False
        self.session.open(document)
        await self._assemble_and_draw()
        return True

    async def show_other_description(self, make: Callable[..., Document]) -> bool:
        """Show another description of the same robot, in the present configuration.

        An error of `make` is shown.

        Args:
            make: function that returns a document.

        Returns:
            Whether `make` returned a document; if not, the present description remains.
        """
        document = await self._made(make)
        if document is None:
            return False
        await self.change(document)
        return True

    async def _made(self, make: Callable[..., Document], *args: Any) -> Document | None:
        """Return the document that `make(*args)` returns.

        Show its error and return None if it fails.
        """
        try:
            document: Document = await self.aside(make, *args)
        except Exception as error:
            self.complain(error)
            return None
        return document

    async def undo(self) -> None:
        """Undo the last change."""
        if self.session.undo():
            await self._assemble_and_draw()

    async def redo(self) -> None:
        """Redo the last change that was undone."""
        if self.session.redo():
            await self._assemble_and_draw()

    async def _assemble_and_draw(self) -> None:
        """Assemble and draw the present document; a later edit cancels this."""
        self._edit += 1
        edit, document, session = self._edit, self.document, self.session
        if session.robot != self._robot:
            self._clear()

        def assembled() -> tuple[Vector, Scene | None, str] | None:
            if edit != self._edit or document.problems:
                return None
            system = document.system()
            document.shown()
            q = carried(session.system, session.q, system)
            return (q, *_drawn(system, q))

        try:
            answer = await self.aside(assembled)
        except Exception as error:
            if edit == self._edit:
                session.refusal = self._error_text(error)
                self._notify(self._on_document)
            return
        if edit != self._edit:
            return
        if answer is not None:
            self._show(document, *answer)
        self._notify(self._on_document)

    def _show(self, document: Document, q: Vector, drawn: Scene | None, why: str) -> None:
        """Show an assembled document in the configuration q.

        `drawn` is its picture, or None for the reason `why`.
        """
        self.session.settle(document, q)
        self.session.refusal = why
        if drawn is not None:
            self._draw(drawn)
        self._notify(self._on_robot)
        self._notify(self._on_configuration)

    async def run(self, label: str, task: Callable[..., Any], *args: Any) -> Any:
        """Run `task(system, *args)` in a child process, while a card shows its progress.

        The card has a button that stops the task. Errors are shown as a notification.

        Args:
            label: description of the task for the user.
            task: function of a module; its arguments and its result are plain data.
            *args: further arguments.

        Returns:
            Result of the task; None if it was stopped or failed.
        """
        try:
            self.system()
        except MbsError as error:
            self.complain(error)
            return None
        with self._cards.card(label) as card:
            work = asyncio.ensure_future(
                jobs.run(task, self.document, *args, progress=card.progress)
            )
            card.on_cancel(work.cancel)
            self._works.add(work)
            work.add_done_callback(self._works.discard)
            try:
                return await work
            except asyncio.CancelledError:
                if not work.cancelled():
                    raise
                self.tell(f"{label}: stopped")
            except Exception as error:
                self.complain(error)
        return None

    def _stop_works(self) -> None:
        """Stop all running tasks of a page that was closed."""
        for work in tuple(self._works):
            work.cancel()

    def open(self, title: str, key: str | None = None) -> AbstractContextManager[Any]:
        """Open a tab of results, which the block fills; it replaces a tab with the same key.

        Args:
            title: title of the tab.
            key: key of the tab; by default a new tab.
        """
        return self.drawer.open(title, key)


async def warm_up() -> None:
    """Load all modules and fill caches, so that the first visitor does not have to wait."""

    def once() -> None:
        system = Document.of_name("rx90").system()
        _drawn(system, system.configuration)
        loop = Document.of_name("four_bar").system()
        # [rad] any small step along the branch
        moved(loop, loop.configuration, handles(loop)[0].index, loop.configuration[0] + 0.01)

    await aside(once)


def _drawn(system: System, q: Vector) -> tuple[Scene | None, str]:
    """Return the scene of a system at q and ""; None and the reason if it cannot be drawn."""
    needed = picture_symbols(system)
    values = zip(system.parameters, system.parameter_values(needed=()), strict=True)
    unknown = [symbol.name for symbol, value in values if value != value and symbol.name in needed]
    if unknown:
        return None, (
            f"The picture needs values of {', '.join(unknown)}; write them in the table Symbols"
        )
    try:
        drawn = scene(system, q)
        drawn.poses(q)
        handles(system)
    except MbsError as error:
        return None, str(error)
    return drawn, ""
