"""Identified parameters, how sure they are, and what they leave unexplained."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from mbs.errors import ModelError
from mbs.identification.observations import Observations
from mbs.identification.regressors import Column
from mbs.result import _figure, _save
from mbs.text import did_you_mean

# Values that have names and a covariance: what estimates and full sets share.


Array = npt.NDArray[np.float64]


class NamedValues:
    """Parameters by name, and how sure they are.

    Attributes:
        what: they are, for messages.
        columns: the k parameters.
        values: (k,) in the unit of each.
        covariance: (k, k) of the values.
    """

    __slots__ = ()
    what: ClassVar[str]
    columns: tuple[Column, ...]
    values: Array
    covariance: Array

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return tuple(column.name for column in self.columns)

    def __getitem__(self, name: str) -> float:
        if name not in self.names:
            raise ModelError(
                f"{self.what}: there is no parameter {name!r}; {did_you_mean(name, self.names)}"
            )
        return float(self.values[self.names.index(name)])

    @property
    def deviations(self) -> Array:
        """(k,) standard deviations, in the unit of each parameter."""
        return np.asarray(np.sqrt(np.diag(self.covariance)), dtype=float)

    @property
    def percent(self) -> Array:
        """(k,) standard deviations in percent of the values; infinite for a value of zero."""
        return percent_of(self.values, self.covariance)


def percent_of(values: Array, covariance: Array) -> Array:
    """(k,) standard deviations in percent of the values; infinite for a value of zero."""
    sizes = np.abs(values)
    share = 100 * np.sqrt(np.diag(covariance)) / np.where(sizes > 0, sizes, 1.0)
    return np.asarray(np.where(sizes > 0, share, np.inf), dtype=float)


# What a set of parameters leaves unexplained.


_CHANCE = 2.0
"""Correlation of independent errors that is rarely passed, in parts of 1/sqrt(n)."""


@dataclass(frozen=True, slots=True, eq=False)
class Residuals:
    """Measured efforts and those that the parameters predict.

    Attributes:
        time: (n,) [s].
        measured: (n, m) [N m or N].
        predicted: (n, m) [N m or N].
        efforts: names of the m efforts.
        effort_units: their units.
    """

    time: Array
    measured: Array
    predicted: Array
    efforts: tuple[str, ...]
    effort_units: tuple[str, ...]

    @property
    def error(self) -> Array:
        """(n, m) measured minus predicted [N m or N]."""
        return self.measured - self.predicted

    @property
    def rms(self) -> Array:
        """(m,) root mean square of the error of each effort [N m or N]."""
        return np.asarray(np.sqrt(np.mean(self.error**2, axis=0)), dtype=float)

    @property
    def percent(self) -> Array:
        """(m,) norm of the error of each effort in percent of the norm of the effort."""
        sizes = np.linalg.norm(self.measured, axis=0)
        shares = np.linalg.norm(self.error, axis=0) / np.where(sizes > 0, sizes, 1.0)
        return np.asarray(100 * shares, dtype=float)

    @property
    def repetition(self) -> Array:
        """(m,) rows that say as much as one of independent error; see `repetition`."""
        return repetition(self.error)

    @property
    def total_percent(self) -> float:
        """Norm of all errors in percent of the norm of all efforts."""
        size = float(np.linalg.norm(self.measured))
        return 100 * float(np.linalg.norm(self.error)) / (size or 1.0)


def repetition(error: Array) -> Array:
    """(m,) rows that say as much as one of independent error: one plus twice the correlations.

    Correlations of each column with itself are summed from one row to the next up to the first
    that could be chance.

    Source: Bayley & Hammersley 1946.

    Args:
        error: (n, m) in equal steps of time.
    """
    n = len(error)
    found = np.ones(error.shape[1])
    for j, e in enumerate(error.T):
        size = float(e @ e)
        lag = 1
        while size > 0 and lag < n // 2:
            part = float(e[lag:] @ e[:-lag]) / size
            if part < _CHANCE / np.sqrt(n):
                break
            found[j] += 2 * part
            lag += 1
    return found


@dataclass(frozen=True, slots=True, eq=False)
class Estimate(NamedValues):
    """Values of parameters found from observations.

    Attributes:
        method: how they were found.
        columns: the k parameters.
        values: (k,) in the unit of each.
        covariance: (k, k) of the values; NaN where the method has none.
        weights: (m,) factor of each effort in the sum of squares [1/(N m) or 1/N].
        observations: that they were found from.
        rounds: how often the weights were set.
    """

    what: ClassVar[str] = "estimate"

    method: str
    columns: tuple[Column, ...]
    values: Array
    covariance: Array
    weights: Array
    observations: Observations
    rounds: int = 1

    def __repr__(self) -> str:
        error = self.residuals.total_percent
        return f"<Estimate: {len(self.values)} parameters, {self.method}, error {error:.3g} %>"

    @property
    def residuals(self) -> Residuals:
        """What it leaves unexplained of the observations that it was found from."""
        return self.residuals_on(self.observations)

    def residuals_on(self, observations: Observations) -> Residuals:
        """What it leaves unexplained of other observations, such as a part that was held out.

        Raises:
            ModelError: they have other parameters.
        """
        if observations.names != self.names:
            raise ModelError(
                f"estimate: the observations have {len(observations.names)} parameters, it has"
                f" {len(self.names)} others or in another order; select the same names"
            )
        return Residuals(
            observations.time,
            observations.y,
            observations.W @ self.values,
            observations.efforts,
            observations.effort_units,
        )


Estimator = Callable[[Observations], Estimate]
"""A method: least_squares, weighted, reweighted, robust, or one of them with its options."""


def held_out(estimator: Estimator, observations: Observations, part: float = 0.75) -> Residuals:
    """Residuals of the end of a record of parameters found from its beginning.

    Args:
        estimator: the method.
        observations: of the whole record.
        part: of the time from which the parameters are found.
    """
    known, unknown = observations.split(part)
    return estimator(known).residuals_on(unknown)


def cross_validated(estimator: Estimator, observations: Observations, count: int = 4) -> Residuals:
    """Residuals of every part of a record of parameters found from the other parts.

    Args:
        estimator: the method.
        observations: of the whole record.
        count: into how many parts it is cut; at least two.
    """
    if count < 2:
        raise ModelError(f"cross-validation: the record is cut into {count} parts; give 2 or more")
    pairs = observations.parts(count)
    found = [estimator(known).residuals_on(unknown) for known, unknown in pairs]
    time = np.concatenate([r.time for r in found])
    measured = np.concatenate([r.measured for r in found])
    predicted = np.concatenate([r.predicted for r in found])
    return Residuals(time, measured, predicted, observations.efforts, observations.effort_units)


# Pictures of measured and predicted efforts.


def plot_residuals(
    residuals: Residuals, path: str | os.PathLike[str] | None = None, title: str = ""
) -> Any:
    """Measured and predicted effort and their difference, a panel for each joint.

    Args:
        residuals: to draw.
        path: file to save the picture to, in the format that its ending names.
        title: above the panels.

    Returns:
        the matplotlib Figure.

    Raises:
        ModelError: matplotlib is missing.
        ExportError: the file cannot be written.
    """
    figure = _figure(len(residuals.efforts), shown=path is None)
    if title:
        figure.suptitle(title)
    panels = figure.subplots(len(residuals.efforts), 1, sharex=True, squeeze=False)[:, 0]
    for k, panel in enumerate(panels):
        panel.plot(residuals.time, residuals.measured[:, k], label="measured")
        panel.plot(residuals.time, residuals.predicted[:, k], "--", label="predicted")
        panel.plot(residuals.time, residuals.error[:, k], label="error")
        share = f"{residuals.percent[k]:.1f} %"
        panel.set_title(f"{residuals.efforts[k]}: error {share}", fontsize="small")
        panel.set_ylabel(f"[{residuals.effort_units[k]}]")
        panel.grid(True, alpha=0.3)  # fainter than lines
    panels[0].legend(loc="upper right", fontsize="small")
    panels[-1].set_xlabel("time [s]")
    if path is not None:
        _save(figure, path)
    return figure
