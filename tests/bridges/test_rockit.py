"""Equations of motion on a stage of rockit, when it is installed."""

import casadi
import numpy as np
import pytest
from bridges.test_opti import slider
from support.rod_mechanisms import four_bar

from mbs.bridges import rockit_stage
from mbs.errors import ModelError
from mbs.models import dae


class Recorded:
    """What a stage of rockit offers, which notes what it is given."""

    def __init__(self):
        self.ders, self.algs, self.values, self.guesses = [], [], [], []

    def _signal(self, size):
        return casadi.MX.sym("signal", size)

    state = algebraic = control = parameter = _signal

    def set_der(self, x, rate):
        self.ders.append((x, rate))

    def add_alg(self, rows):
        self.algs.append(rows)

    def set_initial(self, x, value):
        self.guesses.append((x, value))

    def set_value(self, p, value):
        self.values.append((p, value))


@pytest.mark.parametrize("code", ["compiled", "interpreted"])
def test_the_equations_are_those_of_the_dae(code):
    model = dae(four_bar(), "index1", q0={"j1": 0.3}, v0={"j1": 2.0}, tau0={"j1": 1.0})
    stage = Recorded()
    signals = rockit_stage(stage, model, code=code)
    (x, rate), (rows,) = stage.ders[0], stage.algs
    got = casadi.Function("got", [x, signals.z, signals.u], [rate, rows, signals.q])
    values = got(model.x0 + 0.1, model.z0 - 0.2, 3.0)
    wanted = model.function()(model.x0 + 0.1, model.z0 - 0.2, 3.0, model.p0)
    for value, number in zip(values, (0, 1, 3), strict=True):
        assert float(casadi.norm_inf(value - wanted[number])) < 1e-12
    assert [np.array(value).ravel().tolist() for _, value in stage.guesses] == [
        model.x0.tolist(),
        model.z0.tolist(),
        model.u0.tolist(),
    ]


def test_parameters_get_their_values():
    stage = Recorded()
    signals = rockit_stage(stage, dae(slider()))
    assert stage.algs == []
    assert stage.values[0][0] is signals.p
    assert float(stage.values[0][1]) == 2.0


def test_parameters_may_be_given():
    """As an expression, such as variables of a design problem, or as numbers by name."""
    stage, mass = Recorded(), casadi.MX.sym("mass")
    signals = rockit_stage(stage, dae(slider()), p=mass)
    (x, rate), u = stage.ders[0], signals.u
    got = casadi.Function("got", [x, u, mass], [rate])
    assert np.array(got([0.0, 0.5], 6.0, 4.0)).ravel() == pytest.approx([0.5, 1.5])
    assert stage.values == []
    named = rockit_stage(stage, dae(slider()), p={"m": 7.0})
    assert float(casadi.Function("p", [], [named.p])()["o0"]) == 7.0
    with pytest.raises(ModelError, match=r"p has no 'mass'; .*m"):
        rockit_stage(stage, dae(slider()), p={"mass": 7.0})


def test_refuses_a_code_that_is_not_there():
    with pytest.raises(ModelError, match="code is 'c'; use one of compiled, interpreted"):
        rockit_stage(Recorded(), dae(slider()), code="c")


@pytest.mark.parametrize(("form", "code"), [("reduced", "interpreted"), ("index1", "compiled")])
def test_rockit_finds_the_least_effort_of_a_slider(form, code):
    rockit = pytest.importorskip("rockit")
    ocp = rockit.Ocp(t0=0, T=2.0)
    signals = rockit_stage(ocp, dae(slider(), form), code=code)
    ocp.add_objective(ocp.integral(signals.u**2))
    ocp.subject_to(ocp.at_t0(signals.x) == 0)
    ocp.subject_to(ocp.at_tf(signals.x) == casadi.DM([1.5, 0]))
    ocp.solver("ipopt", {"print_time": False, "ipopt.print_level": 0, "ipopt.sb": "yes"})
    ocp.method(rockit.DirectCollocation(N=8))
    _, u = ocp.solve().sample(signals.u, grid="control")
    h, middle = 0.25, 2 - 0.25 * (np.arange(8) + 0.5)
    rows = h / 2 * np.array([middle, np.ones(8)])
    exact = np.linalg.lstsq(rows, np.array([1.5, 0]), rcond=None)[0]
    assert np.abs(np.array(u).ravel()[:8] - exact).max() < 1e-6
