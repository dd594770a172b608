"""The desk: what menus and panels get to work with."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import Any

from mbs.app.desk.desk_base import aside
from mbs.app.desk.desk_picture import DeskPicture
from mbs.app.desk.document.cells import Cell
from mbs.app.desk.document.document import Document
from mbs.app.desk.drawer import Drawer
from mbs.app.desk.jobs import jobs
from mbs.app.desk.jobs.cards import JobCards
from mbs.app.desk.session import Session
from mbs.app.desk.session_posture import Vector, carried, handles, moved
from mbs.assembly import System
from mbs.errors import MbsError
from mbs.view import Scene, scene


class Desk(DeskPicture):
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
        """Assemble the document of the session and show it, in the posture of the session."""
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
        """Show the document that `make(*args)` gives; whether it could be had."""
        try:
            document = await self.aside(make, *args)
        except Exception as error:
            self.complain(error)
            return False
        self._camera = "iso"
        await self.change(document)
        return True

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
        self._tell(self._on_posture)

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
        _drawn(system, system.posture)
        loop = Document.of_name("four_bar").system()
        moved(loop, loop.posture, handles(loop)[0].place, loop.posture[0] + 0.01)

    await aside(once)


def _drawn(system: System, q: Vector) -> tuple[Scene | None, str]:
    """The picture, or None and a sentence."""
    values = zip(system.parameters, system.parameter_values(needed=()), strict=True)
    open_symbols = [parameter.name for parameter, value in values if value != value]
    if open_symbols:
        return None, f"{', '.join(open_symbols)}: no value yet; write one in the table Symbols"
    try:
        drawn = scene(system, q)
        drawn.poses(q)
        handles(system)
    except MbsError as error:
        return None, str(error)
    return drawn, ""
