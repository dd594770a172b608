"""Velocities and accelerations that loops allow: J(q) v = 0 and J a + psi = 0.

The rows of J are those of the closure, then those of rolling discs, which bind velocities alone.

Source: Khalil & Creusot 1997, eq. 11 and 14.
"""

import casadi
from casadi import SX, Function

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


def kept_rows(system: System) -> list[int]:
    """The numbers of the independent rows among all."""
    closure = system.closure
    assert closure is not None
    positions = sum(len(rows) for _, rows in row_labels(system))
    return [*closure.rows, *(positions + k for k in closure.slips)]


def velocity_rows(system: System, q: SX, phi: SX) -> SX:
    """J (m, nv), with d phi / dt = J v, for rows phi that depend on the symbols q."""
    v = SX.sym("v", system.nv)
    return casadi.jacobian(casadi.jtimes(phi, q, position_rate(system.tree, q, v)), v)


def acceleration_bias(system: System, q: SX, v: SX, J: SX) -> SX:
    """Psi = dJ/dt v, (m, 1), for J that depends on the symbols q."""
    return casadi.jtimes(casadi.mtimes(J, v), q, position_rate(system.tree, q, v))
