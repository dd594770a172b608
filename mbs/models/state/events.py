"""Rigid stops and Coulomb friction in the state equation of the independent joints.

Only what the elements need is a mode or an indicator: a stop has the limit that it is at, friction
    its
direction of sliding, and a limit that is not given is not watched.
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
from mbs.models.state.drive import TreeMotion
from mbs.models.symbols import dense_function, outputs_of
from mbs.numbers import NONZERO
from mbs.recursions.parts import PartEvent, after_events

# What keeps dependent joints at rest that rigid stops or Coulomb friction constrain.
#
# A state equation of the independent joints is integrated without any projection. Those of
# its own that are stuck stay where they are; a dependent joint would creep by the errors of the
# steps.


RETURN_RATE = 20.0
"""How fast a stuck coordinate returns to where it should be [1/s]."""
_SHARED = 1e-6
"""Square that is added to rows: they may depend on others, or vanish."""


def standstill(
    system: System,
    contacts: Contacts,
    motion: TreeMotion,
    required: tuple[SX, SX],
    prescribed: Sequence[int],
) -> SX:
    """A small change of the independent coordinates that changes dependent ones as required.

    Independent coordinates that are stuck do not change, nor do those whose motion is prescribed.

    Args:
        system: open or closed.
        contacts: the k coordinates.
        motion: of the tree.
        required: (k, 1) 1 where a coordinate is stuck, 0 elsewhere; and (k, 1) the changes of those
            that are stuck.
        prescribed: indices of the velocities whose motion is prescribed.

    Returns:
        (m, 1) in the order of the independent velocities; changes of positions or of rates.
    """
    active = list(system.active)
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


# What states and modes are after an event, where nothing projects the motion later.


States = tuple[Sequence[int], Sequence[int]]
"""Indices in q and in v of the positions and velocities that a state begins with."""


def minimal_jump(
    system: System,
    contact: ContactEquations,
    motion: TreeMotion,
    before: tuple[SX, SX],
    states: States,
) -> tuple[SX, SX]:
    """The state and the modes after an event.

    What meets a limit is put there with the velocity that it had there, since an importer may
    locate events coarsely: an impact neither drifts nor gains energy. A stuck coordinate has no
        velocity.

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
    wall = (upper - lower) * ((upper - lower) * contact.state.velocity >= 0)
    v, modes = _after(system, contact, motion, (_at_impact(contact, motion, wall), fired))
    now = contacts.modes(modes)
    at = casadi.if_else(now.limit == 0, wall, now.limit)
    at = casadi.if_else(at == 0, contact.modes.limit, at)
    shift = to_limits(system, contact, motion, at)
    x = _shift(system, motion.q, x, shift, states[0])
    return _write(contacts, (x, v), (at, now.stuck), states), modes


def to_limits(system: System, contact: ContactEquations, motion: TreeMotion, limit: SX) -> SX:
    """(m, 1) changes of independent positions that bring dependent ones to their limits.

    Args:
        system: open or closed.
        contact: its equations of contact.
        motion: of the tree.
        limit: (k, 1) -1 for the lower limit, 1 for the upper one, 0 for none.
    """
    contacts = contact.contacts
    required = limit**2, -contacts.distance(motion.q, limit)
    return standstill(system, contacts, motion, required, contact.driven)


def _at_impact(contact: ContactEquations, motion: TreeMotion, wall: SX) -> SX:
    """(nv, 1) velocities when limits were reached, which may be a little while ago.

    Args:
        contact: the equations of contact.
        motion: now.
        wall: (k, 1) -1 where a lower limit is met, 1 where an upper one is, 0 elsewhere.
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
    """(nv, 1) velocities after an event, those of stuck coordinates zero, and the modes."""
    contacts, (speed, fired) = contact.contacts, before
    v, modes = jump(system, contacts, contact.modes, (motion.q, speed, fired), contact.driven)
    stuck, m = contacts.modes(modes).stuck, len(contact.driven)
    still = casadi.vertcat(SX.zeros(m), -stuck * contacts.velocity(motion.q, v))
    acting = casadi.vertcat(SX.ones(m), stuck)
    dv = outputs_of(system, impact(system, contact.driven), motion.q, still, acting)[0]
    return v + casadi.mmax(stuck) * dv, modes


def _shift(system: System, q: SX, x: SX, shift: SX, positions: Sequence[int]) -> SX:
    """The state with independent positions, which are at q, shifted."""
    after = SX(x)
    if not shift.is_zero():
        v = SX.zeros(system.nv)
        v[list(system.active)] = shift
        after[: len(positions)] += position_rate(system.tree, q, v)[list(positions)]
    return after


def _write(contacts: Contacts, motion: tuple[SX, SX], acting: tuple[SX, SX], states: States) -> SX:
    """The state x with velocities v: stuck coordinates at rest, those at a limit just there.

    Args:
        contacts: the k coordinates.
        motion: x and v (nv, 1).
        acting: (k, 1) the limits where coordinates are, as -1 and 1; (k, 1) 1 where one is stuck.
        states: what x begins with.
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
        approaches: `approaches(t, x, z, u, p) -> a`, (k, 3) as `Events` of `mbs.solvers` has them;
            None where all are zero.
    """

    modes: tuple[str, ...]
    names: tuple[str, ...]
    first: Function
    indicators: Function
    jump: Function
    approaches: Function | None = None


@dataclass(frozen=True, slots=True)
class ContactEffort:
    """What a rigid stop or Coulomb friction exerts, as an output.

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
    return [element.name for element in elements if element is not None]


def contact_efforts(system: System, contacts: Contacts) -> tuple[ContactEffort, ...]:
    """The outputs of the efforts of stops, then of friction."""
    elements = (*contacts.stops, *contacts.frictions)
    found = [(k, element) for k, element in enumerate(elements) if element is not None]
    return tuple(ContactEffort(f"{element.name}.effort", element.unit, k) for k, element in found)


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
    watched = _watch(contacts)
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


def join_part_events(
    system: System,
    contacts: MinimalEvents | None,
    own: Sequence[PartEvent],
    point: Sequence[SX],
) -> MinimalEvents | None:
    """The events of contacts, and behind them those of components.

    Args:
        system: open or closed.
        contacts: None where there are none.
        own: events of all components.
        point: t, x that ends with the states of components, z, u and p, without modes.
    """
    if not own:
        return contacts
    *others, p = point
    x, modes = point[1], SX.sym("modes", len(contacts.modes) if contacts else 0)
    every = [*others, casadi.vertcat(p, modes)]
    count = len(contacts.names) if contacts else 0
    fired = SX.sym("fired", count + len(own))
    first, beyond = SX(0, 1), SX(0, 1)
    watched, after, now = SX(0, 1), x, modes
    if contacts:
        first, beyond = contacts.first.call(every)
        (watched,) = contacts.indicators.call(every)
        there, changed = contacts.jump.call([*every, fired[:count]])
        jumps = casadi.mmax(fired[:count])
        after, now = casadi.if_else(jumps, there, x), casadi.if_else(jumps, changed, modes)
    start = x.numel() - system.z.numel()
    after = casadi.vertcat(after[:start], after_events(system, own, fired[count:]))
    indicators = casadi.vertcat(watched, *(event.when for event in own))
    allowed = casadi.vertcat(beyond, -SX.ones(len(own)))
    return MinimalEvents(
        modes=contacts.modes if contacts else (),
        names=(
            *(contacts.names if contacts else ()),
            *(f"{event.name} {event.label}" for event in own),
        ),
        first=dense_function("first", every, [first, allowed]),
        indicators=dense_function("indicators", every, [indicators]),
        jump=dense_function("jump", [*every, fired], [after, now]),
    )


def at_limits(system: System, contact: ContactEquations | None, motion: TreeMotion) -> SX:
    """(m, 1) rates of independent positions that bring dependent ones at limits back to them."""
    if contact is None:
        return SX.zeros(len(system.active))
    return RETURN_RATE * to_limits(system, contact, motion, contact.modes.limit)


def _watch(contacts: Contacts) -> list[tuple[int, str]]:
    """Number among the 5 k indicators, and name, of those that can fall to zero."""
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


def _spread(values: SX, indices: Sequence[int], size: int) -> SX:
    """(size, 1) values at their indices, zero elsewhere."""
    every = SX.zeros(size)
    every[list(indices)] = values
    return every
