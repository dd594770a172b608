"""What the docstrings of the catalogue say, and figures found by hand from the sketches."""

from math import cos, pi, radians, sin

import numpy as np
import pytest

import mbs
from mbs.robots import catalogue

MOBILITY = {
    "puma560": 6,
    "stanford": 6,
    "rx90": 6,
    "tx90": 6,
    "kr6": 6,
    "irb120": 6,
    "ur5": 6,
    "crx10": 6,
    "panda": 7,
    "youbot": 5,
    "manseur_doty": 6,
    "gantry": 6,
    "scara": 4,
    "planar_2r": 2,
    "cart_pole": 2,
    "two_branch_tree": 7,
    "sr400": 6,
    "five_bar": 2,
    "four_bar": 1,
    "slider_crank": 1,
    "single_cylinder_engine": 1,
    "modelica_four_bar": 1,
    "modelica_rod_four_bar": 1,
    "simple_pendulum": 1,
    "n_four_bar": 1,
    "andrews_squeezer": 1,
    "bricard": 1,
    "flyball_governor": 4,
    "akr3000": 6,
    "delta": 3,
    "stewart_platform": 6,
    "differential_wrist": 2,
    "whipple_bicycle": 3,
}
OPEN = {
    "puma560",
    "stanford",
    "rx90",
    "tx90",
    "kr6",
    "irb120",
    "ur5",
    "crx10",
    "panda",
    "youbot",
    "manseur_doty",
    "gantry",
    "scara",
    "planar_2r",
    "cart_pole",
    "two_branch_tree",
    "simple_pendulum",
    "flyball_governor",
}


def assembled(name):
    return catalogue()[name]().assemble()


def place(system, link, q):
    """(4, 4) of the frame of a link, seen from the base."""
    return np.array(mbs.models.transform(system, link)(q))


def turn(T):
    """Angle about z."""
    return np.arctan2(T[1, 0], T[0, 0])


@pytest.mark.sweep
@pytest.mark.parametrize("name", MOBILITY)
def test_mobility(name):
    system = assembled(name)
    assert len(system.independent) == MOBILITY[name]
    assert system.is_closed == (name not in OPEN)


def test_puma560_at_zero():
    """Shoulder 0.2435 - 0.0934 aside, upper arm along x, forearm upright 0.0203 behind its end."""
    T = place(assembled("puma560"), 6, np.zeros(6))
    np.testing.assert_allclose(T[:3, 3], [0.4318 - 0.0203, 0.2435 - 0.0934, 0.4331], atol=1e-12)
    np.testing.assert_allclose(T[:3, :3], np.eye(3), atol=1e-12)


def test_puma560_limits():
    rows = assembled("puma560").coordinates
    assert rows[2].limits == pytest.approx((radians(-45), radians(225)))


def test_rx90_at_zero_and_stretched_up():
    """At zero the upper arm lies along x and the forearm stands on its end; q2, q3 lift both."""
    system = assembled("rx90")
    T = place(system, 6, np.zeros(6))
    np.testing.assert_allclose(T[:3, 3], [0.45, 0, 0.45], atol=1e-12)
    T = place(system, 6, [0, pi / 2, -pi / 2, 0, 0, 0])
    np.testing.assert_allclose(T[:3, 3], [0, 0, 0.9], atol=1e-12)


def test_scara_is_two_bars_in_the_plane_and_a_lift():
    a, b, c, lift = 0.3, 0.5, -0.2, -0.1
    T = place(assembled("scara"), 4, [a, b, c, lift])
    x = 0.425 * cos(a) + 0.375 * cos(a + b)
    y = 0.425 * sin(a) + 0.375 * sin(a + b)
    np.testing.assert_allclose(T[:3, 3], [x, y, lift], atol=1e-12)
    assert turn(T) == pytest.approx(a + b + c)


@pytest.mark.parametrize(
    ("q", "wrist"),
    [
        ((0, 0, 0.5), (0, 0.154, 0.412 + 0.5)),  # the boom upright, beside the trunk
        ((pi / 2, 0, 0.5), (-0.154, 0, 0.412 + 0.5)),  # the trunk turned a quarter
        ((0, pi / 2, 0.5), (0.5, 0.154, 0.412)),  # the boom along x
        ((pi / 2, pi / 2, 1.0), (-0.154, 1.0, 0.412)),
    ],
)
def test_stanford_wrist(q, wrist):
    system = assembled("stanford")
    T = np.array(mbs.models.direct_geometry(system)([*q, 0, 0, 0]))
    np.testing.assert_allclose(T[:3, 3], wrist, atol=1e-12)
    later = place(system, 6, [*q, 0.4, -0.7, 1.1])
    np.testing.assert_allclose(later[:3, 3], wrist, atol=1e-12)


def test_planar_2r_hangs_along_gravity():
    system = assembled("planar_2r")
    np.testing.assert_allclose(
        place(system, 2, [0.4, 0.3])[:3, 3], [cos(0.4), sin(0.4), 0], atol=1e-12
    )
    gravity = mbs.models.gravity_effort(system)([0, 0])
    np.testing.assert_allclose(np.array(gravity).ravel(), [9.81 * (0.5 + 1.5), 9.81 * 0.5])


def test_cart_pole_tips_towards_positive_q1():
    system = assembled("cart_pole")
    T = place(system, 2, [0.7, 0.1])
    np.testing.assert_allclose(T[:3, 3], [0.7, 0, 0], atol=1e-12)
    np.testing.assert_allclose(T[:3, 0], [sin(0.1), 0, cos(0.1)], atol=1e-12)
    gravity = np.array(mbs.models.gravity_effort(system)([0.7, 0.1])).ravel()
    np.testing.assert_allclose(gravity, [0, -0.1 * 9.81 * 0.5 * sin(0.1)], atol=1e-12)


def test_two_branch_tree_has_two_arms():
    system = assembled("two_branch_tree")
    assert [row.antecedent for row in system.links] == [0, 1, 2, 3, 1, 5, 6]
    assert [row.number for row in system.links if row.motion == "prismatic"] == [4]


def test_sr400_closes_as_its_docstring_says():
    system = assembled("sr400")
    assert [system.velocity_coordinates[k].name for k in system.independent] == [
        "q1",
        "q2",
        "q4",
        "q5",
        "q6",
        "q7",
    ]
    assert [loop.name for loop in system.loops] == ["q9"]
    assert system.position(None)[1] == pytest.approx(-pi / 2)
    names = [row.name for row in system.coordinates]
    for q1, q2, q7 in ((0, -1.5, 0.1), (0.3, -1.2, -0.2), (-1, -2.0, -0.4)):
        given = {"q1": q1, "q2": q2, "q7": q7, "q4": 0.3, "q5": -0.4, "q6": 0.5}
        q = dict(zip(names, mbs.loops.solve(system, given), strict=True))
        assert _same_angle(q["q3"], pi / 2 - q2 + q7)
        assert _same_angle(q["q8"], q2 - q7)
        T_83 = np.array(mbs.models.transform(system, 3, 8)(list(q.values())))
        q9 = turn(T_83) + pi / 2  # frame 10 is a quarter turn ahead of frame 3
        assert _same_angle(q9, pi - q["q8"])


def test_sr400_is_singular_where_q2_is_q7():
    system = assembled("sr400")
    J = mbs.loops.closure_jacobian(system)
    smallest = []
    for q2 in (-0.5, -0.05, 0.0):
        q = [0, q2, pi / 2 - q2, 0, 0, 0, 0, q2]
        assert np.max(np.abs(np.array(mbs.loops.closure_residual(system)(q)))) < 1e-12
        values = np.linalg.svd(np.array(J(q)), compute_uv=False)
        smallest.append(values[len(system.closure.rows) - 1])
    assert smallest[0] > 0.01
    assert smallest[0] > smallest[1] > smallest[2]
    assert smallest[2] < 1e-12


def test_five_bar_is_assembled_symmetric_above_the_ground():
    system = assembled("five_bar")
    assert [system.velocity_coordinates[k].name for k in system.independent] == ["q1", "q3"]
    q = mbs.loops.solve(system, {"q1": 2.1, "q3": pi - 2.1})
    place_2 = place(system, 2, q)
    tip = place_2[:3, 3] + 0.35 * place_2[:3, 0]
    assert tip[0] == pytest.approx(0.1)
    assert tip[1] == pytest.approx(
        0.25 * sin(2.1) + (0.35**2 - (0.1 - 0.25 * cos(2.1)) ** 2) ** 0.5
    )
    assert abs(system.configuration[0] + system.configuration[2] - pi) < 0.1


def test_four_bar_is_a_crank_and_a_rocker():
    """At j1 = 0 the triangle of the ground's rest, the coupler and the rocker gives j2, j4."""
    system = assembled("four_bar")
    assert [system.velocity_coordinates[k].name for k in system.independent] == ["j1"]
    names = [row.name for row in system.coordinates]
    q = dict(zip(names, mbs.loops.solve(system, {"j1": 0.0}), strict=True))
    rest = 0.8 - 0.4
    at_crank = np.arccos((rest**2 + 1.0**2 - 0.9**2) / (2 * rest * 1.0))
    at_rocker = np.arccos((rest**2 + 0.9**2 - 1.0**2) / (2 * rest * 0.9))
    assert q["j2"] == pytest.approx(at_crank)
    assert q["j4"] == pytest.approx(pi - at_rocker)


def _same_angle(a, b):
    return abs(np.exp(1j * a) - np.exp(1j * b)) < 1e-9
