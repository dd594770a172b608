import pytest
from support.measured_arm import arm, equations, noisy_samples

from mbs.errors import ModelError
from mbs.identification import energy_regressor, least_squares, observe_energy, power_regressor


def test_work_of_the_efforts_is_that_of_the_parameters():
    _, base, truth = equations()
    models = energy_regressor(arm()), power_regressor(arm())
    samples = noisy_samples(0.0, rate=400.0)
    observations = observe_energy(*models, samples, 0.05).grouped(base)
    assert observations.effort_units == ("J",)
    assert len(observations.time) == 199
    assert observations.W @ truth == pytest.approx(observations.y, abs=2e-3)
    found = least_squares(observations)
    assert found.values == pytest.approx(truth, abs=2e-3)
    assert found["Fv1"] == pytest.approx(0.8, rel=0.02)


def test_intervals_have_samples():
    models = energy_regressor(arm()), power_regressor(arm())
    for interval in (0.0, 100.0):
        with pytest.raises(ModelError, match="energy model: an interval of"):
            observe_energy(*models, noisy_samples(0.0), interval)
