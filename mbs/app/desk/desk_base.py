"""What every part of the desk needs: the session, the page, one thread, and words to say."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Coroutine, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from nicegui import background_tasks, ui
from nicegui.client import Client

from mbs.app.desk.document.document import Document
from mbs.app.desk.session import Session
from mbs.app.desk.session_posture import Vector
from mbs.assembly import System
from mbs.errors import MbsError

_LOG = logging.getLogger(__name__)
_ASIDE = ThreadPoolExecutor(max_workers=1, thread_name_prefix="mbs-desk")
"""The one thread that builds graphs: they are not made for several at once."""

Listener = Callable[[], Coroutine[Any, Any, None] | None]


async def aside(function: Callable[..., Any], *args: Any) -> Any:
    """What a short function returns, called in the one thread that builds graphs."""
    return await asyncio.get_running_loop().run_in_executor(_ASIDE, function, *args)


class DeskBase:
    """The session of a visitor and the page that shows it.

    Attributes:
        session: the robot, its history and its posture.
    """

    def __init__(self, session: Session) -> None:
        self.session = session
        self._client: Client = ui.context.client
        self._on_robot: list[Listener] = []
        self._on_posture: list[Listener] = []
        self._on_document: list[Listener] = []

    @property
    def document(self) -> Document:
        """The robot as typed."""
        return self.session.document

    @property
    def q(self) -> Vector:
        """(nq,) present posture [rad or m]."""
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
        _LOG.error("the desk could not go on", exc_info=error)
        return (
            f"this did not work ({type(error).__name__}); the log has the details, please report it"
        )

    def on_robot(self, listener: Listener) -> None:
        """Call a function after each robot that could be assembled."""
        self._on_robot.append(listener)

    def on_posture(self, listener: Listener) -> None:
        """Call a function after each change of the posture."""
        self._on_posture.append(listener)

    def on_document(self, listener: Listener) -> None:
        """Call a function after each edit, good or not."""
        self._on_document.append(listener)

    def on_time(self, listener: Callable[[float], Any]) -> None:
        """Call a function with the time of the film that is shown, ten times a second."""
        ui.on("desk-time", lambda event: listener(float(event.args)))

    def _tell(self, listeners: Sequence[Listener]) -> None:
        if self.is_left:
            return
        with self._client:
            for listener in listeners:
                answer = listener()
                if answer is not None:
                    background_tasks.create(answer)
