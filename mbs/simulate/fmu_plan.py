"""Settings of an FMU simulation, its inputs over time, and the recording of its results."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mbs.errors import ModelError, SolverError
from mbs.result import Result, State
from mbs.simulate.arguments import count_steps
from mbs.simulate.fmu_variables import (
    CONTINUOUS,
    NOTHING,
    NUMBERS,
    columns_of,
    numbers_of,
    reader,
    set_values,
    writer,
)
from mbs.text import did_you_mean, error_text, quoted

# Values of FMU variables set by the user.


Array = NDArray[np.float64]
Signal = float | Callable[[float], float] | tuple[ArrayLike, ArrayLike]

_FORMS = "a number, a function of time, or (times, values)"


def start_values(
    description: Any, parameters: Mapping[str, float], start: Mapping[str, float] | State
) -> dict[str, float]:
    """Return the checked initial values of parameters, states and inputs, by name."""
    known = numbers_of(description)
    if isinstance(start, State):
        start = _starts_of(start, {n for n, v in known.items() if _settable(v)})
    every = (*known, *(v.name for v in description.modelVariables))
    fixed = {n for n, v in known.items() if v.causality == "parameter"}
    check_names("parameters", parameters, fixed, every)
    allowed = {n for n, v in known.items() if _settable(v)} - fixed
    start = _full_names(start, allowed, every)
    check_names("start", start, allowed, every)
    return {name: finite_number(name, value) for name, value in {**start, **parameters}.items()}


def _full_names(
    start: Mapping[str, float], allowed: set[str], every: Iterable[str]
) -> dict[str, float]:
    """Replace coordinate names of `run`, such as "j1", by variable names, such as "j1.q".

    Raises:
        ModelError: a coordinate is given by both names.
    """
    found, others = dict[str, float](), set(every)
    for name, value in start.items():
        full = name
        if name not in others and {f"{name}.q", f"{name}.solved"} & allowed:
            full = f"{name}.q"
        if full in start and full != name:
            raise ModelError(f"start: {name} and {full} are the same variable; give it once")
        found[full] = value
    return found


def _starts_of(state: State, settable: set[str]) -> dict[str, float]:
    """Return the start values of an exported mechanism for a state.

    They are positions and velocities of independent joints and states of components. Positions of
    dependent joints select the branch of the loops.

    Raises:
        ModelError: the FMU has no variable of the state.
    """
    positions = {f"{name}.{end}": x for name, x in state.q.items() for end in ("q", "solved")}
    velocities = {f"{name}.v": x for name, x in state.v.items()}
    found = {n: x for n, x in {**positions, **velocities, **state.z}.items() if n in settable}
    if not found:
        raise ModelError(
            f"start: the FMU has none of the states of {state.name or 'the mechanism'}; give"
            " values by the names of its variables"
        )
    return found


def _settable(variable: Any) -> bool:
    """Return whether FMI allows to set the variable before initialization."""
    if variable.variability == "constant" or variable.causality == "independent":
        return False
    return variable.causality == "input" or variable.initial in ("exact", "approx")


def check_names(what: str, given: Iterable[str], allowed: set[str], known: Iterable[str]) -> None:
    """Raise if a name is unknown or its variable cannot be set.

    Args:
        what: name of the checked argument, for the error message.
        given: names to check.
        allowed: names that are valid here.
        known: names of all variables.

    Raises:
        ModelError: a name is not allowed. The message contains the nearest allowed name.
    """
    everything = set(known)
    for name in given:
        if name not in allowed:
            why = "cannot be set" if name in everything else "does not exist"
            solved = f"{name.removesuffix('.q')}.solved"
            if name.endswith(".q") and solved in allowed:
                independent = ", ".join(sorted(n for n in allowed if n.endswith(".q")))
                raise ModelError(
                    f"{what}: {name} follows from the loops; give {independent}, and {solved} as a"
                    " guess that chooses the branch; or give the state of a result, such as"
                    " run(system, 1e-3, q0=...).state(0)"
                )
            hint = did_you_mean(name, sorted(allowed))
            raise ModelError(f"{what}: variable {name!r} {why} here; {hint}")


def pair(name: str, signal: tuple[Any, ...]) -> tuple[Array, Array]:
    """Return the times and values of a table as arrays.

    Raises:
        ModelError: the signal is not a pair of numeric arrays.
    """
    try:
        times, values = (np.asarray(part, dtype=float) for part in signal)
    except (TypeError, ValueError):
        raise ModelError(f"input {name} is {quoted(signal)}; give {_FORMS}") from None
    return times, values


def finite_number(name: str, value: Any) -> float:
    """Return a value as a finite float.

    Raises:
        ModelError: the value is not a finite number.
    """
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = float("nan")
    if not np.isfinite(number):
        raise ModelError(f"{name} = {quoted(value)}: use a finite number")
    return number


# Inputs of an FMU over time, with jumps and kinks.


Inputs = Mapping[str, Signal] | Result


@dataclass(frozen=True, slots=True)
class Track:
    """Input over time.

    Attributes:
        value: callable (time, after) that returns the value. `after` is True for the value right
            after a jump, False for the value right before it.
        corners: times of kinks and jumps [s].
        jumps: times of jumps [s].
    """

    value: Callable[[float, bool], float]
    corners: tuple[float, ...] = ()
    jumps: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class Tracks:
    """Inputs of an FMU over time.

    Attributes:
        variables: input variables of the model description.
        tracks: Track of each variable.
        starts: start values by name, used for array elements without track.
    """

    variables: tuple[Any, ...]
    tracks: tuple[Track, ...]
    starts: Mapping[str, float] = field(default_factory=dict)

    @property
    def corners(self) -> list[float]:
        """Sorted times at which an input has a kink or a jump [s]."""
        return sorted({t for track in self.tracks for t in track.corners})

    @property
    def jumps(self) -> frozenset[float]:
        """Times at which an input jumps [s]."""
        return frozenset(t for track in self.tracks for t in track.jumps)

    def continuous(self) -> Tracks:
        """Return the inputs whose variables are continuous in time."""
        chosen = [k for k, variable in enumerate(self.variables) if _continuous(variable)]
        variables = tuple(self.variables[k] for k in chosen)
        return Tracks(variables, tuple(self.tracks[k] for k in chosen), self.starts)

    def at(self, time: float, after: bool) -> list[float]:
        """Return the value of each input at a time, right after or right before a jump."""
        return [track.value(time, after) for track in self.tracks]

    def setter(self, instance: Any) -> Callable[[float, bool], None]:
        """Return a function (time, after) that sets the inputs of an instance."""
        write = writer(instance, self.variables, self.starts)

        def apply(time: float, after: bool) -> None:
            if self.variables:
                write(self.at(time, after))

        return apply

    def slopes(self, begin: float, end: float) -> tuple[list[int], list[float]]:
        """Return value references of continuous inputs, and their mean rates over a step [1/s]."""
        given = [
            (variable.valueReference, track)
            for variable, track in zip(self.variables, self.tracks, strict=True)
            if _continuous(variable)
        ]
        rises = [t.value(end, False) - t.value(begin, True) for _, t in given]
        return [r for r, _ in given], [rise / (end - begin) for rise in rises]


def tracks_of(description: Any, inputs: Inputs, starts: Mapping[str, float] = NOTHING) -> Tracks:
    """Return the inputs as functions of time.

    Args:
        description: model description of the FMU.
        inputs: dict from input to a number, a function of time or (times, values); or a Result,
            whose columns are the inputs of the same name. Array elements are named `tau[2]`.
        starts: start values by name.

    Raises:
        ModelError: a name is unknown or not an input, or a value is invalid.
    """
    numbers = numbers_of(description)
    known = {name: v for name, v in numbers.items() if v.causality == "input"}
    if isinstance(inputs, Result):
        inputs = _from_result(inputs, known)
    every = (*numbers, *(v.name for v in description.modelVariables))
    check_names("inputs", inputs, set(known), every)
    variables = tuple(known[name] for name in inputs)
    tracks = tuple(_track(known[name], signal) for name, signal in inputs.items())
    return Tracks(variables, tracks, starts)


def _continuous(variable: Any) -> bool:
    return variable.type in CONTINUOUS and variable.variability != "discrete"


def _from_result(result: Result, known: Mapping[str, Any]) -> dict[str, Signal]:
    found: dict[str, Signal] = {n: (result.time, result[n]) for n in known if n in result}
    if not found:
        raise ModelError(
            f"inputs: result {result.name!r} has no column of an input; the FMU has"
            f" {did_you_mean('', known)}"
        )
    return found


def _track(variable: Any, signal: Signal) -> Track:
    name = str(variable.name)
    if callable(signal):
        return _of_function(name, signal)
    if isinstance(signal, tuple):
        return _of_table(name, signal, straight=_continuous(variable))
    number = finite_number(f"input {name}", signal)
    return Track(lambda time, after: number)


def _of_function(name: str, function: Callable[[float], float]) -> Track:
    def value(time: float, after: bool) -> float:
        try:
            found = float(function(time))
        except Exception as error:
            raise ModelError(
                f"input {name}: no number at time {time:g} s ({error_text(error)}); give a"
                " function of time that returns one"
            ) from error
        if not np.isfinite(found):
            raise ModelError(
                f"input {name} has a value that is not finite at time {time:g} s; use numbers"
            )
        return found

    return Track(value)


def _of_table(name: str, signal: tuple[Any, ...], *, straight: bool) -> Track:
    times, values = pair(name, signal)
    if times.ndim != 1 or times.shape != values.shape or not len(times):
        raise ModelError(f"input {name}: give as many values as increasing times")
    if np.any(np.diff(times) < 0):
        raise ModelError(
            f"input {name}: the times decrease; give as many values as increasing times"
        )
    if not (np.isfinite(times).all() and np.isfinite(values).all()):
        raise ModelError(f"input {name} has a value that is not finite; use numbers")
    last = len(times) - 1

    def value(time: float, after: bool) -> float:
        k = int(np.searchsorted(times, time, side="right" if after else "left"))
        if k == 0 or k > last or not straight:
            return float(values[min(max(k - 1, 0), last)])
        share = (time - times[k - 1]) / (times[k] - times[k - 1])
        return float(values[k - 1] + share * (values[k] - values[k - 1]))

    repeated = times[:-1][np.diff(times) == 0]
    jumps = repeated if straight else times[1:][np.diff(values) != 0]
    return Track(value, tuple(map(float, times)), tuple(map(float, jumps)))


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


Event = tuple[float, str, str]


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
    events: list[Event] = field(default_factory=list)
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

    def ended(self, time: float) -> None:
        """Record the event that the FMU ends the simulation."""
        self.events.append((time, self.name, "ends the simulation"))

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
        for v in description.modelVariables
        if v.variability == "discrete"
        and v.causality in ("output", "local")
        and v.type in NUMBERS
        and not v.dimensions
    ]
    return Recording(
        name=description.modelName,
        columns=columns_of(variables),
        read=reader(instance, variables),
        watched=[v.name for v in watched],
        modes=reader(instance, watched),
        reached=reached,
    )
