"""The parameters that a record really shows: the others are set to zero, one by one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from mbs.errors import ModelError
from mbs.identification.estimate import Estimate
from mbs.identification.triangle import compressed, solve
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

    The test compares the sum of squares with that of all parameters; it holds for errors that are
    independent, so take observations that were decimated.

    Source: Pham & Gautier 1991 (essential parameters); Draper & Smith 1998 (F-test).

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
    A, b = _equations(estimate)
    free = len(estimate.observations) - len(estimate.names)
    all_squares = _squares(A, b, estimate.values)
    kept, dropped = list(range(len(estimate.names))), list[str]()
    values, covariance = estimate.values, estimate.covariance
    while True:
        share = _percent(values, covariance)
        worst = int(np.argmax(share))
        name = estimate.names[kept[worst]]
        if share[worst] <= largest_percent:
            reason = f"all deviations are below {largest_percent:g} %"
            break
        if len(kept) == 1:
            reason = f"{name} is the last parameter"
            break
        fewer = [k for k in kept if k != kept[worst]]
        count = len(dropped) + 1
        x, C = solve(A[:, fewer], b, free + count)
        ratio = (_squares(A[:, fewer], b, x) / all_squares - 1) * free / count
        if ratio > float(distribution.isf(significance, count, free)):
            reason = f"without {name} the errors grow more than noise explains (F = {ratio:.3g})"
            break
        kept, values, covariance = fewer, x, C
        dropped.append(name)
    return Essential(_estimate(estimate, kept, values, covariance), tuple(dropped), reason)


def _equations(estimate: Estimate) -> tuple[Array, Array]:
    """The weighted equations in as few rows as they need."""
    W, y = estimate.observations.rows
    w = np.broadcast_to(estimate.weights, estimate.observations.y.shape).reshape(-1)
    return compressed(W * w[:, None], y * w)


def _percent(values: Array, covariance: Array) -> Array:
    sizes = np.abs(values)
    share = 100 * np.sqrt(np.diag(covariance)) / np.where(sizes > 0, sizes, 1.0)
    return np.where(sizes > 0, share, np.inf)


def _squares(A: Array, b: Array, x: Array) -> float:
    return float(np.sum((b - A @ x) ** 2))


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
