"""The number of scalar operations of a Function, and equal Functions with fewer of them."""

from mbs.operations.counts import Count, count
from mbs.operations.pipeline import (
    PASSES,
    Pass,
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
    "Simplification",
    "Split",
    "Step",
    "count",
    "simplification",
    "simplify",
    "split",
]
