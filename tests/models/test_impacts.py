"""Impacts in random trees: Newton's law at the stops, energy, and the impulses by numpy."""

from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.random_trees import random_tree

import mbs
import mbs.models
from mbs.components import RigidStop
from mbs.models.state.tree import full_state

ELASTIC = mbs.Parameter("e", 0.5)


@cache
def stopped_tree(seed, n=4):
    """A random tree with stops at -1 and 1 on all its joints, and its jump."""
    m = random_tree(seed, n=n, kinds=("revolute", "revolute", "prismatic")).mechanism
    for k in range(n):
        m.add(RigidStop(f"stop{k}", joint=f"j{k}", lower=-1, upper=1, restitution=ELASTIC))
    system = m.assemble()
    return system, full_state(system).events.jump


def jumped(jump, q, v, fired, place, restitution=0.5):
    n = len(v)
    x, after = jump(0.0, [*q, *v], [restitution, *place, *np.zeros(n)], fired)
    return np.array(x).ravel()[n:], np.array(after).ravel()[:n]


def case(seed, n=4):
    """Random motion: the first stop is met, the second touched, the third met or not."""
    rng = np.random.default_rng(seed)
    q, v = rng.uniform(-1, 1, n), rng.uniform(-2, 2, n)
    place, fired = np.zeros(n), np.zeros((5, n))
    place[1], v[1] = rng.choice([-1, 1]), 0.0
    for k in (0, 2)[: int(rng.integers(1, 3))]:
        fired[0 if v[k] < 0 else 1, k] = 1
    return q, v, fired, place


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 10_000), restitution=st.floats(0.1, 1.0))
def test_impacts_take_energy_and_turn_velocities_round(seed, restitution):
    system, jump = stopped_tree(seed % 5)
    q, v, fired, place = case(seed)
    after, modes = jumped(jump, q, v, fired.ravel(), place, restitution)
    A = np.array(mbs.models.inertia_matrix(system)(q, [restitution]))
    assert after @ A @ after <= v @ A @ v * (1 + 1e-9)
    side = fired[1] - fired[0]
    met = side != 0
    back = -side * after - restitution * side * v
    assert np.all(back[met] >= -1e-9)
    assert -place[1] * after[1] >= -1e-9
    impulse = A @ (after - v)
    walls = np.where(met, side, place)
    assert np.all(walls * impulse <= 1e-3)
    assert np.max(np.abs(impulse[walls == 0])) < 1e-9 * max(1.0, np.max(np.abs(impulse)))
    assert modes[1] in (0.0, place[1])


def test_one_impact_by_hand():
    system, jump = stopped_tree(3)
    q, v = np.array([0.1, -0.2, 0.3, 1.0]), np.array([0.4, -0.5, 0.6, 1.5])
    fired = np.zeros((5, 4))
    fired[1, 3] = 1
    after, modes = jumped(jump, q, v, fired.ravel(), np.zeros(4))
    A = np.array(mbs.models.inertia_matrix(system)(q))
    column = np.linalg.solve(A, np.eye(4)[3])
    np.testing.assert_allclose(after, v - column / column[3] * 1.5 * v[3], rtol=1e-9)
    assert np.all(modes == 0)


def test_a_slow_rebound_stays_at_the_stop():
    _, jump = stopped_tree(3)
    v = np.array([0.4, -0.5, 0.6, 1.9e-4])
    fired = np.zeros((5, 4))
    fired[1, 3] = 1
    after, modes = jumped(jump, np.zeros(4), v, fired.ravel(), np.zeros(4))
    assert after[3] == pytest.approx(0.0, abs=1e-15)
    assert np.array_equal(modes, [0, 0, 0, 1])
