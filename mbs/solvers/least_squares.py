"""Least squares: minimum-norm solutions, Gauss-Newton and Levenberg-Marquardt iterations."""

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
    """Return the minimum-norm least-squares solution x (n,) of A x = b, for A of any rank.

    Householder QR with column pivoting; the null space component is then removed from x. Each sum
    has a fixed order. The results of linear algebra libraries depend in the last digits on the
    processor and on the number of threads; results of this function do not.

    Source: Golub & Van Loan 2013, section 5.4.

    Args:
        A: (m, n) matrix.
        b: (m,) right-hand side.
        gap: a column counts as dependent if its part orthogonal to the previous columns is shorter
            than this fraction of the longest column.
    """
    A, b = (np.ascontiguousarray(given, dtype=float) for given in (A, b))
    x = np.empty(A.shape[1])
    core_library().shortest_solution(A, b, gap, x)
    return x


MANY = 100
"""Number of unknowns from which sparse matrices are solved by sparse arithmetic."""
_FULL = 0.1
"""Largest fraction of non-zero elements of a matrix that is treated as sparse."""
_DAMPED = 1e-13
"""Damping that is added to A A', relative to its largest row: 1e-5 of the square of a singular
value that is 1e-4 of the largest, and a thousand times the rounding of the sums."""
_SOLUTIONS = 4
"""Number of refinements. Each leaves 1e-3 of the error, and a larger fraction of its components
with small singular values."""
_FILTERED = 2
"""Number of filter steps per refinement. They remove the inconsistent part of the right-hand side,
which the solution would divide by the damping. Each step reduces it to 1e-3."""


@dataclass(frozen=True, slots=True, eq=False)
class Entries:
    """Sparse matrix by elements; each element occurs once.

    Attributes:
        rows: (k,) row indices.
        columns: (k,) column indices.
        values: (k,) values; zeros are permitted.
        shape: shape of the matrix.
    """

    rows: NDArray[np.int64]
    columns: NDArray[np.int64]
    values: Array
    shape: tuple[int, int]

    def dense(self) -> Array:
        """Return the matrix as a dense array of the given shape."""
        full = np.zeros(self.shape)
        full[self.rows, self.columns] = self.values
        return full


def sparse_solution(A: Entries, b: Array) -> Array:
    """Return the minimum-norm least-squares solution x (n,) of A x = b for a large sparse matrix.

    The time is proportional to the number of unknowns if each is coupled to few others, as in
    chains. Directions with singular values below 1e-6 of the largest are not moved. The result is
    equal on every processor, because CasADi factorises by plain arithmetic.

    Source: Kryanev 1974, iterated regularisation.

    Args:
        A: (m, n) matrix.
        b: (m,) right-hand side.
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


# Solution of r(x) = 0 with any number of unknowns and equations, also if rank-deficient.


Vector = NDArray[np.float64]
Jacobian = Vector | Entries
Residual = Callable[[Vector], tuple[Vector, Jacobian]]
"""Callable x -> residual (m,) and Jacobian (m, n), dense or, if mostly zero, as `Entries`."""

_RANK, _ITERATIONS = 1e-9, 100
"""Fraction of the largest singular value below which others count as zero (no regular problem has
singular values near it), and maximum number of iterations (ten are already many)."""
_CONVERGED = 1  # status of a converged iteration in least_squares.h


@dataclass(frozen=True, slots=True)
class LeastSquaresResult:
    """Result of an iteration.

    Attributes:
        x: (n,) unknowns at the end.
        residual: Euclidean norm of the residual at x.
        converged: whether the iteration converged; `gauss_newton` requires that every element of
            the residual is below its tolerance.
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
    """Solve r(x) = 0 by the damped Gauss-Newton method with minimum-norm steps.

    Each step is the minimum-norm least-squares solution of the linearised equations, so dependent
    equations and undetermined unknowns are permitted. The step is halved until the residual
    decreases. Results are bit-identical on every processor.

    Args:
        function: callable that returns residual and Jacobian.
        start: (n,) initial guess; the solution found is near it.
        tolerance: absolute tolerance of the residual, for all elements or for each.
        iterations: maximum number of iterations.
        rank_tolerance: singular values below this fraction of the largest count as zero.
        values: callable that returns the residual only, if that is cheaper; most trial steps do
            not need the Jacobian.

    Returns:
        The last iterate, converged or not.
    """
    x = np.array(start, dtype=float)
    r, J = function(x)
    first = J if isinstance(J, Entries) else _all_entries(J)
    r, e = np.array(r, dtype=float), np.array(first.values, dtype=float)
    limits = np.array(np.broadcast_to(tolerance, r.shape), dtype=float)
    own, known = x.copy(), [(r, J)]  # the first evaluation returns the known values

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
    """Return integers as an array of C integers."""
    return np.array(numbers, dtype=np.intc)


def _all_entries(J: Vector) -> Entries:
    """Return a dense matrix as `Entries` with all its elements, including zeros."""
    rows, columns = np.indices(J.shape).reshape(2, -1)
    return Entries(rows, columns, J.ravel(), J.shape)


def _sparse_step(
    rows: NDArray[np.integer[Any]],
    columns: NDArray[np.integer[Any]],
    shape: tuple[int, int],
    filled: int,
) -> Any:
    """Return `sparse_solution` in the form that the run-time library calls.

    None if the matrix is small or dense, so that the library uses its own dense solution.

    Args:
        rows: (k,) row of each element.
        columns: (k,) column of each element; negative for elements that are not in the matrix.
        shape: shape of the matrix.
        filled: number of non-zero elements.
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
    """Equations r(q, p) = 0, solved repeatedly for some elements of q, by any thread."""

    def __init__(self, equations: Function, values: Function) -> None:
        """Store the Functions.

        Args:
            equations: `equations(q, p) -> r, J`, r dense.
            values: `values(q, p) -> r`.
        """
        self._functions = equations, values
        self._workspaces: list[_Workspace] = []  # unused ones; a thread takes one at a time

    def near(
        self, q: Vector, p: Vector, free: Sequence[int], tolerance: Vector
    ) -> tuple[Vector, LeastSquaresResult]:
        """Solve by the iteration of `gauss_newton`, starting near q.

        Args:
            q: (nq,) initial guess; positions that are not in `free` are constant.
            p: (np,) parameters.
            free: indices of the unknowns in q.
            tolerance: absolute tolerance of each equation.

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
    """Evaluations of `NewtonEquations` with their own memory, for one thread at a time."""

    def __init__(self, equations: Function, values: Function) -> None:
        pattern = equations.sparsity_out(1)
        self.row, self.columns = (np.array(x, dtype=np.intc) for x in pattern.get_triplet())
        self.shape = pattern.shape
        self.calls = tuple(interpreted_evaluation(f, reraise) for f in (equations, values))
        self.r, self.e = np.zeros(equations.numel_out(0)), np.zeros(pattern.nnz())

    def solved(
        self, q: Vector, p: Vector, free: Sequence[int], tolerance: Vector
    ) -> tuple[Vector, LeastSquaresResult]:
        """Solve r(q, p) = 0 for the elements `free` of q; see `NewtonEquations.near`."""
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


# Minimum of a sum of squares without a root nearby.


_FIRST, _EASED, _STIFFENED, _STIFFEST = 1e-3, 3.0, 4.0, 1e12
"""Damping mu at the start (nearly a Gauss-Newton step for Jacobians of size one), its divisor after
a successful step, its factor after a failed step (different from the divisor to avoid cycles), and
its largest value, where steps are too short to change the digits of r' r."""
_LEAST = 1e-15
"""Smallest damping: J' J has rounding errors of 1e-16, which may make it singular if there are more
unknowns than equations."""
_SETTLED = 1e-16
"""Fraction of r' r below which a decrease is rounding error."""


def levenberg_marquardt(
    function: Callable[[Vector], tuple[Vector, Vector]], start: Vector, *, iterations: int = 300
) -> LeastSquaresResult:
    """Find a local minimum of r' r, even if the Jacobian loses rank at it.

    The step s solves (J' J + mu 1) s = -J' r. mu decreases after a successful step and increases
    after a failed one.

    Source: Marquardt 1963.

    Args:
        function: callable that returns residual and Jacobian.
        start: (n,) initial guess.
        iterations: maximum number of iterations.

    Returns:
        The last iterate. It has converged if further steps do not decrease r' r.
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
