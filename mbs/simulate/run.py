"""Simulate a system with closed loops, by compiled code if a C compiler is available."""

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
from mbs.assembly.pickling import Packed, content_of, packed, unpacked
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

# Rigid stops and Coulomb friction in a simulation: initial modes, events, columns of results.


Array = NDArray[np.float64]

_LIMITS = {-1: "lower", 1: "upper"}


@dataclass(frozen=True, slots=True, eq=False)
class ContactMotion:
    """Contact modes and events of k coordinates with stops or friction in a simulation.

    Attributes:
        first: modes at the start, (2 k,): k of the stops, then k of friction.
        modes: modes at the times of the motion, (m, 2 k).
        events: contact events in order of time.
    """

    first: Array
    modes: Array
    events: tuple[IntegrationEvent, ...]


def require_contacts_possible(system: System, motions: Sequence[Prescribed]) -> None:
    """Raise if rigid stops or Coulomb friction cannot be simulated in this system.

    Raises:
        ModelError: prescribed motions move a coordinate with a stop or friction, two contacts
            of the same kind act on one coordinate, or the loops are over-constrained and their
            independent rows change with the configuration.
    """
    contacts = contacts_of(system)
    require_undriven(system, contacts, [motion.velocity for motion in motions])
    require_lasting_rows(system, contacts)


def first_modes(system: System, x0: Array, p: Array) -> Array:
    """Return the contact modes at the start, (2 k,).

    A coordinate that rests at a limit is in contact; a coordinate that moves slides.

    Args:
        system: system with k coordinates on which contacts act.
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
    """Yield index, name and unit of the columns of contacts: 2 k modes, then 2 k efforts.

    Args:
        system: system with k coordinates on which contacts act.
    """
    contacts = contacts_of(system)
    for column, element in enumerate((*contacts.stops, *contacts.frictions)):
        if element is not None:
            yield column, f"{element.name}.mode", "1"
            yield 2 * len(contacts) + column, f"{element.name}.effort", element.unit


def every_effort(system: System, q: Array, p: Array, tau: Array, efforts: Array) -> Array:
    """Return the joint efforts (m, nv), including the efforts of contacts.

    Args:
        system: system with k >= 0 coordinates on which contacts act.
        q: positions (m, nq).
        p: parameters (np,).
        tau: joint efforts (m, nv) without contacts.
        efforts: contact efforts (m, 2 k): k of the stops, then k of friction.
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
    """Return time, name of the element or component, and description of every event.

    Args:
        system: simulated system.
        contact: contact modes and events. The indices of component events follow the indices of
            contact events. None if the system has no contacts.
        others: component events of a system without contacts.
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
    """Return the name of the component and the event text with the label of its contact."""
    return element.part.name, f"{element.label} {what}" if element.label else what


# Inputs and initial states of the devices of drive lines, from all accepted forms.


def input_function(system: System, u: Effort) -> Function | None:
    """Return the Function `u(t, q, v, p) -> u` of the device inputs, (nu, 1).

    Args:
        system: open or closed system.
        u: dict of constants by device name, sequence of all nu inputs, function of (t, q, v), or
            None for the defaults `system.u_default`.

    Returns:
        Function of the inputs. None if `u` is None or empty.

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
    """Return the states of the devices at the start.

    Args:
        system: open or closed system.
        z0: dict of states by name, such as `motor.i`, or sequence of all states. A state without
            value starts at its default `system.z_start`.

    Raises:
        ModelError: a name is unknown, the number of values is wrong, or a value is not finite.
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


# Integration in one segment (Leg), or in several if the independent closure rows change.
#
# In an over-constrained loop such as Bennett's, the set of independent closure rows changes with
# the configuration: no set is valid over a whole revolution. Steps in local tangent coordinates
# use all rows. If these steps are not available, as for laws that CasADi cannot write as C, a
# segment ends when its rows have lost most of their independence. The next segment starts there
# with rows that are chosen for that configuration.


_LOST = 0.05
"""Fraction of the row independence at the start of a segment at which the segment ends."""
_SINGULAR = 1e-6
"""Row independence below which a configuration is singular; it corresponds to a sine of 1e-3."""
_FLAT = 1e-3
"""Sine of the angle between a rolling disc and its plane below which the disc lies flat."""

_INTERPRETED = 2e6
"""Number of instructions that CasADi interprets in about 10 ms. Beyond it, `observe` is compiled,
which takes some tenths of a second for a mechanism of ten links."""

_FIRST_STEP = 1e-9
"""First step after a crossing [s]; steps grow up to tenfold each if their error is small. A contact
of two fast bodies is then resolved before the bodies pass through each other."""

Stop = SolverError | Interrupted | None
"""Error that ends a motion early; None if the motion reaches its end."""


@dataclass(frozen=True, slots=True, eq=False)
class Leg:
    """Segment of a motion with one state equation.

    Attributes:
        state: state equation.
        times: times that were reached [s], (m,).
        x: states at these times, (m, nx).
        contact: modes and events of rigid stops and Coulomb friction; None without contacts.
        first_slope: slope at a singular start, `EventMotion.first_slope`; None at a regular start.
        driven: indices of the velocities whose motion is prescribed.
        happened: events of components in a system without contacts.
        first_bias: efforts of gravity and velocities at the first time, (nv,), or None.
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
        """Copy without the first row, which is the last row of the previous segment."""
        return replace(self, times=self.times[1:], x=self.x[1:])

    def observed(self, p: Array) -> list[Array]:
        """Return the outputs of `state.observe` at the m times, each (m, ..)."""
        observe, count = self.state.observe, len(self.times)
        if not count:
            return [np.empty((0, observe.numel_out(k))) for k in range(observe.n_out())]
        every = np.repeat(p[None, :], count, axis=0)
        if self.contact is not None:
            every = np.hstack([every, self.contact.modes])
        # rows are contiguous in memory, as the columns of a CasADi map
        values = [found.T for found in self._map(count)(self.times, self.x, every)]
        if self.first_slope is not None:  # the closure rows do not determine them
            self._correct_first(values[0][0], values[1][0], every[0])
        return values

    def _map(self, count: int) -> OnArrays:
        """Return `observe` mapped over `count` states; compiled beyond `_INTERPRETED` in total."""
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
        """Set accelerations and drive efforts of the branch at a singular start, in place.

        The effort of one drive follows from the power of inertia and forces. The efforts of
        several drives are not determined (nan).
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
    """Integrate a motion over given times, in one segment for most systems.

    Args:
        system: open or closed system.
        equations: callable that returns the state equation of `system` or of a copy with other
            independent rows.
        x0: state at the first time, (nx,).
        times: increasing times [s], (m,).
        p: parameters (np,), followed by the inputs of this motion.
        modes: modes of rigid stops and Coulomb friction at the start, (2 k,). By default they
            follow from the positions and velocities.
        options: options of `integrate_events`.

    Returns:
        The segments that were reached, at least one, and None or the error that ends the motion
        early. The error message contains the time and the configuration, and at a singular
        configuration the joint that the loops do not constrain.
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
    """Return the parameters of the system, without the inputs of the motion."""
    return p[: len(system.parameters)]


def _without_inertia(system: System) -> str:
    """Return the end of an error message that names a velocity without inertia, or empty text."""
    try:
        require_inertia(system)
    except ModelError as error:
        return "; " + str(error).removeprefix(f"{system.name}: ")
    return without_values(system)


_TOUCHED = 1e-6
"""Distance from a limit [rad or m] below which a stop is closed; impacts are located to 1e-9."""


def _at_stops(system: System, x: Array, p: Array) -> str:
    """Return text with the rigid stops closed at a singular state and the remedy, or empty text."""
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
    """Return the error message with names of components in place of indices of indicators."""
    message, _, numbers = str(stop).partition("; indicators ")
    contacts = [name for _ in KINDS for name in contacts_of(system).names]
    names = [*contacts, *map(", ".join, part_event_names(system))]
    blamed = [names[k] for k in stop.fired if k < len(names)]
    return f"{message}; it concerns {' and '.join(blamed)}" if numbers and blamed else str(stop)


def _lost(system: System, q: Array, p: Array) -> str:
    """Return text with the joint that moves most in the least constrained directions at q."""
    found = scales(system)
    J = np.array(constraint_jacobian(system)(q, _own(system, p)))
    J = J * found.rows.reshape(-1, 1) * found.columns([speed.unit for speed in system.speeds])
    assert system.closure is not None
    rank = system.nv - system.closure.mobility
    if not rank or not np.isfinite(J).all():
        return ""
    free = np.linalg.svd(J)[2][rank - 1 :]  # at least the free directions at q
    moves = np.round(np.sum(free**2, axis=0), 6)  # rounded: the first of equal joints is chosen
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
            state = equations(rows_at(system, q, parameters))  # other rows may be regular
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
    """Integrate as far as possible. Steps end at discontinuities of the laws of components."""
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
    """Return times of jumps, kinks and short pulses of the laws of time; the last are cached."""
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
    few = state.sides + state.counts
    plain, sides, counts = np.split(start, [len(start) - few, len(start) - state.counts])
    places = [*np.where(plain > 0, 1.0, -1.0), *np.sign(sides), *np.floor(counts)]
    if few:  # initial modes of `guard`: awake, no repeated events, since the start
        begin = float(math.floor(ticks_of(t0, duration)))
        places += [*np.zeros(2 * few), *np.full(few, begin), duration]
    first_step = _FIRST_STEP if state.short else 0.0
    return Events(indicators, jump, [*modes, *places], first_step, approaches), functions


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
        there, *changed = events.jump.call([*at, fired_first])  # modes, if any
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


@dataclass(frozen=True, slots=True, eq=False)
class Limit:
    """End of a segment: a measure of the configuration falls below a level.

    Attributes:
        measure: Function `measure(q, p)`.
        level: value of the measure at which the segment ends.
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
    """Integrate in segments, each with closure rows chosen at its first configuration."""
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
    """Integrate one segment up to the limit; after it the state is held constant until the end."""
    n, n_p = len(x0), len(p)
    count = state.events[0].numel_out(0) if state.events else 0
    t, x, pm, fired = (
        SX.sym(k, m) for k, m in (("t", 1), ("x", n), ("p", n_p + 1), ("f", count + 1))
    )
    parameters, ended = pm[:n_p], pm[n_p]
    # after the limit the rate is zero, even if `rhs` is not finite
    rate = casadi.if_else(ended, 0, state.rhs(t, x, parameters))
    rhs = Function("rhs", [t, x, pm], [rate])
    assert state.project is not None
    corrected, residual = state.project(t, x, parameters)
    kept = [casadi.if_else(ended, x, corrected), casadi.if_else(ended, 0, residual)]
    project = Function("project", [t, x, pm], kept)
    # indicators of components, then of the limit
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
    """Choose the closure rows at a configuration and the limit at which their segment ends.

    The limit is None if the configuration is singular. No segment can start there.
    """
    better = rows_at(system, q, p)
    old, new = (float(row_independence(one)(q, p)) for one in (system, better))
    chosen, now = (better, new) if new > 2 * old else (system, old)
    limit = Limit(row_independence(chosen), _LOST * now) if now >= _SINGULAR else None
    return chosen, limit


# Prescribed motions: laws of time or signals, by the names of positions and their rates.


Motion = Mapping[str, float | str | Signal | Function | Callable[[Any], Any]] | None
_KINDS = ("q", "v", "a")


def prescribed_motions(system: System, motion: Motion) -> list[Prescribed]:
    """Return the prescribed motions of a dict with names such as "j1.q", "j1.v" and "j1.a".

    Args:
        system: open or closed system.
        motion: law of each name: a number, a function of time made of CasADi operations, or a
            signal of a component (the Signal or its name).

    Raises:
        ModelError: a name is unknown, a law is not a function of time, a signal depends on the
            motion, or the loops make the prescribed velocities dependent.
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
        hybrid_dynamics(system, names)  # raises if the loops make them dependent
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
    """Return the initial positions and velocities, including the prescribed values.

    Args:
        system: open or closed system.
        motions: prescribed motions.
        q0: positions by name.
        v0: velocities by name.
        z0: states of components at the start, (nz,).
        p: parameters (np,).
        begin: first time [s].

    Raises:
        ModelError: `q0` or `v0` contradicts a prescribed value, or is not given by name.
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
    # relative tolerance 1e-9: both values are typed or read from files, not computed
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
    """Return a signal of a component and the rates (nz, 1) of all states of components."""
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
    """Return the law as a scalar expression of the time t."""
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


# Sensor readings in a simulation.


def sensor_values(system: System, motion: Mapping[str, Array]) -> Array:
    """Return the readings of all sensors at n instants, (n, k), in the order of the sensors.

    Args:
        system: system with sensors.
        motion: arrays with one column per instant: q (nq, n), v, a and tau (nv, n) of the whole
            tree, states z and inputs u of components, parameters p (np, n).
    """
    model = measurements(system, "tree")
    count = motion["q"].shape[1]
    read = model.map(count)(*(motion[name] for name in model.name_in()))
    values = read if isinstance(read, tuple) else (read,)
    return np.hstack([np.array(one).T.reshape(count, -1) for one in values])


# Columns of a result: name, unit and source of the values of each quantity.


_SCALARS = (("kinetic_energy", "J"), ("potential_energy", "J"), ("closure_residual", "1"))
_BLOCKS = ("x", "a", "tau", "u", "y", "scalars", "sensors", "contacts")
"""Blocks of values in order: state, outputs of `observe` (a, tau, u, y, scalars), the others."""


_Column = tuple[str, str, str, int]
"""Name and unit of a column, name of the block of its values, index in the block."""


@dataclass(frozen=True, slots=True, eq=False)
class _Columns:
    """Columns of a result.

    Attributes:
        units: unit of each column by name, in order.
        places: index of each column in the concatenated blocks.
        blocks: names of the blocks that the columns use.
    """

    units: Mapping[str, str]
    places: NDArray[np.int64]
    blocks: frozenset[str]


def _columns_of(system: System, outputs: tuple[str, ...] | None) -> _Columns:
    """Return all columns of a result, or the columns named in `outputs`.

    Raises:
        ModelError: a name is unknown, or occurs twice.
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
    """Return the names of positions, velocities and states of components."""
    return (
        tuple(row.name for row in system.coordinates),
        tuple(row.name for row in system.speeds),
        tuple(name for name, _ in system.states),
    )


def modes_of(legs: Sequence[Leg]) -> Array:
    """Return the modes of rigid stops and Coulomb friction at n rows, (n, 2 k) or (n, 0)."""
    contact = legs[0].contact  # a motion with contacts has one segment
    return np.empty((sum(len(leg.times) for leg in legs), 0)) if contact is None else contact.modes


def require_state_of(system: System, state: State) -> None:
    """Raise if a state belongs to another mechanism.

    Raises:
        ModelError: the names of the state differ from the names of the system.
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


# Simulator: a system with laws of efforts and motions, prepared once for many simulations.


_KEPT = 8
"""Maximum number of cached state equations per system, enough for a script with a few laws; also
the maximum number of cached simulators, starts and sets of columns."""


_LOOKS = 1000
"""Minimum number of steps of a motion under laws whose pulses cannot be located beforehand: a pulse
of one thousandth of the duration is not missed."""


def _is_opaque(law: Function | None) -> bool:
    """Return whether a law calls a Callback or an external function, whose code is opaque."""
    if law is None:
        return False
    names = [one.class_name() for one in (law, *law.find_functions())]
    return any("Callback" in name or "External" in name for name in names)


class Simulator(MadeOnce):
    """Simulator of one system under fixed laws, prepared once and called many times.

    The first call derives the state equation and compiles it. Both are cached with the system and
    on disk, so that another process reads them. A simulator can be pickled, and can be called from
    several threads at once.

    `simulator(duration, q0=..., inputs={"j1.tau": 2.0})` simulates one motion, as `run` does.
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
        """Check and store the arguments that are common to all motions.

        Args:
            system: open or closed system.
            inputs: names of efforts and component inputs whose constant value is set in each call,
                such as "j1.tau" and "motor.voltage". The values replace those of `tau` and `u`.
            outputs: names of the columns of results, such as "j1.q"; all columns by default.
                Accelerations, efforts, energies and sensors without column are not computed.
            tau: joint efforts, as in `run`.
            motion: prescribed motions, as in `run`.
            u: inputs of devices, as in `run`.
            method: integration method, as in `run`.

        Raises:
            ModelError: `system` is not a System, a name is unknown, or a law has the wrong form.
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
        """Full names of the inputs whose values can be set in a call."""
        return tuple(one.name for one in self._given)

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the columns of results."""
        return tuple(self._columns.units)

    def __repr__(self) -> str:
        return f"<Simulator {self.system.name}: {len(self.outputs)} signals>"

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the system and the laws. The derived equations are cached on disk."""
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
        """Simulate one motion.

        Args:
            duration: duration [s].
            q0: initial positions, as in `run`.
            v0: initial velocities, as in `run`.
            z0: initial states of devices, as in `run`.
            guess: approximate positions that select the branch of the loops, as in `run`.
            inputs: values of `Simulator.inputs` by name. An input without value has its default.
            parameters: values of parameters by name, as in `run`.
            step: time between the rows of the result [s].
            tolerance: expected error of the motion, as in `run`.
            max_step: longest integration step [s], as in `run`.
            quiet: Whether to hide the progress bar.

        Raises:
            ModelError, CompilerError, Unclosable, SolverError, Interrupted: as in `run`.
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
        if isinstance(stop, Interrupted):  # deferred: slow laws make the rows slow
            stop.compute = partial(_result, system, legs, p, stop, self._columns, allowed, note)
            raise stop
        result = _result(system, legs, p, stop, self._columns, allowed, note)
        if stop is not None:
            stop.result = result
            raise stop
        return result

    def _values(self, inputs: Mapping[str, float] | None) -> list[float]:
        """Return the values of `self.inputs`, in order; defaults if no value is given."""
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
        """Cache key of the laws; None if they contain machine code, which has no text form."""
        return content_of((self._effort, self._inputs, tuple(self._motions), self._given))

    def content(self) -> bytes:
        """Return a cache key of system and laws that is the same in every process.

        If the laws or components contain user-defined Python code, it is the pickled equation.
        """
        known = self.system.content(), self._key
        if None not in known:
            return repr(known).encode()
        return pickle.dumps(replace(self._equations(self.system), prepared={}))

    def _equations(self, system: System) -> FullState:
        """Return the state equation of the system, or of a copy with other independent rows."""
        laws = self._effort, self._inputs, self._motions, self._given
        if self._key is None:
            return full_state(system, *laws)

        def build() -> FullState:
            return _on_disk(system, self._key, lambda: full_state(system, *laws))

        found: FullState = system.recent("state equations", self._key, build, _KEPT)
        return found


# Cache of state equations on disk, shared between processes.


def _on_disk(system: System, laws: Any, derive: Callable[[], FullState]) -> FullState:
    """Return a state equation from the cache on disk, or derive and store it.

    An unreadable entry is derived again. Systems with user-defined Python code have no cache key
    and are not cached. MBS_KEEP_EQUATIONS=0 disables the cache.

    Args:
        system: open or closed system.
        laws: cache key of the laws.
        derive: callable that derives the state equation.
    """
    own = system.content()
    if own is None or os.environ.get("MBS_KEEP_EQUATIONS", "1") == "0":
        return derive()
    content = repr((own, laws, casadi.CasadiMeta.version(), _sources()))
    name = hashlib.sha256(content.encode()).hexdigest()
    file = cache_dir() / f"equations-{name}.pickle"
    with suppress(Exception):  # the file is missing or damaged
        found: FullState = pickle.loads(read_sealed(file))
        return found
    made = derive()
    with suppress(Exception):  # a full disk, or a Function that cannot be pickled
        write_sealed(pickle.dumps(replace(made, prepared={})), file)
    return made


@functools.cache
def _sources() -> str:
    """Return a hash of the Python files of this package, which derive the equations."""
    total = hashlib.sha256()
    for file in sorted(Path(__file__).parents[1].rglob("*.py")):
        total.update(file.read_bytes())
    return total.hexdigest()


def _simulator_of(*state: Any) -> Simulator:
    """Restore a pickled simulator."""
    system, (effort, inputs, motions), (given, outputs, method) = unpacked(*state)
    made = Simulator(system, [one.name for one in given], outputs, method=method)
    made._effort, made._inputs, made._motions = effort, inputs, list(motions)
    return made


def _degrees_given(system: System, q0: Start, guess: Guess) -> str:
    """Return a note on starts and guesses that look like degrees; empty text if q0 is a state."""
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
    """Return the initial positions and velocities; the last few results are cached.

    Positions are also cached alone: starts that differ in velocities close the loops once.
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
    except (TypeError, NotImplementedError):  # lists, arrays, DM and invalid values
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
    """Simulate a system from initial positions and velocities under joint efforts and motions.

    The forward dynamics are integrated by a one-step method with error control. After every step,
    positions and velocities are projected onto the independent closure rows, so that the loops do
    not drift. A step is accepted if all closure rows are satisfied.

    An error or control-C during the integration raises an exception with the attribute `result`:
    a `Result` of the rows before the stop. Its `stopped` contains the time and the error message.

    Args:
        system: open or closed system.
        duration: duration [s].
        q0: initial positions by coordinate name [rad or m]; the other coordinates are as in the
            assembled configuration. In a closed system the independent positions are kept and the
            loops are closed; a complete configuration is used unchanged. A `State` of
            `Result.state` continues that motion with its time, velocities, component states and
            modes. A `Result` is replaced by its last state.
        v0: initial velocities by name [rad/s or m/s]; the others are zero. In a closed system they
            may be of any joints, and the others follow. A `State` or `Result` is also accepted.
        tau: joint efforts [N m or N]: dict of constants by motor name, or a function of (t, q, v)
            made of CasADi operations, or a casadi.Function. A function returns efforts (nv, 1),
            zero for joints without motor, or a dict by joint name, also of joints without motor.
        motion: prescribed motions by name: "j1.q" for a position, "j1.v" for a velocity, "j1.a"
            for an acceleration. Each law is a number, a smooth function of t made of CasADi
            operations, or a signal of a component (the Signal or its name, such as "filter.q")
            that depends on component states and parameters only. The column `j1.tau` is the total
            effort, including the effort of the drive.
        u: inputs of the devices of drive lines, such as voltages: dict of constants by device name,
            or a function of (t, q, v) as for tau. The default is `system.u_default`. The efforts of
            the devices are added to tau.
        z0: initial states of devices by name, such as `motor.i`; the others have their default.
            A `State` or `Result` is also accepted.
        guess: approximate initial positions of other joints, which select the branch on which the
            loops are closed.
        parameters: values of parameters by name; the others have their defaults.
        step: time between the rows of the result [s]; it does not change the accuracy.
        tolerance: expected error of the motion [rad, m, rad/s or m/s]. The error of one step is
            limited to 1/25 of this value, and to 1/1000 relative to large coordinates. A dict sets
            tolerances by unit, such as "rad" and "m/s", and by name, such as "j1.q"; "others" is
            for the other states. A pair is an absolute and a relative tolerance.
            `result.info["note"]` names positions that move by less than 100 tolerances, and starts
            that look like degrees.
        max_step: longest integration step [s]. By default error control, the times at which laws
            jump, and short laws limit the steps. If a law calls a Callback or an external function,
            whose jumps cannot be located, the default is duration / 1000. Set it if a law is
            smooth and short in space, such as a narrow potential well.
        method: "dopri5", the explicit pair of Dormand and Prince, or "rodas", the linearly implicit
            RODAS5P for stiff systems.
        quiet: Whether to hide the progress bar.

    Returns:
        Result with `name.q`, `name.v`, `name.a` and `name.tau` of every coordinate, and
        `kinetic_energy`, `potential_energy`, `closure_residual`. Every device has its input, states
        and outputs, such as `motor.voltage`, `motor.i`, `motor.tau`, `motor.w`; every sensor has
        its readings, such as `tip.p.x`. A rigid stop or Coulomb friction has `name.mode` and
        `name.effort`, and `events` lists the times of its changes.

    Raises:
        ModelError: `system` is not a System, a name is unknown or has no motor, or an argument has
            the wrong type or size.
        CompilerError: the compiler named by the environment variable CC does not start.
        Unclosable: the loops cannot be closed at these positions.
        SolverError: the integration cannot continue. The message contains the time and the reason,
            `result` the rows that were reached.
        Interrupted: control-C was pressed. It is a KeyboardInterrupt; `result` contains the rows
            that were reached.
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
    """Return a simulator for these laws; simulators of constant laws are cached.

    Args:
        system: open or closed system.
        inputs: names of inputs, as in `Simulator`.
        laws: keyword arguments tau, motion, u and method of `Simulator`.
    """

    def build() -> Simulator:
        return Simulator(system, inputs, **laws)

    require_system(system)
    key = list(names_given(f"{system.name}: inputs", inputs, "j1.tau"))
    for name, law in laws.items():
        if law is None or type(law) is str:
            key.append(f"{name} {law}")
            continue
        # a function may return another value in the next call
        if type(law) is not dict or any(type(value) not in (int, float) for value in law.values()):
            return build()
        key.append(f"{name} {law}")  # with all digits, and the signs of zeros
    found: Simulator = system.recent("simulators", tuple(key), build, _KEPT)
    return found


def _first_bias(system: System, x0: Array, inputs: Function | None, p: Array) -> Array:
    """Return the efforts of gravity and velocities (bias) at the start, (nv,)."""
    n = system.nq + system.nv
    q, v = x0[: system.nq], x0[system.nq : n]
    u = system.u_default if inputs is None else np.array(inputs(0, q, v, p)).ravel()
    point = {"q": q, "v": v, "z": x0[n:], "u": u, "p": p}
    found = bias(system, "tree")
    return np.array(found(*(point[name] for name in found.name_in())))[:, 0]
