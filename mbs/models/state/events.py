"""Events of rigid stops, Coulomb friction and components in state equations.

Modes are the limit at which a stop is in contact, and the sliding direction of friction. Limits
that are not specified have no event indicator.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import casadi
import numpy as np
from casadi import DM, SX, Function

from mbs.assembly import System
from mbs.assembly.tree import position_rate
from mbs.models.contacts import KINDS, ContactEquations, Contacts, impact, jump
from mbs.models.state.arguments import StateArguments, spread
from mbs.models.state.drive import TreeMotion
from mbs.models.symbols import outputs_of
from mbs.numbers import NONZERO
from mbs.recursions.parts import PartEvent, after_events

# Corrections that keep dependent joints at rest if stops or Coulomb friction constrain them.
#
# The state equation of the independent joints is integrated without projection. Stuck independent
# joints stay exactly at rest. A stuck dependent joint would drift by the integration errors.


RETURN_RATE = 20.0
"""Rate at which the error of a stuck coordinate decays [1/s]."""
_SHARED = 1e-6
"""Regularisation that is added to squared rows, which may be zero or dependent on other rows."""


def standstill(
    system: System,
    contacts: Contacts,
    motion: TreeMotion,
    required: tuple[SX, SX],
    prescribed: Sequence[int],
) -> SX:
    """Return a small change of independent coordinates with a required change of dependent ones.

    Stuck independent coordinates and coordinates with prescribed motion do not change.

    Args:
        system: open or closed system.
        contacts: k contact coordinates.
        motion: positions and velocities of the tree.
        required: (k, 1) 1 for each stuck coordinate, else 0; and (k, 1) required changes of the
            stuck coordinates.
        prescribed: indices of the velocities with prescribed motion.

    Returns:
        Change (m, 1) in the order of the independent velocities, of positions or rates as required.
    """
    active = list(system.independent)
    rows = [j for j, number in enumerate(contacts.velocities) if number not in active]
    if not rows:
        return SX.zeros(len(active))
    stuck, change = required
    may_move = SX.ones(len(active))
    for k, number in enumerate(active):
        if number in prescribed:
            may_move[k] = 0
        elif number in contacts.velocities:
            own = [j for j, other in enumerate(contacts.velocities) if other == number]
            may_move[k] = 1 - casadi.mmax(stuck[own])
    E, sizes = contacts.scaled_rows(motion.q)[rows, :], contacts.sizes[rows]
    G = E[:, active] if motion.G is None else casadi.mtimes(E, motion.G)
    R = casadi.mtimes(casadi.diag(stuck[rows]), casadi.mtimes(G, casadi.diag(may_move)))
    S = casadi.mtimes(R, R.T) + casadi.diag(1 - stuck[rows]) + _SHARED * SX(DM.eye(len(rows)))
    D, LT, order = casadi.ldl(casadi.densify(S))
    shares = casadi.ldl_solve(stuck[rows] * change[rows] / sizes, D, LT, order)
    return casadi.densify(casadi.mtimes(R.T, shares))


# States and modes after an event, without a later projection.


States = tuple[Sequence[int], Sequence[int]]
"""Indices in q and v of the positions and velocities at the start of a state x."""


def minimal_jump(
    system: System,
    contact: ContactEquations,
    motion: TreeMotion,
    before: tuple[SX, SX],
    states: States,
) -> tuple[SX, SX]:
    """Return the state and the modes after an event.

    A coordinate that passed a limit is moved to the limit, with its velocity at the time of the
    impact. Importers may locate events coarsely, and without this correction an impact would drift
    or gain energy. The velocity of a stuck coordinate is zero.

    Args:
        system: open or closed system.
        contact: contact equations of the system.
        motion: positions and velocities of the tree.
        before: state x; and (5 k, 1) 1 for each indicator that is not positive.
        states: indices in q and v of the positions and velocities in x.

    Returns:
        State x and modes (2 k, 1).
    """
    contacts, (x, fired) = contact.contacts, before
    lower, upper, *_ = casadi.vertsplit(fired, len(contacts))
    wall = (upper - lower) * ((upper - lower) * contact.state.velocity >= 0)
    v, modes = _after(system, contact, motion, (_at_impact(contact, motion, wall), fired))
    now = contacts.modes(modes)
    at = casadi.if_else(now.limit == 0, wall, now.limit)
    at = casadi.if_else(at == 0, contact.modes.limit, at)
    shift = to_limits(system, contact, motion, at)
    x = _shift(system, motion.q, x, shift, states[0])
    return _write(contacts, (x, v), (at, now.stuck), states), modes


def to_limits(system: System, contact: ContactEquations, motion: TreeMotion, limit: SX) -> SX:
    """Return the changes (m, 1) of independent positions that move dependent ones to limits.

    Args:
        system: open or closed system.
        contact: contact equations of the system.
        motion: positions and velocities of the tree.
        limit: (k, 1) -1 for the lower limit, 1 for the upper limit, 0 for no limit.
    """
    contacts = contact.contacts
    required = limit**2, -contacts.distance(motion.q, limit)
    return standstill(system, contacts, motion, required, contact.driven)


def _at_impact(contact: ContactEquations, motion: TreeMotion, wall: SX) -> SX:
    """Return the velocities (nv, 1) at the earlier time at which limits were reached.

    Args:
        contact: contact equations of the system.
        motion: current positions and velocities of the tree.
        wall: (k, 1) -1 at a lower limit, 1 at an upper limit, 0 otherwise.
    """
    contacts = contact.contacts
    depth = casadi.fmax(wall * contacts.distance(motion.q, wall), 0)
    rise = wall * (casadi.mtimes(contact.state.rows, contact.a) + contact.state.bias)
    speed = wall * contact.state.velocity
    square = speed**2 - 2 * rise * depth
    since = casadi.if_else(
        square > 0,
        2 * depth / casadi.fmax(speed + casadi.sqrt(casadi.fmax(square, 0)), NONZERO),
        speed / casadi.fmax(rise, NONZERO),
    )
    return motion.v - casadi.mmax(casadi.if_else(depth > 0, since, 0)) * contact.a


def _after(
    system: System, contact: ContactEquations, motion: TreeMotion, before: tuple[SX, SX]
) -> tuple[SX, SX]:
    """Return velocities (nv, 1) after an event, zero for stuck coordinates, and the modes."""
    contacts, (speed, fired) = contact.contacts, before
    v, modes = jump(system, contacts, contact.modes, (motion.q, speed, fired), contact.driven)
    stuck, m = contacts.modes(modes).stuck, len(contact.driven)
    still = casadi.vertcat(SX.zeros(m), -stuck * contacts.velocity(motion.q, v))
    acting = casadi.vertcat(SX.ones(m), stuck)
    dv = outputs_of(system, impact(system, contact.driven), motion.q, still, acting)[0]
    return v + casadi.mmax(stuck) * dv, modes


def _shift(system: System, q: SX, x: SX, shift: SX, positions: Sequence[int]) -> SX:
    """Return the state x with its positions shifted by `shift` (m, 1) from q."""
    after = SX(x)
    if not shift.is_zero():
        v = SX.zeros(system.nv)
        v[list(system.independent)] = shift
        after[: len(positions)] += position_rate(system.tree, q, v)[list(positions)]
    return after


def _write(contacts: Contacts, motion: tuple[SX, SX], acting: tuple[SX, SX], states: States) -> SX:
    """Return the state x with new velocities, stuck coordinates at rest and positions at limits.

    Args:
        contacts: k contact coordinates.
        motion: state x and velocities v (nv, 1).
        acting: (k, 1) limit of each coordinate as -1, 1 or 0 for no limit; (k, 1) 1 for each stuck
            coordinate.
        states: indices in q and v of the positions and velocities in x.
    """
    (positions, velocities), (x, v), (at, stuck) = states, motion, acting
    after = SX(x)
    after[len(positions) : len(positions) + len(velocities)] = v[list(velocities)]
    for j, (q, number) in enumerate(zip(contacts.positions, contacts.velocities, strict=True)):
        if number is not None and number in velocities:
            row = len(positions) + list(velocities).index(number)
            after[row] = casadi.if_else(stuck[j], 0, after[row])
        if q is not None and q in positions:
            row = list(positions).index(q)
            limit = casadi.if_else(at[j] < 0, contacts.bounds[0][j], contacts.bounds[1][j])
            after[row] = casadi.if_else(at[j] == 0, after[row], limit)
    return after


@dataclass(frozen=True, slots=True, eq=False)
class StateEvents:
    """Event functions of a state equation.

    They have the arguments of the state equation, "..": (t, x, p) in a simulation and
    (t, x, z, u, p) in an FMU. The parameters are followed by the modes.

    Attributes:
        modes: names of the modes, such as `stop.mode`; empty for a mode without stop or friction.
        names: (k) descriptions of the events of the indicators.
        first: `first(..) -> (modes, beyond)` at the start; it does not depend on the modes in p.
            beyond (k, 1) is positive if x is beyond the limit of the indicator.
        indicators: `indicators(..) -> g`, (k, 1), positive between events.
        jump: `jump(.., fired) -> (x, modes)` after an event; fired (k, 1) is 1 for each indicator
            that is not positive, else 0.
        approaches: `approaches(..) -> a`, (k, 3) as in `Events` of `mbs.solvers`, or None if all
            are zero.
    """

    modes: tuple[str, ...]
    names: tuple[str, ...]
    first: Function
    indicators: Function
    jump: Function
    approaches: Function | None = None


@dataclass(frozen=True, slots=True)
class ContactEffort:
    """Effort of a rigid stop or of Coulomb friction as an output.

    Attributes:
        name: name of the output, such as `stop.effort`.
        unit: unit, N.m or N.
        row: index among the 2 k efforts of k coordinates.
    """

    name: str
    unit: str
    row: int


def contact_efforts(contacts: Contacts) -> tuple[ContactEffort, ...]:
    """Return the effort outputs of the stops, then of the frictions."""
    return tuple(
        ContactEffort(f"{element.name}.effort", element.unit, k) for k, element in contacts.elements
    )


def contact_events(
    arguments: StateArguments,
    contact: ContactEquations,
    motion: TreeMotion,
    jump: Callable[[SX], tuple[SX, SX]],
) -> StateEvents:
    """Return the events of contacts of a state equation.

    With `arguments.every_mode` the events have all 5 k indicators. Otherwise they have only the
    indicators that can become zero.

    Args:
        arguments: arguments of the event functions.
        contact: equations of k contacts.
        motion: positions and velocities of the tree.
        jump: function of fired (5 k, 1), 1 for each indicator that is not positive, that returns x
            and modes (2 k, 1) after an event.
    """
    contacts, elements = contact.contacts, dict(contact.contacts.elements)
    watched = _watch(contacts)
    if arguments.every_mode:
        modes, names = list(range(2 * len(contacts))), dict(watched)
        watched = [(number, names.get(number, "")) for number in range(5 * len(contacts))]
    else:
        modes = list(elements)
    numbers = [number for number, _ in watched]
    fired = SX.sym("fired", len(watched))
    start, outside = contacts.first(motion.q, motion.v)
    beyond = casadi.vertcat(outside, -SX.ones(3 * len(contacts)))
    x, now = jump(spread(fired, numbers, 5 * len(contacts)))
    return StateEvents(
        modes=tuple(f"{elements[k].name}.mode" if k in elements else "" for k in modes),
        names=tuple(name for _, name in watched),
        first=arguments.function("first", [start[modes], beyond[numbers]]),
        indicators=arguments.function("indicators", [contact.indicators[numbers]]),
        jump=arguments.function("jump", [x, now[modes]], fired),
    )


def join_part_events(
    system: System,
    arguments: StateArguments,
    contacts: StateEvents | None,
    own: Sequence[PartEvent],
) -> StateEvents | None:
    """Append the events of components to the events of contacts.

    Args:
        system: open or closed system.
        arguments: arguments of the event functions. The state ends with the states of components.
        contacts: events of contacts, or None.
        own: events of all components.
    """
    if not own:
        return contacts
    x, modes = arguments.point[1], arguments.modes
    count = len(contacts.names) if contacts else 0
    fired = SX.sym("fired", count + len(own))
    first, beyond = SX(0, 1), SX(0, 1)
    watched, after, now = SX(0, 1), x, modes
    if contacts:
        every = arguments.symbols
        first, beyond = contacts.first.call(every)
        (watched,) = contacts.indicators.call(every)
        there, changed = contacts.jump.call([*every, fired[:count]])
        jumps = casadi.mmax(fired[:count])
        after, now = casadi.if_else(jumps, there, x), casadi.if_else(jumps, changed, modes)
    start = x.numel() - system.component_states.numel()
    after = casadi.vertcat(after[:start], after_events(system, own, fired[count:]))
    indicators = casadi.vertcat(watched, *(event.when for event in own))
    allowed = casadi.vertcat(beyond, -SX.ones(len(own)))
    return StateEvents(
        modes=contacts.modes if contacts else (),
        names=(
            *(contacts.names if contacts else ()),
            *(f"{event.name} {event.label}" for event in own),
        ),
        first=arguments.function("first", [first, allowed]),
        indicators=arguments.function("indicators", [indicators]),
        jump=arguments.function("jump", [after, now], fired),
    )


def at_limits(system: System, contact: ContactEquations | None, motion: TreeMotion) -> SX:
    """Return rates (m, 1) of independent positions that return dependent ones to their limits."""
    if contact is None:
        return SX.zeros(len(system.independent))
    return RETURN_RATE * to_limits(system, contact, motion, contact.modes.limit)


def _watch(contacts: Contacts) -> list[tuple[int, str]]:
    """Return index (among 5 k) and name of each indicator that can become zero."""
    lower, upper, friction = (
        np.array(flags)[:, 0] > 0
        for flags in (contacts.has_lower, contacts.has_upper, contacts.has_friction)
    )
    acting = (lower, upper, lower | friction, upper | friction, friction)
    return [
        (kind * len(contacts) + j, _name(contacts, j, word))
        for kind, word in enumerate(KINDS)
        for j in range(len(contacts))
        if acting[kind][j]
    ]


def _name(contacts: Contacts, j: int, word: str) -> str:
    stop, friction = contacts.stops[j], contacts.frictions[j]
    limit, direction = {"pulled": ("lower", "up"), "pushed": ("upper", "down")}.get(word, ("", ""))
    parts = []
    if stop is not None and word in ("lower", "upper"):
        parts.append(f"{stop.name} {word}")
    if stop is not None and limit and stop.sides[("lower", "upper").index(limit)]:
        parts.append(f"{stop.name} leaves {limit}")
    if friction is not None and word not in ("lower", "upper"):
        parts.append(f"{friction.name} {f'slides {direction}' if direction else 'stops'}")
    return " or ".join(parts)
