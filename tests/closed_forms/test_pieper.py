"""Pieper's method: every configuration of arms with a wrist anywhere, and of arms that slide."""

from __future__ import annotations

import numpy as np
import pytest
from support.arm_search import plain_arm
from support.arms import placements, slides_and_turns, spherical
from support.pieper_arms import (
    assert_all,
    assert_complete,
    catalogue,
    kinds_of,
    leaves_of,
    solved,
    with_wrist,
)

from mbs.closed_forms.sequence import Problem
from mbs.models.inverse_geometry.chain import frame_chain

H = np.pi / 2

# Joint letters, and the first of the three axes that meet; position joints with 1 or 2 slides.
WITH_SLIDES = (
    ("RRPRRR", 4, ("quartic", "type 3", "type 3")),
    ("RPRRRR", 4, ("quartic", "type 1", "type 3")),
    ("PRRRRR", 4, ("quartic", "type 3", "type 1")),
    ("RPPRRR", 4, ("quadratic", "type 1", "type 3")),
    ("PRPRRR", 4, ("quadratic", "type 3", "type 1")),
    ("PPRRRR", 4, ("type 2", "type 1", "type 1")),
    ("RPRRRP", 3, ("quadratic", "type 3", "type 1")),
    ("RRRRPR", 2, ("quartic", "type 3", "type 1")),
    ("RRRRPP", 1, ("quadratic", "type 1", "type 3")),
)
# What is special in rows 2 and 3 of an arm with a wrist at its end, and the kinds of its steps.
SPECIAL = (
    ("RRR", {1: {"d": 0.0}}, ("type 2", "type 2", "type 3")),
    ("RRR", {1: {"alpha": 0.0}}, ("type 2", "type 2", "type 3")),
    ("RRR", {2: {"alpha": 0.0}}, ("type 2", "type 2", "type 3")),
    ("RRR", {2: {"alpha": 0.0}, 1: {"d": 0.0, "alpha": H}}, ("type 2", "type 2", "type 3")),
    ("RRR", {1: {"alpha": H}, 2: {"alpha": H}}, ("quartic", "type 3", "type 3")),
    ("RRP", {1: {"alpha": -H, "d": 0.0}, 2: {"alpha": H}}, ("quadratic", "type 2", "type 3")),
    ("RRP", {1: {"alpha": 0.0}, 2: {"alpha": 0.0}}, ("type 1", "type 2", "type 3")),
    ("PRR", {1: {"alpha": H}}, ("type 2", "type 2", "type 1")),
    ("PRR", {2: {"alpha": 0.0}}, ("type 2", "type 3", "type 1")),
    ("RPR", {1: {"alpha": H}}, ("type 2", "quadratic", "type 3")),
    ("RPP", {1: {"alpha": H}}, ("type 1", "quadratic", "type 3")),
)


@pytest.mark.parametrize("name", ["puma560", "rx90", "stanford"])
def test_catalogue_arms_have_eight_configurations(name):
    _, leaves, sequence, arm = solved(catalogue, name)
    assert sequence.signs == ("q3", "q2", "q5")
    for q in arm.random(np.random.default_rng(1), 20):
        assert len(assert_all(leaves, arm, q)) == 8


@pytest.mark.sweep
@pytest.mark.parametrize("first", [1, 2, 3, 4])
@pytest.mark.parametrize("seed", range(2))
def test_three_axes_that_meet_anywhere(first, seed):
    _, leaves, sequence, arm = solved(spherical, first, seed)
    assert sequence.steps[0].kind == "quartic"
    assert sequence.branches == 8
    for q in arm.random(np.random.default_rng(seed), 20):
        assert_all(leaves, arm, q)
    if seed == 0:
        assert_complete(leaves, arm, 3)


@pytest.mark.sweep
@pytest.mark.parametrize(("kinds", "first", "steps"), WITH_SLIDES)
def test_slides_among_the_position_joints(kinds, first, steps):
    _, leaves, sequence, arm = solved(with_wrist, kinds, first, 1)
    assert kinds_of(sequence)[:3] == steps
    for q in arm.random(np.random.default_rng(4), 10):
        assert_all(leaves, arm, q)
    if kinds in ("RRPRRR", "PRPRRR", "RRRRPP"):
        assert_complete(leaves, arm, 5)


@pytest.mark.sweep
@pytest.mark.parametrize(("kinds", "special", "steps"), SPECIAL)
def test_special_arms_take_simple_equations(kinds, special, steps):
    leaves, sequence = leaves_of(
        frame_chain(system := with_wrist(kinds + "RRR", 4, 2, special)).problem()
    )
    assert kinds_of(sequence)[:3] == steps
    arm = plain_arm(system)
    for q in arm.random(np.random.default_rng(6), 10):
        assert_all(leaves, arm, q)


@pytest.mark.parametrize("kinds", placements(3)[::3])
def test_three_slides_anywhere(kinds):
    system = slides_and_turns(kinds, 1)
    leaves, sequence = leaves_of(frame_chain(system).problem())
    assert kinds_of(sequence) == ("type 2", "type 3", "type 3", "linear")
    arm = plain_arm(system)
    for q in arm.random(np.random.default_rng(8), 5):
        assert len(assert_all(leaves, arm, q)) == 2


@pytest.mark.parametrize(
    ("build", "arguments"),
    [(spherical, (4, 0)), (spherical, (1, 0)), (with_wrist, ("RPRRRR", 4, 1))],
)
def test_the_loop_may_begin_anywhere_and_run_backwards(build, arguments):
    system, _, _, arm = solved(build, *arguments)
    problem = frame_chain(system).problem()
    q = arm.random(np.random.default_rng(9))
    count = set[int]()
    for first in (1, 3, 4):
        ring = problem.ring.rotated(first)
        for walked in (ring, ring.reversed()):
            again = Problem(walked, problem.x, problem.given, problem.samples)
            count.add(len(assert_all(leaves_of(again)[0], arm, q)))
    assert len(count) == 1
