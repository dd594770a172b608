"""Every mode of loops that are solved together: what a search finds and `modes` does not.

Random mechanisms of each class, closed somewhere; of loops and of platforms on six legs ten poses
of each geometry. Where the roots are certified and as many as there
can be, that is the proof, and a search is asked only of some; elsewhere Levenberg and Marquardt's
steps, or Gauss-Newton's, from many random starts are held against what was found. Prints a row for
each class: how many mechanisms, of how many all roots are certified, how many were searched, how
many roots the search found, how many of these were missed, how many mechanisms lost the
configuration that they were made from, how many are not complete, the median time; and the seeds
of the last three kinds.

    PYTHONPATH=tests:. python benchmarks/modes.py [--number N] [--first SEED] [--every N] [words ..]
"""

import argparse
import functools
import time
from itertools import combinations_with_replacement
from typing import NamedTuple

import numpy as np
from support import leg_platforms, plane_equations
from support.configurations import active, same, searched
from support.platforms import planar_platform
from support.random_trees import random_rotation
from support.ring_loops import line_symmetric_loop

from mbs.closed_forms import arm_search
from mbs.closed_forms.arm import Arm
from mbs.closed_forms.arm_certificate import certified_arm, certified_configurations
from mbs.closed_forms.arm_search import general_of
from mbs.closed_forms.hexapod import poses
from mbs.closed_forms.planar_loops import KNOWN, planar_roots
from mbs.loops import assembly_modes


class Row(NamedTuple):
    """What was seen of one mechanism."""

    certified: bool
    complete: bool
    lost: bool
    searched: int
    found: int
    missed: int
    spent: float


def three_loops(carriers=()):
    """Three plane loops, with prismatic joints that these links carry."""

    def build(rng):
        angles = plane_equations.complex_numbers(rng, 3, 6 - len(carriers))
        slides = plane_equations.complex_numbers(rng, 3, len(carriers))
        return plane_equations.closed(rng, angles, slides, list(carriers))

    return build


def plane(build, starts):
    """Plane loops in numbers."""

    def run(seed, search):
        loops = build(np.random.default_rng(seed))
        roots, spent = timed(planar_roots, loops)
        found = plane_equations.searched(loops, starts if search else 0, seed)
        missed = plane_equations.missed(loops, roots, found)
        lost = len(roots.theta) == 0
        certified = roots.complete and all("certified" in method for method in roots.methods)
        return Row(certified, roots.complete, lost, search, len(found), missed, spent)

    return run


def system_modes(build, starts):
    """A mechanism, by all that `modes` does."""

    def run(seed, search):
        system = build(seed).assemble()
        q_a = active(system)
        assembly_modes(system, q_a)
        found, spent = timed(assembly_modes, system, q_a)
        others = searched(system, q_a, starts=starts if search else 0, seed=seed)
        missed = sum(not any(same(system, q, mode.q) for mode in found) for q in others)
        lost = not any(same(system, mode.q, system.configuration) for mode in found)
        certified = found.complete and "certified" in found.proof
        return Row(certified, found.complete, lost, search, len(others), missed, spent)

    return run


def movable_loop(seed):
    """A line-symmetric loop that is not assembled where it is rigid."""
    tried = (line_symmetric_loop(seed + 10000 * k) for k in range(100))
    return next(m for m in tried if m.assemble().closure.mobility)


POSES = 10
"""Of each geometry of a loop or of a platform, for seeds that follow each other."""


def loop(kinds, starts):
    """A loop of a motor and six joints in numbers: an arm that reaches a pose."""

    @functools.lru_cache(maxsize=1)
    def made(seed):
        rng = np.random.default_rng(seed)
        gaps = np.tile(np.eye(4), (7, 1, 1))
        for gap in gaps:
            gap[:3, :3], gap[:3, 3] = random_rotation(rng), rng.uniform(-1, 1, 3)
        arm = Arm(tuple("abcdef"), np.array([kind == "P" for kind in kinds]), gaps)
        return certified_arm(general_of(arm))

    def run(seed, search):
        known = made(seed // POSES)
        arm = known.general.arm
        q = np.random.default_rng(seed).uniform(-3, 3, 6)
        T = arm.pose(q)
        found, spent = timed(certified_configurations, known, T)
        others = arm_search.search(arm, T, starts, seed) if search else []
        missed = sum(not reached(arm, found.q, other) for other in others)
        lost = not reached(arm, found.q, q)
        complete = found.complete
        return Row(complete, complete, lost, search, len(others), missed, spent)

    return run


def reached(arm, found, q):
    """Whether a configuration is among those found."""
    return any(np.max(np.abs(arm.wrapped(q - own))) < 1e-4 for own in found)


def legs(kind, starts):
    """Six legs in numbers."""

    def run(seed, search):
        a, b = leg_platforms.ends(kind, np.random.default_rng(seed // POSES))
        e, p = leg_platforms.random_pose(np.random.default_rng(seed))
        length = leg_platforms.lengths_at(a, b, e, p)
        found, spent = timed(poses, a, b, length)
        others = leg_platforms.searched(a, b, length, starts, seed) if search else []
        own = zip(found.e, found.p, strict=True)
        lost = all(leg_platforms.distance(e, p, *pose) > 1e-4 for pose in own)
        missed = leg_platforms.missed(found, others)
        complete = found.complete
        return Row(complete, complete, lost, search, len(others), missed, spent)

    return run


def timed(function, *arguments):
    """What a function gives, and how long it takes [s]."""
    begin = time.perf_counter()
    result = function(*arguments)
    return result, time.perf_counter() - begin


PLATFORMS = {
    "3-RRR": (("RRR",) * 3, (0, 0, 0)),
    "3-RPR": (("RPR",) * 3, (1, 1, 1)),
    "Stephenson III": (("RRR", "RR", "RR"), (0, None, None)),
}

CASES = {
    **{
        f"triad {' '.join(kinds)}": plane(
            functools.partial(plane_equations.triad, kinds=kinds), 200
        )
        for kinds in combinations_with_replacement(["RR", "PR", "RP"], 3)
    },
    **{
        name: system_modes(lambda seed, how=how: planar_platform(seed, *how), 60)
        for name, how in PLATFORMS.items()
    },
    "three plane loops": plane(three_loops(), 1000),
    "three plane loops, a prismatic joint on the ground": plane(three_loops([KNOWN]), 600),
    "three plane loops, three on the ground": plane(three_loops([KNOWN] * 3), 600),
    "three plane loops, two on links": plane(three_loops([0, 1]), 600),
    "three plane loops, one on the ground, two on links": plane(three_loops([KNOWN, 0, 1]), 600),
    **{f"loop R{kinds}": loop(kinds, 500) for kinds in ("RRRRRR", "RPRRPR", "RRPRRR", "PRRRRP")},
    "line-symmetric loop RRRRRR": system_modes(movable_loop, 40),
    **{f"six legs {kind}": legs(kind, 60) for kind in leg_platforms.DEGREES},
}


def main():
    """Runs the classes whose names contain all the given words."""
    parser = argparse.ArgumentParser()
    parser.add_argument("words", nargs="*")
    parser.add_argument("--number", type=int, default=100, help="mechanisms of a class")
    parser.add_argument("--first", type=int, default=0, help="seed of the first one")
    parser.add_argument("--every", type=int, default=1, help="search one of so many")
    given = parser.parse_args()
    print("class, first, mechanisms, certified, searched, found, missed, lost, not complete, ms")
    seeds = range(given.first, given.first + given.number)
    for name, run in CASES.items():
        if all(word in name for word in given.words):
            rows = {seed: run(seed, seed % given.every == 0) for seed in seeds}
            print(name, given.first, *told(rows.values()), sep=", ", end="")
            odd = [k for k, row in rows.items() if row.missed or row.lost or not row.complete]
            print(f", seeds {odd}" if odd else "", flush=True)


def told(rows):
    """The row of a class."""
    rows = list(rows)
    sums = [
        sum(row.certified for row in rows),
        sum(row.searched for row in rows),
        sum(row.found for row in rows),
        sum(row.missed for row in rows),
        sum(row.lost for row in rows),
        sum(not row.complete for row in rows),
    ]
    return len(rows), *sums, f"{1e3 * np.median([row.spent for row in rows]):.1f}"


if __name__ == "__main__":
    main()
