"""Inverse geometric models: what is found, how exactly and how fast, beside EAIK, ssik and ikdh.

    python benchmarks/inverse_geometry.py [--cases "puma560,general 6R"] [--share 1.0]
    python benchmarks/inverse_geometry.py --speed [--robots puma560,ur5] [--rounds 15]
    python benchmarks/inverse_geometry.py --build [--robots puma560]

Completeness: expected of a pose are the configurations that it was made from, those that a
    multi-start
search of its own finds (not next to two singularities), and whatever else a solver returns that
the forward model confirms. Peers count as having found what is anywhere in their answer; a wrong
row is one that is not marked as approximate and misses the pose by more than 1e-6; "twice" are
rows within 1e-5 of another one. Speed: processor seconds of a single thread per pose, contenders
in turns, the median of the rounds. Peers that are not installed are told apart as absent.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from inverse_geometry_cases import CASES, ROBOTS, Case
from inverse_geometry_peers import PEERS, Refused, versions
from inverse_geometry_speed import build_table, built, markdown, speed_table
from support.arm_search import PlainArm, distance, merged, plain_arm, searched

from mbs.assembly import System
from mbs.models.inverse_geometry import solve, solve_many

Array = np.ndarray[Any, Any]
CLOSE, WRONG, SAME = 1e-9, 1e-6, 1e-5
MANY = "mbs solve_many"
_THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")


@dataclass
class Score:
    """How one solver did on a class of arms."""

    poses: int = 0
    complete: int = 0
    expected: int = 0
    found: int = 0
    wrong: int = 0
    copies: int = 0
    worst: float = 0.0

    def add(self, arm: PlainArm, T: Array, expected: Array, q: Array, sure: Array) -> None:
        """Count one pose."""
        residual = arm.residual(T, q) if len(q) else np.empty(0)
        good = q[residual < WRONG]
        hit = sum(bool(np.any(distance(arm, good, x) < SAME)) for x in expected)
        self.poses += 1
        self.complete += hit == len(expected)
        self.expected += len(expected)
        self.found += hit
        self.wrong += int(np.sum(sure & (residual >= WRONG)))
        self.copies += sum(
            bool(np.any(distance(arm, good[:k], good[k]) < SAME)) for k in range(len(good))
        )
        self.worst = max([self.worst, *residual[residual < WRONG]])

    def __str__(self) -> str:
        told = f"{self.found}/{self.expected}, {self.worst:.0e}"
        told += f", {self.copies} twice" if self.copies else ""
        return told + (f", {self.wrong} wrong" if self.wrong else "")


@dataclass
class Row:
    """What was counted of a class of arms, by solver, and why others refuse them."""

    case: Case
    scores: dict[str, Score] = field(default_factory=dict)
    refused: dict[str, str] = field(default_factory=dict)
    seconds: float = 0.0
    missed: list[str] = field(default_factory=list)

    def cells(self) -> list[str]:
        """A row of the table."""
        own = self.scores["mbs"]
        others = [
            str(self.scores[who]) if who in self.scores else self.refused.get(who, "absent")
            for who in PEERS
        ]
        complete = f"{own.complete}/{own.poses}"
        return [self.case.name, complete, str(own), str(self.scores[MANY]), *others]


def main() -> None:
    """Measure and print."""
    arguments = _arguments()
    if any(os.environ.get(name) != "1" for name in _THREADS):
        once_more = os.environ | dict.fromkeys(_THREADS, "1")
        os.execve(sys.executable, [sys.executable, *sys.argv], once_more)
    print(f"peers: {versions()}", file=sys.stderr)
    if arguments.build_one:
        print(*built(arguments.build_one))
        return
    robots = arguments.robots.split(",")
    if arguments.speed:
        text = speed_table(robots, arguments.rounds)
    elif arguments.build:
        text = build_table(robots, __file__)
    else:
        names = arguments.cases.split(",")
        text = completeness_table([CASES[name] for name in names], arguments.share)
    if arguments.output:
        with open(arguments.output, "w", encoding="utf-8") as file:
            file.write(text)
    print(text)


def completeness_table(cases: Sequence[Case], share: float) -> str:
    """Found of expected, the largest residual and wrong rows, one row a class, as Markdown."""
    head = ["arms", "poses complete", "mbs", MANY, *PEERS]
    rows = []
    for case in cases:
        rows.append(counted(case, share))
        told = " | ".join(rows[-1].cells())
        print(f"{told} | {rows[-1].seconds:.0f} s {rows[-1].missed}", file=sys.stderr)
    return markdown(head, [row.cells() for row in rows])


def counted(case: Case, share: float) -> Row:
    """A class of arms: every solver at random poses of some of its arms."""
    row, start = Row(case), time.perf_counter()
    for k in range(max(1, round(share * case.arms))):
        system, locked = case.build(k)
        arm = plain_arm(system, locked)
        peers = _peers(arm, row)
        for m in range(max(1, round(share * case.poses))):
            T, known = case.pose(system, arm, np.random.default_rng((k, m)))
            answers = _own(system, T, locked)
            answers |= {who: peer.solve(T) for who, peer in peers.items()}
            expected = _expected(case, arm, T, [known, *(q for q, _ in answers.values())])
            for who, (q, sure) in answers.items():
                score = row.scores.setdefault(who, Score())
                before = score.found - score.expected
                score.add(arm, T, expected, q, sure)
                if who in ("mbs", MANY) and score.found - score.expected < before:
                    row.missed.append(f"{who}: arm {k} pose {m}")
    row.seconds = time.perf_counter() - start
    return row


def _own(system: System, T: Array, locked: Mapping[str, float]) -> dict[str, tuple[Array, Array]]:
    free = [k for k, row in enumerate(system.coordinates) if row.name not in locked]
    one = solve(system, T, locked=locked or None).q[:, free]
    many = solve_many(system, T[None], locked=locked or None).of(0)[:, free]
    return {who: (q, np.ones(len(q), dtype=bool)) for who, q in (("mbs", one), (MANY, many))}


def _expected(case: Case, arm: PlainArm, T: Array, answers: Sequence[Array]) -> Array:
    close = [q[arm.residual(T, q) < CLOSE] for q in answers if len(q)]
    start = searched(arm, T) if case.search else np.empty((0, len(arm.slides)))
    found = np.concatenate([start, *close])
    return merged(arm, T, found[arm.smallest(found) >= case.least])


def _peers(arm: PlainArm, row: Row) -> dict[str, Any]:
    found = {}
    for who, make in PEERS.items():
        try:
            found[who] = make(arm)
        except Refused as reason:
            row.refused[who] = f"refuses: {reason}"
        except ImportError:
            row.refused[who] = "absent"
    return found


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--cases", default=",".join(CASES))
    parser.add_argument("--robots", default=",".join((*ROBOTS, "general_6r")))
    parser.add_argument("--share", type=float, default=1.0, help="of the arms, and of the poses")
    parser.add_argument("--speed", action="store_true", help="time solving")
    parser.add_argument("--build", action="store_true", help="time the first answer")
    parser.add_argument("--build-one", help=argparse.SUPPRESS)
    parser.add_argument("--rounds", type=int, default=15, help="turns of the contenders")
    parser.add_argument("--output", help="Markdown file to write")
    return parser.parse_args()


if __name__ == "__main__":
    main()
