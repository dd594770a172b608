"""The state equation of the whole tree, with a projection that keeps its loops closed.

Every position and velocity of the tree is a state: the motion runs through postures where no
choice of independent joints would hold.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi
from casadi import SX, Function

from mbs.assembly import System
from mbs.assembly.rates import normalised, position_rate, quaternion_slices
from mbs.loops.closure import closure_rows
from mbs.loops.reduction import independent_closure
from mbs.loops.velocity import velocity_rows
from mbs.models.composition import dense_function, outputs_of
from mbs.models.direct_dynamics import direct_dynamics
from mbs.models.energy import energy
from mbs.solvers.small_linear import solve_symmetric

_SINGULAR = 1e-12


@dataclass(frozen=True, slots=True, eq=False)
class FullState:
    """State x = [q; v] of the whole tree.

    Attributes:
        rhs: `rhs(t, x, p) -> xdot`.
        project: `project(x, p) -> (x, residual)`, one Newton step onto loops and unit
            quaternions, None where there is nothing to keep.
        observe: `observe(t, x, p) -> a, tau, E, U, openness`, what a result shows beside x; the
            last is the largest closure row.
    """

    rhs: Function
    project: Function | None
    observe: Function


def full_state(system: System, effort: Function | None = None) -> FullState:
    """The state equation of the whole tree under given joint efforts.

    Args:
        system: open or closed.
        effort: `effort(t, q, v, p) -> tau`, (nv, 1); no effort when left out.
    """
    nq, nv = system.nq, system.nv
    t, x = SX.sym("t"), SX.sym("x", nq + nv)
    q, v, p = x[:nq], x[nq:], system.p
    tau = SX.zeros(nv) if effort is None else casadi.densify(effort(t, q, v, p))
    ddm = direct_dynamics(system, coordinates="tree")
    a = outputs_of(system, ddm, q, v, tau)[0]
    rate = casadi.vertcat(position_rate(system.tree, q, v), a)
    projected, residual = _projected(system, q, v)
    rows = closure_rows(system, q)
    openness = casadi.mmax(casadi.fabs(rows)) if rows.numel() else SX(0)
    E, U = outputs_of(system, energy(system, "tree"), q, v)
    observed = [a, tau, E, U, openness]
    keeps = system.is_closed or quaternion_slices(system.tree)
    return FullState(
        rhs=dense_function("rhs", [t, x, p], [rate]),
        project=dense_function("project", [x, p], [projected, residual]) if keeps else None,
        observe=dense_function("observe", [t, x, p], observed),
    )


def _projected(system: System, q: SX, v: SX) -> tuple[SX, SX]:
    """One Newton step of [q; v] onto the loops, and the largest row before it, of all rows.

    The step is made on the independent rows: off the loops a dependent row is almost, not
    exactly, dependent, and would turn rounding into motion.
    """
    if not system.is_closed:
        return casadi.vertcat(normalised(system.tree, q), v), SX(0)
    symbols = SX.sym("q", system.nq)
    norms = [casadi.sumsqr(symbols[part]) - 1 for part in quaternion_slices(system.tree)]
    phi = independent_closure(system, symbols)
    r = casadi.vertcat(phi, *norms)
    J_q = casadi.jacobian(r, symbols)
    J = velocity_rows(system, symbols, phi)
    speed = casadi.mtimes(J, v)
    step_q = casadi.mtimes(J_q.T, _least(J_q, r))
    step_v = casadi.mtimes(J.T, _least(J, speed))
    every = casadi.vertcat(closure_rows(system, symbols), *norms, speed)
    residual = casadi.mmax(casadi.fabs(every))
    step, worst = casadi.substitute(
        [casadi.densify(casadi.vertcat(step_q, step_v)), residual], [symbols], [q]
    )
    return casadi.vertcat(q, v) - step, worst


def _least(J: SX, r: SX) -> SX:
    """(J J')^-1 r, finite where the rows become dependent."""
    S = casadi.mtimes(J, J.T)
    return solve_symmetric(S + _SINGULAR * SX.eye(S.shape[0]), r)
