"""What states and modes are after an event, where nothing projects the motion later."""

from __future__ import annotations

from collections.abc import Sequence

import casadi
from casadi import SX

from mbs.assembly import System
from mbs.assembly.rates import position_rate
from mbs.models.composition import outputs_of
from mbs.models.contact_dynamics import ContactEquations
from mbs.models.contacts import Contacts
from mbs.models.impacts import impact, jump
from mbs.models.minimal_motion import TreeMotion
from mbs.models.minimal_standstill import standstill

_SMALL = 1e-300

States = tuple[Sequence[int], Sequence[int]]
"""Numbers in q and in v of the positions and velocities that a state begins with."""


def minimal_jump(
    system: System,
    contact: ContactEquations,
    motion: TreeMotion,
    before: tuple[SX, SX],
    states: States,
) -> tuple[SX, SX]:
    """The state and the modes after an event.

    What meets a limit is put there with the velocity that it had there, since an importer may
    locate events coarsely: an impact neither drifts nor gains energy. What is held has no velocity.

    Args:
        system: open or closed.
        contact: its equations of contact.
        motion: of the tree.
        before: the state x; and (5 k, 1) 1 for each indicator that is not positive.
        states: what x begins with.

    Returns:
        x and (2 k, 1) modes.
    """
    contacts, (x, fired) = contact.contacts, before
    lower, upper, *_ = casadi.vertsplit(fired, len(contacts))
    wall = (upper - lower) * ((upper - lower) * contacts.velocity(motion.v) >= 0)
    v, modes = _after(system, contact, motion, (_at_impact(contact, motion, wall), fired))
    now = contacts.modes(modes)
    at = casadi.if_else(now.place == 0, wall, now.place)
    at = casadi.if_else(at == 0, contact.modes.place, at)
    shift = to_limits(system, contact, motion, at)
    x = _shifted(system, motion.q, x, shift, states[0])
    return _written(contacts, (x, v), (at, now.held), states), modes


def to_limits(system: System, contact: ContactEquations, motion: TreeMotion, place: SX) -> SX:
    """(m, 1) changes of independent positions that bring dependent ones to their limits.

    Args:
        system: open or closed.
        contact: its equations of contact.
        motion: of the tree.
        place: (k, 1) -1 for the lower limit, 1 for the upper one, 0 for none.
    """
    contacts = contact.contacts
    wanted = place**2, -contacts.distance(motion.q, place)
    return standstill(system, contacts, motion, wanted, contact.driven)


def _at_impact(contact: ContactEquations, motion: TreeMotion, wall: SX) -> SX:
    """(nv, 1) velocities when limits were reached, which may be a little while ago.

    Args:
        contact: the equations of contact.
        motion: now.
        wall: (k, 1) -1 where a lower limit is met, 1 where an upper one is, 0 elsewhere.
    """
    contacts = contact.contacts
    depth = casadi.fmax(wall * contacts.distance(motion.q, wall), 0)
    speed, rise = wall * contacts.velocity(motion.v), wall * contacts.velocity(contact.a)
    square = speed**2 - 2 * rise * depth
    since = casadi.if_else(
        square > 0,
        2 * depth / casadi.fmax(speed + casadi.sqrt(casadi.fmax(square, 0)), _SMALL),
        speed / casadi.fmax(rise, _SMALL),
    )
    return motion.v - casadi.mmax(casadi.if_else(depth > 0, since, 0)) * contact.a


def _after(
    system: System, contact: ContactEquations, motion: TreeMotion, before: tuple[SX, SX]
) -> tuple[SX, SX]:
    """(nv, 1) velocities after an event, those of what is held zero, and the modes."""
    contacts, (speed, fired) = contact.contacts, before
    v, modes = jump(system, contacts, contact.modes, (motion.q, speed, fired), contact.driven)
    held, m = contacts.modes(modes).held, len(contact.driven)
    still = casadi.vertcat(SX.zeros(m), -held * contacts.velocity(v))
    acting = casadi.vertcat(SX.ones(m), held)
    numbers = (*contact.driven, *contacts.velocities)
    dv = outputs_of(system, impact(system, numbers), motion.q, still, acting)[0]
    return v + casadi.mmax(held) * dv, modes


def _shifted(system: System, q: SX, x: SX, shift: SX, positions: Sequence[int]) -> SX:
    """The state with independent positions of a closed system, which are at q, shifted."""
    after = SX(x)
    if system.is_closed:
        v = SX.zeros(system.nv)
        v[list(system.active)] = shift
        after[: len(positions)] += position_rate(system.tree, q, v)[list(positions)]
    return after


def _written(
    contacts: Contacts, motion: tuple[SX, SX], acting: tuple[SX, SX], states: States
) -> SX:
    """The state x with velocities v: what is held stands still, what is at a limit is just there.

    Args:
        contacts: the k coordinates.
        motion: x and v (nv, 1).
        acting: (k, 1) the limits where coordinates are, as -1 and 1; (k, 1) 1 for what is held.
        states: what x begins with.
    """
    (positions, velocities), (x, v), (at, held) = states, motion, acting
    after = SX(x)
    after[len(positions) : len(positions) + len(velocities)] = v[list(velocities)]
    for j, (q, number) in enumerate(zip(contacts.positions, contacts.velocities, strict=True)):
        if number in velocities:
            row = len(positions) + list(velocities).index(number)
            after[row] = casadi.if_else(held[j], 0, after[row])
        if q is not None and q in positions:
            row = list(positions).index(q)
            limit = casadi.if_else(at[j] < 0, contacts.bounds[0][j], contacts.bounds[1][j])
            after[row] = casadi.if_else(at[j] == 0, after[row], limit)
    return after
