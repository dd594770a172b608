"""L D L' of symmetric matrices some of whose rows nearly depend on the rows before them."""

from __future__ import annotations

import casadi
from casadi import SX


def partial_ldl(S: SX, least: SX) -> tuple[SX, SX, list[int], SX]:
    """L D L' of the rows whose pivot is large enough, as `casadi.ldl` gives it for all rows.

    What is left of a row that the others nearly imply is rounding. If it were divided by its pivot,
    which is rounding too, numbers of the size of one would pass into every row after it, and these
    would be solved wrongly. Such a row has no part in L, as if S were without it.

    Source: Davis 2006, section 4.8, for the order of the sums.

    Args:
        S: (n, n) symmetric, positive semidefinite.
        least: (n, 1) what a pivot must be above, row by row of S.

    Returns:
        D (n, 1), L' without its diagonal (n, n), the order p of the rows, so that
        S[p, p] = L D L', all as `casadi.ldl_solve` takes them; and, in this order, whether the
        pivot is large enough (n, 1). The D of a row that is left out is what is left of it.
    """
    pattern, order = S.sparsity().ldl()
    W, least = S[order, order], casadi.densify(least)[order]
    n = S.shape[0]
    columns = [pattern.row()[pattern.colind()[k] : pattern.colind()[k + 1]] for k in range(n)]
    LT = SX(pattern)
    D, good, inverse = list[SX](), list[SX](), list[SX]()
    for j, above in enumerate(columns):
        # row j of L D, then of L, from the columns before; U_ij = L_ji D_i
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
