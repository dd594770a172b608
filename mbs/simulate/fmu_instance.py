"""Messages of FMUs, each brought to the simulation of the thread that it comes from.

fmpy keeps one logger for the whole process in a C library and never asks whether the Python
function behind it still lives. So there is one function here that lives as long as the process.
"""

from __future__ import annotations

import ctypes
import os
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import lru_cache
from typing import Any

Listener = Callable[[int, str], None]
"""Called with the status and the text of a message."""

_LISTENERS: dict[int, Listener] = {}  # by thread
_LOCK, _LOADING = threading.Lock(), threading.Lock()


@contextmanager
def heard(listener: Listener) -> Iterator[None]:
    """While it lasts, messages of FMUs that this thread runs go to `listener`."""
    thread = threading.get_ident()
    with _LOCK:
        before = _LISTENERS.get(thread)
        _LISTENERS[thread] = listener
    try:
        yield
    finally:
        with _LOCK:
            if before is None:
                del _LISTENERS[thread]
            else:
                _LISTENERS[thread] = before


@contextmanager
def instance(description: Any, folder: str, kind: str, watch: Callable[..., None]) -> Iterator[Any]:
    """An instance of an FMU of FMI 2.0 or 3.0 whose messages are heard; it is freed at the end.

    Args:
        description: its model description.
        folder: where it was unpacked.
        kind: "CoSimulation" or "ModelExchange".
        watch: called between communication points, in FMI 3.0 where the FMU offers it.
    """
    from fmpy import fmi2, fmi3

    stepped, newer = kind == "CoSimulation", description.fmiVersion.startswith("3")
    interface = description.coSimulation if stepped else description.modelExchange
    kinds = {
        ("2", True): fmi2.FMU2Slave,
        ("2", False): fmi2.FMU2Model,
        ("3", True): fmi3.FMU3Slave,
        ("3", False): fmi3.FMU3Model,
    }
    with _kept_directory():
        fmu = kinds[description.fmiVersion[0], stepped](
            guid=description.guid,
            modelIdentifier=interface.modelIdentifier,
            unzipDirectory=folder,
            instanceName=description.modelName,
        )
    says_why = str(description.generationTool).startswith(
        "mbs"
    )  # others, asked to log, say everything
    if newer:
        offers = _offered(interface, watch) if stepped else {}
        fmu.instantiate(loggingOn=says_why, logMessage=_log_newer, **offers)
    else:
        fmu.instantiate(callbacks=_callbacks(), loggingOn=says_why)
    try:
        yield fmu
    finally:
        fmu.freeInstance()


@contextmanager
def _kept_directory() -> Iterator[None]:
    """A library is loaded by fmpy from its folder: one thread at a time, and back again."""
    with _LOADING:
        before = os.getcwd()
        try:
            yield
        finally:
            os.chdir(before)


def _offered(interface: Any, watch: Callable[..., None]) -> dict[str, Any]:
    """What an instance for co-simulation of FMI 3.0 is told that its host can do."""
    events = bool(interface.hasEventMode)
    found: dict[str, Any] = {"eventModeUsed": events, "earlyReturnAllowed": events}
    if interface.providesIntermediateUpdate:
        found["intermediateUpdate"] = watch
    return found


@lru_cache(maxsize=1)
def _functions() -> tuple[Any, Any, Any]:
    """What C calls for messages and memory; made once, never freed."""
    from fmpy import fmi2

    return (
        fmi2.fmi2CallbackLoggerTYPE(_log),
        fmi2.fmi2CallbackAllocateMemoryTYPE(fmi2.calloc),
        fmi2.fmi2CallbackFreeMemoryTYPE(fmi2.free),
    )


def _callbacks() -> Any:
    """The C functions of an instance.

    fmpy's proxy for messages knows one logger at a time, that of the last who asked, and other
    users of fmpy may have freed theirs: so it is told ours for every instance.
    """
    from fmpy import fmi2
    from fmpy.logging import addLoggerProxy

    logger, allocate, free = _functions()
    callbacks = fmi2.fmi2CallbackFunctions(logger=logger, allocateMemory=allocate, freeMemory=free)
    with _LOCK:
        addLoggerProxy(ctypes.byref(callbacks))
    return callbacks


def _log(environment: Any, name: bytes, status: int, category: bytes, message: bytes) -> None:
    from fmpy import fmi2

    listener = _LISTENERS.get(threading.get_ident())
    if listener is None:
        fmi2.printLogMessage(environment, name, status, category, message)
    else:
        listener(status, message.decode("utf-8", "replace"))


def _log_newer(environment: Any, status: int, category: bytes, message: bytes) -> None:
    """The same in FMI 3.0, which needs no proxy."""
    from fmpy import fmi3

    listener = _LISTENERS.get(threading.get_ident())
    if listener is None:
        fmi3.printLogMessage(environment, status, category, message)
    else:
        listener(status, message.decode("utf-8", "replace"))
