"""Constraints: what keeps a distance, a line, a plane or an orientation between two frames.

They connect as joints do but place nothing: no coordinate describes how one frame moves in the
other, so the assembly always cuts them and only their rows remain (`mbs.loops.closure`).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import casadi
from casadi import DM, SX

from mbs.components.component import SymbolTable, unit_axis
from mbs.components.joints import (
    Freedom,
    Joint,
    Rows,
    along_z,
    cosine,
    orientation_rows,
    position_rows,
)
from mbs.errors import DescriptionError
from mbs.expressions import Number, Scalar, to_float, to_sx
from mbs.spatial import Pose, align_z


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
    """A massless rod between spherical joints: the two origins keep their distance; 1 row.

    Attributes:
        length: between the two centres [m].
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

    def closing_rows(self, pose: Pose, symbols: SymbolTable) -> Rows:
        """Its effort is the force that pushes the ends apart; near zero it is the lengthening."""
        length = to_sx(self.length, symbols)
        return [("force along", (casadi.sumsqr(pose.p) - length**2) / (2 * length))]


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

    def closing_rows(self, pose: Pose, symbols: SymbolTable) -> Rows:
        """Nothing across the line."""
        return position_rows(along_z(pose, self.axis), "xy")


@dataclass(frozen=True, slots=True)
class PointOnPlane(_AxisConstraint):
    """The origin of frame_b stays in the plane through the origin of frame_a, normal to the axis.

    It closes a loop with 1 row.
    """

    def closing_rows(self, pose: Pose, symbols: SymbolTable) -> Rows:
        """Nothing along the normal."""
        return position_rows(along_z(pose, self.axis), "z")


@dataclass(frozen=True, slots=True)
class ConstantVelocity(_AxisConstraint):
    """A homokinetic joint: two shafts that meet at any angle rotate by the same angle; 4 rows.

    Its centre is the origin of both frames, and the axis is that of the shaft in each of them.
    """

    def closing_rows(self, pose: Pose, symbols: SymbolTable) -> Rows:
        """The origins agree, and frame_b is rotated about an axis in the plane x, y alone."""
        pose = along_z(pose, self.axis)
        return [*position_rows(pose, "xyz"), orientation_rows(pose)[2]]

    def facing(self, pose: Pose) -> list[SX]:
        """The shafts are not folded back onto each other."""
        return [0.5 * (casadi.trace(pose.R) - cosine(pose, self.axis))]


# Rolling without slip: a constraint on velocities that no constraint on positions implies.
#
# With n the normal of the plane, u the axis of the disc and s = |n x u|, the point that touches
# the plane is at c = -r (n - (n.u) u) / s from the centre; the centre is r s above the plane, and
# the velocity V + w x c of the point has no part in the plane.
#
# Source: Neimark and Fufaev 1972, chapter 1.


SLIPS = ("slip x", "slip y")
"""Labels of the rows of velocities, in axes whose z is the normal of the plane."""


@dataclass(frozen=True, slots=True, eq=False)
class RimContact:
    """A disc on a plane, in axes whose z is the normal of the plane.

    Attributes:
        height: of the rim above the plane [m].
        point: (3, 1) from the centre to where the rim touches the plane [m].
        upright: sine of the angle between the disc and the plane.
    """

    height: SX
    point: SX
    upright: SX


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

    def on_plane(self, pose: Pose) -> Pose:
        """Frame_b in axes at frame_a whose z is the normal of the plane."""
        return Pose.rotation(align_z(self.normal)).inverse() @ pose

    def contact(self, pose: Pose, symbols: SymbolTable) -> RimContact:
        """Where it touches the plane.

        Args:
            pose: of frame_b, the centre of the disc, in axes whose z is the normal.
            symbols: CasADi symbol of every parameter.
        """
        radius = to_sx(self.radius, symbols)
        u = casadi.mtimes(pose.R, SX(DM(list(self.axis))))
        s = casadi.sqrt(u[0] * u[0] + u[1] * u[1])
        point = radius * casadi.vertcat(u[2] * u[0] / s, u[2] * u[1] / s, -s)
        return RimContact(pose.p[2] - radius * s, point, s)

    def closing_rows(self, pose: Pose, symbols: SymbolTable) -> Rows:
        """The rim stays on the plane."""
        return [("force normal", self.contact(self.on_plane(pose), symbols).height)]
