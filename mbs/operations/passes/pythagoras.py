"""The sum of the squares of a sine and a cosine is 1."""

from __future__ import annotations

from collections.abc import Iterable

import casadi

from mbs.operations.graph import Graph
from mbs.operations.polynomials import Algebra, Monomial, Polynomial, without
from mbs.operations.trigonometry import Pair, angle, improved, multiplied_out


def pythagoras(graph: Graph, parameters: Iterable[str] = ()) -> Graph:
    """Squares of sines and cosines reduced: s s x + c c x is x, x - s s x is c c x.

    With other coefficients p1 s s x + p2 c c x is p1 x + (p2 - p1) c c x.
    A vector turned to and fro is itself again. Each angle is tried by itself and stays so if the
    graph got cheaper.
    """
    return improved(graph, parameters, _reduced, lambda pair: pair[0] == pair[1])


def _reduced(pair: Pair, algebra: Algebra, polynomial: Polynomial) -> Polynomial:
    """The squares of an angle's sine and cosine reduced where that saves a term or product."""
    opened = multiplied_out(algebra, polynomial, pair)
    result = dict(opened)
    for monomial in opened:
        for number in set(monomial):
            if monomial.count(number) > 1 and angle(algebra, number) == pair[0]:
                result = _reduced_rest(algebra, result, number, without(monomial, number, number))
    return polynomial if result == opened else result


def _reduced_rest(
    algebra: Algebra, polynomial: Polynomial, number: int, rest: Monomial
) -> Polynomial:
    """The cheapest of the ways to write the terms with rest, c c rest and s s rest."""
    builder = algebra.builder
    argument = builder.nodes[number].args[0]
    squares = [
        tuple(sorted((*rest, *[builder.apply(op, argument)] * 2)))
        for op in (casadi.OP_COS, casadi.OP_SIN)
    ]
    minus = builder.constant(-1.0)
    ways = [polynomial]
    for gone, other in (squares, squares[::-1]):
        if gone in polynomial:
            way = dict(polynomial)
            coefficient = way.pop(gone)
            opposite = builder.product(minus, coefficient)
            algebra.accumulate(way, [(rest, coefficient), (other, opposite)])
            ways.append(way)
    return min(ways, key=algebra.cost)
