"""Event indicators of crossings that may stay at zero, or pass it infinitely often."""

from __future__ import annotations

from typing import Any

import casadi
from casadi import SX

GUARD_MODES = 4
"""Number of modes per crossing: place, whether asleep, number of events in a row, time of event."""
_OFTEN = 4
"""Number of events in a row after which a crossing is not watched for a pause: a body that bounces
between two sides of a law, or comes to rest by friction, has infinitely many events."""
_CROWDED = 1e-5
"""Length of a tick, as a fraction of the duration. Events within 1 or 2 ticks are in a row."""
_IN_A_ROW = 2.0
"""Number of ticks since the last event below which events are in a row; the time of the last event
is rounded down to a tick."""
_WRAP = 1e9
"""Number of ticks after which the tick count restarts, so that it fits in 32 bits."""
_SHORTEST_PAUSE, _LONGEST_PAUSE = 1e-6, 0.02
"""Factor and upper limit of the pause without watching, as fractions of the duration. The pause
doubles with every event in a row and reaches the limit, 1/50 of the duration, after 15 events."""


def ticks_of(t: Any, duration: Any) -> Any:
    """Convert a time [s] to ticks for a given duration of the motion [s]."""
    return t / (_CROWDED * duration)


def tick(t: Any, duration: Any) -> Any:
    """Return the number of the tick of a time [s]; it restarts after `_WRAP` ticks."""
    return casadi.fmod(casadi.floor(ticks_of(t, duration)), _WRAP)


def guard(t: SX, values: SX, counts: int, modes: SX, fired: SX, duration: Any) -> tuple[SX, SX]:
    """Return the indicators of crossings and their modes after an event, without chattering.

    A crossing may stay at zero or pass it repeatedly. After `_OFTEN` events in a row it is asleep
    for a pause: its events are not located, and only error control handles the law.

    The modes are four columns of k elements: places; 1 for each sleeping crossing; the number of
    events in a row; the time of the last event [ticks, see `ticks_of`]. The place of a side is its
    sign, 1 or -1, or 0 while the value stays exactly zero. The place of a count is its integer
    part, rounded down. Events within `_IN_A_ROW` ticks are in a row.

    Args:
        t: time [s].
        values: (k, 1) values of the crossings, sides first, counts last.
        counts: number of counts.
        modes: (4 k, 1) modes before the event.
        fired: (k + counts, 1) 1 for each indicator that is not positive: of the sides, of counts
            that fall, of counts that rise.
        duration: duration of the motion [s].

    Returns:
        Indicators (k + counts, 1) and modes (4 k, 1) after the event.
    """
    k = values.numel()
    if not k:
        return SX(0, 1), SX(0, 1)
    n = k - counts
    places, asleep, row, last = casadi.vertsplit(modes, [0, k, 2 * k, 3 * k, 4 * k])
    side, count = casadi.vertsplit(places, [0, n, k])
    on_side, counted = casadi.vertsplit(values, [0, n, k])
    passed, falls, rises = casadi.vertsplit(fired, [0, n, k, k + counts])
    # indicators
    elapsed = casadi.fmod(ticks_of(t, duration) - last, _WRAP)
    pause = casadi.fmin(_SHORTEST_PAUSE * 2**row, _LONGEST_PAUSE) / _CROWDED
    stays = casadi.if_else(on_side == 0, 1, -1)
    awake = casadi.vertcat(
        casadi.if_else(side == 0, stays, side * on_side), counted - count, count + 1 - counted
    )
    both = [
        casadi.vertcat(one, casadi.vertsplit(one, [0, n, k])[1])
        for one in (asleep, pause - elapsed)
    ]
    indicators = casadi.if_else(both[0], both[1], awake)
    # next modes
    happened = casadi.vertcat(passed, casadi.fmax(falls, rises))
    here = casadi.vertcat(casadi.sign(on_side), casadi.floor(counted))
    beyond = casadi.vertcat(
        casadi.if_else(side == 0, casadi.sign(on_side), -side), count + rises - falls
    )
    soon = casadi.logic_or(asleep, elapsed < _IN_A_ROW)
    in_row = casadi.if_else(soon, row + 1, 0)
    tired = casadi.logic_and(casadi.logic_not(asleep), in_row > _OFTEN)
    now = tick(t, duration)
    then = casadi.vertcat(
        casadi.if_else(happened, casadi.if_else(asleep, here, beyond), places),
        casadi.if_else(happened, tired, asleep),
        casadi.if_else(happened, in_row, row),
        casadi.if_else(happened, now, last),
    )
    return indicators, then
