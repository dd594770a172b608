"""Simplification passes: each returns an equivalent graph that is cheaper in one respect."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from typing import NamedTuple

import casadi

from mbs.operations.counts import count_graph
from mbs.operations.graph import COMMUTATIVE, Builder, Graph, Node, drop, rebuild
from mbs.operations.polynomials import (
    Algebra,
    Group,
    Monomial,
    Pair,
    Polynomial,
    Writer,
    angle,
    extract_pairs,
    improved,
    multiplied_out,
    rewritten,
    without,
)

# Trigonometric functions of sums of angles instead of products of sines and cosines.


class _AnglePair(NamedTuple):
    """Term with sines or cosines of two angles: factor `first` and factor `second`."""

    monomial: Monomial
    coefficient: int
    first: int
    second: int


def angles(graph: Graph, parameters: Iterable[str] = ()) -> Graph:
    """Replace products of sines and cosines of two angles: c2 c3 - s2 s3 becomes cos(q2 + q3).

    Consecutive rotations of vectors are joined too. Each pair of angles is tried separately. The
    result is kept if the graph is cheaper.

    Args:
        graph: graph to transform.
        parameters: names of the inputs that are constant from call to call.
    """
    return improved(graph, parameters, _join_angles, lambda pair: pair[0] != pair[1])


def _join_angles(pair: Pair, algebra: Algebra, polynomial: Polynomial) -> Polynomial:
    """Replace products of sines and cosines of the two angles of `pair` by those of their sum.

    Return `polynomial` itself if no terms match.
    """
    opened = multiplied_out(algebra, polynomial, pair)
    meetings: dict[Monomial, dict[tuple[int, int], _AnglePair]] = {}
    nodes = algebra.builder.nodes
    for monomial, coefficient in opened.items():
        for first, second in _factor_pairs(algebra, monomial, pair):
            ops = nodes[first].op, nodes[second].op
            meeting = _AnglePair(monomial, coefficient, first, second)
            meetings.setdefault(without(monomial, first, second), {})[ops] = meeting
    result = dict(opened)
    for rest, found in meetings.items():
        for op in (casadi.OP_COS, casadi.OP_SIN):
            one = found.get((op, casadi.OP_COS))
            other = found.get((casadi.OP_COS + casadi.OP_SIN - op, casadi.OP_SIN))
            if one and other:
                _join(algebra, result, rest, one, other)
    return polynomial if result == opened else result


def _factor_pairs(algebra: Algebra, monomial: Monomial, pair: Pair) -> Iterator[tuple[int, int]]:
    """Yield pairs of factors of a monomial: sine or cosine of the first and of the second angle.

    `pair` are the two angles.
    """
    known = {n: name for n in monomial if (name := angle(algebra, n)) in pair}
    for first, a in known.items():
        for second, b in known.items():
            if (a, b) == pair:
                yield first, second


def _join(
    algebra: Algebra, result: Polynomial, rest: Monomial, one: _AnglePair, other: _AnglePair
) -> None:
    """Replace two terms of the polynomial `result`, in place, by the cosine or sine of a sum.

    `rest` is the common factor, `one` has the cosine of the second angle and `other` its sine.
    Nothing changes if the coefficients do not match, as in cos cos - sin sin.
    """
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


# Factor sums of products.


_LONGEST_MONOMIAL = 12
_MOST_WORK = 20_000


def factor(graph: Graph, parameters: Iterable[str] = ()) -> Graph:
    """Factor out common factors of sums of products: a b + a c becomes a (b + c).

    The factor that saves most products is factored out first. Products that are used several times
    are expanded too if this is not more expensive, because the same bracket may already exist.

    Args:
        graph: graph to transform.
        parameters: names of the inputs that are constant from call to call.
    """
    names = tuple(parameters)
    # among equally cheap forms: the form with expanded products, or the form without
    writers: tuple[Writer, ...] = (
        lambda algebra, polynomial: algebra.cheapest(reversed(_forms(algebra, polynomial))),
        lambda algebra, polynomial: algebra.cheapest(_forms(algebra, polynomial)),
    )
    trials = (rewritten(graph, names, write) for write in writers)
    return min(trials, key=lambda trial: count_graph(trial, names).total)


def _forms(algebra: Algebra, polynomial: Polynomial) -> list[partial[int]]:
    """Return callables that write a polynomial in factored form and return its node.

    The second one, if any, expands products first.
    """
    forms = [partial(_factor, algebra, polynomial)]
    opened = _open_products(algebra, polynomial)
    if opened != polynomial:
        forms.append(partial(_factor, algebra, opened))
    return forms


def _open_products(algebra: Algebra, polynomial: Polynomial) -> Polynomial:
    """Return the polynomial in which factors that are products themselves are expanded."""
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


def _factor(algebra: Algebra, polynomial: Polynomial) -> int:
    """Factor a polynomial greedily, write it as nodes and return the last node.

    The factor that saves most products is factored out first.
    """
    rest = dict(polynomial)
    for _ in range(_MOST_WORK // max(1, len(polynomial))):
        savings = _savings(algebra, rest)
        best = max(savings, key=lambda number: savings[number], default=None)
        if best is None:
            break
        rest = _with_factor(algebra, rest, best)
    return algebra.plain(rest)


def _savings(algebra: Algebra, polynomial: Polynomial) -> Counter[int]:
    """Return the number of products that factoring out a node saves, by node.

    Positive numbers only.
    """
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
    """Return the polynomial in which all multiples of the node `number` are one product."""
    builder, rest = algebra.builder, dict(polynomial)
    bracket: Polynomial = {}
    for monomial, coefficient in polynomial.items():
        quotient = _quotient(algebra, monomial, coefficient, number)
        if quotient:
            del rest[monomial]
            algebra.accumulate(bracket, algebra.opened(quotient).items())
    if bracket:
        product = builder.product(number, _factor(algebra, bracket))
        algebra.accumulate(rest, algebra.indeterminate(product).items())
    return rest


def _quotient(
    algebra: Algebra, monomial: Monomial, coefficient: int, number: int
) -> Polynomial | None:
    """Return the term (monomial times coefficient) divided by the node `number`.

    None if the node is no factor of the term.
    """
    if number in monomial:
        return {without(monomial, number): coefficient}
    sign, unsigned = algebra.builder.unsigned(coefficient)
    if unsigned == number and not algebra.is_unit(coefficient):
        return {monomial: algebra.builder.constant(sign)}
    return None


# Evaluation of constants, and sign changes moved to positions without cost.


def fold(graph: Graph, parameters: Iterable[str] = ()) -> Graph:
    """Evaluate constants, remove 0 and 1, move signs outwards, and merge equal nodes.

    A remaining sign is absorbed by a difference without other uses: -(x - y) becomes y - x.

    Args:
        graph: graph to transform.
        parameters: names of the inputs that are constant from call to call.
    """
    return drop(_reverse_differences(drop(rebuild(graph, Builder(graph, parameters)))))


def _reverse_differences(graph: Graph) -> Graph:
    """Return the graph in which x - y becomes y - x if only its negative is used."""
    negated = {n.args[0] for n in graph.nodes if n.op == casadi.OP_NEG}
    plain = {number for result in graph.results for number in result}
    for number, node in enumerate(graph.nodes):
        if node.op != casadi.OP_NEG:
            plain.update(graph.operands(number))
    reversed_nodes = {
        number for number in negated - plain if graph.nodes[number].op == casadi.OP_SUB
    }
    nodes = list(graph.nodes)
    for number in reversed_nodes:
        a, b = nodes[number].args
        nodes[number] = Node(casadi.OP_SUB, (b, a))
    for number, node in enumerate(nodes):
        if node.op == casadi.OP_NEG and node.args[0] in reversed_nodes:
            nodes[number] = Node(casadi.OP_ASSIGN, node.args)
    return _without_assignments(graph.with_nodes(nodes, graph.results))


def _without_assignments(graph: Graph) -> Graph:
    """Return the graph without assignments: copy propagation, uses refer to the operand."""
    target = list(range(len(graph.nodes)))
    nodes = list(graph.nodes)
    for number, node in enumerate(nodes):
        if node.op == casadi.OP_ASSIGN:
            target[number] = target[node.args[0]]
        elif node.op not in (casadi.OP_INPUT, casadi.OP_CONST):
            nodes[number] = node._replace(args=tuple(target[a] for a in node.args))
    return graph.with_nodes(nodes, [[target[n] for n in result] for result in graph.results])


# Order of operations that keeps few values alive at once.


_LEAVES = (casadi.OP_INPUT, casadi.OP_CONST)

_Rank = Callable[[int], tuple[int, ...]]


def order(graph: Graph, parameters: Iterable[str] = ()) -> Graph:
    """Reorder operations so that fewer values are alive at once; `parameters` has no effect.

    Outputs are computed in order. Operands of commutative operations are exchanged so that the
    depth-first traversal of CasADi finds the same order.

    Source: Sethi & Ullman 1970; a shared node belongs to its first use.

    Args:
        graph: graph to transform.
        parameters: names of inputs, not used.
    """
    graph = drop(graph)
    room = _registers(graph)
    deep = _depth(graph)
    ranks: list[_Rank] = [
        lambda number: (-room[number], number),
        lambda number: (-deep[number], number),
        lambda number: (room[number], number),
        lambda number: (number,),
    ]
    trials = [_depth_first(graph, rank) for rank in ranks]
    return min([*trials, graph], key=waiting)


def waiting(graph: Graph) -> int:
    """Return the largest number of values that are alive at once, without inputs and constants.

    Args:
        graph: graph whose nodes are evaluated in order.
    """
    last = list(range(len(graph.nodes)))
    for number in range(len(graph.nodes)):
        for operand in graph.operands(number):
            last[operand] = number
    kept = most = 0
    for number, node in enumerate(graph.nodes):
        if node.op not in _LEAVES:
            ended = {a for a in graph.operands(number) if last[a] == number}
            kept -= sum(1 for a in ended if graph.nodes[a].op not in _LEAVES)
            kept += last[number] > number
            most = max(most, kept)
    return most


def _registers(graph: Graph) -> list[int]:
    """Return the Sethi-Ullman number of each node: registers it needs if no node were shared."""
    room: list[int] = []
    for number, node in enumerate(graph.nodes):
        needs = sorted((room[a] for a in graph.operands(number)), reverse=True)
        own = 0 if node.op in _LEAVES else 1
        room.append(max([own, *(need + k for k, need in enumerate(needs))]))
    return room


def _depth(graph: Graph) -> list[int]:
    """Return for each node the number of operations on the longest path to it from a leaf."""
    depth: list[int] = []
    for number in range(len(graph.nodes)):
        depth.append(max((depth[a] + 1 for a in graph.operands(number)), default=0))
    return depth


def _depth_first(graph: Graph, rank: _Rank) -> Graph:
    """Return the graph in depth-first order from the outputs.

    `rank` maps a node index to a sort key; commutative operands of lower rank are computed first.
    """
    operands = [graph.operands(number) for number in range(len(graph.nodes))]
    for number, node in enumerate(graph.nodes):
        if node.op in COMMUTATIVE:
            operands[number] = tuple(sorted(operands[number], key=rank))
    numbers: dict[int, int] = {}
    nodes: list[Node] = []
    stack = [number for result in reversed(graph.results) for number in reversed(result)]
    while stack:
        number = stack[-1]
        missing = [a for a in operands[number] if a not in numbers]
        if missing and number not in numbers:
            stack.append(missing[0])
            continue
        stack.pop()
        if number not in numbers:
            node = graph.nodes[number]
            if node.op not in _LEAVES:
                node = node._replace(args=tuple(numbers[a] for a in operands[number]))
            numbers[number] = len(nodes)
            nodes.append(node)
    return graph.with_nodes(nodes, [[numbers[n] for n in result] for result in graph.results])


# Products and sums of parameters, which need to be computed only once.


def parameters(graph: Graph, parameters: Iterable[str] = ()) -> Graph:
    """Reassociate products and sums so that parameter-only factors and terms are combined.

    c1 (x c2) becomes (c1 c2) x, c1 x + c2 x becomes (c1 + c2) x, and c1 (c2 x + c3 y) becomes (c1
    c2) x + (c1 c3) y. Values with other uses are not computed a second time.

    Args:
        graph: graph to transform.
        parameters: names of the inputs that are constant from call to call.
    """
    return rewritten(graph, parameters, _gather)


def _gather(algebra: Algebra, polynomial: Polynomial) -> int:
    """Write the cheaper form of a polynomial, with or without expanded sums; return the node."""
    opened = _expanded_sums(algebra, polynomial)
    forms = [polynomial] if opened == polynomial else [polynomial, opened]
    return algebra.cheapest([partial(algebra.plain, form) for form in forms])


def _expanded_sums(algebra: Algebra, polynomial: Polynomial) -> Polynomial:
    """Expand the terms of a polynomial that are sums and have a monomial in common with it."""
    total = dict(polynomial)
    for monomial, coefficient in polynomial.items():
        inside = algebra.written.get(monomial[0], {}) if len(monomial) == 1 else {}
        if any(inner in total for inner in inside):
            algebra.accumulate(total, [(monomial, algebra.builder.negative(coefficient))])
            algebra.accumulate(total, algebra.scaled(inside, coefficient).items())
    return total


# sin^2 + cos^2 = 1.


def pythagoras(graph: Graph, parameters: Iterable[str] = ()) -> Graph:
    """Reduce squares of sines and cosines: s s x + c c x becomes x, x - s s x becomes c c x.

    With different coefficients, p1 s s x + p2 c c x becomes p1 x + (p2 - p1) c c x. Rotations of a
    vector back and forth thus cancel. Each angle is tried separately. The result is kept if the
    graph is cheaper.

    Args:
        graph: graph to transform.
        parameters: names of the inputs that are constant from call to call.
    """
    return improved(graph, parameters, _reduce, lambda pair: pair[0] == pair[1])


def _reduce(pair: Pair, algebra: Algebra, polynomial: Polynomial) -> Polynomial:
    """Reduce the squares of sine and cosine of the angle `pair[0]` where this saves operations.

    Return `polynomial` itself if nothing changes.
    """
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
    """Return the cheapest equal form of a polynomial by c c + s s = 1, for one common factor.

    `number` is a sine or cosine node of the angle, and `rest` the common factor of the terms rest,
    c c rest and s s rest.
    """
    builder = algebra.builder
    argument = builder.nodes[number].args[0]
    squares = [
        tuple(sorted((*rest, *[builder.apply(op, argument)] * 2)))
        for op in (casadi.OP_COS, casadi.OP_SIN)
    ]
    minus = builder.constant(-1.0)
    forms = [polynomial]
    for gone, other in (squares, squares[::-1]):
        if gone in polynomial:
            form = dict(polynomial)
            coefficient = form.pop(gone)
            opposite = builder.product(minus, coefficient)
            algebra.accumulate(form, [(rest, coefficient), (other, opposite)])
            forms.append(form)
    return min(forms, key=algebra.cost)


# Common parts of sums and products.


_SUMS = {casadi.OP_ADD, casadi.OP_SUB}
_PRODUCTS = {casadi.OP_MUL}
_LONGEST_OPENED = (1, 8)


def share(graph: Graph, parameters: Iterable[str] = ()) -> Graph:
    """Reassociate sums and products so that their common parts are computed once.

    Sums are sets of signed terms and products are sets of factors. The pair of elements that occurs
    in most sets becomes a node, until no pair occurs twice. Source: Breuer 1969, generation of
    optimal code for expressions via factorization.

    Args:
        graph: graph to transform.
        parameters: names of the inputs that are constant from call to call.
    """
    names = tuple(parameters)
    graph = fold(graph, names)
    for ops in (_PRODUCTS, _SUMS):
        trials = (fold(_associate(graph, names, ops, n), names) for n in _LONGEST_OPENED)
        graph = min([graph, *trials], key=lambda trial: count_graph(trial, names).total)
    return graph


def _associate(graph: Graph, parameters: tuple[str, ...], ops: set[int], longest: int) -> Graph:
    """Reassociate the sums or the products of a graph.

    Args:
        graph: graph after `fold`.
        parameters: names of the inputs that are parameters.
        ops: operations to reassociate, `_SUMS` or `_PRODUCTS`.
        longest: largest number of elements of a group that is expanded although it has other uses.
    """
    fixed = graph.fixed_by(parameters)
    groups = _merged_groups(graph, ops, fixed, longest)
    known: dict[int, Group] = {}
    for group in groups.values():
        _gather_fixed(group, fixed, known, len(graph.nodes))
    taken = len(graph.nodes) + len(known)
    extract_pairs(groups, taken)
    return _write(graph, {**groups, **known}, Builder(graph, parameters), ops)


def _merged_groups(
    graph: Graph, ops: set[int], fixed: list[bool], longest: int
) -> dict[int, Group]:
    """Return the terms of each sum, or the factors of each product, by node index.

    Sums within sums, used once or short, are merged. `ops` are the operations, `fixed` marks nodes
    of parameters alone, and `longest` is the size up to which a group with other uses is merged.
    """
    uses = graph.uses()
    groups: dict[int, Group] = {}
    part_of_another: set[int] = set()
    for number, node in enumerate(graph.nodes):
        if node.op not in ops or fixed[number]:
            continue
        signs = (1, -1 if node.op == casadi.OP_SUB else 1)
        for opened in ((0, 1), (0,), (1,), ()):
            parts = [
                _group_elements(groups, operand, position in opened, uses[operand] == 1, longest)
                for position, operand in enumerate(node.args)
            ]
            if not set(parts[0]) & set(parts[1]):
                break
        first, second = (
            part if sign > 0 else {e: -s for e, s in part.items()}
            for part, sign in zip(parts, signs, strict=True)
        )
        groups[number] = {**first, **second}
        part_of_another.update(
            a for k, a in enumerate(node.args) if k in opened and a in groups and uses[a] == 1
        )
    return {number: group for number, group in groups.items() if number not in part_of_another}


def _group_elements(
    groups: dict[int, Group], number: int, opened: bool, alone: bool, longest: int
) -> Group:
    """Return the elements of the operand `number`: its own group if it is merged, else itself.

    `opened` is whether it may be merged, `alone` whether it has no other use, and `longest` the
    size up to which a group with other uses is merged.
    """
    group = groups.get(number)
    if not opened or group is None or (not alone and len(group) > longest):
        return {number: 1}
    return group


def _gather_fixed(group: Group, fixed: list[bool], known: dict[int, Group], first: int) -> None:
    """Replace the parameter-only elements of a group by one new group, in place.

    The new group is added to `known` under the next index after `first`. `fixed` marks
    parameter-only nodes.
    """
    together = {e: s for e, s in group.items() if fixed[e]}
    if len(together) < 2:
        return
    for element in together:
        del group[element]
    name = first + len(known)
    known[name] = together
    group[name] = 1


def _write(graph: Graph, groups: dict[int, Group], builder: Builder, ops: set[int]) -> Graph:
    """Return the graph in which each group is computed element by element.

    Groups are sums or products, according to `ops`.
    """
    numbers: dict[int, int] = {}

    def write(name: int) -> None:
        group = groups.get(name)
        if group is None:
            operands = [numbers[a] for a in graph.operands(name)]
            numbers[name] = builder.add(graph.nodes[name], operands)
            return
        combine = builder.sum if ops is _SUMS else builder.product
        total = builder.constant(0.0 if ops is _SUMS else 1.0)
        for element, sign in group.items():
            value = numbers[element]
            total = combine(total, value if sign > 0 else builder.negative(value))
        numbers[name] = total

    for name in _operands_first(graph, groups):
        write(name)
    results = [[numbers[n] for n in result] for result in graph.results]
    return graph.with_nodes(builder.nodes, results)


def _operands_first(graph: Graph, groups: dict[int, Group]) -> Iterator[int]:
    """Yield the indices of nodes and groups that the outputs need, operands first."""
    done: set[int] = set()
    stack = [number for result in reversed(graph.results) for number in reversed(result)]
    while stack:
        name = stack[-1]
        operands = groups[name] if name in groups else graph.operands(name)
        waiting = [operand for operand in operands if operand not in done]
        if name in done or not waiting:
            stack.pop()
            if name not in done:
                done.add(name)
                yield name
        else:
            stack.extend(reversed(waiting))
