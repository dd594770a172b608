"""Solutions by many descents, polished and merged; the general method; the nearest pose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import mbs.closed_forms.arm_core as core
from mbs.closed_forms.arm import Arm, Array, gap_to
from mbs.closed_forms.arm_core import HandedLoop, Numbers, solved_by
from mbs.closed_forms.raghavan_roth.numbers import Prepared, prepare
from mbs.errors import NoClosedForm

# The distance of configurations from a target pose, on numpy arrays.


def examine_arm(arm: Arm, T: Array, q: Array) -> tuple[Array, Array, Array]:
    """Costs (m,), gaps (m, 6) and Jacobians (m, 6, n) of configurations q, (m, n).

    Lengths are measured by that of the arm; the cost is the square of the gap.
    """
    pose, J = arm.pose_and_jacobian(q)
    gap = gap_to(T, pose)
    gap[..., :3] /= arm.length
    J = J * arm.units
    J[..., :3, :] /= arm.length
    return np.sum(gap**2, axis=-1), gap, J


# Which of many solutions for one pose are the same configuration.


@dataclass(frozen=True, slots=True, eq=False)
class Merged:
    """Distinct solutions.

    Attributes:
        q: (m, n) configurations [rad or m].
        hits: (m,) how many of the given configurations are each of them.
    """

    q: Array
    hits: NDArray[np.int64]


def merged(arm: Arm, T: Array, q: Array) -> Merged:
    """The distinct ones of several solutions for one pose, in their order.

    Two are one when they are closer than 1e-9, or closer than 1e-2 with a solution half way, to
    1e-14 or as good as they are, as between scattered copies of a multiple root. Of two that are
    one the better stays. Angles that differ by whole turns are equal, slides are measured in arm
    lengths.

    Args:
        arm: the arm whose configurations are searched.
        T: (4, 4) target pose.
        q: (m, n) solutions [rad or m].
    """
    return Merged(*core.merged_by(core.core_of(arm), arm, T, q))


def wrapped(arm: Arm, q: Array) -> Array:
    """Configurations with all angles in (-pi, pi]."""
    turns = np.pi - np.mod(np.pi - q, 2 * np.pi)
    within = (q > -np.pi) & (q <= np.pi)
    return np.where(arm.prismatic | within, q, turns)


# All solutions by many descents from random configurations.


SEED = 20260105


def search(arm: Arm, T: Array, starts: int = 300, seed: int = SEED) -> Array:
    """The solutions that Levenberg and Marquardt's steps lead to from random configurations.

    Nothing proves that they are all; `counted_search` tells how often each was met.

    Args:
        arm: the arm whose configurations are searched.
        T: (4, 4) target pose.
        starts: how many random configurations.
        seed: of them.

    Returns:
        (m, n) distinct configurations [rad or m]; samples of the families where there are such.
    """
    return counted_search(arm, T, starts, seed).q


def counted_search(arm: Arm, T: Array, starts: int = 300, seed: int = SEED) -> Merged:
    """`search`, and how many of the starts lead to each solution."""
    return Merged(*core.found_by(core.core_of(arm), arm, T, starts, seed))


def random_configurations(arm: Arm, T: Array, count: int, seed: int) -> Array:
    """(count, n) configurations: angles in (-pi, pi], slides as far as arm and pose reach."""
    indices = np.arange(1, count * arm.size + 1, dtype=np.uint64)
    chance = _split_mix(np.array([seed % 2**64], dtype=np.uint64), indices).reshape(count, arm.size)
    reach = arm.length + np.linalg.norm(T[:3, 3])
    return np.where(arm.prismatic, reach, np.pi) * (1.0 - 2.0 * chance)


def _split_mix(seed: NDArray[np.uint64], indices: NDArray[np.uint64]) -> Array:
    """Numbers in [0, 1). Source: Steele, Lea and Flood 2014."""
    z = seed + indices * np.uint64(0x9E3779B97F4A7C15)
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    z = z ^ (z >> np.uint64(31))
    chance: Array = (z >> np.uint64(11)).astype(float) * 2.0**-53
    return chance


# Configurations made as exact as rounding allows.


@dataclass(frozen=True, slots=True, eq=False)
class Polished:
    """Configurations and how well they reach the target pose.

    Attributes:
        q: (m, n) configurations, angles in (-pi, pi] where they were improved [rad or m].
        residual: (m,) max |pose(q) - T| [m and 1].
    """

    q: Array
    residual: Array


def polish(arm: Arm, T: Array, q: Array) -> Polished:
    """The solutions beside configurations.

    A configuration stays as it is where nothing better lies beside it, so that no residual grows.
    An arm of fewer than six joints comes as near as least squares do.

    Args:
        arm: the arm whose configurations are searched.
        T: (4, 4) target pose of all, or (m, 4, 4) of each.
        q: (m, n) configurations [rad or m].
    """
    return Polished(*core.polished_by(core.core_of(arm), arm, T, q))


# The reachable pose that is nearest to a wanted one.


_STARTS = 100


@dataclass(frozen=True, slots=True, eq=False)
class Nearest:
    """The reachable pose nearest to a wanted one.

    Attributes:
        q: (n,) a configuration that has this pose [rad or m].
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

    The best of several descents from random configurations, each followed by Newton's method down
    to where the slope vanishes.

    Args:
        arm: the arm whose configurations are searched.
        T: (4, 4) target pose [m].
    """
    return _measure(arm, T, core.nearest_by(core.core_of(arm), arm, T, _STARTS, SEED))


def _measure(arm: Arm, T: Array, q: Array) -> Nearest:
    pose = arm.pose(q)
    gap = gap_to(T, pose)
    return Nearest(q, float(np.linalg.norm(gap[:3])), float(np.linalg.norm(gap[3:])), pose)


# All configurations of a general arm of six joints that reach a pose.


@dataclass(frozen=True, slots=True, eq=False)
class General:
    """An arm ready for the general method.

    Attributes:
        arm: of six joints.
        prepared: what the method chose for it.
        handed: both for the compiled core.
    """

    arm: Arm
    prepared: Prepared
    handed: HandedLoop


def general_of(arm: Arm) -> General:
    """An arm made ready, once, for `general`.

    Raises:
        ModelError: it has not six joints, or none that turns.
        NoClosedForm: the method does not hold for it.
    """
    prepared = prepare(arm)
    if not prepared.regular:
        raise NoClosedForm(
            f"arm {' '.join(arm.names)}: the matrix of the general inverse geometric model is"
            f" singular at every configuration (its regularity is {prepared.regularity:.0e}); use"
            " method='search'"
        )
    return General(arm, prepared, HandedLoop(arm, prepared))


def general(arm: General, T: Array) -> Array:
    """The configurations that reach a pose, by elimination; polished.

    Source: Raghavan & Roth 1993.

    Args:
        arm: see `general_of`.
        T: (4, 4) target pose [m].

    Returns:
        (m, 6) all isolated solutions, each once [rad or m]; samples where there are families.
    """
    return general_many(arm, np.asarray(T, dtype=float)[None])[1]


def general_many(arm: General, T: Array) -> tuple[Numbers, Array]:
    """Likewise for many poses.

    Args:
        arm: see `general_of`.
        T: (N, 4, 4) target pose [m].

    Returns:
        (m,) numbers of the poses, ascending, and (m, 6) configurations for them.
    """
    return solved_by(core.core_of(arm.arm), arm.handed, T)
