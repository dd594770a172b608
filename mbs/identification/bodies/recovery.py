"""From identified base parameters to a full set of parameters that bodies can have."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from mbs.errors import ModelError
from mbs.identification.bodies.physical_set import Misfit, likeliest
from mbs.identification.bodies.prior import Prior
from mbs.identification.estimation.estimate import Estimate
from mbs.identification.estimation.named_values import NamedValues
from mbs.identification.regressors.columns import Column

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class FullSet(NamedValues):
    """A full set of parameters and how far it is from the base parameters it was made of.

    Attributes:
        columns: the k parameters.
        values: (k,) in the unit of each.
        covariance: (k, k) of the values, the guess taken as a measurement.
        base_names: of the base parameters.
        misfit: (count,) its base parameters minus the identified ones, in standard deviations.
    """

    what: ClassVar[str] = "full set"

    columns: tuple[Column, ...]
    values: Array
    covariance: Array
    base_names: tuple[str, ...]
    misfit: Array


def recovered(
    estimate: Estimate,
    columns: Sequence[Column],
    matrix: Array,
    prior: Prior | None = None,
) -> FullSet:
    """The full set nearest to the guess among those that explain the base parameters.

    Nearest in the entropic divergence; it yields to the base parameters in the measure of their
    covariance.

    Source: Lee, Wensing & Park 2020; Gautier & Venture 2013 (standard parameters from base ones).

    Args:
        estimate: of base parameters.
        columns: the full set.
        matrix: (count, k) base parameters from full ones, `BaseParameters.matrix`.
        prior: full set to stay near, and bounds; `Prior()` when None.

    Raises:
        ModelError: the matrix does not fit, or the estimate has no covariance.
        SolverError: the search did not end.
    """
    if matrix.shape != (len(estimate.values), len(columns)):
        raise ModelError(
            f"recovery: the matrix has the shape {matrix.shape} for {len(estimate.values)} base"
            f" parameters of {len(columns)}; give that of the base parameters identified"
        )
    if not np.isfinite(estimate.covariance).all():
        raise ModelError(f"recovery: {estimate.method} has no covariance; use weighted()")
    deviations = estimate.deviations
    correlation = estimate.covariance / np.outer(deviations, deviations)
    root = np.linalg.inv(np.linalg.cholesky(correlation)) / deviations
    data = Misfit(root @ matrix, root @ estimate.values)
    values, covariance = likeliest(data, columns, prior or Prior())
    misfit = (matrix @ values - estimate.values) / deviations
    return FullSet(tuple(columns), values, covariance, estimate.names, misfit)
