"""Long work in child processes that can be stopped, and the cards that show it."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import multiprocessing
import os
import shutil
import signal
import sys
import tempfile
import threading
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import Any, NoReturn

from nicegui import ui

from mbs import errors
from mbs.app.web.document.document import Document
from mbs.errors import MbsError
from mbs.progress import listen

# Long work in a child process, with progress and a way to stop it.


_LOG = logging.getLogger(__name__)
_PATIENCE = 2.0
"""Seconds that a stopped child has before it is killed."""

_STEP = 0.01
"""Smallest part of the whole run that is worth a message."""


class Broken(MbsError):
    """Work that ended in a way that is no mistake of its user."""


async def run(
    task: Callable[..., Any],
    document: Document,
    *args: Any,
    progress: Callable[[str, float], None] | None = None,
) -> Any:
    """What `task(system, *args)` returns, computed in a child process.

    Cancelling the call stops the child and what it started, and removes its temporary files.

    Args:
        task: a function of a module, so that a child finds it; what it takes and returns is plain
            data.
        document: the robot, assembled in the child.
        *args: further arguments of the task.
        progress: called with the label of a run and the part of it that is done, 0 to 1.

    Raises:
        MbsError: the error of the task, or `Broken` for any other end; it is logged.
    """
    folder = tempfile.mkdtemp(prefix="mbs-app-")
    ours, theirs = multiprocessing.Pipe(duplex=False)
    process = _context().Process(
        target=_child, args=(theirs, folder, task, document, args), daemon=True
    )
    messages: asyncio.Queue[tuple[Any, ...]] = asyncio.Queue()
    try:
        await asyncio.to_thread(process.start)
        theirs.close()
        reader = threading.Thread(
            target=_read, args=(ours, asyncio.get_running_loop(), messages), daemon=True
        )
        reader.start()
        return await _answer(messages, progress)
    finally:
        await asyncio.shield(asyncio.to_thread(_end, process, folder))


def _context() -> Any:
    """A server that children are forked from, where the platform has one."""
    if "forkserver" not in multiprocessing.get_all_start_methods():
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["casadi", "mbs.app.web.jobs.preload"])
    return context


async def _answer(
    messages: asyncio.Queue[tuple[Any, ...]], progress: Callable[[str, float], None] | None
) -> Any:
    while True:
        kind, *content = await messages.get()
        if kind == "done":
            return content[0]
        if kind != "progress":
            _refuse(kind, *content)
        if progress is not None:
            progress(*content)


def _read(
    ours: Connection, loop: asyncio.AbstractEventLoop, messages: asyncio.Queue[tuple[Any, ...]]
) -> None:
    """Hand on what the child says, until it ends; an end without a word is a message as well."""
    kind = "progress"
    with ours, contextlib.suppress(RuntimeError):  # the loop may be closed meanwhile
        while kind == "progress":
            try:
                message = ours.recv()
            except (EOFError, OSError):
                message = ("broken", "it ended without an answer", "")
            kind = message[0]
            loop.call_soon_threadsafe(messages.put_nowait, message)


def _refuse(kind: str, name: str, told: str) -> NoReturn:
    if kind == "refused":
        known = getattr(errors, name, MbsError)
        raise known(told)
    _LOG.error("a job broke: %s\n%s", name, told)
    raise Broken(
        f"this could not be computed ({name}); the log has the details, please report it with the"
        " robot and what you asked for"
    )


def _child(
    theirs: Connection, folder: str, task: Callable[..., Any], document: Document, args: Any
) -> None:
    """The whole life of the child."""
    tempfile.tempdir = folder
    if hasattr(os, "setpgid"):
        os.setpgid(0, 0)  # what it starts is stopped with it
    threading.Thread(target=_end_with_server, args=(folder,), daemon=True).start()
    try:
        with listen(_Teller(theirs)):
            answer = task(document.system(), *args)
        theirs.send(("done", answer))
    except MbsError as error:
        theirs.send(("refused", type(error).__name__, str(error)))
    except Exception as error:
        theirs.send(("broken", f"{type(error).__name__}: {error}", traceback.format_exc()))
    finally:
        theirs.close()


def _end_with_server(folder: str) -> None:
    """Stop the child, and what it started, when the process that asked for it is gone."""
    server = multiprocessing.parent_process()
    if server is None:
        return
    server.join()
    shutil.rmtree(folder, ignore_errors=True)
    if hasattr(os, "killpg"):
        os.killpg(0, signal.SIGKILL)
    os._exit(1)


class _Teller:
    """Sends progress in steps that a reader can see."""

    def __init__(self, theirs: Connection) -> None:
        self._theirs = theirs
        self._last: tuple[str, float] = ("", -1.0)

    def __call__(self, label: str, part: float) -> None:
        if label != self._last[0] or part >= min(self._last[1] + _STEP, 1.0) > self._last[1]:
            self._last = (label, part)
            self._theirs.send(("progress", label, part))


def _end(process: BaseProcess, folder: str) -> None:
    """Stop the child if it still runs, and take away what it leaves behind."""
    if process.pid is not None:
        process.join(0.05)  # [s] one that has sent its answer is about to end by itself
        if process.is_alive():
            _signal(process, "SIGTERM")
            process.join(_PATIENCE)
        if process.is_alive():
            _signal(process, "SIGKILL")
            process.join(_PATIENCE)
    shutil.rmtree(folder, ignore_errors=True)


def _signal(process: BaseProcess, name: str) -> None:
    """Signal the child and what it started."""
    if sys.platform == "win32" or process.pid is None:
        process.terminate()
        return
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, getattr(signal, name))
        return
    process.terminate()  # before it had a group of its own


# Cards of running jobs: what is done, how far it is, and a button that stops it.


class JobCard:
    """One running job."""

    def __init__(self, label: str) -> None:
        with ui.element("div").classes("app-job") as self.element:
            with ui.element("div").classes("app-job-head"):
                self._label = ui.label(label)
                self._button = ui.button("Cancel").props("flat dense no-caps color=negative")
            self._bar = ui.linear_progress(show_value=False, size="5px").props("indeterminate")
            self._note = ui.label("starting").classes("app-note")

    def on_cancel(self, cancel: Callable[[], Any]) -> None:
        """What the button does."""

        def stop() -> None:
            self._button.disable()
            self._note.set_text("stopping")
            cancel()

        self._button.on_click(stop)

    def progress(self, label: str, part: float) -> None:
        """Show what is running and the part of it that is done, 0 to 1."""
        self._bar.props(remove="indeterminate")
        self._bar.set_value(part)
        self._note.set_text(f"{label}: {100 * part:.0f} %")


class JobCards:
    """The corner of the page where the cards are."""

    def __init__(self) -> None:
        self._corner: ui.element | None = None

    def build(self) -> None:
        """Make the empty corner."""
        self._corner = ui.element("div").classes("app-jobs")

    @contextmanager
    def card(self, label: str) -> Iterator[JobCard]:
        """A card for as long as the block lasts."""
        assert self._corner is not None, "build comes first"
        with self._corner:
            card = JobCard(label)
        try:
            yield card
        finally:
            if not card.element.is_deleted:
                card.element.delete()
