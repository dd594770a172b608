"""The app: what menus and panels get to work with."""

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

# What every part of the app needs: the session, the page, one thread, and words to say.


_LOG = logging.getLogger(__name__)
_ASIDE = ThreadPoolExecutor(max_workers=1, thread_name_prefix="mbs-app")
"""The one thread that builds graphs: they are not made for several at once."""

Listener = Callable[[], Coroutine[Any, Any, None] | None]


async def aside(function: Callable[..., Any], *args: Any) -> Any:
    """What a short function returns, called in the one thread that builds graphs."""
    return await asyncio.get_running_loop().run_in_executor(_ASIDE, function, *args)


class AppBase:
    """The session of a visitor and the page that shows it.

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
        """The robot as typed."""
        return self.session.document

    @property
    def q(self) -> Vector:
        """(nq,) present configuration [rad or m]."""
        return self.session.q

    @property
    def is_left(self) -> bool:
        """Whether the page was closed for good; nothing can be shown on it any more."""
        return self._client.is_deleted

    def system(self) -> System:
        """The robot as typed, assembled already.

        Raises:
            MbsError: something is wrong in it; the sentence says what.
        """
        return self.session.require_system()

    def checked_system(self) -> System | None:
        """The robot as typed; None where something is wrong in it, which is told."""
        try:
            return self.system()
        except MbsError as error:
            self.complain(error)
            return None

    async def aside(self, function: Callable[..., Any], *args: Any) -> Any:
        """What a short function returns, called in the one thread that builds graphs."""
        return await aside(function, *args)

    def complain(self, error: Exception | str) -> None:
        """Show why something was refused."""
        sentence = self._sentence(error)
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
        """Show a short message."""
        if self.is_left:
            return
        with self._client:
            ui.notify(sentence, position="bottom", timeout=3500)

    def download(self, data: bytes, name: str) -> None:
        """Send a file to the browser."""
        if self.is_left:
            return
        with self._client:
            ui.download(data, name)

    @staticmethod
    def _sentence(error: Exception | str) -> str:
        if isinstance(error, (str, MbsError)):
            return str(error)
        _LOG.error("the app could not go on", exc_info=error)
        return (
            f"this did not work ({type(error).__name__}); the log has the details, please report it"
        )

    def on_robot(self, listener: Listener) -> None:
        """Call a function after each robot that could be assembled."""
        self._on_robot.append(listener)

    def on_clear(self, listener: Listener) -> None:
        """Call a function when another robot is opened, before it is assembled."""
        self._on_clear.append(listener)

    def on_configuration(self, listener: Listener) -> None:
        """Call a function after each change of the configuration."""
        self._on_configuration.append(listener)

    def on_document(self, listener: Listener) -> None:
        """Call a function after each edit, good or not."""
        self._on_document.append(listener)

    def on_time(self, listener: Callable[[float], Any]) -> None:
        """Call a function with the time of the film that is shown, ten times a second."""
        ui.on("app-time", lambda event: listener(float(event.args)))

    def _tell(self, listeners: Sequence[Listener]) -> None:
        if self.is_left:
            return
        with self._client:
            for listener in listeners:
                answer = listener()
                if answer is not None:
                    background_tasks.create(answer)


# The configuration of the mechanism, and the picture that shows it in the browser.


class AppPicture(AppBase):
    """A app whose picture can be moved."""

    def __init__(self, session: Session) -> None:
        super().__init__(session)
        self._scene: Scene | None = None
        self._robot = session.robot
        self._camera: str | None = "iso"
        self._wanted: dict[int, float] = {}
        self._is_moving = False

    @property
    def is_moving(self) -> bool:
        """Whether somebody moves a joint at this moment."""
        return self._is_moving

    def _draw(self, drawn: Scene) -> None:
        """Put another scene in the place of the present one."""
        self._scene = drawn
        self._send("mount", VIEW, drawn.as_dict(), self._camera)
        self._camera = None

    def _clear(self) -> None:
        """Take the picture and the joints of the former robot away."""
        self._robot, self._scene, self._camera = self.session.robot, None, "iso"
        self._wanted.clear()
        self._send("clear")
        self._tell(self._on_clear)

    async def set_configuration(self, q: Sequence[float]) -> None:
        """Show the mechanism at another configuration.

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
        self._tell(self._on_configuration)

    async def move(self, index: int, value: float) -> None:
        """Move one coordinate by hand; of many moves of it in a row the last one counts.

        Args:
            index: of the coordinate in q.
            value: where it is to be [rad or m].
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
        index = next(iter(self._wanted))
        value = self._wanted.pop(index)
        system, q = self.session.system, self.session.q
        if system is None or not 0 <= index < len(q):
            return
        try:
            q = await self.aside(moved, system, q, index, value)
        except Exception as error:
            self.session.refusal = self._sentence(error)
            self._tell(self._on_configuration)
            return
        if self.session.system is system:
            if self._scene is not None:  # else it says why there is no picture
                self.session.refusal = ""
            await self.set_configuration(q)

    async def _pose(self, q: Vector) -> None:
        drawn = self._scene
        if drawn is not None and len(q) == drawn.system.nq:
            flat = await self.aside(drawn.poses, q)
            self._send("poses", flat)

    async def play(self, times: Sequence[float], configurations: Any, speed: float = 1.0) -> None:
        """Show a motion again and again until `pause`.

        Args:
            times: (n,) [s].
            configurations: (n, nq) [rad or m].
            speed: of the film; 1 is as in reality.
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
        """Stop the film where it is."""
        self._send("pause")

    def look(self, camera: str) -> None:
        """Look from "iso", "front", "top", "side", or "fit"."""
        self._send("camera", camera)

    def show(self, role: str, shown: bool) -> None:
        """Show a role of the picture, such as "frame", or hide it."""
        self.session.shown[role] = shown
        self._send("visible", role, shown)

    def screenshot(self) -> None:
        """Download the picture as a PNG file."""
        self._send("screenshot", f"{self.document.name}.png")

    def _send(self, method: str, *args: Any) -> None:
        """Call a method of the picture in the browser."""
        if self.is_left:
            return
        values = ", ".join(json.dumps(value) for value in args)
        self._client.run_javascript(f"appView.{method}({values})")


class App(AppPicture):
    """One page: the session of its visitor, and what is done with it.

    Attributes:
        drawer: the tabs of results.
    """

    def __init__(self, session: Session) -> None:
        super().__init__(session)
        self.drawer = Drawer()
        self._cards = JobCards()
        self._edit = 0
        self._works: set[asyncio.Future[Any]] = set()
        self._client.on_delete(self._stop_works)

    def build_cards(self) -> None:
        """Make the corner where running jobs are shown."""
        self._cards.build()

    async def start(self) -> None:
        """Assemble the document of the session and show it, in the configuration of the session."""
        await self._settle()

    async def edit(self, cell: Cell, text: str) -> None:
        """Change the text of a cell."""
        try:
            document = self.document.changed(cell, text)
        except MbsError as error:
            self.complain(error)
            return
        await self.change(document)

    async def change(self, document: Document) -> None:
        """Put another document in the place of the present one."""
        self.session.change(document)
        await self._settle()

    async def open_robot(self, make: Callable[..., Document], *args: Any) -> bool:
        """Show the robot that `make(*args)` describes, without anything of the present robot.

        Returns:
            whether there is a document; without one the present robot stays.
        """
        document = await self._made(make, *args)
        if document is None:
            return False
        self.session.open(document)
        await self._settle()
        return True

    async def describe_anew(self, make: Callable[..., Document]) -> bool:
        """Show another description of the same robot, in the present configuration.

        Returns:
            whether there is a document; without one the present description stays.
        """
        document = await self._made(make)
        if document is None:
            return False
        await self.change(document)
        return True

    async def _made(self, make: Callable[..., Document], *args: Any) -> Document | None:
        try:
            document: Document = await self.aside(make, *args)
        except Exception as error:
            self.complain(error)
            return None
        return document

    async def undo(self) -> None:
        """Take back the last change."""
        if self.session.undo():
            await self._settle()

    async def redo(self) -> None:
        """Make it again."""
        if self.session.redo():
            await self._settle()

    async def _settle(self) -> None:
        """Assemble and draw the document; a later edit makes this one stop."""
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
                session.refusal = self._sentence(error)
                self._tell(self._on_document)
            return
        if edit != self._edit:
            return
        if answer is not None:
            self._show(document, *answer)
        self._tell(self._on_document)

    def _show(self, document: Document, q: Vector, drawn: Scene | None, why: str) -> None:
        """Take an assembled document; without a picture the sentence says why."""
        self.session.settle(document, q)
        self.session.refusal = why
        if drawn is not None:
            self._draw(drawn)
        self._tell(self._on_robot)
        self._tell(self._on_configuration)

    async def run(self, label: str, task: Callable[..., Any], *args: Any) -> Any:
        """What `task(system, *args)` returns, computed in a child process.

        Meanwhile a card shows its progress and a button that stops it.

        Args:
            label: what is done, for people.
            task: a function of a module; what it takes and returns is plain data.
            *args: further arguments.

        Returns:
            the result, or None when it was stopped, or refused with a sentence that was shown.
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
        """Stop what runs for a page that nobody looks at any more."""
        for work in tuple(self._works):
            work.cancel()

    def open(self, title: str, key: str | None = None) -> AbstractContextManager[Any]:
        """A tab of results to fill; one with the same key gives it its place."""
        return self.drawer.open(title, key)


async def warm_up() -> None:
    """Do everything once, so that the first visitor does not wait for what is loaded late."""

    def once() -> None:
        system = Document.of_name("rx90").system()
        _drawn(system, system.configuration)
        loop = Document.of_name("four_bar").system()
        # any small step along the branch [rad]
        moved(loop, loop.configuration, handles(loop)[0].index, loop.configuration[0] + 0.01)

    await aside(once)


def _drawn(system: System, q: Vector) -> tuple[Scene | None, str]:
    """The picture, or None and a sentence."""
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
