"""Self-motions of an arm: joint motions that keep the pose of its end frame."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

import mbs.closed_forms.arm_core as core
from mbs.closed_forms.arm import Array
from mbs.errors import ModelError
from mbs.models.inverse_geometry.target import SINGULAR_ERROR, Target, TargetReduction
from mbs.numbers import NONZERO

# Detection of a self-motion at a singular solution, and the curve of its configurations.


_STEP = 0.1
"""Largest step along a self-motion [rad or arm lengths]: 63 steps make one revolution. The tracing
itself, with its other limits, is `arm_descend.c` of the run-time library."""
_MOST_STEPS, _FEW_STEPS = 2000, 60
"""Maximum number of steps along a curve of one freedom (thirty revolutions) and of several
freedoms, for which one curve of a revolution is an example."""
_SHORTEST = 1.0
"""Shortest open self-motion [rad or arm lengths]: a valley at a multiple root is far shorter."""
_AWAY = 0.05
"""Distance [rad or arm lengths] at which a self-motion must still hold the pose. At a double root
the residual there is about 1e-3, far above the tolerance, and the null space is still tangent."""
_TRIES = 24
"""Random null-space directions in which a self-motion is searched if there are several."""
_SEED = 20260108
_INTEGER = 1e-3
"""Distance from integers within which slopes are rounded. A singular configuration and its null
space are known to half the digits or fewer. The residual rejects a wrong rounding."""


@dataclass(frozen=True, slots=True, eq=False)
class ConfigurationCurve:
    """Sampled self-motion: configurations of an arm with the same pose of its end frame.

    Attributes:
        x: (k, n) scaled configurations in order (see `Target`), angles unwrapped.
        closed: whether the last configuration equals the first, up to full revolutions.
        slope: (n,) constant direction of a straight self-motion, scaled to a largest element of 1;
            empty for a curved self-motion.
    """

    x: Array
    closed: bool
    slope: Array


def freedoms(reduced: TargetReduction) -> tuple[int, Array]:
    """Return the number of freedoms of the self-motion through a solution, and its direction.

    Args:
        reduced: equations near the solution, reduced to the null space of the Jacobian.

    Returns:
        Number of freedoms and a direction (n,) in x. The number is 0 for an isolated solution, the
        corank if motion is possible along every null-space direction, and 1 if only along some.
    """
    target, c = reduced.target, reduced.corank
    rng = np.random.default_rng(_SEED)
    directions = [row / np.linalg.norm(row) for row in rng.normal(size=(_TRIES if c > 1 else 1, c))]
    probes = [_probe(reduced, d) for d in directions[:2]]
    if c and all(_solves(target, x) for x in probes):
        return c, (probes[0] - reduced.x) / np.linalg.norm(probes[0] - reduced.x)
    if c > 1:
        around = _nearest_on_sphere(reduced, np.array(directions))
        # keep results on the sphere (relative distance 1); a failed correction ends at its centre
        on = np.abs(np.linalg.norm(around - reduced.x, axis=1) / _AWAY - 1) < 1e-3
        for x in around[on & (target.residual(around * target.unit) < target.tolerance)]:
            return 1, (x - reduced.x) / np.linalg.norm(x - reduced.x)
    return 0, np.zeros(reduced.x.size)


def _solves(target: Target, x: Array) -> bool:
    return bool(target.residual(x * target.unit) < target.tolerance)


def _probe(reduced: TargetReduction, direction: Array) -> Array:
    """Return a configuration (n,) at distance `_AWAY` along a null-space direction.

    It solves the equations only if a self-motion exists there.
    """
    h = _AWAY * direction
    start = reduced.x + reduced.null @ h
    return reduced.target.corrected(start, reduced.null.T, h + reduced.null.T @ reduced.x)


def _nearest_on_sphere(reduced: TargetReduction, directions: Array) -> Array:
    """Return configurations (m, n) of least residual at distance `_AWAY` from the solution.

    The iterations start in null-space directions (m, corank).
    """
    target = reduced.target
    x = reduced.x + _AWAY * (directions @ reduced.null.T)
    library = core.core_of(target.arm)
    return core.on_sphere_by(library, target.arm, target.T, reduced.x, _AWAY, x)


def curve(
    target: Target, q: Array, direction: Array, dimension: int = 1, strictness: float = 0.1
) -> ConfigurationCurve | None:
    """Return the self-motion through a configuration, or None if it is too short.

    Args:
        target: pose that is held.
        q: (n,) configuration on the self-motion [rad or m].
        direction: (n,) direction of the self-motion in x.
        dimension: number of freedoms. For more than one only a short part is sampled.
        strictness: largest residual on the curve, as a fraction of the tolerance of solutions. Near
            a singular configuration the pose is nearly held without any self-motion.
    """
    steps = _MOST_STEPS if dimension == 1 else _FEW_STEPS
    # at the full tolerance the sides of a curve are not distinguished, as its valleys cross
    way = _Way(target, strictness * target.tolerance, steps, strictness < 1.0)
    along = direction / np.linalg.norm(direction)
    start = q / target.unit
    x = target.corrected(start, along[None, :], along[None, :] @ start)
    return way.straight(x, direction) or way.follow(x, along)


@dataclass(frozen=True, slots=True, eq=False)
class _Way:
    """Tracing of a self-motion: pose, largest residual, maximum steps, side check on or off."""

    target: Target
    limit: float
    most: int
    sided: bool

    def straight(self, x: Array, direction: Array) -> ConfigurationCurve | None:
        """Return the self-motion through x if its joints move in constant proportions."""
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
        """Trace the self-motion through x by small steps until it closes or ends."""
        ahead, closed = self._walk(x, direction)
        if closed:
            return ConfigurationCurve(np.array(ahead), True, np.zeros(0))
        back, _ = self._walk(x, -direction)
        samples = np.array([*back[:0:-1], *ahead])
        length = float(np.sum(np.linalg.norm(np.diff(samples, axis=0), axis=1)))
        return ConfigurationCurve(samples, False, np.zeros(0)) if length > _SHORTEST else None

    def _walk(self, start: Array, tangent: Array) -> tuple[list[Array], bool]:
        """Return configurations from the start on, and whether the curve returns to it."""
        target = self.target
        found, closed = core.walked_by(
            core.core_of(target.arm),
            *(target.arm, target.T, start, tangent, self.limit, self.most, self.sided),
        )
        return list(found), closed


Whole = Callable[[Array], Array]
"""Function from chain positions (n,) to the robot configuration (nq,); NaN if loops stay open."""

_MOVES = SINGULAR_ERROR
"""Range of a joint [rad or arm lengths] along a curve, or slope relative to the free joint, above
which the joint moves."""
_AS_NEAR = 1e-3
"""Difference [rad or arm lengths] below which distances of samples are equal. The ends of a curve
are known to 1e-5, the square root of the tolerance over the curvature; samples are 0.1 apart."""
_REFINEMENTS = 5  # of the end of a range; each divides the step by eight: 0.1 to 3e-6
_COMPARABLE = 0.5
"""Fraction of the largest joint range above which a joint nearer to the base is the free joint."""


@dataclass(frozen=True, slots=True, eq=False)
class Family:
    """Self-motion: joints move while the frame keeps its pose.

    Attributes:
        free: name of the joint that parameterises the self-motion.
        moving: names of all moving joints, including the free joint.
        relations: linear equations between moving joints, such as "q4 + q6 = 0.7"; empty for a
            nonlinear self-motion.
        range: lowest and highest position of the free joint [rad or m], or None if it is unlimited.
        dimension: number of freedoms. For more than one, only one curve through the solution is
            described.
    """

    free: str
    moving: tuple[str, ...]
    relations: tuple[str, ...]
    range: tuple[float, float] | None
    dimension: int
    _motion: _SelfMotion = field(repr=False)

    @property
    def samples(self) -> Array:
        """Configurations (k, nq) along the self-motion [rad or m], angles unwrapped."""
        motion = self._motion
        return np.array([motion.whole(q) for q in motion.curve.x * motion.target.unit])

    @property
    def chain_samples(self) -> Array:
        """Chain positions (k, n) along the self-motion [rad or m], angles unwrapped."""
        return self._motion.curve.x * self._motion.target.unit

    def at(self, value: float) -> Array:
        """Return the configuration q (nq,) with the free joint at a value [rad or m].

        If the joint takes the value more than once, the first configuration from the solution on
        is returned.

        Raises:
            ModelError: the free joint cannot reach the value.
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
        """Return the chain positions (n,) with the free joint as near to `value` as possible."""
        q = self._motion.at(value)
        return next(iter(self.configurations_from(value))) if q is None else q

    def configurations_from(self, value: float) -> Array:
        """Return the samples (k, n) of the chain, sorted by |free joint - value|.

        Angles are compared modulo a revolution. Of equally near samples, such as both ends of half
        a revolution, samples above the value come first, so that rounding does not decide.
        """
        motion = self._motion
        away = motion.target.wrapped(self._motion.curve.x - value / motion.target.unit)
        ahead = away[:, motion.free]
        size = np.abs(ahead)
        as_near = size <= np.min(size) + _AS_NEAR
        order = np.lexsort((size, as_near & (ahead < 0), ~as_near))
        return np.asarray((motion.curve.x * motion.target.unit)[order])

    def contains(self, q: Array) -> bool:
        """Whether a configuration q (nq,) [rad or m] is on the self-motion, up to revolutions."""
        return bool(self.meets(np.asarray(q, dtype=float)[None, list(self._motion.indices)])[0])

    def meets(self, q: Array) -> NDArray[np.bool_]:
        """Return (m,) whether each of the chain positions q (m, n) is on the self-motion."""
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
    """Data of a family: curve of chain positions, and position of the chain in the system."""

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
        # samples are nearer than that; past the end of the curve another curve may follow
        if not self.curve.slope.size and abs(near - x[k]) > 2 * _STEP:
            return None
        found = target.corrected(x, held, np.array([near]))
        solved = target.residual(found * target.unit) < target.tolerance
        # solutions have an error of 1e-12 [rad or arm lengths]; an unreachable value misses by far
        if not solved or abs(found[k] - near) > 1e-9:
            return None
        q: Array = found * target.unit
        q[k] = value
        return q

    def _start(self, wanted: float) -> Array:
        """Return the point x (n,) of the curve whose free joint is nearest to `wanted`."""
        samples, k = self.curve.x, self.free
        away = np.abs(self.target.wrapped(samples - wanted)[:, k])
        x = samples[int(np.argmin(away))]
        if self.curve.slope.size:
            shift = self.target.wrapped(np.full(x.size, wanted) - x)[k]
            x = x + shift / self.curve.slope[k] * self.curve.slope
        return np.asarray(x, dtype=float)

    def meets(self, q: Array) -> NDArray[np.bool_]:
        """Compare each q with the curve point in the plane through q normal to the curve."""
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
        met = np.linalg.norm(found - x, axis=1) < SINGULAR_ERROR
        if not self.curve.slope.size:  # from farther away, another curve through x may be found
            met &= np.linalg.norm(start - x, axis=1) < _STEP
        return np.asarray(met)


def family(
    target: Target,
    curve: ConfigurationCurve,
    dimension: int,
    indices: tuple[int, ...],
    whole: Whole,
) -> Family:
    """Return the description of a self-motion.

    Args:
        target: pose that is held.
        curve: configurations along the self-motion.
        dimension: number of freedoms.
        indices: indices of the joints of the chain in q.
        whole: function from chain positions (n,) to the configuration of the robot (nq,).
    """
    moves = np.ptp(curve.x, axis=0) > _MOVES
    free = _free_joint(curve, moves)
    names = target.arm.names
    moving = tuple(name for name, m in zip(names, moves, strict=True) if m)
    motion = _SelfMotion(target, curve, free, indices, whole)
    relations = _relations(target, curve, free) if dimension == 1 else ()
    return Family(names[free], moving, relations, _range(target, curve, free), dimension, motion)


def _free_joint(curve: ConfigurationCurve, moves: Array) -> int:
    """Return the index of the first joint that moves monotonically along most of the range.

    Joints are candidates if they move monotonically, or all moving joints if none does. The first
    candidate with at least half the largest range is selected.
    """
    steps = np.diff(curve.x, axis=0)
    onwards = moves & (np.all(steps > 0, axis=0) | np.all(steps < 0, axis=0))
    span = np.where(onwards if np.any(onwards) else moves, np.ptp(curve.x, axis=0), 0.0)
    return int(np.flatnonzero(span >= _COMPARABLE * np.max(span))[0])


def _relations(target: Target, curve: ConfigurationCurve, free: int) -> tuple[str, ...]:
    """Return one linear equation per joint that moves in proportion to the free joint."""
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
    """Return the text of factor * free + follower = constant, angles in [-pi, pi]."""
    turning = not any(target.arm.prismatic[k] for k in pair)
    if turning and abs(factor - round(factor)) < _MOVES:
        constant = math.remainder(constant, 2 * math.pi)
    # rounding error of angles and lengths that cancel
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
    """Return the lowest and highest position of the free joint, or None if unlimited."""
    x, unit = curve.x[:, free], target.unit[free]
    whole_turn = curve.closed and abs(x[-1] - x[0]) > np.pi
    if curve.slope.size or whole_turn:
        return None
    return float(_end(target, curve, free, -1.0) * unit), float(
        _end(target, curve, free, 1.0) * unit
    )


def _end(target: Target, curve: ConfigurationCurve, free: int, sign: float) -> float:
    """Return the highest (sign 1) or lowest (sign -1) position of a joint along a curve.

    Successive parabolic interpolation from the extreme sample, with a decreasing step. The end of
    an open curve is not refined.
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


# Test of whether configurations are connected by a self-motion of several freedoms.


_SURFACE_STEP, _STEPS = 0.15, 150
"""Step on a self-motion surface [rad or arm lengths], 9 degrees, which four Newton steps correct.
All steps together cover more than three revolutions."""


def connected(target: Target, q: Array, goal: Array) -> NDArray[np.bool_]:
    """Return (m,) whether each configuration is connected to another by a self-motion.

    Every step is the direction to the goal, projected on the null space of the Jacobian. A
    configuration whose steps stall counts as not connected.

    Args:
        target: pose that is held.
        q: (m, n) solutions [rad or m].
        goal: (n,) solution to reach [rad or m].
    """
    x, end = q / target.unit, goal / target.unit
    for _ in range(_STEPS):
        difference = target.wrapped(end - x)
        size = np.linalg.norm(difference, axis=1, keepdims=True)
        if np.all(size < SINGULAR_ERROR):
            break
        _, J = target.excess(x)
        along = _project(J, difference * np.minimum(1.0, _SURFACE_STEP / np.maximum(size, NONZERO)))
        x = _correct(target, x + along)
    arrived = np.linalg.norm(target.wrapped(end - x), axis=1) < SINGULAR_ERROR
    return np.asarray(arrived & (target.residual(x * target.unit) < target.tolerance))


def _project(J: Array, difference: Array) -> Array:
    """Project differences (m, n) on the null spaces of J (m, 6, n)."""
    _, s, Vt = np.linalg.svd(J, full_matrices=False)
    rows = np.where((s > SINGULAR_ERROR)[..., None], Vt, 0.0)
    across = np.einsum("mki,mi->mk", rows, difference)
    return np.asarray(difference - np.einsum("mki,mk->mi", rows, across))


def _correct(target: Target, x: Array) -> Array:
    for _ in range(4):
        e, J = target.excess(x)
        U, s, Vt = np.linalg.svd(J, full_matrices=False)
        inverse = np.where(s > SINGULAR_ERROR, 1.0 / np.maximum(s, SINGULAR_ERROR), 0.0)
        amount = inverse * np.einsum("mik,mi->mk", U, e)
        x = x - np.clip(np.einsum("mki,mk->mi", Vt, amount), -_SURFACE_STEP, _SURFACE_STEP)
    return x
