"""Progress of long runs, shown on the terminal."""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any

PATIENCE = 2.0

Listener = Callable[[str, float], None]
"""Function of the label of a run and the completed fraction, from 0 to 1."""

_LISTENER: ContextVar[Listener | None] = ContextVar("listener", default=None)


@contextmanager
def listen(listener: Listener) -> Iterator[None]:
    """Context manager that reports the progress of every run in its block to a function.

    Quiet runs are reported too.

    Args:
        listener: function of label and completed fraction, called in the thread of the run.
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
    """Context manager that yields a function to report progress.

    After two seconds it shows a bar on a terminal.

    Args:
        label: name of the run.
        start: initial value of the progress, such as a simulated time [s].
        stop: final value of the progress.
        quiet: Whether the bar is never shown. A listener still gets reports.

    Yields:
        function of the reached value.
    """
    bar = _DelayedBar(label, start, stop, shown=not quiet and sys.stderr.isatty())
    listener = _LISTENER.get()
    try:
        yield bar.reach if listener is None else _with_listener(bar, listener)
    finally:
        bar.close()


class _DelayedBar:
    """Progress bar of rich that is created after a waiting time of two seconds."""

    def __init__(self, label: str, start: float, stop: float, *, shown: bool) -> None:
        self.label = label
        self._start = start
        self._stop = stop
        self._due = time.monotonic() + PATIENCE if shown else float("inf")
        self._bar: Any = None
        self._task: Any = None

    def reach(self, simulated: float) -> None:
        """Show the value `simulated` on the bar; the bar is opened if the waiting time is over."""
        if self._bar is None:
            if time.monotonic() < self._due:
                return
            self._open()
        self._bar.update(self._task, completed=simulated - self._start)

    def part(self, simulated: float) -> float:
        """Return the completed fraction, 0 to 1, at the value `simulated`."""
        whole = self._stop - self._start
        return min(max((simulated - self._start) / whole, 0.0), 1.0) if whole > 0 else 1.0

    def close(self) -> None:
        """Remove the bar, if it was opened."""
        if self._bar is not None:
            self._bar.stop()

    def _open(self) -> None:
        """Create the bar and show it on stderr."""
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


def _with_listener(bar: _DelayedBar, listener: Listener) -> Callable[[float], None]:
    """Return a function of the reached value that updates the bar and calls the listener."""

    def reach(simulated: float) -> None:
        bar.reach(simulated)
        listener(bar.label, bar.part(simulated))

    return reach
