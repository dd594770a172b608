"""How fast inverse geometric solvers are, and how long they take to build."""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from inverse_geometry_peers import PEERS, EaikOneByOne, Refused, SsikPrebuilt
from support import arms
from support.arm_search import plain_arm

import mbs
from mbs.assembly import System
from mbs.closed_forms.arm_core import core
from mbs.models.inverse_geometry import solve, solve_many, solver

_SHARE = 0.03
"""Seconds that a contender takes in a round."""
_MOST = 2000
"""Poses in one call."""


@dataclass
class Contender:
    """A way to solve some poses in one call."""

    who: str
    call: Callable[[], Any]
    poses: int
    times: list[float] = field(default_factory=list)
    cycles: int = 1

    def round(self) -> None:
        """Run it for about _SHARE seconds and note the processor time of a pose."""
        start = time.process_time()
        for _ in range(self.cycles):
            self.call()
        spent = max(time.process_time() - start, 1e-9)
        self.times.append(spent / self.cycles / self.poses)
        self.cycles = max(1, min(10_000, round(self.cycles * _SHARE / spent)))

    @property
    def microseconds(self) -> float:
        """The median, without the first round."""
        return 1e6 * statistics.median(self.times[1:])


def speed_table(robots: Sequence[str], rounds: int) -> str:
    """Microseconds of a pose, contenders in turns, and peers as ratios to `solve_many`."""
    names = ["solve_many", "solve", "solver", "EAIK batch", "EAIK", "ikdh", "ssik", "ssik prebuilt"]
    lines = []
    for robot in robots:
        contenders = _contenders(robot)
        for _ in range(rounds + 1):
            for contender in contenders.values():
                contender.round()
        base = contenders["solve_many"].microseconds
        cells = [robot, f"{base:.3g}"]
        for name in names[1:]:
            one = contenders.get(name)
            cells.append(f"{one.microseconds:.3g} ({one.microseconds / base:.3g})" if one else "-")
        lines.append(cells)
        print(" | ".join(cells), file=sys.stderr)
    return markdown(
        ["robot", "solve_many us", *(f"{name} us (ratio)" for name in names[1:])], lines
    )


def _contenders(robot: str) -> dict[str, Contender]:
    system = _system(robot)
    arm = plain_arm(system)
    T = arm.pose(arm.random(np.random.default_rng(0), _MOST))
    solved, single = solver(system), [pose.copy() for pose in T[:200]]
    found = {
        "solve_many": Contender("solve_many", lambda: solve_many(system, T), _MOST),
        "solve": Contender(
            "solve", lambda: [solve(system, pose).q for pose in single], len(single)
        ),
        "solver": Contender(
            "solver", lambda: [solved(pose).labels for pose in single], len(single)
        ),
    }
    makers: dict[str, Callable[[], Any]] = {
        "EAIK batch": lambda: PEERS["EAIK"](arm),
        "EAIK": lambda: EaikOneByOne(arm),
        "ikdh": lambda: PEERS["ikdh"](arm),
        "ssik": lambda: PEERS["ssik"](arm),
        "ssik prebuilt": lambda: SsikPrebuilt(robot),
    }
    for name, make in makers.items():
        try:
            peer = make()
        except (Refused, ImportError):
            continue
        count = _MOST if "EAIK" in name else 16
        found[name] = Contender(name, peer.many(T[:count]), count)
    return found


def build_table(robots: Sequence[str], program: str) -> str:
    """Seconds from an assembled robot to its first answer, each in a process of its own."""
    lines = []
    for robot in robots:
        command = [sys.executable, program, "--build-one", robot]
        with tempfile.TemporaryDirectory() as folder:  # so that compiling is measured
            environment = os.environ | {"MBS_CACHE_DIR": folder}
            cells = []
            for _ in range(2):
                done = subprocess.run(command, env=environment, capture_output=True, check=True)
                cells += done.stdout.decode().split()
        lines.append([robot, *cells])
        print(" | ".join(lines[-1]), file=sys.stderr)
    names = ("core of all robots", "solve", "solve_many")
    head = [f"{name}, {when} s" for when in ("nothing cached", "compiled before") for name in names]
    return markdown(["robot", *head], lines)


def built(robot: str) -> list[str]:
    """CPU seconds of the shared core, of the first `solve` and of the first `solve_many`.

    Compilers are included.
    """
    system = _system(robot)
    arm = plain_arm(system)
    T = arm.pose(arm.random(np.random.default_rng(0), 4))
    cells = []
    for call in (core, lambda: solve(system, T[0]), lambda: solve_many(system, T)):
        before = sum(os.times()[:4])
        call()
        cells.append(f"{sum(os.times()[:4]) - before:.2f}")
    return cells


def _system(robot: str) -> System:
    return arms.general_6r(0) if robot == "general_6r" else mbs.load(robot).assemble()


def markdown(head: Sequence[str], lines: Sequence[Sequence[str]]) -> str:
    """A table."""
    rows = [head, ["---"] * len(head), *lines]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in rows) + "\n"
