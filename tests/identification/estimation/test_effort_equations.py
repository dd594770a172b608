from dataclasses import replace

import numpy as np
import pytest
from support.measured_arm import equations, noisy_samples

from mbs.identification import observe
from mbs.identification._least_squares import EffortEquations

WEIGHTS = np.array([1.0, 2.0, 5.0])


def observations():
    D, base, _ = equations()
    return observe(D, noisy_samples(np.array([0.3, 0.2, 0.1]))).grouped(base)


def test_the_solution_is_that_of_all_weighted_rows():
    given = observations()
    fit = EffortEquations.of(given).solved(WEIGHTS)
    W, y = given.rows
    w = np.tile(WEIGHTS, len(given.time))
    expected = np.linalg.lstsq(W * w[:, None], y * w, rcond=None)[0]
    assert fit.values == pytest.approx(expected, abs=1e-9)
    normal = np.linalg.inv((W * w[:, None]).T @ (W * w[:, None]))
    assert fit.root.T @ fit.root == pytest.approx(normal, rel=1e-6, abs=1e-12)
    assert fit.own.sum() == pytest.approx(len(expected))


def test_squares_deviations_and_covariance():
    given = observations()
    parts = EffortEquations.of(given)
    fit = parts.solved(WEIGHTS)
    error = given.y - given.W @ fit.values
    assert parts.squares(fit.values) == pytest.approx(np.sum(error**2, axis=0))
    deviations = parts.deviations(fit)
    assert deviations == pytest.approx([0.3, 0.2, 0.1], rel=0.1)
    C = parts.covariance(fit, WEIGHTS, deviations)
    W = given.rows[0]
    w, s = (np.tile(x, len(given.time)) for x in (WEIGHTS, deviations))
    N = np.linalg.inv((W * w[:, None]).T @ (W * w[:, None]))
    half = (W * (w * w * s)[:, None]) @ N
    assert pytest.approx(half.T @ half, rel=1e-6, abs=1e-12) == C
    double = replace(parts, repeated=np.full(3, 2.0))
    assert double.covariance(fit, WEIGHTS, deviations) == pytest.approx(2 * C)
