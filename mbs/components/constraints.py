"""Constraints: what keeps a distance, a line, a plane or a turn between two frames.

They connect as joints do but place nothing: no coordinate describes how one frame moves in the
other, so the assembly always cuts them and only their rows remain (`mbs.loops.closure`).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from mbs.components.component import unit_axis
from mbs.components.joints import Freedom, Joint
from mbs.errors import DescriptionError
from mbs.expressions import Number, Scalar, to_float


@dataclass(frozen=True, slots=True)
class Constraint(Joint):
    """Rows between two frames that joints elsewhere place; it has no coordinate itself."""

    def __post_init__(self) -> None:
        Joint.__post_init__(self)
        given = [name for name in ("Fv", "Fs", "Ia") if getattr(self, name) != Number(0.0)]
        for name in [*(["actuated"] if self.actuated else []), *given]:
            raise DescriptionError(
                f"{self.name}: {name} is given, but a {type(self).__name__} has no coordinate that"
                " it could act on; give it to the joints that move the bodies"
            )

    @property
    def freedoms(self) -> tuple[Freedom, ...]:
        """None that coordinates describe."""
        return ()

    @property
    def places(self) -> bool:
        """Never: what it connects is placed by other joints."""
        return False


@dataclass(frozen=True, slots=True)
class Rod(Constraint):
    """A massless rod with a ball at each end: the two origins keep their distance; 1 row.

    Attributes:
        length: from ball to ball [m].
    """

    length: Scalar = field(kw_only=True)

    def __post_init__(self) -> None:
        self._normalise("length")
        length = to_float(self.length)
        if length is not None and length <= 0:
            raise DescriptionError(
                f"{self.name}: length is {length:g} m; give more than zero, or connect the two"
                " points by a Spherical joint"
            )
        Constraint.__post_init__(self)


@dataclass(frozen=True, slots=True)
class _AxisConstraint(Constraint):
    """A constraint with an axis: "x", "y", "z", "-x" .. or three numbers, in frame_a."""

    axis: Any = "z"

    def __post_init__(self) -> None:
        object.__setattr__(self, "axis", unit_axis(self.name, self.axis))
        Constraint.__post_init__(self)


@dataclass(frozen=True, slots=True)
class PointOnLine(_AxisConstraint):
    """The origin of frame_b stays on the axis, a line through the origin of frame_a; 2 rows."""


@dataclass(frozen=True, slots=True)
class PointOnPlane(_AxisConstraint):
    """The origin of frame_b stays in the plane through the origin of frame_a, normal to the axis.

    It closes a loop with 1 row.
    """


@dataclass(frozen=True, slots=True)
class ConstantVelocity(_AxisConstraint):
    """A homokinetic joint: two shafts that meet at any angle turn by the same angle; 4 rows.

    Its centre is the origin of both frames, and the axis is that of the shaft in each of them.
    """


# Rolling without slip: a constraint on velocities that no constraint on positions implies.


@dataclass(frozen=True, slots=True)
class RollingDisc(Constraint):
    """A thin disc that touches a plane with its rim and rolls on it without slipping.

    One row of positions, the rim stays on the plane, and two of velocities: the point of the disc
    that touches the plane does not move in it. Frame_a lies in the plane; the origin of frame_b
    is the centre of the disc. The wheel itself, its mass and its axle are bodies and joints.

    Attributes:
        radius: of the rim [m].
        normal: of the plane, on the side where the disc is, in frame_a.
        axis: about which the disc spins, in frame_b.
    """

    radius: Scalar = field(kw_only=True)
    normal: Any = "z"
    axis: Any = "y"

    def __post_init__(self) -> None:
        self._normalise("radius")
        radius = to_float(self.radius)
        if radius is not None and radius <= 0:
            raise DescriptionError(f"{self.name}: radius is {radius:g} m; give more than zero")
        for name in ("normal", "axis"):
            object.__setattr__(self, name, unit_axis(self.name, getattr(self, name)))
        Constraint.__post_init__(self)
