"""Rigid stops and Coulomb friction in the state equation of the independent joints."""

import casadi
import numpy as np
import pytest
from support.contact_mechanisms import (
    G,
    block,
    five_bar,
    four_bar,
    pendulum,
    slider_crank,
    stick_slip,
    stopped_rocker,
)
from support.minimal_runs import closing, moved, start_of

import mbs
from mbs import Mechanism
from mbs.components import (
    Body,
    Box,
    CoulombFriction,
    Free,
    Revolute,
    RigidStop,
)
from mbs.errors import ModelError
from mbs.models.state.independent import DriveInputs, minimal_state


def compared(system, duration, q0=None, v0=None, tau=None, motion=None):
    """The motion of the state equation and of the simulation, their events at the same times."""
    drive = DriveInputs(motions=tuple((name[:-2], name[-1]) for name in motion or {}))
    state, times = minimal_state(system, drive=drive), np.linspace(0, duration, 41)

    def inputs(t):
        values = [(tau or {}).get(system.velocity_coordinates[k].name, 0) for k in state.inputs]
        for name, law in (motion or {}).items():
            rates = [law(t)]
            for _ in range(2 if name[-1] == "q" else 0):
                rates.append(casadi.jacobian(rates[-1], t))
            values += rates
        return values

    own = moved(system, state, times, inputs, start=start_of(system, state, q0, v0))
    full = mbs.simulate.run(
        system,
        duration,
        q0=q0 or {},
        v0=v0,
        tau=tau,
        motion=motion,
        step=duration / 40,
        tolerance=1e-11,
        quiet=True,
    )
    there = np.array(sorted({time for time, *_ in full.events}))
    np.testing.assert_allclose([event.time for event in own.events], there, atol=1e-9)
    return state, own, full


def largest_error(system, state, own, full):
    """Of positions, efforts of contacts and modes."""
    names = [system.coordinates[k].name for k in (*state.positions, *state.dependents)]
    q = np.hstack([own.x[:, : len(state.positions)], own.z])
    errors = [q - np.stack([full[f"{name}.q"] for name in names], axis=1)]
    for row, effort in enumerate(state.contacts):
        column = own.y[:, own.y.shape[1] - len(state.contacts) + row]
        errors.append((column - full[effort.name]) / (1 + np.abs(full[effort.name]).max()))
    for row, name in enumerate(state.events.modes):
        errors.append(own.modes[:, row] - full[name])
    return max(np.abs(error).max() for error in errors)


def test_a_bouncing_pendulum_loses_what_restitution_takes():
    stop = RigidStop("end", joint="q", lower=-2.5, upper=0.2, restitution=0.8)
    system = pendulum(stop)
    state = minimal_state(system)
    times = np.linspace(0, 6, 601)
    own = moved(system, state, times, start=start_of(system, state, {"q": 0.1}))
    q, v = own.x.T
    weight, inertia = 1.5 * G * 0.7, 1.5 * 0.7**2
    energy = 0.5 * inertia * v**2 + weight * np.sin(q)
    hits = np.array([event.time for event in own.events])
    assert len(hits) >= 3
    level = energy[0]
    for k in range(len(hits) + 1):
        low, high = np.r_[0.0, hits, 7.0][k : k + 2]
        during = (times >= low) & (times < high)
        assert np.abs(energy[during] - level).max() < 1e-9
        if k < len(hits):
            wall = weight * np.sin(-2.5 if 0 in own.events[k].fired else 0.2)
            level = wall + 0.64 * (level - wall)


@pytest.mark.parametrize("method", ["dopri5", "rodas"])
def test_a_block_that_is_pulled_by_a_spring_sticks_and_slips_in_closed_form(method):
    system = stick_slip()
    state = minimal_state(system, drive=DriveInputs(motions=(("pull", "q"),)))
    assert [system.coordinates[k].name for k in state.positions] == ["x"]
    own = moved(
        system, state, np.linspace(0, 12, 61), lambda t: [0, 0.5 * t, 0.5, 0], method=method
    )
    w, extra = 2.0, 10.0 / 40.0
    slip, stick = (2 * np.pi - 2 * np.arctan(extra * w / 0.5)) / w, 2 * extra / 0.5
    expected = 30.0 / 40.0 / 0.5 + np.cumsum([0, *[slip, stick] * 4])
    expected = expected[expected < 12]
    assert len(expected) > 4
    np.testing.assert_allclose([event.time for event in own.events], expected, atol=1e-8)
    rests = own.modes[:, 0] == 0
    assert np.array_equal(own.x[rests, 1], np.zeros(rests.sum()))
    stretch = 0.5 * own.times - own.x[:, 0]
    np.testing.assert_allclose(own.y[rests, -1], -40 * stretch[rests], atol=1e-8)


@pytest.mark.parametrize("part", [0.999, 1.001])
def test_a_block_on_a_slope_rests_inside_the_cone_of_friction(part):
    slope = part * np.arctan(0.5)
    system = block(slope, CoulombFriction("dry", joint="x", sliding=G * np.cos(slope)))
    own = moved(system, minimal_state(system), np.linspace(0, 5, 11))
    fall = G * (np.sin(slope) - 0.5 * np.cos(slope)) if part > 1 else 0.0
    np.testing.assert_allclose(own.x[:, 0], fall / 2 * own.times**2, rtol=1e-9, atol=0)
    assert len(own.events) == (part > 1)


_OPEN = {
    "motor lifts off a stop": (
        lambda: pendulum(RigidStop("end", joint="q", lower=-0.6, restitution=0.3)),
        {"q0": {"q": 0.3}, "v0": {"q": -1.0}, "tau": {"q": 8.6}, "duration": 2.0},
    ),
    "pushed oscillator": (
        lambda: stick_slip(stiffness=60.0, static=8.0, sliding=5.0),
        {"motion": {"pull.q": lambda t: 0.4 * casadi.sin(3 * t)}, "duration": 6.0},
    ),
}


@pytest.mark.parametrize("name", _OPEN)
def test_open_systems_move_as_in_a_simulation(name):
    build, options = _OPEN[name]
    system = build()
    state, own, full = compared(system, **options)
    assert len(own.events) >= 2
    assert largest_error(system, state, own, full) < 1e-8


_CLOSED = {
    "rest on the stop of a rocker": (
        lambda: four_bar(-9.81, RigidStop("end", joint="b1", upper=2.2)),
        {"tau": {"a1": 8.0}, "duration": 2.0},
    ),
    "two contacts of dependent joints": (
        lambda: five_bar(
            -9.81,
            RigidStop("end", joint="a2", lower=-1.6),
            CoulombFriction("dry", joint="b2", sliding=1.0),
        ),
        {"tau": {"a1": 12.0, "b1": 3.0}, "duration": 0.5},
    ),
    "dry slider": (
        lambda: slider_crank(CoulombFriction("dry", joint="slide", sliding=0.4)),
        {"v0": {"crank": 1.5}, "duration": 2.0},
    ),
}


@pytest.mark.parametrize("name", _CLOSED)
def test_closed_systems_move_as_in_a_simulation(name):
    build, options = _CLOSED[name]
    system = build()
    state, own, full = compared(system, **options)
    assert own.events
    assert largest_error(system, state, own, full) < 1e-8


def test_more_contacts_than_freedoms_come_to_rest_as_in_a_simulation():
    m = mbs.load("five_bar")
    configuration = dict(zip(("q1", "q2", "q3", "q4"), m.assemble().configuration, strict=True))
    for name, strength in {"q3": 0.013, "q2": 0.19, "q4": 0.17}.items():
        m.add(CoulombFriction(f"dry_{name}", joint=name, sliding=strength))
    for name in ("q1", "q4"):
        limits = {"lower": configuration[name] - 0.1, "upper": configuration[name] + 0.1}
        m.add(RigidStop(f"end_{name}", joint=name, restitution=0.6566, **limits))
    system = m.assemble()
    state, own, full = compared(system, 0.6, v0={"q1": 0.3, "q3": -0.2})
    assert len(own.events) > 100
    np.testing.assert_allclose(own.x[-1, 2:], [0, 0], atol=1e-12)
    np.testing.assert_allclose(own.x[:, 0], full["q1.q"], atol=1e-8)
    np.testing.assert_allclose(own.x[:, 1], full["q3.q"], atol=1e-8)
    assert np.array_equal(own.modes[-1], [full[name][-1] for name in state.events.modes])


def test_a_dependent_joint_stays_at_its_stop_while_the_others_move():
    limit = five_bar(0.0).configuration[1]
    system = five_bar(0.0, RigidStop("end", joint="a2", lower=limit))
    state = minimal_state(system)
    (column,) = (k for k, n in enumerate(state.dependents) if system.coordinates[n].name == "a2")
    own = moved(
        system,
        state,
        np.linspace(0, 2, 51),
        lambda t: [4 + 0.5 * casadi.cos(3 * t), -3],
        tolerance=1e-8,
    )
    assert np.all(own.modes == -1)
    assert np.ptp(own.x[:, 0]) > 0.3
    assert np.abs(own.z[:, column] - limit).max() < 1e-8


def test_a_joint_of_a_floating_mechanism_meets_its_stop():
    m = Mechanism("satellite", gravity=(0, 0, 0))
    body = m.add(Body("body", mass=12, inertia=(2, 3, 4)))
    m.connect(m.world, Free("f"), body)
    arm = m.add(Box("arm", length=0.6, width=0.1, density=900))
    m.connect(body, Revolute("hinge", axis="y", actuated=True), arm.left)
    m.add(RigidStop("end", joint="hinge", upper=0.4, restitution=0.5))
    m.add(CoulombFriction("dry", joint="hinge", sliding=0.05))
    system = m.assemble()
    state, own, full = compared(system, 1.5, v0={"hinge": 1.0, "f.wx": 0.3}, tau={"hinge": 0.2})
    assert len(own.events) >= 2
    assert largest_error(system, state, own, full) < 1e-8


def test_what_is_held_has_no_acceleration_and_stands_at_its_limit():
    system = pendulum(RigidStop("end", joint="q", lower=-0.6))
    state = minimal_state(system)
    x, moments = [-0.6 - 1e-12, -1e-3], [0.0]
    after, modes = state.events.jump(0.0, x, [], moments, [0.0], [1, 0])
    assert (float(after[0]), float(after[1]), float(modes)) == (-0.6, 0.0, -1.0)
    xdot, y = state.rhs(0.0, after, [], moments, modes)
    assert np.array_equal(np.array(xdot)[:, 0], [0.0, 0.0])
    assert float(y[-1]) == pytest.approx(1.5 * G * 0.7 * np.cos(0.6), rel=1e-12)


def test_an_impact_that_is_found_late_has_the_speed_that_it_had_at_the_limit():
    """A block on a slope of constant acceleration, whose stop is passed by a micrometre."""
    system = block(0.3, RigidStop("end", joint="x", upper=0.5, restitution=0.6))
    state, rise, late = minimal_state(system), G * np.sin(0.3), 1e-6
    for speed, back in ((0.8, 0.6 * np.sqrt(0.64 - 2 * rise * late)), (2.4e-3, 0.0)):
        after, modes = state.events.jump(0, [0.5 + late, speed], [], [0], [0], [1, 0])
        assert float(after[0]) == 0.5
        assert float(after[1]) == pytest.approx(-back, rel=1e-12)
        assert float(modes) == (back == 0)


def test_an_impact_of_a_dependent_joint_that_is_found_late_is_put_on_its_limit():
    system = stopped_rocker()
    state = minimal_state(system)
    x, z = start_of(system, state, {"b1": 2.2 + 1e-6}, {"a1": 1.0})
    after, _ = state.events.jump(0, x, z, [0], [0], [1, 0])
    closed = closing(state, after, z, [])
    (row,) = (k for k, n in enumerate(state.dependents) if system.coordinates[n].name == "b1")
    assert z[row] == pytest.approx(2.2 + 1e-6, abs=1e-12)
    assert float(closed[row]) == pytest.approx(2.2, abs=1e-11)
    assert float(after[1]) < -0.3


@pytest.mark.parametrize(
    ("q", "v", "modes", "beyond"),
    [
        (0.0, 0.0, [0, 0], []),
        (0.5, 0.0, [1, 0], []),
        (0.5 + 1e-10, 0.0, [1, 0], []),
        (0.5, -1.0, [0, -1], []),
        (0.5, 1.0, [0, 1], []),
        (-0.2, 0.0, [-1, 0], []),
        (0.5 + 1e-6, 0.0, [1, 0], ["end upper"]),
        (-0.3, 1.0, [0, 1], ["end lower"]),
    ],
)
def test_the_start_tells_what_touches_and_what_is_beyond(q, v, modes, beyond):
    system = block(
        0.3,
        RigidStop("end", joint="x", lower=-0.2, upper=0.5),
        CoulombFriction("dry", joint="x", sliding=1.0),
    )
    events = minimal_state(system).events
    found, outside = events.first(0.0, [q, v], [], [0.0], [0.0, 0.0])
    assert np.array_equal(np.array(found)[:, 0], modes)
    flags = np.array(outside)[:, 0] > 0
    assert [name for name, flag in zip(events.names, flags, strict=True) if flag] == beyond


def test_a_motion_is_not_prescribed_where_a_contact_acts():
    system = stick_slip()
    with pytest.raises(ModelError, match="motion prescribes x, on which a rigid stop or Coulomb"):
        minimal_state(system, drive=DriveInputs(motions=(("x", "a"),)))
