"""Solutions of the inverse geometric model for many poses."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from mbs.assembly import System
from mbs.assembly.model_function import require_system
from mbs.closed_forms.arm import Arm, Array
from mbs.models.inverse_geometry._solve import solve_at, solve_rigid
from mbs.models.inverse_geometry.chain import FrameChain, frame_chain, target_poses
from mbs.models.inverse_geometry.closed_form import require_method
from mbs.models.inverse_geometry.draft import METHODS
from mbs.models.inverse_geometry.draft_many import (
    Booleans,
    many_draft,
    replace_solutions,
)
from mbs.models.inverse_geometry.redundancy import Locked, LockedSamples, Redundant, samples_of
from mbs.models.inverse_geometry.solutions import (
    WITHIN,
    CoordinateLimits,
    Given,
    ManySolutions,
    Solutions,
    bounds,
    leaves_out,
)

Repair = Callable[[Arm, Array], Array]
"""Function (arm, T (4, 4)) -> all configurations (m, n) of the arm with end pose T."""


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
    chain = frame_chain(system, frame, samples.locked, samples.varied)
    count, number, joints = samples.r.shape
    r = samples.r.reshape(count * number, joints)
    many = poses if number == 1 else np.repeat(poses, number, axis=0)
    draft = many_draft(chain, method, p, many, r)
    for k in np.flatnonzero(draft.searched):
        pose, arm = many[k], chain.locked_at(r[k]).arm(p)
        if repair:
            q = repair(arm, pose)
        else:
            found = solve_at(chain, r[k], pose, method, p)
            q, draft.undecided[k] = found.q[:, list(chain.indices)], found.undecided
        draft = replace_solutions(draft, int(k), arm, q, pose)
    q, valid = _whole(chain, draft.q, r), draft.valid
    if leaves_out(limits):
        names, indices = list(redundant or {}), list(chain.indices)
        indices += [k for k, c in enumerate(system.coordinates) if c.name in names]
        q, within = _unwind(bounds(system, limits, indices), q)
        valid = valid & within
    return _gather_samples(replace(draft, q=q, valid=valid), samples)


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


def _whole(chain: FrameChain, q: Array, r: Array) -> Array:
    """Return the positions (N, branches, nq) of all joints; others as assembled or locked."""
    system = chain.system
    if chain.indices == tuple(range(system.nq)):
        return q
    every = np.empty((*q.shape[:2], system.nq))
    every[...] = system.position(chain.locked)
    every[..., list(chain.indices)] = q
    every[..., list(chain.varied_indices)] = r[:, None]
    return every


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
