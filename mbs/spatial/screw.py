"""Elementary displacements: a turn about a coordinate axis with a translation along it.

A link frame of Khalil and Kleinfinger is two or three of them from its antecedent. A wrench or an
inertia is moved through one for a handful of multiplications, where a pose would cost dozens.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, Self, TypeVar

from casadi import SX

from mbs.spatial.rotation import MatrixTurn, Rotation, Turn, axis_turn
from mbs.spatial.vectors import cross, is_zero, zeros
from mbs.spatial.wrench import Wrench


class Movable(Protocol):
    """What is given about and in a frame: an inertia, or what is moved like one."""

    def turned(self, R: Rotation) -> Self:
        """The same about the same point in the axes of frame i."""

    def slid(self, axis: int, t: SX) -> Self:
        """The same displaced by t [m] along a coordinate axis."""


Thing = TypeVar("Thing", bound=Movable)


class Displacement(Protocol):
    """Where a frame j stands in a frame i."""

    @property
    def turn(self) -> Rotation:
        """The orientation of frame j seen from frame i."""

    def point(self, r: SX) -> SX:
        """A point of frame j, (3, 1), in frame i [m]."""

    def wrench(self, f: SX, m: SX) -> Wrench:
        """Force and moment about the origin of frame j, in frame j, about the origin of i in i."""

    def body(self, thing: Thing) -> Thing:
        """What is given about and in frame j, such as an inertia, about and in frame i."""


@dataclass(frozen=True, slots=True)
class Screw:
    """A turn about a coordinate axis and a translation along the same axis.

    Attributes:
        turn: about the axis.
        t: distance along the axis [m].
    """

    turn: Turn
    t: SX

    @staticmethod
    def about(axis: str, angle: SX, t: SX) -> Screw:
        """The screw by an angle [rad] and a distance [m] along the axis "x", "y" or "z"."""
        return Screw(axis_turn(axis, angle), SX(t))

    @property
    def axis(self) -> int:
        """0, 1 or 2 for x, y or z."""
        return self.turn.along

    def point(self, r: SX) -> SX:
        """A point of frame j, (3, 1), in frame i [m]."""
        moved = SX(self.turn.apply(r))
        moved[self.axis] += self.t
        return moved

    def wrench(self, f: SX, m: SX) -> Wrench:
        """Force and moment about the origin of frame j, in frame j, about the origin of i in i."""
        f, m = self.turn.apply(f), SX(self.turn.apply(m))
        if not self.t.is_zero():
            k, h = self.turn.across
            m[k] -= self.t * f[h]
            m[h] += self.t * f[k]
        return f, m

    def body(self, thing: Thing) -> Thing:
        """What is given about and in frame j, such as an inertia, about and in frame i."""
        return thing.turned(self.turn).slid(self.axis, self.t)


@dataclass(frozen=True, slots=True)
class FreeDisplacement:
    """Any translation, then any turn.

    Attributes:
        turn: orientation of frame j in frame i.
        p: (3, 1) origin of frame j in frame i [m].
    """

    turn: MatrixTurn
    p: SX

    def point(self, r: SX) -> SX:
        """A point of frame j, (3, 1), in frame i [m]."""
        return self.p + self.turn.apply(r)

    def wrench(self, f: SX, m: SX) -> Wrench:
        """Force and moment about the origin of frame j, in frame j, about the origin of i in i."""
        f, m = self.turn.apply(f), self.turn.apply(m)
        return f, m if is_zero(self.p) else m + cross(self.p, f)

    def body(self, thing: Thing) -> Thing:
        """What is given about and in frame j, such as an inertia, about and in frame i."""
        moved = thing.turned(self.turn)
        for axis in range(3):
            moved = moved.slid(axis, self.p[axis])
        return moved


def origin(steps: Sequence[Displacement]) -> SX:
    """(3, 1) where the last frame of successive displacements stands in the first [m]."""
    p = zeros()
    for step in reversed(steps):
        p = step.point(p)
    return p


def wrench_through(steps: Sequence[Displacement], f: SX, m: SX) -> Wrench:
    """Force and moment in the last frame of successive displacements, about and in the first."""
    for step in reversed(steps):
        f, m = step.wrench(f, m)
    return f, m


def body_through(steps: Sequence[Displacement], thing: Thing) -> Thing:
    """What is given about and in the last frame of successive displacements, in the first."""
    for step in reversed(steps):
        thing = step.body(thing)
    return thing
