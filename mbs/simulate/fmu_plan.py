"""Settings of an FMU simulation, and the recording of its results."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from mbs.errors import ModelError, SolverError
from mbs.result import Result
from mbs.simulate.arguments import count_steps
from mbs.simulate.fmu_variables import (
    Tracks,
    columns_of,
    numbers_of,
    reader,
    recordable,
    writer,
)

Interface = Literal["CoSimulation", "ModelExchange"]

_SAME = 1e-9  # fraction of a step: times closer than this are equal


@dataclass(frozen=True, slots=True)
class Plan:
    """Settings of an FMU simulation.

    Attributes:
        description: model description of the FMU, read by FMPy.
        kind: interface, "CoSimulation" or "ModelExchange".
        times: times of the rows [s].
        tracks: inputs over time.
        starts: dict from variable to initial value.
        tolerance: relative tolerance.
        solver: solver of model exchange, "CVode" or "Euler".
        rows: "solver" to record internal solver steps too, or "step".
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
        """Whether the FMU has version 3.0 of FMI."""
        return bool(self.description.fmiVersion.startswith("3"))

    @property
    def begin(self) -> float:
        """Start time [s]."""
        return self.times[0]

    @property
    def end(self) -> float:
        """End time [s]."""
        return self.times[-1]


def row_times(begin: float, duration: float, step: float, where: str) -> tuple[float, ...]:
    """Return the times of the rows: multiples of the step after the start, and the end.

    Args:
        begin: start time [s].
        duration: duration [s].
        step: time between rows [s].
        where: name of the model, for error messages.

    Raises:
        ModelError: the number of rows exceeds the limit.
    """
    count_steps(duration, step, where)
    whole = int(duration / step * (1 + _SAME))
    times = [begin + k * step for k in range(whole + 1)]
    end = begin + duration
    if end - times[-1] > _SAME * step:
        return (*times, end)
    return (*times[:-1], end)


def with_points(times: tuple[float, ...], points: Iterable[float]) -> dict[float, bool]:
    """Merge times of rows and points in order; the values are True for times with a row.

    A row within `_SAME` of a step of a point is moved to the point.
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
    """Initialize an instance: set start values and inputs, and leave initialization mode.

    Args:
        instance: FMPy object of the FMU.
        plan: settings of the simulation.
    """
    span = {"tolerance": plan.tolerance, "startTime": plan.begin, "stopTime": plan.end}
    if not plan.newer:
        instance.setupExperiment(**span)
    started = [v for n, v in numbers_of(plan.description).items() if n in plan.starts]
    writer(instance, started, plan.starts)([plan.starts[v.name] for v in started])
    instance.enterInitializationMode(**(span if plan.newer else {}))
    plan.tracks.setter(instance)(plan.begin, True)
    instance.exitInitializationMode()


def require_equal_steps(plan: Plan, where: str) -> None:
    """Raise if the last step has a different length than the others.

    Raises:
        ModelError: the lengths differ. The message contains a step that divides the duration.
    """
    steps = np.diff(plan.times)
    # tolerance 1e-6 of a step: above rounding errors of times, below any intended difference
    if len(steps) > 1 and abs(steps[-1] - steps[0]) > 1e-6 * steps[0]:
        count = len(steps)
        span = plan.end - plan.begin
        raise ModelError(
            f"{where}: steps of {steps[0]:g} s do not divide {span:g} s and the FMU takes steps of"
            f" one length only; give step={span / count:.12g}"
        )


# Recording of an FMU simulation: rows of variables, and events.


@dataclass(slots=True)
class Recording:
    """Rows and events recorded during a simulation.

    Attributes:
        name: name of the model.
        columns: dict from column name to unit.
        read: function that reads the current values of a row.
        watched: names of the discrete variables whose changes are events.
        modes: function that reads the current values of the watched variables.
        reached: progress callback, called with the time of every row.
        times: times of the rows [s].
        rows: values of the rows.
        events: events, each with time [s], name and description.
        last: values of the watched variables at the last event.
    """

    name: str
    columns: dict[str, str]
    read: Callable[[], list[float]]
    watched: list[str]
    modes: Callable[[], list[float]]
    reached: Callable[[float], None]
    times: list[float] = field(default_factory=list)
    rows: list[list[float]] = field(default_factory=list)
    events: list[tuple[float, str, str]] = field(default_factory=list)
    last: list[float] = field(default_factory=list)

    def begin(self, time: float) -> None:
        """Record the first row and the initial discrete values."""
        self.last = self.modes() if self.watched else []
        self.row(time)

    def row(self, time: float) -> None:
        """Record the current values, unless the last row has the same time and values.

        Raises:
            SolverError: a value is not finite.
        """
        values = self.read()
        for column, value in zip(self.columns, values, strict=True):
            if not math.isfinite(value):
                raise SolverError(f"FMU {self.name}: {column} is not finite at time {time:g} s")
        if not self.times or self.times[-1] != time or self.rows[-1] != values:
            self.times.append(time)
            self.rows.append(values)
        self.reached(time)

    def record_event(self, time: float, otherwise: Iterable[tuple[str, str]] = ()) -> None:
        """Record the changes of discrete variables as events.

        Args:
            time: time [s].
            otherwise: name and description of events to record if no discrete variable changed.
        """
        now = self.modes() if self.watched else []
        changed = [
            (time, name, f"{before:g} -> {after:g}")
            for name, before, after in zip(self.watched, self.last, now, strict=True)
            if before != after
        ]
        self.last = now
        self.events.extend(changed or [(time, name, words) for name, words in otherwise])

    def result(self, stopped: tuple[float, str] | None = None) -> Result:
        """Return the recorded rows and events as a Result.

        Args:
            stopped: time [s] and error message of an early stop; None if the run is complete.
        """
        values = np.array(self.rows, dtype=float).reshape(len(self.times), len(self.columns))
        return Result(
            np.array(self.times),
            values,
            self.columns,
            self.name,
            events=tuple(self.events),
            stopped=stopped,
        )


def recording_of(
    instance: Any, description: Any, variables: list[Any], reached: Callable[[float], None]
) -> Recording:
    """Return an empty recording of an instance.

    Args:
        instance: FMPy object of an FMU.
        description: model description of the FMU.
        variables: variables to record.
        reached: progress callback, called with the time of every row.
    """
    watched = [
        v
        for v in recordable(description).values()
        if v.variability == "discrete" and v.causality in ("output", "local") and not v.shape
    ]
    return Recording(
        name=description.modelName,
        columns=columns_of(variables),
        read=reader(instance, description, variables),
        watched=[v.name for v in watched],
        modes=reader(instance, description, watched),
        reached=reached,
    )
