"""Rigid stops and dry friction in the state equation of the independent joints.

Only what the elements need is a mode or an indicator: a stop has its place, friction its direction
of sliding, and a limit that is not given is not watched.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import casadi
import numpy as np
from casadi import SX, Function

from mbs.assembly import System
from mbs.assembly.tables import EFFORT_UNIT
from mbs.models.composition import dense_function
from mbs.models.contact_dynamics import ContactEquations
from mbs.models.contacts import KINDS, Contacts
from mbs.models.minimal_jump import to_limits
from mbs.models.minimal_motion import TreeMotion
from mbs.models.minimal_standstill import RETURN_RATE


@dataclass(frozen=True, slots=True, eq=False)
class MinimalEvents:
    """Where states and modes jump, and how; p = [parameters; modes] in all functions.

    The state x is that of the independent joints, or of the tree, which has no z.

    Attributes:
        modes: name of every mode, such as `stop.mode`.
        names: (k) what each indicator watches.
        first: `first(t, x, z, u, p) -> (modes, beyond)` at a start, of the modes in p nothing;
            beyond (k, 1) is positive where x is beyond the limit that the indicator watches.
        indicators: `indicators(t, x, z, u, p) -> g`, (k, 1), positive between events.
        jump: `jump(t, x, z, u, p, fired) -> (x, modes)` after an event; fired (k, 1) is 1 for each
            indicator that is not positive, 0 for the others.
    """

    modes: tuple[str, ...]
    names: tuple[str, ...]
    first: Function
    indicators: Function
    jump: Function


@dataclass(frozen=True, slots=True)
class ContactEffort:
    """What a rigid stop or dry friction exerts, as an output.

    Attributes:
        name: such as `stop.effort`.
        unit: N.m or N.
        row: its number among the 2 k efforts of k coordinates.
    """

    name: str
    unit: str
    row: int


def used_modes(contacts: Contacts) -> list[int]:
    """Numbers of the modes, among the 2 k of k coordinates, that elements have."""
    elements = (*contacts.stops, *contacts.frictions)
    return [number for number, element in enumerate(elements) if element is not None]


def element_names(contacts: Contacts) -> list[str]:
    """Names of the stops, then of the frictions."""
    elements = (*contacts.stops, *contacts.frictions)
    return [element.element.name for element in elements if element is not None]


def contact_efforts(system: System, contacts: Contacts) -> tuple[ContactEffort, ...]:
    """The outputs of the efforts of stops, then of friction."""
    units = [EFFORT_UNIT[system.speeds[k].unit] for k in contacts.velocities] * 2
    pairs = zip(element_names(contacts), used_modes(contacts), strict=True)
    return tuple(ContactEffort(f"{name}.effort", units[k], k) for name, k in pairs)


def few_modes(contact: ContactEquations | None, p: SX, values: Sequence[SX]) -> tuple[SX, list[SX]]:
    """[p; modes] of the elements alone, and expressions of all 2 k modes with these in them.

    Where there are no contacts, both as they are.
    """
    if contact is None:
        return p, list(values)
    modes, count = used_modes(contact.contacts), contact.values.numel()
    few = SX.sym("modes", len(modes))
    changed = casadi.substitute(list(values), [contact.values], [_spread(few, modes, count)])
    return casadi.vertcat(p, few), [SX(value) for value in changed]


def minimal_events(
    contact: ContactEquations,
    motion: TreeMotion,
    point: Sequence[SX],
    jump: Callable[[SX], tuple[SX, SX]],
) -> MinimalEvents:
    """The events of a state equation.

    Args:
        contact: its equations of contact.
        motion: of the tree.
        point: t, x, z, u and p, without modes.
        jump: x and (2 k, 1) modes after an event, of (5 k, 1) 1 for each indicator that is not
            positive.
    """
    contacts, modes = contact.contacts, used_modes(contact.contacts)
    watched = _watched(contacts)
    numbers = [number for number, _ in watched]
    *others, p = point

    def written(name: str, extra: list[SX], outputs: list[SX]) -> Function:
        few, values = few_modes(contact, p, outputs)
        return dense_function(name, [*others, few, *extra], values)

    fired = SX.sym("fired", len(watched))
    start, outside = contacts.first(motion.q, motion.v)
    beyond = casadi.vertcat(outside, -SX.ones(3 * len(contacts)))
    every = _spread(fired, numbers, 5 * len(contacts))
    x, now = jump(every)
    return MinimalEvents(
        modes=tuple(f"{name}.mode" for name in element_names(contacts)),
        names=tuple(name for _, name in watched),
        first=written("first", [], [start[modes], beyond[numbers]]),
        indicators=written("indicators", [], [contact.indicators[numbers]]),
        jump=written("jump", [fired], [x, now[modes]]),
    )


def at_limits(system: System, contact: ContactEquations | None, motion: TreeMotion) -> SX:
    """(m, 1) rates of independent positions that bring dependent ones at limits back to them."""
    if contact is None:
        return SX.zeros(len(system.active))
    return RETURN_RATE * to_limits(system, contact, motion, contact.modes.place)


def _watched(contacts: Contacts) -> list[tuple[int, str]]:
    """Number among the 5 k indicators, and name, of those that can fall to zero."""
    lower, upper, dry = (
        np.array(flags)[:, 0] > 0
        for flags in (contacts.has_lower, contacts.has_upper, contacts.has_friction)
    )
    acting = (lower, upper, lower | dry, upper | dry, dry)
    return [
        (kind * len(contacts) + j, _name(contacts, j, word))
        for kind, word in enumerate(KINDS)
        for j in range(len(contacts))
        if acting[kind][j]
    ]


def _name(contacts: Contacts, j: int, word: str) -> str:
    stop, friction = contacts.stops[j], contacts.frictions[j]
    limit, way = {"pulled": ("lower", "up"), "pushed": ("upper", "down")}.get(word, ("", ""))
    parts = []
    if stop is not None and word in ("lower", "upper"):
        parts.append(f"{stop.element.name} {word}")
    if stop is not None and limit and getattr(stop.element, limit) is not None:
        parts.append(f"{stop.element.name} leaves {limit}")
    if friction is not None and word not in ("lower", "upper"):
        parts.append(f"{friction.element.name} {f'slides {way}' if way else 'stops'}")
    return " or ".join(parts)


def _spread(values: SX, places: Sequence[int], size: int) -> SX:
    """(size, 1) values at their places, zero elsewhere."""
    every = SX.zeros(size)
    every[list(places)] = values
    return every
