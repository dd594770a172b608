"""Least squares: smallest solutions, Gauss-Newton and Levenberg-Marquardt iterations."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import casadi
import numpy as np
from casadi import DM
from numpy.typing import NDArray

from mbs.solvers.rank import EQUAL

Array = NDArray[np.float64]

_sum = np.add.reduce  # as its method of arrays, without what that looks at before

_CANCELLED = 1e-4
"""Part of the square of a column's length below which what is left of it is summed anew, as four of
its sixteen digits are gone then."""


def smallest_solution(A: Array, b: Array, gap: float) -> Array:
    """The shortest x (n,) of those that bring A x (m,) nearest to b, for A of any rank.

    Householder's QR with column pivoting: what the remaining columns free is then taken out of x.
    Libraries of linear algebra sum in an order that depends on the processor and on the number of
    threads, and so do the last digits of their solutions. Here each sum has one order.

    Source: Golub & Van Loan 2013, section 5.4.

    Args:
        A: (m, n).
        b: (m,).
        gap: columns that the ones before leave shorter than this part of the longest count as
            dependent.
    """
    n = A.shape[1]
    W = np.column_stack([A, b])[np.logical_or.reduce(A, axis=1)]
    order = list(range(n))
    rank = min(len(W), n)
    squares = _sum(W[:, :n] ** 2, axis=0)
    exact, longest = squares.copy(), float(squares.max(initial=0.0))
    for k in range(rank):
        left = squares[k:]
        lost = left < _CANCELLED * exact[k:]
        if np.logical_or.reduce(lost):
            left[lost] = exact[k:][lost] = _sum(W[k:, k:n][:, lost] ** 2, axis=0)
        most = np.maximum.reduce(left)
        if most <= gap * gap * longest:
            rank = k
            break
        # among columns of equal length the first: which of them rounding makes longest is luck
        pivot = k + int((left >= (1 - EQUAL) * most).argmax())
        if pivot != k:
            W[:, k], W[:, pivot] = W[:, pivot].copy(), W[:, k].copy()
            for row in (squares, exact):
                row[k], row[pivot] = row[pivot], row[k]
            order[k], order[pivot] = order[pivot], order[k]
        _reflect(W[k:, k:])
        squares -= W[k, :n] ** 2
    X = W[:rank, rank:]
    for k in reversed(range(rank)):
        X[k] /= W[k, k]
        X[:k] -= W[:k, k, None] * X[k]
    x = np.zeros(n)
    x[:rank] = X[:, -1]
    free = np.vstack([-X[:, :-1], np.eye(n - rank)])
    for k in range(n - rank):
        u = free[:, k] / float(_sum(free[:, k] ** 2)) ** 0.5
        free[:, k + 1 :] -= u[:, None] * _sum(u[:, None] * free[:, k + 1 :], axis=0)
        x -= float(_sum(u * x)) * u
    solution = np.empty(n)
    solution[order] = x
    return solution


def _reflect(W: Array) -> None:
    """Reflect the columns so that the first one has its first element alone; others may be zero."""
    v = W[:, 0].copy()
    size = math.sqrt(_sum(v * v))
    first = -size if v[0] > 0 else size
    v[0] -= first
    rows = v.nonzero()[0]
    v = v[rows, None]
    rest = W[rows, 1:]
    W[rows, 1:] = rest + v * (_sum(v * rest, axis=0) / (first * v[0, 0]))
    W[0, 0] = first


MANY = 100
"""Unknowns from which a sparse matrix is worth its own arithmetic: pivots by length fill it."""
_FULL = 0.1
"""Part of the elements that are not zero in a matrix that is sparse."""
_DAMPED = 1e-13
"""What is added to A A', in parts of its largest row: 1e-5 of the square of a singular value that
is 1e-4 of the largest, and a thousand times the rounding of the sums."""
_SOLUTIONS = 4
"""Solutions that are added up: each leaves 1e-3 of the error, and more of what A hardly sees."""
_FILTERED = 2
"""How often what no x can reach is taken from the right side, where it would be divided by the
damping: each leaves 1e-3 of it."""


@dataclass(frozen=True, slots=True, eq=False)
class Entries:
    """A sparse matrix by its elements, each of which stands there once.

    Attributes:
        rows: (k,) integers.
        columns: likewise.
        values: (k,), zeros among them.
        shape: of the matrix.
    """

    rows: NDArray[np.int64]
    columns: NDArray[np.int64]
    values: Array
    shape: tuple[int, int]

    def dense(self) -> Array:
        """The matrix with its zeros."""
        full = np.zeros(self.shape)
        full[self.rows, self.columns] = self.values
        return full


def sparse_solution(A: Entries, b: Array) -> Array:
    """The shortest x (n,) of those that bring A x (m,) nearest to b, for large sparse matrices.

    Its time is proportional to the number of unknowns where they are tied to few others, as in
    chains. Motions that A sees by less than 1e-6 of what it sees most are left where they are.
    CasADi's factorisation is plain arithmetic, the same on every processor.

    Source: Kryanev 1974, iterated regularisation.

    Args:
        A: (m, n).
        b: (m,).
    """
    there = A.values != 0
    seen, rows = np.unique(A.rows[there], return_inverse=True)
    places, n = (rows.tolist(), A.columns[there].tolist()), A.shape[1]
    J = DM.triplet(*places, DM(A.values[there].tolist()), len(seen), n)
    S = casadi.mtimes(J, J.T)
    damping = _DAMPED * max(map(abs, S.nonzeros()), default=0.0)
    D, LT, order = casadi.ldl(S + damping * DM.eye(len(seen)))
    x, goal = DM.zeros(n), DM(b[seen].tolist())
    for _ in range(_SOLUTIONS):
        left = goal - casadi.mtimes(J, x)
        for _ in range(_FILTERED):
            left -= damping * casadi.ldl_solve(left, D, LT, order)
        x += casadi.mtimes(J.T, casadi.ldl_solve(left, D, LT, order))
    return np.array(x.nonzeros())


# Solve r(x) = 0 for more or fewer unknowns than equations, rank-deficient ones included.


Vector = NDArray[np.float64]
Jacobian = Vector | Entries
Residual = Callable[[Vector], tuple[Vector, Jacobian]]
"""x -> residual (m,), Jacobian (m, n), as its elements where most of it is zero."""

_STALLED = 1e-14
"""Length of a step [rad or m] that changes no digit of positions of size one that could matter."""

_LAST_DIGITS = 1e-2
"""Part of the tolerance above which one step more is taken: it takes the error to its square."""


@dataclass(frozen=True, slots=True)
class LeastSquaresResult:
    """Where the iteration ended.

    Attributes:
        x: (n,) the unknowns.
        residual: Euclidean norm of the residual there.
        converged: whether every element is below its tolerance.
    """

    x: Vector
    residual: float
    converged: bool


def gauss_newton(
    function: Residual,
    start: Vector,
    *,
    tolerance: float | Vector = 1e-12,
    iterations: int = 100,
    rank_tolerance: float = 1e-9,
    values: Callable[[Vector], Vector] | None = None,
) -> LeastSquaresResult:
    """Damped Gauss-Newton with the smallest step that solves the linearised equations.

    The step is the minimum-norm least-squares solution, so that dependent equations and free
    unknowns do no harm; it is halved until the residual falls. Its arithmetic is plain, so that
    the same start leads to the same digits on every processor.

    Args:
        function: residual and Jacobian.
        start: (n,) first guess; the root found is near to it.
        tolerance: of the absolute residual, one for all elements or one for each.
        iterations: at most.
        rank_tolerance: singular values below this part of the largest count as zero.
        values: the residual alone, where that is less work: most trial steps need no Jacobian.

    Returns:
        The last iterate, converged or not.
    """
    x = np.array(start, dtype=float)
    r, J = function(x)
    if not _finite(r, J):
        return LeastSquaresResult(x, np.inf, False)
    norm, last_digits = _norm(r), _LAST_DIGITS * np.asarray(tolerance)
    for _ in range(iterations):
        size = np.abs(r)
        reached = bool((size <= tolerance).all())
        if reached and (size <= last_digits).all():
            break
        step = _step(J, -r, rank_tolerance)
        length = 1.0
        while length > (0.5 if reached else 1e-6):  # beyond the tolerance one step, if it helps
            trial = x + length * step
            if values is None or _norm(values(trial)) < norm:
                r_trial, J_trial = function(trial)
                norm_trial = _norm(r_trial)
                if norm_trial < norm and _finite(r_trial, J_trial):
                    break
            length /= 2
        else:
            break
        stalled = length * _norm(step) < _STALLED
        x, r, J, norm = trial, r_trial, J_trial, norm_trial
        if stalled or reached:
            break
    return LeastSquaresResult(x, norm, bool((np.abs(r) <= tolerance).all()))


def _step(J: Jacobian, b: Vector, rank_tolerance: float) -> Vector:
    """The shortest x that brings J x nearest to b."""
    m, n = J.shape
    values = J.values if isinstance(J, Entries) else J
    if n >= MANY and np.count_nonzero(values) < _FULL * m * n:
        return sparse_solution(J if isinstance(J, Entries) else _entries(J), b)
    return smallest_solution(J.dense() if isinstance(J, Entries) else J, b, rank_tolerance)


def _entries(J: Vector) -> Entries:
    rows, columns = J.nonzero()
    return Entries(rows, columns, J[rows, columns], J.shape)


def _norm(x: Vector) -> float:
    """Its sum has one order, other than that of a dot product."""
    return math.sqrt(_sum(x * x))


def _finite(r: Vector, J: Jacobian) -> bool:
    values = J.values if isinstance(J, Entries) else J
    return bool(np.isfinite(r).all() and np.isfinite(values).all())


# The smallest sum of squares, where no root is near.


_FIRST, _EASED, _STIFFENED, _STIFFEST = 1e-3, 3.0, 4.0, 1e12
"""The damping mu at the start, nearly a Gauss-Newton step for Jacobians of size one; what divides
it after a step that led down and multiplies it after another, unlike so that no cycle arises; and
the largest, where steps are too short to change the digits of r' r."""
_LEAST = 1e-15
"""The smallest damping: J' J has rounding errors of 1e-16, which may leave it without an inverse
where there are more unknowns than equations."""
_SETTLED = 1e-16
"""Part of r' r below which a gain is the rounding of it."""


def levenberg_marquardt(
    function: Callable[[Vector], tuple[Vector, Vector]], start: Vector, *, iterations: int = 300
) -> LeastSquaresResult:
    """A local minimum of r' r; it is reached too where the Jacobian loses rank at it.

    The step solves (J' J + mu 1) s = -J' r; mu falls where a step leads down and rises where not.

    Source: Marquardt 1963.

    Args:
        function: residual and Jacobian.
        start: (n,) first guess.
        iterations: at most.

    Returns:
        The last iterate; it has converged when further steps gain nothing.
    """
    x, damping = np.array(start, dtype=float), _FIRST
    r, J = function(x)
    for _ in range(iterations):
        step = np.linalg.solve(J.T @ J + damping * np.eye(x.size), -J.T @ r)
        r_trial, J_trial = function(x + step)
        gain = float(r @ r - r_trial @ r_trial)
        if gain > 0:
            settled = gain <= _SETTLED * float(r @ r)
            x, r, J, damping = x + step, r_trial, J_trial, max(damping / _EASED, _LEAST)
        else:
            settled, damping = damping > _STIFFEST, damping * _STIFFENED
        if settled:
            return LeastSquaresResult(x, float(np.linalg.norm(r)), True)
    return LeastSquaresResult(x, float(np.linalg.norm(r)), False)
