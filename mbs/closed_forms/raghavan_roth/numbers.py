"""Configurations for target poses by the general method."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mbs.closed_forms.arm import Arm, Field, inverse, motion
from mbs.errors import ModelError
from mbs.numbers import NONZERO

# A point and a direction as fifteen numbers that every rigid displacement maps linearly.
#
# w(p, l) = (1, p.p, p.l, p, l, p x l, p.p l - 2 (p.l) p). A displacement D takes p to R p + t and
# l to R l, and then w(D p, D l) = rho(D) w(p, l), with rho(D D') = rho(D) rho(D').
#
# Source: Raghavan & Roth 1993, the fourteen equations; here as a representation of the group.


Array = NDArray[np.float64]

SIZE = 15

#: Numbers of the elements without p.p and p.p l - 2 (p.l) p: a displacement r is in them without
# r^2.
LINEAR = np.array([0, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11])


def _skew(t: Array) -> Array:
    return np.array([[0, -t[2], t[1]], [t[2], 0, -t[0]], [-t[1], t[0], 0]])


def _slope(t: Array) -> Array:
    """(15, 15) derivative of rho along a translation t."""
    X = np.zeros((SIZE, SIZE))
    X[1, 3:6] = 2 * t
    X[2, 6:9] = t
    X[3:6, 0] = t
    X[9:12, 6:9] = _skew(t)
    X[12:15, 9:12] = -2 * _skew(t)
    X[12:15, 2] = -2 * t
    return X


def _turning() -> Array:
    """(3, 15, 15) the parts of rho of a rotation about z with 1, its cosine and its sine."""
    Z = np.zeros((3, SIZE, SIZE))
    Z[0, range(3), range(3)] = 1.0
    for k in (3, 6, 9, 12):
        Z[0, k + 2, k + 2] = Z[1, k, k] = Z[1, k + 1, k + 1] = Z[2, k + 1, k] = 1.0
        Z[2, k, k + 1] = -1.0
    return Z


#: (3, 15, 15) slopes X of rho along x, y, z; along a translation rho is 1 + X + X X / 2.
SLOPES = np.array([_slope(axis) for axis in np.eye(3)])
#: (3, 15, 15) parts of rho of a turn q about z, with 1, cos q, sin q.
TURN = _turning()
#: (3, 15, 15) parts of rho of a displacement r along z, with 1, r, r^2.
SLIDE = np.array([np.eye(SIZE), SLOPES[2], 0.5 * SLOPES[2] @ SLOPES[2]])

#: (6,) elements that a rotation about z leaves alone, and (6,) those that a prismatic joint along z
# leaves alone.
KEPT_BY_TURN = np.array([1, 2, 5, 8, 11, 14])
KEPT_BY_SLIDE = np.array([3, 4, 6, 7, 8, 11])


def pair(T: Field) -> Field:
    """(..., 15) w of the origin and the z axis of the frames T, (..., 4, 4)."""
    p, z = T[..., :3, 3], T[..., :3, 2]
    pp, pz = np.sum(p * p, axis=-1)[..., None], np.sum(p * z, axis=-1)[..., None]
    bent = pp * z - 2 * pz * p
    return np.concatenate([np.ones_like(pp), pp, pz, p, z, np.cross(p, z), bent], axis=-1)


def rho(T: Array) -> Array:
    """(..., 15, 15) the linear map of w for displacements T, (..., 4, 4)."""
    X = np.tensordot(T[..., :3, 3], SLOPES, axes=1)
    turned = np.zeros((*T.shape[:-2], SIZE, SIZE), T.dtype)
    turned[..., range(3), range(3)] = 1.0
    for k in (3, 6, 9, 12):
        turned[..., k : k + 3, k : k + 3] = T[..., :3, :3]
    moved: Array = (np.eye(SIZE) + X + 0.5 * X @ X) @ turned
    return moved


def motion_parts(prismatic: bool) -> Array:
    """(3, 15, 15) parts of rho of a joint, with 1, cos q, sin q or with 1, r, r^2."""
    return SLIDE if prismatic else TURN


def back_parts(prismatic: bool) -> Array:
    """(3, 15, 15) likewise, of the inverse of the joint's motion."""
    signs = np.array([1.0, -1.0, 1.0] if prismatic else [1.0, 1.0, -1.0])
    back: Array = signs[:, None, None] * motion_parts(prismatic)
    return back


def half_parts(prismatic: bool) -> Array:
    """(3, 15, 15) parts with 1, x, x^2 of rho of a joint: x = tan(q/2), times 1 + x^2, or x = r."""
    if prismatic:
        return SLIDE
    return np.array([TURN[0] + TURN[1], 2 * TURN[2], TURN[0] - TURN[1]])


# The equations of a loop in three of its joints, and the matrix that is singular at a solution.
#
# rho(Z_3) rho(C_3) rho(Z_4) rho(C_4) rho(Z_5) w(C_5)
#     = rho(C_2^-1) rho(Z_2^-1) rho(C_1^-1) rho(Z_1^-1) w(C_6^-1)
# is fifteen equations, of which the first is 1 = 1; joint 6 is not in them, for it rotates about
# the direction of the pair. The right side is a (14, 8) block times eight monomials of joints 1 and
# 2, and a constant; the left null vectors of the block leave equations in joints 3, 4 and 5. With
# the half angles x4, x5 they have the nine monomials x4^i x5^j, i, j <= 2; with their products by
# x4, or
# by x5, there are twelve equations in twelve monomials. Slides have r^2 in four of the equations
# only, so that without these the monomials are fewer.
#
# Source: Raghavan & Roth 1993; Manocha & Canny 1994.


Joints = NDArray[np.bool_]
Numbers = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class Elimination:
    """The equations that are used of a loop, and their monomials; s elements of a pair are in them.

    Attributes:
        elements: (s,) their numbers in w.
        first: (n1, s, s) parts of rho of the inverse of joint 1, with 1, cos q, sin q or 1, r, r^2.
        second: (n2, s, s) of the inverse of joint 2.
        third: (n3, s, s) of joint 3, with the `weights` of its angle u.
        fourth: (n4, s, s) of joint 4, with 1, x4, x4^2.
        fifth: (n5, s, s) of joint 5, with 1, x5, x5^2.
        one: (n3, n4 n5) what stands for 1 in the terms of the left side.
        raised: 0 where the equations are multiplied by x4, 1 for x5.
        slides: whether joint 3 slides.
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
        """Numbers of powers of x4 and of x5 in the twelve monomials, or in fewer."""
        n4, n5 = len(self.fourth), len(self.fifth)
        return (n4, n5 + 1) if self.raised else (n4 + 1, n5)

    @property
    def size(self) -> int:
        """The size of the matrix."""
        return self.grid[0] * self.grid[1]

    def right_side(self, ways: Array) -> Array:
        """(N, s - 1, n1 n2) factors of the monomials of joints 1 and 2, of which the first is 1.

        Args:
            ways: (N, 6, 4, 4) of the loop.
        """
        u = pair(inverse(ways[:, 5]))[:, self.elements]
        once = self._carry(inverse(ways[:, 0]), np.einsum("jab,nb->naj", self.first, u))
        twice = np.einsum("iab,nbj->naij", self.second, once)
        return self._carry(inverse(ways[:, 1]), twice.reshape(*u.shape, -1))[:, 1:]

    def left_side(self, ways: Array) -> Array:
        """(N, n3, s - 1, n4 n5) factors of the monomials x4^i x5^j, for each weight of joint 3."""
        w = pair(ways[:, 4])[:, self.elements]
        once = self._carry(ways[:, 3], np.einsum("jab,nb->naj", self.fifth, w))
        twice = np.einsum("iab,nbj->naij", self.fourth, once)
        twice = self._carry(ways[:, 2], twice.reshape(*w.shape, -1))
        left: Array = np.einsum("kab,nbm->nkam", self.third, twice)[:, :, 1:]
        return left

    def equations(self, rows: Array, right: Array, left: Array) -> Array:
        """(N, n3, k, n4 n5) the equations in joints 3, 4 and 5 of null rows (N, k, s - 1)."""
        constant = rows @ right[:, :, :1]
        return rows[:, None] @ left - constant[:, None] * self.one[:, None, :]

    def dialytic(self, E: Array) -> Array:
        """(N, n3, 2 k, size) the equations, and below them their products by x4 or x5."""
        count = E.shape[2]
        M = np.zeros((*E.shape[:2], 2 * count, *self.grid))
        E = E.reshape(*E.shape[:3], len(self.fourth), len(self.fifth))
        n4, n5, raised = len(self.fourth), len(self.fifth), self.raised
        M[:, :, :count, :n4, :n5] = E
        M[:, :, count:, 1 - raised : n4 + 1 - raised, raised : n5 + raised] = E
        return M.reshape(*M.shape[:3], -1)

    def _carry(self, T: Array, columns: Array) -> Array:
        moved: Array = rho(T)[:, self.elements[:, None], self.elements] @ columns
        return moved


def weights(u: Array, count: int) -> Array:
    """(N, count) of joint 3 at angles u: 1, cos u, sin u, or cos(u/2), sin(u/2) where count is 2.

    A turn is at u, a prismatic joint at r = tan(u/2).
    """
    if count == 2:
        return np.stack([np.cos(u / 2), np.sin(u / 2)], axis=-1)
    return np.stack([np.ones_like(u), np.cos(u), np.sin(u)], axis=-1)


def at(M: Array, u: Array) -> Array:
    """(N, n, n) the matrix at angles u, (N,), from its parts (N, n3, n, n)."""
    value: Array = np.einsum("nk,nkab->nab", weights(u, M.shape[1]), M)
    return value


def null_rows(right: Array, rank: int) -> Array:
    """(N, s - 1 - rank, s - 1) orthonormal rows that the monomials of joints 1 and 2 vanish on."""
    U = np.linalg.svd(right[:, :, 1:])[0]
    return np.swapaxes(U[:, :, rank:], -1, -2)


def eliminations(prismatic: Joints) -> list[Elimination]:
    """The choices there are: the monomial that multiplies, and where joints slide the equations."""
    chosen = [np.arange(SIZE)] + ([LINEAR] if np.any(prismatic) else [])
    return [_elimination(prismatic, elements, k) for elements in chosen for k in (0, 1)]


def _elimination(prismatic: Joints, elements: NDArray[np.int64], raised: int) -> Elimination:
    slides = [bool(joint) for joint in prismatic]
    highest = 3 if len(elements) == SIZE else 2
    counts = [highest if slide else 3 for slide in slides]
    first, second = (back_parts(slides[k])[: counts[k]] for k in (0, 1))
    fourth, fifth = (half_parts(slides[k])[: counts[k]] for k in (3, 4))
    third, unit = _third(slides[2], counts[2])
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


def _third(slides: bool, count: int) -> tuple[Array, Array]:
    """The parts of joint 3 that go with its `weights`, and what stands for 1."""
    parts = motion_parts(slides)[:count]
    if not slides:
        return parts, np.array([1.0, 0.0, 0.0])
    if count == 2:
        return parts, np.array([1.0, 0.0])
    low, middle, high = 0.5 * parts
    return np.array([low + high, low - high, middle]), np.array([0.5, 0.5, 0.0])


# Joints 4 and 5 from the null space of the matrix at an angle of joint 3.
#
# A null vector holds the monomials x4^i x5^j, i <= 3, j <= 2, or likewise. Where m solutions
# share the angle, the null space is spanned by m such vectors, and the shifts from x^i to x^(i+1)
# are m x m matrices with a common basis of eigenvectors.
#
# Source: Manocha & Canny 1994; Cao, Coutsias & Pollock 2023 for several solutions at one root.


_MIX = 0.6180339887  # of X5 with X4, so that eigenvalues of the sum differ


def middle_joints(M: Array, grid: tuple[int, int], count: int) -> tuple[Array, Array]:
    """The half angles x4 and x5, (N, count) each, of as many solutions as share the angle.

    Args:
        M: (N, n, n) matrices at the angles of joint 3, real or complex.
        grid: numbers of powers of x4 and of x5, of which the n monomials are the products.
        count: of solutions, the dimension of the null space.
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
    """(n, m, m) the least-squares solution X of high = low X."""
    count = low.shape[-1]
    low, high = (part.reshape(len(low), -1, count) for part in (low, high))
    # a direction in which no vector goes but by rounding, some 1e-15, gives no shift
    return np.linalg.pinv(low, rcond=1e-13) @ high


def _rayleigh(vectors: Array, X: Array) -> Array:
    """(n, m) eigenvalues of X of the vectors in the columns; the real part where X is real."""
    size = np.sum(np.abs(vectors) ** 2, axis=1)
    values: Array = np.sum(np.conj(vectors) * (X @ vectors), axis=1) / size
    return np.real(values) if np.isrealobj(X) else values


# A loop of six joints, begun at any of them and walked either way.
#
# The target pose T closes the arm to the loop Z_1 C_1 Z_2 C_2 .. Z_6 C_6 = 1: Z_k is the motion
# of joint k, C_k the path to the next joint, and the pose is in one of the ways.


_TINY_LENGTH = 1e-9  # part of an arm's length that is rounding of lengths between its joints


@dataclass(frozen=True, slots=True, eq=False)
class Arrangement:
    """The loop of an arm as the elimination takes it, lengths in units of its own.

    Attributes:
        order: (6,) numbers of the arm's joints in the order of the loop.
        sign: +1 or -1, of the arm's joint order[k] by the loop's joint k.
        prismatic: (6,) whether each joint of the loop slides.
        offsets: (6,) angles from which the loop's joints are counted [rad]; zero for slides.
        ways: (6, 4, 4) constant ways; the one at `index` ends where the pose begins.
        index: number of the way with the pose.
        after: (4, 4) what comes after the pose in its way.
        length: the unit [m].
    """

    order: NDArray[np.int64]
    sign: int
    prismatic: NDArray[np.bool_]
    offsets: Array
    ways: Array
    index: int
    after: Array
    length: float

    def all_ways(self, T: Array) -> Array:
        """(N, 6, 4, 4) the ways for target poses T, (N, 4, 4) [m]."""
        T = _scale(T, self.length)
        ways = np.broadcast_to(self.ways, (len(T), 6, 4, 4)).copy()
        ways[:, self.index] = ways[:, self.index] @ self._pose(T) @ self.after
        return ways

    def _pose(self, T: Array) -> Array:
        return inverse(T) if self.sign > 0 else T

    def configurations(self, u: Array) -> Array:
        """(..., 6) configurations of the arm, angles in [-pi, pi), for the loop's joints at u."""
        u = self.sign * (u + self.offsets)
        wrapped = (u + np.pi) % (2 * np.pi) - np.pi
        q = np.empty_like(u)
        q[..., self.order] = np.where(self.prismatic, u * self.length, wrapped)
        return q


def arrangements(arm: Arm, offsets: Array) -> list[Arrangement]:
    """All loops of an arm whose last joint turns: up to twelve.

    Args:
        arm: of six joints.
        offsets: (6,) angles from which the joints of the loop are counted [rad].
    """
    length = loop_length(arm)
    G = _scale(arm.gaps, length)
    back = inverse(G)
    ways = {1: np.array([*G[1:6], G[6]]), -1: np.array([*back[5:0:-1], back[0]])}
    after = {1: G[0], -1: back[6]}
    found = []
    for sign in (1, -1):
        for first in range(6):
            order = np.roll(np.arange(6)[::sign], -first)
            prismatic = arm.prismatic[order]
            if prismatic[5]:
                continue
            own = np.where(prismatic, 0.0, offsets)
            C = motion(own, prismatic=False) @ np.roll(ways[sign], -first, axis=0)
            found.append(
                Arrangement(order, sign, prismatic, own, C, 5 - first, after[sign], length)
            )
    return found


def loop_length(arm: Arm) -> float:
    """A length of the size of an arm [m], wherever its base stands and whatever its tool is."""
    inner = float(np.sum(np.linalg.norm(arm.gaps[1:6, :3, 3], axis=1)))
    return inner if inner > _TINY_LENGTH * arm.length else arm.length


def _scale(T: Array, length: float) -> Array:
    T = np.array(T, dtype=float)
    T[..., :3, 3] /= length
    return T


# The matrix of a loop in joint 3 alone, and how far it is from being singular everywhere.


_SEED = 20260212
_ANGLES = np.array([0.4137, 2.2691, -1.5283])  # of joint 3 [rad], at which nothing is special
_RANK = 1e-9  # singular values below it, relatively, are rounding
_SLIDING, _SPARE = 0.01, 100.0  # merit of a joint 3 that slides; the most of further equations
_SMALL = 0.1  # a matrix without larger entries is rounding


@dataclass(frozen=True, slots=True, eq=False)
class Pencil:
    """What makes the matrix from the ways of a loop.

    Attributes:
        elimination: of joints 1 and 2.
        rank: of what these joints are in, eight or less, at any pose.
        mix: (n, 2 k) orthonormal rows that make n equations of the 2 k that are left.
        regularity: reciprocal condition of the matrix at angles that are no solutions, in [0, 1].
    """

    elimination: Elimination
    rank: int
    mix: Array
    regularity: float

    @property
    def merit(self) -> float:
        """The regularity, and more where equations are left over.

        The matrix then keeps its rank near configurations where joints 4 and 6 of the loop align.
        It is less where joint 3 slides, whose roots at infinity are near real ones.
        """
        size, rows = self.mix.shape
        spare = min(float(rows / size) ** 12, _SPARE)
        return self.regularity * spare * (_SLIDING if self.elimination.slides else 1.0)

    def matrices(self, ways: Array) -> Array:
        """(N, n3, n, n) parts of the matrix that is singular at the solutions.

        Args:
            ways: (N, 6, 4, 4) of the loop.
        """
        right, left = self.elimination.right_side(ways), self.elimination.left_side(ways)
        E = self.elimination.equations(null_rows(right, self.rank), right, left)
        M: Array = self.mix @ self.elimination.dialytic(E)
        return M


def pencil(elimination: Elimination, ways: Array) -> Pencil:
    """The matrix of an elimination, examined at some poses.

    Args:
        elimination: of joints 1 and 2.
        ways: (N, 6, 4, 4) of the loop at generic poses that it reaches.
    """
    s = np.linalg.svd(elimination.right_side(ways)[:, :, 1:], compute_uv=False)
    rank = int(np.max(np.sum(s > _RANK * s[:, :1], axis=1)))
    rows, size = 2 * (len(elimination.elements) - 1 - rank), elimination.size
    if rows < size:
        return Pencil(elimination, rank, np.zeros((size, rows)), 0.0)
    found = Pencil(elimination, rank, _mix(size, rows), 0.0)
    return replace(found, regularity=regularity(found.matrices(ways)))


def regularity(M: Array) -> float:
    """Reciprocal condition at angles that are no solutions, of the worst of matrices.

    Entries are of the size of one; those that are but rounding count as nothing.

    Args:
        M: (N, n3, n, n) their parts.
    """
    count = len(_ANGLES)
    values = at(np.repeat(M, count, axis=0), np.tile(_ANGLES, len(M)))
    s = np.linalg.svd(values, compute_uv=False)
    conditions = (s[:, -1] / np.maximum(s[:, 0], _SMALL)).reshape(len(M), count)
    return float(np.min(np.median(conditions, axis=1)))


def _mix(size: int, rows: int) -> Array:
    """(size, rows) orthonormal rows, the identity where there are as many."""
    if rows == size:
        return np.eye(size)
    columns = np.random.default_rng(_SEED).standard_normal((rows, size))
    return np.linalg.qr(columns)[0].T


# What the method needs to know of an arm: its best arrangement, chosen once.


_PREPARE_SEED, _POSES = 20260211, 2
# angles of joints 4 and 5 [rad] that no design prefers, so that none has an infinite half angle
_TRIAL_OFFSETS = np.array([0.0, 0.0, 0.0, 0.7345, -1.1127, 0.0])
_OTHERS, _WELL = 3, 1e-4
"""Most other arrangements of an arm, and the least regularity of one."""
_LEAST = 1e-5
"""Regularity at a pose below which another arrangement is tried: rounding leaves 1e-11 of the
angles there."""
REGULAR = 1e-10
"""Regularity above which the method holds: of a matrix that is always singular rounding leaves
1e-15, and at it six digits of a root are left."""


@dataclass(frozen=True, slots=True, eq=False)
class Prepared:
    """An arm, and the arrangement of its loop in which the matrix is farthest from singular.

    Attributes:
        arrangement: of the loop.
        pencil: that makes the matrix.
        others: the same from other joints, in the order in which they are tried at poses at which
            the matrix is nearly singular at every angle.
    """

    arrangement: Arrangement
    pencil: Pencil
    others: tuple[Prepared, ...] = ()

    @property
    def regularity(self) -> float:
        """Reciprocal condition of the matrix at angles that are no solutions, in [0, 1]."""
        return self.pencil.regularity

    @property
    def regular(self) -> bool:
        """Whether the method holds for the arm; where not, use another one.

        It may hold for an arm that is redundant in one direction and short of another, such as one
        with four parallel axes: its configurations make families, of which candidates are samples.
        """
        return self.regularity > REGULAR


def prepare(arm: Arm) -> Prepared:
    """The best arrangement of an arm, by the condition of its matrix at poses that it reaches.

    Source: Raghavan & Roth 1993; the choice by condition is new here.

    Args:
        arm: of six joints.

    Raises:
        ModelError: the arm has not six joints, or none that is revolute.
    """
    if arm.size != 6 or bool(np.all(arm.prismatic)):
        raise ModelError(
            f"arm {' '.join(arm.names)}: the general inverse geometric model is for six joints of"
            " which one is revolute at least; use method='search'"
        )
    T = _reached(arm)
    tried = [
        Prepared(loop, pencil(elimination, loop.all_ways(T)))
        for loop in arrangements(arm, _TRIAL_OFFSETS)
        for elimination in eliminations(loop.prismatic)
    ]
    tried.sort(key=lambda prepared: -prepared.pencil.merit)
    others = list[Prepared]()
    for one in tried[1:]:  # joints 1 and 2 of the loop are eliminated
        pairs = [_eliminated(other) for other in (tried[0], *others)]
        if one.regularity > _WELL and _eliminated(one) not in pairs and len(others) < _OTHERS:
            others.append(one)
    return replace(tried[0], others=tuple(others))


def _eliminated(prepared: Prepared) -> frozenset[int]:
    """The joints of the arm that are eliminated first."""
    return frozenset(prepared.arrangement.order[:2].tolist())


def for_poses(prepared: Prepared, T: Array) -> list[tuple[Prepared, Numbers]]:
    """The arrangements whose matrices are regular at poses, and the numbers of these poses.

    Args:
        prepared: see `prepare`.
        T: (N, 4, 4) target poses [m].
    """
    best, most = np.zeros(len(T), dtype=np.int64), np.full(len(T), -1.0)
    every = (prepared, *prepared.others)
    for k, one in enumerate(every):
        left = np.flatnonzero(most <= _LEAST)
        if not len(left):
            break
        found = _regularities(one.pencil.matrices(one.arrangement.all_ways(T[left])))
        better = found > most[left]
        best[left[better]], most[left[better]] = k, found[better]
    return [(every[k], np.flatnonzero(best == k)) for k in np.unique(best)]


def _reached(arm: Arm) -> Array:
    """(2, 4, 4) poses of generic configurations."""
    rng = np.random.default_rng(_PREPARE_SEED)
    turns = rng.uniform(-np.pi, np.pi, (_POSES, 6))
    # slides of the arm's own size and never near zero, where axes might meet
    slides = loop_length(arm) * rng.uniform(0.2, 0.8, (_POSES, 6))
    return arm.pose(np.where(arm.prismatic, slides, turns))


# The angles of joint 3 where the matrix is singular: eigenvalues of a companion matrix.
#
# Source: Manocha & Canny 1994.


_OFFSETS = 0.2731 + np.arange(8) * np.pi / 4  # of joint 3 [rad], angles that no design prefers
_ROUNDING = 1e-16  # part of the largest singular value that divides in place of a smaller one


def complex_roots(M: Array) -> NDArray[np.complex128]:
    """(N, r) complex angles u where the matrices (N, n3, n, n) are singular.

    Among them are some of large imaginary part, which belong to no configuration.
    """
    offset, coefficients = _rotate(M / np.max(np.abs(M), axis=(1, 2, 3), keepdims=True))
    x = np.linalg.eigvals(_companion(coefficients)).astype(complex)
    top, bottom = 1 + 1j * x, 1 - 1j * x
    size = np.log(np.abs(top) + NONZERO) - np.log(np.abs(bottom) + NONZERO)
    # e^(i u) = e^(i offset) (1 + i x) / (1 - i x)
    u: NDArray[np.complex128] = offset[:, None] + np.angle(top * np.conj(bottom)) - 1j * size
    return u


def _companion(coefficients: Array) -> Array:
    """(N, d n, d n) matrices whose eigenvalues x make a polynomial of degree d in x singular."""
    count, degree, n = len(coefficients), coefficients.shape[1] - 1, coefficients.shape[-1]
    companion = np.zeros((count, degree * n, degree * n))
    companion[:, range((degree - 1) * n), range(n, degree * n)] = 1.0
    lower = np.concatenate([coefficients[:, k] for k in range(degree)], axis=-1)
    U, s, V = np.linalg.svd(coefficients[:, -1])
    s = np.maximum(s, _ROUNDING * s[:, :1] + NONZERO)
    companion[:, -n:] = -np.swapaxes(V, 1, 2) @ (np.swapaxes(U, 1, 2) / s[..., None] @ lower)
    return companion


def _far_regularities(M: Array) -> Array:
    """(N, 8) reciprocal conditions of matrices at x = infinity, for each offset."""
    far = np.einsum("ok,nkab->noab", weights(_OFFSETS + np.pi, M.shape[1]), M)
    values = np.linalg.svd(far, compute_uv=False)
    conditions: Array = values[..., -1] / np.maximum(values[..., 0], NONZERO)
    return conditions


def _regularities(M: Array) -> Array:
    """(N,) regularities of matrices (N, n3, n, n): nearly singular ones have none."""
    most: Array = np.max(_far_regularities(M), axis=1)
    return most


def _rotate(M: Array) -> tuple[Array, Array]:
    """Offsets (N,), and (N, d + 1, n, n) factors of 1, x, .. for u = offset + 2 atan x.

    Of eight offsets the one where the last factor, the matrix at x = infinity, is best conditioned.
    """
    offset = _OFFSETS[np.argmax(_far_regularities(M), axis=1)]
    if M.shape[1] == 2:
        c, s = (part[:, None, None] for part in (np.cos(offset / 2), np.sin(offset / 2)))
        return offset, np.stack([c * M[:, 0] + s * M[:, 1], c * M[:, 1] - s * M[:, 0]], axis=1)
    c, s = (part[:, None, None] for part in (np.cos(offset), np.sin(offset)))
    cosine, sine = c * M[:, 1] + s * M[:, 2], c * M[:, 2] - s * M[:, 1]
    return offset, np.stack([M[:, 0] + cosine, 2 * sine, M[:, 0] - cosine], axis=1)
