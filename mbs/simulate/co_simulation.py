"""Co-simulation of one FMU: it makes the steps.

An input that the FMU cannot follow during a step is held at its value in the middle of the step,
which is right to second order, and has its own value again where a row is kept.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

from mbs.errors import SolverError
from mbs.simulate.fmu_plan import Plan, require_equal_steps, set_up, with_points
from mbs.simulate.fmu_recording import Recording

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
        recording.happened(reached.time)
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
                recording.happened(time)
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
        self.recording.happened(time, [(self.recording.name, words) for words in otherwise])
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
