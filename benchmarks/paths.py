"""Times of redundant joints and of paths: positions of a seventh joint, and poses followed.

PYTHONPATH=tests python benchmarks/paths.py
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from inverse_geometry_speed import markdown

import mbs
from mbs.closed_forms.arm import Array
from mbs.models.inverse_geometry import follow, solve_many

_ROUNDS = 15
PANDA = np.array([0.1, -0.4, 0.2, -1.9, 0.3, 1.6, 0.5])
STARTS = {
    "puma560": np.array([0.3, -0.8, -0.4, 0.2, 0.6, 0.1]),
    "ur5": np.array([0.3, -1.2, 1.8, -0.5, 1.0, 0.1]),
    "panda": PANDA,
}


def milliseconds(call: Callable[[], Any]) -> float:
    """The median of some calls, after one that derives and compiles."""
    for _ in range(3):
        call()
    times = []
    for _ in range(_ROUNDS):
        start = time.process_time()
        call()
        times.append(time.process_time() - start)
    return 1e3 * statistics.median(times)


def samples_table() -> str:
    """Positions of joint 7 of a Panda, all configurations of each, for one pose."""
    system = mbs.load("panda").assemble()
    T = np.array(mbs.models.direct_geometry(system)(PANDA))[None]
    solve_many(system, T, redundant={"q7": 1000})  # from here on in machine code
    lines = []
    for count in (16, 64, 256, 1024):
        taken = milliseconds(lambda count=count: solve_many(system, T, redundant={"q7": count}))
        found = int(solve_many(system, T, redundant={"q7": count}).count[0])
        lines.append([str(count), str(found), f"{taken:.3g}"])
    return markdown(["positions of q7", "configurations", "milliseconds"], lines)


def circle(first: Array, count: int) -> Array:
    """Poses on a bent circle of 80 mm through the first one."""
    angle = np.linspace(0, 2 * np.pi, count)
    T = np.repeat(first[None], count, axis=0)
    T[:, :3, 3] += 0.08 * np.stack(
        [np.cos(angle) - 1, np.sin(angle), 0.5 * np.sin(2 * angle)], axis=1
    )
    return T


def paths_table() -> str:
    """Circles of several robots."""
    lines = []
    for robot, count in (("puma560", 10_000), ("ur5", 10_000), ("panda", 200)):
        system, start = mbs.load(robot).assemble(), STARTS[robot]
        T = circle(np.array(mbs.models.direct_geometry(system)(start)), count)
        found = follow(system, T, start, limits=False)
        assert found.reason == ""
        taken = milliseconds(lambda s=system, T=T, q=start: follow(s, T, q, limits=False))
        known = dict(zip(np.linspace(0.0, 1.0, count).tolist(), T, strict=True))
        given = milliseconds(
            lambda s=system, f=known.__getitem__, q=start, n=count: follow(
                s, f, q, limits=False, samples=n
            )
        )
        residual = f"{found.residual.max():.1e}"
        lines.append([robot, str(count), f"{taken:.3g}", f"{given:.3g}", residual])
    heads = ["robot", "poses", "milliseconds", "as a function", "largest residual"]
    return markdown(heads, lines)


if __name__ == "__main__":
    print(samples_table())
    print(paths_table())
