"""Postures made as exact as rounding allows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mbs.models.inverse_geometry.arm import Arm, Array
from mbs.models.inverse_geometry.numeric import core
from mbs.models.inverse_geometry.numeric.descent import descended
from mbs.models.inverse_geometry.numeric.merge import wrapped


@dataclass(frozen=True, slots=True, eq=False)
class Polished:
    """Postures and how well they reach the wanted pose.

    Attributes:
        q: (m, n) postures, angles in (-pi, pi] where they were improved [rad or m].
        residual: (m,) max |pose(q) - T| [m and 1].
    """

    q: Array
    residual: Array


def polish(arm: Arm, T: Array, q: Array) -> Polished:
    """The solutions beside postures.

    A posture stays as it is where nothing better lies beside it, so that no residual grows. An
    arm of fewer than six joints comes as near as least squares do.

    Args:
        arm: whose postures.
        T: (4, 4) wanted pose of all, or (m, 4, 4) of each.
        q: (m, n) postures [rad or m].
    """
    library = core.core_of(arm)
    if library is None:
        return polished_with_numpy(arm, T, q)
    return Polished(*core.polished_by(library, arm, T, q))


def polished_with_numpy(arm: Arm, T: Array, q: Array) -> Polished:
    """`polish` where there is no C compiler."""
    before = arm.residual(q, T)
    better = wrapped(arm, descended(arm, T, q)[0])
    after = arm.residual(better, T)
    improved = after < before
    return Polished(np.where(improved[:, None], better, q), np.where(improved, after, before))
