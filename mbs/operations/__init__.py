"""The number of scalar operations of a Function, and equal Functions with fewer of them."""

from mbs.operations.catalogue import PASSES, Pass
from mbs.operations.counts import Count, count
from mbs.operations.pipeline import Simplification, Step, simplification, simplify
from mbs.operations.splitting import Split, split

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
