"""Platforms on six legs: certified paths, against search, published and degenerate platforms."""

from importlib import resources

import numpy as np
import pytest
from support.leg_platforms import (
    DEGREES,
    distance,
    ends,
    hexagon,
    lengths_at,
    matrix,
    missed,
    random_pose,
    searched,
)
from support.messages import refused

from mbs.closed_forms.hexapod import (
    DEGREE,
    Homotopy,
    PlatformLegs,
    certify,
    follow,
    monodromy,
    platform_start,
    poses,
    stored_start,
    text_of,
)
from mbs.errors import LoopError


@pytest.mark.parametrize("kind", DEGREES)
@pytest.mark.parametrize("seed", range(20))
def test_every_pose_is_found_and_certified(kind, seed):
    rng = np.random.default_rng(seed)
    a, b = ends(kind, rng)
    e, p = random_pose(rng)
    length = lengths_at(a, b, e, p)
    found = poses(a, b, length)
    assert found.complete
    assert found.proof == f"homotopy, certified: {DEGREES[kind]} of {DEGREES[kind]} paths"
    assert min(distance(e, p, x[3:], x[:3]) for x in found.values) < 1e-9
    for x in found.values:
        np.testing.assert_allclose(lengths_at(a, b, x[3:], x[:3]), length, rtol=1e-12)
    assert missed(found, searched(a, b, length, 60, seed)) == 0


def test_forty_real_poses():
    """The data of Dietmaier 1998."""
    a = [
        (0, 0, 0),
        (1.107915, 0, 0),
        (0.549094, 0.756063, 0),
        (0.735077, -0.223935, 0.525991),
        (0.514188, -0.526063, -0.368418),
        (0.590473, 0.094733, -0.205018),
    ]
    b = [
        (0, 0, 0),
        (0.542805, 0, 0),
        (0.956919, -0.528915, 0),
        (0.665885, -0.353482, 1.402538),
        (0.478359, 1.158742, 0.107672),
        (-0.137087, -0.235121, 0.353913),
    ]
    length = [1, 0.645275, 1.086284, 1.503439, 1.281933, 0.771071]
    found = poses(np.array(a), np.array(b), np.array(length))
    assert (len(found.values), found.complete) == (40, True)


@pytest.mark.parametrize("scale", [1e-3, 1e3])
def test_the_unit_of_length_does_not_matter(scale):
    rng = np.random.default_rng(4)
    a, b = ends("6-6", rng)
    length = lengths_at(a, b, *random_pose(rng))
    small, large = poses(a, b, length), poses(scale * a, scale * b, scale * length)
    assert len(small.values) == len(large.values) >= 2
    for x in small.values:
        assert min(distance(x[3:], x[:3], y[3:], y[:3] / scale) for y in large.values) < 1e-6


@pytest.mark.parametrize("seed", range(10))
def test_a_fold_is_kept_and_counted(seed):
    """Lengths at which two poses meet: the legs' lines depend on each other there."""
    rng = np.random.default_rng(seed)
    a, b = ends("6-6", rng)
    e, p = random_pose(rng)
    heads = p + b @ matrix(e).T
    way = heads - a
    lines = np.concatenate([way, np.cross(heads, way)], axis=1)[:5]
    mix = rng.normal(size=5)
    for _ in range(50):  # a combination of five legs' lines that is a line itself
        slopes = np.array([_pitch(lines, mix + d) - _pitch(lines, mix) for d in 1e-6 * np.eye(5)])
        slopes /= 1e-6
        mix = mix - slopes * _pitch(lines, mix) / (slopes @ slopes)
    force, moment = np.split(mix @ lines, 2)
    foot = np.cross(force, moment) / (force @ force)
    a[5], b[5] = foot + 0.3 * force, matrix(e).T @ (foot - 0.8 * force - p)
    length = lengths_at(a, b, e, p)
    found = poses(a, b, length)
    assert found.proof == "homotopy, certified: 38 of 40 paths, and 2 where poses meet"
    assert found.complete
    assert min(distance(e, p, x[3:], x[:3]) for x in found.values) < 1e-5


def _pitch(lines, mix):
    total = mix @ lines
    return total[:3] @ total[3:]


def test_similar_hexagons_hold_nothing():
    a = hexagon(1.0, 0.3)
    refused(
        LoopError,
        "the ends of its six legs lie so that they hold the platform at no pose",
        by=lambda: poses(a, 0.6 * a, np.full(6, 0.9)),
    )


def test_a_platform_that_moves_is_not_said_to_be_complete():
    """Congruent ends and equal legs: it may be carried along a sphere. Nearly equal: not so."""
    a = np.random.default_rng(0).normal(size=(6, 3))
    found = poses(a, a, np.full(6, 1.3))
    assert not found.complete
    assert found.proof.startswith("homotopy, certified: 0 of 24 paths")
    assert len(found.values) > 0
    assert poses(a, a, np.array([1.3] * 5 + [1.3001])).complete


def test_what_is_kept_are_forty_roots():
    for number in (0, 1):
        start = stored_start(number)
        ends = certify(start.legs, start.x.copy(), np.ones(len(start.x)))
        assert len(start.x) == DEGREE == np.sum(ends.regular)
        file = resources.files("mbs.closed_forms") / "hexapod_starts" / f"{number}.json"
        assert file.read_text(encoding="utf-8") == text_of(start) + "\n"


def test_what_is_kept_can_be_made_anew():
    """Monodromy from one root finds forty, and following them leads to those that are kept."""
    made, kept = monodromy(7), stored_start(0)
    assert len(made.x) == DEGREE
    x, t = follow(Homotopy.between(made.legs, kept.legs), made.x)
    assert np.all(t == 1)
    overlap = np.abs(x @ kept.x.conj().T)
    np.testing.assert_allclose(np.sort(overlap.max(axis=0)), 1.0, atol=1e-9)
    assert len(set(overlap.argmax(axis=0))) == DEGREE


def test_a_wrong_root_is_not_certified():
    start = stored_start(0)
    x = start.x.copy()
    x[3] = x[5]
    x[7] += 0.5
    ends = certify(start.legs, x, np.ones(len(x)))
    assert np.sum(ends.regular) <= DEGREE - 1
    assert not (ends.regular[3] and ends.regular[5])


def test_own_starts_are_kept():
    a, b = ends("semi-regular", np.random.default_rng(0))
    a, b = a - a.mean(axis=0), b - b.mean(axis=0)
    platform_start.cache_clear()
    first = platform_start(a.tobytes(), b.tobytes())
    assert platform_start(a.tobytes(), b.tobytes()) is first
    assert isinstance(first.legs, PlatformLegs)
    assert len(first.x) == 28
