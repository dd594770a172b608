"""Geometry and kinematics of closed robots in their motorised joints, against plain numpy."""

import numpy as np
import pytest
from support.catalogue_systems import catalogue_system
from support.parallel_geometry import LEGS, rotation, three_spheres

import mbs
from mbs.errors import ModelError, NoClosedForm, SingularPosture, Unclosable
from mbs.models.geometry import terminal_frame

TOOLS = {
    "sr400": 6,
    "akr3000": 10,
    "five_bar": "tool",
    "delta": "tool",
    "stewart_platform": "centre",
}
AWAY = {"sr400": 0.4, "akr3000": 0.02, "five_bar": 0.3, "delta": 0.4, "stewart_platform": 0.08}
ROWS = {"five_bar": ["Vx", "Vy"], "delta": ["Vx", "Vy", "Vz"]}
CRANK, COUPLER, GROUND = 0.25, 0.35, 0.2


@pytest.fixture(scope="module")
def systems():
    return {name: catalogue_system(name) for name in TOOLS}


def numbers(function, *arguments):
    return np.array(function(*arguments))


def free_names(system):
    return [system.velocity_coordinates[k].name for k in system.chosen_coordinates]


def active_positions(system, seed):
    """Positions of the motorised joints near the assembled configuration; no wrist is stretched."""
    rng = np.random.default_rng(seed)
    names = [c.name for c in system.coordinates]
    q_a = np.array([system.configuration[names.index(name)] for name in free_names(system)])
    q_a += rng.uniform(-AWAY[system.name], AWAY[system.name], q_a.shape)
    for wrist in {"sr400": (3,), "akr3000": (4,)}.get(system.name, ()):
        q_a[wrist] += 0.8
    return q_a


def configuration(system, q_a):
    return mbs.loops.solve(system, dict(zip(free_names(system), q_a, strict=True)))


@pytest.mark.parametrize("name", TOOLS)
def test_terminal_frame(systems, name):
    assert terminal_frame(systems[name]) == TOOLS[name]


@pytest.mark.sweep
@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("name", TOOLS)
def test_direct_geometry_is_the_pose_after_closure(systems, name, seed):
    system = systems[name]
    q_a = active_positions(system, seed)
    q = configuration(system, q_a)
    T = numbers(mbs.models.direct_geometry(system), q_a)
    np.testing.assert_allclose(T, numbers(mbs.models.transform(system, TOOLS[name]), q), atol=1e-9)


def test_direct_geometry_of_the_delta_is_where_three_spheres_meet(systems):
    q_a = active_positions(systems["delta"], 7)
    around = 2 * np.pi / 3 * np.arange(3)
    out = 0.20 + 0.25 * np.cos(q_a) - 0.05
    elbows = np.column_stack([out * np.cos(around), out * np.sin(around), -0.25 * np.sin(q_a)])
    T = numbers(mbs.models.direct_geometry(systems["delta"]), q_a)
    np.testing.assert_allclose(T[:3, 3], three_spheres(elbows, 0.6), atol=1e-11)
    np.testing.assert_allclose(T[:3, :3], np.eye(3), atol=1e-11)


def test_direct_geometry_of_the_five_bar_is_where_two_circles_meet(systems):
    q_a = active_positions(systems["five_bar"], 8)
    elbows = CRANK * np.exp(1j * q_a) + np.array([0, GROUND])
    middle, half = elbows.mean(), (elbows[1] - elbows[0]) / 2
    top = middle + 1j * half / abs(half) * np.sqrt(COUPLER**2 - abs(half) ** 2)
    T = numbers(mbs.models.direct_geometry(systems["five_bar"]), q_a)
    np.testing.assert_allclose(T[:2, 3], [top.real, top.imag], atol=1e-12)


@pytest.mark.sweep
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("name", TOOLS)
def test_jacobian_is_the_slope_of_the_pose_along_closed_configurations(systems, name, seed):
    system, h = systems[name], 1e-5
    q_a = active_positions(system, seed)
    v_a = np.random.default_rng(seed).normal(size=q_a.shape)
    dgm = mbs.models.direct_geometry(system)
    ahead, behind = (numbers(dgm, q_a + s * h * v_a) for s in (1, -1))
    V = (ahead[:3, 3] - behind[:3, 3]) / (2 * h)
    spin = (ahead[:3, :3] @ behind[:3, :3].T - behind[:3, :3] @ ahead[:3, :3].T) / (4 * h)
    w = [spin[2, 1], spin[0, 2], spin[1, 0]]
    J = numbers(mbs.models.jacobian(system, TOOLS[name]), configuration(system, q_a))
    assert J.shape == (6, len(system.independent))
    np.testing.assert_allclose(J @ v_a, [*V, *w], atol=2e-7)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("name", TOOLS)
def test_determinant_and_inverse_are_those_of_the_square_part(systems, name, seed):
    system, frame, rows = systems[name], TOOLS[name], ROWS.get(name)
    q = configuration(system, active_positions(system, seed))
    numbered = range(6) if rows is None else range(len(rows))
    square = numbers(mbs.models.jacobian(system, frame), q)[list(numbered)]
    det = float(mbs.models.jacobian_determinant(system, frame, rows)(q))
    assert det == pytest.approx(np.linalg.det(square), rel=1e-9)
    found = mbs.models.singularities(system, frame, rows)
    product = float(found.constant) * np.prod(
        [float(factor.function(q)) ** factor.power for factor in found.factors]
    )
    assert product == pytest.approx(det, rel=1e-9)
    inverse = numbers(mbs.models.inverse_jacobian(system, frame, rows), q)
    np.testing.assert_allclose(inverse @ square, np.eye(len(square)), atol=1e-8)
    twist = np.arange(1.0, len(square) + 1)
    v = numbers(mbs.models.inverse_differential_kinematics(system, frame, rows), q, twist)
    np.testing.assert_allclose(square @ v.ravel(), twist, atol=1e-8)


def test_jacobian_of_the_delta_by_its_rods(systems):
    """Along each rod the platform is as fast as the elbow: r' V = r' (0.25 tip) dq."""
    system = systems["delta"]
    q_a = active_positions(system, 4)
    around = 2 * np.pi / 3 * np.arange(3)
    c, s, out = np.cos(q_a), np.sin(q_a), 0.20 + 0.25 * np.cos(q_a) - 0.05
    elbows = np.column_stack([out * np.cos(around), out * np.sin(around), -0.25 * s])
    tips = 0.25 * np.column_stack([-s * np.cos(around), -s * np.sin(around), -c])
    rods = three_spheres(elbows, 0.6) - elbows
    expected = np.linalg.solve(rods, np.diag(np.sum(rods * tips, axis=1)))
    J = numbers(mbs.models.jacobian(system, "tool"), configuration(system, q_a))
    np.testing.assert_allclose(J, np.vstack([expected, np.zeros((3, 3))]), atol=1e-11)


def test_inverse_jacobian_of_the_stewart_platform_by_its_legs(systems):
    """A leg lengthens by [u; b x u] . [V; w], u along it and b from the centre to its top."""
    system, (low, high) = systems["stewart_platform"], LEGS
    T = np.eye(4)
    T[:3, 3], T[:3, :3] = (0.03, -0.05, 0.75), rotation([0.1, -0.2, 0.15])
    arms = (high - [0, 0, 0.7]) @ T[:3, :3].T
    legs = T[:3, 3] + arms - low
    u = legs / np.linalg.norm(legs, axis=1)[:, None]
    q = mbs.loops.solve_pose(system, "centre", T)
    found = numbers(mbs.models.inverse_jacobian(system, "centre"), q)
    np.testing.assert_allclose(found, np.hstack([u, np.cross(arms, u)]), atol=1e-10)


def five_bar_at(crank, tool, elbow):
    """q of the five-bar: its first crank's angle, the tool, and the side of the second elbow."""
    first = CRANK * np.exp(1j * crank)
    way = tool - GROUND
    off = np.arccos((abs(way) ** 2 + CRANK**2 - COUPLER**2) / (2 * abs(way) * CRANK))
    other = np.angle(way) + elbow * off
    second = GROUND + CRANK * np.exp(1j * other)
    return np.array([crank, np.angle(tool - first) - crank, other, np.angle(tool - second) - other])


@pytest.mark.parametrize(
    ("bend", "crank", "elbow"), [(0.0, 1.2, 1), (0.0, 1.2, -1), (np.pi, 4.4, -1)]
)
def test_serial_singularity_of_the_five_bar(systems, bend, crank, elbow):
    """Crank and coupler of a leg in line: the tool cannot move along them, and det is zero."""
    system = systems["five_bar"]
    along = np.exp(1j * crank)
    q = five_bar_at(crank, (CRANK + COUPLER * np.cos(bend)) * along, elbow)
    q[1] = bend
    assert np.abs(numbers(mbs.loops.closure_residual(system), q)).max() < 1e-12
    assert mbs.loops.configuration_report(system, q).is_led
    det = mbs.models.jacobian_determinant(system, "tool", ["Vx", "Vy"])
    assert abs(float(det(q))) < 1e-16
    J = numbers(mbs.models.jacobian(system, "tool"), q)[:2]
    assert np.abs(J).max() > 0.1
    np.testing.assert_allclose([along.real, along.imag] @ J, 0, atol=1e-15)
    q[1] += 1e-6
    beside = mbs.loops.solve(system, {"q1": q[0], "q2": q[1]}, guess={"q3": q[2], "q4": q[3]})
    square = numbers(mbs.models.jacobian(system, "tool"), beside)[:2]
    assert float(det(beside)) == pytest.approx(np.linalg.det(square), rel=1e-6)
    assert abs(float(det(beside))) > 1e-9


def test_inverse_is_refused_where_crank_and_coupler_are_in_line(systems):
    system = systems["five_bar"]
    q = five_bar_at(1.2, (CRANK + COUPLER) * np.exp(1.2j), 1)
    q[1] = 0.0
    with pytest.raises(ModelError, match="or the configuration is singular"):
        mbs.models.inverse_jacobian(system, "tool", ["Vx", "Vy"])(q)


def test_parallel_singularity_of_the_five_bar(systems):
    """Both couplers in line: with the motors held the tool still moves across them."""
    system = systems["five_bar"]
    half = np.arccos((COUPLER - GROUND / 2) / CRANK)
    q = np.array([np.pi - half, half - np.pi, half, np.pi - half])
    assert np.abs(numbers(mbs.loops.closure_residual(system), q)).max() < 1e-12
    assert not mbs.loops.configuration_report(system, q).is_led
    det = mbs.models.jacobian_determinant(system, "tool", ["Vx", "Vy"])
    for model in (det, mbs.models.jacobian(system, "tool")):
        with pytest.raises(SingularPosture, match="q1, q3 cannot lead"):
            model(q)
    passive = numbers(mbs.loops.closure_jacobian(system), q)[:, [1, 3]]
    _, sizes, ways = np.linalg.svd(passive)
    assert sizes[1] < 1e-12
    tree = numbers(mbs.models.jacobian(system, "tool", coordinates="tree"), q)
    V = tree[:3, [1, 3]] @ ways[1]
    assert abs(V[1]) > 0.1
    np.testing.assert_allclose(V[[0, 2]], 0, atol=1e-12)


def test_wrist_in_line_is_singular(systems):
    for name, wrist, frame in (("sr400", "q5", 6), ("akr3000", "q9", 10)):
        system = systems[name]
        q = mbs.loops.solve(system, {wrist: 0.0, "q1": 0.3})
        assert float(mbs.models.jacobian_determinant(system, frame)(q)) == pytest.approx(0)
        factors = [factor.text for factor in mbs.models.singularities(system, frame).factors]
        assert f"S{wrist[1:]}" in factors


@pytest.mark.parametrize("name", ["five_bar", "delta"])
def test_rows_must_be_named_for_fewer_than_six_motors(systems, name):
    system = systems[name]
    with pytest.raises(
        ModelError, match=rf"6 rows and {len(system.independent)} columns; name as many"
    ):
        mbs.models.jacobian_determinant(system, "tool")


def test_link_of_the_loop_cannot_take_every_pose(systems):
    with pytest.raises(ModelError, match="of 8 are singular in every configuration"):
        mbs.models.inverse_jacobian(systems["sr400"], 8)
    assert mbs.models.singularities(systems["sr400"], 8).constant == "0"


def test_out_of_reach_is_refused(systems):
    with pytest.raises(Unclosable, match=r"leg1 = 2, .* whose branch ends near leg1 = "):
        mbs.models.direct_geometry(systems["stewart_platform"])([2, -0.5, 0, 0, 0, 0])
    with pytest.raises(
        Unclosable, match=r"no configuration on this branch .* q6 can be .* to 0\.2 m"
    ):
        mbs.models.direct_geometry(systems["akr3000"])([0, -0.08, 0.5, 0, 0, 0])


def test_platform_that_turns_freely_has_no_direct_geometry():
    from mbs import Mechanism
    from mbs.components import (
        Body,
        Revolute,
        Rod,
        Spherical,
    )

    m = Mechanism("hung", guess={"j": 0.5})
    arm, plate = (m.add(Body(n, mass=1, inertia=(1, 1, 1))) for n in ("arm", "plate"))
    m.connect(m.world, Revolute("j", actuated=True), arm)
    m.connect(arm.at(1.0), Spherical("ball"), plate)
    m.connect(m.world.at(1.0, 1.0), Rod("rod", length=0.8), plate.at(0.5))
    with pytest.raises(NoClosedForm, match="rotates freely"):
        mbs.models.direct_geometry(m.assemble(), "plate")
