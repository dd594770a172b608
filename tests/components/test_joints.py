"""Joints: their freedoms, limits and efforts, and what they refuse."""

import numpy as np
import pytest
from support.messages import refused

from mbs.components import (
    Coupling,
    Cylindrical,
    Fixed,
    Free,
    Planar,
    Prismatic,
    Revolute,
    Rotor,
    Spherical,
    Universal,
)
from mbs.components.component import in_plane
from mbs.components.joints import Motion
from mbs.errors import DescriptionError
from mbs.expressions import Parameter, parameters_of

KINDS = [
    (Revolute, 1, ["revolute"]),
    (Prismatic, 1, ["prismatic"]),
    (Cylindrical, 2, ["prismatic", "revolute"]),
    (Planar, 3, ["prismatic", "prismatic", "revolute"]),
    (Universal, 2, ["revolute", "revolute"]),
    (Spherical, 3, ["spherical"]),
    (Free, 6, ["free"]),
    (Fixed, 0, []),
]


@pytest.mark.parametrize(("kind", "nv", "motions"), KINDS, ids=lambda x: getattr(x, "__name__", ""))
def test_freedoms(kind, nv, motions):
    joint = kind("j")
    assert joint.nv == nv
    assert [f.motion.value for f in joint.freedoms] == motions
    assert len({f.suffix for f in joint.freedoms}) == len(motions)
    assert (joint.frame_a.port, joint.frame_b.port) == ("a", "b")


def test_positions_and_velocities():
    assert {m.value: (m.nq, m.nv) for m in Motion} == {
        "revolute": (1, 1),
        "prismatic": (1, 1),
        "spherical": (4, 3),
        "free": (7, 6),
    }


@pytest.mark.parametrize(
    ("axis", "wanted"),
    [
        ("x", (1, 0, 0)),
        ("-y", (0, -1, 0)),
        ((0, 0, 5), (0, 0, 1)),
        ([3, 0, -4], (0.6, 0, -0.8)),
        (np.array([0.0, 2.0, 0.0]), (0, 1, 0)),
    ],
)
def test_axes(axis, wanted):
    assert Revolute("j", axis=axis).axis == pytest.approx(wanted, abs=1e-16)


@pytest.mark.parametrize("axis", [(1, 0, 0), (0, -1, 0), (0.6, 0, -0.8), (0.36, 0.48, 0.8)])
def test_plane_of_an_axis(axis):
    u, v = in_plane(axis)
    np.testing.assert_allclose(np.cross(u, v), axis, atol=1e-15)
    np.testing.assert_allclose([np.dot(u, u), np.dot(v, v), np.dot(u, axis)], [1, 1, 0], atol=1e-15)
    assert in_plane((0.0, 0.0, 1.0)) == ((1, 0, 0), (0, 1, 0))


def test_limits():
    assert Revolute("j", limits=(-1, 2)).limits == (("", (-1.0, 2.0)),)
    assert Revolute("j", limits=[-1, np.inf]).limits == (("", (-1.0, np.inf)),)
    assert Revolute("j", limits=np.array([-1.0, 2.0])).limits == (("", (-1.0, 2.0)),)
    assert Cylindrical("j", limits={"phi": (-1, 1)}).limits == (("phi", (-1.0, 1.0)),)
    assert Revolute("j").limits == ()
    assert Universal("j", limits={}).limits == ()


def test_scoping_keeps_everything():
    joint = Universal("j", axes=("y", "-z"), limits={"phi_b": (-1, 1)}, Fv="c", actuated=True)
    moved = joint.scoped("arm")
    assert moved.name == "arm.j"
    assert (moved.axes, moved.limits, moved.actuated) == (joint.axes, joint.limits, True)
    assert str(moved.Fv) == "arm.c"
    assert Revolute("j").scoped("arm").limits == ()
    gear = Coupling("g", "j2", "j1", (0, "n")).scoped("arm")
    assert (gear.name, gear.driven, gear.driver) == ("arm.g", "arm.j2", "arm.j1")
    assert str(gear.coefficients[1]) == "arm.n"


def test_symbols_of_a_rotor_are_scoped_and_checked():
    joint = Revolute("j", stiffness="K", rest="x", rotor=Rotor(inertia="J", ratio="N", axis="x"))
    assert {p.name for e in joint.expressions() for p in parameters_of(e)} == {"K", "x", "J", "N"}
    moved = joint.scoped("arm")
    assert moved.rotor == Rotor(inertia="arm.J", ratio="arm.N", axis=(1, 0, 0))
    assert (str(moved.stiffness), str(moved.rest)) == ("arm.K", "arm.x")
    joint.check_values({"J": 0.1})
    with pytest.raises(DescriptionError, match="j: inertia of the rotor is -1; give zero or more"):
        joint.check_values({"J": -1.0})


@pytest.mark.parametrize(
    ("options", "carries"),
    [
        ({}, False),
        ({"actuated": True}, True),
        ({"actuated": False}, False),
        ({"Fv": 0.1}, True),
        ({"Fs": 0.1}, True),
        ({"Ia": 0.1}, True),
        ({"Ia": "J"}, True),
        ({"Ia": Parameter("J", 0.0)}, True),
        ({"actuated": False, "Fv": 1}, True),
        ({"actuated": False, "stiffness": "K"}, True),
        ({"rest": 1.0}, False),
        ({"rotor": Rotor(inertia=1e-4, ratio=100)}, True),
    ],
)
def test_efforts(options, carries):
    assert Revolute("j", **options).carries_effort is carries


@pytest.mark.parametrize(
    ("make", "parts"),
    [
        (lambda: Revolute("j", Fv=-1), ["j: Fv is -1", "give zero or more"]),
        (lambda: Revolute("j", Fs="-2"), ["j: Fs is -2", "give zero or more"]),
        (lambda: Revolute("j", Ia=Parameter("J", -3.0)), ["j: Ia is -3", "give zero or more"]),
        (lambda: Prismatic("j", stiffness=-3), ["j: stiffness is -3", "give zero or more"]),
        (lambda: Revolute("j", rest="x+"), ["j, rest: "]),
        (
            lambda: Spherical("j", stiffness=3),
            ["j: stiffness is given, but a Spherical joint has not one position", "give it to"],
        ),
        (lambda: Universal("j", rest=3), ["j: rest is given, but a Universal joint"]),
        (lambda: Fixed("j", rotor=Rotor(inertia=1)), ["j: rotor is given, but a Fixed joint"]),
        (lambda: Revolute("j", rotor=0.1), ["j: rotor is 0.1", "give Rotor(inertia="]),
        (
            lambda: Revolute("j", rotor=Rotor(inertia=-0.1)),
            ["j: inertia of the rotor is -0.1", "give zero or more"],
        ),
        (lambda: Rotor(inertia=None), ["rotor, inertia: None is not a finite number"]),
        (lambda: Rotor(inertia=1, axis=(0, 0, 0)), ["rotor: axis (0, 0, 0) has zero length"]),
        (lambda: Revolute("j", Fv=None), ["j, Fv: None is not a finite number", "give"]),
        (
            lambda: Revolute("j", axis=(0, 0, 0)),
            ["j: axis (0, 0, 0) has zero length", "give a direction"],
        ),
        (
            lambda: Prismatic("j", axis=(0, 1)),
            ["j: axis (0, 1) is not a direction", "give three numbers"],
        ),
        (
            lambda: Planar("j", axis=(0, 0, np.nan)),
            ["j: axis (0, 0, nan) is not", "give three numbers"],
        ),
        (lambda: Revolute("j", axis="w"), ["j: axis 'w' is unknown", "give 'x'"]),
        (lambda: Revolute("j", axis="--x"), ["j: axis '--x' is unknown", "give 'x'"]),
        (
            lambda: Revolute("j", axis=None),
            ["j: axis None is not a direction", "give three numbers"],
        ),
        (
            lambda: Universal("u", axes=("x", "-x")),
            ["u: axes ('x', '-x') are not orthogonal", "give two"],
        ),
        (
            lambda: Universal("u", axes=("x", (0.1, 1, 0))),
            ["u: axes", "are not orthogonal", "give two"],
        ),
        (lambda: Universal("u", axes=("x",)), ["u: axes ('x',) are not two", "give two"]),
        (lambda: Universal("u", axes=None), ["u: axes None are not two", "give two"]),
        (
            lambda: Revolute("j", limits=(1, -1)),
            ["j: limits (1, -1) are not (lower, upper)", "in order"],
        ),
        (
            lambda: Revolute("j", limits=(1, 1)),
            ["j: limits (1, 1) are not (lower, upper)", "in order"],
        ),
        (
            lambda: Revolute("j", limits=(0, np.nan)),
            ["j: limits (0, nan) are not", "give two numbers"],
        ),
        (
            lambda: Revolute("j", limits=5),
            ["j: limits 5 are not (lower, upper)", "give two numbers"],
        ),
        (
            lambda: Revolute("j", limits=[]),
            ["j: limits [] are not (lower, upper)", "give two numbers"],
        ),
        (
            lambda: Revolute("j", limits=(1, 2, 3)),
            ["j: limits (1, 2, 3) are not", "give two numbers"],
        ),
        (
            lambda: Universal("u", limits=(-1, 1)),
            ["u: limits (-1, 1) name no", "['phi_a', 'phi_b']"],
        ),
        (
            lambda: Universal("u", limits={"psi": (-1, 1)}),
            ["u: limits (-1, 1) name no", "give a mapping"],
        ),
        (lambda: Spherical("s", limits=(-1, 1)), ["s: limits (-1, 1) name no", "leave them out"]),
        (
            lambda: Coupling("g", "j", "j"),
            ["g: the coordinate 'j' cannot follow itself", "name two"],
        ),
        (
            lambda: Coupling("g", "a", "b", 2.0),
            ["g: coefficients 2.0 are not a sequence", "give c_0"],
        ),
        (
            lambda: Coupling("g", "a", "b", "AB"),
            ["g: coefficients 'AB' are not a sequence", "give c_0"],
        ),
        (
            lambda: Coupling("g", "a", "b", (0, None)),
            ["g, coefficients: None is not a finite number"],
        ),
        (
            lambda: Revolute("my joint"),
            ["Revolute 'my joint': ", "no blanks", "choose another name"],
        ),
    ],
)
def test_impossible_joints(make, parts):
    refused(DescriptionError, *parts, by=make)
