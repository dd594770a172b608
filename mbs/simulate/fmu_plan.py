"""What is asked of a run of an FMU: interface, times, inputs, start values."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from mbs.errors import ModelError
from mbs.simulate.arguments import count_steps
from mbs.simulate.fmu_inputs import Tracks
from mbs.simulate.fmu_variables import set_values

Interface = Literal["CoSimulation", "ModelExchange"]

_SAME = 1e-9  # of a step: times nearer than that are one


@dataclass(frozen=True, slots=True)
class Plan:
    """A run of an FMU.

    Attributes:
        description: of the FMU, as fmpy reads it.
        kind: the interface that is used.
        times: of the rows [s].
        tracks: the inputs.
        starts: variable to its value before the run.
        tolerance: relative.
        solver: of model exchange.
        rows: where else rows are kept.
    """

    description: Any
    kind: Interface
    times: tuple[float, ...]
    tracks: Tracks
    starts: Mapping[str, float]
    tolerance: float
    solver: str
    rows: str

    @property
    def newer(self) -> bool:
        """Whether the FMU is of FMI 3.0."""
        return bool(self.description.fmiVersion.startswith("3"))

    @property
    def begin(self) -> float:
        """Start of the run [s]."""
        return self.times[0]

    @property
    def end(self) -> float:
        """End of the run [s]."""
        return self.times[-1]


def row_times(begin: float, duration: float, step: float, where: str) -> tuple[float, ...]:
    """Times of the rows: multiples of the step, and the end.

    Args:
        begin: [s].
        duration: [s].
        step: distance of the rows [s].
        where: of what it is, for messages.

    Raises:
        ModelError: there are too many.
    """
    count_steps(duration, step, where)
    whole = int(duration / step * (1 + _SAME))
    times = [begin + k * step for k in range(whole + 1)]
    end = begin + duration
    if end - times[-1] > _SAME * step:
        return (*times, end)
    return (*times[:-1], end)


def with_points(times: tuple[float, ...], points: Iterable[float]) -> dict[float, bool]:
    """Times of the rows and points between them, in order, and whether there is a row.

    A row that is nearly at a point moves to it.
    """
    inside = {t for t in points if times[0] < t < times[-1]}
    tight = _SAME * min(np.diff(times), default=1.0)
    wanted = set(times)
    merged: dict[float, bool] = {}
    last = -math.inf
    for time in sorted(wanted | inside):
        row = time in wanted
        if time - last <= tight:
            row = merged.pop(last) or row
            time = last if last in inside or last == times[0] else time
        merged[time] = row
        last = time
    return merged


def set_up(instance: Any, plan: Plan) -> None:
    """Initialization, up to its end.

    Args:
        instance: of the FMU, an object of fmpy.
        plan: the run.
    """
    if not plan.newer:
        instance.setupExperiment(tolerance=plan.tolerance, startTime=plan.begin, stopTime=plan.end)
    set_values(instance, plan.starts, plan.description)
    if plan.newer:
        instance.enterInitializationMode(
            tolerance=plan.tolerance, startTime=plan.begin, stopTime=plan.end
        )
    else:
        instance.enterInitializationMode()
    plan.tracks.setter(instance)(plan.begin, True)
    instance.exitInitializationMode()


def require_equal_steps(plan: Plan, where: str) -> None:
    """Refuse a last step of another length where the FMU cannot make it.

    Raises:
        ModelError: says which step to give.
    """
    steps = np.diff(plan.times)
    if len(steps) > 1 and abs(steps[-1] - steps[0]) > 1e-6 * steps[0]:
        count = len(steps)
        span = plan.end - plan.begin
        raise ModelError(
            f"{where}: steps of {steps[0]:g} s do not divide {span:g} s and the FMU takes steps of"
            f" one length only; give step={span / count:.12g}"
        )
