"""Events at which laws of efforts jump or bend, added to the other events of a simulation."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from casadi import SX, Function
from numpy.typing import NDArray

from mbs.models.state.crossing_modes import DURATION, crossing_modes
from mbs.models.state.events import StateEvents
from mbs.models.state.tree import FullState
from mbs.solvers import EventMotion, Events
from mbs.solvers.problem import Passage

Array = NDArray[np.float64]


_FIRST_STEP = 1e-9
"""First step after a crossing [s]; steps grow up to tenfold each if their error is small. A contact
of two fast bodies is then resolved before the bodies pass through each other."""


def with_crossings(
    state: FullState, x0: Array, span: tuple[float, float], p: Array, modes: Array
) -> tuple[Events, tuple[Function, Function | None, Passage | None]]:
    """Append the crossings to the events of a state equation, and their modes to its functions.

    The mode of a crossing is its side, 1 or -1. The state is continuous at a crossing, so a step
    may end slightly before or after it. `CrossingModes` defines the modes.

    Args:
        state: state equation with crossings.
        x0: state at the start, (nx,).
        span: times of the start and the end [s].
        p: parameters (np,), without modes.
        modes: modes of `state.events` at the start.

    Returns:
        Events with the modes at the start; functions rhs, project and passage with these modes.
    """
    if "crossings" not in state.prepared:
        state.prepared["crossings"] = _crossing_functions(state, len(x0), len(p), len(modes))
    events, functions = state.prepared["crossings"]
    t0, end = span
    duration = end - t0 or 1.0  # 1 s if only one time is requested: no events
    own = np.zeros(len(events.modes))
    own[: len(modes)] = modes
    if events.modes[-1] == DURATION:
        own[-1] = duration
    starts = np.array(events.first(t0, x0, [*p, *own])[0])[:, 0]
    first_modes = [*modes, *starts[len(modes) :]]
    first_step = _FIRST_STEP if state.short else 0.0
    return Events(
        events.indicators, events.jump, first_modes, first_step, events.approaches
    ), functions


def _crossing_functions(
    state: FullState, n: int, n_p: int, n_modes: int
) -> tuple[StateEvents, tuple[Function, Function | None, Passage | None]]:
    """Return the events with crossings, and rhs, project and passage with their modes.

    Args:
        state: state equation with crossings.
        n: number of states.
        n_p: number of parameters.
        n_modes: number of modes of `state.events`.
    """
    assert state.crossings is not None
    point = SX.sym("t"), SX.sym("x", n), SX.sym("p", n_p)
    own = crossing_modes(point, n_modes, state.crossings, in_simulation=True)
    passage = state.passage
    if passage is not None:
        passage = replace(
            passage,
            rows=own.idle(passage.rows),
            forces=own.held(passage.forces),
            regularity=own.idle(passage.regularity),
        )
    project = None if state.project is None else own.idle(state.project)
    return own.events(state.events, "laws"), (own.held(state.rhs), project, passage)


def without_crossings(motion: EventMotion, state: FullState, modes: int) -> EventMotion:
    """Remove the modes and events of crossings from a motion.

    Args:
        motion: motion with crossings.
        state: state equation with crossings.
        modes: number of modes of `state.events`.
    """
    first = len(state.events.names) if state.events else 0
    reported = tuple(
        replace(event, fired=others, modes=event.modes[:modes])
        for event in motion.events
        if (others := tuple(k for k in event.fired if k < first))
    )
    return replace(motion, modes=motion.modes[:, :modes], events=reported)
