"""Wrenches of joints: every body in balance, efforts along the axes, MuJoCo, closed forms."""

import re

import casadi
import numpy as np
import pytest
from support.body_balance import State, along, balanced, column
from support.catalogue_systems import catalogue_system
from support.closed_mechanisms import closed_chain
from support.driven_trees import driven_tree
from support.mujoco_rounding import as_exact_as
from support.random_trees import ALL_KINDS, random_state, random_tree

import mbs
import mbs.models
from mbs.components import (
    Body,
    Force,
    Prismatic,
    Revolute,
    Spring,
)
from mbs.errors import ModelError
from mbs.models import joint_wrenches

IDM, DDM = mbs.models.inverse_dynamics, mbs.models.direct_dynamics


@pytest.mark.parametrize("seed", range(6))
def test_bodies_of_a_tree_are_in_balance(seed):
    m = random_tree(seed, n=5, kinds=ALL_KINDS).mechanism
    system = m.assemble()
    q, v, a = random_state(system, np.random.default_rng(seed))
    F = joint_wrenches(system)(q, v, a)
    assert F.shape == (6, 5)
    assert np.abs(np.array(F)).max() > 1
    balanced(m, system, State(q, v, a), F)


@pytest.mark.parametrize("seed", range(4))
def test_axes_carry_the_efforts(seed):
    """Along its freedoms a joint transmits what motors give beyond rotor inertia and friction."""
    m = random_tree(seed, n=5).mechanism
    system = m.assemble()
    q, v, a = random_state(system, np.random.default_rng(seed))
    F = joint_wrenches(system)(q, v, a)
    tau = np.array(IDM(system)(q, v, a)).ravel()
    for number, speed in enumerate(system.velocity_coordinates):
        joint = m.components[speed.joint]
        own = float(str(joint.Ia)) * a[number] + float(str(joint.Fv)) * v[number]
        expected = tau[number] - own
        assert along(joint, speed.name, q, system) @ column(system, F, joint.name) == (
            pytest.approx(expected, abs=1e-10)
        )


@pytest.mark.parametrize("seed", range(4))
def test_backward_joints_and_springs(seed):
    """Joints connected from the outer body to the inner one; force elements act beside joints."""
    rng = np.random.default_rng(seed)
    m = driven_tree(seed, n=4, kinds=("spherical", "free"))
    bodies = list(m.bodies())
    a, b = bodies[0].at(0.1, 0.2, 0.3), bodies[3].at(-0.2, 0.1, 0)
    m.add(Spring("s", a, b, stiffness=30, length=0.2))
    m.add(Force("f", bodies[1].at(0.3), force=(1, -2, 3)))
    system = m.assemble()
    q, v, acc = random_state(system, rng)
    ends = [np.array(mbs.models.transform(system, k)(q)) for k in ("body0", "body3", "body1")]
    points = [
        T[:3, :3] @ p + T[:3, 3]
        for T, p in zip(ends, ([0.1, 0.2, 0.3], [-0.2, 0.1, 0], [0.3, 0, 0]), strict=True)
    ]
    line = points[1] - points[0]
    pull = 30 * (1 - 0.2 / np.linalg.norm(line)) * line
    push = np.array([1.0, -2, 3])
    forces = {
        "body0": np.concatenate([pull, np.cross(points[0], pull)]),
        "body3": -np.concatenate([pull, np.cross(points[1], pull)]),
        "body1": np.concatenate([push, np.cross(points[2], push)]),
    }
    F = joint_wrenches(system)(q, v, acc)
    balanced(m, system, State(q, v, acc), F, forces=forces)


def test_pendulum():
    """m g cos + m w^2 l along the arm, m (l wd - g sin) across, hanging down at zero."""
    m = mbs.Mechanism("pendulum", gravity=(0, -9.81, 0))
    bob = m.add(Body("bob", mass=2.0, com=(0, -0.7, 0)))
    m.connect(m.world, Revolute("j", actuated=False), bob)
    system = m.assemble()
    q, w = 0.6, 1.7
    a = DDM(system)(q, w, 0)
    f, n = np.split(column(system, joint_wrenches(system)(q, w, a), "j"), 2)
    assert f[1] == pytest.approx(2 * 9.81 * np.cos(q) + 2 * w**2 * 0.7)
    np.testing.assert_allclose([f[0], f[2], *n], 0, atol=1e-12)
    f, n = np.split(column(system, joint_wrenches(system)(q, 0, 3.0), "j"), 2)
    assert f[0] == pytest.approx(2 * 0.7 * 3.0 + 2 * 9.81 * np.sin(q))
    assert n[2] == pytest.approx(0.7 * f[0])


def test_external_wrenches_and_a_base_that_moves():
    m = mbs.Mechanism("m", gravity=(0, 0, -9.81))
    body = m.add(Body("b", mass=3.0, com=(0.1, 0.2, 0.3), inertia=(0.4, 0.5, 0.6)))
    m.connect(m.world.at(0.5, rotation=("x", 0.4)), Prismatic("x", axis="x"), body)
    system = m.assemble()
    out = np.array([1.0, 2, 3, 4, 5, 6])
    plain = joint_wrenches(system)(0.2, 0.1, 0.3)
    F = joint_wrenches(system, f_ext=True)(0.2, 0.1, 0.3, out)
    np.testing.assert_allclose(np.array(F - plain).ravel(), out, atol=1e-12)
    rising = joint_wrenches(system, moving_base=True)
    F = rising(0.2, 0.1, 0.3, np.zeros(6), [0, 0, 1.0, 0, 0, 0], np.eye(3))
    extra = np.array(F - plain)[:3, 0]
    np.testing.assert_allclose(extra, 3 * np.array([0, np.sin(0.4), np.cos(0.4)]), atol=1e-12)


@pytest.mark.parametrize("seed", range(4))
def test_against_mujoco(seed):
    mujoco = pytest.importorskip("mujoco")
    kinds = ("revolute", "prismatic", "universal", "cylindrical", "planar", "spherical")
    twin = random_tree(seed, n=5, kinds=kinds)
    system, rng = twin.mechanism.assemble(), np.random.default_rng(seed)
    xml = re.sub(r'(<body name="(body\d+)"[^>]*>)', r'\1<site name="\2"/>', twin.mjcf)
    sensors = "".join(f'<force site="body{k}"/><torque site="body{k}"/>' for k in range(5))
    xml = xml.replace("</mujoco>", f"<sensor>{sensors}</sensor></mujoco>")
    model = mujoco.MjModel.from_xml_string(xml)
    data, count = mujoco.MjData(model), {}
    q, v, _ = random_state(system, rng)
    tau = rng.uniform(-5, 5, system.nv)
    for link in system.tree.links:
        joint = link.name.split(".")[0]
        count[joint] = count.get(joint, -1) + 1
        entry = model.joint(f"{joint}_{count[joint]}")
        at, place = int(entry.qposadr[0]), int(entry.dofadr[0])
        data.qpos[at : at + link.motion.nq] = q[link.q]
        data.qvel[place : place + link.motion.nv] = v[link.v]
        data.qfrc_applied[place : place + link.motion.nv] = tau[link.v]
    mujoco.mj_forward(model, data)
    F = joint_wrenches(system)(q, v, DDM(system)(q, v, tau))
    for row, read in zip(range(5), data.sensordata.reshape(5, 6), strict=True):
        ours = column(system, F, f"j{row}")
        largest = max(1, np.abs(read).max())
        np.testing.assert_allclose(ours, read, rtol=0, atol=as_exact_as(mujoco, 1e-9) * largest)


def test_parameters_and_derivatives():
    m = mbs.Mechanism("m")
    m.connect(m.world, Revolute("j", axis="y"), m.add(Body("b", mass="M", com=("L", 0, 0))))
    m.values = {"M": mbs.Parameter("M", 2.0), "L": mbs.Parameter("L", 0.5)}
    system = m.assemble()
    model = joint_wrenches(system)
    assert model.name_in() == ["q", "v", "a", "p"]
    np.testing.assert_allclose(
        np.array(model(0, 0, 0))[:, 0], [0, 0, 2 * 9.81, 0, -9.81, 0], atol=1e-12
    )
    q = casadi.SX.sym("q")
    slope = casadi.Function("s", [q], [casadi.jacobian(model(q, 1, 1), q)])
    assert slope(0.3).is_regular()


def test_only_systems():
    with pytest.raises(ModelError, match="is not a System"):
        joint_wrenches(mbs.Mechanism("m"))
    system = catalogue_system("planar_2r")
    assert [row.name for row in system.joints] == [c.name for c in system.coordinates]
    assert not any(row.cut for row in system.joints)


def test_every_joint_has_a_row():
    mechanism, guess = closed_chain(0, "spherical")
    system = mechanism.assemble(guess=guess)
    assert [row.name for row in system.joints] == [*(f"j{k}" for k in range(8)), "closing"]
    assert [row.name for row in system.joints if row.cut] == ["closing"]
    assert system.joints[-1].kind == "spherical"
