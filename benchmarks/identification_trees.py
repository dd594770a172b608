"""Base parameters by rules on random trees: whether they are exact and the fewest.

python benchmarks/identification_trees.py --count 2000

Trees have two to five links, 30 % of their joints slide, branches start anywhere, angles are 0,
90 and -90 degrees and 0.7 rad, and gravity is one of five. Efforts in base parameters are compared
with those in all parameters by Newton and Euler in numpy, the number of base parameters with the
rank of the regressor in random states.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
from pathlib import Path

sys.path.append(str(Path(__file__).parents[1] / "tests"))
from support.base_trees import grouped_tree

EXACT = 1e-9


def main() -> None:
    """Print how many trees are exact, minimal by the rules, and completed by the rank."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=2000)
    parser.add_argument("--first", type=int, default=0)
    options = parser.parse_args()
    begin, found, worst = time.process_time(), Counter[str](), 0.0
    for seed in range(options.first, options.first + options.count):
        base, error, heavy = grouped_tree(seed)
        worst = max(worst, error)
        where = "with gravity" if heavy else "without gravity"
        found[f"{where}, trees"] += 1
        found[f"{where}, error of {EXACT} or more"] += error >= EXACT
        found[f"{where}, minimal by rules"] += base.check.agrees
        completed = not base.check.agrees and base.count == base.check.rank
        found[f"{where}, completed by the rank"] += completed
        if not base.check.agrees:
            print(f"tree {seed}: {base.check.text}", flush=True)
        if seed % 100 == 99:
            print(f"{seed + 1 - options.first} trees", file=sys.stderr)
    for name in sorted(found):
        print(f"{name}: {found[name]}")
    print(f"largest error {worst:.1e}; {time.process_time() - begin:.0f} s")


if __name__ == "__main__":
    main()
