"""Derivatives of accelerations in two stages: one front, then the same solution for each column."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate
from typing import NamedTuple

import casadi
from casadi import DM, MX, SX, Function

from mbs.assembly import System
from mbs.models.slopes import efforts_by_recursion
from mbs.models.symbols import symbols_of
from mbs.recursions.tree_factorization import velocity_antecedents


class TreeFactor(NamedTuple):
    """A = L' D L of a tree's inertia matrix.

    Attributes:
        ratios: for each velocity, the last first, and each of its ancestors, the nearest first,
            minus the element of L.
        inverse: 1 / D.
    """

    ratios: SX
    inverse: SX


def factorized(A: SX, before: list[int]) -> TreeFactor:
    """The factors of A.

    Source: Featherstone 2008, section 6.5 (LTDL).

    Args:
        A: (n, n) symmetric, with A[i, j] zero unless one of i, j is an ancestor of the other.
        before: for each row its ancestor, or -1; ancestors have smaller numbers.
    """
    H, n = SX(A), A.shape[0]
    ratios: list[SX] = []
    inverse = [SX(0)] * n
    for k in reversed(range(n)):
        minus = -1 / H[k, k]
        inverse[k] = -minus
        path = _path(before, k)
        for place, i in enumerate(path):
            ratio = H[k, i] * minus
            for j in path[place:]:
                H[i, j] += ratio * H[k, j]
            ratios.append(ratio)
    return TreeFactor(casadi.vertcat(*ratios), casadi.vertcat(*inverse))


def solve_column(before: list[int]) -> Function:
    """``solve_column(ratios, inverse, right) -> x``: the solution of A x = right.

    Args:
        before: as of `factorized`.

    Returns:
        Function of the factors and one column.
    """
    n = len(before)
    paths = [_path(before, k) for k in range(n)]
    ratios = SX.sym("ratios", sum(map(len, paths)))
    inverse, right = SX.sym("inverse", n), SX.sym("right", n)
    x, place, ratio = casadi.vertsplit(right), 0, {}
    for k in reversed(range(n)):
        for i in paths[k]:
            ratio[k, i] = ratios[place]
            x[i] += ratio[k, i] * x[k]
            place += 1
    for k in range(n):
        x[k] *= inverse[k]
        for i in reversed(paths[k]):
            x[k] += ratio[k, i] * x[i]
    names = ["ratios", "inverse", "right"], ["x"]
    return Function("solve_column", [ratios, inverse, right], [casadi.vertcat(*x)], *names)


def staged_accelerations(system: System, names: Sequence[str]) -> tuple[list[MX], list[MX]]:
    """Derivatives of the accelerations of a tree.

    Args:
        system: its coordinates are those of the tree.
        names: what to differentiate with respect to, of "q", "v", "tau" and "p".

    Returns:
        the inputs q, v, tau and, of a system with parameters, p; then the derivatives in the
        order of the names, and the accelerations.
    """
    before = velocity_antecedents(system.tree)
    solve = solve_column(before)
    order = [name for name in names if name != "tau"]
    front = _front(system, order, before, solve)
    inputs = [MX.sym(front.name_in(k), front.size_in(k)) for k in range(front.n_in())]
    ratios, inverse, a, *right = front.call(inputs)
    if "tau" in names:
        order, right = [*order, "tau"], [*right, MX(DM.eye(system.nv))]
    sides = casadi.densify(casadi.horzcat(*right))
    every = solve.map("solve_columns", "serial", sides.shape[1], [0, 1], [])
    ends = [0, *accumulate(side.shape[1] for side in right)]
    columns = casadi.horzsplit(every(ratios, inverse, sides), ends)
    blocks = dict(zip(order, columns, strict=True))
    if "tau" in names:
        blocks["tau"] = casadi.triu2symm(casadi.triu(blocks["tau"]))
    return inputs, [*(blocks[name] for name in names), a]


def _front(system: System, names: Sequence[str], before: list[int], solve: Function) -> Function:
    """Factors of A, accelerations, and the right-hand sides of their derivatives."""
    s = symbols_of(system, "tree")
    tau, symbol = SX.sym("tau", s.size), SX.sym("a", s.size)
    slopes, efforts = efforts_by_recursion(system, s, symbol)
    factor = factorized(slopes.pop("a"), before)
    if "p" in names:
        slopes["p"] = casadi.jacobian(efforts, system.p)
    a = solve(*factor, tau - casadi.substitute(efforts, symbol, SX.zeros(s.size)))
    sides = casadi.substitute([-SX(slopes[name]) for name in names], [symbol], [a])
    inputs = [s.q, s.v, tau, *([system.p] if system.parameters else [])]
    labels = ["q", "v", "tau", "p"][: len(inputs)]
    outputs = [*factor, a, *map(casadi.densify, sides)]
    results = ["ratios", "inverse", "a", *(f"minus_dtau_d{name}" for name in names)]
    return Function("front", inputs, outputs, labels, results, {"cse": True})


def _path(before: list[int], k: int) -> list[int]:
    """The ancestors of a velocity, the nearest first."""
    path = []
    while before[k] >= 0:
        k = before[k]
        path.append(k)
    return path
