"""Equations of a target pose of a serial arm, and multiplicities of their roots.

Scaled positions are x = q / unit, where the unit is the arm length for prismatic joints and 1 rad
for revolute joints. Elements of x and rows of the equations are thus comparable.
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

SINGULAR_ERROR = math.sqrt(SOLVED)
"""Error of a singular solution [rad or arm lengths], 1e-6: the residual of a double root grows with
the square of the distance from it. Differences of singular solutions below it count as zero."""

ONE, TWO = 2e-14, 2e-13
"""Residuals, relative to max(1 m, arm length), between which it is undecided whether two solutions
are equal. A perturbation of the pose changes the largest residual on a path between two solutions
by at most its own size. Rounding of a pose by 100 units in the last place changes it by 2e-14."""
DECIDED = 6e-14
"""Geometric mean of `ONE` and `TWO`, to one digit: residual below which two solutions are listed as
one."""

NEARLY_SINGULAR = 1e-4
"""Smallest singular value, lengths divided by the arm length, below which a neighbouring solution
may be missing: the distance of two roots is about this value. The general method misses a root at
5e-7. A margin of two orders costs little, as few poses are so near to a singularity."""

_LONGEST_STEP, _TARGET_SETTLED = 0.3, 1e-12
"""Steps [rad or arm lengths]: the longest Newton step, 17 degrees, within which the equations are
nearly linear, and the size of a step that is mostly rounding, where iterations end."""


@dataclass(frozen=True, slots=True, eq=False)
class Target:
    """Equations of a target pose of an arm.

    Attributes:
        arm: numeric geometry of the chain that moves the frame.
        T: (4, 4) target pose [m], or (m, 4, 4) one for each of m configurations.
    """

    arm: Arm
    T: Array
    _library: ctypes.CDLL = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_library", core.core_of(self.arm))

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the arm and pose only; the compiled library is loaded again."""
        return type(self), (self.arm, self.T)

    @property
    def unit(self) -> Array:
        """Unit (n,) of each joint: arm length [m] or 1 rad."""
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
        """Return (...) the largest absolute element of pose(q) - T for q (..., n) [rad or m]."""
        library = self._library
        if self.T.ndim > 2 and q.ndim != 2:
            return self.arm.residual(q, self.T)
        flat = np.asarray(q, dtype=float).reshape(-1, self.arm.size)
        return core.residual_by(library, self.arm, self.T, flat).reshape(q.shape[:-1])

    def excess(self, x: Array) -> tuple[Array, Array]:
        """Return the pose error e(x) (..., 6) and its Jacobian de/dx (..., 6, n).

        Position rows are divided by the arm length. The Jacobian is exact at e = 0.
        """
        library = self._library
        if self.T.ndim == 2 or x.ndim == 2:
            q = (x * self.unit).reshape(-1, self.arm.size)
            gap, slope = core.examined_by(library, self.arm, self.T, q)
            return -gap.reshape(*x.shape[:-1], 6), slope.reshape(*x.shape[:-1], 6, self.arm.size)
        unit, rows = self.unit, np.array([self.arm.length] * 3 + [1.0] * 3)
        T, J = self.arm.pose_and_jacobian(x * unit)
        return -gap_to(self.T, T) / rows, J * unit / rows[:, None]

    def singular_values(self, q: Array) -> Array:
        """Return the singular values (..., n) of de/dx at q (..., n), largest first."""
        J = self.excess(q / self.unit)[1]
        return np.asarray(np.linalg.svd(J, compute_uv=False), dtype=float)

    def wrapped(self, x: Array) -> Array:
        """Return differences x (..., n) with those of revolute joints wrapped to [-pi, pi)."""
        return self.arm.wrapped(x)

    def corrected(self, x: Array, held: Array, values: Array, iterations: int = 40) -> Array:
        """Solve e(x) = 0 and held @ x = values near x by Gauss-Newton.

        Args:
            x: (..., n) initial guesses.
            held: (..., k, n) additional linear equations.
            values: (..., k) right-hand sides of the additional equations.
            iterations: maximum number of iterations.

        Returns:
            Last iterates (..., n). The caller must check their residual.
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
            # truncate only exactly dependent rows (1e-16 by rounding), not nearly dependent ones
            inverse = np.linalg.pinv(np.concatenate([J, held], axis=-2), rcond=1e-12)
            step = (inverse @ np.concatenate([e, further], axis=-1)[..., None])[..., 0]
            size = np.linalg.norm(step, axis=-1, keepdims=True)
            x = x - step * np.minimum(1.0, _LONGEST_STEP / np.maximum(size, NONZERO))
            if np.max(size, initial=0.0) < _TARGET_SETTLED:
                break
        return x


def nearly_singular(arm: Arm, q: Array, bound: float = NEARLY_SINGULAR) -> NDArray[np.bool_]:
    """Return (m,) whether each configuration q (m, n) has a singular value below a bound."""
    return core.singular_by(core.core_of(arm), arm, q, bound)


# Grouping of computed configurations into distinct solutions.


_SAME, _CLOSE = 1e-9, 1e-2
"""Distances [rad or arm lengths] below which two solutions are equal, and may be equal."""
_WORSE = 4.0
"""Largest ratio of the residual half way between two equal solutions to the residual of the worse
solution. The residual half way grows with the square of the distance of two roots: roots are
distinguished from a distance of 1e-7."""
_ACROSS = 3  # Newton steps back to a curved valley: distances 1e-2, 1e-4, 1e-8, then rounding


def distinct(target: Target, q: Array, apart_from: Sequence[object] = ()) -> list[list[int]]:
    """Group equal configurations and return lists of indices, in the order of q.

    Two configurations are equal if their distance is below 1e-9. They are also equal if it is below
    1e-2 and a configuration half way solves the equations up to rounding, as between copies of a
    multiple root. Full revolutions are ignored. Equality is transitive.

    Args:
        target: target pose of the configurations.
        q: (m, n) solutions [rad or m].
        apart_from: name of the closed-form branch of each, or a false value. Copies never merge
            two groups of different branches; branches themselves merge if close.
    """
    x = q / target.unit
    apart = np.max(np.abs(target.wrapped(x[:, None] - x)), axis=2, initial=0.0)
    first, second = np.nonzero(np.triu(apart < _CLOSE, 1))
    if not len(first):  # no two configurations are close
        return [[k] for k in range(len(q))]
    limit = target.decided
    own = target.residual(q)
    limits = np.maximum(limit, _WORSE * np.maximum(own[first], own[second]))
    joined = apart[first, second] < _SAME
    i, j = first[~joined], second[~joined]
    joined[~joined] = middles(target, x[i], x[j])[1] < limits[~joined]
    branch = list(apart_from) or [None] * len(q)
    both = np.array([bool(branch[i] and branch[j]) for i, j in zip(first, second, strict=True)])
    # merge pairs of branches first, then copies with the nearest, without joining two branches
    group, told = np.arange(len(q)), np.array([bool(name) for name in branch])
    order = np.lexsort((apart[first, second], ~both))
    for k in order[joined[order]]:
        a, b = sorted((group[first[k]], group[second[k]]))
        if a != b and (both[k] or not (np.any(told[group == a]) and np.any(told[group == b]))):
            group[group == b] = a
    return [list(map(int, np.flatnonzero(group == g))) for g in np.unique(group)]


def highest_between(target: Target, q: Array) -> float:
    """Return the largest residual half way between q[0] and the other copies q (m, n)."""
    x = q / target.unit
    far = x[1:][np.max(np.abs(target.wrapped(x[1:] - x[0])), axis=1) > _SAME]
    if not len(far):
        return 0.0
    return float(np.max(middles(target, np.broadcast_to(x[0], far.shape), far)[1]))


def middles(target: Target, x: Array, other: Array) -> tuple[Array, Array]:
    """Return configurations (m, n) half way between x and `other` (m, n), and residuals (m,).

    Each is moved normal to the connecting line to the least residual, because the valley between
    copies of a multiple root may be curved.
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
"""Ratio to the largest singular value below which a direction is not used: near two singular
configurations Newton's method does not converge along the second direction."""


def _steep(target: Target, x: Array, held: Array, values: Array) -> Array:
    """Newton's method from points x, without the directions of small singular values.

    Args:
        target: target pose.
        x: (m, n) initial points.
        held: (m, 1, n) additional linear equation of each point.
        values: (m, 1) right-hand sides of the additional equations.
    """
    for _ in range(_ACROSS + 1):
        e, J = target.excess(x)
        further = (held @ x[..., None])[..., 0] - values
        inverse = np.linalg.pinv(np.concatenate([J, held], axis=1), rcond=_FLAT)
        step = (inverse @ np.concatenate([e, further], axis=1)[..., None])[..., 0]
        x = x - np.clip(step, -_LONGEST_STEP, _LONGEST_STEP)
    return x


# Multiplicity of a solution: Lyapunov-Schmidt reduction of the equations to the null space.
#
# If the Jacobian has c zero singular values, the implicit function theorem solves all equations
# except those of the left null space for all unknowns except the c unknowns h of the right null
# space. The remaining equations g(h) = 0 have no linear terms. For c = 1 the multiplicity is the
# order of the first nonzero derivative of g. For c > 1 it is the dimension of the dual space of
# the ideal of g, computed from the ranks of Macaulay matrices.
#
# Source: Golubitsky & Schaeffer 1985, chapter VII (reduction); Dayton & Zeng 2005, section 3
# (dual space).


SINGULAR = 2e-6
"""Singular values below this count as zero: two roots at a distance of 1e-6 are a double root."""

_MEETING = DECIDED
"""Size of dimensionless terms of g that are negligible."""
# radii of h [rad or arm lengths] for the fit of g, each 1/4 or 1/5 of the radius before. The first
# is used at which Newton's method converges and a polynomial of degree 8 fits g up to rounding.
_RADII = (0.05, 0.012, 3e-3, 7e-4, 1.5e-4, 3e-5, 6e-6)
_ROUNDING = 3e-15  # rounding error of g, some tens of 1e-16: largest error of a fitted polynomial
_HIGHEST = 4  # largest order of a root in one unknown that is examined
_FARTHEST = 0.4  # largest step h [rad or arm lengths]: polynomials are invalid beyond 8 radii
_DEGREE = 8  # of the fitted polynomials: terms above are below rounding within the radius
_SEED = 20260107


@dataclass(frozen=True, slots=True, eq=False)
class TargetReduction:
    """Lyapunov-Schmidt reduction of the equations near a solution to g(h) = 0.

    Attributes:
        target: target pose with its equations.
        x: (n,) scaled solution.
        left: (6, 6 - rank) left null space: directions of the remaining equations g.
        solved: (6, rank) directions of the equations that are eliminated.
        null: (n, corank) right null space: directions of the remaining unknowns h.
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
        """Number of remaining unknowns h."""
        return int(self.null.shape[1])

    def at(self, h: Array) -> tuple[Array, Array, bool]:
        """Return x (k, n) and g (k, 6 - rank) at h (k, corank), and whether all converged."""
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
        # after twelve Newton steps only amplified rounding remains, or the iteration diverged
        found = bool(np.max(np.abs(step)) < 1e-11 and np.max(np.abs(right)) < 1e-11)
        return x, self.target.excess(x)[0] @ self.left, found


def _solved(rows: Array, right: Array) -> Array:
    """Solve square linear systems and limit the steps to 0.5; zero for singular systems."""
    try:
        step = np.asarray(np.linalg.solve(rows, right[..., None])[..., 0], dtype=float)
    except np.linalg.LinAlgError:
        return np.zeros_like(right)
    return np.clip(np.where(np.isfinite(step), step, 0.0), -0.5, 0.5)


def reduction(target: Target, q: Array) -> TargetReduction:
    """Return the reduced equations near the solution q (n,) [rad or m]."""
    x = q / target.unit
    J = target.excess(x)[1]
    U, s, Vt = np.linalg.svd(J)
    rank = int(np.sum(s > SINGULAR))
    following = float(s[rank - 1]) if rank else 1.0
    return TargetReduction(target, x, U[:, rank:], U[:, :rank], Vt[rank:].T, following)


def multiplicity(reduced: TargetReduction) -> tuple[int, Array, bool]:
    """Return the multiplicity of an isolated solution and the centre of its roots.

    Args:
        reduced: reduced equations near the solution.

    Returns:
        Number of roots, configuration q (n,) [rad or m] at their centre, and whether both are
        certain. For a corank above 1 the number is an upper bound, as it depends on terms that
        are nearly zero.
    """
    if reduced.corank == 0:
        return 1, reduced.x * reduced.target.unit, True
    if reduced.corank == 1:
        return *_order(reduced), True
    return _dual_dimension(reduced), reduced.x * reduced.target.unit, False


def _order(reduced: TargetReduction) -> tuple[int, Array]:
    """Return the order of the root of g in one unknown, and the centre of the roots as q (n,).

    The order is the highest k for which all lower terms of the Taylor series about the centre are
    negligible, within the radius at which the k-th term is negligible.
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
    """Return the configuration q (n,) of least residual among zero step and given steps of h."""
    x, _, _ = reduced.at(np.clip(np.array(steps)[:, None], -_FARTHEST, _FARTHEST))
    q = np.vstack([reduced.x, x]) * reduced.target.unit
    best: Array = q[int(np.argmin(reduced.target.residual(q)))]
    return best


def _simple_roots(g: Array) -> list[float]:
    """Return candidates h of a simple root of g near 0, from its first 2, 3 and all terms."""
    slope = float(np.linalg.norm(g[1]))
    if slope == 0.0:
        return [0.0]
    along = g @ g[1] / slope
    found = [-float(along[0]) / slope]
    for terms in (along[:3], along):
        every = np.roots(terms[::-1])
        # rounding of the coefficients splits a double root into a conjugate pair
        real = every.real[np.abs(every.imag) < 1e-6 * np.abs(every)]
        found += [float(real[np.argmin(np.abs(real))])] if len(real) else []
    return found


def _shift(g: Array, by: float) -> Array:
    """Return the Taylor coefficients of g about h = `by`."""
    orders = range(len(g))
    return np.array(
        [sum(math.comb(m, k) * by ** (m - k) * g[m] for m in orders[k:]) for k in orders]
    )


def _coefficients(reduced: TargetReduction) -> Array:
    """Return the Taylor coefficients (degree + 1, 6 - rank) of g in one unknown."""
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
    """Return Chebyshev nodes in [-1, 1], their Vandermonde matrix and its pseudo-inverse."""
    nodes = np.cos(np.pi * (np.arange(2 * _DEGREE + 1) + 0.5) / (2 * _DEGREE + 1))
    powers = np.vander(nodes, _DEGREE + 1, increasing=True)
    return nodes, powers, np.linalg.pinv(powers)


def _dual_dimension(reduced: TargetReduction) -> int:
    """Return the dimension of the dual space of g at h = 0, up to degree 5."""
    powers, columns = _taylor(reduced)
    before = 1
    for degree in range(1, 6):
        matrix = _macaulay(powers, columns, degree, reduced.corank)
        s = np.linalg.svd(matrix, compute_uv=False)
        # 1e-4: the fit omits terms above degree 6, which are smaller
        nullity = int(matrix.shape[1]) - int(np.sum(s > 1e-4 * max(float(s[0]), NONZERO)))
        if nullity == before:
            return nullity
        before = nullity
    return before


def _taylor(reduced: TargetReduction) -> tuple[list[tuple[int, ...]], Array]:
    """Return exponents of monomials and their coefficients in g, for h divided by the radius."""
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
    """Return the Macaulay matrix: products of monomials and equations up to a degree."""
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
