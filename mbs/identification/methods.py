"""Estimation methods by name, and selection of essential parameters."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from mbs.errors import ModelError, SolverError
from mbs.identification._base_parameters import BaseParameters
from mbs.identification._least_squares import (
    huber,
    instrumental,
    iteratively_reweighted,
    least_squares,
    simulated_motion,
    weighted,
)
from mbs.identification.bodies import Prior, consistent_weighted
from mbs.identification.estimate import Estimate, Estimator, percent_of, repetition
from mbs.identification.observations import Observations, observe_filtered, stacked
from mbs.identification.record import Samples
from mbs.identification.regressors import Regressor
from mbs.result import optional_module

# Estimation methods by name, each as a function of the equations in base parameters.


Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Setting:
    """Data that methods need in addition to the equations in base parameters.

    Attributes:
        model: regressor of the full set.
        base: base parameters of the columns of the regressor.
        samples: samples of each record.
        full: equations in the full set.
        bodies: physically consistent estimate of `consistent_weighted`; None if it did not
            converge.
        prior: prior knowledge of the bodies.
    """

    model: Regressor
    base: BaseParameters
    samples: tuple[Samples, ...]
    full: Observations
    bodies: Estimate | None
    prior: Prior

    def bodies_of(self, part: Observations) -> Estimate:
        """Return the physically consistent estimate of all or some equations of the record.

        `part` are equations at some of the instants of `full`.
        """
        if self.bodies is not None and len(part.time) == len(self.full.time):
            return self.bodies
        return consistent_weighted(self.full.at(part.time), self.prior)

    def simulation_values(self, part: Observations) -> Array:
        """Return values (k,) of the full parameter set with which the robot is simulated.

        They are the values of `bodies_of(part)`. If that search does not converge, they are the
        base parameters by weighted least squares at the kept columns, which give the same efforts,
        and zeros.
        """
        try:
            return self.bodies_of(part).values
        except SolverError:
            values = np.zeros(len(self.base.columns))
            values[self.base.indices] = weighted(part).values
            return values


def _instrumental_estimator(setting: Setting) -> Estimator:
    """Return instrumental-variable estimator; the robot is simulated with the data in `setting`."""

    def estimator(observations: Observations) -> Estimate:
        values = setting.simulation_values(observations)
        moved = [simulated_motion(setting.model, values, one) for one in setting.samples]
        whole = stacked([observe_filtered(setting.model, one) for one in moved])
        instruments = whole.grouped(setting.base)
        weights = weighted(observations).weights
        return instrumental(observations, instruments.at(observations.time), weights)

    return estimator


def _bodies_estimator(setting: Setting) -> Estimator:
    """Return the estimator of base parameters from physically consistent bodies.

    `setting` contains the data of the record and the guess of the bodies.
    """

    def estimator(observations: Observations) -> Estimate:
        bodies = setting.bodies_of(observations)
        B = setting.base.matrix
        values, covariance = B @ bodies.values, B @ bodies.covariance @ B.T
        return Estimate(
            bodies.method, observations.columns, values, covariance, bodies.weights, observations
        )

    return estimator


def _same_estimator(estimator: Estimator) -> Callable[[Setting], Estimator]:
    """Return a factory that returns the same estimator for all settings."""
    return lambda _: estimator


METHODS: Mapping[str, Callable[[Setting], Estimator]] = MappingProxyType(
    {
        "least_squares": _same_estimator(least_squares),
        "weighted": _same_estimator(weighted),
        "reweighted": _same_estimator(iteratively_reweighted),
        "robust": _same_estimator(huber),
        "instrumental": _instrumental_estimator,
        "consistent": _bodies_estimator,
    }
)
"""Estimation methods for base parameters, by name."""


# Essential parameters: the remaining parameters are set to zero, one by one.


LARGEST_PERCENT = 10.0
"""Standard deviation, in percent of the value, up to which a parameter is essential."""

SIGNIFICANCE = 0.05
"""Significance level of the F-test: probability that it keeps a parameter that is zero."""


@dataclass(frozen=True, slots=True, eq=False)
class Essential:
    """Estimate in fewer parameters, and the reason why the elimination ended.

    Attributes:
        estimate: estimate in the remaining parameters.
        dropped: eliminated parameters, in the order of elimination.
        reason: reason why no further parameter was eliminated.
    """

    estimate: Estimate
    dropped: tuple[str, ...]
    reason: str


def essential(
    estimate: Estimate,
    largest_percent: float = LARGEST_PERCENT,
    significance: float = SIGNIFICANCE,
) -> Essential:
    """Eliminate parameters of large relative deviation as long as the residuals do not grow.

    In each step, the parameter with the largest relative deviation is set to zero, and an F-test of
    all eliminated parameters is computed from the covariance of the complete estimate. The
    remaining values follow from the same covariance. For equal error variances, this equals the
    comparison of sums of squares and a least-squares fit without the eliminated parameters. The
    estimation method is arbitrary.

    Source: Pham & Gautier 1991 (essential parameters); Draper & Smith 1998 (F-test of several
    parameters).

    Args:
        estimate: estimate of any method that gives a covariance.
        largest_percent: relative standard deviation at which the elimination ends.
        significance: significance level of the F-test, between 0 and 1.

    Raises:
        ModelError: the estimate has no covariance, or a bound is out of range.

    Returns:
        Estimate in the remaining parameters, names of the eliminated parameters, and the reason why
        the elimination ended.
    """
    if not (largest_percent > 0 and 0 < significance < 1):
        raise ModelError(
            f"essential parameters: largest_percent is {largest_percent:g} and significance"
            f" {significance:g}; give more than zero, and between 0 and 1"
        )
    if not np.isfinite(estimate.covariance).all():
        raise ModelError(
            f"essential parameters: {estimate.method} has no deviations; use weighted()"
        )
    distribution = optional_module("scipy.stats", "identify").f
    free, dropped = _degrees_of_freedom(estimate), list[int]()
    while True:
        kept, values, covariance = _restricted(estimate, dropped)
        share = percent_of(values, covariance)
        worst = kept[int(np.argmax(share))]
        name, following = estimate.names[worst], [*dropped, worst]
        if share.max() <= largest_percent:
            reason = f"all deviations are below {largest_percent:g} %"
            break
        if len(kept) == 1:
            reason = f"{name} is the last parameter"
            break
        ratio = _f_statistic(estimate, following)
        if ratio > float(distribution.isf(significance, len(following), free)):
            reason = f"without {name} the errors grow more than noise explains (F = {ratio:.3g})"
            break
        dropped = following
    names = tuple(estimate.names[k] for k in dropped)
    return Essential(_estimate(estimate, kept, values, covariance), names, reason)


def _degrees_of_freedom(estimate: Estimate) -> float:
    """Return the degrees of freedom: independent equations minus parameters, at least 1."""
    error = estimate.residuals.error
    return max(float(np.sum(len(error) / repetition(error))) - len(estimate.values), 1.0)


def _restricted(estimate: Estimate, dropped: Sequence[int]) -> tuple[list[int], Array, Array]:
    """Return indices, values and covariance of the other parameters if those in `dropped` are zero.

    Source: Draper & Smith 1998 (restricted least squares, from the covariance).
    """
    kept = [k for k in range(len(estimate.values)) if k not in dropped]
    x, C, size = estimate.values, estimate.covariance, estimate.deviations
    known = (C / np.outer(size, size))[np.ix_(dropped, dropped)]
    shared = C[np.ix_(kept, dropped)] / size[dropped]
    gain = np.linalg.solve(known, shared.T).T
    values = x[kept] - gain @ (x / size)[dropped]
    return kept, values, C[np.ix_(kept, kept)] - gain @ shared.T


def _f_statistic(estimate: Estimate, dropped: Sequence[int]) -> float:
    """Return the F statistic of the hypothesis that the parameters `dropped` (indices) are zero."""
    size = estimate.deviations[dropped]
    values = estimate.values[dropped] / size
    correlation = estimate.covariance[np.ix_(dropped, dropped)] / np.outer(size, size)
    return float(values @ np.linalg.solve(correlation, values)) / len(values)


def _estimate(
    estimate: Estimate, kept: Sequence[int], values: Array, covariance: Array
) -> Estimate:
    """Return the estimate of the parameters with indices `kept` and these values and covariance."""
    names = [estimate.names[k] for k in kept]
    return Estimate(
        f"{estimate.method}, essential",
        tuple(estimate.columns[k] for k in kept),
        values,
        covariance,
        estimate.weights,
        estimate.observations.select(names),
        estimate.rounds,
    )
