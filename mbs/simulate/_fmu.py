"""Simulation of an FMU of any tool through the library FMPy."""

from __future__ import annotations

import contextlib
import ctypes
import logging
import math
import os
import tempfile
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextvars import ContextVar
from dataclasses import dataclass, field
from functools import lru_cache
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
    Interface,
    Plan,
    Recording,
    recording_of,
    require_equal_steps,
    row_times,
    set_up,
    with_points,
)
from mbs.simulate.fmu_variables import Inputs, check_names, recordable, start_values, tracks_of
from mbs.solvers.control_c import control_c
from mbs.text import quoted

# Steps and events of an FMU.
#
# FMPy loads the FMU, calls its functions, reads its variables and integrates Model Exchange. The
# loop of `fmpy.simulate_fmu` is not used: its inputs are sampled, its solver evaluates derivatives
# with the inputs of an earlier time, an error within the solver is lost, and Co-Simulation has
# neither time events nor steps that end at the kinks of inputs.
#
# In co-simulation, an input that the FMU cannot follow during a step is held at its value in the
# middle of the step, which is accurate to second order. It is set to its current value before a
# row is recorded.


_DISCARD = 2
_MOST_ITERATIONS = 1000
_MOST_STEPS = 100_000  # maximum number of integrator steps per output interval


@dataclass(frozen=True, slots=True)
class Reached:
    """End of a step.

    Attributes:
        time: time at the end of the step [s].
        event: Whether an event occurred at this time.
        terminated: Whether the FMU requests the end of the simulation.
        fired: names of the event indicators that changed sign.
    """

    time: float
    event: bool = False
    terminated: bool = False
    fired: tuple[str, ...] = ()


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
    lost: list[BaseException] = field(default_factory=list)

    def __call__(
        self, _: Any, time: float, settable: bool, gettable: bool, finished: bool, *rest: Any
    ) -> None:
        """Call with the arguments of fmi3IntermediateUpdateCallback."""
        try:
            if settable and self.apply is not None:
                self.apply(time, False)
            if gettable and finished and self.look is not None:
                self.look(time)
        except BaseException as error:  # control-C too
            self.lost.append(error)


def simulate(
    instance: Any,
    plan: Plan,
    recording: Recording,
    watch: Intermediate,
    check: Callable[[], object] = lambda: None,
) -> None:
    """Run an instance from begin to end; rows and events go to the recording.

    Args:
        instance: instantiated FMPy object of the FMU.
        plan: settings of the simulation.
        recording: recording to which rows and events are added.
        watch: intermediate update callback of the instance.
        check: callable that raises KeyboardInterrupt after control-C.

    Raises:
        ModelError: the FMU requires a fixed step size, and it does not divide the duration.
        SolverError: a step fails, a value is not finite, or an event does not end.
    """
    stepped = plan.kind == "CoSimulation"
    corners: Iterable[float] = plan.tracks.corners if stepped else plan.tracks.jumps
    if stepped and not plan.description.coSimulation.canHandleVariableCommunicationStepSize:
        require_equal_steps(plan, f"FMU {plan.description.modelName}")
        corners = ()
    points = with_points(plan.times, corners)
    set_up(instance, plan)
    if not stepped:
        run: _Run = _Exchange(instance, plan, recording, check)
    elif plan.newer:
        run = _Newer(instance, plan, recording, watch)
    else:
        run = _Older(instance, plan, recording)
    following, ended = run.start()
    recording.begin(plan.begin)
    if not ended:
        _advance(run, points, following, check)
    instance.terminate()


def _advance(
    run: _Run, points: dict[float, bool], following: float, check: Callable[[], object]
) -> None:
    """Step to the points, the values of which are True for a row, and process events.

    Args:
        run: initialized FMU.
        points: result of `with_points`.
        following: time of the first time event [s], or inf.
        check: callable that raises KeyboardInterrupt after control-C.
    """
    recording, time = run.recording, run.plan.begin
    for end, row in list(points.items())[1:]:
        run.approach(time, end)
        tries = 0
        while time < end:
            reached = run.step(time, min(end, following))
            check()
            tries = tries + 1 if reached.time == time else 0
            if tries > _MOST_ITERATIONS:
                raise SolverError(f"FMU {recording.name} does not get beyond time {time:.9g} s")
            time = reached.time
            if time == end:
                run.arrive(end)
            happens = reached.event or time >= following or time in run.jumps
            if happens or reached.terminated or (row and time == end):
                recording.row(time)
            ended = reached.terminated
            if happens and not ended:
                unsaid = run.unsaid(reached, following)
                following, ended = run.event(time, time == end)
                recording.row(time)
                recording.record_event(time, unsaid)
            else:
                recording.record_event(time)
            if ended:
                recording.events.append((time, recording.name, "ends the simulation"))
                return


class _Run:
    """Calls of an interface of FMI for steps and events.

    Attributes:
        events: Whether the interface has events.
        jumps: times at which jumps of inputs are processed as events [s].
    """

    def __init__(self, instance: Any, plan: Plan, recording: Recording, *, events: bool) -> None:
        self.instance, self.plan, self.recording = instance, plan, recording
        self.events = events
        self.jumps = plan.tracks.jumps if events else frozenset[float]()
        self.apply = plan.tracks.setter(instance)
        self.apply_continuous = plan.tracks.continuous().setter(instance)

    def start(self) -> tuple[float, bool]:
        """Return the time of the first time event [s], or inf, and whether to end."""
        return self.update() if self.events else (math.inf, False)

    def approach(self, begin: float, end: float) -> None:
        """Set the inputs of an interval."""

    def step(self, begin: float, end: float) -> Reached:
        """Make a step, and return its end."""
        raise NotImplementedError

    def arrive(self, end: float) -> None:
        """Set the inputs at the end of an interval."""

    def event(self, time: float, jumped: bool) -> tuple[float, bool]:
        """Process an event; return the time of the next time event [s], and whether to end.

        Args:
            time: time [s].
            jumped: Whether inputs may jump at this time.
        """
        self.instance.enterEventMode()
        if jumped:
            self.apply(time, True)
        return self.update()

    def update(self) -> tuple[float, bool]:
        """Iterate an event to convergence, and go on to the next step."""
        name = "updateDiscreteStates" if self.plan.newer else "newDiscreteStates"
        update = getattr(self.instance, name)
        for _ in range(_MOST_ITERATIONS):
            again, ended, _, _, known, next_time = update()
            if ended:
                return math.inf, True
            if not again:
                self.resume()
                return (float(next_time) if known else math.inf), False
        raise SolverError(f"FMU {self.recording.name}: an event does not come to an end")

    def resume(self) -> None:
        """Leave event mode."""
        self.instance.enterStepMode()

    def unsaid(self, reached: Reached, following: float) -> list[tuple[str, str]]:
        """Return name and text of an event for the case that no discrete variable changes."""
        happened = reached.event or reached.time >= following
        return [(self.recording.name, "event")] if happened else []


class _Older(_Run):
    """Co-simulation of FMI 2.0: inputs with slopes if the FMU interpolates."""

    def __init__(self, instance: Any, plan: Plan, recording: Recording) -> None:
        super().__init__(instance, plan, recording, events=False)
        self._held = not plan.description.coSimulation.canInterpolateInputs

    def approach(self, begin: float, end: float) -> None:
        self.apply((begin + end) / 2 if self._held else begin, True)
        if self.plan.tracks.variables and not self._held:
            references, slopes = self.plan.tracks.slopes(begin, end)
            self.instance.setRealInputDerivatives(references, [1] * len(references), slopes)

    def step(self, begin: float, end: float) -> Reached:
        from fmpy.fmi1 import FMICallException
        from fmpy.fmi2 import fmi2LastSuccessfulTime, fmi2Terminated

        unit = self.instance
        try:
            unit.doStep(currentCommunicationPoint=begin, communicationStepSize=end - begin)
        except FMICallException as error:
            if error.status != _DISCARD or not unit.getBooleanStatus(fmi2Terminated):
                raise
            last = float(unit.getRealStatus(fmi2LastSuccessfulTime))
            self.arrive(last)
            return Reached(last, terminated=True)
        return Reached(end)

    def arrive(self, end: float) -> None:
        if self._held:
            self.apply(end, False)


class _Newer(_Run):
    """Co-simulation of FMI 3.0, with event mode if the FMU has one."""

    def __init__(
        self, instance: Any, plan: Plan, recording: Recording, watch: Intermediate
    ) -> None:
        offered = plan.description.coSimulation
        super().__init__(instance, plan, recording, events=offered.hasEventMode)
        self._watch, self._between = watch, self.apply_continuous if self.events else self.apply
        watch.apply = self.apply_continuous
        watch.look = recording.row if plan.rows == "solver" else None

    def approach(self, begin: float, end: float) -> None:
        self._between((begin + end) / 2, True)

    def step(self, begin: float, end: float) -> Reached:
        event, terminated, early, last = self.instance.doStep(
            currentCommunicationPoint=begin, communicationStepSize=end - begin
        )
        if self._watch.lost:
            raise self._watch.lost[0]
        time = float(last) if early and last < end else end
        return Reached(time, bool(event) and self.events, bool(terminated))

    def arrive(self, end: float) -> None:
        self._between(end, False)

    def update(self) -> tuple[float, bool]:
        following, ended = super().update()
        if ended:
            raise SolverError(f"FMU {self.recording.name} asks for the end at an event")
        return following, False


class _Exchange(_Run):
    """Model exchange: an integrator of FMPy makes the steps and locates the events."""

    def __init__(
        self, instance: Any, plan: Plan, recording: Recording, check: Callable[[], object]
    ) -> None:
        super().__init__(instance, plan, recording, events=True)
        self._after, self._check = plan.begin, check
        self._solver: Any = None
        described = plan.description
        names = [unknown.variable.name for unknown in described.eventIndicators]
        unnamed = described.numberOfEventIndicators - len(names)  # FMI 2.0 names none
        self._indicators = [*names, *[recording.name] * unnamed]

    def start(self) -> tuple[float, bool]:
        following, ended = self.update()
        self._solver = None if ended else _solver(self)
        return following, ended

    def move(self, time: float) -> None:
        """Set the time and continuous inputs, before a jump at this time unless it was made."""
        self._check()
        self.instance.setTime(time)
        self.apply_continuous(time, time <= self._after)

    def step(self, begin: float, end: float) -> Reached:
        _, roots, time = self._solver.step(begin, end)
        # relative tolerance 1e-14: some rounding errors of the time `end`
        near = abs(time - end) <= 1e-14 * max(1.0, abs(end))
        time = end if near else float(time)
        self.move(time)
        wanted = ended = False
        if self.plan.description.modelExchange.needsCompletedIntegratorStep:
            wanted, ended = self.instance.completedIntegratorStep()
        fired = tuple(self._indicators[k] for k in np.flatnonzero(roots))
        return Reached(time, bool(fired or wanted), bool(ended), fired)

    def event(self, time: float, jumped: bool) -> tuple[float, bool]:
        self._after = time
        found = super().event(time, True)
        self._solver.reset(time)
        return found

    def resume(self) -> None:
        self.instance.enterContinuousTimeMode()

    def unsaid(self, reached: Reached, following: float) -> list[tuple[str, str]]:
        if reached.fired or reached.time in self.jumps:
            return [(name, "state event") for name in reached.fired]
        return [(self.recording.name, "event")]


def _solver(run: _Exchange) -> Any:
    """Return the integrator of FMPy."""
    instance, plan = run.instance, run.plan
    common: dict[str, Any] = {
        "nx": plan.description.numberOfContinuousStates,
        "nz": plan.description.numberOfEventIndicators,
        "get_x": instance.getContinuousStates,
        "set_x": instance.setContinuousStates,
        "get_dx": (
            instance.getContinuousStateDerivatives if plan.newer else instance.getDerivatives
        ),
        "get_z": instance.getEventIndicators,
        "input": SimpleNamespace(apply=lambda time: None),
    }
    if plan.solver == "Euler":
        from fmpy.simulation import ForwardEuler

        return ForwardEuler(**common)
    return _cvode_class()(
        **common,
        get_nominals=instance.getNominalsOfContinuousStates,
        set_time=run.move,
        startTime=plan.begin,
        maxStep=max(np.diff(plan.times), default=math.inf),
        relativeTolerance=plan.tolerance,
        maxNumSteps=_MOST_STEPS,
    )


@lru_cache(maxsize=1)
def _cvode_class() -> Any:
    """Return the class of CVODE with errors of the FMU and a time at which steps end."""
    from fmpy.sundials import CVodeSolver
    from fmpy.sundials.libraries import sundials_core, sundials_cvode
    from fmpy.sundials.sundials_context import SUNContext_PushErrHandler

    stop, clear = sundials_cvode.CVodeSetStopTime, sundials_core.SUNContext_ClearErrHandlers
    stop.argtypes, clear.argtypes = [ctypes.c_void_p, ctypes.c_double], [ctypes.c_void_p]

    class Solver(CVodeSolver):  # type: ignore[misc]
        """CVODE that passes on errors of the FMU and repeats steps that the FMU discards."""

        def __init__(self, **settings: Any) -> None:
            self.lost: list[BaseException] = []  # errors in callbacks
            super().__init__(**settings)
            clear(self.sunctx)  # errors go to the solver object only, not to the terminal
            SUNContext_PushErrHandler(self.sunctx, self.ehfun_, None)

        def f(self, *arguments: Any) -> int:
            return self.kept(super().f, arguments)

        def g(self, *arguments: Any) -> int:
            return self.kept(super().g, arguments)

        def kept(self, call: Callable[..., int], arguments: tuple[Any, ...]) -> int:
            """Return the status for CVODE: 0 success, 1 shorter step, -1 unrecoverable error."""
            try:
                return call(*arguments)
            except BaseException as error:  # control-C too, which C code cannot propagate
                self.lost.append(error)
                return 1 if getattr(error, "status", None) == _DISCARD else -1

        def step(self, t: float, tNext: float) -> Any:
            stop(self.cvode_mem, tNext)
            try:
                found = super().step(t, tNext)
            except Exception as error:
                raise (self.lost[0] if self.lost else error) from error
            self.lost.clear()  # the solver has repeated discarded evaluations
            return found

    return Solver


# Messages of FMUs, each passed to the simulation that runs in the same thread.


# callable with the status and the text of a message
_LISTENER: ContextVar[Callable[[int, str], None] | None] = ContextVar("listener", default=None)
_LOADING = threading.Lock()


@contextlib.contextmanager
def instance(description: Any, folder: str, kind: str, watch: Callable[..., None]) -> Iterator[Any]:
    """Instantiate an FMU of FMI 2.0 or 3.0, and free the instance at the end of the context.

    Args:
        description: model description.
        folder: folder of the extracted FMU.
        kind: "CoSimulation" or "ModelExchange".
        watch: intermediate update callback, used if the FMU supports it (FMI 3.0).
    """
    from fmpy.simulation import instantiate_fmu

    offered = description.coSimulation if kind == "CoSimulation" else None
    events = bool(offered and offered.hasEventMode)
    newer = description.fmiVersion.startswith("3")
    # FMPy changes the working directory on loading; one thread at a time
    with _LOADING, contextlib.chdir("."):
        if not newer:
            _log_older()
        fmu = instantiate_fmu(
            folder,
            description,
            kind,
            # FMUs of other tools would log every call
            debug_logging=str(description.generationTool).startswith("mbs"),
            logger=_log if newer else None,
            event_mode_used=events,
            early_return_allowed=events,
            intermediate_update=watch if offered and offered.providesIntermediateUpdate else None,
        )
    try:
        yield fmu
    finally:
        fmu.freeInstance()


def _log_older() -> None:
    """Pass messages of FMI 2.0 to `_log`.

    FMPy stores a single logger per process in a C library and holds no reference to its Python
    function. The logger here is therefore a function that is never freed. It is set for every
    instance, because other users of FMPy may have set theirs.
    """
    from fmpy import fmi2
    from fmpy.logging import addLoggerProxy

    addLoggerProxy(ctypes.byref(fmi2.fmi2CallbackFunctions(logger=_older_logger())))


@lru_cache(maxsize=1)
def _older_logger() -> Any:
    from fmpy import fmi2

    return fmi2.fmi2CallbackLoggerTYPE(lambda unit, name, *message: _log(unit, *message))


def _log(environment: Any, status: int, category: bytes, message: bytes) -> None:
    from fmpy import fmi3

    listener = _LISTENER.get()
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
    for what, values, kinds in (
        ("parameters", parameters, Mapping | None),
        ("start", start, Mapping | State | None),
    ):
        if not isinstance(values, kinds):
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
    known = recordable(described)
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
    token = _LISTENER.set(listen)
    with progress(name, plan.begin, plan.end, quiet=quiet) as reached:
        try:
            with (
                control_c() as check,
                instance(plan.description, folder, plan.kind, watch) as unit,
            ):
                recording = recording_of(unit, plan.description, variables, reached)
                simulate(unit, plan, recording, watch, check)
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
        finally:
            _LISTENER.reset(token)
    if stop is not None:
        if recording is not None and recording.times:
            stop.time = recording.times[-1]
            stop.result = recording.result((stop.time, str(stop)))
        raise stop
    assert recording is not None
    return recording.result()
