"""Batches of models of open, tree, floating and closed systems."""

from functools import cache

import casadi as ca
import numpy as np
import pytest
from support.catalogue_systems import catalogue_system
from support.random_trees import random_state, random_tree

import mbs
import mbs.models
from mbs import Mechanism
from mbs.components import Body, Revolute
from mbs.native import batch, compiled

BUILDERS = (
    "inverse_dynamics",
    "direct_dynamics",
    "inverse_dynamics_derivatives",
    "direct_dynamics_derivatives",
)
STATES = 19


@cache
def system_of(name):
    if name == "floating":
        return random_tree(3, 4, ("free", "spherical", "revolute")).mechanism.assemble()
    return catalogue_system(name)


def states_of(name, model):
    """Inputs for some states; of a closed system, closed configurations near its own."""
    system, rng = system_of(name), np.random.default_rng(0)
    sizes = [model.size1_in(k) for k in range(3)]
    if name == "floating":
        rows = [random_state(system, rng) for _ in range(STATES)]
        return [np.array([np.ravel(row[k]) for row in rows]) for k in range(3)]
    inputs = [rng.uniform(-2, 2, (STATES, size)) for size in sizes]
    if name == "five_bar":
        inputs[0] = np.array(system.configuration) + 1e-3 * inputs[0]
    return inputs


def worst(model, found, inputs):
    """The largest difference to the interpreter, relative to the largest element."""
    exact = ca.Function(model).map(STATES).call([ca.DM(x.T) for x in inputs])
    result = 0.0
    for values, array in zip(exact, found, strict=True):
        # A map has the matrices of the states side by side.
        columns = values.full().reshape(array.shape[1], STATES, -1).transpose(1, 0, 2)
        error = np.abs(columns.reshape(array.shape) - array).max()
        result = max(result, error / max(np.abs(columns).max(), 1e-300))
    return result


@pytest.mark.parametrize("name", ["puma560", "two_branch_tree", "floating", "five_bar"])
def test_models_and_their_derivatives(name):
    models = [getattr(mbs.models, builder)(system_of(name)) for builder in BUILDERS]
    for model in models if name in ("puma560", "five_bar") else models[:2]:
        inputs = states_of(name, model)
        b = batch(model)
        assert b.lanes > 0
        found = b(*inputs, threads=1)
        assert worst(model, found if isinstance(found, tuple) else (found,), inputs) < 1e-12


def test_dynamics_of_one_robot_in_one_batch():
    system = system_of("puma560")
    idm, A = mbs.models.inverse_dynamics(system), mbs.models.inertia_matrix(system)
    b = batch([idm, A])
    q, v, a = states_of("puma560", idm)
    tau, inertia = b(q, v, a)
    np.testing.assert_allclose(tau, batch(idm)(q, v, a), rtol=0, atol=1e-13)
    np.testing.assert_allclose(inertia, batch(A)(q), rtol=0, atol=1e-14)
    np.testing.assert_allclose(inertia, inertia.swapaxes(1, 2), rtol=0, atol=1e-14)


def test_batches_equal_the_scalar_code():
    model = mbs.models.direct_dynamics(system_of("puma560"))
    inputs = states_of("puma560", model)
    one = compiled(model, derivatives=0, fast=True)
    for k, row in enumerate(batch(model)(*inputs)):
        exact = one(*(x[k] for x in inputs))
        np.testing.assert_allclose(row, exact, rtol=0, atol=1e-12 * abs(exact).max())


def test_parameters_of_models():
    """Left out, the same for all states, and one set for each state."""
    mechanism = Mechanism("pendulum", gravity=(0, 0, "-g"), parameters={"g": 9.81, "m": 2.0})
    body = mechanism.add(Body("rod", mass="m", com=(0.5, 0, 0), inertia=(0.1, 0.2, 0.3)))
    mechanism.connect(mechanism.world, Revolute("j", axis="y"), body)
    model = mbs.models.inverse_dynamics(mechanism.assemble())
    b = batch(model)
    q, zero = np.linspace(-1, 1, 11).reshape(-1, 1), np.zeros((11, 1))
    at_rest = -2.0 * 9.81 * 0.5 * np.cos(q)
    p = np.array([9.81, 2.0])
    for given in ((), (p,), (np.repeat(p[None], 11, axis=0),)):
        np.testing.assert_allclose(b(q, zero, zero, *given), at_rest, rtol=1e-13)
    p = np.stack([np.linspace(1, 9, 11), np.linspace(1, 2, 11)], axis=1)
    exact = -0.5 * np.prod(p, axis=1, keepdims=True) * np.cos(q)
    np.testing.assert_allclose(b(q, zero, zero, p=p), exact, rtol=1e-13)
