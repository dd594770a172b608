"""Tests that `make test` leaves out and `make test-all` runs: cases of sweeps, and slow tests."""

import math
import os
import random
from collections import defaultdict

import pytest

EVERY_CASE = os.environ.get("MBS_TEST_ALL") == "1"


def slow(*values):
    """A case of a test that only `make test-all` runs; its cheaper cases run always."""
    return pytest.param(*values, marks=pytest.mark.slow)


def examples(number: int) -> int:
    """How many examples hypothesis draws: all of them, or a tenth and three at least."""
    return number if EVERY_CASE else max(3, number // 10)


def left_out(items, seed):
    """The collected tests that do not run.

    Of each sweep a tenth runs, three at least; of a rule tried with several seeds one; of what is
    marked as slow nothing.

    Args:
        items: all of them, in their order.
        seed: which part runs.
    """
    sweeps, seeds = defaultdict(list), defaultdict(list)
    left = {item for item in items if item.get_closest_marker("slow")}
    for item in (item for item in items if item not in left):
        name = item.nodeid.partition("[")[0]
        given = item.callspec.params if hasattr(item, "callspec") else {}
        if item.get_closest_marker("sweep"):
            sweeps[name].append(item)
        elif "seed" in given:
            # the cases of one rule hold the same objects but for the seed
            others = (id(value) for key, value in sorted(given.items()) if key != "seed")
            seeds[name, *others].append(item)
    for groups, least, part in ((sweeps, 3, 10), (seeds, 1, math.inf)):
        for cases in groups.values():
            kept = max(least, math.ceil(len(cases) / part))
            chosen = random.Random(f"{seed} {cases[0].nodeid}")
            left.update(chosen.sample(cases, max(0, len(cases) - kept)))
    return left
