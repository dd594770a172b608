"""Coordinates with rigid stops and Coulomb friction: modes, accelerations, impacts.

A mode is constant between events. Every such coordinate has two: the limit that it is at, -1 for
the lower one, 1 for the upper one, 0 between them; and the direction in which it slides, 0 where it
sticks.

Source: Pfeiffer and Glocker 1996, chapters 4 and 5, for the laws of contact.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import casadi
from casadi import DM, SX, Function

from mbs.assembly import System
from mbs.assembly.model_function import Named, model_function
from mbs.assembly.parts import AttachedPart
from mbs.components.forces import CoulombFriction, JointContact, RigidStop
from mbs.errors import ModelError
from mbs.expressions import Scalar, to_sx
from mbs.models.constrained_accelerations import (
    constrained,
    constrained_accelerations,
    inertia_size,
    loop_rows,
)
from mbs.models.direct_dynamics import are_independent
from mbs.models.symbols import outputs_of, surroundings, symbols_of
from mbs.recursions.composite_body import inertia_matrix

CREEP = 1e-10
"""Velocity below which a coordinate does not move [rad/s or m/s]."""
_BEYOND = 1e-9
"""How far beyond a limit a start may be by rounding, relative to the limit where it is large."""
_ADHESION = 1e-9
"""Acceleration that a contact may pull with before it opens [rad/s^2 or m/s^2]."""
KINDS = ("lower", "upper", "pulled", "pushed", "stopped")
"""Indicators of a coordinate: it meets a limit; the effort that constrains it is too far below
zero, or above; it stops sliding."""


@dataclass(frozen=True, slots=True, eq=False)
class Modes:
    """What the contacts do.

    Attributes:
        limit: (k, 1) -1 at the lower limit, 1 at the upper one, 0 between.
        slide: (k, 1) direction of sliding against Coulomb friction, 0 for none.
        stuck: (k, 1) 1 where the coordinate is at rest, at a limit or by friction; 0 where it
            moves.
    """

    limit: SX
    slide: SX
    stuck: SX


@dataclass(frozen=True, slots=True, eq=False)
class Contacts:
    """The coordinates with contacts: element j of a vector (k, 1) belongs to the j-th of them.

    They are in the order of v.

    Attributes:
        names: of the coordinates.
        velocities: indices in v.
        positions: indices in q; None where there is friction alone.
        stops, frictions: the elements, None where there is none.
        bounds: (k, 1) lower limits, then upper ones; zero where there is none.
        has_lower, has_upper, has_friction: (k, 1) 1 where there is one.
        restitution, rest_speed, sliding, sticking: (k, 1) of the elements, zero where there is
            none.
    """

    names: tuple[str, ...]
    velocities: tuple[int, ...]
    positions: tuple[int | None, ...]
    stops: tuple[AttachedPart | None, ...]
    frictions: tuple[AttachedPart | None, ...]
    bounds: tuple[SX, SX]
    has_lower: DM
    has_upper: DM
    has_friction: DM
    restitution: SX
    rest_speed: SX
    sliding: SX
    sticking: SX

    def __len__(self) -> int:
        return len(self.names)

    def position(self, q: SX) -> SX:
        """(k, 1) positions, zero where there is no stop."""
        return casadi.vertcat(*(SX(0) if k is None else q[k] for k in self.positions))

    def velocity(self, v: SX) -> SX:
        """(k, 1) velocities."""
        return casadi.vertcat(*(v[k] for k in self.velocities))

    def modes(self, values: SX) -> Modes:
        """The modes from one vector of them, (2 k, 1)."""
        limit, slide = values[: len(self)], values[len(self) :]
        sticks = self.has_friction * (slide == 0)
        return Modes(limit, slide, casadi.fmax(limit**2, sticks))

    def first(self, q: SX, v: SX) -> tuple[SX, SX]:
        """Modes at a start: what rests at a limit touches it, what moves slides.

        Args:
            q: (nq, 1) positions.
            v: (nv, 1) velocities.

        Returns:
            (2 k, 1) modes; (2 k, 1) how far the coordinates are below their lower limits, then
            above the upper ones, by more than rounding where positive.
        """
        x, speed = self.position(q), self.velocity(v)
        direction = casadi.if_else(casadi.fabs(speed) > CREEP, casadi.sign(speed), 0)
        at_limit, beyond = SX.zeros(len(self)), []
        for side, limit, given in (
            (-1, self.bounds[0], self.has_lower),
            (1, self.bounds[1], self.has_upper),
        ):
            outside, slack = side * (x - limit), _BEYOND * casadi.fmax(1, casadi.fabs(limit))
            rests = given * (outside >= -slack) * (direction == 0)
            at_limit = casadi.if_else(rests, side, at_limit)
            beyond.append(casadi.if_else(given, outside - slack, -1))
        return casadi.vertcat(at_limit, direction * self.has_friction), casadi.vertcat(*beyond)

    def distance(self, q: SX, limit: SX) -> SX:
        """(k, 1) how far a coordinate is from the limit that it is at, zero between limits."""
        x = self.position(q)
        return casadi.if_else(limit == 0, 0, x - casadi.if_else(limit < 0, *self.bounds))

    def efforts(self, modes: Modes, y: SX) -> tuple[SX, SX]:
        """(k, 1) efforts of stops and of friction where y constrains the coordinates.

        Friction takes what it can: how a stop and friction share an effort is not determined for
        rigid bodies.
        """
        taken = casadi.fmax(casadi.fmin(y, self.sticking), -self.sticking)
        friction = casadi.if_else(modes.stuck, taken, -modes.slide * self.sliding)
        return modes.stuck * (y - taken), friction

    def indicators(self, q: SX, v: SX, modes: Modes, y: SX, inertia: SX) -> SX:
        """(5 k, 1) in the order of KINDS, positive between events.

        Args:
            q: (nq, 1) positions.
            v: (nv, 1) velocities.
            modes: present.
            y: (k, 1) efforts that constrain the coordinates.
            inertia: (k, 1) diagonal elements of the inertia matrix.
        """
        x, limit = self.position(q), modes.limit
        bears = self.sticking + _ADHESION * inertia
        free, stuck = limit == 0, modes.stuck
        return casadi.vertcat(
            casadi.if_else(free * self.has_lower, x - self.bounds[0], 1),
            casadi.if_else(free * self.has_upper, self.bounds[1] - x, 1),
            casadi.if_else(stuck * (limit < 1), bears + y, 1),
            casadi.if_else(stuck * (limit > -1), bears - y, 1),
            casadi.if_else(modes.slide != 0, modes.slide * self.velocity(v) + CREEP, 1),
        )


def contacts_of(system: System) -> Contacts:
    """The coordinates of a system with rigid stops and Coulomb friction.

    Raises:
        ModelError: two elements of one kind act on a coordinate.
    """
    found: Contacts = system.cached("contacts", lambda: _contacts(system))
    return found


def require_no_contacts(system: System, what: str) -> None:
    """Refuse a system with rigid stops, Coulomb friction or events, for what does not know them.

    Raises:
        ModelError: names the element, and what to use instead.
    """
    for force in system.parts:
        if isinstance(force.element, JointContact):
            kind = type(force.element).__name__
            smooth = "JointStop" if isinstance(force.element, RigidStop) else "JointFriction"
            raise ModelError(
                f"{system.name}: {what} has no events yet, which {kind} {force.element.name} needs;"
                f" use a {smooth}, or mbs.simulate.run"
            )
        if force.element.has("events"):
            raise ModelError(
                f"{system.name}: {what} has no events yet, which {type(force.element).__name__}"
                f" {force.name} needs; use mbs.simulate.run or an FMU"
            )


def require_undriven(system: System, contacts: Contacts, driven: Sequence[int]) -> None:
    """Refuse motions that are prescribed where a contact acts.

    Args:
        system: open or closed.
        contacts: its contacts.
        driven: indices of the velocities whose motion is prescribed.

    Raises:
        ModelError: which, and the remedy.
    """
    for name, number in zip(contacts.names, contacts.velocities, strict=True):
        if number in driven:
            raise ModelError(
                f"{system.name}: motion prescribes {name}, on which a rigid stop or Coulomb"
                " friction"
                " acts; leave out one of the two"
            )
        if driven and not are_independent(system, (*driven, number)):
            raise ModelError(
                f"{system.name}: the motions that are prescribed move {name} through the loops, on"
                " which a rigid stop or Coulomb friction acts; use a JointStop or JointFriction"
                " there"
            )


def require_lasting_rows(system: System, contacts: Contacts) -> None:
    """Refuse contacts on loops whose independent rows change with the configuration.

    Raises:
        ModelError: which contact, and the remedy.
    """
    if len(contacts) and system.closure is not None and system.closure.varies:
        raise ModelError(
            f"{system.name}: the independent rows of its loops change with the configuration, which"
            f" the contact on {contacts.names[0]} does not follow; use a JointStop or"
            " JointFriction there"
        )


def _contacts(system: System) -> Contacts:
    acting = [force for force in system.parts if isinstance(force.element, JointContact)]
    velocities = tuple(sorted({force.levers[0].velocity for force in acting}))
    stops = tuple(_only(system, acting, number, RigidStop) for number in velocities)
    frictions = tuple(_only(system, acting, number, CoulombFriction) for number in velocities)
    lower, upper = _column(stops, "lower"), _column(stops, "upper")
    return Contacts(
        names=tuple(system.speeds[number].name for number in velocities),
        velocities=velocities,
        positions=tuple(None if stop is None else stop.levers[0].position for stop in stops),
        stops=stops,
        frictions=frictions,
        bounds=(lower, upper),
        has_lower=_given(stops, "lower"),
        has_upper=_given(stops, "upper"),
        has_friction=_given(frictions, "sliding"),
        restitution=_column(stops, "restitution"),
        rest_speed=_column(stops, "rest_speed"),
        sliding=_column(frictions, "sliding"),
        sticking=_column(frictions, "sticking"),
    )


def _only(
    system: System, acting: list[AttachedPart], number: int, kind: type[JointContact]
) -> AttachedPart | None:
    """The element of a kind on a velocity."""
    found = [f for f in acting if f.levers[0].velocity == number and isinstance(f.element, kind)]
    if len(found) > 1:
        names = " and ".join(force.element.name for force in found)
        raise ModelError(
            f"{system.name}: {names} act both on {system.speeds[number].name}; give one"
            f" {kind.__name__} for a coordinate"
        )
    return found[0] if found else None


_Elements = tuple[AttachedPart | None, ...]


def _field(force: AttachedPart | None, name: str) -> Scalar | None:
    value: Scalar | None = None if force is None else getattr(force.element, name)
    return value


def _column(elements: _Elements, name: str) -> SX:
    """(k, 1) a field of the elements, zero where it is not given."""
    values = []
    for force in elements:
        value = _field(force, name)
        values.append(SX(0) if force is None or value is None else to_sx(value, force.symbols))
    return SX(casadi.densify(casadi.vertcat(*values)))


def _given(elements: _Elements, name: str) -> DM:
    return DM([float(_field(force, name) is not None) for force in elements])


# Accelerations of a system some of whose coordinates contacts constrain.


def switched_dynamics(system: System, prescribed: tuple[int, ...]) -> Function:
    """``switched_dynamics(q, v, tau, a_p, acting) -> a, tau_p, inertia``: hybrid, with switches.

    Args:
        system: open or closed; all coordinates are those of the tree.
        prescribed: indices of velocities.

    Returns:
        Function of q (nq, 1), v and tau (nv, 1), the accelerations a_p (k, 1) and acting (k, 1), 1
        where a_p is given and 0 where the coordinate is free; a (nv, 1), the efforts tau_p (k, 1)
        that make a_p, and the diagonal elements (k, 1) of the inertia matrix.
    """

    def build() -> tuple[Named, Named]:
        s, k = symbols_of(system, "tree"), len(prescribed)
        tau, a_p, acting = SX.sym("tau", system.nv), SX.sym("a_p", k), SX.sym("acting", k)
        a, _, tau_p = constrained_accelerations(
            system, s, tau, surroundings(system), prescribed, a_p, acting
        )
        A = inertia_matrix(system.tree, s.poses)
        # a limited link may be massless: what a stop then counts on is a millionth of the others'
        least = SX(1e-6 * inertia_size(system, A, s))
        inertia = casadi.vertcat(*(casadi.fmax(A[n, n], least) for n in prescribed))
        inputs: Named = [("q", s.q), ("v", s.v), ("tau", tau), ("a_p", a_p), ("acting", acting)]
        return inputs, [("a", a), ("tau_p", tau_p), ("inertia", inertia)]

    return model_function(system, ("switched_dynamics", prescribed), build)


@dataclass(frozen=True, slots=True, eq=False)
class ContactEquations:
    """What contacts make of the equations of motion.

    Attributes:
        contacts: the coordinates that they act on.
        values: (2 k, 1) symbols of their modes.
        modes: the same by name.
        a: (nv, 1) accelerations.
        driven: indices of the m velocities that drives move.
        drives: (m, 1) efforts that do so, in their order.
        tau: (nv, 1) joint efforts, those of drives included and those of contacts left out.
        efforts: (2 k, 1) of the stops, then of friction.
        indicators: (5 k, 1) as of `Contacts.indicators`.
    """

    contacts: Contacts
    values: SX
    modes: Modes
    a: SX
    driven: tuple[int, ...]
    drives: SX
    tau: SX
    efforts: SX
    indicators: SX


def contact_equations(
    system: System, q: SX, v: SX, tau: SX, driven: Mapping[int, SX]
) -> ContactEquations | None:
    """Accelerations, efforts and indicators under contacts; None where there are none.

    Args:
        system: open or closed.
        q: (nq, 1) positions.
        v: (nv, 1) velocities.
        tau: (nv, 1) joint efforts.
        driven: accelerations that drives give to velocities, by their numbers.

    Raises:
        ModelError: a contact acts where it cannot.
    """
    contacts = contacts_of(system)
    if not len(contacts):
        return None
    values = SX.sym("modes", 2 * len(contacts))
    modes = contacts.modes(values)
    braked, every = SX(tau), SX(tau)
    for j, number in enumerate(contacts.velocities):
        braked[number] -= modes.slide[j] * contacts.sliding[j]
    numbers, m = (*driven, *contacts.velocities), len(driven)
    given = casadi.vertcat(*driven.values(), SX.zeros(len(contacts)))
    acting = casadi.vertcat(SX.ones(m), modes.stuck)
    a, made, inertia = outputs_of(
        system, switched_dynamics(system, numbers), q, v, braked, given, acting
    )
    for row, number in enumerate(driven):
        every[number] += made[row]
    y = made[m:]
    efforts = casadi.vertcat(*contacts.efforts(modes, y))
    indicators = contacts.indicators(q, v, modes, y, inertia[m:])
    return ContactEquations(
        contacts, values, modes, a, tuple(driven), made[:m], every, efforts, indicators
    )


# Impacts on rigid stops, and what else the modes of contacts do at events.


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
        prescribed: indices of velocities.

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

    An impact comes before all else: each stop that is met reverses its velocity, those that are
    touched stay touched, both unless they would have to pull. Friction is finite and has no part
    in it: what slides afterwards, slides. Otherwise contacts open, stick or slide as their
    indicators say.

    Args:
        system: open or closed.
        contacts: its contacts.
        modes: before the event.
        motion: q (nq, 1) and v (nv, 1), before it; and fired (5 k, 1), 1 for each indicator that
            is not positive.
        driven: indices of velocities that drives keep.

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
    wall = casadi.if_else(met, wall, modes.limit)
    change = casadi.if_else(met, -wall * back, 0) - contacts.velocity(v)
    dv, touches = _unilateral(system, contacts, (q, v), (wall, change), driven)
    impact_now = casadi.mmax(met)
    after = v + impact_now * dv
    left = contacts.velocity(after)
    slides = casadi.if_else(casadi.fabs(left) > CREEP, casadi.sign(left), 0)
    limit = casadi.if_else(
        impact_now,
        touches * wall * (1 - met * (back > 0)),
        modes.limit * (1 - pulled) * (1 - pushed),
    )
    free = (limit == 0) * contacts.has_friction
    direction = casadi.if_else(pulled, 1, casadi.if_else(pushed, -1, (1 - stopped) * modes.slide))
    slide = free * casadi.if_else(impact_now, slides, direction)
    return after, casadi.vertcat(limit, slide)


def _unilateral(
    system: System,
    contacts: Contacts,
    motion: tuple[SX, SX],
    targets: tuple[SX, SX],
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
        targets: (k, 1) -1 for a wall below, 1 for one above, 0 for none; and (k, 1) the changes of
            the velocities at walls.
        driven: indices of velocities that do not change.

    Returns:
        dv (nv, 1); (k, 1) 1 for each wall that takes part.
    """
    (q, v), (wall, change), m = motion, targets, len(driven)
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
