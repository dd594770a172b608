"""Equations of motion as differential-algebraic equations, in the forms that solvers take.

With loops, positions q and velocities v of the whole tree follow from A a + H = tau + J' lam and
one of phi(q) = 0, J v = 0 or J a + psi = 0; or both of the first two, the positions then being
moved onto the loops by multipliers mu. Or the loops are solved for, and nothing is left of them.

Source: Gear, Leimkuhler and Gupta 1985 for the form "ggl"; Brenan, Campbell and Petzold 1996 for
the index of the others.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import casadi
from casadi import SX

from mbs.assembly import System
from mbs.assembly.rates import norm_rows, position_rate
from mbs.assembly.validity import plain_rows
from mbs.loops.closure import independent_closure
from mbs.loops.function import function
from mbs.loops.reduction import reduction_matrix
from mbs.models.composition import outputs_of
from mbs.models.dae_rows import Rows, rows_of
from mbs.models.direct_dynamics import direct_dynamics, independent_dynamics
from mbs.models.inverse_dynamics import inverse_dynamics
from mbs.models.symbols import ModelSymbols, symbols_of

Held = Callable[[ModelSymbols, SX], Rows]
"""Rows at the symbols of the tree and its accelerations a (nv, 1)."""

FORMS = ("reduced", "index1", "index2", "index3", "ggl")


@dataclass(frozen=True, slots=True, eq=False)
class DaeEquations:
    """dx/dt = ode(x, z, u, p), 0 = alg(x, z, u, p), on symbols x, z, u, p.

    Attributes:
        x: differential states.
        z: algebraic states; (0, 1) where there are none.
        u: efforts of the motors, in the order of the actuated `system.speeds`.
        p: parameters, in the order of `system.parameters`.
        ode: rates of x.
        alg: as many rows as z has elements.
        invariants: of x and p; zero along every motion, so zero at every start.
        q: (nq, 1) positions of the tree that belong to x.
        v: (nv, 1) velocities of the tree that belong to x.
        excess: of p; by how much parameters are out of their bounds, not above zero where they are
            within.
    """

    x: SX
    z: SX
    u: SX
    p: SX
    ode: SX
    alg: SX
    invariants: SX
    q: SX
    v: SX
    excess: SX


def motors(system: System) -> list[int]:
    """Numbers of the actuated speeds."""
    return [k for k, speed in enumerate(system.speeds) if speed.actuated]


def implicit(system: System, form: str, held: Held | None = None) -> DaeEquations:
    """The forms with x = [q; v] and z = [a; lam], or [a; lam; mu]; the mass stays implicit.

    No inertia matrix is built or factorised: the rows of a are the inverse dynamic model, which
    also serves links without mass.

    Args:
        system: open or closed.
        form: "index1", "index2", "index3" or "ggl".
        held: rows besides those of the loops, such as points that stand.
    """
    s = symbols_of(system, "tree")
    q, v, a = s.q, s.v, SX.sym("a", system.nv)
    rows = rows_of(system, q, v, a)
    if held is not None:
        rows = rows.joined(held(s, a))
    lam, mu = SX.sym("lam", rows.J.shape[0]), SX(0, 1)
    u, tau = motor_efforts(system)
    (needed,) = outputs_of(system, inverse_dynamics(system, "tree"), q, v, a)
    speed = v
    if form == "ggl":
        mu = SX.sym("mu", rows.positions.numel())
        speed = v + casadi.mtimes(rows.J_positions.T, mu)
    return equations(
        system,
        states=(casadi.vertcat(q, v), casadi.vertcat(a, lam, mu), u),
        ode=casadi.vertcat(position_rate(system.tree, q, speed), a),
        alg=casadi.vertcat(needed - tau - casadi.mtimes(rows.J.T, lam), _kept(rows, form)),
        invariants=casadi.vertcat(rows.positions, rows.velocities, rows.norms),
        motion=(q, v),
    )


def _kept(rows: Rows, form: str) -> SX:
    """What the algebraic equations of a form ask of the loops."""
    match form:
        case "index1":
            return rows.accelerations
        case "index2":
            return rows.velocities
        case "index3":
            return rows.deepest
    return casadi.vertcat(rows.positions, rows.velocities)


def open_chain(system: System) -> DaeEquations:
    """Open chains, x = [q; v] and no z: the accelerations are those of the direct dynamic model."""
    q, v = SX.sym("q", system.nq), SX.sym("v", system.nv)
    u, tau = motor_efforts(system)
    (a,) = outputs_of(system, direct_dynamics(system), q, v, tau)
    return equations(
        system,
        states=(casadi.vertcat(q, v), SX(0, 1), u),
        ode=casadi.vertcat(position_rate(system.tree, q, v), a),
        alg=SX(0, 1),
        invariants=norm_rows(system.tree, q),
        motion=(q, v),
    )


def closed_form(system: System, branch: tuple[str, ...]) -> DaeEquations:
    """Closed forms, x = [q_a; v_a] and no z: q is an explicit function of q_a on one branch.

    Raises:
        NoClosedForm: a loop is solved by iteration only.
    """
    active = list(system.active)
    q_a, v_a = SX.sym("q_a", len(active)), SX.sym("v_a", len(active))
    (q,) = outputs_of(system, function(system, branch), q_a)
    u, v, a = _independent_motion(system, q, v_a)
    return equations(
        system,
        states=(casadi.vertcat(q_a, v_a), SX(0, 1), u),
        ode=casadi.vertcat(v_a, a),
        alg=SX(0, 1),
        invariants=SX(0, 1),
        motion=(q, v),
    )


def carried_positions(system: System) -> DaeEquations:
    """Other loops, x = [q; v_a] and no z: all positions are integrated, phi(q) is an invariant."""
    q, v_a = SX.sym("q", system.nq), SX.sym("v_a", len(system.active))
    u, v, a = _independent_motion(system, q, v_a)
    return equations(
        system,
        states=(casadi.vertcat(q, v_a), SX(0, 1), u),
        ode=casadi.vertcat(position_rate(system.tree, q, v), a),
        alg=SX(0, 1),
        invariants=casadi.vertcat(independent_closure(system, q), norm_rows(system.tree, q)),
        motion=(q, v),
    )


def _independent_motion(system: System, q: SX, v_a: SX) -> tuple[SX, SX, SX]:
    """Symbols u, velocities of the tree, and accelerations of the independent joints."""
    u, tau = motor_efforts(system)
    (G,) = outputs_of(system, reduction_matrix(system), q)
    pushed = casadi.mtimes(G.T, tau) if system.motors != system.active else tau[list(system.active)]
    (a,) = outputs_of(system, independent_dynamics(system), q, v_a, pushed)
    return u, casadi.mtimes(G, v_a), a


def motor_efforts(system: System) -> tuple[SX, SX]:
    """Symbols u, and the efforts tau (nv, 1) that they are."""
    driven = motors(system)
    u, tau = SX.sym("u", len(driven)), SX.zeros(system.nv)
    tau[driven] = u
    return u, tau


def equations(
    system: System,
    states: tuple[SX, SX, SX],
    ode: SX,
    alg: SX,
    invariants: SX,
    motion: tuple[SX, SX],
) -> DaeEquations:
    """The expressions with their common parts shared."""
    rules = [row for row in plain_rows(system, motion[0]) if row.kind == "parameter"]
    excess = casadi.vertcat(SX(0, 1), *(row.residual - row.bound for row in rules))
    shared = casadi.cse([casadi.densify(e) for e in (ode, alg, invariants, *motion, excess)])
    return DaeEquations(*states, system.p, *(SX(e) for e in shared))
