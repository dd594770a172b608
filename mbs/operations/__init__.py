"""The number of scalar operations of a Function, and equal Functions with fewer of them."""

from mbs.operations.counts import Count, count

__all__ = ["Count", "count"]
