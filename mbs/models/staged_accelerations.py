"""Derivatives of accelerations in two stages: one front, then the same solution for each column."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate

import casadi
from casadi import DM, MX, SX, Function

from mbs.assembly import System
from mbs.models.slopes import implicit_formula
from mbs.models.symbols import symbols_of
from mbs.recursions.tree_factorization import (
    factor_symbols,
    substituted,
    velocity_antecedents,
)


def solve_column(before: list[int]) -> Function:
    """``solve_column(ratios, inverse, right) -> x``: the solution of A x = right.

    Args:
        before: as of `factorized`.

    Returns:
        Function of the factors and one column.
    """
    factor, right = factor_symbols(before), SX.sym("right", len(before))
    names = ["ratios", "inverse", "right"], ["x"]
    return Function("solve_column", [*factor, right], [substituted(factor, right, before)], *names)


def staged_accelerations(system: System, names: Sequence[str]) -> tuple[list[MX], list[MX]]:
    """Derivatives of the accelerations of a tree.

    Args:
        system: its coordinates are those of the tree.
        names: what to differentiate with respect to, of "q", "v", "tau" and "p".

    Returns:
        the inputs q, v, tau and, of a system with parameters, p; then the derivatives in the
        order of the names, and the accelerations.
    """
    solve = solve_column(velocity_antecedents(system.tree))
    order = [name for name in names if name != "tau"]
    front = _front(system, order)
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


def _front(system: System, names: Sequence[str]) -> Function:
    """Factors of A, accelerations, and the right-hand sides of their derivatives."""
    s = symbols_of(system, "tree")
    tau = SX.sym("tau", s.size)
    factor, a, sides = implicit_formula(system, s, tau, names)
    inputs = [s.q, s.v, tau, *([system.p] if system.parameters else [])]
    labels = ["q", "v", "tau", "p"][: len(inputs)]
    results = ["ratios", "inverse", "a", *(f"minus_dtau_d{name}" for name in sides)]
    return Function("front", inputs, [*factor, a, *sides.values()], labels, results, {"cse": True})
