import numpy as np
import pytest
from support.plain_arms import apart, manseur_doty, needs_compiler, puma, random_arm

import mbs.closed_forms.arm_core as core
from mbs.closed_forms.arm_search import general, general_of, merged, nearest, polish, search


@pytest.fixture
def no_compiler(monkeypatch):
    monkeypatch.setattr(core, "compiler_found", lambda: False)
    assert core.core() is None


@needs_compiler
def test_the_core_is_loaded_once():
    assert core.core() is core.core() is not None


def test_arms_of_more_joints_than_the_core_has_room_for_are_solved_too():
    arm = random_arm(np.random.default_rng(3), 9)
    assert core.core_of(arm) is None
    q = np.random.default_rng(4).uniform(-1, 1, 9)
    T = arm.pose(q)
    assert np.max(polish(arm, T, q[None] + 1e-3).residual) < 1e-13
    assert len(search(arm, T, starts=3)) > 0
    assert nearest(arm, T).distance < 1e-12


@needs_compiler
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


@pytest.mark.usefixtures("no_compiler")
def test_all_works_where_there_is_no_compiler():
    arm, T = manseur_doty()
    q = general(general_of(arm), T)
    assert len(q) == 16
    assert np.max(polish(arm, T, q + 1e-6).residual) < 1e-14
    assert len(merged(arm, T, np.concatenate([q, q + 1e-9])).q) == 16
    found = search(puma(), puma().pose(np.full(6, 0.5)))
    assert len(found) == 8
    assert np.min(apart(puma(), found, np.full((1, 6), 0.5))) < 1e-12
    T[:3, 3] += 10
    assert nearest(arm, T).distance > 5
