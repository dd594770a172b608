"""The equations that a record gives: as many for each instant as there are efforts."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from mbs.errors import ModelError
from mbs.identification.base.base_parameters import BaseParameters
from mbs.identification.observations.evaluated import evaluated, known_of, led_samples
from mbs.identification.observations.singular import without
from mbs.identification.records.filters import ORDER, Samples, zero_phase
from mbs.identification.regressors.columns import Column
from mbs.messages import did_you_mean

Array = npt.NDArray[np.float64]

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
        dropped: instants that were left out, the posture of a closed system being next to a
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
    a closed system next to singular postures are left out.

    Args:
        regressor: Function D(q, v, a) with `.columns` and `.system`, such as `regressor` gives.
        samples: positions, rates and efforts.

    Raises:
        ModelError: the samples have not the coordinates of the regressor, or most are next to
            singular postures.
    """
    keep = led_samples(regressor, samples)
    full = replace(_observed(regressor, samples), dropped=int(np.sum(~keep)))
    return full if keep.all() else full.at(samples.time[keep])


def _observed(regressor: Any, samples: Samples) -> Observations:
    """Every instant; next to singular postures the regressor is on straight lines."""
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
    product is not the product of filtered motions, least of all in dry friction. A further filter
    may be put on both sides. Rows that then say nothing new are dropped, so that the noise of
    those that stay is nearly independent.

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
    full, rate = _observed(regressor, samples), samples.rate
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
    """The equations without those that a filter or an interval mixes with singular postures.

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
