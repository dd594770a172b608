import numpy as np
import pytest
from support.plain_arms import apart, manseur_doty, puma, random_arm

from mbs.closed_forms.arm_search import general, general_of, merged, nearest, polish, search
from mbs.errors import ModelError


def test_redundant_arms_of_nine_joints_are_solved_too():
    arm = random_arm(np.random.default_rng(3), 9)
    q = np.random.default_rng(4).uniform(-1, 1, 9)
    T = arm.pose(q)
    assert np.max(polish(arm, T, q[None] + 1e-3)[1]) < 1e-13
    assert len(search(arm, T, starts=3)) > 0
    assert nearest(arm, T).distance < 1e-12


def test_poses_and_configurations_of_wrong_shapes_are_refused():
    arm, T = manseur_doty()
    for poses, configurations in (
        (T[:3], np.zeros((2, 6))),
        (T[None].repeat(3, 0), np.zeros((2, 6))),
    ):
        with pytest.raises(ValueError, match="broadcast"):
            polish(arm, poses, configurations)
    with pytest.raises(ValueError, match="broadcast"):
        polish(arm, T, np.zeros((2, 5)))
    with pytest.raises(ValueError, match="broadcast"):
        search(arm, T[:3], starts=2)


def test_an_arm_of_too_many_joints_is_an_error():
    arm = random_arm(np.random.default_rng(3), 65)
    with pytest.raises(ModelError, match="has 65 joints; inverse geometry takes 64 at most"):
        polish(arm, np.eye(4), np.zeros((1, 65)))


def test_the_library_needs_no_compiler(monkeypatch):
    monkeypatch.setenv("PATH", "")
    arm, T = manseur_doty()
    q = general(general_of(arm), T)
    assert len(q) == 16
    assert np.max(polish(arm, T, q + 1e-6)[1]) < 1e-14
    assert len(merged(arm, T, np.concatenate([q, q + 1e-9]))[0]) == 16
    found = search(puma(), puma().pose(np.full(6, 0.5)))
    assert len(found) == 8
    assert np.min(apart(puma(), found, np.full((1, 6), 0.5))) < 1e-12
    T[:3, 3] += 10
    assert nearest(arm, T).distance > 5
