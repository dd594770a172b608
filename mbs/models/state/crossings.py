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
from mbs.models.state.drive import DriveInputs
from mbs.models.state.events import StateEvents
from mbs.models.state.laws import Conditions, conditions_of, distinct
from mbs.models.symbols import dense_function
from mbs.operations.graph import Graph, Node, Port, function_of, graph_of, value_of
from mbs.recursions.parts import PartsAt

# Crossings that may stay at zero, or pass it infinitely often.


CONTACTS = "contacts"
"""Prefix of the names of contact crossings in FMUs."""
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


# Crossings in the state equations of FMUs.


_SPAN = 1.0
"""Duration of the motion that is assumed in an FMU to detect events in a row [s], because an FMU
does not know the duration of its simulation."""


@dataclass(frozen=True, slots=True, eq=False)
class WatchedCrossings:
    """Crossings of a state equation.

    Attributes:
        sides: (n, 1) values at whose zeros laws jump or bend, sides of the k contacts first.
        counts: (m, 1) values at whose integer values laws jump.
        approaches: (k, 2) speeds and paces of the k contacts, as in `Approach`.
    """

    sides: SX
    counts: SX
    approaches: SX = field(default_factory=lambda: SX(0, 2))


def part_crossings(system: System) -> Function | None:
    """Return `f(q, v, z, u, p) -> sides, counts, approaches` at which component laws jump.

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
    found = _function(point, [*others, *laws.crossings], laws.counts, states)
    if not contacts:
        return found
    sides, counts = (SX(0, 1), SX(0, 1)) if found is None else found.call(point)
    every = casadi.vertcat(*(one.value for one in contacts), sides)
    return dense_function("crossings", point, [every, counts, parts.approaches(contacts)])


def drive_crossings(system: System, drive: DriveInputs, extra: int) -> Function | None:
    """Return `f(t, q, v, w, p) -> sides, counts` at which the control laws of a drive jump.

    Args:
        system: open or closed system.
        drive: drive, with or without laws.
        extra: number of the inputs w of the laws.

    Returns:
        Function, or None if no law jumps or if laws are external functions.
    """
    laws = [law for law in (drive.effort, drive.device) if law is not None]
    if not laws or not all(law.is_a("SXFunction") for law in laws):
        return None
    t, q, v = SX.sym("t"), SX.sym("q", system.nq), SX.sym("v", system.nv)
    point = [t, q, v, SX.sym("w", extra), system.p]
    values = [casadi.vec(law.call(point)[0]) for law in laws]
    found = _jumps(casadi.vertcat(*values), t, q, system.p)
    sides = [*found.crossings, *found.zeros]
    return _function(point, sides, [*found.counts, *found.wholes], casadi.vertcat(t, q, v))


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


def _function(
    point: Sequence[SX], sides: Sequence[SX], counts: Sequence[SX], of: SX
) -> Function | None:
    """Return the Function of the expressions that depend on the symbols `of`, None if empty."""
    kept = [
        [value for value in distinct(values, []) if casadi.depends_on(value, of)]
        for values in (sides, counts)
    ]
    if not any(kept):
        return None
    return dense_function("crossings", list(point), [casadi.vertcat(SX(0, 1), *v) for v in kept])


def join_crossings(
    events: StateEvents | None, values: WatchedCrossings, point: Sequence[SX], source: str
) -> StateEvents:
    """Append the events of crossings, which only change modes.

    Args:
        events: other events, or None.
        values: expressions of the crossings in the symbols `point`.
        point: symbols t, x, z, u and p, without modes.
        source: prefix of the names of the crossings.
    """
    sides, counts, near = values.sides, values.counts, values.approaches
    k, n, m = sides.numel() + counts.numel(), sides.numel(), counts.numel()
    *others, p = point
    t, x = point[:2]
    c = near.shape[0]
    names = [f"{CONTACTS}.side{j + 1}" for j in range(c)]
    names += [f"{source}.side{j + 1}" for j in range(n - c)]
    names += [f"{source}.count{j + 1}" for j in range(m)]
    before = SX.sym("modes", len(events.modes) if events else 0)
    own, known = SX.sym("own", GUARD_MODES * k), len(events.names) if events else 0
    every = [*others, casadi.vertcat(p, before, own)]
    fired = SX.sym("fired", known + k + m)
    first_fired, own_fired = casadi.vertsplit(fired, [0, known, known + k + m])
    starts = casadi.vertcat(casadi.sign(sides), casadi.floor(counts), SX.zeros(2 * k))
    since = casadi.fmod(casadi.floor(ticks_of(t, _SPAN)), _WRAP)
    starts = casadi.vertcat(starts, casadi.repmat(since, k, 1))
    watched, then = guard(t, casadi.vertcat(sides, counts), m, own, own_fired, _SPAN)
    first, beyond, indicators, after, now = SX(0, 1), SX(0, 1), SX(0, 1), x, before
    if events:
        at = [*others, casadi.vertcat(p, before)]
        first, beyond = events.first.call(at)
        (indicators,) = events.indicators.call(at)
        there, changed = events.jump.call([*at, first_fired])
        jumps = casadi.mmax(first_fired)
        after, now = casadi.if_else(jumps, there, x), casadi.if_else(jumps, changed, before)
    kinds = ("place", "asleep", "row", "time")
    approaches = None
    if c or (events and events.approaches is not None):
        place, asleep = own[:c], own[k : k + c]
        awake = casadi.logic_and(casadi.logic_not(asleep), place)
        known_rows = SX.zeros(known, 3)
        if events and events.approaches is not None:
            (known_rows,) = events.approaches.call([*others, casadi.vertcat(p, before)])
        rows = casadi.horzcat(near * casadi.repmat(awake, 1, 2), place > 0)
        rows = casadi.vertcat(known_rows, rows, SX.zeros(k + m - c, 3))
        approaches = dense_function("approaches", every, [rows])
    return StateEvents(
        modes=(
            *(events.modes if events else ()),
            *(f"{name}.{kind}" for kind in kinds for name in names),
        ),
        names=(
            *(events.names if events else ()),
            *names[:n],
            *(f"{name} {what}" for what in ("falls", "rises") for name in names[n:]),
        ),
        first=dense_function(
            "first",
            every,
            [casadi.vertcat(first, starts), casadi.vertcat(beyond, -SX.ones(k + m))],
        ),
        indicators=dense_function("indicators", every, [casadi.vertcat(indicators, watched)]),
        jump=dense_function("jump", [*every, fired], [after, casadi.vertcat(now, then)]),
        approaches=approaches,
    )


def with_part_crossings(
    system: System,
    events: StateEvents | None,
    motion: tuple[SX, SX],
    point: Sequence[SX],
    *,
    wanted: bool,
) -> tuple[StateEvents | None, WatchedCrossings]:
    """Append the events of component crossings, and return them with the crossings.

    Args:
        system: open or closed system.
        events: other events, or None.
        motion: positions and velocities of the tree.
        point: symbols t, x, z, u and p, without modes.
        wanted: whether crossings are included; if not, `events` is returned.
    """
    found = part_crossings(system) if wanted else None
    if found is None:
        return events, WatchedCrossings(SX(0, 1), SX(0, 1))
    values = WatchedCrossings(*found.call([*motion, system.z, system.u, system.p]))
    return join_crossings(events, values, point, "laws"), values


def held_by(function: Function, values: WatchedCrossings, point: Sequence[SX]) -> Function:
    """Return a function of the same arguments, with the modes of crossings at the end of p.

    The conditions in the function are replaced by these modes.

    Args:
        function: state equation; its p may end with other modes.
        values: expressions of the crossings in the symbols `point`. Conditions of contacts, whose
            laws do not jump, are not replaced.
        point: symbols t, x, z, u and p, without modes.
    """
    sides, counts = values.sides, values.counts
    k = sides.numel() + counts.numel()
    if not k:
        return function
    *others, p = point
    before = SX.sym("before", function.numel_in(len(others)) - p.numel())
    modes = SX.sym("own", GUARD_MODES * k)
    at, inputs = [*others, casadi.vertcat(p, before)], [*others, casadi.vertcat(p, before, modes)]
    every, loose = casadi.vertcat(sides, counts), values.approaches.shape[0]
    return hold_sides(function, at, every, modes, counts.numel(), inputs, loose=loose)


def with_more_modes(function: Function, count: int) -> Function:
    """Return a function of (t, x, z, u, p) with `count` more, unused modes at the end of p."""
    if not count:
        return function
    symbols = [SX.sym(f"i{k}", function.numel_in(k)) for k in range(function.n_in())]
    more = casadi.vertcat(symbols[4], SX.sym("more", count))
    wide = [*symbols[:4], more, *symbols[5:]]
    return Function(function.name(), wide, function.call(symbols))
