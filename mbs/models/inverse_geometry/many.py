"""Inverse geometric model of many poses, by vectorised closed forms or the general method."""

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

# Closed form of a chain at many poses: machine code that solves several poses in vector lanes.


_COLUMNS = 32
"""Poses per call of the machine code: more poses make the code longer, fewer add call overhead."""
MANY = 1000
"""Number of poses, over all calls, from which machine code saves more time than its compilation
takes (about one second)."""


def batch(
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
_SUSPECT = 1e-9
"""Radicands and regularity (squared, dimensionless) above which the two roots of an equation are
farther apart than 1e-5, for any singular value."""
_DEGENERATE = 1e-12
"""Regularity (squared, dimensionless) below which a pose is solved by other methods. Above it the
steps keep ten digits, and residuals reveal a larger loss. `gathering` uses a stricter limit for
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


@dataclass(frozen=True, slots=True, eq=False)
class BranchSolutions:
    """Solutions of N poses, with one column per branch.

    Attributes:
        q: (N, branches, n) joint positions of the chain [rad or m].
        valid: (N, branches) whether the branch has a solution.
        residual: (N, branches) largest absolute difference of an element from the target pose.
        labels: names of the branches.
        searched: (N,) whether the pose must be solved by other methods, because branches meet or a
            joint is undetermined.
    """

    q: Array
    valid: Booleans
    residual: Array
    labels: tuple[str, ...]
    searched: Booleans


def nothing(joints: int, count: int) -> BranchSolutions:
    """Return an empty result of `count` poses, all marked for other methods."""
    shape = count, 0
    empty = np.empty((*shape, joints)), np.zeros(shape, dtype=bool), np.empty(shape)
    return BranchSolutions(*empty, (), np.ones(count, dtype=bool))


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

    def polish(self, T: Array, rows: NDArray[np.intp], q: Array) -> Polished:
        """Refine configurations q (m, n) of the poses with indices `rows` (m,)."""
        if self.gaps is None:
            return polish(self.first, T[rows], q)
        better = Polished(np.empty_like(q), np.empty(len(q)))
        for k in np.unique(rows):
            own = rows == k
            found = polish(self.at(int(k)), T[k], q[own])
            better.q[own], better.residual[own] = found.q, found.residual
        return better

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


def draft_solutions(
    chain: FrameChain, sequence: StepSequence, p: Array, T: Array, r: Array
) -> BranchSolutions:
    """Solve N poses by a closed form.

    Args:
        chain: chain that is solved for.
        sequence: closed form of the chain, for the same p.
        p: (np,) parameter values.
        T: (N, 4, 4) poses [m].
        r: (N, k) positions of the varied joints of the chain [rad or m].
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
    """Return the bounds of the test for missing solutions near singular configurations.

    Returns:
        Value of `real` and `regular` above which the Jacobian is not checked, and singular value
        below which solutions may be missing. Equations with two roots lose no solution until the
        roots count as one. Quartics lose solutions as the general method does.
    """
    if any(step.kind == "quartic" for step in sequence.steps):
        return np.inf, NEARLY_SINGULAR
    return _SUSPECT, SINGULAR


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
    better = arms.polish(T, np.nonzero(which)[0], before)
    every.q[which], every.residual[which] = better.q, better.residual
    moved = np.abs(arms.first.wrapped(better.q - before))
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


def with_configurations(
    draft: BranchSolutions, k: int, arm: Arm, q: Array, T: Array
) -> BranchSolutions:
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


def _widen(draft: BranchSolutions, columns: int) -> BranchSolutions:
    """Append unused columns up to a minimum number of columns."""
    more = columns - draft.valid.shape[1]
    if more <= 0:
        return draft
    rows = (0, 0), (0, more)
    q, valid = np.pad(draft.q, (*rows, (0, 0))), np.pad(draft.valid, rows)
    residual = np.pad(draft.residual, rows, constant_values=np.inf)
    return BranchSolutions(q, valid, residual, draft.labels + ("",) * more, draft.searched)


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


def ready(chain: FrameChain, p: Array) -> General | None:
    """Return the general method of a chain for p (np,), or None if it is ill-conditioned."""
    found = general_ready(chain, p)
    return found if found and found.prepared.regularity >= ILL_CONDITIONED else None


def general_draft(general: General, T: Array) -> BranchSolutions:
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
    return BranchSolutions(every, valid, residual, ("",) * shape[1], searched)


def general_draft_varied(chain: FrameChain, p: Array, T: Array, r: Array) -> BranchSolutions:
    """Solve N poses by the general method, with the varied joints at positions r (N, k).

    A separate arm is prepared for each distinct row of r.
    """
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


# Public result and function for many poses.


Repair = Callable[[Arm, Array], Array]
"""Function (arm, T (4, 4)) -> all configurations (m, n) of the arm with end pose T."""


@dataclass(frozen=True, slots=True, eq=False)
class ManySolutions:
    """Solutions of N poses: one row per pose, one column per branch.

    With S positions of redundant joints, the columns of the first position are followed by the
    columns of the second position, and so on. Use `q.reshape(N, S, -1, nq)` to separate them.

    Attributes:
        q: (N, S branches, nq) configurations [rad or m]; arbitrary finite values if not valid.
        valid: (N, S branches) whether the column contains a solution.
        residual: (N, S branches) largest absolute difference of an element between the pose of q
            and the target, in m and 1; infinite in unused columns.
        labels: names of the columns; empty texts without a closed form.
        searched: (N,) whether the pose was solved individually at some position of redundant
            joints. Its configurations are in the columns of the nearest branches.
        undecided: (N,) whether double precision cannot decide the list of solutions at some
            position of redundant joints; see `Solutions.undecided`.
        samples: number S of positions of redundant joints, 1 without redundant joints.
    """

    q: Array
    valid: Booleans
    residual: Array
    labels: tuple[str, ...]
    searched: Booleans
    undecided: Booleans
    samples: int = 1

    def __len__(self) -> int:
        """Return the number of poses."""
        return len(self.q)

    @property
    def count(self) -> NDArray[np.int64]:
        """Number of solutions of each pose, (N,)."""
        count: NDArray[np.int64] = np.sum(self.valid, axis=1, dtype=np.int64)
        return count

    def of(self, k: int) -> Array:
        """Return the solutions (m, nq) of pose k, counted from 0 [rad or m]."""
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
    """Compute all configurations for many poses of a frame (inverse kinematics).

    A compiled closed form is used, else the general method. Poses at which solutions coincide or
    joints are undetermined are solved one by one, and so are all poses if neither method applies.
    Angles are in [-pi, pi]; limits may shift them by full revolutions.

    Args:
        system: serial robot or tree. For a robot with loops each pose is solved individually.
        T: (N, 4, 4) poses of the frame relative to the base [m].
        frame: name of a body or frame, index of a link, or None for the terminal frame.
        method: "pieper", "paul", "auto" for the cheaper applicable one of both, "general" or
            "search".
        limits: None keeps all solutions. True drops solutions beyond the joint limits of the model.
            A dict of (lower, upper) by joint name replaces limits and drops solutions beyond them
            [rad or m].
        locked: positions of fixed joints by name: one for all poses, or (N,) one per pose [rad or
            m].
        redundant: samples of joints beyond the six that a pose determines, by name: number of
            positions between the limits (or over one revolution), or positions (S,) for all poses
            or (N, S) per pose [rad or m]. Several joints form all combinations, the last joint
            varies fastest.
        parameters: parameter values by name; default values for all others.
        repair: function that solves single poses of a serial robot; default is `solve`. Its
            results are not marked as undecided.

    Returns:
        ManySolutions with the same solutions as `solve` for each pose.

    Raises:
        NoClosedForm: method is "pieper" or "paul" and does not apply to the robot.
        ModelError: a matrix is no rigid transform, a name is unknown, positions have a wrong shape
            or value, or more than six joints are free.
    """
    from mbs.models.inverse_geometry.solve import solve_rigid  # avoids a circular import

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
    """Join the rows of all samples of redundant joints of a pose to one row."""
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
    """Chain, parameter values and method of a robot; `sequence` is None without a closed form."""

    chain: FrameChain
    p: Array
    method: str
    sequence: StepSequence | None

    def draft(self, T: Array, r: Array) -> BranchSolutions:
        """Solve poses T (N, 4, 4) by the closed form, else by the general method."""
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
        """Solve one pose with varied joints at r (k,): chain positions (m, n), undecided flag."""
        from mbs.models.inverse_geometry.solve import solve_at  # avoids a circular import

        found = solve_at(self.chain, r, pose, self.method, self.p)
        return found.q[:, list(self.chain.indices)], found.undecided

    def whole(self, q: Array, r: Array) -> Array:
        """Return the positions (N, branches, nq) of all joints; others as assembled or locked."""
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
    """Return the requested closed form, or None if there is none or the method is another."""
    if method not in (*CLOSED_FORMS, "auto"):
        return None
    try:
        return sequence_of(chain, method, p)
    except NoClosedForm:
        if method != "auto":
            raise
        return None


def _stack(system: System, answers: list[Solutions]) -> ManySolutions:
    """Combine the solutions of all poses in arrays."""
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
    """Shift angles of q (N, branches, nq) into the limits; also return whether all are within."""
    low, high = allowed.low - WITHIN, allowed.high + WITHIN
    missing = np.where(q < low, low - q, np.where(q > high, high - q, 0.0)) / (2 * np.pi)
    turns = np.copysign(np.ceil(np.abs(missing)), missing)
    wound = np.where(allowed.turns & (missing != 0), q + 2 * np.pi * turns, q)
    return wound, np.all((wound >= low) & (wound <= high), axis=-1)
