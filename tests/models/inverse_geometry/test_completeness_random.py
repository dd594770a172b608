"""Every configuration of random arms of each class: `solve` against a multi-start search."""

import numpy as np
import pytest
from support import arms
from support.arm_completeness import assert_complete
from support.arm_search import plain_arm

SLIDING = ("PRRRRR", "RRRPRR", "RPRRPR", "PRPRRR", "PRPRPR", "RRPPRP", "PPPRRR")


def complete(system, seed, locked=None):
    arm = plain_arm(system, locked)
    assert_complete(system, arm.random(np.random.default_rng((9, seed))), locked)


@pytest.mark.parametrize("seed", range(3))
def test_general_6r(seed):
    complete(arms.general_6r(seed), seed)


@pytest.mark.parametrize("first", [1, 2, 3, 4])
def test_spherical_joint_anywhere(first):
    complete(arms.spherical(first, 0), 1)


@pytest.mark.parametrize("first", [1, 3])
def test_three_parallel_axes(first):
    complete(arms.three_parallel(first, 0), first)


@pytest.mark.sweep
@pytest.mark.parametrize("kinds", SLIDING)
def test_slides_anywhere(kinds):
    complete(arms.slides_and_turns(kinds, 0), 4)


def test_general_5r():
    complete(arms.general_5r(0), 0)


@pytest.mark.parametrize("joint", [5])
def test_general_7r_with_one_joint_locked(joint):
    complete(arms.general_7r(0), joint, {f"q{joint}": 0.7})
