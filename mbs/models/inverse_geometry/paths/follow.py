"""A path of poses followed on one branch: the joints move continuously, or stop with a reason."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.assembly.model_function import require_system
from mbs.errors import ModelError
from mbs.loops.goal import goal
from mbs.messages import quoted
from mbs.models.geometry import terminal_frame
from mbs.models.inverse_geometry.answers.limits import Given
from mbs.models.inverse_geometry.paths.follower import Follower, follower
from mbs.models.inverse_geometry.paths.path import Path, path_of
from mbs.models.inverse_geometry.paths.stops import stop_reason
from mbs.models.inverse_geometry.paths.tracking import carried, point_at, smallest

Array = NDArray[np.float64]

_OFF = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class Followed:
    """How far a path was followed.

    Attributes:
        q: (k, nq) postures at the poses reached [rad or m]; angles go on beyond half a turn.
        reached: number of the last pose reached, counted from 0; -1 for none.
        reason: why it stopped there; empty where the path was followed to its end.
        residual: (k,) largest element by which the pose is missed, and row by which a loop is open.
        singular_values: (k,) the smallest of the Jacobian, lengths measured by the arm's.
        stopped_at: (nq,) the last posture on the way, between two poses where it stopped.
    """

    q: Array
    reached: int
    reason: str
    residual: Array
    singular_values: Array
    stopped_at: Array


def follow(
    system: System,
    path: Any,
    start: Any,
    frame: str | int | None = None,
    *,
    samples: int = 101,
    locked: Mapping[str, float] | None = None,
    limits: bool | Given | None = None,
    parameters: Mapping[str, float] | None = None,
) -> Followed:
    """The postures along a path of poses, on the branch of the first one.

    Between two poses the frame is led along a straight line and turned about a fixed axis, in
    steps so small that no other branch can be taken. Where the branch ends, or the joints can move
    while the frame stays, it stops before; also where the path could go on beyond. Fewer than six
    joints need poses that they can take; between these the frame is led as near to the line as they
    can.

    Args:
        system: open, or with closed loops, which stay closed in the way they are at the start.
        path: (N, 4, 4) poses of the frame in the base [m], or a function that makes such a pose of
            a number between 0 and 1.
        start: (nq,) positions near the first pose, by name or all of them, or a solution with such
            a `q`. The frame is led from where it is there to the first pose.
        frame: a body, a named frame, or the number of a link; the terminal frame when left out.
        samples: how many poses of a function are given back.
        locked: positions of joints that stay where they are, by name [rad or m].
        limits: (lowest, highest) by name replaces limits of the description, None for a joint
            without; False leaves all out of account.
        parameters: values of symbols, the others at their defaults.

    Returns:
        The postures up to the last pose reached, and why it is not the last of the path.

    Raises:
        ModelError: a pose, a name or the start is not understood, or the chain has more than six
            free joints.
    """
    require_system(system)
    name = terminal_frame(system) if frame is None else frame
    poses = path_of(system, path, samples)
    q = _start(system, start, locked)
    wanted = goal(system, name, np.eye(4), None, parameters)
    return _followed(follower(wanted, q, locked, limits), poses, q)


def _followed(led: Follower, poses: Path, q: Array) -> Followed:
    tracker, x, T = led.tracker, led.scaled(q), led.pose(q)
    point, step = point_at(tracker, x, T), 1.0
    kept, reason = list[tuple[Array, float, float]](), ""
    for number in range(poses.count):
        way = poses.way(number, T)
        point, at, step = carried(tracker, point, way, min(1.0, step))
        whole, T = led.whole(q, point.x), way(1.0)
        if at < 1.0 or point.left > _OFF:
            reason = stop_reason(led, poses, number, whole, at)
            break
        step = max(step, 1e-3)
        kept.append((whole, led.residual(whole, T), smallest(tracker, point.J)))
    rows = np.array([whole for whole, _, _ in kept]).reshape(len(kept), q.size)
    numbers = np.array([other for _, *other in kept]).reshape(len(kept), 2)
    last = led.whole(q, point.x)
    return Followed(rows, len(kept) - 1, reason, numbers[:, 0], numbers[:, 1], last)


def _start(system: System, start: Any, locked: Mapping[str, float] | None) -> Array:
    """(nq,) the start, with locked joints where they are locked."""
    given = getattr(start, "q", start)
    q = np.array(system.position(given)) if isinstance(given, Mapping) else _numbers(system, given)
    held = np.array(system.position(locked))
    names = [coordinate.name for coordinate in system.coordinates]
    places = [names.index(name) for name in locked or {}]
    q[places] = held[places]
    return q


def _numbers(system: System, given: Any) -> Array:
    try:
        q = np.array(given, dtype=float).ravel()
    except (TypeError, ValueError):
        q = np.zeros(0)
    if q.size != system.nq or not np.all(np.isfinite(q)):
        raise ModelError(
            f"{system.name}: the start is {quoted(given)}; give {system.nq} positions, or a dict of"
            " joint names to positions"
        )
    return q
