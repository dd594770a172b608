"""Rigid stops in simulations, against closed forms and impulses by hand."""

import numpy as np
import pytest
from support.contact_mechanisms import pendulum

import mbs
from mbs.components import Body, PointMass, Prismatic, RigidStop
from mbs.models.state.tree import full_state
from mbs.solvers import Events, integrate_events

G = 9.81


def run(system, duration, **options):
    return mbs.simulate.run(system, duration, quiet=True, tolerance=1e-10, **options)


def words(result):
    return [(name, what) for _, name, what in result.events]


def ball(**stop):
    """A body of 2 kg on a vertical rail over the ground."""
    m = mbs.Mechanism("ball")
    body = m.add(Body("body", mass=2.0, inertia=(0.1, 0.1, 0.1)))
    m.connect(m.world, Prismatic("z", axis="z", actuated=True), body)
    m.add(RigidStop("ground", joint="z", lower=0, **stop))
    return m.assemble()


def test_a_ball_bounces_in_closed_form_and_comes_to_rest():
    result = run(ball(restitution=0.8, rest_speed=1e-5), 5, q0={"z": 1.0})
    first = np.sqrt(2 / G)
    flights = 2 * first * 0.8 ** np.arange(1, 200)
    expected = first + np.concatenate([[0], np.cumsum(flights)])
    speed = G * first * 0.8 ** np.arange(1, 201)
    count = int(np.argmax(speed < 1e-5)) + 1
    times = np.array([time for time, _, _ in result.events])
    assert len(times) == count == 59
    np.testing.assert_allclose(times, expected[:count], atol=1e-9)
    assert words(result) == [("ground", "bounces off lower")] * (count - 1) + [
        ("ground", "rests at lower")
    ]
    rests = result.time > times[-1]
    assert np.array_equal(result["ground.mode"], np.where(rests, -1, 0))
    np.testing.assert_allclose(result["ground.effort"], np.where(rests, 2 * G, 0), atol=1e-12)
    assert np.max(np.abs(result["z.q"][rests])) < 1e-15
    k = np.searchsorted(times, result.time, side="right")
    since = result.time - np.concatenate([[-first], times])[k]
    up = G * first * 0.8**k
    flying = (up * since - G / 2 * since**2)[~rests]
    np.testing.assert_allclose(result["z.q"][~rests], flying, atol=1e-9)


@pytest.mark.parametrize("method", ["dopri5", "rodas"])
def test_the_stop_pushes_with_the_moment_of_gravity_until_the_motor_lifts(method):
    system = pendulum(RigidStop("end", joint="q", lower=-0.6))
    moment = 1.5 * G * 0.7 * np.cos(0.6)
    result = run(system, 3, method=method, tau=lambda t, q, v: 4 * t)
    assert words(result) == [("end", "rests at lower"), ("end", "leaves lower")]
    hits, leaves = (time for time, _, _ in result.events)
    assert leaves == pytest.approx(moment / 4, abs=1e-8)
    rests = (result.time > hits) & (result.time < leaves)
    np.testing.assert_allclose(
        result["end.effort"][rests], moment - 4 * result.time[rests], atol=1e-10
    )
    assert np.all(result["end.effort"][~rests] == 0)
    assert np.max(np.abs(result["q.q"][rests] + 0.6)) < 1e-13
    assert np.max(np.abs(result["q.v"][rests])) < 1e-15
    after = result.time > leaves
    assert np.all(result["q.q"][after] > -0.6)


def test_an_impact_of_a_pendulum_keeps_the_angle_and_turns_the_velocity_round():
    system = pendulum(RigidStop("end", joint="q", lower=-1.0, upper=0.2, restitution=0.5))
    result = run(system, 0.6, v0={"q": -1.0}, step=0.001)
    (time, *_), *_ = result.events
    drop = 2 * G / 0.7 * np.sin(1.0)
    speed = 0.5 * np.sqrt(1 + drop)
    k = int(np.searchsorted(result.time, time))
    energy = result["kinetic_energy"]
    height = 1.5 * G * 0.7 * (np.sin(result["q.q"][k]) - np.sin(-1.0))
    assert energy[k] + height == pytest.approx(0.5 * 1.5 * 0.7**2 * speed**2, rel=1e-8)


def test_a_slider_that_starts_at_its_stop_rests_there_with_and_without_a_load():
    m = mbs.Mechanism("slider", gravity=(0, 0, 0))
    m.connect(m.world, Prismatic("x", axis="x", actuated=True), m.add(PointMass("mass", 2.0)))
    m.add(RigidStop("end", joint="x", upper=0.0))
    system = m.assemble()
    idle = run(system, 1)
    assert not idle.events
    assert np.all(idle["end.mode"] == 1)
    assert np.all(idle["x.q"] == 0)
    pushed = run(system, 1, tau={"x": 3.0})
    np.testing.assert_allclose(pushed["end.effort"], -3.0, rtol=1e-12)
    pulled = run(system, 1, tau={"x": -3.0})
    assert pulled.events == ((0.0, "end", "leaves upper"),)
    np.testing.assert_allclose(pulled["x.q"], -0.75 * pulled.time**2, atol=1e-10)
    assert np.all(pulled["end.mode"] == 0)


def test_stops_that_are_met_at_one_instant_all_act():
    m = mbs.Mechanism("sliders", gravity=(0, 0, 0))
    for name, restitution in (("a", 0.5), ("b", 1.0), ("c", 0.0)):
        body = m.add(PointMass(f"mass_{name}", 1.0))
        m.connect(m.world, Prismatic(name, axis="x", actuated=True), body)
        m.add(RigidStop(f"end_{name}", joint=name, upper=1.0, restitution=restitution))
    system = m.assemble()
    result = run(system, 1.0, v0={"a": 2.0, "b": 2.0, "c": 2.0})
    assert [time for time, *_ in result.events] == pytest.approx([0.5] * 3, abs=1e-12)
    last = [result[f"{name}.v"][-1] for name in "abc"]
    np.testing.assert_allclose(last, [-1.0, -2.0, 0.0], atol=1e-12)
    assert result["end_c.mode"][-1] == 1


def rail(*stops):
    """A carriage of 2 kg and a body of 1 kg that slides on it."""
    m = mbs.Mechanism("rail", gravity=(0, 0, 0))
    carriage = m.add(PointMass("carriage", 2.0))
    m.connect(m.world, Prismatic("x", axis="x", actuated=True), carriage)
    m.connect(carriage, Prismatic("y", axis="x", actuated=True), m.add(PointMass("body", 1.0)))
    for stop in stops:
        m.add(stop)
    return m.assemble()


def test_what_rests_on_a_stop_stays_when_an_impact_presses_it_on():
    system = rail(RigidStop("wall", joint="x", upper=0.0), RigidStop("end", joint="y", upper=0.5))
    result = run(system, 1.0, v0={"y": 1.0}, tau={"x": 0.1})
    assert words(result) == [("end", "rests at upper")]
    assert np.max(np.abs(result["x.q"])) < 1e-15
    assert abs(result["y.v"][-1]) < 1e-15


def test_what_rests_on_a_stop_leaves_when_an_impact_pulls_it_off():
    system = rail(
        RigidStop("wall", joint="x", lower=0.0),
        RigidStop("end", joint="y", upper=0.5, restitution=0.5),
    )
    result = run(system, 1.0, v0={"y": 1.0})
    assert words(result) == [
        ("wall", "leaves lower"),
        ("end", "bounces off upper"),
    ]
    # a free impact of 1 kg at 1 m/s on 2 kg at rest
    np.testing.assert_allclose([result["x.v"][-1], result["y.v"][-1]], [0.5, -0.5], atol=1e-12)


def test_interpreted_functions_give_the_same_bits():
    system = pendulum(RigidStop("end", joint="q", lower=-0.6, upper=0.5, restitution=0.7))
    state, times = full_state(system), np.linspace(0, 4, 31)
    both = [
        integrate_events(
            state.rhs,
            [0, 3],
            times,
            Events(state.events.indicators, state.events.jump, [0, 0]),
            p=[],
            project=state.project,
            compiled=compiled,
        )
        for compiled in (True, False)
    ]
    compiled, interpreted = both
    assert len(compiled.events) == len(interpreted.events) > 4
    assert compiled.x.tobytes() == interpreted.x.tobytes()
    assert np.array_equal(compiled.modes, interpreted.modes)
