"""Lists next to singular poses do not depend on the last bits, or are marked as undecided.

A pose is moved by 1, 10 and 100 units in the last place; then the residuals, the singular values
and the eigenvalues of the general method are. The lists are the same, or both are marked.
"""

import numpy as np
import pytest
from support.arm_search import distance
from support.arms import general_6r
from support.near_singular import (
    KINDS,
    ROBOTS,
    at_distance,
    near_singular,
    plain,
    robot,
    units_away,
)
from support.runtime import changed_library
from support.sweeps import slow

import mbs.closed_forms.arm_core as core
from mbs.models.inverse_geometry import solve, solve_many, solver
from mbs.models.inverse_geometry.target import ONE, TWO, Target

CASES = [(name, kind) for name in ROBOTS[:-1] for kind in KINDS] + [(ROBOTS[-1], "wrist")]
FEW, MORE = (-12, -9, -7, -4), range(-12, -2)
NOISE = 4e-14
"""Largest change of a pose by a hundred units in the last place, and rounding of its rotation."""
MIDDLE = 1e-5
"""Distance [rad or m] within which a root in which several meet stays."""


def signature(answer):
    """Branch, number of roots and moving joints of each solution, in any order."""
    families = [(s.family.moving, s.family.dimension) if s.family else () for s in answer]
    return sorted((s.branch, s.multiplicity, f) for s, f in zip(answer, families, strict=True))


def require_same(name, answer, other):
    if answer.undecided and other.undecided:
        return
    assert signature(answer) == signature(other)
    assert answer.undecided == other.undecided or len(answer) == len(other)
    for s in answer:
        if s.undecided or s.family is not None:
            continue
        bound = 1e-12 + 20 * NOISE / s.sigma_min if s.multiplicity == 1 else MIDDLE
        assert np.min(distance(plain(name), other.q, s.q)) < bound


def check(name, kind, seed, exponents, units):
    for exponent in exponents:
        T = plain(name).pose(at_distance(name, kind, seed, 10.0**exponent))
        rng = np.random.default_rng(seed)
        answer = solve(robot(name), T)
        for count in units:
            require_same(name, answer, solve(robot(name), units_away(T, count, rng)))


@pytest.mark.parametrize(("name", "kind"), CASES)
def test_poses_that_differ_in_the_last_places(name, kind):
    check(name, kind, 0, FEW, (1, 100))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize(("name", "kind"), CASES)
def test_more_poses_that_differ_in_the_last_places(name, kind, seed):
    check(name, kind, seed, MORE, (1, 10, 100))


@pytest.mark.parametrize("name", ROBOTS[:-1])
def test_few_lists_next_to_one_singular_configuration_are_undecided(name):
    """A double root is one from a distance of 1e-8 on, and two roots from 1e-4 on."""
    for kind in ("elbow", "wrist"):
        for exponent in (-10, -5):
            for seed in (0, 1):
                q = at_distance(name, kind, seed, 10.0**exponent)
                assert not solve(robot(name), plain(name).pose(q)).undecided


def test_between_one_root_and_two_the_list_is_undecided():
    """The residual half way between the elbows of a UR5 grows with the square of their distance."""
    system, arm = robot("ur5"), plain("ur5")
    marked = []
    for away in np.geomspace(1e-9, 1e-4, 26):
        q = np.array([0.3, -0.9, away, 0.7, 0.8, 0.2])
        answer = solve(system, arm.pose(q))
        near = [s for s in answer if distance(arm, s.q, q) < 1e-3]
        marked.append(any(s.undecided for s in near))
        assert sum(s.multiplicity for s in near) == 2 or marked[-1]
        assert answer.undecided == any(s.undecided for s in answer)
    first, last = np.flatnonzero(marked)[[0, -1]]
    # the residuals ONE and TWO are a decade apart, and distances the root of it
    assert last - first == pytest.approx(2.5, abs=1.6)
    assert TWO == 10 * ONE


def test_three_calls_list_the_same():
    for name, kind, exponent in (("rx90", "shoulder", -10), ("puma560", "elbow", -9)):
        T = plain(name).pose(at_distance(name, kind, 2, 10.0**exponent))
        answer = solve(robot(name), T)
        assert len(answer) == len(solver(robot(name))(T).q)
        assert len(answer) == len(solve_many(robot(name), T[None]).of(0))


def test_solutions_are_complete_where_a_closed_form_leaves_the_shoulder_undetermined():
    """The first joint of the closed form is a half turn off, and Newton's method goes astray."""
    q = at_distance("rx90", "shoulder", 2, 1e-10)
    T, rng = plain("rx90").pose(q), np.random.default_rng(2)
    for count in (0, 1, 10, 100):
        assert len(solve(robot("rx90"), units_away(T, count, rng))) == 8


@pytest.mark.parametrize("count", [1, 100])
@pytest.mark.parametrize(("name", "kind"), [CASES[0], CASES[1], CASES[13], CASES[15]])
def test_residuals_and_singular_values_that_differ_in_the_last_places(
    name, kind, count, monkeypatch
):
    rng, eps = np.random.default_rng(3), np.finfo(float).eps
    poses = [plain(name).pose(at_distance(name, kind, 1, 10.0**e)) for e in FEW]
    answers = [solve(robot(name), T) for T in poses]
    residual, singular_values = Target.residual, Target.singular_values

    def moved(values):
        return values * (1 + count * eps * rng.uniform(-1, 1, np.shape(values)))

    monkeypatch.setattr(
        Target,
        "residual",
        lambda self, q: np.abs(
            moved(residual(self, q)) + count * eps * rng.uniform(-1, 1, np.shape(q)[:-1])
        ),
    )
    monkeypatch.setattr(Target, "singular_values", lambda self, q: moved(singular_values(self, q)))
    for T, answer in zip(poses, answers, strict=True):
        require_same(name, answer, solve(robot(name), T))


@pytest.mark.parametrize("count", [slow(1), 100])
def test_eigenvalues_that_differ_in_the_last_places(count, monkeypatch, tmp_path):
    """The library is compiled with eigenvalues that are off by units in the last place."""
    name, eps = "general_6r", np.finfo(float).eps
    poses = [plain(name).pose(at_distance(name, "wrist", 1, 10.0**e)) for e in FEW]
    answers = [solve(robot(name), T) for T in poses]
    off = " * (1.0 + {count} * {eps} * sin(1e8 * real[i] + {shift} * i))"
    changed = changed_library(
        tmp_path,
        r"double x = real\[i\], y = imaginary\[i\];",
        "double x = real[i]"
        + off.format(count=count, eps=eps, shift=12345.0)
        + ", y = imaginary[i]"
        + off.format(count=count, eps=eps, shift=54321.0)
        + ";",
    )
    library = core.library_at(changed.__file__)
    monkeypatch.setattr(core, "core", lambda: library)
    system = general_6r(0)
    for T, answer in zip(poses, answers, strict=True):
        require_same(name, answer, solve(system, T))


def test_the_text_names_undecided_solutions():
    q = np.array([0.3, -0.9, 8e-7, 0.7, 0.8, 0.2])
    answer = solve(robot("ur5"), plain("ur5").pose(q))
    assert answer.undecided
    assert "undecided" in str(answer)
    decided = solve(robot("puma560"), plain("puma560").pose(near_singular("puma560", "wrist", 0)))
    assert decided.undecided or "undecided" not in str(decided)
