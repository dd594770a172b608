"""Events at which laws of efforts jump or bend, added to the other events of a simulation."""

from __future__ import annotations

import math
from dataclasses import replace

import casadi
import numpy as np
from casadi import SX, Function
from numpy.typing import NDArray

from mbs.models.state.crossings import GUARD_MODES, guard, hold_sides, ticks_of
from mbs.models.state.tree import FullState
from mbs.solvers import EventMotion, Events
from mbs.solvers.problem import Passage

Array = NDArray[np.float64]


_FIRST_STEP = 1e-9
"""First step after a crossing [s]; steps grow up to tenfold each if their error is small. A contact
of two fast bodies is then resolved before the bodies pass through each other."""


def with_crossings(
    state: FullState, x0: Array, span: tuple[float, float], events: Events | None, p: Array
) -> tuple[Events, tuple[Function, Function | None, Passage | None]]:
    """Append the crossings to the events, and their modes to the functions of the state.

    The mode of a crossing is its side, 1 or -1. The state is continuous at a crossing, so a step
    may end slightly before or after it. `guard` defines the modes of sides and counts; the last
    mode is the duration.

    Args:
        state: state equation with crossings.
        x0: state at the start, (nx,).
        span: times of the start and the end [s].
        events: other events, or None.
        p: parameters (np,), without modes.
    """
    assert state.crossings is not None
    modes = () if events is None else tuple(np.ravel(np.asarray(events.modes, dtype=float)))
    if "crossings" not in state.prepared:
        state.prepared["crossings"] = _watch_crossings(state, events, len(x0), len(p), len(modes))
    (indicators, jump, approaches), functions = state.prepared["crossings"]
    t0, end = span
    duration = end - t0 or 1.0  # 1 s if only one time is requested: no events
    start = np.array(state.crossings(t0, x0, [*p, *modes]))[:, 0]
    n_guarded = state.sides + state.counts
    contacts, sides, counts = np.split(start, [len(start) - n_guarded, len(start) - state.counts])
    first_modes = [*np.where(contacts > 0, 1.0, -1.0), *np.sign(sides), *np.floor(counts)]
    if n_guarded:  # initial modes of `guard`: awake, no repeated events, since the start
        begin = float(math.floor(ticks_of(t0, duration)))
        first_modes += [*np.zeros(2 * n_guarded), *np.full(n_guarded, begin), duration]
    first_step = _FIRST_STEP if state.short else 0.0
    return Events(indicators, jump, [*modes, *first_modes], first_step, approaches), functions


def _watch_crossings(
    state: FullState, events: Events | None, n: int, own: int, modes: int
) -> tuple[
    tuple[Function, Function, Function | None], tuple[Function, Function | None, Passage | None]
]:
    """Return indicators and jump with the crossings last, and the functions with their modes.

    Args:
        state: state equation with crossings.
        events: other events, or None.
        n: number of states.
        own: number of parameters.
        modes: number of modes of the other events.
    """
    assert state.crossings is not None
    count, n_p, n_guarded = state.crossings.numel_out(0), own + modes, state.sides + state.counts
    n_contacts, n_guard_modes = count - n_guarded, GUARD_MODES * n_guarded + 1 if n_guarded else 0
    n_others = 0 if events is None else events.indicators.numel_out(0)
    ends = [0, n_others, n_others + n_contacts, n_others + count + state.counts]
    t, x, pm, fired = (
        SX.sym(name, size)
        for name, size in (
            ("t", 1),
            ("x", n),
            ("p", n_p + n_contacts + n_guard_modes),
            ("fired", ends[-1]),
        )
    )
    parameters, contact_sides, guards = casadi.vertsplit(
        pm, [0, n_p, n_p + n_contacts, n_p + n_contacts + n_guard_modes]
    )
    fired_others, fired_contacts, fired_guarded = casadi.vertsplit(fired, ends)
    at = [t, x, parameters]

    def with_all_modes(function: Function) -> Function:
        return Function(function.name(), [t, x, pm], function.call(at))

    values, guarded_values = casadi.vertsplit(state.crossings.call(at)[0], [0, n_contacts, count])
    *own_modes, duration = (
        casadi.vertsplit(guards, [0, GUARD_MODES * n_guarded, n_guard_modes])
        if n_guarded
        else [guards, guards]
    )
    guarded, then = guard(t, guarded_values, state.counts, own_modes[0], fired_guarded, duration)
    indicators = [contact_sides * values, guarded]
    state_after, after = x, [SX(0, 1)]
    if events is not None:
        indicators.insert(0, events.indicators.call(at)[0])
        jumps = casadi.mmax(fired_others)
        after_others, *changed = events.jump.call([*at, fired_others])
        state_after = casadi.if_else(jumps, after_others, x)
        after = [casadi.if_else(jumps, now, pm[own:n_p]) for now in changed if now.numel()]
    after += [casadi.if_else(fired_contacts > 0, -contact_sides, contact_sides), then, duration]
    approaches = None
    if state.approaches is not None:
        (known,) = state.approaches.call(at)
        acting = casadi.horzcat(known, contact_sides > 0)  # a contact whose depth is positive
        others = [SX.zeros(n_others, 3), acting, SX.zeros(ends[-1] - n_others - n_contacts, 3)]
        approaches = Function("approaches", [t, x, pm], [casadi.vertcat(*others)])
    watched = (
        Function("indicators", [t, x, pm], [casadi.vertcat(*indicators)]),
        Function("jump", [t, x, pm, fired], [state_after, casadi.vertcat(*after)]),
        approaches,
    )

    def held(function: Function) -> Function:
        modes = own_modes[0]
        return hold_sides(function, at, guarded_values, modes, state.counts, [t, x, pm])

    passage = state.passage
    if passage is not None:
        passage = replace(
            passage,
            rows=with_all_modes(passage.rows),
            forces=held(passage.forces),
            regularity=with_all_modes(passage.regularity),
        )
    project = None if state.project is None else with_all_modes(state.project)
    return watched, (held(state.rhs), project, passage)


def without_crossings(motion: EventMotion, events: Events | None, modes: int) -> EventMotion:
    """Remove the modes and events of crossings from a motion.

    Args:
        motion: motion with crossings.
        events: other events, or None.
        modes: number of modes of crossings.
    """
    first = 0 if events is None else events.indicators.numel_out(0)
    kept = motion.modes.shape[1] - modes
    reported = tuple(
        replace(event, fired=others, modes=event.modes[:kept])
        for event in motion.events
        if (others := tuple(k for k in event.fired if k < first))
    )
    return replace(motion, modes=motion.modes[:, :kept], events=reported)
