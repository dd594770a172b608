"""Rolling without slipping: velocities bound where positions are not."""

import math

import casadi
import numpy as np
import pytest
from casadi import SX, Function
from hypothesis import given, settings
from hypothesis import strategies as st
from support.catalogue_systems import catalogue_system
from support.sweeps import examples

import mbs
from mbs.components import Body, Free, Planar, Prismatic, Revolute, RollingDisc
from mbs.errors import DescriptionError, SolverError

RADIUS, MASS = 0.2, 1.5
ACROSS, SPIN = 0.25 * MASS * RADIUS**2, 0.5 * MASS * RADIUS**2


def rolling_disc():
    m = mbs.Mechanism("rolling_disc")
    disc = m.add(Body("disc", mass=MASS, inertia=(ACROSS, SPIN, ACROSS)))
    m.connect(m.world, Free("base"), disc)
    m.connect(m.world, RollingDisc("contact", radius=RADIUS), disc)
    return m.assemble({"base.z": RADIUS})


def test_a_disc_has_three_velocities_and_five_positions():
    system = rolling_disc()
    assert len(system.independent) == 3
    assert len(system.chosen_coordinates) == 5
    assert system.loops[0].rows == ("force normal", "slip x", "slip y")
    assert system.loops[0].dropped == ()


def test_a_disc_keeps_its_energy_and_does_not_slip():
    system = rolling_disc()
    v0 = {"base.wx": 0.3, "base.wy": 3.0, "base.wz": 0.4}
    result = mbs.simulate.run(system, 3.0, v0=v0, tolerance=1e-10, quiet=True)
    energy = result["kinetic_energy"] + result["potential_energy"]
    assert np.ptp(energy) < 1e-7
    for row in (50, 150, 299):
        state = {name: result[name][row] for name in result.units}
        R = rotation([state[f"base.q{k}.q"] for k in "wxyz"])
        u = R @ [0, 1, 0]
        low = RADIUS * (u[2] * u - [0, 0, 1]) / math.hypot(u[0], u[1])
        V = R @ [state[f"base.v{k}.v"] for k in "xyz"]
        w = R @ [state[f"base.w{k}.v"] for k in "xyz"]
        assert state["base.z.q"] + low[2] == pytest.approx(0, abs=1e-12)
        assert V + np.cross(w, low) == pytest.approx(np.zeros(3), abs=1e-11)


def rotation(quaternion):
    w, x, y, z = quaternion
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


@settings(max_examples=examples(15), deadline=None)
@given(
    lean=st.floats(-0.8, 0.8),
    yaw_rate=st.floats(-3, 3),
    lean_rate=st.floats(-3, 3),
    spin=st.floats(-8, 8),
)
def test_a_leaning_disc_follows_the_equations_of_routh(lean, yaw_rate, lean_rate, spin):
    """Moments about the contact, with the angles yaw, lean and spin about the disc's own axis."""
    system = disc_by_angles()
    names = [speed.name for speed in system.velocity_coordinates]
    active = [names[k] for k in system.independent]
    assert set(active) == {"yaw", "lean", "spin"}
    q = np.array(system.configuration)
    q[names.index("lean")], q[names.index("z")] = lean, RADIUS * math.cos(lean)
    v = {"yaw": yaw_rate, "lean": lean_rate, "spin": spin}
    ddm = mbs.models.direct_dynamics(system)
    a = np.array(ddm(q, [v[n] for n in active], [0.0] * 3)).ravel()
    found = dict(zip(active, a, strict=True))
    expected = routh(lean, yaw_rate, lean_rate, spin)
    for name, value in zip(("yaw", "lean", "spin"), expected, strict=True):
        assert found[name] == pytest.approx(value, rel=1e-9, abs=1e-9)


def disc_by_angles():
    m = mbs.Mechanism("disc_by_angles")
    before = m.world
    joints = [Prismatic(axis, axis=axis, actuated=False) for axis in "xyz"]
    turns = (("yaw", "z"), ("lean", "x"), ("spin", "y"))
    joints += [Revolute(name, axis=axis, actuated=True) for name, axis in turns]
    for joint in joints:
        inertia = (ACROSS, SPIN, ACROSS) if joint.name == "spin" else (0.0, 0.0, 0.0)
        mass = MASS if joint.name == "spin" else 0.0
        body = m.add(Body(f"after_{joint.name}", mass=mass, inertia=inertia))
        m.connect(before, joint, body)
        before = body
    m.connect(m.world, RollingDisc("contact", radius=RADIUS), before)
    return m.assemble({"z": RADIUS})


def routh(lean, yaw_rate, lean_rate, spin):
    """Accelerations of yaw, lean and spin, from the moments about the centre in leaning axes.

    In axes that yaw and lean with the disc but do not spin, w = (l', W + y' sin l, y' cos l)
    with the spin W; the centre is r above the contact along the third of them.
    """
    sine, cosine = math.sin(lean), math.cos(lean)
    w1, w2, w3 = lean_rate, spin + yaw_rate * sine, yaw_rate * cosine
    turning = np.array([lean_rate, yaw_rate * sine, yaw_rate * cosine])
    J, r = np.diag([ACROSS, SPIN, ACROSS]), RADIUS
    arm = np.array([0.0, 0.0, r])  # from the contact to the centre
    w = np.array([w1, w2, w3])
    # about the contact: J w' + O x J w + m arm x (d(w x arm)/dt + O x (w x arm)) = arm x m g
    gravity = -9.81 * np.array([0.0, sine, cosine])
    skew = np.array([[0, -r, 0], [r, 0, 0], [0, 0, 0.0]])  # of the arm
    A = J - MASS * skew @ skew
    V = np.cross(w, arm)
    left = np.cross(arm, MASS * gravity) - np.cross(turning, J @ w)
    left -= MASS * np.cross(arm, np.cross(turning, V))
    w1_rate, w2_rate, w3_rate = np.linalg.solve(A, left)
    yaw_acc = (w3_rate + yaw_rate * sine * lean_rate) / cosine
    spin_acc = w2_rate - yaw_acc * sine - yaw_rate * cosine * lean_rate
    return yaw_acc, w1_rate, spin_acc


def test_inverse_and_direct_models_agree():
    system = rolling_disc()
    rng = np.random.default_rng(5)
    v, tau = rng.normal(size=3), rng.normal(size=3)
    a = mbs.models.direct_dynamics(system)(system.configuration, v, tau)
    back = mbs.models.inverse_dynamics(system)(system.configuration, v, a)
    assert np.array(back).ravel() == pytest.approx(tau, abs=1e-10)
    whole = mbs.models.direct_dynamics(system, coordinates="tree")
    G = np.array(mbs.loops.reduction_matrix(system)(system.configuration))
    J = np.array(mbs.loops.closure_jacobian(system)(system.configuration))
    forces = np.zeros(system.nv)
    forces[list(system.independent)] = tau
    a_tree, lam = whole(system.configuration, G @ v, forces)
    assert np.array(a_tree).ravel()[list(system.independent)] == pytest.approx(np.array(a).ravel())
    assert lam.numel() == len(J) == 3
    assert pytest.approx(np.zeros((3, 3)), abs=1e-12) == J @ G


def test_a_slip_row_that_another_constraint_implies_is_dropped():
    """A wheel whose carriage slides along x only cannot slip sideways anyway."""
    m = mbs.Mechanism("rail_car", gravity=(0, 0, -9.81))
    car = m.add(Body("car", mass=2.0))
    wheel = m.add(Body("wheel", mass=1.0, inertia=(0.1, 0.2, 0.1)))
    m.connect(m.world, Prismatic("along", axis="x", actuated=True), car)
    m.connect(car.at(0, 0, 0.3), Revolute("spin", axis="y"), wheel)
    m.connect(m.world, RollingDisc("contact", radius=0.3), wheel)
    system = m.assemble()
    assert system.loops[0].dropped == ("force normal", "slip y")
    A = np.array(mbs.models.inertia_matrix(system)(system.configuration))
    assert pytest.approx(np.array([[2.0 + 1.0 + 0.2 / 0.3**2]]), rel=1e-12) == A


def test_a_plane_carriage_on_one_wheel_turns_and_rolls():
    """The unicycle: Planar motion, of which rolling leaves two velocities."""
    m = mbs.Mechanism("unicycle", gravity=(0, 0, -9.81))
    frame = m.add(Body("frame", mass=4.0, inertia=(0.2, 0.2, 0.3)))
    wheel = m.add(Body("wheel", mass=1.0, inertia=(0.01, 0.02, 0.01)))
    m.connect(m.world, Planar("base"), frame)
    m.connect(frame.at(0, 0, 0.2), Revolute("spin", axis="y", actuated=True), wheel)
    m.connect(m.world, RollingDisc("contact", radius=0.2), wheel)
    system = m.assemble()
    assert len(system.independent) == 2
    names = [speed.name for speed in system.velocity_coordinates if speed.joint == "base"]
    v0 = {"spin": 2.0, names[-1]: 0.5}
    result = mbs.simulate.run(system, 2.0, v0=v0, tau={"spin": 0.0}, quiet=True)
    x, y = (result[f"{name}.q"] for name in names[:2])
    # a circle of radius (r spin) / yaw rate, to the left of the start
    assert x == pytest.approx(0.8 * np.sin(0.5 * result.time), abs=1e-6)
    assert y == pytest.approx(0.8 * (1 - np.cos(0.5 * result.time)), abs=1e-6)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"radius": 0.0}, "radius is 0 m; give more than zero"),
        ({"radius": 0.2, "normal": (0, 0, 0)}, "contact"),
        ({"radius": 0.2, "actuated": True}, "actuated is given, but a RollingDisc"),
    ],
)
def test_an_impossible_disc_is_refused(change, told):
    with pytest.raises(DescriptionError, match=told):
        RollingDisc("contact", **change)


CANONICAL_M = np.array([[80.81722, 2.31941332208709], [2.31941332208709, 0.29784188199686]])
CANONICAL_K0 = np.array([[-80.95, -2.59951685249872], [-2.59951685249872, -0.80329488458618]])
CANONICAL_K2 = np.array([[0, 76.59734589573222], [0, 2.65431523794604]])
CANONICAL_C1 = np.array([[0, 33.86641391492494], [-0.85035641456978, 1.68540397397560]])


def linearised_bicycle(speed):
    """A, and K and C of A a = K q + C v, for lean and steer about straight running."""
    system = catalogue_system("whipple_bicycle")
    names = [c.name for c in system.coordinates]
    active = [system.velocity_coordinates[k].name for k in system.independent]
    q, v = SX.sym("q", system.nq), SX.sym("v", 3)
    a = mbs.models.direct_dynamics(system)(q, v, SX.zeros(3))
    slopes = Function("slopes", [q, v], [a, casadi.jacobian(a, q), casadi.jacobian(a, v)])
    v0 = [-speed / 0.3 if name == "rear_spin" else 0.0 for name in active]
    a0, by_q, by_v = (np.array(x) for x in slopes(system.configuration, v0))
    assert a0 == pytest.approx(np.zeros((3, 1)), abs=1e-9)
    rows = [active.index(name) for name in ("lean", "steer")]
    places = [names.index(name) for name in ("lean", "steer")]
    A = np.array(mbs.models.inertia_matrix(system)(system.configuration))[np.ix_(rows, rows)]
    return A, A @ by_q[np.ix_(rows, places)], A @ by_v[np.ix_(rows, rows)]


@pytest.mark.parametrize("speed", [0.0, 1.0, 5.0])
def test_the_bicycle_has_the_published_linear_equations(speed):
    """Meijaard et al. 2007: M a + v C1 v + (g K0 + v^2 K2) q = 0."""
    A, K, C = linearised_bicycle(speed)
    assert pytest.approx(CANONICAL_M, rel=1e-12) == A
    assert pytest.approx(-9.81 * CANONICAL_K0 - speed**2 * CANONICAL_K2, abs=1e-9) == K
    assert pytest.approx(-speed * CANONICAL_C1, abs=1e-9) == C


@pytest.mark.parametrize("speed", [4.292382536341, 6.024262015388])
def test_the_bicycle_is_at_the_edge_of_stability_at_the_published_speeds(speed):
    A, K, C = linearised_bicycle(speed)
    companion = np.block(
        [[np.zeros((2, 2)), np.eye(2)], [np.linalg.solve(A, K), np.linalg.solve(A, C)]]
    )
    largest = max(np.linalg.eigvals(companion).real)
    assert largest == pytest.approx(0, abs=1e-11)


def test_a_disc_that_falls_flat_ends_the_motion():
    """It went on before, and lost a third of its energy in silence."""
    system = rolling_disc()
    start = {"base.qw": math.cos(0.1), "base.qx": math.sin(0.1)}
    with pytest.raises(SolverError, match="contact lies flat on its plane at t = 0"):
        mbs.simulate.run(system, 3.0, q0=start, quiet=True)
