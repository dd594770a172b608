"""Simulation of an FMU, ours or anyone's, through the libraries of fmpy."""

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

# Co-simulation of one FMU: it makes the steps.
#
# An input that the FMU cannot follow during a step is held at its value in the middle of the
# step, which is right to second order, and has its own value again where a row is kept.


_DISCARD = 2
_MOST_ITERATIONS = 1000


@dataclass(frozen=True, slots=True)
class Reached:
    """How a step ended.

    Attributes:
        time: where [s].
        event: something happened there.
        terminated: the FMU asks for the end.
    """

    time: float
    event: bool = False
    terminated: bool = False


@dataclass(slots=True)
class Intermediate:
    """What an FMU of FMI 3.0 is told between communication points.

    Attributes:
        apply: sets the continuous inputs at (time, after).
        look: called at the end of each step of the solver inside.
        lost: errors, which C cannot pass on.
    """

    apply: Callable[[float, bool], None] | None = None
    look: Callable[[float], None] | None = None
    lost: list[Exception] = field(default_factory=list)

    def __call__(
        self, _: Any, time: float, settable: bool, gettable: bool, finished: bool, *rest: Any
    ) -> None:
        """As the standard calls it."""
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
        instance: of the FMU, an object of fmpy, instantiated.
        plan: the run.
        recording: that is filled.
        watch: what the instance calls between communication points.

    Raises:
        ModelError: the steps do not divide the duration, which the FMU needs.
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
    """FMI 2.0: inputs with their slopes where the FMU interpolates, then the step."""
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
    """FMI 3.0: steps up to a point or an event, where the FMU is in event mode."""
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
    """Calls of FMI 3.0."""

    instance: Any
    plan: Plan
    recording: Recording
    watch: Intermediate
    apply: Callable[[float, bool], None]

    def step(self, begin: float, end: float) -> Reached:
        """One step, and how it ended."""
        event, terminated, early, last = self.instance.doStep(
            currentCommunicationPoint=begin, communicationStepSize=end - begin
        )
        if self.watch.lost:
            raise self.watch.lost[0]
        time = float(last) if early and last < end else end
        return Reached(time, bool(event), bool(terminated))

    def event(self, time: float, *, jumped: bool, otherwise: list[str]) -> float:
        """Event mode, and the time of the next event that is known [s]."""
        self.instance.enterEventMode()
        if jumped:
            self.plan.tracks.setter(self.instance)(time, True)
        following = self.update()
        self.recording.row(time)
        self.recording.record_event(time, [(self.recording.name, words) for words in otherwise])
        return following

    def update(self) -> float:
        """Iterate an event to its end, then back to steps."""
        for _ in range(_MOST_ITERATIONS):
            again, terminated, _, _, known, next_time = self.instance.updateDiscreteStates()
            if terminated:
                raise SolverError(f"FMU {self.recording.name} asks for the end at an event")
            if not again:
                self.instance.enterStepMode()
                return float(next_time) if known else math.inf
        raise SolverError(f"FMU {self.recording.name}: an event does not come to an end")


# Model exchange of one FMU: an integrator here makes the steps and finds the events.


_MOST_STEPS = 100_000  # of the integrator between two points


def exchange(instance: Any, plan: Plan, recording: Recording) -> None:
    """Run an instance from begin to end; rows and events go to the recording.

    Args:
        instance: of the FMU, an object of fmpy, instantiated.
        plan: the run.
        recording: that is filled.

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
    """From event to event, and from row to row."""
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
    """Sets the time of an instance, and its inputs as they are then."""

    def __init__(self, instance: Any, plan: Plan) -> None:
        self._instance = instance
        self._all, self._smooth = plan.tracks.setter(instance), _setter(plan.tracks, instance)
        self._after = plan.begin

    def move(self, time: float) -> None:
        """To a time, before what jumps there, unless the jump is done."""
        self._instance.setTime(time)
        self._smooth(time, time <= self._after)

    def jump(self, time: float) -> None:
        """Every input jumps that does at this time."""
        self._after = time
        self._all(time, True)


def _setter(tracks: Tracks, instance: Any) -> Callable[[float, bool], None]:
    return tracks.continuous().setter(instance)


@dataclass(frozen=True, slots=True)
class _Exchange:
    """Calls of FMI 2.0 and 3.0."""

    instance: Any
    plan: Plan
    recording: Recording
    clock: _Clock

    def completed(self) -> tuple[bool, bool]:
        """After a step: whether the FMU wants an event, and whether it asks for the end."""
        if not self.plan.description.modelExchange.needsCompletedIntegratorStep:
            return False, False
        wanted, ended = self.instance.completedIntegratorStep()
        return bool(wanted), bool(ended)

    def event(self, time: float, fired: list[int]) -> tuple[float, bool]:
        """Event mode: the time of the next event that is known [s], and whether the run ends."""
        self.instance.enterEventMode()
        self.clock.jump(time)
        following, ended = self.update()
        self.recording.row(time)
        self.recording.record_event(time, self._told(time, fired))
        return following, ended

    def update(self) -> tuple[float, bool]:
        """Iterate an event to its end, then back to continuous time."""
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
        """What happened where no discrete variable changes."""
        names = [unknown.variable.name for unknown in self.plan.description.eventIndicators]
        for k in fired:
            name = names[k] if k < len(names) else self.recording.name
            yield name, "state event"
        if not fired and time not in self.plan.tracks.jumps:
            yield self.recording.name, "event"


@dataclass(slots=True)
class _Steps:
    """An integrator of fmpy.

    Attributes:
        solver: that makes the steps.
        bounded: tells it a time that it must not pass.
        lost: errors of the FMU inside it.
    """

    solver: Any
    bounded: Callable[[float], None]
    lost: list[Exception]

    def step(self, time: float, until: float) -> tuple[list[int], float]:
        """One step: numbers of the indicators that changed sign, and the time reached [s]."""
        try:
            self.bounded(until)
            _, roots, reached = self.solver.step(time, until)
        except Exception as error:
            raise (self.lost[0] if self.lost else error) from error
        self.lost.clear()  # what was discarded was tried again
        reached = float(reached)
        # some roundings of the time that the solver was given
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
        """Keeps errors of the FMU, which would be lost in C; what it discards is tried again."""

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
    """What CVODE is answered: 1 asks for a shorter step, -1 for the end."""
    try:
        return call(*arguments)
    except Exception as error:
        lost.append(error)
        return 1 if getattr(error, "status", None) == _DISCARD else -1


def _quiet(solver: Any) -> None:
    """What CVODE complains of goes to the solver alone, not to the terminal."""
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


# Messages of FMUs, each brought to the simulation of the thread that it comes from.
#
# fmpy keeps one logger for the whole process in a C library and never asks whether the Python
# function behind it still lives. So there is one function here that lives as long as the process.


Listener = Callable[[int, str], None]
"""Called with the status and the text of a message."""

_LISTENERS: dict[int, Listener] = {}  # by thread
_LOCK, _LOADING = threading.Lock(), threading.Lock()


@contextmanager
def listening(listener: Listener) -> Iterator[None]:
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
    """A library is loaded by fmpy from its folder: one thread at a time, and back again."""
    with _LOADING:
        before = os.getcwd()
        try:
            yield
        finally:
            os.chdir(before)


def _offer(interface: Any, watch: Callable[..., None]) -> dict[str, Any]:
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
    start: Mapping[str, float] | State | None = None,
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
        start: state, input or other variable with a start value, to its value at the start;
            positions also under the names of `run`, such as "j1" for "j1.q". Or the `State` of the
            mechanism that the FMU was made of.
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


def _record(folder: str, plan: Plan, record: Sequence[str] | None) -> list[Any]:
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
