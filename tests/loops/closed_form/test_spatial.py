"""Spherical loops, and rods between two balls."""

import casadi
import numpy as np
import pytest
from support.configurations import active, same, searched
from support.random_trees import random_body, random_rotation

from mbs import Mechanism, Parameter
from mbs.components import (
    Prismatic,
    Revolute,
    Rod,
    Spherical,
    Universal,
)
from mbs.loops import assembly_modes, function, reduction_matrix, solve
from mbs.loops.plan import plan


def spherical_loop(seed, count, driven, joint=None):
    """Turns about random axes through one point, the last of which closes the loop at zero."""
    rng = np.random.default_rng(seed)
    m = Mechanism(f"spherical{seed}")
    axes = rng.standard_normal((count, 3))
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    centre = rng.uniform(-1, 1, 3)
    before, place, turned = m.world, np.zeros(3), np.eye(3)
    for k, axis in enumerate(axes):
        at = before.at(*(turned.T @ (centre - place)), rotation=turned.T)
        last = k == count - 1
        closing = Revolute(f"j{k}", axis=tuple(axis), actuated=k in driven or None)
        if last:
            m.connect(at, closing, m.world.at(*centre))
            m.cut(closing)
            continue
        body = m.add(random_body(rng, f"body{k}"))
        inside, R = rng.uniform(-0.5, 0.5, 3), random_rotation(rng)
        m.connect(at, closing, body.at(*inside, rotation=R))
        turned = R.T
        place = centre - turned @ inside
        before = body
    return m.assemble()


def rod_loop(seed, kind, length=None):
    """A driven crank, and a follower of another axis that a rod ties to it."""
    rng = np.random.default_rng(seed)
    m = Mechanism(f"rod{seed}")
    crank, follower = (m.add(random_body(rng, name)) for name in ("crank", "follower"))
    m.connect(
        m.world.at(*rng.uniform(-0.5, 0.5, 3), rotation=random_rotation(rng)),
        Revolute("drive", actuated=True),
        crank,
    )
    place, R = rng.uniform(0.5, 1.0, 3), random_rotation(rng)
    m.connect(m.world.at(*place, rotation=R), kind("follow"), follower)
    ends = rng.uniform(0.2, 0.5, 3), rng.uniform(0.2, 0.5, 3)
    rod = Rod("rod", length=1.3 if length is None else length)
    m.connect(crank.at(*ends[0]), rod, follower.at(*ends[1]))
    return m


def leg_loop(seed, kinds):
    """A driven arm, joined to the ground by a leg that fits where all joints are at zero.

    Args:
        seed: of all places.
        kinds: joints of the leg from the ground on; the last one is a ball.
    """
    rng = np.random.default_rng(seed)
    m = Mechanism(f"leg{seed}")
    kind_of = {"R": Revolute, "P": Prismatic, "U": Universal}

    def placed(body, p, R):
        """A point of a body, and where it is when the body is at p and R."""
        x, turn = rng.uniform(-0.6, 0.6, 3), random_rotation(rng)
        return body.at(*x, rotation=turn), p + R @ x, R @ turn

    arm = m.add(random_body(rng, "arm"))
    foot, foot_p, foot_R = placed(m.world, np.zeros(3), np.eye(3))
    m.connect(foot, Revolute("drive", actuated=True), arm)
    before, p, R = placed(m.world, np.zeros(3), np.eye(3))
    for k, kind in enumerate(kinds[:-1]):
        body = m.add(random_body(rng, f"body{k}"))
        m.connect(before, kind_of[kind](f"j{k}"), body)
        before, p, R = placed(body, p, R)
    ball = Spherical("ball")
    m.connect(before, ball, arm.at(*(foot_R.T @ (p - foot_p))))
    m.cut(ball)
    return m


def check(system, starts=60):
    """Modes against a search, derivatives against the implicit function theorem."""
    q_a = active(system)
    listed, found = assembly_modes(system, q_a), searched(system, q_a, starts=starts)
    assert len(listed) == len(found) > 1
    assert all(any(same(system, mode.q, q) for q in found) for mode in listed)
    x = casadi.SX.sym("x", len(q_a))
    for mode in listed:
        assert mode.residual < 1e-12
        q = function(system, mode.branch)(x)
        G = np.array(casadi.Function("G", [x], [casadi.jacobian(q, x)])(q_a))
        wanted = np.array(reduction_matrix(system)(list(mode.q)))
        np.testing.assert_allclose(G, wanted, atol=1e-8 * max(1.0, np.abs(wanted).max()))
    return listed


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(("count", "driven"), [(4, (0,)), (4, (2,)), (4, (3,)), (5, (0, 3))])
def test_spherical_loops(seed, count, driven):
    system = spherical_loop(seed, count, driven)
    listed = check(system)
    assert len(listed) == 2
    assert all(len(mode.branch) == 1 for mode in listed)


@pytest.mark.parametrize("kind", [Revolute, Prismatic])
@pytest.mark.parametrize("seed", [0, 1, 2, 4])
def test_a_rod_places_a_follower(kind, seed):
    system = rod_loop(seed, kind).assemble()
    listed = check(system)
    assert [mode.branch for mode in listed] == [("follow:+",), ("follow:-",)]


def test_the_length_of_a_rod_stays_a_symbol():
    system = rod_loop(1, Revolute, Parameter("L", 1.3)).assemble()
    short = rod_loop(1, Revolute, 1.25).assemble()
    q_a = active(system)
    q = np.array(function(system, "follow:+")(q_a, [1.25]))
    np.testing.assert_allclose(q, np.array(function(short, "follow:+")(q_a)), atol=1e-13)


def test_a_universal_joint_between_two_shafts():
    """The driven angle follows tan(out) = tan(in) / cos(angle between the shafts)."""
    m = Mechanism("hooke")
    angle = 0.6
    drive, driven = (m.add(random_body(np.random.default_rng(k), f"s{k}")) for k in range(2))
    c, s = np.cos(angle), np.sin(angle)
    tilt = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    m.connect(m.world, Revolute("in", axis="z", actuated=True), drive)
    m.connect(m.world.at(rotation=tilt), Revolute("out", axis="z"), driven)
    cross = Universal("cross", axes=("x", "y"))
    m.connect(drive.at(), cross, driven.at(rotation=tilt.T))
    m.cut(cross)
    system = m.assemble()
    assert [stage.name for stage in plan(system)] == ["cross"]
    for x in (0.3, 0.8, 1.2):
        q = solve(system, {"in": x}, branch=[])
        assert same(system, q, solve(system, {"in": x}), 1e-9)
        assert abs(np.tan(x) / c - np.tan(q[1])) < 1e-12


@pytest.mark.parametrize("kinds", ["UPS", "PUS", "URS", "RUS"])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_leg_with_a_universal_joint_and_a_ball(kinds, seed):
    system = leg_loop(seed, kinds).assemble()
    assert [len(stage.labels) for stage in plan(system)] == [2, 2]
    assert len(check(system, starts=200)) in (2, 4)
