"""Closed configuration that is nearest to guessed positions, by Newton's method on a manifold."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import casadi
import numpy as np
from casadi import SX, Function
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.assembly.tree import norm_rows
from mbs.loops.closing import LARGEST_MOVE, Closing, difference, unwound
from mbs.loops.closure_equations import closure_rows
from mbs.loops.cut_positions import cut_positions, cut_positions_and_slopes
from mbs.loops.guess_target import EQUAL, GuessTarget
from mbs.numbers import OnArrays, on_arrays

Vector = NDArray[np.float64]

MET = 1e-9
"""Largest difference from a guess that counts as met [rad, or sizes of the mechanism]: iterations
leave 1e-12."""
_FLAT = 1e-6
"""Relative singular value that counts as zero: configurations are closed to 1e-12."""
_LEVEL = 1e-7
"""Second derivatives of half the square of the distance, in rad or sizes, that count as zero:
rounding leaves 1e-13, and a guess out of reach by 1e-5 leaves about 1e-5."""
_ROUNDING = 1e-11
"""Slope of half the square of the distance that counts as zero if its curvature vanishes: rounding
leaves 1e-14."""
_LONGEST = 0.5
"""Longest step [rad, or sizes of the mechanism]: range of the linear approximation of the loops."""
_SHORT = 1e-3
"""Step below which the gradient decides instead of the distance, whose square changes by less than
the rounding of 1e-16 for steps of 1e-8."""
_SHORTEST = 1e-12
"""Step that changes no digit of a configuration that is closed to 1e-12."""
_BASIN = 1e-3
"""Distance from a known minimum at which a search ends [rad or m]: branches that are nearer to each
other meet there."""
_STEPS, _ROUNDS = 60, 60
"""Largest number of steps, of which six to ten are usual, and largest number of steps along
positions of equal distance, which converge linearly."""
_VISIBLE = 1e-13
"""Smallest decrease of the objective that can be measured: rounding is 1e-16."""
_GAIN = 1e-4
"""Smallest ratio of actual to predicted decrease: the usual value of Armijo's rule."""


def is_movable(closing: Closing, q: Vector) -> bool:
    """Whether the loops allow a motion of the free positions at a closed configuration.

    Args:
        closing: closure rows and the locked positions.
        q: (nq,) closed configuration.
    """
    return len(closing.free) > 0 and _null_space(closing, q)[1].shape[1] > 0


def least_distance(closing: Closing, target: GuessTarget, starts: Iterable[Vector]) -> list[Vector]:
    """Return the configurations of least distance that are reached from some closed ones.

    The distance is the sum of squares of the differences from the guessed positions. Lengths are
    divided by the size of the mechanism. Newton's method on the constraint manifold finds its
    minima from each start. If the distance does not determine the configuration, the result also
    has the least sum of squares of the differences of all positions from `target.start`. Different
    minima are returned if their distances are within 1e-6 of the least distance.

    Source: Absil, Mahony and Sepulchre 2008, chapter 6, Newton's method on manifolds.

    Args:
        closing: closure rows and the locked positions.
        target: guessed positions.
        starts: (nq,) closed configurations.
    """
    objective, minima = _objective(closing, target, target.guessed), list[Vector]()
    for start in starts:
        q = _descended(objective, start, minima)
        if q is not None and not _is_listed(closing, q, minima, EQUAL):
            minima.append(q)
    misses = [target.miss(closing, q) for q in minima]
    least = min(misses, default=0.0)
    found = list[Vector]()
    for q, miss in zip(minima, misses, strict=True):
        if miss <= least + EQUAL:
            exact = _with_met_guesses(closing, target, nearest_in_all(closing, target, q))
            near = unwound(closing, exact, target.start)
            if not _is_listed(closing, near, found, EQUAL):
                found.append(near)
    return found


def _is_listed(closing: Closing, q: Vector, found: Iterable[Vector], reach: float) -> bool:
    """Whether `found` has a configuration within `reach` [rad or m] of q in every position."""
    return any(np.max(np.abs(difference(closing.system, q, x))) < reach for x in found)


def _with_met_guesses(closing: Closing, target: GuessTarget, q: Vector) -> Vector:
    """Return the closed q (nq,) with guessed positions set to their guess if they agree to 1e-9."""
    moves = target.moves(q) / target.units(closing)
    met = {k for k in target.guessed if abs(moves[k]) < MET}
    locked = tuple(sorted({*closing.locked, *(k for k in met if k < closing.system.nq)}))
    given = [k for k in locked if k not in closing.locked]
    exact = q.copy()
    exact[given] -= moves[given] * target.units(closing)[given]
    found = replace(closing, locked=locked).nearest(exact)
    return found.q if found.is_closed and np.max(np.abs(found.q - q)) < EQUAL else q


# Newton's method on the manifold.


@dataclass(frozen=True, slots=True, eq=False)
class _Objective:
    """Half the sum of squares of the differences of some positions from a target.

    Attributes:
        closing: closure rows and the locked positions.
        target: guessed positions.
        counted: (n,) weight of each position: 1 if it counts, else 0.
        units: (n,) divisors of differences of all positions [1 or m].
    """

    closing: Closing
    target: GuessTarget
    counted: Vector
    units: Vector

    def value(self, q: Vector) -> float:
        """Return the objective at q (nq,) [rad^2, or squared sizes of the mechanism]."""
        moves = self.counted * self.target.moves(q) / self.units
        return float(moves @ moves) / 2

    def point(self, q: Vector) -> _ManifoldPoint:
        """Return the objective and its derivatives on the manifold at the closed q (nq,)."""
        closing, nq, units = self.closing, self.closing.system.nq, self.units
        counted, free = self.counted, closing.free
        U, N, values, V = _null_space(closing, q)
        moves = counted * self.target.moves(q) / units
        slopes = np.eye(len(moves), nq)
        if len(moves) > nq:
            slopes[nq:] = cut_positions_and_slopes(closing.system)(q, closing.p)[1]
        slopes = (slopes / units[:, None] * units[:nq])[:, free]
        gradient = slopes.T @ moves
        forces = -U @ ((V @ gradient) / values) / closing.sizes
        at_cut = np.zeros(len(closing.system.cut_coordinates))
        if len(moves) > nq:
            at_cut += (moves / units)[nq:]
        rows = len(forces) - len(closing.aims)
        for k, force in zip(closing.aims, forces[rows:], strict=True):
            at_cut[k] += force
        curved = _curvature(closing.system)(q, closing.p, forces[:rows], at_cut)[0]
        hessian = slopes.T @ (counted[:, None] * slopes)
        hessian += curved[np.ix_(free, free)] * np.outer(units[free], units[free])
        if not np.isfinite(hessian).all():  # a position of a cut joint has no derivative there
            N = N[:, :0]
        value = float(moves @ moves) / 2
        return _ManifoldPoint(value, N.T @ gradient, N.T @ hessian @ N, N, units[free])

    def moved(self, q: Vector, point: _ManifoldPoint, step: Vector) -> Vector | None:
        """Return the closed configuration after a step from q; None if none is near.

        Args:
            q: (nq,) closed configuration.
            point: derivatives at q.
            step: (m,) step in the basis of the motions that the loops allow at q.
        """
        free, predicted = self.closing.free, q.copy()
        predicted[free] += point.units * (point.basis @ step)
        found = self.closing.nearest(predicted)
        off = np.max(np.abs(found.q - predicted)[free] / point.units, initial=0.0)
        return found.q if found.is_closed and off < LARGEST_MOVE else None


def _objective(closing: Closing, target: GuessTarget, indices: Iterable[int]) -> _Objective:
    """Return half the squared distance from a target, of the positions with these indices."""
    units = target.units(closing)
    counted = np.zeros(len(units))
    counted[list(indices)] = 1.0
    return _Objective(closing, target, counted, units)


@dataclass(frozen=True, slots=True, eq=False)
class _ManifoldPoint:
    """Value and derivatives of an objective at a point of the manifold.

    Attributes:
        value: value of the objective.
        gradient: (m,) gradient in the directions of the basis.
        hessian: (m, m) Riemannian Hessian in these directions.
        basis: (n, m) orthonormal directions in which free positions can move.
        units: (n,) divisors of differences of the free positions [1 or m].
    """

    value: float
    gradient: Vector
    hessian: Vector
    basis: Vector
    units: Vector


def _descended(objective: _Objective, start: Vector, known: Sequence[Vector] = ()) -> Vector | None:
    """Return the minimum (nq,) of an objective reached by Newton's method from a closed start.

    None if the iteration comes close to one of the `known` minima.
    """
    q, longest = start, _LONGEST
    point = objective.point(q)
    for _ in range(_STEPS):
        step = _newton_step(point.gradient, point.hessian, longest)
        size, predicted = float(np.linalg.norm(step)), -float(point.gradient @ step)
        if size < _SHORTEST:
            break
        trial = objective.moved(q, point, step)
        after = None if trial is None else objective.point(trial)
        if trial is None or after is None or not _is_better(after, point, size, predicted):
            longest = size / 4
            continue
        q, point, longest = trial, after, min(2 * max(size, longest), _LONGEST)
        if known and _is_listed(objective.closing, q, known, _BASIN):
            return None
    return q


def _is_better(
    after: _ManifoldPoint, before: _ManifoldPoint, size: float, predicted: float
) -> bool:
    """Whether a step decreases the objective, or for a short step the norm of its gradient."""
    if predicted > _VISIBLE and after.value <= before.value - _GAIN * predicted:
        return True
    return size < _SHORT and bool(np.linalg.norm(after.gradient) < np.linalg.norm(before.gradient))


def _newton_step(gradient: Vector, hessian: Vector, longest: float) -> Vector:
    """Return the step (m,) -|H|^-1 g of at most `longest`; |H| has absolute eigenvalues.

    Absolute eigenvalues of the Hessian avoid maxima and saddle points.
    """
    if not len(gradient):
        return np.zeros(0)
    values, vectors = np.linalg.eigh(hessian)
    rates = vectors.T @ gradient
    rates[(np.abs(values) < _LEVEL) & (np.abs(rates) < _ROUNDING)] = 0.0
    step: Vector = -vectors @ (rates / np.maximum(np.abs(values), _LEVEL))
    size = float(np.linalg.norm(step))
    return step * min(1.0, longest / size) if size > 0 else step


def nearest_in_all(closing: Closing, target: GuessTarget, q: Vector) -> Vector:
    """Return the closed configuration nearest in all positions among those nearest to the guess.

    If the guess does not determine the configuration, it moves along configurations of equal
    distance from the guess.

    Args:
        closing: closure rows and the locked positions.
        target: guessed positions, and start values of all other positions.
        q: (nq,) configuration with the least distance from the guess.
    """
    own = _objective(closing, target, target.guessed)
    every = _objective(closing, target, range(len(target.moves(q))))
    longest, value = _LONGEST, every.value(q)
    for _ in range(_ROUNDS):
        point, all_of = own.point(q), every.point(q)
        if not len(point.gradient):
            break
        values, vectors = np.linalg.eigh(point.hessian)
        level = vectors[:, np.abs(values) < _LEVEL]
        slope, curvature = level.T @ all_of.gradient, level.T @ all_of.hessian @ level
        step = _newton_step(slope, curvature, longest)
        size = float(np.linalg.norm(step))
        if size < EQUAL * _SHORT:
            break
        trial = own.moved(q, point, level @ step)
        trial = None if trial is None else _descended(own, trial)
        if trial is None or every.value(trial) >= value or own.value(trial) > point.value + MET**2:
            longest = size / 4
            continue
        q, value, longest = trial, every.value(trial), min(2 * size, _LONGEST)
    return q


def _null_space(closing: Closing, q: Vector) -> tuple[Vector, Vector, Vector, Vector]:
    """Return the singular value decomposition of the closure Jacobian at q, split at its rank r.

    Returns:
        Left vectors (m, r), basis of the null space (n, n - r), singular values (r,), right
        vectors (r, n), for free positions in rad or sizes.
    """
    units = closing.position_units[closing.free]
    J = closing.rows(q)[1] / closing.sizes[:, None] * units
    U, values, V = np.linalg.svd(J, full_matrices=True)
    rank = int(np.sum(values > _FLAT * np.max(values, initial=0.0)))
    return U[:, :rank], V[rank:].T, values[:rank], V[:rank]


def _curvature(system: System) -> OnArrays:
    """Return ``(q, p, l, m) -> H`` (nq, nq): Hessian of l' rows + m' positions of cut joints."""

    def build() -> OnArrays:
        q, p = SX.sym("q", system.nq), system.p
        rows = casadi.vertcat(closure_rows(system, q), norm_rows(system.tree, q))
        cut = cut_positions(system)(q, p)
        on_rows, on_cut = SX.sym("l", rows.numel()), SX.sym("m", cut.numel())
        total = casadi.dot(on_rows, rows) + casadi.dot(on_cut, cut)
        hessian = casadi.densify(casadi.hessian(total, q)[0])
        return on_arrays(Function("curvature", [q, p, on_rows, on_cut], [hessian]))

    function: OnArrays = system.cached("curvature of the manifold", build)
    return function
