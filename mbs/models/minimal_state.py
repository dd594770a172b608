"""The state equation of the independent joints, the others solved for.

It is what an importer of an FMU expects: states that may be set freely, and no drift.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import casadi
import numpy as np
from casadi import SX, Function

from mbs.assembly import System
from mbs.assembly.rates import norm_rows, normalised, position_rate, quaternion_slices
from mbs.errors import ModelError
from mbs.loops.closure import closure_rows, facing, square_closure
from mbs.loops.reduction import reduction
from mbs.models.composition import dense_function, outputs_of
from mbs.models.devices import device_equations, state_count
from mbs.models.direct_dynamics import direct_dynamics
from mbs.models.geometry import terminal_frame
from mbs.recursions.route import relative_pose
from mbs.solvers.small_linear import solve_square

Observe = Callable[[SX, SX, SX], Sequence[SX]]
"""What is seen of positions q, and of velocities and accelerations of the independent joints."""

_NORM_RATE = 10.0
"""How fast a quaternion returns to unit length [1/s]."""


@dataclass(frozen=True, slots=True, eq=False)
class MinimalState:
    """State x = [q_a; v_a; states of devices], with dependent positions z.

    Attributes:
        positions: numbers in q of the first part of x.
        dependents: numbers in q of z.
        inputs: numbers in v of the efforts that u starts with; the inputs of devices follow.
        rhs: `rhs(t, x, z, u, p) -> (xdot, y)`, y = [accelerations of x; positions z, velocities
            and accelerations of the dependent joints; origin (3) and orientation (9, by rows) of
            the terminal frame; outputs of devices; what is observed].
        closure: `closure(x, z, p) -> (z_next, residual)`, one Newton step; None in open chains.
    """

    positions: tuple[int, ...]
    dependents: tuple[int, ...]
    inputs: tuple[int, ...]
    rhs: Function
    closure: Function | None


def minimal_state(system: System, observe: Observe | None = None) -> MinimalState:
    """The state equation of the independent joints.

    Args:
        system: open or closed.
        observe: what else the outputs end with.

    Raises:
        ModelError: an independent velocity of a loop belongs to a quaternion joint, so that no
            position stands for it.
    """
    positions = _free_positions(system)
    dependents = tuple(k for k in range(system.nq) if k not in positions)
    by_devices = [device.velocity for device in system.devices]
    motors = [k for k in system.active if system.speeds[k].actuated]
    driven = tuple(k for k in motors if k not in by_devices)
    t, u = SX.sym("t"), SX.sym("u", len(driven) + len(by_devices))
    nq, n = len(positions), len(positions) + len(system.active)
    x, z = SX.sym("x", n + state_count(system)), SX.sym("z", len(dependents))
    q, v, v_a = SX.zeros(system.nq), SX.zeros(system.nv), x[nq:n]
    q[list(positions)], q[list(dependents)], v[list(system.active)] = x[:nq], z, v_a
    efforts, rates, shown = device_equations(system, v, x[n:], u[len(driven) :])
    for column, k in enumerate(driven):
        efforts[k] = u[column]
    tau = efforts[list(system.active)]
    unit = q if system.is_closed else normalised(system.tree, q)
    (a,) = outputs_of(system, direct_dynamics(system), unit, v_a, tau)
    rest = _dependent_motion(system, q, v_a, a) if system.is_closed else []
    rate = _free_rate(system, v_a, rest[0]) if rest else _steadied_rate(system, q, v_a)
    seen = () if observe is None else observe(unit, v_a, a)
    y = casadi.vertcat(a, z, *rest, _terminal_pose(system, unit), shown, *seen)
    return MinimalState(
        positions=positions,
        dependents=dependents,
        inputs=driven,
        rhs=dense_function("rhs", [t, x, z, u, system.p], [casadi.vertcat(rate, a, rates), y]),
        closure=_closure_step(system, q, x, z, dependents) if dependents else None,
    )


def _free_positions(system: System) -> tuple[int, ...]:
    if not system.is_closed:
        return tuple(range(system.nq))
    names = [coordinate.name for coordinate in system.coordinates]
    missing = [system.speeds[k].name for k in system.free if system.speeds[k].name not in names]
    if missing:
        raise ModelError(
            f"{system.name}: {', '.join(missing)} of a quaternion joint would be independent, which"
            " has no position of its own; replace a ball joint of a rod that can spin by a"
            " Universal, or actuate other joints of the loop"
        )
    return tuple(names.index(system.speeds[k].name) for k in system.free)


def _steadied_rate(system: System, q: SX, v: SX) -> SX:
    """The rate of the positions, quaternions drawn back to unit length."""
    raw = position_rate(system.tree, q, v)
    rate = position_rate(system.tree, normalised(system.tree, q), v)
    for part in quaternion_slices(system.tree):
        rate[part] = raw[part] + _NORM_RATE * (1 - casadi.sumsqr(q[part])) * q[part]
    return rate


def _free_rate(system: System, v_a: SX, v_passive: SX) -> SX:
    """The rate of the free positions, in a system of joints whose positions match velocities."""
    v = SX.zeros(system.nv)
    assert system.closure is not None
    v[list(system.closure.active)], v[list(system.closure.passive)] = v_a, v_passive
    return v[list(system.free)]


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


def _closure_step(system: System, q: SX, x: SX, z: SX, dependents: Sequence[int]) -> Function:
    symbols = SX.sym("q", system.nq)
    norms = norm_rows(system.tree, symbols)
    kept = square_closure(system, symbols, dependents)
    every = casadi.vertcat(closure_rows(system, symbols), norms)
    kept, every = casadi.substitute([kept, every], [symbols], [q])
    z_next = z - solve_square(casadi.jacobian(kept, z), kept)
    cosines = casadi.substitute(facing(system, symbols), symbols, q)
    opposed = casadi.mmin(cosines) <= 0 if cosines.numel() else SX(0)
    residual = casadi.mmax(casadi.fabs(casadi.vertcat(every, opposed)))
    return dense_function("closure", [x, z, system.p], [z_next, residual])


def consistent_start(system: System, state: MinimalState) -> tuple[list[float], list[float]]:
    """State x and dependents z of the assembled posture at rest."""
    posture = np.array(system.posture)
    rest = [0.0] * (len(system.active) + state_count(system))
    x = [*posture[list(state.positions)], *rest]
    return [float(value) for value in x], [
        float(value) for value in posture[list(state.dependents)]
    ]
