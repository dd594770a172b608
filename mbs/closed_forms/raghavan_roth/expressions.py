"""Symbolic matrix in one joint that is singular at a solution of a six-joint arm (Raghavan-Roth).

The numeric method computes null rows by singular values. Here joints 1 and 2 of the loop are
eliminated with pivots that are selected once, at the samples, so that the matrix is an arithmetic
expression of the pose.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi
import numpy as np
from casadi import DM, SX
from numpy.typing import NDArray

from mbs.closed_forms.displacement_matrices import SIZE, SLOPES, Array
from mbs.closed_forms.raghavan_roth.numbers import (
    REGULAR,
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

# Symbolic elimination of joints 1 and 2 of a loop, with pivots that are selected once.
#
# Source: Raghavan & Roth 1993; Manocha & Canny 1994.


_ZERO = 1e-12
"""Largest entry, for entries of about one in units of the loop, that counts as zero at all samples:
a zero has rounding of 1e-14, and other entries are larger at one of the generic samples."""


def table(elimination: Elimination, transforms: Sequence[Pose]) -> SX:
    """Return the equations of a loop (s - 1, m + n3 n4 n5), one column per monomial.

    Args:
        elimination: elimination of joints 1 and 2. Their m = n1 n2 - 1 monomials are the first
            columns. Then follow the columns of x4^i x5^j for each part of joint 3.
        transforms: six constant transforms of the loop.
    """
    right, left = _right_side(elimination, transforms), _left_side(elimination, transforms)
    sides = (
        part - casadi.mtimes(right[:, 0], SX(DM(one)).T)
        for part, one in zip(left, elimination.one, strict=True)
    )
    return SX(casadi.horzcat(right[:, 1:], *sides)[1:, :])


def eliminated(A: SX, values: Array, columns: int, rank: int) -> tuple[SX, Array]:
    """Return the rows of equations that remain after Gaussian elimination of the first columns.

    Args:
        A: (rows, all columns) expressions.
        values: (samples, rows, all columns) values of A at generic configurations.
        columns: number of columns to be eliminated.
        rank: rank of these columns.

    Returns:
        (rows - rank, other columns) expressions, and their values.
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
            rows[k] = _without_vanishing(rows[k] - rows[k][c] / pivot[c] * pivot, values[:, k])
    return SX(casadi.vertcat(*rows)[:, columns:]), values[:, :, columns:]


def independent_rows(values: Array, count: int) -> list[int]:
    """Return ascending indices of rows that are independent at all samples.

    Args:
        values: (samples, rows, n) numeric matrices.
        count: number of rows to select.
    """
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
    """Return equations of one part of joint 3, and their products by x4 or x5, (2 k, size).

    Args:
        elimination: elimination of joints 1 and 2.
        E: (k, n4 n5) equations.
    """
    g5, raised = elimination.grid[1], elimination.raised
    n4, n5 = len(elimination.fourth), len(elimination.fifth)
    M = SX(2 * E.size1(), elimination.size)
    for i in range(n4):
        for j in range(n5):
            M[: E.size1(), i * g5 + j] = E[:, i * n5 + j]
            M[E.size1() :, (i + 1 - raised) * g5 + j + raised] = E[:, i * n5 + j]
    return M


def _pivot(values: Array) -> tuple[int, int]:
    """Return (row, column) of the entry whose minimum magnitude over the samples is largest.

    `values` are the matrices (samples, rows, columns).
    """
    smallest = np.min(np.abs(values), axis=0)
    r, c = np.unravel_index(first_best(smallest.ravel()), smallest.shape)
    return int(r), int(c)


def _without_vanishing(row: SX, values: Array) -> SX:
    """Return the row (1, n) with zeros for the entries whose values vanish at all samples."""
    cleared = SX(1, row.size2())
    for k in np.nonzero(np.any(np.abs(values) > _ZERO, axis=0))[0]:
        cleared[0, int(k)] = row[0, int(k)]
    return cleared


def _right_side(elimination: Elimination, transforms: Sequence[Pose]) -> SX:
    """Return the side of the loop equation with joints 1 and 2, (s, n1 n2), by their monomials.

    `transforms` are the six transforms of the loop; transform k follows joint k.
    """
    u = _origin_axis_products(transforms[5].inverse())[elimination.elements.tolist()]
    once = _carry(elimination, transforms[0].inverse(), _products_with_parts(elimination.first, u))
    return _carry(
        elimination, transforms[1].inverse(), _products_with_parts(elimination.second, once)
    )


def _left_side(elimination: Elimination, transforms: Sequence[Pose]) -> list[SX]:
    """Return the side of the loop equation with joints 3, 4 and 5, for each part of joint 3.

    `transforms` are the six transforms of the loop. The columns are the monomials of joints 4
    and 5.
    """
    w = _origin_axis_products(transforms[4])[elimination.elements.tolist()]
    once = _carry(elimination, transforms[3], _products_with_parts(elimination.fifth, w))
    twice = _carry(elimination, transforms[2], _products_with_parts(elimination.fourth, once))
    return [_products_with_parts(part[None], twice) for part in elimination.third]


def _products_with_parts(parts: Array, columns: SX) -> SX:
    """Return the products part @ columns of all `parts` (k, s, s), side by side (s, k columns)."""
    return SX(casadi.horzcat(*(casadi.mtimes(_constant(part), columns) for part in parts)))


def _carry(elimination: Elimination, T: Pose, columns: SX) -> SX:
    """Return `columns` (s, n) of w after the transform T, for the s used elements of w.

    w are the 15 products of `frame_products`.
    """
    own = elimination.elements.tolist()
    X = SX(SIZE, SIZE)
    for t, slope in zip(casadi.vertsplit(T.p), SLOPES, strict=True):
        X += t * _constant(slope)
    turned = casadi.diagcat(SX.eye(3), T.R, T.R, T.R, T.R)
    rho = casadi.mtimes(SX.eye(SIZE) + X + 0.5 * casadi.mtimes(X, X), turned)
    return SX(casadi.mtimes(casadi.sparsify(rho[own, own]), columns))


def _origin_axis_products(T: Pose) -> SX:
    """Return w (15, 1): 1 and the products of origin p and z axis of a pose."""
    p, z = T.p, T.R[:, 2]
    pp, pz = casadi.dot(p, p), casadi.dot(p, z)
    return SX(casadi.vertcat(1, pp, pz, p, z, casadi.cross(p, z), pp * z - 2 * pz * p))


def _constant(part: NDArray[np.float64]) -> SX:
    """Return a numeric matrix `part` as a sparse expression of the same shape."""
    return SX(casadi.sparsify(DM(part)))


_ANGLES = (0.3, 1.4, -2.1)  # generic angles of joint 3 [rad]
_FOLDED, _TRIED = 10.0, 3


@dataclass(frozen=True, slots=True, eq=False)
class Characteristic:
    """Square matrix in the position of one joint that is singular if the loop closes.

    It is M_0 + M_1 cos q + M_2 sin q for a revolute joint, and M_0 + M_1 r + M_2 r^2, or without
    the last term, for a prismatic joint.

    Attributes:
        matrices: parts M_k, (n, n) expressions of the problem's given quantities.
        joint: name of the joint.
        index: index of the joint in the problem's x.
        prismatic: whether the joint is prismatic.
        regularity: reciprocal condition number of the matrix at positions that are no solutions.
    """

    matrices: tuple[SX, ...]
    joint: str
    index: int
    prismatic: bool
    regularity: float

    def matrix(self, q: SX) -> SX:
        """Return the matrix (n, n) at a position of the joint [rad or m].

        Args:
            q: position of the joint.
        """
        first, *others = self.matrices
        factors = (q, q * q) if self.prismatic else (casadi.cos(q), casadi.sin(q))
        parts = [SX(f * part) for f, part in zip(factors, others, strict=False)]
        return SX(sum(parts, first))


@dataclass(frozen=True, slots=True, eq=False)
class _Loop:
    """Start and direction of a loop, the construction of its matrix, and its unit of length."""

    ring: Ring
    pencil: Pencil
    length: float

    @property
    def merit(self) -> float:
        """Merit of the matrix; larger if no eliminated transform contains the pose."""
        constant = all(self.ring.gaps[k].pose.matrix.is_constant() for k in (0, 1, 2))
        return self.pencil.merit * (_FOLDED if constant else 1.0)

    @property
    def transforms(self) -> list[Pose]:
        """Transforms in units of the length: transform k follows joint k."""
        gaps = (*self.ring.gaps[1:], self.ring.gaps[0])
        return [Pose(gap.pose.R, gap.pose.p / self.length) for gap in gaps]


def characteristic(problem: Problem) -> Characteristic:
    """Return the characteristic matrix of a closed loop of six joints.

    Loops begin at any of the six joints and run in either direction. The loop is chosen whose
    matrix is farthest from singular.

    Source: Raghavan & Roth 1993; Manocha & Canny 1994.

    Args:
        problem: problem of six joints.

    Raises:
        NoClosedForm: the problem does not have six joints, or the matrix is singular at all
            positions.
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
    """Return all loops and eliminations whose matrix is not singular at the samples."""
    length, found = _length(problem), list[_Loop]()
    for ring in (problem.ring, problem.ring.reversed()):
        for first in range(6):
            own = ring.rotated(first)
            prismatic = np.array([not joint.is_rotational for joint in own.joints])
            if prismatic[5]:
                continue
            transforms = _numeric_transforms(problem, own, length)
            pencils = (pencil(elimination, transforms) for elimination in eliminations(prismatic))
            found += [_Loop(own, one, length) for one in pencils if one.regularity > REGULAR]
    return found


def _length(problem: Problem) -> float:
    """Return a power of two of about the size of the loop at the samples [m]."""
    indices = casadi.horzcat(*(gap.pose.p for gap in problem.ring.gaps))
    total = [float(np.sum(np.linalg.norm(p, axis=0))) for p in problem.at_samples(SX(indices))]
    mean = float(np.mean(total))
    return float(2.0 ** round(np.log2(mean))) if mean > 0 else 1.0


def _numeric_transforms(problem: Problem, ring: Ring, length: float) -> Array:
    """Return the transforms (samples, 6, 4, 4) of a loop at the samples, in units of `length`."""
    gaps = (*ring.gaps[1:], ring.gaps[0])
    stacked = problem.at_samples(SX(casadi.vertcat(*(gap.pose.matrix for gap in gaps))))
    transforms = np.array(stacked).reshape(len(stacked), 6, 4, 4)
    transforms[..., :3, 3] /= length
    return transforms


def _characteristic(problem: Problem, loop: _Loop) -> Characteristic:
    """Return the matrix of a loop whose determinant vanishes at the positions of joint 3."""
    elimination, joint = loop.pencil.elimination, loop.ring.joints[2]
    A = table(elimination, loop.transforms)
    columns = len(elimination.first) * len(elimination.second) - 1
    E, values = eliminated(A, np.array(problem.at_samples(A)), columns, loop.pencil.rank)
    count = len(elimination.third)
    parts = [dialytic(elimination, part) for part in casadi.horzsplit(E, E.size2() // count)]
    numbers = elimination.dialytic(np.stack(np.split(values, count, axis=-1), axis=1))
    rows = independent_rows(_at_three_angles(numbers), elimination.size)
    return Characteristic(
        _in_joint_functions([part[rows, :] for part in parts], loop),
        joint.name,
        _unknown_index(joint),
        not joint.is_rotational,
        regularity(numbers[:, :, rows]),
    )


def _at_three_angles(parts: Array) -> Array:
    """Return the matrices of parts (samples, n3, n, n) at three angles for each sample."""
    count = len(_ANGLES)
    return at(np.repeat(parts, count, axis=0), np.tile(np.array(_ANGLES), len(parts)))


def _in_joint_functions(parts: list[SX], loop: _Loop) -> tuple[SX, ...]:
    """Return the parts as factors of 1, cos q, sin q, or of the powers of r in metres."""
    joint = loop.ring.joints[2]
    if joint.is_rotational:
        return parts[0], parts[1], joint.sign * parts[2]
    if len(parts) == 3:
        parts = [parts[0] + parts[1], 2 * parts[2], parts[0] - parts[1]]
    return tuple((joint.sign / loop.length) ** k * part for k, part in enumerate(parts))


def _unknown_index(joint: ChainJoint) -> int:
    """Return the index of a joint among the unknowns. Raise NoClosedForm if it has none."""
    if joint.index is None:
        raise NoClosedForm(f"joint {joint.name} has no place among the unknowns of the problem")
    return joint.index
