"""Records and motions of closed robots next to singular configurations."""

from functools import cache

import numpy as np
import pytest
from support.catalogue_systems import catalogue_system

import mbs
from mbs.errors import ModelError
from mbs.identification import FourierSettings, Record, excitation, identify
from mbs.identification.leading import (
    REGULAR,
    active_indices,
    leads_of,
    positions,
    regular,
    signed_leads,
)


@cache
def sr400():
    return catalogue_system("sr400")


def swinging(middle, size, seed=3):
    """Time, configurations, rates and efforts of all joints; the parallelogram swings about
    `middle`."""
    system = sr400()
    t = np.arange(0, 24, 0.005)
    w = 2 * np.pi * 0.2 * np.arange(1, 5)
    rng = np.random.default_rng(seed)
    sine, cosine = size * rng.uniform(-0.4, 0.4, (2, 4, 6))
    S, C = np.sin(np.outer(t, w)), np.cos(np.outer(t, w))
    start = np.array([system.configuration[k] for k in active_indices(system)])
    start[1] += middle
    q_a = start + S @ sine + C @ cosine
    v = (C * w) @ sine - (S * w) @ cosine
    a = -(S * w * w) @ sine - (C * w * w) @ cosine
    q = positions(system, q_a)
    tau = np.array(mbs.models.inverse_dynamics(system).map(len(t))(q.T, v.T, a.T)).T
    return t, q, tau


def test_leads_change_sign_where_the_parallelogram_is_flat():
    system = sr400()
    start = np.array([system.configuration[k] for k in active_indices(system)])
    turned = np.linspace(0, 2.5, 26)
    q = positions(system, start + np.outer(turned, np.eye(6)[1]))
    leads = leads_of(system, q)
    for configuration, value in zip(q, leads, strict=True):
        state = mbs.loops.configuration_report(system, configuration)
        assert abs(value) == pytest.approx(state.leads, rel=1e-9, abs=1e-12)
        assert float(signed_leads(system)(configuration)) == pytest.approx(
            value, rel=1e-9, abs=1e-12
        )
    assert (leads[turned < 1.5] > 0).all()
    assert (leads[turned > 1.7] < 0).all()
    good = regular(system, q)
    assert not good[(turned > 1.52) & (turned < 1.62)].any()
    assert good[turned < 1.4].all()


def test_rows_next_to_a_singular_configuration_are_left_out_and_told():
    t, q, tau = swinging(0.9, 1.0)
    assert 0.005 < np.mean(np.abs(leads_of(sr400(), q)) < REGULAR) < 0.2
    noisy = q + 1e-5 * np.random.default_rng(1).normal(size=q.shape)
    found = identify(sr400(), Record.of(sr400(), t, noisy, tau), 6.0, quiet=True)
    assert found.estimate.residuals.total_percent < 0.6
    assert found.observations.dropped > 5
    assert f"Loops: {found.observations.dropped} of " in found.text()


def test_a_record_next_to_singular_configurations_is_refused():
    t, q, tau = swinging(np.pi / 2, 0.03)
    with pytest.raises(ModelError, match=r"sr400: \d+ % of the record is next to singular"):
        identify(sr400(), Record.of(sr400(), t, q, tau), 6.0, quiet=True)


def test_an_exciting_motion_stays_on_its_side_of_a_singular_configuration():
    motion = excitation(
        sr400(),
        series=FourierSettings(period=5.0, harmonics=3, samples=30),
        position={f"q{k}": 1.0 for k in (1, 2, 4, 5, 6, 7)},
        velocity=3.0,
        starts=1,
        rounds=40,
        quiet=True,
    )
    leads = leads_of(sr400(), motion.configuration(np.linspace(0, 5, 1001)))
    assert leads.min() > 0.0099
    assert motion.worst("leading").lowest == pytest.approx(leads.min(), abs=1e-4)
    assert motion.condition < 1000
    assert "leading       sr400" in motion.text()
