"""Symbolic solution of linear systems: small systems, constrained systems, Newton steps."""

from __future__ import annotations

from typing import Any

import casadi
from casadi import MX, SX, Function, Sparsity


def solve_square(A: SX, B: SX) -> SX:
    """Return the solution X (n, m) of A X = B for a regular (n, n) matrix A and B (n, m).

    Up to three equations are solved by the adjugate (one division), larger systems by QR on the
    blocks that the sparsity couples. The result is not finite if A is singular.
    """
    n = A.shape[0]
    if n == 0:
        return SX(0, B.shape[1])
    if n > 3:
        return casadi.densify(casadi.solve(casadi.sparsify(A), B))
    adjugate = _adjugate(casadi.densify(A))
    determinant = casadi.mtimes(A[0, :], adjugate[:, 0])
    return casadi.mtimes(adjugate, B) / determinant


def _adjugate(A: SX) -> SX:
    """Return the adjugate of a matrix A with one to three rows: A^-1 times its determinant."""
    match A.shape[0]:
        case 1:
            return SX(1)
        case 2:
            return casadi.vertcat(
                casadi.horzcat(A[1, 1], -A[0, 1]), casadi.horzcat(-A[1, 0], A[0, 0])
            )
    rows = [A[k, :].T for k in range(3)]
    return casadi.horzcat(
        casadi.cross(rows[1], rows[2]),
        casadi.cross(rows[2], rows[0]),
        casadi.cross(rows[0], rows[1]),
    )


# L D L' factors of symmetric matrices with nearly dependent rows.


def partial_ldl(S: SX, least: SX) -> tuple[SX, SX, list[int], SX]:
    """Return L D L' factors of a symmetric matrix S, without rows whose pivots are too small.

    Omitted rows depend nearly on others. The result has the form of `casadi.ldl`.

    The remainder of a nearly dependent row is rounding error, and so is its pivot. A division would
    spread numbers of the size of one to all later rows and make their solution wrong. Such a row is
    omitted from L, as if S did not contain it.

    Source: Davis 2006, section 4.8, for the order of the sums.

    Args:
        S: (n, n) symmetric, positive semidefinite.
        least: (n, 1) lower limit of the pivot of each row of S.

    Returns:
        D (n, 1), L' without its diagonal (n, n) and the order p of the rows, so that S[p, p] = L D
        L', as `casadi.ldl_solve` requires; and in this order whether the pivot is large enough (n,
        1). For an omitted row, D is the rounding error that remains of it.
    """
    pattern, order = S.sparsity().ldl()
    W, least = S[order, order], casadi.densify(least)[order]
    n = S.shape[0]
    columns = [pattern.row()[pattern.colind()[k] : pattern.colind()[k + 1]] for k in range(n)]
    LT = SX(pattern)
    D, good, inverse = list[SX](), list[SX](), list[SX]()
    for j, above in enumerate(columns):
        # row j of L D, then of L, from the previous columns; U_ij = L_ji D_i
        U = dict[int, SX]()
        pivot = W[j, j]
        for i in above:
            both = [k for k in columns[i] if k in U]
            U[i] = W[i, j] - sum((LT[k, i] * U[k] for k in both), SX(0))
            LT[i, j] = U[i] * inverse[i]
            pivot -= LT[i, j] * U[i]
        D.append(pivot)
        good.append(least[j] < pivot)
        inverse.append(casadi.if_else(good[j], 1 / pivot, 0))
    return casadi.vertcat(*D), LT, order, casadi.vertcat(*good)


# Symbolic solution of constrained equations: A x - J' y = b, J x + C y = d.
#
# The matrix of both equations is factorised as L D L' in a fixed order. A row of J comes after the
# columns in which it is non-zero, so that no pivot vanishes if A is positive definite and the rows
# are independent. Among the remaining choices, the element with the fewest neighbours is next,
# which preserves sparsity.
#
# Source: Tinney and Walker 1967 for the order; Benzi, Golub and Liesen 2005 for the equations.


_SINGULAR = 1e-12
"""Regularisation added to J A^-1 J', relative to 1 / scale: finite if rows become dependent."""
_SHARED = 1e-8
"""The same regularisation for switched rows, which are usually dependent."""


def solve_saddle(
    A: SX,
    J: SX,
    b: SX,
    d: SX,
    scale: float,
    corner: SX | None = None,
    penalty: float | None = None,
) -> tuple[SX, SX]:
    """Return x and y of A x - J' y = b, J x + C y = d, with a diagonal C that is usually zero.

    A multiple of J'J is added to A. This does not change the solution and is regular if A alone is
    singular, for example because of massless links. One refinement restores the digits that are
    lost by nearly dependent rows.
    A row with a structural element in C is a switch. It is active if the element is zero. It is
    inactive if the element is positive and the row of J and d are zero. Switched rows that are
    linearly dependent share their y.

    Args:
        A: (n, n) symmetric, positive definite on the null space of J; positive definite if the
            penalty is zero.
        J: (m, n) independent rows.
        b: (n, 1) right-hand side of the first equation.
        d: (m, 1) right-hand side of the constraints.
        scale: factor that makes scale * J'J as large as A.
        corner: (m, 1) diagonal of C, sparse; its elements have the unit of 1 / scale.
        penalty: multiple of J'J that is added to A. Default: scale.

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
    return found[:n, :], -found[n:, :]  # y is (0, 1) without constraints


def elimination_order(pattern: Sparsity, n: int) -> list[int]:
    """Return the order in which the rows of a symmetric matrix are eliminated.

    The row with the fewest neighbours is next, and a row of J comes after its columns.

    Args:
        pattern: sparsity of the symmetric matrix [A J'; J C].
        n: number of rows of A.
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


# Step of Newton's method as a Function with the derivatives of the solution.


def newton_step(rows: Function, slopes: Function) -> Function:
    """Return a Newton step as a Function with the exact derivatives of the solution.

    It is ``closure(x, z, p) -> (z_next, residual)`` with z_next = z - J^-1 r.

    Its derivatives treat J as constant. At r = 0 the derivatives of z_next by x and p are then the
    exact derivatives of the solution, -J^-1 dr, without second derivatives. Elsewhere they are
    approximate.

    Args:
        rows: `rows(x, z, p) -> (r, residual)`: n equations r (n, 1) for n unknowns z, and the
            distance of z from a solution.
        slopes: `slopes(x, z, p) -> J`: derivative of r by z, (n, n).
    """
    A, b = SX.sym("A", slopes.sparsity_out(0)), SX.sym("b", rows.numel_out(0))
    held: dict[str, Any] = {"cse": True, "is_diff_in": [False, True]}
    step = Function("step", [A, b], [casadi.densify(solve_square(A, b))], held)
    point = [MX.sym(name, slopes.size_in(k)) for k, name in enumerate(("x", "z", "p"))]
    r, residual = rows.call(point)
    z_next = point[1] - step(slopes.call(point)[0], r)
    return Function("closure", point, [z_next, residual])
