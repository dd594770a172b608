"""All solutions by many descents from random postures."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbs.models.inverse_geometry.arm import Arm, Array
from mbs.models.inverse_geometry.numeric import core
from mbs.models.inverse_geometry.numeric.descent import descended
from mbs.models.inverse_geometry.numeric.merge import (
    Merged,
    merged_with_numpy,
    reached,
    wrapped,
)

SEED = 20260105


def search(arm: Arm, T: Array, starts: int = 300, seed: int = SEED) -> Array:
    """The solutions that Levenberg and Marquardt's steps lead to from random postures.

    Nothing proves that they are all; `counted_search` tells how often each was met.

    Args:
        arm: whose postures; compiled for up to seven joints.
        T: (4, 4) wanted pose.
        starts: how many random postures.
        seed: of them.

    Returns:
        (m, n) distinct postures [rad or m]; samples of the families where there are such.
    """
    return counted_search(arm, T, starts, seed).q


def counted_search(arm: Arm, T: Array, starts: int = 300, seed: int = SEED) -> Merged:
    """`search`, and how many of the starts lead to each solution."""
    library = core.core_of(arm)
    if library is not None:
        return Merged(*core.found_by(library, arm, T, starts, seed))
    return searched_with_numpy(arm, T, starts, seed)


def searched_with_numpy(arm: Arm, T: Array, starts: int, seed: int) -> Merged:
    """`counted_search` where there is no C compiler."""
    q = wrapped(arm, descended(arm, T, random_postures(arm, T, starts, seed))[0])
    return merged_with_numpy(arm, T, q[reached(arm, T, q)])


def random_postures(arm: Arm, T: Array, count: int, seed: int) -> Array:
    """(count, n) postures: angles in (-pi, pi], slides as far as the arm and the pose reach."""
    places = np.arange(1, count * arm.size + 1, dtype=np.uint64)
    chance = _split_mix(np.array([seed % 2**64], dtype=np.uint64), places).reshape(count, arm.size)
    reach = arm.length + np.linalg.norm(T[:3, 3])
    return np.where(arm.prismatic, reach, np.pi) * (1.0 - 2.0 * chance)


def _split_mix(seed: NDArray[np.uint64], places: NDArray[np.uint64]) -> Array:
    """Numbers in [0, 1). Source: Steele, Lea and Flood 2014."""
    z = seed + places * np.uint64(0x9E3779B97F4A7C15)
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    z = z ^ (z >> np.uint64(31))
    chance: Array = (z >> np.uint64(11)).astype(float) * 2.0**-53
    return chance
