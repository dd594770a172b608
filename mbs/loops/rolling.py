"""Rolling discs: the row that keeps the rim on the plane, and the rows that forbid it to slip.

With n the normal of the plane, u the axis of the disc and s = |n x u|, the point that touches the
plane is at c = -r (n - (n.u) u) / s from the centre; the centre is r s above the plane, and the
velocity V + w x c of the point has no part in the plane.

Source: Neimark and Fufaev 1972, chapter 1.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import casadi
from casadi import DM, SX, Function

from mbs.assembly import System
from mbs.assembly.khalil_frames import Cut
from mbs.components import RollingDisc
from mbs.expressions import to_sx
from mbs.loops.cut_motion import cut_twist
from mbs.recursions.route import relative_pose
from mbs.spatial import Pose, align_z, cross

SLIPS = ("slip x", "slip y")
"""Labels of the rows of velocities, in axes whose z is the normal of the plane."""


@dataclass(frozen=True, slots=True, eq=False)
class Contact:
    """A disc on a plane, in axes whose z is the normal of the plane.

    Attributes:
        height: of the rim above the plane [m].
        point: (3, 1) from the centre to where the rim touches the plane [m].
    """

    height: SX
    point: SX


def contact(pose: Pose, disc: RollingDisc, radius: SX) -> Contact:
    """Where a disc touches the plane z = 0.

    Args:
        pose: of frame_b, the centre of the disc, in axes whose z is the normal.
        disc: its description.
        radius: of the rim [m].
    """
    u = casadi.mtimes(pose.R, SX(DM(list(disc.axis))))
    s = casadi.sqrt(u[0] * u[0] + u[1] * u[1])
    return Contact(
        pose.p[2] - radius * s, radius * casadi.vertcat(u[2] * u[0] / s, u[2] * u[1] / s, -s)
    )


def slip_rows(system: System, q: SX) -> list[tuple[str, SX]]:
    """The joint, and the rows (2, nv) on the velocities of the tree, of every rolling disc."""
    v = SX.sym("v", system.nv)
    result = []
    for cut, disc in rolling_discs(system):
        pose = pose_on_plane(system, q, cut, disc)
        V, w = cut_twist(system, pose, q, v)
        touching = contact(pose, disc, radius_of(system, disc)).point
        slip = V + cross(w, touching)
        result.append((disc.name, casadi.jacobian(slip[:2], v)))
    return result


def least_upright(system: System) -> Function:
    """``upright(q, p)``: the smallest sine between a rolling disc and its plane."""

    def build() -> Function:
        q = SX.sym("q", system.nq)
        sines = []
        for cut, disc in rolling_discs(system):
            u = casadi.mtimes(pose_on_plane(system, q, cut, disc).R, SX(DM(list(disc.axis))))
            sines.append(casadi.sqrt(u[0] * u[0] + u[1] * u[1]))
        return Function("upright", [q, system.p], [casadi.mmin(casadi.vertcat(*sines))])

    function: Function = system.cached("least upright", build)
    return function


def rolling_discs(system: System) -> Iterator[tuple[Cut, RollingDisc]]:
    """The rolling discs of a system and where they are."""
    for cut in system.cuts:
        if isinstance(cut.edge.joint, RollingDisc):
            yield cut, cut.edge.joint


def pose_on_plane(system: System, q: SX, cut: Cut, disc: RollingDisc) -> Pose:
    """Frame_b of a rolling disc in axes at frame_a whose z is the normal of the plane."""
    plane = Pose.turned(align_z(disc.normal))
    return plane.inverse() @ relative_pose(system.tree, q, *cut.frames)


def radius_of(system: System, disc: RollingDisc) -> SX:
    """The radius of the rim [m], a number or an expression of the parameters."""
    return to_sx(disc.radius, system.symbol_table)
