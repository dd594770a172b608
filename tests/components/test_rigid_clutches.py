"""Brakes, clutches and freewheels that stick: common speeds, times of sticking, heat, FMUs."""

import casadi
import fmpy
import numpy as np
import pytest
from support.messages import refused
from support.parts import asked, run

import mbs
from mbs.components import (
    Body,
    CoulombFriction,
    FixedFlange,
    IdealGear,
    PointMass,
    Prismatic,
    Revolute,
    RigidBrake,
    RigidClutch,
    RigidOneWayClutch,
    RigidSlidingBrake,
    RigidStop,
    ShaftInertia,
    TorqueSource,
)
from mbs.errors import AssemblyError, DescriptionError, ModelError

J_A, J_B, CAPACITY = 0.2, 0.5, 3.0


def line(*connections):
    m = mbs.Mechanism("line", gravity=(0, 0, 0))
    for a, b in connections:
        m.connect(a, b)
    return asked(m)


def between(part, *more):
    """Two inertias, a and b, with a part between them and torques on a."""
    a, b = ShaftInertia("a", J_A), ShaftInertia("b", J_B)
    drives = [(source.flange, a.flange_a) for source in more]
    return line((a.flange_b, part.flange_a), (part.flange_b, b.flange_a), *drives)


def test_a_clutch_brings_two_inertias_to_a_common_speed():
    system = between(RigidClutch("clutch", capacity=CAPACITY))
    w_a, w_b = 30.0, -4.0
    result = run(system, 2.0, v0={"a": w_a, "b": w_b}, u={"clutch.engagement": 1.0})
    sticks = J_A * J_B * (w_a - w_b) / ((J_A + J_B) * CAPACITY)
    assert result.events == ((pytest.approx(sticks, abs=1e-10), "clutch", "sticks"),)
    common = (J_A * w_a + J_B * w_b) / (J_A + J_B)
    t = np.minimum(result.time, sticks)
    np.testing.assert_allclose(result["a.v"], w_a - CAPACITY / J_A * t, atol=1e-9)
    np.testing.assert_allclose(result["b.v"], w_b + CAPACITY / J_B * t, atol=1e-9)
    stuck = result.time > sticks
    assert np.abs(result["a.v"] - result["b.v"])[stuck].max() < 1e-12
    # the event comes at a slip of CREEP, 1e-10 rad/s
    np.testing.assert_allclose(result["a.v"][stuck], common, atol=1e-9)
    np.testing.assert_allclose(result["clutch.effort"], np.where(stuck, 0, CAPACITY), atol=1e-12)


def test_a_clutch_slips_where_its_limit_is_passed_and_sticks_again():
    drive = TorqueSource("drive")
    system = between(RigidClutch("clutch", capacity=CAPACITY, sticking=1.2), drive)
    # a drives b through the clutch: it transmits T J_B / (J_A + J_B)
    share = J_B / (J_A + J_B)
    result = run(system, 4.0, u=lambda t, q, v: [1.0, 6.0 * casadi.sin(t)], step=0.005)
    slips = np.arcsin(1.2 * CAPACITY / share / 6.0)
    assert result.events[0] == (pytest.approx(slips, abs=1e-9), "clutch", "slides")
    assert result.events[1][1:] == ("clutch", "sticks")
    # slip: J_A w_a' = 6 sin t - 3, J_B w_b' = 3, until both speeds are equal
    back = result.events[1][0]
    slip = (6 * (np.cos(slips) - np.cos(back)) - CAPACITY * (back - slips)) / J_A
    assert slip == pytest.approx(CAPACITY * (back - slips) / J_B, abs=1e-8)
    sticks = (result.time < slips) | (result.time > back)
    assert np.abs(result["a.v"] - result["b.v"])[sticks].max() < 1e-12
    torque = share * 6.0 * np.sin(result.time)
    np.testing.assert_allclose(result["clutch.effort"][sticks], torque[sticks], atol=1e-9)


def test_an_open_clutch_transmits_nothing_and_takes_hold_when_it_is_engaged():
    drive = TorqueSource("drive")
    system = between(RigidClutch("clutch", capacity=CAPACITY), drive)
    # engaged from t = 1 on, by a ramp that is zero before
    result = run(
        system, 3.0, u=lambda t, q, v: [casadi.fmax(t - 1, 0), 0.5], step=0.01, tolerance=1e-9
    )
    free = result.time < 0.995
    np.testing.assert_allclose(result["a.v"][free], 0.5 / J_A * result.time[free], atol=1e-9)
    assert np.abs(result["b.v"][free]).max() < 1e-12
    # angular momentum, whatever the clutch does
    momentum = J_A * result["a.v"] + J_B * result["b.v"]
    np.testing.assert_allclose(momentum, 0.5 * result.time, atol=1e-8)
    # w' = 0.5 / J_A - 3 (t - 1) (1 / J_A + 1 / J_B) while it slips: zero at t = 1 + s
    rate = CAPACITY * (1 / J_A + 1 / J_B)
    s = np.roots([-rate / 2, 0.5 / J_A, 0.5 / J_A]).max()
    assert result.events[-1] == (pytest.approx(1 + s, abs=1e-7), "clutch", "sticks")
    assert abs(result["a.v"][-1] - result["b.v"][-1]) < 1e-12


def test_a_brake_stops_a_shaft_and_holds_it_up_to_its_capacity():
    brake, shaft, drive = (
        RigidBrake("brake", capacity=2.0),
        ShaftInertia("a", J_A),
        TorqueSource("T"),
    )
    system = line((brake.flange, shaft.flange_a), (drive.flange, shaft.flange_b))
    inputs = [name for name, _ in system.inputs]
    assert inputs == ["brake.engagement", "T.tau"]
    # 0.5 of it brakes with 1 N m; the load of t N m moves the shaft from t = 1 s on
    result = run(system, 2.0, v0={"a": 1.5}, u=lambda t, q, v: [0.5, t], step=0.01)
    # J w' = t - 1: it comes to rest where t - t^2 / 2 = 1.5 J, before 1 s
    stops = 1 - np.sqrt(1 - 2 * 1.5 * J_A)
    first, second = result.events
    assert first == (pytest.approx(stops, abs=1e-9), "brake", "sticks")
    assert second == (pytest.approx(1.0, abs=1e-9), "brake", "slides")
    held = (result.time > stops) & (result.time < 1)
    assert np.abs(result["a.v"][held]).max() < 1e-12
    assert np.ptp(result["a.q"][held]) < 1e-12
    np.testing.assert_allclose(result["brake.effort"][held], -result.time[held], atol=1e-12)
    late = result.time > 1
    np.testing.assert_allclose(
        result["a.v"][late], (result.time[late] - 1) ** 2 / (2 * J_A), atol=1e-9
    )


def test_a_freewheel_drives_and_lets_its_driven_side_run_on():
    system = between(RigidOneWayClutch("free"), TorqueSource("drive"))
    # 2 cos 2t accelerates a from 1 rad/s, b runs at 5 rad/s: they meet at sin 2t = 4 J_A
    result = run(
        system, 3.5, v0={"a": 1.0, "b": 5.0}, u=lambda t, q, v: [2 * casadi.cos(2 * t)], step=0.01
    )
    locks, frees = np.arcsin(4 * J_A) / 2, np.pi / 4
    assert [what for *_, what in result.events] == ["locks", "frees"]
    assert [t for t, *_ in result.events] == pytest.approx([locks, frees], abs=1e-9)
    slip = result["b.v"] - result["a.v"]
    assert slip.min() > -1e-12
    locked = (result.time > locks) & (result.time < frees)
    assert np.abs(slip[locked]).max() < 1e-12
    torque = J_B / (J_A + J_B) * 2 * np.cos(2 * result.time)
    np.testing.assert_allclose(result["free.effort"], np.where(locked, torque, 0), atol=1e-9)
    assert result["free.effort"].min() > -1e-12
    # b keeps what it had when it was let go
    common = 5 + (np.sin(2 * frees) - np.sin(2 * locks)) / (J_A + J_B)
    np.testing.assert_allclose(result["b.v"][result.time > frees], common, atol=1e-9)


@pytest.mark.parametrize("w_a", [1.0, -1.0, 3.0])
def test_an_impact_behind_a_freewheel_is_shared_where_it_locks(w_a):
    m = mbs.Mechanism("line", gravity=(0, 0, 0))
    a, b, free = ShaftInertia("a", J_A), ShaftInertia("b", J_B), RigidOneWayClutch("free")
    m.connect(a.flange_b, free.flange_a)
    m.connect(free.flange_b, b.flange_a)
    m.add(RigidStop("stop", "b", upper=1.0, restitution=0.5))
    result = run(asked(m), 1.0, v0={"a": w_a, "b": 5.0})
    # b comes back with -2.5, slower than a: a plastic impact, momentum is kept in it
    assert [what for *_, what in result.events] == ["bounces off upper", "locks"]
    common = (J_A * w_a - J_B * 2.5) / (J_A + J_B)
    assert result["a.v"][-1] == pytest.approx(common, abs=1e-9)
    assert result["b.v"][-1] == pytest.approx(common, abs=1e-9)


def test_a_freewheel_follows_a_shaft_that_is_driven():
    system = between(RigidOneWayClutch("free"))
    result = run(system, 3.0, motion={"a.v": lambda t: casadi.sin(t)}, step=0.01)
    # b follows up to the largest speed, and keeps it
    np.testing.assert_allclose(
        result["b.v"], np.where(result.time < np.pi / 2, np.sin(result.time), 1.0), atol=1e-9
    )
    assert result.events == ((pytest.approx(np.pi / 2, abs=1e-8), "free", "frees"),)


def test_an_open_clutch_has_few_events_and_no_torque():
    system = between(RigidClutch("clutch", capacity=CAPACITY), TorqueSource("drive"))
    result = run(system, 10.0, u=lambda t, q, v: [-1.0, casadi.cos(5 * t)])
    assert len(result.events) < 20  # one for each change of the sign of the slip
    np.testing.assert_allclose(result["a.v"], np.sin(5 * result.time) / 5 / J_A, atol=1e-9)
    assert np.abs(result["b.v"]).max() < 1e-12


def test_a_freewheel_that_starts_against_its_direction_is_refused():
    refused(
        ModelError,
        "free starts at the velocity -1",
        "start it at zero or above",
        by=lambda: run(between(RigidOneWayClutch("free")), 1.0, v0={"a": 1.0}),
    )


def test_a_one_way_ratchet_on_an_arm_lets_it_only_rise():
    """A pendulum whose shaft is locked to the housing in one direction."""
    m = mbs.Mechanism("ratchet", gravity=(0, 0, -9.81))
    arm = m.add(Body("arm", mass=1.0, com=(0.3, 0, 0), inertia=(0, 0.02, 0.02)))
    joint = Revolute("j", axis="-y", actuated=False)
    m.connect(m.world, joint, arm)
    ratchet = RigidOneWayClutch("ratchet")
    m.connect(ratchet.flange_a, FixedFlange("housing").flange)
    m.connect(ratchet.flange_b, joint.flange)
    result = run(asked(m), 2.0, v0={"j": 3.0}, step=0.005)
    # it rises to where its energy is used up, and stays there
    height = 0.5 * (0.02 + 0.09) * 3.0**2 / 9.81
    assert result["j.q"][-1] == pytest.approx(np.arcsin(height / 0.3), abs=1e-9)
    assert [what for *_, what in result.events] == ["locks"]
    assert abs(result["j.v"][-1]) < 1e-12
    assert result["ratchet.effort"][-1] == pytest.approx(
        9.81 * 0.3 * np.cos(result["j.q"][-1]), abs=1e-9
    )


def test_a_clutch_behind_a_gear_and_a_brake_share_one_shaft():
    a, b = ShaftInertia("a", J_A), ShaftInertia("b", J_B)
    gear, clutch = IdealGear("gear", ratio=2.0), RigidClutch("clutch", capacity=CAPACITY)
    brake = RigidBrake("brake", capacity=0.4)
    system = line(
        (a.flange_b, gear.flange_a),
        (gear.flange_b, clutch.flange_a),
        (clutch.flange_b, b.flange_a),
        (brake.flange, b.flange_b),
    )
    result = run(system, 30.0, v0={"a": 20.0}, u={"clutch": 1.0, "brake": 1.0}, step=0.01)
    # at flange_b of the gear a counts 4 J_A; slip a / 2 - b
    slips = 10.0 / (CAPACITY / (4 * J_A) + (CAPACITY - 0.4) / J_B)
    common = (CAPACITY - 0.4) / J_B * slips
    rest = slips + common * (4 * J_A + J_B) / 0.4
    assert [(name, what) for _, name, what in result.events if what == "sticks"] == [
        ("clutch", "sticks"),
        ("brake", "sticks"),
    ]
    times = [t for t, _, what in result.events if what == "sticks"]
    assert times == pytest.approx([slips, rest], abs=1e-8)
    assert max(abs(result["a.v"][-1]), abs(result["b.v"][-1])) < 1e-12


def test_a_brake_on_a_slide_and_friction_of_its_rail_hold_together():
    m = mbs.Mechanism("slide", gravity=(0, 0, -10.0))
    load = m.add(PointMass("load", 0.5))
    joint = Prismatic("z", axis="z", actuated=False)
    m.connect(m.world, joint, load)
    brake = RigidSlidingBrake("brake", capacity=4.0, sticking=1.25)
    m.connect(brake.flange, joint.flange)
    m.add(CoulombFriction("rail", "z", sliding=1.0))
    system = asked(m)
    # the load needs 5 N: the rail holds one, the brake five
    held = run(system, 1.0, u={"brake": 1.0})
    assert np.abs(held["z.v"]).max() < 1e-12
    total = held["brake.effort"] + held["rail.effort"]
    np.testing.assert_allclose(total, 5.0, atol=1e-9)
    # 0.6 of it holds 3 + 1: it slides, braked by 2.4 + 1
    falls = run(system, 1.0, u={"brake": 0.6})
    np.testing.assert_allclose(falls["z.a"], -(5.0 - 3.4) / 0.5, atol=1e-9)
    assert falls.units["brake.effort"] == "N"


@pytest.mark.parametrize(("fmi", "kind"), [("2.0", "ModelExchange"), ("3.0", "CoSimulation")])
def test_an_fmu_of_a_clutch_and_a_freewheel_moves_as_run_does(tmp_path, fmi, kind):
    a, b, c = ShaftInertia("a", J_A), ShaftInertia("b", J_B), ShaftInertia("c", 0.1)
    clutch, free = RigidClutch("clutch", capacity=CAPACITY), RigidOneWayClutch("free")
    system = line(
        (a.flange_b, clutch.flange_a),
        (clutch.flange_b, b.flange_a),
        (b.flange_b, free.flange_a),
        (free.flange_b, c.flange_a),
    )
    speeds = {"a": 20.0, "b": -2.0, "c": 1.5}
    here = run(system, 2.0, v0=speeds, u={"clutch": 1.0}, step=0.01)
    assert [what for *_, what in here.events] == ["locks", "sticks"]
    path = mbs.export.fmu(system, tmp_path / "line.fmu", fmi=fmi)
    modes = {v.name: v.description for v in fmpy.read_model_description(str(path)).modelVariables}
    assert "direction of sliding" in modes["clutch.mode"]
    assert "-1 where it is locked" in modes["free.mode"]
    there = mbs.simulate.fmu(
        path,
        2.0,
        start={**{f"{name}.v": w for name, w in speeds.items()}, "clutch.engagement": 1.0},
        kind=kind,
        step=0.01,
        tolerance=1e-10,
        quiet=True,
    )
    compared = [
        k for k, t in enumerate(here.time) if all(abs(t - e) > 1e-6 for e, *_ in here.events)
    ]
    rows = [np.flatnonzero(np.abs(there.time - t) < 1e-9)[-1] for t in here.time[compared]]
    for column in ("a.v", "b.v", "c.v", "clutch.effort", "free.effort"):
        # stuck velocities return within 1 / RETURN_RATE where nothing projects
        assert np.abs(there[column][rows] - here[column][compared]).max() < 1e-7, column
    assert there["clutch.mode"][-1] == 0
    assert there["free.mode"][-1] == -1


def test_what_holds_nothing_is_refused():
    refused(DescriptionError, "sticking is 0.5", by=lambda: RigidClutch("c", 1.0, sticking=0.5))
    shaft, clutch = ShaftInertia("a", J_A), RigidClutch("clutch", capacity=1.0)
    m = mbs.Mechanism("m")
    m.connect(shaft.flange_a, clutch.flange_a)
    m.connect(shaft.flange_b, clutch.flange_b)
    system = m.assemble()
    told = "nothing moves what clutch (RigidClutch) holds"
    refused(ModelError, told, by=lambda: run(system, 1.0))
    brake = RigidBrake("brake", capacity=1.0)
    refused(
        AssemblyError,
        "brake: what it acts on",
        "does nothing",
        by=lambda: line(
            (brake.flange, FixedFlange("wall").flange),
            (ShaftInertia("b", J_B).flange_a, RigidBrake("other", capacity=1.0).flange),
        ),
    )
