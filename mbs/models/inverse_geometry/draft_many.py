"""Draft of many poses: solutions of a vectorised closed form or the general method."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from casadi import Function
from numpy.typing import NDArray

from mbs.closed_forms.arm import Arm, Array
from mbs.closed_forms.arm_search import General, general_many, polish
from mbs.closed_forms.sequence import StepSequence
from mbs.models.inverse_geometry.branches import branch_labels
from mbs.models.inverse_geometry.chain import FrameChain
from mbs.models.inverse_geometry.closed_form import (
    PoseBatch,
    at_poses,
    bounds_of,
    plain_branches,
    sequence_or_none,
)
from mbs.models.inverse_geometry.draft import regular_general
from mbs.models.inverse_geometry.solutions import ManySolutions
from mbs.models.inverse_geometry.target import (
    SOLVED,
    Target,
    nearly_singular,
)
from mbs.native import compiled

# Closed form of a chain at many poses: machine code that solves several poses in vector lanes.


_COLUMNS = 32
"""Poses per call of the machine code: more poses make the code longer, fewer add call overhead."""
MANY = 1000
"""Number of poses, over all calls, from which machine code saves more time than its compilation
takes (about one second)."""


def evaluate_branches(
    chain: FrameChain, sequence: StepSequence, p: NDArray[np.float64], T: Array, r: Array
) -> PoseBatch:
    """Evaluate all branches of a closed form at N poses.

    Args:
        chain: chain that is solved for.
        sequence: closed form of the chain, for the same p.
        p: (np,) parameter values.
        T: (N, 4, 4) poses [m].
        r: (N, k) positions of the varied joints of the chain [rad or m].
    """
    plain = plain_branches(chain, sequence, p)
    key = ("machine code of igm_all", sequence, *chain.key, p.tobytes())
    asked: list[int] = chain.system.cached(("poses", *key), lambda: [0])
    asked[0] += len(T)
    if asked[0] < MANY:
        return at_poses(plain, T, r)
    return _by_machine(chain.system.cached(key, lambda: _machine_code(plain)), plain, T, r)


def _machine_code(plain: Function) -> Function:
    return compiled(plain.map(_COLUMNS), derivatives=0, fast=True)


def _by_machine(call: Any, plain: Function, T: Array, r: Array) -> PoseBatch:
    """Evaluate by machine code in blocks of `_COLUMNS` poses, directly into the arrays."""
    n, branches = plain.size_out(0)
    count = len(T)
    padded = -(-count // _COLUMNS) * _COLUMNS
    columns = np.empty((padded, 4, 4))
    columns[:count], columns[count:] = np.swapaxes(T, 1, 2), np.eye(4)
    varied = np.zeros((padded, r.shape[1]))
    varied[:count] = r
    q = np.empty((padded, branches, n))
    rows = [np.empty((padded, branches)) for _ in range(4)]
    for first in range(0, padded, _COLUMNS):
        part = slice(first, first + _COLUMNS)
        out = (q[part].reshape(-1, n).T, *(row[part].T for row in rows))
        more = (varied[part].T,) if r.shape[1] else ()
        call(columns[part].reshape(-1, 4).T, *more, out=out)
    return PoseBatch(q[:count], *(row[:count] for row in rows))


# Solutions of a closed form at many poses, and a mask of the poses that are not certified.


Booleans = NDArray[np.bool_]

_DOUBTFUL = 1e-6
"""Residual, relative to max(1 m, arm length), below which a solution may be near a
configuration."""
_EXACT = 1e-14
"""Residual, relative to max(1 m, arm length), that Newton's method hardly improves."""
_DEGENERATE = 1e-12
"""Regularity (squared, dimensionless) below which a pose is solved by other methods. Above it the
steps keep ten digits, and residuals reveal a larger loss. `draft` uses a stricter limit for
single poses."""
_FOLD = 1e-9
"""Largest negative radicand (dimensionless) of a root that is real up to rounding. The residual
grows with it and decides."""
_SAME = 1e-9
"""Difference [rad or m] below which two configurations are equal: refined copies agree to about
1e-12."""
_MEETING = 1e-5
"""Difference [rad or m] below which two configurations are near a double root. Rounding splits a
double root by 1e-8 and a residual of 1e-12 by 1e-6, so other methods determine the number."""
_ALIKE = 12 * _MEETING
"""Largest difference of the marks (see `all_branches`) of two configurations that differ by
`_MEETING`."""


# The results of this module are `ManySolutions` of a chain: q (N, branches, n) are its positions.
# In `searched`, poses are marked that must be solved by other methods, because branches meet or a
# joint is undetermined.


def empty_draft(joints: int, count: int) -> ManySolutions:
    """Return an empty result of `count` poses, all marked for other methods."""
    shape = count, 0
    empty = np.empty((*shape, joints)), np.zeros(shape, dtype=bool), np.empty(shape)
    return ManySolutions(*empty, (), np.ones(count, dtype=bool), np.zeros(count, dtype=bool))


@dataclass(frozen=True, slots=True, eq=False)
class ArmRows:
    """Numeric geometry of a chain at N poses: one arm, or one per position of varied joints.

    Attributes:
        first: the arm, or the first of several arms, which have the same joints and units.
        gaps: (N, n + 1, 4, 4) constant transforms between joints of each arm, or None for one arm.
    """

    first: Arm
    gaps: Array | None

    @property
    def scale(self) -> Array:
        """Reference length max(1 m, arm length) of residuals, (N, 1) or (1, 1)."""
        if self.gaps is None:
            return np.full((1, 1), max(1.0, self.first.length))
        length = np.sum(np.linalg.norm(self.gaps[:, :, :3, 3], axis=2), axis=1)
        return np.asarray(np.maximum(1.0, length)[:, None])

    def at(self, k: int) -> Arm:
        """Return the arm of pose k."""
        if self.gaps is None:
            return self.first
        return Arm(self.first.names, self.first.prismatic, self.gaps[k])

    def polish(self, T: Array, rows: NDArray[np.intp], q: Array) -> tuple[Array, Array]:
        """Refine configurations q (m, n) of the poses with indices `rows` (m,); see `polish`."""
        if self.gaps is None:
            return polish(self.first, T[rows], q)
        better, residual = np.empty_like(q), np.empty(len(q))
        for k in np.unique(rows):
            own = rows == k
            better[own], residual[own] = polish(self.at(int(k)), T[k], q[own])
        return better, residual

    def nearly_singular(self, rows: NDArray[np.intp], q: Array, bound: float) -> Booleans:
        """Return (m,) whether each q (m, n), of pose `rows` (m,), is nearly singular."""
        if self.gaps is None:
            return nearly_singular(self.first, q, bound)
        near = np.empty(len(q), dtype=bool)
        for k in np.unique(rows):
            own = rows == k
            near[own] = nearly_singular(self.at(int(k)), q[own], bound)
        return near


def arm_rows(chain: FrameChain, p: Array, r: Array) -> ArmRows:
    """Return the numeric chain for parameters p (np,) and varied joint positions r (N, k)."""
    if not chain.varied:
        return ArmRows(chain.arm(p), None)
    some = r if len(r) else np.zeros((1, r.shape[1]))
    gaps = chain.gaps(p, some)
    prismatic = np.array(chain.prismatic, dtype=bool)
    return ArmRows(Arm(chain.names, prismatic, gaps[0]), gaps)


def closed_form_draft(
    chain: FrameChain, sequence: StepSequence, p: Array, T: Array, r: Array
) -> ManySolutions:
    """Solve N poses by a closed form.

    Args:
        chain: chain that is solved for.
        sequence: closed form of the chain, for the same p.
        p: (np,) parameter values.
        T: (N, 4, 4) poses [m].
        r: (N, k) positions of the varied joints of the chain [rad or m].
    """
    every, arms = evaluate_branches(chain, sequence, p, T, r), arm_rows(chain, p, r)
    arm, scale = arms.first, arms.scale
    close = every.residual <= _DOUBTFUL * scale
    doubtful = close & (every.residual > _EXACT * scale)
    if np.any(doubtful):
        doubtful[doubtful] = _polish(arms, T, every, doubtful)
    valid = (every.residual <= SOLVED * scale) & (every.real >= -_FOLD) & ~doubtful
    doubtful = close & ~valid
    searched = np.any(doubtful | (every.regular < _DEGENERATE), axis=1)
    searched |= _merge(arm, every, valid)
    searched |= _next_to_singular(arms, every, valid, bounds_of(sequence))
    labels = branch_labels(chain, sequence, p)
    undecided = np.zeros(len(T), dtype=bool)
    return ManySolutions(every.q, valid, every.residual, labels, searched, undecided)


def _next_to_singular(
    arms: ArmRows, every: PoseBatch, valid: Booleans, limits: tuple[float, float]
) -> Booleans:
    """Return (N,) whether each pose has a solution near a singular configuration."""
    least = np.minimum(np.abs(every.real), every.regular)
    suspect, nearly = limits
    asked = valid & (least < suspect)
    near = np.zeros_like(valid)
    near[asked] = arms.nearly_singular(np.nonzero(asked)[0], every.q[asked], nearly)
    found: Booleans = np.any(near, axis=1)
    return found


def _polish(arms: ArmRows, T: Array, every: PoseBatch, which: Booleans) -> Booleans:
    """Refine the configurations of mask `which` in place; return (m,) whether each moved far."""
    before = every.q[which]
    better, residual = arms.polish(T, np.nonzero(which)[0], before)
    every.q[which], every.residual[which] = better, residual
    moved = np.abs(arms.first.wrapped(better - before))
    far: Booleans = np.max(moved, axis=-1) > _MEETING
    return far


def _merge(arm: Arm, every: PoseBatch, valid: Booleans) -> Booleans:
    """Invalidate copies of equal solutions; return (N,) whether a pose has nearly equal ones."""
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


def replace_solutions(draft: ManySolutions, k: int, arm: Arm, q: Array, T: Array) -> ManySolutions:
    """Replace the solutions of one pose, each in the column of the nearest branch.

    Args:
        draft: solutions of all poses; row k is overwritten.
        k: index of the pose.
        arm: numeric geometry of the chain.
        q: (m, n) new solutions of the pose [rad or m].
        T: (4, 4) pose [m].
    """
    draft = _widen(draft, len(q))
    columns = _nearest_columns(arm, draft.q[k], q)
    draft.valid[k] = False
    draft.valid[k, columns], draft.q[k, columns] = True, q
    draft.residual[k, columns] = arm.residual(q, T)
    return draft


def _widen(draft: ManySolutions, columns: int) -> ManySolutions:
    """Append unused columns up to a minimum number of columns."""
    more = columns - draft.valid.shape[1]
    if more <= 0:
        return draft
    rows = (0, 0), (0, more)
    q, valid = np.pad(draft.q, (*rows, (0, 0))), np.pad(draft.valid, rows)
    residual = np.pad(draft.residual, rows, constant_values=np.inf)
    labels = draft.labels + ("",) * more
    return replace(draft, q=q, valid=valid, residual=residual, labels=labels)


def _nearest_columns(arm: Arm, branches: Array, q: Array) -> list[int]:
    """Assign a column to each configuration, nearest pairs first."""
    apart = np.sum(np.abs(arm.wrapped(q[:, None] - branches[None])), axis=-1)
    columns = [-1] * len(q)
    for _ in columns:
        configuration, column = np.unravel_index(int(np.argmin(apart)), apart.shape)
        columns[int(configuration)] = int(column)
        apart[configuration, :], apart[:, column] = np.inf, np.inf
    return columns


# Solutions of the general method at many poses, and a mask of the poses that are not certified.


def general_draft(general: General, T: Array) -> ManySolutions:
    """Solve N poses by the general method; the order of columns has no meaning.

    Args:
        general: general method, prepared for an arm.
        T: (N, 4, 4) poses [m].
    """
    arm = general.arm
    pose, q = general_many(general, T)
    first = np.searchsorted(pose, np.arange(len(T)))
    column = np.arange(len(q)) - first[pose]
    shape = len(T), int(np.max(column, initial=-1)) + 1
    every, valid = np.zeros((*shape, arm.size)), np.zeros(shape, dtype=bool)
    residual, searched = np.full(shape, np.inf), np.zeros(len(T), dtype=bool)
    target = Target(arm, T[pose])
    reached = target.residual(q)
    every[pose, column], valid[pose, column], residual[pose, column] = q, True, reached
    unsure = nearly_singular(arm, q) | (reached > target.tolerance)
    searched[pose[unsure]] = True
    undecided = np.zeros(len(T), dtype=bool)
    return ManySolutions(every, valid, residual, ("",) * shape[1], searched, undecided)


def general_draft_varied(chain: FrameChain, p: Array, T: Array, r: Array) -> ManySolutions:
    """Solve N poses by the general method, with the varied joints at positions r (N, k).

    A separate arm is prepared for each distinct row of r.
    """
    draft = empty_draft(len(chain.names), len(T))
    positions, which = np.unique(r, axis=0, return_inverse=True)
    for number, position in enumerate(positions):
        general = regular_general(chain.locked_at(position), p)
        if general is None:
            continue
        rows = np.flatnonzero(which.ravel() == number)
        part = general_draft(general, T[rows])
        draft = _widen(draft, part.valid.shape[1])
        columns = slice(0, part.valid.shape[1])
        draft.q[rows, columns], draft.valid[rows, columns] = part.q, part.valid
        draft.residual[rows, columns], draft.searched[rows] = part.residual, part.searched
    return draft


def many_draft(chain: FrameChain, method: str, p: Array, T: Array, r: Array) -> ManySolutions:
    """Solve N poses by a closed form, else by the general method; others are marked as `searched`.

    Args:
        chain: chain that is solved for.
        method: argument of `solve`.
        p: (np,) parameter values.
        T: (N, 4, 4) poses [m].
        r: (N, k) positions of the varied joints of the chain [rad or m].

    Raises:
        NoClosedForm: method is "pieper" or "paul" and does not apply to the chain.
    """
    sequence = sequence_or_none(chain, method, p)
    if sequence is not None:
        return closed_form_draft(chain, sequence, p, T, r)
    if method in ("auto", "general"):
        if chain.varied:
            return general_draft_varied(chain, p, T, r)
        general = regular_general(chain, p)
        if general is not None:
            return general_draft(general, T)
    return empty_draft(len(chain.names), len(T))
