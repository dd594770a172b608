"""A Function in JAX: values and derivatives in both directions; skipped without JAX."""

import sys

import casadi
import numpy as np
import pytest

import mbs
from mbs.bridges import jax_function
from mbs.components import Body, Revolute
from mbs.errors import ModelError


@pytest.fixture
def jax():
    jax = pytest.importorskip("jax")
    jax.config.update("jax_enable_x64", True)
    return jax


@pytest.fixture(scope="module")
def system():
    return mbs.load("planar_2r").assemble()


POINT = [np.array([0.3, 0.5]), np.array([1.0, -0.2]), np.array([0.1, 0.4])]


def test_values_and_jacobians_are_those_of_the_function(jax, system):
    idm = mbs.models.inverse_dynamics(system)
    f = jax_function(idm)
    wanted = np.array(idm(*POINT)).ravel()
    assert np.abs(jax.jit(f)(*POINT) - wanted).max() < 1e-14
    assert np.array_equal(f(q=POINT[0], v=POINT[1], a=POINT[2]), jax.jit(f)(*POINT))
    assert f.__name__ == "idm"
    blocks = casadi.Function.jacobian(idm)(*POINT, 0)
    for number, block in enumerate(blocks):
        for direction in (jax.jacfwd, jax.jacrev):
            found = jax.jit(direction(f, number))(*POINT)
            assert np.abs(found - np.array(block)).max() < 1e-14


def test_second_derivatives(jax, system):
    idm = mbs.models.inverse_dynamics(system)
    f, q = jax_function(idm), casadi.SX.sym("q", 2)
    wanted = casadi.hessian(casadi.sum1(idm(q, *POINT[1:])), q)[0]
    wanted = np.array(casadi.Function("h", [q], [wanted])(POINT[0]))
    found = jax.hessian(lambda q: f(q, *POINT[1:]).sum())(POINT[0])
    assert np.abs(found - wanted).max() < 1e-13


def test_matrices_and_several_outputs(jax, system):
    lagrange = mbs.models.lagrange(system)
    f = jax_function(lagrange)
    A, B, Q = f(*POINT[:2])
    for found, wanted in zip((A, B, Q), lagrange(*POINT[:2]), strict=True):
        assert found.shape == np.array(wanted).squeeze().shape
        assert np.abs(np.array(wanted).squeeze() - found).max() < 1e-14
    forward, backward = (d(lambda q: f(q, POINT[1])[1])(POINT[0]) for d in (jax.jacfwd, jax.jacrev))
    assert forward.shape == (2, 2, 2)
    assert np.abs(forward - backward).max() < 1e-14
    h = 1e-6
    for k, e in enumerate(np.eye(2)):
        ends = [np.array(lagrange(POINT[0] + s * h * e, POINT[1])[1]) for s in (1, -1)]
        assert np.abs(forward[:, :, k] - (ends[0] - ends[1]) / (2 * h)).max() < 1e-8


def test_batches(jax, system):
    idm = mbs.models.inverse_dynamics(system)
    q = np.random.default_rng(3).normal(size=(5, 2))
    f = jax_function(idm)
    found = jax.vmap(f, in_axes=(0, None, None))(q, *POINT[1:])
    wanted = np.array([np.array(idm(row, *POINT[1:])).ravel() for row in q])
    assert np.abs(found - wanted).max() < 1e-14
    every = jax.vmap(jax.vmap(f, in_axes=(None, 0, None)), in_axes=(0, None, None))
    table = every(q, q[:3], POINT[2])
    assert table.shape == (5, 3, 2)
    assert np.array_equal(table[4, 1], f(q[4], q[1], POINT[2]))


def test_slopes_of_batches(jax, system):
    """By reverse mode in a batch, against the Jacobian one point at a time."""
    idm = mbs.models.inverse_dynamics(system)
    q = np.random.default_rng(4).normal(size=(6, 2))
    f = jax_function(idm)
    found = jax.jit(jax.vmap(jax.grad(lambda q: (f(q, *POINT[1:]) ** 2).sum())))(q)
    jacobian = casadi.Function.jacobian(idm)
    for row, slope in zip(q, found, strict=True):
        block, tau = np.array(jacobian(row, *POINT[1:], 0)[0]), np.array(idm(row, *POINT[1:]))
        assert np.abs(slope - (2 * tau.T @ block).ravel()).max() < 1e-12


def test_parameters_may_be_left_out(jax):
    m = mbs.Mechanism("pendulum", gravity=(0, 0, -9.81), parameters={"m": 2.0, "x": 0.5})
    rod = m.add(Body("rod", mass="m", com=("x", 0, 0), inertia=(0.1, 0.1, 0.1)))
    m.connect(m.world, Revolute("j", axis="y", actuated=True), rod)
    f = jax_function(mbs.models.inverse_dynamics(m.assemble()))
    assert f(0.0, 0.0, 0.0)[0] == pytest.approx(-9.81)
    slope = jax.grad(lambda p: f(0.0, 0.0, 0.0, p)[0])(np.array([2.0, 0.5]))
    assert np.array(slope) == pytest.approx([-0.5 * 9.81, -2 * 9.81])


def test_refuses_wrong_inputs(jax, system):
    f = jax_function(mbs.models.inverse_dynamics(system))
    with pytest.raises(ModelError, match="idm: input a is missing"):
        f(*POINT[:2])
    with pytest.raises(ModelError, match="idm does not take 'w'; it takes q, v, a"):
        f(*POINT, w=1.0)
    with pytest.raises(ModelError, match="v has 3 values, it needs 2"):
        f(POINT[0], np.zeros(3), POINT[2])


def test_without_jax_it_says_what_to_install(monkeypatch, system):
    monkeypatch.setitem(sys.modules, "jax", None)
    with pytest.raises(ModelError, match=r'JAX is not installed; .*"casadi-mbs\[jax\]"'):
        jax_function(mbs.models.inverse_dynamics(system))
