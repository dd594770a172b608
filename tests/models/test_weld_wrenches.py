"""Wrenches of Fixed joints, which weld bodies into one link: what force sensors there feel."""

import numpy as np
import pytest
from support.body_balance import State, balanced, column, frames_of, in_balance, numbers
from support.messages import refused
from support.random_trees import random_body, random_rotation, random_state, random_tree

import mbs
import mbs.models
from mbs.components import Body, Box, Fixed, Force, Revolute, Rotor, Spring, WrenchSensor
from mbs.errors import AssemblyError
from mbs.models import joint_wrenches


def point(rng, body):
    return body.at(*rng.uniform(-0.4, 0.4, 3), rotation=random_rotation(rng))


def welded_tree(seed):
    """A random tree with two bodies welded, one behind the other, to one of its bodies."""
    rng = np.random.default_rng(seed)
    m = random_tree(seed, n=4).mechanism
    host = m.components["body1"]
    inner, outer = (m.add(random_body(rng, name)) for name in ("inner", "outer"))
    m.connect(point(rng, host), Fixed("near"), point(rng, inner))
    m.connect(point(rng, outer), Fixed("far"), point(rng, inner))  # frame_a is behind
    tip = m.add(random_body(rng, "tip"))
    m.connect(point(rng, outer), Revolute("wrist", axis="x"), point(rng, tip))
    back = m.add(random_body(rng, "back"))
    m.connect(point(rng, back), Revolute("backwards", axis="y"), point(rng, inner))
    return m, rng


@pytest.mark.parametrize("seed", range(4))
def test_welded_bodies_are_in_balance_one_by_one(seed):
    m, rng = welded_tree(seed)
    system = m.assemble()
    q, v, a = random_state(system, rng)
    F = joint_wrenches(system)(q, v, a)
    assert [row.name for row in system.joints][4:] == ["near", "far", "wrist", "backwards"]
    assert len({row.link for row in system.bodies}) < len(system.bodies)
    balanced(m, system, State(q, v, a), F)


def test_forces_and_external_wrenches_on_a_welded_body():
    """A spring and a force on the part behind the weld pass through it, one before it does not."""
    m, _ = welded_tree(0)
    plain = m.assemble()
    rng = np.random.default_rng(3)
    state = random_state(plain, rng)
    push, p = np.array([1.0, -2, 3]), np.array([0.1, 0.2, 0.3])
    m.add(Force("f", m.components["outer"].at(*p), force=push, axes="body"))
    m.add(Spring("s", m.components["body1"].at(0.3), m.components["body0"], stiffness=20))
    system = m.assemble()
    before, after = (joint_wrenches(s)(*state) for s in (plain, system))
    change = column(system, numbers(after) - numbers(before), "far")
    T = np.linalg.inv(numbers(mbs.models.transform(system, "inner")(state[0])))
    T = T @ numbers(mbs.models.transform(system, "outer")(state[0]))
    inside = numbers(frames_of(m, "far")[1].placement.pose({}).matrix)
    T = np.linalg.inv(inside) @ T
    force = T[:3, :3] @ push  # the part behind has frame_a: it passes the force on
    at = T[:3, :3] @ p + T[:3, 3]
    np.testing.assert_allclose(change, [*force, *np.cross(at, force)], atol=1e-10)
    out = np.zeros((6, len(system.bodies)))
    number = [row.name for row in system.bodies].index("outer")
    out[:3, number] = -push
    out[3:, number] = -np.cross(p, push)
    loaded = joint_wrenches(plain, f_ext=True)(*state, out)
    np.testing.assert_allclose(
        column(plain, loaded, "far"), column(system, after, "far"), atol=1e-10
    )


def test_force_plate_under_a_motor():
    """On the ground: the weight of the plate, what the arm leaves, and the spin of a rotor."""
    results = []
    for rotor in (None, Rotor(inertia=0.02, ratio=5, axis="y")):
        m = mbs.Mechanism("plate")
        plate = m.add(Body("plate", mass=4.0, com=(0.1, 0, 0.2)))
        arm = m.add(Body("arm", mass=2.0, com=(0.3, 0, 0), inertia=(0.1, 0.2, 0.3)))
        m.connect(m.world, Fixed("scale"), plate)
        m.connect(plate.at(0, 0, 0.5), Revolute("j", axis="y", rotor=rotor), arm)
        system = m.assemble()
        F = joint_wrenches(system)(0.4, 1.5, 2.0)
        results.append(column(system, F, "scale"))
    f, n = np.split(results[0], 2)
    c, s = np.cos(0.4), np.sin(0.4)
    acc = 2.0 * 0.3 * np.array([-s, 0, -c]) + 1.5**2 * 0.3 * np.array([-c, 0, s])
    np.testing.assert_allclose(f, 2 * acc + [0, 0, 6 * 9.81], atol=1e-12)
    pull = 2 * acc + [0, 0, 2 * 9.81]
    moment = np.cross([0.3 * c, 0, 0.5 - 0.3 * s], pull) + np.cross([0.1, 0, 0.2], [0, 0, 39.24])
    moment[1] += 0.2 * 2.0
    np.testing.assert_allclose(n, moment, atol=1e-12)
    np.testing.assert_allclose(results[1] - results[0], [0, 0, 0, 0, 0.02 * 5 * 2.0, 0], atol=1e-12)


def test_the_world_on_the_side_of_frame_b():
    """Connected the other way round the joint says the opposite about its other frame."""
    columns = []
    for turned in (False, True):
        m = mbs.Mechanism("m")
        b = m.add(Box("b", length=0.4, mass=2.0))
        m.connect(*((b, Fixed("w"), m.world) if turned else (m.world, Fixed("w"), b)))
        m.connect(b.right, Revolute("j", axis="y"), m.add(Box("c", length=0.3, mass=1.0)).left)
        system = m.assemble()
        columns.append(column(system, joint_wrenches(system)(0.3, 0.2, 0.1), "w"))
    np.testing.assert_allclose(columns[0], -columns[1], atol=1e-12)
    assert columns[0][2] > 29


def test_a_weld_in_a_loop():
    """A coupler of two halves: the wrench between them, with cut joints on either half."""
    m = mbs.Mechanism("four_bar", gravity=(0, -9.81, 0))
    a, b1, b2, c = (
        m.add(Box(n, length=x, mass=1.0))
        for n, x in (("a", 0.4), ("b1", 0.5), ("b2", 0.5), ("c", 0.9))
    )
    m.connect(m.world, Revolute("j1", actuated=True), a.left)
    m.connect(a.right, Revolute("j2"), b1.left)
    m.connect(b1.right, Fixed("middle"), b2.left)
    m.connect(b2.right, Revolute("j3"), c.right)
    m.connect(m.world.at(0.8), Revolute("j4"), c.left)
    m.add(WrenchSensor("gauge", "middle"))
    system = m.assemble(guess={"j1": 0.3, "j2": 0.9, "j4": 1.1})
    F = in_balance(m, system)
    assert np.linalg.norm(column(system, F, "middle")) > 1
    v_a, a_a = np.random.default_rng(7).uniform(-1, 1, (2, 1))
    f, n = mbs.models.measurements(system)(system.configuration, v_a, a_a)
    np.testing.assert_allclose(
        np.vstack([numbers(f), numbers(n)]).ravel(), column(system, F, "middle"), rtol=0, atol=1e-10
    )


def test_a_ring_of_welds_says_nothing():
    m = mbs.Mechanism("m")
    b, c = m.add(Body("b", mass=1.0)), m.add(Body("c", mass=1.0))
    m.connect(m.world, Revolute("j"), b)
    for name in ("first", "second"):
        m.connect(b.at(0.1), Fixed(name), c)
    assert [row.name for row in m.assemble().joints] == ["j"]
    m.add(WrenchSensor("s", "first"))
    refused(
        AssemblyError,
        "s: joint 'first' closes a ring of welds",
        "take another weld of the ring away",
        by=m.assemble,
    )


def test_a_base_that_moves_carries_what_stands_on_it():
    """Lifted with 1 m/s^2 the scale reads the mass above it more."""
    m = mbs.Mechanism("lift")
    plate = m.add(Body("plate", mass=4.0))
    m.connect(m.world, Fixed("scale"), plate)
    m.connect(plate, Revolute("j", axis="z"), m.add(Body("top", mass=2.0, inertia=(1, 1, 1))))
    system = m.assemble()
    model = joint_wrenches(system, moving_base=True)
    lifted = model(0.3, 0, 0, np.zeros(6), [0, 0, 1, 0, 0, 0], np.eye(3))
    rest = model(0.3, 0, 0, np.zeros(6), np.zeros(6), np.eye(3))
    change = column(system, numbers(lifted) - numbers(rest), "scale")
    np.testing.assert_allclose(change, [0, 0, 6, 0, 0, 0], atol=1e-12)
