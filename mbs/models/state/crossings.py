"""Crossings of laws as events: sides and counts with modes, for simulations and FMUs."""

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
from mbs.models.state.events import MinimalEvents
from mbs.models.state.laws import Conditions, conditions_of, distinct
from mbs.models.symbols import dense_function
from mbs.operations.graph import Graph, Node, Port, function_of, graph_of, value_of
from mbs.recursions.parts import PartsAt

# Crossings that may stay at zero or pass it without end.


CONTACTS = "contacts"
"""Before the names of crossings of contacts in FMUs."""
GUARD_MODES = 4
"""Modes of a guarded crossing: its place, whether it is asleep, a number and a time."""
_OFTEN = 4
"""Number of crossings in a row after which a crossing is not watched for a while: a body that
bounces between two sides of a law, or that comes to rest at a friction, passes it without end."""
_CROWDED = 1e-5
"""Part of the duration that is a tick; crossings within one or two ticks are in a row."""
_IN_A_ROW = 2.0
"""Ticks since the last crossing, whose fraction is not kept."""
_WRAP = 1e9
"""Ticks after which their number begins again, so that it is an integer of 32 bits."""
_SHORTEST_PAUSE, _LONGEST_PAUSE = 1e-6, 0.02
"""Parts of the duration for which a crossing is not watched. The pauses double, so that 16 of them
come to the longest one, and 50 of these to the duration."""


def ticks_of(t: Any, duration: Any) -> Any:
    """A time in ticks."""
    return t / (_CROWDED * duration)


def guard(t: SX, values: SX, counts: int, modes: SX, fired: SX, duration: Any) -> tuple[SX, SX]:
    """Return the indicators of crossings and their modes after an event, without chattering.

    A crossing may stay at zero, or pass it again and again. After `_OFTEN` events in a row it is
    asleep for a pause: its events are not located, and error control alone follows the law.

    The modes are four columns of k elements: places; 1 for crossings that are asleep; the number of
    events in a row; the time of the last event [ticks, see `ticks_of`]. The place of a value is its
    sign, 1 or -1; it is 0 from the time at which the value is exactly zero until the value is not.
    The place of a count is its whole number, rounded down. Events within `_IN_A_ROW` ticks of each
    other are in a row.

    Args:
        t: time [s].
        values: (k, 1) of the crossings, the counts last.
        counts: number of counts.
        modes: (4 k, 1).
        fired: (k + counts, 1) 1 for each indicator that is not positive: of the sides, of counts
            that fall, of counts that rise.
        duration: duration of the motion [s].

    Returns:
        indicators (k + counts, 1) and modes.
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


# Laws that keep the side of their conditions during a step.
#
# The conditions of the laws are found again in the graph of a state equation by their values at
# random points. There the modes of the crossings take their place: a step that goes beyond an event
# then follows the law of its begin, smoothly.


_POINTS, _KNOWN, _SEED = 24, 12, 20261124
"""Random points at which conditions are compared, and how many of them must have values: |x| and x
are equal at half of them. A fixed seed, so that every run has the same."""
_SIZES = -2.0, 3.0
"""Powers of ten of the coordinates of these points: fmin(x, 5) and x are equal below 5."""
_EQUAL = 1e-9
"""Difference of equal conditions: far above rounding, far below that of different ones."""
_COMPARISONS = {casadi.OP_LT, casadi.OP_LE}
_ROUNDED = {casadi.OP_FLOOR: 1.0, casadi.OP_CEIL: -1.0}
"""Operations with counts, and the sign of their operand in the count."""


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
    """A function whose conditions have the places of crossings.

    Args:
        function: state equation.
        at: its inputs as symbols.
        values: (k, 1) of the crossings at these symbols, the counts last.
        modes: modes of the crossings, as `guard` has them.
        counts: number of counts.
        inputs: inputs of the result: symbols that include the symbols of `at` and the modes.
        loose: number of the first crossings, whose conditions stay as they are.

    Returns:
        the function of these inputs. Conditions that are not found in it stay as they are.
    """
    k, rest = values.numel(), modes.numel()
    try:
        graph = graph_of(function)
    except ModelError:  # it calls functions as a whole
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
    """Crossing and sign of each condition in a graph that is one of the crossings."""
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
    for point in points[:_KNOWN]:  # roots of parameters, such as masses, have values
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
    """Numbers of many sizes and both signs."""
    return random.choice([-1.0, 1.0], size) * 10 ** random.uniform(*_SIZES, size)


# Crossings of the state equations of FMUs.


_SPAN = 1.0
"""Duration by which crossings in a row are known in an FMU [s], which does not know its own."""


@dataclass(frozen=True, slots=True, eq=False)
class WatchedCrossings:
    """Crossings of a state equation.

    Attributes:
        sides: (n, 1) values that pass through zero, those of contacts first.
        counts: (m, 1) values at whose whole numbers laws jump.
        approaches: (k, 2) speeds and paces of the k contacts, as `Approach` has them.
    """

    sides: SX
    counts: SX
    approaches: SX = field(default_factory=lambda: SX(0, 2))


def part_crossings(system: System) -> Function | None:
    """`f(q, v, z, u, p) -> sides, counts, approaches` at which the laws of components change.

    Bends and curves are left to error control.

    Args:
        system: open or closed.

    Returns:
        the Function, whose outputs are those of `WatchedCrossings`; None if no law jumps.
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
    """`f(t, q, v, w, p) -> sides, counts` at which the laws of a drive jump.

    Args:
        system: open or closed.
        drive: a drive, with or without laws.
        extra: number of the inputs w of the laws.

    Returns:
        the Function; None if no law jumps, or if laws are external functions.
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
    """Conditions at which laws jump, and bends of these conditions.

    An importer sees signs alone. It meets the zeros of |x| - a on both sides if it stops at x = 0.
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
    """The Function of those expressions that depend on some symbols."""
    kept = [
        [value for value in distinct(values, []) if casadi.depends_on(value, of)]
        for values in (sides, counts)
    ]
    if not any(kept):
        return None
    return dense_function("crossings", list(point), [casadi.vertcat(SX(0, 1), *v) for v in kept])


def join_crossings(
    events: MinimalEvents | None, values: WatchedCrossings, point: Sequence[SX], source: str
) -> MinimalEvents:
    """Events with the events of crossings behind them, which change modes alone.

    Args:
        events: other events; None if there are no others.
        values: crossings at the point.
        point: t, x, z, u and p, without modes.
        source: name of the crossings.
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
    return MinimalEvents(
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
    events: MinimalEvents | None,
    motion: tuple[SX, SX],
    point: Sequence[SX],
    *,
    wanted: bool,
) -> tuple[MinimalEvents | None, WatchedCrossings]:
    """Events with the crossings of components behind them, and these crossings.

    Args:
        system: open or closed.
        events: other events; None if there are no others.
        motion: positions and velocities of the tree.
        point: t, x, z, u and p, without modes.
        wanted: whether crossings are wanted at all.
    """
    found = part_crossings(system) if wanted else None
    if found is None:
        return events, WatchedCrossings(SX(0, 1), SX(0, 1))
    values = WatchedCrossings(*found.call([*motion, system.z, system.u, system.p]))
    return join_crossings(events, values, point, "laws"), values


def held_by(function: Function, values: WatchedCrossings, point: Sequence[SX]) -> Function:
    """A function of (t, x, z, u, p) that takes the modes of crossings at the end of p.

    Args:
        function: state equation; its p may end with other modes.
        values: crossings at the point; laws of contacts, which do not jump, have no side.
        point: t, x, z, u and p, without modes.
    """
    sides, counts = values.sides, values.counts
    k = sides.numel() + counts.numel()
    if not k:
        return function
    *others, p = point
    before = SX.sym("before", function.numel_in(4) - p.numel())
    modes = SX.sym("own", GUARD_MODES * k)
    at, inputs = [*others, casadi.vertcat(p, before)], [*others, casadi.vertcat(p, before, modes)]
    every, loose = casadi.vertcat(sides, counts), values.approaches.shape[0]
    return hold_sides(function, at, every, modes, counts.numel(), inputs, loose=loose)


def with_more_modes(function: Function, count: int) -> Function:
    """A function of (t, x, z, u, p) that takes more modes at the end of p."""
    if not count:
        return function
    symbols = [SX.sym(f"i{k}", function.numel_in(k)) for k in range(function.n_in())]
    more = casadi.vertcat(symbols[4], SX.sym("more", count))
    wide = [*symbols[:4], more, *symbols[5:]]
    return Function(function.name(), wide, function.call(symbols))
