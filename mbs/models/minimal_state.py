"""The state equation of the independent joints, the others solved for.

It is what an importer of an FMU expects: states that may be set freely, and no drift.
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
from mbs.models.composition import dense_function, outputs_of
from mbs.models.direct_dynamics import direct_dynamics
from mbs.models.geometry import terminal_frame
from mbs.recursions.route import relative_pose
from mbs.solvers.small_linear import solve_square

_NORM_RATE = 10.0
"""How fast a quaternion returns to unit length [1/s]."""


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


def minimal_state(system: System) -> MinimalState:
    """The state equation of the independent joints.

    Raises:
        ModelError: an independent velocity of a loop belongs to a quaternion joint, so that no
            position stands for it.
    """
    positions = _active_positions(system)
    dependents = tuple(k for k in range(system.nq) if k not in positions)
    driven = tuple(k for k in system.active if system.speeds[k].actuated)
    t, u = SX.sym("t"), SX.sym("u", len(driven))
    x, z = SX.sym("x", len(positions) + len(system.active)), SX.sym("z", len(dependents))
    q, v_a = SX.zeros(system.nq), x[len(positions) :]
    q[list(positions)], q[list(dependents)] = x[: len(positions)], z
    tau = SX.zeros(len(system.active))
    for column, k in enumerate(driven):
        tau[system.active.index(k)] = u[column]
    unit = q if system.is_closed else normalised(system.tree, q)
    (a,) = outputs_of(system, direct_dynamics(system), unit, v_a, tau)
    rate = v_a if system.is_closed else _steadied_rate(system, q, v_a)
    rest = _dependent_motion(system, q, v_a, a) if system.is_closed else []
    outputs = [casadi.vertcat(rate, a), casadi.vertcat(a, z, *rest, _terminal_pose(system, unit))]
    return MinimalState(
        positions=positions,
        dependents=dependents,
        inputs=driven,
        rhs=dense_function("rhs", [t, x, z, u, system.p], outputs),
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
            " has no position of its own; replace a ball joint of a rod that can spin by a"
            " Universal, or actuate other joints of the loop"
        )
    return tuple(names.index(system.speeds[k].name) for k in system.active)


def _steadied_rate(system: System, q: SX, v: SX) -> SX:
    """The rate of the positions, quaternions drawn back to unit length."""
    raw = position_rate(system.tree, q, v)
    rate = position_rate(system.tree, normalised(system.tree, q), v)
    for part in quaternion_slices(system.tree):
        rate[part] = raw[part] + _NORM_RATE * (1 - casadi.sumsqr(q[part])) * q[part]
    return rate


def _dependent_motion(system: System, q: SX, v_a: SX, a_a: SX) -> list[SX]:
    """Velocities and accelerations of the dependent joints."""
    assert system.closure is not None
    passive = list(system.closure.passive)
    m = len(system.active)
    symbols, speeds, rates = SX.sym("q", system.nq), SX.sym("v", m), SX.sym("a", m)
    reduced = reduction(system, symbols, speeds)
    assert reduced.gamma is not None
    v = casadi.mtimes(reduced.G, speeds)[passive]
    a = (casadi.mtimes(reduced.G, rates) + reduced.gamma)[passive]
    return [SX(x) for x in casadi.substitute([v, a], [symbols, speeds, rates], [q, v_a, a_a])]


def _terminal_pose(system: System, q: SX) -> SX:
    """(12, 1) origin, and orientation by rows, of the terminal frame in the base."""
    base, tool = system.frame("base"), system.frame(terminal_frame(system))
    T = relative_pose(system.tree, q, base, tool)
    return casadi.vertcat(T.p, casadi.reshape(T.R.T, 9, 1))


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
    return dense_function("closure", [x, z, system.p], [z_next, residual])


def consistent_start(system: System, state: MinimalState) -> tuple[list[float], list[float]]:
    """State x and dependents z of the assembled posture at rest."""
    posture = np.array(system.posture)
    x = [*posture[list(state.positions)], *([0.0] * len(system.active))]
    return [float(value) for value in x], [
        float(value) for value in posture[list(state.dependents)]
    ]
