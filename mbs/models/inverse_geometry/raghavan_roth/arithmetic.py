"""The elimination of joints 1 and 2 of a loop in expressions, with pivots that are chosen once.

Source: Raghavan & Roth 1993; Manocha & Canny 1994.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi
import numpy as np
from casadi import DM, SX
from numpy.typing import NDArray

from mbs.models.inverse_geometry.raghavan_roth.elimination import Elimination
from mbs.models.inverse_geometry.raghavan_roth.pairs import SIZE, SLOPES, Array
from mbs.solvers.rank import first_best
from mbs.spatial import Pose

_ZERO = 1e-12


def table(elimination: Elimination, ways: Sequence[Pose]) -> SX:
    """(s - 1, m + n3 n4 n5) the equations of a loop, a column a monomial.

    Args:
        elimination: of joints 1 and 2, which have m = n1 n2 - 1 monomials; their columns are first,
            then those of x4^i x5^j for each part of joint 3.
        ways: the six ways of the loop.
    """
    right, left = _right_side(elimination, ways), _left_side(elimination, ways)
    sides = (
        part - casadi.mtimes(right[:, 0], SX(DM(one)).T)
        for part, one in zip(left, elimination.one, strict=True)
    )
    return SX(casadi.horzcat(right[:, 1:], *sides)[1:, :])


def eliminated(A: SX, values: Array, columns: int, rank: int) -> tuple[SX, Array]:
    """The rows of equations that are left without the first columns, by Gauss.

    Args:
        A: (rows, all columns) expressions.
        values: (samples, rows, all columns) of A where the loop is generic.
        columns: the number of columns to be eliminated.
        rank: of these.

    Returns:
        (rows - rank, columns left) expressions, and their values.
    """
    rows = [A[k, :] for k in range(A.size1())]
    values = values / np.max(np.abs(values), axis=(1, 2), keepdims=True)
    for _ in range(rank):
        r, c = _pivot(values[:, :, :columns])
        pivot, chosen = rows.pop(r), values[:, r]
        values = np.delete(values, r, axis=1)
        factors = values[:, :, c] / chosen[:, None, c]
        values = values - factors[:, :, None] * chosen[:, None]
        for k in np.nonzero(np.any(np.abs(factors) > _ZERO, axis=0))[0]:
            rows[k] = _cleared(rows[k] - rows[k][c] / pivot[c] * pivot, values[:, k])
    return SX(casadi.vertcat(*rows)[:, columns:]), values[:, :, columns:]


def independent_rows(values: Array, count: int) -> list[int]:
    """Numbers of as many rows that are independent in all of (samples, rows, n), ascending."""
    left, numbers, found = values, np.arange(values.shape[1]), list[int]()
    for _ in range(count):
        r, c = _pivot(left)
        found.append(int(numbers[r]))
        pivot, numbers = left[:, r], np.delete(numbers, r)
        left = np.delete(left, r, axis=1)
        factors = left[:, :, c] / np.where(pivot[:, None, c] == 0, 1.0, pivot[:, None, c])
        left = left - factors[:, :, None] * pivot[:, None]
    return sorted(found)


def dialytic(elimination: Elimination, E: SX) -> SX:
    """(2 k, size) k equations of one part of joint 3, and below them their products by x4 or x5."""
    g5, raised = elimination.grid[1], elimination.raised
    n4, n5 = len(elimination.fourth), len(elimination.fifth)
    M = SX(2 * E.size1(), elimination.size)
    for i in range(n4):
        for j in range(n5):
            M[: E.size1(), i * g5 + j] = E[:, i * n5 + j]
            M[E.size1() :, (i + 1 - raised) * g5 + j + raised] = E[:, i * n5 + j]
    return M


def _pivot(values: Array) -> tuple[int, int]:
    """The row and the column of the entry that is largest where it is smallest."""
    smallest = np.min(np.abs(values), axis=0)
    r, c = np.unravel_index(first_best(smallest.ravel()), smallest.shape)
    return int(r), int(c)


def _cleared(row: SX, values: Array) -> SX:
    """The row with zeros for the entries that vanish at all samples."""
    cleared = SX(1, row.size2())
    for k in np.nonzero(np.any(np.abs(values) > _ZERO, axis=0))[0]:
        cleared[0, int(k)] = row[0, int(k)]
    return cleared


def _right_side(elimination: Elimination, ways: Sequence[Pose]) -> SX:
    u = _pair(ways[5].inverse())[elimination.elements.tolist()]
    once = _carried(elimination, ways[0].inverse(), _moved(elimination.first, u))
    return _carried(elimination, ways[1].inverse(), _moved(elimination.second, once))


def _left_side(elimination: Elimination, ways: Sequence[Pose]) -> list[SX]:
    w = _pair(ways[4])[elimination.elements.tolist()]
    once = _carried(elimination, ways[3], _moved(elimination.fifth, w))
    twice = _carried(elimination, ways[2], _moved(elimination.fourth, once))
    return [_moved(part[None], twice) for part in elimination.third]


def _moved(parts: Array, columns: SX) -> SX:
    """The columns under every part, one part after the other."""
    return SX(casadi.horzcat(*(casadi.mtimes(_constant(part), columns) for part in parts)))


def _carried(elimination: Elimination, T: Pose, columns: SX) -> SX:
    own = elimination.elements.tolist()
    X = SX(SIZE, SIZE)
    for t, slope in zip(casadi.vertsplit(T.p), SLOPES, strict=True):
        X += t * _constant(slope)
    turned = casadi.diagcat(SX.eye(3), T.R, T.R, T.R, T.R)
    rho = casadi.mtimes(SX.eye(SIZE) + X + 0.5 * casadi.mtimes(X, X), turned)
    return SX(casadi.mtimes(casadi.sparsify(rho[own, own]), columns))


def _pair(T: Pose) -> SX:
    p, z = T.p, T.R[:, 2]
    pp, pz = casadi.dot(p, p), casadi.dot(p, z)
    return SX(casadi.vertcat(1, pp, pz, p, z, casadi.cross(p, z), pp * z - 2 * pz * p))


def _constant(part: NDArray[np.float64]) -> SX:
    return SX(casadi.sparsify(DM(part)))
