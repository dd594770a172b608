"""Symbolic solution of small linear systems, the operations counted in mind."""

import casadi
from casadi import SX


def solve_square(A: SX, B: SX) -> SX:
    """The solution X of A X = B for a regular (n, n) matrix A of scalars.

    Up to three equations by the adjugate (one division), beyond by QR on the blocks that the
    sparsity leaves coupled.
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
