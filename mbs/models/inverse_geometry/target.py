"""A pose that a serial arm is wanted to take, and how many roots meet in a solution.

Positions are counted in x = q / unit, where the unit is the arm's length for slides and one radian
for turns, so that a number in x or in the equations means the same for every joint and every row.
"""

from __future__ import annotations

import ctypes
import functools
import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

import mbs.closed_forms.arm_core as core
from mbs.closed_forms.arm import Arm, Array, gap_to
from mbs.numbers import NONZERO

SOLVED = 1e-12
"""Largest residual of a solution, of max(1 m, the arm's length)."""

ONE, TWO = 2e-14, 2e-13
"""Residuals, of max(1 m, the arm's length), between which it is undecided whether two solutions
are one. The residual at the highest point of a path between two solutions changes by no more than
the pose does. Rounding of a pose by a hundred units in the last place changes it by 2e-14."""
DECIDED = 6e-14
"""Residual in the middle of `ONE` and `TWO`: below it two solutions are listed as one."""

NEARLY_SINGULAR = 1e-4
"""Smallest singular value, lengths divided by the arm's length, below which a solution next to the
one found may be missing: two roots lie about as far apart as it is large. The general method was
seen to miss one at 5e-7; two orders more cost little, as few poses are so near."""

_LONGEST_STEP, _TARGET_SETTLED = 0.3, 1e-12
"""Steps [rad or arm lengths]: the longest, 17 degrees, within which the equations are nearly
linear; and one that is hardly more than rounding."""


@dataclass(frozen=True, slots=True, eq=False)
class Target:
    """The equations of a target pose.

    Attributes:
        arm: that moves the frame.
        T: (4, 4) the target pose; (m, 4, 4) of m configurations, each its own.
    """

    arm: Arm
    T: Array
    _library: ctypes.CDLL = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_library", core.core_of(self.arm))

    def __reduce__(self) -> tuple[Any, ...]:
        """A library is found again where it is read."""
        return type(self), (self.arm, self.T)

    @property
    def unit(self) -> Array:
        """(n,) the unit of every joint [m or rad]."""
        return self.arm.units

    @property
    def tolerance(self) -> float:
        """Largest residual of a solution."""
        return SOLVED * max(1.0, self.arm.length)

    @property
    def decided(self) -> float:
        """Residual on the path between two solutions below which they are listed as one."""
        return DECIDED * max(1.0, self.arm.length)

    def residual(self, q: Array) -> Array:
        """(...) largest element of pose(q) - T at configurations q, (..., n)."""
        library = self._library
        if self.T.ndim > 2 and q.ndim != 2:
            return self.arm.residual(q, self.T)
        flat = np.asarray(q, dtype=float).reshape(-1, self.arm.size)
        return core.residual_by(library, self.arm, self.T, flat).reshape(q.shape[:-1])

    def excess(self, x: Array) -> tuple[Array, Array]:
        """The equations e(x) = 0, (..., 6), and their derivative to first order, (..., 6, n)."""
        library = self._library
        if self.T.ndim == 2 or x.ndim == 2:
            q = (x * self.unit).reshape(-1, self.arm.size)
            gap, slope = core.examined_by(library, self.arm, self.T, q)
            return -gap.reshape(*x.shape[:-1], 6), slope.reshape(*x.shape[:-1], 6, self.arm.size)
        unit, rows = self.unit, np.array([self.arm.length] * 3 + [1.0] * 3)
        T, J = self.arm.pose_and_jacobian(x * unit)
        return -gap_to(self.T, T) / rows, J * unit / rows[:, None]

    def singular_values(self, q: Array) -> Array:
        """(..., n) singular values of the Jacobian, lengths divided by the arm's length."""
        J = self.excess(q / self.unit)[1]
        return np.asarray(np.linalg.svd(J, compute_uv=False), dtype=float)

    def wrapped(self, x: Array) -> Array:
        """Differences x with those of turns brought into [-pi, pi)."""
        return self.arm.wrapped(x)

    def corrected(self, x: Array, held: Array, values: Array, iterations: int = 40) -> Array:
        """Solutions near x, (..., n), at which held @ x = values, by Gauss-Newton.

        Args:
            x: (..., n) first guesses.
            held: (..., k, n) further linear equations.
            values: (..., k) their right sides.
            iterations: at most.

        Returns:
            (..., n) the last iterates; whether they solve the equations is left to the residual.
        """
        library = self._library
        if held.shape[-2] == 1 and type(self) is Target:
            every = np.broadcast_to(x, np.broadcast_shapes(x.shape, held.shape[:-2] + x.shape[-1:]))
            flat = every.reshape(-1, x.shape[-1])
            rows = np.broadcast_to(held[..., 0, :], every.shape).reshape(flat.shape)
            right = np.broadcast_to(values[..., 0], every.shape[:-1]).ravel()
            found = core.corrected_by(library, self.arm, self.T, flat, rows, right, iterations)
            return found.reshape(every.shape)
        for _ in range(iterations):
            e, J = self.excess(x)
            further = (held @ x[..., None])[..., 0] - values
            # only exact dependence, 1e-16 by rounding, is left out; nearly dependent rows count
            inverse = np.linalg.pinv(np.concatenate([J, held], axis=-2), rcond=1e-12)
            step = (inverse @ np.concatenate([e, further], axis=-1)[..., None])[..., 0]
            size = np.linalg.norm(step, axis=-1, keepdims=True)
            x = x - step * np.minimum(1.0, _LONGEST_STEP / np.maximum(size, NONZERO))
            if np.max(size, initial=0.0) < _TARGET_SETTLED:
                break
        return x


def nearly_singular(arm: Arm, q: Array, bound: float = NEARLY_SINGULAR) -> NDArray[np.bool_]:
    """(m,) which of configurations q, (m, n), have a singular value below a bound."""
    return core.singular_by(core.core_of(arm), arm, q, bound)


# Which of the configurations that were found are one solution.


_SAME, _CLOSE = 1e-9, 1e-2
"""Distances [rad or arm lengths] below which two solutions are one, and may be one."""
_SPLIT = 1e-7
"""The same of two branches of a closed form: rounding splits a double root by the root of 1e-16."""
_FLOOR, _WORSE = 2e-15, 4.0
"""Residual half way, of max(1 m, the length), that is rounding of the forward model, some units of
2e-16; and of the worse of two solutions, whose own miss the half way may show. It grows with the
square of the distance of two roots, so that they are told apart from 1e-7 on."""
_ACROSS = 3  # Newton steps back into a bent valley: of 1e-2, 1e-4, 1e-8 from it rounding is left


def distinct(target: Target, q: Array, apart_from: Sequence[object] = ()) -> list[list[int]]:
    """The configurations in groups of equal ones, the groups and their members in the given order.

    Two are one solution when they are closer than 1e-9, or closer than 1e-2 and a configuration
    half way between solves too but for rounding, as between copies of a multiple root. Whole turns
    do not count. The order decides nothing: those that a third one joins are one.

    Args:
        target: the pose they take.
        q: (m, n) solutions [rad or m].
        apart_from: of each its branch of a closed form, or something false; those of different
            branches are one only where they are closer than 1e-7.
    """
    x = q / target.unit
    apart = np.max(np.abs(target.wrapped(x[:, None] - x)), axis=2, initial=0.0)
    first, second = np.nonzero(np.triu(apart < _CLOSE, 1))
    if not len(first):  # each is close to itself alone
        return [[k] for k in range(len(q))]
    limit = target.decided
    own = target.residual(q)
    limits = np.maximum(limit, _WORSE * np.maximum(own[first], own[second]))
    joined = apart[first, second] < _SAME
    i, j = first[~joined], second[~joined]
    joined[~joined] = middles(target, x[i], x[j])[1] < limits[~joined]
    branch = list(apart_from) or [None] * len(q)
    both = np.array([bool(branch[i] and branch[j]) for i, j in zip(first, second, strict=True)])
    # of two branches first; then copies go to what is nearest, and join no two branches
    group, told = np.arange(len(q)), np.array([bool(name) for name in branch])
    order = np.lexsort((apart[first, second], ~both))
    for k in order[joined[order]]:
        a, b = sorted((group[first[k]], group[second[k]]))
        if a != b and (both[k] or not (np.any(told[group == a]) and np.any(told[group == b]))):
            group[group == b] = a
    return [list(map(int, np.flatnonzero(group == g))) for g in np.unique(group)]


def highest_between(target: Target, q: Array) -> float:
    """Largest residual half way from the first to other copies (m, n) of a solution."""
    x = q / target.unit
    far = x[1:][np.max(np.abs(target.wrapped(x[1:] - x[0])), axis=1) > _SAME]
    if not len(far):
        return 0.0
    return float(np.max(middles(target, np.broadcast_to(x[0], far.shape), far)[1]))


def middles(target: Target, x: Array, other: Array) -> tuple[Array, Array]:
    """Configurations (m, n) half way between x and others, (m, n), and their residuals (m,).

    The configuration half way is moved across the line between the two, for the valley that joins
    copies of a root may bend.
    """
    difference = target.wrapped(other - x)
    middle = x + 0.5 * difference
    best = target.residual(middle * target.unit)
    along = difference / np.maximum(np.linalg.norm(difference, axis=1, keepdims=True), NONZERO)
    held, values = along[:, None, :], np.sum(along * middle, axis=1, keepdims=True)
    moved = target.corrected(middle, held, values, _ACROSS)
    for point in (moved, _steep(target, middle, held, values)):
        after = target.residual(point * target.unit)
        better = after < best
        middle, best = np.where(better[:, None], point, middle), np.where(better, after, best)
    return middle, best


_FLAT = 1e-5
"""Singular values, of the largest, along which a point is not moved: next to two singular
configurations Newton's steps along the second one are endless."""


def _steep(target: Target, x: Array, held: Array, values: Array) -> Array:
    """Points (m, n) moved to the pose along all directions but those of small singular values.

    Args:
        target: the pose.
        x: (m, n) the points.
        held: (m, 1, n) a further linear equation of each.
        values: (m, 1) its right sides.
    """
    for _ in range(_ACROSS + 1):
        e, J = target.excess(x)
        further = (held @ x[..., None])[..., 0] - values
        inverse = np.linalg.pinv(np.concatenate([J, held], axis=1), rcond=_FLAT)
        step = (inverse @ np.concatenate([e, further], axis=1)[..., None])[..., 0]
        x = x - np.clip(step, -_LONGEST_STEP, _LONGEST_STEP)
    return x


# How many roots meet in a solution: the equations near it, reduced to the directions left free.
#
# Where the Jacobian has c singular values of zero, the implicit function theorem solves all
# equations but those of the left null space for all unknowns but the c along the right null
# space: g(h) = 0 remains, without linear terms (Lyapunov-Schmidt). With one unknown the
# multiplicity is the order of the first derivative of g that does not vanish; with more, the
# dimension of the dual space of the ideal of g, from the ranks of Macaulay matrices.
#
# Source: Golubitsky & Schaeffer 1985, chapter VII (reduction); Dayton & Zeng 2005, section 3
# (dual space).


SINGULAR = 2e-6
"""Singular values below it count as zero: two roots that lie 1e-6 apart are one double root."""

_MEETING = DECIDED
"""Terms of g, free of units, that are negligible."""
# h [rad or arm lengths] at which g is fitted, each a fourth or fifth of the one before: the first
# within which Newton's method converges and a polynomial of degree 8 is g but for rounding
_RADII = (0.05, 0.012, 3e-3, 7e-4, 1.5e-4, 3e-5, 6e-6)
_ROUNDING = 3e-15  # of g, some tens of 1e-16, with which a fitted polynomial agrees
_HIGHEST = 4
_FARTHEST = 0.4  # h [rad or arm lengths] of a step: beyond eight radii no polynomial holds
_DEGREE = 8
_SEED = 20260107


@dataclass(frozen=True, slots=True, eq=False)
class TargetReduction:
    """The equations of a target near a solution, split by the singular directions.

    Attributes:
        target: whose equations.
        x: (n,) the solution.
        left: (6, 6 - rank) directions of the equations that remain.
        solved: (6, rank) those that are solved for the other unknowns.
        null: (n, corank) directions of the unknowns h that remain.
        next: smallest singular value that does not count as zero.
    """

    target: Target
    x: Array
    left: Array
    solved: Array
    null: Array
    next: float

    @property
    def corank(self) -> int:
        """The number of unknowns that remain."""
        return int(self.null.shape[1])

    def at(self, h: Array) -> tuple[Array, Array, bool]:
        """X (k, n) and g (k, 6 - rank) for h, (k, corank), and whether all were found."""
        target, library = self.target, self.target._library
        if library is not None and type(target) is Target:
            parts = self.x, self.solved.T, self.left.T, self.null.T
            return core.reduced_by(library, target.arm, target.T, parts, h)
        x = self.x + h @ self.null.T
        for _ in range(12):
            e, J = self.target.excess(x)
            off = (x - self.x) @ self.null - h
            rows = np.concatenate(
                [self.solved.T @ J, np.broadcast_to(self.null.T, (*h.shape, self.x.size))], axis=1
            )
            right = np.concatenate([e @ self.solved, off], axis=1)
            step = _solved(rows, right)
            x = x - step
        # after twelve Newton steps either rounding, magnified by the inverse, or no convergence
        found = bool(np.max(np.abs(step)) < 1e-11 and np.max(np.abs(right)) < 1e-11)
        return x, self.target.excess(x)[0] @ self.left, found


def _solved(rows: Array, right: Array) -> Array:
    """The solutions of square systems, zero where a system is singular."""
    try:
        step = np.asarray(np.linalg.solve(rows, right[..., None])[..., 0], dtype=float)
    except np.linalg.LinAlgError:
        return np.zeros_like(right)
    return np.clip(np.where(np.isfinite(step), step, 0.0), -0.5, 0.5)


def reduction(target: Target, q: Array) -> TargetReduction:
    """The equations near the solution q, (n,) [rad or m]."""
    x = q / target.unit
    J = target.excess(x)[1]
    U, s, Vt = np.linalg.svd(J)
    rank = int(np.sum(s > SINGULAR))
    following = float(s[rank - 1]) if rank else 1.0
    return TargetReduction(target, x, U[:, rank:], U[:, :rank], Vt[rank:].T, following)


def multiplicity(reduced: TargetReduction) -> tuple[int, Array, bool]:
    """How many roots meet in an isolated solution, and where.

    Args:
        reduced: the equations near it.

    Returns:
        the number of roots, the configuration q (n,) [rad or m] in their middle, and whether both
        are certain: where two singular configurations nearly meet, terms that are nearly zero
        decide, and the number is an upper bound.
    """
    if reduced.corank == 0:
        return 1, reduced.x * reduced.target.unit, True
    if reduced.corank == 1:
        return *_order(reduced), True
    return _dual_dimension(reduced), reduced.x * reduced.target.unit, False


def _order(reduced: TargetReduction) -> tuple[int, Array]:
    """The order of the root of g in one unknown, and the middle of the roots that meet.

    It is the highest k for which, about the middle of k roots, all terms below the k-th are
    negligible as far from it as the k-th is.
    """
    g = _coefficients(reduced)
    order, middle = 1, 0.0
    for k in range(2, _HIGHEST + 1):
        size = max(float(g[k] @ g[k]), NONZERO)
        radius, shift = (_MEETING / size**0.5) ** (1.0 / k), -float(g[k - 1] @ g[k]) / (k * size)
        if max(radius, abs(shift)) > _RADII[0]:
            continue
        below = np.linalg.norm(_shift(g, shift)[:k], axis=1) * radius ** np.arange(k)
        if np.all(below < _MEETING):
            order, middle = k, shift
    target = reduced.target
    if order == 1:
        return 1, _best(reduced, _simple_roots(g))
    q = reduced.at(np.array([[middle]]))[0][0] * target.unit
    good = target.residual(q) <= 0.5 * target.tolerance
    return order, q if good else reduced.x * target.unit


def _best(reduced: TargetReduction, steps: list[float]) -> Array:
    """The configuration (n,) of least residual after one of several steps, or none."""
    x, _, _ = reduced.at(np.clip(np.array(steps)[:, None], -_FARTHEST, _FARTHEST))
    q = np.vstack([reduced.x, x]) * reduced.target.unit
    best: Array = q[int(np.argmin(reduced.target.residual(q)))]
    return best


def _simple_roots(g: Array) -> list[float]:
    """Where a simple root of g near h = 0 may be: by its first two, three and all terms."""
    slope = float(np.linalg.norm(g[1]))
    if slope == 0.0:
        return [0.0]
    along = g @ g[1] / slope
    found = [-float(along[0]) / slope]
    for terms in (along[:3], along):
        every = np.roots(terms[::-1])
        # fitted coefficients split a double root by a root of their rounding
        real = every.real[np.abs(every.imag) < 1e-6 * np.abs(every)]
        found += [float(real[np.argmin(np.abs(real))])] if len(real) else []
    return found


def _shift(g: Array, by: float) -> Array:
    """Taylor coefficients about another point."""
    orders = range(len(g))
    return np.array(
        [sum(math.comb(m, k) * by ** (m - k) * g[m] for m in orders[k:]) for k in orders]
    )


def _coefficients(reduced: TargetReduction) -> Array:
    """(degree + 1, 6 - rank) Taylor coefficients of g in one unknown."""
    nodes, powers, inverse = _fitting()
    for radius in _RADII:
        _, g, found = reduced.at(radius * nodes[:, None])
        fit = inverse @ g
        rest = powers @ fit - g
        if found and np.max(np.abs(rest)) < _ROUNDING:
            break
    coefficients: Array = fit / radius ** np.arange(_DEGREE + 1)[:, None]
    return coefficients


@functools.cache
def _fitting() -> tuple[Array, Array, Array]:
    """Nodes in [-1, 1], their powers, and what makes coefficients of values at them."""
    nodes = np.cos(np.pi * (np.arange(2 * _DEGREE + 1) + 0.5) / (2 * _DEGREE + 1))
    powers = np.vander(nodes, _DEGREE + 1, increasing=True)
    return nodes, powers, np.linalg.pinv(powers)


def _dual_dimension(reduced: TargetReduction) -> int:
    """The dimension of the dual space of g at h = 0, up to degree 5."""
    powers, columns = _taylor(reduced)
    before = 1
    for degree in range(1, 6):
        matrix = _macaulay(powers, columns, degree, reduced.corank)
        s = np.linalg.svd(matrix, compute_uv=False)
        # fitted coefficients, in units of the radius, lack terms beyond degree 6, which are less
        nullity = int(matrix.shape[1]) - int(np.sum(s > 1e-4 * max(float(s[0]), NONZERO)))
        if nullity == before:
            return nullity
        before = nullity
    return before


def _taylor(reduced: TargetReduction) -> tuple[list[tuple[int, ...]], Array]:
    """Exponents of monomials, and their coefficients in g with h counted in units of the radius."""
    c = reduced.corank
    powers = _monomials(c, 6)
    rng = np.random.default_rng(_SEED)
    h = rng.uniform(-1.0, 1.0, (3 * len(powers), c))
    for radius in _RADII:
        _, g, found = reduced.at(radius * h)
        if found:
            break
    values = np.stack([np.prod(h ** np.array(power), axis=1) for power in powers], axis=1)
    fit: Array = np.linalg.lstsq(values, g, rcond=None)[0]
    degree = np.array([sum(power) for power in powers])
    fit[degree <= 1] = 0.0
    return powers, fit / max(float(np.max(np.abs(fit))), NONZERO)


def _monomials(c: int, degree: int) -> list[tuple[int, ...]]:
    every = itertools.product(range(degree + 1), repeat=c)
    return sorted((power for power in every if sum(power) <= degree), key=lambda m: (sum(m), m))


def _macaulay(powers: list[tuple[int, ...]], columns: Array, degree: int, c: int) -> Array:
    """Rows: the products of monomials and equations, cut off above the degree."""
    kept = _monomials(c, degree)
    index = {power: k for k, power in enumerate(kept)}
    rows = []
    for factor in _monomials(c, degree - 1):
        for equation in columns.T:
            row = np.zeros(len(kept))
            for power, value in zip(powers, equation, strict=True):
                product = tuple(a + b for a, b in zip(power, factor, strict=True))
                if product in index:
                    row[index[product]] += value
            rows.append(row)
    return np.array(rows)
