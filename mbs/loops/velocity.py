"""Velocity and acceleration of the closure: J(q) v = 0 and J a + psi = 0.

Source: Khalil & Creusot 1997, eq. 11 and 14.
"""

import casadi
from casadi import SX, Function

from mbs.assembly import System
from mbs.assembly.model_function import Named, model_function
from mbs.assembly.rates import position_rate
from mbs.loops.closure import closure_rows


def closure_jacobian(system: System) -> Function:
    """``closure_jacobian(q) -> J``: the rows of J, (m, nv), act on v.

    Returns:
        Function of q (nq, 1); J (m, nv) [m/rad, 1 or 1/m].
    """

    def build() -> tuple[Named, Named]:
        q = SX.sym("q", system.nq)
        return [("q", q)], [("J", velocity_rows(system, q, closure_rows(system, q)))]

    return model_function(system, ("closure_jacobian",), build)


def velocity_rows(system: System, q: SX, phi: SX) -> SX:
    """J (m, nv), with d phi / dt = J v, for rows phi that depend on the symbols q."""
    v = SX.sym("v", system.nv)
    return casadi.jacobian(casadi.jtimes(phi, q, position_rate(system.tree, q, v)), v)


def acceleration_bias(system: System, q: SX, v: SX, J: SX) -> SX:
    """Psi = dJ/dt v, (m, 1), for J that depends on the symbols q."""
    return casadi.jtimes(casadi.mtimes(J, v), q, position_rate(system.tree, q, v))
