"""Symbolic solution of constrained equations: A x - J' y = b, J x + C y = d.

The matrix of both is factorised as L D L' in an order that is fixed once: a row of J comes after
the columns that it acts on, so that no pivot vanishes where A is positive definite and the rows
are independent; within this rule the element with the fewest neighbours is next, so that what is
sparse stays sparse.

Source: Tinney and Walker 1967 for the order; Benzi, Golub and Liesen 2005 for the equations.
"""

from __future__ import annotations

import casadi
from casadi import SX, Sparsity

_SINGULAR = 1e-12
"""What is added to J A^-1 J', relative to 1 / scale: finite where rows become dependent."""
_SHARED = 1e-8
"""Likewise for rows that are switched, which are dependent as a rule."""


def solve_saddle(
    A: SX,
    J: SX,
    b: SX,
    d: SX,
    scale: float,
    corner: SX | None = None,
    penalty: float | None = None,
) -> tuple[SX, SX]:
    """The x and y of A x - J' y = b, J x + C y = d, with a diagonal C that is zero as a rule.

    A multiple of J'J is added to A, which changes no solution and is regular where A alone is
    not, as massless links make it. One refinement restores the digits that nearly dependent rows
    cost.
    A row with a structural element in C is a switch: it acts where that is zero, and does not where
    that is positive and the row of J and d are zero. Switched rows that depend on others share
    their y.

    Args:
        A: (n, n) symmetric, positive definite where J x = 0, everywhere if the penalty is zero.
        J: (m, n) independent rows.
        b: (n, 1).
        d: (m, 1).
        scale: makes scale * J'J as large as A.
        corner: (m, 1) the diagonal of C, sparse; the unit of its elements is that of 1 / scale.
        penalty: how many times J'J is added to A; the scale when left out.

    Returns:
        x (n, 1) and y (m, 1).
    """
    n, m = J.shape[1], J.shape[0]
    J = casadi.sparsify(J)
    weighted = (scale if penalty is None else penalty) * J.T
    K = casadi.sparsify(A) + casadi.sparsify(casadi.mtimes(weighted, J))
    C = SX(m, 1) if corner is None else corner
    last = SX(m, m)
    for row in range(m):
        last[row, row] = -C[row] - (_SHARED if C.sparsity().has_nz(row, 0) else _SINGULAR) / scale
    whole = casadi.vertcat(casadi.horzcat(K, J.T), casadi.horzcat(J, last))
    order = elimination_order(whole.sparsity(), n)
    D, LT, _ = casadi.ldl(whole[order, order], False)
    places = [order.index(k) for k in range(n + m)]

    def solve(right: SX) -> SX:
        ordered = casadi.ldl_solve(casadi.densify(right)[order], D, LT, list(range(n + m)))
        return casadi.densify(ordered)[places]

    first = solve(casadi.vertcat(b + casadi.mtimes(weighted, d), d))
    missing = d - casadi.mtimes(J, first[:n])
    if corner is not None:
        missing += corner * first[n:]
    second = solve(casadi.vertcat(SX.zeros(n), missing))
    found = first + second
    return found[:n], -found[n:]


def elimination_order(pattern: Sparsity, n: int) -> list[int]:
    """An order of elimination: fewest neighbours first, a row of J after its columns.

    Args:
        pattern: of the symmetric matrix [A J'; J C].
        n: size of A.
    """
    columns, rows = pattern.get_triplet()[1], pattern.get_triplet()[0]
    neighbours: list[set[int]] = [set() for _ in range(pattern.size1())]
    for row, column in zip(rows, columns, strict=True):
        if row != column:
            neighbours[column].add(row)
    waits = [
        {k for k in near if k < n} if own >= n else set() for own, near in enumerate(neighbours)
    ]
    left = set(range(len(neighbours)))
    order = []
    while left:
        pivot = min((k for k in left if not waits[k]), key=lambda k: (len(neighbours[k]), k))
        order.append(pivot)
        left.remove(pivot)
        near = neighbours[pivot]
        for k in near:
            neighbours[k] = (neighbours[k] | near) - {k, pivot}
        for k in left:
            waits[k].discard(pivot)
    return order
