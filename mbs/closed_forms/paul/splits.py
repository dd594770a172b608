"""All splits of a loop into two sides, evaluated numerically at the samples.

A point and the axes of joint e, relative to the frame before or after joint i, are the same on both
paths around the loop. Each pair of frames therefore gives a set of equations, left = right, in
which each joint appears on one side only.

Source: Paul 1981, section 3.7; the invariants: Raghavan & Roth 1993, section 4.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import combinations, product

import casadi
import numpy as np
from casadi import SX, Function
from numpy.typing import NDArray

from mbs.closed_forms.arm import inverse, motion
from mbs.closed_forms.displacement_matrices import POWERS, SIZE, motion_parts, rho
from mbs.closed_forms.sequence import ZERO, Problem
from mbs.recursions.chain import Ring

# Known quantities of a search: joints, and sums of joint angles.


Matrix = NDArray[np.float64]
Members = tuple[tuple[int, int], ...]


@dataclass(frozen=True, slots=True)
class Variable:
    """Unknown of an equation: a prismatic displacement, an angle, or a signed sum of angles.

    Attributes:
        prismatic: whether it is the displacement of a prismatic joint.
        members: index of each joint in the loop chain, and its sign; the first sign is +1.
    """

    prismatic: bool
    members: Members

    @property
    def single(self) -> bool:
        """Whether the variable is that of a single joint."""
        return len(self.members) == 1


@dataclass(frozen=True, slots=True, eq=False)
class LoopSamples:
    """Numeric samples of a loop, with lengths divided by a typical length of the loop.

    Attributes:
        gaps: (samples, n, 4, 4) poses of the known transforms.
        q: (samples, n) positions of the joints, in the order of the loop chain.
    """

    gaps: Matrix
    q: Matrix


@dataclass(frozen=True, slots=True, eq=False)
class KnownFrames:
    """Known quantities at one stage of the search.

    Attributes:
        problem: problem of the loop, with the joints in the order of `ring`.
        ring: loop chain, with frame origins where neighbouring axes are nearest to each other.
        samples: numeric values of the loop chain.
        known: indices of the known joints in the loop chain.
        sums: known sums of angles, and their indices in x.
    """

    problem: Problem
    ring: Ring
    samples: LoopSamples
    known: frozenset[int] = frozenset()
    sums: tuple[tuple[Variable, int], ...] = ()

    @property
    def unknown(self) -> list[int]:
        """Indices of the unknown joints."""
        return [k for k in range(len(self.ring.joints)) if k not in self.known]

    def index(self, variable: Variable) -> int:
        """Return the index in x of a variable. A sum of angles gets the next free index."""
        if variable.single:
            index = self.ring.joints[variable.members[0][0]].index
            return -1 if index is None else index
        return self.problem.size + len(self.sums)

    def can_hold(self, variable: Variable) -> bool:
        """Whether a variable can become known: it is new, and x has a free index for a sum."""
        held = [known.members for known, _, _ in self.open_sums()]
        return variable.single or (
            variable.members not in held and self.index(variable) < self.problem.x.numel()
        )

    def name(self, variable: Variable) -> str:
        """Return the name of a variable: the name of its joint, or of the symbol of a sum."""
        if variable.single:
            return self.ring.joints[variable.members[0][0]].name
        return str(self.problem.x[self.index(variable)])

    def with_joint(self, variable: Variable) -> KnownFrames:
        """Return a copy in which the variable is known too."""
        if variable.single:
            return replace(self, known=self.known | {variable.members[0][0]})
        return replace(self, sums=(*self.sums, (variable, self.index(variable))))

    def open_sums(self) -> list[tuple[Variable, SX, Matrix]]:
        """Return the unknown part of each known sum: variable, expression, values at samples."""
        return [_unknown_part(self, *known) for known in self.sums]

    def position(self, k: int) -> SX:
        """Return the symbol of the position of joint k."""
        return SX(self.problem.x[self.index(Variable(False, ((k, 1),)))])


def _unknown_part(
    knowledge: KnownFrames, variable: Variable, index: int
) -> tuple[Variable, SX, Matrix]:
    """Return the unknown part of a known sum of angles: variable, expression, values at samples.

    `variable` is the sum and `index` its index in x.
    """
    value = SX(knowledge.problem.x[index])
    members = [member for member in variable.members if member[0] not in knowledge.known]
    for k, sign in variable.members:
        if k in knowledge.known:
            value -= sign * knowledge.position(k)
    if members and members[0][1] < 0:
        members, value = [(k, -sign) for k, sign in members], -value
    at_samples = np.zeros(len(knowledge.samples.q))
    for k, sign in members:
        at_samples = at_samples + sign * knowledge.samples.q[:, k]
    return Variable(False, tuple(members)), value, at_samples


def nothing_known(problem: Problem, ring: Ring) -> KnownFrames:
    """Return the known quantities at the start of a search: none.

    Args:
        problem: loop and samples.
        ring: loop chain with the same joints and chosen frame origins.
    """
    return KnownFrames(problem, ring, _samples(problem, ring))


def _samples(problem: Problem, ring: Ring) -> LoopSamples:
    """Return transforms and positions of the loop chain at the samples of the problem.

    Lengths are divided by the mean length of the transforms.
    """
    stacked = casadi.vertcat(*(gap.pose.matrix for gap in ring.gaps))
    function = Function("gaps", [problem.given], [casadi.densify(stacked)])
    n, indices = len(ring.joints), [joint.index or 0 for joint in ring.joints]
    gaps = np.array([np.array(function(given)).reshape(n, 4, 4) for _, given in problem.samples])
    q = np.array([x[indices] for x, _ in problem.samples])
    length = float(np.mean(np.linalg.norm(gaps[..., :3, 3], axis=-1))) or 1.0
    gaps[..., :3, 3] /= length
    prismatic = [not joint.is_rotational for joint in ring.joints]
    return LoopSamples(gaps, np.where(prismatic, q / length, q))


Tensor = NDArray[np.complex128]

_MOST = 4
_DIRECTION = slice(6, 9)


@dataclass(frozen=True, slots=True, eq=False)
class Side:
    """One side of an equation, as a polynomial in its unknown joints.

    Attributes:
        joints: indices of the unknown joints in the loop chain.
        values: (samples, rows, 3^k) coefficients. Each joint has the factors e^-iq, 1, e^iq, or
            r, 1, r^2; the factors of the last joint change fastest.
    """

    joints: tuple[int, ...]
    values: Tensor


@dataclass(frozen=True, slots=True, eq=False)
class FrameSplit:
    """Equations from one pair of frames: left = right, row by row.

    Attributes:
        start: reference frame: 2 k before joint k, 2 k + 1 after it.
        end: observed frame, with the same numbering.
        seed: index 0, 1 or 2 of the observed axis. The origin is observed with the z axis (2) only.
        rows: indices of the elements of w that give equations.
        left: path in forward direction.
        right: path in backward direction.
    """

    start: int
    end: int
    seed: int
    rows: tuple[int, ...]
    left: Side
    right: Side


@dataclass(frozen=True, slots=True, eq=False)
class _Pieces:
    """Matrices on w, or on directions only, from which the sides of equations are multiplied.

    `joints` are the unknown joints, `gaps` and `back` transforms between them in both directions,
    `turns` and `turns_back` the joint factors of `_joint_factors` in both directions.
    """

    joints: list[int]
    gaps: list[Matrix]
    back: list[Matrix]
    turns: list[Tensor]
    turns_back: list[Tensor]
    prismatic: frozenset[int]


def splits(knowledge: KnownFrames) -> Iterator[FrameSplit]:
    """Yield each split of the loop into two sides with few unknown joints each.

    Args:
        knowledge: known joints and sums.
    """
    whole = _pieces(knowledge, slice(0, SIZE))
    directions = _pieces(knowledge, _DIRECTION)
    w = np.zeros((SIZE, 1))
    w[[0, 8]] = 1.0
    for e, k in enumerate(whole.joints):
        prismatic = k in whole.prismatic
        for end in (2 * k, 2 * k + 1) if prismatic else (2 * k,):
            yield from _splits_to(whole, w, (e, prismatic), (end, 2))
        for end in (2 * k,) if prismatic else (2 * k, 2 * k + 1):
            yield from _splits_to(directions, np.eye(3)[:, :2], (e, not prismatic), (end, 0))


def _splits_to(
    pieces: _Pieces, seed: Matrix, joint: tuple[int, bool], end: tuple[int, int]
) -> Iterator[FrameSplit]:
    """Yield the splits with one observed frame.

    Args:
        pieces: matrices of the loop.
        seed: observed vectors w or axes, as columns.
        joint: index among the unknown joints, and whether it moves the seed.
        end: index of the observed frame and index of its first axis.
    """
    (e, moves), (point, axis) = joint, end
    samples = len(pieces.gaps[0])
    first = np.broadcast_to(seed, (samples, *seed.shape)).astype(complex)
    left = _walk(pieces, first, e, moves and point % 2 == 1, forward=False)
    right = _walk(pieces, first, e, moves and point % 2 == 0, forward=True)
    for start, side in left.items():
        other = right.get(start)
        if other is None or start == point:
            continue
        for column in range(seed.shape[1]):
            sides = (Side(s.joints, s.values[:, :, column]) for s in (side, other))
            rows = _new_rows(axis, start, start // 2 in pieces.prismatic)
            yield FrameSplit(start, point, axis + column, rows, *sides)


def _new_rows(axis: int, start: int, prismatic: bool) -> tuple[int, ...]:
    """Return indices in w (15,) of the equations that are new if the reference frame is `start`.

    `axis` is the index of the observed axis, and `prismatic` the type of the joint at `start`.

    w are the products of `frame_products`, equal on both paths around the loop.
    """
    after = start % 2 == 1
    if axis == 2:
        return (3, 4, 6, 7, 9, 10, 12, 13) if after and not prismatic else tuple(range(1, SIZE))
    if after and prismatic:
        return ()
    return (6, 7) if after else (6, 7, 8)


def _walk(
    pieces: _Pieces, first: Tensor, e: int, turned: bool, forward: bool
) -> Mapping[int, Side]:
    """Return the observed vectors in the frames on one path from joint e, by frame index.

    `first` are the vectors in the frame of joint e; `turned` is whether its motion acts on them,
    and `forward` the direction of the path along the loop.
    """
    gaps, turns = (pieces.back, pieces.turns_back) if forward else (pieces.gaps, pieces.turns)
    m, found = len(pieces.joints), dict[int, Side]()
    side, j = Side((), first[..., None]), e
    if turned:
        side = _with_joint(side, pieces.joints[e], turns[e])
    for _ in range(m):
        found[2 * pieces.joints[j] + forward] = side
        following = (j + 1 if forward else j - 1) % m
        side = _multiplied(side, gaps[following if forward else j])
        found.setdefault(2 * pieces.joints[following] + (not forward), side)
        if len(side.joints) == _MOST:
            break
        j = following
        side = _with_joint(side, pieces.joints[j], turns[j])
    return found


def _multiplied(side: Side, matrix: Matrix) -> Side:
    """Return one side of the loop equation multiplied by a matrix."""
    S, d = matrix.shape[:2]
    values = matrix @ side.values.reshape(S, d, -1)
    return Side(side.joints, values.reshape(side.values.shape))


def _with_joint(side: Side, k: int, basis: Tensor) -> Side:
    """Return the side multiplied by the factors (3, d, d) of a further unknown joint k.

    `basis` are the factors; k is the index of the joint.
    """
    S, d, columns, K = side.values.shape
    moved = basis[:, None] @ side.values.reshape(S, d, -1)
    values = np.moveaxis(moved.reshape(3, S, d, columns, K), 0, -1)
    return Side((*side.joints, k), values.reshape(S, d, columns, 3 * K))


def _pieces(knowledge: KnownFrames, block: slice) -> _Pieces:
    """Return the matrices of the unknown joints and of the transforms between them.

    The slice `block` selects rows and columns of the matrices that act on w (15,), see
    `frame_products`.
    """
    joints = knowledge.unknown
    gaps = [_merged_transform(knowledge, k) for k in joints]
    ways = [rho(T)[:, block, block] for T in gaps]
    back = [rho(inverse(T))[:, block, block] for T in gaps]
    turns = [_joint_factors(knowledge, k, 1)[:, block, block] for k in joints]
    turns_back = [_joint_factors(knowledge, k, -1)[:, block, block] for k in joints]
    prismatic = frozenset(k for k in joints if not knowledge.ring.joints[k].is_rotational)
    return _Pieces(joints, ways, back, turns, turns_back, prismatic)


def _merged_transform(knowledge: KnownFrames, k: int) -> Matrix:
    """Return the transform (samples, 4, 4) from the previous unknown joint to joint k."""
    ring, samples = knowledge.ring, knowledge.samples
    T, n = samples.gaps[:, k], len(ring.joints)
    before = (k - 1) % n
    while before in knowledge.known:
        joint = ring.joints[before]
        moved = motion(joint.sign * samples.q[:, before], not joint.is_rotational)
        T = samples.gaps[:, before] @ moved @ T
        before = (before - 1) % n
    return T


def _joint_factors(knowledge: KnownFrames, k: int, direction: int) -> Tensor:
    """Return the factors (3, 15, 15) of e^-iq, 1, e^iq of joint k, or of r, 1, r^2.

    The direction is 1 along the loop and -1 against it.
    """
    joint = knowledge.ring.joints[k]
    one, first, second = motion_parts(not joint.is_rotational)
    if not joint.is_rotational:
        return np.array([direction * joint.sign * first, one, second], dtype=complex)
    up = (first - 1j * direction * joint.sign * second) / 2
    return np.array([up.conj(), one, up])


# Rows of a split loop that may have few unknowns, sorted into terms of the joints.


Values = NDArray[np.complex128]

MOST_VARIABLES = 3
_MOST_JOINTS = 4


@dataclass(frozen=True, slots=True)
class SplitRow:
    """Origin of an equation, see `FrameSplit`.

    Attributes:
        start: reference frame.
        end: observed frame.
        seed: index of the observed axis.
        element: index of the element of w.
    """

    start: int
    end: int
    seed: int
    element: int

    @property
    def power(self) -> int:
        """Power of a length that is the unit of its terms."""
        return POWERS[self.element]


def simple_rows(
    split: FrameSplit, prismatic: frozenset[int], most: int
) -> Iterator[tuple[SplitRow, dict[Members, Values]]]:
    """Yield the rows that may have few unknowns, and their terms.

    Args:
        split: split of the loop.
        prismatic: indices of the prismatic joints.
        most: largest number of variables in a row with products of variables.
    """
    offset = 0 if split.seed == 2 else -6
    rows = [r + offset for r in split.rows]
    if not rows:
        return
    sides = (split.left, split.right)
    tables = [_table(side.joints, prismatic) for side in sides]
    masks = [np.max(np.abs(side.values[:, rows]), axis=0) > ZERO for side in sides]
    counts = np.sum([_counts(t, mask) for t, mask in zip(tables, masks, strict=True)], axis=0)
    variables, joints, long = counts
    few = (variables <= most) | ((variables <= MOST_VARIABLES) & (long == 0))
    for number in np.flatnonzero((joints > 0) & (joints <= _MOST_JOINTS) & few):
        row = SplitRow(split.start, split.end, split.seed, split.rows[number])
        found = dict[Members, Values]()
        for side, table, mask, sign in zip(sides, tables, masks, (1, -1), strict=True):
            _collect_terms(found, (side, table.terms, mask[number]), rows[number], sign)
        yield row, found


def _counts(table: _Table, mask: NDArray[np.bool_]) -> NDArray[np.int_]:
    """Return three counts (3, rows) of the terms that a mask (rows, terms) selects from a table.

    They are a lower bound of the number of variables, and the numbers of joints and of products.
    """
    weights = mask.astype(int)
    joints = (weights @ table.has) > 0
    together = np.zeros(joints.shape, dtype=bool)
    for (a, b), apart in zip(table.pairs, (weights @ table.apart).T, strict=True):
        together[:, b] |= joints[:, a] & joints[:, b] & (apart == 0)
    count = joints.sum(axis=1)
    return np.array([count - together.sum(axis=1), count, weights @ table.long])


def _collect_terms(
    found: dict[Members, Values],
    source: tuple[Side, list[Members | None], NDArray[np.bool_]],
    row: int,
    sign: int,
) -> None:
    """Add `sign` times the terms of a row of a side to `found`, in place.

    `source` is the side, its terms, and a mask of the terms that are not zero.
    """
    side, terms, mask = source
    for k in np.flatnonzero(mask):
        term = terms[k]
        if term is None:
            continue
        values = sign * side.values[:, row, k]
        found[term] = found[term] + values if term in found else values


@dataclass(frozen=True, slots=True, eq=False)
class _Table:
    """Terms of a side with given joints.

    Attributes:
        terms: terms by index; None for a term that is the conjugate of another one.
        has: (terms, joints) 1 if the term contains the joint.
        pairs: pairs of joints.
        apart: (terms, pairs) 1 if the term contains exactly one joint of the pair.
        long: (terms,) 1 if the term contains several joints.
    """

    terms: list[Members | None]
    has: NDArray[np.int_]
    pairs: list[tuple[int, int]]
    apart: NDArray[np.int_]
    long: NDArray[np.int_]


@lru_cache(maxsize=4096)
def _table(joints: tuple[int, ...], prismatic: frozenset[int]) -> _Table:
    """Return the terms of a side with these joints: products of powers of joint variables.

    `joints` are indices of joints, and `prismatic` those of all prismatic joints.
    """
    every = list(product((-1, 0, 1), repeat=len(joints)))
    terms = list[Members | None]()
    for row in every:
        term = tuple(
            (k, {-1: 1, 1: 2}[e] if k in prismatic else e)
            for k, e in sorted(zip(joints, row, strict=True))
            if e
        )
        leading = next((e for k, e in term if k not in prismatic), 1)
        terms.append(term if leading > 0 else None)
    has = (np.array(every, dtype=int).reshape(len(every), len(joints)) != 0).astype(int)
    pairs = list(combinations(range(len(joints)), 2))
    apart = np.array([has[:, a] != has[:, b] for a, b in pairs], dtype=int)
    apart = apart.reshape(len(pairs), len(every)).T
    return _Table(terms, has, pairs, apart, (has.sum(axis=1) > 1).astype(int))
