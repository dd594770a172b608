"""Roots of equations that are followed while the equations become others, many at once."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from mbs.numbers import NONZERO

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]

Newton = Callable[[Complex, Real, Complex], tuple[Complex, Complex]]
"""Newton's step at x (r, n) and t (r,), and the slope of the root by t, both (r, n); the third are
the roots at the beginning of a step."""
Settle = Callable[[Complex, Complex], tuple[Complex, Complex]]
"""A root and its slope as those of the next step, such as homogeneous ones of length one."""

TOLERANCE = 1e-4
"""First correction of Newton's method after a step, of coordinates of the size of one: at 1e-2 a
tenth of the platforms on six legs lost a path to another one."""
_FIRST_STEP, _LEAST_STEP = 0.01, 1e-9
"""Of t, from 0 to 1: the first is shorter than most that follow; one below the other stands before
a singular root, to which the steps of a regular path do not come near."""
_SHRINK, _GROW, _SAFETY = 0.2, 3.0, 0.9
"""Of steps, as in solvers of differential equations: at most by these, and a little less than what
the fifth power of the step says."""
_MOST_STEPS = 4000


def follow(
    newton: Newton, x: Complex, settle: Settle, tolerance: float = TOLERANCE
) -> tuple[Complex, Real]:
    """The roots (r, n) at t = 1, and how far each came.

    That is 1, or less at a singular root or one at infinity, which is approached in ever smaller
    steps. Runge and Kutta's fourth order predicts, two steps of Newton's method correct.

    Args:
        newton: of the equations.
        x: (r, n) roots at t = 0.
        settle: after each step.
        tolerance: first correction of Newton's method after a step.
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
        # the second correction is about the square of the first where the root is regular
        good = (error < 2 * tolerance) & (rest < tolerance**1.5)
        factor = _SAFETY * (tolerance / np.maximum(error, NONZERO)) ** (1 / 5)
        factor = np.where(np.isfinite(factor), factor, _SHRINK)
        h[going] = step * np.clip(factor, _SHRINK, np.where(good, _GROW, 0.5))
        won = going[good]
        x[won], slope[won] = settle((y + first + second)[good], along[good])
        t[won] = np.where(step[good] >= 1 - t0[good], 1.0, (t0 + step)[good])
    return x, t


def _predicted(newton: Newton, x: Complex, k1: Complex, t: Real, h: Real) -> Complex:
    """(r, n) the roots at t + h, from x with slopes k1."""
    s = h[:, None]
    _, k2 = newton(x + s / 2 * k1, t + h / 2, x)
    _, k3 = newton(x + s / 2 * k2, t + h / 2, x)
    _, k4 = newton(x + s * k3, t + h, x)
    return x + s / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


def solved(A: Complex, b: Complex) -> Complex:
    """(r, n, k) solutions of A x = b, NaN where A is singular to the last bit."""
    try:
        return np.asarray(np.linalg.solve(A, b), np.complex128)
    except np.linalg.LinAlgError:
        x = np.full(b.shape, np.nan, dtype=np.complex128)
        for k in range(len(b)):
            with suppress(np.linalg.LinAlgError):
                x[k] = np.linalg.solve(A[k], b[k])
        return x
