from dataclasses import replace

import numpy as np
import pytest
from support.measured_arm import equations, noisy_samples

from mbs.errors import ModelError
from mbs.identification.essential import essential
from mbs.identification.least_squares import least_squares
from mbs.identification.observations import observe
from mbs.identification.weighted import weighted


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


def test_bounds_without_sense_are_refused():
    estimate = least_squares(observations(0.1))
    with pytest.raises(ModelError, match="significance 2"):
        essential(estimate, significance=2.0)
    blind = replace(estimate, covariance=np.full_like(estimate.covariance, np.nan))
    with pytest.raises(ModelError, match="least squares has no deviations"):
        essential(blind)
