"""All configurations of plane loops that must be solved together, by numerical methods.

Vectors of the plane are complex numbers. The rows are A theta + D (s theta_c) + b = 0. The unit
number theta_k is the direction of link k. A prismatic joint moves by s along a direction that is
fixed in its link c. Parts that can be solved alone are solved first. An irreducible part is a dyad,
a set of revolute joints (Dixon's determinant) or a triad with prismatic joints. Other parts are
solved by homotopy.

Source: Wampler 2001.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations, pairwise
from math import pi

import numpy as np
from numpy.typing import NDArray

from mbs.closed_forms.roots import Roots
from mbs.errors import LoopError, NoClosedForm
from mbs.numbers import NONZERO
from mbs.solvers.homotopy import follow, solved

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]
Numbers = NDArray[np.int64]

KNOWN = -1
"""Link index that represents a known direction."""


@dataclass(frozen=True, slots=True, eq=False)
class PlanarLoops:
    """Closure rows of L plane loops, with lengths divided by the size of the loops.

    Attributes:
        angles: (L, n) factors of the unknown link directions (unit numbers).
        slides: (L, m) factors of the displacements, with the links that carry them at angle zero.
        carriers: (m,) index of the link that carries each displacement, or `KNOWN`.
        constant: (L,) known terms.
    """

    angles: Complex
    slides: Complex
    carriers: Numbers
    constant: Complex

    @property
    def counts(self) -> tuple[int, int]:
        """Number of unknown directions and number of unknown displacements."""
        return self.angles.shape[1], self.slides.shape[1]

    def rows(self, theta: Real, s: Real) -> tuple[Complex, Complex]:
        """Return the rows (r, L) and their derivatives by all unknowns (r, L, n + m).

        Args:
            theta: (r, n) angles of the links [rad].
            s: (r, m) displacements, divided by the size.
        """
        unit = np.exp(1j * theta)
        carried = self._carried(unit)
        moved = s * carried
        value = unit @ self.angles.T + moved @ self.slides.T + self.constant
        turned = 1j * unit[:, None, :] * self.angles
        for j, k in enumerate(self.carriers):
            if k != KNOWN:
                turned[:, :, k] += 1j * moved[:, j, None] * self.slides[:, j]
        return value, np.concatenate([turned, carried[:, None, :] * self.slides], axis=2)

    def _carried(self, unit: Complex) -> Complex:
        """Return the unit vectors (r, m), as complex numbers, along which displacements act.

        Args:
            unit: (r, n) unit vectors of the unknown directions.
        """
        whole = np.concatenate([unit, np.ones((len(unit), 1))], axis=1)
        return whole[:, self.carriers]

    def with_known(self, part: PlanarPart, theta: Real, s: Real) -> PlanarLoops:
        """Return the rows of the remaining unknowns, with the values of a part inserted.

        Args:
            part: unknowns that are known now.
            theta: values of its directions [rad].
            s: values of its displacements, divided by the size.
        """
        n, m = self.counts
        every_theta, every_s = np.zeros((1, n)), np.zeros((1, m))
        every_theta[0, part.angles], every_s[0, part.slides] = theta, s
        unit = np.exp(1j * every_theta)
        carried = self._carried(unit)[0]
        constant = (
            self.constant
            + self.angles[:, part.angles] @ unit[0, part.angles]
            + self.slides[:, part.slides] @ (every_s[0] * carried)[part.slides]
        )
        others = [k for k in range(n) if k not in part.angles]
        left = [j for j in range(m) if j not in part.slides]
        number = {k: place for place, k in enumerate(others)}
        turned = [
            self.slides[:, j] * (1 if self.carriers[j] in number else carried[j]) for j in left
        ]
        return PlanarLoops(
            self.angles[:, others],
            np.array(turned, dtype=complex).reshape(len(left), len(constant)).T,
            np.array([number.get(int(self.carriers[j]), KNOWN) for j in left], dtype=int),
            constant,
        )


# Parts that can be solved alone: unknowns with enough rows that contain no other unknown.


_SMALL = 1e-10
"""Relative singular value that counts as zero: columns of rank one leave 1e-15, links of a
millionth of the mechanism 1e-6."""
_OPEN = 1e-9
"""Largest row of a closed configuration, in sizes: Newton's method leaves 1e-15 at single roots and
1e-14 at double roots; without a root it is usually above 1e-4."""


_DEPENDENT = 1e-5
"""Largest value of redundant rows at the roots of other rows: a root at a fold is accurate to 1e-7
until all rows are refined together."""


@dataclass(frozen=True, slots=True, eq=False)
class PlanarPart:
    """Unknowns that some rows determine without other unknowns.

    Attributes:
        angles: indices of its directions.
        slides: indices of its displacements.
        rows: (d, L) combinations of the rows that contain no other unknown.
    """

    angles: list[int]
    slides: list[int]
    rows: Complex

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return len(self.angles) + len(self.slides)


@dataclass(frozen=True, slots=True, eq=False)
class _PartRoots:
    """Roots of a part.

    Attributes:
        theta: (r, n) directions of the links [rad].
        s: (r, m) displacements, divided by the size.
        method: solution method, such as "Dixon's determinant of degree 6".
        complete: whether no root is missing. False if an equation vanishes for all directions, so
            that links may move by themselves, or if a path is lost.
    """

    theta: Real
    s: Real
    method: str
    complete: bool = True

    @property
    def values(self) -> Real:
        """Directions, then displacements (r, n + m)."""
        return np.concatenate([self.theta, self.s], axis=1)


def planar_roots(loops: PlanarLoops) -> Roots:
    """Return all configurations that close the loops.

    Args:
        loops: closure rows. The number of independent rows is half the number of unknowns. Further
            dependent rows are allowed.

    Returns:
        Directions [rad], then displacements divided by the size, (r, n + m).

    Raises:
        NoClosedForm: a part needs more than eight unknowns.
        LoopError: a part can move by itself.
    """
    theta, s, parts = _solve(loops)
    theta, s, _ = refine(loops, theta, s)
    proof = " and ".join(dict.fromkeys(part.method for part in parts))
    return Roots(np.concatenate([theta, s], axis=1), proof, all(part.complete for part in parts))


def _solve(loops: PlanarLoops) -> tuple[Real, Real, list[_PartRoots]]:
    """Return angles (r, n) and displacements (r, m) of all roots, and the results of each part.

    `loops` are the rows of all loops; n and m are the numbers of unknown directions and
    displacements.
    """
    n, m = loops.counts
    if n + m == 0:
        closed = int(np.all(np.abs(loops.constant) < _DEPENDENT))
        return np.zeros((closed, 0)), np.zeros((closed, 0)), []
    part = _smallest_part(loops)
    own = _irreducible(_part_rows(loops, part))
    parts, theta, s = [own], list[Real](), list[Real]()
    rest = (
        [k for k in range(n) if k not in part.angles],
        [j for j in range(m) if j not in part.slides],
    )
    for theta_k, s_k in zip(own.theta, own.s, strict=True):
        more_theta, more_s, more = _solve(loops.with_known(part, theta_k, s_k))
        parts += more
        whole_theta, whole_s = np.empty((len(more_theta), n)), np.empty((len(more_s), m))
        whole_theta[:, part.angles], whole_theta[:, rest[0]] = theta_k, more_theta
        whole_s[:, part.slides], whole_s[:, rest[1]] = s_k, more_s
        theta.append(whole_theta)
        s.append(whole_s)
    return np.concatenate([np.zeros((0, n)), *theta]), np.concatenate([np.zeros((0, m)), *s]), parts


_LARGEST = 8
"""Largest number of unknowns of a part: the determinant of four loops has seventy rows, of five
loops 252."""


def _smallest_part(loops: PlanarLoops) -> PlanarPart:
    """Return the smallest set of unknowns that some rows of `loops` determine alone.

    Raises NoClosedForm if it has more than eight unknowns.
    """
    n, m = loops.counts
    columns = np.concatenate([loops.angles, loops.slides], axis=1)
    for size in range(1, min(n + m, _LARGEST) + 1):
        for chosen in combinations(range(n + m), size):
            angles, slides = [k for k in chosen if k < n], [k - n for k in chosen if k >= n]
            if any(loops.carriers[j] not in (*angles, KNOWN) for j in slides):
                continue
            rows = _left_null(columns[:, [k for k in range(n + m) if k not in chosen]])
            own = _rank(rows @ columns[:, list(chosen)])
            if 2 * own >= size:
                return PlanarPart(angles, slides, rows)
    raise NoClosedForm(
        f"no {_LARGEST} or fewer of the {n + m} unknowns of plane loops follow from these alone"
    )


def _left_null(columns: Complex) -> Complex:
    """Return orthonormal rows (d, L) whose products with the columns (L, k) vanish."""
    if not columns.shape[1]:
        return np.eye(len(columns), dtype=complex)
    U, values, _ = np.linalg.svd(columns)
    rank = int(np.sum(values > _SMALL * max(values[0], NONZERO)))
    return U[:, rank:].conj().T


def _rank(matrix: Complex) -> int:
    """Return the number of singular values of a matrix above 1e-10."""
    if not matrix.size:
        return 0
    values = np.linalg.svd(matrix, compute_uv=False)
    # entries are relative to the size of the mechanism, so that small values count as no row
    return int(np.sum(values > _SMALL))


def _part_rows(loops: PlanarLoops, part: PlanarPart) -> PlanarLoops:
    """Return the rows of the unknowns of a part alone, with no more rows than it needs."""
    rows = part.rows
    columns = np.concatenate([loops.angles[:, part.angles], loops.slides[:, part.slides]], axis=1)
    needed = (part.size + 1) // 2
    if len(rows) > needed:  # of dependent rows, the strongest combinations
        U = np.linalg.svd(rows @ columns)[0]
        rows = U[:, :needed].conj().T @ rows
    number = {k: place for place, k in enumerate(part.angles)}
    carriers = [number.get(int(loops.carriers[j]), KNOWN) for j in part.slides]
    return PlanarLoops(
        rows @ loops.angles[:, part.angles],
        rows @ loops.slides[:, part.slides],
        np.array(carriers, dtype=int),
        rows @ loops.constant,
    )


def _irreducible(loops: PlanarLoops) -> _PartRoots:
    """Return the roots of a part that cannot be split further, refined and each once."""
    n, m = loops.counts
    if n + m == 1:
        found = _one_unknown(loops)
    elif n + m < 2 * len(loops.constant):
        found = _one_row_more(loops)
    elif n + m == 2:
        found = _dyad(loops)
    elif m == 0:
        found = dixon_roots(loops.angles, loops.constant)
    elif n + m == 4 and _best_triad(loops) is not None:
        found = triad_roots(loops)
    else:
        found = path_roots(loops)
    theta, s, residual = refine(loops, found.theta, found.s)
    kept = residual < _OPEN
    theta, s = _distinct(loops, theta[kept], s[kept], residual[kept])
    return _PartRoots(theta, s, found.method, found.complete)


def _one_unknown(loops: PlanarLoops) -> _PartRoots:
    """Return the root of loops with a single unknown, a direction or a displacement."""
    n, _ = loops.counts
    a = (loops.angles if n else loops.slides)[:, 0]
    value = -np.vdot(a, loops.constant) / np.vdot(a, a)
    if n:
        return _PartRoots(np.full((1, 1), np.angle(value)), np.zeros((1, 0)), "linear equations")
    return _PartRoots(np.zeros((1, 0)), np.full((1, 1), value.real), "linear equations")


_AT_ZERO = 1e-6
"""Largest angle [rad] of the added direction in a valid root: at a fold it is accurate to 1e-7."""


def _one_row_more(loops: PlanarLoops) -> _PartRoots:
    """Return the roots of loops with one real equation too many, such as equal parallel cranks.

    A direction with random factors is added. At angle zero it does not change the loops.
    """
    n, _ = loops.counts
    added = _random(np.random.default_rng(_MONODROMY_SEED), len(loops.constant), 1)
    angles = np.concatenate([loops.angles, added], axis=1)
    constant = loops.constant - added[:, 0]
    found = _irreducible(PlanarLoops(angles, loops.slides, loops.carriers, constant))
    kept = np.abs(found.theta[:, n]) < _AT_ZERO
    return _PartRoots(found.theta[kept, :n], found.s[kept], found.method, found.complete)


# A dyad: one loop of two unknowns, by the law of cosines and similar quadratic equations.


_FOLD = 1e-12
"""Largest excess of a cosine above one, or of the square of a displacement below zero, at a
stretched
dyad: rounding of lengths relative to the size."""


def _dyad(loops: PlanarLoops) -> _PartRoots:
    """Return the real roots of `loops` with a single row and two unknowns: none, one or two."""
    method = "the quadratic equation of a dyad"
    n, _ = loops.counts
    b = loops.constant[0]
    if n == 2:
        a, c = loops.angles[0]
        first = _angles_of(np.conj(b) * a, (abs(c) ** 2 - abs(a) ** 2 - abs(b) ** 2) / 2)
        theta = [(t, np.angle(-(a * np.exp(1j * t) + b) / c)) for t in first]
        return _PartRoots(np.array(theta).reshape(-1, 2), np.zeros((len(theta), 0)), method)
    if n == 0:
        D = np.stack([loops.slides[0].real, loops.slides[0].imag])
        s = np.linalg.solve(D, [-b.real, -b.imag])
        return _PartRoots(np.zeros((1, 0)), s[None], "linear equations")
    a, d = loops.angles[0, 0], loops.slides[0, 0]
    # |a + d s| = |b| where the link carries the displacement, else |b + d s| = |a|
    begin, length = (b, abs(a)) if loops.carriers[0] == KNOWN else (a, abs(b))
    middle = -(np.conj(d) * begin).real / abs(d) ** 2
    square = (length**2 - abs(begin) ** 2) / abs(d) ** 2 + middle**2
    if square < -_FOLD:
        return _PartRoots(np.zeros((0, 1)), np.zeros((0, 1)), method)
    s = middle + np.array([1, -1]) * np.sqrt(max(square, 0.0))
    moved = d * s
    unit = -(b + moved) / a if loops.carriers[0] == KNOWN else -b / (a + moved)
    return _PartRoots(np.angle(unit)[:, None], s[:, None], method)


def _angles_of(w: complex, value: float) -> list[float]:
    """Return the angles t [rad] with Re(w e^(i t)) = value: two, or none.

    Raises LoopError if the equation holds for all angles.
    """
    if abs(w) < _SMALL:
        if abs(value) < _SMALL:
            raise LoopError("a dyad of equal links can turn about its own end")
        return []
    cosine = value / abs(w)
    if abs(cosine) > 1 + _FOLD:
        return []
    t = np.arccos(np.clip(cosine, -1.0, 1.0))
    return [float(t - np.angle(w)), float(-t - np.angle(w))]


# Newton's method on all unknowns, for many starts at once.


_STEPS = 60
"""Maximum number of steps: regular roots need two or three; a step halves the distance at folds."""
_CLOSED = 1e-15
"""Largest row that is exact up to rounding, in sizes."""
_NEARLY, _HALF, _LEAST = 1e-13, 0.3, 1e-4
"""Row below which the step is halved at most once, because only rounding remains; smallest fraction
of a step there; smallest fraction of a step for larger rows."""
_LOOSE = 1e-13
"""Relative singular value of directions along which a root is not moved, as at folds."""
_SAME = 1e-4
"""Distance [rad, or sizes] below which two roots are the same if their mean closes as well as the
roots: at a fold Newton's method ends on both sides, at a distance of about the root of 1e-9."""
_BETWEEN = 1e-13
"""Largest row at the mean of two equal roots: between different roots it is an eighth of the
squared distance, so that roots 1e-6 apart are distinguished."""


def refine(loops: PlanarLoops, theta: Real, s: Real) -> tuple[Real, Real, Real]:
    """Refine roots to rounding by Newton's method on all unknowns.

    Args:
        loops: closure rows.
        theta: (r, n) angles of the links [rad].
        s: (r, m) displacements, divided by the size.

    Returns:
        (r, n) angles in (-pi, pi], (r, m) displacements, and (r,) largest closure errors.
    """
    n = theta.shape[1]
    x = np.concatenate([theta, s], axis=1)
    share = np.ones(len(x))
    value, slope = loops.rows(x[:, :n], x[:, n:])
    worst = np.max(np.abs(value), axis=1, initial=0.0)
    for _ in range(_STEPS):
        going = (worst > _CLOSED) & (share > np.where(worst < _NEARLY, _HALF, _LEAST))
        if not np.any(going):
            break
        J = np.concatenate([slope.real, slope.imag], axis=1)
        r = np.concatenate([value.real, value.imag], axis=1)
        step = np.linalg.pinv(J, rcond=_LOOSE) @ r[:, :, None]
        tried = x - share[:, None] * step[:, :, 0]
        other, other_slope = loops.rows(tried[:, :n], tried[:, n:])
        error = np.max(np.abs(other), axis=1, initial=0.0)
        better = error < worst
        x = np.where(better[:, None], tried, x)
        value = np.where(better[:, None], other, value)
        slope = np.where(better[:, None, None], other_slope, slope)
        worst = np.where(better, error, worst)
        # steps at a fold have no bound: a step without improvement is halved
        share = np.where(better, np.minimum(2 * share, 1), share / 2)
    x[:, :n] = pi - np.mod(pi - x[:, :n], 2 * pi)
    return x[:, :n], x[:, n:], worst


def _distinct(loops: PlanarLoops, theta: Real, s: Real, residual: Real) -> tuple[Real, Real]:
    """Return the different roots, each with the smallest `residual` (r,) among its copies.

    theta (r, n) and s (r, m) are the angles and displacements of the roots.
    """
    kept = list[int]()
    for k in np.argsort(residual, kind="stable"):
        if not any(
            _is_same(loops, theta[[k, other]], s[[k, other]], residual[k]) for other in kept
        ):
            kept.append(int(k))
    return theta[sorted(kept)], s[sorted(kept)]


def _is_same(loops: PlanarLoops, theta: Real, s: Real, residual: float) -> bool:
    """Whether two roots theta (2, n), s (2, m) are the same.

    The first has the larger closure error, `residual`.
    """
    turn = pi - np.mod(pi - (theta[0] - theta[1]), 2 * pi)
    slide = s[0] - s[1]
    if max(np.max(np.abs(turn), initial=0.0), np.max(np.abs(slide), initial=0.0)) > _SAME:
        return False
    value, _ = loops.rows((theta[1] + turn / 2)[None], (s[1] + slide / 2)[None])
    return bool(np.max(np.abs(value)) <= max(_BETWEEN, residual))


# Revolute joints alone: L rows in 2 L directions, by Dixon's determinant.
#
# One direction x is hidden. The determinant of W(x) vanishes at the roots. The null vector of W
# consists of products of inverses of the other directions. With the lower rows multiplied by x, W
# is a linear pencil.
#
# Source: Wampler 2001.


_NEAR_CIRCLE = 0.5
"""Largest |log |x|| of a candidate for a real root: real roots are unit numbers; at a fold two
roots leave the circle by the root of rounding, 1e-7, and at a fourfold root by 1e-3."""
_SINGULAR = 1e-13
"""Reciprocal condition number, at the best of some values of x, below which the pencil is singular
for all x: regular pencils of a thousand mechanisms have 1e-7 at least."""
_ZERO = 1e-12
"""Relative size of elements of W that count as zero: products of zeros of the loops are exact."""
_FAR = 1e6
"""Largest absolute value of x, or of its inverse, of a counted root: others are rounding of zero
and infinity."""
_APART = 1e-6
"""Relative distance above which two roots x count as different."""


def dixon_roots(angles: Complex, constant: Complex) -> _PartRoots:
    """Return candidates for the directions that close loops of revolute joints.

    Args:
        angles: (L, 2 L) factors of the directions.
        constant: (L,) known terms.

    Returns:
        Angles (r, 2 L) [rad], which have to be refined and tested.

    Raises:
        LoopError: the determinant vanishes for all x, for each hidden direction.
    """
    n = angles.shape[1]
    pencils = [_pencil(angles, constant, hidden) for hidden in range(n)]
    solved = [(x, t, pencil) for pencil in pencils if pencil for x, t in _eigenvectors(pencil)]
    if not solved:
        raise LoopError(
            "the equations vanish for every direction of a link, so that links may move"
        )
    degrees = [_count_distinct(x) for x, _, _ in solved]
    x, t, pencil = solved[int(np.argmax(degrees))]
    with np.errstate(all="ignore"):
        near = np.abs(np.log(np.abs(x))) < _NEAR_CIRCLE
    theta = [pencil.angles(x_k, t_k) for x_k, t_k in zip(x[near], t.T[near], strict=True)]
    return _PartRoots(
        np.array(theta).reshape(-1, n),
        np.zeros((len(theta), 0)),
        f"Dixon's determinant of degree {max(degrees)}",
        len(solved) == len(pencils),
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Pencil:
    """Pencil W = P + x Q with one hidden direction, without zero rows and columns.

    Attributes:
        hidden: index of the hidden direction x.
        others: indices of the other directions.
        products: set of directions of each column: the null vector has the product of their
            inverses there.
        P, Q: square matrices of the pencil.
    """

    hidden: int
    others: list[int]
    products: list[frozenset[int]]
    P: Complex
    Q: Complex

    def angles(self, x: complex, t: Complex) -> Real:
        """Return angles [rad] of all directions at a root x with null vector t of the pencil."""
        theta = np.zeros(len(self.others) + 1)
        theta[self.hidden] = np.angle(x)
        place = {product: k for k, product in enumerate(self.products)}
        for j in self.others:
            pairs = [
                (t[k], t[place[product | {j}]])
                for product, k in place.items()
                if j not in product and product | {j} in place
            ]
            inverse = sum(np.conj(low) * high for low, high in pairs)
            theta[j] = -np.angle(inverse)
        return theta


def _sign(order: tuple[int, ...]) -> int:
    """Return the sign, 1 or -1, of the permutation `order` of 0, 1, ..."""
    swaps = sum(a > b for k, a in enumerate(order) for b in order[k + 1 :])
    return -1 if swaps % 2 else 1


def _pencil(angles: Complex, constant: Complex, hidden: int) -> _Pencil | None:
    """Return the pencil whose eigenvalues are the values of the direction with index `hidden`.

    `angles` (L, 2 L) and `constant` (L,) are as in `dixon_roots`. None if it vanishes.
    """
    L, n = angles.shape
    others = [k for k in range(n) if k != hidden]
    a, b, c = angles, constant, angles[:, hidden]
    upper = list(combinations(others, L))
    lower = list(combinations(others, L - 1))
    size = len(upper)
    P, Q = np.zeros((2 * size, 2 * size), complex), np.zeros((2 * size, 2 * size), complex)

    def det(*columns: Complex) -> complex:
        return complex(np.linalg.det(np.column_stack(columns)))

    def rest(product: tuple[int, ...]) -> tuple[int, ...]:
        return tuple(k for k in others if k not in product)

    # in the signs of permutations, the hidden direction has index zero, before all others
    for k, J in enumerate(upper):
        left = rest(J)
        factor = _sign((-1, *left, *J)) * det(*(-a[:, j].conj() for j in J))
        P[k, k] = factor * det(b, *(a[:, j] for j in left))
        Q[k, k] = factor * det(c, *(a[:, j] for j in left))
    for row, K in enumerate(lower, size):
        left = rest(K)
        factor = _sign((*left, -1, *K)) * det(*(a[:, j] for j in left))
        P[row, row] = factor * det(c.conj(), *(-a[:, j].conj() for j in K))
        Q[row, row] = factor * det(b.conj(), *(-a[:, j].conj() for j in K))
        for j in left:
            column = upper.index(tuple(sorted((*K, j))))
            value = factor * det(a[:, j].conj(), *(-a[:, m].conj() for m in K))
            P[column, row] = value
            Q[row, column] = value
    products = [frozenset(J) for J in (*upper, *lower)]
    largest = np.maximum(np.abs(P), np.abs(Q))
    kept = list(range(2 * size))
    while True:
        block = largest[np.ix_(kept, kept)]
        full = (block.max(axis=0) > _ZERO * block.max()) & (block.max(axis=1) > _ZERO * block.max())
        if np.all(full):
            break
        kept = [k for k, one in zip(kept, full, strict=True) if one]
        if not kept:
            return None
    square = np.ix_(kept, kept)
    return _Pencil(hidden, others, [products[k] for k in kept], P[square], Q[square])


_PLACES = np.exp(1j * np.array([0.7, 2.1, 3.3, 4.9, 5.8])) * np.array([1.0, 0.8, 1.25, 0.9, 1.1])
"""Values of x at which the pencil may be inverted; the best conditioned is used. Any values that
are no roots are possible."""


def _eigenvectors(pencil: _Pencil) -> Iterator[tuple[Complex, Complex]]:
    """Yield the eigenvalues x and null vectors (columns) of a pencil once.

    Nothing is yielded if the pencil is singular for all x.
    """
    scale = 1 / np.maximum(np.abs(pencil.P), np.abs(pencil.Q)).max(axis=1)
    P, Q = scale[:, None] * pencil.P, scale[:, None] * pencil.Q
    shifted = [P + x * Q for x in _PLACES]
    regular = [1 / np.linalg.cond(W) for W in shifted]
    best = int(np.argmax(regular))
    if regular[best] < _SINGULAR:
        return
    # (P + x0 Q) t = -(x - x0) Q t
    values, vectors = np.linalg.eig(np.linalg.solve(shifted[best], Q))
    with np.errstate(all="ignore"):
        x = _PLACES[best] - 1 / values
    finite = np.isfinite(x) & (np.abs(x) < _FAR) & (np.abs(x) > 1 / _FAR)
    yield x[finite], vectors[:, finite]


def _count_distinct(x: Complex) -> int:
    """Return the number of different values of x."""
    kept = list[complex]()
    for value in x:
        if all(abs(value - other) > _APART * abs(value) for other in kept):
            kept.append(value)
    return len(kept)


# A triad with prismatic joints: two loops in one direction x and three further unknowns.
#
# For a given x, the three unknowns are y = y0(x) + t alpha with a complex number t. A unit number y
# is a circle of t. A real y (after rotation by its link) is a line. The condition that three
# circles or lines have a common point is a trigonometric polynomial in x of degree three at most.


_SAMPLES = 16
_TAIL = 1e-8
"""Relative size of coefficients above degree three: rounding of products of six lengths."""


def triad_roots(loops: PlanarLoops) -> _PartRoots:
    """Return candidates for the unknowns of two loops with prismatic joints.

    Args:
        loops: two closure rows in four unknowns, for which `_best_triad` returns a triad.

    Raises:
        LoopError: the polynomial vanishes for all directions.
    """
    triad = _best_triad(loops)
    assert triad is not None  # tested by the caller
    angle, degree = triad.angles()
    theta, s = triad.unknowns(angle)
    return _PartRoots(theta, s, f"the polynomial of a triad, of degree {degree}")


def _best_triad(loops: PlanarLoops) -> _Triad | None:
    """Return a triad of `loops` with the first hidden direction that is possible, or None.

    The rest of the equations are circles or lines of the complex number t of another direction.
    """
    for hidden in range(loops.counts[0]):
        if all(k in (KNOWN, hidden) for k in loops.carriers):
            triad = _Triad.of(loops, hidden)
            if triad is not None:
                return triad
    return None


@dataclass(frozen=True, slots=True, eq=False)
class _Triad:
    """Two loops with one hidden direction.

    Attributes:
        loops: closure rows of the loops.
        hidden: index of the hidden direction x.
        columns: (2, 3) factors of the three other unknowns: directions, then displacements.
        alpha: (3,) null vector of these columns.
    """

    loops: PlanarLoops
    hidden: int
    columns: Complex
    alpha: Complex

    @staticmethod
    def of(loops: PlanarLoops, hidden: int) -> _Triad | None:
        """Return the triad with a hidden direction; None if two columns are parallel."""
        others = [k for k in range(loops.counts[0]) if k != hidden]
        columns = np.concatenate([loops.angles[:, others], loops.slides], axis=1)
        alpha = np.linalg.svd(columns)[2][-1].conj()
        if np.min(np.abs(alpha)) < _SMALL:
            return None
        return _Triad(loops, hidden, columns, alpha)

    def _curves(self, x: Complex) -> tuple[Real, Complex, Real, Complex]:
        """Return K, u, w of the curves K |t|^2 + 2 Re(u* t) + w = 0 at x (r,), and y at t = 0."""
        fixed = x[:, None] * self.loops.angles[:, self.hidden] + self.loops.constant
        y = -fixed @ np.linalg.pinv(self.columns).T
        turned = self.loops.counts[0] - 1
        k, w = np.zeros(3), np.empty((len(x), 3))
        u = np.empty((len(x), 3), complex)
        k[:turned] = 1.0
        u[:, :turned] = y[:, :turned] * np.conj(self.alpha[:turned])
        u[:, :turned] /= np.abs(self.alpha[:turned]) ** 2
        w[:, :turned] = (np.abs(y[:, :turned]) ** 2 - 1) / np.abs(self.alpha[:turned]) ** 2
        for j, carrier in enumerate(self.loops.carriers, turned):
            # y e^(-i carrier) is real: its imaginary part is Re(-i ..)
            back = 1.0 if carrier == KNOWN else np.conj(x)
            u[:, j] = np.conj(-1j * self.alpha[j] * back) / 2
            w[:, j] = np.imag(y[:, j] * back)
        return k, u, w, y

    def _meeting(self, x: Complex) -> tuple[Complex, Real, Real]:
        """Return N and D of the point t = N / D on two of the curves, and the polynomial at x."""
        k, u, w, _ = self._curves(x)
        first = 0
        lines_u, lines_w = u - (k != 0) * u[:, :1], w - (k != 0) * w[:, :1]
        if k[0] == 0:
            lines_u, lines_w = u, w
        N = 0.5j * (lines_w[:, 1] * lines_u[:, 2] - lines_w[:, 2] * lines_u[:, 1])
        D = np.imag(np.conj(lines_u[:, 1]) * lines_u[:, 2])
        value = 2 * np.real(np.conj(u[:, first]) * N) + w[:, first] * D
        if k[0]:
            value = np.abs(N) ** 2 + value * D
        return N, D, value

    def angles(self) -> tuple[Real, int]:
        """Return the angles [rad] of the hidden direction near real roots, and the degree.

        Raises LoopError if the polynomial vanishes for all directions.
        """
        x = np.exp(2j * pi * np.arange(_SAMPLES) / _SAMPLES)
        spectrum = np.fft.fft(self._meeting(x)[2]) / _SAMPLES
        coefficients = spectrum[np.arange(-3, 4)]  # of x^-3 .. x^3
        largest = np.max(np.abs(spectrum))
        if largest < _ZERO or np.max(np.abs(spectrum[4:-3])) > _TAIL * largest:
            raise LoopError(
                "the equation of a triad vanishes for every direction of a link, so that links may"
                " move"
            )
        degree = 3
        while degree > 0 and abs(coefficients[3 + degree]) < _ZERO * largest:
            degree -= 1
        roots = np.roots(coefficients[3 - degree : 4 + degree][::-1])
        with np.errstate(all="ignore"):
            near = np.abs(np.log(np.abs(roots))) < _NEAR_CIRCLE
        return np.angle(roots[near]), 2 * degree

    def unknowns(self, angle: Real) -> tuple[Real, Real]:
        """Return theta (r, n) and s (r, m) at angles (r,) [rad] of the hidden direction."""
        x = np.exp(1j * angle)
        N, D, _ = self._meeting(x)
        y = self._curves(x)[3] + (N / np.where(D == 0, NONZERO, D))[:, None] * self.alpha
        n, _ = self.loops.counts
        theta = np.empty((len(x), n))
        theta[:, self.hidden] = angle
        theta[:, [k for k in range(n) if k != self.hidden]] = np.angle(y[:, : n - 1])
        back = np.where(self.loops.carriers == KNOWN, 1.0, np.conj(x)[:, None])
        return theta, np.real(y[:, n - 1 :] * back)


# Any other loops, such as three with prismatic joints: all complex roots of random loops with the
# same nonzero factors are found once, by monodromy, and then followed to the given loops.
#
# The conjugate of a row is a separate row: P+ w+ = 0 and P- w- = 0, with w+ = (e^(i theta),
# s e^(i theta_c), 1) and w- = (e^(-i theta), s e^(-i theta_c), 1). The unknowns may be complex.


_MONODROMY_SEED = 20260415
_IDLE, _MOST_WAYS = 4, 60
"""Number of monodromy loops without new roots after which the roots count as complete, and largest
number of monodromy loops."""
_CERTAIN = 0.03
"""Largest product of Newton's step and the curvature of the rows at a certified root: below one
half one root is near; the margin is for rounding."""
_NEAR = 0.1
"""Distance from a root [rad, or sizes] within which the curvature changes by a tenth at most."""
_ROUNDING = 1e-14
"""Rounding of the rows, in sizes: lower limit of Newton's step."""
_NEARLY_REAL = 0.1
"""Largest imaginary part of a candidate for a real double root, at the end of a path before t = 1:
t misses 1 by some hundredths there, and the root by about the square root of that."""
_END = 1e-2
"""Largest distance of t from 1 at such an end."""
_SAME_ROOT = 1e-6
"""Largest distance between a certified root and the same root after refinement."""


@dataclass(frozen=True, slots=True, eq=False)
class _Rows:
    """Rows and their conjugates, as independent analytic equations in complex unknowns.

    Attributes:
        P: (2, L, n + m + 1) factors of the rows and of their conjugates.
        carriers: (m,) link of each displacement, as in `PlanarLoops`.
    """

    P: Complex
    carriers: Numbers

    @staticmethod
    def of(loops: PlanarLoops) -> _Rows:
        """Return the rows of plane loops with their conjugates."""
        P = np.concatenate([loops.angles, loops.slides, loops.constant[:, None]], axis=1)
        return _Rows(np.array([P, P.conj()]), loops.carriers)

    def with_constants(self, rng: np.random.Generator) -> _Rows:
        """Return the rows with random constants."""
        P = self.P.copy()
        P[:, :, -1] = _random(rng, *P.shape[:2])
        return _Rows(P, self.carriers)

    def terms(self, x: Complex) -> tuple[Complex, Complex]:
        """Return the terms (r, 2, n + m + 1) that P multiplies, and their derivatives by x."""
        m = len(self.carriers)
        n, r = x.shape[1] - m, len(x)
        w = np.ones((r, 2, n + m + 1), dtype=np.complex128)
        dw = np.zeros((r, 2, n + m + 1, n + m), dtype=np.complex128)
        for kind, sign in enumerate((1j, -1j)):
            unit = np.concatenate([np.exp(sign * x[:, :n]), np.ones((r, 1))], axis=1)
            w[:, kind, :n] = unit[:, :n]
            dw[:, kind, range(n), range(n)] = sign * unit[:, :n]
            for j, k in enumerate(self.carriers):
                w[:, kind, n + j] = x[:, n + j] * unit[:, k]
                dw[:, kind, n + j, n + j] = unit[:, k]
                if k != KNOWN:
                    dw[:, kind, n + j, k] = sign * x[:, n + j] * unit[:, k]
        return w, dw

    def values(self, x: Complex) -> tuple[Complex, Complex]:
        """Return the rows (r, 2 L) at unknowns x (r, n + m), and derivatives (r, 2 L, n + m)."""
        w, dw = self.terms(x)
        size = self.P.shape[0] * self.P.shape[1]
        rows = np.einsum("klc,rkc->rkl", self.P, w).reshape(len(x), size)
        return rows, np.einsum("klc,rkcj->rklj", self.P, dw).reshape(len(x), size, x.shape[1])

    def followed(self, other: _Rows, x: Complex) -> tuple[Complex, Real]:
        """Track roots x (r, n + m) of these rows to roots of other rows along a straight path.

        Return the ends and the reached path parameter t (r,), 1 at a completed path.
        """
        change = other.P - self.P

        def newton(x: Complex, t: Real, _: Complex) -> tuple[Complex, Complex]:
            w, dw = self.terms(x)
            P = self.P + t[:, None, None, None] * change
            rows = np.einsum("rklc,rkc->rkl", P, w)
            J = np.einsum("rklc,rkcj->rklj", P, dw)
            rate = np.einsum("klc,rkc->rkl", change, w)
            size = rows.shape[1] * rows.shape[2]
            sides = np.stack([rows, rate], axis=-1).reshape(len(x), size, 2)
            step = -solved(J.reshape(len(x), size, x.shape[1]), sides)
            return step[..., 0], step[..., 1]

        return follow(newton, x, lambda x, slope: (x, slope))

    def certified(self, x: Complex) -> tuple[Complex, Real]:
        """Return certified roots near x, each once, and their error bounds (radius) per unknown.

        Source: Ortega & Rheinboldt 1970, section 12.6; in floating point, with room for rounding.
        """
        n = x.shape[1] - len(self.carriers)
        with np.errstate(all="ignore"):
            for _ in range(3):
                rows, J = self.values(x)
                x = x - solved(J, rows[..., None])[..., 0]
                x = x[np.all(np.isfinite(x), axis=1)]
            rows, J = self.values(x)
            W = np.abs(solved(J, np.broadcast_to(np.eye(x.shape[1], dtype=complex), J.shape)))
            w = np.abs(self.terms(x)[0])
            # second derivatives of s e^(i theta) by s and theta, in addition to those by theta only
            w[:, :, n:-1] *= 1 + 2 / np.maximum(np.abs(x[:, None, n:]), NONZERO)
            bend = np.einsum("klc,rkc->rkl", np.abs(self.P[:, :, :-1]), w[:, :, :-1])
            gain = np.max(np.einsum("rij,rj->ri", W, bend.reshape(rows.shape)), axis=1)
            radius = 2 * np.max(np.einsum("rij,rj->ri", W, np.abs(rows) + _ROUNDING), axis=1)
            certain = (gain * radius < _CERTAIN) & (radius < _NEAR)
        x, radius = x[certain], radius[certain]
        kept = list[int]()
        for k in np.argsort(radius, kind="stable"):
            gap = x[k] - x[kept]
            gap[:, :n] -= 2 * pi * np.round(gap[:, :n].real / (2 * pi))
            if np.all(np.max(np.abs(gap), axis=1) > radius[k] + radius[kept]):
                kept.append(int(k))
        return x[kept], radius[kept]


def _random(rng: np.random.Generator, *shape: int) -> Complex:
    """Return random complex numbers whose real and imaginary parts are normally distributed."""
    return np.asarray(rng.normal(size=shape) + 1j * rng.normal(size=shape), np.complex128)


@functools.lru_cache(maxsize=16)
def _random_start(links: bytes, count: int, carriers: tuple[int, ...]) -> tuple[_Rows, Complex]:
    """Return random rows and all their roots.

    Args:
        links: bytes of (L, n + m): one for a nonzero factor.
        count: number L of rows.
        carriers: link of each displacement, as in `PlanarLoops`.
    """
    rng = np.random.default_rng(_MONODROMY_SEED)
    there = np.frombuffer(links, dtype=bool).reshape(count, -1)

    def drawn() -> _Rows:
        P = np.concatenate([_random(rng, 2, *there.shape) * there, _random(rng, 2, count, 1)], 2)
        return _Rows(P, np.array(carriers, dtype=int))

    rows, x = drawn(), 0.5 * _random(rng, 1, there.shape[1])
    # constants for which x is a root
    rows.P[:, :, -1] -= rows.values(x)[0].reshape(2, count)
    idle = 0
    for _ in range(_MOST_WAYS):
        if idle == _IDLE:
            break
        y, ways = x, [rows, drawn(), drawn(), rows]
        for begin, end in pairwise(ways):
            y, t = begin.followed(end, y)
            y = y[t >= 1]
        known = len(x)
        x, _ = rows.certified(np.concatenate([x, y]))
        idle = idle + 1 if len(x) == known else 0
    return rows, x


def path_roots(loops: PlanarLoops) -> _PartRoots:
    """Return the unknowns of any loops, by path tracking from random loops.

    The paths first run to random constants. The number of regular ends is the number of roots for
    generic constants with these links, which is the maximum for all constants.

    Args:
        loops: closure rows, two real equations for each pair of unknowns.
    """
    n, _ = loops.counts
    links = np.abs(np.concatenate([loops.angles, loops.slides], axis=1)) > _SMALL
    start, x = _random_start(links.tobytes(), len(links), tuple(int(k) for k in loops.carriers))
    rows = _Rows.of(loops)
    general = rows.with_constants(np.random.default_rng(_MONODROMY_SEED))
    y, t = start.followed(general, x)
    own, _ = general.certified(y[t >= 1])
    y, t = general.followed(rows, own)
    certain, radius = rows.certified(y[t >= 1])
    near = y[(t > 1 - _END) & (np.max(np.abs(y.imag), axis=1) < _NEARLY_REAL)].real
    real = certain[np.max(np.abs(certain.imag), axis=1) <= radius].real
    every = np.concatenate([real, near])
    theta, s, residual = refine(loops, every[:, :n], every[:, n:])
    kept = residual < _OPEN
    theta, s = _distinct(loops, theta[kept], s[kept], residual[kept])
    found = np.concatenate([theta, s], axis=1)
    folds = sum(not _is_near(x, real, n) for x in found)
    meet = f", and {2 * folds} where roots meet" if folds else ""
    method = f"homotopy, certified: {len(certain)} of {len(own)} paths{meet}"
    return _PartRoots(theta, s, method, len(certain) + 2 * folds == len(own))


def _is_near(x: Real, roots: Real, n: int) -> bool:
    """Whether x (n + m,) equals one of the roots (r, n + m); the first n elements are angles."""
    gap = roots - x
    gap[:, :n] = pi - np.mod(pi - gap[:, :n], 2 * pi)
    return bool(np.any(np.max(np.abs(gap), axis=1) < _SAME_ROOT))
