"""Elementary displacements: a turn about a coordinate axis with a translation along it.

A link frame of Khalil and Kleinfinger is two or three of them from its antecedent. A wrench or an
inertia is moved through one for a handful of multiplications, where a pose would cost dozens.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, TypeVar

from casadi import SX

from mbs.spatial.inertia import Inertia
from mbs.spatial.pseudo_inertia import PseudoInertia
from mbs.spatial.rotation import MatrixTurn, Rotation, Turn, axis_turn
from mbs.spatial.vectors import cross, is_zero

Body = TypeVar("Body", Inertia, PseudoInertia)
"""A rigid body in either form of its ten parameters."""


class Displacement(Protocol):
    """Where a frame j stands in a frame i."""

    @property
    def turn(self) -> Rotation:
        """The orientation of frame j seen from frame i."""

    def point(self, r: SX) -> SX:
        """A point of frame j, (3, 1), in frame i [m]."""

    def wrench(self, f: SX, m: SX) -> tuple[SX, SX]:
        """Force and moment about the origin of frame j, in frame j, about the origin of i in i."""

    def body(self, inertia: Body) -> Body:
        """A body given about and in frame j, about and in frame i."""


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

    def wrench(self, f: SX, m: SX) -> tuple[SX, SX]:
        """Force and moment about the origin of frame j, in frame j, about the origin of i in i."""
        f, m = self.turn.apply(f), SX(self.turn.apply(m))
        if not self.t.is_zero():
            k, h = self.turn.across
            m[k] -= self.t * f[h]
            m[h] += self.t * f[k]
        return f, m

    def body(self, inertia: Body) -> Body:
        """A body given about and in frame j, about and in frame i."""
        return inertia.turned(self.turn).slid(self.axis, self.t)


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

    def wrench(self, f: SX, m: SX) -> tuple[SX, SX]:
        """Force and moment about the origin of frame j, in frame j, about the origin of i in i."""
        f, m = self.turn.apply(f), self.turn.apply(m)
        return f, m if is_zero(self.p) else m + cross(self.p, f)

    def body(self, inertia: Body) -> Body:
        """A body given about and in frame j, about and in frame i."""
        moved = inertia.turned(self.turn)
        for axis in range(3):
            moved = moved.slid(axis, self.p[axis])
        return moved
