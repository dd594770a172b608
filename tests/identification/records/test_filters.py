import numpy as np
import pytest

from mbs.errors import ModelError
from mbs.identification import Record, resampled, smoothed, smoothed_with_velocity
from mbs.identification.record import central_difference, zero_phase

RATE = 500.0
TIME = np.arange(5000) / RATE


def sine(frequency, time=TIME):
    return np.sin(2 * np.pi * frequency * time)[:, None]


def test_the_filter_delays_nothing_and_halves_the_power_at_its_bandwidth():
    slow, edge, fast = (zero_phase(sine(f), RATE, 10.0)[1000:-1000] for f in (1.0, 10.0, 40.0))
    assert slow == pytest.approx(sine(1.0)[1000:-1000], abs=1e-4)
    assert edge == pytest.approx(0.5 * sine(10.0)[1000:-1000], abs=1e-6)
    assert np.abs(fast).max() < 1e-4


def test_the_filter_says_what_it_cannot_do():
    with pytest.raises(ModelError, match="bandwidth is 300 Hz for 500 samples"):
        zero_phase(sine(1.0), RATE, 300.0)
    with pytest.raises(ModelError, match="10 samples are too few"):
        zero_phase(sine(1.0)[:10], RATE, 10.0)


def test_central_differences_are_of_fourth_order():
    exact = 2 * np.pi * 5 * np.cos(2 * np.pi * 5 * TIME)[:, None]
    errors = []
    for step in (1, 2):
        rate = central_difference(sine(5.0)[::step], RATE / step)
        errors.append(np.abs(rate - exact[::step])[2:-2].max())
    assert errors[1] / errors[0] == pytest.approx(16, rel=0.05)


def record(**options):
    rng = np.random.default_rng(1)
    time = np.sort(rng.uniform(0, 10, 8000))
    time = time[np.r_[True, np.diff(time) > 1e-6]]
    v = 2 * np.pi * np.cos(2 * np.pi * time)[:, None]
    return Record(time, sine(1.0, time), 3 * sine(1.0, time), v, **options)


def test_samples_of_uneven_rows_are_even_and_in_phase():
    even = resampled(record(), 200.0)
    assert np.diff(even.time) == pytest.approx(0.005)
    for make in (smoothed, smoothed_with_velocity):
        samples = make(record(), 10.0)
        assert 200.0 <= samples.rate < 1000.0
        assert samples.time[0] >= 0.5
        assert samples.q == pytest.approx(sine(1.0, samples.time), abs=2e-3)
        assert samples.tau == pytest.approx(3 * samples.q, abs=1e-6)
        w = 2 * np.pi
        assert samples.v == pytest.approx(w * np.cos(w * samples.time)[:, None], abs=0.05)
        assert samples.a == pytest.approx(-w * w * sine(1.0, samples.time), abs=2.0)


def test_records_that_cannot_be_smoothed_are_refused():
    with pytest.raises(ModelError, match="too short for a bandwidth of 1 Hz"):
        smoothed(record(), 1.0)
    still = Record(TIME, sine(1.0), sine(1.0))
    with pytest.raises(ModelError, match="no velocities were measured"):
        smoothed_with_velocity(still, 10.0)
    with pytest.raises(ModelError, match="the rate is 0 Hz"):
        resampled(still, 0.0)


def test_a_gap_that_hides_the_motion_is_refused():
    keep = (TIME < 4.0) | (TIME > 4.2)
    rate = 2 * np.pi * np.cos(2 * np.pi * TIME)[:, None]
    values = (x[keep] for x in (TIME, sine(1.0), sine(1.0), rate))
    holed = Record(*values, longest_gap=1.0)
    for make in (smoothed, smoothed_with_velocity):
        with pytest.raises(ModelError, match=r"0\.204 s from 3\.998 s, .* bandwidth of 10 Hz"):
            make(holed, 10.0)
    assert len(smoothed(holed, 2.0).time) > 40
