import numpy as np
import pytest
from support.plain_arms import (
    khalil,
    manseur_doty,
    puma,
    random_arm,
)

from mbs.closed_forms.arm_search import polish

RNG_SEED = 20260401


def arms():
    rng = np.random.default_rng(RNG_SEED)
    slides = random_arm(rng, 6, [False, True, False, False, True, False])
    return [puma(), manseur_doty()[0], random_arm(rng, 6), slides, random_arm(rng, 4)]


@pytest.mark.parametrize("number", range(5))
def test_configurations_beside_solutions_become_solutions(number):
    arm, rng = arms()[number], np.random.default_rng(number)
    q = rng.uniform(-3, 3, (40, arm.size))
    T = arm.pose(q)
    given = q + 1e-5 * rng.standard_normal(q.shape)
    polished, residual = polish(arm, T, given)
    assert np.max(residual) < 1e-14
    assert residual == pytest.approx(arm.residual(polished, T), abs=3e-15)
    assert np.median(np.abs(polished - q)) < 1e-13


def test_one_pose_serves_all_configurations():
    arm, T = manseur_doty()
    given = np.random.default_rng(1).uniform(-3, 3, (30, 6))
    each, _ = polish(arm, np.repeat(T[None], 30, axis=0), given)
    assert np.array_equal(polish(arm, T, given)[0], each)


def test_no_residual_grows():
    rng = np.random.default_rng(2)
    for arm in arms():
        T = arm.pose(rng.uniform(-3, 3, arm.size))
        T[:3, 3] += arm.length * np.array([2.0, 0.5, -1.0])  # out of reach
        given = rng.uniform(-3, 3, (30, arm.size))
        before = arm.residual(given, T)
        _, residual = polish(arm, T, given)
        assert np.all(residual <= before + 1e-14)
        assert np.mean(residual < before) > 0.5


def test_an_exact_configuration_stays():
    arm, q = puma(), np.array([[0.1, -0.4, 0.7, 0.2, 0.9, 4.0]])
    assert np.array_equal(polish(arm, arm.pose(q[0]), q)[0], q)


def test_the_input_is_left_alone():
    arm, q = puma(), np.zeros((1, 6))
    polish(arm, arm.pose(np.full(6, 0.01)), q)
    assert not q.any()


def test_a_stretched_arm_where_two_solutions_meet():
    arm = khalil([(0, 0, 0, 0), (0, 1.0, 0, 0), (0, 0.7, 0, 0)])
    q = np.array([[0.3, 0.0, 0.0], [1.2, 0.0, -0.4]])
    T = arm.pose(q)
    polished, residual = polish(arm, T, q + np.array([0.02, -0.03, 0.04]))
    assert np.max(residual) < 1e-15
    assert np.max(np.abs(polished - q)) < 1e-7


@pytest.mark.parametrize("bend", [1e-5, 0.0])
def test_a_wrist_that_is_nearly_or_quite_straight(bend):
    arm, rng = puma(), np.random.default_rng(3)
    q = rng.uniform(-3, 3, (40, 6))
    q[:, 4] = bend
    T = arm.pose(q)
    _, residual = polish(arm, T, q + 1e-4 * rng.standard_normal(q.shape))
    assert np.max(residual) < 1e-13
