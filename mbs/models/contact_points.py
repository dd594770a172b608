"""Points of links that planes may hold: where they are, how they move, what efforts act there."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from numbers import Real

import casadi
from casadi import DM, SX, Function

from mbs.assembly import System
from mbs.components.forces import RelativeMotion
from mbs.errors import ModelError
from mbs.messages import did_you_mean, quoted
from mbs.models.symbols import ModelSymbols
from mbs.recursions.accelerations import link_accelerations, resting_base
from mbs.recursions.frame_motion import relative_acceleration, relative_motion
from mbs.recursions.velocities import link_velocities
from mbs.spatial import zeros

Touching = Iterable[str] | Mapping[str, str]
"""Names of the points that stand; or for each name "fixed" or "sliding"."""

WAYS = ("fixed", "sliding")


@dataclass(frozen=True, slots=True)
class ContactPoint:
    """The origin of a frame, which may touch the plane x, y of another frame from above.

    Attributes:
        name: of the contact.
        frame: a body, a named frame, or the number of a link.
        plane: likewise, 0 for the base; its z points from the ground to the point.
        friction: coefficient of dry friction, None where the ground never lets the point slip.
    """

    name: str
    frame: str | int
    plane: str | int = 0
    friction: float | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name:
            raise ModelError(
                f"contact point {quoted(self.name)}: the name is not a text; give it a name"
            )
        mu = self.friction
        if mu is None:
            return
        if isinstance(mu, bool) or not isinstance(mu, Real) or not 0 <= mu < math.inf:
            raise ModelError(
                f"{quoted(self.name)}: friction is {quoted(mu)}; give a coefficient of zero or"
                " more, or None"
            )
        object.__setattr__(self, "friction", float(mu))


@dataclass(frozen=True, slots=True, eq=False)
class PointRows:
    """How n points move, seen from their planes and in the axes of these, 3 n elements each.

    Attributes:
        r: positions [m]; the third of each point is its distance from the plane.
        V: velocities [m/s].
        J: (3 n, nv), V = J v; the force on a point acts along the lines of its rows.
        bias: accelerations where those of the joints are zero [m/s^2].
    """

    r: SX
    V: SX
    J: SX
    bias: SX


def point_rows(system: System, s: ModelSymbols, points: Sequence[ContactPoint]) -> PointRows:
    """The motion of contact points.

    Args:
        system: open or closed.
        s: its symbols, in tree coordinates.
        points: one or more.

    Raises:
        ModelError: there is no such frame.
    """
    tree = system.tree
    moving = link_velocities(tree, s.poses, s.v)
    rest = SX.zeros(system.nv)
    drifting = link_accelerations(tree, s.poses, s.v, rest, resting_base(zeros()))
    seen: list[RelativeMotion] = []
    bias: list[SX] = []
    for point in points:
        plane, frame = system.frame(point.plane), system.frame(point.frame)
        motion = relative_motion(tree, plane, frame, s.q, moving)
        seen.append(motion)
        bias.append(relative_acceleration(motion, plane, frame, drifting).A)
    V = casadi.densify(casadi.vertcat(*(motion.V for motion in seen)))
    r = casadi.densify(casadi.vertcat(*(motion.p for motion in seen)))
    return PointRows(r, V, casadi.jacobian(V, s.v), casadi.densify(casadi.vertcat(*bias)))


def held_elements(ways: Sequence[str]) -> DM:
    """(3 n, 1) 1 for each element of the motion that the plane holds.

    Args:
        ways: of each point "fixed", "sliding" or "" where it is free.
    """
    held = {"fixed": (1, 1, 1), "sliding": (0, 0, 1), "": (0, 0, 0)}
    return DM([element for way in ways for element in held[way]])


def checked_points(name: str, points: Iterable[ContactPoint]) -> tuple[ContactPoint, ...]:
    """One or more points, each with a name of its own.

    Args:
        name: of the mechanism, for errors.
        points: that may touch.

    Raises:
        ModelError: there is none, two have one name, or something is no contact point.
    """
    every = tuple(points) if isinstance(points, Iterable) else (points,)
    for point in every:
        if not isinstance(point, ContactPoint):
            raise ModelError(
                f"{name}: {quoted(point)} is no contact point; give ContactPoint(name, frame)"
            )
    names = [point.name for point in every]
    if not every or len(set(names)) < len(names):
        raise ModelError(
            f"{name}: the contact points are {', '.join(names) or 'none'}; give one or more, each a"
            " name of its own"
        )
    return every


def ways_of(name: str, points: Sequence[ContactPoint], touching: Touching) -> tuple[str, ...]:
    """Of each point "fixed", "sliding" or "" where it is free.

    Args:
        name: of the mechanism, for errors.
        points: that may touch.
        touching: those that do.

    Raises:
        ModelError: there is no such point, one is named twice, or it touches in no known way.
    """
    names = [point.name for point in points]
    given = _ways_by_name(name, touching)
    for point, way in given.items():
        if point not in names:
            raise ModelError(
                f"{name}: there is no contact point {quoted(point)}; "
                + did_you_mean(str(point), names)
            )
        if way not in WAYS:
            raise ModelError(
                f"{name}: point {point!r} touches {quoted(way)}; use 'fixed' or 'sliding', or"
                " leave it out"
            )
    return tuple(given.get(point, "") for point in names)


def _ways_by_name(name: str, touching: Touching) -> dict[str, str]:
    """How each point touches that is named, each once."""
    if isinstance(touching, Mapping):
        return dict(touching)
    alone = isinstance(touching, str) or not isinstance(touching, Iterable)
    standing = [str(point) for point in ([touching] if alone else touching)]
    if len(set(standing)) < len(standing):
        raise ModelError(f"{name}: the points that touch are {', '.join(standing)}; name each once")
    return dict.fromkeys(standing, "fixed")


def friction_cone(name: str, points: Sequence[ContactPoint], sides: int | None) -> Function:
    """``cone(f) -> margin``; see `ContactPhases.friction`.

    Args:
        name: of the mechanism, for errors.
        points: a column of f (3, n) each.
        sides: of a pyramid, None for the cone.

    Raises:
        ModelError: a pyramid has fewer than three sides.
    """
    if sides is not None and (isinstance(sides, bool) or sides not in range(3, 1000)):
        raise ModelError(
            f"{name}: sides is {quoted(sides)}; give a number of sides from 3, or None for the cone"
        )
    f = SX.sym("f", 3, len(points))
    margins = [
        casadi.vertcat(f[2, k], _slip(f[:, k], point.friction, sides))
        for k, point in enumerate(points)
    ]
    return Function("cone", [f], [casadi.densify(casadi.vertcat(*margins))], ["f"], ["margin"])


def _slip(f: SX, friction: float | None, sides: int | None) -> SX:
    """How far a force is from the border of its cone."""
    if friction is None:
        return SX(0, 1)
    if sides is None:
        return (friction * f[2]) ** 2 - f[0] ** 2 - f[1] ** 2
    turns = 2 * casadi.pi / sides * casadi.DM(range(sides))
    reach = casadi.cos(casadi.pi / sides) * friction * f[2]
    return reach - casadi.cos(turns) * f[0] - casadi.sin(turns) * f[1]
