"""Velocities and accelerations that loops allow: J(q) v = 0 and J a + psi = 0; their wrenches.

The rows of J are those of the closure, then those of rolling discs, which bind velocities alone.

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
from mbs.loops.closure import (
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
    """``closure_jacobian(q) -> J``: the rows of J, (m, nv), act on v.

    Returns:
        Function of q (nq, 1); J (m, nv) [m/rad, 1 or 1/m].
    """

    def build() -> tuple[Named, Named]:
        q = SX.sym("q", system.nq)
        return [("q", q)], [("J", constraint_rows(system, q))]

    return model_function(system, ("closure_jacobian",), build)


def constraint_rows(system: System, q: SX) -> SX:
    """J (m, nv), every row, at the symbols q."""
    slips = [rows for _, rows in slip_rows(system, q)]
    return casadi.vertcat(velocity_rows(system, q, closure_rows(system, q)), *slips)


def constraint_drift(system: System, q: SX) -> SX | None:
    """Drift g (m, 1) of every row J v + g = 0 at the symbols q; None if all rows are J v = 0."""
    drift = drift_rows(system, q)
    if drift is None:
        return None
    others = len(position_rows(system)) + len(velocity_row_units(system)) - drift.numel()
    return casadi.vertcat(SX.zeros(others), drift)


def constraint_drift_at(system: System) -> Function | None:
    """``drift(q, p) -> g``: drift of every row; None if all rows are J v = 0."""

    def build() -> Function | None:
        q = SX.sym("q", system.nq)
        drift = constraint_drift(system, q)
        return None if drift is None else Function("drift", [q, system.p], [drift])

    function: Function | None = system.cached("constraint drift", build)
    return function


def independent_drift(system: System, q: SX) -> SX | None:
    """Drift g (r, 1) of the rows that the analysis kept; None if all rows are J v = 0."""
    drift = constraint_drift(system, q)
    return None if drift is None else drift[kept_rows(system)]


def independent_constraint_rows(system: System, q: SX) -> SX:
    """J (r, nv), the rows that the analysis kept, at the symbols q."""
    J = velocity_rows(system, q, independent_closure(system, q))
    assert system.closure is not None
    if not system.closure.slips:
        return J
    slips = casadi.vertcat(*(rows for _, rows in slip_rows(system, q)))
    return casadi.vertcat(J, slips[list(system.closure.slips), :])


def constraint_jacobian(system: System) -> Function:
    """``constraint_jacobian(q, p) -> J``: every row, also where parameters have no value."""

    def build() -> Function:
        q = SX.sym("q", system.nq)
        return Function("constraint_jacobian", [q, system.p], [constraint_rows(system, q)])

    function: Function = system.cached("constraint jacobian", build)
    return function


def kept_rows(system: System) -> list[int]:
    """The numbers of the independent rows among all; none in an open chain."""
    if system.closure is None:
        return []
    positions = len(position_rows(system))
    return [*system.closure.rows, *(positions + k for k in system.closure.slips)]


@dataclass(frozen=True, slots=True, eq=False)
class DeterminingRows:
    """Rows from which the passive velocities follow in every configuration that leads them.

    These are the kept rows; all of them, by least squares, where no choice of rows is independent
    everywhere: as rows agree with each other on closed loops, the solution is the same.

    Attributes:
        J: (m, nv).
        mixed: (r, m) combinations of the rows, as many as there are passive velocities.
        square: (r, r) their columns of the passive velocities.
        drift: (m, 1) drift g of the rows J v + g = 0; None if all rows are J v = 0.
    """

    J: SX
    mixed: SX
    square: SX
    drift: SX | None = None


def determining_rows(system: System, q: SX) -> DeterminingRows:
    """The rows of a system with loops at the symbols q."""
    closure = system.closure
    assert closure is not None
    J = constraint_rows(system, q) if closure.varies else independent_constraint_rows(system, q)
    drift = (constraint_drift if closure.varies else independent_drift)(system, q)
    J_p = J[:, list(closure.passive)]
    mixed = J_p.T if closure.varies else SX(DM.eye(J.shape[0]))
    return DeterminingRows(J, mixed, casadi.mtimes(mixed, J_p), drift)


def velocity_rows(system: System, q: SX, phi: SX) -> SX:
    """J (m, nv), with d phi / dt = J v, for rows phi that depend on the symbols q."""
    v = SX.sym("v", system.nv)
    return casadi.jacobian(casadi.jtimes(phi, q, position_rate(system.tree, q, v)), v)


def acceleration_bias(system: System, q: SX, v: SX, J: SX, drift: SX | None = None) -> SX:
    """Psi = dJ/dt v + dg/dt, (m, 1), for J and the drift g that depend on the symbols q."""
    speeds = casadi.mtimes(J, v)
    if drift is not None:
        speeds += drift
    return casadi.jtimes(speeds, q, position_rate(system.tree, q, v))


# The wrenches of cut joints: what the efforts of their closure rows are between two bodies.
#
# A small displacement of frame_b that the tree does not make, by x and by the turn y in its own
# axes, opens the rows by d phi; the rows do the work lam' d phi = F' x + M' y, whatever they are
# made of.
#
# Source: Haug 1989, for reactions from the efforts of rows.


def cut_wrenches(system: System, q: SX, lam: SX) -> dict[str, Wrench]:
    """For every cut joint the wrench on the body of frame_b, about and in frame_b.

    Args:
        system: with closed loops.
        q: (nq, 1) symbols of positions that close the loops.
        lam: (m, 1) efforts of all rows, those of rolling discs last.
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
    """For some links the wrench that they exert on cut joints, about and in their frames.

    Args:
        system: with closed loops.
        q: (nq, 1) positions.
        wrenches: as `cut_wrenches` gives them.
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
    """For some links the wrench that they exert on components with rows, in their frames.

    Args:
        system: with components that have rows, or without any.
        q: (nq, 1) symbols of positions that close the loops.
        lam: (m, 1) efforts of all rows, those of velocities last.
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
    """A frame moved by d[:3] and turned by d[3:], both small."""
    return Pose(SX(DM.eye(3)) + skew(d[3:]), d[:3])


def _against_slip(system: System, q: SX, lam: SX) -> dict[str, Wrench]:
    """What the rows of rolling discs, which bind velocities alone, do to the disc."""
    result: dict[str, Wrench] = {}
    for number, (cut, disc) in enumerate(rolling_discs(system)):
        along = [lam[2 * number], lam[2 * number + 1]]
        pose = pose_on_plane(system, q, cut, disc)
        f = vector([*along, 0])
        m = cross(disc.contact(pose, system.symbol_table).point, f)
        result[disc.name] = casadi.mtimes(pose.R.T, f), casadi.mtimes(pose.R.T, m)
    return result


# Sizes of the rows and columns of the constraints, so that nothing depends on units.
#
# Rows are lengths or cosines, columns belong to angles or displacements. A displacement is
# measured by the length that an angle moves the rows of positions, and a row by its own size at
# the assembled configuration.


_VANISHING = 1e-9
"""Rows below this part of the usual one vanish as assembled, and are measured by the usual one:
assembling leaves 1e-12, and nobody builds levers a thousand million times shorter than others."""
_NO_LEVER = 1e-9
"""Levers below this part of the size of the mechanism are rounding: they make no unit of length."""


@dataclass(frozen=True, slots=True, eq=False)
class Scales:
    """What rows are multiplied by, and columns: D J E has rows of about unit length.

    Attributes:
        rows: (m,) for every constraint row, rows of positions first [1/m or 1].
        length: for displacements [m]; angles count as they are.
    """

    rows: NDArray[np.float64]
    length: float

    def columns(self, units: list[str]) -> NDArray[np.float64]:
        """For coordinates of these units."""
        return np.array([self.length if unit.startswith("m") else 1.0 for unit in units])


def scales(system: System) -> Scales:
    """The scales of a system; ones where a symbol has no value, and no rows in an open chain."""

    def build() -> Scales:
        J = np.array(constraint_jacobian(system)(list(system.configuration), system.p_default))
        if J.size == 0 or not np.all(np.isfinite(J)):
            return Scales(np.ones(len(J)), 1.0)
        units = [speed.unit for speed in system.speeds]
        lever = _largest_lever(J, [unit for *_, unit in position_rows(system)], units)
        size = Function("size", [system.p], [mechanism_size(system)])(system.p_default)
        # levers of a dwell of a cam, or at a dead centre, are rounding, or zero
        length = 1.0 if lever is None else lever
        if lever is not None and lever <= _NO_LEVER * float(size):
            length = float(size)
        sizes = np.linalg.norm(J * Scales(np.ones(0), length).columns(units), axis=1)
        usual = float(np.median(sizes[sizes > 0])) if np.any(sizes > 0) else 1.0
        return Scales(1 / np.where(sizes > _VANISHING * usual, sizes, usual), length)

    found: Scales = system.cached("constraint scales", build)
    return found


def _largest_lever(J: NDArray[np.float64], rows: list[str], units: list[str]) -> float | None:
    """How far an angle moves the rows of positions, the largest of them; None without angles."""
    turns = [k for k, unit in enumerate(units) if unit.startswith("rad")]
    places = [k for k, unit in enumerate(rows) if unit == "m"]
    moved = np.abs(J[np.ix_(places, turns)])
    return float(np.max(moved)) if moved.size else None
