"""Force elements in every model, against MuJoCo, virtual work, and each other."""

import re

import casadi
import numpy as np
import pytest
from casadi import SX
from hypothesis import given, settings
from hypothesis import strategies as st
from support.closed_mechanisms import planar_loop
from support.random_trees import ALL_KINDS, random_rotation, random_state, random_tree

import mbs
import mbs.models
from mbs.components import (
    Bushing,
    Damper,
    Force,
    Free,
    JointFriction,
    JointStop,
    PointGravity,
    Revolute,
    Spring,
    Torque,
)
from mbs.components.joints import Motion
from mbs.operations import count

MODELS = mbs.models
SEEDS = range(4)


def numbers(value):
    return np.array(value)


def close(one, other, tolerance=1e-11):
    one, other = numbers(one), numbers(other)
    scale = max(1.0, np.abs(other).max(initial=0))
    np.testing.assert_allclose(one.ravel(), other.ravel(), rtol=0, atol=tolerance * scale)


def random_point(rng, body):
    return body.at(*rng.uniform(-0.5, 0.5, 3), rotation=random_rotation(rng))


def two_points(rng, m):
    bodies = [m.world, *m.bodies()]
    a, b = (bodies[k] for k in rng.permutation(len(bodies))[:2])
    return random_point(rng, a), random_point(rng, b)


def elastic(rng, m):
    """Elements that store energy, between random points and on a random joint."""
    m.add(Spring("spring", *two_points(rng, m), stiffness=20, length=0.3))
    m.add(PointGravity("attraction", *two_points(rng, m), strength=3))
    m.add(
        Bushing(
            "bushing",
            *two_points(rng, m),
            stiffness=rng.uniform(5, 20, 3),
            angular_stiffness=rng.uniform(5, 20, 3),
        )
    )
    for name in sliding(m)[:1]:
        m.add(JointStop("stop", joint=name, lower=-0.1, upper=0.2, stiffness=30, width=0.4))


def sliding(m):
    return [
        f"{joint.name}.{f.suffix}" if f.suffix else joint.name
        for joint in m.joints()
        for f in joint.freedoms
        if f.motion in (Motion.REVOLUTE, Motion.PRISMATIC)
    ]


def dissipative(rng, m):
    """Elements that take energy away."""
    m.add(Damper("damper", *two_points(rng, m), damping=3))
    m.add(Spring("both", *two_points(rng, m), stiffness=10, length=0.2, damping=2))
    m.add(Bushing("rubber", *two_points(rng, m), damping=(1, 2, 3), angular_damping=(3, 2, 1)))
    for name in sliding(m)[:1]:
        m.add(JointFriction("friction", joint=name, coulomb=2, stribeck=1, width=0.1))


def sources(rng, m):
    """Constant forces and torques."""
    bodies = list(m.bodies())
    for number, axes in enumerate(("world", "body")):
        body = bodies[rng.integers(len(bodies))]
        m.add(Force(f"force{number}", random_point(rng, body), force=(1, 2, 3), axes=axes))
        m.add(Torque(f"torque{number}", random_point(rng, body), torque=(3, 1, 2), axes=axes))


def tree(seed, *groups, **options):
    m = random_tree(seed, n=4, kinds=ALL_KINDS, **options).mechanism
    rng = np.random.default_rng(seed)
    for group in groups:
        group(rng, m)
    return m.assemble()


def state(system, seed=0):
    return random_state(system, np.random.default_rng(seed))


def rate(system, value, q_s, q, v):
    """Rate of a value of the positions when they move with velocities v."""
    return numbers(casadi.Function("f", [q_s], [casadi.jtimes(value, q_s, system.qdot(q, v))])(q))


@pytest.mark.parametrize("seed", SEEDS)
def test_static_efforts_are_the_gradient_of_the_energy(seed):
    system = tree(seed, elastic)
    q, _, _ = state(system)
    q_s = SX.sym("q", system.nq)
    U = MODELS.energy(system)(q_s, np.zeros(system.nv))[1]
    Q = numbers(MODELS.gravity_effort(system)(q)).ravel()
    slopes = [rate(system, U, q_s, q, e).item() for e in np.eye(system.nv)]
    close(Q, slopes)
    close(MODELS.bias(system)(q, np.zeros(system.nv)), Q)
    plain = MODELS.gravity_effort(tree(seed))(q)
    assert np.abs(Q - numbers(plain).ravel()).max() > 0.1


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("groups", [(elastic,), (elastic, dissipative)], ids=["elastic", "all"])
def test_power_is_the_rate_of_energy_and_what_dampers_take(seed, groups):
    system = tree(seed, *groups)
    q, v, a = state(system)
    q_s, v_s = SX.sym("q", system.nq), SX.sym("v", system.nv)
    total = sum(MODELS.energy(system)(q_s, v_s))
    along = casadi.vertcat(system.qdot(q, v), a)
    slope = casadi.jtimes(total, casadi.vertcat(q_s, v_s), along)
    gained = float(casadi.Function("f", [q_s, v_s], [slope])(q, v))
    power = v @ numbers(MODELS.inverse_dynamics(system)(q, v, a)).ravel()
    friction = v @ numbers(viscous(system, v))
    lost = power - gained - friction
    if len(groups) == 1:
        assert abs(lost) < 1e-10 * max(1, abs(power))
    else:
        assert lost == pytest.approx(damped(seed, system, q, v), rel=1e-8)
        assert lost > 0.1


def viscous(system, v):
    return np.concatenate([float(link.Fv) * v[link.v] for link in system.tree.links])


def damped(seed, system, q, v):
    """What the dampers take, from the rates of poses alone."""
    total = 0.0
    for force in system.parts:
        law = force.element
        if isinstance(law, JointFriction):
            u = v[force.levers[0].velocity]
            total += u * (2 + np.exp(-((u / 0.1) ** 2))) * np.tanh(u / 0.1)
        elif isinstance(law, (Damper, Spring, Bushing)):
            p, V, w_rate = relative(system, force.frames, q, v)
            if isinstance(law, Bushing):
                C, C_phi = (
                    np.array([float(str(c)) for c in x]) for x in (law.damping, law.angular_damping)
                )
                total += V @ (C * V) + w_rate @ (C_phi * w_rate)
            else:
                total += float(str(law.damping)) * (p @ V / np.linalg.norm(p)) ** 2
    return total


def relative(system, frames, q, v, h=1e-6):
    """Position, its rate, and the rate of 2 sin(theta / 2) u, by central differences."""

    def at(t):
        x = q + t * numbers(system.qdot(q, v)).ravel()
        for link in system.tree.links:
            if link.motion in (Motion.SPHERICAL, Motion.FREE):
                part = slice(link.q.stop - 4, link.q.stop)
                x[part] /= np.linalg.norm(x[part])
        T = [pose_of(system, frame, x) for frame in frames]
        T_ab = np.linalg.solve(*T)
        R = T_ab[:3, :3]
        angle = np.arccos(np.clip((np.trace(R) - 1) / 2, -1, 1))
        skew = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
        return T_ab[:3, 3], 2 * np.sin(angle / 2) * skew / (2 * np.sin(angle))

    (p0, phi0), (p1, phi1) = at(-h), at(h)
    return (p0 + p1) / 2, (p1 - p0) / (2 * h), (phi1 - phi0) / (2 * h)


def pose_of(system, frame, q):
    link, pose = frame
    inside = numbers(casadi.evalf(pose.matrix))
    return (
        inside
        if link < 0
        else (numbers(MODELS.transform(system, link + 1)(q)).reshape(4, 4) @ inside)
    )


@pytest.mark.parametrize("seed", SEEDS)
def test_models_agree(seed):
    system = tree(seed, elastic, dissipative, sources)
    q, v, a = state(system, seed)
    wrenches = np.random.default_rng(seed).uniform(-5, 5, (6, len(system.bodies)))
    tau = MODELS.inverse_dynamics(system)(q, v, a)
    A, H = numbers(MODELS.inertia_matrix(system)(q)), numbers(MODELS.bias(system)(q, v))
    close(tau, A @ a + H.ravel())
    pushed = MODELS.inverse_dynamics(system, f_ext=True)(q, v, a, wrenches)
    plain = tree(seed)
    push = numbers(MODELS.inverse_dynamics(plain, f_ext=True)(q, v, a, wrenches))
    close(pushed - tau, push - numbers(MODELS.inverse_dynamics(plain)(q, v, a)), 1e-10)
    for method in ("composite", "articulated"):
        close(MODELS.direct_dynamics(system, method)(q, v, tau), a, 1e-8)
        ddm = MODELS.direct_dynamics(system, method, f_ext=True)
        close(ddm(q, v, pushed, wrenches), a, 1e-8)
    for method in ("renaud", "christoffel"):
        A_l, _, Q = MODELS.lagrange(system, method)(q, v)
        close(A_l, A)
        close(Q, MODELS.gravity_effort(system)(q))
        close(Q, MODELS.bias(system)(q, np.zeros(system.nv)))


@pytest.mark.parametrize("seed", SEEDS)
def test_sources_are_the_transpose_of_the_jacobian(seed):
    m = random_tree(seed, n=4, kinds=ALL_KINDS).mechanism
    rng = np.random.default_rng(seed)
    tip = m.add_frame("tip", random_point(rng, list(m.bodies())[-1]))
    plain = m.assemble()
    q, v, a = state(plain)
    J = numbers(MODELS.jacobian(plain, "tip")(q))
    R = numbers(MODELS.transform(plain, "tip")(q))[:3, :3]
    before = numbers(MODELS.inverse_dynamics(plain)(q, v, a)).ravel()
    F, M = np.array([1.0, 2, 3]), np.array([-2.0, 1, 4])
    m.add(Force("f", tip, force=F))
    m.add(Torque("t", tip, torque=M, axes="body"))
    after = numbers(MODELS.inverse_dynamics(m.assemble())(q, v, a)).ravel()
    close(before - after, J[:3].T @ F + J[3:].T @ (R @ M))


@pytest.mark.parametrize("seed", range(6))
def test_springs_and_dampers_of_mujoco(seed):
    mujoco = pytest.importorskip("mujoco")
    kinds = ("revolute", "prismatic", "universal", "cylindrical", "planar", "spherical")
    twin, rng = random_tree(seed, n=4, kinds=kinds), np.random.default_rng(seed)
    plain = twin.mechanism.assemble()
    bodies = ["world", *(body.name for body in twin.mechanism.bodies())]
    sites, tendons = {name: "" for name in bodies}, ""
    for number in range(3):
        ends = rng.permutation(len(bodies))[:2]
        points, law = rng.uniform(-0.5, 0.5, (2, 3)), rng.uniform(1, 5, 3)
        for side, k, p in zip("ab", ends, points, strict=True):
            sites[bodies[k]] += (
                f'<site name="{side}{number}" pos="{" ".join(map(repr, map(float, p)))}"/>'
            )
        owners = [twin.mechanism.components[bodies[k]] for k in ends]
        a, b = (owner.at(*p) for owner, p in zip(owners, points, strict=True))
        twin.mechanism.add(
            Spring(f"s{number}", a, b, stiffness=law[0], length=law[1], damping=law[2])
        )
        tendons += (
            (
                f'<spatial stiffness="{law[0]!r}" springlength="{law[1]!r}" damping="{law[2]!r}">'
                f'<site site="a{number}"/><site site="b{number}"/></spatial>'
            )
            .replace("np.float64(", "")
            .replace(")", "")
        )
    xml = twin.mjcf.replace("<worldbody>", "<worldbody>" + sites["world"])
    for name in bodies[1:]:
        xml = re.sub(f'(<body name="{name}"[^>]*>)', rf"\1{sites[name]}", xml)
    xml = xml.replace("</mujoco>", f"<tendon>{tendons}</tendon></mujoco>")
    system = twin.mechanism.assemble()
    q, v, _ = state(system, seed)
    ours = MODELS.bias(plain)(q, v) - MODELS.bias(system)(q, v)
    U = float(MODELS.energy(system)(q, v)[1] - MODELS.energy(plain)(q, v)[1])
    passive, energy = zip(
        *(mujoco_passive(mujoco, text, system, q, v) for text in (twin.mjcf, xml)), strict=True
    )
    close(ours, passive[1] - passive[0])
    close(U, energy[1] - energy[0])
    assert np.abs(numbers(ours)).max() > 0.1


def mujoco_passive(mujoco, xml, system, q, v):
    """Passive efforts in our order, and the potential energy."""
    model = mujoco.MjModel.from_xml_string(xml)
    data, numbering, places = mujoco.MjData(model), {}, []
    for link in system.tree.links:
        joint = link.name.split(".")[0]
        numbering[joint] = numbering.get(joint, -1) + 1
        entry = model.joint(f"{joint}_{numbering[joint]}")
        start = int(entry.qposadr[0])
        data.qpos[start : start + link.motion.nq] = q[link.q]
        start = int(entry.dofadr[0])
        data.qvel[start : start + link.motion.nv] = v[link.v]
        places += range(start, start + link.motion.nv)
    model.opt.enableflags = mujoco.mjtEnableBit.mjENBL_ENERGY
    mujoco.mj_forward(model, data)
    return data.qfrc_passive[places].copy(), data.energy[0]


def test_elements_of_a_moving_base():
    """What is tied to the base moves with it."""

    def build(moved):
        m = mbs.Mechanism("m")
        foot = m.world
        if moved:
            foot = m.add(mbs.components.Body("foot", mass=0))
            m.connect(m.world, Free("float"), foot)
        arm = m.add(mbs.components.Body("arm", 1.0, (0.2, 0, 0), (0.1, 0.2, 0.3)))
        m.connect(foot, Revolute("j", axis="y", actuated=True), arm)
        m.add(Spring("s", foot.at(0, 0, 1), arm.at(0.4, 0, 0), stiffness=9, length=1, damping=2))
        return m.assemble()

    whole, arm = build(True), build(False)
    q, v, a = state(whole)
    turning = np.concatenate([a[:3] + np.cross(v[3:6], v[:3]), a[3:6]])
    R = numbers(MODELS.transform(whole, "foot")(q))[:3, :3]
    tau = MODELS.inverse_dynamics(arm, moving_base=True)(q[7], v[6], a[6], v[:6], turning, R)
    close(tau, numbers(MODELS.inverse_dynamics(whole)(q, v, a))[6])
    ddm = MODELS.direct_dynamics(arm, "articulated", moving_base=True)
    close(ddm(q[7], v[6], tau, v[:6], turning, R), a[6], 1e-10)


@pytest.mark.parametrize("seed", SEEDS)
def test_derivatives_hold_the_elements(seed):
    system = tree(seed, elastic, dissipative, sources)
    q, v, a = state(system)
    for method in METHODS:
        dq, dv, _, tau = map(numbers, MODELS.inverse_dynamics_derivatives(system, method)(q, v, a))
        idm = MODELS.inverse_dynamics(system)
        close(tau, idm(q, v, a))
        for k, e in enumerate(np.eye(system.nv)):
            h = 1e-6
            step = h * numbers(system.qdot(q, e)).ravel()
            close(dq[:, k], (idm(q + step, v, a) - idm(q - step, v, a)) / (2 * h), 1e-6)
            close(dv[:, k], (idm(q, v + h * e, a) - idm(q, v - h * e, a)) / (2 * h), 1e-6)


METHODS = ("ad", "analytical", "auto")


@pytest.mark.parametrize("seed", SEEDS)
def test_elements_in_a_loop(seed):
    """Efforts of a closed system are the slopes of its energy along the loop."""
    m, guess = planar_loop(seed, links=3)
    rng = np.random.default_rng(seed)
    for number in range(2):
        m.add(Spring(f"s{number}", *two_points(rng, m), stiffness=50, length=0.4))
    m.add(JointStop("stop", joint="j1", upper=guess["j1"] - 0.1, stiffness=40, width=0.1))
    system = m.assemble(guess=guess)
    assert system.is_closed
    assert len(system.independent) == 1
    q, name = (
        np.array(system.configuration),
        system.velocity_coordinates[system.independent[0]].name,
    )
    place = [c.name for c in system.coordinates].index(name)
    U = MODELS.energy(system, "tree")
    ends = [mbs.loops.solve(system, {name: q[place] + h}) for h in (1e-5, -1e-5)]
    slope = (float(U(ends[0], 0)[1]) - float(U(ends[1], 0)[1])) / 2e-5
    assert float(MODELS.gravity_effort(system)(q)) == pytest.approx(slope, rel=1e-6, abs=1e-6)
    v, a = 0.7, -0.4
    tau = MODELS.inverse_dynamics(system)(q, v, a)
    assert float(MODELS.direct_dynamics(system)(q, v, tau)) == pytest.approx(a, rel=1e-9)
    G = numbers(mbs.loops.reduction_matrix(system)(q))
    whole = MODELS.direct_dynamics(system, coordinates="tree")
    efforts = np.zeros(system.nv)
    efforts[system.independent[0]] = float(tau)
    a_tree = numbers(whole(q, G @ [v], efforts)[0]).ravel()
    assert a_tree[system.independent[0]] == pytest.approx(a, rel=1e-8)


def test_a_joint_with_a_stop_is_not_cut():
    m, guess = planar_loop(1)
    m.add(JointStop("stop", joint="closing", upper=3, stiffness=40, width=0.1))
    system = m.assemble(guess={k: x for k, x in guess.items() if k != "j3"})
    assert "closing" in [c.name for c in system.coordinates]


def test_absent_elements_cost_nothing():
    """An element on a joint leaves the recursion as it is."""
    m = random_tree(1, n=4, kinds=("revolute",), aligned=True).mechanism
    plain = count(MODELS.inverse_dynamics(m.assemble()))
    m.add(JointFriction("friction", joint="j0", viscous=2))
    rubbed = count(MODELS.inverse_dynamics(m.assemble()))
    assert plain.total < rubbed.total <= plain.total + 2


@settings(max_examples=30, deadline=None)
@given(
    st.tuples(*[st.floats(-2, 2)] * 6),
    st.tuples(*[st.floats(-3, 3)] * 3),
    st.tuples(*[st.floats(-3, 3)] * 3),
)
def test_a_pair_of_forces_does_not_move_the_mass_centre(points, q, v):
    """Between two free bodies: no net force, no net moment, at any points and configurations."""
    configuration = [*q, 1, 0, 0, 0, *v, 0.6, 0, 0.8, 0]
    value = MODELS.gravity_effort(PAIR)(configuration, points)
    f_a, m_a, f_b, m_b = np.split(numbers(value).ravel(), 4)
    R_b = numbers(MODELS.transform(PAIR, "b")(configuration, points))[:3, :3]
    scale = 1 + np.abs(f_a).max() * 10
    np.testing.assert_allclose(f_a + R_b @ f_b, 0, atol=1e-12 * scale)
    moment = m_a + np.cross(q, f_a) + R_b @ m_b + np.cross(v, R_b @ f_b)
    np.testing.assert_allclose(moment, 0, atol=1e-11 * scale)


def two_free_bodies():
    m = mbs.Mechanism("pair", gravity=(0, 0, 0))
    a, b = (m.add(mbs.components.Body(n, 1.0, (0, 0, 0), (1, 1, 1))) for n in "ab")
    for body in (a, b):
        m.connect(m.world, Free(f"free_{body.name}"), body)
    ends = a.at("x1", "x2", "x3"), b.at("y1", "y2", "y3")
    m.add(Spring("s", *ends, stiffness=9, length=1))
    m.add(Bushing("u", *ends, stiffness=(1, 2, 3), angular_stiffness=(3, 2, 1)))
    m.values = {n: mbs.Parameter(n, 0.1) for n in ("x1", "x2", "x3", "y1", "y2", "y3")}
    return m.assemble()


PAIR = two_free_bodies()
