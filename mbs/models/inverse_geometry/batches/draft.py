"""What a compiled closed form gives for many poses, and which of them it leaves in doubt."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mbs.loops.sequence import Sequence
from mbs.models.inverse_geometry.answers.target import SOLVED
from mbs.models.inverse_geometry.arm import Arm, Array
from mbs.models.inverse_geometry.batches.batch import PoseBatch, batch
from mbs.models.inverse_geometry.chain import Chain
from mbs.models.inverse_geometry.numeric.polish import polish

Booleans = NDArray[np.bool_]

_DOUBTFUL = 1e-6
"""Residual, of max(1 m, the arm's length), below which a solution may stand beside a posture."""
_DEGENERATE = 1e-12
_FOLD = 1e-9
_SAME, _MEETING = 1e-9, 1e-5
_ALIKE = 12 * _MEETING
"""Largest difference of the marks of two postures that differ by `_MEETING`."""


@dataclass(frozen=True, slots=True, eq=False)
class BranchSolutions:
    """Solutions of N poses, a column for every branch.

    Attributes:
        q: (N, branches, n) positions of the chain's joints [rad or m].
        valid: (N, branches) whether there is a solution.
        residual: (N, branches) largest difference of an element from the wanted pose.
        labels: of the branches.
        searched: (N,) whether the solutions are to be looked for by other means: branches meet
            there, or leave a joint undetermined.
    """

    q: Array
    valid: Booleans
    residual: Array
    labels: tuple[str, ...]
    searched: Booleans


def nothing(arm: Arm, count: int) -> BranchSolutions:
    """So many poses without a closed form."""
    shape = count, 0
    empty = np.empty((*shape, arm.size)), np.zeros(shape, dtype=bool), np.empty(shape)
    return BranchSolutions(*empty, (), np.ones(count, dtype=bool))


def drafted(chain: Chain, sequence: Sequence, p: Array, arm: Arm, T: Array) -> BranchSolutions:
    """The solutions by a closed form.

    Args:
        chain: what is solved for.
        sequence: its steps, for the same p.
        p: (np,) the parameters.
        arm: the chain in numbers.
        T: (N, 4, 4) poses [m].
    """
    every = batch(chain, sequence, p, T)
    scale = max(1.0, arm.length)
    close = every.residual <= _DOUBTFUL * scale
    doubtful = close & (every.residual > 0.1 * SOLVED * scale)
    if np.any(doubtful):
        doubtful[doubtful] = _polish(arm, T, every, doubtful)
    valid = (every.residual <= SOLVED * scale) & (every.real >= -_FOLD) & ~doubtful
    doubtful = close & ~valid
    searched = np.any(doubtful | (every.regular < _DEGENERATE), axis=1)
    searched |= _merge(arm, every, valid)
    labels = tuple(sequence.label(b) for b in range(sequence.branches))
    return BranchSolutions(every.q, valid, every.residual, labels, searched)


def _polish(arm: Arm, T: Array, every: PoseBatch, which: Booleans) -> Booleans:
    """Improve some postures, (m,), and tell which of them moved far."""
    before = every.q[which]
    better = polish(arm, T[np.nonzero(which)[0]], before)
    every.q[which], every.residual[which] = better.q, better.residual
    far: Booleans = np.max(np.abs(arm.wrapped(better.q - before)), axis=-1) > _MEETING
    return far


def _merge(arm: Arm, every: PoseBatch, valid: Booleans) -> Booleans:
    """Keep the first of equal solutions, and tell at which poses others are nearly equal."""
    marks = np.sort(np.where(valid, every.mark, np.inf), axis=1)
    with np.errstate(invalid="ignore"):
        rows = np.flatnonzero(np.any(np.diff(marks, axis=1) < _ALIKE, axis=1))
    some, q = valid[rows], every.q[rows]
    meeting = np.zeros(len(valid), dtype=bool)
    for b in range(1, valid.shape[1]):
        apart = np.max(np.abs(arm.wrapped(q[:, :b] - q[:, b : b + 1])), axis=-1)
        apart[~some[:, :b]] = np.inf
        nearest = np.min(apart, axis=1)
        meeting[rows] |= some[:, b] & (nearest >= _SAME) & (nearest < _MEETING)
        some[:, b] &= nearest >= _SAME
    valid[rows] = some
    return meeting


def with_postures(draft: BranchSolutions, k: int, arm: Arm, q: Array, T: Array) -> BranchSolutions:
    """With other solutions of one pose, each in the column of the nearest branch.

    Args:
        draft: whose rows are written over.
        k: number of the pose.
        arm: the chain in numbers.
        q: (m, n) its solutions [rad or m].
        T: (4, 4) the pose.
    """
    draft = _widened(draft, len(q))
    columns = _nearest_columns(arm, draft.q[k], q)
    draft.valid[k] = False
    draft.valid[k, columns], draft.q[k, columns] = True, q
    draft.residual[k, columns] = arm.residual(q, T)
    return draft


def _widened(draft: BranchSolutions, columns: int) -> BranchSolutions:
    """With so many columns at least."""
    more = columns - draft.valid.shape[1]
    if more <= 0:
        return draft
    rows = (0, 0), (0, more)
    q, valid = np.pad(draft.q, (*rows, (0, 0))), np.pad(draft.valid, rows)
    residual = np.pad(draft.residual, rows, constant_values=np.inf)
    return BranchSolutions(q, valid, residual, draft.labels + ("",) * more, draft.searched)


def _nearest_columns(arm: Arm, branches: Array, q: Array) -> list[int]:
    """A column for every posture: the nearest pairs first."""
    apart = np.sum(np.abs(arm.wrapped(q[:, None] - branches[None])), axis=-1)
    columns = [-1] * len(q)
    for _ in columns:
        posture, column = np.unravel_index(int(np.argmin(apart)), apart.shape)
        columns[int(posture)] = int(column)
        apart[posture, :], apart[:, column] = np.inf, np.inf
    return columns
