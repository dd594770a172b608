"""Solve r(x) = 0 for more or fewer unknowns than equations, rank-deficient ones included."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mbs.solvers.least_squares import smallest_solution

Vector = NDArray[np.float64]
Residual = Callable[[Vector], tuple[Vector, Vector]]
"""x -> residual (m,), Jacobian (m, n)."""

_STALLED = 1e-14
"""Length of a step [rad or m] that changes no digit of positions of size one that could matter."""

_LAST_DIGITS = 1e-2
"""Part of the tolerance above which one step more is taken: it takes the error to its square."""


@dataclass(frozen=True, slots=True)
class Root:
    """Where the iteration ended.

    Attributes:
        x: (n,) the unknowns.
        residual: Euclidean norm of the residual there.
        converged: whether every element is below its tolerance.
    """

    x: Vector
    residual: float
    converged: bool


def gauss_newton(
    function: Residual,
    start: Vector,
    *,
    tolerance: float | Vector = 1e-12,
    iterations: int = 100,
    rank_tolerance: float = 1e-9,
) -> Root:
    """Damped Gauss-Newton with the smallest step that solves the linearised equations.

    The step is the minimum-norm least-squares solution, so that dependent equations and free
    unknowns do no harm; it is halved until the residual falls. Its arithmetic is plain, so that
    the same start leads to the same digits on every processor.

    Args:
        function: residual and Jacobian.
        start: (n,) first guess; the root found is near to it.
        tolerance: of the absolute residual, one for all elements or one for each.
        iterations: at most.
        rank_tolerance: singular values below this part of the largest count as zero.

    Returns:
        The last iterate, converged or not.
    """
    x = np.array(start, dtype=float)
    r, J = function(x)
    if not _finite(r, J):
        return Root(x, np.inf, False)
    for _ in range(iterations):
        reached = bool(np.all(np.abs(r) <= tolerance))
        if reached and np.all(np.abs(r) <= _LAST_DIGITS * np.asarray(tolerance)):
            break
        step = smallest_solution(J, -r, rank_tolerance)
        length = 1.0
        while length > (0.5 if reached else 1e-6):  # beyond the tolerance one step, if it helps
            trial = x + length * step
            r_trial, J_trial = function(trial)
            lower = _norm(r_trial) < _norm(r)
            if lower and _finite(r_trial, J_trial):
                break
            length /= 2
        else:
            break
        stalled = length * _norm(step) < _STALLED
        x, r, J = trial, r_trial, J_trial
        if stalled or reached:
            break
    return Root(x, _norm(r), bool(np.all(np.abs(r) <= tolerance)))


def _norm(x: Vector) -> float:
    """Its sum has one order, other than that of a dot product."""
    return float(np.sqrt(np.sum(x * x)))


def _finite(r: Vector, J: Vector) -> bool:
    return bool(np.all(np.isfinite(r)) and np.all(np.isfinite(J)))
