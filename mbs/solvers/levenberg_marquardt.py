"""The smallest sum of squares, where no root is near."""

from __future__ import annotations

import numpy as np

from mbs.solvers.gauss_newton import Residual, Root, Vector

_FIRST, _EASED, _STIFFENED, _STIFFEST = 1e-3, 3.0, 4.0, 1e12
_SETTLED = 1e-16


def levenberg_marquardt(function: Residual, start: Vector, *, iterations: int = 300) -> Root:
    """A local minimum of r' r; it is reached too where the Jacobian loses rank at it.

    The step solves (J' J + mu 1) s = -J' r; mu falls where a step leads down and rises where not.

    Source: Marquardt 1963.

    Args:
        function: residual and Jacobian.
        start: (n,) first guess.
        iterations: at most.

    Returns:
        The last iterate; it has converged when further steps gain nothing.
    """
    x, damping = np.array(start, dtype=float), _FIRST
    r, J = function(x)
    for _ in range(iterations):
        step = np.linalg.solve(J.T @ J + damping * np.eye(x.size), -J.T @ r)
        r_trial, J_trial = function(x + step)
        gain = float(r @ r - r_trial @ r_trial)
        if gain > 0:
            settled = gain <= _SETTLED * float(r @ r)
            x, r, J, damping = x + step, r_trial, J_trial, damping / _EASED
        else:
            settled, damping = damping > _STIFFEST, damping * _STIFFENED
        if settled:
            return Root(x, float(np.linalg.norm(r)), True)
    return Root(x, float(np.linalg.norm(r)), False)
