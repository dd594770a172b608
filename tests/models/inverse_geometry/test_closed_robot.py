"""Whole configurations of trees and closed robots: the one that made the pose is among them."""

import numpy as np
import pytest
from support.catalogue_systems import catalogue_system
from support.closed_mechanisms import closed_chain
from support.configurations import same

import mbs
from mbs import Mechanism
from mbs.closed_forms.arm_search import search
from mbs.components import Body, Revolute, Spherical
from mbs.loops.closing import Closing
from mbs.loops.mode_search import closed_configurations
from mbs.loops.plan import complete
from mbs.models.inverse_geometry.chain import frame_chain
from mbs.models.inverse_geometry.whole_robot import close, configurations_at, why_searched

NONE = np.zeros(0)
FRAMES = {"sr400": 6, "akr3000": 10, "five_bar": "tool", "differential_wrist": "tool"}
AWAY = {"sr400": 0.5, "akr3000": 0.03, "five_bar": 0.3, "differential_wrist": 0.5}


@pytest.fixture(scope="module")
def systems():
    return {n: mbs.load(n).assemble() for n in (*FRAMES, "delta", "stewart_platform")}


def drawn(system, away, seed):
    """A closed configuration whose independent joints stand elsewhere."""
    rng = np.random.default_rng(seed)
    held = complete(system, ()).undetermined
    q = np.array(system.configuration)
    q[list(held)] += rng.uniform(-away, away, len(held))
    closed = Closing(system, NONE, held).nearest(q)
    assert closed.is_closed
    return closed.q


def pose(system, frame, q):
    return np.array(mbs.models.transform(system, frame)(q))


def solutions(system, frame, T):
    way = frame_chain(system, frame)
    return close(system, way, search(way.arm(NONE), T), NONE)


def assert_solved(system, frame, T, found):
    closure = mbs.loops.closure_residual(system)
    for configuration in found:
        assert np.abs(np.array(closure(configuration.q))).max(initial=0.0) < 1e-12
        assert configuration.residual < 1e-12
        np.testing.assert_allclose(pose(system, frame, configuration.q), T, atol=1e-12)
    for k, one in enumerate(found):
        assert not any(same(system, one.q, other.q, 1e-6) for other in found[:k])


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("name", FRAMES)
def test_the_configuration_that_made_the_pose_is_found(systems, name, seed):
    system, frame = systems[name], FRAMES[name]
    q = drawn(system, AWAY[name], seed)
    T = pose(system, frame, q)
    found = solutions(system, frame, T)
    assert_solved(system, frame, T, found)
    assert any(same(system, configuration.q, q, 1e-7) for configuration in found)
    assert why_searched(system, frame_chain(system, frame)) is None


@pytest.mark.parametrize("way", ["parallel", "crossed"])
@pytest.mark.parametrize("seed", range(5))
def test_both_assemblies_of_the_sr400(systems, way, seed):
    """The motors far from the assembled configuration, the loop a parallelogram or crossed."""
    system = systems["sr400"]
    rng = np.random.default_rng(seed)
    names = [system.velocity_coordinates[k].name for k in system.chosen_coordinates]
    motors = dict(zip(names, rng.uniform(-2.5, 2.5, 6), strict=True))
    q = mbs.loops.solve(system, motors, branch=f"q9:{way}")
    T = pose(system, 6, q)
    found = solutions(system, 6, T)
    assert_solved(system, 6, T, found)
    assert any(same(system, configuration.q, q, 1e-7) for configuration in found)
    labels = [configuration.branch for configuration in found]
    assert labels.count("q8:parallel") == labels.count("q8:crossed") == len(found) / 2


@pytest.mark.parametrize(("name", "count"), [("sr400", 16), ("akr3000", 32)])
def test_as_many_as_a_search_in_all_joints_finds(systems, name, count):
    system, frame = systems[name], FRAMES[name]
    q = drawn(system, AWAY[name], 7)
    T = pose(system, frame, q)
    found = solutions(system, frame, T)
    modes = mbs.loops.working_modes(system, frame, T, tries=150)
    assert len(found) == count >= len(modes) >= count * 0.7
    for mode in modes:
        assert any(same(system, configuration.q, mode.q, 1e-6) for configuration in found)


@pytest.mark.parametrize("seed", range(3))
def test_delta_has_eight_configurations(systems, seed):
    system = systems["delta"]
    q = drawn(system, 0.3, seed)
    T = pose(system, "tool", q)
    found = configurations_at(system, "tool", T, NONE)
    assert_solved(system, "tool", T, found)
    assert why_searched(system, "tool") is None
    assert len(found) == len(mbs.loops.working_modes(system, "tool", T, tries=100)) == 8
    assert len({configuration.branch for configuration in found}) == 8
    assert any(same(system, configuration.q, q, 1e-7) for configuration in found)
    T[:3, :3] = T[:3, :3] @ np.diag([-1, -1, 1])
    assert configurations_at(system, "tool", T, NONE) == []


@pytest.mark.parametrize("seed", range(4))
def test_an_arm_with_a_ball_for_a_wrist(seed):
    m = Mechanism("ball_wrist")
    a, b, c, d = (m.add(Body(n, mass=1, inertia=(0.1, 0.1, 0.1))) for n in "abcd")
    m.connect(m.world, Revolute("j1", axis="z"), a)
    m.connect(a.at(0.02, 0, 0.3), Revolute("j2", axis="y"), b)
    m.connect(b.at(0.5), Revolute("j3", axis="y"), c)
    m.connect(c.at(0.4, 0.05), Spherical("wrist"), d)
    m.add_frame("tool", d.at(0.1))
    system = m.assemble()
    q = np.random.default_rng(seed).uniform(-1.2, 1.2, system.nq)
    q[3:] /= np.linalg.norm(q[3:])
    T = pose(system, "tool", q)
    found = configurations_at(system, "tool", T, NONE)
    assert_solved(system, "tool", T, found)
    modes = mbs.loops.working_modes(system, "tool", T, tries=100)
    assert len(found) == len(modes)
    assert any(same(system, configuration.q, q, 1e-8) for configuration in found)


def test_stewart_platform_has_four_ways_for_every_leg(systems):
    """Each leg forwards or backwards, its universal joint turned round or not; nearest first."""
    system = systems["stewart_platform"]
    q = drawn(system, 0.05, 1)
    T = pose(system, "centre", q)
    found = configurations_at(system, "centre", T, NONE, q)
    assert len(found) == 4**6
    assert same(system, found[0].q, q, 1e-9)
    assert max(configuration.residual for configuration in found) < 1e-12
    assert_solved(system, "centre", T, found[:6])


def test_a_tree_keeps_the_other_arm_where_it_is():
    system = catalogue_system("two_branch_tree")
    rng = np.random.default_rng(3)
    q = rng.uniform(-1, 1, 7)
    for frame, other in ((4, [4, 5, 6]), (7, [1, 2, 3])):
        T = pose(system, frame, q)
        way = frame_chain(system, frame)
        configurations = search(way.arm(NONE), T)
        found = close(system, way, configurations, NONE, q)
        assert len(found) == len(configurations) >= 1
        assert any(same(system, configuration.q, q, 1e-9) for configuration in found)
        for configuration in found:
            np.testing.assert_array_equal(configuration.q[other], q[other])
            np.testing.assert_allclose(pose(system, frame, configuration.q), T, atol=1e-12)
        at_rest = close(system, way, configurations, NONE)
        np.testing.assert_array_equal(at_rest[0].q[other], np.array(system.configuration)[other])


def test_joints_that_nothing_determines_stay(systems):
    system = systems["five_bar"]
    q = drawn(system, 0.3, 2)
    way = frame_chain(system, "link1")
    found = close(system, way, q[[0]], NONE, q)
    assert len(found) == 2
    assert all(configuration.q[0] == q[0] and configuration.q[2] == q[2] for configuration in found)
    assert any(same(system, configuration.q, q, 1e-9) for configuration in found)


def test_locked_joints_are_known():
    system = catalogue_system("sr400")
    q = drawn(system, 0.4, 4)
    way = frame_chain(system, 6, {"q4": float(q[3])})
    found = close(system, way, q[[0, 1, 2, 4, 5]], NONE)
    assert len(found) == 2
    assert any(same(system, configuration.q, q, 1e-9) for configuration in found)


def test_a_configuration_of_the_chain_that_leaves_the_loop_open(systems):
    assert (
        close(systems["five_bar"], frame_chain(systems["five_bar"], "tool"), [[3.0, 0.0]], NONE)
        == []
    )
    nothing = np.zeros((0, 2))
    assert close(systems["five_bar"], frame_chain(systems["five_bar"], "tool"), nothing, NONE) == []


def test_chain_joints_that_depend_on_each_other():
    """A point of the coupler of a four-bar: its two joints fit the loop, or there is no
    configuration."""
    system = catalogue_system("four_bar")
    q = drawn(system, 0.3, 1)
    frame = next(k + 1 for k in range(len(system.tree.links)) if len(system.tree.path(k)) == 2)
    way = frame_chain(system, frame)
    found = solutions(system, frame, pose(system, frame, q))
    assert [same(system, configuration.q, q, 1e-8) for configuration in found] == [True]
    assert close(system, way, q[list(way.indices)] + 0.1, NONE) == []


@pytest.mark.parametrize(("closing", "seed"), [("spherical", 1), ("spherical", 2), ("revolute", 1)])
def test_spatial_loops_without_closed_form_are_searched(seed, closing):
    mechanism, guess = closed_chain(seed, closing)
    system = mechanism.assemble(guess=guess)
    frame = "body2"
    way = frame_chain(system, frame)
    q = drawn(system, 0.1, seed)
    T = pose(system, frame, q)
    found = solutions(system, frame, T)
    assert_solved(system, frame, T, found[:8])
    reason = why_searched(system, way)
    if reason is not None:
        assert "no closed form known here" in reason
    held = complete(system, way.indices).undetermined
    rest = close(system, way, q[list(way.indices)], NONE, q)
    assert any(same(system, configuration.q, q, 1e-6) for configuration in rest)
    for configuration in rest:
        np.testing.assert_allclose(configuration.q[list(held)], q[list(held)], atol=1e-12)


def test_search_with_positions_held_finds_what_closed_forms_find(systems):
    system = systems["akr3000"]
    q = drawn(system, 0.03, 3)
    places = frame_chain(system, 10).indices
    found = list(closed_configurations(Closing(system, NONE, places), q))
    exact = close(system, frame_chain(system, 10), q[list(places)], NONE)
    assert len(found) == len(exact) == 4
    for configuration in exact:
        assert any(same(system, configuration.q, other, 1e-7) for other in found)


def test_a_ball_that_turns_freely_stays():
    m = Mechanism("loose")
    a, b, c, d = (m.add(Body(n, mass=1, inertia=(0.1, 0.1, 0.1))) for n in "abcd")
    m.connect(m.world, Revolute("j1", actuated=True), a)
    m.connect(a.at(0.5), Revolute("j2"), b)
    m.connect(m.world.at(1), Revolute("j3"), d)
    m.connect(d.at(0.6), Revolute("j4"), b.at(0.9))
    m.connect(b.at(0.3), Spherical("loose", actuated=False), c)
    system = m.assemble(guess={"j1": 1.2, "j2": -1.0, "j3": 1.5})
    places = [k for k, c in enumerate(system.coordinates) if c.name.startswith("loose")]
    seed = np.array(system.configuration)
    seed[places] = [0.5, -0.5, 0.5, 0.5]
    found = close(system, frame_chain(system, "a"), [[1.1]], NONE, seed)
    assert len(found) == 2
    for configuration in found:
        np.testing.assert_array_equal(configuration.q[places], seed[places])
        assert configuration.q[0] == 1.1
