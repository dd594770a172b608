"""Inverse geometry of closed robots by iteration, against geometry done by hand."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from support.catalogue_systems import catalogue_system
from support.configurations import same
from support.parallel_geometry import LEGS, rotation
from support.sweeps import examples

import mbs
from mbs import Mechanism
from mbs.components import Body, Revolute
from mbs.errors import LoopError, ModelError, Unclosable
from mbs.loops.pose import goal

COMMON = dict(deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
TOOLS = {"sr400": 6, "akr3000": 10, "delta": "tool", "stewart_platform": "centre"}
AWAY = {"sr400": 0.4, "akr3000": 0.02, "delta": 0.4, "stewart_platform": 0.08}
CRANK, COUPLER, GROUND = 0.25, 0.35, 0.2


@pytest.fixture(scope="module")
def systems():
    return {name: catalogue_system(name) for name in (*TOOLS, "five_bar")}


def moved(system, away, seed):
    """A closed configuration whose independent joints stand elsewhere."""
    rng = np.random.default_rng(seed)
    names = [c.name for c in system.coordinates]
    free = [system.velocity_coordinates[k].name for k in system.chosen_coordinates]
    return mbs.loops.solve(
        system, {n: system.configuration[names.index(n)] + rng.uniform(-away, away) for n in free}
    )


def point(x, y, z=0.0):
    T = np.eye(4)
    T[:3, 3] = x, y, z
    return T


def is_closed(system, q):
    return np.abs(np.array(mbs.loops.closure_residual(system)(q))).max() < 1e-10


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("name", TOOLS)
def test_pose_is_reproduced(systems, name, seed):
    system, frame = systems[name], TOOLS[name]
    pose = mbs.models.transform(system, frame)
    T = np.array(pose(moved(system, AWAY[name], seed)))
    q = mbs.loops.solve_pose(system, frame, T)
    np.testing.assert_allclose(np.array(pose(q)), T, atol=1e-10)
    assert is_closed(system, q)


@settings(max_examples=examples(15), **COMMON)
@given(seed=st.integers(0, 10**6))
def test_stewart_legs_are_as_long_as_the_plain_formula_says(systems, seed):
    system = systems["stewart_platform"]
    rng = np.random.default_rng(seed)
    T = point(*rng.uniform(-0.1, 0.1, 2), 0.7 + rng.uniform(-0.1, 0.1))
    T[:3, :3] = rotation(rng.uniform(-0.3, 0.3, 3))
    q = mbs.loops.solve_pose(system, "centre", T)
    low, high = LEGS
    tops = T[:3, 3] + (high - [0, 0, 0.7]) @ T[:3, :3].T
    longer = np.linalg.norm(tops - low, axis=1) - np.linalg.norm(high - low, axis=1)
    names = [c.name for c in system.coordinates]
    found = [q[names.index(f"leg{k + 1}")] for k in range(6)]
    np.testing.assert_allclose(found, longer, atol=1e-11)


def dyad(x, y):
    """Both angles of a crank at the origin whose coupler ends in (x, y)."""
    r = np.hypot(x, y)
    off = np.arccos((r**2 + CRANK**2 - COUPLER**2) / (2 * r * CRANK))
    return np.arctan2(y, x) + off, np.arctan2(y, x) - off


@pytest.mark.parametrize("at", [(0.1, 0.4), (0.25, 0.3), (-0.1, -0.35)])
def test_five_bar_has_four_working_modes(systems, at):
    system = systems["five_bar"]
    modes = mbs.loops.working_modes(system, "tool", point(*at), rows=["x", "y"])
    expected = {
        (round(np.angle(np.exp(1j * a)), 8), round(np.angle(np.exp(1j * b)), 8))
        for a in dyad(*at)
        for b in dyad(at[0] - GROUND, at[1])
    }
    assert {(round(mode.q[0], 8), round(mode.q[2], 8)) for mode in modes} == expected
    assert len(modes) == 4
    assert all(mode.residual < 1e-10 and mode.hits > 1 for mode in modes)


def test_guess_chooses_the_working_mode(systems):
    system = systems["five_bar"]
    for mode in mbs.loops.working_modes(system, "tool", point(0.1, 0.4), rows=["x", "y"]):
        names = [c.name for c in system.coordinates]
        guess = dict(zip(names, np.add(mode.q, 0.02), strict=True))
        q = mbs.loops.solve_pose(system, "tool", point(0.1, 0.4), rows=["x", "y"], guess=guess)
        np.testing.assert_allclose(q, mode.q, atol=1e-9)


@pytest.mark.parametrize("place", [(0.05, 0.02, -0.45), (-0.1, 0.08, -0.5)])
def test_delta_has_eight_working_modes(systems, place):
    """Each arm on its own: u cos q + w sin q = c from the length of the rods."""
    system = systems["delta"]
    modes = mbs.loops.working_modes(system, "tool", point(*place))
    ways = []
    for k in range(3):
        around = 2 * np.pi * k / 3
        out = np.array([np.cos(around), np.sin(around), 0])
        side = np.array([-np.sin(around), np.cos(around), 0])
        x, y, z = out @ place + 0.05 - 0.2, side @ place, place[2]
        c = (x**2 + y**2 + z**2 + 0.25**2 - 0.6**2) / 0.5
        ways.append([np.arctan2(-z, x) + s * np.arccos(c / np.hypot(x, z)) for s in (1, -1)])
    found = {tuple(np.round(mode.q[7:], 7)) for mode in modes}
    grid = np.array(np.meshgrid(*ways, indexing="ij")).reshape(3, 8).T
    wrapped = np.remainder(grid + np.pi, 2 * np.pi) - np.pi
    assert found == {tuple(np.round(row, 7)) for row in wrapped}
    assert len(modes) == 8


def test_sr400_has_eight_working_modes_as_a_parallelogram_and_eight_crossed(systems):
    """Shoulder, elbow and wrist, two ways each; the loop closes in two ways for each of them."""
    system = systems["sr400"]
    q = moved(system, 0.4, 5)
    T = mbs.models.transform(system, 6)(q)
    modes = mbs.loops.working_modes(system, 6, T)
    arms = {tuple(np.round(mode.q[:6], 6)) for mode in modes}
    turns = [mode.q[2] - (np.pi / 2 - mode.q[1] + mode.q[6]) for mode in modes]
    parallel = [abs(np.angle(np.exp(1j * turn))) < 1e-8 for turn in turns]
    assert (len(modes), len(arms), sum(parallel)) == (16, 8, 8)
    assert any(same(system, mode.q, q, 1e-8) for mode in modes)
    for mode in modes:
        assert is_closed(system, mode.q)


def test_akr3000_has_eight_arms_with_four_signs_of_cylinders(systems):
    """Trunk, elbow and wrist, two ways each; either cylinder may be turned round."""
    system = systems["akr3000"]
    q = mbs.loops.solve(system, {"q1": 0.1, "q5": -0.09, "q8": 0.4, "q9": 0.7, "q10": -0.2})
    T = mbs.models.transform(system, 10)(q)
    modes = mbs.loops.working_modes(system, 10, T)
    arms = {tuple(np.round(np.take(mode.q, (0, 1, 6, 7, 8, 9)), 6)) for mode in modes}
    lengths = np.array([np.take(mode.q, (4, 5)) for mode in modes]) + 0.3
    assert (len(modes), len(arms)) == (32, 8)
    assert int(np.all(lengths > 0, axis=1).sum()) == 8
    assert any(same(system, mode.q, q, 1e-8) for mode in modes)


def test_stewart_platform_has_one_working_mode_nearby(systems):
    system = systems["stewart_platform"]
    T = mbs.models.transform(system, "centre")(moved(system, 0.05, 1))
    modes = mbs.loops.working_modes(system, "centre", T, reach=0.2, tries=30)
    assert len(modes) == 1
    assert modes[0].hits == 30


@pytest.mark.parametrize("beyond", [0.05, 0.5])
def test_out_of_reach_says_by_how_much(systems, beyond):
    """Above the highest point of the line of symmetry, where both legs are stretched."""
    top = np.sqrt((CRANK + COUPLER) ** 2 - (GROUND / 2) ** 2)
    with pytest.raises(Unclosable, match=rf"leaves it {beyond:.4g}\d* m away; give another pose"):
        mbs.loops.solve_pose(systems["five_bar"], "tool", point(0.1, top + beyond), rows=["x", "y"])
    assert not mbs.loops.working_modes(
        systems["five_bar"], "tool", point(0.1, top + beyond), rows=["x", "y"], tries=20
    )


def test_platform_that_cannot_turn_says_how_far_it_is_turned(systems):
    T = point(0.05, 0.0, -0.45)
    T[:3, :3] = rotation([0, 0, 0.3])
    near = mbs.loops.solve_pose(systems["delta"], "tool", T, rows=["x", "y", "z"])
    assert is_closed(systems["delta"], near)
    with pytest.raises(Unclosable, match=r"m away and rotated by \d.*; name the rows"):
        mbs.loops.solve_pose(systems["five_bar"], "tool", point(0.1, 0.4))


def test_axis_alone_leaves_the_turn_about_it_free(systems):
    system = systems["akr3000"]
    T = np.array(mbs.models.transform(system, 10)(moved(system, 0.02, 3)))
    turned = T.copy()
    turned[:3, :3] = T[:3, :3] @ rotation([0, 0, 1.0])
    rows = ["x", "y", "z", "axis"]
    q = mbs.loops.solve_pose(system, 10, turned, rows=rows)
    found = np.array(mbs.models.transform(system, 10)(q))
    np.testing.assert_allclose(found[:3, 2:], T[:3, 2:], atol=1e-10)
    with pytest.raises(LoopError, match=r"q10.* can move while frame 10 stays at this pose"):
        mbs.loops.working_modes(system, 10, turned, rows=rows, tries=5)


def test_symbols_in_lengths():
    m = Mechanism("arm", parameters={"L": 0.5})
    a, b = (m.add(Body(n, mass=1)) for n in "ab")
    m.connect(m.world, Revolute("j1"), a)
    m.connect(a.at("L"), Revolute("j2"), b)
    m.add_frame("tip", b.at(0.3))
    system = m.assemble()
    T = point(0.6, 0.5)
    q = mbs.loops.solve_pose(system, "tip", T, rows=["x", "y"], parameters={"L": 0.7})
    tip = 0.7 * np.exp(1j * q[0]) + 0.3 * np.exp(1j * (q[0] + q[1]))
    assert tip == pytest.approx(0.6 + 0.5j, abs=1e-11)
    modes = mbs.loops.working_modes(system, "tip", T, rows=["x", "y"], parameters={"L": 0.7})
    assert len(modes) == 2
    with pytest.raises(Unclosable, match=r"frame 'tip' .* leaves it 1\.95 m away"):
        mbs.loops.solve_pose(system, "tip", point(2.75, 0), rows=["x", "y"])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"frame": "tol"}, r"no frame 'tol'; did you mean 'tool'"),
        ({"T": np.eye(3)}, r"T is .*; give a pose, \(4, 4\)"),
        ({"T": 2 * np.eye(4)}, r"give a pose, \(4, 4\) with an orthonormal"),
        ({"T": np.full((4, 4), np.nan)}, r"give a pose"),
        ({"T": "here"}, r"T is 'here'; give a pose"),
        ({"rows": ["x", "why"]}, r"no row 'why' of a pose; .*use one of x, y"),
        ({"rows": "xy"}, r"no row 'xy' of a pose"),
        ({"rows": 3}, r"no row 3 of a pose"),
        ({"rows": [["x"]]}, r"no row \['x'\] of a pose"),
        ({"rows": []}, r"no rows were named; give some of x, y, z"),
        ({"guess": {"q9": 1.0}}, r"no coordinate 'q9'"),
        ({"reach": 0.0}, r"reach is 0.0 and tries 500; give a reach above zero"),
        ({"reach": "far"}, r"reach is 'far'"),
        ({"tries": 0}, r"tries 0"),
        ({"tries": 9.5}, r"tries 9.5"),
    ],
)
def test_refusals(systems, change, message):
    given = {"frame": "tool", "T": point(0.1, 0.4), "rows": ["x", "y"], **change}
    frame, T = given.pop("frame"), given.pop("T")
    with pytest.raises(ModelError, match=message):
        mbs.loops.working_modes(systems["five_bar"], frame, T, **given)


@pytest.mark.parametrize("rows", [None, ["x", "y", "z", "axis"]])
def test_how_far_a_frame_is_away(systems, rows):
    system, frame = systems["sr400"], TOOLS["sr400"]
    q = np.array(system.configuration)
    T = np.array(mbs.models.transform(system, frame)(q))
    # 0.5 m away, and turned by 0.3 rad about its own x axis
    c, s = np.cos(0.3), np.sin(0.3)
    turn = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    T[:3, :3], T[:3, 3] = T[:3, :3] @ turn, T[:3, 3] + [0.3, 0, -0.4]
    gap = goal(system, frame, T, rows, None).gap(q)
    assert gap == pytest.approx((0.5, 0.3), rel=1e-9)
