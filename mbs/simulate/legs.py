"""Integration in one leg, or in several: over-constrained loops whose independent rows change.

In a loop such as Bennett's, which rows of the closing joint are independent changes with the
configuration: no choice holds all the way round. Steps in local tangent coordinates use all rows,
and need no choice. Where there are none, as for laws that CasADi cannot write as C, a leg ends
where its rows have lost most of their independence, and the next one begins there with rows that
are chosen for that configuration.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import casadi
import numpy as np
from casadi import SX, Function
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.errors import Interrupted, SolverError
from mbs.loops.analysis import rows_at
from mbs.loops.examine import row_independence
from mbs.loops.rolling import least_upright, rolling_discs
from mbs.loops.scales import scales
from mbs.loops.velocity import constraint_jacobian
from mbs.models.full_state import FullState
from mbs.simulate.contacts import ContactMotion, first_modes
from mbs.solvers import EventMotion, Events, integrate_events
from mbs.solvers.compiled_run import is_compilable
from mbs.solvers.failures import failed

Array = NDArray[np.float64]

_LOST = 0.05
"""Part of its independence at the start of a leg at which a leg ends."""
_SINGULAR = 1e-6
"""Independence below which a configuration is singular for all rows: a thousandth, as a sine."""
_FLAT = 1e-3
"""Sine of the angle between a rolling disc and its plane at which it counts as flat."""

Stop = SolverError | Interrupted | None
"""Why a motion ends early; None where it does not."""


@dataclass(frozen=True, slots=True, eq=False)
class Leg:
    """A part of a motion with one state equation.

    Attributes:
        state: its equations.
        times: (m,) s, that were reached.
        x: (m, nx) states at these times.
        contact: what rigid stops and dry friction do meanwhile, None where there are none.
    """

    state: FullState
    times: Array
    x: Array
    contact: ContactMotion | None = None

    @property
    def without_start(self) -> Leg:
        """The same without its first row, which belongs to the leg before."""
        return Leg(self.state, self.times[1:], self.x[1:])

    def observed(self, p: Sequence[float]) -> list[Array]:
        """What the state equation observes, (m, ..) each."""
        observe, count = self.state.observe, len(self.times)
        if not count:
            return [np.empty((0, observe.numel_out(k))) for k in range(observe.n_out())]
        own = np.repeat(np.array(p, dtype=float).reshape(-1, 1), count, axis=1)
        every = own if self.contact is None else np.vstack([own, self.contact.modes.T])
        values = observe.map(count)(self.times.reshape(1, -1), self.x.T, every)
        return [np.array(value).T for value in values]


def integrated(
    system: System,
    equations: Callable[[System], FullState],
    x0: Array,
    times: Array,
    p: Sequence[float],
    **options: Any,
) -> tuple[list[Leg], Stop]:
    """The motion at given times, in one leg for most systems, and why it ends before the last.

    Args:
        system: open or closed.
        equations: the state equation of a system that differs in its independent rows alone.
        x0: (nx,) state at the first time.
        times: (m,) s, increasing.
        p: (np,) parameters.
        options: of `integrate`.

    Returns:
        the legs that were reached, one at least; None where they reach the last time, or else why
        they do not: the message says when and in which configuration, and at a singular one the
        joint that the loops do not hold.
    """
    legs, stop = _integrated(system, equations, x0, times, p, **options)
    if isinstance(stop, SolverError) and stop.state:
        q = np.array(stop.state[: system.nq])
        where = ", ".join(f"{c.name} = {x:.6g}" for c, x in zip(system.coordinates, q, strict=True))
        lost = _lost(system, q, p) if stop.singular and system.is_closed else ""
        stop = SolverError(
            f"{system.name}: {stop}; the configuration is {where}{lost}",
            state=stop.state,
            singular=stop.singular,
            time=stop.time,
        )
    return legs, stop


def _lost(system: System, q: Array, p: Sequence[float]) -> str:
    """The joint that moves most in what the rows hold least at a configuration, in words."""
    found = scales(system)
    J = np.array(constraint_jacobian(system)(q, np.array(p, dtype=float)))
    J = J * found.rows.reshape(-1, 1) * found.columns([speed.unit for speed in system.speeds])
    assert system.closure is not None
    rank = system.nv - system.closure.mobility
    if not rank or not np.isfinite(J).all():
        return ""
    free = np.linalg.svd(J)[2][rank - 1 :]  # as many directions as are free there, at the least
    moves = np.round(np.sum(free**2, axis=0), 6)  # the first of joints that move alike
    name = system.speeds[int(np.argmax(moves))].name
    return f", and the loops hardly hold {name} there"


def _integrated(
    system: System,
    equations: Callable[[System], FullState],
    x0: Array,
    times: Array,
    p: Sequence[float],
    **options: Any,
) -> tuple[list[Leg], Stop]:
    state = equations(system)
    if system.closure is not None and system.closure.varies:
        if state.passage is None or not is_compilable(state.rhs):
            return _with_other_rows(system, equations, x0, times, p, options)
        q, parameters = x0[: system.nq], np.array(p, dtype=float)
        if float(row_independence(system)(q, parameters)) < _SINGULAR:
            state = equations(rows_at(system, q, parameters))  # the start may be regular for others
    if state.events is not None:
        return _with_contacts(system, state, x0, times, p, options)
    discs = [disc.name for _, disc in rolling_discs(system)]
    if discs:
        upright = Limit(least_upright(system), _FLAT)
        leg, motion = _leg(system, state, x0, times, p, upright, options)
        if not motion.events:
            return [leg], motion.stop
        end = motion.events[0].time
        return [leg], SolverError(
            f"{system.name}: {' or '.join(discs)} lies flat on its plane at t = {end:.6g} s, where"
            " no single point of a disc touches; end the run before, or keep it upright",
            time=end,
        )
    motion = _motion(state, x0, times, None, p, options)
    return [Leg(state, times[: len(motion.x)], motion.x)], motion.stop


def _motion(
    state: FullState,
    x0: Array,
    times: Array,
    events: Events | None,
    p: Sequence[float],
    options: dict[str, Any],
) -> EventMotion:
    """The motion as far as it comes."""
    return integrate_events(
        state.rhs,
        x0,
        times,
        events,
        p=p,
        project=state.project,
        passage=state.passage,
        partial=True,
        **options,
    )


@dataclass(frozen=True, slots=True, eq=False)
class Limit:
    """Where a leg ends: a measure of the configuration falls below a level.

    Attributes:
        measure: `measure(q, p)`.
        level: of the measure.
    """

    measure: Function
    level: float


def _with_other_rows(
    system: System,
    equations: Callable[[System], FullState],
    x0: Array,
    times: Array,
    p: Sequence[float],
    options: dict[str, Any],
) -> tuple[list[Leg], Stop]:
    """Legs of an over-constrained system, each with rows that suit its first posture."""
    legs: list[Leg] = []
    start = Leg(equations(system), times[:1], x0.reshape(1, -1))
    system, limit = _next(system, x0[: system.nq], np.array(p, dtype=float))
    if limit is None:
        moves = x0[system.nq : system.nq + system.nv].any()
        reason = "singular" if moves else "undetermined"
        return [start], failed(float(times[0]), 0.0, reason, state=x0.tolist())
    left = times
    known: dict[tuple[int, ...], tuple[System, FullState]] = {}
    while True:
        assert system.closure is not None
        rows = (*system.closure.rows, -1, *system.closure.slips)
        if rows not in known:
            known[rows] = system, equations(system)
        system, state = known[rows]
        leg, motion = _leg(system, state, x0, left, p, limit, options)
        legs.append(leg if not legs else leg.without_start)
        if motion.stop is not None or not motion.events:
            return legs, motion.stop
        x0, end = motion.x[-1], motion.events[0].time
        left = left[left > end]
        if not len(left):
            return legs, None
        left = np.concatenate([[end], left])
        system, limit = _next(system, x0[: system.nq], np.array(p, dtype=float))
        if limit is None:
            return legs, failed(end, 0.0, "singular", state=x0.tolist())


def _with_contacts(
    system: System,
    state: FullState,
    x0: Array,
    times: Array,
    p: Sequence[float],
    options: dict[str, Any],
) -> tuple[list[Leg], Stop]:
    assert state.events is not None
    first = first_modes(system, x0, p)
    motion = _motion(state, x0, times, Events(*state.events, first), p, options)
    contact = ContactMotion(first, motion.modes, motion.events)
    return [Leg(state, times[: len(motion.x)], motion.x, contact)], motion.stop


def _leg(
    system: System,
    state: FullState,
    x0: Array,
    times: Array,
    p: Sequence[float],
    limit: Limit,
    options: dict[str, Any],
) -> tuple[Leg, EventMotion]:
    """One leg, and the motion whose first event is its end, if it ends early; it rests then."""
    n, n_p = len(x0), len(p)
    t, x, pm, fired = (SX.sym(k, m) for k, m in (("t", 1), ("x", n), ("p", n_p + 1), ("f", 1)))
    parameters, ended = pm[:n_p], pm[n_p]
    rate = casadi.if_else(
        ended, 0, state.rhs(t, x, parameters)
    )  # what has no value there is let be
    rhs = Function("rhs", [t, x, pm], [rate])
    assert state.project is not None
    moved, residual = state.project(t, x, parameters)
    kept = [casadi.if_else(ended, x, moved), casadi.if_else(ended, 0, residual)]
    project = Function("project", [t, x, pm], kept)
    left = limit.measure(x[: system.nq], parameters) - limit.level
    events = Events(
        Function("lost", [t, x, pm], [casadi.if_else(ended, 1, left)]),
        Function("end", [t, x, pm, fired], [x, SX(1)]),
        [0.0],
    )
    motion = integrate_events(rhs, x0, times, events, p=p, project=project, partial=True, **options)
    reached = times[: len(motion.x)]
    before = reached <= (motion.events[0].time if motion.events else np.inf)
    return Leg(state, reached[before], motion.x[before]), motion


def _next(system: System, q: Array, p: Array) -> tuple[System, Limit | None]:
    """The system with rows that suit a configuration better, and where its leg ends.

    No leg begins where all rows are dependent.
    """
    better = rows_at(system, q, p)
    old, new = (float(row_independence(one)(q, p)) for one in (system, better))
    chosen, now = (better, new) if new > 2 * old else (system, old)
    limit = Limit(row_independence(chosen), _LOST * now) if now >= _SINGULAR else None
    return chosen, limit
