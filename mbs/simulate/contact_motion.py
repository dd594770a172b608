"""Rigid stops and Coulomb friction in a simulation: initial modes, events, columns of results."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import casadi
import numpy as np
from casadi import SX, Function
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.components.custom import OneWay
from mbs.errors import ModelError
from mbs.models.contacts import (
    KINDS,
    ContactElement,
    Contacts,
    contacts_of,
    require_lasting_rows,
    require_undriven,
)
from mbs.models.state.events import StateEvents
from mbs.models.state.signals import Prescribed
from mbs.recursions.parts import part_event_names
from mbs.solvers.problem import IntegrationEvent

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]


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


def initial_modes(system: System, events: StateEvents, t0: float, x0: Array, p: Array) -> Array:
    """Return the contact modes at the start, (2 k,).

    A coordinate that rests at a limit is in contact; a coordinate that moves slides.

    Args:
        system: system with k coordinates on which contacts act.
        events: events of the state equation of the system.
        t0: time at the start [s].
        x0: state at the start.
        p: parameters of the state equation, without modes.

    Raises:
        ModelError: a coordinate starts beyond a limit.
    """
    contacts = contacts_of(system)
    unknown = np.zeros(len(events.modes))
    modes, beyond = (np.array(value)[:, 0] for value in events.first(t0, x0, [*p, *unknown]))
    _require_within_limits(system, contacts, beyond[: 2 * len(contacts)] > 0, x0, p)
    return modes


def _require_within_limits(
    system: System, contacts: Contacts, outside: Flags, x0: Array, p: Array
) -> None:
    """Raise if a coordinate starts beyond a limit.

    outside: (2 k,) whether each coordinate is beyond its lower limit, then its upper limit.
    """
    if not outside.any():
        return
    nq, n = system.nq, system.nq + system.nv
    q, v = SX.sym("q", nq), SX.sym("v", system.nv)
    found = [*contacts.bounds, contacts.at(q, v).measure]
    start = Function("start", [q, v, system.p], found)
    own = p[: len(system.parameters)]
    limits = [np.array(value)[:, 0] for value in start(x0[:nq], x0[nq:n], own)]
    for number in np.flatnonzero(outside):
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


def contact_columns(system: System) -> Iterator[tuple[int, str, str]]:
    """Yield index, name and unit of the columns of contacts: 2 k modes, then 2 k efforts.

    Args:
        system: system with k coordinates on which contacts act.
    """
    contacts = contacts_of(system)
    for column, element in contacts.elements:
        yield column, f"{element.name}.mode", "1"
        yield 2 * len(contacts) + column, f"{element.name}.effort", element.unit


def efforts_with_contacts(system: System, q: Array, p: Array, tau: Array, efforts: Array) -> Array:
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
            for name, what in _contact_changes(contacts, j, before, event):
                happened.append((event.time, name, what))
        before = event.modes
    return tuple(happened)


def _contact_changes(
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
                yield _labelled_event(stop, "locks" if isinstance(stop.law, OneWay) else what)
        if was and not now:
            freed = isinstance(stop.law, OneWay)
            yield _labelled_event(stop, "frees" if freed else f"leaves {_LIMITS[was]}")
    slide_before, slides = before[k + j], event.modes[k + j]
    if friction is not None and slide_before != slides:
        yield _labelled_event(friction, "slides" if slides else "sticks")


def _labelled_event(element: ContactElement, what: str) -> tuple[str, str]:
    """Return the name of the component and the event text with the label of its contact."""
    return element.part.name, f"{element.label} {what}" if element.label else what
