"""Integration of a motion in one segment, or in several if the independent closure rows change.

In an over-constrained loop such as Bennett's, the set of independent closure rows changes with
the configuration: no set is valid over a whole revolution. Steps in local tangent coordinates
use all rows. If these steps are not available, as for laws that CasADi cannot write as C, a
segment ends when its rows have lost most of their independence. The next segment starts there
with rows that are chosen for that configuration.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import casadi
import numpy as np
from casadi import SX, Function
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.errors import Interrupted, ModelError, SolverError
from mbs.loops.analysis import rows_at
from mbs.loops.balance import without_values
from mbs.loops.closure_equations import least_upright, rolling_discs
from mbs.loops.examination import row_independence
from mbs.loops.velocity import constraint_jacobian, scales
from mbs.models._direct_dynamics import require_inertia
from mbs.models.contacts import (
    KINDS,
    contacts_of,
)
from mbs.models.state.events import StateEvents
from mbs.models.state.tree import FullState
from mbs.native import compiled
from mbs.numbers import OnArrays, on_arrays
from mbs.recursions.parts import part_event_names
from mbs.simulate.contact_motion import ContactMotion, initial_modes
from mbs.simulate.crossings import with_crossings, without_crossings
from mbs.solvers import EventMotion, Events, integrate_events
from mbs.solvers.problem import IntegrationEvent, failed

Array = NDArray[np.float64]

_LEFT_INDEPENDENCE = 0.05
"""Fraction of the row independence at the start of a segment at which the segment ends."""
_SINGULAR = 1e-6
"""Row independence below which a configuration is singular; it corresponds to a sine of 1e-3."""
_DISC_FLAT = 1e-3
"""Sine of the angle between a rolling disc and its plane below which the disc lies flat."""
_STOP_CLOSED = 1e-6
"""Distance from a limit [rad or m] below which a stop is closed; impacts are located to 1e-9."""

_INTERPRETED = 2e6
"""Number of instructions that CasADi interprets in about 10 ms. Beyond it, `observe` is compiled,
which takes some tenths of a second for a mechanism of ten links."""

_NO_MODES = np.empty(0)

StopReason = SolverError | Interrupted | None
"""Error that ends a motion early; None if the motion reaches its end."""


@dataclass(frozen=True, slots=True, eq=False)
class Segment:
    """Segment of a motion with one state equation.

    Attributes:
        state: state equation.
        times: times that were reached [s], (m,).
        x: states at these times, (m, nx).
        contact: modes and events of rigid stops and Coulomb friction; None without contacts.
        first_slope: slope at a singular start, `EventMotion.first_slope`; None at a regular start.
        driven: indices of the velocities whose motion is prescribed.
        part_events: events of components in a system without contacts.
        first_bias: efforts of gravity and velocities at the first time, (nv,), or None.
    """

    state: FullState
    times: Array
    x: Array
    contact: ContactMotion | None = None
    first_slope: Array | None = None
    driven: tuple[int, ...] = ()
    first_bias: Array | None = None
    part_events: tuple[IntegrationEvent, ...] = ()

    @property
    def without_first_row(self) -> Segment:
        """Copy without the first row, which is the last row of the previous segment."""
        return replace(self, times=self.times[1:], x=self.x[1:])

    def observe(self, p: Array) -> list[Array]:
        """Return the outputs of `state.observe` at the m times, each (m, ..)."""
        observe, count = self.state.observe, len(self.times)
        if not count:
            return [np.empty((0, observe.numel_out(k))) for k in range(observe.n_out())]
        every = np.repeat(p[None, :], count, axis=0)
        if self.contact is not None:
            every = np.hstack([every, self.contact.modes])
        # rows are contiguous in memory, as the columns of a CasADi map
        values = [found.T for found in self._observe_function(count)(self.times, self.x, every)]
        if self.first_slope is not None:  # the closure rows do not determine them
            self._correct_first_row(values[0][0], values[1][0], every[0])
        return values

    def _observe_function(self, count: int) -> OnArrays:
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

    def _correct_first_row(self, a: Array, tau: Array, p: Array) -> None:
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


def integrate_segments(
    system: System,
    equations: Callable[[System], FullState],
    x0: Array,
    times: Array,
    p: Array,
    modes: Array | None = None,
    **options: Any,
) -> tuple[list[Segment], StopReason]:
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
    segments, stop = _integrate(system, equations, x0, times, p, modes, **options)
    if isinstance(stop, SolverError) and stop.state:
        q = np.array(stop.state[: system.nq])
        where = ", ".join(f"{c.name} = {x:.6g}" for c, x in zip(system.coordinates, q, strict=True))
        own, cause = system_parameters(system, p), stop.__cause__
        if stop.singular:
            reason = _free_joint_message(system, q, own) if system.is_closed else ""
            reason += _closed_stops_message(system, np.array(stop.state), own)
        else:
            reason = _inertia_message(system)
        said = _with_component_names(system, stop)
        stop = SolverError(
            f"{system.name}: {said}; the configuration is {where}{reason}",
            state=stop.state,
            singular=stop.singular,
            time=stop.time,
            fired=stop.fired,
        )
        stop.__cause__ = cause
    return segments, stop


def system_parameters(system: System, p: Array) -> Array:
    """Return the parameters of the system, without the inputs of the motion."""
    return p[: len(system.parameters)]


def _inertia_message(system: System) -> str:
    """Return the end of an error message that names a velocity without inertia, or empty text."""
    try:
        require_inertia(system)
    except ModelError as error:
        return "; " + str(error).removeprefix(f"{system.name}: ")
    return without_values(system)


def _closed_stops_message(system: System, x: Array, p: Array) -> str:
    """Return text with the rigid stops closed at a singular state and the remedy, or empty text."""
    contacts = contacts_of(system)
    if not len(contacts):
        return ""
    q, v = SX.sym("q", system.nq), SX.sym("v", system.nv)
    limits = Function("limits", [q, v, system.p], [*contacts.bounds, contacts.at(q, v).measure])
    found = limits(x[: system.nq], x[system.nq : system.nq + system.nv], p)
    lower, upper, value = (np.array(row)[:, 0] for row in found)
    gaps = np.minimum(np.abs(value - lower), np.abs(upper - value))
    closed = [name for name, gap in zip(contacts.names, gaps, strict=True) if gap < _STOP_CLOSED]
    if not closed:
        return ""
    return (
        f"; the rigid stop at {' and '.join(closed)} is closed there: move its limit away from the"
        " singular configuration, or use an elastic JointStop"
    )


def _with_component_names(system: System, stop: SolverError) -> str:
    """Return the error message with names of components in place of indices of indicators."""
    message, _, numbers = str(stop).partition("; indicators ")
    contacts = [name for _ in KINDS for name in contacts_of(system).names]
    names = [*contacts, *map(", ".join, part_event_names(system))]
    blamed = [names[k] for k in stop.fired if k < len(names)]
    return f"{message}; it concerns {' and '.join(blamed)}" if numbers and blamed else str(stop)


def _free_joint_message(system: System, q: Array, p: Array) -> str:
    """Return text with the joint that moves most in the least constrained directions at q."""
    found = scales(system)
    J = np.array(constraint_jacobian(system)(q, p))
    J = (
        J
        * found.rows.reshape(-1, 1)
        * found.columns([speed.unit for speed in system.velocity_coordinates])
    )
    assert system.closure is not None
    rank = system.nv - system.closure.mobility
    if not rank or not np.isfinite(J).all():
        return ""
    free = np.linalg.svd(J)[2][rank - 1 :]  # at least the free directions at q
    moves = np.round(np.sum(free**2, axis=0), 6)  # rounded: the first of equal joints is chosen
    name = system.velocity_coordinates[int(np.argmax(moves))].name
    return f", and the loops hardly hold {name} there"


def _integrate(
    system: System,
    equations: Callable[[System], FullState],
    x0: Array,
    times: Array,
    p: Array,
    modes: Array | None,
    **options: Any,
) -> tuple[list[Segment], StopReason]:
    state = equations(system)
    if system.closure is not None and system.closure.varies:
        if state.passage is None:
            return _integrate_with_row_changes(system, equations, x0, times, p, options)
        q, parameters = x0[: system.nq], system_parameters(system, p)
        if float(row_independence(system)(q, parameters)) < _SINGULAR:
            state = equations(rows_at(system, q, parameters))  # other rows may be regular
    if len(contacts_of(system)):
        return _integrate_with_contacts(system, state, x0, times, p, modes, options)
    discs = [disc.name for _, disc in rolling_discs(system)]
    if discs:
        upright = SegmentEnd(least_upright(system), _DISC_FLAT)
        segment, motion, end = _integrate_to_end(system, state, x0, times, p, upright, options)
        if end is None:
            return [segment], motion.stop
        return [segment], SolverError(
            f"{system.name}: {' or '.join(discs)} lies flat on its plane at t = {end:.6g} s, where"
            " no single point of a disc touches; end the run before, or keep it upright",
            time=end,
        )
    motion = _integrate_motion(state, x0, times, p, _NO_MODES, options)
    part_events = motion.events if state.events else ()
    reached = times[: len(motion.x)]
    first = motion.first_slope
    return [Segment(state, reached, motion.x, None, first, part_events=part_events)], motion.stop


def _integrate_motion(
    state: FullState,
    x0: Array,
    times: Array,
    p: Array,
    modes: Array,
    options: dict[str, Any],
) -> EventMotion:
    """Integrate as far as possible. Steps end at discontinuities of the laws of components.

    modes: modes of `state.events` at the first time.
    """
    rhs, project, passage = state.rhs, state.project, state.passage
    events, prepared = None, state.prepared
    if state.crossings is not None:
        span = float(times[0]), float(times[-1])
        events, (rhs, project, passage) = with_crossings(state, x0, span, p, modes)
        prepared = state.prepared.setdefault("runs with crossings", {})
    elif state.events is not None:
        events = Events(state.events.indicators, state.events.jump, modes)
    motion = integrate_events(
        rhs,
        x0,
        times,
        events,
        p=p,
        project=project,
        passage=passage,
        partial=True,
        prepared=prepared,
        stops=_time_stops(state, float(times[0]), float(times[-1]), p),
        **options,
    )
    return motion if state.crossings is None else without_crossings(motion, state, len(modes))


def _time_stops(
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


@dataclass(frozen=True, slots=True, eq=False)
class SegmentEnd:
    """End of a segment: a measure of the configuration falls below a level.

    Attributes:
        measure: Function `measure(q, p)`.
        level: value of the measure at which the segment ends.
    """

    measure: Function
    level: float


def _integrate_with_row_changes(
    system: System,
    equations: Callable[[System], FullState],
    x0: Array,
    times: Array,
    p: Array,
    options: dict[str, Any],
) -> tuple[list[Segment], StopReason]:
    """Integrate in segments, each with closure rows chosen at its first configuration."""
    segments: list[Segment] = []
    start = Segment(equations(system), times[:1], x0.reshape(1, -1))
    system, limit = _choose_rows(system, x0[: system.nq], system_parameters(system, p))
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
        segment, motion, end = _integrate_to_end(system, state, x0, left, p, limit, options)
        segments.append(segment if not segments else segment.without_first_row)
        if motion.stop is not None or end is None:
            return segments, motion.stop
        x0 = motion.x[-1]
        left = left[left > end]
        if not len(left):
            return segments, None
        left = np.concatenate([[end], left])
        system, limit = _choose_rows(system, x0[: system.nq], system_parameters(system, p))
        if limit is None:
            return segments, failed(end, 0.0, "singular", state=x0.tolist())


def _integrate_with_contacts(
    system: System,
    state: FullState,
    x0: Array,
    times: Array,
    p: Array,
    modes: Array | None,
    options: dict[str, Any],
) -> tuple[list[Segment], StopReason]:
    assert state.events is not None
    first = initial_modes(system, state.events, float(times[0]), x0, p) if modes is None else modes
    motion = _integrate_motion(state, x0, times, p, first, options)
    contact = ContactMotion(first, motion.modes, motion.events)
    reached = times[: len(motion.x)]
    return [Segment(state, reached, motion.x, contact, motion.first_slope)], motion.stop


def _integrate_to_end(
    system: System,
    state: FullState,
    x0: Array,
    times: Array,
    p: Array,
    limit: SegmentEnd,
    options: dict[str, Any],
) -> tuple[Segment, EventMotion, float | None]:
    """Integrate one segment up to the limit; after it the state is held constant until the end."""
    n, n_p = len(x0), len(p)
    count = len(state.events.names) if state.events else 0
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
    # events of components, then of the limit
    left = limit.measure(x[: system.nq], parameters[: len(system.parameters)]) - limit.level
    watched, after = left, x
    if own := state.events:
        watched = casadi.vertcat(own.indicators(t, x, parameters), left)
        jumps = casadi.mmax(fired[:count])
        after = casadi.if_else(jumps, own.jump(t, x, parameters, fired[:count])[0], x)
    events = StateEvents(
        modes=("ended",),
        names=(*(own.names if own else ()), "limit"),
        first=Function("first", [t, x, pm], [SX(0), -SX.ones(count + 1)]),
        indicators=Function("watched", [t, x, pm], [casadi.if_else(ended, 1, watched)]),
        jump=Function("end", [t, x, pm, fired], [after, casadi.fmax(ended, fired[count])]),
    )
    crossings = state.crossings
    if crossings is not None:
        crossings = Function("crossings", [t, x, pm], crossings.call([t, x, parameters]))
    ending = replace(
        state,
        rhs=rhs,
        project=project,
        passage=None,
        events=events,
        crossings=crossings,
        prepared={},
    )
    motion = _integrate_motion(ending, x0, times, p, np.zeros(1), options)
    reached = times[: len(motion.x)]
    end = next((event.time for event in motion.events if count in event.fired), None)
    before = reached <= (np.inf if end is None else end)
    part_events = tuple(
        replace(event, fired=others)
        for event in motion.events
        if (others := tuple(k for k in event.fired if k < count))
    )
    return Segment(state, reached[before], motion.x[before], part_events=part_events), motion, end


def _choose_rows(system: System, q: Array, p: Array) -> tuple[System, SegmentEnd | None]:
    """Choose the closure rows at a configuration and the limit at which their segment ends.

    The limit is None if the configuration is singular. No segment can start there.
    """
    better = rows_at(system, q, p)
    old, new = (float(row_independence(one)(q, p)) for one in (system, better))
    chosen, now = (better, new) if new > 2 * old else (system, old)
    if now < _SINGULAR:
        return chosen, None
    return chosen, SegmentEnd(row_independence(chosen), _LEFT_INDEPENDENCE * now)
