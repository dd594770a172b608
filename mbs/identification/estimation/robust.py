"""Least squares that outliers do not move."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from mbs.errors import SolverError
from mbs.identification.estimation.effort_equations import EffortEquations, above_rounding
from mbs.identification.estimation.estimate import Estimate
from mbs.identification.estimation.triangle import solved as solve
from mbs.identification.estimation.weighted import weighted
from mbs.identification.observations.observations import Observations

Array = npt.NDArray[np.float64]

HUBER = 1.345
"""Bound at which 95 % of the efficiency of least squares is left for normal errors."""

_MEDIAN_OF_NORMAL = 0.6745


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
    start = weighted(observations)
    equations, values = EffortEquations.of(observations), start.values
    for number in range(1, most + 1):
        error = observations.y - observations.W @ values
        scale = _deviations(error, observations.y)
        following = _solved(observations, np.sqrt(_trust(error / scale, bound)) / scale)
        change = np.abs(following - values) / start.deviations
        values = following
        if change.max() < tolerance:
            covariance = _covariance(observations, equations, values, bound)
            method = "robust least squares (Huber)"
            return Estimate(
                method, observations.columns, values, covariance, 1 / scale, observations, number
            )
    raise SolverError(
        f"robust least squares: the parameters still change by {change.max():.2g} deviations after"
        f" {most} rounds; use a larger bound or tolerance"
    )


def _trust(size: Array, bound: float) -> Array:
    """(n, m) weight of each error, given in deviations: one up to the bound, less beyond."""
    return np.asarray(bound / np.maximum(np.abs(size), bound), dtype=float)


def _solved(observations: Observations, rows: Array) -> Array:
    """(k,) least squares with a weight for each row and effort, (n, m)."""
    W, y = observations.rows
    w = rows.reshape(-1)
    A, lengths = W * w[:, None], np.linalg.norm(W * w[:, None], axis=0)
    return np.asarray(solve(A / lengths, y * w) / lengths, dtype=float)


def _covariance(
    observations: Observations, equations: EffortEquations, values: Array, bound: float
) -> Array:
    """(k, k) covariance of the parameters, the part of trusted errors taken for each effort.

    Source: Huber 1964 (variance of his estimator); Street, Carroll & Ruppert 1988.
    """
    error = observations.y - observations.W @ values
    scale = _deviations(error, observations.y)
    trusted = np.mean(np.abs(error) < bound * scale, axis=0)
    kept = error * _trust(error / scale, bound)
    weights = np.sqrt(trusted) / scale
    fit = equations.solved(weights)
    left = np.maximum(len(error) - fit.own, 1.0)
    deviations = np.sqrt(np.sum(kept**2, axis=0) / left) / trusted
    return equations.with_errors(kept).covariance(fit, weights, deviations)


def _deviations(error: Array, efforts: Array) -> Array:
    """(m,) deviation of each column by the median of its sizes."""
    size = np.median(np.abs(error), axis=0) / _MEDIAN_OF_NORMAL
    return above_rounding(size, np.sqrt(np.mean(efforts**2, axis=0)))
