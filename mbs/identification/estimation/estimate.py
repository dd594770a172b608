"""Identified parameters, how sure they are, and what they leave unexplained."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from mbs.errors import ModelError
from mbs.identification.estimation.named_values import NamedValues
from mbs.identification.estimation.residuals import Residuals
from mbs.identification.observations.observations import Observations
from mbs.identification.regressors.columns import Column

Array = npt.NDArray[np.float64]


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
