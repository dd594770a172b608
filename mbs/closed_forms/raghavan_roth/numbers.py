"""Numeric elimination for six-joint arms (Raghavan-Roth): loop, matrices, roots."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mbs.closed_forms.arm import Arm, inverse, motion
from mbs.closed_forms.displacement_matrices import (
    LINEAR,
    SIZE,
    Array,
    back_parts,
    frame_products,
    half_parts,
    motion_parts,
    rho,
)
from mbs.errors import ModelError
from mbs.numbers import NONZERO

# Equations of a loop in three of its joints, and the matrix that is singular at a solution.
#
# rho(Z_3) rho(C_3) rho(Z_4) rho(C_4) rho(Z_5) w(C_5)
#     = rho(C_2^-1) rho(Z_2^-1) rho(C_1^-1) rho(Z_1^-1) w(C_6^-1)
# are fifteen equations, the first of which is 1 = 1. Joint 6 does not appear, because it rotates
# about the direction of w. The right side is a (14, 8) matrix times eight monomials of joints 1 and
# 2, and a constant. The left null vectors of the matrix give equations in joints 3, 4 and 5. In the
# half angles x4, x5 they have the nine monomials x4^i x5^j, i, j <= 2. Together with their products
# by x4, or by x5, they are twelve equations in twelve monomials. Prismatic joints have r^2 in four
# of the equations only, so that without these there are fewer monomials.
#
# Source: Raghavan & Roth 1993; Manocha & Canny 1994.


Joints = NDArray[np.bool_]
Numbers = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class Elimination:
    """Selected equations of a loop, and their monomials; s elements of w are used.

    Attributes:
        elements: (s,) indices of the used elements of w.
        first: (n1, s, s) parts of rho of the inverse of joint 1, with 1, cos q, sin q or 1, r, r^2.
        second: (n2, s, s) parts of rho of the inverse of joint 2.
        third: (n3, s, s) parts of rho of joint 3, with the `weights` of its angle u.
        fourth: (n4, s, s) parts of rho of joint 4, with 1, x4, x4^2.
        fifth: (n5, s, s) parts of rho of joint 5, with 1, x5, x5^2.
        one: (n3, n4 n5) coefficients of the number 1 in the terms of the left side.
        raised: 0 if the equations are multiplied by x4, 1 for x5.
        slides: whether joint 3 is prismatic.
    """

    elements: NDArray[np.int64]
    first: Array
    second: Array
    third: Array
    fourth: Array
    fifth: Array
    one: Array
    raised: int
    slides: bool

    @property
    def grid(self) -> tuple[int, int]:
        """Numbers of powers of x4 and of x5 in the monomials (twelve at most)."""
        n4, n5 = len(self.fourth), len(self.fifth)
        return (n4, n5 + 1) if self.raised else (n4 + 1, n5)

    @property
    def size(self) -> int:
        """Size of the square matrix: number of monomials."""
        return self.grid[0] * self.grid[1]

    def right_side(self, transforms: Array) -> Array:
        """Return coefficients (N, s - 1, n1 n2) of the monomials of joints 1 and 2, 1 as the first.

        Args:
            transforms: (N, 6, 4, 4) constant transforms of the loop.
        """
        u = frame_products(inverse(transforms[:, 5]))[:, self.elements]
        once = self._carry(inverse(transforms[:, 0]), np.einsum("jab,nb->naj", self.first, u))
        twice = np.einsum("iab,nbj->naij", self.second, once)
        return self._carry(inverse(transforms[:, 1]), twice.reshape(*u.shape, -1))[:, 1:]

    def left_side(self, transforms: Array) -> Array:
        """Return coefficients (N, n3, s - 1, n4 n5) of x4^i x5^j, for each weight of joint 3.

        Args:
            transforms: (N, 6, 4, 4) constant transforms of the loop.
        """
        w = frame_products(transforms[:, 4])[:, self.elements]
        once = self._carry(transforms[:, 3], np.einsum("jab,nb->naj", self.fifth, w))
        twice = np.einsum("iab,nbj->naij", self.fourth, once)
        twice = self._carry(transforms[:, 2], twice.reshape(*w.shape, -1))
        left: Array = np.einsum("kab,nbm->nkam", self.third, twice)[:, :, 1:]
        return left

    def equations(self, rows: Array, right: Array, left: Array) -> Array:
        """Return the equations (N, n3, k, n4 n5) in joints 3, 4, 5, without joints 1 and 2.

        Args:
            rows: (N, k, s - 1) null rows of the factors of joints 1 and 2.
            right: result of `right_side`.
            left: result of `left_side`.
        """
        constant = rows @ right[:, :, :1]
        return rows[:, None] @ left - constant[:, None] * self.one[:, None, :]

    def dialytic(self, E: Array) -> Array:
        """Return the equations and their products by x4 or x5, (N, n3, 2 k, size).

        Args:
            E: (N, n3, k, n4 n5) equations.
        """
        count = E.shape[2]
        M = np.zeros((*E.shape[:2], 2 * count, *self.grid))
        E = E.reshape(*E.shape[:3], len(self.fourth), len(self.fifth))
        n4, n5, raised = len(self.fourth), len(self.fifth), self.raised
        M[:, :, :count, :n4, :n5] = E
        M[:, :, count:, 1 - raised : n4 + 1 - raised, raised : n5 + raised] = E
        return M.reshape(*M.shape[:3], -1)

    def _carry(self, T: Array, columns: Array) -> Array:
        """Return the used elements of columns of w after displacements T (N, 4, 4).

        w are the 15 products of `frame_products`; `columns` has them in its rows.
        """
        moved: Array = rho(T)[:, self.elements[:, None], self.elements] @ columns
        return moved


def weights(u: Array, count: int) -> Array:
    """Return the weights (N, count) of the parts of joint 3 at its angle.

    They are 1, cos u, sin u, or cos(u/2), sin(u/2) for count 2. A revolute joint is at u, a
    prismatic joint at r = tan(u/2).

    Args:
        u: (N,) angles [rad].
        count: number of parts, 2 or 3.
    """
    if count == 2:
        return np.stack([np.cos(u / 2), np.sin(u / 2)], axis=-1)
    return np.stack([np.ones_like(u), np.cos(u), np.sin(u)], axis=-1)


def at(M: Array, u: Array) -> Array:
    """Return the matrices (N, n, n) at angles of joint 3.

    Args:
        M: (N, n3, n, n) parts of the matrices.
        u: (N,) angles [rad].
    """
    value: Array = np.einsum("nk,nkab->nab", weights(u, M.shape[1]), M)
    return value


def null_rows(right: Array, rank: int) -> Array:
    """Return orthonormal rows (N, s - 1 - rank, s - 1) that cancel the monomials of joints 1 and 2.

    Args:
        right: result of `Elimination.right_side`.
        rank: rank of its columns after the first.
    """
    U = np.linalg.svd(right[:, :, 1:])[0]
    return np.swapaxes(U[:, :, rank:], -1, -2)


def eliminations(prismatic: Joints) -> list[Elimination]:
    """Return all eliminations: products by x4 or x5, and fewer equations with prismatic joints.

    Args:
        prismatic: (6,) whether each joint of the loop is prismatic.
    """
    chosen = [np.arange(SIZE)] + ([LINEAR] if np.any(prismatic) else [])
    return [_elimination(prismatic, elements, k) for elements in chosen for k in (0, 1)]


def _elimination(prismatic: Joints, elements: NDArray[np.int64], raised: int) -> Elimination:
    """Return the elimination with `elements` of w; `raised`: 0 for products by x4, 1 by x5.

    w are the 15 products of `frame_products`; x4 and x5 are half-angle tangents of joints 4 and 5.
    """
    slides = [bool(joint) for joint in prismatic]
    highest = 3 if len(elements) == SIZE else 2
    counts = [highest if slide else 3 for slide in slides]
    first, second = (back_parts(slides[k])[: counts[k]] for k in (0, 1))
    fourth, fifth = (half_parts(slides[k])[: counts[k]] for k in (3, 4))
    third, unit = _joint_3_parts(slides[2], counts[2])
    ends = (np.array([1.0, 0.0, 0.0 if slides[k] else 1.0])[: counts[k]] for k in (3, 4))
    one = np.einsum("k,i,j->kij", unit, *ends).reshape(len(unit), -1)
    own = (slice(None), elements[:, None], elements)
    return Elimination(
        elements,
        first[own],
        second[own],
        third[own],
        fourth[own],
        fifth[own],
        one,
        raised,
        slides[2],
    )


def _joint_3_parts(slides: bool, count: int) -> tuple[Array, Array]:
    """Return first `count` parts of joint 3 for its `weights`, and coefficients of the number 1.

    `slides` is whether joint 3 is prismatic.
    """
    parts = motion_parts(slides)[:count]
    if not slides:
        return parts, np.array([1.0, 0.0, 0.0])
    if count == 2:
        return parts, np.array([1.0, 0.0])
    low, middle, high = 0.5 * parts
    return np.array([low + high, low - high, middle]), np.array([0.5, 0.5, 0.0])


# Joints 4 and 5 from the null space of the matrix at an angle of joint 3.
#
# A null vector consists of monomials x4^i x5^j, such as i <= 3, j <= 2. If m solutions share the
# angle, m such vectors span the null space, and the shifts from x^i to x^(i+1) are m x m matrices
# with common eigenvectors.
#
# Source: Manocha & Canny 1994; Cao, Coutsias & Pollock 2023 for several solutions at one root.


_MIX = 0.6180339887  # weight of X5 in the sum with X4, such that the sum has different eigenvalues


def middle_joints(M: Array, grid: tuple[int, int], count: int) -> tuple[Array, Array]:
    """Return half angles x4 and x5 (N, count) of the solutions that share an angle of joint 3.

    Args:
        M: (N, n, n) real or complex matrices at the angles of joint 3.
        grid: numbers of powers of x4 and of x5. The n monomials are their products.
        count: number of solutions, the dimension of the null space.
    """
    V = np.linalg.svd(M)[2][:, M.shape[-1] - count :, :].conj()
    basis = np.swapaxes(V, -1, -2).reshape(len(M), *grid, count)
    X4 = _shift(basis[:, :-1], basis[:, 1:])
    X5 = _shift(basis[:, :, :-1], basis[:, :, 1:])
    if count == 1:
        return X4[:, :, 0], X5[:, :, 0]
    vectors = np.linalg.eig((X4 + _MIX * X5).astype(complex))[1]
    return _rayleigh(vectors, X4), _rayleigh(vectors, X5)


def _shift(low: Array, high: Array) -> Array:
    """Return the least-squares solutions X (N, m, m) of high = low X."""
    count = low.shape[-1]
    low, high = (part.reshape(len(low), -1, count) for part in (low, high))
    # directions with singular values of rounding, about 1e-15, give no shift
    return np.linalg.pinv(low, rcond=1e-13) @ high


def _rayleigh(vectors: Array, X: Array) -> Array:
    """Return Rayleigh quotients (N, m) of X (N, m, m) for vectors in columns; real if X is real."""
    size = np.sum(np.abs(vectors) ** 2, axis=1)
    values: Array = np.sum(np.conj(vectors) * (X @ vectors), axis=1) / size
    return np.real(values) if np.isrealobj(X) else values


# Loop of six joints, which can start at each joint and run in both directions.
#
# The target pose T closes the arm to the loop Z_1 C_1 Z_2 C_2 .. Z_6 C_6 = 1. Z_k is the motion of
# joint k. C_k is the constant transform to the next joint; one of them contains the pose.


_TINY_LENGTH = 1e-9  # relative size of lengths between the joints of an arm that are rounding


@dataclass(frozen=True, slots=True, eq=False)
class Arrangement:
    """Loop of an arm for the elimination, with lengths divided by the length of the loop.

    Attributes:
        order: (6,) indices of the arm's joints in the order of the loop.
        sign: +1, or -1 if the loop runs against the arm.
        prismatic: (6,) whether each joint of the loop is prismatic.
        offsets: (6,) angles at which the loop's joints are zero [rad]; 0 for prismatic joints.
        transforms: (6, 4, 4) constant transforms; that at `index` ends where the pose begins.
        index: index of the transform with the pose.
        after: (4, 4) transform after the pose in that transform.
        length: unit of lengths [m].
    """

    order: NDArray[np.int64]
    sign: int
    prismatic: NDArray[np.bool_]
    offsets: Array
    transforms: Array
    index: int
    after: Array
    length: float

    def transforms_for(self, T: Array) -> Array:
        """Return the transforms (N, 6, 4, 4) of the loop for target poses.

        Args:
            T: (N, 4, 4) target poses [m].
        """
        T = _scale(T, self.length)
        pose = inverse(T) if self.sign > 0 else T
        transforms = np.broadcast_to(self.transforms, (len(T), 6, 4, 4)).copy()
        transforms[:, self.index] = transforms[:, self.index] @ pose @ self.after
        return transforms

    def configurations(self, u: Array) -> Array:
        """Return arm configurations (..., 6) [rad or m], with angles in [-pi, pi).

        Args:
            u: (..., 6) positions of the joints of the loop.
        """
        u = self.sign * (u + self.offsets)
        wrapped = (u + np.pi) % (2 * np.pi) - np.pi
        q = np.empty_like(u)
        q[..., self.order] = np.where(self.prismatic, u * self.length, wrapped)
        return q


def arrangements(arm: Arm, offsets: Array) -> list[Arrangement]:
    """Return all loops of an arm whose last joint is revolute: up to twelve.

    Args:
        arm: arm of six joints.
        offsets: (6,) angles at which the joints of the loop are zero [rad].
    """
    length = loop_length(arm)
    G = _scale(arm.gaps, length)
    back = inverse(G)
    transforms = {1: np.array([*G[1:6], G[6]]), -1: np.array([*back[5:0:-1], back[0]])}
    after = {1: G[0], -1: back[6]}
    found = []
    for sign in (1, -1):
        for first in range(6):
            order = np.roll(np.arange(6)[::sign], -first)
            prismatic = arm.prismatic[order]
            if prismatic[5]:
                continue
            own = np.where(prismatic, 0.0, offsets)
            C = motion(own, prismatic=False) @ np.roll(transforms[sign], -first, axis=0)
            found.append(
                Arrangement(order, sign, prismatic, own, C, 5 - first, after[sign], length)
            )
    return found


def loop_length(arm: Arm) -> float:
    """Return a typical length of an arm [m] that does not depend on its base and tool.

    Args:
        arm: arm of six joints.
    """
    inner = float(np.sum(np.linalg.norm(arm.gaps[1:6, :3, 3], axis=1)))
    return inner if inner > _TINY_LENGTH * arm.length else arm.length


def _scale(T: Array, length: float) -> Array:
    """Return transforms (..., 4, 4) with their translations divided by a length."""
    T = np.array(T, dtype=float)
    T[..., :3, 3] /= length
    return T


# Matrix of a loop in joint 3 alone, and its distance from a matrix that is singular everywhere.


_SEED = 20260212
_ANGLES = np.array([0.4137, 2.2691, -1.5283])  # generic angles of joint 3 [rad]
_RANK = 1e-9  # relative singular value below which a value is rounding
_SLIDING, _SPARE = 0.01, 100.0  # merit factors: of a prismatic joint 3; largest of spare equations
_SMALL = 0.1  # largest singular value below which a matrix is rounding


@dataclass(frozen=True, slots=True, eq=False)
class Pencil:
    """Construction of the matrix from the constant transforms of a loop.

    Attributes:
        elimination: elimination of joints 1 and 2.
        rank: rank of the matrix of the monomials of joints 1 and 2, eight or less, at any pose.
        mix: (n, 2 k) orthonormal rows that combine the 2 k remaining equations to n equations.
        regularity: reciprocal condition number, in [0, 1], at angles that are no solutions.
    """

    elimination: Elimination
    rank: int
    mix: Array
    regularity: float

    @property
    def merit(self) -> float:
        """Regularity, multiplied by a factor for spare equations.

        With spare equations, the matrix keeps its rank near configurations in which joints 4 and 6
        of the loop align. A prismatic joint 3 has a small factor, because its roots at infinity are
        near real roots.
        """
        size, rows = self.mix.shape
        spare = min(float(rows / size) ** 12, _SPARE)
        return self.regularity * spare * (_SLIDING if self.elimination.slides else 1.0)

    def matrices(self, transforms: Array) -> Array:
        """Return parts (N, n3, n, n) of the matrix that is singular at the solutions.

        Args:
            transforms: (N, 6, 4, 4) constant transforms of the loop.
        """
        right = self.elimination.right_side(transforms)
        left = self.elimination.left_side(transforms)
        E = self.elimination.equations(null_rows(right, self.rank), right, left)
        M: Array = self.mix @ self.elimination.dialytic(E)
        return M


def pencil(elimination: Elimination, transforms: Array) -> Pencil:
    """Return the matrix construction of an elimination, with its rank and regularity.

    Args:
        elimination: elimination of joints 1 and 2.
        transforms: (N, 6, 4, 4) transforms of the loop at generic reachable poses.
    """
    s = np.linalg.svd(elimination.right_side(transforms)[:, :, 1:], compute_uv=False)
    rank = int(np.max(np.sum(s > _RANK * s[:, :1], axis=1)))
    rows, size = 2 * (len(elimination.elements) - 1 - rank), elimination.size
    if rows < size:
        return Pencil(elimination, rank, np.zeros((size, rows)), 0.0)
    found = Pencil(elimination, rank, _random_rows(size, rows), 0.0)
    return replace(found, regularity=regularity(found.matrices(transforms)))


def regularity(M: Array) -> float:
    """Return the smallest reciprocal condition number of matrices at angles that are no solutions.

    For each matrix it is the median over three angles. Entries are of size one; a matrix of smaller
    entries, which are rounding, counts as singular.

    Args:
        M: (N, n3, n, n) parts of the matrices.
    """
    count = len(_ANGLES)
    values = at(np.repeat(M, count, axis=0), np.tile(_ANGLES, len(M)))
    s = np.linalg.svd(values, compute_uv=False)
    conditions = (s[:, -1] / np.maximum(s[:, 0], _SMALL)).reshape(len(M), count)
    return float(np.min(np.median(conditions, axis=1)))


def _random_rows(size: int, rows: int) -> Array:
    """Return orthonormal rows (size, rows), random unless size and rows are equal."""
    if rows == size:
        return np.eye(size)
    columns = np.random.default_rng(_SEED).standard_normal((rows, size))
    return np.linalg.qr(columns)[0].T


# Preparation of an arm: its best loop, selected once.


_PREPARE_SEED, _POSES = 20260211, 2
# generic offsets of joints 4 and 5 [rad], so that no usual design has an infinite half angle
_TRIAL_OFFSETS = np.array([0.0, 0.0, 0.0, 0.7345, -1.1127, 0.0])
_OTHERS, _WELL = 3, 1e-4
"""Largest number of alternative loops of an arm, and their smallest regularity."""
_LEAST = 1e-5
"""Regularity at a pose below which an alternative loop is tried: angles are accurate to 1e-11 at
this value."""
REGULAR = 1e-10
"""Smallest regularity for which the method is valid: a matrix that is always singular has 1e-15
from rounding, and at 1e-10 roots have six digits."""


@dataclass(frozen=True, slots=True, eq=False)
class Prepared:
    """Arm with the loop whose matrix is farthest from singular.

    Attributes:
        arrangement: loop of the arm.
        pencil: construction of its matrix.
        others: alternative loops with other eliminated joints, in order of preference, for poses at
            which the matrix is nearly singular at all angles.
    """

    arrangement: Arrangement
    pencil: Pencil
    others: tuple[Prepared, ...] = ()

    @property
    def regularity(self) -> float:
        """Reciprocal condition number of the matrix at angles that are no solutions, in [0, 1]."""
        return self.pencil.regularity

    @property
    def regular(self) -> bool:
        """Whether the method is valid for the arm.

        It may be valid for an arm that is redundant in one direction and deficient in another, such
        as an arm with four parallel axes. Its configurations are self-motions, and the candidates
        are samples of them.
        """
        return self.regularity > REGULAR


def prepare(arm: Arm) -> Prepared:
    """Return the best loop of an arm, by the condition number of its matrix at reachable poses.

    Source: Raghavan & Roth 1993; the choice by condition is new here.

    Args:
        arm: arm of six joints.

    Raises:
        ModelError: the arm does not have six joints, or has no revolute joint.
    """
    if arm.size != 6 or bool(np.all(arm.prismatic)):
        raise ModelError(
            f"arm {' '.join(arm.names)}: the general inverse geometric model is for six joints of"
            " which one is revolute at least; use method='search'"
        )
    T = _generic_poses(arm)
    tried = [
        Prepared(loop, pencil(elimination, loop.transforms_for(T)))
        for loop in arrangements(arm, _TRIAL_OFFSETS)
        for elimination in eliminations(loop.prismatic)
    ]
    tried.sort(key=lambda prepared: -prepared.pencil.merit)
    others = list[Prepared]()
    for one in tried[1:]:  # loops that eliminate other joints
        pairs = [_eliminated(other) for other in (tried[0], *others)]
        if one.regularity > _WELL and _eliminated(one) not in pairs and len(others) < _OTHERS:
            others.append(one)
    return replace(tried[0], others=tuple(others))


def _eliminated(prepared: Prepared) -> frozenset[int]:
    """Return the indices of the two joints of the arm that are eliminated first."""
    return frozenset(prepared.arrangement.order[:2].tolist())


def for_poses(prepared: Prepared, T: Array) -> list[tuple[Prepared, Numbers]]:
    """Return, for each pose, the prepared loop whose matrix is regular there.

    Args:
        prepared: arm from `prepare`.
        T: (N, 4, 4) target poses [m].

    Returns:
        Pairs of a loop and the indices of its poses.
    """
    best, most = np.zeros(len(T), dtype=np.int64), np.full(len(T), -1.0)
    every = (prepared, *prepared.others)
    for k, one in enumerate(every):
        left = np.flatnonzero(most <= _LEAST)
        if not len(left):
            break
        found = _regularities(one.pencil.matrices(one.arrangement.transforms_for(T[left])))
        better = found > most[left]
        best[left[better]], most[left[better]] = k, found[better]
    return [(every[k], np.flatnonzero(best == k)) for k in np.unique(best)]


def _generic_poses(arm: Arm) -> Array:
    """Return poses (2, 4, 4) of generic configurations of an arm [m]."""
    rng = np.random.default_rng(_PREPARE_SEED)
    turns = rng.uniform(-np.pi, np.pi, (_POSES, 6))
    # displacements of the size of the arm and not near zero, where axes might intersect
    slides = loop_length(arm) * rng.uniform(0.2, 0.8, (_POSES, 6))
    return arm.pose(np.where(arm.prismatic, slides, turns))


# Angles of joint 3 at which the matrix is singular: eigenvalues of a companion matrix.
#
# Source: Manocha & Canny 1994.


_OFFSETS = 0.2731 + np.arange(8) * np.pi / 4  # offsets of joint 3 [rad], generic for usual designs
_ROUNDING = 1e-16  # lower limit of singular values that divide, relative to the largest


def complex_roots(M: Array) -> NDArray[np.complex128]:
    """Return complex angles u (N, r) [rad] at which matrices are singular.

    Some angles with a large imaginary part belong to no configuration.

    Args:
        M: (N, n3, n, n) parts of the matrices.
    """
    offset, coefficients = _rotated_polynomial(M / np.max(np.abs(M), axis=(1, 2, 3), keepdims=True))
    x = np.linalg.eigvals(_companion(coefficients)).astype(complex)
    top, bottom = 1 + 1j * x, 1 - 1j * x
    size = np.log(np.abs(top) + NONZERO) - np.log(np.abs(bottom) + NONZERO)
    # e^(i u) = e^(i offset) (1 + i x) / (1 - i x)
    u: NDArray[np.complex128] = offset[:, None] + np.angle(top * np.conj(bottom)) - 1j * size
    return u


def _companion(coefficients: Array) -> Array:
    """Return the companion matrices (N, d n, d n) of matrix polynomials of degree d.

    `coefficients` (N, d + 1, n, n) are in ascending order.
    """
    count, degree, n = len(coefficients), coefficients.shape[1] - 1, coefficients.shape[-1]
    companion = np.zeros((count, degree * n, degree * n))
    companion[:, range((degree - 1) * n), range(n, degree * n)] = 1.0
    lower = np.concatenate([coefficients[:, k] for k in range(degree)], axis=-1)
    U, s, V = np.linalg.svd(coefficients[:, -1])
    s = np.maximum(s, _ROUNDING * s[:, :1] + NONZERO)
    companion[:, -n:] = -np.swapaxes(V, 1, 2) @ (np.swapaxes(U, 1, 2) / s[..., None] @ lower)
    return companion


def _far_regularities(M: Array) -> Array:
    """Return reciprocal condition numbers (N, 8) of matrices at x = infinity, for each offset.

    M (N, n3, n, n) are the parts of the matrices.
    """
    far = np.einsum("ok,nkab->noab", weights(_OFFSETS + np.pi, M.shape[1]), M)
    values = np.linalg.svd(far, compute_uv=False)
    conditions: Array = values[..., -1] / np.maximum(values[..., 0], NONZERO)
    return conditions


def _regularities(M: Array) -> Array:
    """Return best reciprocal condition numbers (N,) over the offsets, for parts (N, n3, n, n).

    M are the parts of the matrix of joint 3.
    """
    most: Array = np.max(_far_regularities(M), axis=1)
    return most


def _rotated_polynomial(M: Array) -> tuple[Array, Array]:
    """Return offsets (N,) and coefficients (N, d + 1, n, n) of 1, x, .. for u = offset + 2 atan x.

    The offset is the one of eight at which the last coefficient, the matrix at x = infinity, is
    best conditioned.

    M are the parts (N, n3, n, n) of the matrix of joint 3.
    """
    offset = _OFFSETS[np.argmax(_far_regularities(M), axis=1)]
    if M.shape[1] == 2:
        c, s = (part[:, None, None] for part in (np.cos(offset / 2), np.sin(offset / 2)))
        return offset, np.stack([c * M[:, 0] + s * M[:, 1], c * M[:, 1] - s * M[:, 0]], axis=1)
    c, s = (part[:, None, None] for part in (np.cos(offset), np.sin(offset)))
    cosine, sine = c * M[:, 1] + s * M[:, 2], c * M[:, 2] - s * M[:, 1]
    return offset, np.stack([M[:, 0] + cosine, 2 * sine, M[:, 0] - cosine], axis=1)
