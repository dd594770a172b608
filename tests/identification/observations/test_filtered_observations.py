from dataclasses import replace

import numpy as np
import pytest
from support.measured_arm import arm, equations, noisy_samples

from mbs.errors import ModelError
from mbs.identification import filtered_regressor, least_squares, observe_momentum


def test_filtered_equations_hold_without_accelerations():
    _, base, truth = equations()
    samples = noisy_samples(0.0, rate=400.0)
    blind = replace(samples, a=np.full_like(samples.a, 1e6))
    observations = observe_momentum(filtered_regressor(arm()), blind, 40.0).grouped(base)
    assert observations.time[0] == pytest.approx(15 / 40, abs=0.01)
    assert observations.W @ truth == pytest.approx(observations.y, abs=5e-3)
    found = least_squares(observations)
    assert found.values == pytest.approx(truth, abs=2e-3)


def test_the_corner_suits_the_samples():
    for corner in (0.0, 1.0, 1000.0):
        with pytest.raises(ModelError, match="filtered model: the corner is"):
            observe_momentum(filtered_regressor(arm()), noisy_samples(0.0), corner)
