"""Identity of a parameter sweep: content of the model, cases and options."""

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
from mbs.simulate.options import SimulatorArguments
from mbs.simulate.simulator import simulator_of
from mbs.simulate.sweep_cases import Case
from mbs.text import quoted

_ADDRESS = re.compile(r" at 0x[0-9A-Fa-f]+")  # address of an object in the memory of one process


def study_of(
    model: System | str | os.PathLike[str], cases: Sequence[Case], options: Mapping[str, Any]
) -> dict[str, object]:
    """Return the JSON description of a sweep, which identifies it.

    Args:
        model: system, or path of an FMU.
        cases: dict from name to value of each simulation.
        options: further arguments of all simulations.

    Raises:
        ModelError: the FMU cannot be read, or `model` is neither a System nor a path.
    """
    identity = (
        _system_identity(model, options) if isinstance(model, System) else _fmu_identity(model)
    )
    name, content = identity
    described = {option: _describe(value) for option, value in sorted(options.items())}
    digest = hashlib.sha256(content).hexdigest()
    return {"model": name, "content": digest, "cases": list(cases), "options": described}


LAWS = tuple(field.name for field in fields(SimulatorArguments) if field.kw_only)
"""Options common to all cases. Efforts and inputs of a case are numeric inputs of the simulator, so
that all cases have the same equations."""


def _system_identity(system: System, options: Mapping[str, Any]) -> tuple[str, bytes]:
    """Return the name of the system, and the cache key of system and laws."""
    laws = {name: options[name] for name in LAWS if name in options}
    return system.name, simulator_of(system, **laws).content()


def _fmu_identity(path: object) -> tuple[str, bytes]:
    if not isinstance(path, (str, os.PathLike)):
        raise ModelError(f"sweep: {quoted(path)} is no model; give a System or the path of an FMU")
    file = Path(os.fspath(path))
    try:
        return file.name, file.read_bytes()
    except OSError as error:
        raise ModelError(
            f"sweep: {file} cannot be read ({error.strerror}); give the path of an FMU"
        ) from error


def _describe(value: object) -> str:
    """Return a text of an option that is the same in every process."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key!r}: {_describe(value[key])}" for key in value) + "}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(_describe(part) for part in value) + "]"
    if isinstance(value, np.ndarray):
        return f"array {value.shape} {hashlib.sha256(value.tobytes()).hexdigest()}"
    return getattr(value, "__qualname__", None) or _ADDRESS.sub("", repr(value))
