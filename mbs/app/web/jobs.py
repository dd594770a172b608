"""Long computations in child processes that can be cancelled, and the cards that show them."""

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

# Long computations in a child process, with progress and cancellation.


_LOG = logging.getLogger(__name__)
_PATIENCE = 2.0
"""Time [s] that a stopped child process has to end before it is killed."""

_STEP = 0.01
"""Smallest increase of the completed fraction for which a progress message is sent."""


class JobError(MbsError):
    """Failure of a computation that the user did not cause."""


async def run(
    task: Callable[..., Any],
    document: Document,
    *args: Any,
    progress: Callable[[str, float], None] | None = None,
) -> Any:
    """Run `task(system, *args)` in a child process and return its result.

    Cancelling the call stops the child and its own child processes, and removes its temporary
    files.

    Args:
        task: function of a module, so that it can be pickled. Arguments and result are plain data.
        document: description of the robot; it is assembled in the child.
        *args: further arguments of the task.
        progress: callable (label, completed fraction from 0 to 1).

    Raises:
        MbsError: error of the task; `JobError` for any other failure, which is logged.
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
        await asyncio.shield(asyncio.to_thread(_stop_child, process, folder))


def _context() -> Any:
    """Return the multiprocessing context: a fork server if the platform has one, else spawn."""
    if "forkserver" not in multiprocessing.get_all_start_methods():
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["casadi", "mbs.app.web.jobs.preload"])
    return context


async def _answer(
    messages: asyncio.Queue[tuple[Any, ...]], progress: Callable[[str, float], None] | None
) -> Any:
    """Return the result of the child process; pass its progress messages to `progress`.

    Raise the error that the child reports.
    """
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
    """Pass the messages of the child to the event loop; a silent end is reported as a failure.

    `ours` is the receiving end of the pipe.
    """
    kind = "progress"
    with ours, contextlib.suppress(RuntimeError):  # the event loop may be closed already
        while kind == "progress":
            try:
                message = ours.recv()
            except (EOFError, OSError):
                message = ("broken", "it ended without an answer", "")
            kind = message[0]
            loop.call_soon_threadsafe(messages.put_nowait, message)


def _refuse(kind: str, name: str, told: str) -> NoReturn:
    """Raise the error that a child process reports.

    An MbsError (kind "refused") keeps its class, other failures become a `JobError` and are logged.
    `told` is the message or traceback.
    """
    if kind == "refused":
        known = getattr(errors, name, MbsError)
        raise known(told)
    _LOG.error("a job broke: %s\n%s", name, told)
    raise JobError(
        f"this could not be computed ({name}); the log has the details, please report it with the"
        " robot and what you asked for"
    )


def _child(
    theirs: Connection, folder: str, task: Callable[..., Any], document: Document, args: Any
) -> None:
    """Run a task in the child process: assemble the robot, call the task, send the result.

    `theirs` is the sending end of the pipe, `folder` the folder of temporary files.
    """
    tempfile.tempdir = folder
    if hasattr(os, "setpgid"):
        os.setpgid(0, 0)  # process group: its own child processes are stopped with it
    threading.Thread(target=_end_with_server, args=(folder,), daemon=True).start()
    try:
        with listen(_ProgressSender(theirs)):
            answer = task(document.system(), *args)
        theirs.send(("done", answer))
    except MbsError as error:
        theirs.send(("refused", type(error).__name__, str(error)))
    except Exception as error:
        theirs.send(("broken", f"{type(error).__name__}: {error}", traceback.format_exc()))
    finally:
        theirs.close()


def _end_with_server(folder: str) -> None:
    """Stop this child and its own child processes when the server process ends."""
    server = multiprocessing.parent_process()
    if server is None:
        return
    server.join()
    shutil.rmtree(folder, ignore_errors=True)
    if hasattr(os, "killpg"):
        os.killpg(0, signal.SIGKILL)
    os._exit(1)


class _ProgressSender:
    """Callable (label, fraction) that sends progress messages through a pipe.

    Messages are limited to changes that are visible in the progress bar.
    """

    def __init__(self, theirs: Connection) -> None:
        self._theirs = theirs
        self._last: tuple[str, float] = ("", -1.0)

    def __call__(self, label: str, part: float) -> None:
        """Send a label and a completed fraction (0 to 1) if the change is visible."""
        if label != self._last[0] or part >= min(self._last[1] + _STEP, 1.0) > self._last[1]:
            self._last = (label, part)
            self._theirs.send(("progress", label, part))


def _stop_child(process: BaseProcess, folder: str) -> None:
    """Stop the child process if it is still running, and remove its folder of temporary files."""
    if process.pid is not None:
        process.join(0.05)  # [s] after sending its result, the child is about to end by itself
        if process.is_alive():
            _signal(process, "SIGTERM")
            process.join(_PATIENCE)
        if process.is_alive():
            _signal(process, "SIGKILL")
            process.join(_PATIENCE)
    shutil.rmtree(folder, ignore_errors=True)


def _signal(process: BaseProcess, name: str) -> None:
    """Send a signal, such as "SIGTERM", to the child and its own child processes."""
    if sys.platform == "win32" or process.pid is None:
        process.terminate()
        return
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, getattr(signal, name))
        return
    process.terminate()  # the child has no process group yet


# Cards of running jobs: label, progress, and a button that cancels the job.


class JobCard:
    """Card of a running job: label, progress bar and a button that cancels it."""

    def __init__(self, label: str) -> None:
        with ui.element("div").classes("app-job") as self.element:
            with ui.element("div").classes("app-job-head"):
                self._label = ui.label(label)
                self._button = ui.button("Cancel").props("flat dense no-caps color=negative")
            self._bar = ui.linear_progress(show_value=False, size="5px").props("indeterminate")
            self._note = ui.label("starting").classes("app-note")

    def on_cancel(self, cancel: Callable[[], Any]) -> None:
        """Set the action of the cancel button.

        Args:
            cancel: function without arguments that stops the job.
        """

        def stop() -> None:
            self._button.disable()
            self._note.set_text("stopping")
            cancel()

        self._button.on_click(stop)

    def progress(self, label: str, part: float) -> None:
        """Show the label of the computation and the completed fraction.

        Args:
            label: name of the present step.
            part: completed fraction from 0 to 1.
        """
        self._bar.props(remove="indeterminate")
        self._bar.set_value(part)
        self._note.set_text(f"{label}: {100 * part:.0f} %")


class JobCards:
    """Corner of the page that contains the cards of running jobs."""

    def __init__(self) -> None:
        self._corner: ui.element | None = None

    def build(self) -> None:
        """Create the empty corner."""
        self._corner = ui.element("div").classes("app-jobs")

    @contextmanager
    def card(self, label: str) -> Iterator[JobCard]:
        """Show a card of a job while the block runs, and remove it afterwards.

        Args:
            label: description of the job.
        """
        assert self._corner is not None, "build comes first"
        with self._corner:
            card = JobCard(label)
        try:
            yield card
        finally:
            if not card.element.is_deleted:
                card.element.delete()
