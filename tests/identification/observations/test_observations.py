from dataclasses import replace

import numpy as np
import pytest
from support.measured_arm import arm, equations, mbs_values, noisy_record, noisy_samples

import mbs
from mbs.components import Body, Prismatic
from mbs.errors import ModelError
from mbs.identification import (
    Samples,
    excitation_quality,
    least_squares,
    observe,
    observe_filtered,
    regressor,
    smoothed,
)
from mbs.identification.observations import require_visible


def full():
    return observe(equations()[0], noisy_samples(0.0))


def test_the_equations_hold_for_the_true_parameters():
    D, base, truth = equations()
    observations = full()
    assert observations.W @ np.array(mbs_values(D.columns)) == pytest.approx(observations.y)
    grouped = observations.grouped(base)
    assert grouped.names == base.names
    assert grouped.W @ truth == pytest.approx(observations.y)
    W, y = grouped.rows
    assert W.shape == (len(grouped), base.count)
    assert y[4] == observations.y[1, 1]


def test_both_sides_pass_one_filter_and_fewer_rows_stay():
    D, base, truth = equations()
    samples = smoothed(noisy_record(position=0.0, effort=0.0), 8.0)
    observations = observe_filtered(D, samples).grouped(base)
    rate = (len(observations.time) - 1) / (observations.time[-1] - observations.time[0])
    assert rate == pytest.approx(1.8 * 8.0, rel=0.1)
    assert observations.W @ truth == pytest.approx(observations.y, abs=0.03)
    narrow = observe_filtered(D, samples, 4.0)
    assert len(narrow.time) < 0.6 * len(observations.time)
    with pytest.raises(ModelError, match="give a bandwidth in Hz"):
        observe_filtered(D, noisy_samples(0.0))


def test_parts_of_a_record():
    observations = full()
    first, second = observations.split(0.25)
    assert len(first.time) + len(second.time) == len(observations.time)
    assert first.time[-1] < 2.51 < second.time[1] + 0.01
    parts = list(observations.parts(3))
    assert sum(len(part.time) for _, part in parts) == len(observations.time)
    assert all(len(rest.time) + len(part.time) == len(observations.time) for rest, part in parts)


def test_springs_are_known_efforts():
    m = mbs.Mechanism("sprung", gravity=(0, 0, 0))
    slide = Prismatic("j", axis="z", stiffness=40.0, rest=0.1, actuated=True)
    m.connect(m.world, slide, m.add(Body("b", mass=2, inertia=(1, 1, 1))))
    system = m.assemble()
    time = np.arange(200) / 50
    q, v, a = (s * np.sin(3 * time + p)[:, None] for s, p in ((1, 0), (3, np.pi / 2), (-9, 0)))
    tau = 2 * a + 40 * (q - 0.1) + 0.5 * v
    samples = Samples(time, q, v, a, tau, ("j",), ("N",))
    found = least_squares(observe(regressor(system), samples).select(["M1", "Fv1"]))
    assert found.values == pytest.approx([2.0, 0.5])


def test_what_the_record_does_not_show_is_named():
    quality = excitation_quality(full())
    assert {"XX1", "M1", "Fv1"} & set(quality.unseen) == {"XX1", "M1"}
    assert {"ZZ1", "Ia1"} <= set(quality.inseparable)
    assert "Fv1" not in quality.inseparable
    assert quality.condition == quality.scaled_condition == float("inf")
    with pytest.raises(ModelError, match=r"cannot be seen at all and .* cannot be told apart in"):
        least_squares(full())
    good = require_visible(full().grouped(equations()[1]))
    values = np.linalg.svd(full().grouped(equations()[1]).rows[0], compute_uv=False)
    assert good.condition == pytest.approx(values[0] / values[-1])
    assert 1 < good.scaled_condition < good.condition
    assert good.sentence == ""


def test_a_joint_that_stands_still_hides_its_parameters():
    D, base, _ = equations()
    samples = noisy_samples(0.0)
    v, a = samples.v.copy(), samples.a.copy()
    v[:, 2] = a[:, 2] = 0.0
    still = replace(samples, v=v, a=a)
    with pytest.raises(ModelError, match="Fv3, Fs3 cannot be seen at all"):
        least_squares(observe(D, still).grouped(base))
    first = (x[:5] for x in (samples.time, samples.q, v, a, samples.tau))
    few = Samples(*first, ("",) * 3, ("",) * 3)
    with pytest.raises(ModelError, match="15 equations are too few for"):
        least_squares(observe(D, few).grouped(base))


def test_shapes_and_names_are_checked():
    D, _, _ = equations()
    samples = noisy_samples(0.0)
    with pytest.raises(ModelError, match="2 efforts, the model takes 3 and 3"):
        observe(D, replace(samples, tau=samples.tau[:, :2]))
    with pytest.raises(ModelError, match="give a row for each instant"):
        replace(samples, v=samples.v[:, :2])
    with pytest.raises(ModelError, match="no parameter 'ZZ7'"):
        full().select(["ZZ7"])
    assert arm().nq == 3
    y = full().y.copy()
    y[0, 0] = np.nan
    with pytest.raises(ModelError, match="a number is not finite"):
        replace(full(), y=y)
    with pytest.raises(ModelError, match="W has the shape"):
        replace(full(), y=y[:, :2])
