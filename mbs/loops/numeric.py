"""Positions of the whole tree from those of the independent joints, as a CasADi graph."""

import casadi
from casadi import DM, MX, SX, Function

from mbs.assembly import System
from mbs.loops.reduction import independent_rows


def follow_active(system: System) -> Function:
    """``follow(q_a, p) -> q``: Newton's method from the assembled posture.

    It is differentiable (implicit function theorem) and stays in the basin of the assembled
    posture; a posture that is not reached is an error of the call. For systems without
    quaternion joints, where positions and velocities have the same numbers.

    Returns:
        Function of q_a (m, 1) and p (np, 1); q (nq, 1).
    """

    def build() -> Function:
        assert system.closure is not None
        active, passive = list(system.closure.active), list(system.closure.passive)
        q = SX.sym("q", system.nq)
        z, q_a = SX.sym("z", len(passive)), SX.sym("q_a", len(active))
        merged = SX.zeros(system.nq)
        merged[passive], merged[active] = z, q_a
        residual = casadi.substitute(independent_rows(system, q), q, merged)
        equations = Function("phi", [z, q_a, system.p], [residual])
        newton = casadi.rootfinder(
            "newton", "fast_newton", equations, {"abstol": 1e-13, "max_iter": 100}
        )
        y, p = MX.sym("q_a", len(active)), MX.sym("p", system.p.numel())
        solved = newton(DM([system.posture[k] for k in passive]), y, p)
        order = [*passive, *active]
        rows = casadi.vertcat(solved, y)
        q_all = rows[[order.index(k) for k in range(system.nq)]]
        return Function("follow", [y, p], [q_all], ["q_a", "p"], ["q"])

    function: Function = system.cached("follow", build)
    return function
