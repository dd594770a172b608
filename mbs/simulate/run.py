"""Simulation of a system, compiled where there is a compiler, loops kept closed."""

from __future__ import annotations

import functools
import hashlib
import math
import os
import pickle
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import casadi
import numpy as np
from casadi import DM, SX, Function
from numpy.typing import NDArray

from mbs.arguments import MadeOnce, names_given, values_given
from mbs.assembly import System
from mbs.assembly.degrees import like_degrees
from mbs.assembly.model_function import require_system
from mbs.assembly.parts import WireSource
from mbs.assembly.system import Packed, content_of, packed, unpacked
from mbs.assembly.tables import ACCELERATION_UNIT, EFFORT_UNIT
from mbs.assembly.variable_names import GUESSES, POSITIONS, VELOCITIES
from mbs.components.custom import OneWay, Signal
from mbs.errors import Interrupted, ModelError, SolverError
from mbs.files import read_sealed, write_sealed
from mbs.loops.analysis import rows_at
from mbs.loops.balance import without_values
from mbs.loops.closure import least_upright, rolling_discs
from mbs.loops.configuration import Guess, Start, Values, start, start_position, start_velocity
from mbs.loops.examine import row_independence
from mbs.loops.velocity import constraint_jacobian, scales
from mbs.models.contacts import (
    KINDS,
    ContactElement,
    Contacts,
    contacts_of,
    require_lasting_rows,
    require_undriven,
)
from mbs.models.direct_dynamics import hybrid_dynamics, require_inertia
from mbs.models.inverse_dynamics import bias
from mbs.models.measurements import measurements
from mbs.models.state.crossings import GUARD_MODES, guard, hold_sides, ticks_of
from mbs.models.state.signals import (
    Effort,
    LawArgument,
    Prescribed,
    by_name,
    effort_function,
    given_inputs,
    signal_function,
    untraceable,
)
from mbs.models.state.tree import FullState, full_state
from mbs.models.symbols import part_equations
from mbs.native import compiled
from mbs.native.compiler import cache_dir
from mbs.numbers import OnArrays, has_boolean, is_vector, numbers_given, on_arrays
from mbs.progress import progress
from mbs.recursions.parts import part_event_names
from mbs.result import (
    RecordedStates,
    Result,
    State,
    device_states_of,
    positions_of,
    state_of,
    velocities_of,
)
from mbs.simulate.arguments import count_steps, positive
from mbs.simulate.tolerances import Tolerance, Tolerances, small_motions, tolerances_of
from mbs.solvers import EventMotion, Events, integrate_events
from mbs.solvers.problem import METHODS, IntegrationEvent, Passage, failed
from mbs.text import did_you_mean, quoted

# Rigid stops and Coulomb friction in a simulation: how they start, and what a result says of them.


Array = NDArray[np.float64]

_LIMITS = {-1: "lower", 1: "upper"}


@dataclass(frozen=True, slots=True, eq=False)
class ContactMotion:
    """What k coordinates with contacts do in a simulation.

    Attributes:
        first: (2 k,) modes at the start.
        modes: (m, 2 k) at the times of the motion.
        events: in the order of time.
    """

    first: Array
    modes: Array
    events: tuple[IntegrationEvent, ...]


def require_contacts_possible(system: System, motions: Sequence[Prescribed]) -> None:
    """Refuse what rigid stops and Coulomb friction cannot be simulated with.

    Raises:
        ModelError: a motion is prescribed where one acts, two of one kind act on one coordinate,
            or the loops are over-constrained in a way that changes with the configuration.
    """
    contacts = contacts_of(system)
    require_undriven(system, contacts, [motion.velocity for motion in motions])
    require_lasting_rows(system, contacts)


def first_modes(system: System, x0: Array, p: Array) -> Array:
    """(2 k,) modes at the start: what rests at a limit touches it, what moves slides.

    Args:
        system: with k coordinates on which contacts act.
        x0: state at the start.
        p: (np,) parameters.

    Raises:
        ModelError: a coordinate starts beyond a limit.
    """
    contacts, nq = contacts_of(system), system.nq
    q, v = SX.sym("q", nq), SX.sym("v", system.nv)
    found = [*contacts.first(q, v), *contacts.bounds, contacts.at(q, v).measure]
    start = Function("start", [q, v, system.p], found)
    modes, outside, *limits = (
        np.array(value)[:, 0] for value in start(x0[:nq], x0[nq : nq + system.nv], p)
    )
    for number in np.flatnonzero(outside > 0):
        side, j = divmod(int(number), len(contacts))
        value, stop = limits[2][j], contacts.stops[j]
        assert stop is not None
        if isinstance(stop.law, OneWay):
            raise ModelError(
                f"{system.name}: {stop.name} starts at the velocity {value:g}, below zero, where it"
                " holds; start it at zero or above, by v0"
            )
        raise ModelError(
            f"{system.name}: {contacts.names[j]} starts at {value:g}, beyond the"
            f" {_LIMITS[2 * side - 1]} limit {limits[side][j]:g} of its rigid stop; start inside,"
            " by q0"
        )
    return modes


def contact_columns(system: System) -> Iterator[tuple[int, str, str]]:
    """Index, name and unit of the columns of contacts: modes side by side, then efforts.

    Args:
        system: with k coordinates on which contacts act, (2 k,) modes and (2 k,) efforts.
    """
    contacts = contacts_of(system)
    for column, element in enumerate((*contacts.stops, *contacts.frictions)):
        if element is not None:
            yield column, f"{element.name}.mode", "1"
            yield 2 * len(contacts) + column, f"{element.name}.effort", element.unit


def every_effort(system: System, q: Array, p: Array, tau: Array, efforts: Array) -> Array:
    """(m, nv) joint efforts, those of contacts included.

    Args:
        system: with k rows on which contacts act, or none.
        q: (m, nq) positions.
        p: (np,) parameters.
        tau: (m, nv) joint efforts without them.
        efforts: (m, 2 k) of the stops, then of friction.
    """
    contacts, k = contacts_of(system), len(contacts_of(system))
    if not k:
        return tau
    rows = Function("rows", [contacts.q, system.p], [casadi.densify(contacts.state.rows)])
    E = np.array(rows(q.T, np.repeat(p[:, None], len(q), axis=1))).reshape(k, len(q), -1)
    pushed: Array = np.einsum("jmn,mj->mn", E, efforts[:, :k] + efforts[:, k:])
    return tau + pushed


def list_events(
    system: System, contact: ContactMotion | None, others: Sequence[IntegrationEvent] = ()
) -> tuple[tuple[float, str, str], ...]:
    """Time, name of the element or component and what it does, of every event.

    Args:
        system: in motion.
        contact: what contacts do, their events and those of components behind them.
        others: events of components alone, where there are no contacts.
    """
    own = part_event_names(system)
    happened = [(event.time, *own[k]) for event in others for k in event.fired]
    if contact is None:
        return tuple(happened)
    contacts, before = contacts_of(system), contact.first
    count = len(KINDS) * len(contacts)
    for event in contact.events:
        happened += [(event.time, *own[k - count]) for k in event.fired if k >= count]
        for j in range(len(contacts)):
            for name, what in _changes(contacts, j, before, event):
                happened.append((event.time, name, what))
        before = event.modes
    return tuple(happened)


def _changes(
    contacts: Contacts, j: int, before: Array, event: IntegrationEvent
) -> Iterator[tuple[str, str]]:
    k = len(contacts)
    stop, friction = contacts.stops[j], contacts.frictions[j]
    was, now = int(before[j]), int(event.modes[j])
    if stop is not None:
        for side, name in enumerate(("lower", "upper")):
            if side * k + j in event.fired:
                rests = now == (-1, 1)[side]
                what = f"{'rests at' if rests else 'bounces off'} {name}"
                yield _said(stop, "locks" if isinstance(stop.law, OneWay) else what)
        if was and not now:
            freed = isinstance(stop.law, OneWay)
            yield _said(stop, "frees" if freed else f"leaves {_LIMITS[was]}")
    slide_before, slides = before[k + j], event.modes[k + j]
    if friction is not None and slide_before != slides:
        yield _said(friction, "slides" if slides else "sticks")


def _said(element: ContactElement, what: str) -> tuple[str, str]:
    """The component, and what its friction or stop does."""
    return element.part.name, f"{element.label} {what}" if element.label else what


# Inputs of the devices of drive lines, in whatever form the user gives them.


def input_function(system: System, u: Effort) -> Function | None:
    """`u(t, q, v, p) -> u`, (nu, 1), one input for each device.

    Args:
        system: open or closed.
        u: constants by the name of the device, or all of them, or a function of (t, q, v), or
            None for zeros.

    Returns:
        the Function; None where nothing is given.

    Raises:
        ModelError: a name is unknown, or the inputs are not (nu, 1) numbers.
    """
    if u is None or (isinstance(u, Mapping) and not u):
        return None
    signal = LawArgument("u", "inputs", [name for name, _ in system.inputs])
    if not system.inputs:
        raise ModelError(
            f"{system.name}: u is given, but no motor and no torque is connected to a flange, and"
            " no other component has an input; leave u out, or give the efforts tau of the joints"
        )
    if callable(u):
        return signal_function(system, signal, u)
    if isinstance(u, Mapping):
        values = by_name(system, "u", u, system.inputs, system.u_default)
        return signal_function(system, signal, SX(DM(values)))
    return signal_function(system, signal, SX(DM(_numbers(system, "u", u))))


def device_states(system: System, z0: Mapping[str, float] | Sequence[float] | None) -> list[float]:
    """The states of the devices at the start, zero where none is given.

    Args:
        system: open or closed.
        z0: by name, such as `motor.i`, or all of them.

    Raises:
        ModelError: a name is unknown, or a value is no number.
    """
    if z0 is None or isinstance(z0, Mapping):
        return list(by_name(system, "z0", z0, system.states, system.z_start))
    names, values = [name for name, _ in system.states], _numbers(system, "z0", z0)
    if len(values) != len(names):
        raise ModelError(
            f"{system.name}: z0 has {len(values)} values, the devices have {len(names)} states:"
            f" {', '.join(names)}"
        )
    return values


def _numbers(system: System, what: str, values: Any) -> list[float]:
    array = numbers_given(values)
    vector = not isinstance(array, str) and array.ndim > 0 and is_vector(array.shape)
    if isinstance(array, str) or not vector or not np.isfinite(array).all():
        raise ModelError(f"{system.name}: {what} is {quoted(values)}; give finite numbers")
    return [float(value) for value in array.ravel()]


# Integration in one leg, or in several: over-constrained loops whose independent rows change.
#
# In a loop such as Bennett's, which rows of the closing joint are independent changes with the
# configuration: no choice holds over a whole revolution. Steps in local tangent coordinates use all
# rows, and need no choice. Where there are none, as for laws that CasADi cannot write as C, a leg
# ends where its rows have lost most of their independence, and the next one begins there with
# rows that are chosen for that configuration.


_LOST = 0.05
"""Part of its independence at the start of a leg at which a leg ends."""
_SINGULAR = 1e-6
"""Independence below which a configuration is singular for all rows: a thousandth, as a sine."""
_FLAT = 1e-3
"""Sine of the angle between a rolling disc and its plane at which it counts as flat."""

_INTERPRETED = 2e6
"""Instructions that CasADi interprets in some 10 ms; what is asked for beyond them is compiled,
which takes some tenths of a second for a mechanism of ten links."""

_FIRST_STEP = 1e-9
"""Step behind a crossing [s], from which steps grow tenfold where nothing errs: what two bodies do
to each other is met at any speed before they are through each other."""

Stop = SolverError | Interrupted | None
"""Why a motion ends early; None where it does not."""


@dataclass(frozen=True, slots=True, eq=False)
class Leg:
    """A part of a motion with one state equation.

    Attributes:
        state: its equations.
        times: (m,) s, that were reached.
        x: (m, nx) states at these times.
        contact: what rigid stops and Coulomb friction do meanwhile, None where there are none.
        first_slope: as `EventMotion` has it.
        driven: numbers of the velocities whose motion is prescribed.
        happened: events of components, where there are no contacts.
        first_bias: (nv,) efforts of gravity and velocities at the first time; None as before.
    """

    state: FullState
    times: Array
    x: Array
    contact: ContactMotion | None = None
    first_slope: Array | None = None
    driven: tuple[int, ...] = ()
    first_bias: Array | None = None
    happened: tuple[IntegrationEvent, ...] = ()

    @property
    def without_start(self) -> Leg:
        """The same without its first row, which belongs to the leg before."""
        return replace(self, times=self.times[1:], x=self.x[1:])

    def observed(self, p: Array) -> list[Array]:
        """What the state equation observes, (m, ..) each."""
        observe, count = self.state.observe, len(self.times)
        if not count:
            return [np.empty((0, observe.numel_out(k))) for k in range(observe.n_out())]
        every = np.repeat(p[None, :], count, axis=0)
        if self.contact is not None:
            every = np.hstack([every, self.contact.modes])
        # rows follow each other in memory as CasADi has the columns of a map
        values = [found.T for found in self._map(count)(self.times, self.x, every)]
        if self.first_slope is not None:  # the rows alone would allow other accelerations there
            self._correct_first(values[0][0], values[1][0], every[0])
        return values

    def _map(self, count: int) -> OnArrays:
        """`observe` for as many states; in machine code once it has been asked for often."""
        prepared, observe = self.state.prepared, self.state.observe
        asked = prepared.get("asked", 0) + count * observe.n_instructions()
        if asked > _INTERPRETED and "machine code" not in prepared:
            prepared["machine code"] = compiled(observe, derivatives=0)
            prepared.pop("observe", None)
        prepared["asked"] = asked
        known: tuple[int, OnArrays] | None = prepared.get("observe")
        if known is None or known[0] != count:
            function = prepared.get("machine code", observe)
            known = prepared["observe"] = count, on_arrays(function.map(count))
        return known[1]

    def _correct_first(self, a: Array, tau: Array, p: Array) -> None:
        """Accelerations of the branch at a singular start, and what they ask of drives.

        One drive gives the power that inertia and forces take; shares of several are not
        determined.
        """
        assert self.state.passage is not None
        assert self.first_slope is not None
        nq, nv, *_ = self.state.passage.size
        a[:] = self.first_slope[nq : nq + nv]
        if self.driven and self.first_bias is not None:
            M, f, _ = (np.array(x) for x in self.state.passage.forces(self.times[0], self.x[0], p))
            v, (k, *more) = self.x[0, nq : nq + nv], self.driven
            given, power = f[k, 0] + self.first_bias[k], v @ (M @ a - f[:, 0])
            tau[list(self.driven)] = np.nan if more or not v[k] else given + power / v[k]


def integrate_legs(
    system: System,
    equations: Callable[[System], FullState],
    x0: Array,
    times: Array,
    p: Array,
    modes: Array | None = None,
    **options: Any,
) -> tuple[list[Leg], Stop]:
    """The motion at given times, in one leg for most systems, and why it ends before the last.

    Args:
        system: open or closed.
        equations: the state equation of a system that differs in its independent rows alone.
        x0: (nx,) state at the first time.
        times: (m,) s, increasing.
        p: (np,) parameters, then the inputs that are given for this motion.
        modes: (k,) modes of rigid stops and Coulomb friction at the start; found by the positions
            and velocities if left out.
        options: of `integrate`.

    Returns:
        the legs that were reached, one at least; None where they reach the last time, or else why
        they do not: the message says when and in which configuration, and at a singular one the
        joint that the loops do not hold.
    """
    legs, stop = _integrate(system, equations, x0, times, p, modes, **options)
    if isinstance(stop, SolverError) and stop.state:
        q = np.array(stop.state[: system.nq])
        where = ", ".join(f"{c.name} = {x:.6g}" for c, x in zip(system.coordinates, q, strict=True))
        lost = _lost(system, q, p) if stop.singular and system.is_closed else ""
        cause = stop.__cause__
        reason = lost if lost or stop.singular else _without_inertia(system)
        if stop.singular:
            reason += _at_stops(system, np.array(stop.state), _own(system, p))
        stop = SolverError(
            f"{system.name}: {_with_names(system, stop)}; the configuration is {where}{reason}",
            state=stop.state,
            singular=stop.singular,
            time=stop.time,
            fired=stop.fired,
        )
        stop.__cause__ = cause
    return legs, stop


def _own(system: System, p: Array) -> Array:
    """The parameters of the system, without the inputs that are given for a motion."""
    return p[: len(system.parameters)]


def _without_inertia(system: System) -> str:
    """Which velocity moves no inertia, as the end of a sentence; empty if each moves some."""
    try:
        require_inertia(system)
    except ModelError as error:
        return "; " + str(error).removeprefix(f"{system.name}: ")
    return without_values(system)


_TOUCHED = 1e-6
"""Distance from a limit [rad or m] at which a rigid stop is closed; impacts are found to 1e-9."""


def _at_stops(system: System, x: Array, p: Array) -> str:
    """The rigid stops that are closed at a singular state, and the remedy; empty if none is."""
    contacts = contacts_of(system)
    if not len(contacts):
        return ""
    q, v = SX.sym("q", system.nq), SX.sym("v", system.nv)
    limits = Function("limits", [q, v, system.p], [*contacts.bounds, contacts.at(q, v).measure])
    found = limits(x[: system.nq], x[system.nq : system.nq + system.nv], p)
    lower, upper, value = (np.array(row)[:, 0] for row in found)
    gaps = np.minimum(np.abs(value - lower), np.abs(upper - value))
    closed = [name for name, gap in zip(contacts.names, gaps, strict=True) if gap < _TOUCHED]
    if not closed:
        return ""
    return (
        f"; the rigid stop at {' and '.join(closed)} is closed there: move its limit away from the"
        " singular configuration, or use an elastic JointStop"
    )


def _with_names(system: System, stop: SolverError) -> str:
    """The message, with the events that are to blame by component and label."""
    message, _, numbers = str(stop).partition("; indicators ")
    contacts = [name for _ in KINDS for name in contacts_of(system).names]
    names = [*contacts, *map(", ".join, part_event_names(system))]
    blamed = [names[k] for k in stop.fired if k < len(names)]
    return f"{message}; it concerns {' and '.join(blamed)}" if numbers and blamed else str(stop)


def _lost(system: System, q: Array, p: Array) -> str:
    """The joint that moves most in what the rows hold least at a configuration, in words."""
    found = scales(system)
    J = np.array(constraint_jacobian(system)(q, _own(system, p)))
    J = J * found.rows.reshape(-1, 1) * found.columns([speed.unit for speed in system.speeds])
    assert system.closure is not None
    rank = system.nv - system.closure.mobility
    if not rank or not np.isfinite(J).all():
        return ""
    free = np.linalg.svd(J)[2][rank - 1 :]  # as many directions as are free there, at the least
    moves = np.round(np.sum(free**2, axis=0), 6)  # the first of joints that move alike
    name = system.speeds[int(np.argmax(moves))].name
    return f", and the loops hardly hold {name} there"


def _integrate(
    system: System,
    equations: Callable[[System], FullState],
    x0: Array,
    times: Array,
    p: Array,
    modes: Array | None,
    **options: Any,
) -> tuple[list[Leg], Stop]:
    state = equations(system)
    if system.closure is not None and system.closure.varies:
        if state.passage is None:
            return _with_other_rows(system, equations, x0, times, p, options)
        q, parameters = x0[: system.nq], _own(system, p)
        if float(row_independence(system)(q, parameters)) < _SINGULAR:
            state = equations(rows_at(system, q, parameters))  # the start may be regular for others
    if len(contacts_of(system)):
        return _with_contacts(system, state, x0, times, p, modes, options)
    discs = [disc.name for _, disc in rolling_discs(system)]
    if discs:
        upright = Limit(least_upright(system), _FLAT)
        leg, motion, end = _leg(system, state, x0, times, p, upright, options)
        if end is None:
            return [leg], motion.stop
        return [leg], SolverError(
            f"{system.name}: {' or '.join(discs)} lies flat on its plane at t = {end:.6g} s, where"
            " no single point of a disc touches; end the run before, or keep it upright",
            time=end,
        )
    watched = Events(*state.events) if state.events else None
    motion = _motion(state, x0, times, watched, p, options)
    happened = motion.events if state.events else ()
    reached = times[: len(motion.x)]
    leg = Leg(state, reached, motion.x, first_slope=motion.first_slope, happened=happened)
    return [leg], motion.stop


def _motion(
    state: FullState,
    x0: Array,
    times: Array,
    events: Events | None,
    p: Array,
    options: dict[str, Any],
) -> EventMotion:
    """The motion as far as it comes; its steps end where laws of components have bends."""
    rhs, project, passage = state.rhs, state.project, state.passage
    own, count, prepared = events, 0, state.prepared
    if state.crossings is not None:
        span = float(times[0]), float(times[-1])
        own, wrapped = with_crossings(state, x0, span, events, p)
        rhs, project, passage = wrapped
        prepared = state.prepared.setdefault("runs with crossings", {})
        count = np.size(own.modes) - (0 if events is None else np.size(events.modes))
    motion = integrate_events(
        rhs,
        x0,
        times,
        own,
        p=p,
        project=project,
        passage=passage,
        partial=True,
        prepared=prepared,
        stops=_stops(state, float(times[0]), float(times[-1]), p),
        **options,
    )
    return _without_crossings(motion, events, count) if count else motion


def _stops(
    state: FullState, begin: float, end: float, p: Array
) -> tuple[Array, NDArray[np.bool_]] | None:
    """Times at which laws of time jump, bend or are short; the last ones found are kept."""
    if state.timing is None:
        return None
    own = p[: state.timing.p]
    key = begin, end, own.tobytes()
    known = state.prepared.get("stops")
    if known is None or known[0] != key:
        known = state.prepared["stops"] = key, state.timing.stops(begin, end, own)
    found: tuple[Array, NDArray[np.bool_]] = known[1]
    return found


def with_crossings(
    state: FullState, x0: Array, span: tuple[float, float], events: Events | None, p: Array
) -> tuple[Events, tuple[Function, Function | None, Passage | None]]:
    """Events with the crossings behind them, and the functions of the state with their modes.

    On which side of a crossing the motion is, 1 or -1, is its mode; nothing jumps there, so that
    it does not matter whether a step stops a little before or behind it. The modes of sides and
    counts are as `guard` has them; the last mode is the duration.

    Args:
        state: with crossings.
        x0: (nx,) at the start.
        span: times of the start and the end [s].
        events: others; None where there are none.
        p: (np,) parameters, without modes.
    """
    assert state.crossings is not None
    modes = () if events is None else tuple(np.ravel(np.asarray(events.modes, dtype=float)))
    if "crossings" not in state.prepared:
        state.prepared["crossings"] = _watch_crossings(state, events, len(x0), len(p), len(modes))
    (indicators, jump, approaches), functions = state.prepared["crossings"]
    t0, end = span
    duration = end - t0 or 1.0  # a motion of one time has no events
    start = np.array(state.crossings(t0, x0, [*p, *modes]))[:, 0]
    few = state.sides + state.counts
    plain, sides, counts = np.split(start, [len(start) - few, len(start) - state.counts])
    places = [*np.where(plain > 0, 1.0, -1.0), *np.sign(sides), *np.floor(counts)]
    if few:  # awake, not in a row, since the start
        begin = float(math.floor(ticks_of(t0, duration)))
        places += [*np.zeros(2 * few), *np.full(few, begin), duration]
    first_step = _FIRST_STEP if state.short else 0.0
    return Events(indicators, jump, [*modes, *places], first_step, approaches), functions


def _watch_crossings(
    state: FullState, events: Events | None, n: int, own: int, modes: int
) -> tuple[
    tuple[Function, Function, Function | None], tuple[Function, Function | None, Passage | None]
]:
    """Indicators and jump with the crossings behind those of others, and the functions.

    Args:
        state: with crossings.
        events: others; None where there are none.
        n: number of states.
        own: number of parameters.
        modes: number of the modes of the others.
    """
    assert state.crossings is not None
    count, n_p, few = state.crossings.numel_out(0), own + modes, state.sides + state.counts
    plain, more = count - few, GUARD_MODES * few + 1 if few else 0
    first = 0 if events is None else events.indicators.numel_out(0)
    ends = [0, first, first + plain, first + count + state.counts]
    t, x, pm, fired = (
        SX.sym(name, size)
        for name, size in (("t", 1), ("x", n), ("p", n_p + plain + more), ("fired", ends[-1]))
    )
    parameters, sides, guards = casadi.vertsplit(pm, [0, n_p, n_p + plain, n_p + plain + more])
    fired_first, fired_plain, fired_few = casadi.vertsplit(fired, ends)
    at = [t, x, parameters]

    def wide(function: Function) -> Function:
        return Function(function.name(), [t, x, pm], function.call(at))

    values, few_values = casadi.vertsplit(state.crossings.call(at)[0], [0, plain, count])
    *own_modes, duration = (
        casadi.vertsplit(guards, [0, GUARD_MODES * few, more]) if few else [guards, guards]
    )
    guarded, then = guard(t, few_values, state.counts, own_modes[0], fired_few, duration)
    indicators = [sides * values, guarded]
    state_after, after = x, [SX(0, 1)]
    if events is not None:
        indicators.insert(0, events.indicators.call(at)[0])
        jumps = casadi.mmax(fired_first)
        there, *changed = events.jump.call([*at, fired_first])  # modes where there are some
        state_after = casadi.if_else(jumps, there, x)
        after = [casadi.if_else(jumps, now, pm[own:n_p]) for now in changed]
    after += [casadi.if_else(fired_plain > 0, -sides, sides), then, duration]
    approaches = None
    if state.approaches is not None:
        (known,) = state.approaches.call(at)
        acting = casadi.horzcat(known, sides > 0)  # a contact whose depth is positive
        others = [SX.zeros(first, 3), acting, SX.zeros(ends[-1] - first - plain, 3)]
        approaches = Function("approaches", [t, x, pm], [casadi.vertcat(*others)])
    watched = (
        Function("indicators", [t, x, pm], [casadi.vertcat(*indicators)]),
        Function("jump", [t, x, pm, fired], [state_after, casadi.vertcat(*after)]),
        approaches,
    )

    def held(function: Function) -> Function:
        modes = own_modes[0]
        return hold_sides(function, at, few_values, modes, state.counts, [t, x, pm])

    passage = state.passage
    if passage is not None:
        passage = replace(
            passage,
            rows=wide(passage.rows),
            forces=held(passage.forces),
            regularity=wide(passage.regularity),
        )
    project = None if state.project is None else wide(state.project)
    return watched, (held(state.rhs), project, passage)


def _without_crossings(motion: EventMotion, events: Events | None, modes: int) -> EventMotion:
    """The motion with the modes and events of others alone.

    Args:
        motion: with crossings.
        events: others; None where there are none.
        modes: number of the modes of crossings.
    """
    first = 0 if events is None else events.indicators.numel_out(0)
    kept = motion.modes.shape[1] - modes
    reported = tuple(
        replace(event, fired=others, modes=event.modes[:kept])
        for event in motion.events
        if (others := tuple(k for k in event.fired if k < first))
    )
    return replace(motion, modes=motion.modes[:, :kept], events=reported)


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
    p: Array,
    options: dict[str, Any],
) -> tuple[list[Leg], Stop]:
    """Legs of an over-constrained system, each with rows that suit its first configuration."""
    legs: list[Leg] = []
    start = Leg(equations(system), times[:1], x0.reshape(1, -1))
    system, limit = _next(system, x0[: system.nq], _own(system, p))
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
        leg, motion, end = _leg(system, state, x0, left, p, limit, options)
        legs.append(leg if not legs else leg.without_start)
        if motion.stop is not None or end is None:
            return legs, motion.stop
        x0 = motion.x[-1]
        left = left[left > end]
        if not len(left):
            return legs, None
        left = np.concatenate([[end], left])
        system, limit = _next(system, x0[: system.nq], _own(system, p))
        if limit is None:
            return legs, failed(end, 0.0, "singular", state=x0.tolist())


def _with_contacts(
    system: System,
    state: FullState,
    x0: Array,
    times: Array,
    p: Array,
    modes: Array | None,
    options: dict[str, Any],
) -> tuple[list[Leg], Stop]:
    assert state.events is not None
    first = first_modes(system, x0, _own(system, p)) if modes is None else modes
    motion = _motion(state, x0, times, Events(*state.events, first), p, options)
    contact = ContactMotion(first, motion.modes, motion.events)
    reached = times[: len(motion.x)]
    return [Leg(state, reached, motion.x, contact, motion.first_slope)], motion.stop


def _leg(
    system: System,
    state: FullState,
    x0: Array,
    times: Array,
    p: Array,
    limit: Limit,
    options: dict[str, Any],
) -> tuple[Leg, EventMotion, float | None]:
    """One leg, the motion, and when it ended early, below the limit; it rests from then on."""
    n, n_p = len(x0), len(p)
    count = state.events[0].numel_out(0) if state.events else 0
    t, x, pm, fired = (
        SX.sym(k, m) for k, m in (("t", 1), ("x", n), ("p", n_p + 1), ("f", count + 1))
    )
    parameters, ended = pm[:n_p], pm[n_p]
    # a rate that has no value at the end is left out
    rate = casadi.if_else(ended, 0, state.rhs(t, x, parameters))
    rhs = Function("rhs", [t, x, pm], [rate])
    assert state.project is not None
    corrected, residual = state.project(t, x, parameters)
    kept = [casadi.if_else(ended, x, corrected), casadi.if_else(ended, 0, residual)]
    project = Function("project", [t, x, pm], kept)
    # events of components, then the end
    left = limit.measure(x[: system.nq], parameters[: len(system.parameters)]) - limit.level
    watched, after = left, x
    if state.events:
        own, jump = state.events
        watched = casadi.vertcat(own(t, x, parameters), left)
        jumps = casadi.mmax(fired[:count])
        after = casadi.if_else(jumps, jump(t, x, parameters, fired[:count]), x)
    events = Events(
        Function("watched", [t, x, pm], [casadi.if_else(ended, 1, watched)]),
        Function("end", [t, x, pm, fired], [after, casadi.fmax(ended, fired[count])]),
        [0.0],
    )
    ending = replace(state, rhs=rhs, project=project, passage=None, prepared={})
    if state.crossings is not None:
        crossed = state.crossings(t, x, parameters)
        ending = replace(ending, crossings=Function("crossings", [t, x, pm], [crossed]))
    if state.approaches is not None:
        approached = state.approaches(t, x, parameters)
        ending = replace(ending, approaches=Function("approaches", [t, x, pm], [approached]))
    motion = _motion(ending, x0, times, events, p, options)
    reached = times[: len(motion.x)]
    end = next((event.time for event in motion.events if count in event.fired), None)
    before = reached <= (np.inf if end is None else end)
    happened = tuple(
        replace(event, fired=others)
        for event in motion.events
        if (others := tuple(k for k in event.fired if k < count))
    )
    return Leg(state, reached[before], motion.x[before], happened=happened), motion, end


def _next(system: System, q: Array, p: Array) -> tuple[System, Limit | None]:
    """The system with rows that suit a configuration better, and where its leg ends.

    No leg begins where all rows are dependent.
    """
    better = rows_at(system, q, p)
    old, new = (float(row_independence(one)(q, p)) for one in (system, better))
    chosen, now = (better, new) if new > 2 * old else (system, old)
    limit = Limit(row_independence(chosen), _LOST * now) if now >= _SINGULAR else None
    return chosen, limit


# Prescribed motions of a simulation: laws of time, or signals, by the names of positions and rates.


Motion = Mapping[str, float | str | Signal | Function | Callable[[Any], Any]] | None
_KINDS = ("q", "v", "a")


def prescribed_motions(system: System, motion: Motion) -> list[Prescribed]:
    """What a user prescribes, by names such as "j1.q", "j1.v" and "j1.a".

    Args:
        system: open or closed.
        motion: for each name a number, a function of the time made of CasADi operations, or a
            signal of a component, itself or by its name.

    Raises:
        ModelError: a name is unknown, a law is no function of time, a signal follows from the
            motion, or the loops tie what is prescribed.
    """
    if not isinstance(motion, Mapping | None):
        raise ModelError(
            f"{system.name}: motion is {quoted(motion)}; give a dict such as"
            ' {"j1.q": lambda t: 0.3 * casadi.sin(t)}'
        )
    found = [_prescribe(system, name, law) for name, law in (motion or {}).items()]
    names = [one.name for one in found]
    for name in names:
        if names.count(name) > 1:
            raise ModelError(
                f"{system.name}: motion prescribes {name} more than once; give its position, its"
                " velocity or its acceleration"
            )
    if found:
        hybrid_dynamics(system, names)  # refuses what the loops tie
    return found


def start_positions(
    system: System,
    motions: list[Prescribed],
    q0: Start,
    v0: Values,
    z0: Sequence[float],
    p: Sequence[float],
    begin: float,
) -> tuple[Start, Values]:
    """The start of a motion, with what is prescribed of it at its first time.

    Args:
        system: open or closed.
        motions: what is prescribed.
        q0: positions by name.
        v0: velocities by name.
        z0: (nz,) states of components at the start.
        p: (np,) parameters.
        begin: the first time [s].

    Raises:
        ModelError: a start is given for what is prescribed, or not by name.
    """
    if not motions:
        return q0, v0
    if isinstance(q0, State) and v0 is None:
        v0 = q0.v
    positions = _by_name(system, "q0", positions_of(q0), POSITIONS)
    velocities = _by_name(system, "v0", v0, VELOCITIES)
    for one in motions:
        position, speed, _ = (float(value) for value in one.laws.call([DM(begin), DM(z0), DM(p)]))
        if one.position is not None:
            _put(system, positions, one.name, position, "q0")
        if one.holds_speed:
            _put(system, velocities, one.name, speed, "v0")
    return positions, velocities


def _by_name(system: System, what: str, given: Values, kinds: Collection[str]) -> dict[str, float]:
    if not isinstance(given, Mapping | None):
        raise ModelError(
            f"{system.name}: {what} is given as a sequence, beside motion; give a dict of names"
        )
    found: dict[str, float] = system.plain_names(given or {}, kinds)
    return found


def _put(system: System, values: dict[str, float], name: str, value: float, what: str) -> None:
    # both are given with the digits that people and files write, not computed
    if name in values and abs(values[name] - value) > 1e-9 * max(1.0, abs(value)):
        raise ModelError(
            f"{system.name}: {what} gives {name} = {values[name]:g}, but its motion starts at"
            f" {value:g}; leave it out of {what}"
        )
    values[name] = value


def _prescribe(system: System, name: str, law: Any) -> Prescribed:
    base, _, kind = str(name).rpartition(".")
    speeds = [speed.name for speed in system.speeds]
    positions = [coordinate.name for coordinate in system.coordinates]
    known = [f"{n}.{k}" for n in speeds for k in _KINDS if k != "q" or n in positions]
    if name not in known:
        raise ModelError(
            f"{system.name}: motion names {quoted(name)}, which is no position, velocity or"
            f" acceleration; {did_you_mean(str(name), known)}"
        )
    t = SX.sym("t")
    if isinstance(law, str | Signal):
        value, z_rate = _signal(system, name, str(law))
    else:
        value, z_rate = _value(system, name, law, t), SX.zeros(system.z.numel())

    def rate_of(expression: SX) -> SX:
        by_states = casadi.jtimes(expression, system.z, z_rate) if system.z.numel() else SX(0)
        return casadi.jacobian(expression, t) + by_states

    rate = rate_of(value)
    laws = {
        "q": (value, rate, rate_of(rate)),
        "v": (SX(0), value, rate),
        "a": (SX(0), SX(0), value),
    }[kind]
    position = positions.index(base) if kind == "q" else None
    inputs = [t, system.z, system.p]
    function = Function("motion", inputs, list(laws), {"allow_free": True})
    if function.has_free():
        raise ModelError(
            f"{system.name}: the motion of {name} is {law}, which follows from"
            f" {', '.join(function.get_free())}; give a signal that follows from states of"
            " components and parameters alone"
        )
    return Prescribed(base, speeds.index(base), position, kind != "a", function)


def _signal(system: System, name: str, given: str) -> tuple[SX, SX]:
    """A signal of a component, and the rates of all states that it follows from."""
    q, v = (
        casadi.vertcat(SX(0, 1), *(SX.sym(f"{row.name}.{letter}") for row in rows))
        for letter, rows in (("q", system.coordinates), ("v", system.speeds))
    )
    sources = {
        f"{part.name}.{signal}": WireSource(part.name, signal)
        for part in system.parts
        for signal in [*part.states, *part.element.output_names]
    }
    if given not in sources:
        raise ModelError(
            f"{system.name}: the motion of {name} is {quoted(given)}; give a finite number, or a"
            " function of the time made of CasADi operations, or an output or a state of a"
            f" component; {did_you_mean(given, list(sources))}"
        )
    _, z_rate, parts = part_equations(system, q, v)
    return parts.signal(sources[given]), z_rate


def _value(system: System, name: str, law: Any, t: SX) -> SX:
    """The law as one scalar expression of the time."""
    given = law
    if callable(law):
        try:
            given = law(t)
        except Exception as error:
            raise untraceable(system, f"the motion of {name}", error) from error
    try:
        value = SX(0, 0) if has_boolean(given) else SX(given)
    except Exception:
        value = SX(0, 0)
    constant = not casadi.symvar(value)
    if value.numel() != 1 or (constant and not casadi.evalf(value).is_regular()):
        raise ModelError(
            f"{system.name}: the motion of {name} is {quoted(given)}; give a finite number, or a"
            " function of the time made of CasADi operations, such as"
            " lambda t: 0.3 * casadi.sin(2 * t)"
        )
    alone = Function("law", [t], [value], {"allow_free": True})
    if alone.has_free():
        raise ModelError(
            f"{system.name}: the motion of {name} holds the symbols {', '.join(alone.get_free())};"
            " make it of the time and numbers"
        )
    return value


# What sensors read in the course of a simulation.


def sensor_values(system: System, motion: Mapping[str, Array]) -> Array:
    """(n, k) values of every element that the sensors read, in their order.

    Args:
        system: with sensors.
        motion: a column for each instant of q (nq, n), v, a and tau (nv, n) of the whole tree, of
            states z and inputs u of components, and of the parameters p (np, n).
    """
    model = measurements(system, "tree")
    count = motion["q"].shape[1]
    read = model.map(count)(*(motion[name] for name in model.name_in()))
    values = read if isinstance(read, tuple) else (read,)
    return np.hstack([np.array(one).T.reshape(count, -1) for one in values])


# What a result shows: a column for each quantity, and where its values come from.


_SCALARS = (("kinetic_energy", "J"), ("potential_energy", "J"), ("closure_residual", "1"))
_BLOCKS = ("x", "a", "tau", "u", "y", "scalars", "sensors", "contacts")
"""Where values come from, side by side: the state, what the state equation observes, the rest."""


_Column = tuple[str, str, str, int]
"""Name and unit of a column, the block where its values are, and the index in it."""


@dataclass(frozen=True, slots=True, eq=False)
class _Columns:
    """The columns of a result.

    Attributes:
        units: by name, in order.
        places: for each, its index in the blocks side by side.
        blocks: which of them the columns are of.
    """

    units: Mapping[str, str]
    places: NDArray[np.int64]
    blocks: frozenset[str]


def _columns_of(system: System, outputs: tuple[str, ...] | None) -> _Columns:
    """All columns of a result, or those that are asked for.

    Raises:
        ModelError: a name is unknown, or there twice.
    """
    nq, nv, nu = system.nq, system.nv, len(system.inputs)
    contacts = contacts_of(system)
    sensors = [column for attached in system.sensors for column in attached.columns]
    sizes = {
        "x": nq + nv + len(system.states),
        "a": nv,
        "tau": nv,
        "u": nu,
        "y": len(system.outputs),
        "scalars": len(_SCALARS),
        "sensors": len(sensors),
        "contacts": 4 * len(contacts),
    }
    first = dict(zip(_BLOCKS, np.cumsum([0, *(sizes[name] for name in _BLOCKS)]), strict=False))
    every: list[_Column] = []
    for k, coordinate in enumerate(system.coordinates):
        every.append((f"{coordinate.name}.q", coordinate.unit, "x", k))
    for k, speed in enumerate(system.speeds):
        every.append((f"{speed.name}.v", speed.unit, "x", nq + k))
        every.append((f"{speed.name}.a", ACCELERATION_UNIT[speed.unit], "a", k))
        every.append((f"{speed.name}.tau", EFFORT_UNIT[speed.unit], "tau", k))
    every += [(*scalar, "scalars", k) for k, scalar in enumerate(_SCALARS)]
    for k, quantity in enumerate(system.inputs):
        every.append((*quantity, "u", k))
    for k, quantity in enumerate(system.states):
        every.append((*quantity, "x", nq + nv + k))
    for k, quantity in enumerate(system.outputs):
        every.append((*quantity, "y", k))
    every += [(name, unit, "sensors", k) for k, (name, unit) in enumerate(sensors)]
    every += [(name, unit, "contacts", k) for k, name, unit in contact_columns(system)]
    if outputs is not None:
        every = _chosen(system, every, outputs)
    return _Columns(
        {name: unit for name, unit, *_ in every},
        np.array([first[block] + index for *_, block, index in every], dtype=np.int64),
        frozenset(block for *_, block, _ in every),
    )


def _chosen(system: System, every: Sequence[_Column], outputs: Sequence[str]) -> list[_Column]:
    known = {column[0]: column for column in every}
    for name in outputs:
        if name not in known:
            raise ModelError(
                f"{system.name}: outputs names {quoted(name)}; {did_you_mean(str(name), known)}"
            )
        if list(outputs).count(name) > 1:
            raise ModelError(f"{system.name}: outputs names {name} twice; name it once")
    return [known[name] for name in outputs]


def _state_names(system: System) -> tuple[tuple[str, ...], tuple[str, ...], tuple[str, ...]]:
    """Names of positions, velocities and states of components."""
    return (
        tuple(row.name for row in system.coordinates),
        tuple(row.name for row in system.speeds),
        tuple(name for name, _ in system.states),
    )


def modes_of(legs: Sequence[Leg]) -> Array:
    """(n, k) modes of rigid stops and Coulomb friction at the rows of a motion."""
    contact = legs[0].contact  # a motion with contacts has one leg
    return np.empty((sum(len(leg.times) for leg in legs), 0)) if contact is None else contact.modes


def require_state_of(system: System, state: State) -> None:
    """Refuse a state of another mechanism.

    Raises:
        ModelError: its names are not those of the system; the message says which.
    """
    wanted, given = _state_names(system), (tuple(state.q), tuple(state.v), tuple(state.z))
    for what, own, other in zip(("positions", "velocities", "states"), wanted, given, strict=True):
        if set(own) != set(other):
            raise ModelError(
                f"{system.name}: the state is of {state.name or 'another mechanism'} and has the"
                f" {what} {', '.join(other) or '(none)'}; give one that has"
                f" {', '.join(own) or '(none)'}"
            )


def _result(
    system: System,
    legs: Sequence[Leg],
    p: Array,
    stop: Stop,
    columns: _Columns,
    allowed: Tolerances,
    note: str,
) -> Result:
    times, x = np.concatenate([leg.times for leg in legs]), np.vstack([leg.x for leg in legs])
    nq, n, np_own = system.nq, system.nq + system.nv, len(system.parameters)
    blocks, contact = [x], legs[0].contact
    if columns.blocks != {"x"}:
        parts = [leg.observed(p) for leg in legs]
        a, tau, u, y, efforts, *scalars = (np.vstack(rows) for rows in zip(*parts, strict=True))
        sensors = np.empty((len(times), 0))
        if "sensors" in columns.blocks:
            every = np.repeat(p[:np_own, None], len(times), axis=1)
            motion = {"q": x[:, :nq].T, "v": x[:, nq:n].T, "z": x[:, n:].T, "u": u.T, "p": every}
            whole = every_effort(system, x[:, :nq], p[:np_own], tau, efforts)
            sensors = sensor_values(system, {**motion, "a": a.T, "tau": whole.T})
        elif system.sensors:
            sensors = np.empty((len(times), sum(len(one.columns) for one in system.sensors)))
        modes = np.empty((len(times), 0)) if contact is None else contact.modes
        blocks += [a, tau, u, y, *scalars, sensors, modes, efforts]
    values = np.hstack(blocks)[:, columns.places]
    happened = [event for leg in legs for event in leg.happened]
    events = list_events(system, contact, happened)
    stopped = None if stop is None or stop.time is None else (stop.time, str(stop))
    info: dict[str, object] = {"tolerance": allowed.common}
    notes = [note] if note else []
    if small := small_motions(system, x[:, :nq], allowed):
        notes.append(f"less than 100 tolerances: {', '.join(small)}; ask for a smaller tolerance")
    if notes:
        info["note"] = ". ".join(notes)
    return Result(
        times,
        values,
        columns.units,
        name=system.name,
        info=info,
        events=events,
        system=system,
        stopped=stopped,
        states=RecordedStates(_state_names(system), x, modes_of(legs)),
    )


# A system under some laws, prepared once for many motions.


_KEPT = 8
"""State equations that a system keeps between runs: a few laws that a script takes in turn. As many
starts, and sets of columns."""


_LOOKS = 1000
"""Steps of a motion under laws in which no pulse can be found beforehand, at least: pulses of one
thousandth of the duration are met."""


def _is_opaque(law: Function | None) -> bool:
    """Whether a law calls code that is no expression: a Callback or a function of a library."""
    if law is None:
        return False
    names = [one.class_name() for one in (law, *law.find_functions())]
    return any("Callback" in name or "External" in name for name in names)


class Simulator(MadeOnce):
    """Motions of one system under the same laws: prepared once, called many times.

    Its state equation and its machine code are made at the first call, kept with the system, and on
    disk by their content, so that another process only reads them. It may be pickled and called
    from several threads at once.

    `simulator(duration, q0=..., inputs={"j1.tau": 2.0})` is a motion as that of `run`.
    """

    settings = ("system",)

    def __init__(
        self,
        system: System,
        inputs: Sequence[str] = (),
        outputs: Sequence[str] | None = None,
        *,
        tau: Effort = None,
        motion: Motion = None,
        u: Effort = None,
        method: str = "dopri5",
    ) -> None:
        """Check what is given for all motions.

        Args:
            system: open or closed.
            inputs: efforts and inputs of components that are numbers of each motion, such as
                "j1.tau" and "motor.voltage"; they take the place of what `tau` and `u` say.
            outputs: the columns of results, such as "j1.q"; all when left out. Accelerations,
                efforts, energies and sensors cost nothing where no column is of them.
            tau: as of `run`, likewise the others.
            motion: likewise.
            u: likewise.
            method: likewise.

        Raises:
            ModelError: `system` is no System, a name is unknown, or a law has the wrong form.
        """
        require_system(system)
        self.system = system
        self._motions = prescribed_motions(system, motion)
        require_contacts_possible(system, self._motions)
        self._effort, self._inputs = effort_function(system, tau), input_function(system, u)
        self._given = given_inputs(system, inputs)
        if not isinstance(method, str) or method not in METHODS:
            raise ModelError(
                f"{system.name}: method is {quoted(method)}; use {', or '.join(map(repr, METHODS))}"
            )
        self._method = method
        self._outputs = None
        if outputs is not None:
            self._outputs = names_given(f"{system.name}: outputs", outputs, "j1.q")
        columns = partial(_columns_of, system, self._outputs)
        self._columns: _Columns = system.recent("columns", self._outputs, columns, _KEPT)

    @property
    def inputs(self) -> tuple[str, ...]:
        """The full names of the inputs that a call may give."""
        return tuple(one.name for one in self._given)

    @property
    def outputs(self) -> tuple[str, ...]:
        """The columns of results."""
        return tuple(self._columns.units)

    def __repr__(self) -> str:
        return f"<Simulator {self.system.name}: {len(self.outputs)} signals>"

    def __reduce__(self) -> tuple[Any, ...]:
        """A pickle holds the system and the laws; what was made of them is found on disk."""
        laws = self._effort, self._inputs, tuple(self._motions)
        plain = self._given, self._outputs, self._method
        return _simulator_of, packed((self.system, laws, plain))

    def __call__(
        self,
        duration: float,
        *,
        q0: Start = None,
        v0: Start = None,
        z0: Start = None,
        guess: Guess = None,
        inputs: Mapping[str, float] | None = None,
        parameters: Mapping[str, float] | None = None,
        step: float = 0.01,
        tolerance: Tolerance = 1e-8,
        max_step: float | None = None,
        quiet: bool = True,
    ) -> Result:
        """One motion.

        Args:
            duration: [s].
            q0: as of `run`, likewise the others.
            v0: likewise.
            z0: likewise.
            guess: likewise.
            inputs: values of those that the simulator has, the others zero or as described.
            parameters: as of `run`, likewise the others.
            step: likewise.
            tolerance: likewise.
            max_step: likewise.
            quiet: likewise.

        Raises:
            what `run` raises.
        """
        system, motions = self.system, self._motions
        duration = positive(duration, "duration [s]", system.name)
        allowed = tolerances_of(system, tolerance)
        longest = math.inf
        if max_step is not None:
            longest = positive(max_step, "max_step [s]", system.name)
        elif _is_opaque(self._effort) or _is_opaque(self._inputs):
            longest = duration / _LOOKS
        steps = count_steps(duration, positive(step, "step [s]", system.name), system.name)
        own = system.parameter_values(parameters)
        p = np.array([*own, *self._values(inputs)])
        begin, modes = 0.0, None
        q0, guess = state_of(q0), state_of(guess)
        speeds, devices = velocities_of(v0), device_states_of(z0)
        if isinstance(q0, State):
            require_state_of(system, q0)
            begin, modes = q0.time, np.array(q0.modes)
            devices = dict(q0.z) if devices is None else devices
        note = _degrees_given(system, q0, guess)
        z = device_states(system, devices)
        placed = start_positions(system, motions, q0, speeds, z, own, begin)
        x0 = np.concatenate([*_started(system, *placed, p, guess), z])
        times = np.linspace(begin, begin + duration, steps + 1)
        rtol, atol, sizes = allowed.of_step()
        with progress(f"simulating {system.name}", 0.0, duration, quiet=quiet) as reached:
            legs, stop = integrate_legs(
                system,
                self._equations,
                x0,
                times,
                p,
                modes,
                method=self._method,
                rtol=rtol,
                atol=atol,
                sizes=sizes,
                max_step=longest,
                progress=reached,
            )
        if motions and legs[0].first_slope is not None:
            H = _first_bias(system, x0, self._inputs, _own(system, p))
            legs[0] = replace(legs[0], driven=tuple(m.velocity for m in motions), first_bias=H)
        if isinstance(stop, Interrupted):  # rows may take long where laws do
            stop.compute = partial(_result, system, legs, p, stop, self._columns, allowed, note)
            raise stop
        result = _result(system, legs, p, stop, self._columns, allowed, note)
        if stop is not None:
            stop.result = result
            raise stop
        return result

    def _values(self, inputs: Mapping[str, float] | None) -> list[float]:
        """Numbers of the inputs that the simulator has."""
        inputs = values_given(f"{self.system.name}: inputs", inputs, '"j1.tau": 2.0')
        if not inputs:
            return [one.default for one in self._given]
        quantities = [(one.name, "") for one in self._given]
        if not quantities:
            raise ModelError(
                f"{self.system.name}: inputs are given, but the simulator has none; name them when"
                f" it is made: Simulator(system, inputs=[{quoted(next(iter(inputs)))}])"
            )
        defaults = [one.default for one in self._given]
        return list(by_name(self.system, "inputs", inputs, quantities, defaults))

    @functools.cached_property
    def _key(self) -> Packed | None:
        """What laws say; None where they hold machine code, which has no text."""
        return content_of((self._effort, self._inputs, tuple(self._motions), self._given))

    def content(self) -> bytes:
        """What its motions follow from, as text that is the same in another process.

        Code of a user is known by the equations that it makes.
        """
        known = self.system.content(), self._key
        if None not in known:
            return repr(known).encode()
        return pickle.dumps(replace(self._equations(self.system), prepared={}))

    def _equations(self, system: System) -> FullState:
        """The state equation of the system, or of one that differs in its independent rows."""
        laws = self._effort, self._inputs, self._motions, self._given
        if self._key is None:
            return full_state(system, *laws)

        def build() -> FullState:
            return _on_disk(system, self._key, lambda: full_state(system, *laws))

        found: FullState = system.recent("state equations", self._key, build, _KEPT)
        return found


# State equations on disk, by all that made them: another process reads what this one derived.


def _on_disk(system: System, laws: Any, derive: Callable[[], FullState]) -> FullState:
    """The state equation that was derived from the same content, in whatever process.

    What cannot be read is derived anew, and so is what code of a user takes part in, which no
    text knows; MBS_KEEP_EQUATIONS=0 keeps nothing on disk.

    Args:
        system: open or closed.
        laws: what else it was derived from, as text.
        derive: makes it where it is not at hand.
    """
    own = system.content()
    if own is None or os.environ.get("MBS_KEEP_EQUATIONS", "1") == "0":
        return derive()
    content = repr((own, laws, casadi.CasadiMeta.version(), _sources()))
    name = hashlib.sha256(content.encode()).hexdigest()
    file = cache_dir() / f"equations-{name}.pickle"
    with suppress(Exception):  # it is not there, or damaged
        found: FullState = pickle.loads(read_sealed(file))
        return found
    made = derive()
    with suppress(Exception):  # a full disk, or a Function without text: the next one derives too
        write_sealed(pickle.dumps(replace(made, prepared={})), file)
    return made


@functools.cache
def _sources() -> str:
    """A hash of this package's Python, which derives the equations."""
    total = hashlib.sha256()
    for file in sorted(Path(__file__).parents[1].rglob("*.py")):
        total.update(file.read_bytes())
    return total.hexdigest()


def _simulator_of(*state: Any) -> Simulator:
    """The simulator that was pickled."""
    system, (effort, inputs, motions), (given, outputs, method) = unpacked(*state)
    made = Simulator(system, [one.name for one in given], outputs, method=method)
    made._effort, made._inputs, made._motions = effort, inputs, list(motions)
    return made


def _degrees_given(system: System, q0: Start, guess: Guess) -> str:
    """Return a note on starts and guesses that look like degrees; those of a state do not."""
    if isinstance(q0, State | Result):
        return ""
    given: dict[str, float] = {}
    if isinstance(guess, Mapping):
        given.update(system.plain_names(guess, GUESSES))
    if isinstance(q0, Mapping):
        given.update(system.plain_names(q0, POSITIONS))
    elif q0 is not None:
        names = (coordinate.name for coordinate in system.coordinates)
        given.update(zip(names, system.position(q0), strict=True))
    return like_degrees([*system.coordinates, *system.cut_coordinates], given)


def _started(
    system: System,
    q0: Start,
    v0: Values,
    p: Array,
    guess: Guess,
) -> tuple[Array, Array]:
    """The start of a motion; the last few are kept, for the next motion from the same one.

    So are positions alone: motions that differ in their velocities close the loops once.
    """
    own = _own(system, p)
    named = dict(zip((one.name for one in system.parameters), own, strict=True))
    if guess is not None or isinstance(q0, State):
        return start(system, q0, v0, named, guess)
    try:
        positions, velocities = (
            tuple(sorted(dict(given).items())) if isinstance(given, Mapping) else given
            for given in (q0, v0)
        )
        hash((positions, velocities))
    except (TypeError, NotImplementedError):  # lists, arrays, DM, and values without meaning
        return start(system, q0, v0, named)

    def position() -> Array:
        return start_position(system, q0, named)

    def build() -> tuple[Array, Array]:
        q: Array = system.recent("start positions", (positions, *own), position, _KEPT)
        return q, start_velocity(system, q, v0, named)

    key = (positions, velocities, *own)
    found: tuple[Array, Array] = system.recent("starts", key, build, _KEPT)
    return found


def run(
    system: System,
    duration: float,
    *,
    q0: Start = None,
    v0: Start = None,
    tau: Effort = None,
    motion: Motion = None,
    u: Effort = None,
    z0: Start = None,
    guess: Guess = None,
    parameters: Mapping[str, float] | None = None,
    step: float = 0.01,
    tolerance: Tolerance = 1e-8,
    max_step: float | None = None,
    method: str = "dopri5",
    quiet: bool = False,
) -> Result:
    """The motion of a system from given positions and velocities under given joint efforts.

    A one-step method with error control. After every step positions and velocities are
    projected onto the independent closure rows, so that loops do not drift; the step is accepted
    when all closure rows hold.

    What stops a motion, an error or control-C, is raised with what was reached as its `result`: a
    `Result` of the rows before the stop, whose `stopped` has the time and the sentence.

    Args:
        system: open or closed.
        duration: [s].
        q0: positions at the start by coordinate name [rad or m], the others as in the assembled
            configuration; in a closed system the loops are closed with the independent ones as
            given, and a complete configuration is taken as it is. Or a `State`, as
            `Result.state` gives it: the motion goes on from there, at its time, with its
            velocities, its states of components and its modes. A `Result` is its last state.
        v0: velocities at the start by name [rad/s or m/s], the others zero; in a closed system
            they may be of any joints, and the others follow. Or those of a `State` or `Result`.
        tau: joint efforts [N m or N]: constants of motors by name, or a function of (t, q, v) made
            of CasADi operations, or a casadi.Function, that returns (nv, 1) efforts, zero where
            there is no motor; or a dict that names joints, also such as have no motor.
        motion: laws for coordinates that drives move: by name such as "j1.q" a position, "j1.v" a
            velocity, "j1.a" an acceleration. Each law is a number, a smooth function of t made of
            CasADi operations, or a signal of a component, itself or by its name, such as
            "filter.q". A signal follows from states of components and parameters alone. The column
            `j1.tau` is the whole effort, with the drive's.
        u: inputs of the devices of drive lines, such as voltages: constants by the name of the
            device, or a function of (t, q, v) as for tau; zero when left out. What the devices
            deliver is added to tau.
        z0: states of devices at the start by name, such as `motor.i`, the others zero. Or those of
            a `State` or `Result`.
        guess: approximate positions of other joints at the start, which choose the branch on which
            the loops are closed.
        parameters: values of symbols, the others at their defaults.
        step: time between the rows of the result [s]; it does not change the accuracy.
        tolerance: error of the motion to be expected [rad, m, rad/s or m/s]. A step may err by a
            twenty-fifth of it, and by a thousandth relative to large coordinates. Or a dict of
            tolerances by unit, such as "rad" and "m/s", and by name, such as "j1.q"; "others" is
            for the other states. A pair has an absolute and a relative tolerance.
            `result.info["note"]` names positions that move by less than 100 tolerances, and starts
            that look like degrees.
        max_step: the longest step of the integration [s]. Error control, the times at which laws
            jump, and short laws limit the steps by default. If a law calls a Callback or an
            external function, whose jumps cannot be found, the default is duration / 1000.
            It is needed where a law is short in space and smooth, such as a narrow potential well.
        method: "dopri5", Dormand and Prince's explicit pair, or "rodas", the linearly implicit
            RODAS5P for stiff systems.
        quiet: no progress bar.

    Returns:
        A `Result` with, for every coordinate, `name.q`, `name.v`, `name.a`, `name.tau`, and
        `kinetic_energy`, `potential_energy`, `closure_residual`; for every device its input, its
        states and its outputs, such as `motor.voltage`, `motor.i`, `motor.tau`, `motor.w`; and
        what every sensor reads, such as `tip.p.x`. A rigid stop or Coulomb friction has `name.mode`
        and `name.effort`, and `events` says when they change.

    Raises:
        ModelError: `system` is no System, a name is unknown or has no motor, or an argument has the
            wrong type or size.
        CompilerError: the compiler that CC names does not start.
        Unclosable: the loops cannot be closed at these positions.
        SolverError: the integration cannot go on; the message says when and why, `result` has
            what was reached.
        Interrupted: control-C was pressed; a KeyboardInterrupt whose `result` has what was reached.
    """
    simulator = simulator_of(system, tau=tau, motion=motion, u=u, method=method)
    return simulator(
        duration,
        q0=q0,
        v0=v0,
        z0=z0,
        guess=guess,
        parameters=parameters,
        step=step,
        tolerance=tolerance,
        max_step=max_step,
        quiet=quiet,
    )


def simulator_of(system: System, inputs: Sequence[str] = (), **laws: Any) -> Simulator:
    """What runs a motion under these laws; where they are numbers, the one of the last such run.

    Args:
        system: open or closed.
        inputs: as of `Simulator`.
        laws: likewise, and the method.
    """

    def build() -> Simulator:
        return Simulator(system, inputs, **laws)

    require_system(system)
    key = list(names_given(f"{system.name}: inputs", inputs, "j1.tau"))
    for name, law in laws.items():
        if law is None or type(law) is str:
            key.append(f"{name} {law}")
            continue
        # a function may say something else in the next call
        if type(law) is not dict or any(type(value) not in (int, float) for value in law.values()):
            return build()
        key.append(f"{name} {law}")  # every digit of the numbers, and the signs of zeros
    found: Simulator = system.recent("simulators", tuple(key), build, _KEPT)
    return found


def _first_bias(system: System, x0: Array, inputs: Function | None, p: Array) -> Array:
    """(nv,) efforts of gravity and velocities at the start."""
    n = system.nq + system.nv
    q, v = x0[: system.nq], x0[system.nq : n]
    u = system.u_default if inputs is None else np.array(inputs(0, q, v, p)).ravel()
    point = {"q": q, "v": v, "z": x0[n:], "u": u, "p": p}
    found = bias(system, "tree")
    return np.array(found(*(point[name] for name in found.name_in())))[:, 0]
