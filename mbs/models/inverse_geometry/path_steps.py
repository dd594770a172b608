"""Predictor-corrector continuation of a configuration while the target pose moves.

The tangent of the path is the predictor and Newton's method is the corrector. A step is accepted
if the corrector is shorter than the predictor and contracts, and if all eigenvalues of J^-1 J'
are within 1/2 of 1, where J and J' are the Jacobians before and after the step. The eigenvalues
do not depend on the units. An accepted step crosses no singular configuration and changes to no
other branch. The step size tends to zero towards a singular configuration.

Source: Deuflhard 2011, sections 2.1 and 5.1, with eigenvalues instead of a norm.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from mbs.closed_forms.arm import Array
from mbs.closed_forms.arm_search import polish
from mbs.models.inverse_geometry._solve import solve_at
from mbs.models.inverse_geometry.draft import NOT_VARIED
from mbs.models.inverse_geometry.path_equations import (
    LARGEST_STEP,
    POSE_ERROR,
    SINGULAR,
    SMALL,
    PathJoints,
    PathPoint,
    pseudo_inverse,
    smallest,
)
from mbs.models.inverse_geometry.target import SOLVED
from mbs.numbers import NONZERO
from mbs.solvers.least_squares import gauss_newton, levenberg_marquardt

# Predictor: tangent of the path, or a polynomial through the last configurations.


_GAIN = 10.0
"""Step along the negative gradient per rad or arm length of frame motion. A cost whose second
derivative is about 1 decreases within a frame motion of a tenth of the arm length."""
FAIR = 0.1
"""Largest relative correction of a predicted configuration along a smooth joint path."""


def predicted(
    joints: PathJoints, point: PathPoint, r: Array, free: NDArray[np.bool_], aim: Array
) -> tuple[Array, Array]:
    """Return the predicted configuration and the pseudo-inverse of the free joints' Jacobian.

    Args:
        joints: joints that track the path.
        point: configuration before the step.
        r: (m,) pose error from `point` to the next pose.
        free: (n,) whether each joint is not stopped at a limit.
        aim: (n,) positions, of which the stopped joints take theirs.
    """
    J, move = point.J[:, free], np.where(free, 0.0, aim - point.x)
    back, _ = pseudo_inverse(joints, J, int(np.sum(~free)))
    move[free] = back @ (r - point.J @ move)
    if joints.slope is not None and np.sum(~free) < joints.redundant:
        downhill = -_GAIN * float(np.linalg.norm(r)) * joints.slope(point.x)[free]
        still = downhill - back @ (J @ downhill)
        # at most as long as the move along the path, which must dominate the step
        most, length = float(np.linalg.norm(move)), float(np.linalg.norm(still))
        move[free] += still * min(1.0, most / max(length, NONZERO))
    return point.x + move, back


def lagrange(nodes: Sequence[float] | range, values: Array, u: float) -> Array:
    """Evaluate at u the interpolating polynomial through values (k, n) at k nodes."""
    total = np.zeros(values.shape[1])
    for k, own in enumerate(nodes):
        others = [other for m, other in enumerate(nodes) if m != k]
        total += values[k] * math.prod((u - other) / (own - other) for other in others)
    return total


def relative_correction(predicted: Array, found: Array, last: Array) -> float:
    """Return the correction |found - predicted| relative to the distance |found - last|."""
    way = max(float(np.linalg.norm(found - last)), NONZERO)
    return float(np.linalg.norm(found - predicted)) / way


# Corrector: Newton's method to a solution of the pose equations.


_CONTRACTION = 0.5
"""Largest ratio of a Newton correction to the one before: quadratic convergence is far below it."""
_ITERATIONS = 12
"""Maximum number of corrections: more than twice as many as quadratic convergence needs from 0.1
to 1e-16."""
_NOISE = 1e-14
"""Rounding error of an error row: some tens of 1e-16 from products of transforms. The norm of the
inverse Jacobian amplifies it in the Newton step."""
_BESIDE = 0.1
"""Largest correction [rad or arm lengths] from an interpolated configuration to a solution."""


def correct(
    joints: PathJoints, x: Array, T: Array, free: NDArray[np.bool_] | None = None
) -> PathPoint | None:
    """Newton's method from x to pose T. None without contraction or with a residual error."""
    before, free = np.inf, np.ones(x.size, dtype=bool) if free is None else free
    stopped = int(np.sum(~free))
    x = x.copy()
    r, J = joints.rows(x, T)
    for _ in range(_ITERATIONS):
        back, gain = pseudo_inverse(joints, J[:, free], stopped)
        move, noise = back @ r, _NOISE * gain
        length = float(np.linalg.norm(move))
        if length > max(_CONTRACTION * before, noise):
            return None
        x[free] += move
        before = length
        r, J = joints.rows(x, T)
        if length < noise:
            break
    left = float(np.max(np.abs(r)))
    return None if joints.exact and left > SMALL else PathPoint(x, J, left)


def nearby_solution(joints: PathJoints, x: Array, T: Array) -> Array | None:
    """Return a solution (n,) of pose T near x, which may be singular, or None."""
    residual = residual_of(joints, T)

    def missing(z: Array) -> float:
        return float(np.max(np.abs(joints.rows(z, T)[0])))

    # singular directions keep their positions: moving along them changes rounding errors only
    y = gauss_newton(residual, x, rank_tolerance=SINGULAR).x
    most = POSE_ERROR if joints.chain is None else SOLVED
    # otherwise use the full numerical rank, then damped least squares
    if missing(y) > most:
        y = gauss_newton(residual, y).x
    if missing(y) > most:
        y = _descended(joints, x, T)
    near = float(np.max(np.abs(y - x))) < _BESIDE
    return y if near and missing(y) <= most else None


def _descended(joints: PathJoints, x: Array, T: Array) -> Array:
    """Minimise the pose error from x, also if the Jacobian is rank-deficient; return (n,)."""
    if joints.chain is not None:
        arm = joints.chain.arm(joints.target.closing.p)
        better = polish(arm, T, (x * joints.scale)[None])[0][0]
        return x + arm.wrapped(better - x * joints.scale) / joints.scale

    return levenberg_marquardt(residual_of(joints, T), x).x


def residual_of(joints: PathJoints, T: Array) -> Callable[[Array], tuple[Array, Array]]:
    """Return the function from scaled positions (n,) to the residual of a pose and its Jacobian.

    Args:
        joints: joints that track a path.
        T: (4, 4) pose.
    """

    def residual(z: Array) -> tuple[Array, Array]:
        r, J = joints.rows(z, T)
        return -r, J

    return residual


def nearest_solution(joints: PathJoints, x: Array, T: Array) -> Array | None:
    """Return the solution (n,) of pose T nearest to x, or None. Open chains only."""
    if joints.chain is None:
        return None
    if joints.redundant:  # infinitely many solutions: take a local one
        return nearby_solution(joints, x, T)
    p = joints.target.closing.p
    q = solve_at(joints.chain, NOT_VARIED, T, "auto", p).q[:, list(joints.indices)]
    if not len(q):
        return None
    away = joints.chain.arm(p).wrapped(q / joints.scale - x)
    nearest: Array = x + away[int(np.argmin(np.linalg.norm(away, axis=1)))]
    return nearest


# Steps of the continuation.


_CHANGE = 0.5
"""Largest distance of the eigenvalues of J^-1 J' from 1: the Jacobian cannot become singular within
the step. It also bounds the correction relative to the prediction."""
_SMALLEST_STEP = 1e-12
"""Smallest step, as a fraction of the segment between two poses. The rounding of 1 is 1e-16."""
_TANGENT = 1e-3
"""Fraction of a step over which a finite difference approximates the tangent of a pose curve."""
_MOST_STEPS = 200
"""Maximum number of steps between two poses. A full revolution of a joint takes some tens."""


def advance(
    joints: PathJoints,
    start: PathPoint,
    pose: Callable[[float], Array],
    step: float,
    trail: list[tuple[float, PathPoint]] | None = None,
    curved: bool = False,
) -> tuple[PathPoint, float, float]:
    """Continue a configuration along a pose curve from parameter 0 to parameter 1.

    Args:
        joints: joints that track the path.
        start: point at parameter 0.
        pose: target pose (4, 4) as a function of the parameter in [0, 1].
        step: first step of the parameter.
        trail: list to which (parameter, point) of every accepted step is appended.
        curved: whether the pose curve is not a straight line.

    Returns:
        Last point, its parameter and the next step size. The parameter is below 1 if the
        continuation stopped at a singular configuration, at a limit, or after `_MOST_STEPS` steps.
    """
    point, at = start, 0.0
    for _ in range(_MOST_STEPS):
        if at == 1.0 or step <= _SMALLEST_STEP or smallest(joints, point.J) <= SINGULAR:
            break
        to = min(1.0, at + step)
        T = pose(to)
        found = _step(joints, point, T, joints.rows(point.x, T)[0])
        if found is None and curved:
            # near a singular configuration the curvature is amplified: predict from the tangent
            part = _TANGENT * (to - at)
            found = _step(joints, point, T, joints.rows(point.x, pose(at + part))[0] / _TANGENT)
        if found is None:
            step = (to - at) / 2
        else:
            point, at, step = found, to, 2 * (to - at)
            if trail is not None:
                trail.append((at, point))
    return point, at, step


def _step(joints: PathJoints, point: PathPoint, T: Array, r: Array) -> PathPoint | None:
    """Return the configuration at the next pose, or None if the step is too long.

    A redundant joint that would exceed its limit stops at the limit, and the other joints move.

    Args:
        joints: joints that track the path.
        point: configuration before the step.
        T: (4, 4) next pose.
        r: (m,) pose error from `point` to T, or its linear estimate.
    """
    free = np.ones(point.x.size, dtype=bool)
    aim = point.x.copy()
    for _ in range(joints.redundant + 1):
        guess, back = predicted(joints, point, r, free, aim)
        found = correct(joints, guess, T, free)
        reached = guess if found is None else found.x
        beyond = joints.beyond(reached) & free
        if not np.any(beyond):
            break
        free &= ~beyond
        aim = np.clip(reached, joints.low, joints.high)
        found = None
    if found is None or not joints.may(found.x):
        return None
    ahead, miss = np.linalg.norm(guess - point.x), np.linalg.norm(found.x - guess)
    near = np.max(np.abs(found.x - point.x)) < LARGEST_STEP and miss <= _CHANGE * ahead + SMALL
    change = np.max(np.abs(np.linalg.eigvals(back @ (found.J - point.J)[:, free])))
    return found if near and change <= _CHANGE else None
