"""Every method of estimation by its name, and the parameters that a record really shows."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from mbs.errors import ModelError, SolverError
from mbs.identification.base_parameters import BaseParameters
from mbs.identification.bodies import Prior, consistent_weighted
from mbs.identification.estimate import Estimate, Estimator, percent_of, repetition
from mbs.identification.least_squares import (
    instrumental,
    least_squares,
    reweighted,
    robust,
    simulated_motion,
    weighted,
)
from mbs.identification.observations import Observations, observe_filtered, stacked
from mbs.identification.record import Samples
from mbs.identification.regressors import Regressor
from mbs.result import optional_module

# Every method of estimation by its name, as one function of the equations in base parameters.


Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Setting:
    """What methods need beside the equations in base parameters.

    Attributes:
        model: regressor of the full set.
        base: base parameters of its columns.
        samples: of each record.
        full: the equations in the full set.
        bodies: that explain them, by `consistent_weighted`; None where none were found.
        prior: of the bodies.
    """

    model: Regressor
    base: BaseParameters
    samples: tuple[Samples, ...]
    full: Observations
    bodies: Estimate | None
    prior: Prior

    def bodies_of(self, part: Observations) -> Estimate:
        """The bodies that explain these equations, all or some of the record's."""
        if self.bodies is not None and len(part.time) == len(self.full.time):
            return self.bodies
        return consistent_weighted(self.full.at(part.time), self.prior)

    def moving(self, part: Observations) -> Array:
        """Values of the full set that move as these equations say.

        They are those of bodies; where none are found, the base parameters by weighted least
        squares in their places, which have the same efforts.
        """
        try:
            return self.bodies_of(part).values
        except SolverError:
            values = np.zeros(len(self.base.columns))
            values[self.base.indices] = weighted(part).values
            return values


def _by_instruments(setting: Setting) -> Estimator:
    """Instruments from the motion that bodies of these equations make under the efforts."""

    def estimator(observations: Observations) -> Estimate:
        values = setting.moving(observations)
        moved = [simulated_motion(setting.model, values, one) for one in setting.samples]
        whole = stacked([observe_filtered(setting.model, one) for one in moved])
        instruments = whole.grouped(setting.base)
        weights = weighted(observations).weights
        return instrumental(observations, instruments.at(observations.time), weights)

    return estimator


def _by_bodies(setting: Setting) -> Estimator:
    """Base parameters of the bodies that explain the efforts best."""

    def estimator(observations: Observations) -> Estimate:
        bodies = setting.bodies_of(observations)
        B = setting.base.matrix
        values, covariance = B @ bodies.values, B @ bodies.covariance @ B.T
        return Estimate(
            bodies.method, observations.columns, values, covariance, bodies.weights, observations
        )

    return estimator


def _always(estimator: Estimator) -> Callable[[Setting], Estimator]:
    return lambda _: estimator


METHODS: Mapping[str, Callable[[Setting], Estimator]] = MappingProxyType(
    {
        "least_squares": _always(least_squares),
        "weighted": _always(weighted),
        "reweighted": _always(reweighted),
        "robust": _always(robust),
        "instrumental": _by_instruments,
        "consistent": _by_bodies,
    }
)
"""Methods for base parameters by name."""


# The parameters that a record really shows: the others are set to zero, one by one.


LARGEST_PERCENT = 10.0
"""Standard deviation, in percent of the value, up to which a parameter is essential."""

SIGNIFICANCE = 0.05
"""Probability with which the test takes a parameter for needed that is not."""


@dataclass(frozen=True, slots=True, eq=False)
class Essential:
    """An estimate in fewer parameters, and why the search for it ended.

    Attributes:
        estimate: in the parameters that are left.
        dropped: the others, in the order in which they went.
        reason: why no more were dropped.
    """

    estimate: Estimate
    dropped: tuple[str, ...]
    reason: str


def essential(
    estimate: Estimate,
    largest_percent: float = LARGEST_PERCENT,
    significance: float = SIGNIFICANCE,
) -> Essential:
    """Drop the parameter of largest relative deviation while the errors stay as good.

    The covariance of the whole set says whether all dropped parameters together may be zero, and
    what the others are when they are; for errors that are alike these are the comparison of the
    sums of squares and least squares without them. The method of the estimate does not matter.

    Source: Pham & Gautier 1991 (essential parameters); Draper & Smith 1998 (F-test of several
    parameters).

    Args:
        estimate: by any method that gives a covariance.
        largest_percent: relative standard deviation at which it ends.
        significance: of the F-test, between 0 and 1.

    Raises:
        ModelError: the estimate has no deviations, or a bound makes no sense.
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
    free, dropped = _freedom(estimate), list[int]()
    while True:
        kept, values, covariance = _without(estimate, dropped)
        share = percent_of(values, covariance)
        worst = kept[int(np.argmax(share))]
        name, following = estimate.names[worst], [*dropped, worst]
        if share.max() <= largest_percent:
            reason = f"all deviations are below {largest_percent:g} %"
            break
        if len(kept) == 1:
            reason = f"{name} is the last parameter"
            break
        ratio = _ratio(estimate, following)
        if ratio > float(distribution.isf(significance, len(following), free)):
            reason = f"without {name} the errors grow more than noise explains (F = {ratio:.3g})"
            break
        dropped = following
    names = tuple(estimate.names[k] for k in dropped)
    return Essential(_estimate(estimate, kept, values, covariance), names, reason)


def _freedom(estimate: Estimate) -> float:
    """Equations of independent error less the parameters, at least one."""
    error = estimate.residuals.error
    return max(float(np.sum(len(error) / repetition(error))) - len(estimate.values), 1.0)


def _without(estimate: Estimate, dropped: Sequence[int]) -> tuple[list[int], Array, Array]:
    """Numbers, values and covariance of the other parameters once some are known to be zero.

    Source: Draper & Smith 1998 (restricted least squares, from the covariance).
    """
    kept = [k for k in range(len(estimate.values)) if k not in dropped]
    x, C, size = estimate.values, estimate.covariance, estimate.deviations
    known = (C / np.outer(size, size))[np.ix_(dropped, dropped)]
    shared = C[np.ix_(kept, dropped)] / size[dropped]
    gain = np.linalg.solve(known, shared.T).T
    values = x[kept] - gain @ (x / size)[dropped]
    return kept, values, C[np.ix_(kept, kept)] - gain @ shared.T


def _ratio(estimate: Estimate, dropped: Sequence[int]) -> float:
    """Mean square of some parameters in deviations, F-distributed where they are zero."""
    size = estimate.deviations[dropped]
    values = estimate.values[dropped] / size
    correlation = estimate.covariance[np.ix_(dropped, dropped)] / np.outer(size, size)
    return float(values @ np.linalg.solve(correlation, values)) / len(values)


def _estimate(
    estimate: Estimate, kept: Sequence[int], values: Array, covariance: Array
) -> Estimate:
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
