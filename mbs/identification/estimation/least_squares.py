"""Ordinary least squares."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from mbs.identification.estimation.effort_equations import EffortEquations
from mbs.identification.estimation.estimate import Estimate
from mbs.identification.observations.observations import Observations
from mbs.identification.observations.quality import require_visible

Array = npt.NDArray[np.float64]


def least_squares(observations: Observations) -> Estimate:
    """The parameters that make the sum of squared errors of all efforts least.

    The standard deviations are those of errors that differ from effort to effort and repeat
    themselves from row to row as the residuals do.

    Source: Gautier & Khalil 1988; Khalil & Dombre 2002, chapter 12.

    Args:
        observations: that show every parameter.

    Raises:
        ModelError: the parameters that they do not show.
    """
    require_visible(observations)
    weights = np.ones(observations.y.shape[1])
    equations = EffortEquations.of(observations)
    return weighted_solution(observations, equations, weights, "least squares", 1)


def weighted_solution(
    observations: Observations,
    equations: EffortEquations,
    weights: Array,
    method: str,
    rounds: int,
) -> Estimate:
    """Least squares with given weights (m,) of the efforts.

    What the errors are like is taken from least squares with the weights that they ask for, so
    that an effort of small error does not get those of the others.
    """
    fit = equations.solved(weights)
    better = equations.solved(1 / equations.deviations(fit))
    errors = equations.with_errors(observations.y - observations.W @ better.values)
    covariance = errors.covariance(fit, weights, errors.deviations(better))
    return Estimate(
        method, observations.columns, fit.values, covariance, weights, observations, rounds
    )
