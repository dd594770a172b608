"""Constraints and transmissions as they are described: defaults, scopes, and what is refused."""

import math

import pytest
from support.messages import refused

from mbs import Mechanism
from mbs.components import (
    Body,
    ConstantVelocity,
    Gear,
    PointOnLine,
    PointOnPlane,
    Prismatic,
    RackAndPinion,
    Revolute,
    Rod,
    Screw,
)
from mbs.errors import AssemblyError, DescriptionError
from mbs.expressions import to_float


@pytest.mark.parametrize(
    "joint", [Rod("r", length=1), PointOnLine("l"), PointOnPlane("p"), ConstantVelocity("c")]
)
def test_a_constraint_has_no_coordinate(joint):
    assert joint.freedoms == ()
    assert joint.nv == 0
    assert not joint.places
    assert not joint.carries_effort
    assert Revolute("j").places


def test_factors():
    assert [to_float(c) for c in Gear("g", "b", "a", ratio=-0.5).coefficients] == [0, -0.5]
    rack = RackAndPinion("r", "x", "phi", radius="D/2", offset=0.1)
    assert to_float(rack.coefficients[0]) == 0.1
    assert to_float(rack.coefficients[1], {"D": 0.3}) == 0.15
    screw = Screw("s", "n.s", "n.phi", pitch=-0.004)
    assert to_float(screw.coefficients[1]) == pytest.approx(-0.002 / math.pi, abs=1e-18)


def test_scopes():
    gear = Gear("g", "b", "a", ratio="n", offset="c").scoped("arm")
    assert (gear.name, gear.driven, gear.driver) == ("arm.g", "arm.b", "arm.a")
    assert [str(c) for c in gear.coefficients] == ["arm.c", "arm.n"]
    rod = Rod("r", length="L").scoped("arm")
    assert (rod.name, str(rod.length)) == ("arm.r", "arm.L")


@pytest.mark.parametrize(
    ("make", "parts"),
    [
        (lambda: Rod("r", length=0), ["r: length is 0 m", "more than zero", "Spherical"]),
        (lambda: Rod("r", length=-2.0), ["r: length is -2 m", "more than zero"]),
        (lambda: Rod("r", length=math.nan), ["r, length: nan is not a finite number"]),
        (lambda: Rod("r", length=None), ["r, length: None is not a finite number"]),
        (
            lambda: Rod("r", length=1, actuated=True),
            ["r: actuated is given, but a Rod has no coordinate", "give it to the joints"],
        ),
        (lambda: PointOnLine("p", Fv=0.1), ["p: Fv is given, but a PointOnLine has no"]),
        (lambda: PointOnPlane("p", limits=(0, 1)), ["p: limits (0, 1) name no", "leave them out"]),
        (lambda: ConstantVelocity("c", stiffness=1.0), ["c: stiffness is given", "Revolute"]),
        (lambda: PointOnPlane("p", axis="w"), ["p: axis 'w' is unknown"]),
        (lambda: PointOnLine("p", axis=(0, 0, 0)), ["p: axis (0, 0, 0) has zero length"]),
        (lambda: Gear("g", "b", "a", ratio=0), ["g: ratio is 0, which ties nothing"]),
        (lambda: RackAndPinion("g", "b", "a", radius=0.0), ["g: radius is 0, which ties nothing"]),
        (lambda: Screw("g", "b", "a", pitch="0"), ["g: pitch is 0, which ties nothing"]),
        (lambda: Gear("g", "a", "a", ratio=2), ["g: the coordinate 'a' cannot follow itself"]),
        (lambda: Gear("g", "b", "a", ratio=None), ["g, ratio: None is not a finite number"]),
    ],
)
def test_what_is_refused(make, parts):
    refused(DescriptionError, *parts, by=make)


def two_joints():
    m = Mechanism("m")
    for name, joint in (("a", Revolute("turn")), ("b", Prismatic("slide"))):
        m.connect(m.world, joint, m.add(Body(name, 1.0, inertia=(0.1, 0.1, 0.1))))
    return m


@pytest.mark.parametrize(
    ("coupling", "parts"),
    [
        (
            Gear("g", "slide", "turn", ratio=2),
            ["the driven coordinate of Gear 'g' must be revolute", "'slide' is prismatic"],
        ),
        (
            RackAndPinion("r", "turn", "slide", radius=0.1),
            ["the driven coordinate of RackAndPinion 'r' must be prismatic", "'turn' is revolute"],
        ),
        (Screw("s", "slide", "b", pitch=0.1), ["s: there is no coordinate 'b' in the tree"]),
    ],
)
def test_coordinates_of_the_wrong_kind(coupling, parts):
    m = two_joints()
    m.add(coupling)
    refused(AssemblyError, *parts, by=m.assemble)


def test_values_of_symbols_are_checked():
    m = Mechanism("m", parameters={"L": -1.0})
    a, b = (m.add(Body(name, 1.0, inertia=(0.1, 0.1, 0.1))) for name in "ab")
    m.connect(m.world, Revolute("j1"), a)
    m.connect(m.world.at(1), Revolute("j2"), b)
    m.connect(a.at(0, 1), Rod("r", length="L"), b.at(0, 1))
    refused(DescriptionError, "r: length is -1 m", by=m.assemble)
    refused(
        AssemblyError,
        "joint 'r' connects 'a' to itself",
        by=lambda: rod_on_one_body().assemble(),
    )


def rod_on_one_body():
    m = Mechanism("m")
    a = m.add(Body("a", 1.0, inertia=(0.1, 0.1, 0.1)))
    m.connect(m.world, Revolute("j1"), a)
    m.connect(a.at(1), Rod("r", length=1), a)
    return m
