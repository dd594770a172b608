"""A Function in JAX: values and derivatives in both directions; skipped without JAX."""

import sys

import casadi
import numpy as np
import pytest

import mbs
from mbs.bridges import jax_function
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
    assert np.array_equal(jax.jit(f)(*POINT), np.array(idm(*POINT)).ravel())
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
        assert np.array_equal(np.array(wanted).squeeze(), found)
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
    found = jax.vmap(jax_function(idm), in_axes=(0, None, None))(q, *POINT[1:])
    wanted = [np.array(idm(row, *POINT[1:])).ravel() for row in q]
    assert np.array_equal(found, wanted)


def test_refuses_wrong_inputs(jax, system):
    f = jax_function(mbs.models.inverse_dynamics(system))
    with pytest.raises(ModelError, match="2 arguments were given; the inputs are q, v, a"):
        f(*POINT[:2])
    with pytest.raises(ModelError, match="v has 3 values, it needs 2"):
        f(POINT[0], np.zeros(3), POINT[2])


def test_without_jax_it_says_what_to_install(monkeypatch, system):
    monkeypatch.setitem(sys.modules, "jax", None)
    with pytest.raises(ModelError, match=r'JAX is not installed; use pip install "mbs\[jax\]"'):
        jax_function(mbs.models.inverse_dynamics(system))
