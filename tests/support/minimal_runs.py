"""Motions of the state equation of the independent joints, integrated as an FMU's: no projection.

The dependent positions come from the closure in every evaluation, from a guess that is integrated.
"""

from dataclasses import dataclass

import casadi
import numpy as np
from casadi import SX, Function

from mbs.loops import solve
from mbs.models.state.independent import consistent_start
from mbs.solvers import Events, integrate, integrate_events


@dataclass(frozen=True)
class Run:
    """Times (m,), states, dependent positions, outputs, modes at them, and the events."""

    times: np.ndarray
    x: np.ndarray
    z: np.ndarray
    y: np.ndarray
    modes: np.ndarray
    events: tuple


def start_of(system, state, q0=None, v0=None):
    """x and z at positions that close the loops, and velocities of states, both by name."""
    x, z = consistent_start(system, state)
    if q0:
        q = solve(system, dict(q0)) if system.is_closed else system.position(q0)
        x[: len(state.positions)] = [q[k] for k in state.positions]
        z = [q[k] for k in state.dependents]
    names = [system.velocity_coordinates[k].name for k in state.velocities]
    for name, value in (v0 or {}).items():
        x[len(state.positions) + names.index(name)] = value
    return np.array(x), np.array(z)


def closing(state, x, z, p, steps=4):
    """z (nz, 1) that closes the loops at x, by Newton steps from a guess."""
    for _ in range(steps if state.closure is not None else 0):
        z, _ = state.closure(x, z, p)
    return z


def moved(system, state, times, u=None, *, start=None, tolerance=1e-11, method="dopri5"):
    """The motion at given times; u(t) gives the list of inputs, zeros when left out."""
    x0, z0 = start_of(system, state) if start is None else start
    t, w = SX.sym("t"), SX.sym("w", len(x0) + len(z0))
    p = SX.sym("p", state.rhs.numel_in(4))
    given = SX.zeros(state.rhs.numel_in(3)) if u is None else SX(casadi.vertcat(*u(t)))
    x, z = _closed(state, w, len(x0), _parameters(state, p), 1)
    point = [t, x, z, given, p]
    xdot, y = state.rhs.call(point)
    rhs = Function("rhs", [t, w, p], [casadi.vertcat(xdot, _lead(state, point, xdot))])
    observe = Function("observe", [t, w, p], [x, z, y])
    w0, own = np.concatenate([x0, z0]), system.p_default
    options = {"p": own, "method": method, "rtol": tolerance, "atol": tolerance}
    if state.events is None:
        table, modes, log = integrate(rhs, w0, times, **options), np.zeros((len(times), 0)), ()
    else:
        motion = integrate_events(rhs, w0, times, _events(state, point, w, w0, own), **options)
        table, modes, log = motion.x, motion.modes, motion.events
    rows = [observe(s, row, [*own, *m]) for s, row, m in zip(times, table, modes, strict=True)]
    x, z, y = (np.array([np.array(row[k])[:, 0] for row in rows]) for k in range(3))
    return Run(np.array(times), x, z, y, modes, log)


def _closed(state, w, nx, p, steps):
    x, z = w[:nx], w[nx:]
    return x, closing(state, x, z, p, steps)


def _parameters(state, p):
    """The parameters alone, of those with modes behind them."""
    modes = 0 if state.events is None else len(state.events.modes)
    return casadi.vertsplit(p, [0, p.numel() - modes, p.numel()])[0]


def _lead(state, point, xdot):
    """How the dependent positions follow x."""
    if state.closure is None:
        return SX(0, 1)
    _, x, z, _, p = point
    p = _parameters(state, p)
    symbols = [SX.sym("x", x.numel()), SX.sym("z", z.numel()), SX.sym("p", p.numel())]
    dx = SX.sym("dx", x.numel())
    after = state.closure(*symbols)[0]
    lead = Function("lead", [*symbols, dx], [casadi.jtimes(after, symbols[0], dx)])
    return lead(x, z, p, xdot)


def _events(state, point, w, w0, own):
    t, x, _, _, p = point
    nx = x.numel()
    fired = SX.sym("fired", len(state.events.names))
    after, modes = state.events.jump(*point, fired)
    _, closed = _closed(state, casadi.vertcat(after, w[nx:]), nx, _parameters(state, p), 3)
    start = Function("start", [t, w, p], state.events.first.call(point))
    n_modes = len(state.events.modes)
    first, beyond = start(0.0, w0, [*own, *[0.0] * n_modes])
    assert np.max(np.array(beyond)) <= 0
    return Events(
        Function("indicators", [t, w, p], [state.events.indicators(*point)]),
        Function("jump", [t, w, p, fired], [casadi.vertcat(after, closed), modes]),
        np.array(first)[:, 0],
    )
