"""The number of scalar operations of a Function, and equal Functions with fewer of them."""

from mbs.operations.counts import Count, count
from mbs.operations.pipeline import (
    PASSES,
    Pass,
    PassReport,
    Simplification,
    Split,
    Step,
    simplification,
    simplify,
    split,
)

__all__ = [
    "PASSES",
    "Count",
    "Pass",
    "PassReport",
    "Simplification",
    "Split",
    "Step",
    "count",
    "simplification",
    "simplify",
    "split",
]
