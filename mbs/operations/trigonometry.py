"""Polynomials in sines and cosines: which angles are in them, and how they meet."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from functools import partial
from itertools import islice, product

import casadi

from mbs.operations.counts import count_graph
from mbs.operations.graph import Graph
from mbs.operations.polynomials import Algebra, Monomial, Polynomial, rewritten, without

Pair = tuple[str, str]
"""The names of two angles; one name twice for an angle and itself."""

Reshape = Callable[[Algebra, Polynomial], Polynomial]

_DEEPEST_NAME = 6
_DEEPEST_PRODUCT = 6
_LONGEST_MONOMIAL = 12
_ALLOWANCES = (1000, 4, 0)
_MOST_PAIRS = 24
_MOST_WORK = 40_000


def angle(algebra: Algebra, number: int) -> str:
    """A name of the angle of a sine or cosine, the same in equal graphs; else empty."""
    node = algebra.builder.nodes[number]
    if node.op not in (casadi.OP_SIN, casadi.OP_COS):
        return ""
    return _name(algebra, node.args[0])


def angles_in(algebra: Algebra, monomial: Monomial) -> set[str]:
    """The names of the angles of which a monomial has sines or cosines."""
    return {name for number in monomial if (name := angle(algebra, number))}


def angles_met(algebra: Algebra, polynomial: Polynomial) -> set[Pair]:
    """Pairs of angles that meet in a product, directly or within a factor."""
    met: set[Pair] = set()
    for monomial in polynomial:
        inner: set[str] = set()
        for factor in monomial:
            inner |= _within(algebra, factor)
        outer = inner if len(monomial) == 1 else angles_in(algebra, monomial)
        inner |= outer
        met |= {(min(a, b), max(a, b)) for a in outer for b in inner}
    return met


def multiplied_out(algebra: Algebra, polynomial: Polynomial, pair: Pair) -> Polynomial:
    """A polynomial, factors that hold one angle opened where the other is a factor too.

    Products in products are opened, and one sum of each term.
    """
    total: Polynomial = {}
    waiting = [(monomial, c, True) for monomial, c in reversed(polynomial.items())]
    while waiting:
        monomial, coefficient, opens_sums = waiting.pop()
        factor = _factor_with(algebra, monomial, pair, opens_sums)
        if factor is None:
            algebra.accumulate(total, [(monomial, coefficient)])
            continue
        rest, inside = without(monomial, factor), algebra.written[factor]
        opens_sums = opens_sums and len(inside) == 1
        waiting += (
            (
                tuple(sorted(rest + inner)),
                algebra.builder.product(c, coefficient),
                opens_sums,
            )
            for inner, c in inside.items()
        )
    return total


def improved(
    graph: Graph,
    parameters: Iterable[str],
    reshape: Callable[[Pair, Algebra, Polynomial], Polynomial],
    pairs: Callable[[Pair], bool],
) -> Graph:
    """A graph reshaped for each pair of angles for which that makes it cheaper, by themselves.

    A polynomial stays as it is where the reshaped one is much dearer by itself; a little dearer
    it may be, as what is no longer needed then may be worth more. Of a large graph only the pairs
    that are met most often are tried, so that the work grows with the number of nodes.

    Args:
        graph: what is computed.
        parameters: names of the inputs that are constant.
        reshape: gives a polynomial as it is with a pair; itself where nothing changes.
        pairs: whether a pair is of the kind that is reshaped.
    """
    names, met = tuple(parameters), Counter[Pair]()

    def noted(algebra: Algebra, polynomial: Polynomial) -> int:
        for pair in angles_met(algebra, polynomial):
            if pairs(pair) and reshape(pair, algebra, polynomial) != polynomial:
                met[pair] += 1
        return algebra.plain(polynomial)

    rewritten(graph, names, noted)
    most = [partial(reshape, pair) for pair, _ in met.most_common(_MOST_PAIRS)]
    best = count_graph(graph, names).total
    trials = max(2, _MOST_WORK // max(1, len(graph.nodes)))
    for way, allowance in islice(product(most, _ALLOWANCES), trials):
        trial = rewritten(graph, names, _writer(way, allowance))
        total = count_graph(trial, names).total
        if total < best:
            graph, best = trial, total
    return graph


def _writer(reshape: Reshape, allowance: int) -> Callable[[Algebra, Polynomial], int]:
    def write(algebra: Algebra, polynomial: Polynomial) -> int:
        reshaped = reshape(algebra, polynomial)
        dearest = algebra.cost(polynomial) + allowance
        kept = reshaped if algebra.cost(reshaped) <= dearest else polynomial
        return algebra.plain(kept)

    return write


def _factor_with(algebra: Algebra, monomial: Monomial, pair: Pair, opens_sums: bool) -> int | None:
    """A factor that is itself written with one angle of a pair while the other is a factor."""
    if len(monomial) > _LONGEST_MONOMIAL:
        return None
    present = angles_in(algebra, monomial)
    wanted = {b for a, b in (pair, pair[::-1]) if a in present}
    for factor in monomial:
        inside = algebra.written.get(factor, {})
        if len(inside) == 1 or (inside and opens_sums):
            within = _within(algebra, factor)
            if within & wanted or (len(inside) == 1 and within & set(pair)):
                return factor
    return None


def _within(algebra: Algebra, factor: int, depth: int = _DEEPEST_PRODUCT) -> frozenset[str]:
    """The angles that are factors in a polynomial that is written, products in it opened."""
    known = algebra.angles_within.get(factor)
    if known is None:
        names: set[str] = set()
        for monomial in algebra.written.get(factor, ()):
            names |= angles_in(algebra, monomial)
            for inner in monomial if depth else ():
                if len(algebra.written.get(inner, ())) == 1:
                    names |= _within(algebra, inner, depth - 1)
        known = algebra.angles_within[factor] = frozenset(names)
    return known


def _name(algebra: Algebra, number: int) -> str:
    """What a node is computed from; empty when that is much."""
    known = algebra.names.get(number)
    if known is None:
        known = algebra.names[number] = _spelt(algebra, number, _DEEPEST_NAME)
    return known


def _spelt(algebra: Algebra, number: int, depth: int) -> str:
    node = algebra.builder.nodes[number]
    if node.op in (casadi.OP_INPUT, casadi.OP_CONST):
        return f"{node.op} {node.args} {node.value}"
    parts = [_spelt(algebra, operand, depth - 1) for operand in node.args] if depth else [""]
    if node.op != casadi.OP_SUB:
        parts.sort()
    return f"({node.op} {' '.join(parts)})" if all(parts) else ""
