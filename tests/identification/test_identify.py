import casadi
import numpy as np
import pytest
from support.measured_arm import arm, motion, noisy_record, true_efforts

import mbs
import mbs.identification.bodies as physical_set
from mbs.errors import ModelError, SolverError
from mbs.identification import (
    FourierSettings,
    Record,
    Samples,
    base_parameters,
    excitation,
    identify,
    least_squares,
    numeric_parameters,
    observe,
    regressor,
    symbolic_parameters,
)
from mbs.identification.leading import active_indices
from mbs.identification.methods import METHODS


def test_an_arm_identified_from_a_noisy_record_predicts_another_motion():
    found = identify(arm(), noisy_record(), 8.0)
    assert found.estimate.names == found.base.names
    assert found.validation.rms.max() < 0.1
    _, q, v, a = motion(seed=1, rate=50.0)
    model = mbs.models.inverse_dynamics(found.identified_system())
    predicted = np.array(model.map(len(q))(q.T, v.T, a.T)).T
    wanted = true_efforts(q, v, a)
    assert np.linalg.norm(predicted - wanted) < 0.01 * np.linalg.norm(wanted)
    A = np.array(mbs.models.inertia_matrix(found.identified_system())(q[0]))
    assert np.linalg.eigvalsh(A)[0] > 0
    text = found.text()
    assert "weighted least squares" in text
    assert "physically consistent" in text
    assert "Errors, last 25 %, found from the rest" in text
    assert "measured_arm: 22 base parameters of 39, bandwidth 8 Hz" in text
    assert repr(found).startswith(
        "<Identification measured_arm: 22 base parameters of 39, weighted"
    )
    assert len(repr(found.estimate)) < 100
    essential = found.essential()
    assert f"Essential: {len(essential.estimate.names)} of 22 parameters" in text
    assert len(found.cross_validated().time) == len(found.estimate.observations.time)


@pytest.mark.parametrize("method", sorted(METHODS))
def test_every_method_finds_the_arm(method):
    found = identify(arm(), noisy_record(), 8.0, method, quiet=True)
    truth = found.base.matrix @ numeric_parameters(arm(), found.base.columns)
    errors = (found.estimate.values - truth) / found.estimate.deviations
    assert np.sqrt(np.mean(errors**2)) < 1.6
    assert np.abs(errors).max() < 4.5
    assert found.validation.rms == pytest.approx([0.04] * 3, rel=0.3)


@pytest.mark.parametrize("equations", ["filtered", "energy"])
def test_equations_without_accelerations_find_the_arm(equations):
    found = identify(arm(), noisy_record(), 8.0, equations=equations, quiet=True)
    truth = found.base.matrix @ numeric_parameters(arm(), found.base.columns)
    errors = (found.estimate.values - truth) / found.estimate.deviations
    assert np.sqrt(np.mean(errors**2)) < 2
    assert found.estimate["Fv1"] == pytest.approx(0.8, rel=0.15)
    assert found.estimate["MX2R"] == pytest.approx(
        truth[found.estimate.names.index("MX2R")], rel=0.05
    )


def test_instruments_take_out_the_bias_of_rough_positions():
    record = noisy_record(position=6e-3)
    plain, free = (
        identify(arm(), record, 12.0, method, quiet=True) for method in ("weighted", "instrumental")
    )
    truth = free.base.matrix @ numeric_parameters(arm(), free.base.columns)
    k = free.estimate.names.index("Ia3")
    assert plain.estimate.values[k] < truth[k] - 0.02
    assert abs(free.estimate.values[k] - truth[k]) < 0.5 * abs(plain.estimate.values[k] - truth[k])


@pytest.mark.parametrize("method", ["weighted", "instrumental"])
def test_a_search_of_bodies_that_fails_leaves_the_base_parameters(method, monkeypatch):
    wanted = identify(arm(), noisy_record(), 8.0, method, quiet=True).estimate
    monkeypatch.setattr(physical_set, "_ROUNDS", 2)
    monkeypatch.setitem(physical_set._OPTIONS["ipopt"], "max_iter", 2)
    found = identify(arm(), noisy_record(), 8.0, method, quiet=True)
    assert found.bodies is None
    assert "IPOPT ended with Maximum_Iterations_Exceeded" in found.bodies_reason
    assert found.estimate.values == pytest.approx(wanted.values, rel=0.05, abs=0.05)
    assert "Bodies: none were found; physical consistency: IPOPT ended" in found.text()
    with pytest.raises(ModelError, match="measured_arm: no bodies were found"):
        found.identified_system()
    with pytest.raises(SolverError, match="IPOPT ended"):
        identify(arm(), noisy_record(), 8.0, "consistent", quiet=True)


@pytest.mark.parametrize(
    ("method", "equations"), [("weighted", "filtered"), ("instrumental", "dynamic")]
)
def test_several_records_are_identified_together(method, equations):
    records = [noisy_record(), noisy_record(seed=1).between(0, 6)]
    found = identify(arm(), records, 8.0, method, equations=equations, quiet=True)
    alone = [identify(arm(), r, 8.0, equations=equations, quiet=True).observations for r in records]
    assert len(found.observations) == sum(len(one) for one in alone)
    assert (np.diff(found.observations.time) > 0).all()
    truth = found.base.matrix @ numeric_parameters(arm(), found.base.columns)
    errors = (found.estimate.values - truth) / found.estimate.deviations
    assert np.sqrt(np.mean(errors**2)) < 2


def test_the_pieces_of_a_record_with_a_gap_are_identified():
    record = noisy_record()
    keep = (record.time < 4) | (record.time > 4.5)
    with pytest.raises(ModelError, match=r"identify\(system, \[r1, r2\], ...\)"):
        Record.of(arm(), record.time[keep], record.q[keep], record.tau[keep])
    gapped = Record.of(arm(), record.time[keep], record.q[keep], record.tau[keep], longest_gap=1.0)
    with pytest.raises(ModelError, match=r"give identify the list record.pieces\(0.0625\)"):
        identify(arm(), gapped, 8.0, quiet=True)
    pieces = gapped.pieces()
    assert [len(piece.time) for piece in pieces] == [1600, 2199]
    found = identify(arm(), pieces, 8.0, quiet=True)
    assert found.estimate["Fv1"] == pytest.approx(0.8, rel=0.1)


@pytest.mark.parametrize(
    ("record", "options", "message"),
    [
        (np.zeros((100, 3)), {}, "measured_arm: the record is array"),
        (None, {}, "measured_arm: the record is None; give mbs.identification.Record"),
        ([], {}, "the list of records is empty"),
        (noisy_record(), {"bandwidth": "5"}, "the bandwidth is '5'; give a number in Hz"),
        (noisy_record(), {"smoothing": "smoothed"}, "smoothing is 'smoothed'; give the function"),
    ],
)
def test_what_cannot_be_identified_is_refused(record, options, message):
    given = {"bandwidth": 5.0} | options
    with pytest.raises(ModelError, match=message):
        identify(arm(), record, given.pop("bandwidth"), quiet=True, **given)


def test_methods_and_equations_have_names():
    with pytest.raises(ModelError, match="method is 'weigthed'; did you mean 'weighted'"):
        identify(arm(), noisy_record(), 8.0, "weigthed")
    with pytest.raises(ModelError, match="equations is 'dynamics'; did you mean 'dynamic'"):
        identify(arm(), noisy_record(), 8.0, equations="dynamics")
    for equations in ("filtered", "energy"):
        with pytest.raises(ModelError, match=r"instruments are for .*; use equations='dynamic'"):
            identify(arm(), noisy_record(), 8.0, "instrumental", equations=equations, quiet=True)


def test_efforts_of_the_wrong_sign_are_told():
    record = noisy_record()
    turned = Record.of(arm(), record.time, record.q, -record.tau)
    text = identify(arm(), turned, 8.0, "weighted", quiet=True).text()
    assert "Below zero: Fv1, Fs1, " in text
    assert "check the signs of the efforts" in text


@pytest.mark.parametrize("method", ["weighted", "instrumental"])
def test_a_closed_robot_is_identified_from_its_independent_joints(method):
    system = mbs.load("five_bar").assemble()
    places = active_indices(system)
    motion = excitation(
        system,
        series=FourierSettings(period=4.0, harmonics=3, samples=24),
        position=[(system.configuration[k] - 0.5, system.configuration[k] + 0.5) for k in places],
        velocity=3.0,
        starts=1,
        rounds=10,
        quiet=True,
    )
    t = np.arange(0, 12, 0.005)
    q, v, a = motion.configuration(t), motion.v(t), motion.a(t)
    tau = np.array(mbs.models.inverse_dynamics(system).map(len(t))(q.T, v.T, a.T)).T
    tau += 0.01 * np.random.default_rng(2).normal(size=tau.shape)
    record = Record.of(system, t, motion.q(t), tau)
    assert record.names == tuple(system.coordinates[k].name for k in places)
    found = identify(system, record, 10.0, method, quiet=True)
    truth = found.base.matrix @ numeric_parameters(system, found.base.columns)
    errors = (found.estimate.values - truth) / found.estimate.deviations
    assert np.sqrt(np.mean(errors**2)) < 2
    assert found.validation.rms.max() < 0.01


def driven(t, q, v):
    return casadi.vertcat(4 * casadi.sin(5 * t), 0, -3 * casadi.cos(7 * t), 0)


def test_base_parameters_of_a_closed_robot_are_found_from_a_simulation():
    system = mbs.load("five_bar").assemble()
    D = regressor(system)
    base = base_parameters(system, columns=D.columns)
    observations = observe(D, samples_of(system, mbs.simulate.run(system, 3.0, tau=driven)))
    assert observations.efforts == ("q1", "q3")
    truth = base.matrix @ np.array(
        [float(x) for x in symbolic_parameters(system, D.columns).elements()]
    )
    found = least_squares(observations.grouped(base))
    assert found.values == pytest.approx(truth, abs=1e-3)
    assert found.residuals.rms.max() < 1e-4


def test_a_motion_without_efforts_shows_ratios_alone():
    system = mbs.load("five_bar").assemble()
    D = regressor(system)
    observations = observe(D, samples_of(system, mbs.simulate.run(system, 2.0)))
    with pytest.raises(ModelError, match=r"ZZ1R, .* cannot be told apart in this record"):
        least_squares(observations.grouped(base_parameters(system, columns=D.columns)))


def samples_of(system, run):
    """Every row of a simulation; its efforts are those of the motors."""
    q, v, a = (
        np.column_stack([run[f"{c.name}.{x}"] for c in table])
        for x, table in (
            ("q", system.coordinates),
            ("v", system.velocity_coordinates),
            ("a", system.velocity_coordinates),
        )
    )
    names = tuple(system.velocity_coordinates[k].name for k in system.independent)
    tau = np.column_stack([run[f"{name}.tau"] for name in names])
    return Samples(run.time, q, v, a, tau, names, ("N.m",) * len(names))
