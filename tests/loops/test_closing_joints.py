"""Constraints that close loops: rods, points on lines and planes, constant-velocity joints."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from support.messages import refused
from support.random_trees import random_body, random_rotation

import mbs
import mbs.models
import mbs.simulate
from mbs.components import (
    Body,
    Box,
    ConstantVelocity,
    Free,
    PointOnLine,
    PointOnPlane,
    Prismatic,
    Revolute,
    Rod,
)
from mbs.errors import AssemblyError, Unclosable
from mbs.loops import closure_jacobian, closure_residual, reduction_matrix, solve

ROWS = {"rod": 1, "line": 2, "plane": 1, "constant_velocity": 4}
DOWN = (0, -9.81, 0)


@dataclass(frozen=True)
class Held:
    """A chain held by a constraint, and how far numbers of its frames say it is open."""

    system: Any
    openness: Any


def turned(axis, angle):
    """Rodrigues."""
    K = np.cross(np.eye(3), axis)
    return np.eye(3) - np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


def chain(kind, seed, rng):
    """A chain without friction: mechanism, point at its tip, and positions."""
    m = mbs.Mechanism(f"{kind}{seed}", gravity=tuple(rng.uniform(-6, 6, 3)))
    before, guess = m.world, {}
    for k in range(ROWS[kind] + 2):
        body = m.add(random_body(rng, f"body{k}"))
        joint = (Revolute, Revolute, Prismatic)[k % 3](f"j{k}", axis=tuple(rng.normal(size=3)))
        m.connect(before.at(*rng.uniform(-0.5, 0.5, 3), rotation=random_rotation(rng)), joint, body)
        guess[f"j{k}"] = float(rng.uniform(-0.6, 0.6))
        before = body
    tip = before.at(*rng.uniform(-0.5, 0.5, 3), rotation=random_rotation(rng))
    m.add_frame("tip", tip)
    return m, tip, guess


def constraint(kind, tip, z, rng):
    """A constraint of axis z that a tip of this pose fulfils, and the pose of its frame_a."""
    R, arm = random_rotation(rng), rng.uniform(0.5, 1.0, 3)
    if kind == "rod":
        return Rod("held", length=float(np.linalg.norm(arm))), tip[:3, 3] + arm, R
    if kind == "line":
        return PointOnLine("held", z), tip[:3, 3] + 0.4 * R @ z, R
    if kind == "plane":
        return PointOnPlane("held", z), tip[:3, 3] + R @ np.cross(z, arm), R
    bend = np.cross(z, arm)
    turn = turned(bend / np.linalg.norm(bend), -0.7)
    return ConstantVelocity("held", z), tip[:3, 3], tip[:3, :3] @ turn


def held_chain(kind, seed):
    """A chain whose tip a constraint holds to a frame of the world."""
    rng = np.random.default_rng(seed)
    m, tip, guess = chain(kind, seed, rng)
    start = np.array(mbs.models.transform(m.assemble(), "tip")(list(guess.values())))
    z = rng.normal(size=3)
    z /= np.linalg.norm(z)
    joint, point, R = constraint(kind, start, z, rng)
    m.connect(m.world.at(*point, rotation=R), joint, tip)
    system = m.assemble(guess=guess)
    tip_pose = mbs.models.transform(system, "tip")

    def openness(q):
        T = np.array(tip_pose(q))
        gap, turn = T[:3, 3] - point, R.T @ T[:3, :3]
        spin = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
        gaps = {
            "rod": lambda: np.linalg.norm(gap) - float(str(joint.length)),
            "line": lambda: np.cross(R @ z, gap),
            "plane": lambda: (R @ z) @ gap,
            "constant_velocity": lambda: [*gap, z @ spin],
        }
        return np.abs(gaps[kind]()).max()

    return Held(system, openness)


@pytest.fixture(
    scope="module",
    params=[(kind, seed) for seed, kind in enumerate([*ROWS, *ROWS], start=1)],
    ids=str,
)
def held(request):
    return held_chain(*request.param)


def test_rows_mobility_and_configuration(held):
    system = held.system
    kind = next(kind for kind in ROWS if system.name.startswith(kind))
    assert [row.name for row in system.loops] == ["held"]
    assert len(system.loops[0].rows) == ROWS[kind]
    assert system.loops[0].dropped == ()
    assert system.closure.mobility == 2
    assert system.cut_coordinates == ()
    assert held.openness(system.configuration) < 1e-12
    assert f"{ROWS[kind]} of {ROWS[kind]} rows are independent" in system.report()


def test_configurations_and_velocities_keep_the_constraint(held):
    system = held.system
    names = [system.velocity_coordinates[k].name for k in system.independent]
    q = solve(
        system, {name: system.configuration[system.independent[0]] + 0.02 for name in names[:1]}
    )
    assert held.openness(q) < 1e-12
    v = np.array(reduction_matrix(system)(q)) @ [0.7, -0.4]
    assert np.abs(np.array(closure_jacobian(system)(q)) @ v).max() < 1e-12
    assert held.openness(q + 1e-5 * v) < 1e-8
    assert held.openness(q + 1e-5 * np.ones(system.nv)) > 1e-7


def test_dynamics_are_consistent(held):
    system, rng = held.system, np.random.default_rng(3)
    q, v_a, tau_a = np.array(system.configuration), *rng.uniform(-1, 1, (2, 2))
    a_a = np.array(mbs.models.direct_dynamics(system)(q, v_a, tau_a)).ravel()
    back = np.array(mbs.models.inverse_dynamics(system)(q, v_a, a_a)).ravel()
    np.testing.assert_allclose(back, tau_a, rtol=0, atol=1e-9)
    A = np.array(mbs.models.inertia_matrix(system)(q))
    H = np.array(mbs.models.bias(system)(q, v_a)).ravel()
    np.testing.assert_allclose(A @ a_a + H, tau_a, rtol=0, atol=1e-9)
    tau = np.zeros(system.nv)
    tau[list(system.independent)] = tau_a
    v = np.array(reduction_matrix(system)(q)) @ v_a
    in_tree = mbs.models.direct_dynamics(system, coordinates="tree")
    a, lam = (np.array(x).ravel() for x in in_tree(q, v, tau))
    np.testing.assert_allclose(a[list(system.independent)], a_a, rtol=0, atol=1e-9)
    J = np.array(closure_jacobian(system)(q))
    needed = np.array(mbs.models.inverse_dynamics(system, coordinates="tree")(q, v, a)).ravel()
    np.testing.assert_allclose(needed, tau + J.T @ lam, rtol=0, atol=1e-8)


def test_motion_keeps_constraint_and_energy(held):
    run = mbs.simulate.run(held.system, 1.0, step=0.05, tolerance=1e-10, quiet=True)
    q = np.column_stack([run[f"{c.name}.q"] for c in held.system.coordinates])
    assert np.ptp(q, axis=0).max() > 0.05
    assert max(held.openness(row) for row in q) < 1e-11
    assert run["closure_residual"].max() < 1e-12
    total = run["kinetic_energy"] + run["potential_energy"]
    assert np.ptp(total) < 1e-7 * max(1.0, run["kinetic_energy"].max())


CRANK, ROCKER, COUPLER, GROUND = 0.4, 0.9, 1.0, 0.8
INERTIA, MASS = (0.05, 0.4), (1.2, 2.1)


def rod_four_bar(length: Any = COUPLER, coupler=None):
    """Crank and rocker, joined by a rod or by a bar."""
    m = mbs.Mechanism("rod_four_bar", gravity=DOWN)
    a, c = (
        m.add(Body(name, mass, (arm / 2, 0, 0), (0, J, J)))
        for name, mass, arm, J in zip("ac", MASS, (CRANK, ROCKER), INERTIA, strict=True)
    )
    m.connect(m.world, Revolute("j1", actuated=True), a)
    m.connect(m.world.at(GROUND), Revolute("j4"), c)
    if coupler is None:
        m.connect(a.at(CRANK), Rod("rod", length=length), c.at(ROCKER))
        return m.assemble(guess={"j4": 1.0})
    bar = m.add(coupler)
    m.connect(a.at(CRANK), Revolute("j2"), bar)
    m.connect(bar.at(COUPLER), Revolute("j3"), c.at(ROCKER))
    return m.assemble(guess={"j1": 0.0, "j2": 1.0, "j4": 1.0})


def constrained_equations(q, v, tau):
    """Accelerations and rod force of the rod four-bar, written down by hand."""
    arms = np.array([CRANK, ROCKER])
    along = arms[:, None] * np.column_stack([np.cos(q), np.sin(q)])
    ahead = arms[:, None] * np.column_stack([-np.sin(q), np.cos(q)])
    gap = np.array([GROUND, 0]) + along[1] - along[0]
    rate = ahead[1] * v[1] - ahead[0] * v[0]
    J = np.array([-gap @ ahead[0], gap @ ahead[1]]) / COUPLER
    psi = (rate @ rate + gap @ (along[0] * v[0] ** 2 - along[1] * v[1] ** 2)) / COUPLER
    M = np.array(INERTIA) + np.array(MASS) * (arms / 2) ** 2
    weight = 9.81 * np.array(MASS) * arms / 2 * np.cos(q)
    K = np.block([[np.diag(M), -J[:, None]], [J[None], np.zeros((1, 1))]])
    solution = np.linalg.solve(K, [tau - weight[0], -weight[1], -psi])
    return solution[:2], solution[2]


@pytest.mark.parametrize("angle", [0.3, 1.9, 4.0])
def test_rod_against_equations_by_hand(angle):
    system = rod_four_bar()
    q = solve(system, {"j1": angle})
    v = np.array(reduction_matrix(system)(q)) @ [1.7]
    a, lam = mbs.models.direct_dynamics(system, coordinates="tree")(q, v, [2.5, 0.0])
    expected, force = constrained_equations(q, v.ravel(), 2.5)
    np.testing.assert_allclose(np.array(a).ravel(), expected, rtol=0, atol=1e-9)
    assert float(lam) == pytest.approx(force, abs=1e-9)


def test_rod_is_a_coupler_without_mass():
    bar = Body("bar", 1e-9, (COUPLER / 2, 0, 0), (0, 1e-10, 1e-10))
    rod, light = rod_four_bar(), rod_four_bar(coupler=bar)
    options = dict(duration=2.0, step=0.02, tolerance=1e-10, quiet=True)
    runs = [mbs.simulate.run(s, q0={"j1": 0.2}, **options) for s in (rod, light)]
    for name in ("j1.q", "j4.q", "j1.v", "j4.v"):
        np.testing.assert_allclose(runs[0][name], runs[1][name], rtol=0, atol=1e-6)


def test_length_may_be_a_symbol():
    system = rod_four_bar(mbs.Parameter("L", 1.0, "m"))
    closed = closure_residual(system)
    for length in (0.95, 1.1):
        q = solve(system, {"j1": 0.3}, parameters={"L": length})
        along = (np.cos(q[1]) * ROCKER + GROUND - CRANK * np.cos(q[0])) ** 2
        assert along + (ROCKER * np.sin(q[1]) - CRANK * np.sin(q[0])) ** 2 == pytest.approx(
            length**2, abs=1e-12
        )
        assert abs(float(closed(q, [length]))) < 1e-12


def test_a_second_rod_of_a_parallelogram_is_redundant():
    m = mbs.Mechanism("parallelogram", gravity=DOWN)
    a, c = (m.add(Box(name, length=0.5, mass=1.0)) for name in "ac")
    m.connect(m.world, Revolute("j1", actuated=True), a.left)
    m.connect(m.world.at(0.8), Revolute("j4"), c.left)
    for name, arm in (("upper", 0.5), ("lower", 0.3)):
        m.connect(a.at(arm), Rod(name, length=0.8), c.at(arm))
    system = m.assemble(guess={"j1": 0.7, "j4": 0.7})
    assert system.closure.mobility == 1
    assert sum(len(row.dropped) for row in system.loops) == 1
    assert "Dropped, since the others imply them: force along" in system.report()
    q = solve(system, {"j1": 2.0})
    assert q[1] == pytest.approx(2.0, abs=1e-12)


def test_a_free_body_hangs_on_three_rods():
    m = mbs.Mechanism("swing")
    plate = m.add(Body("plate", 1.0, (0, 0, 0), (0.1, 0.1, 0.15)))
    m.connect(m.world, Free("f"), plate)
    for k, angle in enumerate((0.0, 2.1, 4.2)):
        p = 0.3 * np.array([np.cos(angle), np.sin(angle), 0])
        hook = 1.5 * p + [0, 0, 1.0]
        rod = Rod(f"r{k}", length=float(np.linalg.norm(hook - p)))
        m.connect(m.world.at(*hook), rod, plate.at(*p))
    system = m.assemble()
    assert system.closure.mobility == 3
    run = mbs.simulate.run(system, 2.0, v0={"f.vx": 0.3, "f.vy": 0.2}, tolerance=1e-10, quiet=True)
    total = run["kinetic_energy"] + run["potential_energy"]
    assert np.ptp(total) < 1e-8
    assert run["closure_residual"].max() < 1e-12


def test_constraints_that_cannot_be():
    m = mbs.Mechanism("m")
    body = m.add(Body("b", 1.0, inertia=(0.1, 0.1, 0.1)))
    m.connect(m.world.at(z=1), Rod("rod", length=1), body)
    m.connect(m.world, Revolute("j"), m.add(Body("c", 1.0, inertia=(0.1, 0.1, 0.1))))
    parts = ["from the world to 'b'", "Rod 'rod' constrains it but does not place it", "by a Free"]
    refused(AssemblyError, *parts, by=m.assemble)
    refused(
        Unclosable,
        "the loop cannot be closed",
        "rod open by 1.05 m",
        by=lambda: rod_four_bar(length=3.4),
    )
