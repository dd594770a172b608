"""Every posture that takes a frame to a pose, as rows of a table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mbs.app.tasks.postures_pose import Array, pose_from, pose_from_text, pose_of, rpy_of
from mbs.assembly import System
from mbs.loops.goal import goal
from mbs.models import inverse_geometry
from mbs.models.catalogue.postures import SIX, held_at, moving_joints, surplus_joints
from mbs.models.geometry import terminal_frame
from mbs.models.inverse_geometry import Solution, Solutions
from mbs.models.inverse_geometry.answers.limits import CoordinateLimits, bounds

__all__ = [
    "METHODS",
    "Near",
    "Posture",
    "PostureList",
    "locked_by_default",
    "pose_from",
    "pose_from_text",
    "pose_of",
    "postures",
    "rpy_of",
]

Seed = Sequence[float] | Mapping[str, float] | None
Values = Mapping[str, float] | None

METHODS = ("auto", "pieper", "paul", "general", "search")
"""Ways to solve the inverse geometric model."""


@dataclass(frozen=True, slots=True)
class Posture:
    """One posture that takes the frame to the pose.

    Attributes:
        q: (nq) positions [rad or m].
        label: what tells it from the others, such as the side of shoulder, elbow and wrist.
        residual: largest element of the pose at q less the wanted one [m or 1].
        sigma: smallest singular value of the Jacobian; zero at a singular posture.
        multiplicity: how many roots meet in it; 0 where it is one of a self-motion.
        within_limits: whether whole turns bring every joint within its limits.
        outside: names of the joints that none brings within.
        family: the self-motion that it stands for, in words; "" where there is none.
        windings: how many postures within limits differ from it by whole turns.
    """

    q: tuple[float, ...]
    label: str
    residual: float
    sigma: float
    multiplicity: int
    within_limits: bool
    outside: tuple[str, ...]
    family: str
    windings: int


@dataclass(frozen=True, slots=True)
class Near:
    """The reachable pose that is nearest to the wanted one.

    Attributes:
        q: (nq) a whole posture that has it, loops closed [rad or m].
        distance: between the origins of both poses [m].
        angle: between their orientations [rad].
        T: the pose, rows of (4, 4).
    """

    q: tuple[float, ...]
    distance: float
    angle: float
    T: tuple[tuple[float, ...], ...]


@dataclass(frozen=True, slots=True)
class PostureList:
    """Every posture that takes a frame to a pose.

    Attributes:
        system: name of the mechanism.
        frame: that was taken there.
        T: the wanted pose, rows of (4, 4).
        names: of the coordinates.
        units: of the coordinates.
        locked: joints that stayed, with their positions.
        method: that found them.
        reason: why there is none; "" where there is one.
        rows: the postures, those near the seed first.
        nearest: the reachable pose next to the wanted one, where there is no posture.
        text: the same as a plain table.
    """

    system: str
    frame: str | int
    T: tuple[tuple[float, ...], ...]
    names: tuple[str, ...]
    units: tuple[str, ...]
    locked: tuple[tuple[str, float], ...]
    method: str
    reason: str
    rows: tuple[Posture, ...]
    nearest: Near | None
    text: str


def locked_by_default(
    system: System, frame: str | int | None = None, seed: Seed = None
) -> dict[str, float]:
    """The joints that are locked when nothing is said, as in a posture; none up to six joints."""
    name = terminal_frame(system) if frame is None else frame
    return held_at(system, surplus_joints(system, name), system.position(seed))


def postures(
    system: System,
    T: Any,
    frame: str | int | None = None,
    method: str = "auto",
    *,
    seed: Seed = None,
    locked: Mapping[str, float] | None = None,
    parameters: Values = None,
) -> PostureList:
    """Every posture that takes a frame to a pose, with and without loops.

    Args:
        system: the mechanism.
        T: (4, 4) the pose of the frame seen from the base [m].
        frame: a body, a named frame, the number of a link, or None for the terminal frame.
        method: one of `METHODS`. The general method is for six joints; of another chain "general"
            takes the search.
        seed: a posture from which distances count and that places joints beside the chain.
        locked: positions of joints that stay, by name; `locked_by_default` when left out.
        parameters: values of symbols, the others at their defaults.

    Raises:
        ModelError: T is no pose, or a name or method is unknown.
        NoClosedForm: Pieper's or Paul's method does not fit the mechanism.
    """
    name = terminal_frame(system) if frame is None else frame
    held = dict(locked_by_default(system, name, seed) if locked is None else locked)
    way = _method(system, name, method, held)
    found = inverse_geometry.solve(
        system, T, name, way, seed=seed, locked=held or None, parameters=parameters
    )
    limits = bounds(system)
    return PostureList(
        system=system.name,
        frame=name,
        T=_rows_of(np.asarray(T, dtype=float)),
        names=found.names,
        units=tuple(c.unit for c in system.coordinates),
        locked=tuple(held.items()),
        method=found.method,
        reason=found.reason,
        rows=tuple(_row(one, limits) for one in found),
        nearest=None if len(found) else _near(system, found, (name, T), seed, parameters),
        text=str(found),
    )


def _method(system: System, frame: str | int, method: str, held: Mapping[str, float]) -> str:
    free = [joint for joint in moving_joints(system, frame) if joint not in held]
    return "search" if method == "general" and free and len(free) != SIX else method


def _row(one: Solution, limits: CoordinateLimits) -> Posture:
    return Posture(
        q=_tuple(one.q),
        label=one.branch,
        residual=float(one.residual),
        sigma=float(one.sigma_min),
        multiplicity=one.multiplicity,
        within_limits=one.within_limits,
        outside=() if one.within_limits else tuple(limits.outside(one.q)),
        family=str(one.family) if one.family else "",
        windings=len(one.windings),
    )


def _near(
    system: System, found: Solutions, wanted: Any, seed: Seed, parameters: Values
) -> Near | None:
    """The nearest pose: of the chain alone, else with closed loops, from the seed downhill."""
    near = found.nearest
    if near is not None and np.all(np.isfinite(near.q)):
        return Near(_tuple(near.q), float(near.distance), float(near.angle), _rows_of(near.T))
    if not system.is_closed:
        return None
    frame, T = wanted
    aim = goal(system, frame, T, None, parameters)
    best = aim.approached(np.array(system.position(seed)))
    if not best.is_closed:
        return None
    distance, angle = aim.gap(best.q)
    q = _tuple(best.q)
    return Near(q, distance, angle, _rows_of(pose_of(system, q, frame, parameters)))


def _rows_of(T: Array) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(float(x) for x in row) for row in T)


def _tuple(q: Array) -> tuple[float, ...]:
    return tuple(float(x) for x in q)
