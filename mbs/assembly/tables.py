"""The tables of a system: what a script reads to know its coordinates, bodies and loops."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from casadi import SX

from mbs.assembly.tree import Tree
from mbs.components import Box, Cylinder, Joint
from mbs.components.motion import Motion
from mbs.spatial import Pose

Places = Mapping[tuple[str, str], tuple[int, Pose]]
"""Link and pose of every body, by its name and "", and of the frames "a" and "b" of every joint."""

_POSITIONS = {
    Motion.REVOLUTE: (("", "revolute", "rad"),),
    Motion.PRISMATIC: (("", "prismatic", "m"),),
    Motion.SPHERICAL: tuple((k, "quaternion", "1") for k in ("qw", "qx", "qy", "qz")),
    Motion.FREE: (
        *((k, "translation", "m") for k in "xyz"),
        *((k, "quaternion", "1") for k in ("qw", "qx", "qy", "qz")),
    ),
}
_VELOCITIES = {
    Motion.REVOLUTE: (("", "revolute", "rad/s"),),
    Motion.PRISMATIC: (("", "prismatic", "m/s"),),
    Motion.SPHERICAL: tuple((k, "rotation", "rad/s") for k in ("wx", "wy", "wz")),
    Motion.FREE: (
        *((k, "translation", "m/s") for k in ("vx", "vy", "vz")),
        *((k, "rotation", "rad/s") for k in ("wx", "wy", "wz")),
    ),
}
EFFORT_UNIT = {"rad/s": "N.m", "m/s": "N"}
"""Unit of the effort that does work with a velocity of this unit."""

RATE_UNIT = {"m": "m/s", "rad": "rad/s", "1": "1/s"}
"""Unit of the rate of a position of this unit."""

ACCELERATION_UNIT = {"rad/s": "rad/s2", "m/s": "m/s2"}
"""Unit of the rate of a velocity of this unit."""


@dataclass(frozen=True, slots=True)
class Coordinate:
    """One element of q or of v.

    Attributes:
        name: the joint's name, with a suffix when the joint has several coordinates.
        kind: revolute, prismatic, translation, rotation or quaternion.
        unit: of its value.
        joint: name of the joint it belongs to.
        actuated: whether a motor drives it.
        cut: whether its joint is cut, so that it is not in q.
        limits: (lower, upper), or None.
        effort: of an element of v, (lower, upper) of the effort of its motor, or None.
    """

    name: str
    kind: str
    unit: str
    joint: str
    actuated: bool
    cut: bool = False
    limits: tuple[float, float] | None = None
    effort: tuple[float, float] | None = None


@dataclass(frozen=True, slots=True)
class LinkRow:
    """A link of the tree and the Khalil parameters of its frame.

    Attributes:
        number: of the link, from 1.
        name: of the motion that moves it.
        antecedent: number of the link it is placed on, 0 for the base.
        motion: revolute, prismatic, spherical or free.
        gamma, b, alpha, d, theta, r: placement at the zero position [rad, m]; numbers, or
            expressions where a symbol is in them.
        via: the same six of fixed frames between the antecedent and the placement; the link is
            placed on the last of them. There are none where one frame says it.
    """

    number: int
    name: str
    antecedent: int
    motion: str
    gamma: float | SX
    b: float | SX
    alpha: float | SX
    d: float | SX
    theta: float | SX
    r: float | SX
    via: tuple[tuple[float | SX, ...], ...] = ()


@dataclass(frozen=True, slots=True)
class BodyRow:
    """A body of the description and where it is.

    Attributes:
        name: of the body.
        link: number of the link that carries it, from 1.
        mass: [kg], None when a symbol without value is in it.
        solid: the body itself where it was described by its dimensions.
    """

    name: str
    link: int
    mass: float | None
    solid: Box | Cylinder | None = None


@dataclass(frozen=True, slots=True)
class LoopRow:
    """A closed loop, or a coupling of coordinates.

    Attributes:
        name: of the joint that was cut, or of the coupling.
        closing: kind of the closing joint in lower case, or "coupling".
        joints: joints in the loop that remain in the tree.
        rows: label of every closure row, such as "j3: force x".
        dropped: those rows that depend on the others.
    """

    name: str
    closing: str
    joints: tuple[str, ...]
    rows: tuple[str, ...]
    dropped: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Closure:
    """How the loops of a system constrain its velocities.

    Attributes:
        rows: numbers of the independent closure rows.
        slips: numbers of the independent rows of rolling discs, which bind velocities alone.
        active: numbers of the independent velocities.
        passive: numbers of the velocities that follow from them.
        motors: numbers of the velocities whose efforts drive the mechanism: the active ones, or
            where there are more motors than these, or others, the motors.
        free: numbers of the velocities whose positions may be chosen: the active ones, and what
            rolling discs alone hold.
        varies: whether the dropped rows follow from the kept ones in a way that changes with the
            posture, so that other rows may be independent elsewhere.
        gruebler: mobility by the Gruebler-Kutzbach count of rows.
        residual: largest closure residual at the assembled posture.
    """

    rows: tuple[int, ...]
    slips: tuple[int, ...]
    active: tuple[int, ...]
    passive: tuple[int, ...]
    motors: tuple[int, ...]
    free: tuple[int, ...]
    varies: bool
    gruebler: int
    residual: float

    @property
    def mobility(self) -> int:
        """Number of independent velocities."""
        return len(self.active)


def link_rows(tree: Tree) -> tuple[LinkRow, ...]:
    """The links and the parameters of their frames."""
    rows = []
    for number, link in enumerate(tree.links, start=1):
        *via, (gamma, b, alpha, d, theta, r) = (
            tuple(float(x) if x.is_constant() else x for x in frame.parameters)
            for frame in link.frames
        )
        before, motion = link.antecedent + 1, link.motion.value
        rows.append(
            LinkRow(number, link.name, before, motion, gamma, b, alpha, d, theta, r, tuple(via))
        )
    return tuple(rows)


def position_coordinates(
    links: Sequence[tuple[Motion, str, Joint]], actuated: Sequence[bool], *, cut: bool = False
) -> tuple[Coordinate, ...]:
    """The elements of q of motions given as (motion, name, joint)."""
    return _coordinates(_POSITIONS, links, actuated, cut)


def velocity_coordinates(
    links: Sequence[tuple[Motion, str, Joint]], actuated: Sequence[bool]
) -> tuple[Coordinate, ...]:
    """The elements of v of motions given as (motion, name, joint)."""
    rows = _coordinates(_VELOCITIES, links, actuated, False)
    described = {joint.name: joint for _, _, joint in links}
    return tuple(
        replace(row, limits=described[row.joint].velocity, effort=described[row.joint].effort)
        for row in rows
    )


def _coordinates(
    table: dict[Motion, tuple[tuple[str, str, str], ...]],
    links: Sequence[tuple[Motion, str, Joint]],
    actuated: Sequence[bool],
    cut: bool,
) -> tuple[Coordinate, ...]:
    rows = []
    for (motion, name, joint), driven in zip(links, actuated, strict=True):
        limits = dict(joint.limits or ())
        for suffix, kind, unit in table[motion]:
            full = f"{name}.{suffix}" if suffix else name
            interval = limits.get(name.removeprefix(joint.name).removeprefix("."))
            bounded = interval if unit in ("rad", "m") and not suffix else None
            rows.append(Coordinate(full, kind, unit, joint.name, driven, cut, bounded))
    return tuple(rows)
