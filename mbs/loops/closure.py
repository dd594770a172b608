"""The equations that close the loops: rows of each cut joint, and couplings of coordinates.

Each closing joint allows some motion between its two frames; the rows say that nothing else
moves. Lengths are in metres, directions are cosines, so that a row is zero when closed.

Source: Khalil & Creusot 1997, section 3.4; rows by joint type as in Haug 1989, chapter 9.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import casadi
from casadi import SX, Function

from mbs.assembly import System
from mbs.assembly.khalil_frames import Cut
from mbs.assembly.model_function import Named, model_function
from mbs.assembly.tree import norms_of, position_rate
from mbs.components import Fixed, RollingDisc
from mbs.components.constraints import SLIPS
from mbs.components.custom import Row
from mbs.errors import ModelError
from mbs.loops.balance import balance_rows, velocity_balance_rows
from mbs.recursions.parts import PartsAt, part_rows
from mbs.recursions.route import relative_pose
from mbs.spatial import Pose, cross

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


# Rolling discs, which bind velocities too.


def slip_rows(system: System, q: SX) -> list[tuple[str, SX]]:
    """By name, the rows (k, nv) on velocities of every rolling disc and component that has some."""
    v = SX.sym("v", system.nv)
    result = []
    for cut, disc in rolling_discs(system):
        pose = pose_on_plane(system, q, cut, disc)
        V, w = cut_twist(system, pose, q, v)
        touching = disc.contact(pose, system.symbol_table).point
        slip = V + cross(w, touching)
        result.append((disc.name, casadi.jacobian(slip[:2], v)))
    for name, rows in part_rows(PartsAt(system, q, v), velocities=True):
        values = casadi.vertcat(*(row.value for _, row in rows))
        result.append((name, casadi.jacobian(values, v)))
    for name, rows in velocity_balance_rows(system, q, v):
        values = casadi.vertcat(*(row.value for _, row in rows))
        result.append((name, casadi.jacobian(values, v)))
    return result


def drift_rows(system: System, q: SX) -> SX | None:
    """Values of the rows of damped massless nodes at rest. None without such rows."""
    rows = velocity_balance_rows(system, q, SX.zeros(system.nv))
    return casadi.vertcat(*(row.value for _, row in rows[0][1])) if rows else None


def least_upright(system: System) -> Function:
    """``upright(q, p)``: the smallest sine between a rolling disc and its plane."""

    def build() -> Function:
        q = SX.sym("q", system.nq)
        sines = []
        for cut, disc in rolling_discs(system):
            pose = pose_on_plane(system, q, cut, disc)
            sines.append(disc.contact(pose, system.symbol_table).upright)
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
    return disc.on_plane(relative_pose(system.tree, q, *cut.frames))


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


@dataclass(frozen=True, slots=True)
class RowGroup:
    """The rows of a loop, a coupling or a component.

    Attributes:
        name: of the cut joint, the coupling or the component.
        positions: label and unit of each row that binds positions.
        velocities: likewise of those that bind velocities alone.
    """

    name: str
    positions: tuple[tuple[str, str], ...]
    velocities: tuple[tuple[str, str], ...] = ()


def row_groups(system: System) -> tuple[RowGroup, ...]:
    """The rows of all loops, couplings and components, in their order."""

    def build() -> tuple[RowGroup, ...]:
        slips = {
            disc.name: tuple((label, "m") for label in SLIPS) for _, disc in rolling_discs(system)
        }
        q, v = SX.sym("q", system.nq), SX.sym("v", system.nv)
        for name, rows in part_rows(PartsAt(system, q, v), velocities=True):
            slips[name] = tuple((label, row.unit) for label, row in rows)
        for name, rows in velocity_balance_rows(system, q, v):
            slips[name] = tuple((label, row.unit) for label, row in rows)
        groups = [
            RowGroup(name, tuple(rows), slips.pop(name, ()))
            for name, rows in _equations(system).labels
        ]
        return (*groups, *(RowGroup(name, (), rows) for name, rows in slips.items()))

    groups: tuple[RowGroup, ...] = system.cached("row groups", build)
    return groups


def position_rows(system: System) -> list[tuple[str, str, str]]:
    """Name of the group, label and unit of every row that binds positions."""
    return [(g.name, label, unit) for g in row_groups(system) for label, unit in g.positions]


def velocity_row_units(system: System) -> list[str]:
    """The unit of every row that binds velocities alone, as if it were integrated."""
    return [unit for group in row_groups(system) for _, unit in group.velocities]


@dataclass(frozen=True, slots=True, eq=False)
class _Equations:
    """What closes the loops, written once for a system.

    Attributes:
        q: (nq, 1) the symbols.
        labels: of the rows, each with its unit, by loop.
        rows: (m, 1) all of them.
        cosines: (k, 1) that must be positive.
    """

    q: SX
    labels: list[tuple[str, list[tuple[str, str]]]]
    rows: SX
    cosines: SX


def _equations(system: System) -> _Equations:
    def build() -> _Equations:
        q = SX.sym("q", system.nq)
        loops, cosines = list[tuple[str, list[tuple[str, Row]]]](), list[SX]()
        for cut in system.cuts:
            pose = relative_pose(system.tree, q, *cut.frames)
            joint = Fixed("weld") if cut.welded else cut.edge.joint
            rows = joint.closing_rows(pose, system.symbol_table)
            assert rows is not None  # else it is welded
            loops.append((cut.edge.joint.name, [(n, Row(x, _unit(n))) for n, x in rows]))
            cosines.extend(joint.facing(pose))
        for coupling in system.couplings:
            unit = "m" if system.coordinates[coupling.driven].unit == "m" else "1"
            value = q[coupling.driven] - coupling.value(q)
            loops.append((coupling.name, [("coordinate", Row(value, unit))]))
        parts = PartsAt(system, q)
        loops += part_rows(parts)
        loops += balance_rows(system, q)
        for part in system.parts:
            if part.element.has("positive"):
                cosines.extend(SX(x) for x in part.element.positive(parts.at(part)).values())
        labels = [(name, [(label, row.unit) for label, row in rows]) for name, rows in loops]
        values = [row.value for _, rows in loops for _, row in rows]
        every = casadi.densify(casadi.vertcat(SX(0, 1), *values))
        return _Equations(q, labels, every, casadi.vertcat(SX(0, 1), *cosines))

    equations: _Equations = system.cached("closure equations", build)
    return equations


def _unit(label: str) -> str:
    """The unit of a row of a cut joint: forces act along lengths, moments along cosines."""
    return "1" if label.startswith("moment") else "m"


def facing(system: System, q: SX) -> SX:
    """(k, 1) cosines that must be positive: axes that are aligned and not opposed.

    The rows of a joint with an axis are zero for opposed axes as well; a configuration is only
    right when these are positive.
    """
    found = _equations(system)
    return casadi.substitute(found.cosines, found.q, q)
