"""How the outputs of a function depend on each of its inputs: by a constant factor, or by others.

Every scalar operation hands on which inputs its result depends on, and of what kind the factor is.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Literal

import casadi

DependencyKind = Literal["constant", "fixed", "tunable", "discrete", "dependent"]
KINDS: tuple[DependencyKind, ...] = ("constant", "fixed", "tunable", "discrete", "dependent")
"""Least to greatest: a sum has the greatest kind of its terms."""

_WORST = len(KINDS) - 1
_Masks = tuple[int, ...]
"""For each kind the inputs of that kind or a greater one, as bits; the first holds all."""

_NONE: _Masks = (0,) * len(KINDS)
_SUMS = (casadi.OP_ADD, casadi.OP_SUB)
_SCALED = (casadi.OP_NEG, casadi.OP_TWICE, casadi.OP_ASSIGN)


def linearity(
    function: casadi.Function, levels: Sequence[DependencyKind]
) -> list[list[dict[int, DependencyKind]]]:
    """What every element of every output depends on, and how.

    An input that enters by a factor is as "constant", "fixed", "tunable" or "discrete" as the
    factor; in every other way it is "dependent". Where the function is no graph of scalars, all
    that the sparsity shows is "dependent".

    Args:
        function: any.
        levels: for each element of all inputs, in order, what it is as a factor of others.

    Returns:
        for each output and each element of it, numbers of the elements of all inputs, and kinds.
    """
    if not function.is_a("SXFunction"):
        return _by_sparsity(function)
    weights = [KINDS.index(level) for level in levels]
    found = _walk(function, _levels_of(weights))
    return [[_read(masks) for masks in rows] for rows in found]


def _walk(function: casadi.Function, level: Callable[[int], int]) -> list[list[_Masks]]:
    work = [_NONE] * function.sz_w()
    sizes = [function.numel_in(k) for k in range(function.n_in())]
    first = [sum(sizes[:k]) for k in range(len(sizes))]
    places_in = [_places(function.sparsity_in(k)) for k in range(function.n_in())]
    places_out = [_places(function.sparsity_out(k)) for k in range(function.n_out())]
    answer = [[_NONE] * function.numel_out(k) for k in range(function.n_out())]
    for k in range(function.n_instructions()):
        op, out = function.instruction_id(k), function.instruction_output(k)
        given = function.instruction_input(k)
        if op == casadi.OP_INPUT:
            bit = 1 << (first[given[0]] + places_in[given[0]][given[1]])
            work[out[0]] = (bit, *_NONE[1:])
        elif op == casadi.OP_OUTPUT:
            answer[out[0]][places_out[out[0]][out[1]]] = work[given[0]]
        elif op == casadi.OP_CONST:
            work[out[0]] = _NONE
        else:
            work[out[0]] = _combined(op, [work[i] for i in given], level)
    return answer


def _combined(op: int, terms: list[_Masks], level: Callable[[int], int]) -> _Masks:
    a, b = terms[0], terms[-1]
    if op in _SCALED:
        return a
    if op in _SUMS:
        return _sum(a, b)
    if op == casadi.OP_MUL:
        return _product(a, b, level)
    if op == casadi.OP_DIV:
        return _product(a, _bent(b), level)
    if op == casadi.OP_IF_ELSE_ZERO:
        return _product(_bent(a), b, level)
    return _sum(_bent(a), _bent(b))


def _sum(a: _Masks, b: _Masks) -> _Masks:
    return tuple(x | y for x, y in zip(a, b, strict=True))


def _bent(a: _Masks) -> _Masks:
    """All of it as through a function that is not linear."""
    return (a[0],) * len(KINDS)


def _product(a: _Masks, b: _Masks, level: Callable[[int], int]) -> _Masks:
    """Each factor is as constant as the other one; what is in both is not linear."""
    both = a[0] & b[0]
    raised = _sum(_raised(a, level(b[0])), _raised(b, level(a[0])))
    return tuple(mask | both for mask in raised)


def _raised(a: _Masks, kind: int) -> _Masks:
    return tuple(a[0] if k <= kind else mask for k, mask in enumerate(a))


def _levels_of(weights: Sequence[int]) -> Callable[[int], int]:
    """What a set of inputs is as a factor: the greatest of its members."""
    groups = [sum(1 << k for k, w in enumerate(weights) if w == kind) for kind in range(len(KINDS))]

    def level(mask: int) -> int:
        return next((kind for kind in range(_WORST, 0, -1) if mask & groups[kind]), 0)

    return level


def _places(pattern: casadi.Sparsity) -> list[int]:
    """The element that each nonzero is, counted column by column."""
    rows, columns = pattern.get_triplet()
    return [r + c * pattern.size1() for r, c in zip(rows, columns, strict=True)]


def _read(masks: _Masks) -> dict[int, DependencyKind]:
    found: dict[int, DependencyKind] = {}
    for kind, mask in zip(KINDS, masks, strict=True):
        while mask:
            bit = mask & -mask
            found[bit.bit_length() - 1] = kind
            mask ^= bit
    return dict(sorted(found.items()))


def _by_sparsity(function: casadi.Function) -> list[list[dict[int, DependencyKind]]]:
    answer: list[list[dict[int, DependencyKind]]] = []
    for output in range(function.n_out()):
        rows: list[dict[int, DependencyKind]] = [{} for _ in range(function.numel_out(output))]
        first = 0
        for k in range(function.n_in()):
            pattern = function.jac_sparsity(output, k)
            for row, column in zip(*pattern.get_triplet(), strict=True):
                rows[row][first + column] = "dependent"
            first += function.numel_in(k)
        answer.append(rows)
    return answer
