"""Coulomb friction that sticks, in simulations, against closed forms between events."""

import numpy as np
import pytest
from support.contact_mechanisms import block

import mbs
from mbs.components import CoulombFriction, PointMass, Prismatic, RigidStop, Spring

G = 9.81


def run(system, duration, **options):
    return mbs.simulate.run(system, duration, quiet=True, tolerance=1e-10, **options)


def words(result):
    return [(name, what) for _, name, what in result.events]


def dry(slope, mu=0.5, mass=2.0):
    return CoulombFriction("dry", joint="x", sliding=mu * mass * G * np.cos(slope))


@pytest.mark.parametrize("part", [0.5, 0.999])
def test_a_block_sticks_below_the_cone_of_friction(part):
    slope = part * np.arctan(0.5)
    result = run(block(slope, dry(slope)), 5)
    assert not result.events
    assert np.all(result["dry.mode"] == 0)
    assert np.max(np.abs(result["x.q"])) < 1e-14
    np.testing.assert_allclose(result["dry.effort"], -2 * G * np.sin(slope), rtol=1e-12)


@pytest.mark.parametrize("part", [1.001, 1.5])
def test_a_block_slides_above_the_cone_of_friction(part):
    slope = part * np.arctan(0.5)
    result = run(block(slope, dry(slope)), 5)
    a = G * (np.sin(slope) - 0.5 * np.cos(slope))
    assert result.events == ((0.0, "dry", "slides"),)
    np.testing.assert_allclose(result["x.q"], a / 2 * result.time**2, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(result["dry.effort"], -G * np.cos(slope), rtol=1e-12)


def test_a_block_that_is_pushed_up_a_slope_stops_there():
    slope = 0.3
    result = run(block(slope, dry(slope)), 2, v0={"x": -3.0})
    a = G * (np.sin(slope) + 0.5 * np.cos(slope))
    ((time, *what),) = result.events
    assert what == ["dry", "sticks"]
    assert time == pytest.approx(3 / a, abs=1e-9)
    assert result["x.q"][-1] == pytest.approx(-(3**2) / 2 / a, abs=1e-9)


def test_a_block_that_is_pushed_up_a_steep_slope_comes_back():
    slope = 0.6
    result = run(block(slope, dry(slope)), 1.5, v0={"x": -3.0})
    up, down = (G * (np.sin(slope) + s * 0.5 * np.cos(slope)) for s in (1, -1))
    turn = 3 / up
    assert result.events[-1][1:] == ("dry", "slides")
    assert {time for time, *_ in result.events} == {result.events[0][0]}
    assert result.events[0][0] == pytest.approx(turn, abs=1e-9)
    place = -4.5 / up + down / 2 * (1.5 - turn) ** 2
    assert result["x.q"][-1] == pytest.approx(place, abs=1e-9)


@pytest.mark.parametrize("method", ["dopri5", "rodas"])
def test_a_block_on_a_spring_that_is_pulled_at_constant_speed_sticks_and_slips(method):
    stiffness, static, sliding, speed, mass = 40.0, 30.0, 20.0, 0.5, 10.0
    m = mbs.Mechanism("stick_slip", gravity=(0, 0, 0))
    puller, body = m.add(PointMass("puller", 1.0)), m.add(PointMass("body", mass))
    m.connect(m.world, Prismatic("pull", axis="x", actuated=True), puller)
    m.connect(m.world, Prismatic("x", axis="x"), body)
    m.add(Spring("spring", puller.at(1.0), body, stiffness=stiffness, length=1.0))
    m.add(CoulombFriction("dry", joint="x", sliding=sliding, sticking=static))
    result = run(m.assemble(), 20, motion={"pull.q": lambda t: speed * t}, method=method)
    w, extra = np.sqrt(stiffness / mass), (static - sliding) / stiffness
    slip = (2 * np.pi - 2 * np.arctan(extra * w / speed)) / w
    stick = 2 * extra / speed
    expected = static / stiffness / speed + np.cumsum([0, *[slip, stick] * 6])
    expected = expected[expected < 20]
    times = np.array([time for time, *_ in result.events])
    assert len(expected) > 7
    np.testing.assert_allclose(times, expected, atol=1e-8)
    assert [what for *_, what in result.events] == (["slides", "sticks"] * 7)[: len(times)]
    since = result.time - expected[0]
    during = (since > 0) & (since < slip)
    s = since[during]
    # stretch beyond the equilibrium of sliding: extra cos + speed / w sin
    stretch = sliding / stiffness + extra * np.cos(w * s) + speed / w * np.sin(w * s)
    np.testing.assert_allclose(result["pull.q"][during] - result["x.q"][during], stretch, atol=1e-8)
    resting = result["dry.mode"] == 0
    np.testing.assert_allclose(
        result["dry.effort"][resting],
        -stiffness * (result["pull.q"] - result["x.q"])[resting],
        atol=1e-8,
    )


def test_friction_takes_the_energy_that_an_oscillation_loses():
    m = mbs.Mechanism("oscillator", gravity=(0, 0, 0))
    body = m.add(PointMass("body", 2.0))
    m.connect(m.world, Prismatic("x", axis="x"), body)
    m.add(Spring("spring", m.world.at(-1), body, stiffness=50, length=1))
    m.add(CoulombFriction("dry", joint="x", sliding=1.5))
    result = run(m.assemble(), 6, q0={"x": 0.5})
    # each half swing loses 2 F / k of the amplitude, until the spring holds less than F
    turns = 0.5 - 0.06 * np.arange(0, 9)
    half = np.pi / np.sqrt(25.0)
    assert result["x.q"][-1] == pytest.approx(turns[8], abs=1e-8)
    assert result.events[-1][1:] == ("dry", "sticks")
    assert result.events[-1][0] == pytest.approx(8 * half, abs=1e-8)
    for k in range(1, 8):
        assert result.at(half * k)["x.q"] == pytest.approx((-1) ** k * turns[k], abs=2e-3)


def test_a_stop_and_friction_share_a_coordinate():
    end = RigidStop("end", joint="x", upper=0.5, restitution=0.5)
    slope = 0.3
    result = run(block(slope, dry(slope), end), 3, v0={"x": 3.0}, tau={"x": 12.0})
    drive = 6 + G * np.sin(slope)
    down = drive - 0.5 * G * np.cos(slope)
    up = drive + 0.5 * G * np.cos(slope)
    hit = (-3 + np.sqrt(9 + down)) / down
    back = 0.5 * np.sqrt(9 + down)
    times = [time for time, *_ in result.events]
    assert words(result)[:3] == [
        ("end", "bounces off upper"),
        ("dry", "slides"),
        ("dry", "slides"),
    ]
    assert words(result)[-2:] == [("end", "rests at upper"), ("dry", "sticks")]
    np.testing.assert_allclose(times[:3:2], [hit, hit + back / up], atol=1e-9)
    # friction holds what it can, the stop the rest
    assert result["dry.effort"][-1] == pytest.approx(-G * np.cos(slope), rel=1e-9)
    assert result["end.effort"][-1] == pytest.approx(-2 * down, rel=1e-9)


def test_an_impact_sets_a_joint_that_sticks_in_motion():
    m = mbs.Mechanism("rail", gravity=(0, 0, 0))
    carriage = m.add(PointMass("carriage", 2.0))
    m.connect(m.world, Prismatic("x", axis="x"), carriage)
    m.connect(carriage, Prismatic("y", axis="x"), m.add(PointMass("body", 1.0)))
    m.add(CoulombFriction("dry", joint="x", sliding=4.0))
    m.add(RigidStop("end", joint="y", upper=0.5, restitution=1.0))
    result = run(m.assemble(), 0.6, v0={"y": 1.0})
    assert words(result)[:2] == [("dry", "slides"), ("end", "bounces off upper")]
    # the free impact gives the carriage 2/3 m/s, which 4 N brake: 2/3 / 2 = 1/3 s
    assert np.all(result["x.q"][result.time < 0.5] == 0)
    row = int(np.searchsorted(result.time, 0.55))
    since = result.time[row] - 0.5
    assert result["x.v"][row] == pytest.approx(2 / 3 - 2 * since, abs=1e-9)
