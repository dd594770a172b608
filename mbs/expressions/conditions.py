"""Conditions in the graphs of laws, and the parts of laws that depend on time alone."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import casadi
from casadi import SX

_BENDS = (casadi.OP_FABS, casadi.OP_FMIN, casadi.OP_FMAX)
"""Operations that are continuous, and whose slope jumps."""


@dataclass(frozen=True, slots=True, eq=False)
class LawConditions:
    """What decides between the pieces of a law.

    Attributes:
        sides: (n, 1) values whose sign decides.
        counts: (m, 1) values whose integer part decides.
    """

    sides: SX
    counts: SX

    def __add__(self, other: LawConditions) -> LawConditions:
        """The conditions of two laws."""
        return LawConditions(
            casadi.vertcat(self.sides, other.sides), casadi.vertcat(self.counts, other.counts)
        )


def law_conditions(law: SX, t: SX, x: SX) -> LawConditions:
    """The conditions in a law that time or states decide, each of them once.

    Comparisons, signs and angles have sides. Integer parts and remainders have counts. Equalities
    hold at single points only and are left out. Absolute, smallest and largest values bend a law,
    which error control sees in states; in time they have sides too.

    Args:
        law: expressions.
        t: symbol of the time.
        x: symbols of states.
    """
    found: dict[tuple[str, int], SX] = {}
    for kind, value in _conditions(law):
        by_state = casadi.depends_on(value, x)
        if by_state and kind == "bend":
            continue
        if by_state or casadi.depends_on(value, t):
            wanted = "count" if kind == "count" else "side"
            found.setdefault((wanted, value.element_hash()), value)
    sides, counts = (
        casadi.vertcat(SX(0, 1), *(value for (kind, _), value in found.items() if kind == wanted))
        for wanted in ("side", "count")
    )
    return LawConditions(sides, counts)


def time_parts(law: SX, t: SX, others: SX) -> SX:
    """(n, 1) the largest parts of a law that depend on time and on none of the others.

    Args:
        law: expressions.
        t: symbol of the time.
        others: symbols that change along a motion as well.
    """
    changing = {symbol.element_hash() for symbol in _scalars(others)}
    time = t.element_hash()
    known: dict[int, tuple[bool, bool]] = {}  # whether a node depends on time, on others
    parts: dict[int, SX] = {}
    roots = _scalars(law)
    stack = list(roots)
    while stack:
        node = stack[-1]
        name = node.element_hash()
        operands = [] if node.is_leaf() else [node.dep(k) for k in range(node.n_dep())]
        unknown = [one for one in operands if one.element_hash() not in known]
        if name not in known and unknown:
            stack += unknown
            continue
        stack.pop()
        if name in known:
            continue
        found = [known[one.element_hash()] for one in operands]
        moves = name in changing or any(other for _, other in found)
        known[name] = name == time or any(timed for timed, _ in found), moves
        if moves:
            parts |= {
                one.element_hash(): one
                for one, (timed, other) in zip(operands, found, strict=True)
                if timed and not other
            }
    whole = {one.element_hash(): one for one in roots if known[one.element_hash()] == (True, False)}
    return casadi.vertcat(SX(0, 1), *{**parts, **whole}.values())


def _scalars(law: SX) -> list[SX]:
    """The elements that are no structural zeros."""
    return [SX(law.nz[k]) for k in range(law.nnz())]


def _conditions(law: SX) -> Iterator[tuple[str, SX]]:
    """Kinds and values of all conditions, those of the same nodes once."""
    seen: set[int] = set()
    left = _scalars(law)
    while left:
        node = left.pop()
        if node.is_leaf() or node.element_hash() in seen:
            continue
        seen.add(node.element_hash())
        operands = [node.dep(k) for k in range(node.n_dep())]
        left += operands
        yield from _of_node(node.op(), operands)


def _of_node(operation: int, operands: list[SX]) -> Iterator[tuple[str, SX]]:
    if operation in (casadi.OP_LT, casadi.OP_LE):
        yield "side", operands[1] - operands[0]
    elif operation == casadi.OP_SIGN:
        yield "side", operands[0]
    elif operation == casadi.OP_COPYSIGN:
        yield "side", operands[1]
    elif operation == casadi.OP_ATAN2:  # it jumps at half a turn
        yield "side", casadi.if_else(operands[1] < 0, operands[0], 1)
    elif operation in _BENDS:
        yield "bend", operands[0] - operands[1] if len(operands) > 1 else operands[0]
    elif operation == casadi.OP_FLOOR:
        yield "count", operands[0]
    elif operation == casadi.OP_CEIL:
        yield "count", -operands[0]
    elif operation == casadi.OP_FMOD:  # the integer part is taken towards zero
        ratio = operands[0] / operands[1]
        yield "side", ratio
        yield "count", casadi.fabs(ratio)
    elif operation == casadi.OP_REMAINDER:  # the quotient is rounded
        yield "count", operands[0] / operands[1] + 0.5
