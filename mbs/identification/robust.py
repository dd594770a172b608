"""Least squares that outliers do not move."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from mbs.errors import SolverError
from mbs.identification.estimate import Estimate
from mbs.identification.observations import Observations
from mbs.identification.triangle import solve
from mbs.identification.weighted import weighted

Array = npt.NDArray[np.float64]

HUBER = 1.345
"""Bound at which 95 % of the efficiency of least squares is left for normal errors."""

_MEDIAN_OF_NORMAL = 0.6745
_FLOOR = 1e-9


def robust(
    observations: Observations, bound: float = HUBER, tolerance: float = 1e-2, most: int = 100
) -> Estimate:
    """Errors beyond some deviations count by their size, not by their square.

    The deviation of each joint is taken from the median of its errors, which outliers hardly move.

    Source: Huber 1964; Holland & Welsch 1977 (by re-weighted least squares).

    Args:
        observations: that show every parameter.
        bound: deviations beyond which an error counts less.
        tolerance: change of the parameters, in standard deviations, at which it ends.
        most: rounds before it is given up.

    Raises:
        ModelError: the parameters that they do not show.
        SolverError: the parameters did not settle.
    """
    estimate = weighted(observations)
    for number in range(1, most + 1):
        scale = _deviations(estimate.residuals.error)
        size = np.abs(estimate.residuals.error) / scale
        trust = np.sqrt(np.minimum(1.0, bound / np.maximum(size, bound * _FLOOR)))
        following = _solved(observations, 1 / scale, trust / scale, number)
        change = np.abs(following.values - estimate.values) / following.deviations
        estimate = following
        if change.max() < tolerance:
            return estimate
    raise SolverError(
        f"robust least squares: the parameters still change by {change.max():.2g} deviations after"
        f" {most} rounds; use a larger bound or tolerance"
    )


def _solved(observations: Observations, weights: Array, rows: Array, number: int) -> Estimate:
    W, y = observations.rows
    w = rows.reshape(-1)
    x, covariance = solve(W * w[:, None], y * w, len(y) - len(observations.columns))
    method = "robust least squares (Huber)"
    return Estimate(method, observations.columns, x, covariance, weights, observations, number)


def _deviations(error: Array) -> Array:
    """(m,) deviation of each column by the median of its sizes."""
    size = np.median(np.abs(error), axis=0) / _MEDIAN_OF_NORMAL
    return np.asarray(np.maximum(size, _FLOOR * max(float(size.max()), _FLOOR)), dtype=float)
