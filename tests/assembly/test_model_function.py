"""How models are called: arguments, parameters left out, mapping, pickling."""

import pickle

import casadi
import numpy as np
import pytest

import mbs
import mbs.models
from mbs import Mechanism
from mbs.components import Body, PointMass, Revolute
from mbs.errors import ModelError


@pytest.fixture(scope="module")
def pendulum():
    m = Mechanism("pendulum", gravity=(0, -9.81, 0), parameters={"L": 0.5, "m": 2.0})
    rod = m.add(Body("rod", mass=0))
    m.connect(m.world, Revolute("j"), rod)
    m.connect(rod.at("L"), m.add(PointMass("bob", mass="m")))
    return m.assemble()


def test_parameters_may_be_left_out(pendulum):
    idm = mbs.models.inverse_dynamics(pendulum)
    expected = 2.0 * 0.5**2 * 3.0 + 2.0 * 9.81 * 0.5
    assert float(idm([0], [0], [3.0])) == pytest.approx(expected)
    assert float(idm(q=[0], v=[0], a=[3.0])["tau"]) == pytest.approx(expected)
    order = [p.name for p in pendulum.parameters]
    values = [{"L": 0.25, "m": 4.0}[name] for name in order]
    assert float(idm([0], [0], [3.0], values)) == pytest.approx(4 * 0.25**2 * 3 + 4 * 9.81 * 0.25)


def test_mapped_and_expanded_models_keep_the_defaults(pendulum):
    idm = mbs.models.inverse_dynamics(pendulum)
    one = float(idm([0], [0], [3.0]))
    mapped = idm.map(3)
    np.testing.assert_allclose(
        np.array(mapped(np.zeros((1, 3)), np.zeros((1, 3)), [[3.0] * 3])), one
    )
    assert float(idm.expand()([0], [0], [3.0])) == one


def test_symbols_pass(pendulum):
    idm = mbs.models.inverse_dynamics(pendulum)
    for kind in (casadi.SX, casadi.MX):
        x = kind.sym("x")
        f = casadi.Function("f", [x], [idm(x, 0.0, 0.0)])
        assert float(f(0.3)) == pytest.approx(float(idm([0.3], [0], [0])))


def test_a_pickle_keeps_the_equations(pendulum):
    idm = mbs.models.inverse_dynamics(pendulum)
    again = pickle.loads(pickle.dumps(idm))
    values = pendulum.parameter_values()
    assert float(again([0.3], [0.1], [0.2], values)) == float(idm([0.3], [0.1], [0.2]))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda f: f(0.3, [0] * 6, [0] * 6), r"q has 1 values, it needs 6: q1, q2"),
        (lambda f: f([], [0] * 6, [0] * 6), r"q has 0 values, it needs 6"),
        (lambda f: f([0] * 6, [0] * 6), r"a missing; the inputs are q \(6, 1\)"),
        (lambda f: f(q=[0] * 6), r"v and a missing"),
        (lambda f: f(q=[0] * 6, v=[0] * 6, acc=[0] * 6), r"there is no input 'acc'"),
        (lambda f: f([0] * 6, [0] * 6, [0] * 6, 1, 2), r"5 arguments were given"),
        (lambda f: f(["a"] * 6, [0] * 6, [0] * 6), r"q is \["),
        (lambda f: f([np.nan] * 6, [0] * 6, [0] * 6), r"q is not finite; give numbers"),
    ],
)
def test_wrong_calls(call, message):
    idm = mbs.models.inverse_dynamics(mbs.load("puma560").assemble())
    with pytest.raises(ModelError, match=r"idm\(puma560\): " + message):
        call(idm)


def test_zero_stands_for_all_zero():
    idm = mbs.models.inverse_dynamics(mbs.load("puma560").assemble())
    np.testing.assert_array_equal(
        np.array(idm([0.1] * 6, 0, 0)), np.array(idm([0.1] * 6, [0] * 6, [0] * 6))
    )


def test_a_mechanism_is_not_a_system():
    m = mbs.load("puma560")
    builders = (
        mbs.models.inverse_dynamics,
        mbs.models.direct_dynamics,
        mbs.models.direct_geometry,
        mbs.models.energy,
        mbs.models.lagrange,
        lambda s: mbs.models.jacobian(s, 1),
    )
    for builder in builders:
        with pytest.raises(ModelError) as refused:
            builder(m)
        assert str(refused.value) == (
            "puma560 (Mechanism) is not a System, of which models are made; call assemble() first"
        )


def test_what_cannot_be_assembled_is_told_apart():
    with pytest.raises(ModelError) as refused:
        mbs.models.inverse_dynamics(3)  # type: ignore[arg-type]
    assert str(refused.value) == (
        "3 (int) is not a System, of which models are made; give what assemble() returns"
    )
