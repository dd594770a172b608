"""Plane loops in numbers against Levenberg-Marquardt from many starts, and what is degenerate."""

from itertools import combinations_with_replacement

import numpy as np
import pytest
from support.plane_equations import (
    closed,
    closed_loops,
    complex_numbers,
    missed,
    searched,
    triad,
)
from support.sweeps import EVERY_CASE

from mbs.closed_forms.planar_loops import (
    KNOWN,
    PlanarLoops,
    dixon_roots,
    path_roots,
    planar_roots,
)
from mbs.errors import LoopError, NoClosedForm

SEEDS = range(100) if EVERY_CASE else range(3)
LEGS = list(combinations_with_replacement(["RR", "PR", "RP"], 3))


@pytest.mark.parametrize("kinds", LEGS, ids="_".join)
@pytest.mark.parametrize("seed", SEEDS)
def test_triads(kinds, seed):
    loops = triad(np.random.default_rng(seed), kinds)
    roots = planar_roots(loops)
    assert roots.complete
    assert missed(loops, roots, searched(loops, 200, seed)) == 0


@pytest.mark.parametrize("seed", SEEDS)
def test_three_loops(seed):
    loops = closed_loops(np.random.default_rng(seed), 3)
    roots = planar_roots(loops)
    assert roots.proof == "Dixon's determinant of degree 20"
    assert missed(loops, roots, searched(loops, 1000, seed)) == 0


def test_four_loops():
    loops = closed_loops(np.random.default_rng(1), 4)
    roots = planar_roots(loops)
    assert roots.proof == "Dixon's determinant of degree 70"
    assert len(roots.values) == 10
    assert missed(loops, roots, searched(loops, 600, 1)) == 0


@pytest.mark.parametrize("seed", SEEDS)
def test_sparse_loops_are_split(seed):
    """A triad, and behind it a dyad on its platform: no equation holds all six links."""
    rng = np.random.default_rng(seed)
    loops = closed_loops(rng, 3, zeros=[(0, 4), (0, 5), (1, 4), (1, 5), (2, 0), (2, 2), (2, 3)])
    roots = planar_roots(loops)
    assert roots.proof == "Dixon's determinant of degree 6 and the quadratic equation of a dyad"
    assert missed(loops, roots, searched(loops, 600, seed)) == 0


@pytest.mark.parametrize("seed", SEEDS)
def test_sparse_loops_that_do_not_split(seed):
    rng = np.random.default_rng(seed)
    loops = closed_loops(rng, 3, zeros=[(0, 3), (0, 5), (1, 1), (1, 4), (2, 0), (2, 2)])
    roots = planar_roots(loops)
    assert " and " not in roots.proof
    assert missed(loops, roots, searched(loops, 1000, seed)) == 0


def test_dependent_rows_change_nothing():
    loops = triad(np.random.default_rng(5), ("RR", "RR", "RR"))
    mix = np.array([[1.0, 0], [0, 1], [1, 1], [2, -1]])
    more = PlanarLoops(mix @ loops.angles, mix @ loops.slides, loops.carriers, mix @ loops.constant)
    assert missed(more, planar_roots(more), searched(loops, 200, 5)) == 0


def test_rows_that_contradict_each_other_have_no_roots():
    loops = triad(np.random.default_rng(5), ("RR", "RR", "RR"))
    mix = np.array([[1.0, 0], [0, 1], [1, 1]])
    constant = mix @ loops.constant + np.array([0, 0, 0.1])
    more = PlanarLoops(mix @ loops.angles, mix @ loops.slides, loops.carriers, constant)
    assert len(planar_roots(more).values) == 0


@pytest.mark.parametrize("seed", range(200 if EVERY_CASE else 20))
def test_a_fold_is_kept(seed):
    """Legs in line with the normals of the curve of the platform: two roots meet."""
    folded, theta = folded_triad(np.random.default_rng(seed))
    roots = planar_roots(folded)
    gap = np.abs(np.exp(1j * roots.values) - np.exp(1j * theta)).max(axis=1)
    assert gap.min() < 1e-5


def folded_triad(rng):
    """A platform on three legs, and its angles, (1, 4), at which two roots meet."""
    loops = triad(rng, ("RR", "RR", "RR"))
    theta = np.array(rng.uniform(-3, 3, (1, 4)))
    # the three forces along the legs meet in one point: the platform may turn about it
    point = rng.normal() + 1j * rng.normal()
    E = np.array([[1, -1, 0], [1, 0, -1]])
    ends = rng.normal(size=3) + 1j * rng.normal(size=3)
    z = np.exp(1j * theta[0, 0])
    along = (point - ends * z) / np.abs(point - ends * z)
    theta[0, 1:] = np.angle(along)
    angles = np.column_stack([E @ ends, -E * rng.uniform(0.3, 1.5, 3)])
    constant = -(angles @ np.exp(1j * theta[0]))
    return PlanarLoops(angles, loops.slides, loops.carriers, constant), theta


def test_equal_legs_of_a_congruent_platform_move():
    """The platform may be carried in a circle: said by a singular equation, never in silence."""
    rng = np.random.default_rng(2)
    ends = rng.normal(size=3) + 1j * rng.normal(size=3)
    E = np.array([[1, -1, 0], [1, 0, -1]])
    angles = np.column_stack([E @ ends, -0.7 * E])
    loops = PlanarLoops(angles, np.zeros((2, 0)), np.zeros(0, int), -(E @ ends).astype(complex))
    assert not dixon_roots(loops.angles, loops.constant).complete


SLIDES = {
    "carried by two links": (2, [0, 1], 6),
    "on the ground": (3, [KNOWN] * 3, 8),
    "on the ground and on links": (3, [KNOWN, 0, 1], 20),
}
"""How many loops, what carries the prismatic joints, and how many complex roots there are."""


@pytest.mark.parametrize("kind", SLIDES)
def test_loops_with_slides(kind):
    count, carriers, degree = SLIDES[kind]
    rng = np.random.default_rng(1)
    for _ in range(len(SEEDS)):
        angles = complex_numbers(rng, count, 2 * count - len(carriers))
        loops = closed(rng, angles, complex_numbers(rng, count, len(carriers)), carriers)
        roots = planar_roots(loops)
        assert roots.complete
        assert roots.proof == f"homotopy, certified: {degree} of {degree} paths"
        assert missed(loops, roots, searched(loops, 300, 1)) == 0


@pytest.mark.parametrize("seed", range(3))
def test_paths_and_the_determinant_agree(seed):
    loops = closed_loops(np.random.default_rng(seed), 2)
    found, paths = planar_roots(loops), path_roots(loops)
    assert (len(paths.values), paths.complete) == (len(found.values), True)
    assert missed(loops, paths, found.values) == 0


def test_paths_that_meet_count_twice():
    """A platform on three legs in line with forces that meet in one point."""
    loops, theta = folded_triad(np.random.default_rng(4))
    found = path_roots(loops)
    assert found.complete
    assert found.method.endswith(" 4 of 6 paths, and 2 where roots meet")
    gap = np.abs(np.exp(1j * found.theta) - np.exp(1j * theta)).max(axis=1)
    assert gap.min() < 1e-5


@pytest.mark.parametrize(("count", "slides"), [(2, 0), (2, 1), (3, 0)])
def test_a_row_too_many(count, slides):
    """Loops that close only because their lengths fit, as those of equal parallel cranks."""
    rng = np.random.default_rng(1)
    angles = complex_numbers(rng, count, 2 * count - 1 - slides)
    loops = closed(rng, angles, complex_numbers(rng, count, slides), [KNOWN] * slides)
    roots = planar_roots(loops)
    n, _ = loops.counts
    assert (len(roots.values), roots.complete) == (1, True)
    assert np.abs(loops.rows(*np.split(roots.values, [n], axis=1))[0]).max() < 1e-14
    other = PlanarLoops(loops.angles, loops.slides, loops.carriers, loops.constant + 1e-3)
    assert len(planar_roots(other).values) == 0


def test_what_is_not_known_is_said():
    with pytest.raises(NoClosedForm, match="no 8 or fewer of the 3 unknowns"):
        planar_roots(PlanarLoops(np.ones((1, 3)), np.zeros((1, 0)), np.zeros(0, int), np.ones(1)))
    with pytest.raises(LoopError, match="a dyad of equal links"):
        planar_roots(PlanarLoops(np.ones((1, 2)), np.zeros((1, 0)), np.zeros(0, int), np.zeros(1)))
