"""Factor sums of products."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from functools import partial

from mbs.operations.counts import count_graph
from mbs.operations.graph import Graph
from mbs.operations.polynomials import Algebra, Monomial, Polynomial, rewritten, without

_LONGEST_MONOMIAL = 12
_MOST_WORK = 20_000


def factor(graph: Graph, parameters: Iterable[str] = ()) -> Graph:
    """Sums of products with common factors put outside: a b + a c is a (b + c).

    The factor that saves most products is taken first. Products that are used elsewhere are
    opened too where that is no dearer, as the bracket may be there already.
    """
    names = tuple(parameters)
    trials = (rewritten(graph, names, write) for write in (_opened_first, _opened_last))
    return min(trials, key=lambda trial: count_graph(trial, names).total)


def _opened_first(algebra: Algebra, polynomial: Polynomial) -> int:
    """The cheapest way to write a polynomial; of equals the one with its products opened."""
    return algebra.cheapest(reversed(_ways(algebra, polynomial)))


def _opened_last(algebra: Algebra, polynomial: Polynomial) -> int:
    return algebra.cheapest(_ways(algebra, polynomial))


def _ways(algebra: Algebra, polynomial: Polynomial) -> list[partial[int]]:
    ways = [partial(_factored, algebra, polynomial)]
    opened = _opened(algebra, polynomial)
    if opened != polynomial:
        ways.append(partial(_factored, algebra, opened))
    return ways


def _opened(algebra: Algebra, polynomial: Polynomial) -> Polynomial:
    """The same polynomial, no factor of which is a product."""
    total: Polynomial = {}
    for monomial, coefficient in polynomial.items():
        factors: Monomial = ()
        waiting = list(monomial)
        while waiting:
            number = waiting.pop()
            inside = algebra.written.get(number, {})
            if len(inside) == 1 and len(factors) + len(waiting) < _LONGEST_MONOMIAL:
                ((inner, c),) = inside.items()
                coefficient = algebra.builder.product(coefficient, c)
                waiting += inner
            else:
                factors = (*factors, number)
        algebra.accumulate(total, [(tuple(sorted(factors)), coefficient)])
    return total


def _factored(algebra: Algebra, polynomial: Polynomial) -> int:
    rest = dict(polynomial)
    for _ in range(_MOST_WORK // max(1, len(polynomial))):
        savings = _savings(algebra, rest)
        best = max(savings, key=lambda number: savings[number], default=None)
        if best is None:
            break
        rest = _with_factor(algebra, rest, best)
    return algebra.plain(rest)


def _savings(algebra: Algebra, polynomial: Polynomial) -> Counter[int]:
    """How many products are saved when a node is put outside, of nodes that save any."""
    savings: Counter[int] = Counter()
    for monomial, coefficient in polynomial.items():
        unit = algebra.is_unit(coefficient)
        saved = int(len(monomial) > 1 or not unit)
        for number in set(monomial):
            savings[number] += saved
        if monomial and not unit:
            savings[algebra.builder.unsigned(coefficient)[1]] += 1
    return Counter({number: saved - 1 for number, saved in savings.items() if saved > 1})


def _with_factor(algebra: Algebra, polynomial: Polynomial, number: int) -> Polynomial:
    """The polynomial with all multiples of a node written as one product."""
    builder, rest = algebra.builder, dict(polynomial)
    bracket: Polynomial = {}
    for monomial, coefficient in polynomial.items():
        quotient = _quotient(algebra, monomial, coefficient, number)
        if quotient:
            del rest[monomial]
            algebra.accumulate(bracket, algebra.opened(quotient).items())
    if bracket:
        product = builder.product(number, _factored(algebra, bracket))
        algebra.accumulate(rest, algebra.indeterminate(product).items())
    return rest


def _quotient(
    algebra: Algebra, monomial: Monomial, coefficient: int, number: int
) -> Polynomial | None:
    """A term divided by a node; None when that is no factor of it."""
    if number in monomial:
        return {without(monomial, number): coefficient}
    sign, unsigned = algebra.builder.unsigned(coefficient)
    if unsigned == number and not algebra.is_unit(coefficient):
        return {monomial: algebra.builder.constant(sign)}
    return None
