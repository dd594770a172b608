"""Solutions by many descents, polished and merged; the general method; the nearest pose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import mbs.closed_forms.arm_core as core
from mbs.closed_forms.arm import Arm, Array, gap_to
from mbs.closed_forms.arm_core import HandedLoop, Numbers, solved_by
from mbs.closed_forms.raghavan_roth.numbers import Prepared, candidates_many, prepare
from mbs.errors import NoClosedForm

# Levenberg and Marquardt's steps of many configurations towards a target pose, on numpy arrays.


_STEPS = 60  # at most
_STALLS = 3  # steps without progress
_FINE = 1e-26  # costs below it are those of solutions but for rounding
_FINEST = 1e-31  # nothing is left to gain
_LEAST = 1e-31  # damping, so that no matrix is singular


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


def descend(arm: Arm, T: Array, q: Array) -> tuple[Array, Array]:
    """Configurations (m, n) where rounding or a smallest distance stops; their costs (m,).

    The damping is proportional to the cost, which makes the last steps those of Newton, even
    where the Jacobian loses rank.
    Source: Yamashita and Fukushima 2001.

    Args:
        arm: whose configurations.
        T: (4, 4) target pose of all, or (m, 4, 4) of each.
        q: (m, n) configurations to start from [rad or m].
    """
    target = np.broadcast_to(T, (len(q), 4, 4))
    q = np.array(q, dtype=float)
    cost, gap, J = examine_arm(arm, target, q)
    # of the cost, at first; what lies between Newton's method and the gradient's
    damping, stalls = np.full(len(q), 0.1), np.zeros(len(q), dtype=int)
    for _ in range(_STEPS):
        going = np.flatnonzero((cost > _FINEST) & (stalls < _STALLS))
        if not len(going):
            break
        dx = _step(J[going], gap[going], damping[going] * cost[going] + _LEAST)
        tried = q[going] + arm.units * dx
        tried_cost, tried_gap, tried_J = examine_arm(arm, target[going], tried)
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
    # weights by how much a step brings, as in trust regions: most of the cost, some, or little
    easier = np.where(gain > 0.5, 0.2, np.where(gain > 0.1, 0.5, 2.0)) * weight
    # a rejected step is shorter: at once where damping had all but gone
    harder = np.where(weight < 1e-3, 1e-2, 4.0 * weight)
    damping[going] = np.where(better, easier, harder)
    # less than a twentieth of the cost is no progress
    slow = np.where(gain < 5e-2, stalls[going] + 1, 0)
    # of entries of about one: the step is then below 1e-12 of the gap
    hopeless = (before < _FINE) | (damping[going] * before > 1e12)
    stalls[going] = np.where(better, slow, stalls[going] + hopeless)


# Which of many solutions for one pose are the same configuration.


_SAME, _CLOSE, _BETWEEN = 1e-9, 1e-2, 1e-14  # see `merged`
_REACHED = 1e-12  # relative residual of a solution: 1e-16 of rounding, and room for long arms


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
        arm: whose configurations.
        T: (4, 4) target pose.
        q: (m, n) solutions [rad or m].
    """
    library = core.core_of(arm)
    if library is not None:
        return Merged(*core.merged_by(library, arm, T, q))
    return merged_with_numpy(arm, T, q)


def merged_with_numpy(arm: Arm, T: Array, q: Array) -> Merged:
    """`merged` where there is no C compiler."""
    residual = relative_residual(arm, T, q)
    indices, hits = list[int](), list[int]()
    for number, own in enumerate(q):
        twin = _twin(arm, T, q[indices], own)
        if twin is None:
            indices.append(number)
            hits.append(1)
            continue
        hits[twin] += 1
        if residual[number] < residual[indices[twin]]:
            indices[twin] = number
    return Merged(np.array(q[indices], dtype=float), np.array(hits, dtype=np.int64))


def reached(arm: Arm, T: Array, q: Array) -> NDArray[np.bool_]:
    """(...,) whether configurations have the pose: a relative residual below 1e-12."""
    return relative_residual(arm, T, q) < _REACHED


def relative_residual(arm: Arm, T: Array, q: Array) -> Array:
    """(...,) max |arm.pose(q) - T| with lengths in arm lengths."""
    miss = np.abs(arm.pose(q) - T)
    miss[..., :3, 3] /= arm.length
    worst: Array = np.max(miss, axis=(-2, -1))
    return worst


def wrapped(arm: Arm, q: Array) -> Array:
    """Configurations with all angles in (-pi, pi]."""
    turns = np.pi - np.mod(np.pi - q, 2 * np.pi)
    within = (q > -np.pi) & (q <= np.pi)
    return np.where(arm.prismatic | within, q, turns)


def _twin(arm: Arm, T: Array, found: Array, own: Array) -> int | None:
    if not len(found):
        return None
    difference = own - found
    difference = np.where(arm.prismatic, difference, wrapped(arm, difference))
    farthest = np.max(np.abs(difference / arm.units), axis=-1)
    for number in np.flatnonzero(farthest < _CLOSE):
        half = found[number] + 0.5 * difference[number]
        middle, *ends = relative_residual(arm, T, np.array([half, found[number], own]))
        if farthest[number] < _SAME or middle < max(_BETWEEN, *ends):
            return int(number)
    return None


# All solutions by many descents from random configurations.


SEED = 20260105


def search(arm: Arm, T: Array, starts: int = 300, seed: int = SEED) -> Array:
    """The solutions that Levenberg and Marquardt's steps lead to from random configurations.

    Nothing proves that they are all; `counted_search` tells how often each was met.

    Args:
        arm: whose configurations; compiled for up to seven joints.
        T: (4, 4) target pose.
        starts: how many random configurations.
        seed: of them.

    Returns:
        (m, n) distinct configurations [rad or m]; samples of the families where there are such.
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
    q = wrapped(arm, descend(arm, T, random_configurations(arm, T, starts, seed))[0])
    return merged_with_numpy(arm, T, q[reached(arm, T, q)])


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
        arm: whose configurations.
        T: (4, 4) target pose of all, or (m, 4, 4) of each.
        q: (m, n) configurations [rad or m].
    """
    library = core.core_of(arm)
    if library is None:
        return polished_with_numpy(arm, T, q)
    return Polished(*core.polished_by(library, arm, T, q))


def polished_with_numpy(arm: Arm, T: Array, q: Array) -> Polished:
    """`polish` where there is no C compiler."""
    before = arm.residual(q, T)
    better = wrapped(arm, descend(arm, T, q)[0])
    after = arm.residual(better, T)
    improved = after < before
    return Polished(np.where(improved[:, None], better, q), np.where(improved, after, before))


# The reachable pose that is nearest to a wanted one.


_STARTS, _KEPT, _REFINEMENTS = 100, 8, 60
_NUDGE = 1e-5  # of joints, for differences of the slope
_FLAT = 1e-15  # slopes below it are rounding
_ENDLESS = 1e6  # shift at which a step is a millionth of the slope, and lowers nothing
_ALIKE = 1e-14  # relative rounding of costs
_EQUAL = 1e-6  # costs that are closer, relatively, are of one valley


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
        arm: whose configurations; compiled for up to seven joints.
        T: (4, 4) target pose [m].
    """
    library = core.core_of(arm)
    if library is not None:
        return _measure(arm, T, core.nearest_by(library, arm, T, _STARTS, SEED))
    return _measure(arm, T, nearest_with_numpy(arm, T))


def nearest_with_numpy(arm: Arm, T: Array) -> Array:
    """(n,) the configuration of `nearest` where there is no C compiler."""
    q, cost = descend(arm, T, random_configurations(arm, T, _STARTS, SEED))
    best = [_refine(arm, T, q[k]) for k in _apart(cost)]
    lowest = min(best, key=lambda found: found[1])
    return wrapped(arm, lowest[0])


def _measure(arm: Arm, T: Array, q: Array) -> Nearest:
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


def _refine(arm: Arm, T: Array, q: Array) -> tuple[Array, float]:
    """Newton's method with differences of the slope; the configuration and its cost."""
    cost, slope = _sloped(arm, T, q)
    curvature: Array | None = None
    # of curvatures of about one: hardly any, and no step is endless where one of them is zero
    shift = 1e-9
    for _ in range(_REFINEMENTS):
        if cost <= _FINEST or np.linalg.norm(slope) <= _FLAT or shift > _ENDLESS:
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
            # less would be lost beside curvatures of about one
            shift, curvature = max(0.1 * shift, 1e-12), None
        else:
            # ten times shorter, and from where a shift is felt
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
    cost, gap, J = examine_arm(arm, T, q)
    return cost, -np.einsum("...ij,...i->...j", J, gap)


def _curvature(arm: Arm, T: Array, q: Array) -> Array:
    nudges = _NUDGE * np.diag(arm.units)
    ahead, behind = _sloped(arm, T, q + nudges)[1], _sloped(arm, T, q - nudges)[1]
    H: Array = (ahead - behind) / (2 * _NUDGE)
    return 0.5 * (H + H.T)


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
    library = core.core_of(arm.arm)
    if library is not None:
        return solved_by(library, arm.handed, T)
    return general_with_numpy(arm, T)


def general_with_numpy(arm: General, T: Array) -> tuple[Numbers, Array]:
    """`general_many` where there is no C compiler."""
    number, q = candidates_many(arm.prepared, T)
    q = polished_with_numpy(arm.arm, T[number], q).q
    solved = reached(arm.arm, T[number], q)
    number, q = number[solved], q[solved]
    found = [merged_with_numpy(arm.arm, T[k], q[number == k]).q for k in range(len(T))]
    numbers = np.repeat(np.arange(len(T)), [len(own) for own in found])
    return numbers, np.concatenate([np.zeros((0, 6)), *found])
