"""Paul's method: its steps, their text, and that no configuration is lost."""

from __future__ import annotations

import re
from functools import cache

import casadi
import numpy as np
import pytest
from casadi import DM, SX, Function
from support.arm_search import distance, plain_arm, some
from support.arms import general_6r, slides_and_turns, spherical, three_parallel
from support.catalogue_systems import catalogue_system

import mbs
from mbs.closed_forms.paul import paul
from mbs.closed_forms.sequence import Problem
from mbs.components.joints import Motion
from mbs.errors import NoClosedForm
from mbs.models.inverse_geometry.chain import frame_chain
from mbs.recursions.chain import ChainJoint, Gap, Ring
from mbs.robots.rows import frame, robot
from mbs.spatial import Pose, axis_rotation, vector

HALF = np.pi / 2


def arm(*rows):
    """An arm of rows of Khalil & Kleinfinger; s=1 slides."""
    kinds = ("revolute", "prismatic")
    frames = [
        frame(k, kinds[row.get("s", 0)], **{n: v for n, v in row.items() if n != "s"})
        for k, row in enumerate(rows)
    ]
    return robot("arm", "test", frames, []).assemble()


def catalogue(name):
    return catalogue_system(name)


def puma_5r():
    wrist = {"alpha": -HALF, "d": 0.02, "r": 0.43}
    return arm({}, {"alpha": -HALF, "r": 0.15}, {"d": 0.43}, wrist, {"alpha": HALF})


def two_sums():
    """A slide and two pairs of parallel axes: its equations have products of three angles."""
    tilted = {"alpha": 0.8, "d": 0.2, "r": 0.3}
    return arm({"s": 1}, {"d": 0.3, "r": 0.1}, {"d": 0.5}, tilted, {"d": 0.4})


def moved_origins():
    """A spherical wrist whose frames do not have their origins where its axes meet."""
    axes = ("z", "y", "y", "x", "y", "x")
    ways = ((0, 0, 0), (0, 0, 1), (0.5, 0, 0), (0.2, 0, 0), (0.3, 0.1, 0), (0.2, -0.1, 0))
    system = mbs.Mechanism("moved")
    before = system.world
    for k, (axis, way) in enumerate(zip(axes, ways, strict=True)):
        body = system.add(mbs.components.Body(f"b{k}", mass=1))
        joint = mbs.components.Revolute(f"q{k + 1}", axis=axis)
        system.connect(before.at(*way), joint, body.at(0, 0, 0))
        before = body
    return system.assemble()


# What is solved, and its leaves.
SOLVED = {
    "planar_2r": (lambda: catalogue("planar_2r"), 1),
    "planar_3r": (lambda: arm({}, {"d": 0.5}, {"d": 0.4}), 2),
    "scara": (lambda: catalogue("scara"), 2),
    "puma560": (lambda: catalogue("puma560"), 8),
    "rx90": (lambda: catalogue("rx90"), 8),
    "stanford": (lambda: catalogue("stanford"), 8),
    "ur5": (lambda: catalogue("ur5"), 8),
    "puma_5r": (puma_5r, 2),
    "gantry": (lambda: catalogue("gantry"), 2),
    "wrist": (lambda: arm({}, {"alpha": -0.7}, {"alpha": 1.1}), 2),
    "rpr": (lambda: arm({}, {"s": 1, "alpha": HALF}, {"alpha": HALF, "d": 0.1}), 2),
    "rr": (lambda: arm({}, {"alpha": 0.5, "d": 0.3, "r": 0.1}), 1),
    "p": (lambda: arm({"s": 1, "alpha": 0.3}), 1),
    "prprpr": (lambda: slides_and_turns("PRPRPR", 1), 2),
    "two_sums": (two_sums, 4),
    "spherical_1": (lambda: spherical(1, 2), 8),
    "spherical_4": (lambda: spherical(4, 2), 8),
    "parallel_2": (lambda: three_parallel(2, 2), 8),
    "moved_origins": (moved_origins, 8),
}


@pytest.mark.sweep
@pytest.mark.parametrize("name", SOLVED)
def test_leaves_hold_every_configuration(name):
    system, steps, at = solved(name)
    assert steps.branches == SOLVED[name][1]
    assert sorted(n for step in steps.steps for n in step.names if n[0] != "x") == sorted(
        row.name for row in system.coordinates
    )
    plain, rng = plain_arm(system), np.random.default_rng(len(name))
    for configuration in plain.random(rng, 6):
        T = plain.pose(configuration)
        assert_among(plain, configuration, closing(plain, T, at(T)))
    for other in some(plain, T, rng, 60):
        assert_among(plain, other, closing(plain, T, at(T)))


@pytest.mark.parametrize("name", ["puma560", "stanford", "scara", "spherical_4", "parallel_2"])
def test_equations_hold_as_they_are_written(name):
    system, steps, _ = solved(name)
    problem = frame_chain(system).problem(np.zeros(0))
    leaf = steps.leaf(problem.given, SX(DM([1] * len(steps.signs))))
    values = list(leaf.coefficients.values())
    function = Function("f", [problem.given], [leaf.x, casadi.vertcat(*values)])
    arm_at = frame_chain(system).arm(np.zeros(0))
    checked = 0
    for seed in range(20):
        q = np.random.default_rng(seed).uniform(-1, 1, arm_at.size) + 0.1
        T = arm_at.pose(q)
        x, coefficients = (np.array(out).ravel() for out in function(T[:3].ravel(order="F")))
        if np.max(np.abs(arm_at.pose(x) - T)) > 1e-6:
            continue
        names = dict(zip(leaf.coefficients, coefficients, strict=True))
        names |= dict(zip(arm_at.names, x, strict=True)) | {"cos": np.cos, "sin": np.sin}
        for step in steps.steps:
            if step.kind != "sum":
                checked += assert_holds(step.equation, names)
    assert checked > 5


def test_types_of_textbook_robots():
    kinds = {
        name: [step.kind for step in solved(name)[1].steps]
        for name in ("puma560", "planar_3r", "gantry", "spherical_4")
    }
    assert set(kinds["puma560"]) == {"type 2", "type 3"}
    assert kinds["planar_3r"] == ["type 3", "type 2", "type 3", "sum"]
    assert kinds["gantry"][:3] == ["type 1", "type 1", "type 1"]
    assert "quartic" in kinds["spherical_4"]


def test_symbolic_lengths_stay_symbols():
    system = arm(
        {}, {"alpha": -HALF, "r": "R2"}, {"d": "D3"}, {"alpha": -HALF, "d": "D4", "r": "R4"}
    )
    with_wrist = frame_chain(system)
    problem = with_wrist.problem()
    steps = paul(problem)
    leaves = steps.leaves(problem.given)
    configurations = Function("f", [problem.given], [casadi.horzcat(*(leaf.x for leaf in leaves))])
    for p in ([0.1, 0.5, 0.2, 0.4], [-0.3, 0.2, 0.0, 0.7]):
        at = with_wrist.arm(np.array(p))
        q = np.array([0.3, -0.4, 1.2, 0.5])
        T = at.pose(q)
        found = np.array(configurations(np.concatenate([p, T[:3].ravel(order="F")]))).T
        assert np.min(np.max(np.abs(found - q), axis=1)) < 1e-10


@pytest.mark.parametrize("name", ["puma560", "rx90", "stanford", "ur5", "scara", "spherical_4"])
def test_leaves_are_finite_for_every_pose(name):
    system, _, at = solved(name)
    plain, rng = plain_arm(system), np.random.default_rng(3)
    n = len(plain.slides)
    poses = [np.eye(4), plain.pose(np.zeros(n)), plain.pose(np.full(n, np.pi))]
    far = plain.pose(rng.uniform(-1, 1, n))
    far[:3, 3] += 100.0
    for T in (*poses, far):
        assert np.all(np.isfinite(at(T)))


def test_radicands_tell_poses_out_of_reach():
    system, steps, _ = solved("rx90")
    problem = frame_chain(system).problem(np.zeros(0))
    leaves = steps.leaves(problem.given)
    real = Function("f", [problem.given], [casadi.horzcat(*(leaf.real for leaf in leaves))])
    plain = plain_arm(system)
    T = plain.pose(np.full(6, 0.4))
    assert np.max(np.min(np.array(real(T[:3].ravel(order="F"))), axis=0)) >= 0
    T[:3, 3] *= 3
    assert np.max(np.min(np.array(real(T[:3].ravel(order="F"))), axis=0)) < 0


def test_a_loop_that_no_pose_closes():
    """A four-bar: the crank angle and the length of the coupler are given."""
    problem = four_bar()
    steps = paul(problem)
    assert steps.branches == 2
    leaves = steps.leaves(problem.given)
    function = Function("f", [problem.given], [casadi.horzcat(*(leaf.x for leaf in leaves))])
    for x, given in problem.samples:
        found = np.array(function(given)).T
        gap = np.abs(np.remainder(found - x + np.pi, 2 * np.pi) - np.pi)
        assert np.min(np.max(gap, axis=1)) < 1e-10


def test_refusals_name_the_joints_left():
    with pytest.raises(NoClosedForm, match=r"q1, q2, q3, q4, q5, q6.*more than two unknowns"):
        paul(frame_chain(general_6r(1)).problem(np.zeros(0)))
    ring = Ring((ChainJoint("ball", Motion.SPHERICAL, 0, 1),), (Gap(),))
    with pytest.raises(NoClosedForm, match="ball is spherical"):
        paul(Problem(ring, SX.sym("x", 2), SX.sym("g", 1), []))


def four_bar():
    """Crank 0.3 m, rocker 0.7 m, ground 1 m."""
    a, coupler = SX.sym("a"), SX.sym("c")
    crank = Pose.rotation(axis_rotation("z", a).matrix) @ Pose.translation(vector([0.3, 0, 0]))
    ground = Pose.translation(vector([-1, 0, 0]))
    gaps = (
        Gap(ground @ crank),
        Gap(Pose.translation(vector([coupler, 0, 0]))),
        Gap(Pose.translation(vector([0.7, 0, 0]))),
    )
    joints = tuple(ChainJoint(f"q{k + 2}", Motion.REVOLUTE, k, 1) for k in range(3))
    samples = []
    for angle, rocker in ((0.3, 1.9), (1.4, 2.4), (2.5, 0.8), (-0.9, 1.2)):
        tip = 0.3 * np.array([np.cos(angle), np.sin(angle)])
        reached = np.array([1 + 0.7 * np.cos(rocker), 0.7 * np.sin(rocker)])
        way = np.arctan2(*(reached - tip)[::-1])
        x = np.array([way - angle, rocker + np.pi - way, np.pi - rocker])
        samples.append((x, np.array([angle, np.linalg.norm(reached - tip)])))
    x = casadi.vertcat(*(SX.sym(f"x{k}") for k in range(6)))
    return Problem(Ring(joints, gaps), x, casadi.vertcat(a, coupler), samples)


@cache
def solved(name):
    """An arm of SOLVED, its sequence, and all leaves (m, n) as a function of the pose."""
    system = SOLVED[name][0]()
    problem = frame_chain(system).problem(np.zeros(0))
    steps = paul(problem)
    leaves = casadi.horzcat(*(leaf.x for leaf in steps.leaves(problem.given)))
    function = Function("leaves", [problem.given], [casadi.densify(leaves)], {"cse": True})
    return system, steps, lambda T: np.array(function(T[:3].ravel(order="F"))).T


def closing(plain, T, q):
    """The leaves that reach the pose."""
    return q[plain.residual(T, q) < 1e-6]


def assert_among(plain, configuration, found):
    assert np.min(distance(plain, found, configuration), initial=1.0) < 1e-5


def assert_holds(equation, names):
    """Evaluate each of the equations in a text; how many there were."""
    lines = equation.split(", ")
    for line in lines:
        code = re.sub(r"(?<=\w) (?=\w|\()", "*", line.replace("^", "**"))
        left, right = code.split(" = ")
        size = 1 + max(abs(names[n]) for n in re.findall(r"[A-Z]\d+[a-h]?", line))
        assert abs(eval(left, {}, names) - eval(right, {}, names)) < 1e-6 * size
    return len(lines)
