"""Levenberg and Marquardt's steps of many postures towards a wanted pose, on numpy arrays."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbs.models.inverse_geometry.arm import Arm, Array, gap_to

_STEPS = 60  # at most
_STALLS = 3  # steps without progress
_FINE = 1e-26  # costs below it are those of solutions but for rounding
_FINEST = 1e-31  # nothing is left to gain
_LEAST = 1e-31  # damping, so that no matrix is singular


def examined(arm: Arm, T: Array, q: Array) -> tuple[Array, Array, Array]:
    """Costs (m,), gaps (m, 6) and Jacobians (m, 6, n) of postures q, (m, n).

    Lengths are measured by that of the arm; the cost is the square of the gap.
    """
    pose, J = arm.pose_and_jacobian(q)
    gap = gap_to(T, pose)
    gap[..., :3] /= arm.length
    J = J * arm.units
    J[..., :3, :] /= arm.length
    return np.sum(gap**2, axis=-1), gap, J


def descended(arm: Arm, T: Array, q: Array) -> tuple[Array, Array]:
    """Postures (m, n) where rounding or a smallest distance stops the steps; their costs (m,).

    The damping is proportional to the cost, which makes the last steps those of Newton, even
    where the Jacobian loses rank.
    Source: Yamashita and Fukushima 2001.

    Args:
        arm: whose postures.
        T: (4, 4) wanted pose of all, or (m, 4, 4) of each.
        q: (m, n) postures to start from [rad or m].
    """
    wanted = np.broadcast_to(T, (len(q), 4, 4))
    q = np.array(q, dtype=float)
    cost, gap, J = examined(arm, wanted, q)
    damping, stalls = np.full(len(q), 0.1), np.zeros(len(q), dtype=int)
    for _ in range(_STEPS):
        going = np.flatnonzero((cost > _FINEST) & (stalls < _STALLS))
        if not len(going):
            break
        dx = _step(J[going], gap[going], damping[going] * cost[going] + _LEAST)
        tried = q[going] + arm.units * dx
        tried_cost, tried_gap, tried_J = examined(arm, wanted[going], tried)
        better = tried_cost < cost[going]
        _settle(going, tried_cost, cost, damping, stalls)
        won = going[better]
        q[won], cost[won] = tried[better], tried_cost[better]
        gap[won], J[won] = tried_gap[better], tried_J[better]
    return q, cost


def _step(J: Array, gap: Array, shift: Array) -> Array:
    """Least squares of [J; sqrt(shift)] dx = [gap; 0] by reflections."""
    n = J.shape[-1]
    damped = np.concatenate([J, np.sqrt(shift)[:, None, None] * np.eye(n)], axis=-2)
    Q, R = np.linalg.qr(damped)
    side = np.einsum("mij,mi->mj", Q[:, :6], gap)
    answer: Array = np.linalg.solve(R, side[..., None])[..., 0]
    return answer


def _settle(
    going: NDArray[np.intp],
    tried: Array,
    cost: Array,
    damping: Array,
    stalls: NDArray[np.int_],
) -> None:
    """The damping of the next steps, and how often no progress was made."""
    before, weight = cost[going], damping[going]
    better = tried < before
    gain = 1.0 - tried / before
    easier = np.where(gain > 0.5, 0.2, np.where(gain > 0.1, 0.5, 2.0)) * weight
    harder = np.where(weight < 1e-3, 1e-2, 4.0 * weight)
    damping[going] = np.where(better, easier, harder)
    slow = np.where(gain < 5e-2, stalls[going] + 1, 0)
    hopeless = (before < _FINE) | (damping[going] * before > 1e12)
    stalls[going] = np.where(better, slow, stalls[going] + hopeless)
