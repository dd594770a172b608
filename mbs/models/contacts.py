"""Coordinates that rigid stops and dry friction may hold, and the modes that say what they do.

A mode is constant between events. Every such coordinate has two: its place, -1 at the lower limit,
1 at the upper one, 0 between them; and the direction in which it slides, 0 where friction holds it.

Source: Pfeiffer and Glocker 1996, chapters 4 and 5, for the laws of contact.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi
from casadi import DM, SX

from mbs.assembly import System
from mbs.assembly.attached import AttachedForce
from mbs.components.contacts_joint import CoulombFriction, JointContact, RigidStop
from mbs.errors import ModelError
from mbs.expressions import Scalar, to_sx
from mbs.models.hybrid_dynamics import are_independent

CREEP = 1e-10
"""Velocity below which a coordinate does not move [rad/s or m/s]."""
_BEYOND = 1e-9
"""How far beyond a limit a start may be by rounding, relative to the limit where it is large."""
_ADHESION = 1e-9
"""Acceleration that a contact may pull with before it opens [rad/s^2 or m/s^2]."""
KINDS = ("lower", "upper", "pulled", "pushed", "stopped")
"""Indicators of a coordinate: it meets a limit; the effort that holds it is too far below zero, or
above; it stops sliding."""


@dataclass(frozen=True, slots=True, eq=False)
class Modes:
    """What the contacts do.

    Attributes:
        place: (k, 1) -1 at the lower limit, 1 at the upper one, 0 between.
        slide: (k, 1) direction of sliding against dry friction, 0 for none.
        held: (k, 1) 1 where the coordinate is held at rest, 0 where it moves.
    """

    place: SX
    slide: SX
    held: SX


@dataclass(frozen=True, slots=True, eq=False)
class Contacts:
    """The coordinates with contacts: element j of a vector (k, 1) belongs to the j-th of them.

    They are in the order of v.

    Attributes:
        names: of the coordinates.
        velocities: numbers in v.
        positions: numbers in q; None where there is friction alone.
        stops, frictions: the elements, None where there is none.
        bounds: (k, 1) lower limits, then upper ones; zero where there is none.
        has_lower, has_upper, has_friction: (k, 1) 1 where there is one.
        restitution, rest_speed, sliding, sticking: (k, 1) of the elements, zero where there is
            none.
    """

    names: tuple[str, ...]
    velocities: tuple[int, ...]
    positions: tuple[int | None, ...]
    stops: tuple[AttachedForce | None, ...]
    frictions: tuple[AttachedForce | None, ...]
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
        place, slide = values[: len(self)], values[len(self) :]
        sticks = self.has_friction * (slide == 0)
        return Modes(place, slide, casadi.fmax(place**2, sticks))

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
        way = casadi.if_else(casadi.fabs(speed) > CREEP, casadi.sign(speed), 0)
        place, beyond = SX.zeros(len(self)), []
        for side, limit, given in (
            (-1, self.bounds[0], self.has_lower),
            (1, self.bounds[1], self.has_upper),
        ):
            outside, slack = side * (x - limit), _BEYOND * casadi.fmax(1, casadi.fabs(limit))
            rests = given * (outside >= -slack) * (way == 0)
            place = casadi.if_else(rests, side, place)
            beyond.append(casadi.if_else(given, outside - slack, -1))
        return casadi.vertcat(place, way * self.has_friction), casadi.vertcat(*beyond)

    def distance(self, q: SX, place: SX) -> SX:
        """(k, 1) how far a coordinate is from the limit that it is at, zero between limits."""
        x = self.position(q)
        return casadi.if_else(place == 0, 0, x - casadi.if_else(place < 0, *self.bounds))

    def efforts(self, modes: Modes, y: SX) -> tuple[SX, SX]:
        """(k, 1) efforts of stops and of friction where y holds the coordinates.

        Friction takes what it can; which part it takes of what a stop could take as well, rigid
        bodies do not tell.
        """
        caught = casadi.fmax(casadi.fmin(y, self.sticking), -self.sticking)
        friction = casadi.if_else(modes.held, caught, -modes.slide * self.sliding)
        return modes.held * (y - caught), friction

    def indicators(self, q: SX, v: SX, modes: Modes, y: SX, inertia: SX) -> SX:
        """(5 k, 1) in the order of KINDS, positive between events.

        Args:
            q: (nq, 1) positions.
            v: (nv, 1) velocities.
            modes: present.
            y: (k, 1) efforts that hold the coordinates.
            inertia: (k, 1) diagonal elements of the inertia matrix.
        """
        x, place = self.position(q), modes.place
        bears = self.sticking + _ADHESION * inertia
        free, held = place == 0, modes.held
        return casadi.vertcat(
            casadi.if_else(free * self.has_lower, x - self.bounds[0], 1),
            casadi.if_else(free * self.has_upper, self.bounds[1] - x, 1),
            casadi.if_else(held * (place < 1), bears + y, 1),
            casadi.if_else(held * (place > -1), bears - y, 1),
            casadi.if_else(modes.slide != 0, modes.slide * self.velocity(v) + CREEP, 1),
        )


def contacts_of(system: System) -> Contacts:
    """The coordinates of a system with rigid stops and dry friction.

    Raises:
        ModelError: two elements of one kind act on a coordinate.
    """
    found: Contacts = system.cached("contacts", lambda: _contacts(system))
    return found


def require_no_contacts(system: System, what: str) -> None:
    """Refuse a system with rigid stops or dry friction, for what does not know them.

    Raises:
        ModelError: names the element, and what to use instead.
    """
    for force in system.forces:
        if isinstance(force.element, JointContact):
            kind = type(force.element).__name__
            smooth = "JointStop" if isinstance(force.element, RigidStop) else "JointFriction"
            raise ModelError(
                f"{system.name}: {what} has no events yet, which {kind} {force.element.name} needs;"
                f" use a {smooth}, or mbs.simulate.run"
            )


def require_undriven(system: System, contacts: Contacts, driven: Sequence[int]) -> None:
    """Refuse motions that are prescribed where a contact acts.

    Args:
        system: open or closed.
        contacts: its contacts.
        driven: numbers of the velocities whose motion is prescribed.

    Raises:
        ModelError: which, and the remedy.
    """
    for name, number in zip(contacts.names, contacts.velocities, strict=True):
        if number in driven:
            raise ModelError(
                f"{system.name}: motion prescribes {name}, on which a rigid stop or dry friction"
                " acts; leave out one of the two"
            )
        if driven and not are_independent(system, (*driven, number)):
            raise ModelError(
                f"{system.name}: the motions that are prescribed move {name} through the loops, on"
                " which a rigid stop or dry friction acts; use a JointStop or JointFriction there"
            )


def require_lasting_rows(system: System, contacts: Contacts) -> None:
    """Refuse contacts on loops whose independent rows change with the posture.

    Raises:
        ModelError: which contact, and the remedy.
    """
    if len(contacts) and system.closure is not None and system.closure.varies:
        raise ModelError(
            f"{system.name}: the independent rows of its loops change with the posture, which"
            f" the contact on {contacts.names[0]} does not follow; use a JointStop or"
            " JointFriction there"
        )


def _contacts(system: System) -> Contacts:
    acting = [force for force in system.forces if isinstance(force.element, JointContact)]
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
    system: System, acting: list[AttachedForce], number: int, kind: type[JointContact]
) -> AttachedForce | None:
    """The element of a kind on a velocity."""
    found = [f for f in acting if f.levers[0].velocity == number and isinstance(f.element, kind)]
    if len(found) > 1:
        names = " and ".join(force.element.name for force in found)
        raise ModelError(
            f"{system.name}: {names} act both on {system.speeds[number].name}; give one"
            f" {kind.__name__} for a coordinate"
        )
    return found[0] if found else None


_Elements = tuple[AttachedForce | None, ...]


def _field(force: AttachedForce | None, name: str) -> Scalar | None:
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
