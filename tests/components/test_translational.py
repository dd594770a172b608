"""Lines of parts that slide: motions against hand formulas, what may be connected."""

import numpy as np
import pytest
from support.messages import refused
from support.parts import asked, metered, run, stored

import mbs
from mbs.components import (
    ElasticShaft,
    ElastoGap,
    FixedFlange,
    ForceSource,
    IdealGear,
    PointMass,
    Prismatic,
    ShaftInertia,
    SlidingBrake,
    SlidingDamper,
    SlidingForceInput,
    SlidingMass,
    SlidingSpring,
    TorqueSource,
)
from mbs.errors import AssemblyError, DescriptionError


def line(*connections, m=None):
    m = m or mbs.Mechanism("line", gravity=(0, 0, -9.81))
    for a, b in connections:
        m.connect(a, b)
    return m


def test_two_masses_on_a_spring_have_their_frequency():
    a, b = SlidingMass("a", mass=2.0), SlidingMass("b", mass=3.0)
    spring = SlidingSpring("spring", stiffness=100.0, length=0.2)
    system = asked(line((a.flange_b, spring.flange_a), (spring.flange_b, b.flange_a)))
    assert [(c.name, c.unit) for c in system.coordinates] == [("a", "m"), ("b", "m")]
    result = run(system, 1.0, q0={"b": 0.25})
    swing = 0.05 * np.cos(np.sqrt(100 * (1 / 2 + 1 / 3)) * result.time)
    np.testing.assert_allclose(result["b.q"] - result["a.q"], 0.2 + swing, atol=1e-10)
    np.testing.assert_allclose(result["spring.force"], 100 * swing, atol=1e-8)
    np.testing.assert_allclose(2 * result["a.v"] + 3 * result["b.v"], 0, atol=1e-12)
    report = system.report()
    assert "prismatic a from the base carries a slide of a drive line" in report
    assert "SlidingSpring spring acts between a and b." in report


def test_masses_that_are_connected_are_one():
    a, b, push = SlidingMass("a", mass=2.0), SlidingMass("b", mass=3.0), ForceSource("push")
    system = asked(line((a.flange_b, b.flange_a), (push.flange, b.flange_b)))
    assert run(system, 1.0, u={"push": 10.0})["a.v"][-1] == pytest.approx(2.0, rel=1e-12)
    assert "SlidingMass b slides with a, which has its mass." in system.report()


def test_a_prismatic_joint_is_a_slide():
    m = mbs.Mechanism("rail", gravity=(0, 0, -9.81))
    joint = Prismatic("z", axis="z", actuated=False)
    m.connect(m.world, joint, m.add(PointMass("mass", 2.0)))
    spring, housing = SlidingSpring("spring", stiffness=200.0), FixedFlange("housing")
    system = asked(line((housing.flange, spring.flange_a), (spring.flange_b, joint.flange), m=m))
    result = run(system, 1.0)
    sag = 2 * 9.81 / 200
    np.testing.assert_allclose(result["z.q"], sag * (np.cos(10 * result.time) - 1), atol=1e-10)


def test_a_damper_takes_all_energy():
    a, damper, housing = (
        SlidingMass("a", mass=2.0),
        metered(SlidingDamper)("damper", damping=5.0),
        FixedFlange("housing"),
    )
    system = asked(line((a.flange_b, damper.flange_a), (damper.flange_b, housing.flange)))
    result = run(system, 1.0, v0={"a": 3.0})
    np.testing.assert_allclose(result["a.v"], 3 * np.exp(-2.5 * result.time), atol=1e-9)
    np.testing.assert_allclose(stored(result, "damper"), 9.0, atol=1e-8)


def test_a_gap_pushes_where_slides_touch_and_gives_all_back():
    def bouncing(**options):
        a, housing = SlidingMass("a", mass=2.0), FixedFlange("wall")
        gap = metered(ElastoGap)("gap", stiffness=5e3, width=2e-3, length=-0.1, **options)
        # x = position of a less that of the wall; they touch below -0.1 m
        return asked(line((housing.flange, gap.flange_a), (gap.flange_b, a.flange_a)))

    result = run(bouncing(), 0.4, v0={"a": -1.0}, step=1e-4)
    free = result["a.q"] > -0.1
    assert np.all(result["gap.force"][free] == 0)
    before = result.time < 0.1
    np.testing.assert_allclose(result["a.q"][before], -result.time[before], atol=1e-12)
    assert result["a.v"][-1] == pytest.approx(1.0, abs=1e-9)
    np.testing.assert_allclose(stored(result, "gap"), 1.0, atol=1e-8)
    pushed = result["gap.force"].min()
    # the deepest point x: k (d^2 / 2 - d w / 2 + 3 w^2 / 20) = 1 J, as the areas of the ramp say
    w = 2e-3
    deepest = np.roots([0.5, -w / 2, 0.15 * w**2 - 1 / 5e3]).max()
    assert pushed == pytest.approx(-5e3 * (deepest - w / 2), rel=1e-5)  # between rows
    damped = run(bouncing(damping=20.0), 0.4, v0={"a": -1.0})
    assert 0.3 < damped["a.v"][-1] < 0.9
    np.testing.assert_allclose(stored(damped, "gap"), 1.0, atol=1e-8)


def test_a_damped_spring_between_slides():
    a, b = SlidingMass("a", mass=2.0), SlidingMass("b", mass=3.0)
    spring = metered(SlidingSpring)("spring", stiffness=100.0, length=0.2, damping=4.0)
    system = asked(line((a.flange_b, spring.flange_a), (spring.flange_b, b.flange_a)))
    result = run(system, 1.0, q0={"b": 0.25})
    np.testing.assert_allclose(stored(result, "spring"), 50 * 0.05**2, atol=1e-9)


def test_a_brake_and_a_force_between_slides():
    a, b, push = SlidingMass("a", mass=2.0), SlidingMass("b", mass=3.0), SlidingForceInput("push")
    brake = metered(SlidingBrake)("brake", capacity=40.0, width=0.01)
    m = line((a.flange_b, push.flange_a), (push.flange_b, b.flange_a), (brake.flange, b.flange_b))
    system = asked(m)
    result = run(system, 1.0, u={"push.force": 6.0})
    np.testing.assert_allclose(result["a.v"], -3 * result.time, atol=1e-11)
    np.testing.assert_allclose(result["b.v"], 2 * result.time, atol=1e-11)
    u = {"brake.engagement": 0.3}
    stopped = run(system, 2.0, v0={"b": 5.0}, u=u, method="rodas")
    slides = stopped.time < 1.2
    np.testing.assert_allclose(stopped["b.v"][slides], 5 - 4 * stopped.time[slides], atol=1e-8)
    assert stopped["b.q"][-1] == pytest.approx(25 / 8, abs=1e-4)  # and what it creeps at the end
    np.testing.assert_allclose(stored(stopped, "brake"), 37.5, atol=1e-7)
    held = run(system, 2.0, u={**u, "push.force": 6.0}, method="rodas")
    assert held["b.v"][-1] == pytest.approx(0.01 * np.arctanh(0.5), rel=1e-8)


def test_a_gear_leads_from_a_shaft_to_a_slide():
    motor, rotor, rack = TorqueSource("motor"), ShaftInertia("rotor", 0.02), IdealGear("rack", 50)
    table = SlidingMass("table", mass=10.0)
    system = asked(
        line(
            (motor.flange, rotor.flange_a),
            (rotor.flange_b, rack.flange_a),
            (rack.flange_b, table.flange_a),
        )
    )
    result = run(system, 1.0, u={"motor": 3.0})
    (name,) = [c.name for c in system.coordinates]
    # 10 kg are 10 / 50^2 at the rotor
    alpha = 3.0 / (0.02 + 10 / 2500)
    assert result[f"{name}.v"][-1] == pytest.approx(alpha * (1 if name == "rotor" else 1 / 50))


@pytest.mark.parametrize(
    ("pair", "parts"),
    [
        (
            lambda: (SlidingMass("a", mass=1).flange_b, ShaftInertia("s", 1).flange_a),
            ["s.flange_a turns but SlidingMass 'a' slides", "IdealGear"],
        ),
        (
            lambda: (ShaftInertia("s", 1).flange_a, SlidingMass("a", mass=1).flange_b),
            ["s.flange_a turns but SlidingMass 'a' slides"],
        ),
        (
            lambda: (TorqueSource("t").flange, SlidingMass("a", mass=1).flange_b),
            ["t.flange turns but SlidingMass 'a' slides"],
        ),
        (
            lambda: (ForceSource("f").flange, ShaftInertia("s", 1).flange_b),
            ["s.flange_b turns but ForceSource 'f' slides"],
        ),
    ],
)
def test_shafts_and_slides_are_not_connected(pair, parts):
    refused(AssemblyError, *parts, by=line(pair()).assemble)


def test_slides_without_a_mass_are_refused():
    spring, other = SlidingSpring("one", stiffness=1.0), SlidingSpring("two", stiffness=1.0)
    a, b = SlidingMass("a", mass=1.0), SlidingMass("b", mass=1.0)
    m = line(
        (a.flange_b, spring.flange_a),
        (spring.flange_b, other.flange_a),
        (other.flange_b, b.flange_a),
    )
    refused(AssemblyError, "one.flange_b", "slide without any", "SlidingMass", by=m.assemble)


def test_a_spring_that_turns_is_not_one_that_slides():
    a, shaft, housing = SlidingMass("a", mass=1.0), ElasticShaft("s", 1.0), FixedFlange("wall")
    m = line((a.flange_b, shaft.flange_a), (shaft.flange_b, housing.flange))
    refused(AssemblyError, "s.flange_a turns", by=m.assemble)


@pytest.mark.parametrize(
    ("make", "parts"),
    [
        (lambda: SlidingMass("p", mass=-1), ["p: mass is -1 kg"]),
        (lambda: SlidingSpring("p", stiffness=-1), ["p: stiffness is -1 N/m"]),
        (lambda: SlidingSpring("p", stiffness=0), ["p: stiffness and damping are zero"]),
        (lambda: SlidingDamper("p", damping=-1), ["p: damping is -1 N.s/m"]),
        (lambda: SlidingBrake("p", capacity=-1), ["p: capacity is -1 N"]),
        (lambda: SlidingBrake("p", capacity=1, width=0), ["p: width is 0 m/s"]),
        (lambda: ElastoGap("p", stiffness=0), ["p: stiffness is 0 N/m"]),
        (lambda: ElastoGap("p", stiffness=1, width=-1), ["p: width is -1 m"]),
    ],
)
def test_descriptions_that_are_refused(make, parts):
    refused(DescriptionError, *parts, by=make)
