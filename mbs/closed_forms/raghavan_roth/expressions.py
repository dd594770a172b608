"""The matrix in one joint that is singular at a solution, as expressions of the pose.

The numeric method takes null rows from singular values; here joints 1 and 2 of the loop are
eliminated with pivots chosen once, at the samples, so that the matrix is plain arithmetic.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi
import numpy as np
from casadi import DM, SX
from numpy.typing import NDArray

from mbs.closed_forms.raghavan_roth.numbers import (
    REGULAR,
    SIZE,
    SLOPES,
    Array,
    Elimination,
    Pencil,
    at,
    eliminations,
    pencil,
    regularity,
)
from mbs.closed_forms.sequence import Problem
from mbs.errors import NoClosedForm
from mbs.recursions.chain import ChainJoint, Ring
from mbs.solvers.rank import first_best, graded
from mbs.spatial import Pose

# The elimination of joints 1 and 2 of a loop in expressions, with pivots that are chosen once.
#
# Source: Raghavan & Roth 1993; Manocha & Canny 1994.


_ZERO = 1e-12
"""Entries, of about one in units of the loop, that vanish at all samples: elimination leaves 1e-14
of rounding in a zero, and an entry that depends on generic positions is larger at one of them."""


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
            rows[k] = _clear(rows[k] - rows[k][c] / pivot[c] * pivot, values[:, k])
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


def _clear(row: SX, values: Array) -> SX:
    """The row with zeros for the entries that vanish at all samples."""
    cleared = SX(1, row.size2())
    for k in np.nonzero(np.any(np.abs(values) > _ZERO, axis=0))[0]:
        cleared[0, int(k)] = row[0, int(k)]
    return cleared


def _right_side(elimination: Elimination, ways: Sequence[Pose]) -> SX:
    u = _pair(ways[5].inverse())[elimination.elements.tolist()]
    once = _carry(elimination, ways[0].inverse(), _moved(elimination.first, u))
    return _carry(elimination, ways[1].inverse(), _moved(elimination.second, once))


def _left_side(elimination: Elimination, ways: Sequence[Pose]) -> list[SX]:
    w = _pair(ways[4])[elimination.elements.tolist()]
    once = _carry(elimination, ways[3], _moved(elimination.fifth, w))
    twice = _carry(elimination, ways[2], _moved(elimination.fourth, once))
    return [_moved(part[None], twice) for part in elimination.third]


def _moved(parts: Array, columns: SX) -> SX:
    """The columns under every part, one part after the other."""
    return SX(casadi.horzcat(*(casadi.mtimes(_constant(part), columns) for part in parts)))


def _carry(elimination: Elimination, T: Pose, columns: SX) -> SX:
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


_ANGLES = (0.3, 1.4, -2.1)  # of joint 3 [rad], at which nothing is special
_FOLDED, _TRIED = 10.0, 3


@dataclass(frozen=True, slots=True, eq=False)
class Characteristic:
    """A square matrix of the position of one joint, singular wherever the loop closes.

    It is M_0 + M_1 cos q + M_2 sin q of a joint that turns, and M_0 + M_1 r + M_2 r^2, or without
    the last term, of one that slides.

    Attributes:
        matrices: the parts M_k, (n, n) expressions of the problem's given.
        joint: name of the joint.
        index: its index in the problem's x.
        prismatic: whether it slides.
        regularity: reciprocal condition of the matrix at positions that are no solutions.
    """

    matrices: tuple[SX, ...]
    joint: str
    index: int
    prismatic: bool
    regularity: float

    def matrix(self, q: SX) -> SX:
        """(n, n) the matrix at a position of the joint [rad or m]."""
        first, *others = self.matrices
        factors = (q, q * q) if self.prismatic else (casadi.cos(q), casadi.sin(q))
        parts = [SX(f * part) for f, part in zip(factors, others, strict=False)]
        return SX(sum(parts, first))


@dataclass(frozen=True, slots=True, eq=False)
class _Loop:
    """One arrangement of the ring, and its ways at the samples."""

    ring: Ring
    pencil: Pencil
    length: float

    @property
    def merit(self) -> float:
        """More where the pose is not in what is eliminated, which then folds to numbers."""
        constant = all(self.ring.gaps[k].pose.matrix.is_constant() for k in (0, 1, 2))
        return self.pencil.merit * (_FOLDED if constant else 1.0)

    @property
    def ways(self) -> list[Pose]:
        """The ways in units of the length: number k follows joint k."""
        gaps = (*self.ring.gaps[1:], self.ring.gaps[0])
        return [Pose(gap.pose.R, gap.pose.p / self.length) for gap in gaps]


def characteristic(problem: Problem) -> Characteristic:
    """The matrix of the arrangement in which it is farthest from singular.

    Source: Raghavan & Roth 1993; Manocha & Canny 1994.

    Args:
        problem: of six joints.

    Raises:
        NoClosedForm: the problem has not six joints, or the matrix is singular at every position.
    """
    if problem.size != 6:
        raise NoClosedForm(
            f"the loop has {problem.size} joints; the characteristic matrix is for six"
        )
    loops = sorted(_loops(problem), key=lambda loop: graded(loop.merit), reverse=True)
    for loop in loops[:_TRIED]:
        found = _characteristic(problem, loop)
        if found.regularity > REGULAR:
            return found
    raise NoClosedForm(
        "the matrix of the general inverse geometric model is singular at every configuration of"
        " joints"
        f" {' '.join(joint.name for joint in problem.ring.joints)}; use method='search'"
    )


def _loops(problem: Problem) -> list[_Loop]:
    """Every arrangement and elimination whose matrix is not singular."""
    length, found = _length(problem), list[_Loop]()
    for ring in (problem.ring, problem.ring.reversed()):
        for first in range(6):
            own = ring.rotated(first)
            prismatic = np.array([not joint.is_rotational for joint in own.joints])
            if prismatic[5]:
                continue
            ways = _numbers(problem, own, length)
            pencils = (pencil(elimination, ways) for elimination in eliminations(prismatic))
            found += [_Loop(own, one, length) for one in pencils if one.regularity > REGULAR]
    return found


def _length(problem: Problem) -> float:
    """A power of two of about the size of the loop at the samples [m]."""
    indices = casadi.horzcat(*(gap.pose.p for gap in problem.ring.gaps))
    total = [float(np.sum(np.linalg.norm(p, axis=0))) for p in problem.at_samples(SX(indices))]
    mean = float(np.mean(total))
    return float(2.0 ** round(np.log2(mean))) if mean > 0 else 1.0


def _numbers(problem: Problem, ring: Ring, length: float) -> Array:
    """(samples, 6, 4, 4) the ways of a loop at the samples."""
    gaps = (*ring.gaps[1:], ring.gaps[0])
    stacked = problem.at_samples(SX(casadi.vertcat(*(gap.pose.matrix for gap in gaps))))
    ways = np.array(stacked).reshape(len(stacked), 6, 4, 4)
    ways[..., :3, 3] /= length
    return ways


def _characteristic(problem: Problem, loop: _Loop) -> Characteristic:
    elimination, joint = loop.pencil.elimination, loop.ring.joints[2]
    A = table(elimination, loop.ways)
    columns = len(elimination.first) * len(elimination.second) - 1
    E, values = eliminated(A, np.array(problem.at_samples(A)), columns, loop.pencil.rank)
    count = len(elimination.third)
    parts = [dialytic(elimination, part) for part in casadi.horzsplit(E, E.size2() // count)]
    numbers = elimination.dialytic(np.stack(np.split(values, count, axis=-1), axis=1))
    rows = independent_rows(_spread(numbers), elimination.size)
    return Characteristic(
        _in_joint([part[rows, :] for part in parts], loop),
        joint.name,
        _place(joint),
        not joint.is_rotational,
        regularity(numbers[:, :, rows]),
    )


def _spread(parts: Array) -> Array:
    """The matrices at some angles, one after the other."""
    count = len(_ANGLES)
    return at(np.repeat(parts, count, axis=0), np.tile(np.array(_ANGLES), len(parts)))


def _in_joint(parts: list[SX], loop: _Loop) -> tuple[SX, ...]:
    """The parts with 1, cos q, sin q, or with the powers of r in metres."""
    joint = loop.ring.joints[2]
    if joint.is_rotational:
        return parts[0], parts[1], joint.sign * parts[2]
    if len(parts) == 3:
        parts = [parts[0] + parts[1], 2 * parts[2], parts[0] - parts[1]]
    return tuple((joint.sign / loop.length) ** k * part for k, part in enumerate(parts))


def _place(joint: ChainJoint) -> int:
    if joint.index is None:
        raise NoClosedForm(f"joint {joint.name} has no place among the unknowns of the problem")
    return joint.index
