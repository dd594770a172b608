"""Inverse geometric models of many poses at once."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.assembly.model_function import require_system
from mbs.errors import NoClosedForm
from mbs.loops.sequence import Sequence
from mbs.models.inverse_geometry.answers.gathering import METHODS
from mbs.models.inverse_geometry.answers.limits import CoordinateLimits, Given, bounds, leaves_out
from mbs.models.inverse_geometry.answers.solutions import Solutions
from mbs.models.inverse_geometry.arm import Arm, Array
from mbs.models.inverse_geometry.batches.draft import (
    Booleans,
    BranchSolutions,
    drafted,
    nothing,
    with_postures,
)
from mbs.models.inverse_geometry.batches.general_draft import general_draft, ready
from mbs.models.inverse_geometry.chain import Chain, chain
from mbs.models.inverse_geometry.equations.closed_form import (
    CLOSED_FORMS,
    require_method,
    sequence_of,
)
from mbs.models.inverse_geometry.numeric.general import General
from mbs.models.inverse_geometry.pose_input import wanted_poses
from mbs.models.inverse_geometry.solve import solve

Repair = Callable[[Arm, Array], Array]
"""All postures (m, n) of an arm that take its frame to a pose (4, 4)."""

_WITHIN = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class ManySolutions:
    """The solutions of N poses: a row for every pose, in it a column for every branch.

    Attributes:
        q: (N, branches, nq) postures [rad or m]; where there is no solution any finite numbers.
        valid: (N, branches) whether there is a solution.
        residual: (N, branches) largest difference of an element between the pose of q and the
            wanted one, in m and 1; infinite where a column is not used.
        labels: of the branches; empty texts where no closed form tells them apart.
        searched: (N,) whether the pose was solved by itself: its postures stand in the columns of
            the nearest branches.
    """

    q: Array
    valid: Booleans
    residual: Array
    labels: tuple[str, ...]
    searched: Booleans

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
        postures: Array = self.q[k, self.valid[k]]
        return postures


def solve_many(
    system: System,
    T: Any,
    frame: str | int | None = None,
    method: str = "auto",
    limits: bool | Given | None = None,
    locked: Mapping[str, float] | None = None,
    *,
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
        locked: positions of joints that stay where they are, by name [rad or m].
        parameters: values of symbols, the others at their defaults.
        repair: what solves single poses of a serial robot, `solve` when left out.

    Returns:
        ManySolutions: the solutions that `solve` finds for each pose.

    Raises:
        NoClosedForm: "pieper" or "paul" was asked for and does not fit.
        ModelError: a matrix is no rigid transform, a name is unknown, or more than six joints
            are free.
    """
    require_system(system)
    require_method(system, method, METHODS)
    poses, p = wanted_poses(system, T), np.array(system.parameter_values(parameters))

    def solved(pose: Array) -> Solutions:
        return solve(system, pose, frame, method, given, locked=locked, parameters=parameters)

    given = limits if system.is_closed else None
    if system.is_closed:
        return _stacked(system, [solved(pose) for pose in poses])
    robot = _robot(chain(system, frame, locked), method, p)
    draft = robot.draft(poses)
    for k in np.flatnonzero(draft.searched):
        pose = poses[k]
        q = repair(robot.arm, pose) if repair else solved(pose).q[:, list(robot.way.places)]
        draft = with_postures(draft, int(k), robot.arm, q, pose)
    q, valid = robot.whole(draft.q), draft.valid
    if leaves_out(limits):
        q, within = _wound(bounds(system, limits, robot.way.places), q)
        valid = valid & within
    return ManySolutions(q, valid, draft.residual, draft.labels, draft.searched)


@dataclass(frozen=True, slots=True, eq=False)
class _Robot:
    """How a robot is solved; without both methods every pose is searched for by itself."""

    way: Chain
    p: Array
    arm: Arm
    sequence: Sequence | None
    general: General | None

    def draft(self, T: Array) -> BranchSolutions:
        """The solutions by a closed form, else by the general method."""
        if self.sequence is not None:
            return drafted(self.way, self.sequence, self.p, self.arm, T)
        if self.general is not None:
            return general_draft(self.general, T)
        return nothing(self.arm, len(T))

    def whole(self, q: Array) -> Array:
        """(N, branches, nq) positions of all joints, those outside the chain as assembled."""
        system = self.way.system
        if self.way.places == tuple(range(system.nq)):
            return q
        every = np.empty((*q.shape[:2], system.nq))
        every[...] = system.position(self.way.locked)
        every[..., list(self.way.places)] = q
        return every


def _robot(way: Chain, method: str, p: Array) -> _Robot:
    sequence, general = _sequence(way, method, p), None
    if sequence is None and method in ("auto", "general"):
        general = ready(way, p)
    return _Robot(way, p, way.arm(p), sequence, general)


def _sequence(way: Chain, method: str, p: Array) -> Sequence | None:
    """The closed form that was asked for, None for methods that are none."""
    if method not in (*CLOSED_FORMS, "auto"):
        return None
    try:
        return sequence_of(way, method, p)
    except NoClosedForm:
        if method != "auto":
            raise
        return None


def _stacked(system: System, answers: list[Solutions]) -> ManySolutions:
    """The solutions of every pose side by side."""
    columns = max((len(answer) for answer in answers), default=0)
    shape = len(answers), columns
    q, valid = np.zeros((*shape, system.nq)), np.zeros(shape, dtype=bool)
    residual = np.full(shape, np.inf)
    for k, answer in enumerate(answers):
        m = len(answer)
        q[k, :m], valid[k, :m] = answer.q, True
        residual[k, :m] = [solution.residual for solution in answer]
    return ManySolutions(q, valid, residual, ("",) * columns, np.ones(len(answers), dtype=bool))


def _wound(allowed: CoordinateLimits, q: Array) -> tuple[Array, Booleans]:
    """Postures (N, branches, nq) changed by whole turns, and whether all is within limits."""
    low, high = allowed.low - _WITHIN, allowed.high + _WITHIN
    missing = np.where(q < low, low - q, np.where(q > high, high - q, 0.0)) / (2 * np.pi)
    turns = np.copysign(np.ceil(np.abs(missing)), missing)
    wound = np.where(allowed.turns & (missing != 0), q + 2 * np.pi * turns, q)
    return wound, np.all((wound >= low) & (wound <= high), axis=-1)
