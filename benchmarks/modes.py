"""Every mode of loops that are solved together: what a search finds and `modes` does not.

Random platforms of each class, closed somewhere, against Levenberg and Marquardt's steps from many
random starts. Prints a row for each class: how many platforms, how many roots the search found
that were missed, how many platforms lost the configuration that they were made from, how many were
not proved complete, and the median time.

    PYTHONPATH=tests:. python benchmarks/modes.py [number of platforms of a class] [classes ..]
"""

import sys
import time
from itertools import combinations_with_replacement

import numpy as np
from support import leg_platforms, plane_equations
from support.configurations import active, same, searched
from support.ring_loops import ring_loop

from mbs.closed_forms.hexapod import poses
from mbs.closed_forms.planar_loops import planar_roots
from mbs.loops import modes


def plane(kinds, starts):
    def run(seed):
        rng = np.random.default_rng(seed)
        if isinstance(kinds, int):
            loops = plane_equations.closed_loops(rng, kinds)
        else:
            loops = plane_equations.triad(rng, kinds)
        begin = time.perf_counter()
        roots = planar_roots(loops)
        spent = time.perf_counter() - begin
        found = plane_equations.searched(loops, starts, seed)
        missed = plane_equations.missed(loops, roots, found)
        return missed, len(roots.theta) == 0, roots.singular, spent, len(found)

    return run


def loop(kinds, starts):
    def run(seed):
        system = ring_loop(seed, kinds).assemble()
        q_a = active(system)
        modes(system, q_a)
        begin = time.perf_counter()
        found = modes(system, q_a)
        spent = time.perf_counter() - begin
        others = searched(system, q_a, starts=starts, seed=seed)
        missed = sum(not any(same(system, q, mode.q) for mode in found) for q in others)
        lost = not any(same(system, mode.q, system.configuration) for mode in found)
        return missed, lost, not found.complete, spent, len(others)

    return run


def legs(kind, starts):
    def run(seed):
        rng = np.random.default_rng(seed)
        a, b = leg_platforms.ends(kind, rng)
        e, p = leg_platforms.random_pose(rng)
        length = leg_platforms.lengths_at(a, b, e, p)
        poses(a, b, length)
        begin = time.perf_counter()
        found = poses(a, b, length)
        spent = time.perf_counter() - begin
        others = leg_platforms.searched(a, b, length, starts, seed)
        own = zip(found.e, found.p, strict=True)
        lost = all(leg_platforms.distance(e, p, *pose) > 1e-4 for pose in own)
        return leg_platforms.missed(found, others), lost, not found.complete, spent, len(others)

    return run


CASES = {
    **{
        f"triad {' '.join(kinds)}": plane(kinds, 200)
        for kinds in combinations_with_replacement(["RR", "PR", "RP"], 3)
    },
    "three plane loops": plane(3, 1000),
    **{f"loop {kinds}": loop(kinds, 100) for kinds in ("RRRRRRR", "RRPRRPR")},
    **{f"six legs {kind}": legs(kind, 60) for kind in leg_platforms.DEGREES},
}


def main():
    number = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    print("class, platforms, found by search, missed, lost, not proved, ms")
    for name, run in CASES.items():
        if all(part in name for part in sys.argv[2:]):
            rows = [run(seed) for seed in range(number)]
            missed, lost, unproved, spent, others = zip(*rows, strict=True)
            told = [len(rows), sum(others), sum(missed), sum(lost), sum(unproved)]
            print(name, *told, f"{1e3 * np.median(spent):.1f}", sep=", ", flush=True)


if __name__ == "__main__":
    main()
