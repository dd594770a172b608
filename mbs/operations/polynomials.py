"""Graphs read as polynomials with parameter-only coefficients, and written anew.

Sums and products that are used once are opened, so that a chain of them is one polynomial; what
is used more often stays one indeterminate. A pass reshapes the polynomials or says how they are
computed.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable

import casadi

from mbs.operations.builder import Builder
from mbs.operations.graph import Graph
from mbs.operations.passes.drop import drop

Monomial = tuple[int, ...]
"""Sorted numbers of nodes to be multiplied, in a Builder; a square is a number twice."""

Polynomial = dict[Monomial, int]
"""The number of the parameter-only coefficient of each monomial, in a Builder."""

Writer = Callable[["Algebra", Polynomial], int]
"""Writes a polynomial as nodes and returns the number of the last."""

_LONGEST_NEGATED = 100
_POLYNOMIAL_OPS = {
    *(casadi.OP_NEG, casadi.OP_ADD, casadi.OP_SUB, casadi.OP_MUL, casadi.OP_SQ),
    *(casadi.OP_TWICE, casadi.OP_DIV, casadi.OP_ASSIGN),
}


class Algebra:
    """Polynomials over a Builder.

    Attributes:
        builder: where coefficients and indeterminates are nodes.
        written: the polynomials that were written as nodes, by the number of the node.
        names: what nodes are computed from, in words; see trigonometry.
        angles_within: the angles in polynomials that were written; see trigonometry.
        one: the coefficient 1.
    """

    def __init__(self, builder: Builder) -> None:
        self.builder = builder
        self.written: dict[int, Polynomial] = {}
        self.names: dict[int, str] = {}
        self.angles_within: dict[int, frozenset[str]] = {}
        self.one = builder.constant(1.0)

    def read(self, number: int) -> Polynomial:
        """A node as a coefficient times one indeterminate; a coefficient alone if it is fixed."""
        builder, coefficient = self.builder, self.one
        while not builder.fixed[number]:
            node = builder.nodes[number]
            if node.op == casadi.OP_NEG:
                coefficient, number = builder.negative(coefficient), node.args[0]
            elif node.op == casadi.OP_TWICE:
                two = builder.constant(2.0)
                coefficient, number = builder.product(coefficient, two), node.args[0]
            elif node.op == casadi.OP_MUL and any(builder.fixed[a] for a in node.args):
                known, number = sorted(node.args, key=lambda a: not builder.fixed[a])
                coefficient = builder.product(coefficient, known)
            else:
                return {(number,): coefficient}
        return {(): builder.product(coefficient, number)}

    def indeterminate(self, number: int) -> Polynomial:
        """A node as one indeterminate with its sign; a coefficient if it is fixed."""
        if self.builder.fixed[number]:
            return {(): number}
        sign, number = self.builder.unsigned(number)
        return {(number,): self.one if sign > 0 else self.builder.constant(-1.0)}

    def opened(self, polynomial: Polynomial) -> Polynomial:
        """The same polynomial, an indeterminate that is a multiple of another being read so."""
        total: Polynomial = {}
        for monomial, coefficient in polynomial.items():
            read = self.read(monomial[0]) if len(monomial) == 1 else {monomial: self.one}
            self.accumulate(total, self.scaled(read, coefficient).items())
        return total

    def is_unit(self, coefficient: int) -> bool:
        """Whether a coefficient is 1 or -1."""
        return self.builder.value(coefficient) in (1.0, -1.0)

    def cost(self, polynomial: Polynomial) -> int:
        """Operations of the sum of terms."""
        products = (len(m) - self.is_unit(c) for m, c in polynomial.items() if m)
        return sum(products) + len(polynomial) - 1

    def accumulate(self, total: Polynomial, terms: Iterable[tuple[Monomial, int]]) -> None:
        """Add terms to a polynomial, in place; what cancels goes."""
        for monomial, coefficient in terms:
            if monomial in total:
                coefficient = self.builder.sum(total.pop(monomial), coefficient)
            if self.builder.value(coefficient) != 0.0:
                total[monomial] = coefficient

    def scaled(self, polynomial: Polynomial, factor: int) -> Polynomial:
        """A polynomial times a coefficient."""
        if factor == self.one:
            return dict(polynomial)
        products = ((m, self.builder.product(c, factor)) for m, c in polynomial.items())
        return {m: c for m, c in products if self.builder.value(c) != 0.0}

    def monomial(self, monomial: Monomial) -> int:
        """The product of a monomial; powers by squaring."""
        if len(set(monomial)) == len(monomial):
            return self._product(monomial)
        powers = Counter(monomial)
        single = self._product(n for n, power in powers.items() if power % 2)
        half = sorted(n for n, power in powers.items() for _ in range(power // 2))
        square = self.builder.apply(casadi.OP_SQ, self.monomial(tuple(half)))
        return self.builder.product(single, square)

    def _product(self, numbers: Iterable[int]) -> int:
        result = -1
        for number in numbers:
            result = self.builder.product(result, number) if result >= 0 else number
        return result if result >= 0 else self.one

    def term(self, monomial: Monomial, coefficient: int) -> int:
        """Coefficient times monomial as a node."""
        product = self.monomial(monomial)
        return product if coefficient == self.one else self.builder.product(coefficient, product)

    def cheapest(self, ways: Iterable[Callable[[], int]]) -> int:
        """The number that the way with the fewest new operations gives; the first of equals."""
        start = len(self.builder.nodes)
        tried = []
        for way in ways:
            way()
            tried.append((self.builder.cost_since(start), way))
            self._forget_since(start)
        return min(tried, key=lambda trial: trial[0])[1]()

    def _forget_since(self, start: int) -> None:
        for number in range(start, len(self.builder.nodes)):
            for memory in (self.written, self.names, self.angles_within):
                memory.pop(number, None)
        self.builder.forget_since(start)

    def plain(self, polynomial: Polynomial) -> int:
        """A polynomial as the sum of its terms."""
        total = -1
        for monomial, coefficient in polynomial.items():
            term = self.term(monomial, coefficient)
            total = self.builder.sum(total, term) if total >= 0 else term
        return total if total >= 0 else self.builder.constant(0.0)


def rewritten(graph: Graph, parameters: Iterable[str], write: Writer) -> Graph:
    """A graph of which a pass writes every polynomial.

    Args:
        graph: what to rewrite.
        parameters: names of inputs of which coefficients are made.
        write: how.
    """
    return _Rewriting(graph, Algebra(Builder(graph, parameters)), write).graph()


class _Rewriting:
    """One walk over a graph.

    A node used once is kept as a polynomial until something needs it as a node. A polynomial of
    more than one term has one owner, who may change it in place.
    """

    def __init__(self, graph: Graph, algebra: Algebra, write: Writer) -> None:
        self._old = graph
        self._algebra, self._builder, self._write = algebra, algebra.builder, write
        self._uses = self._old.uses()
        self._forms: list[Polynomial] = []

    def graph(self) -> Graph:
        """The rewritten graph."""
        for number in range(len(self._old.nodes)):
            self._forms.append(self._form(number))
        results = [[self._number(self._forms[n]) for n in r] for r in self._old.results]
        return drop(self._old.with_nodes(self._builder.nodes, results))

    def _form(self, number: int) -> Polynomial:
        node, operands = self._old.nodes[number], self._old.operands(number)
        form = None
        if node.op in _POLYNOMIAL_OPS:
            form = self._combined(node.op, [self._forms[a] for a in operands])
        if form is None:
            made = self._builder.add(node, [self._number(self._forms[a]) for a in operands])
            return self._algebra.indeterminate(made)
        if self._uses[number] > 1:
            return self._algebra.indeterminate(self._number(form))
        return form

    def _number(self, form: Polynomial) -> int:
        if not form:
            return self._builder.constant(0.0)
        if len(form) == 1:
            number = self._algebra.term(*next(iter(form.items())))
        else:
            number = self._write(self._algebra, form)
        sign, unsigned = self._builder.unsigned(number)
        if sign < 0:
            form = self._algebra.scaled(form, self._builder.constant(-1.0))
        if len(form) > 1 or next(iter(form)) != (unsigned,):
            self._algebra.written[unsigned] = form
        return number

    def _combined(self, op: int, forms: list[Polynomial]) -> Polynomial | None:
        """An operation on polynomials; None when the result is none."""
        first, *others = forms
        second = others[0] if others else first
        if op == casadi.OP_ASSIGN:
            return first
        if op == casadi.OP_NEG:
            return self._algebra.scaled(first, self._builder.constant(-1.0))
        if op == casadi.OP_TWICE:
            return self._times(first, {(): self._builder.constant(2.0)})
        if op in (casadi.OP_MUL, casadi.OP_SQ):
            return self._times(first, second)
        if op == casadi.OP_DIV:
            return self._over(first, second)
        sign = self._builder.constant(1.0 if op == casadi.OP_ADD else -1.0)
        return self._plus(first, second, sign)

    def _plus(self, first: Polynomial, second: Polynomial, sign: int) -> Polynomial:
        """The sum first + sign second, in place of the longer one."""
        if len(second) > _LONGEST_NEGATED and sign != self._algebra.one:
            second = self._algebra.indeterminate(self._number(second))
        scaled = second if sign == self._algebra.one else self._algebra.scaled(second, sign)
        first = first if len(first) > 1 else self._algebra.opened(first)
        if len(scaled) == 1:
            scaled = self._algebra.opened(scaled)
        longer, shorter = (first, scaled) if len(first) >= len(scaled) else (scaled, first)
        self._algebra.accumulate(longer, shorter.items())
        return longer

    def _over(self, first: Polynomial, second: Polynomial) -> Polynomial | None:
        """A quotient by a coefficient is a product by its inverse."""
        if not _is_coefficient(second):
            return None
        inverse = self._builder.apply(casadi.OP_INV, second[()])
        return self._times(first, {(): inverse})

    def _times(self, first: Polynomial, second: Polynomial) -> Polynomial:
        if not first or not second:
            return {}
        for one, other in ((first, second), (second, first)):
            if _is_coefficient(one) and self._bears(other):
                other = self._algebra.opened(other) if len(other) == 1 else other
                return self._algebra.scaled(other, one[()])
        (m1, c1), (m2, c2) = self._single(first), self._single(second)
        return {tuple(sorted(m1 + m2)): self._builder.product(c1, c2)}

    def _bears(self, form: Polynomial) -> bool:
        """Whether a coefficient times every term costs no more than times the sum."""
        units = sum(1 for m, c in form.items() if m and self._algebra.is_unit(c))
        return units <= 1

    def _single(self, form: Polynomial) -> tuple[Monomial, int]:
        """A polynomial as one term."""
        if len(form) > 1:
            form = self._algebra.indeterminate(self._number(form))
        return next(iter(form.items()))


def _is_coefficient(form: Polynomial) -> bool:
    return len(form) == 1 and () in form


def without(monomial: Monomial, *factors: int) -> Monomial:
    """A monomial divided by some of its factors."""
    rest = list(monomial)
    for factor in factors:
        rest.remove(factor)
    return tuple(rest)
