"""Events of an integration with discrete modes: what a caller gives, and what comes back."""

from dataclasses import dataclass

import casadi
import numpy as np
import numpy.typing as npt

from mbs.errors import Interrupted, SolverError

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Events:
    """Where the state and the modes jump, and how.

    Modes are numbers that are constant between events. All functions of the integration take them
    as the last of their parameters.

    Attributes:
        indicators: `indicators(t, x, p) -> g`, positive between events. An event is where one of
            them is not positive any more. After the jump each must be positive, or leave zero
            upwards.
        jump: `jump(t, x, p, fired) -> (x, modes)`, state and modes after an event; fired is 1 for
            each indicator that is not positive, 0 for the others. Without modes x alone will do.
        modes: (nm,) at the start.
    """

    indicators: casadi.Function
    jump: casadi.Function
    modes: npt.ArrayLike = ()


@dataclass(frozen=True, slots=True, eq=False)
class Event:
    """One event of a motion.

    Attributes:
        time: [s].
        fired: numbers of the indicators that asked for jumps.
        modes: (nm,) after it.
    """

    time: float
    fired: tuple[int, ...]
    modes: Array


@dataclass(frozen=True, slots=True, eq=False)
class EventMotion:
    """A motion with events.

    Attributes:
        x: (m, nx) states at the times asked for, those that were reached; at the time of an event,
            after it.
        modes: (m, nm) modes at these times.
        events: in the order of time.
        stop: why not all the times were reached; None where they were.
    """

    x: Array
    modes: Array
    events: tuple[Event, ...]
    stop: SolverError | Interrupted | None = None


def fired_of(flags: npt.ArrayLike) -> tuple[int, ...]:
    """Numbers of the indicators whose flag is set."""
    return tuple(np.flatnonzero(flags).tolist())


def modes_at(times: Array, first: Array, events: tuple[Event, ...]) -> Array:
    """(m, nm) modes at given times; at the time of an event, after it.

    Args:
        times: (m,) s, increasing.
        first: (nm,) modes before the first event.
        events: in the order of time.
    """
    values = np.array([first, *(event.modes for event in events)])
    passed = np.searchsorted([event.time for event in events], times, side="right")
    return values[passed]
