"""Rigid stops and dry friction in a simulation: how they start, and what a result tells of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from casadi import SX, Function
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.assembly.tables import EFFORT_UNIT
from mbs.errors import ModelError
from mbs.models.contacts import (
    Contacts,
    contacts_of,
    require_lasting_rows,
    require_undriven,
)
from mbs.models.prescribed import Prescribed
from mbs.solvers.events import Event

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
    events: tuple[Event, ...]


def require_contacts_possible(system: System, motions: Sequence[Prescribed]) -> None:
    """Refuse what rigid stops and dry friction cannot be simulated with.

    Raises:
        ModelError: a motion is prescribed where one acts, two of one kind act on one coordinate,
            or the loops are over-constrained in a way that changes with the posture.
    """
    contacts = contacts_of(system)
    require_undriven(system, contacts, [motion.velocity for motion in motions])
    require_lasting_rows(system, contacts)


def first_modes(system: System, x0: Array, p: Sequence[float]) -> Array:
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
    start = Function("start", [q, v, system.p], [*contacts.first(q, v), *contacts.bounds])
    modes, outside, *limits = (
        np.array(value)[:, 0] for value in start(x0[:nq], x0[nq : nq + system.nv], p)
    )
    for number in np.flatnonzero(outside > 0):
        side, j = divmod(int(number), len(contacts))
        position = contacts.positions[j]
        assert position is not None
        raise ModelError(
            f"{system.name}: {contacts.names[j]} starts at {x0[position]:g}, beyond the"
            f" {_LIMITS[2 * side - 1]} limit {limits[side][j]:g} of its rigid stop; start inside,"
            " by q0"
        )
    return modes


def contact_columns(
    system: System, contact: ContactMotion | None, efforts: Array
) -> Iterator[tuple[str, str, Array]]:
    """Name, unit and values of the columns of contacts.

    Args:
        system: with k coordinates on which contacts act.
        contact: their modes.
        efforts: (m, 2 k) of the stops, then of friction.
    """
    if contact is None:
        return
    contacts = contacts_of(system)
    for column, force in enumerate((*contacts.stops, *contacts.frictions)):
        if force is not None:
            unit = system.speeds[force.levers[0].velocity].unit
            yield f"{force.element.name}.mode", "1", contact.modes[:, column]
            yield f"{force.element.name}.effort", EFFORT_UNIT[unit], efforts[:, column]


def every_effort(system: System, tau: Array, efforts: Array) -> Array:
    """(m, nv) joint efforts, those of contacts included.

    Args:
        system: with k coordinates on which contacts act, or none.
        tau: (m, nv) joint efforts without them.
        efforts: (m, 2 k) of the stops, then of friction.
    """
    total = tau.copy()
    for column, number in enumerate(2 * contacts_of(system).velocities):
        total[:, number] += efforts[:, column]
    return total


def told(system: System, contact: ContactMotion | None) -> tuple[tuple[float, str, str], ...]:
    """Time, name of the element and what it does, of every event."""
    if contact is None:
        return ()
    contacts, before = contacts_of(system), contact.first
    happened = []
    for event in contact.events:
        for j in range(len(contacts)):
            for name, what in _changes(contacts, j, before, event):
                happened.append((event.time, name, what))
        before = event.modes
    return tuple(happened)


def _changes(contacts: Contacts, j: int, before: Array, event: Event) -> Iterator[tuple[str, str]]:
    k = len(contacts)
    stop, friction = contacts.stops[j], contacts.frictions[j]
    was, now = int(before[j]), int(event.modes[j])
    if stop is not None:
        for side, name in enumerate(("lower", "upper")):
            if side * k + j in event.fired:
                rests = now == (-1, 1)[side]
                yield stop.element.name, f"{'rests at' if rests else 'bounces off'} {name}"
        if was and not now:
            yield stop.element.name, f"leaves {_LIMITS[was]}"
    slid, slides = before[k + j], event.modes[k + j]
    if friction is not None and slid != slides:
        yield friction.element.name, "slides" if slides else "sticks"
