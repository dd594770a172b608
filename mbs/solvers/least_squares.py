"""Least squares: smallest solutions, Gauss-Newton and Levenberg-Marquardt iterations."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import casadi
import numpy as np
from casadi import DM, Function
from numpy.typing import NDArray

from mbs.core import core_library, interpreted_evaluation, python_evaluation, reraise

Array = NDArray[np.float64]


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
    A, b = (np.ascontiguousarray(given, dtype=float) for given in (A, b))
    x = np.empty(A.shape[1])
    core_library().shortest_solution(A, b, gap, x)
    return x


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

_RANK, _ITERATIONS = 1e-9, 100
"""Part of the largest singular value below which others count as zero: where Newton's method is of
use none is near to it; and the most iterations, where ten are many."""
_CONVERGED = 1  # of least_squares.h


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
    iterations: int = _ITERATIONS,
    rank_tolerance: float = _RANK,
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
    first = J if isinstance(J, Entries) else _all_entries(J)
    r, e = np.array(r, dtype=float), np.array(first.values, dtype=float)
    limits = np.array(np.broadcast_to(tolerance, r.shape), dtype=float)
    own, known = x.copy(), [(r, J)]  # the iteration begins with known values

    def equations() -> None:
        found, slopes = known.pop() if known else function(own.copy())
        r_out[:] = found
        e_out[:] = slopes.values if isinstance(slopes, Entries) else slopes.ravel()

    def alone() -> None:
        assert values is not None
        v_out[:] = values(own.copy())

    r_out, e_out, v_out = r.copy(), e.copy(), r.copy()
    evaluate = python_evaluation(equations, (own, np.empty(0)), (r_out, e_out))
    reduced = None if values is None else python_evaluation(alone, (own, np.empty(0)), (v_out,))
    filled = int(np.count_nonzero(first.values))
    step = _sparse_step(first.rows, first.columns, first.shape, filled)
    status, residual = core_library().gauss_newton(
        (evaluate, reduced, step),
        (x, np.empty(0), r, e),
        (_indices(range(len(x))), _indices(first.rows), _indices(first.columns), limits),
        rank_tolerance,
        iterations,
    )
    return LeastSquaresResult(x, residual, status == _CONVERGED)


def _indices(numbers: Iterable[int]) -> NDArray[np.intc]:
    return np.array(numbers, dtype=np.intc)


def _all_entries(J: Vector) -> Entries:
    """All elements of a matrix, zeros included."""
    rows, columns = np.indices(J.shape).reshape(2, -1)
    return Entries(rows, columns, J.ravel(), J.shape)


def _sparse_step(
    rows: NDArray[np.integer[Any]],
    columns: NDArray[np.integer[Any]],
    shape: tuple[int, int],
    filled: int,
) -> Any:
    """Evaluation of the shortest solution of a large sparse matrix; None if it is small or dense.

    Args:
        rows: (k,) row of each element.
        columns: (k,) column of each element; negative for an element that the matrix lacks.
        shape: shape of the matrix.
        filled: number of elements of the matrix that are not zero.
    """
    m, n = shape
    if n < MANY or filled >= _FULL * m * n:
        return None
    kept = columns >= 0
    e, b, x = np.empty(len(columns)), np.empty(m), np.empty(n)
    own = rows[kept].astype(np.int64), columns[kept].astype(np.int64)

    def solve() -> None:
        x[:] = sparse_solution(Entries(*own, e[kept], shape), b)

    return python_evaluation(solve, (e, b), (x,))


class NewtonEquations:
    """Equations r(q, p) = 0 that are solved for some of q, again and again."""

    def __init__(self, equations: Function, values: Function) -> None:
        """Keep the Functions.

        Args:
            equations: `equations(q, p) -> r, J`, r dense.
            values: `values(q, p) -> r`.
        """
        self._functions = equations, values
        self._workspaces: list[_Workspace] = []  # each is for one thread at a time

    def near(
        self, q: Vector, p: Vector, free: Sequence[int], tolerance: Vector
    ) -> tuple[Vector, LeastSquaresResult]:
        """Return the end of the iteration of `gauss_newton`.

        Args:
            q: (nq,) first guess; positions that are not free stay.
            p: (np,).
            free: indices of the unknowns in q.
            tolerance: of each row.

        Returns:
            q (nq,) at the end, and the result for the unknowns.

        Raises:
            RuntimeError: the equations have no value, or no memory is left.
        """
        try:
            workspace = self._workspaces.pop()
        except IndexError:
            workspace = _Workspace(*self._functions)
        found = workspace.solved(q, p, free, tolerance)
        self._workspaces.append(workspace)
        return found


class _Workspace:
    """Evaluations of equations, with their own memory."""

    def __init__(self, equations: Function, values: Function) -> None:
        pattern = equations.sparsity_out(1)
        self.row, self.columns = (np.array(x, dtype=np.intc) for x in pattern.get_triplet())
        self.shape = pattern.shape
        self.calls = tuple(interpreted_evaluation(f, reraise) for f in (equations, values))
        self.r, self.e = np.zeros(equations.numel_out(0)), np.zeros(pattern.nnz())

    def solved(
        self, q: Vector, p: Vector, free: Sequence[int], tolerance: Vector
    ) -> tuple[Vector, LeastSquaresResult]:
        """The result of `NewtonEquations.near`."""
        found, unknowns = np.array(q, dtype=float), _indices(free)
        number = np.full(len(q), -1, dtype=np.intc)
        number[unknowns] = np.arange(len(free))
        column = number[self.columns]
        shape = self.shape[0], len(free)
        step = _sparse_step(self.row, column, shape, int(np.count_nonzero(column >= 0)))
        status, residual = core_library().gauss_newton(
            (*self.calls, step),
            (found, np.array(p, dtype=float), self.r, self.e),
            (unknowns, self.row, column, np.array(tolerance, dtype=float)),
            _RANK,
            _ITERATIONS,
        )
        if status > _CONVERGED:
            raise RuntimeError("equations of a closure have no value there, or no memory is left")
        return found, LeastSquaresResult(found[unknowns], residual, status == _CONVERGED)


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
