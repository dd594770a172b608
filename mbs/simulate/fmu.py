"""Simulation of an FMU, ours or anyone's, by fmpy."""

import logging
import os
import tempfile
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np

from mbs.errors import ModelError, SolverError
from mbs.messages import quoted
from mbs.result import Result
from mbs.simulate.arguments import count_steps, positive
from mbs.simulate.callbacks import callback_errors
from mbs.simulate.fmu_instance import heard, instance
from mbs.simulate.progress import progress
from mbs.simulate.signals import REAL, Signal, check_names, input_table, start_values

Interface = Literal["CoSimulation", "ModelExchange"]

_LOG = logging.getLogger(__name__)
_SOLVERS = ("CVode", "Euler")
_STEPS = 500
_OK = 0  # status of messages that are no complaint, in every version of FMI


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

    file = _path(path)
    for what, values in (("inputs", inputs), ("parameters", parameters), ("start", start)):
        if not isinstance(values, Mapping | None):
            raise ModelError(f"{what} is {quoted(values)}; give a dict of names to values")
    with tempfile.TemporaryDirectory(prefix="mbs-fmu-", ignore_cleanup_errors=True) as folder:
        _extract(file, folder)
        description = _described(folder, file)
        where = f"FMU {description.modelName}"
        _check_kind(description, kind)
        begin, end = _span(description, duration, where)
        interval = _interval(description, end - begin, step, where)
        starts = start_values(description, parameters or {}, start or {})
        options: dict[str, Any] = {
            "validate": False,
            "start_time": begin,
            "stop_time": end,
            "output_interval": interval,
            "relative_tolerance": positive(tolerance, "tolerance", where),
            "solver": _solver(solver, where),
            "fmi_type": kind,
            "start_values": starts,
            "input": input_table(description, inputs or {}, starts, (begin, end), interval),
            "output": _recorded(description, record),
            "model_description": description,
        }
        answer = _simulated(fmpy.simulate_fmu, folder, options, quiet=quiet)
        _check_finite(answer, description.modelName)
        return Result.from_structured(answer, _units(description), description.modelName)


def _path(path: object) -> Path:
    if not isinstance(path, (str, os.PathLike)):
        raise ModelError(
            f"{quoted(path)} is not the path of an FMU; write one by mbs.export.fmu, or simulate a"
            " System by mbs.simulate.run"
        )
    return Path(path).resolve()


def _solver(solver: object, where: str) -> str:
    if solver not in _SOLVERS:
        raise ModelError(f"{where}: solver is {quoted(solver)}; use {' or '.join(_SOLVERS)}")
    return str(solver)


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


def _span(description: Any, duration: float | None, where: str) -> tuple[float, float]:
    experiment = description.defaultExperiment
    begin = float(getattr(experiment, "startTime", None) or 0.0)
    stop = getattr(experiment, "stopTime", None)
    if duration is None:
        duration = 1.0 if stop is None else float(stop) - begin
    return begin, begin + positive(duration, "duration [s]", where)


def _interval(description: Any, duration: float, step: float | None, where: str) -> float:
    proposed = getattr(description.defaultExperiment, "stepSize", None)
    if step is None:
        step = float(proposed) if proposed else duration / _STEPS
    interval = min(positive(step, "step [s]", where), duration)
    count_steps(duration, interval, where)
    return interval


def _recorded(description: Any, record: Sequence[str] | None) -> list[str]:
    variables = [
        v for v in description.modelVariables if v.type in REAL and v.causality != "independent"
    ]
    if record is not None:
        if isinstance(record, str) or not isinstance(record, Iterable):
            raise ModelError(f"record is {quoted(record)}; give a list of names")
        names = {v.name for v in variables}
        check_names("record", record, names, names)
        return list(record)
    states = {v.derivative.name for v in variables if v.derivative is not None}
    kept = [v for v in variables if v.causality in ("input", "output") or v.name in states]
    return [v.name for v in kept if not getattr(v, "dimensions", None)]


def _simulated(
    simulate: Callable[..., Any], folder: str, options: dict[str, Any], *, quiet: bool
) -> Any:
    messages: deque[str] = deque(maxlen=2)

    def listen(status: int, message: str) -> None:
        _LOG.debug(message)
        if status != _OK:
            messages.append(message)

    name = options["model_description"].modelName
    with progress(name, options["start_time"], options["stop_time"], quiet=quiet) as reach:

        def advance(time: float, _recorder: Any) -> bool:
            reach(time)
            return True

        try:
            with heard(listen), callback_errors() as lost:
                answer = _run(simulate, folder, options | {"step_finished": advance})
            if lost:
                raise lost[0]
        except Exception as error:
            said = "; ".join(dict.fromkeys(messages)) or str(error)
            raise SolverError(f"FMU {name} stopped: {said}") from error
    return answer


def _run(simulate: Callable[..., Any], folder: str, options: dict[str, Any]) -> Any:
    description = options["model_description"]
    if description.fmiVersion[0] not in "23":
        return simulate(folder, **options)
    with instance(description, folder, options["fmi_type"]) as fmu:
        return simulate(folder, fmu_instance=fmu, **options)


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
