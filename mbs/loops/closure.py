"""The equations that close the loops: rows of each cut joint, and couplings of coordinates.

Each closing joint allows some motion between its two frames; the rows say that nothing else
moves. Lengths are in metres, directions are cosines, so that a row is zero when closed.

Source: Khalil & Creusot 1997, section 3.4; rows by joint type as in Haug 1989, chapter 9.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import casadi
from casadi import DM, SX, Function

from mbs.assembly import System
from mbs.assembly.khalil_frames import Cut
from mbs.assembly.model_function import Named, model_function
from mbs.assembly.tree import norms_of, position_rate
from mbs.components import (
    ConstantVelocity,
    Cylindrical,
    Fixed,
    Free,
    Planar,
    PointOnLine,
    PointOnPlane,
    Prismatic,
    Revolute,
    Rod,
    RollingDisc,
    Spherical,
    Universal,
)
from mbs.errors import ModelError
from mbs.expressions import to_sx
from mbs.recursions.route import relative_pose
from mbs.spatial import Pose, align_z, cross

# How frames of cut joints move: velocities from the rates of their poses.


def cut_twist(system: System, pose: Pose, q: SX, v: SX) -> tuple[SX, SX]:
    """Velocity (3, 1) of the origin and angular velocity (3, 1) of a frame seen from another one.

    Args:
        system: with closed loops.
        pose: of the frame at the positions q, such as that of frame_b seen from frame_a.
        q: (nq, 1) symbols of positions.
        v: (nv, 1) velocities of the tree.

    Returns:
        both in the axes from which the frame is seen [m/s, rad/s].
    """
    rate = position_rate(system.tree, q, v)
    R_dot = casadi.reshape(casadi.jtimes(casadi.vec(pose.R), q, rate), 3, 3)
    spin = casadi.mtimes(R_dot, pose.R.T)
    return casadi.jtimes(pose.p, q, rate), casadi.vertcat(spin[2, 1], spin[0, 2], spin[1, 0])


# Rolling discs: the row that keeps the rim on the plane, and the rows that forbid it to slip.
#
# With n the normal of the plane, u the axis of the disc and s = |n x u|, the point that touches
# the plane is at c = -r (n - (n.u) u) / s from the centre; the centre is r s above the plane, and
# the velocity V + w x c of the point has no part in the plane.
#
# Source: Neimark and Fufaev 1972, chapter 1.


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
    plane = Pose.rotation(align_z(disc.normal))
    return plane.inverse() @ relative_pose(system.tree, q, *cut.frames)


def radius_of(system: System, disc: RollingDisc) -> SX:
    """The radius of the rim [m], a number or an expression of the parameters."""
    return to_sx(disc.radius, system.symbol_table)


Rows = list[tuple[str, SX]]
"""Label and value of each row."""


def closure(system: System) -> Function:
    """``closure(q) -> phi``: zero when every loop is closed.

    Returns:
        Function of q (nq, 1); phi (m, 1) [m or 1], one element for each label of
        `system.loops[..].rows`, dependent rows included.
    """

    def build() -> tuple[Named, Named]:
        q = SX.sym("q", system.nq)
        return [("q", q)], [("phi", closure_rows(system, q))]

    return model_function(system, ("closure",), build)


def closure_rows(system: System, q: SX) -> SX:
    """(m, 1) all closure rows at the positions q, (nq, 1)."""
    found = _equations(system)
    return casadi.substitute(found.rows, found.q, q)


def independent_closure(system: System, q: SX) -> SX:
    """(r, 1) the closure rows that the analysis kept, at the symbols q."""
    if system.closure is None:
        raise ModelError(f"{system.name}: an open chain has no closure; use the open-chain models")
    return closure_rows(system, q)[list(system.closure.rows)]


def square_closure(system: System, q: SX, passive: Sequence[int], ties: SX | None = None) -> SX:
    """As many equations as passive positions that are zero where the loops are closed.

    They are the independent rows; where no choice of rows is independent everywhere, the slopes
    of the sum of the squares of all rows.

    Args:
        system: with closed loops.
        q: (nq, 1) symbols.
        passive: numbers of the positions to be solved for.
        ties: (k, 1) further equations, where a quaternion is solved for that may turn.
    """
    norms = [norm for part, norm in norms_of(system.tree, q) if part.start in passive]
    more = casadi.vertcat(SX(0, 1), *norms, SX(0, 1) if ties is None else ties)
    if system.closure is None or not system.closure.varies:
        return casadi.vertcat(independent_closure(system, q), more)
    rows = casadi.vertcat(closure_rows(system, q), more)
    slopes = casadi.jacobian(rows, q)[:, list(passive)]
    return casadi.densify(casadi.mtimes(slopes.T, rows))


def row_labels(system: System) -> list[tuple[str, list[str]]]:
    """For each loop and coupling its name and what its rows are."""
    return _equations(system).labels


@dataclass(frozen=True, slots=True, eq=False)
class _Equations:
    """What closes the loops, written once for a system.

    Attributes:
        q: (nq, 1) the symbols.
        labels: of the rows, by loop.
        rows: (m, 1) all of them.
        cosines: (k, 1) that must be positive.
    """

    q: SX
    labels: list[tuple[str, list[str]]]
    rows: SX
    cosines: SX


def _equations(system: System) -> _Equations:
    def build() -> _Equations:
        q = SX.sym("q", system.nq)
        loops, cosines = list[tuple[str, Rows]](), list[SX]()
        for cut in system.cuts:
            pose = relative_pose(system.tree, q, *cut.frames)
            loops.append((cut.edge.joint.name, _cut_rows(system, q, cut, pose)))
            cosines.extend(_facing(cut, pose))
        for coupling in system.couplings:
            value = q[coupling.driven] - coupling.value(q)
            loops.append((coupling.name, [("coordinate", value)]))
        labels = [(name, [label for label, _ in rows]) for name, rows in loops]
        values = [value for _, rows in loops for _, value in rows]
        every = casadi.densify(casadi.vertcat(SX(0, 1), *values))
        return _Equations(q, labels, every, casadi.vertcat(SX(0, 1), *cosines))

    equations: _Equations = system.cached("closure equations", build)
    return equations


def facing(system: System, q: SX) -> SX:
    """(k, 1) cosines that must be positive: axes that are aligned and not opposed.

    The rows of a joint with an axis are zero for opposed axes as well; a configuration is only
    right when these are positive.
    """
    found = _equations(system)
    return casadi.substitute(found.cosines, found.q, q)


def _facing(cut: Cut, pose: Pose) -> list[SX]:
    joint = cut.edge.joint
    if cut.welded or isinstance(joint, (Fixed, Prismatic)):
        return [pose.R[k, k] for k in range(3)]
    if isinstance(joint, ConstantVelocity):
        return [0.5 * (casadi.trace(pose.R) - _along(pose, joint.axis))]
    if isinstance(joint, (Revolute, Cylindrical, Planar)):
        return [_along(pose, joint.axis)]
    return []


def _along(pose: Pose, axis: Sequence[float]) -> SX:
    """Cosine between an axis of frame_b and the same axis of frame_a."""
    z = SX(DM(list(axis)))
    return casadi.dot(z, casadi.mtimes(pose.R, z))


def _cut_rows(system: System, q: SX, cut: Cut, pose: Pose) -> Rows:
    """The rows of a cut joint, whose frame_b has this pose in its frame_a."""
    joint = cut.edge.joint
    if isinstance(joint, RollingDisc):
        on_plane = pose_on_plane(system, q, cut, joint)
        return [("force normal", contact(on_plane, joint, radius_of(system, joint)).height)]
    if cut.welded:
        return [*_position(pose, "xyz"), *_orientation(pose)]
    if isinstance(joint, Rod):
        return _rod(pose, to_sx(joint.length, system.symbol_table))
    axis = getattr(joint, "axis", (0.0, 0.0, 1.0))
    inside = Pose.rotation(align_z(axis))
    along = inside.inverse() @ pose @ inside
    return _ROWS[type(joint)](along, joint)


def _rod(pose: Pose, length: SX) -> Rows:
    """Its effort is the force that pushes the ends apart; near zero the row is the lengthening."""
    return [("force along", (casadi.sumsqr(pose.p) - length**2) / (2 * length))]


def _position(pose: Pose, axes: str) -> Rows:
    return [(f"force {axis}", pose.p["xyz".index(axis)]) for axis in axes]


def _tilt(pose: Pose) -> Rows:
    """The z axis of frame_b has no part along x and y of frame_a."""
    return [("moment y", pose.R[0, 2]), ("moment x", pose.R[1, 2])]


def _orientation(pose: Pose) -> Rows:
    R = pose.R
    return [
        ("moment x", 0.5 * (R[2, 1] - R[1, 2])),
        ("moment y", 0.5 * (R[0, 2] - R[2, 0])),
        ("moment z", 0.5 * (R[1, 0] - R[0, 1])),
    ]


def _universal(pose: Pose, joint: Universal) -> Rows:
    first, second = (SX(DM(list(axis))) for axis in joint.axes)
    cosine = casadi.dot(first, casadi.mtimes(pose.R, second))
    return [*_position(pose, "xyz"), ("moment across", cosine)]


def _same_turn(pose: Pose) -> Rows:
    """Frame_b is turned about an axis in the plane x, y of frame_a, so that it has not spun."""
    return [("moment z", 0.5 * (pose.R[1, 0] - pose.R[0, 1]))]


_ROWS: dict[type, Callable[[Pose, object], Rows]] = {
    Revolute: lambda pose, joint: [*_position(pose, "xyz"), *_tilt(pose)],
    Prismatic: lambda pose, joint: [*_position(pose, "xy"), *_orientation(pose)],
    Cylindrical: lambda pose, joint: [*_position(pose, "xy"), *_tilt(pose)],
    Planar: lambda pose, joint: [*_position(pose, "z"), *_tilt(pose)],
    Spherical: lambda pose, joint: _position(pose, "xyz"),
    PointOnLine: lambda pose, joint: _position(pose, "xy"),
    PointOnPlane: lambda pose, joint: _position(pose, "z"),
    ConstantVelocity: lambda pose, joint: [*_position(pose, "xyz"), *_same_turn(pose)],
    Universal: lambda pose, joint: _universal(pose, joint),  # type: ignore[arg-type]
    Fixed: lambda pose, joint: [*_position(pose, "xyz"), *_orientation(pose)],
    Free: lambda pose, joint: [],
}
