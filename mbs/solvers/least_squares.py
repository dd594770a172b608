"""The smallest least-squares solution in plain arithmetic, the same digits on every processor."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from mbs.solvers.rank import EQUAL

Array = NDArray[np.float64]

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
    W = np.column_stack([A, b])[A.any(axis=1)]
    order = list(range(n))
    rank = min(len(W), n)
    squares = (W[:, :n] ** 2).sum(axis=0)
    exact, longest = squares.copy(), float(squares.max(initial=0.0))
    for k in range(rank):
        left = squares[k:]
        lost = left < _CANCELLED * exact[k:]
        if lost.any():
            left[lost] = exact[k:][lost] = (W[k:, k:n][:, lost] ** 2).sum(axis=0)
        most = left.max()
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
        u = free[:, k] / float((free[:, k] ** 2).sum()) ** 0.5
        free[:, k + 1 :] -= u[:, None] * (u[:, None] * free[:, k + 1 :]).sum(axis=0)
        x -= float((u * x).sum()) * u
    solution = np.empty(n)
    solution[order] = x
    return solution


def _reflect(W: Array) -> None:
    """Reflect the columns so that the first one has its first element alone; others may be zero."""
    v = W[:, 0].copy()
    size = math.sqrt((v * v).sum())
    first = -size if v[0] > 0 else size
    v[0] -= first
    rows = v.nonzero()[0]
    v = v[rows, None]
    rest = W[rows, 1:]
    W[rows, 1:] = rest + v * ((v * rest).sum(axis=0) / (first * v[0, 0]))
    W[0, 0] = first
