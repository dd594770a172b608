"""How far a long run has come, shown to people who wait for it."""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any

PATIENCE = 2.0

Listener = Callable[[str, float], None]
"""What hears of progress: the label of the run, and the part of it that is done, from 0 to 1."""

_LISTENER: ContextVar[Listener | None] = ContextVar("listener", default=None)


@contextmanager
def listen(listener: Listener) -> Iterator[None]:
    """Tell a function about the progress of every run within the block, quiet ones as well.

    Args:
        listener: it is called in the thread of the run each time that progress is reported.
    """
    token = _LISTENER.set(listener)
    try:
        yield
    finally:
        _LISTENER.reset(token)


@contextmanager
def progress(
    label: str, start: float, stop: float, *, quiet: bool = False
) -> Iterator[Callable[[float], None]]:
    """A function to call with what was reached; after two seconds it shows a bar on a terminal.

    Args:
        label: what is running.
        start: what is reached at the beginning, such as a simulated time, s.
        stop: what is reached at the end.
        quiet: never show anything on the terminal; a listener hears of it all the same.

    Yields:
        a function of what was reached.
    """
    bar = _DelayedBar(label, start, stop, shown=not quiet and sys.stderr.isatty())
    listener = _LISTENER.get()
    try:
        yield bar.reach if listener is None else _told(bar, listener)
    finally:
        bar.close()


class _DelayedBar:
    """A rich progress bar that is made only when somebody has waited long enough."""

    def __init__(self, label: str, start: float, stop: float, *, shown: bool) -> None:
        self.label = label
        self._start = start
        self._stop = stop
        self._due = time.monotonic() + PATIENCE if shown else float("inf")
        self._bar: Any = None
        self._task: Any = None

    def reach(self, simulated: float) -> None:
        if self._bar is None:
            if time.monotonic() < self._due:
                return
            self._open()
        self._bar.update(self._task, completed=simulated - self._start)

    def part(self, simulated: float) -> float:
        """The part that is done, 0 to 1."""
        whole = self._stop - self._start
        return min(max((simulated - self._start) / whole, 0.0), 1.0) if whole > 0 else 1.0

    def close(self) -> None:
        if self._bar is not None:
            self._bar.stop()

    def _open(self) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

        self._bar = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            TextColumn("{task.percentage:>3.0f} %"),
            TimeRemainingColumn(),
            console=Console(stderr=True),
            transient=True,
        )
        self._task = self._bar.add_task(self.label, total=max(self._stop - self._start, 0.0))
        self._bar.start()


def _told(bar: _DelayedBar, listener: Listener) -> Callable[[float], None]:
    """Reach that also tells the listener."""

    def reach(simulated: float) -> None:
        bar.reach(simulated)
        listener(bar.label, bar.part(simulated))

    return reach
