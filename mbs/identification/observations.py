"""Identification equations of records (dynamic, filtered, energy) and their quality."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

import numpy as np
import numpy.typing as npt
from casadi import DM

from mbs.assembly import System
from mbs.errors import ModelError
from mbs.identification._base_parameters import BaseParameters
from mbs.identification.leading import motion_function, positions, regular
from mbs.identification.record import ORDER, Samples, zero_phase
from mbs.identification.regressors import (
    Column,
    energy_regressor,
    filtered_regressor,
    known_efforts,
    power_regressor,
    regressor,
)
from mbs.identification.triangle import triangle
from mbs.numbers import NONZERO
from mbs.result import optional_module
from mbs.text import did_you_mean

# Rows of a record of a closed-loop system that are close to singular configurations.


Array = npt.NDArray[np.float64]
Chosen = npt.NDArray[np.bool_]

_FEWEST = 0.5
"""Smallest fraction of a record that must be away from singular configurations. The remaining
rows are left out."""
_ROUNDING = 1e-9
"""Relative enlargement of a time interval, so that an instant at its end belongs to the
interval in spite of rounding. Sampling periods are a thousand times larger."""


def regular_rows(system: System, q: Array) -> Chosen:
    """Return a mask (n,) of the configurations that are not close to singular ones.

    Args:
        system: closed system.
        q: (n, nq) positions in the order of time [rad or m].

    Raises:
        ModelError: more than half of the configurations are close to singular ones.
    """
    good = regular(system, q)
    if good.mean() < _FEWEST:
        names = ", ".join(system.velocity_coordinates[k].name for k in system.independent)
        raise ModelError(
            f"{system.name}: {100 * (1 - good.mean()):.0f} % of the record is next to singular"
            f" configurations, where {names} do not lead the other joints; record a motion that"
            " keeps"
            " away from them, or assemble with other independent joints"
        )
    return good


def interpolated(values: Array, good: Chosen) -> Array:
    """Return values with the rows that are not good replaced by linear interpolation.

    Args:
        values: (n, ...) values in the order of time.
        good: (n,) mask of the rows that are kept.
    """
    if good.all():
        return values
    at, known = np.arange(len(good)), np.flatnonzero(good)
    flat = values.reshape(len(good), -1).copy()
    for k in range(flat.shape[1]):
        flat[:, k] = np.interp(at, known, flat[known, k])
    return flat.reshape(values.shape)


def outside_windows(time: Array, bad: Array, ahead: float, back: float) -> Chosen:
    """Return a mask (n,) of the instants t that have no bad instant in [t - back, t + ahead].

    Args:
        time: (n,) instants [s].
        bad: sorted bad instants [s].
        ahead: length of the window after an instant [s].
        back: length of the window before an instant [s].
    """
    first = np.searchsorted(bad, time - back * (1 + _ROUNDING), side="left")
    last = np.searchsorted(bad, time + ahead * (1 + _ROUNDING), side="right")
    return np.asarray(first == last, dtype=bool)


# Evaluation of models at the samples of a record.


_BATCH = 500


def known_efforts_at(regressor: Any, samples: Samples) -> Array:
    """Return the efforts (n, m) of springs and force elements that have no column [N m or N].

    Args:
        regressor: Function D(q, v, a) with `.columns` and `.system`.
        samples: motion at which the efforts are evaluated.
    """
    system: System = regressor.system
    if not _has_elements(system):
        return np.zeros(samples.tau.shape)
    q, v, _ = motion_of(regressor, samples)
    laws = [column.symbol for column in regressor.columns if column.symbol]
    kind = "independent" if _is_reduced(regressor) else "tree"
    known = motion_function(known_efforts(system, kind, laws))
    pairs = zip(q, v, strict=True)
    return np.array([DM(known(*state)).full()[:, 0] for state in pairs])


def motion_of(model: Any, samples: Samples) -> tuple[Array, Array, Array]:
    """Return positions (n, nq), velocities and accelerations (n, m) at which to evaluate a model.

    If the samples contain only the independent joints of a closed system, the positions of the
    other joints are computed from them.

    Args:
        model: model in the independent or tree coordinates of `model.system`.
        samples: motion of all joints, or of the independent joints.

    Raises:
        ModelError: the widths of the samples do not match the coordinates of the model.
    """
    system: System = model.system
    width, m = samples.q.shape[1], int(model.size1_in(1))
    if samples.tau.shape[1] == m:
        if width == system.nq == system.nv:
            chosen = list(system.independent) if _is_reduced(model) else list(range(m))
            return samples.q, samples.v[:, chosen], samples.a[:, chosen]
        if width == m and _is_reduced(model):
            return positions(system, samples.q), samples.v, samples.a
    also = f" or {m}" if _is_reduced(model) else ""
    raise ModelError(
        f"observations: the samples have {width} positions and {samples.tau.shape[1]} efforts, the"
        f" model takes {system.nq}{also} and {m}; give every joint of the tree or the independent"
        " ones, and the efforts of the independent ones"
    )


def regular_samples(model: Any, samples: Samples) -> npt.NDArray[np.bool_]:
    """Return a mask (n,) of the samples that are not close to singular configurations.

    It is all True for an open system and for a model in tree coordinates.

    Args:
        model: model in the independent or tree coordinates of `model.system`.
        samples: motion of all joints, or of the independent joints. Its mask `regular` is returned
            if it is set.

    Raises:
        ModelError: more than half of the samples are close to singular configurations.
    """
    if samples.regular is not None:
        return samples.regular
    if not _is_reduced(model):
        return np.ones(len(samples.time), dtype=bool)
    return regular_rows(model.system, motion_of(model, samples)[0])


def with_regular(model: Any, samples: Samples) -> Samples:
    """Return the samples with their mask `regular` set, so that it is computed only once.

    Args:
        model: model in the independent or tree coordinates of `model.system`.
        samples: motion of all joints, or of the independent joints.
    """
    return replace(samples, regular=regular_samples(model, samples))


def _is_reduced(model: Any) -> bool:
    """Whether the model is in the independent velocities of a closed system."""
    return bool(model.system.is_closed and int(model.size1_in(1)) == len(model.system.independent))


def _has_elements(system: System) -> bool:
    """Whether the system has joint springs or force elements."""
    springs = any(not link.stiffness.is_zero() for link in system.tree.links)
    return springs or bool(system.parts)


def evaluated(model: Any, samples: Samples) -> list[Array]:
    """Evaluate a model of (q, v) or (q, v, a) at every sample.

    Close to singular configurations of closed systems, the values are interpolated linearly.

    Args:
        model: model in the independent or tree coordinates of `model.system`.
        samples: motion of all joints, or of the independent joints.

    Returns:
        One array (n, rows, columns) for each output of the model.

    Raises:
        ModelError: the widths of the samples do not match the coordinates of the model, or the
            model depends on states or inputs of components.
    """
    along = motion_function(model)  # # measured positions do not close the loops exactly
    states = motion_of(model, samples)[: along.n_in()]
    n = len(samples.time)
    size = min(_BATCH, n)
    many = along.map(size)
    found = [np.empty((n, *model.size_out(k))) for k in range(model.n_out())]
    for start in [*range(0, n - size, size), n - size]:
        rows = slice(start, start + size)
        values = many(*(DM(x[rows].T) for x in states))
        for whole, part in zip(found, values if len(found) > 1 else [values], strict=True):
            m, k = whole.shape[1:]
            whole[rows] = np.asarray(part).reshape(m, size, k).transpose(1, 0, 2)
    return [interpolated(whole, regular_samples(model, samples)) for whole in found]


# Equations of a record: one row per instant and effort.


KEPT_RATE = 1.8
"""Rows that are kept per period of the bandwidth, so that filtered white noise is nearly white.

The two passes of the filter halve the power of noise at 0.9 of the bandwidth, which is the Nyquist
frequency of the kept rows. More rows have correlated errors; fewer rows lose information.
"""

_SETTLED = 1.0
_SPREAD = 2.0
"""Periods of the bandwidth in which the filter response to earlier and later samples decays."""
_PAUSE = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class Observations:
    """Linear identification equations y = W K + noise, one row per instant and effort.

    Attributes:
        time: (n,) instants [s].
        W: (n, m, k) observation matrix: rows of the regressor, filtered as y.
        y: (n, m) measured efforts [N m or N].
        columns: the k parameters of K.
        efforts: names of the m efforts.
        effort_units: units of the efforts.
        dropped: number of instants that were left out because the configuration of a closed system
            is close to a singular one.
    """

    time: Array
    W: Array
    y: Array
    columns: tuple[Column, ...]
    efforts: tuple[str, ...]
    effort_units: tuple[str, ...]
    dropped: int = 0

    def __post_init__(self) -> None:
        if self.W.shape != (*self.y.shape, len(self.columns)):
            raise ModelError(
                f"observations: W has the shape {self.W.shape} for efforts {self.y.shape} and"
                f" {len(self.columns)} columns; give (n, m, columns)"
            )
        if not (np.isfinite(self.W).all() and np.isfinite(self.y).all()):
            raise ModelError("observations: a number is not finite; check the regressor's inputs")

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return tuple(column.name for column in self.columns)

    @property
    def rows(self) -> tuple[Array, Array]:
        """W (n m, k) and y (n m,) with the rows of all instants stacked."""
        return self.W.reshape(-1, self.W.shape[2]), self.y.reshape(-1)

    def __repr__(self) -> str:
        rows, m = self.y.shape
        return f"<Observations: {rows} instants of {m} efforts, {len(self.columns)} parameters>"

    def __len__(self) -> int:
        return int(self.y.size)

    def select(self, names: Sequence[str]) -> Observations:
        """Return the equations with only the named columns; other parameters are assumed zero.

        Args:
            names: names of parameters, in the order of the new columns.

        Raises:
            ModelError: a name is unknown.
        """
        known = self.names
        for name in names:
            if name not in known:
                raise ModelError(
                    f"observations: there is no parameter {name!r}; {did_you_mean(name, known)}"
                )
        chosen = [known.index(name) for name in names]
        columns = tuple(self.columns[k] for k in chosen)
        return replace(self, W=self.W[:, :, chosen], columns=columns)

    def grouped(self, base: BaseParameters) -> Observations:
        """Return the equations in base parameters, without the columns of eliminated parameters.

        Args:
            base: base parameters of the same columns.

        Raises:
            ModelError: a kept base parameter has no column in these equations.
        """
        left = self.select([column.name for column in base.kept])
        named = zip(left.columns, base.names, strict=True)
        return replace(left, columns=tuple(replace(c, name=name) for c, name in named))

    def split(self, part: float) -> tuple[Observations, Observations]:
        """Split the equations in time into a first and a second set.

        Args:
            part: fraction of the duration in the first set, between 0 and 1.
        """
        first = self.time <= self.time[0] + part * (self.time[-1] - self.time[0])
        return self._rows_of(first), self._rows_of(~first)

    def parts(self, count: int) -> Iterator[tuple[Observations, Observations]]:
        """Yield, for each of `count` equal parts of the record, the other parts and that part.

        Args:
            count: number of parts.
        """
        number = np.arange(len(self.time)) * count // len(self.time)
        for k in range(count):
            yield self._rows_of(number != k), self._rows_of(number == k)

    def at(self, time: Array) -> Observations:
        """Return the equations at some of the instants.

        Args:
            time: instants [s], which must be elements of `self.time`; others are ignored.
        """
        return self._rows_of(np.isin(self.time, time))

    def _rows_of(self, keep: npt.NDArray[np.bool_]) -> Observations:
        """Return the observations of the instants at which the mask `keep` (n,) is True."""
        return replace(self, time=self.time[keep], W=self.W[keep], y=self.y[keep])


def observe(regressor: Any, samples: Samples) -> Observations:
    """Return the identification equations of the samples, without further filtering.

    Efforts of springs and force elements without a column are subtracted from the measured efforts.
    Instants at which a closed system is close to a singular configuration are left out.

    Args:
        regressor: Function D(q, v, a) with `.columns` and `.system`, such as the result of
            `regressor`.
        samples: positions, velocities, accelerations and efforts.

    Raises:
        ModelError: the widths of the samples do not match the coordinates of the regressor, or more
            than half of the samples are close to singular configurations.
    """
    keep = regular_samples(regressor, samples)
    full = replace(_observe(regressor, samples), dropped=int(np.sum(~keep)))
    return full if keep.all() else full.at(samples.time[keep])


def _observe(regressor: Any, samples: Samples) -> Observations:
    """Return the equations of every sample, interpolated close to singular configurations.

    `regressor` is a model of `regressors.py`, evaluated at every sample.
    """
    return Observations(
        samples.time,
        evaluated(regressor, samples)[0],
        samples.tau - known_efforts_at(regressor, samples),
        tuple(regressor.columns),
        samples.efforts,
        samples.effort_units,
    )


def observe_filtered(
    regressor: Any, samples: Samples, bandwidth: float | None = None, order: int = ORDER
) -> Observations:
    """Return the identification equations, with the columns filtered as the efforts.

    The columns pass the filter that was applied to the efforts of the samples: the filtered product
    of signals differs from the product of filtered signals, in particular for Coulomb friction. A
    further filter may be applied to both sides. The rows are then decimated, so that the noise of
    the kept rows is nearly independent.

    Source: Gautier 1997 (parallel filtering and decimation).

    Args:
        regressor: Function D(q, v, a) with `.columns` and `.system`.
        samples: positions, velocities, accelerations and efforts.
        bandwidth: bandwidth of a further filter on both sides [Hz], or None.
        order: order of one pass of the filters.

    Raises:
        ModelError: the samples are unfiltered and no bandwidth is given. Also the errors of
            `observe` and `zero_phase`.
    """
    further = [] if bandwidth is None else [bandwidth]
    passed = [] if samples.bandwidth is None else [samples.bandwidth]
    if not passed + further:
        raise ModelError("observations: the samples were not filtered; give a bandwidth in Hz")
    full, rate = _observe(regressor, samples), samples.rate
    narrowest = min(passed + further)
    step = max(round(rate / (KEPT_RATE * narrowest)), 1)
    ends = int(np.ceil(_SETTLED * rate / narrowest))
    keep = slice(ends, len(full.time) - ends, step)

    def behind(values: Array, bandwidths: list[float]) -> Array:
        for one in bandwidths:
            values = zero_phase(values, rate, one, order)
        return values[keep]

    y = behind(full.y, further)
    W = np.empty((*y.shape, len(full.columns)))
    for k in range(len(full.columns)):
        W[:, :, k] = behind(full.W[:, :, k], passed + further)
    found = replace(full, time=full.time[keep], W=W, y=y)
    return clear_of_singular(found, regressor, samples, _SPREAD / narrowest)


def clear_of_singular(
    found: Observations, model: Any, samples: Samples, before: float, after: float | None = None
) -> Observations:
    """Return the equations whose time window contains no sample close to a singular configuration.

    Args:
        found: equations of the samples.
        model: model with which the singular configurations are found.
        samples: the complete samples.
        before: length of the window after the instant of an equation [s].
        after: length of the window before that instant [s]. The default is the same length.
    """
    bad = samples.time[~regular_samples(model, samples)]
    keep = outside_windows(found.time, bad, before, before if after is None else after)
    return replace(found.at(found.time[keep]), dropped=int(np.sum(~keep)))


def stacked(parts: Sequence[Observations]) -> Observations:
    """Concatenate the equations of several records.

    The times of each record are shifted to start half a second after the end of the previous
    record.

    Args:
        parts: one or more sets of equations with the same columns and efforts.

    Raises:
        ModelError: the efforts or columns differ.
    """
    first = parts[0]
    if len(parts) == 1:
        return first
    times = [first.time]
    for part in parts[1:]:
        if (part.names, part.efforts) != (first.names, first.efforts):
            raise ModelError(
                f"observations: one record has the efforts {', '.join(first.efforts)}, another"
                f" {', '.join(part.efforts)}; give records of the same joints"
            )
        times.append(part.time - part.time[0] + times[-1][-1] + _PAUSE)
    return replace(
        first,
        time=np.concatenate(times),
        W=np.concatenate([part.W for part in parts]),
        y=np.concatenate([part.y for part in parts]),
        dropped=sum(part.dropped for part in parts),
    )


# Equations of the energy model: work of the efforts over intervals of time.
#
# Source: Gautier & Khalil 1988; Khalil & Creusot 1997, eq. 47-52.


def observe_energy(energy: Any, power: Any, samples: Samples, interval: float) -> Observations:
    """Return one equation per interval: work of the efforts = change of h K + integral of P K.

    Integrals use the trapezoidal rule. The energy model has one equation per interval instead of
    one per joint and instant, and is the model that is most sensitive to noise.

    Source: Khalil & Creusot 1997, eq. 47.

    Args:
        energy: ``energy_regressor``, (q, v) -> h with `.columns` and `.system`.
        power: ``power_regressor`` with the same columns.
        samples: positions, velocities and efforts. Accelerations are not used.
        interval: length of an interval [s].

    Raises:
        ModelError: the interval is shorter than a sampling period or longer than the record.
    """
    step = round(interval * samples.rate)
    if not 1 <= step < len(samples.time):
        raise ModelError(
            f"energy model: an interval of {interval:g} s has {step} of the {len(samples.time)}"
            " samples; give one or more, and less than the record has"
        )
    (h,), (P,) = evaluated(energy, samples), evaluated(power, samples)
    v = motion_of(energy, samples)[1]
    work = _integral(
        np.sum(v * (samples.tau - known_efforts_at(energy, samples)), axis=1), samples.rate
    )
    taken = h[:, 0] + _integral(P[:, 0], samples.rate)
    ends = np.arange(0, len(samples.time), step)
    found = Observations(
        samples.time[ends[1:]],
        np.diff(taken[ends], axis=0)[:, None, :],
        np.diff(work[ends])[:, None],
        tuple(energy.columns),
        ("energy",),
        ("J",),
    )
    return clear_of_singular(found, energy, samples, 0.0, step / samples.rate)


def _integral(values: Array, rate: float) -> Array:
    """Return the cumulative integral of values (n, ...) over time by the trapezoidal rule.

    `rate` is the sampling rate [Hz]; the integral is zero at the first sample.
    """
    parts = (values[1:] + values[:-1]) / (2 * rate)
    return np.concatenate([np.zeros((1, *values.shape[1:])), np.cumsum(parts, axis=0)])


# Equations of the filtered model, which need no accelerations.
#
# Source: Khalil & Creusot 1997, eq. 41-46.


_SETTLED_PERIODS = 15.0
"""Time constants 1/a after which the initial transient of the filter is dropped. It has then
decayed to 16 exp(-15), or 5e-6 of its start, which is less than the noise of any record."""
_ROWS = 2.0
"""Time constants between kept rows. The errors of closer rows are strongly correlated."""


def observe_momentum(filtered: Any, samples: Samples, corner: float) -> Observations:
    """Return the equations F tau = (F' D1 + F D2) K with F = a^2 / (s + a)^2 and F' = s F.

    The initial transient of the filter is dropped. Of the remaining rows, one per two time
    constants is kept, because the errors of closer rows are correlated.

    Source: Khalil & Creusot 1997, eq. 44-46. The filter is discretised by the bilinear transform.

    Args:
        filtered: ``filtered_regressor``, (q, v) -> D1, D2 with `.columns` and `.system`.
        samples: positions, velocities and efforts. Accelerations are not used.
        corner: corner frequency a [rad/s], five to ten times the highest frequency of the motion.

    Raises:
        ModelError: the corner frequency is too high for the sampling rate or too low for the
            record, or the samples do not match the coordinates of the model.
    """
    rate = samples.rate
    settled = int(np.ceil(_SETTLED_PERIODS * rate / corner)) if corner > 0 else len(samples.time)
    if corner >= rate or settled >= len(samples.time) - 1:
        raise ModelError(
            f"filtered model: the corner is {corner:g} rad/s for {rate:g} samples in a second over"
            f" {len(samples.time) / rate:.3g} s; give less than {rate:g} and a longer record"
        )
    D1, D2 = evaluated(filtered, samples)
    tau = samples.tau - known_efforts_at(filtered, samples)
    plain, slope = ([0.0, 0.0, corner**2], [0.0, corner**2, 0.0])
    keep = slice(settled, None, max(round(_ROWS * rate / corner), 1))
    W = (
        _filtered_signal(D1, slope, corner, rate)[keep]
        + _filtered_signal(D2, plain, corner, rate)[keep]
    )
    found = Observations(
        samples.time[keep],
        W,
        _filtered_signal(tau, plain, corner, rate)[keep],
        tuple(filtered.columns),
        samples.efforts,
        samples.effort_units,
    )
    return clear_of_singular(found, filtered, samples, 0.0, _SETTLED_PERIODS / corner)


def _filtered_signal(values: Array, numerator: list[float], corner: float, rate: float) -> Array:
    """Return values (n, m) filtered by numerator / (s + corner)^2.

    Args:
        values: (n, m) samples.
        numerator: three coefficients of the numerator, highest power of s first.
        corner: corner frequency [rad/s].
        rate: sampling rate [Hz].
    """
    signal = optional_module("scipy.signal", "identify")
    b, a = signal.bilinear(numerator, [1.0, 2 * corner, corner**2], fs=rate)
    return np.asarray(signal.lfilter(b, a, values, axis=0), dtype=float)


# Equations of a record, by the name of the identification model.


INTERVALS = 1.0
"""Number of intervals of the energy model per period of the bandwidth."""


def _dynamic_equations(
    system: System, samples: Samples, bandwidth: float, options: Any
) -> Observations:
    """Return the equations of the dynamic model, with the same filter on both sides.

    `bandwidth` is unused, because the samples contain it; `options` are those of `columns_of`.
    """
    return observe_filtered(regressor(system, **options), samples)


def _filtered_equations(
    system: System, samples: Samples, bandwidth: float, options: Any
) -> Observations:
    """Return the equations of the filtered model with the bandwidth [Hz] as corner frequency.

    `options` are those of `columns_of`.
    """
    return observe_momentum(filtered_regressor(system, **options), samples, 2 * np.pi * bandwidth)


def _energy_equations(
    system: System, samples: Samples, bandwidth: float, options: Any
) -> Observations:
    """Return the equations of the energy model, with intervals of one period of the bandwidth [Hz].

    `options` are those of `columns_of`.
    """
    models = energy_regressor(system, **options), power_regressor(system, **options)
    return observe_energy(*models, samples, 1 / (INTERVALS * bandwidth))


EQUATIONS: Mapping[str, Callable[[System, Samples, float, Any], Observations]] = MappingProxyType(
    {"dynamic": _dynamic_equations, "filtered": _filtered_equations, "energy": _energy_equations}
)
"""Functions of the identification models: (system, samples, bandwidth, column options) ->
equations."""


# Excitation quality of a record, and parameters that are not identifiable from it.


_NOTHING = 1e-9
"""Norm of a column, relative to the largest, below which its parameter counts as unobserved.
Rounding errors are about 1e-15 and the resolution of sensors about 1e-5 of the largest motion."""
_DEPENDENT = 1e-7
"""Singular values of the normalised columns below this fraction of the largest count as zero.
Rounding errors are about 1e-15, and directions below 1e-7 are lost in the noise of any record."""
_SHARE = 0.05
"""Component in an unobservable direction (unit vector) above which a parameter is named as
inseparable."""
_LISTED = 8
"""Maximum number of names in an error message. Further names are counted."""


@dataclass(frozen=True, slots=True, eq=False)
class ExcitationQuality:
    """Singular values of the observation matrix, and the parameters that it does not determine.

    Attributes:
        condition: condition number of W.
        scaled_condition: condition number of W with columns of unit length, which is independent of
            the units.
        singular_values: (k,) singular values of the scaled columns; zero for unobserved parameters.
        unseen: names of the parameters on which no effort depends.
        inseparable: names of the parameters that are identifiable only in linear combinations.
    """

    condition: float
    scaled_condition: float
    singular_values: Array
    unseen: tuple[str, ...]
    inseparable: tuple[str, ...]

    @property
    def sentence(self) -> str:
        """Names of the parameters that are not identifiable, as text; empty if there are none."""
        parts = []
        if self.unseen:
            parts.append(f"{_name_list(self.unseen)} cannot be seen at all")
        if self.inseparable:
            parts.append(f"{_name_list(self.inseparable)} cannot be told apart")
        return " and ".join(parts)


def excitation_quality(observations: Observations) -> ExcitationQuality:
    """Return the condition number of the observations and the parameters they do not determine.

    Zero columns are removed first. The other columns are scaled to unit length, since otherwise
    rounding errors would count as independent columns. Condition numbers are infinite if a
    parameter is not identifiable.

    Source: Gautier 1991 (numerical rank); Presse & Gautier 1993 (condition number).

    Args:
        observations: equations y = W K.
    """
    R = triangle(observations.rows[0])
    names = np.array(observations.names)
    lengths = np.linalg.norm(R, axis=0)
    seen = lengths > _NOTHING * max(float(lengths.max(initial=0.0)), NONZERO)
    _, values, modes = np.linalg.svd(R[:, seen] / lengths[seen])
    values = np.concatenate([values, np.zeros(len(modes) - len(values))])
    null = modes[values <= _DEPENDENT * values.max(initial=0.0)]
    inseparable = names[seen][np.abs(null).max(axis=0, initial=0.0) > _SHARE]
    missing = np.zeros(int((~seen).sum()))
    raw = np.linalg.svd(R, compute_uv=False)
    full = len(null) == 0 and len(missing) == 0 and len(R) >= len(names)
    return ExcitationQuality(
        float(raw[0] / raw[-1]) if full else float("inf"),
        float(values[0] / values[-1]) if full else float("inf"),
        np.concatenate([values, missing]),
        tuple(str(name) for name in names[~seen]),
        tuple(str(name) for name in inseparable),
    )


def require_visible(observations: Observations) -> ExcitationQuality:
    """Return the excitation quality of observations; raise if a parameter is not identifiable.

    Args:
        observations: equations y = W K.

    Raises:
        ModelError: there are fewer equations than parameters, or some parameters are not
            identifiable: their columns of W are zero or linearly dependent. The message names them.
    """
    count, rows = len(observations.columns), len(observations)
    if rows < count:
        dropped = observations.dropped
        left_out = f", {dropped} next to singular configurations being left out" if dropped else ""
        raise ModelError(
            f"observations: {rows} equations are too few for {count} parameters{left_out}; give a"
            " longer record"
        )
    quality = excitation_quality(observations)
    if quality.sentence:
        raise ModelError(
            f"observations: {quality.sentence} in this record; group them with base_parameters,"
            " select others, or record a motion that excites them"
        )
    return quality


def _name_list(names: tuple[str, ...]) -> str:
    """Return names as text, separated by commas; names after the eighth are only counted."""
    more = len(names) - _LISTED
    return ", ".join(names[:_LISTED]) + (f" and {more} more" if more > 0 else "")
