"""Identification of two real robots; skipped where their records are not."""

import numpy as np
import pytest
from support.real_records import panda_record, tx40_record

from mbs.identification import (
    Prior,
    base_parameters,
    consistent_links,
    essential,
    excitation_quality,
    holdout_residuals,
    huber,
    identify,
    least_squares,
    observe,
    observe_filtered,
    physically_consistent,
    regressor,
    smoothed,
    smoothed_with_velocity,
    weighted,
)
from mbs.identification.observations import EQUATIONS


@pytest.fixture(scope="module")
def panda():
    system, record = panda_record()
    D = regressor(system, rotors=False, offsets=True)
    return record, D, base_parameters(system, columns=D.columns)


def test_panda_from_positions_and_torques(panda):
    record, D, base = panda
    full = observe_filtered(D, smoothed(record, 10.0))
    observations = full.grouped(base)
    assert len(observations.columns) == 64
    assert least_squares(observations).residuals.total_percent <= 1.51
    assert holdout_residuals(least_squares, observations).total_percent <= 1.59
    bodies = physically_consistent(full, Prior(heaviest=18.0))
    assert bodies.residuals.total_percent <= 1.55
    assert consistent_links(bodies.columns, bodies.values) == list(range(1, 8))
    masses = [bodies[f"M{j}"] for j in range(1, 8)]
    assert 0 < min(masses) <= max(masses) <= 18.0 + 1e-6


def test_panda_from_measured_velocities_with_no_second_filter(panda):
    record, D, base = panda
    full = observe(D, smoothed_with_velocity(record, 10.0))
    observations = full.grouped(base)
    assert excitation_quality(observations).condition == pytest.approx(111, rel=0.05)
    assert least_squares(observations).residuals.total_percent <= 1.51
    assert holdout_residuals(least_squares, observations).total_percent <= 1.59


def test_tx40_at_100_hz():
    system, record = tx40_record()
    D = regressor(system, offsets=True, couplings=[(6, 5)])
    observations = observe_filtered(D, smoothed(record, 100.0)).grouped(
        base_parameters(system, columns=D.columns)
    )
    assert len(observations.columns) == 61
    estimate = least_squares(observations)
    assert estimate.residuals.total_percent <= 8.6
    assert estimate["ZZ1R"] == pytest.approx(1.25, abs=3 * estimate.deviations[0])
    assert estimate["Fv1"] == pytest.approx(8.05, rel=0.15)
    late = holdout_residuals(least_squares, observations, 0.5)
    assert late.total_percent <= 16.8


@pytest.mark.parametrize("method", [weighted, huber])
def test_methods_explain_the_panda_at_5_hz(panda, method):
    record, D, base = panda
    observations = observe_filtered(D, smoothed(record, 5.0)).grouped(base)
    found = method(observations)
    assert found.residuals.total_percent < 0.99
    assert holdout_residuals(method, observations).total_percent < 1.13
    few = essential(found).estimate
    assert 10 < len(few.names) < 64
    assert few.residuals.total_percent < 1.1


def test_instruments_and_bodies_explain_the_panda_at_5_hz(panda):
    record, D, _ = panda
    options = {"rotors": False, "offsets": True, "prior": Prior(heaviest=18.0)}
    found = identify(D.system, record, 5.0, "instrumental", quiet=True, **options)
    assert found.estimate.residuals.total_percent < 0.99
    assert found.validation.total_percent < 1.13
    assert found.bodies.residuals.total_percent < 1.0
    assert consistent_links(found.bodies.columns, found.bodies.values) == list(range(1, 8))


@pytest.mark.parametrize(("equations", "most"), [("filtered", 1.2), ("energy", 0.5)])
def test_other_equations_on_the_panda(panda, equations, most):
    record, D, base = panda
    samples, options = smoothed(record, 10.0), {"rotors": False, "offsets": True}
    observations = EQUATIONS[equations](D.system, samples, 10.0, options).grouped(base)
    found = weighted(observations)
    assert len(found.names) == 64
    assert found.residuals.total_percent < most
    assert holdout_residuals(weighted, observations).total_percent < 2.5 * most
    dynamic = weighted(observe_filtered(D, samples).grouped(base))
    for name in ("MX4R", "MY4R", "XX2R"):
        k = dynamic.names.index(name)
        both = np.hypot(dynamic.deviations[k], found.deviations[k])
        assert found[name] == pytest.approx(dynamic[name], abs=4 * both)
