"""Modes and events of the crossings of laws, in simulations and in FMUs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi
from casadi import SX, Function

from mbs.models.state.arguments import Point
from mbs.models.state.crossings import WatchedCrossings
from mbs.models.state.events import StateEvents
from mbs.models.state.guard import GUARD_MODES, guard, tick
from mbs.models.state.held_conditions import hold_sides
from mbs.models.symbols import dense_function

CONTACTS = "contacts"
"""Prefix of the names of contact crossings in FMUs."""
DURATION = "duration"
"""Name of the last mode in a simulation, the duration of the motion [s]."""
_SPAN = 1.0
"""Duration of the motion that is assumed in an FMU to detect events in a row [s], because an FMU
does not know the duration of its simulation."""


@dataclass(frozen=True, slots=True, eq=False)
class CrossingModes:
    """Modes that crossings add to the functions of a state equation, after other modes.

    In an FMU every crossing is guarded, and the duration is assumed. In a simulation contacts are
    always watched: their mode is the side, 1 or -1.

    Attributes:
        point: symbols of the arguments without modes: t and x first, the parameters p last.
        before: (b, 1) symbols of the other modes.
        values: crossings as expressions of `point` and `before`.
        watched: (c, 1) modes of the contacts if they are always watched; else empty.
        guarded: (4 k, 1) modes of the other crossings, see `guard`.
        duration: duration of the motion [s], the last mode; empty in an FMU.
    """

    point: Point
    before: SX
    values: WatchedCrossings
    watched: SX
    guarded: SX
    duration: SX

    @property
    def _known(self) -> list[SX]:
        """Arguments of the functions without the modes of crossings."""
        *others, p = self.point
        return [*others, casadi.vertcat(p, self.before)]

    @property
    def symbols(self) -> list[SX]:
        """Arguments of the functions with the modes of crossings."""
        *others, p = self._known
        return [*others, casadi.vertcat(p, self.watched, self.guarded, self.duration)]

    @property
    def _watched_values(self) -> SX:
        """(c, 1) values of the crossings that are always watched."""
        return self._split_values[0]

    @property
    def _guarded_values(self) -> SX:
        """(k, 1) values of the guarded crossings."""
        return self._split_values[1]

    @property
    def _split_values(self) -> list[SX]:
        every = self.values.every
        return list(casadi.vertsplit(every, [0, self.watched.numel(), every.numel()]))

    @property
    def _span(self) -> SX | float:
        """Duration of the motion that `guard` assumes [s]."""
        return self.duration if self.duration.numel() else _SPAN

    def idle(self, function: Function) -> Function:
        """Return a function with the modes of crossings, on which it does not depend."""
        return Function(function.name(), self.symbols, function.call(self._known))

    def held(self, function: Function) -> Function:
        """Return a state equation in which modes replace the conditions of its laws.

        Conditions of contacts, whose laws do not jump, are not replaced.
        """
        return hold_sides(
            function,
            self._known,
            self._guarded_values,
            self.guarded,
            self.values.counts.numel(),
            self.symbols,
            loose=0 if self.watched.numel() else self.values.contacts.numel(),
        )

    def events(self, others: StateEvents | None, source: str) -> StateEvents:
        """Return other events, followed by the events of crossings, which only change modes.

        Args:
            others: events with the modes `before`, or None.
            source: prefix of the names of the crossings.
        """
        t, x = self.point[:2]
        n_before = len(others.names) if others else 0
        k, m = self._guarded_values.numel(), self.values.counts.numel()
        c = self.watched.numel()
        fired = SX.sym("fired", n_before + c + k + m)
        fired_before, fired_watched, fired_guarded = casadi.vertsplit(
            fired, [0, n_before, n_before + c, n_before + c + k + m]
        )
        values = self._guarded_values
        guards, then = guard(t, values, m, self.guarded, fired_guarded, self._span)
        first, beyond, indicators = SX(0, 1), SX(0, 1), SX(0, 1)
        after, now = x, self.before
        if others:
            first, beyond = others.first.call(self._known)
            (indicators,) = others.indicators.call(self._known)
            there, changed = others.jump.call([*self._known, fired_before])
            jumps = casadi.mmax(fired_before)
            after = casadi.if_else(jumps, there, x)
            now = casadi.if_else(jumps, changed, self.before)
        side = self.watched
        turned = casadi.if_else(fired_watched > 0, -side, side)
        names = [f"{CONTACTS}.side{j + 1}" for j in range(self.values.contacts.numel())]
        names += [f"{source}.side{j + 1}" for j in range(self.values.sides.numel())]
        names += [f"{source}.count{j + 1}" for j in range(m)]
        kinds, guarded_names = ("place", "asleep", "row", "time"), names[c:]
        return StateEvents(
            modes=(
                *(others.modes if others else ()),
                *names[:c],
                *(f"{name}.{kind}" for kind in kinds for name in guarded_names),
                *(DURATION for _ in range(self.duration.numel())),
            ),
            names=(
                *(others.names if others else ()),
                *names[: len(names) - m],
                *(f"{name} {what}" for what in ("falls", "rises") for name in names[c + k - m :]),
            ),
            first=dense_function(
                "first",
                self.symbols,
                [
                    casadi.vertcat(first, self._starts(), self.duration),
                    casadi.vertcat(beyond, -SX.ones(c + k + m)),
                ],
            ),
            indicators=dense_function(
                "indicators",
                self.symbols,
                [casadi.vertcat(indicators, side * self._watched_values, guards)],
            ),
            jump=dense_function(
                "jump",
                [*self.symbols, fired],
                [after, casadi.vertcat(now, turned, then, self.duration)],
            ),
            approaches=self._approaches(others),
        )

    def _starts(self) -> SX:
        """Return the modes at the start, without the duration: all awake, no events before."""
        k, m = self._guarded_values.numel(), self.values.counts.numel()
        sides, counts = casadi.vertsplit(self._guarded_values, [0, k - m, k])
        watched = casadi.if_else(self._watched_values > 0, 1, -1)
        since = tick(self.point[0], self._span)
        return casadi.vertcat(
            watched,
            casadi.sign(sides),
            casadi.floor(counts),
            SX.zeros(2 * k),
            casadi.repmat(since, k, 1),
        )

    def _approaches(self, others: StateEvents | None) -> Function | None:
        """Return the function `approaches` of the events, None if all are zero."""
        near = self.values.approaches
        known = others.approaches if others else None
        c, k, m = near.shape[0], self._guarded_values.numel(), self.values.counts.numel()
        if not c and known is None:
            return None
        place, awake = self.watched, SX.ones(c)
        if not self.watched.numel():
            place, _, asleep, _ = casadi.vertsplit(self.guarded, [0, c, k, k + c, 4 * k])
            awake = casadi.logic_and(casadi.logic_not(asleep), place)
        first = SX.zeros(len(others.names) if others else 0, 3)
        if known is not None:
            (first,) = known.call(self._known)
        rows = casadi.horzcat(near * casadi.repmat(awake, 1, 2), place > 0)
        left = SX.zeros(self.watched.numel() + k + m - c, 3)
        return dense_function("approaches", self.symbols, [casadi.vertcat(first, rows, left)])


def crossing_modes(
    point: Point, before: int, crossings: Function, *, in_simulation: bool
) -> CrossingModes:
    """Return the modes of crossings in a state equation.

    Args:
        point: symbols of the arguments without modes.
        before: number of other modes, which follow the parameters.
        crossings: function of the arguments, without or with the other modes, that returns the
            elements of `WatchedCrossings`.
        in_simulation: whether contacts are always watched and the duration is a mode.
    """
    *others, p = point
    modes = SX.sym("modes", before)
    own = casadi.vertcat(p, modes) if crossings.numel_in(len(others)) != p.numel() else p
    values = WatchedCrossings(*crossings.call([*others, own]))
    count, contacts = values.every.numel(), values.contacts.numel()
    n_watched = contacts if in_simulation else 0
    return CrossingModes(
        point=point,
        before=modes,
        values=values,
        watched=SX.sym("watched", n_watched),
        guarded=SX.sym("guarded", GUARD_MODES * (count - n_watched)),
        duration=SX.sym("duration", int(in_simulation and count > n_watched)),
    )


def add_crossings(
    crossings: Function | None,
    point: Point,
    functions: Sequence[Function],
    events: StateEvents | None,
    source: str,
) -> tuple[list[Function], StateEvents | None]:
    """Return functions and events of an FMU with the modes of crossings.

    Args:
        crossings: function of `point` that returns the elements of `WatchedCrossings`, or None.
        point: symbols t, x, z, u and p, without modes.
        functions: state equations in which modes replace the conditions of laws.
        events: other events, or None.
        source: prefix of the names of the crossings.
    """
    if crossings is None:
        return list(functions), events
    before = len(events.modes) if events else 0
    own = crossing_modes(point, before, crossings, in_simulation=False)
    return [own.held(function) for function in functions], own.events(events, source)


def with_more_modes(function: Function, count: int) -> Function:
    """Return a function of (t, x, z, u, p) with `count` more, unused modes at the end of p."""
    if not count:
        return function
    symbols = [SX.sym(f"i{k}", function.numel_in(k)) for k in range(function.n_in())]
    more = casadi.vertcat(symbols[4], SX.sym("more", count))
    wide = [*symbols[:4], more, *symbols[5:]]
    return Function(function.name(), wide, function.call(symbols))
