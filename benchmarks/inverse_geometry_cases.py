"""The arms of benchmarks/inverse_geometry.py, a class of arms a case."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np

import mbs
from mbs.assembly import System

sys.path.append(str(Path(__file__).parents[1] / "tests"))
from support import arms
from support.arm_poses import folded, stretched, with_wrist
from support.arm_search import PlainArm

Array = np.ndarray[Any, Any]
Build = Callable[[int], tuple[System, Mapping[str, float]]]
Pose = Callable[[System, PlainArm, np.random.Generator], tuple[Array, Array]]


def anywhere(_: System, arm: PlainArm, rng: np.random.Generator) -> tuple[Array, Array]:
    """The pose (4, 4) of a random configuration, and that configuration (1, n)."""
    q = arm.random(rng, 1)
    return arm.pose(q[0]), q


@dataclass(frozen=True)
class Case:
    """A class of arms: how many of them, how many poses of each, and number k of them.

    Attributes:
        pose: a pose (4, 4) to be reached, and some of its configurations (m, n).
        least: smallest singular value of the configurations that must be found; those of a
            self-motion are not counted.
        search: whether a search tells what must be found.
    """

    name: str
    arms: int
    poses: int
    build: Build
    pose: Pose = anywhere
    least: float = 0.0
    search: bool = True


def _robot(name: str) -> Case:
    return Case(name, 1, 40, lambda _: (_loaded(name), {}))


@cache
def _loaded(name: str) -> System:
    return mbs.load(name).assemble()


def _random(name: str, count: int, poses: int, make: Callable[[int], System]) -> Case:
    return Case(name, count, poses, lambda k: (make(k), {}))


def _sliding(count: int, seeds: int) -> Case:
    kinds = arms.placements(count)

    def build(k: int) -> tuple[System, Mapping[str, float]]:
        return arms.slides_and_turns(kinds[k % len(kinds)], k // len(kinds)), {}

    return Case(f"6 joints with {count} sliding", seeds * len(kinds), 10, build)


def _locked(k: int) -> tuple[System, Mapping[str, float]]:
    return _loaded("panda"), {f"q{k % 7 + 1}": (-1) ** k * 0.3 * (1 + k / 7)}


def _locked_at_random(k: int) -> tuple[System, Mapping[str, float]]:
    return arms.general_7r(k // 7), {f"q{k % 7 + 1}": 0.7}


WRISTS = ("puma560", "rx90", "tx90", "kr6", "irb120")


def _with_a_wrist(k: int) -> tuple[System, Mapping[str, float]]:
    return _loaded(WRISTS[k % len(WRISTS)]), {}


def _wrist_at(q5: float) -> Pose:
    return lambda _, arm, rng: _both_wrists(arm, with_wrist(arm.random(rng), q5))


def _elbow_straight(system: System, arm: PlainArm, rng: np.random.Generator) -> tuple[Array, Array]:
    return _both_wrists(arm, stretched(system, arm.random(rng)))


def _elbow_folded(system: System, arm: PlainArm, rng: np.random.Generator) -> tuple[Array, Array]:
    return _both_wrists(arm, folded(system, arm.random(rng), 2e-3))


def _both_wrists(arm: PlainArm, q: Array) -> tuple[Array, Array]:
    flipped = np.add(q, [0, 0, 0, np.pi, 0, np.pi]) * [1, 1, 1, 1, -1, 1]
    return arm.pose(q), np.array([q, flipped])


def _too_far(_: System, arm: PlainArm, rng: np.random.Generator) -> tuple[Array, Array]:
    T = arm.pose(arm.random(rng))
    T[:3, 3] *= (1.2 + rng.uniform()) * arm.reach / np.linalg.norm(T[:3, 3])
    return T, np.empty((0, len(arm.slides)))


ROBOTS = (
    "puma560",
    "rx90",
    "tx90",
    "kr6",
    "irb120",
    "ur5",
    "crx10",
    "manseur_doty",
    "stanford",
    "scara",
    "gantry",
    "youbot",
)
CASES = {
    case.name: case
    for case in (
        *map(_robot, ROBOTS),
        *(
            _random(f"spherical joint {k}{k + 1}{k + 2}", 10, 20, partial(arms.spherical, k))
            for k in (1, 2, 3, 4)
        ),
        *(
            _random(f"parallel axes {k}{k + 1}{k + 2}", 5, 20, partial(arms.three_parallel, k))
            for k in (1, 2, 3, 4)
        ),
        _random("general 6R", 100, 20, arms.general_6r),
        _sliding(1, 3),
        _sliding(2, 2),
        _sliding(3, 2),
        _random("general 5R", 10, 20, arms.general_5r),
        Case("panda with a lock", 14, 10, _locked),
        Case("general 7R with a lock", 14, 10, _locked_at_random),
        Case("q5 = 1e-5", 5, 4, _with_a_wrist, _wrist_at(1e-5)),
        Case("q5 = 0 (isolated configurations)", 5, 4, _with_a_wrist, _wrist_at(0.0), least=1e-6),
        Case("elbow straight", 5, 4, _with_a_wrist, _elbow_straight, search=False),
        Case(
            "folded 2 mm from axis 2",
            1,
            12,
            lambda _: (_loaded("puma560"), {}),
            _elbow_folded,
            search=False,
        ),
        Case("out of reach", 5, 4, _with_a_wrist, _too_far),
    )
}
