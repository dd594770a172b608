"""The reachable pose that is nearest to a wanted one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mbs.models.inverse_geometry.arm import Arm, Array, gap_to
from mbs.models.inverse_geometry.numeric import core
from mbs.models.inverse_geometry.numeric.descent import descended, examined
from mbs.models.inverse_geometry.numeric.merge import wrapped
from mbs.models.inverse_geometry.numeric.search import SEED, random_postures

_STARTS, _KEPT, _REFINEMENTS = 100, 8, 60
_NUDGE = 1e-5  # of joints, for differences of the slope
_FLAT = 1e-15  # slopes below it are rounding
_FINEST = 1e-31  # costs below it leave nothing to gain
_ALIKE = 1e-14  # relative rounding of costs
_EQUAL = 1e-6  # costs that are closer, relatively, are of one valley


@dataclass(frozen=True, slots=True, eq=False)
class Nearest:
    """The reachable pose nearest to a wanted one.

    Attributes:
        q: (n,) a posture that has this pose [rad or m].
        distance: between the origins of both poses [m].
        angle: between their orientations [rad].
        T: (4, 4) the pose.
    """

    q: Array
    distance: float
    angle: float
    T: Array


def nearest(arm: Arm, T: Array) -> Nearest:
    """The pose of least distance^2 + (arm.length * angle)^2 from a wanted one.

    The best of several descents from random postures, each followed by Newton's method down to
    where the slope vanishes.

    Args:
        arm: whose postures; compiled for up to seven joints.
        T: (4, 4) wanted pose [m].
    """
    library = core.core_of(arm)
    if library is not None:
        return _measured(arm, T, core.nearest_by(library, arm, T, _STARTS, SEED))
    return _measured(arm, T, nearest_with_numpy(arm, T))


def nearest_with_numpy(arm: Arm, T: Array) -> Array:
    """(n,) the posture of `nearest` where there is no C compiler."""
    q, cost = descended(arm, T, random_postures(arm, T, _STARTS, SEED))
    best = [_refined(arm, T, q[k]) for k in _apart(cost)]
    lowest = min(best, key=lambda found: found[1])
    return wrapped(arm, lowest[0])


def _measured(arm: Arm, T: Array, q: Array) -> Nearest:
    pose = arm.pose(q)
    gap = gap_to(T, pose)
    return Nearest(q, float(np.linalg.norm(gap[:3])), float(np.linalg.norm(gap[3:])), pose)


def _apart(cost: Array) -> list[int]:
    """The numbers of the lowest costs that differ."""
    kept = list[int]()
    for k in np.argsort(cost, kind="stable"):
        if not kept or cost[k] - cost[kept[-1]] >= _EQUAL * cost[k]:
            kept.append(int(k))
    return kept[:_KEPT]


def _refined(arm: Arm, T: Array, q: Array) -> tuple[Array, float]:
    """Newton's method with differences of the slope; the posture and its cost."""
    cost, slope = _sloped(arm, T, q)
    curvature: Array | None = None
    shift = 1e-9
    for _ in range(_REFINEMENTS):
        if cost <= _FINEST or np.linalg.norm(slope) <= _FLAT or shift > 1e6:
            break
        curvature = _curvature(arm, T, q) if curvature is None else curvature
        try:
            L = np.linalg.cholesky(curvature + shift * np.eye(arm.size))
            tried = q - arm.units * np.linalg.solve(L.T, np.linalg.solve(L, slope))
            tried_cost, tried_slope = _sloped(arm, T, tried)
        except np.linalg.LinAlgError:  # not positive: a longer shift
            tried_cost, tried_slope = np.array(np.inf), slope
        if _lower((tried_cost, tried_slope), (cost, slope)):
            q, cost, slope = tried, tried_cost, tried_slope
            shift, curvature = max(0.1 * shift, 1e-12), None
        else:
            shift = max(10.0 * shift, 1e-6)
    return q, float(cost)


def _lower(tried: tuple[Array, Array], old: tuple[Array, Array]) -> bool:
    """Near the bottom costs are alike but for rounding, and the slope tells more."""
    (cost, slope), (old_cost, old_slope) = tried, old
    flatter = np.linalg.norm(slope) < 0.5 * np.linalg.norm(old_slope)
    alike = cost < old_cost * (1 + _ALIKE)
    return bool(cost < old_cost * (1 - _ALIKE) or (alike and flatter))


def _sloped(arm: Arm, T: Array, q: Array) -> tuple[Array, Array]:
    """Costs, and half their gradients.

    They are exact although J is the motion of the frame and not of the rotation vector, because
    that vector is the axis of its own turn.
    """
    cost, gap, J = examined(arm, T, q)
    return cost, -np.einsum("...ij,...i->...j", J, gap)


def _curvature(arm: Arm, T: Array, q: Array) -> Array:
    nudges = _NUDGE * np.diag(arm.units)
    ahead, behind = _sloped(arm, T, q + nudges)[1], _sloped(arm, T, q - nudges)[1]
    H: Array = (ahead - behind) / (2 * _NUDGE)
    return 0.5 * (H + H.T)
