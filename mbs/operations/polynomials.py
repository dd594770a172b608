"""Rewrite graphs as polynomials with parameter-only coefficients.

Sums and products that are used once are expanded, so that a chain of them is a single polynomial.
A node that is used several times is an indeterminate. A pass transforms the polynomials, or
chooses how they are computed.
"""

from __future__ import annotations

import heapq
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable
from functools import partial
from itertools import combinations, islice, product

import casadi

from mbs.operations.counts import count_graph
from mbs.operations.graph import Builder, Graph, drop

Monomial = tuple[int, ...]
"""Sorted node indices (in a Builder) of the factors of a product; a square contains one twice."""

Polynomial = dict[Monomial, int]
"""Monomial to the node index (in a Builder) of its parameter-only coefficient."""

Writer = Callable[["Algebra", Polynomial], int]
"""Callable that writes a polynomial as nodes and returns the index of the last node."""

_LONGEST_NEGATED = 100
_POLYNOMIAL_OPS = {
    *(casadi.OP_NEG, casadi.OP_ADD, casadi.OP_SUB, casadi.OP_MUL, casadi.OP_SQ),
    *(casadi.OP_TWICE, casadi.OP_DIV, casadi.OP_ASSIGN),
}


class Algebra:
    """Arithmetic of polynomials whose coefficients and indeterminates are nodes of a Builder.

    Attributes:
        builder: builder of the nodes.
        written: node index to the polynomial that was written as this node.
        names: node index to a text of the expression that it computes; see `angle`.
        angles_within: node index to the angles in its polynomial; see `angles_met`.
        one: index of the coefficient 1.
    """

    def __init__(self, builder: Builder) -> None:
        self.builder = builder
        self.written: dict[int, Polynomial] = {}
        self.names: dict[int, str] = {}
        self.angles_within: dict[int, frozenset[str]] = {}
        self.one = builder.constant(1.0)

    def read(self, number: int) -> Polynomial:
        """Return a node as a polynomial of one term: coefficient times another node.

        Signs and parameter-only factors join the coefficient. A parameter-only node is a constant
        term.

        Args:
            number: index of a node.
        """
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
        """Return a node as a polynomial of one term: 1 or -1 times the node.

        A parameter-only node is a constant term.

        Args:
            number: index of a node.
        """
        if self.builder.fixed[number]:
            return {(): number}
        sign, number = self.builder.unsigned(number)
        return {(number,): self.one if sign > 0 else self.builder.constant(-1.0)}

    def opened(self, polynomial: Polynomial) -> Polynomial:
        """Return the polynomial in which indeterminates of the form c x are written as c times x.

        c is a parameter-only coefficient.
        """
        total: Polynomial = {}
        for monomial, coefficient in polynomial.items():
            read = self.read(monomial[0]) if len(monomial) == 1 else {monomial: self.one}
            self.accumulate(total, self.scaled(read, coefficient).items())
        return total

    def is_unit(self, coefficient: int) -> bool:
        """Return whether the node `coefficient` is the constant 1 or -1."""
        return self.builder.value(coefficient) in (1.0, -1.0)

    def cost(self, polynomial: Polynomial) -> int:
        """Return the number of operations that computing a polynomial term by term takes."""
        products = (len(m) - self.is_unit(c) for m, c in polynomial.items() if m)
        return sum(products) + len(polynomial) - 1

    def accumulate(self, total: Polynomial, terms: Iterable[tuple[Monomial, int]]) -> None:
        """Add terms (monomial, coefficient) to the polynomial `total`, in place.

        Zero terms are removed.
        """
        for monomial, coefficient in terms:
            if monomial in total:
                coefficient = self.builder.sum(total.pop(monomial), coefficient)
            if self.builder.value(coefficient) != 0.0:
                total[monomial] = coefficient

    def scaled(self, polynomial: Polynomial, factor: int) -> Polynomial:
        """Return a polynomial times the coefficient node `factor`."""
        if factor == self.one:
            return dict(polynomial)
        products = ((m, self.builder.product(c, factor)) for m, c in polynomial.items())
        return {m: c for m, c in products if self.builder.value(c) != 0.0}

    def monomial(self, monomial: Monomial) -> int:
        """Write a product of nodes and return its node; powers are computed by squaring.

        Args:
            monomial: node indices of the factors.
        """
        if len(set(monomial)) == len(monomial):
            return self._product(monomial)
        powers = Counter(monomial)
        single = self._product(n for n, power in powers.items() if power % 2)
        half = sorted(n for n, power in powers.items() for _ in range(power // 2))
        square = self.builder.apply(casadi.OP_SQ, self.monomial(tuple(half)))
        return self.builder.product(single, square)

    def _product(self, numbers: Iterable[int]) -> int:
        """Write the product of nodes and return its node; 1 without nodes."""
        result = -1
        for number in numbers:
            result = self.builder.product(result, number) if result >= 0 else number
        return result if result >= 0 else self.one

    def term(self, monomial: Monomial, coefficient: int) -> int:
        """Write coefficient times monomial and return its node."""
        product = self.monomial(monomial)
        return product if coefficient == self.one else self.builder.product(coefficient, product)

    def cheapest(self, forms: Iterable[Callable[[], int]]) -> int:
        """Write the form with the fewest new operations (the first of equals) and return its node.

        Args:
            forms: callables that write equal values; each returns the index of its node.
        """
        start = len(self.builder.nodes)
        tried = []
        for form in forms:
            form()
            tried.append((self.builder.cost_since(start), form))
            self._forget_since(start)
        return min(tried, key=lambda trial: trial[0])[1]()

    def _forget_since(self, start: int) -> None:
        """Remove all nodes with index `start` or more, with their polynomials and names."""
        for number in range(start, len(self.builder.nodes)):
            for memory in (self.written, self.names, self.angles_within):
                memory.pop(number, None)
        self.builder.forget_since(start)

    def plain(self, polynomial: Polynomial) -> int:
        """Write a polynomial as the sum of its terms and return its node."""
        total = -1
        for monomial, coefficient in polynomial.items():
            term = self.term(monomial, coefficient)
            total = self.builder.sum(total, term) if total >= 0 else term
        return total if total >= 0 else self.builder.constant(0.0)


def rewritten(graph: Graph, parameters: Iterable[str], write: Writer) -> Graph:
    """Return an equal graph in which a callable writes every polynomial as nodes.

    Args:
        graph: graph to rewrite.
        parameters: names of the inputs that coefficients may depend on.
        write: callable (algebra, polynomial) -> index of the node of the polynomial.
    """
    return _Rewriting(graph, Algebra(Builder(graph, parameters)), write).graph()


class _Rewriting:
    """Traversal of a graph that converts its nodes to polynomials and back.

    A node that is used once is kept as a polynomial until it is needed as a node. A polynomial of
    several terms has a single owner, which may change it in place.
    """

    def __init__(self, graph: Graph, algebra: Algebra, write: Writer) -> None:
        self._old = graph
        self._algebra, self._builder, self._write = algebra, algebra.builder, write
        self._uses = self._old.uses()
        self._forms: list[Polynomial] = []

    def graph(self) -> Graph:
        """Return the rewritten graph."""
        for number in range(len(self._old.nodes)):
            self._forms.append(self._form(number))
        results = [[self._number(self._forms[n]) for n in r] for r in self._old.results]
        return drop(self._old.with_nodes(self._builder.nodes, results))

    def _form(self, number: int) -> Polynomial:
        """Return the polynomial of node `number` of the old graph."""
        node, operands = self._old.nodes[number], self._old.operands(number)
        form = None
        if node.op in _POLYNOMIAL_OPS:
            form = self._combine(node.op, [self._forms[a] for a in operands])
        if form is None:
            made = self._builder.add(node, [self._number(self._forms[a]) for a in operands])
            return self._algebra.indeterminate(made)
        if self._uses[number] > 1:
            return self._algebra.indeterminate(self._number(form))
        return form

    def _number(self, form: Polynomial) -> int:
        """Write a polynomial as nodes of the new graph and return the index of its node."""
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

    def _combine(self, op: int, forms: list[Polynomial]) -> Polynomial | None:
        """Apply the operation `op` to polynomials; return None if the result is no polynomial."""
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
        """Return first + sign second, where `sign` is a node of 1 or -1.

        The longer polynomial is changed in place.
        """
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
        """Return the quotient first / second as a polynomial.

        None if the divisor is no coefficient.
        """
        if not _is_coefficient(second):
            return None
        inverse = self._builder.apply(casadi.OP_INV, second[()])
        return self._times(first, {(): inverse})

    def _times(self, first: Polynomial, second: Polynomial) -> Polynomial:
        """Return the product of two polynomials.

        A sum that is not scaled by terms becomes a node.
        """
        if not first or not second:
            return {}
        for one, other in ((first, second), (second, first)):
            if _is_coefficient(one) and self._scales_by_terms(other):
                other = self._algebra.opened(other) if len(other) == 1 else other
                return self._algebra.scaled(other, one[()])
        (m1, c1), (m2, c2) = self._single(first), self._single(second)
        return {tuple(sorted(m1 + m2)): self._builder.product(c1, c2)}

    def _scales_by_terms(self, form: Polynomial) -> bool:
        """Return whether scaling each term of a polynomial costs no more than scaling its sum."""
        units = sum(1 for m, c in form.items() if m and self._algebra.is_unit(c))
        return units <= 1

    def _single(self, form: Polynomial) -> tuple[Monomial, int]:
        """Return a polynomial as a single term (monomial, coefficient).

        A sum is written as a node.
        """
        if len(form) > 1:
            form = self._algebra.indeterminate(self._number(form))
        return next(iter(form.items()))


def _is_coefficient(form: Polynomial) -> bool:
    """Return whether a polynomial is a constant term."""
    return len(form) == 1 and () in form


def without(monomial: Monomial, *factors: int) -> Monomial:
    """Return a monomial without some of its factors. Raise ValueError if one is not contained."""
    rest = list(monomial)
    for factor in factors:
        rest.remove(factor)
    return tuple(rest)


# Polynomials in sines and cosines: their angles, and the pairs of angles in products.


Pair = tuple[str, str]
"""Names of two angles; the same name twice for the squares of an angle."""

Reshape = Callable[[Algebra, Polynomial], Polynomial]

_DEEPEST_NAME = 6
_DEEPEST_PRODUCT = 6
_LONGEST_MONOMIAL = 12
_ALLOWANCES = (1000, 4, 0)
_MOST_PAIRS = 24
_MOST_WORK = 40_000


def angle(algebra: Algebra, number: int) -> str:
    """Return a text that identifies the angle of a sine or cosine; empty for another node.

    Args:
        algebra: algebra with the nodes.
        number: index of a node.
    """
    node = algebra.builder.nodes[number]
    if node.op not in (casadi.OP_SIN, casadi.OP_COS):
        return ""
    return _name(algebra, node.args[0])


def angles_in(algebra: Algebra, monomial: Monomial) -> set[str]:
    """Return the texts (see `angle`) of the angles whose sines or cosines are in a monomial.

    Args:
        algebra: algebra with the nodes.
        monomial: node indices of the factors.
    """
    return {name for number in monomial if (name := angle(algebra, number))}


def angles_met(algebra: Algebra, polynomial: Polynomial) -> set[Pair]:
    """Return the pairs of angles that occur in a product, directly or within a factor.

    Pairs consist of two texts, see `angle`, in alphabetical order.

    Args:
        algebra: algebra with the nodes.
        polynomial: polynomial to search.
    """
    met: set[Pair] = set()
    for monomial in polynomial:
        inner: set[str] = set()
        for factor in monomial:
            inner |= _angles_within(algebra, factor)
        outer = inner if len(monomial) == 1 else angles_in(algebra, monomial)
        inner |= outer
        met |= {(min(a, b), max(a, b)) for a in outer for b in inner}
    return met


def multiplied_out(algebra: Algebra, polynomial: Polynomial, pair: Pair) -> Polynomial:
    """Expand the factors that contain one angle of a pair if the other angle is a factor too.

    Nested products are expanded. In each term at most one sum is expanded.

    Args:
        algebra: algebra with the nodes.
        polynomial: polynomial to expand.
        pair: texts of the two angles.
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
    """Return the graph transformed for each pair of angles for which this makes it cheaper.

    A polynomial remains unchanged if the transformed one is much more expensive. It may be slightly
    more expensive, because nodes that become unused may save more. In a large graph only the most
    frequent pairs are tried, so that the work grows with the number of nodes.

    Args:
        graph: graph to transform.
        parameters: names of the inputs that are constant.
        reshape: callable (pair, algebra, polynomial) -> transformed polynomial. It returns an equal
            polynomial if nothing changes.
        pairs: callable (pair of angles) -> whether it is tried.
    """
    names, met = tuple(parameters), Counter[Pair]()

    def note(algebra: Algebra, polynomial: Polynomial) -> int:
        for pair in angles_met(algebra, polynomial):
            if pairs(pair) and reshape(pair, algebra, polynomial) != polynomial:
                met[pair] += 1
        return algebra.plain(polynomial)

    rewritten(graph, names, note)
    most = [partial(reshape, pair) for pair, _ in met.most_common(_MOST_PAIRS)]
    best = count_graph(graph, names).total
    trials = max(2, _MOST_WORK // max(1, len(graph.nodes)))
    for form, allowance in islice(product(most, _ALLOWANCES), trials):
        trial = rewritten(graph, names, _writer(form, allowance))
        total = count_graph(trial, names).total
        if total < best:
            graph, best = trial, total
    return graph


def _writer(reshape: Reshape, allowance: int) -> Callable[[Algebra, Polynomial], int]:
    """Return a callable that writes a polynomial transformed by `reshape`.

    The polynomial is written untransformed if the other costs over `allowance` more operations.
    """

    def write(algebra: Algebra, polynomial: Polynomial) -> int:
        reshaped = reshape(algebra, polynomial)
        dearest = algebra.cost(polynomial) + allowance
        kept = reshaped if algebra.cost(reshaped) <= dearest else polynomial
        return algebra.plain(kept)

    return write


def _factor_with(algebra: Algebra, monomial: Monomial, pair: Pair, opens_sums: bool) -> int | None:
    """Return a factor of a monomial to expand for a pair of angles; None if there is none.

    The factor contains one angle of the pair, and the other angle is a factor too. `opens_sums` is
    whether sums may be expanded, not only products.
    """
    if len(monomial) > _LONGEST_MONOMIAL:
        return None
    present = angles_in(algebra, monomial)
    partners = {b for a, b in (pair, pair[::-1]) if a in present}
    for factor in monomial:
        inside = algebra.written.get(factor, {})
        if len(inside) == 1 or (inside and opens_sums):
            within = _angles_within(algebra, factor)
            if within & partners or (len(inside) == 1 and within & set(pair)):
                return factor
    return None


def _angles_within(algebra: Algebra, factor: int, depth: int = _DEEPEST_PRODUCT) -> frozenset[str]:
    """Return the angles in the polynomial of a node, products expanded to the nesting `depth`."""
    known = algebra.angles_within.get(factor)
    if known is None:
        names: set[str] = set()
        for monomial in algebra.written.get(factor, ()):
            names |= angles_in(algebra, monomial)
            for inner in monomial if depth else ():
                if len(algebra.written.get(inner, ())) == 1:
                    names |= _angles_within(algebra, inner, depth - 1)
        known = algebra.angles_within[factor] = frozenset(names)
    return known


def _name(algebra: Algebra, number: int) -> str:
    """Return a text of the expression that a node computes; empty if it is nested too deeply."""
    known = algebra.names.get(number)
    if known is None:
        known = algebra.names[number] = _expression_text(algebra, number, _DEEPEST_NAME)
    return known


def _expression_text(algebra: Algebra, number: int, depth: int) -> str:
    """Return a text of the expression that a node computes; empty if nested deeper than `depth`."""
    node = algebra.builder.nodes[number]
    if node.op in (casadi.OP_INPUT, casadi.OP_CONST):
        return f"{node.op} {node.args} {node.value}"
    parts = (
        [_expression_text(algebra, operand, depth - 1) for operand in node.args] if depth else [""]
    )
    if node.op != casadi.OP_SUB:
        parts.sort()
    return f"({node.op} {' '.join(parts)})" if all(parts) else ""


# Pairs of elements that occur in several groups.


Group = dict[int, int]
"""Element to its sign, 1 or -1."""

_Pair = tuple[int, int, int]
"""Two elements, the lower index first, and the product of their signs."""

_LONGEST = 48


def extract_pairs(groups: dict[int, Group], first_name: int) -> None:
    """Replace common parts of sums or products by new groups, in place.

    The pair of elements that occurs most often, up to a common sign, becomes a group, until no pair
    occurs twice. Only the first elements of a long group are considered, so that the work grows
    with the number of elements.

    Args:
        groups: groups by name; the new groups are added.
        first_name: first index that is free as a name.
    """
    extraction = _Extraction(groups)
    name = first_name
    while (pair := extraction.most_common()) is not None:
        extraction.replace(pair, name)
        name += 1


class _Extraction:
    """Replacement of the most frequent pair of elements in groups by a new group."""

    def __init__(self, groups: dict[int, Group]) -> None:
        self._groups = groups
        self._holders: dict[_Pair, dict[int, None]] = defaultdict(dict)
        self._queue: list[tuple[int, _Pair]] = []
        for name, group in groups.items():
            for a, b in combinations(sorted(list(group)[:_LONGEST]), 2):
                self._holders[(a, b, group[a] * group[b])][name] = None
        self._queue = [(-len(h), pair) for pair, h in self._holders.items() if len(h) > 1]
        heapq.heapify(self._queue)

    def most_common(self) -> _Pair | None:
        """Return the most frequent pair (a, b, sign); None if no pair occurs twice."""
        while self._queue:
            count, pair = heapq.heappop(self._queue)
            occurrences = len(self._holders.get(pair, ()))
            if occurrences == -count:
                return pair
            if occurrences > 1:
                heapq.heappush(self._queue, (-occurrences, pair))
        return None

    def replace(self, pair: _Pair, name: int) -> None:
        """Make a pair a new group `name`; one element replaces it in all groups that contain it."""
        a, b, sign = pair
        for holder in list(self._holders.pop(pair)):
            group = self._groups[holder]
            outer = group[a]
            self._remove_pairs(holder, group, a, b)
            del group[a], group[b]
            self._record_pairs(holder, group, name, outer)
            group[name] = outer
        self._groups[name] = {a: 1, b: sign}

    def _remove_pairs(self, holder: int, group: Group, a: int, b: int) -> None:
        """Remove the pairs of elements a or b with the other elements of the group `holder`."""
        for other, sign in group.items():
            for gone in (a, b):
                if other != gone:
                    low, high = min(gone, other), max(gone, other)
                    holders = self._holders.get((low, high, sign * group[gone]))
                    if holders is not None:
                        holders.pop(holder, None)

    def _record_pairs(self, holder: int, group: Group, name: int, outer: int) -> None:
        """Record the pairs of the new element `name` with the elements of the group `holder`.

        `outer` is the sign of the new element.
        """
        for other in list(group)[:_LONGEST]:
            pair = (other, name, group[other] * outer)
            holders = self._holders[pair]
            holders[holder] = None
            if len(holders) > 1:
                heapq.heappush(self._queue, (-len(holders), pair))
