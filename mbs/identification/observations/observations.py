"""The equations that a record gives: as many for each instant as there are efforts."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt
from casadi import DM

from mbs.assembly import System
from mbs.errors import ModelError
from mbs.identification.base.base_parameters import BaseParameters
from mbs.identification.postures import positions
from mbs.identification.records.filters import ORDER, Samples, zero_phase
from mbs.identification.regressors.columns import Column
from mbs.identification.regressors.dynamic import known_efforts
from mbs.messages import did_you_mean

Array = npt.NDArray[np.float64]

KEPT_RATE = 1.8
"""Rows that are kept in a period of the bandwidth, which makes filtered white noise white again.

The two passes of the filter halve the power of noise at 0.9 of the bandwidth, about which its
spectrum folds; with more rows their errors depend on each other, with less the record is wasted.
"""

_SETTLED = 1.0
_BATCH = 500


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
    """

    time: Array
    W: Array
    y: Array
    columns: tuple[Column, ...]
    efforts: tuple[str, ...]
    effort_units: tuple[str, ...]

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
    """The equations of the samples, none filtered or dropped.

    What springs and force elements of the system take is subtracted from the efforts.

    Args:
        regressor: Function D(q, v, a) with `.columns` and `.system`, such as `regressor` gives.
        samples: positions, rates and efforts.

    Raises:
        ModelError: the samples have not the coordinates of the regressor.
    """
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
    full, rate = observe(regressor, samples), samples.rate
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
    return replace(full, time=full.time[keep], W=W, y=y)


def known_of(regressor: Any, samples: Samples) -> Array:
    """(n, m) efforts of springs and force elements, which have no column [N m or N]."""
    system: System = regressor.system
    if not _has_elements(system):
        return np.zeros(samples.tau.shape)
    q, v, _ = motion_of(regressor, samples)
    known = known_efforts(system, "independent" if _is_reduced(regressor) else "tree")
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


def _is_reduced(model: Any) -> bool:
    """Whether a model is in the independent velocities of a closed system."""
    return bool(model.system.is_closed and int(model.size1_in(1)) == len(model.system.active))


def _has_elements(system: System) -> bool:
    springs = any(not link.stiffness.is_zero() for link in system.tree.links)
    return springs or bool(system.forces)


def evaluated(model: Any, samples: Samples) -> list[Array]:
    """(n, rows, columns) every output of a model of (q, v) or (q, v, a) at every sample.

    Args:
        model: of the independent or tree coordinates of `model.system`.
        samples: of all joints, or of the independent ones.

    Raises:
        ModelError: the samples have not the coordinates of the model.
    """
    states = motion_of(model, samples)[: model.n_in()]
    n = len(samples.time)
    size = min(_BATCH, n)
    many = model.map(size)
    found = [np.empty((n, *model.size_out(k))) for k in range(model.n_out())]
    for start in [*range(0, n - size, size), n - size]:
        rows = slice(start, start + size)
        values = many(*(DM(x[rows].T) for x in states))
        for whole, part in zip(found, values if len(found) > 1 else [values], strict=True):
            m, k = whole.shape[1:]
            whole[rows] = np.asarray(part).reshape(m, size, k).transpose(1, 0, 2)
    return found
