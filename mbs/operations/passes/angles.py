"""Sums of angles in place of products of sines and cosines."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import casadi

from mbs.operations.graph import Graph
from mbs.operations.polynomials import Algebra, Monomial, Polynomial, without
from mbs.operations.trigonometry import Pair, angle, improved, multiplied_out


class _Meeting(NamedTuple):
    """A term with a sine or cosine, `first`, of one angle and one, `second`, of the other."""

    monomial: Monomial
    coefficient: int
    first: int
    second: int


def angles(graph: Graph, parameters: Iterable[str] = ()) -> Graph:
    """Rotations about parallel axes joined: c2 c3 - s2 s3 is cos(q2 + q3).

    Rotations of vectors, one after the other, are joined too. Each pair of angles is tried by
    itself and stays joined if the graph got cheaper.
    """
    return improved(graph, parameters, _joined, lambda pair: pair[0] != pair[1])


def _joined(pair: Pair, algebra: Algebra, polynomial: Polynomial) -> Polynomial:
    """Two angles joined wherever both of their terms are there; itself if they never are."""
    opened = multiplied_out(algebra, polynomial, pair)
    meetings: dict[Monomial, dict[tuple[int, int], _Meeting]] = {}
    nodes = algebra.builder.nodes
    for monomial, coefficient in opened.items():
        for first, second in _of_both(algebra, monomial, pair):
            ops = nodes[first].op, nodes[second].op
            meeting = _Meeting(monomial, coefficient, first, second)
            meetings.setdefault(without(monomial, first, second), {})[ops] = meeting
    result = dict(opened)
    for rest, found in meetings.items():
        for op in (casadi.OP_COS, casadi.OP_SIN):
            one = found.get((op, casadi.OP_COS))
            other = found.get((casadi.OP_COS + casadi.OP_SIN - op, casadi.OP_SIN))
            if one and other:
                _join(algebra, result, rest, one, other)
    return polynomial if result == opened else result


def _of_both(algebra: Algebra, monomial: Monomial, pair: Pair) -> Iterator[tuple[int, int]]:
    """Two factors, one of each angle."""
    known = {n: name for n in monomial if (name := angle(algebra, n)) in pair}
    for first, a in known.items():
        for second, b in known.items():
            if (a, b) == pair:
                yield first, second


def _join(
    algebra: Algebra, result: Polynomial, rest: Monomial, one: _Meeting, other: _Meeting
) -> None:
    """Two terms as one in place, if their coefficients agree: cos cos - sin sin and the like."""
    builder = algebra.builder
    if any(result.get(m.monomial) != m.coefficient for m in (one, other)):
        return
    same = one.coefficient == other.coefficient
    if not same and other.coefficient != builder.negative(one.coefficient):
        return
    op = builder.nodes[one.first].op
    a, b = (builder.nodes[number].args[0] for number in (one.first, one.second))
    plus = same == (op == casadi.OP_SIN)
    joined = builder.sum(a, b) if plus else builder.difference(a, b)
    del result[one.monomial], result[other.monomial]
    for monomial, sign in algebra.indeterminate(builder.apply(op, joined)).items():
        product = builder.product(sign, one.coefficient)
        algebra.accumulate(result, [(tuple(sorted(rest + monomial)), product)])
