"""Chains of many links and walking machines: right, and linear in the number of bodies."""

import functools

import numpy as np
import pytest
from casadi import evalf

import mbs
import mbs.models
from mbs import Mechanism
from mbs.components import Body, Free, Revolute
from mbs.operations import count


@functools.cache
def chain(n, branches=1):
    """Chains of n links with general numbers that start from one base."""
    rng = np.random.default_rng(0)
    frames, bodies = [], []
    for j in range(branches * n):
        alpha, d, r = (float(x) for x in rng.uniform((0.3, 0.2, 0.1), (1.2, 0.5, 0.4)))
        antecedent = 0 if j % n == 0 else j
        frames.append(
            {"antecedent": antecedent, "joint": "revolute", "alpha": alpha, "d": d, "r": r}
        )
        m, c = rng.uniform(1, 3), rng.uniform(-0.2, 0.2, 3)
        R = np.linalg.qr(rng.standard_normal((3, 3)))[0]
        J = R @ np.diag([0.1, 0.12, 0.15]) @ R.T + m * (c @ c * np.eye(3) - np.outer(c, c))
        moments = dict(
            zip(("XX", "XY", "XZ", "YY", "YZ", "ZZ"), J[np.triu_indices(3)], strict=True)
        )
        first = dict(zip(("MX", "MY", "MZ"), m * c, strict=True))
        numbers = {key: float(x) for key, x in (moments | first | {"M": m}).items()}
        bodies.append({"frame": j + 1, **numbers})
    table = {"name": f"chain{n}", "gravity": [0, 0, -9.81], "frame": frames, "body": bodies}
    return mbs.load(table).assemble()


def solid(rng, name):
    size = rng.uniform(0.01, 0.03, 3)
    inertia = (size.sum(), size[0] + 0.02, size[1] + 0.02)
    return Body(
        name, mass=rng.uniform(0.5, 4), com=tuple(rng.uniform(-0.1, 0.1, 3)), inertia=inertia
    )


def add_limb(m, rng, root, at, name, axes, lengths):
    """Revolute joints about these axes, each this far below the one before; the last body."""
    before, place = root, at
    for k, (axis, length) in enumerate(zip(axes, lengths, strict=True)):
        body = m.add(solid(rng, f"{name}{k}"))
        m.connect(before.at(*place), Revolute(f"{name}_{k}", axis=axis), body)
        before, place = body, (0.0, 0.0, -length)
    return before


@functools.cache
def humanoid():
    """A floating base with two legs of 6 joints, two arms of 7, a torso of 3 and a head of 3."""
    rng, m = np.random.default_rng(1), Mechanism("humanoid", gravity=(0, 0, -9.81))
    pelvis = m.add(solid(rng, "pelvis"))
    m.connect(m.world, Free("base"), pelvis)
    leg, arm = (0, 0, 0.38, 0.32, 0, 0), (0, 0, 0.26, 0, 0.2, 0, 0)
    for side, y in (("left", 0.1), ("right", -0.1)):
        add_limb(m, rng, pelvis, (-0.02, y, -0.05), f"{side}_leg", "zxyyyx", leg)
    chest = add_limb(m, rng, pelvis, (0, 0, 0.08), "torso", "zyx", (0, 0, 0))
    add_limb(m, rng, chest, (0, 0, 0.32), "head", "zyx", (0, 0, 0))
    for side, y in (("left", 0.2), ("right", -0.2)):
        add_limb(m, rng, chest, (0, y, 0.23), f"{side}_arm", "yxzyzyx", arm)
    return m.assemble()


@functools.cache
def quadruped():
    """A floating trunk on four legs of three joints."""
    rng, m = np.random.default_rng(2), Mechanism("quadruped", gravity=(0, 0, -9.81))
    trunk = m.add(solid(rng, "trunk"))
    m.connect(m.world, Free("base"), trunk)
    for number, (x, y) in enumerate(((0.2, 0.05), (0.2, -0.05), (-0.2, 0.05), (-0.2, -0.05))):
        add_limb(m, rng, trunk, (x, y, 0), f"leg{number}", "xyy", (0, 0.21, 0.2))
    return m.assemble()


def random_motion(system):
    rng = np.random.default_rng(4)
    q = np.array(system.configuration)
    fixed = system.nq != system.nv
    q[7 if fixed else 0 :] = rng.uniform(-1, 1, system.nq - 7 * fixed)
    if fixed:
        q[3:7] = np.array([0.5, -0.1, 0.7, 0.5])
    return q, *rng.uniform(-1, 1, (2, system.nv))


@pytest.mark.parametrize(
    "builder", [mbs.models.inverse_dynamics, mbs.models.direct_dynamics], ids=["idm", "ddm"]
)
def test_operations_are_linear_in_the_number_of_links(builder):
    short, twice = count(builder(chain(30))), count(builder(chain(60)))
    assert short.total < twice.total < 2.1 * short.total
    assert twice.trig == 2 * short.trig == 120


def test_direct_dynamics_of_branches_costs_as_much_as_the_branches():
    one = count(mbs.models.direct_dynamics(chain(6), "articulated"))
    four = count(mbs.models.direct_dynamics(chain(6, branches=4), "articulated"))
    assert four.total <= 4.1 * one.total


def test_articulated_bodies_are_taken_where_they_are_cheaper():
    for system, method in (
        (chain(6), "composite"),
        (chain(12), "articulated"),
        (chain(30), "articulated"),
        (quadruped(), "articulated"),
    ):
        auto = mbs.models.direct_dynamics(system)
        assert auto is mbs.models.direct_dynamics(system, method), system.name


@pytest.mark.parametrize("system", [humanoid, quadruped, functools.partial(chain, 12)])
def test_methods_agree(system):
    q, v, tau = random_motion(system())
    a, b = (
        np.array(mbs.models.direct_dynamics(system(), method)(q, v, tau))
        for method in ("articulated", "composite")
    )
    np.testing.assert_allclose(a, b, rtol=0, atol=1e-11 * np.abs(b).max())


def test_operations_of_the_humanoid():
    assert humanoid().nv == 38
    taken = count(mbs.models.direct_dynamics(humanoid()))
    assert taken.mul + taken.add + 2 * taken.div <= 7800


def test_long_chain_against_pinocchio():
    pin = pytest.importorskip("pinocchio")
    system, n = chain(60), 60
    model = pin.Model()
    for j, link in enumerate(system.tree.links):
        at = link.placement
        c, s = np.cos(float(at.alpha)), np.sin(float(at.alpha))
        R = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
        p = np.array([float(at.d), 0, 0]) + R @ [0, 0, float(at.r)]
        model.addJoint(j, pin.JointModelRZ(), pin.SE3(R, p), f"j{j}")
        m, com = float(link.inertia.m), np.array(evalf(link.inertia.ms)).ravel()
        com /= m
        J = np.array(evalf(link.inertia.J)) - m * (com @ com * np.eye(3) - np.outer(com, com))
        model.appendBodyToJoint(j + 1, pin.Inertia(m, com, J), pin.SE3.Identity())
    data = model.createData()
    rng = np.random.default_rng(5)
    q, v, a = rng.uniform(-1, 1, (3, n)) * 0.3
    tau = pin.rnea(model, data, q, v, a)
    ours = np.array(mbs.models.inverse_dynamics(system)(q, v, a)).ravel()
    np.testing.assert_allclose(ours, tau, rtol=0, atol=1e-11 * np.abs(tau).max())
    theirs = pin.aba(model, data, q, v, tau)
    back = np.array(mbs.models.direct_dynamics(system)(q, v, tau)).ravel()
    np.testing.assert_allclose(back, theirs, rtol=0, atol=1e-9)
