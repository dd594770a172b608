"""Closure equations of loops: constraint rows of each cut joint, and couplings of coordinates.

A closing joint allows some relative motions of its two frames. Its rows are zero if the frames
differ by such a motion only. Lengths are in metres; directions are cosines.

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

# Relative velocities of the frames of cut joints, from the rates of their poses.


def cut_twist(system: System, pose: Pose, q: SX, v: SX) -> tuple[SX, SX]:
    """Return the relative velocity and angular velocity (3, 1) of the two frames of a cut joint.

    Args:
        system: mechanism with closed loops.
        pose: pose of the frame at the positions q, such as frame_b relative to frame_a.
        q: (nq, 1) symbols of positions.
        v: (nv, 1) velocities of the tree.

    Returns:
        Both vectors in the axes of the reference frame of `pose` [m/s, rad/s].
    """
    rate = position_rate(system.tree, q, v)
    R_dot = casadi.reshape(casadi.jtimes(casadi.vec(pose.R), q, rate), 3, 3)
    spin = casadi.mtimes(R_dot, pose.R.T)
    return casadi.jtimes(pose.p, q, rate), casadi.vertcat(spin[2, 1], spin[0, 2], spin[1, 0])


# Rolling discs, which also constrain velocities.


def slip_rows(system: System, q: SX) -> list[tuple[str, SX]]:
    """Return all constraints on velocities only, as rows J (k, nv) of J v + g = 0.

    Args:
        system: mechanism with loops.
        q: (nq, 1) symbols of positions.

    Returns:
        Pairs of a name and rows. They belong to rolling discs (no slip), components, and massless
        nodes with dampers.
    """
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
    """Return the constant part g of the velocity rows of damped massless nodes; None without nodes.

    Args:
        system: mechanism with loops.
        q: (nq, 1) symbols of positions.
    """
    rows = velocity_balance_rows(system, q, SX.zeros(system.nv))
    return casadi.vertcat(*(row.value for _, row in rows[0][1])) if rows else None


def least_upright(system: System) -> Function:
    """Return ``upright(q, p)``: smallest sine of the angle between a rolling disc and its plane.

    Args:
        system: mechanism with at least one rolling disc.
    """

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
    """Yield the cut joint and the component of each rolling disc.

    Args:
        system: mechanism with or without rolling discs.
    """
    for cut in system.cuts:
        if isinstance(cut.edge.joint, RollingDisc):
            yield cut, cut.edge.joint


def pose_on_plane(system: System, q: SX, cut: Cut, disc: RollingDisc) -> Pose:
    """Return frame_b of a rolling disc relative to axes at frame_a with z normal to the plane.

    Args:
        system: mechanism with the disc.
        q: (nq, 1) positions.
        cut: cut joint of the disc.
        disc: component of the disc.
    """
    return disc.on_plane(relative_pose(system.tree, q, *cut.frames))


def closure_residual(system: System) -> Function:
    """Return ``closure(q) -> phi``: the closure residual, zero if all loops are closed.

    Args:
        system: mechanism with closed loops.

    Returns:
        Function of q (nq, 1); phi (m, 1) [m or 1], one element for each label of
        `system.loops[..].rows`, dependent rows included.
    """

    def build() -> tuple[Named, Named]:
        q = SX.sym("q", system.nq)
        return [("q", q)], [("phi", closure_rows(system, q))]

    return model_function(system, ("closure",), build)


def closure_rows(system: System, q: SX) -> SX:
    """Return all closure rows, (m, 1) [m or 1], dependent rows included.

    Args:
        system: mechanism with loops.
        q: (nq, 1) positions.
    """
    found = _equations(system)
    return casadi.substitute(found.rows, found.q, q)


def independent_closure(system: System, q: SX) -> SX:
    """Return the independent closure rows, (r, 1) [m or 1], as selected by the loop analysis.

    Args:
        system: mechanism with closed loops.
        q: (nq, 1) symbols of positions.

    Raises:
        ModelError: the system is an open chain.
    """
    if system.closure is None:
        raise ModelError(f"{system.name}: an open chain has no closure; use the open-chain models")
    return closure_rows(system, q)[list(system.closure.rows)]


def square_closure(system: System, q: SX, passive: Sequence[int], ties: SX | None = None) -> SX:
    """Return as many equations as passive positions, which are zero if the loops are closed.

    They are the independent rows. If no selection of rows is independent in all configurations,
    they are the gradient of half the sum of squares of all rows.

    Args:
        system: mechanism with closed loops.
        q: (nq, 1) symbols.
        passive: indices in q of the unknowns.
        ties: (k, 1) further equations for the independent rotation of an unknown quaternion.
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
    """Constraint rows of a loop, a coupling or a component.

    Attributes:
        name: name of the cut joint, the coupling or the component.
        positions: label and unit of each row that constrains positions.
        velocities: label and unit of each row that constrains velocities only.
    """

    name: str
    positions: tuple[tuple[str, str], ...]
    velocities: tuple[tuple[str, str], ...] = ()


def row_groups(system: System) -> tuple[RowGroup, ...]:
    """Return the constraint rows of all loops, couplings and components, in their order.

    Args:
        system: mechanism with loops.
    """

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
    """Return (group name, label, unit) of each row that constrains positions.

    Args:
        system: mechanism with loops.
    """
    return [(g.name, label, unit) for g in row_groups(system) for label, unit in g.positions]


def velocity_row_units(system: System) -> list[str]:
    """Return the unit of each velocity row after integration over time: "m" for m/s.

    Args:
        system: mechanism with loops.
    """
    return [unit for group in row_groups(system) for _, unit in group.velocities]


@dataclass(frozen=True, slots=True, eq=False)
class _Equations:
    """Closure equations of a system.

    Attributes:
        q: (nq, 1) symbols of positions.
        labels: label and unit of each row, by loop.
        rows: (m, 1) all rows.
        cosines: (k, 1) expressions that must be positive.
    """

    q: SX
    labels: list[tuple[str, list[tuple[str, str]]]]
    rows: SX
    cosines: SX


def _equations(system: System) -> _Equations:
    """Return the closure equations of loops, couplings, components and massless nodes."""

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
    """Return the unit of a row of a cut joint: 1 (cosine) for moments, m for forces."""
    return "1" if label.startswith("moment") else "m"


def facing(system: System, q: SX) -> SX:
    """Return cosines (k, 1) that must be positive for axes to be aligned and not opposed.

    The rows of a joint with an axis are zero for opposed axes too. Only a configuration with
    positive cosines is correct.

    Args:
        system: mechanism with loops.
        q: (nq, 1) positions.
    """
    found = _equations(system)
    return casadi.substitute(found.cosines, found.q, q)
