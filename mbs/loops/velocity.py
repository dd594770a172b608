"""Velocities and accelerations that loops allow: J(q) v = 0 and J a + psi = 0.

The rows of J are those of the closure, then those of rolling discs, which bind velocities alone.

Source: Khalil & Creusot 1997, eq. 11 and 14.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi
from casadi import DM, SX, Function

from mbs.assembly import System
from mbs.assembly.model_function import Named, model_function
from mbs.assembly.rates import position_rate
from mbs.loops.closure import closure_rows, independent_closure, row_labels
from mbs.loops.rolling import slip_rows


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
    positions = sum(len(rows) for _, rows in row_labels(system))
    return [*system.closure.rows, *(positions + k for k in system.closure.slips)]


@dataclass(frozen=True, slots=True, eq=False)
class DeterminingRows:
    """Rows from which the passive velocities follow in every posture that leads them.

    These are the kept rows; all of them, by least squares, where no choice of rows is independent
    everywhere: as rows agree with each other on closed loops, the solution is the same.

    Attributes:
        J: (m, nv).
        mixed: (r, m) combinations of the rows, as many as there are passive velocities.
        square: (r, r) their columns of the passive velocities.
    """

    J: SX
    mixed: SX
    square: SX


def determining_rows(system: System, q: SX) -> DeterminingRows:
    """The rows of a system with loops at the symbols q."""
    closure = system.closure
    assert closure is not None
    J = constraint_rows(system, q) if closure.varies else independent_constraint_rows(system, q)
    J_p = J[:, list(closure.passive)]
    mixed = J_p.T if closure.varies else SX(DM.eye(J.shape[0]))
    return DeterminingRows(J, mixed, casadi.mtimes(mixed, J_p))


def velocity_rows(system: System, q: SX, phi: SX) -> SX:
    """J (m, nv), with d phi / dt = J v, for rows phi that depend on the symbols q."""
    v = SX.sym("v", system.nv)
    return casadi.jacobian(casadi.jtimes(phi, q, position_rate(system.tree, q, v)), v)


def acceleration_bias(system: System, q: SX, v: SX, J: SX) -> SX:
    """Psi = dJ/dt v, (m, 1), for J that depends on the symbols q."""
    return casadi.jtimes(casadi.mtimes(J, v), q, position_rate(system.tree, q, v))
