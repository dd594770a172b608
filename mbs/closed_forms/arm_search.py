"""Solutions of arms by random descents, polishing, merging, elimination, and the nearest pose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import mbs.closed_forms.arm_core as core
from mbs.closed_forms.arm import Arm, Array, gap_to
from mbs.closed_forms.arm_core import CLoop, Numbers, solved_by
from mbs.closed_forms.raghavan_roth.numbers import Prepared, prepare
from mbs.errors import NoClosedForm

# Distance of configurations from a target pose.


def examine_arm(arm: Arm, T: Array, q: Array) -> tuple[Array, Array, Array]:
    """Return costs (m,), displacements to the target (m, 6) and Jacobians (m, 6, n).

    Lengths are divided by the length of the arm. A displacement is a translation and a rotation
    vector, as of `gap_to`; the cost is its squared norm.

    Args:
        arm: arm of the configurations.
        T: (4, 4) target pose [m].
        q: (m, n) configurations [rad or m].
    """
    pose, J = arm.pose_and_jacobian(q)
    gap = gap_to(T, pose)
    gap[..., :3] /= arm.length
    J = J * arm.units
    J[..., :3, :] /= arm.length
    return np.sum(gap**2, axis=-1), gap, J


# Merging of solutions for one pose that are the same configuration.


def merged(arm: Arm, T: Array, q: Array) -> tuple[Array, Numbers]:
    """Return the distinct solutions among several for one pose, in their order.

    Two solutions are the same if they are closer than 1e-9, or if they are closer than 1e-2 and
    their mean is a solution too, to 1e-14 or as exact as they are, as for scattered copies of a
    multiple root. The better of two equal solutions is kept. Angles are compared modulo 2 pi.
    Displacements are compared in arm lengths.

    Args:
        arm: arm of the configurations.
        T: (4, 4) target pose.
        q: (m, n) solutions [rad or m].

    Returns:
        (k, n) distinct solutions, and (k,) the number of given solutions that are equal to each.
    """
    return core.merged_by(core.core_of(arm), arm, T, q)


def wrapped(arm: Arm, q: Array) -> Array:
    """Return configurations with all angles in (-pi, pi].

    Args:
        arm: arm of the configurations.
        q: (..., n) configurations [rad or m].
    """
    turns = np.pi - np.mod(np.pi - q, 2 * np.pi)
    within = (q > -np.pi) & (q <= np.pi)
    return np.where(arm.prismatic | within, q, turns)


# All solutions by descents from many random configurations.


SEED = 20260105


def search(arm: Arm, T: Array, starts: int = 300, seed: int = SEED) -> Array:
    """Return the solutions that Levenberg-Marquardt finds from random configurations.

    Completeness is not proved. `counted_search` also returns the number of starts per solution.

    Args:
        arm: arm whose configurations are searched.
        T: (4, 4) target pose.
        starts: number of random configurations.
        seed: seed of the random numbers.

    Returns:
        (m, n) distinct configurations [rad or m]; samples of a self-motion if one exists.
    """
    return counted_search(arm, T, starts, seed)[0]


def counted_search(
    arm: Arm, T: Array, starts: int = 300, seed: int = SEED
) -> tuple[Array, Numbers]:
    """Return the solutions of `search`, and the number of starts that converged to each of them.

    Args:
        arm: arm whose configurations are searched.
        T: (4, 4) target pose.
        starts: number of random configurations.
        seed: seed of the random numbers.
    """
    return core.found_by(core.core_of(arm), arm, T, starts, seed)


def random_configurations(arm: Arm, T: Array, count: int, seed: int) -> Array:
    """Return random configurations (count, n): angles, and displacements within reach of a pose.

    Args:
        arm: arm of the configurations.
        T: (4, 4) target pose [m].
        count: number of configurations.
        seed: seed of the random numbers.
    """
    indices = np.arange(1, count * arm.size + 1, dtype=np.uint64)
    chance = _split_mix(np.array([seed % 2**64], dtype=np.uint64), indices).reshape(count, arm.size)
    reach = arm.length + np.linalg.norm(T[:3, 3])
    return np.where(arm.prismatic, reach, np.pi) * (1.0 - 2.0 * chance)


def _split_mix(seed: NDArray[np.uint64], indices: NDArray[np.uint64]) -> Array:
    """Return a random number in [0, 1) for each index, by the SplitMix64 generator with this seed.

    Source: Steele, Lea and Flood 2014.
    """
    z = seed + indices * np.uint64(0x9E3779B97F4A7C15)
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    z = z ^ (z >> np.uint64(31))
    chance: Array = (z >> np.uint64(11)).astype(float) * 2.0**-53
    return chance


# Configurations refined to rounding.


def polish(arm: Arm, T: Array, q: Array) -> tuple[Array, Array]:
    """Return the solutions near given configurations.

    A configuration changes only if its residual decreases. An arm of fewer than six joints gets a
    least-squares solution.

    Args:
        arm: arm of the configurations.
        T: (4, 4) target pose of all configurations, or (m, 4, 4) of each.
        q: (m, n) configurations [rad or m].

    Returns:
        (m, n) configurations [rad or m], with angles of improved ones in (-pi, pi], and (m,) their
        residuals max |pose(q) - T| [m and 1].
    """
    return core.polished_by(core.core_of(arm), arm, T, q)


# Reachable pose nearest to a target pose.


_STARTS = 100


@dataclass(frozen=True, slots=True, eq=False)
class Nearest:
    """Reachable pose nearest to a target pose.

    Attributes:
        q: (n,) configuration with this pose [rad or m].
        distance: distance between the origins of both poses [m].
        angle: angle between their orientations [rad].
        T: (4, 4) nearest pose.
    """

    q: Array
    distance: float
    angle: float
    T: Array


def nearest(arm: Arm, T: Array) -> Nearest:
    """Return the pose of least distance^2 + (arm.length * angle)^2 from a target pose.

    It is the best result of several descents from random configurations, each refined by Newton's
    method until the gradient vanishes.

    Args:
        arm: arm whose configurations are searched.
        T: (4, 4) target pose [m].
    """
    return _measure(arm, T, core.nearest_by(core.core_of(arm), arm, T, _STARTS, SEED))


def _measure(arm: Arm, T: Array, q: Array) -> Nearest:
    """Return q (n,) with its pose, and the distance [m] and angle [rad] of the pose to T."""
    pose = arm.pose(q)
    gap = gap_to(T, pose)
    return Nearest(q, float(np.linalg.norm(gap[:3])), float(np.linalg.norm(gap[3:])), pose)


# All configurations of a general six-joint arm for a pose.


@dataclass(frozen=True, slots=True, eq=False)
class General:
    """Arm prepared for the general (Raghavan-Roth) method.

    Attributes:
        arm: arm of six joints.
        prepared: loop and matrices that the method selected for the arm.
        c_loop: arm and selection as structures for the compiled library.
    """

    arm: Arm
    prepared: Prepared
    c_loop: CLoop


def general_of(arm: Arm) -> General:
    """Prepare an arm for `general`; this is done once per arm.

    Raises:
        ModelError: the arm does not have six joints, or has no revolute joint.
        NoClosedForm: the method is singular for this arm.

    Args:
        arm: arm of six joints.
    """
    prepared = prepare(arm)
    if not prepared.regular:
        raise NoClosedForm(
            f"arm {' '.join(arm.names)}: the matrix of the general inverse geometric model is"
            f" singular at every configuration (its regularity is {prepared.regularity:.0e}); use"
            " method='search'"
        )
    return General(arm, prepared, CLoop(arm, prepared))


def general(arm: General, T: Array) -> Array:
    """Return the polished configurations that reach a pose, by elimination.

    Source: Raghavan & Roth 1993.

    Args:
        arm: arm from `general_of`.
        T: (4, 4) target pose [m].

    Returns:
        (m, 6) all isolated solutions, each once [rad or m]; samples if self-motions exist.
    """
    return general_many(arm, np.asarray(T, dtype=float)[None])[1]


def general_many(arm: General, T: Array) -> tuple[Numbers, Array]:
    """Return the polished configurations that reach each of many poses, by elimination.

    Args:
        arm: arm from `general_of`.
        T: (N, 4, 4) target poses [m].

    Returns:
        (m,) indices of the poses, ascending, and (m, 6) configurations for them.
    """
    return solved_by(core.core_of(arm.arm), arm.c_loop, T)
