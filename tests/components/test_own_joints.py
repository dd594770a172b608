"""Joints of a user's own, by elementary or by any motions, in trees and where loops close."""

import casadi
import numpy as np
import pytest
from support.messages import refused

import mbs
from mbs.components import (
    Body,
    Box,
    Cartesian,
    Cylindrical,
    Gimbal,
    Helical,
    Joint,
    MotionJoint,
    PinSlot,
    PointMass,
    Prismatic,
    Revolute,
    Screw,
    Spherical,
    Universal,
    custom,
)
from mbs.components.constraints import Constraint
from mbs.components.joints import Freedom, Motion
from mbs.components.motion_joint import rotation, translation
from mbs.errors import DescriptionError

PITCH = 0.4


class Corkscrew(MotionJoint):
    """A screw joint, by its motion."""

    pitch = custom.parameter("m")
    phi = custom.unknown("rad")

    def motion(self, at):
        return rotation("z", at.phi) @ translation(0, 0, at.pitch * at.phi / (2 * np.pi))


class Wave(MotionJoint):
    """A slide along a sine in the plane x, z."""

    s = custom.unknown("m")

    def motion(self, at):
        return translation(at.s, 0, 0.1 * casadi.sin(5 * at.s))


class Hinge(MotionJoint):
    """A revolute joint, by its motion."""

    phi = custom.unknown("rad")

    def motion(self, at):
        return rotation("z", at.phi)


class Own(Revolute):
    """A revolute joint under another name."""


class Twice(Joint):
    """A rotation, then a translation along the rotated x: a user's own chain of freedoms."""

    @property
    def freedoms(self):
        turn = Freedom(Motion.REVOLUTE, (0.0, 0.0, 1.0), "first")
        return turn, Freedom(Motion.PRISMATIC, (1.0, 0.0, 0.0), "out")


def mechanism(joint, body=None):
    m = mbs.Mechanism("one", gravity=(1.0, -2.0, -9.81))
    given = body or Body("nut", mass=2.0, com=(0.1, 0, 0.2), inertia=(0.1, 0.2, 0.15))
    m.add(given)
    m.connect(m.world, joint, given)
    return m


def test_three_ways_to_a_screw_move_alike():
    by_coupling = mechanism(Cylindrical("j"))
    by_coupling.add(Screw("thread", driven="j.s", driver="j.phi", pitch=PITCH))
    helical, own = mechanism(Helical("j", pitch=PITCH)), mechanism(Corkscrew("j", pitch=PITCH))
    first, second, third = (
        mbs.simulate.run(m.assemble(), 0.8, tolerance=1e-10, quiet=True)
        for m in (by_coupling, helical, own)
    )
    np.testing.assert_allclose(second["j.phi.q"], first["j.phi.q"], atol=1e-12)
    np.testing.assert_allclose(third["j.phi.q"], first["j.phi.q"], atol=1e-7)
    assert np.ptp(first["j.phi.q"]) > 0.5
    energy = third["kinetic_energy"] + third["potential_energy"]
    assert np.ptp(energy) < 1e-7


@pytest.mark.parametrize("mass", ["point", "box"])
def test_cartesian_falls_freely(mass):
    body = PointMass("p", mass=0.7) if mass == "point" else Box("p", length=0.3, mass=0.7)
    system = mechanism(Cartesian("c"), body).assemble()
    assert [c.name for c in system.coordinates] == ["c.x", "c.y", "c.z"]
    result = mbs.simulate.run(system, 0.5, v0={"c.x": 1.0}, quiet=True)
    last = [result[f"c.{axis}.q"][-1] for axis in "xyz"]
    np.testing.assert_allclose(last, [0.5 + 0.125, -0.25, -9.81 / 8], atol=1e-9)


def test_gimbal_is_a_spherical_joint_by_angles():
    gimbal = mechanism(Gimbal("g", axes=("z", "y", "x"))).assemble()
    ball = mechanism(Spherical("b")).assemble()
    q = np.array([0.3, -0.4, 0.7])
    R = np.array(mbs.models.transform(gimbal, "nut")(q))[:3, :3]
    w = np.sqrt(1 + np.trace(R)) / 2
    quaternion = [w, *np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]) / (4 * w)]
    assert float(mbs.models.energy(gimbal)(q, [0, 0, 0])[1]) == pytest.approx(
        float(mbs.models.energy(ball)(quaternion, [0, 0, 0])[1]), rel=1e-12
    )


def test_pin_slot_makes_a_scotch_yoke():
    """A loop through a joint without rows is closed by a weld behind it."""
    m = mbs.Mechanism("yoke", gravity=(0, 0, -9.81))
    crank, yoke = (
        m.add(Box("crank", length=0.2, mass=1.0)),
        m.add(Box("yoke", length=0.1, mass=2.0)),
    )
    m.connect(m.world, Revolute("j", axis="z", actuated=True), crank.left)
    m.connect(m.world, Prismatic("s", axis="x"), yoke)
    m.connect(yoke, PinSlot("pin", axis="z", slot="y"), crank.right)
    system = m.assemble(guess={"j": 0.3, "s": 0.2})
    assert system.closure.mobility == 1
    result = mbs.simulate.run(system, 0.5, q0={"j": 0.3}, v0={"j": 2.0}, quiet=True)
    np.testing.assert_allclose(result["s.q"], 0.2 * np.cos(result["j.q"]), atol=1e-10)
    np.testing.assert_allclose(result["pin.s.q"], 0.2 * np.sin(result["j.q"]), atol=1e-10)


def four_bar(last):
    m = mbs.Mechanism("four_bar", gravity=(0, -9.81, 0))
    a, b, c = (
        m.add(Box(name, length=size, mass=1.0))
        for name, size in (("a", 0.4), ("b", 1.0), ("c", 0.9))
    )
    m.connect(m.world, Revolute("j1", axis="z", actuated=True), a.left)
    m.connect(a.right, Revolute("j2", axis="z"), b.left)
    m.connect(m.world.at(0.8), Revolute("j4", axis="z"), c.left)
    m.connect(b.right, last, c.right)
    return m.assemble(guess={"j1": 0.5, "j2": 0.6, "j4": 1.6}, active=["j1"])


@pytest.mark.parametrize("kind", [Own, Hinge])
def test_own_joints_close_a_loop_as_a_revolute_joint_does(kind):
    known, own = four_bar(Revolute("j3", axis="z")), four_bar(kind("j3"))
    q0 = {name: known.position(None)[k] for k, name in enumerate(c.name for c in known.coordinates)}
    first, second = (
        mbs.simulate.run(s, 0.4, q0={"j1": q0["j1"]}, v0={"j1": 1.0}, tolerance=1e-10, quiet=True)
        for s in (known, own)
    )
    for name in ("j1.q", "j2.q", "j4.q"):
        np.testing.assert_allclose(second[name], first[name], atol=1e-7)
    assert own.closure.mobility == 1


def test_a_bead_slides_along_its_motion():
    system = mechanism(Wave("w"), Body("bead", mass=0.5, inertia=(1e-3, 1e-3, 1e-3))).assemble()
    result = mbs.simulate.run(system, 1.0, tolerance=1e-10, quiet=True)
    energy = result["kinetic_energy"] + result["potential_energy"]
    assert np.ptp(energy) < 1e-8
    assert np.ptp(result["w.s.q"]) > 0.1
    # m (1 + f'^2) s'' + m f' f'' s'^2 = m (gx + gz f') along the curve z = f(s)
    s, v, a = (result[f"w.s.{kind}"] for kind in ("q", "v", "a"))
    f1, f2 = 0.5 * np.cos(5 * s), -2.5 * np.sin(5 * s)
    np.testing.assert_allclose((1 + f1**2) * a + f1 * f2 * v**2, 1.0 - 9.81 * f1, atol=1e-6)


def test_own_freedoms_make_a_tree():
    system = mechanism(Twice("t")).assemble()
    assert [c.name for c in system.coordinates] == ["t.first", "t.out"]
    T = np.array(mbs.models.transform(system, "nut")([0.5, 0.3]))
    np.testing.assert_allclose(T[:3, 3], [0.3 * np.cos(0.5), 0.3 * np.sin(0.5), 0], atol=1e-14)


class Bound(Constraint):
    """A constraint without rows."""


def test_what_is_refused():
    m = mbs.Mechanism("m")
    body = m.add(Body("b", mass=1.0))
    refused(DescriptionError, "a joint is connected", by=lambda: m.add(Hinge("h")))
    refused(
        DescriptionError, "nothing on its other side", by=lambda: m.connect(m.world, Hinge("h"))
    )
    refused(DescriptionError, "closing_rows", by=lambda: m.connect(m.world, Bound("bound"), body))
    refused(DescriptionError, "pitch is 0", by=lambda: Helical("h", pitch=0))
    refused(DescriptionError, "not orthogonal", by=lambda: PinSlot("p", axis="x", slot="x"))
    refused(DescriptionError, "three axes", by=lambda: Gimbal("g", axes=("x", "y")))
    refused(DescriptionError, "not orthogonal", by=lambda: Gimbal("g", axes=("x", "x", "y")))
    with pytest.raises(DescriptionError, match="needs a method motion"):
        type("Still", (MotionJoint,), {})
    assert Universal("u").closes
    assert not Twice("t").closes
