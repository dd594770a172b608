"""What makes a parameter study the same as an earlier one."""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from mbs.assembly import System
from mbs.errors import ModelError
from mbs.messages import quoted
from mbs.simulate.cases import Case

_ADDRESS = re.compile(r" at 0x[0-9A-Fa-f]+")  # of objects in memory, another one every time


def study_of(
    model: System | str | os.PathLike[str], cases: Sequence[Case], options: Mapping[str, Any]
) -> dict[str, object]:
    """A study as JSON knows it.

    Args:
        model: a system, or the path of an FMU.
        cases: name to value, of each simulation.
        options: further arguments of every simulation.

    Raises:
        ModelError: there is no such FMU.
    """
    name, content = _system(model) if isinstance(model, System) else _fmu(model)
    told = {option: _told(value) for option, value in sorted(options.items())}
    digest = hashlib.sha256(content).hexdigest()
    return {"model": name, "content": digest, "cases": list(cases), "options": told}


def _system(system: System) -> tuple[str, bytes]:
    """Its name, and all that it holds; numbers inside expressions are told to six digits."""
    held = [getattr(system, part.name) for part in fields(system) if part.name[0] != "_"]
    return system.name, _ADDRESS.sub("", repr(held)).encode()


def _fmu(path: object) -> tuple[str, bytes]:
    if not isinstance(path, (str, os.PathLike)):
        raise ModelError(f"sweep: {quoted(path)} is no model; give a System or the path of an FMU")
    file = Path(os.fspath(path))
    try:
        return file.name, file.read_bytes()
    except OSError as error:
        raise ModelError(
            f"sweep: {file} cannot be read ({error.strerror}); give the path of an FMU"
        ) from error


def _told(value: object) -> str:
    """A text that is the same the next time."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key!r}: {_told(value[key])}" for key in value) + "}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(_told(part) for part in value) + "]"
    if isinstance(value, np.ndarray):
        return f"array {value.shape} {hashlib.sha256(value.tobytes()).hexdigest()}"
    return getattr(value, "__qualname__", None) or _ADDRESS.sub("", repr(value))
