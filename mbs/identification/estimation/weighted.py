"""Least squares with a weight for each joint."""

from __future__ import annotations

import numpy as np

from mbs.errors import SolverError
from mbs.identification.estimation.effort_equations import EffortEquations
from mbs.identification.estimation.estimate import Estimate
from mbs.identification.estimation.least_squares import weighted_solution
from mbs.identification.observations.observations import Observations
from mbs.identification.observations.quality import require_visible


def weighted(observations: Observations) -> Estimate:
    """Every effort is divided by the deviation of its error that least squares left.

    Source: Gautier 1997; Khalil & Dombre 2002, chapter 12.

    Args:
        observations: that show every parameter.

    Raises:
        ModelError: the parameters that they do not show.
    """
    require_visible(observations)
    equations = EffortEquations.of(observations)
    first = equations.solved(np.ones(observations.y.shape[1]))
    weights = 1 / equations.deviations(first)
    return weighted_solution(observations, equations, weights, "weighted least squares", 1)


def reweighted(observations: Observations, tolerance: float = 1e-3, most: int = 50) -> Estimate:
    """Weights and parameters in turn, until the weights stay as they are.

    Its end is the most likely set of parameters for errors that are normal with a deviation of
    each joint.

    Source: Gautier 1997.

    Args:
        observations: that show every parameter.
        tolerance: relative change of the weights at which it ends.
        most: rounds before it is given up.

    Raises:
        ModelError: the parameters that they do not show.
        SolverError: the weights did not settle.
    """
    require_visible(observations)
    equations, change = EffortEquations.of(observations), np.inf
    weights = 1 / equations.deviations(equations.solved(np.ones(observations.y.shape[1])))
    for number in range(1, most + 1):
        following = 1 / equations.deviations(equations.solved(weights))
        change = float(np.abs(following / weights - 1).max())
        if change < tolerance:
            method = "iteratively re-weighted least squares"
            return weighted_solution(observations, equations, weights, method, number)
        weights = following
    raise SolverError(
        f"re-weighted least squares: the weights still change by {change:.2g} after {most} rounds;"
        " use weighted(), or a larger tolerance"
    )
