"""Play, losses, planetary gears, brakes and clutches: motions against hand formulas, heat."""

from dataclasses import replace

import numpy as np
import pytest
from support.messages import refused
from support.parts import asked, metered, run, stored

import mbs
from mbs.components import (
    Body,
    Brake,
    Clutch,
    DCMotor,
    ElasticShaft,
    ElastoBacklash,
    FixedFlange,
    IdealGear,
    LossyGear,
    OneWayClutch,
    PlanetaryGear,
    QuadraticSpeedTorque,
    Revolute,
    ShaftDamper,
    ShaftInertia,
    ShaftSpringDamperSeries,
    TorqueSource,
)
from mbs.errors import AssemblyError, DescriptionError


def line(*connections):
    m = mbs.Mechanism("line", gravity=(0, 0, 0))
    for a, b in connections:
        m.connect(a, b)
    return asked(m)


def between(part, inertia_a=0.2, inertia_b=0.5):
    """Two inertias, a and b, with a part between them."""
    a, b = ShaftInertia("a", inertia_a), ShaftInertia("b", inertia_b)
    return line((a.flange_b, part.flange_a), (part.flange_b, b.flange_a))


def test_a_maxwell_shaft_follows_its_linear_equations():
    kind = metered(ShaftSpringDamperSeries)
    system = between(kind("soft", stiffness=40.0, damping=3.0))
    result = run(system, 2.0, q0={"a": 0.3})
    # x twist, w its rate, z in the damper
    A = np.array([[0, 1, 0], [-40 * 7, 0, 40 * 7], [40 / 3, 0, -40 / 3]])
    values, vectors = np.linalg.eig(A)
    shares = np.linalg.solve(vectors, np.array([0.3, 0, 0], dtype=complex))
    x, _, z = (vectors @ (shares[:, None] * np.exp(np.outer(values, result.time)))).real
    np.testing.assert_allclose(result["a.q"] - result["b.q"], x, atol=1e-9)
    np.testing.assert_allclose(result["soft.torque"], 40 * (x - z), atol=1e-7)
    np.testing.assert_allclose(stored(result, "soft"), 20 * 0.3**2, atol=1e-8)


def test_within_the_backlash_nothing_acts_and_flanks_give_all_back():
    system = between(ElastoBacklash("mesh", stiffness=2e3, backlash=0.2, width=5e-3))
    result = run(system, 0.5, v0={"a": 2.0})
    x = result["a.q"] - result["b.q"]
    free = np.abs(x) < 0.1
    assert np.all(result["mesh.torque"][free] == 0)
    first = result.time < 0.05
    np.testing.assert_allclose(x[first], 2 * result.time[first], atol=1e-12)
    assert np.count_nonzero(np.diff(np.sign(np.diff(x)))) == 4
    np.testing.assert_allclose(stored(result), 0.4, atol=1e-8)
    # deeper than the width the stiffness is all there: T = k (d - width / 2)
    deep = np.abs(x) > 0.105
    depth = np.sign(x) * (np.abs(x) - 0.1 - 0.0025)
    assert np.count_nonzero(deep) > 3
    np.testing.assert_allclose(result["mesh.torque"][deep], 2e3 * depth[deep], rtol=1e-12)


def test_damped_backlash_turns_what_is_lost_into_heat():
    kind = metered(ElastoBacklash)
    system = between(kind("mesh", stiffness=2e3, backlash=0.2, damping=3.0, width=5e-3))
    result = run(system, 0.5, v0={"a": 2.0})
    assert result["mesh.heat"][-1] > 0.1
    np.testing.assert_allclose(stored(result, "mesh"), 0.4, atol=1e-8)


def planetary(ring):
    gear, motor = PlanetaryGear("gear", ratio=2.5), TorqueSource("motor")
    sun, carrier = ShaftInertia("sun", 0.1), ShaftInertia("carrier", 0.5)
    return line(
        (motor.flange, sun.flange_a),
        (sun.flange_b, gear.sun),
        (gear.ring, ring),
        (gear.carrier, carrier.flange_a),
    )


def test_a_planetary_gear_is_exact():
    system = planetary(ShaftInertia("ring", 0.3).flange_a)
    assert system.closure.mobility == 2
    result = run(system, 1.0, u={"motor": 1.0})
    for kind in "qva":
        left = (
            result[f"sun.{kind}"] + 2.5 * result[f"ring.{kind}"] - 3.5 * result[f"carrier.{kind}"]
        )
        np.testing.assert_allclose(left, 0, atol=1e-13)
    # T / J of the sun: 0.1 a = 1 + T, 0.3 b = 2.5 T, 0.5 c = -3.5 T, a + 2.5 b = 3.5 c
    T = -10 / (1 / 0.1 + 2.5**2 / 0.3 + 3.5**2 / 0.5)
    np.testing.assert_allclose(result["gear.torque_sun"], T, rtol=1e-12)
    np.testing.assert_allclose(result["gear.torque_ring"], 2.5 * T, rtol=1e-12)
    np.testing.assert_allclose(result["gear.torque_carrier"], -3.5 * T, rtol=1e-12)
    assert result["sun.q"][-1] == pytest.approx(5 * (1 + T), abs=1e-12)
    work = result["sun.q"]  # of a torque of 1 N m
    np.testing.assert_allclose(result["kinetic_energy"], work, atol=1e-8)


def test_a_ring_that_is_held():
    system = planetary(FixedFlange("housing").flange)
    assert system.closure.mobility == 1
    result = run(system, 1.0, u={"motor": 1.0})
    assert result["carrier.a"][0] == pytest.approx(3.5 / (0.5 + 3.5**2 * 0.1), rel=1e-13)
    np.testing.assert_allclose(result["sun.q"], 3.5 * result["carrier.q"], atol=1e-13)


def test_the_fmu_of_a_planetary_gear_moves_as_the_simulation(tmp_path):
    system = planetary(ShaftInertia("ring", 0.3).flange_a)
    path = mbs.export.fmu(system, tmp_path / "gear.fmu")
    result = mbs.simulate.fmu(path, 0.5, start={"motor.tau": 1.0}, step=0.05, quiet=True)
    expected = run(system, 0.5, u={"motor": 1.0}, step=0.05)
    for name in ("sun.q", "ring.v", "gear.torque_carrier"):
        np.testing.assert_allclose(result[name], expected[name], atol=1e-9)


def lossy(kind=LossyGear, ratio=20.0, **options):
    """A motor on a shaft, a gear, and a load with its own torque."""
    numbers = {"stiffness": 5e3, "efficiency": 0.8, "efficiency_back": 0.7, "damping": 20.0}
    gear = kind("gear", ratio=ratio, **{**numbers, **options})
    motor, load = TorqueSource("motor"), TorqueSource("load")
    a, b = ShaftInertia("a", 1e-3), ShaftInertia("b", 0.4)
    friction_a, friction_b = ShaftDamper("friction_a", 0.01), ShaftDamper("friction_b", 4.0)
    return line(
        (motor.flange, a.flange_a),
        (friction_a.flange, a.flange_a),
        (a.flange_b, gear.flange_a),
        (gear.flange_b, b.flange_a),
        (friction_b.flange, b.flange_b),
        (load.flange, b.flange_b),
    )


@pytest.mark.parametrize("ratio", [20.0, -20.0])
def test_a_lossy_gear_has_its_efficiencies_in_both_directions_of_the_power(ratio):
    system = lossy(ratio=ratio)
    forward = run(system, 8.0, u={"motor": 1.5}, tolerance=1e-9, method="rodas")
    # at constant speed 1.5 = 0.01 N w + T / (0.8 N) and T = 4 w
    N = abs(ratio)
    w = 1.5 / (0.01 * N + 4 / (0.8 * N))
    assert abs(forward["b.v"][-1]) == pytest.approx(w, rel=1e-6)
    assert forward["gear.loss"][-1] == pytest.approx(0.25 * 4 * w**2, rel=1e-6)
    back = run(system, 8.0, u={"load": 30.0}, tolerance=1e-9, method="rodas")
    # 30 = 4 w + T and 0.7 T / N = 0.01 N w
    w = 30 / (4 + 0.01 * N**2 / 0.7)
    assert back["b.v"][-1] == pytest.approx(w, rel=1e-6)
    assert back["gear.loss"][-1] == pytest.approx(0.3 * 0.01 * N**2 / 0.7 * w**2, rel=1e-6)


def test_a_lossy_gear_turns_what_it_loses_into_heat():
    gear = metered(LossyGear)(
        "gear",
        ratio=5.0,
        stiffness=50.0,
        efficiency=0.8,
        efficiency_back=0.7,
        damping=0.3,
        width=1.0,
        torque_width=2.0,
    )
    result = run(between(gear, 0.02, 0.4), 2.0, q0={"a": 3.0})
    assert result["gear.heat"][-1] > 5
    np.testing.assert_allclose(stored(result, "gear"), 25 * 0.6**2, atol=1e-8)


def on_a_shaft(part, inertia=0.5):
    return line((part.flange, ShaftInertia("a", inertia).flange_a))


def test_a_fan_slows_down_as_one_over_time():
    system = on_a_shaft(metered(QuadraticSpeedTorque)("fan", coefficient=0.02))
    for start in (50.0, -50.0):
        result = run(system, 3.0, v0={"a": start})
        expected = start / (1 + 0.02 * 50 * result.time / 0.5)
        np.testing.assert_allclose(result["a.v"], expected, atol=1e-8)
        np.testing.assert_allclose(stored(result, "fan"), 625, rtol=1e-10)


def test_a_brake_stops_a_shaft_and_creeps_below_its_capacity():
    brake, load = metered(Brake)("brake", capacity=4.0, width=0.01), TorqueSource("load")
    a = ShaftInertia("a", 0.5)
    system = line((brake.flange, a.flange_a), (load.flange, a.flange_b))
    u = {"brake.engagement": 0.5}
    result = run(system, 3.0, v0={"a": 8.0}, u=u, method="rodas")
    slides = result.time < 1.9
    np.testing.assert_allclose(result["a.v"][slides], 8 - 4 * result.time[slides], atol=1e-8)
    assert abs(result["a.v"][-1]) < 1e-8
    np.testing.assert_allclose(stored(result, "brake"), 16.0, atol=1e-7)
    held = run(system, 3.0, u={**u, "load.tau": 1.0}, method="rodas")
    assert held["a.v"][-1] == pytest.approx(0.01 * np.arctanh(0.5), rel=1e-8)
    free = run(system, 1.0, v0={"a": 8.0}, u={"brake.engagement": -0.3})
    assert np.all(free["a.v"] == 8.0)


def test_a_clutch_brings_two_shafts_to_one_speed():
    clutch = metered(Clutch)("clutch", capacity=6.0, width=0.05)
    result = run(between(clutch), 1.0, v0={"a": 7.0}, u={"clutch": 0.5}, method="rodas")
    np.testing.assert_allclose(0.2 * result["a.v"] + 0.5 * result["b.v"], 1.4, atol=1e-12)
    np.testing.assert_allclose([result[f"{n}.v"][-1] for n in "ab"], 2.0, atol=1e-6)
    assert result["clutch.heat"][-1] == pytest.approx(0.5 * 7**2 / 7, abs=1e-7)
    assert result["clutch.torque"][0] == pytest.approx(3.0, rel=1e-12)


def test_a_freewheel_drives_one_way():
    wheel, motor = metered(OneWayClutch)("wheel", damping=100.0, width=0.02), TorqueSource("motor")
    a, b = ShaftInertia("a", 0.2), ShaftInertia("b", 0.5)
    system = line(
        (motor.flange, a.flange_a), (a.flange_b, wheel.flange_a), (wheel.flange_b, b.flange_a)
    )
    over = run(system, 1.0, v0={"b": 5.0}, u={"motor": -1.0})
    assert np.all(over["wheel.torque"] == 0)
    np.testing.assert_allclose(over["b.v"], 5.0, rtol=1e-15)
    drives = run(system, 2.0, u={"motor": 1.4})
    # both speed up at 2 rad/s2, b by a torque of 1 N m
    assert drives["b.a"][-1] == pytest.approx(2.0, rel=1e-8)
    slip = drives["a.v"][-1] - drives["b.v"][-1]
    assert slip == pytest.approx(1 / 100 + 0.01, rel=1e-8)
    caught = run(system, 1.0, v0={"a": 7.0})
    np.testing.assert_allclose(stored(caught, "wheel"), 4.9, atol=1e-8)


def test_a_spring_to_the_housing_swings_with_its_frequency():
    shaft, housing, a = ElasticShaft("shaft", 80.0), FixedFlange("housing"), ShaftInertia("a", 0.2)
    system = line((housing.flange, shaft.flange_a), (shaft.flange_b, a.flange_a))
    assert [c.name for c in system.coordinates] == ["a"]
    assert not system.is_closed
    result = run(system, 1.0, q0={"a": 0.1})
    np.testing.assert_allclose(result["a.q"], 0.1 * np.cos(20 * result.time), atol=1e-10)
    np.testing.assert_allclose(result["shaft.torque"], -80 * result["a.q"], atol=1e-13)


def held(*connections):
    m = mbs.Mechanism("m", gravity=(0, 0, 0))
    for a, b in connections:
        m.connect(a, b)
    return m.assemble


@pytest.mark.parametrize("kind", ["joint", "motor", "inertia", "gear"])
def test_a_mechanism_that_a_housing_holds_is_refused(kind):
    housing = FixedFlange("housing")
    if kind == "joint":
        m = mbs.Mechanism("m")
        joint = Revolute("j")
        m.connect(m.world, joint, m.add(Body("b", 1.0, inertia=(1, 1, 1))))
        m.connect(joint.flange, housing.flange)
        refused(AssemblyError, "Revolute 'j'", "FixedFlange 'housing'", by=m.assemble)
        return
    gear = IdealGear("part", 2.0)
    pairs = {
        "motor": [(DCMotor("part", resistance=1, inductance=0, constant=1).flange, housing.flange)],
        "inertia": [(ShaftInertia("part", 1.0).flange_a, housing.flange)],
        "gear": [(gear.flange_a, housing.flange), (gear.flange_b, ShaftInertia("s", 1).flange_a)],
    }
    by = held(*pairs[kind])
    refused(AssemblyError, "there is no joint that moves", by=by)


def test_parts_that_only_the_housing_has_are_refused():
    spring, brake = ElasticShaft("shaft", 80.0), Brake("brake", capacity=1.0)
    one, other = FixedFlange("one"), FixedFlange("other")
    by = held((one.flange, spring.flange_a), (other.flange, spring.flange_b))
    refused(AssemblyError, "'shaft'", "rigid shaft", by=by)
    free = ShaftInertia("free", 1.0), ShaftDamper("damper", 1.0)
    by = held((one.flange, brake.flange), (free[0].flange_a, free[1].flange))
    refused(AssemblyError, "brake", "FixedFlange", "does nothing", by=by)


LOSSY = {"ratio": 3.0, "stiffness": 10.0, "efficiency": 0.9, "efficiency_back": 0.8}


@pytest.mark.parametrize(
    ("make", "parts"),
    [
        (lambda: PlanetaryGear("p", ratio=0), ["p: ratio is 0", "more than zero"]),
        (lambda: LossyGear("p", **{**LOSSY, "ratio": 0}), ["p: ratio is 0, which ties nothing"]),
        (lambda: LossyGear("p", **{**LOSSY, "efficiency": 1.1}), ["p: efficiency is 1.1"]),
        (lambda: LossyGear("p", **{**LOSSY, "efficiency": 0}), ["p: efficiency is 0"]),
        (lambda: LossyGear("p", **{**LOSSY, "efficiency_back": -1}), ["efficiency_back is -1"]),
        (lambda: ElastoBacklash("p", stiffness=0, backlash=1), ["p: stiffness is 0 N.m/rad"]),
        (lambda: ElastoBacklash("p", stiffness=1, backlash=-1), ["p: backlash is -1 rad"]),
        (lambda: ElastoBacklash("p", stiffness=1, backlash=1, width=0), ["p: width is 0 rad"]),
        (lambda: Brake("p", capacity=-1), ["p: capacity is -1 N.m"]),
        (lambda: Clutch("p", capacity=1, width=0), ["p: width is 0 rad/s"]),
        (lambda: OneWayClutch("p", damping=0), ["p: damping is 0"]),
        (lambda: QuadraticSpeedTorque("p", coefficient=-2), ["p: coefficient is -2"]),
        (lambda: ShaftSpringDamperSeries("p", stiffness=1, damping=0), ["p: damping is 0"]),
    ],
)
def test_descriptions_that_are_refused(make, parts):
    refused(DescriptionError, *parts, by=make)


def test_models_of_a_planetary_gear_know_the_efforts_of_its_row():
    system = planetary(ShaftInertia("ring", 0.3).flange_a)
    T = -10 / (1 / 0.1 + 2.5**2 / 0.3 + 3.5**2 / 0.5)
    devices = mbs.models.devices(system)
    assert devices.name_in() == ["v", "z", "u", "row_efforts"]
    tau, _, y = devices([1, 2, 3], [], [1.0], [T])
    np.testing.assert_allclose(np.array(tau).ravel(), [1, 0, 0])
    np.testing.assert_allclose(np.array(y).ravel(), [1, T, 2.5 * T, -3.5 * T], rtol=1e-14)
    d = mbs.models.dae(system, "index1", inputs={"motor.tau": 1.0})
    np.testing.assert_allclose(d.z0, [10 * (1 + T), 2.5 * T / 0.3, -3.5 * T / 0.5, T], rtol=1e-12)


def test_every_number_may_be_a_symbol():
    parts = [
        ShaftSpringDamperSeries("p0", stiffness=40.0, damping=3.0),
        ElastoBacklash("p1", stiffness=2e3, backlash=0.2, damping=3.0, width=5e-3),
        LossyGear("p2", **LOSSY, damping=0.2),
        Clutch("p3", capacity=6.0, width=0.05),
        OneWayClutch("p4", damping=100.0, width=0.02),
    ]

    def chain(parts):
        shafts = [ShaftInertia(f"s{k}", 0.1 * (k + 1)) for k in range(len(parts) + 1)]
        pairs = []
        for part, a, b in zip(parts, shafts, shafts[1:], strict=False):
            pairs += [(a.flange_b, part.flange_a), (part.flange_b, b.flange_a)]
        return mbs.models.inverse_dynamics(line(*pairs))

    symbolic = []
    for part in parts:
        values = {name: getattr(part, name) for name in part.names_of("parameter")}
        named = {n: mbs.Parameter(f"{part.name}_{n}", float(str(x))) for n, x in values.items()}
        symbolic.append(replace(part, **named))
    numbers, symbols = chain(parts), chain(symbolic)
    rng = np.random.default_rng(2)
    given = [*rng.uniform(-1, 1, (3, 6)), [0.1], [0.4]]
    tau = np.array(numbers(*given))
    assert np.all(tau != 0)
    np.testing.assert_allclose(symbols(*given), tau, rtol=1e-12)
    assert symbols.numel_in("p") == 2 + 4 + 7 + 3 + 2
