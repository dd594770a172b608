"""Every way to split a loop, in numbers: what one side is, seen from each frame of the other.

Seen from the frame before or after joint i, a point and the axes of joint e are the same whether
one walks there forwards or backwards: each pair of frames gives a set of equations, left = right,
that no joint stands on both sides of.

Source: Paul 1981, section 3.7; the invariants: Raghavan & Roth 1993, section 4.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mbs.loops.paul.knowledge import Knowledge, Matrix
from mbs.loops.paul.representation import SIZE, inverse, joint_basis, motion, represented

Tensor = NDArray[np.complex128]

_MOST = 4
_DIRECTION = slice(6, 9)


@dataclass(frozen=True, slots=True, eq=False)
class Side:
    """One side of an equation as a polynomial in the unknown joints on it.

    Attributes:
        joints: their numbers in the ring.
        values: (samples, rows, 3^k) its coefficients; each joint has the factors e^-iq, 1, e^iq,
            or r, 1, r^2, the last joint those that change fastest.
    """

    joints: tuple[int, ...]
    values: Tensor


@dataclass(frozen=True, slots=True, eq=False)
class Split:
    """The equations of two frames: left = right, row by row.

    Attributes:
        start: the frame from which one looks: 2 k before joint k, 2 k + 1 after it.
        end: the frame at which one looks.
        seed: 0, 1, 2: which axis of it; of its point only with the z axis.
        rows: of the 15 elements of w those that are meant.
        left: the way forwards.
        right: the way backwards.
    """

    start: int
    end: int
    seed: int
    rows: tuple[int, ...]
    left: Side
    right: Side


@dataclass(frozen=True, slots=True, eq=False)
class _Pieces:
    """Matrices of the joints and of the ways between them, of one representation."""

    joints: list[int]
    gaps: list[Matrix]
    back: list[Matrix]
    turns: list[Tensor]
    turns_back: list[Tensor]
    slides: frozenset[int]


def splits(knowledge: Knowledge) -> Iterator[Split]:
    """Every split of the loop whose sides have few unknown joints each."""
    whole = _pieces(knowledge, slice(0, SIZE))
    turning = _pieces(knowledge, _DIRECTION)
    w = np.zeros((SIZE, 1))
    w[[0, 8]] = 1.0
    for e, k in enumerate(whole.joints):
        slides = k in whole.slides
        for end in (2 * k, 2 * k + 1) if slides else (2 * k,):
            yield from _of_end(whole, w, (e, slides), (end, 2))
        for end in (2 * k,) if slides else (2 * k, 2 * k + 1):
            yield from _of_end(turning, np.eye(3)[:, :2], (e, not slides), (end, 0))


def _of_end(
    pieces: _Pieces, seed: Matrix, joint: tuple[int, bool], end: tuple[int, int]
) -> Iterator[Split]:
    """The splits that look at one frame.

    Args:
        pieces: of the loop.
        seed: what is looked at.
        joint: its number among the unknown ones, and whether it moves the seed.
        end: number of the frame and first axis.
    """
    (e, moves), (point, axis) = joint, end
    samples = len(pieces.gaps[0])
    first = np.broadcast_to(seed, (samples, *seed.shape)).astype(complex)
    left = _walk_back(pieces, first, e, moves and point % 2 == 1)
    right = _walk_on(pieces, first, e, moves and point % 2 == 0)
    for start, side in left.items():
        other = right.get(start)
        if other is None or start == point:
            continue
        for column in range(seed.shape[1]):
            sides = (Side(s.joints, s.values[:, :, column]) for s in (side, other))
            rows = _rows(axis, start, start // 2 in pieces.slides)
            yield Split(start, point, axis + column, rows, *sides)


def _rows(axis: int, start: int, slides: bool) -> tuple[int, ...]:
    """The elements that are new: a turn of the frame about its z axis leaves the others."""
    after = start % 2 == 1
    if axis == 2:
        return (3, 4, 6, 7, 9, 10, 12, 13) if after and not slides else tuple(range(1, SIZE))
    if after and slides:
        return ()
    return (6, 7) if after else (6, 7, 8)


def _walk_back(pieces: _Pieces, first: Tensor, e: int, turned: bool) -> Mapping[int, Side]:
    """What is seen from the frames before joint e, by their numbers."""
    m, found = len(pieces.joints), dict[int, Side]()
    side = Side((), first[..., None])
    if turned:
        side = _through(side, pieces.joints[e], pieces.turns[e])
    for step in range(m):
        j = (e - step) % m
        found[2 * pieces.joints[j]] = side
        side = _over(side, pieces.gaps[j])
        before = (j - 1) % m
        found.setdefault(2 * pieces.joints[before] + 1, side)
        if len(side.joints) == _MOST:
            break
        side = _through(side, pieces.joints[before], pieces.turns[before])
    return found


def _walk_on(pieces: _Pieces, first: Tensor, e: int, turned: bool) -> Mapping[int, Side]:
    """What is seen from the frames after joint e, by their numbers."""
    m, found = len(pieces.joints), dict[int, Side]()
    side = Side((), first[..., None])
    if turned:
        side = _through(side, pieces.joints[e], pieces.turns_back[e])
    for step in range(m):
        j = (e + step) % m
        found[2 * pieces.joints[j] + 1] = side
        after = (j + 1) % m
        side = _over(side, pieces.back[after])
        found.setdefault(2 * pieces.joints[after], side)
        if len(side.joints) == _MOST:
            break
        side = _through(side, pieces.joints[after], pieces.turns_back[after])
    return found


def _over(side: Side, matrix: Matrix) -> Side:
    S, d = matrix.shape[:2]
    values = matrix @ side.values.reshape(S, d, -1)
    return Side(side.joints, values.reshape(side.values.shape))


def _through(side: Side, k: int, basis: Tensor) -> Side:
    """The side with the powers of one more joint, (3, d, d), before it."""
    S, d, columns, K = side.values.shape
    moved = basis[:, None] @ side.values.reshape(S, d, -1)
    values = np.moveaxis(moved.reshape(3, S, d, columns, K), 0, -1)
    return Side((*side.joints, k), values.reshape(S, d, columns, 3 * K))


def _pieces(knowledge: Knowledge, block: slice) -> _Pieces:
    joints = knowledge.unknown
    gaps = [_merged(knowledge, k) for k in joints]
    ways = [represented(T)[:, block, block] for T in gaps]
    back = [represented(inverse(T))[:, block, block] for T in gaps]
    turns = [_basis(knowledge, k, 1)[:, block, block] for k in joints]
    turns_back = [_basis(knowledge, k, -1)[:, block, block] for k in joints]
    slides = frozenset(k for k in joints if not knowledge.ring.joints[k].turns)
    return _Pieces(joints, ways, back, turns, turns_back, slides)


def _merged(knowledge: Knowledge, k: int) -> Matrix:
    """(samples, 4, 4) the way to joint k from the unknown joint before it."""
    ring, samples = knowledge.ring, knowledge.samples
    T, n = samples.gaps[:, k], len(ring.joints)
    before = (k - 1) % n
    while before in knowledge.known:
        joint = ring.joints[before]
        moved = motion(joint.sign * samples.q[:, before], not joint.turns)
        T = samples.gaps[:, before] @ moved @ T
        before = (before - 1) % n
    return T


def _basis(knowledge: Knowledge, k: int, way: int) -> Tensor:
    """(3, 15, 15) factors of e^-iq, 1, e^iq, or of r, 1, r^2."""
    joint = knowledge.ring.joints[k]
    one, first, second = joint_basis(not joint.turns)
    if not joint.turns:
        return np.array([way * joint.sign * first, one, second], dtype=complex)
    up = (first - 1j * way * joint.sign * second) / 2
    return np.array([up.conj(), one, up])
