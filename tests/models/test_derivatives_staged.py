"""Derivatives of the accelerations of large trees, whose columns are a map."""

import casadi
import numpy as np
import pytest
from casadi import SX
from support.random_trees import ALL_KINDS, random_state, random_tree
from test_derivatives import assert_close

import mbs
from mbs import Mechanism
from mbs.components import Body, Revolute
from mbs.errors import ModelError
from mbs.models import direct_dynamics_derivatives
from mbs.models.derivatives import accelerations_by_efforts
from mbs.models.symbols import symbols_of
from mbs.native import compiled
from mbs.native.staged import staged
from mbs.operations import count


@pytest.fixture(params=["serial", "branched"], scope="module")
def system(request):
    serial = request.param == "serial"
    kinds = ("revolute", "prismatic") if serial else (*ALL_KINDS, "free", "spherical")
    found = (
        random_tree(seed, n=11 if serial else 6, kinds=kinds, serial=serial).mechanism.assemble()
        for seed in range(40)
    )
    return next(system for system in found if 10 <= system.nv <= 16)


def written_out(system, names=("q", "v", "tau")):
    """The same derivatives, every column by its own scalar operations."""
    s = symbols_of(system)
    tau = SX.sym("tau", system.nv)
    blocks, a = accelerations_by_efforts(system, s, tau, names)
    inputs = [s.q, s.v, tau, *([system.p] if system.parameters else [])]
    return casadi.Function("f", inputs, [*(blocks[name] for name in names), a])


def test_values(system):
    f, g = direct_dynamics_derivatives(system), written_out(system)
    assert [m.columns for m in staged(f).maps] == [3 * system.nv]
    assert (f.name_in(), f.name_out()) == (["q", "v", "tau"], ["da_dq", "da_dv", "da_dtau", "a"])
    for seed in range(3):
        state = random_state(system, np.random.default_rng(seed))
        found = f(*state)
        assert_close(found, g(*state), 1e-12)
        inverse = np.array(found[2])
        assert np.array_equal(inverse, inverse.T)


@pytest.mark.sweep
@pytest.mark.parametrize("names", [("tau",), ("v", "q"), ("tau", "v")])
def test_some_derivatives_in_any_order(system, names):
    f = direct_dynamics_derivatives(system, with_respect_to=names)
    assert f.name_out() == [*(f"da_d{name}" for name in names), "a"]
    state = random_state(system, np.random.default_rng(0))
    assert_close(f(*state), written_out(system, names)(*state), 1e-12)


def test_on_symbols_and_expanded(system):
    f = direct_dynamics_derivatives(system)
    state = random_state(system, np.random.default_rng(0))
    exact = f(*state)
    for kind in (casadi.SX, casadi.MX):
        x = [kind.sym("x", f.size1_in(k)) for k in range(3)]
        assert_close(casadi.Function("g", x, f(*x))(*state), exact, 1e-12)
    expanded = f.expand()
    assert expanded.is_a("SXFunction")
    assert_close(expanded(*state), exact, 1e-12)
    taken, plain = count(f), count(written_out(system))
    assert 0.8 < taken.mul / plain.mul < 1.2
    assert taken.mul == count(expanded).mul


def test_machine_code(system):
    f = direct_dynamics_derivatives(system)
    state = [np.array(x) for x in random_state(system, np.random.default_rng(0))]
    exact = [np.array(x) for x in f(*state)]
    plain = compiled(f, derivatives=0)(*state)
    fast = compiled(f, derivatives=0, fast=True)(*state)
    for a, b, c in zip(exact, plain, fast, strict=True):
        assert np.array_equal(a.ravel("F"), b.ravel("F"))
        np.testing.assert_allclose(c.reshape(a.shape), a, rtol=0, atol=1e-12 * np.abs(a).max())


def test_second_derivatives():
    system = random_tree(0, n=10, kinds=("revolute",), serial=False).mechanism.assemble()
    f, g = direct_dynamics_derivatives(system, with_respect_to="v"), written_out(system, ("v",))
    v, e = casadi.MX.sym("v", system.nv), np.linspace(-1, 1, system.nv)
    q, _, tau = random_state(system, np.random.default_rng(0))
    slopes = [
        casadi.Function("s", [v], [casadi.gradient(casadi.dot(e, h(q, v, tau)[0] @ e), v)])
        for h in (f, g)
    ]
    assert_close([slopes[0](e)], [slopes[1](e)], 1e-11)


def chain_with_parameter():
    mechanism = Mechanism("chain", gravity=(0.0, 0.0, -9.81))
    before, m = mechanism.world, mbs.Parameter("M", 2.0)
    for k in range(10):
        body = mechanism.add(Body(f"b{k}", mass=m, com=(0.1, 0, 0.02), inertia=np.eye(3) / 9))
        mechanism.connect(before.at(0.2, 0, 0), Revolute(f"j{k}", axis="xyz"[k % 3]), body)
        before = body
    return mechanism.assemble()


def test_parameters_and_checks():
    system = chain_with_parameter()
    names = ("q", "p", "tau")
    f, g = direct_dynamics_derivatives(system, with_respect_to=names), written_out(system, names)
    state = random_state(system, np.random.default_rng(0))
    p = np.array(system.p_default)
    assert f.name_out() == ["da_dq", "da_dp", "da_dtau", "a"]
    assert_close(f(*state), g(*state, p), 1e-12)
    assert_close(f(*state, 2 * p), g(*state, 2 * p), 1e-12)
    with pytest.raises(ModelError, match=r"ddm_derivatives\(chain\): v has 9 values, it needs 10"):
        f(state[0], state[1][:9], state[2])
    fast = compiled(f, derivatives=0, fast=True)
    assert_close(fast(*map(np.array, state))[:1], g(*state, p)[:1], 1e-12)
