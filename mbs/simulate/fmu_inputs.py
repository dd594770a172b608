"""Inputs of an FMU over time, as they jump, bend and are held."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mbs.errors import ModelError
from mbs.messages import did_you_mean
from mbs.result import Result
from mbs.simulate.fmu_variables import CONTINUOUS, NOTHING, numbers_of, writer
from mbs.simulate.signals import Signal, check_names, finite_number, pair

Array = NDArray[np.float64]
Inputs = Mapping[str, Signal] | Result


@dataclass(frozen=True, slots=True)
class Track:
    """One input over time.

    Attributes:
        value: of (time, True right after a jump or False right before it).
        corners: times at which it bends or jumps [s].
        jumps: times at which it jumps [s].
    """

    value: Callable[[float, bool], float]
    corners: tuple[float, ...] = ()
    jumps: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class Tracks:
    """All inputs that are given.

    Attributes:
        variables: of the model description.
        tracks: one for each.
        starts: values at the start, of elements of arrays that have no track.
    """

    variables: tuple[Any, ...]
    tracks: tuple[Track, ...]
    starts: Mapping[str, float] = field(default_factory=dict)

    @property
    def corners(self) -> list[float]:
        """Times at which an input bends or jumps [s]."""
        return sorted({t for track in self.tracks for t in track.corners})

    @property
    def jumps(self) -> frozenset[float]:
        """Times at which an input jumps [s]."""
        return frozenset(t for track in self.tracks for t in track.jumps)

    def continuous(self) -> Tracks:
        """Those that are continuous in time."""
        chosen = [k for k, variable in enumerate(self.variables) if _continuous(variable)]
        variables = tuple(self.variables[k] for k in chosen)
        return Tracks(variables, tuple(self.tracks[k] for k in chosen), self.starts)

    def at(self, time: float, after: bool) -> list[float]:
        """The value of each input at a time, right after a jump or right before it."""
        return [track.value(time, after) for track in self.tracks]

    def setter(self, instance: Any) -> Callable[[float, bool], None]:
        """A function of (time, after) that sets the inputs of an instance."""
        write = writer(instance, self.variables, self.starts)

        def apply(time: float, after: bool) -> None:
            if self.variables:
                write(self.at(time, after))

        return apply

    def slopes(self, begin: float, end: float) -> tuple[list[int], list[float]]:
        """Value references of the continuous inputs, and their mean rates over a step [1/s]."""
        given = [
            (variable.valueReference, track)
            for variable, track in zip(self.variables, self.tracks, strict=True)
            if _continuous(variable)
        ]
        rises = [t.value(end, False) - t.value(begin, True) for _, t in given]
        return [r for r, _ in given], [rise / (end - begin) for rise in rises]


def tracks_of(description: Any, inputs: Inputs, starts: Mapping[str, float] = NOTHING) -> Tracks:
    """Inputs as functions of time.

    Args:
        description: of the FMU.
        inputs: name of an input to a number, a function of time or (times, values); or a Result,
            whose columns feed the inputs of the same name; of an array its elements, `tau[2]`.
        starts: values at the start, by name.

    Raises:
        ModelError: a name is unknown or no input, or a value does not fit.
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
                f"input {name}: no number at time {time:g} s ({error}); give a function of time"
                " that returns one"
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
