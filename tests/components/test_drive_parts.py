"""Parts of drive lines: what they refuse, and how flanges are connected."""

import pytest
from support.messages import refused

import mbs
from mbs.components import (
    Body,
    Cylindrical,
    DCMotor,
    ElasticGear,
    ElasticShaft,
    Flange,
    IdealGear,
    Prismatic,
    Revolute,
    ShaftDamper,
    ShaftInertia,
    Spherical,
    TorqueSource,
)
from mbs.errors import DescriptionError


def motor(name="motor", **changed):
    numbers = {"resistance": 1.0, "inductance": 2e-3, "constant": 0.05} | changed
    return DCMotor(name, **numbers)


@pytest.mark.parametrize(
    ("part", "parts"),
    [
        (lambda: ShaftInertia("s", -1.0), ["s", "-1 kg m^2", "zero or more"]),
        (lambda: IdealGear("g", 0), ["g", "ratio is 0", "less than zero"]),
        (lambda: IdealGear("g", "2-2"), ["g", "ratio is 0"]),
        (lambda: ElasticGear("g", 10.0, ratio=0), ["g", "ratio is 0"]),
        (lambda: ElasticShaft("e", -3.0), ["e", "stiffness is -3"]),
        (lambda: ElasticShaft("e", 3.0, -1.0), ["e", "damping is -1"]),
        (lambda: ElasticShaft("e", 0.0), ["e", "stiffness and damping are zero", "ElasticShaft"]),
        (lambda: ShaftDamper("d", -1.0), ["d", "damping is -1"]),
        (lambda: ShaftDamper("d", 0.0), ["d", "damping is zero"]),
        (lambda: motor(resistance=0.0), ["motor", "resistance is 0", "more than zero"]),
        (lambda: motor(constant=-0.1), ["motor", "constant is -0.1"]),
        (lambda: motor(inductance=-1e-3), ["motor", "inductance is -0.001 H"]),
        (lambda: motor(inertia=-1.0), ["motor", "inertia is -1"]),
        (lambda: Spherical("ball").flange, ["ball", "Spherical", "Revolute or Prismatic"]),
        (lambda: Cylindrical("tube").flange, ["tube", "Cylindrical"]),
    ],
)
def test_descriptions_that_are_refused(part, parts):
    refused(DescriptionError, *parts, by=part)


def test_flanges_know_their_owner():
    gear = IdealGear("gear", 5)
    assert str(gear.flange_a) == "gear.flange_a"
    assert gear.flanges == (gear.flange_a, gear.flange_b)
    assert str(TorqueSource("push").flange) == "push.flange"
    assert Revolute("j").flange == Flange(Revolute("j"))
    assert Prismatic("p").flange.key == ("p", "")


def test_what_cannot_be_connected_to_a_flange():
    m = mbs.Mechanism("m")
    body = m.add(Body("b", mass=0))
    gear, joint = IdealGear("gear", 5), Revolute("j")
    refused(DescriptionError, "b", "is no flange", by=lambda: m.connect(gear.flange_a, body))
    refused(DescriptionError, "is no flange", by=lambda: m.connect(body, gear.flange_a))
    refused(
        DescriptionError, "no flange", by=lambda: m.connect(gear.flange_a, joint, gear.flange_b)
    )
    refused(
        DescriptionError,
        "to itself",
        by=lambda: m.connect(gear.flange_a, IdealGear("gear", 5).flange_a),
    )


def test_parts_are_added_when_they_are_connected():
    m = mbs.Mechanism("m")
    a, b = ShaftInertia("a", 1.0), ShaftInertia("b", 2.0)
    m.connect(a.flange_b, b.flange_a)
    assert m.components["a"] is a
    assert m.components["b"] is b
    refused(
        DescriptionError,
        "two components are named 'a'",
        by=lambda: m.connect(ShaftInertia("a", 3.0).flange_a, b.flange_b),
    )


def test_symbol_of_no_inductance_is_refused():
    m = mbs.Mechanism("m", parameters={"L": 0.0})
    drive = motor(inductance="L", inertia=1e-5)
    m.connect(drive.flange, ShaftInertia("load", 1e-3).flange_a)
    refused(DescriptionError, "motor", "inductance is L", "value 0", by=m.assemble)
