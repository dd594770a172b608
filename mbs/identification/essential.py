"""The parameters that a record really shows: the others are set to zero, one by one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from mbs.errors import ModelError
from mbs.identification.effort_equations import EffortEquations
from mbs.identification.estimate import Estimate
from mbs.identification.named_values import percent_of
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

    The test asks whether all dropped parameters together may be zero, by the covariance of the
    whole set; for errors that are alike it is the comparison of the sums of squares.

    Source: Pham & Gautier 1991 (essential parameters); Draper & Smith 1998 (F-test of several
    parameters).

    Args:
        estimate: by `least_squares`, `weighted` or `reweighted`, whose weights are kept.
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
    distribution = optional_module("scipy.stats", 'pip install "mbs[identify]"').f
    equations = EffortEquations.of(estimate.observations).with_errors(estimate.residuals.error)
    deviations = equations.deviations(equations.solved(estimate.weights))
    free = equations.freedom(len(estimate.names))
    kept, dropped = list(range(len(estimate.names))), list[int]()
    values, covariance = estimate.values, estimate.covariance
    while True:
        share = percent_of(values, covariance)
        worst = kept[int(np.argmax(share))]
        name, without = estimate.names[worst], [*dropped, worst]
        if share.max() <= largest_percent:
            reason = f"all deviations are below {largest_percent:g} %"
            break
        if len(kept) == 1:
            reason = f"{name} is the last parameter"
            break
        ratio = _ratio(estimate, without)
        if ratio > float(distribution.isf(significance, len(without), free)):
            reason = f"without {name} the errors grow more than noise explains (F = {ratio:.3g})"
            break
        kept, dropped = [k for k in kept if k != worst], without
        left = equations.select(kept)
        fit = left.solved(estimate.weights)
        values = fit.values
        covariance = left.covariance(fit, estimate.weights, deviations)
    names = tuple(estimate.names[k] for k in dropped)
    return Essential(_estimate(estimate, kept, values, covariance), names, reason)


def _ratio(estimate: Estimate, without: Sequence[int]) -> float:
    """Mean square of some parameters in deviations, F-distributed where they are zero."""
    values = estimate.values[list(without)]
    covariance = estimate.covariance[np.ix_(without, without)]
    return float(values @ np.linalg.solve(covariance, values)) / len(values)


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
