"""Simulation of an FMU, ours or anyone's, through the libraries of fmpy."""

import logging
import os
import tempfile
from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal
from xml.etree import ElementTree

from mbs.archives import check_archive
from mbs.errors import Interrupted, MbsError, ModelError, SolverError
from mbs.messages import quoted
from mbs.progress import progress
from mbs.result import Result
from mbs.simulate.arguments import positive
from mbs.simulate.co_simulation import Intermediate, co_simulate
from mbs.simulate.fmu_inputs import Inputs, tracks_of
from mbs.simulate.fmu_instance import heard, instance
from mbs.simulate.fmu_plan import Interface, Plan, row_times
from mbs.simulate.fmu_recording import Recording, recording_of
from mbs.simulate.fmu_variables import NUMBERS
from mbs.simulate.model_exchange import exchange
from mbs.simulate.signals import check_names, start_values

_LOG = logging.getLogger(__name__)
_SOLVERS = ("CVode", "Euler")
_ROWS = ("step", "solver")
_STEPS = 500
_UNUSED = ("sources/", "documentation/")
_OK = 0  # status of messages that are no complaint, in every version of FMI


def fmu(
    path: str | os.PathLike[str],
    duration: float | None = None,
    *,
    inputs: Inputs | None = None,
    parameters: Mapping[str, float] | None = None,
    start: Mapping[str, float] | None = None,
    kind: Interface = "CoSimulation",
    step: float | None = None,
    tolerance: float = 1e-8,
    solver: str = "CVode",
    record: Sequence[str] | None = None,
    rows: Literal["step", "solver"] = "step",
    quiet: bool = False,
) -> Result:
    """Inputs, states and outputs of an FMU over time, and the events.

    In model exchange inputs are given at the time at which they are needed. In co-simulation an FMU
    2.0 that interpolates inputs follows their mean slope over each step, so that straight lines are
    exact; another one holds their value in the middle of the step. Either is right to second order.
    Steps end where a table bends or jumps, if the FMU takes steps of any length.

    Events are changes of discrete variables. In model exchange and in co-simulation of FMI 3.0 with
    event mode they are at their time, with a row before and one after, and an event that changes
    no discrete variable is told too; else they are at the end of the step.

    Args:
        path: the FMU, of FMI 2.0 or 3.0.
        duration: s; by default until the stop time that the FMU proposes, else 1 s.
        inputs: input to a number, to a function of time, or to (times, values) with straight
            lines between them and a jump where a time is repeated; or a `Result`, whose columns
            feed the inputs of the same names.
        parameters: parameter to its value.
        start: state, input or other variable with a start value, to its value at the start.
        kind: the interface that is used; the FMU brings the solver for co-simulation.
        step: communication step and distance of the rows, s; by default the one that the FMU
            proposes, else a 500th of the duration. The last one is shorter where steps do not
            divide the duration.
        tolerance: relative tolerance.
        solver: for model exchange: "CVode" or "Euler".
        record: variables to keep, of any type of numbers; by default inputs, states and outputs.
        rows: "solver" adds a row at every step of the solver inside, where an FMU 3.0 tells them.
        quiet: show no progress bar.

    Returns:
        the variables, with the units that the FMU gives them; `events` with time, name of the
        variable and words.

    Raises:
        ModelError: the FMU is invalid or lacks the interface, or a name or a value does not fit.
        SolverError: the FMU refused a call; the message is its own, `result` has what was reached.
        Interrupted: control-C was pressed; a KeyboardInterrupt whose `result` has what was reached.
    """
    file = _path(path)
    for what, values in (("parameters", parameters), ("start", start)):
        if not isinstance(values, Mapping | None):
            raise ModelError(f"{what} is {quoted(values)}; give a dict of names to values")
    if not isinstance(inputs, Mapping | Result | None):
        raise ModelError(f"inputs is {quoted(inputs)}; give a dict of names to values, or a Result")
    with tempfile.TemporaryDirectory(prefix="mbs-fmu-", ignore_cleanup_errors=True) as folder:
        _extract(file, folder)
        description = _described(folder, file)
        where = f"FMU {description.modelName}"
        _check_kind(description, kind)
        begin, span = _span(description, duration, where)
        starts = start_values(description, parameters or {}, start or {})
        plan = Plan(
            description=description,
            kind=kind,
            times=row_times(begin, span, _interval(description, span, step, where), where),
            tracks=tracks_of(description, inputs or {}, starts),
            starts=starts,
            tolerance=positive(tolerance, "tolerance", where),
            solver=_one_of(solver, _SOLVERS, "solver", where),
            rows=_one_of(rows, _ROWS, "rows", where),
        )
        return _simulated(folder, plan, _recorded(folder, plan, record), quiet=quiet)


def _path(path: object) -> Path:
    if not isinstance(path, (str, os.PathLike)):
        raise ModelError(
            f"{quoted(path)} is not the path of an FMU; write one by mbs.export.fmu, or simulate a"
            " System by mbs.simulate.run"
        )
    return Path(path).resolve()


def _one_of(value: object, known: tuple[str, ...], what: str, where: str) -> str:
    if value not in known:
        raise ModelError(f"{where}: {what} is {quoted(value)}; use {' or '.join(known)}")
    return str(value)


def _extract(path: Path, folder: str) -> None:
    import fmpy

    if not path.is_file():
        raise ModelError(f"{path} is not a file; give the path of an FMU")
    try:
        check_archive(path)
        fmpy.extract(str(path), folder, include=lambda name: not name.startswith(_UNUSED))
    except Exception as error:
        raise ModelError(f"{path} is not an FMU: {error}") from error


def _described(folder: str, path: Path) -> Any:
    import fmpy

    try:
        version = ElementTree.parse(f"{folder}/modelDescription.xml").getroot().get("fmiVersion")
        if str(version)[:2] not in ("2.", "3."):
            raise ModelError(f"{path} is of FMI {version}; export it as FMI 2.0 or 3.0")
        return fmpy.read_model_description(folder, validate=True)
    except MbsError:
        raise
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
    """Start and duration [s]."""
    experiment = description.defaultExperiment
    begin = float(getattr(experiment, "startTime", None) or 0.0)
    stop = getattr(experiment, "stopTime", None)
    if duration is None:
        duration = 1.0 if stop is None else float(stop) - begin
    return begin, positive(duration, "duration [s]", where)


def _interval(description: Any, duration: float, step: float | None, where: str) -> float:
    proposed = getattr(description.defaultExperiment, "stepSize", None)
    if step is None:
        step = float(proposed) if proposed else duration / _STEPS
    return min(positive(step, "step [s]", where), duration)


def _between_steps(folder: str, plan: Plan) -> set[str]:
    """Names of the variables that have a value between communication points.

    Raises:
        ModelError: the FMU does not tell the steps of its solver.
    """
    root = ElementTree.parse(f"{folder}/modelDescription.xml").getroot()
    found = {str(v.get("name")) for v in root.iter() if v.get("intermediateUpdate") == "true"}
    offered = plan.description.coSimulation
    if plan.kind != "CoSimulation" or not offered.providesIntermediateUpdate or not found:
        raise ModelError(
            f"FMU {plan.description.modelName}: rows is 'solver', but the FMU does not tell the"
            " steps of its solver; leave rows out"
        )
    return found


def _recorded(folder: str, plan: Plan, record: Sequence[str] | None) -> list[Any]:
    """The variables to keep."""
    described = plan.description
    known = {
        v.name: v
        for v in described.modelVariables
        if v.type in NUMBERS and v.causality != "independent"
    }
    if plan.rows == "solver":
        between = _between_steps(folder, plan)
        known = {name: v for name, v in known.items() if name in between}
    if record is not None:
        if isinstance(record, str) or not isinstance(record, Iterable):
            raise ModelError(f"record is {quoted(record)}; give a list of names")
        check_names("record", record, set(known), (v.name for v in described.modelVariables))
        return [known[name] for name in dict.fromkeys(record)]
    states = {v.derivative.name for v in known.values() if v.derivative is not None}
    return [v for v in known.values() if v.causality in ("input", "output") or v.name in states]


def _simulated(folder: str, plan: Plan, variables: list[Any], *, quiet: bool) -> Result:
    messages: deque[str] = deque(maxlen=2)

    def listen(status: int, message: str) -> None:
        _LOG.debug(message)
        if status != _OK:
            messages.append(message)

    name, watch = plan.description.modelName, Intermediate()
    recording: Recording | None = None
    stop: SolverError | Interrupted | None = None
    with progress(name, plan.begin, plan.end, quiet=quiet) as reached:
        try:
            with heard(listen), instance(plan.description, folder, plan.kind, watch) as unit:
                recording = recording_of(unit, plan.description, variables, reached)
                if plan.kind == "CoSimulation":
                    co_simulate(unit, plan, recording, watch)
                else:
                    exchange(unit, plan, recording)
        except SolverError as error:
            stop = error
        except MbsError:
            raise
        except KeyboardInterrupt as error:
            stop = Interrupted(f"FMU {name} was interrupted")
            stop.__cause__ = error
        except Exception as error:
            said = "; ".join(dict.fromkeys(messages)) or str(error)
            stop = SolverError(f"FMU {name} stopped: {said}")
            stop.__cause__ = error
    if stop is not None:
        if recording is not None and recording.times:
            stop.time = recording.times[-1]
            stop.result = recording.result((stop.time, str(stop)))
        raise stop
    assert recording is not None
    return recording.result()
