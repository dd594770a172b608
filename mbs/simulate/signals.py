"""Values of the variables of an FMU: at the start, and of inputs over time."""

from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from mbs.errors import ModelError
from mbs.messages import did_you_mean, quoted
from mbs.simulate.arguments import count_steps

Array = npt.NDArray[np.float64]
Signal = float | Callable[[float], float] | tuple[npt.ArrayLike, npt.ArrayLike]

REAL = ("Real", "Float64")
_FORMS = "a number, a function of time, or (times, values)"


def start_values(
    description: Any, parameters: Mapping[str, float], start: Mapping[str, float]
) -> dict[str, float]:
    """Values of parameters, states and inputs before the run, their names and numbers checked."""
    known = {v.name: v for v in description.modelVariables}
    fixed = {n for n, v in known.items() if v.causality == "parameter"}
    check_names("parameters", parameters, fixed, known)
    check_names("start", start, {n for n, v in known.items() if _settable(v)} - fixed, known)
    return {name: _number(name, value) for name, value in {**start, **parameters}.items()}


def _settable(variable: Any) -> bool:
    """Whether fmpy passes a start value on; what it does not pass on it drops without a word."""
    if variable.variability == "constant" or variable.causality == "independent":
        return False
    return variable.causality == "input" or variable.initial in ("exact", "approx")


def check_names(what: str, given: Iterable[str], allowed: set[str], known: Iterable[str]) -> None:
    """Refuse names that are unknown or may not be given.

    Args:
        what: the argument that names them.
        given: names.
        allowed: names that may be given.
        known: all names.

    Raises:
        ModelError: says which name, and the nearest one that may be given.
    """
    everything = set(known)
    for name in given:
        if name not in allowed:
            why = "cannot be set" if name in everything else "does not exist"
            hint = did_you_mean(name, sorted(allowed))
            raise ModelError(f"{what}: variable {name!r} {why} here; {hint}")


def input_table(
    description: Any,
    inputs: Mapping[str, Signal],
    start: Mapping[str, float],
    span: tuple[float, float],
    interval: float,
) -> Any:
    """Inputs as one structured array, sampled wherever one of them has a point.

    Inputs that are not given keep their start value. fmpy prints a warning where one is missing.
    """
    if not inputs:
        return None
    known = {v.name: v for v in description.modelVariables if v.causality == "input"}
    allowed = {n for n, v in known.items() if v.type in REAL}
    check_names("inputs", inputs, allowed, (v.name for v in description.modelVariables))
    grid = np.array(span)
    for name, signal in inputs.items():
        grid = np.union1d(grid, _points(name, signal, span, interval))
    columns = {name: _sampled(name, signal, grid) for name, signal in inputs.items()}
    for name, variable in known.items():
        value = start.get(name, _own_start(variable))
        if name not in inputs and value is not None:
            columns[name] = np.full(len(grid), value)
    table = np.empty(
        len(grid), dtype=[("time", float), *((n, c.dtype) for n, c in columns.items())]
    )
    table["time"] = grid
    for name, column in columns.items():
        table[name] = column
    return table


def _own_start(variable: Any) -> float | int | bool | None:
    """The start value that the FMU gives to one of its inputs; None where it is no number."""
    if getattr(variable, "dimensions", None):
        return None
    text = str(variable.start or 0)
    if variable.type in ("Real", "Float64", "Float32"):
        return float(text)
    if variable.type == "Boolean":
        return text in ("true", "1")
    if variable.type in ("String", "Binary", "Clock"):
        return None
    return int(text)


def _points(name: str, signal: Signal, span: tuple[float, float], interval: float) -> Array:
    if callable(signal):
        steps = count_steps(span[1] - span[0], interval, f"input {name}")
        return np.linspace(*span, steps + 1)
    if isinstance(signal, tuple):
        times, values = _pair(name, signal)
        if times.ndim != 1 or times.shape != values.shape or np.any(np.diff(times) <= 0):
            raise ModelError(f"input {name}: give as many values as increasing times")
        return times
    return np.array(span)


def _sampled(name: str, signal: Signal, grid: Array) -> Array:
    if callable(signal):
        column = np.array([_called(name, signal, float(t)) for t in grid])
    elif isinstance(signal, tuple):
        column = np.asarray(np.interp(grid, *_pair(name, signal)))
    else:
        column = np.full(len(grid), _number(f"input {name}", signal))
    if not np.isfinite(column).all():
        raise ModelError(f"input {name} has a value that is not finite; use numbers")
    return column


def _called(name: str, signal: Callable[[float], float], time: float) -> float:
    try:
        return float(signal(time))
    except Exception as error:
        raise ModelError(
            f"input {name}: no number at time {time:g} s ({error}); give a function of time that"
            " returns one"
        ) from error


def _pair(name: str, signal: tuple[Any, ...]) -> tuple[Array, Array]:
    try:
        times, values = (np.asarray(part, dtype=float) for part in signal)
    except (TypeError, ValueError):
        raise ModelError(f"input {name} is {quoted(signal)}; give {_FORMS}") from None
    return times, values


def _number(name: str, value: Any) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = float("nan")
    if not np.isfinite(number):
        raise ModelError(f"{name} = {quoted(value)}: use a finite number")
    return number
