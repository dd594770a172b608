from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from support.measured_arm import equations, noisy_record, noisy_samples

from mbs.errors import ModelError, SolverError
from mbs.identification import (
    cross_validated,
    holdout_residuals,
    huber,
    instrumental,
    iteratively_reweighted,
    least_squares,
    observe,
    observe_filtered,
    smoothed,
    weighted,
)
from mbs.identification.estimate import repetition
from mbs.identification.record import zero_phase

DEVIATIONS = np.array([0.3, 0.1, 0.02])


def observations(seed=0, deviation=DEVIATIONS):
    D, base, _ = equations()
    return observe(D, noisy_samples(deviation, seed)).grouped(base)


def distance(estimate):
    """Mean square of the errors in standard deviations, correlations included."""
    error = estimate.values - equations()[2]
    return float(error @ np.linalg.solve(estimate.covariance, error)) / len(error)


@pytest.mark.parametrize("method", [least_squares, weighted, iteratively_reweighted, huber])
def test_exact_efforts_give_the_parameters(method):
    estimate = method(observations(deviation=0.0))
    assert estimate.values == pytest.approx(equations()[2], abs=1e-8)
    assert estimate.residuals.total_percent < 1e-8


def test_deviations_are_those_of_many_records():
    exact, rng = observations(deviation=0.0), np.random.default_rng(5)
    records = [replace(exact, y=exact.y + 0.2 * rng.normal(size=exact.y.shape)) for _ in range(30)]
    alike = [least_squares(record) for record in records]
    errors = np.array([(e.values - equations()[2]) / e.deviations for e in alike])
    assert np.mean(errors**2) == pytest.approx(1.0, abs=0.2)
    assert np.abs(errors).max() < 5


@cache
def filtered_records(count, deviations, bandwidth=8.0):
    """Equations of filtered records that differ in the white noise of their efforts alone."""
    D, base, _ = equations()
    record = noisy_record(position=0.0, effort=0.0)
    exact = observe_filtered(D, smoothed(record, bandwidth)).grouped(base)
    rows = np.searchsorted(record.time, exact.time - 1e-9)
    records = []
    for seed in range(count):
        noise = np.random.default_rng((12, seed)).normal(size=record.tau.shape) * deviations
        records.append(replace(exact, y=exact.y + zero_phase(noise, 400.0, bandwidth)[rows]))
    return records


def by_motion(observations):
    """Instrumental variables, the instruments being the exact motion."""
    return instrumental(observations, observations, np.array([1.0, 3.0, 20.0]))


@pytest.mark.parametrize(
    "method", [least_squares, weighted, iteratively_reweighted, huber, by_motion]
)
def test_deviations_are_those_of_200_filtered_records(method):
    found = [method(record) for record in filtered_records(200, (1.0, 0.3, 0.05))]
    values = np.array([estimate.values for estimate in found])
    predicted = np.sqrt(np.mean([estimate.deviations**2 for estimate in found], axis=0))
    ratio = values.std(axis=0, ddof=1) / predicted
    assert np.abs(ratio - 1).max() < 0.2
    assert abs(ratio.mean() - 1) < 0.06


def test_rows_that_repeat_each_other_count_as_fewer():
    white = np.random.default_rng(4).normal(size=(4000, 2))
    slow = zero_phase(white, 400.0, 10.0)
    assert repetition(white) == pytest.approx([1, 1], abs=0.1)
    assert repetition(slow) == pytest.approx([400 / (1.796 * 10)] * 2, rel=0.35)


def test_weights_use_what_is_known_of_each_joint():
    plain, better = least_squares(observations()), weighted(observations())
    settled = iteratively_reweighted(observations())
    assert 1 / settled.weights == pytest.approx(DEVIATIONS, rel=0.1)
    assert distance(better) < 2
    assert distance(settled) < 2
    assert better.deviations.sum() < 0.9 * plain.deviations.sum()
    assert better.percent[0] == pytest.approx(100 * better.deviations[0] / abs(better.values[0]))


def test_reweighting_needs_its_rounds():
    with pytest.raises(SolverError, match=r"weights still change by .* after 1 rounds"):
        iteratively_reweighted(observations(), tolerance=1e-12, most=1)


def test_robust_estimate_resists_outliers():
    clean = observations()
    hit = np.random.default_rng(3).random(clean.y.shape) < 0.03
    clean = replace(clean, y=np.where(hit, clean.y + 20.0, clean.y))
    truth = equations()[2]
    bound = 6 * weighted(observations()).deviations
    assert (np.abs(huber(clean).values - truth) < bound).all()
    assert (np.abs(weighted(clean).values - truth) > bound).any()


def test_parameters_of_a_filtered_record_are_within_their_deviations():
    D, base, truth = equations()
    record = noisy_record()
    found = weighted(observe_filtered(D, smoothed(record, 8.0)).grouped(base))
    errors = (found.values - truth) / found.deviations
    assert np.abs(errors).max() < 4
    assert np.mean(errors**2) < 3
    assert found.residuals.rms.max() < 0.1
    assert found["ZZ1R"] == pytest.approx(truth[base.names.index("ZZ1R")], rel=0.05)


def test_held_out_and_cross_validated_errors_are_those_of_the_noise():
    residuals = holdout_residuals(weighted, observations(), 0.6)
    assert residuals.rms == pytest.approx(DEVIATIONS, rel=0.25)
    assert residuals.time[0] > 5.9
    whole = cross_validated(weighted, observations(), 4)
    assert len(whole.time) == len(observations().time)
    assert whole.rms == pytest.approx(DEVIATIONS, rel=0.25)
    size = np.linalg.norm(whole.measured[:, 2])
    assert whole.percent[2] == pytest.approx(100 * np.linalg.norm(whole.error[:, 2]) / size)
    with pytest.raises(ModelError, match="cut into 1 parts"):
        cross_validated(weighted, observations(), 1)


def test_an_estimate_knows_its_names():
    estimate = least_squares(observations())
    with pytest.raises(ModelError, match="no parameter 'ZZ9'"):
        estimate["ZZ9"]
    with pytest.raises(ModelError, match="another order"):
        estimate.residuals_on(estimate.observations.select(estimate.names[1:]))
