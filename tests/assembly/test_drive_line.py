"""Drive lines in a system: coordinates, reflected inertia, actuation, refusals."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.messages import refused

import mbs
from mbs.components import (
    Body,
    DCMotor,
    ElasticGear,
    ElasticShaft,
    FixedFlange,
    Free,
    IdealGear,
    Prismatic,
    Revolute,
    ShaftDamper,
    ShaftInertia,
    Spring,
    TorqueSource,
)
from mbs.errors import AssemblyError
from mbs.models.geometry import terminal_frame


def arm(name="arm", joint=None):
    """One link on a joint, 0.3 kg m^2 about its axis; or 2 kg on a rail."""
    m = mbs.Mechanism(name, gravity=(0, 0, 0))
    body = m.add(Body("link", mass=2.0, inertia=(0.3, 0.3, 0.3)))
    joint = joint or Revolute("j")
    m.connect(m.world, joint, body)
    return m, joint


def names(system):
    return [c.name for c in system.coordinates]


def inertia(system):
    return np.array(mbs.models.inertia_matrix(system)(list(system.configuration)))


def test_rigid_geared_rotor_is_part_of_the_joint():
    m, joint = arm()
    rotor, gear, drive = ShaftInertia("rotor", 1e-4), IdealGear("gear", -50), TorqueSource("drive")
    m.connect(gear.flange_b, joint.flange)
    m.connect(rotor.flange_b, gear.flange_a)
    m.connect(drive.flange, rotor.flange_a)
    system = m.assemble()
    assert names(system) == ["j"]
    assert not system.is_closed
    assert inertia(system)[0, 0] == pytest.approx(0.3 + 50**2 * 1e-4, rel=1e-15)
    assert [(s.name, s.coordinate, s.factor) for s in system.shafts] == [
        ("gear", "j", -50.0),
        ("rotor", "j", -50.0),
    ]
    tau, _, y = mbs.models.devices(system)([0.2], [], [3.0])
    assert float(tau) == -150.0
    assert float(y) == pytest.approx(-10.0)


@settings(max_examples=25, deadline=None)
@given(
    ratios=st.lists(
        st.floats(0.2, 20).flatmap(lambda x: st.sampled_from([x, -x])), min_size=1, max_size=5
    ),
    turned=st.lists(st.booleans(), min_size=5, max_size=5),
    on_joint=st.booleans(),
)
def test_any_train_of_gears_reflects_inertia_by_the_squares_of_its_ratios(ratios, turned, on_joint):
    m, joint = arm()
    first = ShaftInertia("s0", 0.3)
    end = joint.flange if on_joint else first.flange_b
    factor, expected = 1.0, 0.3
    for k, (ratio, back) in enumerate(zip(ratios, turned, strict=False)):
        gear, shaft = IdealGear(f"g{k}", ratio), ShaftInertia(f"s{k + 1}", 0.01 * (k + 1))
        a, b = (gear.flange_b, gear.flange_a) if back else (gear.flange_a, gear.flange_b)
        m.connect(end, a)
        m.connect(shaft.flange_a, b)
        factor *= 1 / ratio if not back else ratio
        expected += factor**2 * 0.01 * (k + 1)
        end = shaft.flange_b
    system = m.assemble()
    assert names(system) == (["j"] if on_joint else ["j", "s0"])
    assert inertia(system)[-1, -1] == pytest.approx(expected, rel=1e-12)


def test_elastic_gear_leaves_the_joint_passive_and_the_rotor_actuated():
    m, joint = arm()
    motor = DCMotor("motor", resistance=1, inductance=1e-3, constant=0.1, inertia=1e-4)
    gear = ElasticGear("gear", 800.0, 3.0, ratio=40)
    m.connect(motor.flange, gear.flange_a)
    m.connect(gear.flange_b, joint.flange)
    system = m.assemble()
    assert [(c.name, c.actuated) for c in system.velocity_coordinates] == [
        ("j", False),
        ("motor.rotor", True),
    ]
    np.testing.assert_allclose(inertia(system), np.diag([0.3, 1e-4]), atol=1e-18)
    q, v = np.array([0.1, 2.0]), np.array([-0.3, 7.0])
    torque = 800 * (q[1] / 40 - q[0]) + 3 * (v[1] / 40 - v[0])
    H = np.array(mbs.models.bias(system)(q, v)).ravel()
    np.testing.assert_allclose(H, [-torque, torque / 40], rtol=1e-14)
    stored = float(mbs.models.energy(system)(q, v)[1])
    assert stored == pytest.approx(400 * (q[1] / 40 - q[0]) ** 2, rel=1e-14)


def test_torque_source_and_damper_on_a_screw_drive():
    """A prismatic joint behind a gear of 200 rad for 1 m."""
    m, joint = arm(joint=Prismatic("s", axis="x"))
    gear, push, bearing = IdealGear("nut", 200), TorqueSource("push"), ShaftDamper("bearing", 0.01)
    m.connect(joint.flange, gear.flange_b)
    m.connect(gear.flange_a, push.flange)
    m.connect(gear.flange_a, bearing.flange)
    m.connect(gear.flange_a, ShaftInertia("spindle", 1e-5).flange_a)
    system = m.assemble()
    assert inertia(system)[0, 0] == pytest.approx(2.0 + 200**2 * 1e-5, rel=1e-14)
    assert float(mbs.models.bias(system)([0], [0.5])) == pytest.approx(200**2 * 0.01 * 0.5)
    assert float(mbs.models.devices(system)([0.5], [], [2.0])[0]) == 400.0


def test_two_joints_on_one_shaft_are_coupled():
    m, joint = arm()
    other = Revolute("other", axis="y", Ia=0.02)
    m.connect(m.world, other, m.add(Body("b", mass=0)))
    gear, drive = IdealGear("gear", 4), TorqueSource("drive")
    m.connect(other.flange, gear.flange_a)
    m.connect(gear.flange_b, joint.flange)
    m.connect(drive.flange, other.flange)
    system = m.assemble()
    assert [system.velocity_coordinates[k].name for k in system.independent] == ["j"]
    assert inertia(system)[0, 0] == pytest.approx(0.3 + 16 * 0.02, rel=1e-12)
    assert float(system.devices[0].factor) == 4
    assert "other follows j" in system.report()


def test_report_has_a_sentence_for_every_part():
    m, joint = arm()
    parts = [
        DCMotor("motor", resistance=1, inductance=1e-3, constant=0.1),
        ShaftInertia("rotor", 1e-4),
        IdealGear("gear", 40),
        ShaftInertia("wheel", 1e-3),
        ElasticShaft("shaft", 900.0),
        ShaftDamper("bearing", 0.1),
    ]
    motor, rotor, gear, wheel, shaft, bearing = parts
    m.connect(motor.flange, rotor.flange_a)
    m.connect(rotor.flange_b, gear.flange_a)
    m.connect(gear.flange_b, wheel.flange_a)
    m.connect(wheel.flange_b, shaft.flange_a)
    m.connect(shaft.flange_b, joint.flange)
    m.connect(bearing.flange, gear.flange_b)
    lines = m.assemble().report().splitlines()
    assert "ShaftInertia rotor has a coordinate of its own, rotor." in lines
    assert "IdealGear gear is rigid: its flange_a turns with rotor." in lines
    assert "ShaftInertia wheel turns 0.025 times as fast as rotor, which has its inertia." in lines
    assert "ElasticShaft shaft acts between rotor and j." in lines
    assert "ShaftDamper bearing acts on rotor." in lines
    assert (
        "DCMotor motor drives rotor and turns with rotor: input motor.voltage [V],"
        " state motor.i [A]." in lines
    )


def test_the_tool_is_on_the_robot_and_forces_stay_on_its_joints():
    m, joint = arm()
    m.add(Spring("spring", m.world.at(0, 1, 0), joint.frame_b, stiffness=5))
    gear = ElasticGear("gear", 100.0, ratio=3)
    m.connect(joint.flange, gear.flange_b)
    m.connect(gear.flange_a, ShaftInertia("rotor", 0.1).flange_a)
    system = m.assemble()
    assert terminal_frame(system) == 1
    assert np.array(mbs.models.direct_geometry(system)([0.3, 2.0]))[0, 0] == pytest.approx(
        np.cos(0.3)
    )
    assert float(mbs.models.energy(system)([0, 0], [0, 0])[1]) == pytest.approx(2.5)


def test_drive_lines_move_into_other_mechanisms_with_their_parameters():
    m, joint = arm()
    motor = DCMotor("motor", resistance="R", inductance="L", constant="k", inertia="J")
    gear = IdealGear("gear", "N")
    m.connect(motor.flange, gear.flange_a)
    m.connect(gear.flange_b, joint.flange)
    m.values |= {
        name: mbs.Parameter(name, value)
        for name, value in {"R": 2.0, "L": 0.1, "k": 0.5, "J": 1e-3, "N": 10.0}.items()
    }
    plant = mbs.Mechanism("plant", gravity=(0, 0, 0))
    for side in ("left", "right"):
        plant.connect(plant.world, plant.add(m, side).base)
    system = plant.assemble()
    assert [d.name for d in system.devices] == ["left.motor", "right.motor"]
    np.testing.assert_allclose(inertia(system), 0.4 * np.eye(2), rtol=1e-14)
    p = system.parameter_values({"right.N": 20.0, "right.L": 0.2})
    tau, zdot, y = mbs.models.devices(system)([0.1, 0.2], [3.0, 4.0], [12.0, 6.0], p)
    np.testing.assert_allclose(np.array(tau).ravel(), [10 * 0.5 * 3, 20 * 0.5 * 4])
    by_hand = [(12 - 2 * 3 - 0.5 * 10 * 0.1) / 0.1, (6 - 2 * 4 - 0.5 * 20 * 0.2) / 0.2]
    np.testing.assert_allclose(np.array(zdot).ravel(), by_hand)
    np.testing.assert_allclose(np.array(y).ravel(), [1.5, 1.0, 2.0, 4.0])
    assert mbs.models.devices(system).elements("z") == [
        ("left.motor.i", "A"),
        ("right.motor.i", "A"),
    ]


def refused_line(*parts, by):
    """The connections that `by` makes on an arm are refused at assembly."""
    m, joint = arm()
    by(m, joint)
    refused(AssemblyError, "arm", *parts, by=m.assemble)


def test_refused_loose_flange():
    def gear(m, joint):
        m.connect(joint.flange, IdealGear("gear", 2).flange_b)

    refused_line("gear.flange_a", "IdealGear", "connected to nothing", by=gear)
    refused_line("lonely.flange_a", "nothing", by=lambda m, _: m.add(ShaftInertia("lonely", 1)))


def test_refused_shaft_without_inertia():
    def chain(m, joint):
        first, second = ElasticShaft("first", 10.0), ElasticShaft("second", 20.0)
        m.connect(joint.flange, first.flange_a)
        m.connect(first.flange_b, second.flange_a)
        m.connect(second.flange_b, ShaftInertia("wheel", 1.0).flange_a)

    refused_line("first.flange_b, second.flange_a", "without any inertia", by=chain)


def test_refused_ring_of_gears():
    def ring(m, joint):
        first, second = IdealGear("first", 2), IdealGear("second", 3)
        shaft = ShaftInertia("shaft", 1.0)
        for gear in (first, second):
            m.connect(gear.flange_b, joint.flange)
            m.connect(gear.flange_a, shaft.flange_a)

    refused_line("in two ways", "nothing can turn", by=ring)


def test_gears_in_a_ring_that_agree_are_one():
    m, joint = arm()
    shaft = ShaftInertia("shaft", 1.0)
    for name in ("first", "second"):
        gear = IdealGear(name, 0.3)
        m.connect(gear.flange_b, joint.flange)
        m.connect(gear.flange_a, shaft.flange_a)
    assert inertia(m.assemble())[0, 0] == pytest.approx(0.3 + 0.09)


def test_a_gear_whose_ratio_has_no_value_yet_is_no_ring():
    m, joint = arm()
    first, second = IdealGear("first", "N"), IdealGear("second", "sqrt(M)")
    m.connect(joint.flange, first.flange_b)
    m.connect(first.flange_a, second.flange_b)
    m.connect(second.flange_a, ShaftInertia("rotor", 1e-3).flange_a)
    system = m.assemble()
    names = [p.name for p in system.parameters]
    A = mbs.models.inertia_matrix(system)
    p = system.parameter_values({"N": 20.0, "M": 9.0})
    assert sorted(names) == ["M", "N"]
    assert float(A(list(system.configuration), p)) == pytest.approx(0.3 + (20 * 3) ** 2 * 1e-3)


@pytest.mark.parametrize(("other", "agrees"), [("1 / (1 / N)", True), ("M", False), ("-N", False)])
def test_rings_of_gears_whose_ratios_have_no_values_yet(other, agrees):
    m, joint = arm()
    shaft = ShaftInertia("shaft", 0.01)
    for name, ratio in (("first", "N"), ("second", other)):
        gear = IdealGear(name, ratio)
        m.connect(gear.flange_b, joint.flange)
        m.connect(gear.flange_a, shaft.flange_a)
    if not agrees:
        refused(AssemblyError, "in two ways", "the ratios", by=m.assemble)
        return
    system = m.assemble()
    A = mbs.models.inertia_matrix(system)
    p = system.parameter_values({"N": 7.0})
    assert float(A(list(system.configuration), p)) == pytest.approx(0.3 + 0.49)


def test_refused_twist_of_a_rigid_shaft():
    def twist(m, joint):
        gear, spring = IdealGear("gear", 2), ElasticShaft("spring", 5.0)
        for end, flange in ((spring.flange_a, gear.flange_a), (spring.flange_b, gear.flange_b)):
            m.connect(end, flange)
        m.connect(gear.flange_b, joint.flange)

    refused_line("spring", "one rigid shaft", by=twist)


def test_refused_motor_on_a_passive_joint():
    m, joint = arm(joint=Revolute("j", actuated=False))
    m.connect(TorqueSource("push").flange, joint.flange)
    refused(AssemblyError, "'j'", "actuated=False", "'push'", by=m.assemble)


def test_refused_shaft_on_a_sliding_joint():
    m, joint = arm(joint=Prismatic("rail"))
    gear = IdealGear("gear", 100)
    m.connect(joint.flange, gear.flange_b)
    m.connect(gear.flange_b, ShaftInertia("wheel", 1.0).flange_a)
    m.connect(gear.flange_a, ShaftInertia("rotor", 1.0).flange_a)
    refused(AssemblyError, "wheel.flange_a turns", "'rail' slides", by=m.assemble)


def test_there_are_no_devices_without_motors():
    m, _ = arm()
    refused(mbs.errors.ModelError, "no motor", by=lambda: mbs.models.devices(m.assemble()))


def test_the_housing_takes_the_reactions_of_a_motor_and_of_a_bevel_gear():
    # a free hull with two rotors across each other, a motor on the first, a gear between them
    m = mbs.Mechanism("hull", gravity=(0, 0, 0))
    hull = m.add(Body("hull", mass=10.0, inertia=(2.0, 3.0, 4.0)))
    m.connect(m.world, Free("free"), hull)
    spin, across = Revolute("spin", axis="z"), Revolute("across", axis="x", actuated=False)
    m.connect(hull, spin, m.add(Body("first", mass=0.5, inertia=(0.05, 0.05, 0.1))))
    m.connect(hull, across, m.add(Body("second", mass=0.5, inertia=(0.2, 0.1, 0.1))))
    motor, gear = TorqueSource("motor"), IdealGear("bevel", 3.0)
    m.connect(motor.flange, spin.flange)
    m.connect(spin.flange, gear.flange_a)
    m.connect(gear.flange_b, across.flange)
    system = m.assemble()
    result = mbs.simulate.run(system, 2.0, u={"motor": 1.5}, tolerance=1e-10, quiet=True)
    # at rest: the whole angular momentum stays zero, and the torque goes into both rotors
    A = np.array([[2.25, 0.2 / 3, 0], [0, 0.1, 4.2], [0.2 / 3, 0.1 + 0.2 / 9, 0.1]])
    w_x, spin_a, w_z = np.linalg.solve(A, [0, 0, 1.5])
    assert result["spin.a"][0] == pytest.approx(spin_a, rel=1e-12)
    assert result["free.wx.a"][0] == pytest.approx(w_x, rel=1e-12)
    assert result["free.wz.a"][0] == pytest.approx(w_z, rel=1e-12)
    # and later on: about the centre, in axes at rest
    w = np.array([result[f"free.w{axis}.v"] for axis in "xyz"])
    own = np.diag([2.25, 3.15, 4.2]) @ w
    own[0] += 0.2 * result["across.v"]
    own[2] += 0.1 * result["spin.v"]
    assert np.abs(own).max() < 1e-8


def test_parts_on_a_fixed_shaft_do_not_move():
    m = mbs.Mechanism("m", gravity=(0, 0, 0))
    housing, first, second = FixedFlange("f"), ShaftInertia("i", 2.0), ShaftInertia("k", 1.0)
    gear, torque, free = IdealGear("g", 3.0), TorqueSource("t"), ShaftInertia("free", 1.5)
    m.connect(housing.flange, first.flange_a)
    m.connect(first.flange_b, gear.flange_a)
    m.connect(gear.flange_b, second.flange_a)
    m.connect(torque.flange, free.flange_a)
    system = m.assemble()
    assert [speed.name for speed in system.velocity_coordinates] == ["free"]
    assert "IdealGear g" in system.report()
    result = mbs.simulate.run(system, 1.0, u={"t": 3.0}, quiet=True)
    assert result["free.v"][-1] == pytest.approx(2.0, abs=1e-9)
