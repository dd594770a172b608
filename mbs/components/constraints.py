"""Constraints on a distance, a line, a plane or an orientation between two frames.

They are connected as joints are, but have no coordinates. Joints must determine the pose of both
frames. The assembly always cuts constraints and adds their rows (`mbs.loops.closure_residual`).
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
    """Base of constraint rows between two frames whose poses are determined by joints."""

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
        """Empty: a constraint has no coordinates."""
        return ()

    @property
    def places(self) -> bool:
        """False: other joints must determine the poses of frame_a and frame_b."""
        return False


@dataclass(frozen=True, slots=True)
class Rod(Constraint):
    """A massless rod between spherical joints: constant distance of the two origins; 1 row.

    Attributes:
        length: distance of the two centres [m].
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
        """Return the row "force along": (distance^2 - length^2) / (2 length) [m].

        It is the elongation to first order. Its effort is the force that pushes the two origins
        apart [N].

        Args:
            pose: pose of frame_b relative to frame_a.
            symbols: CasADi symbol of each parameter, by name.
        """
        length = to_sx(self.length, symbols)
        return [("force along", (casadi.sumsqr(pose.p) - length**2) / (2 * length))]


@dataclass(frozen=True, slots=True)
class _AxisConstraint(Constraint):
    """Base of constraints with an axis in frame_a.

    Attributes:
        axis: "x", "y", "z", "-x", "-y", "-z", or three numbers.
    """

    axis: Any = "z"

    def __post_init__(self) -> None:
        object.__setattr__(self, "axis", unit_axis(self.name, self.axis))
        Constraint.__post_init__(self)


@dataclass(frozen=True, slots=True)
class PointOnLine(_AxisConstraint):
    """The origin of frame_b stays on the axis, a line through the origin of frame_a; 2 rows."""

    def closing_rows(self, pose: Pose, symbols: SymbolTable) -> Rows:
        """Return two rows: position of the origin of frame_b across the line [m].

        The rows are "force x" and "force y" in axes whose z is `axis`.

        Args:
            pose: pose of frame_b relative to frame_a.
            symbols: CasADi symbol of each parameter, by name.
        """
        return position_rows(along_z(pose, self.axis), "xy")


@dataclass(frozen=True, slots=True)
class PointOnPlane(_AxisConstraint):
    """The origin of frame_b stays in the plane through the origin of frame_a, normal to the axis.

    It closes a loop with 1 row.
    """

    def closing_rows(self, pose: Pose, symbols: SymbolTable) -> Rows:
        """Return the row "force z": height of the origin of frame_b above the plane [m].

        z is `axis`, the normal of the plane.

        Args:
            pose: pose of frame_b relative to frame_a.
            symbols: CasADi symbol of each parameter, by name.
        """
        return position_rows(along_z(pose, self.axis), "z")


@dataclass(frozen=True, slots=True)
class ConstantVelocity(_AxisConstraint):
    """A homokinetic joint: two shafts at any angle, with the same rotation; 4 rows.

    Its centre is the origin of both frames, and the axis is the shaft axis in each frame.
    """

    def closing_rows(self, pose: Pose, symbols: SymbolTable) -> Rows:
        """Return four rows: coincident origins, and no rotation component about the axis.

        frame_b is then rotated relative to frame_a about a line normal to `axis` only.

        Args:
            pose: pose of frame_b relative to frame_a.
            symbols: CasADi symbol of each parameter, by name.
        """
        pose = along_z(pose, self.axis)
        return [*position_rows(pose, "xyz"), orientation_rows(pose)[2]]

    def facing(self, pose: Pose) -> list[SX]:
        """Return a number that is positive if the shafts are not folded back onto each other.

        It is (trace(R) - axis' R axis) / 2.

        R is the orientation of frame_b in frame_a. Negative values also satisfy the rows, but with
        the shafts folded back onto each other.

        Args:
            pose: pose of frame_b relative to frame_a.
        """
        return [0.5 * (casadi.trace(pose.R) - cosine(pose, self.axis))]


# Rolling without slip: a nonholonomic constraint on velocities.
#
# With the normal n of the plane, the axis u of the disc and s = |n x u|, the contact point is at
# c = -r (n - (n.u) u) / s from the centre, and the centre is r s above the plane. The velocity
# V + w x c of the contact point has no component in the plane.
#
# Source: Neimark and Fufaev 1972, chapter 1.


SLIPS = ("slip x", "slip y")
"""Labels of the velocity rows, in axes whose z is the normal of the plane."""


@dataclass(frozen=True, slots=True, eq=False)
class RimContact:
    """Contact of a disc with a plane, in axes whose z is the normal of the plane.

    Attributes:
        height: height of the lowest rim point above the plane [m].
        point: (3, 1) vector from the centre to the contact point of the rim [m].
        upright: sine of the angle between the disc and the plane.
    """

    height: SX
    point: SX
    upright: SX


@dataclass(frozen=True, slots=True)
class RollingDisc(Constraint):
    """A thin disc that rolls with its rim on a plane without slipping.

    One row on positions keeps the rim on the plane. Two rows on velocities keep the contact point
    of the disc at rest in the plane. Frame_a is in the plane; the origin of frame_b is the centre
    of the disc. The wheel itself, its mass and its axle are bodies and joints.

    Attributes:
        radius: radius of the rim [m].
        normal: normal of the plane, on the side of the disc, in frame_a.
        axis: spin axis of the disc, in frame_b.
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
        """Return the pose of frame_b in axes at the origin of frame_a whose z is `normal`."""
        return Pose.rotation(align_z(self.normal)).inverse() @ pose

    def contact(self, pose: Pose, symbols: SymbolTable) -> RimContact:
        """Return height, contact point and inclination of the disc, in axes whose z is the normal.

        Args:
            pose: pose of frame_b, at the centre of the disc, in axes whose z is the normal.
            symbols: CasADi symbol of every parameter.
        """
        radius = to_sx(self.radius, symbols)
        u = casadi.mtimes(pose.R, SX(DM(list(self.axis))))
        s = casadi.sqrt(u[0] * u[0] + u[1] * u[1])
        point = radius * casadi.vertcat(u[2] * u[0] / s, u[2] * u[1] / s, -s)
        return RimContact(pose.p[2] - radius * s, point, s)

    def closing_rows(self, pose: Pose, symbols: SymbolTable) -> Rows:
        """Return the row "force normal": height of the lowest rim point above the plane [m].

        Args:
            pose: pose of frame_b relative to frame_a.
            symbols: CasADi symbol of each parameter, by name.
        """
        return [("force normal", self.contact(self.on_plane(pose), symbols).height)]
