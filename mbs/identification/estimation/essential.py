"""The parameters that a record really shows: the others are set to zero, one by one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from mbs.errors import ModelError
from mbs.identification.estimation.estimate import Estimate
from mbs.identification.estimation.named_values import percent_of
from mbs.identification.estimation.residuals import repetition
from mbs.result import optional_module

Array = npt.NDArray[np.float64]

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
