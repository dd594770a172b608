"""Model exchange of one FMU: an integrator here makes the steps and finds the events."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np

from mbs.errors import SolverError
from mbs.simulate.fmu_inputs import Tracks
from mbs.simulate.fmu_plan import Plan, set_up, with_points
from mbs.simulate.fmu_recording import Recording

_MOST_ITERATIONS = 1000
_DISCARD = 2
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
        self.recording.happened(time, self._told(time, fired))
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
            return _kept(super().f, arguments, lost)

        def g(self, *arguments: Any) -> int:
            return _kept(super().g, arguments, lost)

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


def _kept(call: Callable[..., int], arguments: tuple[Any, ...], lost: list[Exception]) -> int:
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
