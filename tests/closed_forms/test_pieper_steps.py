"""Pieper's method: symbolic lengths, special poses, the text of its steps, its refusals."""

from __future__ import annotations

import casadi
import numpy as np
import pytest
from support.arm_search import distance
from support.arms import general_5r, general_6r, spherical
from support.pieper_arms import (
    EXACT,
    catalogue,
    configurations,
    leaves_of,
    lengths,
    solved,
    with_wrist,
)

from mbs.closed_forms.pieper import pieper
from mbs.errors import NoClosedForm
from mbs.models.inverse_geometry.chain import frame_chain

H = np.pi / 2


def test_symbolic_lengths_give_the_same_configurations():
    system, p = lengths()
    way = frame_chain(system)
    symbolic, sequence = leaves_of(way.problem())
    numeric, plain = leaves_of(way.problem(p))
    assert sequence.signs == plain.signs == ("q3a", "q3", "q5")
    arm = way.arm(p)
    for q in np.random.default_rng(10).uniform(-3, 3, (10, 6)):
        T = arm.pose(q)
        ours = configurations(symbolic, T, p)
        assert len(ours) >= 2
        assert np.max(np.abs(arm.pose(ours) - T)) < EXACT
        assert np.cos(ours - configurations(numeric, T)) == pytest.approx(1, abs=1e-12)


@pytest.mark.parametrize("scale", [1e-2, 1e3])
def test_the_size_of_the_arm_does_not_matter(scale):
    system, p = lengths()
    way, sizes = frame_chain(system), np.array([scale] * (len(p) - 1) + [1.0])
    leaves, _ = leaves_of(way.problem(p * sizes))
    arm, like = way.arm(p * sizes), way.arm(p)
    same, _ = leaves_of(way.problem(p))
    for q in np.random.default_rng(11).uniform(-3, 3, (10, 6)):
        ours, others = configurations(leaves, arm.pose(q)), configurations(same, like.pose(q))
        assert np.cos(ours - others) == pytest.approx(1, abs=1e-12)


def test_folded_arm_with_the_wrist_near_the_shoulder():
    _, leaves, _, arm = solved(catalogue, "puma560")
    # q3 folds the forearm back along the upper arm; q5 is nearly straight
    for q3, q5 in ((-1.54, 1e-5), (-1.52, 1e-3), (-1.524, 1e-4)):
        q = np.array([0.3, -0.8, q3, 0.4, q5, 1.1])
        T = arm.pose(q)
        ours = configurations(leaves, T)
        assert len(ours) in (4, 8)
        assert np.max(arm.residual(T, ours)) < EXACT


@pytest.mark.parametrize(
    ("build", "arguments"), [(catalogue, ("puma560",)), (spherical, (3, 0)), (spherical, (4, 1))]
)
def test_singular_configurations_are_found(build, arguments):
    _, leaves, _, arm = solved(build, *arguments)
    rng = np.random.default_rng(12)
    for _ in range(20):
        q = rng.choice([0, H, -H, np.pi], 6)
        T = arm.pose(q)
        columns = np.array(leaves(np.ravel(T[:3], order="F")))
        assert np.isfinite(columns).all()
        assert np.min(arm.residual(T, columns[:-2].T)) < 1e-9


def test_any_numbers_for_the_pose_give_finite_numbers():
    for build, arguments in ((catalogue, ("rx90",)), (spherical, (2, 0)), (spherical, (4, 0))):
        _, leaves, _, _ = solved(build, *arguments)
        rng = np.random.default_rng(13)
        for T in (np.zeros(12), np.ones(12), 1e6 * rng.normal(size=12), rng.normal(size=12)):
            assert np.isfinite(np.array(leaves(T))).all()


def test_out_of_reach_has_no_real_branch():
    for build, arguments in ((catalogue, ("puma560",)), (spherical, (4, 0))):
        _, leaves, _, arm = solved(build, *arguments)
        T = arm.pose(np.full(6, 0.3))
        T[:3, 3] += 3 * arm.reach
        assert len(configurations(leaves, T)) == 0


def test_configurations_move_with_the_pose():
    """The branches of a quartic follow a joint motion at the speed of the joints."""
    _, leaves, _, arm = solved(spherical, 4, 0)
    T = casadi.SX.sym("T", 12)
    x = leaves(T)[:6, :]
    slopes = casadi.Function("slopes", [T], [casadi.jacobian(x, T)])
    rng, step = np.random.default_rng(15), 1e-6
    for q in arm.random(rng, 10):
        rate = rng.normal(size=6)
        ahead, behind = (np.ravel(arm.pose(q + s * step * rate)[:3], order="F") for s in (1, -1))
        middle = np.ravel(arm.pose(q)[:3], order="F")
        columns = np.array(leaves(middle))
        branch = int(np.argmin(distance(arm, columns[:6].T, q)))
        speeds = np.array(slopes(middle)) @ (ahead - behind) / (2 * step)
        assert speeds.reshape(8, 6)[branch] == pytest.approx(rate, abs=1e-4)


def test_steps_can_be_read():
    _, _, sequence, _ = solved(catalogue, "puma560")
    first = sequence.steps[0]
    assert first.equation == "X3 cos(q3) + Y3 sin(q3) = Z3"
    assert first.coefficients == ("X3", "Y3", "Z3")
    assert first.signs == ("q3",)
    names = [name for one in sequence.steps for name in one.coefficients]
    assert len(set(names)) == len(names)
    assert sorted(name for one in sequence.steps for name in one.names) == list(
        frame_chain(catalogue("puma560")).names
    )


def test_coefficients_fulfil_the_equation():
    _, _, sequence, arm = solved(spherical, 4, 0)
    given = casadi.SX.sym("given", 12)
    leaf = sequence.leaf(given, casadi.SX.ones(3))
    A, B, X, Y, Z = (leaf.coefficients[f"{letter}3"] for letter in "ABXYZ")
    q3 = leaf.x[2]
    rest = A * casadi.cos(2 * q3) + B * casadi.sin(2 * q3)
    rest += X * casadi.cos(q3) + Y * casadi.sin(q3) - Z
    real = casadi.mmin(leaf.real)
    function = casadi.Function("rest", [given], [rest, real])
    checked = 0
    for q in arm.random(np.random.default_rng(14), 60):
        value, radicand = map(float, function(np.ravel(arm.pose(q)[:3], order="F")))
        checked += radicand > 0
        assert radicand <= 0 or value == pytest.approx(0, abs=1e-12)
    assert checked > 5


def test_refusals_name_the_joints_and_the_condition():
    with pytest.raises(NoClosedForm, match=r"three neighbouring axes of q1 \.\. q6 meet"):
        pieper(frame_chain(general_6r(0)).problem())
    with pytest.raises(NoClosedForm, match="the loop has 5 unknown joints"):
        pieper(frame_chain(general_5r(0)).problem())
    flat = {1: {"alpha": 0.0}, 2: {"alpha": 0.0}}
    with pytest.raises(NoClosedForm, match="singular in every configuration"):
        pieper(frame_chain(with_wrist("RRRRRR", 4, 3, flat)).problem())
    four = {1: {"d": 0.0, "r": 0.0}, 2: {"d": 0.0, "r": 0.0}, 3: {"d": 0.0}}
    with pytest.raises(NoClosedForm, match="singular in every configuration"):
        pieper(frame_chain(with_wrist("RRRRRR", 4, 3, four)).problem())
    coplanar = {1: {"alpha": H}, 2: {"alpha": 0.0}}
    with pytest.raises(NoClosedForm, match="move in one plane"):
        pieper(frame_chain(with_wrist("PPPRRR", 4, 3, coplanar)).problem())
    parallel = {4: {"alpha": 0.0}}
    with pytest.raises(NoClosedForm, match="axes stay parallel"):
        pieper(frame_chain(with_wrist("PPPRRR", 4, 3, parallel)).problem())
