"""Simulation of an FMU of any tool through the library FMPy."""

from __future__ import annotations

import ctypes
import logging
import math
import os
import tempfile
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Literal
from xml.etree import ElementTree

import numpy as np

from mbs.errors import Interrupted, MbsError, ModelError, SolverError
from mbs.files import check_archive
from mbs.progress import progress
from mbs.result import Result, State, state_of
from mbs.simulate.arguments import positive
from mbs.simulate.fmu_plan import (
    Inputs,
    Interface,
    Plan,
    Recording,
    Tracks,
    check_names,
    recording_of,
    require_equal_steps,
    row_times,
    set_up,
    start_values,
    tracks_of,
    with_points,
)
from mbs.simulate.fmu_variables import NUMBERS
from mbs.text import quoted

# Co-simulation of an FMU, which integrates by itself.
#
# An input that the FMU cannot follow during a step is held at its value in the middle of the
# step, which is accurate to second order. It is set to its current value before a row is recorded.


_DISCARD = 2
_MOST_ITERATIONS = 1000


@dataclass(frozen=True, slots=True)
class Reached:
    """End of a step.

    Attributes:
        time: time at the end of the step [s].
        event: Whether an event occurred at this time.
        terminated: Whether the FMU requests the end of the simulation.
    """

    time: float
    event: bool = False
    terminated: bool = False


@dataclass(slots=True)
class Intermediate:
    """Callback of an FMU of FMI 3.0 between communication points (intermediate update).

    Attributes:
        apply: callable (time, after) that sets the continuous inputs; `after` selects the value
            after a jump.
        look: callable (time) at the end of each internal solver step.
        lost: errors raised in the callback, which C code cannot propagate.
    """

    apply: Callable[[float, bool], None] | None = None
    look: Callable[[float], None] | None = None
    lost: list[Exception] = field(default_factory=list)

    def __call__(
        self, _: Any, time: float, settable: bool, gettable: bool, finished: bool, *rest: Any
    ) -> None:
        """Call with the arguments of fmi3IntermediateUpdateCallback."""
        try:
            if settable and self.apply is not None:
                self.apply(time, False)
            if gettable and finished and self.look is not None:
                self.look(time)
        except Exception as error:
            self.lost.append(error)


def co_simulate(instance: Any, plan: Plan, recording: Recording, watch: Intermediate) -> None:
    """Run an instance from begin to end; rows and events go to the recording.

    Args:
        instance: instantiated FMPy object of the FMU.
        plan: settings of the simulation.
        recording: recording to which rows and events are added.
        watch: intermediate update callback of the instance.

    Raises:
        ModelError: the FMU requires a fixed step size, and it does not divide the duration.
        SolverError: a value is not finite, or an event does not end.
    """
    offered = plan.description.coSimulation
    where = f"FMU {plan.description.modelName}"
    flexible = offered.canHandleVariableCommunicationStepSize
    if not flexible:
        require_equal_steps(plan, where)
    points = with_points(plan.times, plan.tracks.corners if flexible else ())
    set_up(instance, plan)
    if plan.newer:
        _newer(instance, plan, points, (recording, watch))
    else:
        _older(instance, plan, points, recording)
    instance.terminate()


def _older(instance: Any, plan: Plan, points: dict[float, bool], recording: Recording) -> None:
    """Run FMI 2.0: set inputs, with slopes if the FMU interpolates, then step."""
    apply = plan.tracks.setter(instance)
    held = not plan.description.coSimulation.canInterpolateInputs
    recording.begin(plan.begin)
    for begin, end in pairwise(points):
        apply((begin + end) / 2 if held else begin, True)
        if plan.tracks.variables and not held:
            references, slopes = plan.tracks.slopes(begin, end)
            instance.setRealInputDerivatives(references, [1] * len(references), slopes)
        reached = _step_older(instance, begin, end)
        if held:
            apply(reached.time, False)
        if points[end] or reached.terminated:
            recording.row(reached.time)
        recording.record_event(reached.time)
        if reached.terminated:
            return recording.ended(reached.time)
    return None


def _step_older(instance: Any, begin: float, end: float) -> Reached:
    from fmpy.fmi1 import FMICallException
    from fmpy.fmi2 import fmi2LastSuccessfulTime, fmi2Terminated

    try:
        instance.doStep(currentCommunicationPoint=begin, communicationStepSize=end - begin)
    except FMICallException as error:
        if error.status != _DISCARD or not instance.getBooleanStatus(fmi2Terminated):
            raise
        return Reached(float(instance.getRealStatus(fmi2LastSuccessfulTime)), terminated=True)
    return Reached(end)


def _newer(
    instance: Any, plan: Plan, points: dict[float, bool], kept: tuple[Recording, Intermediate]
) -> None:
    """Run FMI 3.0: step to the next point or event, and process events in event mode."""
    offered, (recording, watch) = plan.description.coSimulation, kept
    continuous = plan.tracks.continuous() if offered.hasEventMode else plan.tracks
    run = _Newer(instance, plan, recording, watch, continuous.setter(instance))
    watch.apply = plan.tracks.continuous().setter(instance)
    watch.look = recording.row if plan.rows == "solver" else None
    following = run.update() if offered.hasEventMode else math.inf
    recording.begin(plan.begin)
    time = plan.begin
    for end, row in list(points.items())[1:]:
        run.apply((time + end) / 2, True)
        tries = 0
        while time < end:
            reached = run.step(time, min(end, following))
            tries = tries + 1 if reached.time == time else 0
            if tries > _MOST_ITERATIONS:
                raise SolverError(f"FMU {recording.name} does not get beyond time {time:.9g} s")
            time = reached.time
            if time == end:
                run.apply(end, False)
            happens = offered.hasEventMode and (
                reached.event or time >= following or time in plan.tracks.jumps
            )
            if happens or reached.terminated or (row and time == end):
                recording.row(time)
            if reached.terminated:
                return recording.ended(time)
            if happens:
                unsaid = reached.event or time >= following
                following = run.event(time, jumped=time == end, otherwise=["event"] * unsaid)
            else:
                recording.record_event(time)
    return None


@dataclass(frozen=True, slots=True)
class _Newer:
    """Calls of FMI 3.0 for co-simulation."""

    instance: Any
    plan: Plan
    recording: Recording
    watch: Intermediate
    apply: Callable[[float, bool], None]

    def step(self, begin: float, end: float) -> Reached:
        """Make a step, and return its end."""
        event, terminated, early, last = self.instance.doStep(
            currentCommunicationPoint=begin, communicationStepSize=end - begin
        )
        if self.watch.lost:
            raise self.watch.lost[0]
        time = float(last) if early and last < end else end
        return Reached(time, bool(event), bool(terminated))

    def event(self, time: float, *, jumped: bool, otherwise: list[str]) -> float:
        """Process an event, and return the time of the next time event [s], or inf."""
        self.instance.enterEventMode()
        if jumped:
            self.plan.tracks.setter(self.instance)(time, True)
        following = self.update()
        self.recording.row(time)
        self.recording.record_event(time, [(self.recording.name, words) for words in otherwise])
        return following

    def update(self) -> float:
        """Iterate an event to convergence, and return to step mode."""
        for _ in range(_MOST_ITERATIONS):
            again, terminated, _, _, known, next_time = self.instance.updateDiscreteStates()
            if terminated:
                raise SolverError(f"FMU {self.recording.name} asks for the end at an event")
            if not again:
                self.instance.enterStepMode()
                return float(next_time) if known else math.inf
        raise SolverError(f"FMU {self.recording.name}: an event does not come to an end")


# Model exchange of an FMU: an integrator of FMPy makes the steps and locates the events.


_MOST_STEPS = 100_000  # maximum number of integrator steps per output interval


def exchange(instance: Any, plan: Plan, recording: Recording) -> None:
    """Run an instance from begin to end; rows and events go to the recording.

    Args:
        instance: instantiated FMPy object of the FMU.
        plan: settings of the simulation.
        recording: recording to which rows and events are added.

    Raises:
        SolverError: the integration fails, a value is not finite, or an event does not end.
    """
    set_up(instance, plan)
    run = _Exchange(instance, plan, recording, _Clock(instance, plan))
    following, ended = run.update()
    recording.begin(plan.begin)
    if not ended:
        _steps(run, following)
    instance.terminate()


def _steps(run: _Exchange, following: float) -> None:
    """Integrate to the end, and stop at rows, events and jumps of inputs."""
    plan, recording = run.plan, run.recording
    jumps = plan.tracks.jumps
    integrator = _integrator(run)
    time = plan.begin
    for end, row in list(with_points(plan.times, jumps).items())[1:]:
        while time < end:
            until = min(end, following)
            fired, time = integrator.step(time, until)
            run.clock.move(time)
            wanted, ended = run.completed()
            happens = bool(fired) or wanted or time >= following or time in jumps
            if happens or ended or (row and time == end):
                recording.row(time)
            if happens and not ended:
                following, ended = run.event(time, fired)
                integrator.solver.reset(time)
            if ended:
                return recording.ended(time)
    return None


class _Clock:
    """Setter of the time of an instance and of its inputs at this time."""

    def __init__(self, instance: Any, plan: Plan) -> None:
        self._instance = instance
        self._all, self._smooth = plan.tracks.setter(instance), _setter(plan.tracks, instance)
        self._after = plan.begin

    def move(self, time: float) -> None:
        """Set the time and continuous inputs, before a jump at this time unless it was made."""
        self._instance.setTime(time)
        self._smooth(time, time <= self._after)

    def jump(self, time: float) -> None:
        """Set all inputs to their values after the jumps at this time."""
        self._after = time
        self._all(time, True)


def _setter(tracks: Tracks, instance: Any) -> Callable[[float, bool], None]:
    return tracks.continuous().setter(instance)


@dataclass(frozen=True, slots=True)
class _Exchange:
    """Calls of FMI 2.0 and 3.0 for model exchange."""

    instance: Any
    plan: Plan
    recording: Recording
    clock: _Clock

    def completed(self) -> tuple[bool, bool]:
        """Complete a step; return whether the FMU requests an event, and the end."""
        if not self.plan.description.modelExchange.needsCompletedIntegratorStep:
            return False, False
        wanted, ended = self.instance.completedIntegratorStep()
        return bool(wanted), bool(ended)

    def event(self, time: float, fired: list[int]) -> tuple[float, bool]:
        """Process an event; return the time of the next time event [s], and whether to end."""
        self.instance.enterEventMode()
        self.clock.jump(time)
        following, ended = self.update()
        self.recording.row(time)
        self.recording.record_event(time, self._told(time, fired))
        return following, ended

    def update(self) -> tuple[float, bool]:
        """Iterate an event to convergence, and return to continuous-time mode."""
        newer = self.plan.newer
        update = self.instance.updateDiscreteStates if newer else self.instance.newDiscreteStates
        for _ in range(_MOST_ITERATIONS):
            again, ended, _, _, known, next_time = update()
            if ended:
                return math.inf, True
            if not again:
                self.instance.enterContinuousTimeMode()
                return (float(next_time) if known else math.inf), False
        raise SolverError(f"FMU {self.recording.name}: an event does not come to an end")

    def _told(self, time: float, fired: list[int]) -> Iterator[tuple[str, str]]:
        """Yield name and text of an event for the case that no discrete variable changes."""
        names = [unknown.variable.name for unknown in self.plan.description.eventIndicators]
        for k in fired:
            name = names[k] if k < len(names) else self.recording.name
            yield name, "state event"
        if not fired and time not in self.plan.tracks.jumps:
            yield self.recording.name, "event"


@dataclass(slots=True)
class _Steps:
    """Integrator of FMPy.

    Attributes:
        solver: FMPy solver object.
        bounded: callable that sets the stop time of the solver [s].
        lost: errors of the FMU in callbacks of the solver.
    """

    solver: Any
    bounded: Callable[[float], None]
    lost: list[Exception]

    def step(self, time: float, until: float) -> tuple[list[int], float]:
        """Make a step; return the indices of indicators that changed sign, and the time [s]."""
        try:
            self.bounded(until)
            _, roots, reached = self.solver.step(time, until)
        except Exception as error:
            raise (self.lost[0] if self.lost else error) from error
        self.lost.clear()  # the solver has repeated discarded evaluations
        reached = float(reached)
        # relative tolerance 1e-14: some rounding errors of the time `until`
        near = abs(reached - until) <= 1e-14 * max(1.0, abs(until))
        return np.flatnonzero(roots).tolist(), until if near else reached


def _integrator(run: _Exchange) -> _Steps:
    instance, plan, lost = run.instance, run.plan, list[Exception]()
    newer = plan.newer
    rates = instance.getContinuousStateDerivatives if newer else instance.getDerivatives
    common: dict[str, Any] = {
        "nx": plan.description.numberOfContinuousStates,
        "nz": plan.description.numberOfEventIndicators,
        "get_x": instance.getContinuousStates,
        "set_x": instance.setContinuousStates,
        "get_dx": rates,
        "get_z": instance.getEventIndicators,
        "input": SimpleNamespace(apply=lambda time: None),
    }
    if plan.solver == "Euler":
        from fmpy.simulation import ForwardEuler

        return _Steps(ForwardEuler(**common), lambda until: None, lost)
    return _cvode(run, common, lost)


def _cvode(run: _Exchange, common: dict[str, Any], lost: list[Exception]) -> _Steps:
    from fmpy.sundials import CVodeSolver

    class Solver(CVodeSolver):  # type: ignore[misc]
        """CVODE that stores errors of the FMU and repeats steps that the FMU discards."""

        def f(self, *arguments: Any) -> int:
            return _keep(super().f, arguments, lost)

        def g(self, *arguments: Any) -> int:
            return _keep(super().g, arguments, lost)

    plan = run.plan
    solver = Solver(
        **common,
        get_nominals=run.instance.getNominalsOfContinuousStates,
        set_time=run.clock.move,
        startTime=plan.begin,
        maxStep=max(np.diff(plan.times), default=math.inf),
        relativeTolerance=plan.tolerance,
        maxNumSteps=_MOST_STEPS,
    )
    _quiet(solver)
    return _Steps(solver, lambda until: _stop_at(solver, until), lost)


def _keep(call: Callable[..., int], arguments: tuple[Any, ...], lost: list[Exception]) -> int:
    """Return the status for CVODE: 0 success, 1 shorter step, -1 unrecoverable error."""
    try:
        return call(*arguments)
    except Exception as error:
        lost.append(error)
        return 1 if getattr(error, "status", None) == _DISCARD else -1


def _quiet(solver: Any) -> None:
    """Send error messages of CVODE to the solver object only, not to the terminal."""
    from ctypes import c_void_p

    from fmpy.sundials.libraries import sundials_core
    from fmpy.sundials.sundials_context import SUNContext_PushErrHandler

    clear = sundials_core.SUNContext_ClearErrHandlers
    clear.argtypes = [c_void_p]
    clear(solver.sunctx)
    SUNContext_PushErrHandler(solver.sunctx, solver.ehfun_, None)


def _stop_at(solver: Any, until: float) -> None:
    from ctypes import c_double, c_void_p

    from fmpy.sundials.libraries import sundials_cvode

    stop = sundials_cvode.CVodeSetStopTime
    stop.argtypes = [c_void_p, c_double]
    stop(solver.cvode_mem, until)


# Messages of FMUs, each passed to the simulation that runs in the same thread.
#
# FMPy stores a single logger per process in a C library and holds no reference to its Python
# function. The logger here is therefore a function that is never freed.


Listener = Callable[[int, str], None]
"""Callable with the status and the text of a message."""

_LISTENERS: dict[int, Listener] = {}  # listeners by thread identifier
_LOCK, _LOADING = threading.Lock(), threading.Lock()


@contextmanager
def listening(listener: Listener) -> Iterator[None]:
    """Pass messages of FMUs in this thread to `listener` within the context."""
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
    """Instantiate an FMU of FMI 2.0 or 3.0, and free the instance at the end of the context.

    Args:
        description: model description.
        folder: folder of the extracted FMU.
        kind: "CoSimulation" or "ModelExchange".
        watch: intermediate update callback, used if the FMU supports it (FMI 3.0).
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
    # FMUs of other tools would log every call
    says_why = str(description.generationTool).startswith("mbs")
    if newer:
        offers = _offer(interface, watch) if stepped else {}
        fmu.instantiate(loggingOn=says_why, logMessage=_log_newer, **offers)
    else:
        fmu.instantiate(callbacks=_callbacks(), loggingOn=says_why)
    try:
        yield fmu
    finally:
        fmu.freeInstance()


@contextmanager
def _kept_directory() -> Iterator[None]:
    """Restore the working directory, which FMPy changes on loading; one thread at a time."""
    with _LOADING:
        before = os.getcwd()
        try:
            yield
        finally:
            os.chdir(before)


def _offer(interface: Any, watch: Callable[..., None]) -> dict[str, Any]:
    """Return the host capabilities for the instantiation of an FMI 3.0 co-simulation."""
    events = bool(interface.hasEventMode)
    found: dict[str, Any] = {"eventModeUsed": events, "earlyReturnAllowed": events}
    if interface.providesIntermediateUpdate:
        found["intermediateUpdate"] = watch
    return found


@lru_cache(maxsize=1)
def _functions() -> tuple[Any, Any, Any]:
    """Return the C callbacks for messages and memory, made once and never freed."""
    from fmpy import fmi2

    return (
        fmi2.fmi2CallbackLoggerTYPE(_log),
        fmi2.fmi2CallbackAllocateMemoryTYPE(fmi2.calloc),
        fmi2.fmi2CallbackFreeMemoryTYPE(fmi2.free),
    )


def _callbacks() -> Any:
    """Return the C callbacks of an FMI 2.0 instance.

    The logger proxy of FMPy holds only the last logger, which other users of FMPy may have freed.
    The logger is therefore set again for every instance.
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
    """Pass on a message of FMI 3.0, which needs no logger proxy."""
    from fmpy import fmi3

    listener = _LISTENERS.get(threading.get_ident())
    if listener is None:
        fmi3.printLogMessage(environment, status, category, message)
    else:
        listener(status, message.decode("utf-8", "replace"))


_LOG = logging.getLogger(__name__)
_SOLVERS = ("CVode", "Euler")
_ROWS = ("step", "solver")
_STEPS = 500
_UNUSED = ("sources/", "documentation/")
_OK = 0  # status of messages without warning or error, in all FMI versions


def fmu(
    path: str | os.PathLike[str],
    duration: float | None = None,
    *,
    inputs: Inputs | None = None,
    parameters: Mapping[str, float] | None = None,
    start: Mapping[str, float] | State | None = None,
    kind: Interface = "CoSimulation",
    step: float | None = None,
    tolerance: float = 1e-8,
    solver: str = "CVode",
    record: Sequence[str] | None = None,
    rows: Literal["step", "solver"] = "step",
    quiet: bool = False,
) -> Result:
    """Simulate an FMU, and return its inputs, states, outputs and events over time.

    Model exchange evaluates inputs at the current time. In co-simulation, an FMU 2.0 that
    interpolates inputs uses their mean slope over each step, which is exact for straight lines.
    Other FMUs hold the value in the middle of the step. Both are accurate to second order. If the
    FMU supports variable step sizes, steps end at the kinks and jumps of input tables.

    Events are changes of discrete variables. Model exchange, and co-simulation of FMI 3.0 with
    event mode, record an event at its time, with a row before and a row after it; events without
    change of a discrete variable are recorded too. Otherwise an event is at the end of its step.

    Args:
        path: path of an FMU of FMI 2.0 or 3.0.
        duration: duration [s]. By default up to the stop time in the FMU, or 1 s if it has none.
        inputs: dict from input to a number, a function of time, or (times, values) with linear
            interpolation and a jump at a repeated time. Or a `Result`, whose columns are the
            values of the inputs with the same names.
        parameters: dict from parameter to value.
        start: dict from state, input or other variable with a start value to its initial value;
            positions also by their names in `run`, such as "j1" for "j1.q". Or a `State` of the
            mechanism from which the FMU was exported.
        kind: interface, "CoSimulation" (with the solver in the FMU) or "ModelExchange".
        step: communication step and time between rows [s]. The default is the step size in the
            FMU, or 1/500 of the duration. The last step is shorter if the steps do not divide the
            duration.
        tolerance: relative tolerance.
        solver: solver of model exchange, "CVode" or "Euler".
        record: names of numeric variables to record; by default inputs, states and outputs.
        rows: "step" for a row per step; "solver" adds a row at every internal solver step, if an
            FMU 3.0 reports these steps.
        quiet: Whether to hide the progress bar.

    Returns:
        Result with the variables in the units of the FMU. Its `events` contain the time, the name
        of the variable and a description.

    Raises:
        ModelError: the FMU is invalid or lacks the interface, or a name or a value is invalid.
        SolverError: a call of the FMU failed. The message is that of the FMU; `result` contains
            the rows that were reached.
        Interrupted: control-C was pressed. It is a KeyboardInterrupt; `result` contains the rows
            that were reached.
    """
    file = _path(path)
    start = state_of(start)
    for what, values in (("parameters", parameters), ("start", start)):
        if not isinstance(values, Mapping | None) and not (
            what == "start" and isinstance(values, State)
        ):
            raise ModelError(f"{what} is {quoted(values)}; give a dict of names to values")
    if not isinstance(inputs, Mapping | Result | None):
        raise ModelError(f"inputs is {quoted(inputs)}; give a dict of names to values, or a Result")
    with tempfile.TemporaryDirectory(prefix="mbs-fmu-", ignore_cleanup_errors=True) as folder:
        _extract(file, folder)
        description = _describe(folder, file)
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
        return _simulate(folder, plan, _record(folder, plan, record), quiet=quiet)


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


def _describe(folder: str, path: Path) -> Any:
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
    """Return start time and duration [s]."""
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
    """Return the names of the variables that can be read between communication points.

    Raises:
        ModelError: the FMU does not report the steps of its solver.
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


def _record(folder: str, plan: Plan, record: Sequence[str] | None) -> list[Any]:
    """Return the variables to record."""
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


def _simulate(folder: str, plan: Plan, variables: list[Any], *, quiet: bool) -> Result:
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
            with listening(listen), instance(plan.description, folder, plan.kind, watch) as unit:
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
