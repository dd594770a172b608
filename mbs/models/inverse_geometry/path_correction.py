"""Correction of a predicted configuration to a solution of the pose equations."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from mbs.closed_forms.arm import Array
from mbs.closed_forms.arm_search import polish
from mbs.models.inverse_geometry._solve import solve_at
from mbs.models.inverse_geometry.draft import NOT_VARIED
from mbs.models.inverse_geometry.path_equations import (
    POSE_ERROR,
    SINGULAR,
    SMALL,
    Follower,
    PathPoint,
    Tracker,
    pseudo_inverse,
)
from mbs.models.inverse_geometry.target import SOLVED
from mbs.solvers.least_squares import gauss_newton, levenberg_marquardt

_CONTRACTION = 0.5
_ITERATIONS = 12
_NOISE = 1e-14
"""Rounding error of an error row: some tens of 1e-16 from products of transforms. The norm of the
inverse Jacobian amplifies it in the Newton step."""
_BESIDE = 0.1
"""Largest correction [rad or arm lengths] from an interpolated configuration to a solution."""


def correct(
    tracker: Tracker, x: Array, T: Array, free: NDArray[np.bool_] | None = None
) -> PathPoint | None:
    """Newton's method from x to pose T. None without contraction or with a residual error."""
    before, free = np.inf, np.ones(x.size, dtype=bool) if free is None else free
    stopped = int(np.sum(~free))
    x = x.copy()
    r, J = tracker.rows(x, T)
    for _ in range(_ITERATIONS):
        back, gain = pseudo_inverse(tracker, J[:, free], stopped)
        move, noise = back @ r, _NOISE * gain
        length = float(np.linalg.norm(move))
        if length > max(_CONTRACTION * before, noise):
            return None
        x[free] += move
        before = length
        r, J = tracker.rows(x, T)
        if length < noise:
            break
    left = float(np.max(np.abs(r)))
    return None if tracker.exact and left > SMALL else PathPoint(x, J, left)


def nearby_solution(led: Follower, x: Array, T: Array) -> Array | None:
    """Return a solution (n,) of pose T near x, which may be singular, or None."""
    residual = _residual_of(led, T)

    def missing(z: Array) -> float:
        return float(np.max(np.abs(led.rows(z, T)[0])))

    # singular directions keep their positions: moving along them changes rounding errors only
    y = gauss_newton(residual, x, rank_tolerance=SINGULAR).x
    most = POSE_ERROR if led.chain is None else SOLVED
    # otherwise use the full numerical rank, then damped least squares
    if missing(y) > most:
        y = gauss_newton(residual, y).x
    if missing(y) > most:
        y = _descended(led, x, T)
    near = float(np.max(np.abs(y - x))) < _BESIDE
    return y if near and missing(y) <= most else None


def _descended(led: Follower, x: Array, T: Array) -> Array:
    """Minimise the pose error from x, also if the Jacobian is rank-deficient; return (n,)."""
    if led.chain is not None:
        arm = led.chain.arm(led.target.closing.p)
        better = polish(arm, T, (x * led.scale)[None])[0][0]
        return x + arm.wrapped(better - x * led.scale) / led.scale

    return levenberg_marquardt(_residual_of(led, T), x).x


def _residual_of(led: Follower, T: Array) -> Callable[[Array], tuple[Array, Array]]:
    """Return the function from positions (n,) to the residual of pose T and its Jacobian."""

    def residual(z: Array) -> tuple[Array, Array]:
        r, J = led.rows(z, T)
        return -r, J

    return residual


def nearest_solution(led: Follower, x: Array, T: Array) -> Array | None:
    """Return the solution (n,) of pose T nearest to x, or None. Open chains only."""
    if led.chain is None:
        return None
    if led.redundant:  # infinitely many solutions: take a local one
        return nearby_solution(led, x, T)
    p = led.target.closing.p
    q = solve_at(led.chain, NOT_VARIED, T, "auto", p).q[:, list(led.indices)]
    if not len(q):
        return None
    away = led.chain.arm(p).wrapped(q / led.scale - x)
    nearest: Array = x + away[int(np.argmin(np.linalg.norm(away, axis=1)))]
    return nearest
