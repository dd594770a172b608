from dataclasses import replace

import numpy as np
import pytest
from support.catalogue_systems import catalogue_system
from support.measured_arm import equations, mbs_values, motion, noisy_samples

from mbs.errors import ModelError
from mbs.identification import (
    Samples,
    instrumental,
    least_squares,
    numeric_parameters,
    observe,
    physically_consistent,
    regressor,
    simulated_motion,
)
from mbs.identification.leading import active_indices, positions

_ACCELERATION = 3.0


def noisy_motion(samples, seed=0):
    """Samples whose accelerations have noise, as differences of positions have."""
    noise = np.random.default_rng((4, seed)).normal(size=samples.a.shape)
    return replace(samples, a=samples.a + _ACCELERATION * noise)


def bias(estimate, name="Ia3"):
    return estimate[name] - equations()[2][estimate.names.index(name)]


def test_instruments_take_out_the_bias_of_noise_in_the_regressor():
    D, base, truth = equations()
    exact = noisy_samples(0.05)
    measured = observe(D, noisy_motion(exact)).grouped(base)
    ordered = observe(D, exact).grouped(base)
    plain, free = least_squares(measured), instrumental(measured, ordered)
    assert bias(plain) < -0.03
    assert abs(bias(free)) < 0.25 * abs(bias(plain))
    assert np.abs((free.values - truth) / free.deviations).max() < 4
    assert np.abs((plain.values - truth) / plain.deviations).max() > 5


def test_without_noise_it_is_least_squares():
    D, base, truth = equations()
    clean = observe(D, noisy_samples(0.0)).grouped(base)
    weights = np.array([1.0, 2.0, 3.0])
    found = instrumental(clean, clean, weights)
    assert found.values == pytest.approx(truth, abs=1e-8)
    assert found.weights == pytest.approx(weights)


def test_simulated_motion_follows_the_measured_one():
    D, base, _ = equations()
    samples = noisy_samples(0.02, rate=200.0)
    simulated = simulated_motion(D, mbs_values(D.columns), samples)
    _, q, v, a = motion(rate=200.0)
    assert simulated.q == pytest.approx(q, abs=0.02)
    assert simulated.v == pytest.approx(v, abs=0.05)
    assert np.sqrt(np.mean((simulated.a - a) ** 2)) < 0.1 * np.sqrt(np.mean(a**2))
    rough = noisy_motion(samples)
    full = observe(D, rough)
    instruments = observe(
        D, simulated_motion(D, physically_consistent(full).values, rough)
    ).grouped(base)
    found = instrumental(full.grouped(base), instruments)
    assert abs(bias(found)) < 0.5 * abs(bias(least_squares(full.grouped(base))))


def test_a_closed_robot_is_simulated_in_its_independent_joints():
    system = catalogue_system("five_bar")
    D = regressor(system)
    K = numeric_parameters(system, D.columns)
    time = np.arange(400) / 200
    middle = np.array([system.configuration[k] for k in active_indices(system)])
    wave, w = np.array([0.2, -0.15]), 4.0
    s, c = np.sin(w * time)[:, None] * wave, np.cos(w * time)[:, None] * wave
    q, v, a = middle + s, w * c, -w * w * s
    states = zip(positions(system, q), v, a, strict=True)
    tau = np.array([np.array(D(*state)) @ K for state in states])
    samples = Samples(time, q, v, a, tau, ("q1", "q3"), ("N.m",) * 2)
    simulated = simulated_motion(D, K, samples)
    assert simulated.q == pytest.approx(q, abs=1e-3)
    assert simulated.a == pytest.approx(a, abs=0.05)


def test_instruments_that_do_not_fit_are_refused():
    D, base, _ = equations()
    full = observe(D, noisy_samples(0.1)).grouped(base)
    with pytest.raises(ModelError, match="from the same instants and columns"):
        instrumental(full, full.split(0.5)[0])
    with pytest.raises(ModelError, match=r"values have the shape \(2,\) for 39 columns"):
        simulated_motion(D, [1.0, 2.0], noisy_samples(0.1))
    with pytest.raises(ModelError, match="bandwidth of the controller is 0 Hz"):
        simulated_motion(D, mbs_values(D.columns), noisy_samples(0.1), tracking=0.0)
