"""Self-motions as a user reads them: the joint that moves freely, those that move with it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from mbs.errors import ModelError
from mbs.models.inverse_geometry.answers.curves import PostureCurve
from mbs.models.inverse_geometry.answers.target import Target
from mbs.models.inverse_geometry.arm import Array

Whole = Callable[[Array], Array]
"""The posture (nq,) of a robot for one of its chain, (n,); NaN where there is none."""

_MOVES = 1e-6
_SAME = 1e-6
_REFINEMENTS = 5
_COMPARABLE = 0.5
"""Part of the widest motion from which a joint nearer the base is the free one."""


@dataclass(frozen=True, slots=True, eq=False)
class Family:
    """A self-motion: the frame stays while joints move.

    Attributes:
        free: name of the joint that tells its postures apart.
        moving: names of all joints that move, the free one among them.
        relations: between them, such as "q4 + q6 = 0.7"; empty where they are not linear.
        range: lowest and highest position of the free joint [rad or m]; None where it may turn
            all the way round, or slide without end.
        dimension: how many joints may be chosen; with more than one, only the postures along one
            curve through the solution are described.
    """

    free: str
    moving: tuple[str, ...]
    relations: tuple[str, ...]
    range: tuple[float, float] | None
    dimension: int
    _motion: _SelfMotion = field(repr=False)

    @property
    def samples(self) -> Array:
        """(k, nq) postures along it [rad or m], turns unwrapped."""
        motion = self._motion
        return np.array([motion.whole(q) for q in motion.curve.x * motion.target.unit])

    def at(self, value: float) -> Array:
        """The posture q (nq,) whose free joint is at a value [rad or m].

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
        """The posture of the chain (n,) whose free joint is as near to a value as it gets."""
        q = self._motion.at(value)
        return next(iter(self.postures_from(value))) if q is None else q

    def postures_from(self, value: float) -> Array:
        """The samples of the chain (k, n), those whose free joint is near a value first."""
        motion = self._motion
        away = motion.target.wrapped(self._motion.curve.x - value / motion.target.unit)
        order = np.argsort(np.abs(away[:, motion.free]), kind="stable")
        return np.asarray((motion.curve.x * motion.target.unit)[order])

    def contains(self, q: Array) -> bool:
        """Whether a posture (nq,) [rad or m] is one of it, up to whole turns."""
        return bool(self.meets(np.asarray(q, dtype=float)[None, list(self._motion.places)])[0])

    def meets(self, q: Array) -> NDArray[np.bool_]:
        """(m,) whether postures (m, n) of the chain belong to it."""
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
    curve: PostureCurve
    free: int
    places: tuple[int, ...]
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
        found = target.corrected(x, held, np.array([near]))
        solved = target.residual(found * target.unit) < target.tolerance
        if not solved or abs(found[k] - near) > 1e-9:
            return None
        q: Array = found * target.unit
        q[k] = value
        return q

    def _start(self, wanted: float) -> Array:
        """The posture of the curve whose free joint is nearest the wanted position."""
        samples, k = self.curve.x, self.free
        away = np.abs(self.target.wrapped(samples - wanted)[:, k])
        x = samples[int(np.argmin(away))]
        if self.curve.slope.size:
            shift = self.target.wrapped(np.full(x.size, wanted) - x)[k]
            x = x + shift / self.curve.slope[k] * self.curve.slope
        return np.asarray(x, dtype=float)

    def meets(self, q: Array) -> NDArray[np.bool_]:
        """By the postures of the curve in the planes through q that stand across it."""
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
        return np.asarray(np.linalg.norm(found - x, axis=1) < _SAME)


def family(
    target: Target, curve: PostureCurve, dimension: int, places: tuple[int, ...], whole: Whole
) -> Family:
    """The description of a self-motion.

    Args:
        target: the pose that is held.
        curve: postures along it.
        dimension: how many freedoms it has.
        places: of the chain's joints in q.
        whole: the posture (nq,) of the robot for one of the chain, (n,).
    """
    moves = np.ptp(curve.x, axis=0) > _MOVES
    free = _free_joint(curve, moves)
    names = target.arm.names
    moving = tuple(name for name, m in zip(names, moves, strict=True) if m)
    motion = _SelfMotion(target, curve, free, places, whole)
    relations = _relations(target, curve, free) if dimension == 1 else ()
    return Family(names[free], moving, relations, _range(target, curve, free), dimension, motion)


def _free_joint(curve: PostureCurve, moves: Array) -> int:
    """The first joint that tells all postures apart, or moves as far as most of the others.

    Where every joint turns back, postures that share its position are told apart by the side from
    which the curve reaches them.
    """
    steps = np.diff(curve.x, axis=0)
    onwards = moves & (np.all(steps > 0, axis=0) | np.all(steps < 0, axis=0))
    span = np.where(onwards if np.any(onwards) else moves, np.ptp(curve.x, axis=0), 0.0)
    return int(np.flatnonzero(span >= _COMPARABLE * np.max(span))[0])


def _relations(target: Target, curve: PostureCurve, free: int) -> tuple[str, ...]:
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


def _range(target: Target, curve: PostureCurve, free: int) -> tuple[float, float] | None:
    """Lowest and highest position of the free joint, None where nothing bounds it."""
    x, unit = curve.x[:, free], target.unit[free]
    whole_turn = curve.closed and abs(x[-1] - x[0]) > np.pi
    if curve.slope.size or whole_turn:
        return None
    return float(_end(target, curve, free, -1.0) * unit), float(
        _end(target, curve, free, 1.0) * unit
    )


def _end(target: Target, curve: PostureCurve, free: int, sign: float) -> float:
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
