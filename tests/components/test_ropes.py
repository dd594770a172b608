"""Ropes over pulleys: two weights by hand, chains of segments, tension and slack."""

import numpy as np
import pytest
from support.messages import refused
from support.parts import asked, metered, run, stored

import mbs
from mbs.components import (
    Box,
    ElasticRope,
    Fixed,
    PointMass,
    Prismatic,
    Revolute,
    RopeOverPulleys,
)
from mbs.errors import AssemblyError, DescriptionError

G = 9.81


def weights(rope):
    """Two weights of 2 kg and 3 kg below two pulleys 1 m apart."""
    m = mbs.Mechanism("weights", gravity=(0, 0, -G))
    for name, x, mass in (("left", 0, 2.0), ("right", 1, 3.0)):
        joint = Prismatic(f"z_{name}", axis="z", actuated=False)
        m.connect(m.world.at(x), joint, m.add(PointMass(name, mass=mass)))
    left, right = m.components["left"], m.components["right"]
    m.add(rope((left, m.world.at(0, 0, 5), m.world.at(1, 0, 5), right)))
    return m


def test_two_weights_by_hand():
    m = weights(lambda path: RopeOverPulleys("rope", path, length=9.0))
    system = asked(m, guess={"z_left": 1.0})
    a, lam = mbs.models.direct_dynamics(system, coordinates="tree")(
        system.configuration, [0, 0], [0, 0]
    )
    np.testing.assert_allclose(np.array(a).ravel(), [G / 5, -G / 5], atol=1e-12)
    np.testing.assert_allclose(-float(lam), 2 * 2 * 3 / 5 * G, rtol=1e-13)
    result = run(system, 0.5)
    np.testing.assert_allclose(result["rope.tension"], 2 * 2 * 3 / 5 * G, rtol=1e-12)
    rise = result["z_left.q"] - system.configuration[0]
    np.testing.assert_allclose(rise, 0.5 * G / 5 * result.time**2, atol=1e-12)
    report = system.report()
    assert "RopeOverPulleys rope binds z_left and z_right: 1 of 1 row is independent." in report
    assert "RopeOverPulleys rope binds z_left and z_right: 1 of 1 row is independent." in report


def tackle():
    """A load on a loose pulley, between the ground and a weight: three segments."""
    m = mbs.Mechanism("tackle", gravity=(0, 0, -G))
    load, weight = m.add(PointMass("load", 3.0)), m.add(PointMass("weight", 2.0))
    m.connect(m.world, Prismatic("z", axis="z", actuated=False), load)
    m.connect(m.world.at(1), Prismatic("w", axis="z", actuated=False), weight)
    path = (m.world.at(0, 0, 4), load, m.world.at(0, 0, 4), m.world.at(1, 0, 4), weight)
    m.add(RopeOverPulleys("rope", path, length=10.0))
    return m


def test_a_tackle_halves_the_force():
    system = asked(tackle(), guess={"z": 1.0})
    result = run(system, 0.3)
    # 3 a = 2 T - 3 g, 2 b = T - 2 g, 2 a + b = 0
    T = 3 * G / (4 / 3 + 1 / 2)
    np.testing.assert_allclose(result["rope.tension"], T, rtol=1e-12)
    np.testing.assert_allclose(result["z.a"], (2 * T - 3 * G) / 3, atol=1e-11)
    np.testing.assert_allclose(result["w.v"], -2 * result["z.v"], atol=1e-12)


def hanging(kind, **numbers):
    """A pendulum whose end a rope draws over a pulley with a weight."""
    m = mbs.Mechanism("hanging", gravity=(0, 0, -G))
    bar, weight = m.add(Box("bar", length=1.0, mass=2.0)), m.add(PointMass("weight", 1.5))
    m.connect(m.world, Revolute("j", axis="y", actuated=False), bar.left)
    m.connect(m.world.at(1.5), Prismatic("z", axis="z", actuated=False), weight)
    m.add(kind("rope", (bar.right, m.world.at(1.5, 0, 2), weight), length=4.0, **numbers))
    return asked(m, guess={"j": 0.3, "z": -0.5})


def test_a_rope_that_does_not_stretch_takes_no_energy():
    result = run(hanging(RopeOverPulleys), 1.5)
    q, z = result["j.q"], result["z.q"]
    length = np.hypot(1.5 - np.cos(q), 2 + np.sin(q)) + 2 - z
    np.testing.assert_allclose(length, 4.0, atol=1e-10)
    E = stored(result)
    np.testing.assert_allclose(E, E[0], rtol=0, atol=1e-8)
    # the weight: m a = T - m g
    tension = 1.5 * (result["z.a"] + G)
    np.testing.assert_allclose(result["rope.tension"], tension, rtol=1e-9)


def test_an_elastic_rope_stores_and_is_slack():
    system = hanging(ElasticRope, stiffness=2e3, width=0.01)
    # it starts slack by a quarter of a metre
    z = 0.25 - 2 + np.hypot(1.5 - np.cos(0.3), 2 + np.sin(0.3))
    result = run(system, 1.5, q0={"j": 0.3, "z": z}, v0={"z": 2.0})
    T, E = result["rope.tension"], stored(result)
    assert np.all(T[:10] == 0)
    assert T.max() > 50
    np.testing.assert_allclose(E, E[0], rtol=0, atol=1e-8)
    np.testing.assert_allclose(1.5 * (result["z.a"] + G), T, atol=1e-9)


def test_a_damped_rope_turns_what_is_lost_into_heat():
    system = hanging(metered(ElasticRope), stiffness=2e3, width=0.01, damping=15.0)
    result = run(system, 1.5, q0={"j": 0.3, "z": 0.9})
    E = stored(result, "rope")
    assert result["rope.heat"][-1] > 1
    np.testing.assert_allclose(E, E[0], rtol=0, atol=1e-8)


def test_points_in_mechanisms_that_are_placed():
    outer = mbs.Mechanism("outer", gravity=(0, 0, -G))
    inner = weights(lambda path: RopeOverPulleys("rope", path, length="L"))
    inner.values["L"] = mbs.Parameter("L", 9.0)
    outer.connect(outer.world.at(0, 0, 1), Fixed("weld"), outer.add(inner, "in").base)
    result = run(asked(outer, guess={"in.z_left": 1.0}), 0.2)
    np.testing.assert_allclose(result["in.rope.tension"], 2 * 2 * 3 / 5 * G, rtol=1e-12)


def test_a_pulley_on_a_boom_that_is_locked():
    m = mbs.Mechanism("boom", gravity=(0, 0, -G))
    boom = m.add(Box("boom", length=2.0, mass=2.0))
    m.connect(m.world, Revolute("luff", axis="y"), boom.left)
    m.connect(boom.right, Revolute("head", axis="y"), m.add(PointMass("sheave", 1.0)))
    for name, x in (("left", -1.0), ("right", 3.0)):
        m.connect(m.world.at(x, 0, -2), Prismatic(f"z_{name}", axis="z"), m.add(PointMass(name, 1)))
    path = (m.components["left"], m.components["sheave"], m.components["right"])
    m.add(RopeOverPulleys("rope", path, length=9.0))
    m.lock({"luff": -0.5, "head": 0.0})
    system = asked(m)
    assert [c.name for c in system.coordinates] == ["z_left", "z_right"]
    left, right = np.array(system.configuration) - 2
    x, z = 2 * np.cos(0.5), 2 * np.sin(0.5)
    assert np.hypot(x + 1, z - left) + np.hypot(3 - x, z - right) == pytest.approx(9, abs=1e-12)


@pytest.mark.parametrize(
    ("path", "parts"),
    [
        (lambda m, b: (b,), ["rope: path is (PointMass", "two or more"]),
        (lambda m, b: b, ["rope: path is PointMass", "two or more"]),
        (lambda m, b: (b, 3.0), ["rope: path[1] is 3.0", "body.at"]),
    ],
)
def test_paths_that_are_refused(path, parts):
    m = mbs.Mechanism("m")
    body = m.add(PointMass("b", 1.0))
    refused(DescriptionError, *parts, by=lambda: RopeOverPulleys("rope", path(m, body), length=1))
    refused(
        DescriptionError,
        *parts,
        by=lambda: ElasticRope("rope", path(m, body), length=1, stiffness=1),
    )


def test_numbers_that_are_refused():
    point = mbs.Mechanism("m").world.at(1)
    refused(
        DescriptionError,
        "rope: length is 0 m",
        by=lambda: RopeOverPulleys("rope", (point, point), length=0),
    )
    refused(
        DescriptionError,
        "rope: stiffness is -1 N/m",
        by=lambda: ElasticRope("rope", (point, point), length=1, stiffness=-1),
    )


def test_a_rope_on_the_ground_is_refused():
    m = weights(lambda path: RopeOverPulleys("rope", path[1:3], length=1.0))
    refused(AssemblyError, "rope", "does not move", "does nothing", by=m.assemble)


def test_the_joint_of_a_bar_feels_the_rope():
    system = hanging(RopeOverPulleys)
    q = np.array(system.configuration)
    a, lam = mbs.models.direct_dynamics(system, coordinates="tree")(q, [0, 0], [0, 0])
    F = np.array(mbs.models.joint_wrenches(system, "tree")(q, [0, 0], a, [0, 0]))
    c, s = np.cos(q[0]), np.sin(q[0])
    pull = np.array([1.5 - c, 0, 2 + s])
    pull *= -float(lam) / np.linalg.norm(pull)
    centre = 0.5 * float(a[0]) * np.array([-s, 0, -c])
    force = 2 * centre - pull + np.array([0, 0, 2 * G])
    turned = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])  # of the bar about y
    np.testing.assert_allclose(F[:3, 0], turned.T @ force, atol=1e-12)
    np.testing.assert_allclose(F[[3, 4, 5], 0], 0, atol=1e-12)
