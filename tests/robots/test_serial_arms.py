"""Serial arms of the catalogue against configurations that their makers or papers publish."""

from functools import cache
from math import cos, pi, radians, sin

import numpy as np
import pytest

import mbs
from mbs.robots import catalogue

# Manocha & Canny 1994, table III: the sixteen configurations of one pose [deg].
SIXTEEN = np.array(
    [
        [-96.28, -6.27, 179.96, 38.48, 52.55, -39.40],
        [-120.78, 172.33, -179.07, 31.33, -146.71, 142.82],
        [88.67, -176.72, -176.72, -63.24, 157.19, 140.43],
        [113.84, 5.30, -177.74, -55.92, -62.98, -43.37],
        [-178.12, 108.19, -147.73, -5.69, -164.67, 179.58],
        [168.32, -103.89, 146.60, -17.24, -171.87, 98.16],
        [-12.94, -105.09, -114.97, 3.02, 7.41, -79.42],
        [2.51, 108.07, 112.04, -10.52, 0.00, -0.10],
        [2.51, 108.07, -67.95, -169.47, 179.99, 179.89],
        [-12.94, -105.09, 65.02, 176.97, 172.58, 100.57],
        [168.32, -103.89, -33.39, -162.75, -8.12, -81.83],
        [-178.12, 108.19, 32.26, -174.30, -15.32, -0.41],
        [88.67, -176.72, 3.27, -116.75, 22.80, -39.56],
        [-96.28, -6.27, -0.03, 141.51, 127.44, 140.59],
        [-120.78, 172.33, 0.92, 148.66, -33.28, -37.17],
        [113.84, 5.30, 2.25, -124.07, -117.01, 136.62],
    ]
)
HAND = np.array(
    [
        [-0.7601, -0.6416, 0.1022, -1.1401],
        [0.1333, 0.0, 0.9910, 0.0],
        [-0.6359, 0.7669, 0.0855, 0.0],
        [0, 0, 0, 1],
    ]
)
UP, DOWN, X, Y = (0, 0, 1), (0, 0, -1), (1, 0, 0), (0, 1, 0)
BACK = (-1, 0, 0)


@cache
def assembled(name):
    return catalogue()[name]().assemble()


def tool(name, q):
    return np.array(mbs.models.direct_geometry(assembled(name))(q))


@pytest.mark.parametrize(
    ("name", "place", "z"),
    [
        ("tx90", (0.05, 0.05, 0.478 + 0.425 + 0.425 + 0.1), UP),
        ("kr6", (0.025 + 0.455 + 0.42 + 0.08, 0, 0.4 + 0.035), BACK),
        ("irb120", (0.302 + 0.072, 0, 0.29 + 0.27 + 0.07), X),
        ("ur5", (-0.425 - 0.39225, -0.10915 - 0.0823, 0.089159 - 0.09465), (0, -1, 0)),
        ("crx10", (0.54 + 0.16, -0.15, 0.245 + 0.54), BACK),
        ("panda", (0.088, 0, 0.333 + 0.316 + 0.384 - 0.107), DOWN),
        ("youbot", (0.033 - 0.002, 0, 0.115 + 0.155 + 0.135 + 0.13), UP),
        ("gantry", (0, 0, 1.5 - 0.12), DOWN),
    ],
)
def test_zero_configuration(name, place, z):
    T = tool(name, np.zeros(assembled(name).nq))
    np.testing.assert_allclose(T[:3, 3], place, atol=1e-12)
    np.testing.assert_allclose(T[:3, 2], z, atol=1e-12)


# The axis about which each joint turns at zero, and a point on it, read off the makers' drawings.
AXES = {
    "tx90": [
        (UP, (0, 0, 0)),
        (Y, (0.05, 0, 0.478)),
        (Y, (0.05, 0, 0.903)),
        (UP, (0.05, 0.05, 0)),
        (Y, (0.05, 0, 1.328)),
        (UP, (0.05, 0.05, 0)),
    ],
    "kr6": [
        (DOWN, (0, 0, 0)),
        (Y, (0.025, 0, 0.4)),
        (Y, (0.48, 0, 0.4)),
        (BACK, (0, 0, 0.435)),
        (Y, (0.9, 0, 0.435)),
        (BACK, (0, 0, 0.435)),
    ],
    "irb120": [
        (UP, (0, 0, 0)),
        (Y, (0, 0, 0.29)),
        (Y, (0, 0, 0.56)),
        (X, (0, 0, 0.63)),
        (Y, (0.302, 0, 0.63)),
        (X, (0, 0, 0.63)),
    ],
    "crx10": [
        (UP, (0, 0, 0)),
        (Y, (0, 0, 0.245)),
        ((0, -1, 0), (0, 0, 0.785)),
        (BACK, (0, 0, 0.785)),
        ((0, -1, 0), (0.54, 0, 0.785)),
        (BACK, (0, -0.15, 0.785)),
    ],
    "panda": [
        (UP, (0, 0, 0)),
        (Y, (0, 0, 0.333)),
        (UP, (0, 0, 0)),
        ((0, -1, 0), (0.0825, 0, 0.649)),
        (UP, (0, 0, 0)),
        ((0, -1, 0), (0, 0, 1.033)),
        (DOWN, (0.088, 0, 0)),
    ],
    "youbot": [
        (UP, (0, 0, 0)),
        (Y, (0.033, 0, 0.115)),
        (Y, (0.033, 0, 0.27)),
        (Y, (0.033, 0, 0.405)),
        (UP, (0.031, 0, 0)),
    ],
}


@pytest.mark.parametrize("name", AXES)
def test_product_of_exponentials(name):
    """The pose is that of turns about the axes of the zero configuration."""
    q = np.random.default_rng(0).uniform(-2, 2, len(AXES[name]))
    T = np.eye(4)
    for (axis, point), angle in zip(AXES[name], q, strict=True):
        T = T @ turned(np.array(axis, dtype=float), np.array(point, dtype=float), angle)
    expected = T @ tool(name, np.zeros(len(q)))
    np.testing.assert_allclose(tool(name, q), expected, atol=1e-12)


def turned(axis, point, angle):
    """(4, 4) turn about an axis through a point, by Rodrigues' formula."""
    K = np.cross(np.eye(3), axis)
    T = np.eye(4)
    T[:3, :3] = np.eye(3) + sin(angle) * K + (1 - cos(angle)) * K @ K
    T[:3, 3] = point - T[:3, :3] @ point
    return T


def test_ur5_with_standard_parameters():
    """Rz(theta) Tz(d) Tx(a) Rx(alpha), as the maker prints them."""
    a = [0, -0.425, -0.39225, 0, 0, 0]
    d = [0.089159, 0, 0, 0.10915, 0.09465, 0.0823]
    alpha = [pi / 2, 0, 0, pi / 2, -pi / 2, 0]
    q, T = np.random.default_rng(1).uniform(-3, 3, 6), np.eye(4)
    for k in range(6):
        T = T @ turned(np.array([0, 0, 1.0]), np.zeros(3), q[k])
        step = turned(np.array([1.0, 0, 0]), np.zeros(3), alpha[k])
        step[:3, 3] = a[k], 0, d[k]
        T = T @ step
    np.testing.assert_allclose(tool("ur5", q), T, atol=1e-12)


def test_manseur_doty_reaches_one_pose_in_sixteen_configurations():
    hand = turned(np.array([1.0, 0, 0]), np.zeros(3), radians(1))
    for q in np.radians(SIXTEEN):
        np.testing.assert_allclose(tool("manseur_doty", q) @ hand, HAND, atol=6e-4)


def test_gantry_slides_along_the_base_and_downwards():
    T = tool("gantry", [1.1, 0.6, 0.3, 0, 0, 0])
    np.testing.assert_allclose(T[:3, 3], [1.1, 0.6, 1.5 - 0.3 - 0.12], atol=1e-12)
    turn = tool("gantry", [1.1, 0.6, 0.3, 0.4, 0.9, -0.2])
    centre = turn[:3, 3] - 0.12 * turn[:3, 2]
    np.testing.assert_allclose(centre, [1.1, 0.6, 1.2], atol=1e-12)


@pytest.mark.parametrize("name", ["tx90", "kr6", "irb120", "crx10", "panda", "youbot", "ur5"])
def test_assembled_within_limits(name):
    system = assembled(name)
    for place, row in zip(system.configuration, system.coordinates, strict=True):
        assert row.limits[0] <= place <= row.limits[1]
