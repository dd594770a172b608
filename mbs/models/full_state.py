"""The state equation of the whole tree, with a projection that keeps its loops closed.

Every position and velocity of the tree is a state: the motion runs through postures where no
choice of independent joints would hold.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi
from casadi import SX, Function

from mbs.assembly import System
from mbs.assembly.rates import norm_rows, normalised, position_rate, quaternion_slices
from mbs.loops.closure import closure_rows, independent_closure
from mbs.loops.velocity import independent_constraint_rows
from mbs.models.composition import dense_function, outputs_of
from mbs.models.devices import device_equations, state_count
from mbs.models.direct_dynamics import direct_dynamics
from mbs.models.energy import energy

_NEARLY_DEPENDENT = 1e-6
"""Squared sine between a row and the rows before it below which it is left alone."""
_ASLEEP = 1e-6
"""What rows count in that case."""
_NEVER = 1e300


@dataclass(frozen=True, slots=True, eq=False)
class FullState:
    """State x = [q; v; z] of the whole tree and of the devices that drive its shafts.

    Attributes:
        rhs: `rhs(t, x, p) -> xdot`.
        project: `project(x, p) -> (x, residual)`, one Newton step onto loops and unit
            quaternions, None where there is nothing to keep.
        observe: `observe(t, x, p) -> a, tau, u, y, E, U, openness`, what a result shows beside x:
            u and y are inputs and outputs of the devices, the last is the largest closure row.
    """

    rhs: Function
    project: Function | None
    observe: Function


def full_state(
    system: System, effort: Function | None = None, inputs: Function | None = None
) -> FullState:
    """The state equation of the whole tree under given joint efforts and inputs of devices.

    Args:
        system: open or closed.
        effort: `effort(t, q, v, p) -> tau`, (nv, 1), beside what devices deliver; no effort when
            left out.
        inputs: `inputs(t, q, v, p) -> u`, (nu, 1), one for each device; zeros when left out.
    """
    nq, n = system.nq, system.nq + system.nv
    t, x = SX.sym("t"), SX.sym("x", n + state_count(system))
    q, v, z, p = x[:nq], x[nq:n], x[n:], system.p
    tau = SX.zeros(system.nv) if effort is None else casadi.densify(effort(t, q, v, p))
    u = SX.zeros(len(system.devices)) if inputs is None else SX(inputs(t, q, v, p))
    delivered, z_rate, y = device_equations(system, v, z, u)
    tau += delivered
    ddm = direct_dynamics(system, coordinates="tree")
    a = outputs_of(system, ddm, q, v, tau)[0]
    rate = casadi.vertcat(position_rate(system.tree, q, v), a, z_rate)
    projected, residual = _projected(system, q, v)
    rows = closure_rows(system, q)
    openness = casadi.mmax(casadi.fabs(rows)) if rows.numel() else SX(0)
    E, U = outputs_of(system, energy(system, "tree"), q, v)
    observed = [a, tau, u, y, E, U, openness]
    kept = casadi.vertcat(projected, z)
    keeps = system.is_closed or quaternion_slices(system.tree)
    return FullState(
        rhs=dense_function("rhs", [t, x, p], [rate]),
        project=dense_function("project", [x, p], [kept, residual]) if keeps else None,
        observe=dense_function("observe", [t, x, p], observed),
    )


def _projected(system: System, q: SX, v: SX) -> tuple[SX, SX]:
    """One Newton step of [q; v] onto the loops, and the largest row before it, of all rows.

    The step is made on the independent rows: off the loops a dependent row is almost, not
    exactly, dependent, and would turn rounding into motion. Close to a singular posture the same
    holds for a row that the others nearly imply there: it is left alone, and rows count little
    for as long.
    """
    if not system.is_closed:
        return casadi.vertcat(normalised(system.tree, q), v), SX(0)
    symbols = SX.sym("q", system.nq)
    norms = norm_rows(system.tree, symbols)
    r = casadi.vertcat(independent_closure(system, symbols), norms)
    J_q = casadi.jacobian(r, symbols)
    J = independent_constraint_rows(system, symbols)
    speed = casadi.mtimes(J, v)
    step_q, _ = _shortest(J_q, r)
    step_v, awake = _shortest(J, speed)
    every = casadi.vertcat(closure_rows(system, symbols), norms, speed)
    residual = casadi.if_else(awake, 1, _ASLEEP) * casadi.mmax(casadi.fabs(every))
    step, worst = casadi.substitute(
        [casadi.densify(casadi.vertcat(step_q, step_v)), residual], [symbols], [q]
    )
    return casadi.vertcat(q, v) - step, worst


def _shortest(J: SX, r: SX) -> tuple[SX, SX]:
    """The shortest step x with J x = r, by rows that are not nearly dependent, and whether all are.

    A row counts as long as the rows are on average, at least: it may also vanish by itself.
    """
    S = casadi.sparsify(casadi.mtimes(J, J.T))
    D, LT, order = casadi.ldl(S)
    squares = casadi.densify(casadi.diag(S))
    least = casadi.fmax(squares, casadi.sum1(squares) / squares.numel())
    independent = _NEARLY_DEPENDENT * least[order] < D
    x = casadi.ldl_solve(r, casadi.if_else(independent, D, _NEVER), LT, order)
    return casadi.mtimes(J.T, casadi.densify(x)), casadi.mmin(independent)
