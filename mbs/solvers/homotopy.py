"""Homotopy continuation: roots are tracked while the equations change, many at once."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from mbs.numbers import NONZERO

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]

Newton = Callable[[Complex, Real, Complex], tuple[Complex, Complex]]
"""Callable (x (r, n), t (r,), roots at the start of the step (r, n)) -> Newton step and derivative
of the root by t, both (r, n)."""
Settle = Callable[[Complex, Complex], tuple[Complex, Complex]]
"""Callable that normalises roots and slopes after a step, such as homogeneous roots to length 1."""

TOLERANCE = 1e-4
"""Size of the first Newton correction that steps aim at, for coordinates of size one. At 1e-2 a
tenth of the platforms with six legs lost a path to another path."""
_FIRST_STEP, _LEAST_STEP = 0.01, 1e-9
"""First and smallest step of t, which runs from 0 to 1. The first is shorter than most later steps.
Smaller steps than the smallest occur only near a singular root."""
_SHRINK, _GROW, _SAFETY = 0.2, 3.0, 0.9
"""Step size control, as in ODE solvers: smallest and largest factor of a step, and a safety factor
on the step that follows from the fifth-order error estimate."""
_MOST_STEPS = 4000


def follow(
    newton: Newton, x: Complex, settle: Settle, tolerance: float = TOLERANCE
) -> tuple[Complex, Real]:
    """Track roots of equations from t = 0 to t = 1 by continuation.

    The predictor is the fourth-order Runge-Kutta method. The corrector is two Newton steps.

    Args:
        newton: Newton step of the equations.
        x: (r, n) roots at t = 0.
        settle: normalisation after each step.
        tolerance: size of the first Newton correction that steps aim at; up to twice this size is
            accepted.

    Returns:
        roots (r, n), and the t (r,) that each reached: 1, or less at a singular root or a root at
        infinity, where steps become too small.
    """
    t, h = np.zeros(len(x)), np.full(len(x), _FIRST_STEP)
    x, slope = settle(x.copy(), newton(x, t, x)[1])
    for _ in range(_MOST_STEPS):
        going = np.flatnonzero((t < 1) & (h > _LEAST_STEP))
        if not len(going):
            break
        x0, t0 = x[going], t[going]
        step = np.minimum(h[going], 1 - t0)
        with np.errstate(all="ignore"):  # near singular matrices steps have no bounds
            y = _predicted(newton, x0, slope[going], t0, step)
            first, _ = newton(y, t0 + step, x0)
            second, along = newton(y + first, t0 + step, x0)
            error, rest = np.linalg.norm(first, axis=1), np.linalg.norm(second, axis=1)
        # for a regular root the second correction is about the square of the first
        good = (error < 2 * tolerance) & (rest < tolerance**1.5)
        factor = _SAFETY * (tolerance / np.maximum(error, NONZERO)) ** (1 / 5)
        factor = np.where(np.isfinite(factor), factor, _SHRINK)
        h[going] = step * np.clip(factor, _SHRINK, np.where(good, _GROW, 0.5))
        won = going[good]
        x[won], slope[won] = settle((y + first + second)[good], along[good])
        t[won] = np.where(step[good] >= 1 - t0[good], 1.0, (t0 + step)[good])
    return x, t


def _predicted(newton: Newton, x: Complex, k1: Complex, t: Real, h: Real) -> Complex:
    """Return the roots (r, n) at t + h predicted by one Runge-Kutta step.

    `x` (r, n) are the roots at t (r,), `k1` their derivatives by t, and `h` (r,) the steps.
    """
    s = h[:, None]
    _, k2 = newton(x + s / 2 * k1, t + h / 2, x)
    _, k3 = newton(x + s / 2 * k2, t + h / 2, x)
    _, k4 = newton(x + s * k3, t + h, x)
    return x + s / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


def solved(A: Complex, b: Complex) -> Complex:
    """Return the solutions (r, n, k) of r linear systems A x = b.

    NaN if a matrix is exactly singular. `A` is (r, n, n) and `b` is (r, n, k).
    """
    try:
        return np.asarray(np.linalg.solve(A, b), np.complex128)
    except np.linalg.LinAlgError:
        x = np.full(b.shape, np.nan, dtype=np.complex128)
        for k in range(len(b)):
            with suppress(np.linalg.LinAlgError):
                x[k] = np.linalg.solve(A[k], b[k])
        return x
