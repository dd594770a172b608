"""What is refused in the description of an FMU, before anything is written."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import TYPE_CHECKING

import casadi

from mbs.errors import ExportError
from mbs.messages import quoted
from mbs.units import UNITS

if TYPE_CHECKING:
    from mbs.export.fmu.description import FmuModel

TIME = "time"
"""What the independent variable is called, in FMI 3.0 and in results."""

SOLVERS = ("dopri5", "rodas", "rk4")


def check(model: FmuModel) -> None:
    """Refuse a description that is no FMU.

    Raises:
        ExportError: a name, a number or the size of a function is wrong.
    """
    _check_names(model)
    _check_texts(model)
    _check_numbers(model)
    _check_functions(model)


def _check_names(model: FmuModel) -> None:
    if not model.name:
        raise ExportError("FMU: the model has no name; give it one")
    seen: set[str] = set()
    names = [entry.variable.name for entry in model.entries]
    for name in (*names, *(array.name for array in model.arrays)):
        if not name or not name.isprintable():
            raise ExportError(f"FMU {model.name}: {name!r} is no name; use printable characters")
        if name == TIME:
            raise ExportError(f"FMU {model.name}: {name!r} is the name of time itself; use another")
        if name in seen:
            raise ExportError(f"FMU {model.name}: two variables are called {name!r}; rename one")
        seen.add(name)


def _check_texts(model: FmuModel) -> None:
    """What people read in the description, where other characters are lost or invalid."""
    for what, text in {"description": model.description, **asdict(model.origin)}.items():
        if not isinstance(text, str) or not text.isprintable():
            raise ExportError(
                f"FMU {model.name}: {what} is {quoted(text)}; give a line of printable characters"
            )


def _check_numbers(model: FmuModel) -> None:
    if model.solver not in SOLVERS:
        raise ExportError(
            f"FMU {model.name}: solver is {model.solver!r}; use {' or '.join(SOLVERS)}"
        )
    for entry in model.entries:
        v = entry.variable
        place = f"FMU {model.name}: {v.name}"
        if v.unit not in UNITS:
            raise ExportError(f"{place} has unit {v.unit!r}; use one of {', '.join(UNITS)}")
        if not math.isfinite(v.start):
            raise ExportError(f"{place} starts at {v.start}; use a finite number")
        if not (v.nominal > 0 and math.isfinite(v.nominal)):
            raise ExportError(f"{place} has nominal {v.nominal}; use a positive number")
        low = -math.inf if v.min is None else v.min
        high = math.inf if v.max is None else v.max
        if not low <= v.start <= high and entry.kind == "parameter":
            raise ExportError(f"{place} starts at {v.start}, outside {low} to {high}; move one")
    for what, value in (
        ("stop time", model.stop_time),
        ("tolerance", model.tolerance),
        ("step size", model.step_size),
        ("internal step", model.internal_step),
    ):
        known = isinstance(value, (int, float)) and math.isfinite(value)
        if not (known and value > 0):
            raise ExportError(f"FMU {model.name}: {what} {quoted(value)} must be positive")


def _check_functions(model: FmuModel) -> None:
    nx, nz, nu = len(model.states), len(model.dependents), len(model.inputs)
    ny, n_p, n_m = len(model.outputs), len(model.parameters), len(model.modes)
    _check_shape(model, "rhs", model.rhs, (1, nx, nz, nu, n_p + n_m), (nx, ny))
    if (model.closure is None) != (nz == 0):
        raise ExportError(
            f"FMU {model.name}: {nz} dependent coordinates need "
            f"{'a closure' if nz else 'no closure'}; give both or neither"
        )
    if model.closure is not None:
        _check_shape(model, "closure", model.closure, (nx, nz, n_p), (nz, 1))
    if model.jumps is not None:
        point, k = (1, nx, nz, nu, n_p + n_m), len(model.jumps.names)
        _check_shape(model, "first", model.jumps.first, point, (n_m, k))
        _check_shape(model, "indicators", model.jumps.indicators, point, (k,))
        _check_shape(model, "jump", model.jumps.jump, (*point, k), (nx, n_m))


def _check_shape(
    model: FmuModel,
    what: str,
    function: casadi.Function,
    inputs: tuple[int, ...],
    outputs: tuple[int, ...],
) -> None:
    found_in = tuple(function.numel_in(k) for k in range(function.n_in()))
    found_out = tuple(function.numel_out(k) for k in range(function.n_out()))
    if found_in != inputs or found_out != outputs:
        raise ExportError(
            f"FMU {model.name}: {what} has inputs of sizes {found_in} and outputs of sizes "
            f"{found_out}; the variables ask for {inputs} and {outputs}"
        )
