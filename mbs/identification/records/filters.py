"""From a record to samples in equal steps: the same zero-phase filter on positions and efforts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from mbs.errors import ModelError
from mbs.identification.records.record import Record
from mbs.result import optional_module

Array = npt.NDArray[np.float64]

ORDER = 4
"""Order of the Butterworth filter, which runs once forwards and once backwards."""

WORKING_RATE = 20.0
"""Samples in a period of the bandwidth that are kept for the regressor."""

_SLOW = 10.0
"""Records of less samples in a second may have time in another unit [Hz]."""

DROPPED = 5.0
"""Periods of the bandwidth that are left out at both ends, where the filter settles."""


@dataclass(frozen=True, slots=True, eq=False)
class Samples:
    """Positions, their rates, and efforts at equal steps of time.

    Attributes:
        time: (n,) [s].
        q: (n, nq) positions [rad or m].
        v: (n, nq) velocities [rad/s or m/s].
        a: (n, nq) accelerations [rad/s2 or m/s2].
        tau: (n, m) efforts [N m or N].
        efforts: names of the efforts.
        effort_units: their units.
        bandwidth: of what was left by the filter [Hz], or None where nothing was filtered.
        led: (n,) whether a posture of a closed system keeps clear of singular ones; None where
            that is still to be found.
    """

    time: Array
    q: Array
    v: Array
    a: Array
    tau: Array
    efforts: tuple[str, ...]
    effort_units: tuple[str, ...]
    bandwidth: float | None = None
    led: npt.NDArray[np.bool_] | None = None

    def __post_init__(self) -> None:
        n = len(self.time)
        shapes = [x.shape for x in (self.q, self.v, self.a)]
        if len(set(shapes)) != 1 or shapes[0][0] != n or len(self.tau) != n:
            raise ModelError(
                f"samples: q, v, a and tau have the shapes {shapes[0]}, {shapes[1]}, {shapes[2]}"
                f" and {self.tau.shape} for {n} instants; give a row for each instant"
            )

    @property
    def rate(self) -> float:
        """Samples in a second [Hz]."""
        return (len(self.time) - 1) / float(self.time[-1] - self.time[0])


def resampled(record: Record, rate: float | None = None) -> Record:
    """The record at equal steps of time, on straight lines between its rows.

    Nothing is filtered: at a lower rate than that of the record, noise folds into the motion.

    Args:
        record: at any steps.
        rate: samples in a second [Hz]; that of the usual step of the record by default.
    """
    usual = 1.0 / float(np.median(np.diff(record.time)))
    wanted = usual if rate is None else rate
    span = float(record.time[-1] - record.time[0])
    if not wanted > 0:
        raise ModelError(f"resampling: the rate is {wanted:g} Hz; give more than zero")
    time = record.time[0] + np.arange(int(span * wanted * (1 + 1e-12)) + 1) / wanted

    def at_times(values: Array) -> Array:
        columns = (np.interp(time, record.time, x) for x in values.T)
        return np.column_stack(list(columns))

    v = None if record.v is None else at_times(record.v)
    described = (record.names, record.units, record.limits, record.efforts, record.effort_units)
    return Record(time, at_times(record.q), at_times(record.tau), v, *described)


def zero_phase(values: Array, rate: float, bandwidth: float, order: int = ORDER) -> Array:
    """Low-pass Butterworth filter run forwards and backwards, so that nothing is delayed.

    Source: Gautier 1997 (filtering of positions and efforts); Gustafsson 1996 (two passes).

    Args:
        values: (n, ...) samples in equal steps.
        rate: of the samples [Hz].
        bandwidth: at which each pass leaves 0.71 of a sine [Hz].
        order: of one pass.

    Returns:
        (n, ...) the samples that are left.

    Raises:
        ModelError: the bandwidth is not between zero and half the rate, or there are too few
            samples for the filter.
    """
    if not 0 < bandwidth < rate / 2:
        hint = "; time is in s, is that of the record in ms?" if rate < _SLOW else ""
        raise ModelError(
            f"filter: the bandwidth is {bandwidth:g} Hz for {rate:g} samples in a second; give more"
            f" than zero and less than {rate / 2:g} Hz{hint}"
        )
    padding = 3 * (2 * ((order + 1) // 2) + 1)
    if len(values) <= padding:
        raise ModelError(
            f"filter: {len(values)} samples are too few for it; give a record of more than"
            f" {padding} samples"
        )
    signal = optional_module("scipy.signal", "identify")
    sections = signal.butter(order, bandwidth, fs=rate, output="sos")
    return np.asarray(signal.sosfiltfilt(sections, values, axis=0), dtype=float)


def central_difference(values: Array, rate: float) -> Array:
    """Rate of change by central differences over five samples, of fourth order.

    Args:
        values: (n, k) samples in equal steps; n is five or more.
        rate: of the samples [Hz].

    Returns:
        (n, k) rates; the two at each end are of second order.
    """
    slope = np.gradient(values, 1.0 / rate, axis=0, edge_order=2)
    wide = 8 * (values[3:-1] - values[1:-3]) - (values[4:] - values[:-4])
    slope[2:-2] = wide * (rate / 12)
    return np.asarray(slope, dtype=float)


def smoothed(record: Record, bandwidth: float, order: int = ORDER) -> Samples:
    """Samples for a regressor: velocities and accelerations are differences of positions.

    Positions and efforts go through the same filter; samples that the bandwidth does not need and
    those at both ends, where the filter settles, are dropped.

    Source: Gautier 1997; Khalil & Dombre 2002, chapter 12.

    Args:
        record: at any steps of time.
        bandwidth: of the filter [Hz]; five to ten times the highest frequency of the motion.
        order: of one pass of the filter.

    Raises:
        ModelError: the bandwidth does not suit the rate, or nothing would be left.
    """
    even = _without_gaps(record, bandwidth)
    rate = _rate(even)
    q = zero_phase(even.q, rate, bandwidth, order)
    return _trimmed(even, q, central_difference(q, rate), bandwidth, order)


def smoothed_with_velocity(record: Record, bandwidth: float, order: int = ORDER) -> Samples:
    """As `smoothed`, with the measured velocities; accelerations are their differences.

    Args:
        record: with velocities.
        bandwidth: of the filter [Hz].
        order: of one pass of the filter.

    Raises:
        ModelError: the record has no velocities, or as for `smoothed`.
    """
    if record.v is None:
        raise ModelError("record: no velocities were measured; use smoothed(), or give v")
    even = _without_gaps(record, bandwidth)
    assert even.v is not None
    rate = _rate(even)
    q, v = (zero_phase(x, rate, bandwidth, order) for x in (even.q, even.v))
    return _trimmed(even, q, v, bandwidth, order)


def _without_gaps(record: Record, bandwidth: float) -> Record:
    """The record at equal steps; a straight line over a longer gap would be taken for motion."""
    steps = np.diff(record.time)
    longest = float(steps.max())
    usual = float(np.median(steps))
    if longest > max(0.5 / bandwidth, 2 * usual) and bandwidth > 0:
        start = float(record.time[int(np.argmax(steps))])
        raise ModelError(
            f"record: nothing was measured for {longest:.3g} s from {start:.6g} s, which is more"
            f" than half a period of the bandwidth of {bandwidth:g} Hz; give identify the"
            f" list record.pieces({0.5 / bandwidth:.3g}), or a bandwidth that is lower"
        )
    return resampled(record)


def _rate(record: Record) -> float:
    return (len(record.time) - 1) / float(record.time[-1] - record.time[0])


def _trimmed(even: Record, q: Array, v: Array, bandwidth: float, order: int) -> Samples:
    """Accelerations, filtered efforts, and the rows that are worth keeping."""
    rate = _rate(even)
    a = central_difference(v, rate)
    tau = zero_phase(even.tau, rate, bandwidth, order)
    ends = int(np.ceil(DROPPED * rate / bandwidth))
    step = max(int(rate / (WORKING_RATE * bandwidth)), 1)
    keep = slice(ends, len(even.time) - ends, step)
    time = even.time[keep]
    if len(time) < 2 * WORKING_RATE:
        raise ModelError(
            f"record: {even.time[-1] - even.time[0]:.3g} s are too short for a bandwidth of"
            f" {bandwidth:g} Hz, which takes {DROPPED / bandwidth:.3g} s at each end; give a longer"
            " record"
        )
    q, v, a, tau = (x[keep] for x in (q, v, a, tau))
    return Samples(time, q, v, a, tau, even.efforts, even.effort_units, bandwidth)
