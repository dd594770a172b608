import casadi
import numpy as np
import pytest
from support.measured_arm import arm, motion, noisy_record, true_efforts

import mbs
from mbs.errors import ModelError
from mbs.identification.base_parameters import base_parameters
from mbs.identification.columns import values_of
from mbs.identification.filters import Samples
from mbs.identification.identify import identify
from mbs.identification.least_squares import least_squares
from mbs.identification.observations import observe
from mbs.identification.regressor import regressor


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
    assert "last quarter, from the rest" in text


def test_the_method_is_one_of_four():
    with pytest.raises(ModelError, match="did you mean 'weighted'"):
        identify(arm(), noisy_record(), 8.0, "weigthed")


def driven(t, q, v):
    return casadi.vertcat(4 * casadi.sin(5 * t), 0, -3 * casadi.cos(7 * t), 0)


def test_base_parameters_of_a_closed_robot_are_found_from_a_simulation():
    system = mbs.load("five_bar").assemble()
    D = regressor(system)
    base = base_parameters(system, columns=D.columns)
    observations = observe(D, samples_of(system, mbs.simulate.run(system, 3.0, tau=driven)))
    assert observations.efforts == ("q1", "q3")
    truth = base.matrix @ np.array([float(x) for x in values_of(system, D.columns).elements()])
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
        for x, table in (("q", system.coordinates), ("v", system.speeds), ("a", system.speeds))
    )
    names = tuple(system.speeds[k].name for k in system.active)
    tau = np.column_stack([run[f"{name}.tau"] for name in names])
    return Samples(run.time, q, v, a, tau, names, ("N.m",) * len(names))
