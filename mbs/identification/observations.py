"""The equations that a record gives: dynamic, filtered, energy; how well they show what."""

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
from mbs.identification.base_parameters import BaseParameters
from mbs.identification.leading import of_motion, positions, regular
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

# Rows of a record of a closed system that are next to singular configurations.


Array = npt.NDArray[np.float64]
Chosen = npt.NDArray[np.bool_]

_FEWEST = 0.5
"""Part of a record that must be away from singular configurations: the rest is taken out."""
_ROUNDING = 1e-9
"""Part of a span of time that is added to it, so that an instant at its end belongs to it however
times are rounded; samples are a thousand times further apart."""


def led_rows(system: System, q: Array) -> Chosen:
    """(n,) which configurations q (n, nq) of a closed system are not next to singular ones.

    Raises:
        ModelError: they are less than half of all.
    """
    good = regular(system, q)
    if good.mean() < _FEWEST:
        names = ", ".join(system.speeds[k].name for k in system.active)
        raise ModelError(
            f"{system.name}: {100 * (1 - good.mean()):.0f} % of the record is next to singular"
            f" configurations, where {names} do not lead the other joints; record a motion that"
            " keeps"
            " away from them, or assemble with other independent joints"
        )
    return good


def on_lines(values: Array, good: Chosen) -> Array:
    """(n, ...) values with straight lines between the rows that are good."""
    if good.all():
        return values
    at, known = np.arange(len(good)), np.flatnonzero(good)
    flat = values.reshape(len(good), -1).copy()
    for k in range(flat.shape[1]):
        flat[:, k] = np.interp(at, known, flat[known, k])
    return flat.reshape(values.shape)


def without(time: Array, bad: Array, ahead: float, back: float) -> Chosen:
    """(n,) instants that have none of the bad ones from `back` before to `ahead` after them."""
    first = np.searchsorted(bad, time - back * (1 + _ROUNDING), side="left")
    last = np.searchsorted(bad, time + ahead * (1 + _ROUNDING), side="right")
    return np.asarray(first == last, dtype=bool)


# Models at the samples of a record: the motion that they take, and what they give.


_BATCH = 500


def known_of(regressor: Any, samples: Samples) -> Array:
    """(n, m) efforts of springs and force elements, which have no column [N m or N]."""
    system: System = regressor.system
    if not _has_elements(system):
        return np.zeros(samples.tau.shape)
    q, v, _ = motion_of(regressor, samples)
    laws = [column.symbol for column in regressor.columns if column.symbol]
    kind = "independent" if _is_reduced(regressor) else "tree"
    known = of_motion(known_efforts(system, kind, laws))
    pairs = zip(q, v, strict=True)
    return np.array([DM(known(*state)).full()[:, 0] for state in pairs])


def motion_of(model: Any, samples: Samples) -> tuple[Array, Array, Array]:
    """Positions (n, nq), velocities and accelerations (n, m) that a model takes.

    The other joints of a closed system follow from the independent ones where the samples are of
    those alone.

    Args:
        model: of the independent or tree coordinates of `model.system`.
        samples: of all joints, or of the independent ones.

    Raises:
        ModelError: the samples have not the coordinates of the model.
    """
    system: System = model.system
    width, m = samples.q.shape[1], int(model.size1_in(1))
    if samples.tau.shape[1] == m:
        if width == system.nq == system.nv:
            chosen = list(system.active) if _is_reduced(model) else list(range(m))
            return samples.q, samples.v[:, chosen], samples.a[:, chosen]
        if width == m and _is_reduced(model):
            return positions(system, samples.q), samples.v, samples.a
    also = f" or {m}" if _is_reduced(model) else ""
    raise ModelError(
        f"observations: the samples have {width} positions and {samples.tau.shape[1]} efforts, the"
        f" model takes {system.nq}{also} and {m}; give every joint of the tree or the independent"
        " ones, and the efforts of the independent ones"
    )


def led_samples(model: Any, samples: Samples) -> npt.NDArray[np.bool_]:
    """(n,) instants at which the independent joints of a closed system lead the others.

    Raises:
        ModelError: they are less than half of all.
    """
    if samples.regular is not None:
        return samples.regular
    if not _is_reduced(model):
        return np.ones(len(samples.time), dtype=bool)
    return led_rows(model.system, motion_of(model, samples)[0])


def with_regular(model: Any, samples: Samples) -> Samples:
    """The samples with `regular` found, so that other motions near them keep the same instants."""
    return replace(samples, regular=led_samples(model, samples))


def _is_reduced(model: Any) -> bool:
    """Whether a model is in the independent velocities of a closed system."""
    return bool(model.system.is_closed and int(model.size1_in(1)) == len(model.system.active))


def _has_elements(system: System) -> bool:
    springs = any(not link.stiffness.is_zero() for link in system.tree.links)
    return springs or bool(system.parts)


def evaluated(model: Any, samples: Samples) -> list[Array]:
    """(n, rows, columns) every output of a model of (q, v) or (q, v, a) at every sample.

    Next to singular configurations of closed systems, straight lines take the place of the model.

    Args:
        model: of the independent or tree coordinates of `model.system`.
        samples: of all joints, or of the independent ones.

    Raises:
        ModelError: the samples have not the coordinates of the model, or it depends on states or
            inputs of components.
    """
    along = of_motion(model)  # measured positions close no loop exactly
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
    return [on_lines(whole, led_samples(model, samples)) for whole in found]


# The equations that a record gives: as many for each instant as there are efforts.


KEPT_RATE = 1.8
"""Rows that are kept in a period of the bandwidth, which makes filtered white noise white again.

The two passes of the filter halve the power of noise at 0.9 of the bandwidth, about which its
spectrum folds; with more rows their errors depend on each other, with less the record is wasted.
"""

_SETTLED = 1.0
_SPREAD = 2.0
"""Periods of the bandwidth in which the filter forgets what came before, and what comes after."""
_PAUSE = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class Observations:
    """y = W K + noise, for each instant and effort.

    Attributes:
        time: (n,) [s].
        W: (n, m, k) rows of the regressor, filtered as y.
        y: (n, m) efforts [N m or N].
        columns: the k parameters.
        efforts: names of the m efforts.
        effort_units: their units.
        dropped: instants that were left out, the configuration of a closed system being next to a
            singular one.
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
        """(n m, k) and (n m,) the equations one below the other."""
        return self.W.reshape(-1, self.W.shape[2]), self.y.reshape(-1)

    def __repr__(self) -> str:
        rows, m = self.y.shape
        return f"<Observations: {rows} instants of {m} efforts, {len(self.columns)} parameters>"

    def __len__(self) -> int:
        return int(self.y.size)

    def select(self, names: Sequence[str]) -> Observations:
        """The equations in these parameters alone, the others being zero.

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
        """The equations in base parameters: the columns of the eliminated ones are left out.

        Args:
            base: of the same columns.

        Raises:
            ModelError: it keeps a parameter that these equations do not have.
        """
        left = self.select([column.name for column in base.kept])
        named = zip(left.columns, base.names, strict=True)
        return replace(left, columns=tuple(replace(c, name=name) for c, name in named))

    def split(self, part: float) -> tuple[Observations, Observations]:
        """The equations up to this part of the time and those after it.

        Args:
            part: between 0 and 1.
        """
        first = self.time <= self.time[0] + part * (self.time[-1] - self.time[0])
        return self._rows_of(first), self._rows_of(~first)

    def parts(self, count: int) -> Iterator[tuple[Observations, Observations]]:
        """For each of `count` equal parts of the record: the rest, and the part itself."""
        number = np.arange(len(self.time)) * count // len(self.time)
        for k in range(count):
            yield self._rows_of(number != k), self._rows_of(number == k)

    def at(self, time: Array) -> Observations:
        """The equations of these instants [s], which must be among those of `time`."""
        return self._rows_of(np.isin(self.time, time))

    def _rows_of(self, keep: npt.NDArray[np.bool_]) -> Observations:
        return replace(self, time=self.time[keep], W=self.W[keep], y=self.y[keep])


def observe(regressor: Any, samples: Samples) -> Observations:
    """The equations of the samples, none filtered.

    What springs and force elements of the system take is subtracted from the efforts. Instants of
    a closed system next to singular configurations are left out.

    Args:
        regressor: Function D(q, v, a) with `.columns` and `.system`, such as `regressor` gives.
        samples: positions, rates and efforts.

    Raises:
        ModelError: the samples have not the coordinates of the regressor, or most are next to
            singular configurations.
    """
    keep = led_samples(regressor, samples)
    full = replace(_observe(regressor, samples), dropped=int(np.sum(~keep)))
    return full if keep.all() else full.at(samples.time[keep])


def _observe(regressor: Any, samples: Samples) -> Observations:
    """Every instant; next to singular configurations the regressor is on straight lines."""
    return Observations(
        samples.time,
        evaluated(regressor, samples)[0],
        samples.tau - known_of(regressor, samples),
        tuple(regressor.columns),
        samples.efforts,
        samples.effort_units,
    )


def observe_filtered(
    regressor: Any, samples: Samples, bandwidth: float | None = None, order: int = ORDER
) -> Observations:
    """The equations of the samples with the same filter on every column as on the efforts.

    The columns pass the filter that the efforts of the samples have passed already: a filtered
    product is not the product of filtered motions, least of all in Coulomb friction. A further
    filter may be put on both sides. Rows that then say nothing new are dropped, so that the noise
    of those that stay is nearly independent.

    Source: Gautier 1997 (parallel filtering and decimation).

    Args:
        regressor: Function D(q, v, a) with `.columns` and `.system`.
        samples: positions, rates and efforts.
        bandwidth: of a further filter on both sides [Hz], or None.
        order: of one pass of the filters.

    Raises:
        ModelError: the samples were not filtered and no bandwidth is given, or as for `observe`
            and `zero_phase`.
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
    """The equations without those that a filter or an interval mixes with singular configurations.

    Args:
        found: from the samples.
        model: of the samples.
        samples: whose time is that of `found`.
        before: time that an equation looks ahead [s].
        after: time that it looks back [s]; the same when left out.
    """
    bad = samples.time[~led_samples(model, samples)]
    keep = without(found.time, bad, before, before if after is None else after)
    return replace(found.at(found.time[keep]), dropped=int(np.sum(~keep)))


def stacked(parts: Sequence[Observations]) -> Observations:
    """The equations of several records one after the other.

    Times of a record go on where the one before ended, half a second later.

    Args:
        parts: one or more, of the same columns and efforts.

    Raises:
        ModelError: their efforts or columns differ.
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
    """One equation for each interval: work of the efforts = change of h K + integral of P K.

    Integrals are taken by the trapezoidal rule. One equation in place of one for each joint and
    instant: it is the weakest of the models in noise.

    Source: Khalil & Creusot 1997, eq. 47.

    Args:
        energy: ``energy_regressor``, (q, v) -> h with `.columns` and `.system`.
        power: ``power_regressor`` of the same columns.
        samples: positions, velocities and efforts; accelerations are not used.
        interval: [s].

    Raises:
        ModelError: the interval is shorter than a sample or longer than the record.
    """
    step = round(interval * samples.rate)
    if not 1 <= step < len(samples.time):
        raise ModelError(
            f"energy model: an interval of {interval:g} s has {step} of the {len(samples.time)}"
            " samples; give one or more, and less than the record has"
        )
    (h,), (P,) = evaluated(energy, samples), evaluated(power, samples)
    v = motion_of(energy, samples)[1]
    work = _integral(np.sum(v * (samples.tau - known_of(energy, samples)), axis=1), samples.rate)
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
    """From the first sample on, by the trapezoidal rule."""
    parts = (values[1:] + values[:-1]) / (2 * rate)
    return np.concatenate([np.zeros((1, *values.shape[1:])), np.cumsum(parts, axis=0)])


# Equations of the filtered model, which need no accelerations.
#
# Source: Khalil & Creusot 1997, eq. 41-46.


_SETTLED_PERIODS = 15.0
"""Time constants 1/a after which the filter has forgotten its start: 16 exp(-15), 5e-6 of it is
left, less than the noise of any record."""
_ROWS = 2.0
"""Time constants between rows, over which errors that the filter has passed are alike."""


def observe_momentum(filtered: Any, samples: Samples, corner: float) -> Observations:
    """F tau = (F' D1 + F D2) K with F = a^2 / (s + a)^2 and F' = s F.

    The time in which the filter forgets its start is left out, and rows that come sooner after
    another than two of its time constants, since their errors are alike.

    Source: Khalil & Creusot 1997, eq. 44-46; the filter by the bilinear transform.

    Args:
        filtered: ``filtered_regressor``, (q, v) -> D1, D2 with `.columns` and `.system`.
        samples: positions, velocities and efforts; accelerations are not used.
        corner: a [rad/s]; five to ten times the highest frequency of the motion.

    Raises:
        ModelError: the corner does not suit the samples, or they have not the coordinates.
    """
    rate = samples.rate
    settled = int(np.ceil(_SETTLED_PERIODS * rate / corner)) if corner > 0 else len(samples.time)
    if corner >= rate or settled >= len(samples.time) - 1:
        raise ModelError(
            f"filtered model: the corner is {corner:g} rad/s for {rate:g} samples in a second over"
            f" {len(samples.time) / rate:.3g} s; give less than {rate:g} and a longer record"
        )
    D1, D2 = evaluated(filtered, samples)
    tau = samples.tau - known_of(filtered, samples)
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
    signal = optional_module("scipy.signal", "identify")
    b, a = signal.bilinear(numerator, [1.0, 2 * corner, corner**2], fs=rate)
    return np.asarray(signal.lfilter(b, a, values, axis=0), dtype=float)


# The equations of a record by the name of their model.


INTERVALS = 1.0
"""Intervals of the energy model in a period of the bandwidth."""


def _dynamic(system: System, samples: Samples, bandwidth: float, options: Any) -> Observations:
    """Efforts, filtered once more on both sides."""
    return observe_filtered(regressor(system, **options), samples)


def _filter(system: System, samples: Samples, bandwidth: float, options: Any) -> Observations:
    """Momenta behind a filter whose corner is the bandwidth; no accelerations."""
    return observe_momentum(filtered_regressor(system, **options), samples, 2 * np.pi * bandwidth)


def _energy(system: System, samples: Samples, bandwidth: float, options: Any) -> Observations:
    """Work over intervals of a period of the bandwidth; no accelerations."""
    models = energy_regressor(system, **options), power_regressor(system, **options)
    return observe_energy(*models, samples, 1 / (INTERVALS * bandwidth))


EQUATIONS: Mapping[str, Callable[[System, Samples, float, Any], Observations]] = MappingProxyType(
    {"dynamic": _dynamic, "filtered": _filter, "energy": _energy}
)
"""Models by name: (system, samples, bandwidth, options of the columns) -> the equations."""


# How well a record shows the parameters, and which it does not show.


_NOTHING = 1e-9
"""Column below this part of the longest that the record does not show: rounding, 1e-15 of the
largest motion, is below it, and what sensors tell, 1e-5, above."""
_DEPENDENT = 1e-7
"""Singular values of columns of length one below this part of the largest count as zero: rounding
makes 1e-15 of it, and directions that a record shows by less than 1e-7 are lost in any noise."""
_SHARE = 0.05
"""Part of a direction without effect from which on a parameter is named as one of those behind
it."""
_LISTED = 8
"""Names in a sentence; more are counted."""


@dataclass(frozen=True, slots=True, eq=False)
class ExcitationQuality:
    """The singular values of the observations, and the parameters behind those that are zero.

    Attributes:
        condition: largest over smallest singular value of W.
        scaled_condition: the same with every column of length one, which no choice of units moves.
        singular_values: (k,) of the scaled columns, those of unseen parameters zero.
        unseen: parameters that no effort depends on.
        inseparable: parameters of which only combinations can be found, more than those that the
            combinations need.
    """

    condition: float
    scaled_condition: float
    singular_values: Array
    unseen: tuple[str, ...]
    inseparable: tuple[str, ...]

    @property
    def sentence(self) -> str:
        """What is wrong with the record, or an empty text."""
        parts = []
        if self.unseen:
            parts.append(f"{_list(self.unseen)} cannot be seen at all")
        if self.inseparable:
            parts.append(f"{_list(self.inseparable)} cannot be told apart")
        return " and ".join(parts)


def excitation_quality(observations: Observations) -> ExcitationQuality:
    """The condition number of the observations and the parameters that they do not show.

    Columns of zeros are taken out first, then every column is scaled to length one; otherwise
    rounding would count as a column.

    Source: Gautier 1991 (numerical rank); Presse & Gautier 1993 (condition number).
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
    """The quality of observations that show every parameter.

    Raises:
        ModelError: names the parameters that cannot be seen or told apart.
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


def _list(names: tuple[str, ...]) -> str:
    more = len(names) - _LISTED
    return ", ".join(names[:_LISTED]) + (f" and {more} more" if more > 0 else "")
