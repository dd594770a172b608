"""Sweeps: many cases of one rule, of which `make test` runs a part and `make test-all` all."""

import os

EVERY_CASE = os.environ.get("MBS_TEST_ALL") == "1"


def examples(number: int) -> int:
    """How many examples hypothesis draws: all of them, or a tenth and three at least."""
    return number if EVERY_CASE else max(3, number // 10)
