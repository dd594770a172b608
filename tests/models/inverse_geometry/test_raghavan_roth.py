import numpy as np
import pytest
from support.arms import general_6r, placements, slides_and_turns, spherical, three_parallel
from support.catalogue_systems import catalogue_system

from mbs.closed_forms import arm_core
from mbs.closed_forms.arm import Arm, gap_to, motion
from mbs.closed_forms.arm_search import general_many, general_of
from mbs.closed_forms.displacement_matrices import (
    back_parts,
    frame_products,
    half_parts,
    motion_parts,
    rho,
)
from mbs.closed_forms.raghavan_roth import prepare
from mbs.errors import ModelError, NoClosedForm
from mbs.models.inverse_geometry.chain import frame_chain

ROBOTS = (
    "crx10",
    "gantry",
    "irb120",
    "kr6",
    "manseur_doty",
    "puma560",
    "rx90",
    "stanford",
    "tx90",
    "ur5",
)
SLIDING = [*placements(1), *placements(2)[::2], *placements(3)[::3]]


def arm_of(system):
    return frame_chain(system).arm(np.array(system.p_default))


def configurations(arm, rng, count):
    turns = rng.uniform(-np.pi, np.pi, (count, arm.size))
    return np.where(arm.prismatic, 0.6 * arm.length * rng.uniform(-1, 1, turns.shape), turns)


def newton(arm, T, q, steps=12):
    """Damped Gauss-Newton steps from configurations q, (m, n), and how far from T each ends."""
    unit = np.array([1 / arm.length] * 3 + [1.0] * 3)
    size = np.where(arm.prismatic, arm.length, 1.0)
    pose, J = arm.pose_and_jacobian(q)
    gap = unit * gap_to(T, pose)
    damping = np.full(len(q), 1e-6)
    for _ in range(steps):
        A = unit[:, None] * J * size
        far = np.sum(gap**2, axis=1)
        squared = np.swapaxes(A, 1, 2) @ A
        squared += ((damping * np.minimum(far, 1) + 1e-13)[:, None, None]) * np.eye(arm.size)
        step = np.linalg.solve(squared, np.swapaxes(A, 1, 2) @ gap[..., None])[..., 0]
        moved_pose, moved_J = arm.pose_and_jacobian(q + size * step)
        moved_gap = unit * gap_to(T, moved_pose)
        better = np.sum(moved_gap**2, axis=1) < far
        q = np.where(better[:, None], q + size * step, q)
        gap, J = (
            np.where(better[:, None], moved_gap, gap),
            np.where(better[:, None, None], moved_J, J),
        )
        damping = np.where(better, 0.1 * damping, 20 * np.maximum(damping, 1e-8))
    return q, np.max(np.abs(arm.pose(q) - T), axis=(1, 2))


def distance(arm, a, b):
    d = a - b
    return np.max(
        np.abs(np.where(arm.prismatic, d / arm.length, (d + np.pi) % (2 * np.pi) - np.pi)), axis=-1
    )


def distinct(arm, q, tolerance=1e-5):
    kept = np.zeros((0, arm.size))
    for configuration in q:
        if np.all(distance(arm, kept, configuration) > tolerance):
            kept = np.vstack([kept, configuration])
    return kept


def candidates(arm, T):
    """Configurations that may reach a pose, before they are polished and checked."""
    return arm_core.candidates_by(arm_core.core(), general_of(arm).c_loop, T)


def candidates_many(arm, T):
    every = [candidates(arm, pose) for pose in T]
    return np.repeat(np.arange(len(T)), [len(q) for q in every]), np.concatenate(every)


def solved(arm, T):
    q, residual = newton(arm, T, candidates(arm, T))
    return distinct(arm, q[residual < 1e-10 * (1 + arm.length)])


def searched(arm, T, rng, starts=120):
    q, residual = newton(arm, T, configurations(arm, rng, starts), 40)
    return distinct(arm, q[residual < 1e-10 * (1 + arm.length)])


def assert_complete(arm, rng, poses, oracle=1):
    assert prepare(arm).regular
    for number, q in enumerate(configurations(arm, rng, poses)):
        T = arm.pose(q)
        found = solved(arm, T)
        assert np.min(distance(arm, found, q)) < 1e-6
        if number < oracle:
            for other in searched(arm, T, rng):
                assert np.min(distance(arm, found, other)) < 1e-5


def random_poses(rng, count):
    q = rng.uniform(-3, 3, (count, 6))
    arm = Arm(tuple("abcdef"), np.array([0, 1, 0, 1, 0, 0], bool), np.stack([np.eye(4)] * 7))
    quarter = np.array([[0, 0, 1, 0.3], [1, 0, 0, 0.1], [0, 1, 0, -0.2], [0, 0, 0, 1.0]])
    return Arm(arm.names, arm.prismatic, np.stack([quarter] * 7)).pose(q)


def test_pairs_move_by_a_representation():
    A, B = random_poses(np.random.default_rng(1), 10).reshape(2, 5, 4, 4)
    np.testing.assert_allclose(rho(A) @ rho(B), rho(A @ B), atol=1e-11)
    np.testing.assert_allclose(
        (rho(A) @ frame_products(B)[..., None])[..., 0], frame_products(A @ B), atol=1e-11
    )


@pytest.mark.parametrize("slides", [False, True])
@pytest.mark.parametrize("q", [0.7, -2.1])
def test_parts_of_a_joint_make_its_map(slides, q):
    weights = np.array([1, q, q * q] if slides else [1, np.cos(q), np.sin(q)])
    half = np.array([1, q, q * q] if slides else [1, np.tan(q / 2), np.tan(q / 2) ** 2])
    scale = 1 if slides else 1 + half[2]
    exact = rho(motion(np.array(q), slides))
    np.testing.assert_allclose(np.tensordot(weights, motion_parts(slides), 1), exact, atol=1e-14)
    np.testing.assert_allclose(
        np.tensordot(weights, back_parts(slides), 1) @ exact, np.eye(15), atol=1e-13
    )
    np.testing.assert_allclose(
        np.tensordot(half, half_parts(slides), 1), scale * exact, atol=1e-13 * scale
    )


@pytest.mark.parametrize("name", ROBOTS)
def test_robots_are_solved_completely(name):
    assert_complete(arm_of(catalogue_system(name)), np.random.default_rng(2), 4)


@pytest.mark.parametrize("seed", range(3))
def test_general_arms_are_solved_completely(seed):
    assert_complete(arm_of(general_6r(seed)), np.random.default_rng(seed), 4)


@pytest.mark.parametrize("first", range(1, 5))
@pytest.mark.parametrize("make", [spherical, three_parallel])
def test_special_arms_are_solved_completely(make, first):
    assert_complete(arm_of(make(first - 1, 0)), np.random.default_rng(first), 4)


@pytest.mark.sweep
@pytest.mark.parametrize("kinds", SLIDING)
def test_slides_anywhere(kinds):
    assert_complete(arm_of(slides_and_turns(kinds, 0)), np.random.default_rng(3), 3, oracle=0)


@pytest.mark.parametrize("kinds", ["PRRRRR", "RRPRRR", "RRRRRP", "PRPRRR", "PRRPRR", "PRPRPR"])
def test_slides_against_a_search(kinds):
    assert_complete(arm_of(slides_and_turns(kinds, 1)), np.random.default_rng(4), 2, oracle=2)


def test_sixteen_configurations_of_one_pose():
    arm = arm_of(catalogue_system("manseur_doty"))
    T = arm.pose(configurations(arm, np.random.default_rng(0), 40))
    number, q = candidates_many(arm, T)
    reached = np.max(np.abs(arm.pose(q) - T[number]), axis=(1, 2)) < 1e-7
    counts = [len(distinct(arm, q[reached & (number == k)])) for k in range(len(T))]
    assert max(counts) == 16
    assert all(count % 2 == 0 for count in counts)


def test_many_poses_are_as_one_by_one():
    arm = arm_of(general_6r(1))
    T = arm.pose(configurations(arm, np.random.default_rng(5), 4))
    number, q = general_many(general_of(arm), T)
    assert np.all(np.diff(number) >= 0)
    for k in range(len(T)):
        alone = solved(arm, T[k])
        assert len(alone) == np.sum(number == k)
        for configuration in alone:
            assert np.min(distance(arm, q[number == k], configuration)) < 1e-6


def test_candidates_are_accurate_before_any_step():
    arm = arm_of(general_6r(2))
    T = arm.pose(configurations(arm, np.random.default_rng(6), 20))
    number, q = candidates_many(arm, T)
    residual = np.max(np.abs(arm.pose(q) - T[number]), axis=(1, 2))
    best = [np.min(residual[number == k]) for k in range(len(T))]
    assert np.max(best) < 1e-9


@pytest.mark.parametrize("value", [0.0, np.pi, np.pi / 2])
def test_right_angles_of_a_general_arm(value):
    arm = arm_of(general_6r(3))
    rng = np.random.default_rng(7)
    for _ in range(4):
        q = np.where(rng.uniform(size=6) < 0.6, value, configurations(arm, rng, 1)[0])
        assert np.min(distance(arm, solved(arm, arm.pose(q)), q)) < 1e-6


@pytest.mark.parametrize("system", [general_6r(4), slides_and_turns("PRRRRR", 2)])
def test_double_configurations(system):
    arm = arm_of(system)
    rng = np.random.default_rng(8)
    for _ in range(4):
        q = singular_configuration(arm, rng)
        assert np.min(distance(arm, candidates(arm, arm.pose(q)), q)) < 1e-4


def singular_configuration(arm, rng):
    """Where the determinant of the Jacobian changes its sign between two configurations."""

    def determinant(q):
        return np.linalg.det(arm.pose_and_jacobian(q)[1])

    low, high = configurations(arm, rng, 2)
    while determinant(low) * determinant(high) > 0:
        low, high = configurations(arm, rng, 2)
    for _ in range(60):
        middle = 0.5 * (low + high)
        if determinant(low) * determinant(middle) > 0:
            low = middle
        else:
            high = middle
    return low


def test_out_of_reach_there_is_nothing():
    arm = arm_of(general_6r(5))
    T = arm.pose(np.zeros(6))
    T[:3, 3] = 3 * arm.length
    assert len(solved(arm, T)) == 0


def test_units_do_not_matter():
    arm = arm_of(general_6r(6))
    gaps = arm.gaps.copy()
    gaps[:, :3, 3] *= 1000
    large, q = (
        Arm(arm.names, arm.prismatic, gaps),
        configurations(arm, np.random.default_rng(9), 1)[0],
    )
    assert prepare(large).regularity == pytest.approx(prepare(arm).regularity, rel=1e-6)
    assert np.min(distance(large, candidates(large, large.pose(q)), q)) < 1e-8


def test_a_far_base_and_a_long_tool_do_not_matter():
    arm = arm_of(general_6r(6))
    gaps, far, long = arm.gaps.copy(), np.eye(4), np.eye(4)
    far[:3, 3], long[:3, 3] = (300, 200, 100), (-20, 40, 30)
    gaps[0], gaps[6] = far @ gaps[0], gaps[6] @ long
    moved, q = (
        Arm(arm.names, arm.prismatic, gaps),
        configurations(arm, np.random.default_rng(9), 1)[0],
    )
    assert prepare(moved).regularity == pytest.approx(prepare(arm).regularity, rel=1e-6)
    assert np.min(distance(arm, candidates(moved, moved.pose(q)), q)) < 1e-8


def test_four_parallel_axes_give_samples_of_the_self_motion():
    arm = arm_of(general_6r(7))
    gaps = arm.gaps.copy()
    gaps[2:5, :3, :3] = np.eye(3)
    arm = Arm(arm.names, arm.prismatic, gaps)
    q = configurations(arm, np.random.default_rng(10), 1)[0]
    assert prepare(arm).regular
    assert len(solved(arm, arm.pose(q))) > 2


def test_parallel_axes_everywhere_are_refused():
    gap = np.eye(4)
    gap[0, 3] = 0.5
    arm = Arm(tuple("abcdef"), np.zeros(6, bool), np.stack([gap] * 7))
    assert not prepare(arm).regular
    with pytest.raises(NoClosedForm, match="regularity"):
        candidates(arm, arm.pose(np.ones(6)))


@pytest.mark.parametrize("slides", [[False] * 5, [True] * 6])
def test_arms_that_the_method_is_not_for(slides):
    arm = Arm(tuple("abcdef"[: len(slides)]), np.array(slides), np.stack([np.eye(4)] * 7))
    with pytest.raises(ModelError, match="six joints"):
        prepare(arm)
