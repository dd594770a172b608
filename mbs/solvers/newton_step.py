"""One step of Newton's method as a Function whose derivatives are those of the solution."""

from __future__ import annotations

from typing import Any

import casadi
from casadi import MX, SX, Function

from mbs.solvers.small_linear import solve_square


def newton_step(rows: Function, slopes: Function) -> Function:
    """``closure(x, z, p) -> (z_next, residual)``, z_next = z - J^-1 r.

    Its derivatives hold J: where r is zero, those of z_next by x and p are the derivatives of the
    solution, -J^-1 dr, and nothing is spent on how J changes. Elsewhere they are approximate.

    Args:
        rows: `rows(x, z, p) -> (r, residual)`, as many equations r (n, 1) as unknowns z, and how
            far from a solution z is.
        slopes: `slopes(x, z, p) -> J`, how r changes with z, (n, n).
    """
    A, b = SX.sym("A", slopes.sparsity_out(0)), SX.sym("b", rows.numel_out(0))
    held: dict[str, Any] = {"cse": True, "is_diff_in": [False, True]}
    step = Function("step", [A, b], [casadi.densify(solve_square(A, b))], held)
    point = [MX.sym(name, slopes.size_in(k)) for k, name in enumerate(("x", "z", "p"))]
    r, residual = rows.call(point)
    z_next = point[1] - step(slopes.call(point)[0], r)
    return Function("closure", point, [z_next, residual])
