"""Where solutions come from."""

from functools import cache

import numpy as np
import pytest
from support.catalogue_systems import catalogue_system
from support.plain_arms import manseur_doty

from mbs.errors import ModelError, NoClosedForm
from mbs.models.inverse_geometry.chain import frame_chain
from mbs.models.inverse_geometry.draft import extend_draft, join_drafts, pose_draft, search_draft
from mbs.models.inverse_geometry.target import Target

NONE = np.zeros(0)


@cache
def way(name):
    return frame_chain(catalogue_system(name))


def target(name, q):
    arm = way(name).arm(NONE)
    return Target(arm, arm.pose(np.array(q)))


REGULAR = [0.3, -0.5, 0.7, 0.4, 0.9, 0.2]


def test_leaves_carry_their_signs():
    found = pose_draft(way("puma560"), target("puma560", REGULAR), "auto", NONE)
    assert found.method == "pieper"
    assert found.certain
    assert len(found.q) == len(set(found.labels)) == 8
    assert np.max(target("puma560", REGULAR).residual(found.q)) < 1e-14


def test_a_degenerate_pose_is_not_certain():
    aim = target("puma560", [0.3, -0.5, 0.7, 0.4, 0.0, 0.2])
    found = pose_draft(way("puma560"), aim, "pieper", NONE)
    assert not found.certain
    more = join_drafts(extend_draft(way("puma560"), aim, found, NONE), search_draft(aim))
    assert len(more.q) > len(found.q)
    assert more.labels[: len(found.labels)] == found.labels
    assert np.max(aim.residual(more.q)) < aim.tolerance


def test_each_method_says_its_name():
    aim = target("puma560", REGULAR)
    for method in ("general", "search"):
        found = pose_draft(way("puma560"), aim, method, NONE)
        assert (found.method, len(found.q)) == (method, 8)
        assert set(found.labels) == {""}


def test_what_does_not_fit_is_refused():
    aim = target("scara", [0.3, 0.5, 0.2, -0.1])
    with pytest.raises(NoClosedForm):
        pose_draft(way("scara"), aim, "pieper", NONE)
    with pytest.raises(ModelError, match="it is for six joints"):
        pose_draft(way("scara"), aim, "general", NONE)
    with pytest.raises(ModelError, match=r"method is .newton., which is not known"):
        pose_draft(way("scara"), aim, "newton", NONE)


def test_the_search_has_enough_starts():
    assert len(search_draft(Target(*manseur_doty())).q) == 16
