"""Self-motions as a user reads them: the joint that moves freely, those that move with it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

import mbs.closed_forms.arm_core as core
from mbs.closed_forms.arm import Array
from mbs.errors import ModelError
from mbs.models.inverse_geometry.target import Target, TargetReduction
from mbs.numbers import NONZERO

# Self-motions of an arm whose frame is held: where they start, and the configurations along them.


_STEP, _SMALLEST_STEP = 0.1, 1e-5
"""Lengths of a step along a self-motion [rad or arm lengths]: 63 to a turn, and the shortest: a
curve that even this does not follow ends there, and one that is nearer is crossed."""
_STRAIGHT = 0.9
"""Cosine of 26 degrees, by which a step may turn: curves hardly ever cross at less."""
_MOST_STEPS, _FEW_STEPS = 2000, 60
_SHORTEST = 1.0
_AWAY = 0.05
"""Distance [rad or arm lengths] at which a self-motion must still be there: at a double root the
residual is then some 1e-3, far above the tolerance, and the null space still points along."""
_TRIES = 24
_SEED = 20260108
_ZERO = 1e-6
"""Singular values below it are zero: on a self-motion they are known to the root of 1e-12."""
_INTEGER = 1e-3
"""Distance from integers within which slopes are rounded to them: a singular configuration is known
to half its digits or fewer, and so is the null space; where rounding is wrong the residual
tells."""


@dataclass(frozen=True, slots=True, eq=False)
class ConfigurationCurve:
    """Configurations through which an arm moves while its frame stays.

    Attributes:
        x: (k, n) configurations in order, turns unwrapped, see `Target` for the unit.
        closed: whether the last one is the first one again, up to whole turns.
        slope: (n,) the constant direction of a straight one, its largest element 1; empty where
            it bends.
    """

    x: Array
    closed: bool
    slope: Array


def freedoms(reduced: TargetReduction) -> tuple[int, Array]:
    """How many freedoms a self-motion through a solution has, and a direction of it.

    Args:
        reduced: the equations near the solution.

    Returns:
        0 for an isolated solution; the corank where every direction of the null space can be
        followed, 1 where only some can; and a direction (n,) in x.
    """
    target, c = reduced.target, reduced.corank
    rng = np.random.default_rng(_SEED)
    directions = [row / np.linalg.norm(row) for row in rng.normal(size=(_TRIES if c > 1 else 1, c))]
    probes = [_probe(reduced, d) for d in directions[:2]]
    if c and all(_solves(target, x) for x in probes):
        return c, (probes[0] - reduced.x) / np.linalg.norm(probes[0] - reduced.x)
    if c > 1:
        around = _nearest_on_sphere(reduced, np.array(directions))
        # on the sphere, not fallen back to its centre, at a distance of 0 in place of 1
        on = np.abs(np.linalg.norm(around - reduced.x, axis=1) / _AWAY - 1) < 1e-3
        for x in around[on & (target.residual(around * target.unit) < target.tolerance)]:
            return 1, (x - reduced.x) / np.linalg.norm(x - reduced.x)
    return 0, np.zeros(reduced.x.size)


def _solves(target: Target, x: Array) -> bool:
    return bool(target.residual(x * target.unit) < target.tolerance)


def _probe(reduced: TargetReduction, direction: Array) -> Array:
    """The solution at a distance along the null space, if there is one."""
    h = _AWAY * direction
    start = reduced.x + reduced.null @ h
    return reduced.target.corrected(start, reduced.null.T, h + reduced.null.T @ reduced.x)


def _nearest_on_sphere(reduced: TargetReduction, directions: Array) -> Array:
    """Solutions (m, n) at a distance from the centre, from directions (m, corank) on."""
    target = reduced.target
    x = reduced.x + _AWAY * (directions @ reduced.null.T)
    library = core.core_of(target.arm)
    return core.on_sphere_by(library, target.arm, target.T, reduced.x, _AWAY, x)


def curve(
    target: Target, q: Array, direction: Array, dimension: int = 1, strictness: float = 0.1
) -> ConfigurationCurve | None:
    """The self-motion through a configuration; None where it soon ends.

    Args:
        target: the pose that is held.
        q: (n,) configuration on it [rad or m].
        direction: (n,) along it, in x.
        dimension: how many freedoms it has; with more than one, a short way along it is enough.
        strictness: part of the tolerance of solutions within which configurations hold the pose;
            next to a singular configuration those of no self-motion hold it nearly.
    """
    steps = _MOST_STEPS if dimension == 1 else _FEW_STEPS
    # what holds the pose but within the tolerance has valleys that cross, and no sides
    way = _Way(target, strictness * target.tolerance, steps, strictness < 1.0)
    along = direction / np.linalg.norm(direction)
    start = q / target.unit
    x = target.corrected(start, along[None, :], along[None, :] @ start)
    return way.straight(x, direction) or way.follow(x, along)


@dataclass(frozen=True, slots=True, eq=False)
class _Way:
    """How a self-motion is followed: largest residual, number of steps, whether it keeps sides."""

    target: Target
    limit: float
    most: int
    sided: bool

    def straight(self, x: Array, direction: Array) -> ConfigurationCurve | None:
        """The self-motion whose joints move in constant proportions."""
        target = self.target
        slope = direction / direction[np.argmax(np.abs(direction))]
        whole = np.round(slope)
        slope = whole if np.max(np.abs(slope - whole)) < _INTEGER else slope
        turns = bool(np.any(~target.arm.prismatic & (slope != 0)))
        extent = np.linspace(-np.pi if turns else -1.0, np.pi if turns else 1.0, 65)
        samples = x + extent[:, None] * slope
        if np.max(target.residual(samples * target.unit)) > self.limit:
            return None
        return ConfigurationCurve(samples, turns, slope)

    def follow(self, x: Array, direction: Array) -> ConfigurationCurve | None:
        """The self-motion by small steps, to where it closes or ends."""
        ahead, closed = self._walk(x, direction)
        if closed:
            return ConfigurationCurve(np.array(ahead), True, np.zeros(0))
        back, _ = self._walk(x, -direction)
        samples = np.array([*back[:0:-1], *ahead])
        length = float(np.sum(np.linalg.norm(np.diff(samples, axis=0), axis=1)))
        return ConfigurationCurve(samples, False, np.zeros(0)) if length > _SHORTEST else None

    def _walk(self, start: Array, tangent: Array) -> tuple[list[Array], bool]:
        """Configurations from the start on, and whether they come back to it."""
        target = self.target
        found, closed = core.walked_by(
            core.core_of(target.arm),
            *(target.arm, target.T, start, tangent, self.limit, self.most, self.sided),
        )
        return list(found), closed


Whole = Callable[[Array], Array]
"""The configuration (nq,) of a robot for one of its chain, (n,); NaN where there is none."""

_MOVES = 1e-6
"""Way of a joint [rad or arm lengths] along a curve, or slope against the free one, from which it
moves: points of a curve are solved to 1e-12, of singular ones to the root of it."""
_SAME = 1e-6
"""Distance [rad or arm lengths] from a curve of configurations that belong to it, likewise."""
_AS_NEAR = 1e-3
"""Difference of distances [rad or arm lengths] of samples that are as near: the ends of a curve are
known to 1e-5, the root of the tolerance over the curvature, and samples are 0.1 apart."""
_REFINEMENTS = 5
_COMPARABLE = 0.5
"""Part of the widest motion from which a joint nearer the base is the free one."""


@dataclass(frozen=True, slots=True, eq=False)
class Family:
    """A self-motion: the frame stays while joints move.

    Attributes:
        free: name of the joint that tells its configurations apart.
        moving: names of all joints that move, the free one among them.
        relations: between them, such as "q4 + q6 = 0.7"; empty where they are not linear.
        range: lowest and highest position of the free joint [rad or m]; None where it may turn
            all the way round, or slide without end.
        dimension: how many joints may be chosen; with more than one, only the configurations along
            one curve through the solution are described.
    """

    free: str
    moving: tuple[str, ...]
    relations: tuple[str, ...]
    range: tuple[float, float] | None
    dimension: int
    _motion: _SelfMotion = field(repr=False)

    @property
    def samples(self) -> Array:
        """(k, nq) configurations along it [rad or m], turns unwrapped."""
        motion = self._motion
        return np.array([motion.whole(q) for q in motion.curve.x * motion.target.unit])

    @property
    def chain_samples(self) -> Array:
        """(k, n) configurations of the chain along it [rad or m], turns unwrapped."""
        return self._motion.curve.x * self._motion.target.unit

    def at(self, value: float) -> Array:
        """The configuration q (nq,) whose free joint is at a value [rad or m].

        Where the joint passes the value more than once, the first one from the solution on.

        Raises:
            ModelError: the free joint does not get there.
        """
        q = self._motion.at(value)
        whole = np.full(1, np.nan) if q is None else self._motion.whole(q)
        if not np.all(np.isfinite(whole)):
            low, high = self.range or (-math.inf, math.inf)
            raise ModelError(
                f"self-motion: {self.free} is asked to be at {value:.6g}; it moves between"
                f" {low:.6g} and {high:.6g}, give a value from there"
            )
        return whole

    def nearest(self, value: float) -> Array:
        """The configuration of the chain (n,) whose free joint is as near to a value as it gets."""
        q = self._motion.at(value)
        return next(iter(self.configurations_from(value))) if q is None else q

    def configurations_from(self, value: float) -> Array:
        """The samples of the chain (k, n), those whose free joint is near a value first.

        Of those that are as near on either side, such as both ends of half a turn, the ones
        beyond the value come first, not those that rounding brings nearer.
        """
        motion = self._motion
        away = motion.target.wrapped(self._motion.curve.x - value / motion.target.unit)
        ahead = away[:, motion.free]
        size = np.abs(ahead)
        as_near = size <= np.min(size) + _AS_NEAR
        order = np.lexsort((size, as_near & (ahead < 0), ~as_near))
        return np.asarray((motion.curve.x * motion.target.unit)[order])

    def contains(self, q: Array) -> bool:
        """Whether a configuration (nq,) [rad or m] is one of it, up to whole turns."""
        return bool(self.meets(np.asarray(q, dtype=float)[None, list(self._motion.indices)])[0])

    def meets(self, q: Array) -> NDArray[np.bool_]:
        """(m,) whether configurations (m, n) of the chain belong to it."""
        return self._motion.meets(q)

    def __str__(self) -> str:
        if self.dimension > 1:
            return f"{self.dimension} freedoms, among them {', '.join(self.moving)}"
        if self.relations:
            return f"any {self.free} with " + ", ".join(self.relations)
        followers = ", ".join(name for name in self.moving if name != self.free)
        span = "any" if self.range is None else f"{self.range[0]:.4g} .. {self.range[1]:.4g}"
        return f"{self.free} {span}" + (f", {followers} follow" if followers else "")


@dataclass(frozen=True, slots=True, eq=False)
class _SelfMotion:
    """What a family is computed from: the curve in the chain, and the chain in the system."""

    target: Target
    curve: ConfigurationCurve
    free: int
    indices: tuple[int, ...]
    whole: Whole

    def at(self, value: float) -> Array | None:
        target, k = self.target, self.free
        wanted = value / target.unit[k]
        x = self._start(wanted)
        held = np.eye(x.size)[[k]]
        if target.arm.prismatic[k]:
            near = wanted
        else:
            near = x[k] + (np.mod(wanted - x[k] + np.pi, 2 * np.pi) - np.pi)
        # samples are no farther apart; beyond the end of a curve another one may go on
        if not self.curve.slope.size and abs(near - x[k]) > 2 * _STEP:
            return None
        found = target.corrected(x, held, np.array([near]))
        solved = target.residual(found * target.unit) < target.tolerance
        # solved to 1e-12 [rad or arm lengths]; where the free joint does not get, it is far off
        if not solved or abs(found[k] - near) > 1e-9:
            return None
        q: Array = found * target.unit
        q[k] = value
        return q

    def _start(self, wanted: float) -> Array:
        """The configuration of the curve whose free joint is nearest the wanted position."""
        samples, k = self.curve.x, self.free
        away = np.abs(self.target.wrapped(samples - wanted)[:, k])
        x = samples[int(np.argmin(away))]
        if self.curve.slope.size:
            shift = self.target.wrapped(np.full(x.size, wanted) - x)[k]
            x = x + shift / self.curve.slope[k] * self.curve.slope
        return np.asarray(x, dtype=float)

    def meets(self, q: Array) -> NDArray[np.bool_]:
        """By the configurations of the curve in the planes through q that stand across it."""
        target, samples = self.target, self.curve.x
        x = q / target.unit
        away = target.wrapped(samples - x[:, None])
        near = np.argmin(np.linalg.norm(away, axis=2), axis=1)
        start = x + away[np.arange(len(x)), near]
        last = len(samples) - 1
        along = samples[np.minimum(near + 1, last)] - samples[np.maximum(near - 1, 0)]
        along /= np.linalg.norm(along, axis=1, keepdims=True)
        ahead = np.sum(along * (x - start), axis=1, keepdims=True)
        if self.curve.slope.size:
            found = start + ahead * along
        else:
            held = along[:, None, :]
            found = target.corrected(start, held, np.sum(along * x, axis=1, keepdims=True), 12)
        met = np.linalg.norm(found - x, axis=1) < _SAME
        if not self.curve.slope.size:  # from farther off they may lead to another curve through x
            met &= np.linalg.norm(start - x, axis=1) < _STEP
        return np.asarray(met)


def family(
    target: Target,
    curve: ConfigurationCurve,
    dimension: int,
    indices: tuple[int, ...],
    whole: Whole,
) -> Family:
    """The description of a self-motion.

    Args:
        target: the pose that is held.
        curve: configurations along it.
        dimension: how many freedoms it has.
        indices: of the chain's joints in q.
        whole: the configuration (nq,) of the robot for one of the chain, (n,).
    """
    moves = np.ptp(curve.x, axis=0) > _MOVES
    free = _free_joint(curve, moves)
    names = target.arm.names
    moving = tuple(name for name, m in zip(names, moves, strict=True) if m)
    motion = _SelfMotion(target, curve, free, indices, whole)
    relations = _relations(target, curve, free) if dimension == 1 else ()
    return Family(names[free], moving, relations, _range(target, curve, free), dimension, motion)


def _free_joint(curve: ConfigurationCurve, moves: Array) -> int:
    """The first joint that tells all configurations apart, or moves as far as most of the others.

    Where every joint turns back, configurations that share its position are told apart by the side
    from which the curve reaches them.
    """
    steps = np.diff(curve.x, axis=0)
    onwards = moves & (np.all(steps > 0, axis=0) | np.all(steps < 0, axis=0))
    span = np.where(onwards if np.any(onwards) else moves, np.ptp(curve.x, axis=0), 0.0)
    return int(np.flatnonzero(span >= _COMPARABLE * np.max(span))[0])


def _relations(target: Target, curve: ConfigurationCurve, free: int) -> tuple[str, ...]:
    """One equation for every joint that follows in proportion."""
    if not curve.slope.size:
        return ()
    texts = []
    slope = curve.slope / curve.slope[free]
    for k, name in enumerate(target.arm.names):
        if k == free or abs(slope[k]) < _MOVES:
            continue
        factor = -slope[k] * target.unit[k] / target.unit[free]
        q = curve.x[0] * target.unit
        constant = q[k] + factor * q[free]
        texts.append(_relation(target, (free, k), factor, constant, name))
    return tuple(texts)


def _relation(
    target: Target, pair: tuple[int, int], factor: float, constant: float, name: str
) -> str:
    """The equation factor * free + follower = constant; angles within half a turn."""
    turning = not any(target.arm.prismatic[k] for k in pair)
    if turning and abs(factor - round(factor)) < _MOVES:
        constant = math.remainder(constant, 2 * math.pi)
    # what is left of sums of angles and lengths that cancel
    constant = 0.0 if abs(constant) < 1e-12 else constant
    free = target.arm.names[pair[0]]
    if abs(abs(factor) - 1) < _MOVES:
        return (
            f"{free} + {name} = {constant:.6g}"
            if factor > 0
            else (f"{name} - {free} = {constant:.6g}")
        )
    sign = "+" if factor > 0 else "-"
    return f"{name} {sign} {abs(factor):.6g} {free} = {constant:.6g}"


def _range(target: Target, curve: ConfigurationCurve, free: int) -> tuple[float, float] | None:
    """Lowest and highest position of the free joint, None where nothing bounds it."""
    x, unit = curve.x[:, free], target.unit[free]
    whole_turn = curve.closed and abs(x[-1] - x[0]) > np.pi
    if curve.slope.size or whole_turn:
        return None
    return float(_end(target, curve, free, -1.0) * unit), float(
        _end(target, curve, free, 1.0) * unit
    )


def _end(target: Target, curve: ConfigurationCurve, free: int, sign: float) -> float:
    """The highest position of a joint along a curve, the lowest for the other sign.

    The highest sample is moved to the vertex of the parabola through it and its neighbours, again
    and again with closer neighbours; an end of the curve itself stays.
    """
    samples = curve.x
    k, last = int(np.argmax(sign * samples[:, free])), len(samples) - 1
    if k in (0, last) and not curve.closed:
        return float(samples[k, free])
    before = samples[k - 1] if k else samples[last - 1] + samples[0] - samples[last]
    after = samples[k + 1] if k < last else samples[1] + samples[last] - samples[0]
    x, along = samples[k], (after - before) / np.linalg.norm(after - before)
    step = float(np.linalg.norm(after - before)) / 2
    for _ in range(_REFINEMENTS):
        s = np.array([-step, 0.0, step])
        held = np.broadcast_to(along, (3, 1, x.size))
        near = target.corrected(x + s[:, None] * along, held, (along @ x + s)[:, None], 12)
        low, middle, high = (float(value) for value in near[:, free])
        bend = low - 2 * middle + high
        if bend * sign >= 0:
            break
        x = x + max(-1.0, min(1.0, 0.5 * (low - high) / bend)) * step * along
        x = target.corrected(x, along[None, :], along[None, :] @ x, 12)
        step /= 8
    return float(x[free])


# Which configurations are joined by a self-motion of several freedoms.


_SURFACE_STEP, _STEPS = 0.15, 150
"""Length of a step on a surface of configurations [rad or arm lengths], 9 degrees, which four
Newton steps bring back to it; all steps together are more than three turns."""
_ARRIVED = 1e-6
"""Distance [rad or arm lengths] from the goal, itself known to the root of 1e-12 where singular."""


def connected(target: Target, q: Array, goal: Array) -> NDArray[np.bool_]:
    """Whether configurations reach another one in small steps that keep the frame where it is.

    Every step goes as straight towards the goal as the null space of the Jacobian allows; one
    that gets stuck on the way counts as not connected.

    Args:
        target: the pose that is held.
        q: (m, n) solutions [rad or m].
        goal: (n,) another one.
    """
    x, end = q / target.unit, goal / target.unit
    for _ in range(_STEPS):
        difference = target.wrapped(end - x)
        size = np.linalg.norm(difference, axis=1, keepdims=True)
        if np.all(size < _ARRIVED):
            break
        _, J = target.excess(x)
        along = _project(J, difference * np.minimum(1.0, _SURFACE_STEP / np.maximum(size, NONZERO)))
        x = _correct(target, x + along)
    arrived = np.linalg.norm(target.wrapped(end - x), axis=1) < _ARRIVED
    return np.asarray(arrived & (target.residual(x * target.unit) < target.tolerance))


def _project(J: Array, difference: Array) -> Array:
    """Ways (m, n) within the null spaces of J, (m, 6, n)."""
    _, s, Vt = np.linalg.svd(J, full_matrices=False)
    rows = np.where((s > _ZERO)[..., None], Vt, 0.0)
    across = np.einsum("mki,mi->mk", rows, difference)
    return np.asarray(difference - np.einsum("mki,mk->mi", rows, across))


def _correct(target: Target, x: Array) -> Array:
    for _ in range(4):
        e, J = target.excess(x)
        U, s, Vt = np.linalg.svd(J, full_matrices=False)
        inverse = np.where(s > _ZERO, 1.0 / np.maximum(s, _ZERO), 0.0)
        amount = inverse * np.einsum("mik,mi->mk", U, e)
        x = x - np.clip(np.einsum("mki,mk->mi", Vt, amount), -_SURFACE_STEP, _SURFACE_STEP)
    return x
