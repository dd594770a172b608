"""Differential wrist and AKR3000 against kinematics and mechanics done by hand."""

import numpy as np
import pytest

import mbs
from mbs.robots import akr3000, differential_wrist

G = 9.81


def named(system, q):
    return dict(zip((c.name for c in system.coordinates), q, strict=True))


@pytest.fixture(scope="module")
def painter():
    return akr3000().assemble()


@pytest.mark.parametrize(("robot", "seconds"), [(differential_wrist, 1.0), (akr3000, 0.3)])
def test_energy_of_a_fall(robot, seconds):
    result = mbs.simulate.run(robot().assemble(), seconds, tolerance=1e-9, quiet=True)
    total = result["kinetic_energy"] + result["potential_energy"]
    assert result["kinetic_energy"].max() > 1
    assert np.ptp(total) < 1e-6
    assert result["closure_residual"].max() < 1e-12


@pytest.mark.parametrize("ratio", [1.0, 1.5])
def test_differential_wrist_pitches_by_the_sum_and_rolls_by_the_difference(ratio):
    system = differential_wrist(ratio).assemble()
    assert [system.velocity_coordinates[k].name for k in system.independent] == ["q1", "q2"]
    q = mbs.loops.solve(system, {"q1": 0.9, "q2": -0.3})
    at = named(system, q)
    pitch, roll = 0.3, ratio * 0.6
    assert at["pitch"] == pytest.approx(pitch)
    assert at["roll"] == pytest.approx(roll)
    v = np.array([0.7, 1.1])
    dpitch, droll = v.sum() / 2, ratio * (v[0] - v[1]) / 2
    c, s = np.cos(roll), np.sin(roll)
    w_tool = np.array([droll, dpitch * c, -dpitch * s])
    v_tool = np.cross(w_tool, [0.12, 0, 0.01])
    kinetic = (
        (2e-3 + 1.2 * 0.02**2) * dpitch**2
        + 0.8 * v_tool @ v_tool
        + w_tool @ (np.array([6e-4, 3e-3, 3e-3]) * w_tool)
        + (2e-4 + 5e-3) * v @ v
    ) / 2
    height = -1.2 * 0.02 * np.sin(pitch)
    height += 0.8 * (-0.12 * np.sin(pitch) + 0.01 * c * np.cos(pitch))
    found = [float(e) for e in mbs.models.energy(system)(q, v)]
    assert found == pytest.approx([kinetic, G * height], rel=1e-12)


@pytest.mark.parametrize("seed", range(4))
def test_akr3000_cylinders_reach_from_trunk_to_arm(painter, seed):
    rng = np.random.default_rng(seed)
    given = {"q5": rng.uniform(-0.12, -0.04), "q6": rng.uniform(-0.1, -0.02), "q8": 0.3}
    q = named(painter, mbs.loops.solve(painter, given))

    def unit(angle):
        return np.exp(1j * angle)

    on_arm = 0.3 * unit(q["q2"] - np.pi / 5)
    on_forearm = 0.3 * unit(q["q2"]) + 0.2 * unit(q["q2"] + q["q7"] + np.pi / 1.6)
    assert abs(on_arm - 0.2) == pytest.approx(0.3 + given["q6"], abs=1e-11)
    assert abs(on_forearm + 0.2) == pytest.approx(0.3 + given["q5"], abs=1e-11)
    assert np.angle((on_arm - 0.2) / unit(q["q4"] + np.pi / 2)) == pytest.approx(0, abs=1e-10)
    assert np.angle((on_forearm + 0.2) / unit(q["q3"] + np.pi / 2)) == pytest.approx(0, abs=1e-10)
