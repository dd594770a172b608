"""Gather parameters: what depends on them alone is done once."""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial

from mbs.operations.graph import Graph
from mbs.operations.polynomials import Algebra, Polynomial, rewritten


def parameters(graph: Graph, parameters: Iterable[str] = ()) -> Graph:
    """Products and sums associated so that parameter-only factors and terms meet.

    c1 (x c2) is (c1 c2) x, c1 x + c2 x is (c1 + c2) x, and c1 (c2 x + c3 y) is
    (c1 c2) x + (c1 c3) y. What is used elsewhere is never computed a second time.
    """
    return rewritten(graph, parameters, _gathered)


def _gathered(algebra: Algebra, polynomial: Polynomial) -> int:
    opened = _opened(algebra, polynomial)
    ways = [polynomial] if opened == polynomial else [polynomial, opened]
    return algebra.cheapest([partial(algebra.plain, way) for way in ways])


def _opened(algebra: Algebra, polynomial: Polynomial) -> Polynomial:
    """A polynomial, sums among its terms opened that have a term in common with it."""
    total = dict(polynomial)
    for monomial, coefficient in polynomial.items():
        inside = algebra.written.get(monomial[0], {}) if len(monomial) == 1 else {}
        if any(inner in total for inner in inside):
            algebra.accumulate(total, [(monomial, algebra.builder.negative(coefficient))])
            algebra.accumulate(total, algebra.scaled(inside, coefficient).items())
    return total
