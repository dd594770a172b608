"""The filtered model: its rate and its rest are the dynamic model."""

import casadi
import numpy as np
import pytest
from casadi import SX
from support.regressor_states import (
    CLOSED,
    OPEN,
    ROTORS,
    TREES,
    Motion,
    moving,
    state_of,
    system_of,
)
from symbolic_robots import symbolic_robot

from mbs.identification import energy_regressor, filtered_regressor, regressor
from mbs.operations import count

BOUNDS = {"puma560": "566/358", "rx90": "497/303", "iiwa": "900/530"}
"""Multiplications and additions of D1 and D2 together."""


def parts(name):
    system = system_of(name)
    pairs = [(1, 2)] if name == "puma560" else []
    options = {"offsets": True, "couplings": pairs}
    return system, regressor(system, **options), filtered_regressor(system, **options)


@pytest.mark.sweep
@pytest.mark.parametrize("name", [*OPEN, *CLOSED, *TREES, *ROTORS])
def test_rate_and_rest_are_the_dynamic_model(name):
    system, D, filtered = parts(name)
    motion = Motion(system)
    D1, D2 = filtered(motion.q, motion.v)
    dynamic = D(motion.q, motion.v, motion.a)
    state = state_of(system)
    scale = motion.largest(dynamic, state)
    assert motion.largest(motion.rate(D1) + D2 - dynamic, state) < 1e-12 * scale


def test_at_rest_only_the_weight_is_left():
    # shoulder and elbow are parallel, and the shoulder's seat turns the direction of gravity
    _, D, filtered = parts("puma560")
    q = np.random.default_rng(4).uniform(-3, 3, 6)
    D1, D2 = (np.array(part) for part in filtered(q, np.zeros(6)))
    weight = np.array(D(q, np.zeros(6), np.zeros(6)))
    assert np.max(np.abs(weight)) > 9
    np.testing.assert_allclose(D2, weight, rtol=0, atol=1e-13)
    np.testing.assert_allclose(D1, 0, rtol=0, atol=0)


@pytest.mark.parametrize("name", ["puma560", "scara", "sr400", "ball_base"])
def test_momentum_is_the_derivative_of_energy(name):
    system, _, filtered = parts(name)
    motion = Motion(system)
    h = energy_regressor(system)(motion.q, motion.v)
    D1, _ = filtered(motion.q, motion.v)
    columns = h.shape[1]
    shared = [k for k, c in enumerate(filtered.names) if c in energy_regressor(system).names]
    assert len(shared) == columns
    slope = casadi.jacobian(h, motion.v).T
    assert motion.largest(slope - D1[:, shared], state_of(system)) < 1e-10


@pytest.mark.parametrize("name", BOUNDS)
def test_it_costs_less_than_derivatives_of_energy(name):
    system = symbolic_robot(name).assemble()
    filtered = filtered_regressor(system, rotors=False, friction=False)
    found = count(filtered)
    mul, add = (int(part) for part in BOUNDS[name].split("/"))
    assert (found.mul <= mul, found.add <= add) == (True, True), str(found)
    energy = energy_regressor(system, rotors=False, friction=False)
    motion = Motion(system)
    H = energy(motion.q, motion.v, system.p)
    U = casadi.substitute(H, motion.v, 0 * motion.v)
    slopes = [casadi.jacobian(H, motion.v), casadi.jacobian(2 * U - H, motion.q)]
    inputs = [motion.q, motion.v, system.p]
    options = {"cse": True}
    plain = casadi.Function("plain", inputs, slopes, ["q", "v", "p"], ["D1", "D2"], options)
    assert found.total < count(plain).total


def test_first_joint_has_no_centrifugal_rest():
    system, _, filtered = parts("puma560")
    q, v, _ = state_of(system)
    inertial = [k for k, c in enumerate(filtered.columns) if c.kind not in ("Fv", "Fs", "offset")]
    inertial = [k for k in inertial if not filtered.names[k].startswith(("Fvm", "Fsm"))]
    D2 = np.array(filtered(q, v)[1])
    assert not D2[0, inertial].any()


@pytest.mark.parametrize("name", ["scara", "four_bar", "free_base", "turret"])
def test_a_base_that_moves_needs_no_acceleration(name):
    system, (v_0, a_0, R_0) = moving(name)
    motion, state = Motion(system), state_of(system)
    v_b, R_b = SX.sym("v_0", 6), SX.sym("R_0", 3, 3)
    q, v, a, V, w = motion.q, motion.v, motion.a, v_b[:3], v_b[3:]
    D1, D2 = filtered_regressor(system, moving_base=True)(q, v, v_b, R_b)
    A = SX(a_0)
    turning = casadi.mtimes(R_b, casadi.skew(w))
    pairs = [(v_b, casadi.vertcat(A[:3] - casadi.cross(w, V), A[3:])), (R_b, turning)]
    rate = motion.rate(D1) + sum(
        casadi.reshape(casadi.jtimes(casadi.vec(D1), casadi.vec(x), casadi.vec(change)), *D1.shape)
        for x, change in pairs
    )
    D = regressor(system, moving_base=True)(q, v, a, v_b, A, R_b)
    error = casadi.Function("error", [q, v, a, v_b, R_b], [rate + D2 - D, D])
    found, expected = (np.array(x) for x in error(*state, v_0, R_0))
    assert np.abs(found).max() < 1e-12 * np.abs(expected).max()
