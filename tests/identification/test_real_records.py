"""Identification of two real robots; skipped where their records are not."""

import numpy as np
import pytest
from support.real_records import panda_record, tx40_record

from mbs.identification.base_parameters import base_parameters
from mbs.identification.consistent import consistent
from mbs.identification.estimate import held_out
from mbs.identification.excitation_quality import excitation_quality
from mbs.identification.filters import smoothed, smoothed_with_velocity
from mbs.identification.identify import identify
from mbs.identification.least_squares import least_squares
from mbs.identification.observations import observe, observe_filtered
from mbs.identification.physical_set import consistent_links
from mbs.identification.prior import Prior
from mbs.identification.regressor import regressor
from mbs.identification.weighted import weighted


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
    assert held_out(least_squares, observations).total_percent <= 1.59
    bodies = consistent(full, Prior(heaviest=18.0))
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
    assert held_out(least_squares, observations).total_percent <= 1.59


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
    late = held_out(least_squares, observations, 0.5)
    assert late.total_percent <= 16.8


@pytest.mark.parametrize("method", ["weighted", "robust", "instrumental"])
def test_methods_explain_the_panda_at_5_hz(method):
    system, record = panda_record()
    options = {"rotors": False, "offsets": True, "prior": Prior(heaviest=18.0)}
    found = identify(system, record, 5.0, method, quiet=True, **options)
    assert found.estimate.residuals.total_percent < 0.99
    assert found.validation.total_percent < 1.13
    assert found.bodies.residuals.total_percent < 1.0
    assert consistent_links(found.bodies.columns, found.bodies.values) == list(range(1, 8))
    assert 10 < len(found.essential().estimate.names) < 64


@pytest.mark.parametrize(("equations", "most"), [("filtered", 1.2), ("energy", 0.5)])
def test_other_equations_on_the_panda(panda, equations, most):
    system, record = panda_record()
    found = identify(
        system, record, 10.0, equations=equations, rotors=False, offsets=True, quiet=True
    )
    assert found.base.count == 64
    assert found.estimate.residuals.total_percent < most
    assert found.validation.total_percent < 2.5 * most
    _, D, base = panda
    dynamic = weighted(observe_filtered(D, smoothed(record, 10.0)).grouped(base))
    for name in ("MX4R", "MY4R", "XX2R"):
        k = dynamic.names.index(name)
        both = np.hypot(dynamic.deviations[k], found.estimate.deviations[k])
        assert found.estimate[name] == pytest.approx(dynamic[name], abs=4 * both)
