"""Delta and Stewart platform against geometry and mechanics done by hand."""

import numpy as np
import pytest
from support.parallel_geometry import LEGS, leg_bodies, rotation, three_spheres

import mbs
from mbs.robots import delta, stewart_platform

G = 9.81
UP = np.array([0.0, 0.0, 1.0])


@pytest.fixture(scope="module")
def systems():
    return {"delta": delta().assemble(), "stewart": stewart_platform().assemble()}


def numbers(function, *arguments):
    outputs = function(*arguments)
    return np.array(outputs).ravel()


@pytest.mark.parametrize(("name", "drop"), [("delta", 0.3), ("stewart", 0.05)])
def test_energy_of_a_fall(systems, name, drop):
    result = mbs.simulate.run(systems[name], drop, tolerance=1e-9, quiet=True)
    total = result["kinetic_energy"] + result["potential_energy"]
    assert result["kinetic_energy"].max() > 1
    assert np.ptp(total) < 1e-6
    assert result["closure_residual"].max() < 1e-12


def elbows(q):
    """Elbows of the Delta less the radius of its platform, (3, 3) rows."""
    around = 2 * np.pi / 3 * np.arange(3)
    out = 0.20 + 0.25 * np.cos(q) - 0.05
    return np.column_stack([out * np.cos(around), out * np.sin(around), -0.25 * np.sin(q)])


@pytest.mark.parametrize("seed", range(4))
def test_delta_platform_hangs_from_three_spheres(systems, seed):
    system = systems["delta"]
    q = np.random.default_rng(seed).uniform(-0.4, 0.9, 3)
    configuration = mbs.loops.solve(system, {f"q{k + 1}": q[k] for k in range(3)})
    place = mbs.models.transform(system, "plate")(configuration)
    np.testing.assert_allclose(place[:3, 3], three_spheres(elbows(q), 0.6)[:, None], atol=1e-12)
    np.testing.assert_allclose(place[:3, :3], np.eye(3), atol=1e-12)


@pytest.mark.parametrize("seed", range(4))
def test_delta_efforts_are_those_of_codourey(systems, seed):
    """Arms with their share of the forearms, and the platform with the rest, through J'."""
    system = systems["delta"]
    rng = np.random.default_rng(seed)
    q, v, a = rng.uniform(-0.4, 0.9, 3), rng.normal(size=3), rng.normal(size=3)
    around = 2 * np.pi / 3 * np.arange(3)
    tip = np.column_stack([-np.sin(q) * np.cos(around), -np.sin(q) * np.sin(around), -np.cos(q)])
    inwards = np.column_stack([-np.cos(q) * np.cos(around), -np.cos(q) * np.sin(around), np.sin(q)])
    e, de = elbows(q), 0.25 * tip * v[:, None]
    dde = 0.25 * (tip * a[:, None] + inwards * (v**2)[:, None])
    x = three_spheres(e, 0.6)
    rods = x - e
    J = np.linalg.solve(rods, np.diag(0.25 * np.sum(rods * tip, axis=1)))
    dx = J @ v
    ddx = np.linalg.solve(rods, np.sum(rods * dde - (dx - de) ** 2, axis=1))
    mass, share = 0.8 + 0.12, 2 / 3 * 0.12
    arm = 0.01 + 0.3 * ((3 * 0.015**2 + 0.25**2) / 12 + 0.125**2) + share * 0.25**2
    weight = -G * np.cos(q) * (0.3 * 0.125 + share * 0.25)
    expected = arm * a + weight + J.T @ (mass * (ddx + G * UP))
    configuration = mbs.loops.solve(system, {f"q{k + 1}": q[k] for k in range(3)})
    efforts = numbers(mbs.models.inverse_dynamics(system), configuration, v, a)
    np.testing.assert_allclose(efforts, expected, atol=1e-10)


def lengthenings(place, turn):
    """Of the legs of the Stewart platform at a pose (place of its centre, rotation vector)."""
    low, high = LEGS
    heads = np.asarray(place) + (high - [0, 0, 0.7]) @ rotation(turn).T
    return np.linalg.norm(heads - low, axis=1) - np.linalg.norm(high - low, axis=1)


def stewart_configuration(system, place, turn):
    lengths = lengthenings(place, turn)
    return mbs.loops.solve(system, {f"leg{k + 1}": lengths[k] for k in range(6)})


@pytest.mark.parametrize("seed", range(3))
def test_stewart_platform_is_where_its_legs_carry_it(systems, seed):
    system = systems["stewart"]
    rng = np.random.default_rng(seed)
    place = 0.7 * UP + rng.uniform(-0.08, 0.08, 3)
    turn = rng.uniform(-0.2, 0.2, 3)
    T = np.array(mbs.models.transform(system, "centre")(stewart_configuration(system, place, turn)))
    np.testing.assert_allclose(T[:3, 3], place, atol=1e-11)
    np.testing.assert_allclose(T[:3, :3], rotation(turn), atol=1e-11)


@pytest.mark.parametrize("seed", range(3))
def test_stewart_platform_energy_and_weight(systems, seed):
    """Thirteen bodies placed by the pose alone, their motion by central differences."""
    system = systems["stewart"]
    rng = np.random.default_rng(10 + seed)
    pose = np.concatenate([0.7 * UP + rng.uniform(-0.08, 0.08, 3), rng.uniform(-0.2, 0.2, 3)])
    rate, h = rng.normal(size=6), 1e-5
    ahead, behind = pose + h * rate, pose - h * rate
    kinetic = 0.0
    for a, b in zip(leg_bodies(ahead), leg_bodies(behind), strict=True):
        v = (a.com - b.com) / (2 * h)
        spin = (a.R @ b.R.T - b.R @ a.R.T) / (4 * h)
        w = a.middle(b).T @ np.array([spin[2, 1], spin[0, 2], spin[1, 0]])
        kinetic += a.mass * v @ v / 2 + w @ (a.inertia * w) / 2
    speeds = (lengthenings(ahead[:3], ahead[3:]) - lengthenings(behind[:3], behind[3:])) / (2 * h)
    configuration = stewart_configuration(system, pose[:3], pose[3:])
    found = [float(e) for e in mbs.models.energy(system)(configuration, speeds)]
    height = sum(body.mass * body.com[2] for body in leg_bodies(pose))
    assert found[0] == pytest.approx(kinetic, rel=1e-6)
    assert found[1] == pytest.approx(G * height, rel=1e-12)
    fall = [
        G * sum(x.mass * (x.com[2] - y.com[2]) for x, y in _pairs(pose, h * d)) / (2 * h)
        for d in np.eye(6)
    ]
    slopes = [
        (lengthenings(*np.split(pose + h * d, 2)) - lengthenings(*np.split(pose - h * d, 2)))
        / (2 * h)
        for d in np.eye(6)
    ]
    efforts = numbers(mbs.models.gravity_effort(system), configuration)
    np.testing.assert_allclose(np.array(slopes) @ efforts, fall, atol=1e-6)


def _pairs(pose, d):
    return zip(leg_bodies(pose + d), leg_bodies(pose - d), strict=True)
