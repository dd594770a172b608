"""Models of mechanisms with drive lines: MuJoCo, derivatives, and the same answer by every way."""

import casadi
import numpy as np
import pytest
from support.mujoco_rounding import as_exact_as
from support.random_trees import random_tree

import mbs
import mbs.models
from mbs.components import DCMotor, ElasticGear, IdealGear, ShaftInertia, TorqueSource

GEARS = ((30.0, 200.0, 0.5), (-4.0, 50.0, 0.1), (12.5, 900.0, 2.0))
"""Ratio, stiffness and damping of the drives of the first three joints."""

INERTIA = 2e-3


def driven(seed):
    """A random tree with an elastic drive on each of its three joints."""
    twin = random_tree(seed, n=3, kinds=("revolute", "prismatic"))
    m = twin.mechanism
    for joint, (ratio, stiffness, damping) in zip(list(m.joints()), GEARS, strict=True):
        gear = ElasticGear(f"{joint.name}_gear", stiffness, damping, ratio=ratio)
        rotor = ShaftInertia(f"{joint.name}_rotor", INERTIA)
        m.connect(gear.flange_b, joint.flange)
        m.connect(rotor.flange_a, gear.flange_a)
        m.connect(TorqueSource(f"{joint.name}_drive").flange, rotor.flange_b)
    return twin


def as_mujoco(twin):
    """The same with a wheel on the world and a tendon for each drive."""
    wheels, tendons = "", ""
    for joint, (ratio, stiffness, damping) in zip(twin.mechanism.joints(), GEARS, strict=True):
        wheels += (
            f'<body name="{joint.name}_wheel" pos="3 0 0">'
            f'<inertial pos="0 0 0" mass="1" diaginertia="{INERTIA} {INERTIA} {INERTIA}"/>'
            f'<joint name="{joint.name}_rotor_0" type="hinge" axis="0 0 1"/></body>'
        )
        tendons += (
            f'<fixed stiffness="{stiffness}" damping="{damping}" springlength="0">'
            f'<joint joint="{joint.name}_rotor_0" coef="{1 / ratio!r}"/>'
            f'<joint joint="{joint.name}_0" coef="-1"/></fixed>'
        )
    xml = twin.mjcf.replace("</worldbody>", f"{wheels}</worldbody>")
    return xml.replace("</mujoco>", f"<tendon>{tendons}</tendon></mujoco>")


@pytest.mark.parametrize("seed", range(4))
def test_accelerations_of_mujoco(seed):
    mujoco = pytest.importorskip("mujoco")
    twin = driven(seed)
    system = twin.mechanism.assemble()
    rng = np.random.default_rng(seed)
    q, v, tau = rng.uniform(-1, 1, (3, system.nv))
    model = mujoco.MjModel.from_xml_string(as_mujoco(twin))
    data = mujoco.MjData(model)
    places = [int(model.joint(f"{c.name}_0").dofadr[0]) for c in system.coordinates]
    data.qpos[places], data.qvel[places], data.qfrc_applied[places] = q, v, tau
    mujoco.mj_forward(model, data)
    a = np.array(mbs.models.direct_dynamics(system)(q, v, tau)).ravel()
    assert system.nv == 6
    tolerance = as_exact_as(mujoco, 1e-9)
    np.testing.assert_allclose(a, data.qacc[places], rtol=tolerance, atol=tolerance)


@pytest.mark.parametrize("seed", range(2))
def test_both_methods_and_the_inverse_model_agree(seed):
    system = driven(seed).mechanism.assemble()
    rng = np.random.default_rng(seed)
    q, v, a = rng.uniform(-1, 1, (3, system.nv))
    tau = mbs.models.inverse_dynamics(system)(q, v, a)
    for method in ("composite", "articulated"):
        back = mbs.models.direct_dynamics(system, method)(q, v, tau)
        np.testing.assert_allclose(np.array(back).ravel(), a, rtol=1e-8, atol=1e-8)


def test_derivatives_by_strength_and_ratio():
    m = random_tree(1, n=2, kinds=("revolute",)).mechanism
    first, second = m.joints()
    elastic, rigid = ElasticGear("elastic", "k", "c", ratio="N"), IdealGear("rigid", "N+1")
    for joint, gear in ((first, elastic), (second, rigid)):
        m.connect(gear.flange_b, joint.flange)
        m.connect(gear.flange_a, ShaftInertia(f"{joint.name}_rotor", "J").flange_a)
    m.values |= {
        name: mbs.Parameter(name, value)
        for name, value in {"k": 80.0, "c": 0.3, "N": 5.0, "J": 0.01}.items()
    }
    system = m.assemble()
    model = mbs.models.direct_dynamics_derivatives(system, with_respect_to=("q", "v", "p"))
    ddm = mbs.models.direct_dynamics(system)
    rng = np.random.default_rng(2)
    point = [rng.uniform(-1, 1, 3) for _ in range(3)] + [np.array(system.p_default)]
    for number, slope in ((0, "da_dq"), (1, "da_dv"), (3, "da_dp")):
        exact = np.array(model.call(dict(zip(model.name_in(), point, strict=True)))[slope])
        for column, _ in enumerate(point[number]):
            step = 1e-6 * max(1, abs(point[number][column]))
            ends = []
            for sign in (-1, 1):
                moved = [x.copy() for x in point]
                moved[number][column] += sign * step
                ends.append(np.array(ddm(*moved)).ravel())
            numeric = (ends[1] - ends[0]) / (2 * step)
            np.testing.assert_allclose(exact[:, column], numeric, rtol=2e-6, atol=1e-5)


def test_devices_are_functions_of_symbols():
    m = random_tree(0, n=1, kinds=("revolute",)).mechanism
    motor = DCMotor("motor", resistance=2, inductance=0.5, constant=0.25)
    m.connect(motor.flange, next(m.joints()).flange)
    model = mbs.models.devices(m.assemble())
    v, z, u = (casadi.SX.sym(name) for name in "vzu")
    _, zdot, _ = model(v, z, u)
    slopes = casadi.jacobian(zdot, casadi.vertcat(v, z, u))
    np.testing.assert_allclose(np.array(casadi.evalf(slopes)), [[-0.5, -4, 2]])
