"""Least squares: smallest solutions, Gauss-Newton and Levenberg-Marquardt iterations."""

from __future__ import annotations

import ctypes
import functools
import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import resources
from typing import Any

import casadi
import numpy as np
from casadi import DM, Function
from numpy.typing import NDArray

from mbs.errors import CompilerError
from mbs.native import cached_library, compiler_found
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
    if (library := _library()) is not None:
        A, b = (np.ascontiguousarray(given, dtype=float) for given in (A, b))
        x = np.empty(A.shape[1])
        if library.mbs_smallest_solution(*A.shape, _at(A), _at(b), gap, _at(x)):
            raise MemoryError(f"no memory is left for {A.shape} equations")
        return x
    return plain_solution(A, b, gap)


def plain_solution(A: Array, b: Array, gap: float) -> Array:
    """The same without machine code, to the bit: the twin of `native/runtime/least_squares.c`.

    Args:
        A: as of `smallest_solution`, likewise the others.
        b: likewise.
        gap: likewise.
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


# The same in machine code, which is the same for all equations.


_OFTEN = 300
"""Solutions in this process from which machine code is worth its compiler, which takes as long as a
thousand of them, once for all processes."""

_asked = itertools.count()


def _library() -> ctypes.CDLL | None:
    """The machine code; None where few solutions were asked for, or there is no compiler."""
    return _compiled() if next(_asked) >= _OFTEN else None


@functools.cache
def _compiled() -> ctypes.CDLL | None:
    folder = resources.files("mbs.native") / "runtime"
    names = ("least_squares.c", "least_squares.h")
    try:
        if not compiler_found():
            return None
        files = {name: (folder / name).read_text(encoding="utf-8") for name in names}
        library = ctypes.CDLL(str(cached_library(files)))
    except CompilerError:
        return None
    pointer, integer, real = ctypes.c_void_p, ctypes.c_int, ctypes.c_double
    library.mbs_smallest_solution.argtypes = [integer, integer, pointer, pointer, real, pointer]
    library.mbs_gauss_newton.argtypes = [ctypes.POINTER(_GaussNewton), ctypes.POINTER(real)]
    return library


def _at(array: NDArray[Any]) -> int:
    return array.ctypes.data


_EVALUATE = ctypes.CFUNCTYPE(ctypes.c_int)


class _GaussNewton(ctypes.Structure):
    """`least_squares` of `native/runtime/least_squares.h`."""

    _fields_ = (
        *((name, ctypes.c_int) for name in ("size", "rows", "unknowns", "elements")),
        *((name, ctypes.c_void_p) for name in ("q", "r", "e", "free", "row", "column")),
        ("tolerance", ctypes.c_void_p),
        ("gap", ctypes.c_double),
        ("iterations", ctypes.c_int),
        ("equations", _EVALUATE),
        ("values", _EVALUATE),
    )


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


class NewtonEquations:
    """Equations r(q, p) = 0 that are solved for some of q, again and again.

    What `gauss_newton` does with them is machine code, which calls their Functions by itself, for
    fewer than `MANY` unknowns.
    """

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
    ) -> tuple[Vector, LeastSquaresResult] | None:
        """Where `gauss_newton` ends, to the bit; None where there is no machine code for it.

        Args:
            q: (nq,) first guess; what is not free stays.
            p: (np,).
            free: numbers of the unknowns in q.
            tolerance: of each row.

        Returns:
            q (nq,) at the end, and what `gauss_newton` says of the unknowns.
        """
        library = _library() if len(free) < MANY else None
        if library is None:
            return None
        try:
            workspace = self._workspaces.pop()
        except IndexError:
            workspace = _Workspace(*self._functions)
        found = workspace.solved(library, q, p, free, tolerance)
        self._workspaces.append(workspace)
        return found


class _Workspace:
    """Memory from which Functions read and in which they write, and what calls them there."""

    def __init__(self, equations: Function, values: Function) -> None:
        pattern = equations.sparsity_out(1)
        self.row, columns = (np.array(x, dtype=np.intc) for x in pattern.get_triplet())
        self.columns, self.column = columns, np.empty_like(columns)
        self.q, self.p = (np.zeros(equations.numel_in(k)) for k in range(2))
        self.r, self.e = np.zeros(equations.numel_out(0)), np.zeros(pattern.nnz())
        self.error: BaseException | None = None
        self.calls = [
            self._call(equations, [self.r, self.e]),
            self._call(values, [self.r]),
        ]

    def _call(self, function: Function, results: Sequence[Vector]) -> Any:
        made: Any = function.buffer()
        buffer, run = made
        for k, array in enumerate((self.q, self.p)):
            buffer.set_arg(k, array.data)
        for k, array in enumerate(results):
            buffer.set_res(k, array.data)

        def evaluate() -> int:
            try:
                run()
                return int(buffer.ret())
            except BaseException as error:  # control-C too; it cannot pass through machine code
                self.error = error
                return 1

        return _EVALUATE(evaluate)

    def solved(
        self,
        library: ctypes.CDLL,
        q: Vector,
        p: Vector,
        free: Sequence[int],
        tolerance: Vector,
    ) -> tuple[Vector, LeastSquaresResult]:
        """What `NewtonEquations.near` gives.

        Args:
            library: the machine code.
            q: as there, likewise the others.
            p: likewise.
            free: likewise.
            tolerance: likewise.
        """
        self.q[:], self.p[:] = q, p
        indices, number = np.array(free, dtype=np.intc), np.full(len(q), -1, dtype=np.intc)
        number[indices] = np.arange(len(free))
        self.column[:] = number[self.columns]
        limits, residual = np.ascontiguousarray(tolerance), ctypes.c_double()
        arrays: tuple[NDArray[Any], ...] = (self.q, self.r, self.e)
        arrays += (indices, self.row, self.column, limits)
        sizes = (len(q), len(self.r), len(free), len(self.e))
        given = _GaussNewton(*sizes, *map(_at, arrays), _RANK, _ITERATIONS, *self.calls)
        status = library.mbs_gauss_newton(ctypes.byref(given), ctypes.byref(residual))
        if (error := self.error) is not None:
            self.error = None
            raise error
        if status > 1:
            raise RuntimeError("equations of a closure have no value there, or no memory is left")
        found = self.q.copy()
        return found, LeastSquaresResult(found[indices], residual.value, status == 1)


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
