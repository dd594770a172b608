"""Wrenches of joints in loops, of those that are cut and those that remain."""

import numpy as np
import pytest
from support.body_balance import along, balanced, column, in_balance, tree_state
from support.closed_mechanisms import CLOSING, closed_chain, planar_loop
from support.random_trees import random_tree

import mbs
import mbs.models
from mbs.components import (
    Body,
    Box,
    ConstantVelocity,
    Gear,
    PointOnLine,
    PointOnPlane,
    Revolute,
    Rod,
)
from mbs.loops import closure_jacobian
from mbs.models import joint_wrenches

IDM = mbs.models.inverse_dynamics
REVOLUTE_CHAIN = dict(n=8, kinds=("revolute", "revolute", "prismatic"), serial=True)


@pytest.mark.sweep
@pytest.mark.parametrize("kind", CLOSING)
def test_bodies_of_a_loop_are_in_balance(kind):
    mechanism, guess = closed_chain(3, kind)
    in_balance(mechanism, mechanism.assemble(guess=guess))


@pytest.mark.parametrize("kind", ["rod", "line", "plane", "constant_velocity"])
def test_constraints(kind):
    mechanism, guess, joint = held(kind)
    system = mechanism.assemble(guess=guess)
    F = in_balance(mechanism, system)
    f, m = np.split(column(system, F, "held"), 2)
    T = np.linalg.inv(joint) @ np.array(mbs.models.transform(system, "body7")(system.configuration))
    z = T[:3, :3].T @ [0, 0, 1]
    if kind == "rod":
        along = T[:3, :3].T @ T[:3, 3]
        assert np.linalg.norm(np.cross(f, along)) < 1e-9
    if kind == "line":
        assert abs(f @ z) < 1e-9
    if kind == "plane":
        assert np.linalg.norm(np.cross(f, z)) < 1e-9
    if kind == "constant_velocity":
        assert np.linalg.norm(m) > 0.1
        middle = z + np.eye(3)[2]  # shafts of one speed: between the two axes
        np.testing.assert_allclose(np.cross(m, middle), 0, atol=1e-8)
    else:
        np.testing.assert_allclose(m, 0, atol=1e-9)
    assert np.linalg.norm(f) > 1


def held(kind):
    """A serial chain whose tip a constraint holds, and the pose of frame_a in the world."""
    rng = np.random.default_rng(5)
    m = random_tree(5, **REVOLUTE_CHAIN).mechanism
    q = rng.uniform(-0.6, 0.6, 8)
    T = np.array(mbs.models.transform(m.assemble(), "body7")(q))
    if kind == "rod":
        T[:3, 3] += [0.3, 0.5, -0.4]
        joint = Rod("held", length=float(np.sqrt(0.5)))
    elif kind == "constant_velocity":
        c, s = np.cos(0.6), np.sin(0.6)
        T[:3, :3] = T[:3, :3] @ [[1, 0, 0], [0, c, -s], [0, s, c]]
        joint = ConstantVelocity("held")
    else:
        joint = (PointOnLine if kind == "line" else PointOnPlane)("held")
    m.connect(m.world.at(*T[:3, 3], rotation=T[:3, :3]), joint, m.components["body7"])
    return m, {f"j{k}": float(x) for k, x in enumerate(q)}, T


@pytest.mark.parametrize("seed", range(3))
def test_planar_loops(seed):
    mechanism, guess = planar_loop(seed, links=3 + seed)
    system = mechanism.assemble(guess=guess)
    assert system.loops[0].dropped
    F = in_balance(mechanism, system)
    f, m = np.split(column(system, F, system.loops[0].name), 2)
    np.testing.assert_allclose([f[2], *m], 0, atol=1e-12)  # dropped rows, and the free axis


@pytest.mark.parametrize("name", ["sr400", "five_bar", "four_bar"])
def test_catalogue(name):
    mechanism = mbs.load(name)
    in_balance(mechanism, mechanism.assemble())


def test_rolling_discs():
    """The ground pushes with the whole weight, and along itself against slip, at the contacts."""
    mechanism = mbs.load("whipple_bicycle")
    system = mechanism.assemble()
    in_balance(mechanism, system)
    F = joint_wrenches(system)(system.configuration, [0, 0, 4.0], [0, 0, 0])
    contacts = [column(system, F, f"{name}_contact") for name in ("rear", "front")]
    weight = sum(row.mass for row in system.bodies) * 9.81
    assert sum(abs(f[2]) for f in contacts) == pytest.approx(weight, rel=1e-3)


def test_efforts_that_the_loops_distribute():
    """The same motion under two motors: other forces inside, balance and axes as the motors say."""
    mechanism, guess = closed_chain(1, "revolute")
    system = mechanism.assemble(guess=guess)
    rng = np.random.default_rng(2)
    v_a, a_a = rng.uniform(-1, 1, (2, len(system.independent)))
    state = tree_state(system, v_a, a_a)
    tau = np.zeros(system.nv)
    tau[list(system.independent)] = np.array(IDM(system)(state.q, v_a, a_a)).ravel()
    J = np.array(closure_jacobian(system)(state.q))[list(system.closure.rows)]
    other = tau + J.T @ rng.uniform(-9, 9, len(J))
    model = joint_wrenches(system, "tree")
    F, G = (np.array(model(state.q, state.v, state.a, t)) for t in (tau, other))
    assert np.abs(F - G).max() > 1
    balanced(mechanism, system, state, G)
    for number, speed in enumerate(system.velocity_coordinates):
        joint = mechanism.components[speed.joint]
        own = float(str(joint.Ia)) * state.a[number] + float(str(joint.Fv)) * state.v[number]
        axis = along(joint, speed.name, state.q, system)
        assert axis @ column(system, G, joint.name) == pytest.approx(
            float((other[number] - own).item()), abs=1e-8
        )


def test_a_welded_cut_passes_the_wrench_of_its_joint():
    """A joint with friction stays in the tree and its free end is welded: the same wrenches."""
    forces = []
    for driven in ("j2", "j3"):
        m = mbs.Mechanism("four_bar", gravity=(0, -9.81, 0))
        bars = [
            m.add(Box(n, length=x, mass=1.0)) for n, x in zip("abc", (0.4, 1, 0.9), strict=True)
        ]
        a, b, c = bars
        friction = {n: 0.1 for n in ("j1", "j2", "j3", "j4")}
        if driven == "j3":
            friction["j3"] = 0.0
        m.connect(m.world, Revolute("j1", actuated=True, Fv=friction["j1"]), a.left)
        m.connect(a.right, Revolute("j2", Fv=friction["j2"]), b.left)
        m.connect(b.right, Revolute("j3", Fv=friction["j3"]), c.right)
        m.connect(m.world.at(0.8), Revolute("j4", Fv=friction["j4"]), c.left)
        system = m.assemble(guess={"j1": 0.3, "j2": 0.9, "j4": 1.1})
        q = mbs.loops.solve(system, {"j1": 0.4})
        F = joint_wrenches(system)(q, 0.0, 0.7)
        assert any(cut.welded for cut in system.cuts) is (driven == "j2")
        forces.append(np.column_stack([column(system, F, n)[[0, 1, 5]] for n in friction]))
    np.testing.assert_allclose(forces[0], forces[1], atol=1e-9)


def test_gears_put_efforts_on_their_coordinates():
    m = mbs.Mechanism("gears", gravity=(0, 0, 0))
    for name, x in (("p", 0.0), ("w", 0.5)):
        body = m.add(Body(f"{name}_body", mass=1.0, inertia=(1, 1, 0.3)))
        m.connect(m.world.at(x), Revolute(name, actuated=name == "p"), body)
    m.add(Gear("mesh", driven="w", driver="p", ratio=-0.5))
    system = m.assemble()
    F = joint_wrenches(system)(system.configuration, 0.0, 2.0)
    assert column(system, F, "w")[5] == pytest.approx(0.3 * -0.5 * 2.0)
    assert column(system, F, "p")[5] == pytest.approx(0.3 * 2.0)


def test_massless_link_of_a_parallelogram():
    m = mbs.Mechanism("parallelogram", gravity=(0, -9.81, 0))
    a, c = (m.add(Box(n, length=0.5, mass=2.0)) for n in "ac")
    bar = m.add(Body("bar", mass=0))
    m.connect(m.world, Revolute("j1", actuated=True), a.left)
    m.connect(m.world.at(0.8), Revolute("j4"), c.left)
    m.connect(a.right, Revolute("j2"), bar)
    m.connect(bar.at(0.8), Revolute("j3"), c.right)
    system = m.assemble(guess={"j1": 1.1, "j4": 1.1, "j2": -1.1})
    F = in_balance(m, system)
    f, n = np.split(column(system, F, "j3"), 2)
    assert abs(n[2]) < 1e-12
    assert np.linalg.norm(f) > 1  # the bar pushes the passive crank, along itself
    q = dict(zip([x.name for x in system.coordinates], system.configuration, strict=True))
    b_axis = np.array([np.cos(q["j4"]), -np.sin(q["j4"]), 0])
    np.testing.assert_allclose(np.cross(f, b_axis), 0, atol=1e-9)
