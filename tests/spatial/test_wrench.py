"""Wrenches carried to other frames, against the (6, 6) transform and the work they do."""

import numpy as np
import pytest
from casadi import DM, SX
from support.random_trees import random_rotation

from mbs.spatial import Pose, add_wrenches, transform_wrench


def drawn(seed):
    rng = np.random.default_rng(seed)
    R, p = random_rotation(rng), rng.normal(size=3)
    f, m = rng.normal(size=(2, 3))
    return R, p, f, m


def numeric(wrench):
    return np.concatenate([DM(part).full().ravel() for part in wrench])


def sx(*vectors):
    return tuple(SX(DM(vector)) for vector in vectors)


@pytest.mark.parametrize("seed", range(5))
def test_a_carried_wrench_is_the_transform_of_force_and_moment(seed):
    R, p, f, m = drawn(seed)
    pose, wrench = Pose(*sx(R, p)), sx(f, m)
    there = transform_wrench(pose, wrench)
    expected = np.concatenate([R @ f, R @ m + np.cross(p, R @ f)])
    np.testing.assert_allclose(numeric(there), expected, atol=1e-14)
    np.testing.assert_allclose(
        numeric(transform_wrench(pose.inverse(), there)), [*f, *m], atol=1e-14
    )


def test_two_ways_and_one_and_their_sum():
    first, second = drawn(11), drawn(12)
    a, b = (Pose(*sx(R, p)) for R, p, _, _ in (first, second))
    one, other = sx(*first[2:]), sx(*second[2:])
    step_by_step = transform_wrench(a, transform_wrench(b, one))
    np.testing.assert_allclose(
        numeric(step_by_step), numeric(transform_wrench(a @ b, one)), atol=1e-14
    )
    together = numeric(transform_wrench(a, add_wrenches(one, other)))
    alone = numeric(transform_wrench(a, one)) + numeric(transform_wrench(a, other))
    np.testing.assert_allclose(together, alone, atol=1e-14)


def test_power_does_not_depend_on_the_frame():
    R, p, f, m = drawn(3)
    V, w = np.random.default_rng(4).normal(size=(2, 3))
    there = numeric(transform_wrench(Pose(*sx(R, p)), sx(f, m)))
    w_i = R @ w
    V_i = R @ V + np.cross(p, w_i)
    assert there[:3] @ V_i + there[3:] @ w_i == pytest.approx(f @ V + m @ w, rel=1e-13)
