"""Least squares with a weight for each joint."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from mbs.errors import SolverError
from mbs.identification.estimate import Estimate
from mbs.identification.least_squares import least_squares
from mbs.identification.observations import Observations
from mbs.identification.triangle import solve, triangle

Array = npt.NDArray[np.float64]

_FLOOR = 1e-9


def weighted(observations: Observations) -> Estimate:
    """Every effort is divided by the deviation of its error that least squares left.

    Source: Gautier 1997; Khalil & Dombre 2002, chapter 12.

    Args:
        observations: that show every parameter.

    Raises:
        ModelError: the parameters that they do not show.
    """
    first = least_squares(observations)
    joints = _joints(observations)
    weights = _weights(joints, first.values, len(observations.time))
    return _solved(observations, joints, weights, "weighted least squares", 1)


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
    joints, n = _joints(observations), len(observations.time)
    weights = _weights(joints, least_squares(observations).values, n)
    method, change = "iteratively re-weighted least squares", np.inf
    for number in range(1, most + 1):
        estimate = _solved(observations, joints, weights, method, number)
        following = _weights(joints, estimate.values, n)
        change = float(np.abs(following / weights - 1).max())
        if change < tolerance:
            return estimate
        weights = following
    raise SolverError(
        f"re-weighted least squares: the weights still change by {change:.2g} after {most} rounds;"
        " use weighted(), or a larger tolerance"
    )


def _joints(observations: Observations) -> list[Array]:
    """For each effort its equations [W y] in as few rows as they have columns."""
    W, y = observations.W, observations.y
    return [triangle(np.column_stack([W[:, j], y[:, j]])) for j in range(y.shape[1])]


def _weights(joints: Sequence[Array], values: Array, n: int) -> Array:
    """(m,) one over the deviation of the error of each effort [1/(N m) or 1/N]."""
    with_effort = np.append(values, -1.0)
    rms = np.array([np.linalg.norm(T @ with_effort) for T in joints]) / np.sqrt(n)
    return np.asarray(1.0 / np.maximum(rms, _FLOOR * max(float(rms.max()), _FLOOR)), dtype=float)


def _solved(
    observations: Observations, joints: Sequence[Array], weights: Array, method: str, rounds: int
) -> Estimate:
    rows = np.vstack([w * T for w, T in zip(weights, joints, strict=True)])
    freedom = len(observations) - len(observations.columns)
    x, covariance = solve(rows[:, :-1], rows[:, -1], freedom)
    return Estimate(method, observations.columns, x, covariance, weights, observations, rounds)
