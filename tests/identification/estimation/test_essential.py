from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import f
from support.measured_arm import equations, noisy_samples

from mbs.errors import ModelError
from mbs.identification import essential, huber, least_squares, observe, weighted


def observations(deviation):
    D, base, _ = equations()
    return observe(D, noisy_samples(deviation)).grouped(base)


def test_parameters_that_are_lost_in_noise_are_dropped():
    full = weighted(observations(2.0))
    found = essential(full)
    assert 0 < len(found.dropped) < len(full.names)
    assert set(found.dropped) | set(found.estimate.names) == set(full.names)
    assert found.estimate.method.endswith(", essential")
    assert found.estimate.method.count("essential") == 1
    worse = found.estimate.residuals.total_percent / full.residuals.total_percent
    assert 1 <= worse < 1.02
    assert {"MX2R", "Fv1"} <= set(found.estimate.names)
    below = found.estimate.percent.max() <= 10
    assert found.reason.startswith("all deviations" if below else "without ")


def test_nothing_is_dropped_without_noise():
    found = essential(least_squares(observations(1e-3)))
    assert found.dropped == ()
    assert found.reason == "all deviations are below 10 %"


def test_the_test_keeps_what_the_errors_need():
    found = essential(weighted(observations(2.0)), largest_percent=1e-3)
    assert "(F = " in found.reason
    assert found.estimate.percent.max() > 1e-3


def test_parameters_known_to_be_zero_move_the_others_as_least_squares_without_them():
    given = observations(2.0)
    found = essential(weighted(given))
    left = given.select(found.estimate.names)
    weights = np.tile(found.estimate.weights, len(given.time))
    W, y = left.rows
    wanted = np.linalg.lstsq(W * weights[:, None], y * weights, rcond=None)[0]
    shift = (found.estimate.values - wanted) / found.estimate.deviations
    moved = [full_value(given, name) for name in found.estimate.names]
    assert np.abs(shift).max() < 0.3
    assert np.abs((moved - wanted) / found.estimate.deviations).max() > 0.5


def full_value(given, name):
    return weighted(given)[name]


def test_outliers_that_an_estimate_left_out_stay_out():
    D, base, truth = equations()
    samples, rng = noisy_samples(0.5), np.random.default_rng(3)
    hit = rng.uniform(size=samples.tau.shape) < 0.05
    tau = samples.tau + np.where(hit, 30 * rng.normal(size=hit.shape), 0.0)
    found = essential(huber(observe(D, replace(samples, tau=tau)).grouped(base))).estimate
    expected = truth[[base.names.index(name) for name in found.names]]
    assert len(found.names) < len(truth)
    assert np.sqrt(np.mean(((found.values - expected) / found.deviations) ** 2)) < 1.6


def test_bounds_without_sense_are_refused():
    estimate = least_squares(observations(0.1))
    with pytest.raises(ModelError, match="significance 2"):
        essential(estimate, significance=2.0)
    blind = replace(estimate, covariance=np.full_like(estimate.covariance, np.nan))
    with pytest.raises(ModelError, match="least squares has no deviations"):
        essential(blind)


def test_as_many_are_dropped_as_sums_of_squares_allow():
    """F of the dropped ones together, by least squares without them, on both sides of its bound."""
    given = observations(0.5)
    full, (W, y) = least_squares(given), given.rows
    found = essential(full)

    def squares(gone):
        A = W[:, [name not in gone for name in full.names]]
        return np.sum((y - A @ np.linalg.lstsq(A, y, rcond=None)[0]) ** 2)

    one_more = [*found.dropped, found.reason.split()[1]]
    least, free = squares([]), W.shape[0] - W.shape[1]
    for k in range(1, len(one_more) + 1):
        F = (squares(one_more[:k]) - least) / k / (least / free)
        bound = f.isf(0.05, k, free)
        assert (1.1 * bound < F) if k == len(one_more) else (0.1 * bound < F < 0.9 * bound)
    assert len(found.dropped) == 3


@pytest.mark.parametrize(("significance", "count"), [(0.5, 0), (0.05, 3), (0.005, 4)])
def test_a_significance_moved_tenfold_drops_others(significance, count):
    estimate = least_squares(observations(0.5))
    found = essential(estimate, significance=significance)
    assert len(found.dropped) == count
    assert (found.dropped == essential(estimate).dropped) == (significance == 0.05)
