"""Many poses at once."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from casadi import Function
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.assembly.model_function import require_system
from mbs.closed_forms.arm import Arm, Array
from mbs.closed_forms.arm_search import General, Polished, general_many, polish
from mbs.closed_forms.sequence import StepSequence
from mbs.errors import NoClosedForm
from mbs.models.inverse_geometry.branches import branch_labels
from mbs.models.inverse_geometry.chain import FrameChain, frame_chain, target_poses
from mbs.models.inverse_geometry.closed_form import (
    CLOSED_FORMS,
    PoseBatch,
    at_poses,
    plain_branches,
    require_method,
    sequence_of,
)
from mbs.models.inverse_geometry.gathering import ILL_CONDITIONED, METHODS, general_ready
from mbs.models.inverse_geometry.redundancy import Locked, LockedSamples, Redundant, samples_of
from mbs.models.inverse_geometry.solutions import (
    WITHIN,
    CoordinateLimits,
    Given,
    Solutions,
    bounds,
    leaves_out,
)
from mbs.models.inverse_geometry.target import (
    NEARLY_SINGULAR,
    SINGULAR,
    SOLVED,
    Target,
    nearly_singular,
)
from mbs.native import compiled

# The closed form of a chain at many poses: in machine code, several poses in vector lanes.


_COLUMNS = 32
"""Poses in one call: more make the code longer, fewer the calls felt."""
MANY = 1000
"""Poses from which machine code is worth the second that a compiler takes; those of earlier calls
count."""


def batch(
    chain: FrameChain, sequence: StepSequence, p: NDArray[np.float64], T: Array, r: Array
) -> PoseBatch:
    """All branches at poses T, (N, 4, 4).

    Args:
        chain: what is solved for.
        sequence: its steps, for the same p.
        p: (np,) the parameters.
        T: the poses [m].
        r: (N, k) positions of the chain's varied joints [rad or m].
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
    """By machine code for so many columns at a time, straight into the arrays."""
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


# What a compiled closed form gives for many poses, and which of them it leaves in doubt.


Booleans = NDArray[np.bool_]

_DOUBTFUL = 1e-6
"""Residual, of max(1 m, the arm's length), below which a solution may stand beside a
configuration."""
_EXACT = 1e-14
"""Residual, of max(1 m, the arm's length), that polishing hardly betters."""
_SUSPECT = 1e-9
"""Radicands and regularity, squared and free of units, from which on the roots of equations with
two lie farther apart than 1e-5, however small a singular value is."""
_DEGENERATE = 1e-12
"""Squared and free of units, below which a pose is searched: its steps keep ten digits, and one
that loses more is told by the residuals. For one pose alone, `gathering` is more careful."""
_FOLD = 1e-9
"""Below zero, radicand, free of units, of a root that is real but for rounding: the residual, which
grows with it, decides."""
_SAME = 1e-9
"""Difference [rad or m] of two configurations that are one: polished ones repeat to 1e-12 or so."""
_MEETING = 1e-5
"""Difference [rad or m] below which two are near a double root, which rounding splits by 1e-8 and a
residual of 1e-12 by 1e-6, so that how many there are is left to the search."""
_ALIKE = 12 * _MEETING
"""Largest difference of the marks of two configurations that differ by `_MEETING`."""


@dataclass(frozen=True, slots=True, eq=False)
class BranchSolutions:
    """Solutions of N poses, a column for every branch.

    Attributes:
        q: (N, branches, n) positions of the chain's joints [rad or m].
        valid: (N, branches) whether there is a solution.
        residual: (N, branches) largest difference of an element from the target pose.
        labels: of the branches.
        searched: (N,) whether the solutions are to be looked for by other means: branches meet
            there, or leave a joint undetermined.
    """

    q: Array
    valid: Booleans
    residual: Array
    labels: tuple[str, ...]
    searched: Booleans


def nothing(joints: int, count: int) -> BranchSolutions:
    """So many poses without a closed form."""
    shape = count, 0
    empty = np.empty((*shape, joints)), np.zeros(shape, dtype=bool), np.empty(shape)
    return BranchSolutions(*empty, (), np.ones(count, dtype=bool))


@dataclass(frozen=True, slots=True, eq=False)
class ArmRows:
    """A chain in numbers at N poses: one arm, or one for the positions of the varied joints.

    Attributes:
        first: the arm; of several any, which tells joints and units alone.
        gaps: (N, n + 1, 4, 4) of every arm; None where there is one.
    """

    first: Arm
    gaps: Array | None

    @property
    def scale(self) -> Array:
        """(N, 1) or (1, 1) max(1 m, length), by which residuals are measured."""
        if self.gaps is None:
            return np.full((1, 1), max(1.0, self.first.length))
        length = np.sum(np.linalg.norm(self.gaps[:, :, :3, 3], axis=2), axis=1)
        return np.asarray(np.maximum(1.0, length)[:, None])

    def at(self, k: int) -> Arm:
        """The arm of pose number k."""
        if self.gaps is None:
            return self.first
        return Arm(self.first.names, self.first.prismatic, self.gaps[k])

    def polish(self, T: Array, rows: NDArray[np.intp], q: Array) -> Polished:
        """Better configurations (m, n) of poses whose numbers are `rows`, (m,)."""
        if self.gaps is None:
            return polish(self.first, T[rows], q)
        better = Polished(np.empty_like(q), np.empty(len(q)))
        for k in np.unique(rows):
            own = rows == k
            found = polish(self.at(int(k)), T[k], q[own])
            better.q[own], better.residual[own] = found.q, found.residual
        return better

    def nearly_singular(self, rows: NDArray[np.intp], q: Array, bound: float) -> Booleans:
        """(m,) which of configurations q, (m, n), of poses `rows` are next to a singular one."""
        if self.gaps is None:
            return nearly_singular(self.first, q, bound)
        near = np.empty(len(q), dtype=bool)
        for k in np.unique(rows):
            own = rows == k
            near[own] = nearly_singular(self.at(int(k)), q[own], bound)
        return near


def arm_rows(chain: FrameChain, p: Array, r: Array) -> ArmRows:
    """The chain in numbers for parameters p, (np,), and positions r, (N, k), of varied joints."""
    if not chain.varied:
        return ArmRows(chain.arm(p), None)
    some = r if len(r) else np.zeros((1, r.shape[1]))
    gaps = chain.gaps(p, some)
    prismatic = np.array(chain.prismatic, dtype=bool)
    return ArmRows(Arm(chain.names, prismatic, gaps[0]), gaps)


def draft_solutions(
    chain: FrameChain, sequence: StepSequence, p: Array, T: Array, r: Array
) -> BranchSolutions:
    """The solutions by a closed form.

    Args:
        chain: what is solved for.
        sequence: its steps, for the same p.
        p: (np,) the parameters.
        T: (N, 4, 4) poses [m].
        r: (N, k) positions of the chain's varied joints [rad or m].
    """
    every, arms = batch(chain, sequence, p, T, r), arm_rows(chain, p, r)
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
    return BranchSolutions(every.q, valid, every.residual, labels, searched)


def bounds_of(sequence: StepSequence) -> tuple[float, float]:
    """What tells whether solutions may be missing next to a singular configuration.

    Returns:
        the value of `real` and `regular` from which on the Jacobian is not asked, and the singular
        value below which others may be missing. Two-root equations lose none as long as two roots
        do not count as one; quartics lose them as the general method does.
    """
    if any(step.kind == "quartic" for step in sequence.steps):
        return np.inf, NEARLY_SINGULAR
    return _SUSPECT, SINGULAR


def _next_to_singular(
    arms: ArmRows, every: PoseBatch, valid: Booleans, limits: tuple[float, float]
) -> Booleans:
    """At which poses a solution is next to a singular configuration."""
    least = np.minimum(np.abs(every.real), every.regular)
    suspect, nearly = limits
    asked = valid & (least < suspect)
    near = np.zeros_like(valid)
    near[asked] = arms.nearly_singular(np.nonzero(asked)[0], every.q[asked], nearly)
    found: Booleans = np.any(near, axis=1)
    return found


def _polish(arms: ArmRows, T: Array, every: PoseBatch, which: Booleans) -> Booleans:
    """Improve some configurations, (m,), and tell which of them moved far."""
    before = every.q[which]
    better = arms.polish(T, np.nonzero(which)[0], before)
    every.q[which], every.residual[which] = better.q, better.residual
    moved = np.abs(arms.first.wrapped(better.q - before))
    far: Booleans = np.max(moved, axis=-1) > _MEETING
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


def with_configurations(
    draft: BranchSolutions, k: int, arm: Arm, q: Array, T: Array
) -> BranchSolutions:
    """With other solutions of one pose, each in the column of the nearest branch.

    Args:
        draft: whose rows are written over.
        k: number of the pose.
        arm: the chain in numbers.
        q: (m, n) its solutions [rad or m].
        T: (4, 4) the pose.
    """
    draft = _widen(draft, len(q))
    columns = _nearest_columns(arm, draft.q[k], q)
    draft.valid[k] = False
    draft.valid[k, columns], draft.q[k, columns] = True, q
    draft.residual[k, columns] = arm.residual(q, T)
    return draft


def _widen(draft: BranchSolutions, columns: int) -> BranchSolutions:
    """With so many columns at least."""
    more = columns - draft.valid.shape[1]
    if more <= 0:
        return draft
    rows = (0, 0), (0, more)
    q, valid = np.pad(draft.q, (*rows, (0, 0))), np.pad(draft.valid, rows)
    residual = np.pad(draft.residual, rows, constant_values=np.inf)
    return BranchSolutions(q, valid, residual, draft.labels + ("",) * more, draft.searched)


def _nearest_columns(arm: Arm, branches: Array, q: Array) -> list[int]:
    """A column for every configuration: the nearest pairs first."""
    apart = np.sum(np.abs(arm.wrapped(q[:, None] - branches[None])), axis=-1)
    columns = [-1] * len(q)
    for _ in columns:
        configuration, column = np.unravel_index(int(np.argmin(apart)), apart.shape)
        columns[int(configuration)] = int(column)
        apart[configuration, :], apart[:, column] = np.inf, np.inf
    return columns


# What the general method gives for many poses, and which of them it leaves in doubt.


def ready(chain: FrameChain, p: Array) -> General | None:
    """The general method of a chain for parameters p, (np,); None where it hardly holds."""
    found = general_ready(chain, p)
    return found if found and found.prepared.regularity >= ILL_CONDITIONED else None


def general_draft(general: General, T: Array) -> BranchSolutions:
    """The solutions by the general method, in no order.

    Args:
        general: the method, made ready for an arm.
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
    return BranchSolutions(every, valid, residual, ("",) * shape[1], searched)


def general_draft_varied(chain: FrameChain, p: Array, T: Array, r: Array) -> BranchSolutions:
    """Likewise where the varied joints are at r, (N, k): each of their positions makes an arm."""
    draft = nothing(len(chain.names), len(T))
    positions, which = np.unique(r, axis=0, return_inverse=True)
    for number, position in enumerate(positions):
        general = ready(chain.locked_at(position), p)
        if general is None:
            continue
        rows = np.flatnonzero(which.ravel() == number)
        part = general_draft(general, T[rows])
        draft = _widen(draft, part.valid.shape[1])
        columns = slice(0, part.valid.shape[1])
        draft.q[rows, columns], draft.valid[rows, columns] = part.q, part.valid
        draft.residual[rows, columns], draft.searched[rows] = part.residual, part.searched
    return draft


# Inverse geometric models of many poses at once.


Repair = Callable[[Arm, Array], Array]
"""All configurations (m, n) of an arm that take its frame to a pose (4, 4)."""


@dataclass(frozen=True, slots=True, eq=False)
class ManySolutions:
    """The solutions of N poses: a row for every pose, in it a column for every branch.

    With S positions of redundant joints the columns are those of the first position, then those of
    the second, and so on: `q.reshape(N, S, -1, nq)` tells them apart.

    Attributes:
        q: (N, S branches, nq) configurations [rad or m]; where there is no solution any finite
            numbers.
        valid: (N, S branches) whether there is a solution.
        residual: (N, S branches) largest difference of an element between the pose of q and the
            wanted one, in m and 1; infinite where a column is not used.
        labels: of the columns; empty texts where no closed form tells branches apart.
        searched: (N,) whether the pose was solved by itself, with some position of redundant
            joints: its configurations stand in the columns of the nearest branches.
        undecided: (N,) whether double precision does not decide the list of the pose, as
            `Solutions.undecided`; True if it does not with some position of redundant joints.
        samples: S, how many positions of redundant joints every pose was solved for; 1 without.
    """

    q: Array
    valid: Booleans
    residual: Array
    labels: tuple[str, ...]
    searched: Booleans
    undecided: Booleans
    samples: int = 1

    def __len__(self) -> int:
        """The number of poses."""
        return len(self.q)

    @property
    def count(self) -> NDArray[np.int64]:
        """(N,) how many solutions each pose has."""
        count: NDArray[np.int64] = np.sum(self.valid, axis=1, dtype=np.int64)
        return count

    def of(self, k: int) -> Array:
        """(m, nq) the solutions of pose number k, counted from 0 [rad or m]."""
        configurations: Array = self.q[k, self.valid[k]]
        return configurations


def solve_many(
    system: System,
    T: Any,
    frame: str | int | None = None,
    method: str = "auto",
    limits: bool | Given | None = None,
    locked: Locked | None = None,
    *,
    redundant: Redundant | None = None,
    parameters: Mapping[str, float] | None = None,
    repair: Repair | None = None,
) -> ManySolutions:
    """All solutions of many poses, by a compiled closed form, else by the general method.

    Poses at which solutions meet or joints are left undetermined, and all poses of robots for which
    neither method holds, are solved one by one. An angle is within half a turn of zero; limits
    may move it by full turns.

    Args:
        system: a serial robot or a tree; of a robot with loops every pose is solved by itself.
        T: (N, 4, 4) poses of the frame seen from the base [m].
        frame: a body, a named frame, the number of a link, or None for the terminal frame.
        method: "pieper", "paul", "auto" for the cheaper of them that fits, "general", "search".
        limits: None leaves out no solution; True leaves out those beyond the limits of the
            description; (lowest, highest) by name replaces these [rad or m].
        locked: positions of joints that stay where they are, by name; one for all poses, or (N,)
            one for each [rad or m].
        redundant: by the name of a joint beyond the six that a pose determines how many positions
            it takes, from limit to limit or over a turn, or the positions: (S,) for every pose, or
            (N, S) for each [rad or m]. Several joints take all combinations, the last one fastest.
        parameters: values of symbols, the others at their defaults.
        repair: what solves single poses of a serial robot, `solve` when left out. Its lists are
            not marked as undecided.

    Returns:
        ManySolutions: the solutions that `solve` finds for each pose.

    Raises:
        NoClosedForm: "pieper" or "paul" was asked for and does not fit.
        ModelError: a matrix is no rigid transform, a name is unknown, positions are not what they
            should be, or more than six joints are free.
    """
    from mbs.models.inverse_geometry.solve import solve_rigid  # it takes drafts from here

    require_system(system)
    require_method(system, method, METHODS)
    poses, p = target_poses(system, T), np.array(system.parameter_values(parameters))
    samples = samples_of(system, locked, redundant, limits, len(poses))
    if system.is_closed:
        answers = [
            solve_rigid(
                system,
                pose,
                frame,
                method,
                limits,
                locked={**samples.locked, **dict(zip(samples.varied, at, strict=True))},
                parameters=parameters,
            )
            for pose, own in zip(poses, samples.r.tolist(), strict=True)
            for at in own
        ]
        return _gather_samples(_stack(system, answers), samples)
    robot = _robot(frame_chain(system, frame, samples.locked, samples.varied), method, p)
    count, number, joints = samples.r.shape
    r = samples.r.reshape(count * number, joints)
    many = poses if number == 1 else np.repeat(poses, number, axis=0)
    draft = robot.draft(many, r)
    undecided = np.zeros(len(many), dtype=bool)
    for k in np.flatnonzero(draft.searched):
        chain, pose = robot.chain.locked_at(r[k]), many[k]
        arm = chain.arm(p)
        if repair:
            q = repair(arm, pose)
        else:
            q, undecided[k] = robot.solved(pose, r[k])
        draft = with_configurations(draft, int(k), arm, q, pose)
    q, valid = robot.whole(draft.q, r), draft.valid
    if leaves_out(limits):
        names, indices = list(redundant or {}), list(robot.chain.indices)
        indices += [k for k, c in enumerate(system.coordinates) if c.name in names]
        q, within = _unwind(bounds(system, limits, indices), q)
        valid = valid & within
    found = ManySolutions(q, valid, draft.residual, draft.labels, draft.searched, undecided)
    return _gather_samples(found, samples)


def _gather_samples(many: ManySolutions, samples: LockedSamples) -> ManySolutions:
    """The rows of all positions of a pose in one row."""
    count, number, _ = samples.r.shape
    if number == 1:
        return many
    columns = many.valid.shape[1]
    shape = count, number * columns
    return ManySolutions(
        many.q.reshape(*shape, many.q.shape[2]),
        many.valid.reshape(shape),
        many.residual.reshape(shape),
        many.labels * number,
        np.any(many.searched.reshape(count, number), axis=1),
        np.any(many.undecided.reshape(count, number), axis=1),
        number,
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Robot:
    """How a robot is solved; without both methods every pose is searched for by itself."""

    chain: FrameChain
    p: Array
    method: str
    sequence: StepSequence | None

    def draft(self, T: Array, r: Array) -> BranchSolutions:
        """The solutions by a closed form, else by the general method."""
        if self.sequence is not None:
            return draft_solutions(self.chain, self.sequence, self.p, T, r)
        if self.method in ("auto", "general"):
            if self.chain.varied:
                return general_draft_varied(self.chain, self.p, T, r)
            general = ready(self.chain, self.p)
            if general is not None:
                return general_draft(general, T)
        return nothing(len(self.chain.names), len(T))

    def solved(self, pose: Array, r: Array) -> tuple[Array, bool]:
        """(m, n) all configurations at one pose, the varied joints at r, (k,); undecided or not."""
        from mbs.models.inverse_geometry.solve import solve_at  # it takes drafts from here

        found = solve_at(self.chain, r, pose, self.method, self.p)
        return found.q[:, list(self.chain.indices)], found.undecided

    def whole(self, q: Array, r: Array) -> Array:
        """(N, branches, nq) positions of all joints, those outside the chain as assembled."""
        system = self.chain.system
        if self.chain.indices == tuple(range(system.nq)):
            return q
        every = np.empty((*q.shape[:2], system.nq))
        every[...] = system.position(self.chain.locked)
        every[..., list(self.chain.indices)] = q
        every[..., list(self.chain.varied_indices)] = r[:, None]
        return every


def _robot(chain: FrameChain, method: str, p: Array) -> _Robot:
    return _Robot(chain, p, method, _sequence(chain, method, p))


def _sequence(chain: FrameChain, method: str, p: Array) -> StepSequence | None:
    """The closed form that was asked for, None for methods that are none."""
    if method not in (*CLOSED_FORMS, "auto"):
        return None
    try:
        return sequence_of(chain, method, p)
    except NoClosedForm:
        if method != "auto":
            raise
        return None


def _stack(system: System, answers: list[Solutions]) -> ManySolutions:
    """The solutions of every pose side by side."""
    columns = max((len(answer) for answer in answers), default=0)
    shape = len(answers), columns
    q, valid = np.zeros((*shape, system.nq)), np.zeros(shape, dtype=bool)
    residual = np.full(shape, np.inf)
    for k, answer in enumerate(answers):
        m = len(answer)
        q[k, :m], valid[k, :m] = answer.q, True
        residual[k, :m] = [solution.residual for solution in answer]
    undecided = np.array([answer.undecided for answer in answers], dtype=bool)
    searched = np.ones(len(answers), dtype=bool)
    return ManySolutions(q, valid, residual, ("",) * columns, searched, undecided)


def _unwind(allowed: CoordinateLimits, q: Array) -> tuple[Array, Booleans]:
    """Configurations (N, branches, nq) changed by whole turns, and whether all is within limits."""
    low, high = allowed.low - WITHIN, allowed.high + WITHIN
    missing = np.where(q < low, low - q, np.where(q > high, high - q, 0.0)) / (2 * np.pi)
    turns = np.copysign(np.ceil(np.abs(missing)), missing)
    wound = np.where(allowed.turns & (missing != 0), q + 2 * np.pi * turns, q)
    return wound, np.all((wound >= low) & (wound <= high), axis=-1)
