"""Discontinuities of force and control laws as events with modes, for simulations and FMUs.

A side is an expression at whose sign change a law jumps or bends, such as the condition of an
if_else. A count is an expression at whose integer values a law jumps, such as the argument of
floor. A crossing is a side or a count.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import casadi
import numpy as np
from casadi import SX, Function
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.errors import ModelError
from mbs.models.state.arguments import Point, StateArguments
from mbs.models.state.drive import DriveInputs
from mbs.models.state.events import StateEvents
from mbs.models.state.laws import Conditions, conditions_of, distinct
from mbs.models.symbols import dense_function
from mbs.operations.graph import Graph, Node, Port, function_of, graph_of, value_of
from mbs.recursions.parts import PartsAt

# Crossings that may stay at zero, or pass it infinitely often.


CONTACTS = "contacts"
"""Prefix of the names of contact crossings in FMUs."""
DURATION = "duration"
"""Name of the last mode in a simulation, the duration of the motion [s]."""
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
    now = casadi.fmod(casadi.floor(ticks_of(t, duration)), _WRAP)
    then = casadi.vertcat(
        casadi.if_else(happened, casadi.if_else(asleep, here, beyond), places),
        casadi.if_else(happened, tired, asleep),
        casadi.if_else(happened, in_row, row),
        casadi.if_else(happened, now, last),
    )
    return indicators, then


# Laws whose conditions are constant during a step.
#
# The conditions of the laws are identified in the graph of a state equation by their values at
# random points, and are replaced by the modes of the crossings. A step past an event then continues
# the law of its start smoothly.


_POINTS, _KNOWN, _SEED = 24, 12, 20261124
"""Number of random points at which conditions are compared, number of points that must have finite
values, and seed. Many points are needed: |x| and x are equal at half of them."""
_SIZES = -2.0, 3.0
"""Decimal exponents of the coordinates of these points: fmin(x, 5) and x differ only above 5."""
_EQUAL = 1e-9
"""Largest relative difference of equal conditions: far above rounding, far below the difference of
unequal conditions."""
_COMPARISONS = {casadi.OP_LT, casadi.OP_LE}
_ROUNDED = {casadi.OP_FLOOR: 1.0, casadi.OP_CEIL: -1.0}
"""Rounding operations, with the sign of their operand in the count."""


def hold_sides(
    function: Function,
    at: Sequence[SX],
    values: SX,
    modes: SX,
    counts: int,
    inputs: Sequence[SX],
    *,
    loose: int = 0,
) -> Function:
    """Replace the conditions in a function by the places of crossings, which are modes.

    Args:
        function: state equation.
        at: symbols of the inputs of `function`.
        values: (k, 1) expressions of the crossings in these symbols, counts last.
        modes: symbols of the modes of the crossings, as in `guard`.
        counts: number of counts.
        inputs: inputs of the result: symbols that include the symbols of `at` and the modes.
        loose: number of the first crossings whose conditions are not replaced.

    Returns:
        Function of `inputs`. Conditions that match no crossing are not replaced.
    """
    k, rest = values.numel(), modes.numel()
    try:
        graph = graph_of(function)
    except ModelError:  # the graph contains calls of other Functions
        graph = None
    watched = {*_COMPARISONS, casadi.OP_SIGN, *_ROUNDED}
    if graph is None or not any(node.op in watched for node in graph.nodes):
        return Function(function.name(), list(inputs), function.call(list(at)))
    elements = [[SX(value.nz[j]) for j in range(value.nnz())] for value in at]
    places, asleep, _ = casadi.vertsplit(modes, [0, k, 2 * k, rest])
    crossed = Function("c", list(at), [values])
    found = _found_again(graph, [n.numel() for n in at], crossed, counts, loose)
    nodes = list[SX]()
    for number, node in enumerate(graph.nodes):
        value = value_of(node, nodes, elements)
        if number in found:
            j, sign = found[number]
            free = casadi.logic_or(asleep[j], places[j] == 0) if j < k - counts else asleep[j]
            held = sign * places[j]
            if node.op in _COMPARISONS:
                held = held < 0
            value = casadi.if_else(free, value, held)
        nodes.append(value)
    outputs = [
        SX(port.sparsity, casadi.vertcat(*(nodes[j] for j in result)))
        if result
        else SX(port.sparsity)
        for port, result in zip(graph.outputs, graph.results, strict=True)
    ]
    return Function(function.name(), list(inputs), outputs)


def _found_again(
    graph: Graph, sizes: Sequence[int], crossings: Function, counts: int, loose: int
) -> dict[int, tuple[int, float]]:
    """Match the conditions in a graph with crossings: node -> (index of the crossing, sign)."""
    nodes, numbers, of_counts = list(graph.nodes), list[int](), list[bool]()
    places = list[int]()
    for number, node in enumerate(graph.nodes):
        if node.op in _COMPARISONS:
            nodes.append(Node(casadi.OP_SUB, node.args))
            places.append(len(nodes) - 1)
        elif node.op == casadi.OP_SIGN or node.op in _ROUNDED:
            places.append(node.args[0])
        else:
            continue
        numbers.append(number)
        of_counts.append(node.op in _ROUNDED)
    column = Port("conditions", casadi.Sparsity.dense(len(places), 1))
    probe = function_of(
        replace(graph, outputs=(column,), nodes=tuple(nodes), results=(tuple(places),))
    )
    random = np.random.default_rng(_SEED)
    points = [[_anywhere(random, size) for size in sizes] for _ in range(_POINTS)]
    for point in points[:_KNOWN]:  # positive parameters, whose roots are real
        point[-1] = np.abs(point[-1])
    seen, wanted = (
        np.array([np.array(f(*point)).ravel() for point in points]) for f in (probe, crossings)
    )
    sides = wanted.shape[1] - counts
    found: dict[int, tuple[int, float]] = {}
    for column_of, number in enumerate(numbers):
        op = graph.nodes[number].op
        for j in range(loose, wanted.shape[1]):
            signs = (_ROUNDED[op],) if op in _ROUNDED else (1.0, -1.0)
            for sign in signs:
                off = np.abs(seen[:, column_of] - sign * wanted[:, j])
                known = np.isfinite(off)
                same = np.all(off[known] <= _EQUAL * (1 + np.abs(wanted[known, j])))
                if of_counts[column_of] == (j >= sides) and known.sum() >= _KNOWN and same:
                    found.setdefault(number, (j, sign))
    return found


def _anywhere(random: np.random.Generator, size: int) -> NDArray[np.float64]:
    """Return random numbers of many orders of magnitude and both signs."""
    return random.choice([-1.0, 1.0], size) * 10 ** random.uniform(*_SIZES, size)


# Crossings in state equations.


_SPAN = 1.0
"""Duration of the motion that is assumed in an FMU to detect events in a row [s], because an FMU
does not know the duration of its simulation."""


@dataclass(frozen=True, slots=True, eq=False)
class WatchedCrossings:
    """Crossings of a state equation.

    Attributes:
        contacts: (c, 1) sides of contacts between bodies, whose laws are continuous there.
        sides: (n, 1) values at whose zeros laws jump or bend.
        counts: (m, 1) values at whose integer values laws jump.
        approaches: (c, 2) speeds and paces of the contacts, as in `Approach`.
    """

    contacts: SX = field(default_factory=lambda: SX(0, 1))
    sides: SX = field(default_factory=lambda: SX(0, 1))
    counts: SX = field(default_factory=lambda: SX(0, 1))
    approaches: SX = field(default_factory=lambda: SX(0, 2))

    @property
    def every(self) -> SX:
        """(c + n + m, 1) values of all crossings."""
        return casadi.vertcat(self.contacts, self.sides, self.counts)


def part_crossings(system: System) -> Function | None:
    """Return `f(q, v, z, u, p)` with the crossings at which laws of components jump.

    Bends of laws are left to error control.

    Args:
        system: open or closed system.

    Returns:
        Function with the outputs of `WatchedCrossings`, or None if no law jumps.
    """
    q, v = SX.sym("q", system.nq), SX.sym("v", system.nv)
    parts = PartsAt(system, q, v)
    constants = casadi.vertcat(system.p, parts.modes())
    laws = _jumps(parts.laws(), SX(0, 1), q, constants)
    states, point = casadi.vertcat(q, v, system.z), [q, v, system.z, system.u, system.p]
    given = [one for one in parts.crossings(of_bends=False) if casadi.depends_on(one.value, states)]
    contacts = [one for one in given if not one.pace.is_zero()]
    others = [one.value for one in given if one.pace.is_zero()]
    column = casadi.vertcat(SX(0, 1), *(one.value for one in contacts))
    values = WatchedCrossings(
        contacts=column,
        sides=_distinct_of([*others, *laws.crossings], states),
        counts=_distinct_of(laws.counts, states),
        approaches=parts.approaches(contacts),
    )
    return crossings_function(StateArguments(tuple(point)), values)


def drive_crossings(system: System, drive: DriveInputs, extra: int) -> Function | None:
    """Return `f(t, q, v, w, p)` with the crossings at which the control laws of a drive jump.

    Args:
        system: open or closed system.
        drive: drive, with or without laws.
        extra: number of the inputs w of the laws.

    Returns:
        Function with the outputs of `WatchedCrossings`, or None if no law jumps or if laws are
        external functions.
    """
    laws = [law for law in (drive.effort, drive.device) if law is not None]
    if not laws or not all(law.is_a("SXFunction") for law in laws):
        return None
    t, q, v = SX.sym("t"), SX.sym("q", system.nq), SX.sym("v", system.nv)
    point = [t, q, v, SX.sym("w", extra), system.p]
    values = [casadi.vec(law.call(point)[0]) for law in laws]
    found = _jumps(casadi.vertcat(*values), t, q, system.p)
    states = casadi.vertcat(t, q, v)
    crossings = WatchedCrossings(
        sides=_distinct_of([*found.crossings, *found.zeros], states),
        counts=_distinct_of([*found.counts, *found.wholes], states),
    )
    return crossings_function(StateArguments(tuple(point)), crossings)


def _jumps(laws: SX, t: SX, q: SX, constants: SX) -> Conditions:
    """Return the conditions at which laws jump, and the bends of these conditions.

    Importers detect sign changes only. They find both zeros of |x| - a if they also stop at x = 0.
    """
    found = conditions_of(laws, t, q, constants, jumps_alone=True)
    decisive = casadi.vertcat(*found.crossings, *found.counts, *found.zeros, *found.wholes)
    inner = conditions_of(SX(decisive), t, q, constants)
    return Conditions(
        zeros=[*found.zeros, *inner.zeros],
        wholes=[*found.wholes, *inner.wholes],
        crossings=[*found.crossings, *inner.crossings],
        counts=[*found.counts, *inner.counts],
    )


def _distinct_of(values: Sequence[SX], symbols: SX) -> SX:
    """Return the distinct expressions that depend on symbols, in one column."""
    kept = (value for value in distinct(values, []) if casadi.depends_on(value, symbols))
    return casadi.vertcat(SX(0, 1), *kept)


def crossings_function(arguments: StateArguments, values: WatchedCrossings) -> Function | None:
    """Return a Function with the outputs of `WatchedCrossings`, None without crossings.

    Args:
        arguments: arguments of the Function.
        values: crossings as expressions of the arguments.
    """
    if not values.every.numel():
        return None
    outputs = [values.contacts, values.sides, values.counts, values.approaches]
    return arguments.function("crossings", outputs)


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
        since = casadi.fmod(casadi.floor(ticks_of(self.point[0], self._span)), _WRAP)
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


def with_crossings(
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
