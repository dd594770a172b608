"""Self-motions of an arm whose frame is held: where they start, and the postures along them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mbs.models.inverse_geometry.answers.multiplicity import TargetReduction
from mbs.models.inverse_geometry.answers.target import Target
from mbs.models.inverse_geometry.arm import Array

_STEP, _SMALLEST_STEP = 0.1, 1e-3
_MOST_STEPS, _FEW_STEPS = 2000, 60
_SHORTEST = 1.0
_AWAY = 0.05
_TRIES = 24
_SEED = 20260108
_INTEGER = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class PostureCurve:
    """Postures through which an arm moves while its frame stays.

    Attributes:
        x: (k, n) postures in order, turns unwrapped, see `Target` for the unit.
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
    for direction in directions if c > 1 else ():
        x = _nearest_on_sphere(reduced, direction)
        if _solves(target, x) and abs(np.linalg.norm(x - reduced.x) / _AWAY - 1) < 1e-3:
            return 1, (x - reduced.x) / np.linalg.norm(x - reduced.x)
    return 0, np.zeros(reduced.x.size)


def _solves(target: Target, x: Array) -> bool:
    return bool(target.residual(x * target.unit) < target.tolerance)


def _probe(reduced: TargetReduction, direction: Array) -> Array:
    """The solution at a distance along the null space, if there is one."""
    h = _AWAY * direction
    start = reduced.x + reduced.null @ h
    return reduced.target.corrected(start, reduced.null.T, h + reduced.null.T @ reduced.x)


def _nearest_on_sphere(reduced: TargetReduction, direction: Array) -> Array:
    """A solution at a distance from the centre in any direction of the null space."""
    x = reduced.x + _AWAY * (reduced.null @ direction)
    for _ in range(60):
        e, J = reduced.target.excess(x)
        away = x - reduced.x
        rows = np.vstack([J, away / _AWAY])
        right = np.append(e, 0.5 * (away @ away / _AWAY - _AWAY))
        step = np.linalg.lstsq(rows, -right, rcond=1e-10)[0]
        size = float(np.linalg.norm(step))
        x = x + step * min(1.0, 0.3 * _AWAY / max(size, 1e-300))
        if size < 1e-14:
            break
    return x


def curve(
    target: Target, q: Array, direction: Array, dimension: int = 1, strictness: float = 0.1
) -> PostureCurve | None:
    """The self-motion through a posture; None where it soon ends.

    Args:
        target: the pose that is held.
        q: (n,) posture on it [rad or m].
        direction: (n,) along it, in x.
        dimension: how many freedoms it has; with more than one, a short way along it is enough.
        strictness: part of the tolerance of solutions within which postures hold the pose; next
            to a singular posture those of no self-motion hold it nearly.
    """
    steps = _MOST_STEPS if dimension == 1 else _FEW_STEPS
    way = _Way(target, strictness * target.tolerance, steps)
    along = direction / np.linalg.norm(direction)
    start = q / target.unit
    x = target.corrected(start, along[None, :], along[None, :] @ start)
    return way.straight(x, direction) or way.followed(x, along)


@dataclass(frozen=True, slots=True, eq=False)
class _Way:
    """How a self-motion is followed: largest residual, and number of steps."""

    target: Target
    limit: float
    most: int

    def straight(self, x: Array, direction: Array) -> PostureCurve | None:
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
        return PostureCurve(samples, turns, slope)

    def followed(self, x: Array, direction: Array) -> PostureCurve | None:
        """The self-motion by small steps, to where it closes or ends."""
        ahead, closed = self._walked(x, direction)
        if closed:
            return PostureCurve(np.array(ahead), True, np.zeros(0))
        back, _ = self._walked(x, -direction)
        samples = np.array([*back[:0:-1], *ahead])
        length = float(np.sum(np.linalg.norm(np.diff(samples, axis=0), axis=1)))
        return PostureCurve(samples, False, np.zeros(0)) if length > _SHORTEST else None

    def _walked(self, start: Array, tangent: Array) -> tuple[list[Array], bool]:
        """Postures from the start on, and whether they come back to it."""
        points, step, target = [start], _STEP, self.target
        while len(points) < self.most and step > _SMALLEST_STEP:
            x = _stepped(target, points[-1], tangent, step)
            moved = x - points[-1]
            far = np.linalg.norm(moved) > 1.5 * step
            if far or target.residual(x * target.unit) > self.limit:
                step /= 2
                continue
            tangent = _tangent(target, x, moved / np.linalg.norm(moved))
            points.append(x)
            step = min(2 * step, _STEP)
            home = target.wrapped(start - x)
            near = np.linalg.norm(home) <= 1.1 * step
            if len(points) > 3 and near and 0 < home @ tangent <= step:
                return [*points, x + home], True
        return points, False


def _stepped(target: Target, x: Array, tangent: Array, step: float) -> Array:
    held = tangent[None, :]
    ahead = x + step * tangent
    return target.corrected(ahead, held, held @ ahead, 12)


def _tangent(target: Target, x: Array, before: Array) -> Array:
    """The direction along which the equations stay solved, nearest the one before."""
    J = target.excess(x)[1]
    _, s, Vt = np.linalg.svd(J)
    rank = min(int(np.sum(s > 1e-6)), x.size - 1)
    null = Vt[rank:].T
    along: Array = null @ (null.T @ before)
    size = float(np.linalg.norm(along))
    return along / size if size > 0.1 else before
