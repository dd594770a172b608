"""A system as a first-order equation in time, for integration here and in other tools.

Two forms. `full_state` keeps every position and velocity of the tree and offers a projection onto
the loops: it runs through postures where no choice of independent joints would hold.
`minimal_state` keeps the independent joints only and solves for the others, which is what an
importer of an FMU expects: no drift, and starts that may be set freely.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi
import numpy as np
from casadi import SX, Function

from mbs.assembly import System
from mbs.assembly.rates import normalised, position_rate, quaternion_slices
from mbs.errors import ModelError
from mbs.loops.closure import closure_rows, facing
from mbs.loops.reduction import independent_closure, reduction
from mbs.loops.velocity import velocity_rows
from mbs.models.direct_dynamics import direct_dynamics
from mbs.models.energy import energy
from mbs.models.geometry import terminal_frame
from mbs.recursions.poses import link_poses, relative_pose
from mbs.solvers.small_linear import solve_square, solve_symmetric

_SINGULAR = 1e-12
_NORM_RATE = 10.0


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


@dataclass(frozen=True, slots=True, eq=False)
class MinimalState:
    """State x = [q_a; v_a] of the independent joints, with dependent positions z.

    Attributes:
        positions: numbers in q of the first part of x.
        dependents: numbers in q of z.
        inputs: numbers in v of the efforts u.
        rhs: `rhs(t, x, z, u, p) -> (xdot, y)`, y = [accelerations of x; positions z, velocities
            and accelerations of the dependent joints; origin (3) and orientation (9, by rows) of
            the terminal frame].
        closure: `closure(x, z, p) -> (z_next, residual)`, one Newton step; None in open chains.
    """

    positions: tuple[int, ...]
    dependents: tuple[int, ...]
    inputs: tuple[int, ...]
    rhs: Function
    closure: Function | None


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
    a = _outputs(system, ddm, q, v, tau)[0]
    rate = casadi.vertcat(position_rate(system.tree, q, v), a)
    projected, residual = _projected(system, q, v)
    rows = closure_rows(system, q)
    openness = casadi.mmax(casadi.fabs(rows)) if rows.numel() else SX(0)
    E, U = _outputs(system, energy(system, "tree"), q, v)
    observed = [a, tau, E, U, openness]
    keeps = system.is_closed or quaternion_slices(system.tree)
    return FullState(
        rhs=_function("rhs", [t, x, p], [rate]),
        project=_function("project", [x, p], [projected, residual]) if keeps else None,
        observe=_function("observe", [t, x, p], observed),
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


def minimal_state(system: System) -> MinimalState:
    """The state equation of the independent joints.

    Raises:
        ModelError: an independent velocity of a loop belongs to a quaternion joint, so that no
            position stands for it.
    """
    tree = system.tree
    t, p = SX.sym("t"), system.p
    positions = _active_positions(system)
    dependents = tuple(k for k in range(system.nq) if k not in positions)
    x = SX.sym("x", len(positions) + len(system.active))
    z = SX.sym("z", len(dependents))
    driven = tuple(k for k in system.active if system.speeds[k].actuated)
    u = SX.sym("u", len(driven))
    q = SX.zeros(system.nq)
    q[list(positions)], q[list(dependents)] = x[: len(positions)], z
    unit = normalised(tree, q) if not system.is_closed else q
    v_a = x[len(positions) :]
    tau = SX.zeros(len(system.active))
    for column, k in enumerate(driven):
        tau[system.active.index(k)] = u[column]
    (a,) = _outputs(system, direct_dynamics(system), unit, v_a, tau)
    symbols, speeds = SX.sym("q", system.nq), SX.sym("v", len(system.active))
    rate, rest = (v_a, SX(0, 1))
    if system.is_closed:
        passive = list(system.closure.passive) if system.closure else []
        reduced = reduction(system, symbols, speeds)
        assert reduced.gamma is not None
        a_sym = SX.sym("a", len(system.active))
        v_p = casadi.mtimes(reduced.G, speeds)[passive]
        a_p = (casadi.mtimes(reduced.G, a_sym) + reduced.gamma)[passive]
        v_p, a_p = casadi.substitute([v_p, a_p], [symbols, speeds, a_sym], [q, v_a, a])
        rest = casadi.vertcat(z, v_p, a_p)
    else:
        rate = position_rate(tree, q, v_a)
        for part in quaternion_slices(tree):
            rate[part] += _NORM_RATE * (1 - casadi.sumsqr(q[part])) * q[part]
    T = relative_pose(
        tree, link_poses(tree, unit), system.frame("base"), system.frame(terminal_frame(system))
    )
    pose = casadi.vertcat(T.p, casadi.reshape(T.R.T, 9, 1))
    outputs = [casadi.vertcat(rate, a), casadi.vertcat(a, rest, pose)]
    return MinimalState(
        positions=positions,
        dependents=dependents,
        inputs=driven,
        rhs=_function("rhs", [t, x, z, u, p], outputs),
        closure=_closure_step(system, q, x, z) if dependents else None,
    )


def _active_positions(system: System) -> tuple[int, ...]:
    if not system.is_closed:
        return tuple(range(system.nq))
    names = [coordinate.name for coordinate in system.coordinates]
    missing = [system.speeds[k].name for k in system.active if system.speeds[k].name not in names]
    if missing:
        raise ModelError(
            f"{system.name}: {', '.join(missing)} of a quaternion joint would be independent, which"
            " has no position of its own; actuate other joints of the loop"
        )
    return tuple(names.index(system.speeds[k].name) for k in system.active)


def _closure_step(system: System, q: SX, x: SX, z: SX) -> Function:
    symbols = SX.sym("q", system.nq)
    norms = [casadi.sumsqr(symbols[part]) - 1 for part in quaternion_slices(system.tree)]
    kept = casadi.vertcat(independent_closure(system, symbols), *norms)
    every = casadi.vertcat(closure_rows(system, symbols), *norms)
    kept, every = casadi.substitute([kept, every], [symbols], [q])
    z_next = z - solve_square(casadi.jacobian(kept, z), kept)
    cosines = casadi.substitute(facing(system, symbols), symbols, q)
    opposed = casadi.mmin(cosines) <= 0 if cosines.numel() else SX(0)
    residual = casadi.mmax(casadi.fabs(casadi.vertcat(every, opposed)))
    return _function("closure", [x, z, system.p], [z_next, residual])


def consistent_start(system: System, state: MinimalState) -> tuple[list[float], list[float]]:
    """State x and dependents z of the assembled posture at rest."""
    posture = np.array(system.posture)
    x = [*posture[list(state.positions)], *([0.0] * len(system.active))]
    return [float(value) for value in x], [
        float(value) for value in posture[list(state.dependents)]
    ]


def _outputs(system: System, model: Function, *values: SX) -> list[SX]:
    """The outputs of a model on symbols, its parameters passed on when it has any."""
    arguments = [*values, *([system.p] if system.parameters else [])]
    return [SX(output) for output in model.call(arguments)]


def _function(name: str, inputs: list[SX], outputs: list[SX]) -> Function:
    return Function(name, inputs, [casadi.densify(o) for o in outputs], {"cse": True})
