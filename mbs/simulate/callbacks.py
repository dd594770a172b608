"""Errors raised where a C library calls back: Python drops them and the library goes on."""

import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

_LOCK = threading.Lock()
_LOST: dict[int, list[BaseException]] = {}  # by thread
_before: Any = sys.unraisablehook


@contextmanager
def callback_errors() -> Iterator[list[BaseException]]:
    """Errors of FMUs that this thread loses; other errors are told as before.

    Simulations in several threads share the hook of the interpreter: the first one installs it and
    the last one takes it away.

    Yields:
        a list that fills with the errors.
    """
    global _before
    thread = threading.get_ident()
    with _LOCK:
        if not _LOST:
            _before, sys.unraisablehook = sys.unraisablehook, _keep
        outer = _LOST.get(thread)
        lost = _LOST[thread] = []
    try:
        yield lost
    finally:
        with _LOCK:
            if outer is None:
                del _LOST[thread]
            else:
                _LOST[thread] = outer
            if not _LOST and sys.unraisablehook is _keep:
                sys.unraisablehook = _before


def _keep(event: "sys.UnraisableHookArgs") -> None:
    lost = _LOST.get(threading.get_ident())
    error = event.exc_value
    if lost is not None and isinstance(error, Exception) and "fmi" in type(error).__module__:
        lost.append(error)
    else:
        _before(event)
