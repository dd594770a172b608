"""Simulation of an FMU, ours or anyone's, by fmpy."""

import difflib
import logging
import os
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from mbs.errors import ModelError, SolverError
from mbs.result import Result
from mbs.simulate.progress import progress

Array = npt.NDArray[np.float64]
Signal = float | Callable[[float], float] | tuple[npt.ArrayLike, npt.ArrayLike]
Interface = Literal["CoSimulation", "ModelExchange"]

_LOG = logging.getLogger(__name__)
_REAL = ("Real", "Float64")
_STEPS = 500


def fmu(
    path: str | os.PathLike[str],
    duration: float | None = None,
    *,
    inputs: Mapping[str, Signal] | None = None,
    parameters: Mapping[str, float] | None = None,
    start: Mapping[str, float] | None = None,
    kind: Interface = "CoSimulation",
    step: float | None = None,
    tolerance: float = 1e-8,
    solver: str = "CVode",
    record: Sequence[str] | None = None,
    quiet: bool = False,
) -> Result:
    """Inputs, states and outputs of an FMU over time.

    Args:
        path: the FMU.
        duration: s; by default until the stop time that the FMU proposes, else 1 s.
        inputs: input to a number, to a function of time, or to (times, values) with straight
            lines between them. It is held over each step, so shorten `step` where it varies fast.
        parameters: parameter to its value.
        start: state or input to its value at the start.
        kind: the interface that is used; the FMU brings the solver for co-simulation.
        step: communication step and distance of the rows, s; by default the one that the FMU
            proposes, else a 500th of the duration.
        tolerance: relative tolerance.
        solver: for model exchange: "CVode" or "Euler".
        record: variables to keep; by default inputs, states and outputs.
        quiet: show no progress bar.

    Returns:
        the variables, with the units that the FMU gives them.

    Raises:
        ModelError: the FMU is invalid or lacks the interface, or a name or a value does not fit.
        SolverError: the FMU refused a call; the message is its own.
    """
    import fmpy

    with tempfile.TemporaryDirectory(prefix="mbs-fmu-", ignore_cleanup_errors=True) as folder:
        _extract(Path(path), folder)
        description = _described(folder, Path(path))
        _check_kind(description, kind)
        begin, end = _span(description, duration)
        interval = _interval(description, end - begin, step)
        options: dict[str, Any] = {
            "validate": False,
            "start_time": begin,
            "stop_time": end,
            "output_interval": interval,
            "relative_tolerance": tolerance,
            "solver": solver,
            "fmi_type": kind,
            "start_values": _start_values(description, parameters or {}, start or {}),
            "input": _input_table(description, inputs or {}, begin, end, interval),
            "output": _recorded(description, record),
            "model_description": description,
        }
        answer = _simulated(fmpy.simulate_fmu, folder, options, quiet=quiet)
        _check_finite(answer, description.modelName)
        return Result.from_structured(answer, _units(description), description.modelName)


def _extract(path: Path, folder: str) -> None:
    import fmpy

    if not path.is_file():
        raise ModelError(f"{path} is not a file; give the path of an FMU")
    try:
        fmpy.extract(str(path), folder)
    except Exception as error:
        raise ModelError(f"{path} is not an FMU: {error}") from error


def _described(folder: str, path: Path) -> Any:
    import fmpy

    try:
        return fmpy.read_model_description(folder, validate=True)
    except Exception as error:
        problem = " ".join(str(error).split())
        raise ModelError(f"{path} is not a valid FMU: {problem}") from error


def _check_kind(description: Any, kind: str) -> None:
    offered = {
        "CoSimulation": description.coSimulation is not None,
        "ModelExchange": description.modelExchange is not None,
    }
    if not offered.get(kind, False):
        names = " or ".join(name for name, present in offered.items() if present)
        raise ModelError(f"FMU {description.modelName}: kind is {kind!r}; use {names}")


def _span(description: Any, duration: float | None) -> tuple[float, float]:
    experiment = description.defaultExperiment
    begin = float(getattr(experiment, "startTime", None) or 0.0)
    stop = getattr(experiment, "stopTime", None)
    proposed = begin + 1.0 if stop is None else float(stop)
    end = proposed if duration is None else begin + duration
    if not (end > begin and np.isfinite(end)):
        raise ModelError(f"duration {duration} s must be positive")
    return begin, end


def _interval(description: Any, duration: float, step: float | None) -> float:
    proposed = getattr(description.defaultExperiment, "stepSize", None)
    if step is None:
        step = float(proposed) if proposed else duration / _STEPS
    if not (step > 0 and np.isfinite(step)):
        raise ModelError(f"step {step} s must be positive")
    return min(step, duration)


def _start_values(
    description: Any, parameters: Mapping[str, float], start: Mapping[str, float]
) -> dict[str, float]:
    known = {v.name: v for v in description.modelVariables}
    fixed = {n for n, v in known.items() if v.causality == "parameter"}
    _check_names("parameters", parameters, fixed, known)
    _check_names("start", start, {n for n, v in known.items() if _settable(v)} - fixed, known)
    values = {**start, **parameters}
    for name, value in values.items():
        if not np.isfinite(value):
            raise ModelError(f"{name} = {value}: use a finite number")
    return values


def _settable(variable: Any) -> bool:
    """Whether fmpy passes a start value on; what it does not pass on it drops without a word."""
    if variable.variability == "constant" or variable.causality == "independent":
        return False
    return variable.causality == "input" or variable.initial in ("exact", "approx")


def _check_names(what: str, given: Iterable[str], allowed: set[str], known: Iterable[str]) -> None:
    everything = set(known)
    for name in given:
        if name in allowed:
            continue
        close = difflib.get_close_matches(name, sorted(allowed), n=3, cutoff=0.5)
        hint = f"did you mean {' or '.join(close)}?" if close else _listed(sorted(allowed))
        why = "cannot be set" if name in everything else "does not exist"
        raise ModelError(f"{what}: variable {name!r} {why} here; {hint}")


def _listed(names: Sequence[str]) -> str:
    if not names:
        return "the FMU has none"
    more = f" and {len(names) - 10} more" if len(names) > 10 else ""
    return f"use {', '.join(names[:10])}{more}"


def _input_table(
    description: Any, inputs: Mapping[str, Signal], begin: float, end: float, interval: float
) -> Any:
    """Inputs as one structured array, sampled wherever one of them has a point."""
    if not inputs:
        return None
    known = {v.name: v for v in description.modelVariables}
    allowed = {n for n, v in known.items() if v.causality == "input" and v.type in _REAL}
    _check_names("inputs", inputs, allowed, known)
    grid = np.array([begin, end])
    for name, signal in inputs.items():
        grid = np.union1d(grid, _points(name, signal, begin, end, interval))
    table = np.empty(len(grid), dtype=[("time", float), *((name, float) for name in inputs)])
    table["time"] = grid
    for name, signal in inputs.items():
        table[name] = _sampled(signal, grid)
        if not np.isfinite(table[name]).all():
            raise ModelError(f"input {name} has a value that is not finite; use numbers")
    return table


def _points(name: str, signal: Signal, begin: float, end: float, interval: float) -> Array:
    if callable(signal):
        return np.linspace(begin, end, max(2, round((end - begin) / interval) + 1))
    if isinstance(signal, tuple):
        times, values = np.asarray(signal[0], dtype=float), np.asarray(signal[1], dtype=float)
        if times.ndim != 1 or times.shape != values.shape or np.any(np.diff(times) <= 0):
            raise ModelError(f"input {name}: give as many values as increasing times")
        return times
    return np.array([begin, end])


def _sampled(signal: Signal, grid: Array) -> Array:
    if callable(signal):
        return np.array([signal(float(t)) for t in grid])
    if isinstance(signal, tuple):
        times, values = np.asarray(signal[0], dtype=float), np.asarray(signal[1], dtype=float)
        return np.asarray(np.interp(grid, times, values))
    return np.full(len(grid), float(signal))


def _recorded(description: Any, record: Sequence[str] | None) -> list[str]:
    variables = [
        v for v in description.modelVariables if v.type in _REAL and v.causality != "independent"
    ]
    if record is not None:
        names = {v.name for v in variables}
        _check_names("record", record, names, names)
        return list(record)
    states = {v.derivative.name for v in variables if v.derivative is not None}
    kept = [v for v in variables if v.causality in ("input", "output") or v.name in states]
    return [v.name for v in kept if not getattr(v, "dimensions", None)]


def _simulated(
    simulate: Callable[..., Any], folder: str, options: dict[str, Any], *, quiet: bool
) -> Any:
    messages: list[str] = []

    def listen(*arguments: Any) -> None:
        text = arguments[-1]
        message = text.decode("utf-8", "replace") if isinstance(text, bytes) else str(text)
        _LOG.debug(message)
        messages.append(message)

    name = options["model_description"].modelName
    with progress(name, options["start_time"], options["stop_time"], quiet=quiet) as reach:

        def advance(time: float, _recorder: Any) -> bool:
            reach(time)
            return True

        try:
            with _callback_errors() as lost:
                answer = simulate(folder, logger=listen, step_finished=advance, **options)
            if lost:
                raise lost[0]
        except Exception as error:
            said = "; ".join(dict.fromkeys(messages[-2:])) or str(error)
            raise SolverError(f"FMU {name} stopped: {said}") from error
    return answer


@contextmanager
def _callback_errors() -> Iterator[list[BaseException]]:
    """Errors raised where fmpy's solver calls back: Python drops them and the solver goes on."""
    lost: list[BaseException] = []
    before = sys.unraisablehook

    def keep(event: "sys.UnraisableHookArgs") -> None:
        if isinstance(event.exc_value, Exception) and "fmi" in type(event.exc_value).__module__:
            lost.append(event.exc_value)
        else:
            before(event)

    sys.unraisablehook = keep
    try:
        yield lost
    finally:
        sys.unraisablehook = before


def _check_finite(answer: Any, name: str) -> None:
    for column in answer.dtype.names:
        bad = ~np.isfinite(answer[column])
        if bad.any():
            when = answer["time"][int(np.argmax(bad))]
            raise SolverError(f"FMU {name}: {column} is not finite at time {when:g} s")


def _units(description: Any) -> dict[str, str]:
    units = {}
    for variable in description.modelVariables:
        declared = variable.declaredType
        unit = variable.unit or (declared.unit if declared is not None else None)
        units[variable.name] = unit or "1"
    return units
