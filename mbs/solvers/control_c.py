"""Control-C during an integration."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType


@contextmanager
def control_c() -> Iterator[Callable[[], None]]:
    """Give a function that raises KeyboardInterrupt if control-C was pressed.

    Python drops a KeyboardInterrupt that is raised while an object is deleted. The function raises
    it again. A call of CasADi that is interrupted may return None: errors after control-C are
    KeyboardInterrupts too. Other handlers of the signal, and other threads, are left alone.
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
