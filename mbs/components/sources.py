"""Signal sources: steps, ramps, sines, pulses, tables and point-to-point motions over time.

A source has no input. Its state `clock` is the time since the start of the motion. Each bend and
each jump of a source ends a step of the integration, so that no pulse is skipped.

Sources with a finite number of bends give them as crossings of the clock. Sources with many or
periodic changes count the time down to the next change and have an event there. Models without
events, such as `dae`, raise an error for these sources.

Source: Modelica Association 2023, package Modelica.Blocks.Sources.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import casadi
import numpy as np
from casadi import DM, SX
from numpy.typing import NDArray

from mbs.components import custom
from mbs.components.blocks import SignalBlock
from mbs.components.custom import At, Custom, Event
from mbs.errors import DescriptionError
from mbs.text import did_you_mean, quoted

Array = NDArray[np.float64]


class SignalSource(SignalBlock):
    """Base class of signals that depend on time alone.

    Attributes:
        clock: time since the start of the motion [s]; its start is the first time of the source.
    """

    clock = custom.state("s")
    y = custom.output()

    def rates(self, at: At) -> Mapping[str, SX]:
        """Return {"clock": 1}: one second per second.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return {"clock": SX(1)}


def _zero_before_start(begun: SX, signal: SX) -> SX:
    """Return `signal` if `begun`, the time since its start [s], is at least zero; else zero."""
    return casadi.if_else(begun >= 0, signal, 0)


# Sources with a finite number of bends.


class Step(SignalSource):
    """A step: y = offset before start_time and offset + height from then on.

    Attributes:
        height: change of y at the step.
        start_time: time of the step [s].
        offset: value before the step.
    """

    height = custom.parameter("1", 1.0)
    start_time = custom.parameter("s", 0.0)
    offset = custom.parameter("1", 0.0)

    def outputs(self, at: At) -> Mapping[str, SX]:
        """Return {"y": offset, plus height from start_time on}.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return {"y": at.offset + _zero_before_start(at.clock - at.start_time, at.height)}

    def crossings(self, at: At) -> Mapping[str, SX]:
        """Return {"start": time since start_time [s]}, the event indicator of the step.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return {"start": at.clock - at.start_time}


class Ramp(SignalSource):
    """A ramp: y rises linearly from offset to offset + height within the duration.

    Attributes:
        height: total rise.
        duration: time from the begin to the end of the rise [s].
        start_time: time at which the rise begins [s].
        offset: value before the rise.
    """

    height = custom.parameter("1", 1.0)
    duration = custom.parameter("s", 1.0, positive=True)
    start_time = custom.parameter("s", 0.0)
    offset = custom.parameter("1", 0.0)

    def outputs(self, at: At) -> Mapping[str, SX]:
        """Return {"y": ramp of the class docstring}, constant before and after the rise.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        part = (at.clock - at.start_time) / at.duration
        return {"y": at.offset + at.height * casadi.fmin(casadi.fmax(part, 0), 1)}

    def crossings(self, at: At) -> Mapping[str, SX]:
        """Return the times since the start ("start") and the end ("end") of the rise [s].

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        begun = at.clock - at.start_time
        return {"start": begun, "end": begun - at.duration}


class Sine(SignalSource):
    """A sine: y = offset + amplitude sin(2 pi frequency (t - start_time) + phase).

    Before start_time y is the offset.

    Attributes:
        amplitude: largest deviation from the offset.
        frequency: periods per second [Hz].
        phase: angle at start_time [rad].
        start_time: time at which the sine begins [s].
        offset: value before the sine, and its mean.
    """

    amplitude = custom.parameter("1", 1.0)
    frequency = custom.parameter("Hz", 1.0)
    phase = custom.parameter("rad", 0.0)
    start_time = custom.parameter("s", 0.0)
    offset = custom.parameter("1", 0.0)

    def outputs(self, at: At) -> Mapping[str, SX]:
        """Return {"y": value of the class equation; offset before start_time}.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        begun = at.clock - at.start_time
        return {"y": at.offset + _zero_before_start(begun, self._wave(at, begun))}

    def _wave(self, at: At, begun: SX) -> SX:
        """Return the deviation of y from the offset.

        `begun` is the time since start_time [s].
        """
        return SX(at.amplitude * casadi.sin(2 * math.pi * at.frequency * begun + at.phase))

    def crossings(self, at: At) -> Mapping[str, SX]:
        """Return {"start": time since start_time [s]}.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return {"start": at.clock - at.start_time}


class ExpSine(Sine):
    """A damped sine: the sine of `Sine` times exp(-damping (t - start_time)).

    Attributes:
        amplitude, frequency, phase, start_time, offset: parameters of the undamped `Sine`.
        damping: rate of decay [1/s].
    """

    damping = custom.parameter("1/s", 1.0)

    def _wave(self, at: At, begun: SX) -> SX:
        """Return the damped deviation of y from the offset.

        `begun` is the time since start_time [s].
        """
        # fmax keeps exp from overflowing before the begin, where the value is not used
        return SX(Sine._wave(self, at, begun) * casadi.exp(-at.damping * casadi.fmax(begun, 0)))


class KinematicPTP(SignalSource):
    """A point-to-point motion along a line in least time, with limits of speed and acceleration.

    The velocity is a trapezoid, or a triangle if the distance is too short to reach v_max. With a
    duration the same motion is slowed down to last that long, so that several axes arrive together.

    The outputs are `y`, the position, `v`, its rate, and `a`, the rate of `v`.

    Attributes:
        begin: position at the start.
        end: position at the end.
        v_max: limit of the speed [1/s].
        a_max: limit of the acceleration [1/s2].
        start_time: time at which the motion begins [s].
        duration: time from begin to end [s]; the shortest duration within the limits if left out.
    """

    begin = custom.parameter()
    end = custom.parameter()
    v_max = custom.parameter("1/s", positive=True)
    a_max = custom.parameter("1/s2", positive=True)
    start_time = custom.parameter("s", 0.0)
    duration = custom.parameter("s", None, positive=True)
    v = custom.output()
    a = custom.output()

    def __post_init__(self) -> None:
        Custom.__post_init__(self)
        shortest, given = self.shortest_duration, self._parameter_value("duration")
        # a duration that was computed from other numbers may be shorter by rounding
        if shortest is not None and given is not None and given < shortest * (1 - 1e-9):
            raise DescriptionError(
                f"{self.name}: duration is {given:g} s, but the limits need {shortest:.6g} s; give"
                " a longer duration, or larger limits"
            )

    @property
    def shortest_duration(self) -> float | None:
        """Shortest duration that the limits allow [s]; None if one of the numbers is a symbol."""
        found = [self._parameter_value(name) for name in ("begin", "end", "v_max", "a_max")]
        known = [SX(value) for value in found if value is not None]
        if len(known) < len(found):
            return None
        times = _ptp_times(*known)
        return float(casadi.evalf(times[-1]))

    def outputs(self, at: At) -> Mapping[str, SX]:
        """Return position "y", its rate "v" and the rate "a" of v.

        Before the motion y is `begin`, after it `end`; v and a are then zero.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        rise, brake, last = _ptp_times(at.begin, at.end, at.v_max, at.a_max)
        slowdown, distance = self._slowdown(at, last), casadi.fabs(at.end - at.begin)
        sign = casadi.if_else(at.end < at.begin, -1, 1)
        s = casadi.fmin(casadi.fmax((at.clock - at.start_time) / slowdown, 0), last)
        left, peak = last - s, at.a_max * rise
        phases = (
            (s < rise, (at.a_max * s**2 / 2, at.a_max * s, at.a_max)),
            (s < brake, (peak * (s - rise / 2), peak, 0)),
        )
        found = [distance - at.a_max * left**2 / 2, at.a_max * left, -at.a_max]
        for holds, values in reversed(phases):
            found = [casadi.if_else(holds, *pair) for pair in zip(values, found, strict=True)]
        begun = at.clock - at.start_time
        moving = casadi.logic_and(begun >= 0, begun < slowdown * last)
        return {
            "y": at.begin + sign * found[0],
            "v": sign * found[1] / slowdown,
            "a": casadi.if_else(moving, sign * found[2] / slowdown**2, 0),
        }

    def crossings(self, at: At) -> Mapping[str, SX]:
        """Return the times since "start", "rise", "brake" and "end" [s], where a jumps.

        "rise" is the end of the acceleration, "brake" the begin of the braking.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        times = _ptp_times(at.begin, at.end, at.v_max, at.a_max)
        slowdown, begun = self._slowdown(at, times[-1]), at.clock - at.start_time
        after = {
            n: begun - slowdown * t for n, t in zip(("rise", "brake", "end"), times, strict=True)
        }
        return {"start": begun, **after}

    def _slowdown(self, at: At, shortest: SX) -> SX:
        """Return the factor by which the given duration slows down the fastest motion.

        It is `duration` divided by `shortest`, the shortest duration [s]; 1 without duration or
        distance.
        """
        if at.duration is None:
            return SX(1)
        return casadi.if_else(
            shortest > 0, at.duration / casadi.if_else(shortest > 0, shortest, 1), 1
        )


def _ptp_times(begin: SX, end: SX, v_max: SX, a_max: SX) -> tuple[SX, SX, SX]:
    """Return the ends of acceleration and of constant speed, and the end of the motion [s].

    They are times since the start of the fastest motion from `begin` to `end`, with the limits
    `v_max` and `a_max`.
    """
    distance = casadi.fabs(end - begin)
    rise = casadi.fmin(v_max / a_max, casadi.sqrt(distance / a_max))
    peak = a_max * rise
    last = rise + casadi.if_else(peak > 0, distance / casadi.if_else(peak > 0, peak, 1), 0)
    return SX(rise), SX(last - rise), SX(last)


# Periodic sources. A period is a sequence of phases; an event ends each of them.


class PeriodicSource(SignalSource):
    """Base class of periodic sources: an event ends each phase of a period.

    Attributes:
        left: time to the next event [s]; -1 before the first event, which is at the first time.
        phase: index of the present phase; -1 before the first event.
        number: index of the present period; -1 before start_time.
        entered: clock at the begin of the present phase [s].
    """

    left = custom.state("s", start=-1.0)
    phase = custom.mode(-1.0)
    number = custom.mode(-1.0)
    entered = custom.mode()

    def _durations(self, at: At) -> list[SX]:
        """Return the duration of each phase of a period [s]."""
        raise NotImplementedError

    def _level(self, at: At, since: SX) -> list[SX]:
        """Return the height in each phase, divided by the amplitude.

        `since` is the time since the start of the phase [s].
        """
        raise NotImplementedError

    def _require_count(self) -> None:
        """Raise DescriptionError if `count` is a number that is negative or not whole."""
        count = self._parameter_value("count")
        if count is not None and (count < 0 or count != int(count)):
            raise DescriptionError(
                f"{self.name}: count is {count:g}; give a whole number of periods, or leave it out"
            )

    def outputs(self, at: At) -> Mapping[str, SX]:
        """Return {"y": offset, plus amplitude times the height of the present phase}.

        It is the offset before start_time and after the last period.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        level = self._level(at, at.clock - at.entered)
        height = sum((casadi.if_else(at.phase == k, h, 0) for k, h in enumerate(level)), SX(0))
        return {
            "y": at.offset
            + casadi.if_else(self._has_period(at, at.number), at.amplitude * height, 0)
        }

    def _has_period(self, at: At, number: SX) -> SX:
        """Return whether the period of index `number` exists: 0 <= number < count.

        Without a count there is no upper limit.
        """
        begun = number >= 0
        return begun if at.count is None else casadi.logic_and(begun, number < at.count)

    def rates(self, at: At) -> Mapping[str, SX]:
        """Return {"clock": 1, "left": -1}; the rate of `left` is zero after the last period.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        over = SX(0) if at.count is None else at.number >= at.count
        return {**SignalSource.rates(self, at), "left": casadi.if_else(over, 0, -1)}

    def events(self, at: At) -> Mapping[str, Event]:
        """Return the event "switches" at left = 0, which sets phase, number, left and entered.

        It starts the next phase. The first event, at the first time, finds the phase of that time.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        durations = self._durations(at)
        period = sum(durations, SX(0))
        last = len(durations) - 1
        # the first event
        begun = at.clock - at.start_time
        number = casadi.floor(begun / period)
        within = begun - number * period
        ends = [sum(durations[: k + 1], SX(0)) for k in range(last)]
        phase = sum((end <= within for end in ends), SX(0))
        passed = zip(ends, durations[:last], strict=True)
        entered = sum((casadi.if_else(end <= within, d, 0) for end, d in passed), SX(0))
        late, first = at.clock < at.start_time, at.phase < 0
        begin = {
            "phase": casadi.if_else(late, last, phase),
            "number": casadi.if_else(late, -1, number),
            "left": casadi.if_else(late, -begun, _element_at(durations, phase) + entered - within),
            "entered": at.clock - casadi.if_else(late, 0, within - entered),
        }
        # all others
        next_phase = casadi.if_else(at.phase == last, 0, at.phase + 1)
        counted = at.number + (at.phase == last)
        over = SX(0) if at.count is None else counted >= at.count
        follow = {
            "phase": next_phase,
            "number": counted,
            # after the last period the time to the next event stays at some positive value
            "left": casadi.if_else(over, period, _element_at(durations, next_phase)),
            "entered": at.clock,
        }
        return {
            "switches": Event(
                at.left, {n: casadi.if_else(first, begin[n], follow[n]) for n in begin}
            )
        }


def _element_at(values: Sequence[SX], index: SX) -> SX:
    """Return the element of `values` at `index`, an expression; zero if it is out of range."""
    return sum((casadi.if_else(index == k, value, 0) for k, value in enumerate(values)), SX(0))


class Pulse(PeriodicSource):
    """Rectangular pulses: y = offset + amplitude in the first part of each period, else offset.

    Attributes:
        period: time from pulse to pulse [s].
        amplitude: height of a pulse.
        duty: length of a pulse as a part of the period, from 0 to 1.
        start_time: time at which the first pulse begins [s].
        offset: value between pulses.
        count: number of pulses; unlimited if left out.
    """

    period = custom.parameter("s", positive=True)
    amplitude = custom.parameter("1", 1.0)
    duty = custom.parameter("1", 0.5, min=0, max=1)
    start_time = custom.parameter("s", 0.0)
    offset = custom.parameter("1", 0.0)
    count = custom.parameter("1", None, min=0)

    def __post_init__(self) -> None:
        Custom.__post_init__(self)
        self._require_count()

    def _durations(self, at: At) -> list[SX]:
        """Return the durations of the pulse and of the rest of a period [s]."""
        return [SX(at.duty * at.period), SX((1 - at.duty) * at.period)]

    def _level(self, at: At, since: SX) -> list[SX]:
        """Return the heights of a pulse (1) and of the rest of a period (0), for any `since`."""
        return [SX(1), SX(0)]


class Trapezoid(PeriodicSource):
    """Trapezoidal pulses: y rises, stays at offset + amplitude, falls, and stays at offset.

    Attributes:
        period: time from pulse to pulse [s].
        width: time at full height [s].
        amplitude: height of a pulse.
        rising: duration of the rise [s].
        falling: duration of the fall [s].
        start_time: time at which the first rise begins [s].
        offset: value between pulses.
        count: number of pulses; unlimited if left out.
    """

    period = custom.parameter("s", positive=True)
    width = custom.parameter("s", min=0)
    amplitude = custom.parameter("1", 1.0)
    rising = custom.parameter("s", 0.0, min=0)
    falling = custom.parameter("s", 0.0, min=0)
    start_time = custom.parameter("s", 0.0)
    offset = custom.parameter("1", 0.0)
    count = custom.parameter("1", None, min=0)

    def __post_init__(self) -> None:
        Custom.__post_init__(self)
        self._require_count()
        found = [self._parameter_value(name) for name in ("period", "rising", "width", "falling")]
        period, *parts = (value if value is not None else 0.0 for value in found)
        # the sum of decimal fractions may exceed the period by rounding
        if found[0] is not None and sum(parts) > period * (1 + 1e-12):
            raise DescriptionError(
                f"{self.name}: rising, width and falling are {sum(parts):g} s together, the period"
                f" is {period:g} s; give a longer period or shorter parts"
            )

    def _durations(self, at: At) -> list[SX]:
        """Return the durations of rise, full height, fall and rest of a period [s]."""
        rest = casadi.fmax(at.period - at.rising - at.width - at.falling, 0)
        return [at.rising, at.width, at.falling, rest]

    def _level(self, at: At, since: SX) -> list[SX]:
        """Return the heights in rise, full height, fall and rest, from 0 to 1.

        `since` is the time since the start of the phase [s].
        """
        rise, fall = (since / casadi.if_else(t > 0, t, 1) for t in (at.rising, at.falling))
        return [rise, SX(1), 1 - fall, SX(0)]


# Tables.


SMOOTHNESS = ("linear", "hold", "akima", "monotone")
"""Interpolation of a table between its points."""
EXTRAPOLATION = ("hold", "linear", "periodic")
"""Extrapolation of a table before its first and after its last point."""


class Table(SignalSource):
    """A signal from a table of times and values.

    An event at each time of the table sets the polynomial of the next interval. The cost of a step
    does not depend on the number of points.

    Two equal times make a jump: y has the second value from that time on.

    Source: Akima 1970; Fritsch and Butland 1984 for monotone polynomials.

    Attributes:
        times: two or more times in increasing order [s].
        values: values of y at these times.
        smoothness: "linear"; "hold" for the value of the last point; "akima" or "monotone" for
            cubic polynomials with continuous slopes, which need scipy.
        extrapolation: outside the table: "hold" for the first or last value; "linear" for the slope
            of the first or last interval; "periodic" for repetition.
        left: time to the next event [s]; -1 before the first event, which is at the first time.
        row: index of the present interval; -1 before the first event.
        knot: clock at the begin of the interval [s].
        c0, c1, c2, c3: coefficients of the polynomial in the time since the knot.
    """

    times: Any
    values: Any
    smoothness: str = "linear"
    extrapolation: str = "hold"
    left = custom.state("s", start=-1.0)
    row = custom.mode(-1.0)
    knot = custom.mode()
    c0 = custom.mode()
    c1 = custom.mode()
    c2 = custom.mode()
    c3 = custom.mode()

    def __post_init__(self) -> None:
        Custom.__post_init__(self)
        for name, known in (("smoothness", SMOOTHNESS), ("extrapolation", EXTRAPOLATION)):
            given = getattr(self, name)
            if given not in known:
                raise DescriptionError(
                    f"{self.name}: {name} is {quoted(given)}; {did_you_mean(str(given), known)}"
                )
        points = [self._column(name) for name in ("times", "values")]
        times, values = points
        if len(times) != len(values) or len(times) < 2:
            raise DescriptionError(
                f"{self.name}: there are {len(times)} times and {len(values)} values; give as many"
                " values as times, and at least two"
            )
        back = np.flatnonzero(np.diff(times) < 0)
        if len(back):
            k = int(back[0])
            raise DescriptionError(
                f"{self.name}: time {k + 1} is {times[k]:g} s, time {k + 2} is {times[k + 1]:g} s;"
                " give times in increasing order"
            )
        if times[0] == times[-1]:
            raise DescriptionError(
                f"{self.name}: all times are {times[0]:g} s; give an interval of time"
            )
        smooth = self.smoothness in ("akima", "monotone")
        if smooth and np.any(np.diff(times) == 0):
            raise DescriptionError(
                f"{self.name}: two times are equal, which is a jump, but smoothness is"
                f" {quoted(self.smoothness)}; use 'linear' or 'hold', or times that differ"
            )
        object.__setattr__(self, "times", tuple(times.tolist()))
        object.__setattr__(self, "values", tuple(values.tolist()))
        self._intervals()  # raises here, not during assembly, if scipy is missing

    def _column(self, name: str) -> Array:
        """Return the field `name` as an array (n,).

        Raise DescriptionError if it is not finite numbers.
        """
        try:
            found = np.array(getattr(self, name), dtype=float).reshape(-1)
        except (TypeError, ValueError):
            found = np.array([math.nan])
        if not np.isfinite(found).all():
            raise DescriptionError(
                f"{self.name}: {name} are {quoted(getattr(self, name))}; give finite numbers"
            )
        return found

    @classmethod
    def from_csv(
        cls,
        name: str,
        path: str | Path,
        *,
        time: str | int = 0,
        value: str | int = 1,
        smoothness: str = "linear",
        extrapolation: str = "hold",
    ) -> Table:
        """Return the table of two columns of a file of comma-separated values.

        Commas, semicolons and tabs separate columns. A first line without numbers has the names of
        the columns. Empty lines and lines that begin with # are skipped.

        Args:
            name: name of the component.
            path: path of the file.
            time: name or index, from 0, of the column of times [s].
            value: name or index of the column of values.
            smoothness: smoothness of the table.
            extrapolation: extrapolation of the table.

        Raises:
            DescriptionError: the file cannot be read, a column does not exist, or a cell is no
                number. The message has the file and the line.
        """
        rows = _csv_rows(name, Path(path))
        _, first = rows[0]
        names = [cell.strip() for cell in first] if not all(map(_is_number, first)) else []
        columns = [_csv_column(name, path, one, names, len(first)) for one in (time, value)]
        found: list[tuple[float, ...]] = []
        for line, cells in rows[1:] if names else rows:
            picked = [cells[k] if k < len(cells) else "" for k in columns]
            for cell in picked:
                if not _is_number(cell):
                    raise DescriptionError(
                        f"{name}: {path}, line {line}: {quoted(cell)} is no number; give a number"
                        " in each cell"
                    )
            found.append(tuple(map(float, picked)))
        times, values = zip(*found, strict=True) if found else ((), ())
        make: Any = cls  # the fields of a Custom are made when the class is
        table: Table = make(name, times, values, smoothness, extrapolation)
        return table

    def _intervals(self) -> tuple[Array, Array]:
        """Return the starts [s] of all intervals, and their cubic polynomials with c0 first.

        They are (n + 1,) and (n + 1, 4) for n points.

        The first interval is before the table, and its polynomial starts at the first time. The
        last interval is after the table. The n - 1 others are between successive points.
        """
        t, y = np.array(self.times), np.array(self.values)
        keep = np.diff(t) > 0
        begins, steps = t[:-1][keep], np.diff(t)[keep]
        inner = np.zeros((len(begins), 4))
        if self.smoothness in ("akima", "monotone"):
            inner = _cubics(self.name, self.smoothness, t, y)
        else:
            inner[:, 0] = y[:-1][keep]
            if self.smoothness == "linear":
                inner[:, 1] = np.diff(y)[keep] / steps
        outside = np.zeros((2, 4))
        outside[:, 0] = y[0], y[-1]
        if self.extrapolation == "linear":
            _, c1, c2, c3 = inner[-1]
            h = steps[-1]
            outside[:, 1] = inner[0, 1], c1 + 2 * c2 * h + 3 * c3 * h**2
        every = np.vstack([outside[:1], inner, outside[1:]])
        return np.concatenate([begins[:1], begins, t[-1:]]), every

    def rates(self, at: At) -> Mapping[str, SX]:
        """Return {"clock": 1, "left": -1}; the rate of `left` is zero after the table.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        last = len(self._intervals()[0]) - 1
        return {**SignalSource.rates(self, at), "left": casadi.if_else(at.row == last, 0, -1)}

    def outputs(self, at: At) -> Mapping[str, SX]:
        """Return {"y": polynomial of the present interval at the clock}.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        s = at.clock - at.knot
        return {"y": at.c0 + s * (at.c1 + s * (at.c2 + s * at.c3))}

    def events(self, at: At) -> Mapping[str, Event]:
        """Return the event "next" at left = 0, which sets left, row, knot and c0 .. c3.

        It starts the next interval. The first event, at the first time, finds the interval of that
        time.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        begins, polynomials = self._intervals()
        last, span = len(begins) - 1, begins[-1] - begins[0]
        periodic = self.extrapolation == "periodic"
        turns = casadi.floor((at.clock - begins[0]) / span) * span if periodic else SX(0)
        within = at.clock - turns  # time in the first period
        found = sum((within >= begin for begin in begins[1:]), SX(0))
        following = at.row + 1
        if periodic:
            following = casadi.if_else(following == last, 1, following)
        first = at.row < 0
        row = casadi.if_else(first, found, following)
        begin, *c = _rows_at(np.column_stack([begins, polynomials]), row)
        # the interval before the table ends at the first time, as it begins
        end = _rows_at(np.append(begins[1:], begins[-1] + 1.0)[:, None], row)[0]
        knot = casadi.if_else(first, turns + begin, at.clock)
        left = casadi.if_else(first, end - within, end - begin)
        # after the table the time to the next event stays at 1 s
        then = {"left": casadi.if_else(row == last, 1, left), "row": row, "knot": knot}
        return {
            "next": Event(at.left, {**then, **dict(zip(("c0", "c1", "c2", "c3"), c, strict=True))})
        }


def _rows_at(table: Array, row: SX) -> list[SX]:
    """Return the elements of a row of a numeric table; `row`, its index, is an expression."""
    picked = casadi.vertcat(*(row == k for k in range(len(table))))
    found = casadi.mtimes(picked.T, DM(table))
    return [found[k] for k in range(table.shape[1])]


def _cubics(name: str, smoothness: str, t: Array, y: Array) -> Array:
    """Return the coefficients (n - 1, 4) of the cubics between n points (t, y), c0 first.

    `smoothness` is "akima" or "monotone". Raise DescriptionError, with the component `name`, if
    scipy is missing.
    """
    try:
        from scipy.interpolate import Akima1DInterpolator, PchipInterpolator
    except ImportError:
        raise DescriptionError(
            f"{name}: smoothness {quoted(smoothness)} needs scipy; install casadi-mbs[identify], or"
            " use 'linear'"
        ) from None
    kind = Akima1DInterpolator if smoothness == "akima" else PchipInterpolator
    found: Array = kind(t, y).c.T[:, ::-1]
    return found


def _csv_rows(name: str, path: Path) -> list[tuple[int, list[str]]]:
    """Return (line number from 1, cells) of each line of a file, without empty lines and comments.

    Raise DescriptionError, with the component `name`, if it cannot be read or has no rows.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise DescriptionError(f"{name}: {path} cannot be read: {error}") from None
    lines = [(k, line) for k, line in enumerate(text.splitlines(), start=1)]
    lines = [(k, line) for k, line in lines if line.strip() and not line.lstrip().startswith("#")]
    if not lines:
        raise DescriptionError(f"{name}: {path} has no rows; give a file with times and values")
    separator = max(",;\t", key=lines[0][1].count)
    cells = csv.reader((line for _, line in lines), delimiter=separator)
    return [(k, row) for (k, _), row in zip(lines, cells, strict=True)]


def _csv_column(name: str, path: str | Path, given: str | int, names: list[str], count: int) -> int:
    """Return the index of a column; raise DescriptionError if it does not exist.

    `given` is its name in `names` or its index below `count`; `name` is the component in the
    message.
    """
    if isinstance(given, str):
        if given in names:
            return names.index(given)
        known = did_you_mean(given, names) if names else "the file has no names; give an index"
        raise DescriptionError(f"{name}: {path} has no column {quoted(given)}; {known}")
    if not isinstance(given, int) or isinstance(given, bool) or not 0 <= given < count:
        raise DescriptionError(
            f"{name}: column {given!r} is not in {path}; give an index from 0 to {count - 1}"
        )
    return given


def _is_number(cell: str) -> bool:
    """Return whether the text of a cell is a finite number."""
    try:
        return math.isfinite(float(cell))
    except ValueError:
        return False


# References of prescribed motions.


class ReferenceFilter(SignalBlock):
    """A second-order filter that makes a smooth motion of a reference position.

    Outputs are the position `q`, its rate `v`, and `a`, the rate of `v`.

    The filter is of Bessel type: it delays the reference and overshoots by less than 1 %.

    Source: Modelica.Mechanics.Rotational.Sources.Position with exact=false.

    Attributes:
        frequency: frequency at which the gain is 1 / sqrt(2) [Hz].
        x: position; its start is the position at the start of the motion.
        w: rate of the position [1/s].
    """

    frequency = custom.parameter("Hz", positive=True)
    x = custom.state()
    w = custom.state("1/s")
    u = custom.input()
    q = custom.output()
    v = custom.output()
    a = custom.output()

    def rates(self, at: At) -> Mapping[str, SX]:
        """Return {"x": w, "w": acceleration [1/s2]}.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return {"x": at.w, "w": self._acceleration(at)}

    def outputs(self, at: At) -> Mapping[str, SX]:
        """Return the filtered position "q", its rate "v" and the rate "a" of v.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return {"q": at.x, "v": at.w, "a": self._acceleration(at)}

    def _acceleration(self, at: At) -> SX:
        """Return the acceleration of the filtered position for the input u [1/s2]."""
        w = 2 * math.pi * at.frequency
        # Bessel filter of order 2: 1 / (1 + 1.3617 s/w + 0.6180 (s/w)^2), -3 dB at w
        return SX((w * (at.u - at.x) - 1.3617 * at.w) * w / 0.6180)
