"""What must hold between models of one system, on random trees with every kind of joint."""

import casadi
import numpy as np
import pytest
from casadi import SX
from support.closed_mechanisms import closed_chain
from support.random_trees import ALL_KINDS, random_state, random_tree

import mbs.models
from mbs.errors import ModelError

TREES = [*((seed, False) for seed in range(4)), *((seed, True) for seed in range(10, 13))]


@pytest.fixture(params=TREES, ids=lambda p: f"tree{p[0]}")
def system(request):
    seed, aligned = request.param
    return random_tree(seed, n=5, kinds=ALL_KINDS, aligned=aligned).mechanism.assemble()


def test_inertia_is_the_derivative_of_inverse_dynamics(system):
    q, v, a = random_state(system, np.random.default_rng(0))
    idm = mbs.models.inverse_dynamics(system)
    acceleration = SX.sym("a", system.nv)
    slope = casadi.Function(
        "f", [acceleration], [casadi.jacobian(idm(q, v, acceleration), acceleration)]
    )
    A = np.array(mbs.models.inertia_matrix(system)(q))
    np.testing.assert_allclose(np.array(slope(a)), A, rtol=0, atol=1e-11 * np.abs(A).max())
    np.testing.assert_allclose(A, A.T, rtol=0, atol=1e-12 * np.abs(A).max())
    assert np.linalg.eigvalsh(A).min() > 0


def test_direct_dynamics_inverts_inverse_dynamics(system):
    q, v, a = random_state(system, np.random.default_rng(1))
    tau = mbs.models.inverse_dynamics(system)(q, v, a)
    back = np.array(mbs.models.direct_dynamics(system)(q, v, tau)).ravel()
    np.testing.assert_allclose(back, a, rtol=0, atol=1e-9)


def lagrange_rate(system, q, v, coordinates="independent", v_tree=None):
    """dA/dt by a central difference along the motion."""
    f = mbs.models.lagrange(system, coordinates=coordinates)
    rate = np.array(system.qdot(q, v if v_tree is None else v_tree)).ravel()
    h = 1e-6
    plus, minus = f(q + h * rate, v)[0], f(q - h * rate, v)[0]
    return (np.array(plus) - np.array(minus)) / (2 * h)


def test_lagrange_form(system):
    q, v, a = random_state(system, np.random.default_rng(2))
    A, B, Q = (np.array(x) for x in mbs.models.lagrange(system)(q, v))
    friction = np.array(
        [float(link.Fv) for link in system.tree.links for _ in range(link.motion.nv)]
    )
    tau = np.array(mbs.models.inverse_dynamics(system)(q, v, a)).ravel()
    np.testing.assert_allclose(
        A @ a + B @ v + Q.ravel() + friction * v,
        tau,
        rtol=0,
        atol=1e-10 * max(1, np.abs(tau).max()),
    )
    skew = lagrange_rate(system, q, v) - 2 * B
    np.testing.assert_allclose(skew, -skew.T, rtol=0, atol=1e-6 * max(1, np.abs(B).max()))
    assert v @ skew @ v == pytest.approx(0, abs=1e-5)


def test_power_is_the_rate_of_energy(system):
    q, v, a = random_state(system, np.random.default_rng(3))
    energy = mbs.models.energy(system)
    q_s, v_s = SX.sym("q", system.nq), SX.sym("v", system.nv)
    total = sum(energy(q_s, v_s))
    rate = casadi.jtimes(total, casadi.vertcat(q_s, v_s), casadi.vertcat(system.qdot(q, v), a))
    dE = float(casadi.Function("f", [q_s, v_s], [rate])(q, v))
    friction = np.array(
        [float(link.Fv) for link in system.tree.links for _ in range(link.motion.nv)]
    )
    tau = np.array(mbs.models.inverse_dynamics(system)(q, v, a)).ravel()
    assert v @ (tau - friction * v) == pytest.approx(dE, rel=1e-9, abs=1e-9)


def test_gravity_is_the_gradient_of_potential(system):
    q, v, _ = random_state(system, np.random.default_rng(4))
    q_s = SX.sym("q", system.nq)
    U = mbs.models.energy(system)(q_s, np.zeros(system.nv))[1]
    power = float(casadi.Function("f", [q_s], [casadi.jtimes(U, q_s, system.qdot(q, v))])(q))
    Q = np.array(mbs.models.gravity_effort(system)(q)).ravel()
    assert Q @ v == pytest.approx(power, rel=1e-9, abs=1e-9)


def test_jacobian_is_the_velocity_of_the_frame(system):
    q, v, _ = random_state(system, np.random.default_rng(5))
    name = system.bodies[-1].name
    T = mbs.models.transform(system, name)
    q_s = SX.sym("q", system.nq)
    rate = casadi.Function("f", [q_s], [casadi.jtimes(T(q_s), q_s, system.qdot(q, v))])
    T_rate, T_now = np.array(rate(q)), np.array(T(q))
    twist = np.array(mbs.models.jacobian(system, name)(q)) @ v
    W = T_rate[:3, :3] @ T_now[:3, :3].T
    np.testing.assert_allclose(twist[:3], T_rate[:3, 3], rtol=0, atol=1e-10)
    np.testing.assert_allclose(twist[3:], [W[2, 1], W[0, 2], W[1, 0]], rtol=0, atol=1e-10)
    own = np.array(mbs.models.jacobian(system, name, expressed_in=name)(q)) @ v
    np.testing.assert_allclose(own[:3], T_now[:3, :3].T @ twist[:3], rtol=0, atol=1e-10)


def test_transform_between_frames(system):
    q, _, _ = random_state(system, np.random.default_rng(6))
    first, last = system.bodies[0].name, system.bodies[-1].name
    T_0a, T_0b = (np.array(mbs.models.transform(system, n)(q)) for n in (first, last))
    T_ab = np.array(mbs.models.transform(system, last, relative_to=first)(q))
    np.testing.assert_allclose(T_0a @ T_ab, T_0b, rtol=0, atol=1e-12)


def test_external_wrench_does_work_through_the_jacobian(system):
    q, v, a = random_state(system, np.random.default_rng(7))
    rng = np.random.default_rng(8)
    wrenches = rng.standard_normal((6, len(system.bodies)))
    free = np.array(mbs.models.inverse_dynamics(system)(q, v, a)).ravel()
    loaded = np.array(mbs.models.inverse_dynamics(system, f_ext=True)(q, v, a, wrenches)).ravel()
    expected = sum(
        np.array(mbs.models.jacobian(system, row.name, expressed_in=row.name)(q)).T @ wrench
        for row, wrench in zip(system.bodies, wrenches.T, strict=True)
    )
    np.testing.assert_allclose(loaded - free, expected, rtol=0, atol=1e-10)


@pytest.mark.parametrize("closing", ["revolute", "spherical", "universal"])
def test_lagrange_of_a_closed_system(closing):
    mechanism, guess = closed_chain(3, closing)
    system = mechanism.assemble(guess=guess)
    rng = np.random.default_rng(0)
    q, m = np.array(system.configuration), len(system.independent)
    v_a, a_a = rng.uniform(-1, 1, (2, m))
    A, B, Q = (np.array(x) for x in mbs.models.lagrange(system)(q, v_a))
    tau = np.array(mbs.models.inverse_dynamics(system)(q, v_a, a_a)).ravel()
    friction = closed_friction(system, q, v_a)
    np.testing.assert_allclose(
        A @ a_a + B @ v_a + Q.ravel() + friction, tau, rtol=0, atol=1e-8 * max(1, np.abs(tau).max())
    )


def closed_friction(system, q, v_a):
    with_friction = np.array(mbs.models.bias(system)(q, v_a)).ravel()
    G = mbs.loops.reduction_matrix(system)(q)
    v = np.array(G @ v_a).ravel()
    friction = np.array([float(link.Fv) for link in system.tree.links]) * v
    assert with_friction.shape == v_a.shape
    return np.array(G).T @ friction


def test_functions_can_be_mapped_expanded_and_differentiated_twice(system):
    idm = mbs.models.inverse_dynamics(system)
    q, v, a = random_state(system, np.random.default_rng(9))
    mapped = np.array(idm.map(3)(np.tile(q, (3, 1)).T, np.tile(v, (3, 1)).T, np.tile(a, (3, 1)).T))
    np.testing.assert_allclose(mapped, np.tile(np.array(idm(q, v, a)), (1, 3)), rtol=0, atol=1e-12)
    x = casadi.MX.sym("x", system.nq)
    gradient = casadi.gradient(casadi.sumsqr(idm(x, v, a)), x)
    second = casadi.Function("h", [x], [casadi.jacobian(gradient, x)])(q)
    assert np.all(np.isfinite(np.array(second)))


def test_builders_cache(system):
    assert mbs.models.inverse_dynamics(system) is mbs.models.inverse_dynamics(system)


def test_wrong_number_of_values_names_the_coordinates(system):
    idm = mbs.models.inverse_dynamics(system)
    with pytest.raises(
        ModelError, match=rf"idm\({system.name}\): q has 1 values, it needs {system.nq}: "
    ):
        idm([0.1], np.zeros(system.nv), np.zeros(system.nv))


def test_unknown_frame_is_refused(system):
    with pytest.raises(ModelError, match="did you mean 'body1'"):
        mbs.models.transform(system, "bdy1")
