"""Control-C during an integration."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType


@contextmanager
def control_c() -> Iterator[Callable[[], None]]:
    """Yield a callable `check()`, which raises KeyboardInterrupt if control-C was pressed.

    Python drops a KeyboardInterrupt that is raised in a finalizer, so call `check` regularly. An
    interrupted call of CasADi may return None. An error that is raised in the block after control-C
    becomes a KeyboardInterrupt, with that error as its cause. The context manager does nothing if
    SIGINT has another handler, or outside the main thread.
    """
    pressed = [False]

    def handler(number: int, frame: FrameType | None) -> None:
        pressed[0] = True
        raise KeyboardInterrupt

    def check() -> None:
        if pressed[0]:
            raise KeyboardInterrupt

    is_main = threading.current_thread() is threading.main_thread()
    if not is_main or signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield check
        return
    signal.signal(signal.SIGINT, handler)
    try:
        yield check
    except Exception as error:
        if pressed[0]:
            raise KeyboardInterrupt from error
        raise
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)
