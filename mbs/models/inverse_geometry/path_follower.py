"""Joints and equations that track poses of a frame, from the options of the user."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

import mbs.closed_forms.arm_core as core
from mbs.closed_forms.arm import Arm, Array
from mbs.closed_forms.ring import spin_indices
from mbs.errors import ModelError
from mbs.loops.plan import regular_configuration, undetermined_beside
from mbs.loops.pose import Goal
from mbs.models.inverse_geometry.chain import frame_chain
from mbs.models.inverse_geometry.path_equations import (
    Follower,
    Rows,
)
from mbs.models.inverse_geometry.path_redundancy import Redundancy, slope_of
from mbs.models.inverse_geometry.solutions import CoordinateLimits, Given, bounds
from mbs.solvers.rank import null_space
from mbs.text import did_you_mean, quoted

_WHOLE = 6


def follower(
    target: Goal,
    start: Array,
    locked: Mapping[str, float] | None,
    limits: bool | Given | None,
    redundancy: Redundancy | None = None,
) -> Follower:
    """Set up the joints and equations that track poses of a frame.

    Args:
        target: tracked frame and loop closure of the system.
        start: (nq,) configuration; joints that do not move keep their positions in it.
        locked: joints that do not move, by name.
        limits: as in `follow`.
        redundancy: as in `follow`.

    Raises:
        ModelError: a name or a criterion is unknown.
    """
    system, frame = target.closing.system, target.frame
    ends = None if limits is False else bounds(system, limits)
    path = system.tree.path(system.frame(frame)[0])
    simple = all(system.tree.links[k].motion.nq == 1 for k in path)
    if simple and not system.is_closed:
        found = frame_chain(system, frame, locked, most=len(path))
        arm = found.arm(target.closing.p)
        more, exact = max(0, arm.size - _WHOLE), arm.size >= _WHOLE
        rows = _arm_rows(arm)
        led = Follower(target, found.indices, arm.units, rows, more, exact, ends, found, more)
    else:
        led = _closed_follower(target, start, list(locked or {}), ends)
    slope = slope_of(led, start, redundancy)
    return replace(led, slope=slope) if led.redundant else led


def _closed_follower(
    target: Goal, start: Array, locked: list[str], ends: CoordinateLimits | None
) -> Follower:
    """Set up a robot with loops: all joints move, except locked and undetermined joints."""
    system = target.closing.system
    indices = {link.name: link.q.start for link in system.tree.links if link.motion.nq == 1}
    for name in locked:
        if name not in indices:
            raise ModelError(
                f"{system.name}: joint {quoted(name)} cannot be locked;"
                f" {did_you_mean(name, indices)}"
            )
    q = regular_configuration(system)
    stays = tuple(indices[name] for name in locked)
    still = null_space(np.vstack([target.residual(q)[1], np.eye(system.nq)[list(stays)]]))
    held = {*stays, *undetermined_beside(system, still, ())}
    moving = tuple(k for k in range(system.nq) if k not in held)
    slack = len(spin_indices(system))
    free = null_space(target.closing.rows(q)[1][:, moving]).shape[1] - slack
    more = max(0, free - _WHOLE)

    def rows(x: Array, T: Array) -> tuple[Array, Array]:
        at = start.copy()
        at[list(moving)] = x
        r, J = target.at(T).residual(at)
        return -r, J[:, moving]

    exact, scale = free >= _WHOLE, np.ones(len(moving))
    return Follower(target, moving, scale, rows, slack + more, exact, ends, None, more)


def _arm_rows(arm: Arm) -> Rows:
    library = core.core_of(arm)

    def rows(x: Array, T: Array) -> tuple[Array, Array]:
        q = (x * arm.units)[None]
        gap, J = core.examined_by(library, arm, T, q)
        return gap[0], J[0]

    return rows
