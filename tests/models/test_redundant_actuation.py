"""More motors than the mobility: what their efforts do, and how they share what a motion takes."""

import casadi
import numpy as np
import pytest

import mbs
from mbs.components import Body, Prismatic, Revolute, WrenchSensor
from mbs.errors import ModelError
from mbs.identification import Record

GRAVITY = (0, -9.81, 0)
QUIET = {"quiet": True, "tolerance": 1e-10}


def rod(name, length):
    inertia = length**3 / 12
    return Body(name, mass=length, com=(length / 2, 0, 0), inertia=(0, inertia, inertia))


def five_bar(motors=("left", "right", "elbow"), sensor=False):
    """Two arms that hold a point: two motors at the base, a third at an elbow."""
    m = mbs.Mechanism("five_bar", gravity=GRAVITY)
    a, b, c, d = (m.add(rod(n, x)) for n, x in zip("abcd", (0.5, 0.8, 0.9, 0.5), strict=True))

    def joint(name):
        return Revolute(name, actuated=name in motors)

    m.connect(m.world, joint("left"), a)
    m.connect(a.at(0.5), joint("elbow"), b)
    m.connect(m.world.at(0.7), joint("right"), d)
    m.connect(d.at(0.5), joint("other"), c)
    m.connect(b.at(0.8), point := Revolute("point", actuated=False), c.at(0.9))
    m.cut(point)
    if sensor:
        m.add(WrenchSensor("cell", "elbow"))
    return m


def engine(active=()):
    """Three cylinders in a star on one crank; the gas presses on the pistons alone."""
    m = mbs.Mechanism("engine", gravity=GRAVITY)
    crank = m.add(rod("crank", 0.1))
    m.connect(m.world, Revolute("crank_angle", actuated=False), crank)
    for k, angle in enumerate(2 * np.pi * np.arange(3) / 3):
        piston, bar = m.add(Body(f"piston{k}", mass=0.4)), m.add(rod(f"rod{k}", 0.3))
        m.connect(
            m.world.at(0, 0, 0, rotation=("z", angle)),
            Prismatic(f"gas{k}", axis="x", actuated=True),
            piston,
        )
        m.connect(piston, Revolute(f"pin{k}", actuated=False), bar)
        m.connect(bar.at(0.3), big := Revolute(f"big{k}", actuated=False), crank.at(0.1))
        m.cut(big)
    guess = {"crank_angle": 0.5, "gas0": 0.38, "gas1": 0.25, "gas2": 0.25, "pin0": np.pi}
    return m.assemble(active=active, guess={**guess, "pin1": np.pi, "pin2": np.pi})


@pytest.fixture(scope="module")
def redundant():
    return five_bar().assemble(guess=GUESS)


GUESS = {"left": 1.9, "elbow": -1.2, "right": 1.2, "other": 0.9}


def names(system, numbers):
    return [system.velocity_coordinates[k].name for k in numbers]


def configuration(system):
    return dict(zip((c.name for c in system.coordinates), system.configuration, strict=True))


def closed(system, count=5):
    """Configurations near the assembled one, and independent velocities and accelerations."""
    rng = np.random.default_rng(7)
    start = np.array(system.configuration)[list(system.independent)]
    for _ in range(count):
        q_a = start + rng.uniform(-0.1, 0.1, len(start))
        q = np.array(mbs.loops.solve(system, q_a, guess=configuration(system))).ravel()
        yield q, rng.normal(size=len(start)), rng.normal(size=len(start)), rng


def test_what_was_assembled_is_told(redundant):
    assert redundant.closure.mobility == 2
    assert set(names(redundant, redundant.motors)) == {"left", "right", "elbow"}
    assert set(redundant.independent) < set(redundant.motors)
    assert "Driven by 3 efforts: " in redundant.report()
    alone = five_bar(("left", "right")).assemble(guess=GUESS)
    assert alone.motors == alone.independent
    assert "Driven by" not in alone.report()


def test_inverse_and_direct_dynamics_undo_each_other(redundant):
    idm, ddm = mbs.models.inverse_dynamics(redundant), mbs.models.direct_dynamics(redundant)
    null_space = mbs.models.actuation_null_space(redundant)
    matrix = mbs.models.actuation_matrix(redundant)
    assert idm.name_out() == ["tau_m"]
    assert ddm.name_in() == ["q", "v_a", "tau_m"]
    assert [name for name, _ in ddm.elements("tau_m")] == names(redundant, redundant.motors)
    for q, v, a, rng in closed(redundant):
        tau, N, B = (np.array(x) for x in (idm(q, v, a), null_space(q), matrix(q)))
        np.testing.assert_allclose(np.array(ddm(q, v, tau)).ravel(), a, atol=1e-10)
        assert N.shape == (3, 1)
        np.testing.assert_allclose(B @ N, 0, atol=1e-12)
        np.testing.assert_allclose(N.T @ tau, 0, atol=1e-10)  # so it is the shortest
        strained = tau + N * rng.normal()
        np.testing.assert_allclose(np.array(ddm(q, v, strained)).ravel(), a, atol=1e-9)


def test_all_motors_do_what_equal_efforts_of_independent_joints_do(redundant):
    active = names(redundant, redundant.independent)
    alone = five_bar(tuple(active)).assemble(guess=configuration(redundant), active=active)
    assert alone.independent == redundant.independent == alone.motors
    ddm, reference = mbs.models.direct_dynamics(redundant), mbs.models.direct_dynamics(alone)
    tree = mbs.models.direct_dynamics(redundant, coordinates="tree")
    matrix, G = mbs.models.actuation_matrix(redundant), mbs.loops.reduction_matrix(redundant)
    for q, v, _, rng in closed(redundant):
        tau_m = rng.normal(size=3)
        a = np.array(ddm(q, v, tau_m)).ravel()
        np.testing.assert_allclose(np.array(reference(q, v, matrix(q) @ tau_m)).ravel(), a)
        tau = np.zeros(redundant.nv)
        tau[list(redundant.motors)] = tau_m
        every = np.array(tree(q, G(q) @ v, tau)[0]).ravel()
        np.testing.assert_allclose(every[list(redundant.independent)], a, atol=1e-9)


def pushed(system):
    """Efforts of three motors."""
    left, right, elbow = (names(system, range(system.nv)).index(n) for n in LAWS)

    def tau(t, _q, v):
        values = [0] * v.numel()
        values[left], values[right] = 6 * casadi.sin(3 * t), 5 - 0.2 * v[right]
        values[elbow] = 2 * casadi.cos(5 * t)
        return values

    return tau


LAWS = ("left", "right", "elbow")


def test_the_power_of_all_motors_is_the_rate_of_the_energy(redundant):
    result = mbs.simulate.run(redundant, 1.0, tau=pushed(redundant), step=1e-3, **QUIET)
    energy = result["kinetic_energy"] + result["potential_energy"]
    power = sum(result[f"{name}.tau"] * result[f"{name}.v"] for name in LAWS)
    work = np.concatenate([[0], np.cumsum((power[1:] + power[:-1]) / 2) * 1e-3])
    assert np.ptp(energy) > 1
    np.testing.assert_allclose(energy - energy[0], work, atol=1e-4 * np.ptp(energy))
    matrix = mbs.models.actuation_matrix(redundant)
    active = names(redundant, redundant.independent)
    alone = five_bar(tuple(active)).assemble(guess=configuration(redundant), active=active)

    def equal(t, q, v):
        tau = casadi.vertcat(*pushed(redundant)(t, q, v))
        values = casadi.SX.zeros(alone.nv)
        values[list(alone.independent)] = matrix(q) @ tau[list(redundant.motors)]
        return values

    same = mbs.simulate.run(alone, 1.0, tau=equal, step=1e-3, **QUIET)
    np.testing.assert_allclose(same["left.q"], result["left.q"], atol=1e-8)


@pytest.mark.parametrize("kind", ["CoSimulation", "ModelExchange"])
def test_an_fmu_has_the_efforts_of_all_motors(redundant, tmp_path, kind):
    path = mbs.export.fmu(redundant, tmp_path / "five_bar.fmu", outputs=["energy"])
    constant = {"left": 4.0, "right": -3.0, "elbow": 2.0}
    inputs = {f"{name}.tau": value for name, value in constant.items()}
    ran = mbs.simulate.run(redundant, 0.4, tau=constant, **QUIET)
    got = mbs.simulate.fmu(path, 0.4, inputs=inputs, kind=kind, quiet=True, tolerance=1e-10)
    for name in ("left", "elbow", "other"):
        np.testing.assert_allclose(got[f"{name}.q"], ran[f"{name}.q"], atol=1e-6)


def test_the_other_models_are_of_the_independent_joints(redundant):
    matrix = mbs.models.actuation_matrix(redundant)
    idm, ddm = mbs.models.inverse_dynamics(redundant), mbs.models.direct_dynamics(redundant)
    bias, A = mbs.models.bias(redundant), mbs.models.inertia_matrix(redundant)
    slopes = mbs.models.direct_dynamics_derivatives(redundant)
    by_ad = mbs.models.direct_dynamics_derivatives(redundant, "ad")
    dae = mbs.models.dae(redundant)
    ode = casadi.Function("ode", [dae.x, dae.u], [dae.ode])
    for q, v, a, rng in closed(redundant, 2):
        tau_a = np.array(A(q) @ a + bias(q, v)).ravel()
        np.testing.assert_allclose(np.array(matrix(q) @ idm(q, v, a)).ravel(), tau_a, atol=1e-10)
        for found, same in zip(slopes(q, v, tau_a), by_ad(q, v, tau_a), strict=True):
            np.testing.assert_allclose(np.array(found), np.array(same), atol=1e-8)
        np.testing.assert_allclose(np.array(slopes(q, v, tau_a)[-1]).ravel(), a, atol=1e-9)
        tau_m = rng.normal(size=3)
        x = np.concatenate([q[list(redundant.independent)], v])
        rate = np.array(ode(x, tau_m)).ravel()[-2:]
        np.testing.assert_allclose(rate, np.array(ddm(q, v, tau_m)).ravel(), atol=1e-8)


def test_a_joint_transmits_the_effort_of_its_motor():
    system = five_bar(sensor=True).assemble(guess=GUESS)
    elbow = names(system, system.motors).index("elbow")
    for q, v, a, _ in closed(system, 3):
        tau = mbs.models.inverse_dynamics(system)(q, v, a)
        _, moment = mbs.models.measurements(system)(q, v, a)
        assert float(moment[2]) == pytest.approx(float(tau[elbow]), abs=1e-9)


def test_gas_forces_on_all_pistons_of_a_crankshaft():
    for active in ((), ("crank_angle",)):
        system = engine(active)
        assert system.closure.mobility == 1
        assert names(system, system.motors) == ["gas0", "gas1", "gas2"]
        assert mbs.models.actuation_null_space(system)(system.configuration).shape == (3, 2)
    assert names(system, system.independent) == ["crank_angle"]
    forces = {"gas0": -400.0, "gas1": -150.0, "gas2": 30.0}
    result = mbs.simulate.run(system, 0.2, tau=forces, step=1e-3, v0={"crank_angle": 30}, **QUIET)
    energy = result["kinetic_energy"] + result["potential_energy"]
    work = sum(f * (result[f"{n}.q"] - result[f"{n}.q"][0]) for n, f in forces.items())
    assert np.ptp(work) > 10
    np.testing.assert_allclose(energy - energy[0], work, atol=1e-6)
    ddm, idm = mbs.models.direct_dynamics(system), mbs.models.inverse_dynamics(system)
    q = result.values[50, [result.names.index(f"{c.name}.q") for c in system.coordinates]]
    v, a = result["crank_angle.v"][50], result["crank_angle.a"][50]
    assert float(ddm(q, v, list(forces.values()))) == pytest.approx(a, rel=1e-7)
    assert float(ddm(q, v, idm(q, v, 3.0))) == pytest.approx(3.0, abs=1e-8)


def test_velocities_that_are_named_beyond_the_mobility_are_driven():
    system = mbs.robots.n_four_bar(1).assemble(active=["a0", "a1"])
    assert names(system, system.motors) == ["a0", "a1"]
    assert [s.name for s in system.velocity_coordinates if s.actuated] == ["a0", "a1"]
    result = mbs.simulate.run(system, 0.1, tau={"a0": 1.0, "a1": 2.0}, quiet=True)
    assert result["a1.tau"][0] == 2.0


def test_another_independent_joint_than_the_motor_leaves_the_motor_alone():
    m = five_bar(("left", "right"))
    system = m.assemble(guess=GUESS, active=["left", "elbow"])
    assert names(system, system.independent) == ["left", "elbow"]
    assert names(system, system.motors) == ["left", "right"]
    usual = m.assemble(guess=GUESS)
    ddm, tree = (mbs.models.direct_dynamics(usual, coordinates=c) for c in ("independent", "tree"))
    rows = list(system.independent)
    for q, v, a, _ in closed(usual, 2):
        G = mbs.loops.reduction_matrix(usual)(q)
        tau, every = mbs.models.inverse_dynamics(usual)(q, v, a), np.zeros(usual.nv)
        assert np.array(ddm(q, v, tau)).ravel() == pytest.approx(a)
        every[list(usual.independent)] = np.array(tau).ravel()
        found = np.array(tree(q, G @ v, every)[0]).ravel()[rows]
        same = mbs.models.inverse_dynamics(system)(q, np.array(G @ v).ravel()[rows], found)
        np.testing.assert_allclose(np.array(same), np.array(tau), atol=1e-8)


def test_identification_does_not_take_a_part_of_the_motors(redundant):
    result = mbs.simulate.run(redundant, 0.1, quiet=True)
    positions = [f"{c.name}.q" for c in redundant.coordinates]
    with pytest.raises(ModelError, match=r"motors \(.*\) are not its independent joints"):
        Record.from_table(result, positions, ["left.tau", "right.tau"], system=redundant)


def test_limits_of_efforts_that_motors_share_are_refused():
    system = mbs.robots.n_four_bar(1).assemble(active=["a0", "a1"])
    with pytest.raises(ModelError, match="leave the limits of efforts out"):
        mbs.identification.excitation(system, position=0.5, velocity=1.0, effort=9.0, quiet=True)
