"""Springs and rotors of joints in every model, against each other and against other mechanisms."""

import casadi
import numpy as np
import pytest
from casadi import SX
from support.driven_trees import driven_tree, random_rotor
from support.random_trees import random_body, random_rotation, random_state

import mbs.models
from mbs import Mechanism
from mbs.components import (
    Body,
    Box,
    Coupling,
    Free,
    Prismatic,
    Revolute,
    Rotor,
    Spherical,
)
from mbs.operations import count

MODELS = mbs.models
RATIO = 7.0
SEEDS = range(6)


@pytest.fixture(params=SEEDS, ids=lambda seed: f"driven{seed}")
def system(request):
    return driven_tree(request.param).assemble()


def numbers(value):
    return np.array(value)


def close(one, other, tolerance=1e-11):
    one, other = numbers(one), numbers(other)
    scale = max(1.0, np.abs(other).max(initial=0))
    np.testing.assert_allclose(one.ravel(), other.ravel(), rtol=0, atol=tolerance * scale)


def test_every_carrier_occurs():
    """The fixture has rotors on the base, on the inner and on the outer link of their joint."""
    found = set()
    for seed in SEEDS:
        for j, link in enumerate(driven_tree(seed).assemble().tree.links):
            if link.rotor is not None:
                carrier = link.rotor.carrier
                found.add("base" if carrier < 0 else "outer" if carrier == j else "inner")
    assert found == {"base", "inner", "outer"}


def test_inverse_dynamics_is_inertia_and_bias(system):
    q, v, a = random_state(system, np.random.default_rng(0))
    A, H = numbers(MODELS.inertia_matrix(system)(q)), numbers(MODELS.bias(system)(q, v))
    close(MODELS.inverse_dynamics(system)(q, v, a), A @ a + H.ravel())
    assert np.linalg.eigvalsh(A).min() > 0


@pytest.mark.sweep
@pytest.mark.parametrize("method", ["composite", "articulated", "auto"])
def test_direct_dynamics_inverts_inverse_dynamics(system, method):
    q, v, a = random_state(system, np.random.default_rng(1))
    tau = MODELS.inverse_dynamics(system)(q, v, a)
    close(MODELS.direct_dynamics(system, method)(q, v, tau), a, 1e-9)


def test_power_is_the_rate_of_energy(system):
    q, v, a = random_state(system, np.random.default_rng(2))
    energy = MODELS.energy(system)
    q_s, v_s = SX.sym("q", system.nq), SX.sym("v", system.nv)
    state = casadi.vertcat(q_s, v_s)
    rate = casadi.jtimes(sum(energy(q_s, v_s)), state, casadi.vertcat(system.qdot(q, v), a))
    power = v @ numbers(MODELS.inverse_dynamics(system)(q, v, a)).ravel()
    assert float(casadi.Function("f", [q_s, v_s], [rate])(q, v)) == pytest.approx(power, rel=1e-10)
    A = numbers(MODELS.inertia_matrix(system)(q))
    assert float(energy(q, v)[0]) == pytest.approx(v @ A @ v / 2, rel=1e-12)


def test_static_effort_is_the_gradient_of_the_potential_energy(system):
    q, v, _ = random_state(system, np.random.default_rng(3))
    q_s = SX.sym("q", system.nq)
    U = MODELS.energy(system)(q_s, np.zeros(system.nv))[1]
    slope = casadi.Function("f", [q_s], [casadi.jtimes(U, q_s, system.qdot(q, v))])
    Q = numbers(MODELS.gravity_effort(system)(q)).ravel()
    assert Q @ v == pytest.approx(float(slope(q)), rel=1e-10)
    close(MODELS.bias(system)(q, np.zeros(system.nv)), Q)


@pytest.mark.sweep
@pytest.mark.parametrize("method", ["renaud", "christoffel"])
def test_lagrange_form(system, method):
    q, v, a = random_state(system, np.random.default_rng(4))
    lagrange = MODELS.lagrange(system, method)
    A, B, Q = map(numbers, lagrange(q, v))
    close(A, MODELS.inertia_matrix(system)(q))
    close(Q, MODELS.gravity_effort(system)(q))
    close(A @ a + B @ v + Q.ravel(), MODELS.inverse_dynamics(system)(q, v, a))
    q_s, v_s = SX.sym("q", system.nq), SX.sym("v", system.nv)
    rate = casadi.jtimes(lagrange(q_s, v_s)[0], q_s, system.qdot(q_s, v_s))
    skew = numbers(casadi.Function("f", [q_s, v_s], [rate])(q, v)) - 2 * B
    close(skew, -skew.T)


def real_rotor(rng, name):
    """A balanced body that is symmetric about its z axis, and its inertia about it."""
    across, about = rng.uniform(0.02, 0.03), rng.uniform(0.01, 0.04)
    body = Body(name, mass=rng.uniform(0.2, 0.5), inertia=(across, across, about))
    return body, about


def with_rotor(kind, seed, drive):
    """A body on a moving carrier, and a rotor: "locked", as a "Rotor", or "geared" on a bearing."""
    rng = np.random.default_rng(seed)
    m = Mechanism(drive, gravity=tuple(rng.uniform(-10, 10, 3)))
    carrier, arm = m.add(random_body(rng, "carrier")), m.add(random_body(rng, "arm"))
    base = (Revolute("base", axis=(1, 2, 3)), Spherical("base"), Free("base"))[seed]
    m.connect(m.world, base, carrier)
    rotor, inertia = real_rotor(rng, "rotor")
    m.add(rotor)
    R = random_rotation(rng)
    spin = carrier.at(*rng.uniform(-0.3, 0.3, 3), rotation=R)
    seat = carrier.at(*rng.uniform(-0.3, 0.3, 3), rotation=random_rotation(rng))
    axis = tuple(numbers(casadi.evalf(seat.placement.pose({}).R)).T @ R[:, 2])
    fast = Rotor(inertia=inertia, ratio=RATIO, axis=axis) if drive == "Rotor" else None
    joint = {"revolute": Revolute, "prismatic": Prismatic}[kind]
    m.connect(seat, joint("joint", axis=(0, 1, 0), actuated=True, rotor=fast), arm)
    if drive == "geared":
        m.connect(spin, Revolute("spin"), rotor)
        m.add(Coupling("gear", driven="spin", driver="joint", coefficients=(0, RATIO)))
    else:
        m.connect(spin, rotor)
    return m.assemble()


@pytest.mark.parametrize("kind", ["revolute", "prismatic"])
@pytest.mark.parametrize("seed", range(3), ids=["revolute", "spherical", "free"])
def test_rotor_moves_as_a_body_behind_a_gear(kind, seed):
    driven, geared = (with_rotor(kind, seed, drive) for drive in ("Rotor", "geared"))
    q, v, a = random_state(driven, np.random.default_rng(seed))
    every = dict(zip((c.name for c in driven.coordinates), q, strict=True))
    every["spin"] = RATIO * every["joint"]
    q_all = [every[c.name] for c in geared.coordinates]
    names = [speed.name for speed in driven.velocity_coordinates]
    order = [names.index(geared.velocity_coordinates[k].name) for k in geared.independent]
    assert sorted(order) == list(range(driven.nv))
    v_a, a_a = v[order], a[order]
    tau = numbers(MODELS.inverse_dynamics(driven)(q, v, a)).ravel()
    close(MODELS.inverse_dynamics(geared)(q_all, v_a, a_a), tau[order], 1e-10)
    close(MODELS.gravity_effort(geared)(q_all), numbers(MODELS.gravity_effort(driven)(q))[order])
    A = numbers(MODELS.inertia_matrix(driven)(q))[np.ix_(order, order)]
    close(MODELS.inertia_matrix(geared)(q_all), A, 1e-10)
    close(MODELS.direct_dynamics(geared)(q_all, v_a, tau[order]), a_a, 1e-9)
    close(MODELS.energy(geared)(q_all, v_a)[0], MODELS.energy(driven)(q, v)[0], 1e-10)
    locked = MODELS.inverse_dynamics(with_rotor(kind, seed, "locked"))
    assert np.abs(numbers(locked(q, v, a)).ravel() - tau).max() > 0.1


def test_rotor_on_a_moving_base():
    """A base that is moved gives the same efforts as one that a joint moves."""
    rotor = random_rotor(np.random.default_rng(0), axis=(1, 1, 0))
    arm = Body("arm", mass=1.2, com=(0.1, 0.2, 0.3), inertia=(0.2, 0.3, 0.4))
    on_base = Mechanism("on_base", gravity=(0, 0, -9.81))
    on_base.connect(on_base.world, Revolute("j", rotor=rotor), on_base.add(arm))
    on_body = Mechanism("on_body", gravity=(0, 0, -9.81))
    carrier = on_body.add(Body("carrier", mass=0))
    on_body.connect(on_body.world, Free("float"), carrier)
    on_body.connect(carrier, Revolute("j", rotor=rotor), on_body.add(arm))
    whole = on_body.assemble()
    q, v, a = random_state(whole, np.random.default_rng(1))
    R = numbers(MODELS.transform(whole, "carrier")(q))[:3, :3]
    turning = np.concatenate([a[:3] + np.cross(v[3:6], v[:3]), a[3:6]])
    moved = MODELS.inverse_dynamics(on_base.assemble(), moving_base=True)
    tau = moved(q[7], v[6], a[6], v[:6], turning, R)
    close(tau, numbers(MODELS.inverse_dynamics(whole)(q, v, a))[6])


def test_absent_drives_cost_nothing():
    nothing = {"stiffness": 0, "rest": 1, "rotor": Rotor(inertia=0, ratio=9)}
    drives = ({}, nothing, DRIVE)
    plain, still, driven = (box_on(Revolute("j", axis="y", **drive)) for drive in drives)
    for model in (MODELS.inverse_dynamics, MODELS.direct_dynamics, MODELS.lagrange):
        assert count(model(plain)) == count(model(still))
        assert count(model(plain)).total < count(model(driven)).total


DRIVE = {"stiffness": 2.0, "rest": 0.5, "rotor": Rotor(inertia=0.01, ratio=50)}


def box_on(joint):
    m = Mechanism("box", gravity=(0, 0, -9.81))
    m.connect(m.world, joint, m.add(Box("box", length=1, mass=1)))
    return m.assemble()


def test_symbols_in_springs_and_rotors():
    symbols = {"stiffness": "K", "rest": "x0", "rotor": Rotor(inertia="J", ratio="N")}
    system = box_on(Revolute("j", axis="y", **symbols))
    assert {parameter.name for parameter in system.parameters} == {"K", "x0", "J", "N"}
    values = {"K": 2.0, "x0": 0.5, "J": 0.01, "N": 50.0}
    p = [values[parameter.name] for parameter in system.parameters]
    plain = box_on(Revolute("j", axis="y", **DRIVE))
    close(
        MODELS.inverse_dynamics(system)(0.3, 0.4, 0.5, p),
        MODELS.inverse_dynamics(plain)(0.3, 0.4, 0.5),
        1e-14,
    )


def test_spring_of_a_joint_that_closes_a_loop():
    """A cut joint with a spring stays in the tree, and the loop feels its potential energy."""

    def bar(stiffness):
        m = Mechanism("parallelogram", gravity=(0, 0, 0))
        left, top, right = (m.add(Box(n, length=1, mass=1)) for n in ("left", "top", "right"))
        m.connect(m.world, Revolute("crank", actuated=True), left)
        m.connect(left.right, Revolute("corner"), top)
        m.connect(m.world.at(1, 0, 0), Revolute("rocker"), right)
        spring = Revolute("spring", stiffness=stiffness, rest=0.2, actuated=False)
        m.connect(top.right, spring, right.right)
        return m.assemble(guess={"crank": 1.0, "corner": -1.0, "rocker": 1.0})

    elastic = bar(3.0)
    q = mbs.loops.solve(elastic, {"crank": 1.1})
    place = [c.name for c in elastic.coordinates].index("spring")
    moved = 3.0 * (float(q[place]) - 0.2)
    assert float(MODELS.energy(elastic)(q, 0)[1]) == pytest.approx(moved**2 / 6)
    around = [float(mbs.loops.solve(elastic, {"crank": 1.1 + h})[place]) for h in (1e-5, -1e-5)]
    slope = (around[0] - around[1]) / 2e-5
    assert abs(slope) == pytest.approx(1, abs=1e-6)
    assert float(MODELS.gravity_effort(elastic)(q)) == pytest.approx(moved * slope, rel=1e-6)


def test_rotor_inertia_of_a_free_body_is_seen_from_the_world():
    """Ia (a + w x v) along the axes of the body: its velocity is in axes that turn."""

    def body(Ia):
        m = mbs.Mechanism("body", gravity=(0, 0, 0))
        hull = m.add(Body("hull", mass=2.0, com=(0.1, 0.2, 0.3), inertia=(0.4, 0.5, 0.6)))
        m.connect(m.world, Free("base", Ia=Ia), hull)
        return mbs.models.inverse_dynamics(m.assemble())

    rng = np.random.default_rng(1)
    q = rng.standard_normal(7)
    q[3:] /= np.linalg.norm(q[3:])
    v, a = rng.standard_normal((2, 6))
    extra = np.array(body(0.7)(q, v, a) - body(0.0)(q, v, a)).ravel()
    seen = a + np.concatenate([np.cross(v[3:], v[:3]), np.zeros(3)])
    np.testing.assert_allclose(extra, 0.7 * seen, atol=1e-12)
