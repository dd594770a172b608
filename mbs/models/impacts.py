"""Impacts on rigid stops, and what else the modes of contacts do at events."""

from __future__ import annotations

import casadi
from casadi import SX, Function

from mbs.assembly import System
from mbs.assembly.model_function import Named, model_function
from mbs.models.composition import outputs_of
from mbs.models.constrained_accelerations import constrained, loop_rows
from mbs.models.contact_dynamics import ContactEquations
from mbs.models.contacts import CREEP, Contacts, Modes
from mbs.models.symbols import symbols_of
from mbs.recursions.composite_body import inertia_matrix

_PULL = 1e-9
"""Part of all impulses below which a pull is rounding."""
_ROUNDS = 8
"""How often at most a wall that pulls is left out, or another one taken in."""


def impact(system: System, prescribed: tuple[int, ...]) -> Function:
    """``impact(q, dv_p, acting) -> dv, P``: velocities after impulses that change some by dv_p.

    A dv = J' Lambda + E' P with J dv = 0, and dv as given where `acting` is 1.

    Source: Pfeiffer and Glocker 1996, section 6.2.

    Args:
        system: open or closed.
        prescribed: numbers of velocities.

    Returns:
        Function of q (nq, 1), dv_p and acting (k, 1); dv (nv, 1) and P (k, 1) [N m s or N s].
    """

    def build() -> tuple[Named, Named]:
        s, k = symbols_of(system, "tree"), len(prescribed)
        change, acting = SX.sym("dv_p", k), SX.sym("acting", k)
        A, (J, psi) = inertia_matrix(system.tree, s.poses), loop_rows(system, s)
        right = SX.zeros(system.nv), SX.zeros(psi.numel()), change
        dv, _, P = constrained(system, s, (A, J), right, prescribed, acting)
        return [("q", s.q), ("dv_p", change), ("acting", acting)], [("dv", dv), ("P", P)]

    return model_function(system, ("impact", prescribed), build)


def tree_jump(system: System, contact: ContactEquations, x: SX, fired: SX) -> tuple[SX, SX]:
    """The state of the whole tree, and the modes, after an event; see `jump`.

    Args:
        system: open or closed.
        contact: its equations of contact; what drives move, keeps its velocity.
        x: [q; v; z], z the states of devices.
        fired: (5 k, 1), 1 for each indicator that is not positive.

    Returns:
        x and modes (2 k, 1).
    """
    q, v, z = casadi.vertsplit(x, [0, system.nq, system.nq + system.nv, x.numel()])
    after, modes = jump(system, contact.contacts, contact.modes, (q, v, fired), contact.driven)
    return casadi.vertcat(q, after, z), modes


def jump(
    system: System,
    contacts: Contacts,
    modes: Modes,
    motion: tuple[SX, SX, SX],
    driven: tuple[int, ...],
) -> tuple[SX, SX]:
    """Velocities and modes after an event.

    An impact comes before all else: each stop that is met turns its velocity round, those that are
    touched stay touched, both unless they would have to pull. Friction is finite and has no part
    in it: what slides afterwards, slides. Otherwise contacts open, stick or slide as their
    indicators say.

    Args:
        system: open or closed.
        contacts: its contacts.
        modes: before the event.
        motion: q (nq, 1) and v (nv, 1), before it; and fired (5 k, 1), 1 for each indicator that
            is not positive.
        driven: numbers of velocities that drives keep.

    Returns:
        v (nv, 1) and modes (2 k, 1).
    """
    q, v, fired = motion
    lower, upper, pulled, pushed, stopped = casadi.vertsplit(fired, len(contacts))
    wall = upper - lower
    speed = wall * contacts.velocity(v)
    met = wall**2 * (speed >= 0)
    back = contacts.restitution * speed
    back = casadi.if_else(back > contacts.rest_speed, back, 0)
    wall = casadi.if_else(met, wall, modes.place)
    change = casadi.if_else(met, -wall * back, 0) - contacts.velocity(v)
    dv, touches = _unilateral(system, contacts, (q, v), (wall, change), driven)
    impact_now = casadi.mmax(met)
    after = v + impact_now * dv
    left = contacts.velocity(after)
    slides = casadi.if_else(casadi.fabs(left) > CREEP, casadi.sign(left), 0)
    place = casadi.if_else(
        impact_now,
        touches * wall * (1 - met * (back > 0)),
        modes.place * (1 - pulled) * (1 - pushed),
    )
    free = (place == 0) * contacts.has_friction
    turned = casadi.if_else(pulled, 1, casadi.if_else(pushed, -1, (1 - stopped) * modes.slide))
    slide = free * casadi.if_else(impact_now, slides, turned)
    return after, casadi.vertcat(place, slide)


def _unilateral(
    system: System,
    contacts: Contacts,
    motion: tuple[SX, SX],
    asked: tuple[SX, SX],
    driven: tuple[int, ...],
) -> tuple[SX, SX]:
    """Velocities that impulses of walls change, and the walls that take part.

    A wall that would have to pull takes no part, unless what it touches would leave it slower than
    the slowest rebound: several contacts could go on pushing each other off for ever. Where very
    many walls act on each other, what still approaches one meets it again.

    Source: Murty 1974, which wall to leave out or take in next.

    Args:
        system: open or closed.
        contacts: its contacts.
        motion: q (nq, 1) and v (nv, 1).
        asked: (k, 1) -1 for a wall below, 1 for one above, 0 for none; and (k, 1) the changes of
            the velocities at walls.
        driven: numbers of velocities that do not change.

    Returns:
        dv (nv, 1); (k, 1) 1 for each wall that takes part.
    """
    (q, v), (wall, change), m = motion, asked, len(driven)
    function = impact(system, (*driven, *contacts.velocities))

    def after(acting: SX) -> tuple[SX, SX]:
        given = casadi.vertcat(SX.zeros(m), change), casadi.vertcat(SX.ones(m), acting)
        dv, P = outputs_of(system, function, q, *given)
        return dv, P[m:]

    part = there = wall**2
    stops = sum(stop is not None for stop in contacts.stops)
    for _ in range(min(2 * (stops - 1), _ROUNDS)):
        dv, P = after(part)
        pulls = part * (wall * P > _PULL * casadi.sum1(casadi.fabs(P)))
        enters = (there - part) * (wall * (contacts.velocity(dv) - change) > CREEP)
        wrong = pulls + enters
        first = wrong * (casadi.cumsum(wrong) == 1)
        part = part + first * (1 - 2 * part)
    leaving = -wall * contacts.velocity(v + after(part)[0])
    part = casadi.fmax(part, there * (leaving <= contacts.rest_speed))
    return after(part)[0], part
