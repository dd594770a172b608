"""Constraints of loops on velocities and accelerations, J(q) v + g = 0, and constraint wrenches.

The rows of J are the closure rows, then velocity rows, such as the no-slip rows of rolling discs.

Source: Khalil & Creusot 1997, eq. 11 and 14.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import casadi
import numpy as np
from casadi import DM, SX, Function
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.assembly.model_function import Named, model_function
from mbs.assembly.tree import position_rate
from mbs.loops.closing import mechanism_size
from mbs.loops.closure_equations import (
    closure_rows,
    drift_rows,
    independent_closure,
    pose_on_plane,
    position_rows,
    rolling_discs,
    row_groups,
    slip_rows,
    velocity_row_units,
)
from mbs.recursions.force_elements import sum_wrenches
from mbs.recursions.parts import PartsAt
from mbs.recursions.route import relative_pose
from mbs.spatial import Pose, Wrench, add_wrenches, cross, skew, transform_wrench, vector


def closure_jacobian(system: System) -> Function:
    """Return ``closure_jacobian(q) -> J``: all constraint rows J (m, nv), which act on v.

    Args:
        system: mechanism with closed loops.

    Returns:
        Function of q (nq, 1); J (m, nv) [m/rad, 1 or 1/m].
    """

    def build() -> tuple[Named, Named]:
        q = SX.sym("q", system.nq)
        return [("q", q)], [("J", constraint_rows(system, q))]

    return model_function(system, ("closure_jacobian",), build)


def constraint_rows(system: System, q: SX) -> SX:
    """Return all constraint rows J (m, nv), which act on the velocities v.

    Args:
        system: mechanism with closed loops.
        q: (nq, 1) symbols of positions.
    """
    slips = [rows for _, rows in slip_rows(system, q)]
    return casadi.vertcat(velocity_rows(system, q, closure_rows(system, q)), *slips)


def constraint_drift(system: System, q: SX) -> SX | None:
    """Return the drift g (m, 1) of all rows J v + g = 0; None if all rows are J v = 0.

    Args:
        system: mechanism with closed loops.
        q: (nq, 1) symbols of positions.
    """
    drift = drift_rows(system, q)
    if drift is None:
        return None
    others = len(position_rows(system)) + len(velocity_row_units(system)) - drift.numel()
    return casadi.vertcat(SX.zeros(others), drift)


def constraint_drift_at(system: System) -> Function | None:
    """Return ``drift(q, p) -> g``, the drift of all rows J v + g = 0; None if all are J v = 0.

    Args:
        system: mechanism with closed loops.
    """

    def build() -> Function | None:
        q = SX.sym("q", system.nq)
        drift = constraint_drift(system, q)
        return None if drift is None else Function("drift", [q, system.p], [drift])

    function: Function | None = system.cached("constraint drift", build)
    return function


def independent_drift(system: System, q: SX) -> SX | None:
    """Return the drift g (r, 1) of the independent rows J v + g = 0; None if all are J v = 0.

    Args:
        system: mechanism with closed loops.
        q: (nq, 1) symbols of positions.
    """
    drift = constraint_drift(system, q)
    return None if drift is None else drift[kept_rows(system)]


def independent_constraint_rows(system: System, q: SX) -> SX:
    """Return the independent constraint rows J (r, nv), as found by the loop analysis.

    Args:
        system: mechanism with closed loops.
        q: (nq, 1) symbols of positions.
    """
    J = velocity_rows(system, q, independent_closure(system, q))
    assert system.closure is not None
    if not system.closure.slips:
        return J
    slips = casadi.vertcat(*(rows for _, rows in slip_rows(system, q)))
    return casadi.vertcat(J, slips[list(system.closure.slips), :])


def constraint_jacobian(system: System) -> Function:
    """Return ``constraint_jacobian(q, p) -> J``: all rows (m, nv), with p as an input.

    Args:
        system: mechanism with loops, with or without their analysis.
    """

    def build() -> Function:
        q = SX.sym("q", system.nq)
        return Function("constraint_jacobian", [q, system.p], [constraint_rows(system, q)])

    function: Function = system.cached("constraint jacobian", build)
    return function


def kept_rows(system: System) -> list[int]:
    """Return the indices of the independent rows among all rows; empty for an open chain.

    Args:
        system: open or closed mechanism.
    """
    if system.closure is None:
        return []
    positions = len(position_rows(system))
    return [*system.closure.rows, *(positions + k for k in system.closure.slips)]


@dataclass(frozen=True, slots=True, eq=False)
class DeterminingRows:
    """Constraint rows that determine the passive velocities from the independent ones.

    They are the independent rows if one selection of rows is independent in all configurations.
    Otherwise they are all rows, solved by least squares. On closed loops all rows are consistent,
    so that both solutions are equal.

    Attributes:
        J: (m, nv) constraint rows.
        mixed: (r, m) combinations of the rows; r is the number of passive velocities.
        square: (r, r) matrix `mixed` times the columns of J of the passive velocities.
        drift: (m, 1) drift g of the rows J v + g = 0; None if all rows are J v = 0.
    """

    J: SX
    mixed: SX
    square: SX
    drift: SX | None = None


def determining_rows(system: System, q: SX) -> DeterminingRows:
    """Return the constraint rows that determine the passive velocities.

    Args:
        system: mechanism with closed loops.
        q: (nq, 1) symbols of positions.
    """
    closure = system.closure
    assert closure is not None
    J = constraint_rows(system, q) if closure.varies else independent_constraint_rows(system, q)
    drift = (constraint_drift if closure.varies else independent_drift)(system, q)
    J_p = J[:, list(closure.passive)]
    mixed = J_p.T if closure.varies else SX(DM.eye(J.shape[0]))
    return DeterminingRows(J, mixed, casadi.mtimes(mixed, J_p), drift)


def velocity_rows(system: System, q: SX, phi: SX) -> SX:
    """Return J (m, nv) with d phi / dt = J v.

    Args:
        system: mechanism with these coordinates.
        q: (nq, 1) symbols of positions.
        phi: (m, 1) expressions of q.
    """
    v = SX.sym("v", system.nv)
    return casadi.jacobian(casadi.jtimes(phi, q, position_rate(system.tree, q, v)), v)


def acceleration_bias(system: System, q: SX, v: SX, J: SX, drift: SX | None = None) -> SX:
    """Return the bias psi (m, 1) of J a + psi = 0: dJ/dt v + dg/dt.

    Args:
        system: mechanism with these coordinates.
        q: (nq, 1) symbols of positions.
        v: (nv, 1) velocities.
        J: (m, nv) constraint rows, expressions of q.
        drift: (m, 1) drift g of J v + g = 0; None for zero.
    """
    speeds = casadi.mtimes(J, v)
    if drift is not None:
        speeds += drift
    return casadi.jtimes(speeds, q, position_rate(system.tree, q, v))


# Wrenches of cut joints, from the efforts (Lagrange multipliers) of their closure rows.
#
# A small displacement of frame_b relative to the tree, by a translation x and a rotation y in its
# own axes, changes the rows by d phi. The efforts of the rows do the work lam' d phi = F' x + M' y,
# for rows of any form.
#
# Source: Haug 1989, for reactions from the efforts of rows.


def cut_wrenches(system: System, q: SX, lam: SX) -> dict[str, Wrench]:
    """Return the wrench of each cut joint on the body of frame_b, at its origin, in its axes.

    Args:
        system: mechanism with closed loops.
        q: (nq, 1) symbols of positions that close the loops.
        lam: (m, 1) efforts of all rows, with the rows of rolling discs last.
    """
    if not system.cuts:
        return {}
    small = [SX.sym(cut.edge.joint.name, 6) for cut in system.cuts]
    moved = tuple(
        replace(cut, pose_b=cut.pose_b @ _displace(d))
        for cut, d in zip(system.cuts, small, strict=True)
    )
    rows = closure_rows(replace(system, cuts=moved, _cache={}), q)
    positions = rows.numel()
    work = casadi.dot(lam[:positions], rows)
    every = casadi.vertcat(*small)
    slopes = casadi.substitute(casadi.gradient(work, every), every, SX.zeros(every.numel()))
    parts = casadi.vertsplit(casadi.densify(slopes), 6)
    result = {
        cut.edge.joint.name: (part[:3], part[3:])
        for cut, part in zip(system.cuts, parts, strict=True)
    }
    for name, wrench in _against_slip(system, q, lam[positions:]).items():
        result[name] = add_wrenches(result[name], wrench)
    return result


def on_links(system: System, q: SX, wrenches: dict[str, Wrench]) -> dict[int, Wrench]:
    """Return the wrenches that links exert on cut joints, at the origins and in the link frames.

    Args:
        system: mechanism with closed loops.
        q: (nq, 1) positions.
        wrenches: wrenches of the cut joints by name, from `cut_wrenches`.
    """
    exerted: list[dict[int, Wrench]] = []
    for cut in system.cuts:
        for link, sign in ((cut.link_a, 1), (cut.link_b, -1)):
            if link >= 0:
                T = relative_pose(system.tree, q, (link, Pose.identity()), cut.frames[1])
                f, m = transform_wrench(T, wrenches[cut.edge.joint.name])
                exerted.append({link: (sign * f, sign * m)})
    return sum_wrenches(*exerted)


def part_wrenches(system: System, q: SX, lam: SX) -> dict[int, Wrench]:
    """Return the wrenches that links exert on components with constraint rows, in link frames.

    Args:
        system: mechanism, with or without components that have constraint rows.
        q: (nq, 1) symbols of positions that close the loops.
        lam: (m, 1) efforts of all rows, with the velocity rows last.
    """
    parts = {part.name: part for part in system.parts if part.element.binds}
    if not parts:
        return {}
    still, moving = PartsAt(system, q), PartsAt(system, q, SX.sym("v", system.nv))
    exerted: list[dict[int, Wrench]] = []
    first = 0
    for kind in ("positions", "velocities"):
        for group in row_groups(system):
            last = first + len(getattr(group, kind))
            if group.name in parts and last > first:
                part, at = parts[group.name], moving if kind == "velocities" else still
                loads = at.loads_of_rows(part, lam[first:last], velocities=kind == "velocities")
                for (link, pose), load in zip(part.frames, loads, strict=True):
                    f, m = transform_wrench(pose, (load.force, load.moment))
                    exerted.append({link: (-f, -m)} if link >= 0 else {})
            first = last
    return sum_wrenches(*exerted)


def _displace(d: SX) -> Pose:
    """Return the first-order pose of a small translation d[:3] [m] and rotation d[3:] [rad]."""
    return Pose(SX(DM.eye(3)) + skew(d[3:]), d[:3])


def _against_slip(system: System, q: SX, lam: SX) -> dict[str, Wrench]:
    """Return the wrench that the no-slip rows of each rolling disc exert on it, by name."""
    result: dict[str, Wrench] = {}
    for number, (cut, disc) in enumerate(rolling_discs(system)):
        along = [lam[2 * number], lam[2 * number + 1]]
        pose = pose_on_plane(system, q, cut, disc)
        f = vector([*along, 0])
        m = cross(disc.contact(pose, system.symbol_table).point, f)
        result[disc.name] = casadi.mtimes(pose.R.T, f), casadi.mtimes(pose.R.T, m)
    return result


# Scales of the rows and columns of the constraints, which make results independent of units.
#
# Rows are lengths or cosines. Columns belong to angles or displacements. The unit of a displacement
# is the largest moment arm of an angle on the position rows. The unit of a row is its norm at the
# assembled configuration.


_VANISHING = 1e-9
"""Norm of a row, relative to the median norm, below which the row is zero at assembly and is scaled
by the median: assembling leaves 1e-12, and moment arms do not differ by a factor of 1e9."""
_NO_LEVER = 1e-9
"""Moment arm, relative to the size of the mechanism, below which it is rounding and gives no unit
of length."""


@dataclass(frozen=True, slots=True, eq=False)
class Scales:
    """Scale factors of constraint rows (D) and columns (E): D J E has rows of about unit norm.

    Attributes:
        rows: (m,) factors of all constraint rows, position rows first [1/m or 1].
        length: unit of displacements [m]. Angles have the unit 1.
    """

    rows: NDArray[np.float64]
    length: float

    def columns(self, units: list[str]) -> NDArray[np.float64]:
        """Return the factors of coordinates: `length` for lengths, else 1.

        Args:
            units: units of the coordinates, such as "m" or "rad/s".
        """
        return np.array([self.length if unit.startswith("m") else 1.0 for unit in units])


def scales(system: System) -> Scales:
    """Return the scales of a system. They are 1 if a parameter of the rows has no value.

    Args:
        system: mechanism with closed loops.
    """

    def build() -> Scales:
        J = np.array(constraint_jacobian(system)(list(system.configuration), system.p_default))
        if J.size == 0 or not np.all(np.isfinite(J)):
            return Scales(np.ones(len(J)), 1.0)
        units = [speed.unit for speed in system.velocity_coordinates]
        lever = _largest_lever(J, [unit for *_, unit in position_rows(system)], units)
        size = Function("size", [system.p], [mechanism_size(system)])(system.p_default)
        # moment arms at a dwell of a cam or at a dead centre are zero, up to rounding
        length = 1.0 if lever is None else lever
        if lever is not None and lever <= _NO_LEVER * float(size):
            length = float(size)
        sizes = np.linalg.norm(J * Scales(np.ones(0), length).columns(units), axis=1)
        usual = float(np.median(sizes[sizes > 0])) if np.any(sizes > 0) else 1.0
        return Scales(1 / np.where(sizes > _VANISHING * usual, sizes, usual), length)

    found: Scales = system.cached("constraint scales", build)
    return found


def _largest_lever(J: NDArray[np.float64], rows: list[str], units: list[str]) -> float | None:
    """Return the largest moment arm of an angle on the position rows [m]; None without angles.

    Args:
        J: (m, nv) constraint rows.
        rows: units of the position rows.
        units: units of the velocities.
    """
    turns = [k for k, unit in enumerate(units) if unit.startswith("rad")]
    places = [k for k, unit in enumerate(rows) if unit == "m"]
    moved = np.abs(J[np.ix_(places, turns)])
    return float(np.max(moved)) if moved.size else None
