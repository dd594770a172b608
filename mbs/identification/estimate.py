"""Parameter estimates, their standard deviations and residuals."""

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

# Named values with a covariance: base class of estimates and full sets.


Array = npt.NDArray[np.float64]


class NamedValues:
    """Parameter values with names and a covariance.

    Attributes:
        what: kind of the values, for error messages.
        columns: the k parameters.
        values: (k,) values, in the units of the columns.
        covariance: (k, k) covariance of the values.
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
        """Standard deviations (k,), in the units of the parameters."""
        return np.asarray(np.sqrt(np.diag(self.covariance)), dtype=float)

    @property
    def percent(self) -> Array:
        """Standard deviations (k,) in percent of the values; infinite for a value of zero."""
        return percent_of(self.values, self.covariance)


def percent_of(values: Array, covariance: Array) -> Array:
    """Return standard deviations (k,) in percent of the values.

    Args:
        values: (k,) parameters; a value of zero gives infinity.
        covariance: (k, k) covariance of the parameters.
    """
    sizes = np.abs(values)
    share = 100 * np.sqrt(np.diag(covariance)) / np.where(sizes > 0, sizes, 1.0)
    return np.asarray(np.where(sizes > 0, share, np.inf), dtype=float)


# Residuals of a set of parameters.


_CHANCE = 2.0
"""Autocorrelation that independent errors rarely exceed, as a multiple of 1/sqrt(n)."""


@dataclass(frozen=True, slots=True, eq=False)
class Residuals:
    """Measured efforts and efforts predicted by the parameters.

    Attributes:
        time: (n,) instants [s].
        measured: (n, m) measured efforts [N m or N].
        predicted: (n, m) predicted efforts [N m or N].
        efforts: names of the m efforts.
        effort_units: units of the efforts.
    """

    time: Array
    measured: Array
    predicted: Array
    efforts: tuple[str, ...]
    effort_units: tuple[str, ...]

    @property
    def error(self) -> Array:
        """Residuals (n, m): measured minus predicted efforts [N m or N]."""
        return self.measured - self.predicted

    @property
    def rms(self) -> Array:
        """Root mean square (m,) of the residuals of each effort [N m or N]."""
        return np.asarray(np.sqrt(np.mean(self.error**2, axis=0)), dtype=float)

    @property
    def percent(self) -> Array:
        """Norm (m,) of the residuals of each effort in percent of the norm of the effort."""
        sizes = np.linalg.norm(self.measured, axis=0)
        shares = np.linalg.norm(self.error, axis=0) / np.where(sizes > 0, sizes, 1.0)
        return np.asarray(100 * shares, dtype=float)

    @property
    def repetition(self) -> Array:
        """Number (m,) of correlated rows with the information of one independent row."""
        return repetition(self.error)

    @property
    def total_percent(self) -> float:
        """Norm of all residuals in percent of the norm of all efforts."""
        size = float(np.linalg.norm(self.measured))
        return 100 * float(np.linalg.norm(self.error)) / (size or 1.0)


def repetition(error: Array) -> Array:
    """Return the number (m,) of correlated rows with the information of one independent row.

    It is 1 plus twice the sum of the autocorrelations of each column, up to the first lag whose
    autocorrelation could be random.

    Source: Bayley & Hammersley 1946.

    Args:
        error: (n, m) residuals at equal time steps.
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
    """Parameter values estimated from observations.

    Attributes:
        method: name of the estimation method.
        columns: the k parameters.
        values: (k,) values, in the units of the columns.
        covariance: (k, k) covariance of the values; NaN if the method has none.
        weights: (m,) factor of each effort in the sum of squares [1/(N m) or 1/N].
        observations: observations of the estimation.
        rounds: number of iterations of the weights.
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
        """Residuals on the observations of the estimation."""
        return self.residuals_on(self.observations)

    def residuals_on(self, observations: Observations) -> Residuals:
        """Return the residuals of these parameters on other observations, such as validation data.

        Args:
            observations: equations in the same parameters, in the same order.

        Raises:
            ModelError: the observations have other parameters.
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
"""Estimation method: least_squares, weighted, reweighted, robust, or such a function with
options set."""


def holdout_residuals(
    estimator: Estimator, observations: Observations, part: float = 0.75
) -> Residuals:
    """Estimate parameters from the beginning of a record and return residuals on its end.

    Args:
        estimator: estimation method.
        observations: observations of the whole record.
        part: fraction of the duration that is used for the estimation.

    Returns:
        Residuals at the instants after that fraction.
    """
    known, unknown = observations.split(part)
    return estimator(known).residuals_on(unknown)


def cross_validated(estimator: Estimator, observations: Observations, count: int = 4) -> Residuals:
    """Return the residuals of each part of a record, with parameters from the other parts.

    Args:
        estimator: estimation method.
        observations: observations of the whole record.
        count: number of parts, at least two.

    Returns:
        Residuals at all instants of the record.

    Raises:
        ModelError: `count` is less than two.
    """
    if count < 2:
        raise ModelError(f"cross-validation: the record is cut into {count} parts; give 2 or more")
    pairs = observations.parts(count)
    found = [estimator(known).residuals_on(unknown) for known, unknown in pairs]
    time = np.concatenate([r.time for r in found])
    measured = np.concatenate([r.measured for r in found])
    predicted = np.concatenate([r.predicted for r in found])
    return Residuals(time, measured, predicted, observations.efforts, observations.effort_units)


# Plots of measured and predicted efforts.


def plot_residuals(
    residuals: Residuals, path: str | os.PathLike[str] | None = None, title: str = ""
) -> Any:
    """Plot measured and predicted effort and their difference, with one panel per joint.

    Args:
        residuals: residuals to plot.
        path: path of the image file to write; its suffix selects the format.
        title: title above the panels.

    Returns:
        The matplotlib Figure.

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
        panel.grid(True, alpha=0.3)  # grid fainter than the curves
    panels[0].legend(loc="upper right", fontsize="small")
    panels[-1].set_xlabel("time [s]")
    if path is not None:
        _save(figure, path)
    return figure
