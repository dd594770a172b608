"""Coordinates with rigid stops and Coulomb friction: modes, accelerations, impacts.

A mode is constant between events. Every such coordinate has two: the limit that it is at, -1 for
the lower one, 1 for the upper one, 0 between them; and the direction in which it slides, 0 where it
sticks.

Source: Pfeiffer and Glocker 1996, chapters 4 and 5, for the laws of contact.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

import casadi
import numpy as np
from casadi import DM, SX, Function
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.assembly.model_function import Named, model_function
from mbs.assembly.parts import AttachedPart
from mbs.assembly.tables import EFFORT_UNIT
from mbs.assembly.tree import position_rate, quaternion_slices
from mbs.components.custom import Friction, OneWay, Stop
from mbs.errors import ModelError
from mbs.models.constrained_accelerations import (
    constrained,
    constrained_accelerations,
    inertia_size,
    loop_rows,
    unit_rows,
)
from mbs.models.direct_dynamics import are_independent
from mbs.models.symbols import outputs_of, surroundings, symbols_of
from mbs.recursions.composite_body import inertia_matrix
from mbs.recursions.parts import PartsAt

Array = NDArray[np.float64]

CREEP = 1e-10
"""Velocity below which a coordinate does not move [rad/s or m/s]."""
_BEYOND = 1e-9
"""How far beyond a limit a start may be by rounding, relative to the limit where it is large."""
_ADHESION = 1e-9
"""Acceleration that a contact may pull with before it opens [rad/s^2 or m/s^2]."""
_CONFIGURATIONS, _SEED = 4, 20261124
"""Where the typical levers of a row are looked for: one that vanishes here does not elsewhere."""
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
class ContactElement:
    """A friction or a stop of a component.

    Attributes:
        part: the component.
        label: of the friction or stop in it.
        law: what the component says of it.
        unit: of its effort.
    """

    part: AttachedPart
    label: str
    law: Friction | Stop | OneWay
    unit: str

    @property
    def name(self) -> str:
        """The name of the component, with the label where there is one."""
        return f"{self.part.name}.{self.label}" if self.label else self.part.name

    @property
    def sides(self) -> tuple[bool, bool]:
        """Whether a stop has a lower and an upper limit."""
        if isinstance(self.law, Stop):
            return self.law.lower is not None, self.law.upper is not None
        return isinstance(self.law, OneWay), False


@dataclass(frozen=True, slots=True, eq=False)
class ContactState:
    """The contacts at positions q and velocities v; see `Contacts` for k.

    Attributes:
        rows: (k, nv) E, how the velocities of the contacts follow from v.
        velocity: (k, 1) velocities of slip and of gaps, w = E v + what it is at rest.
        bias: (k, 1) dw/dt = E a + bias.
        measure: (k, 1) gaps, and velocities of what holds in one way; zero for friction alone.
        sliding, sticking: (k, 1) friction while it slides, and the largest at which it sticks.
    """

    rows: SX
    velocity: SX
    bias: SX
    measure: SX
    sliding: SX
    sticking: SX


@dataclass(frozen=True, slots=True, eq=False)
class Contacts:
    """The k rows with contacts: each is a velocity on which a friction, a stop or both act.

    Those of single coordinates come first, in the order of v, others by component.

    Attributes:
        names: of the coordinates, or of the elements.
        velocities: indices in v where the row is that of a coordinate alone; None elsewhere.
        positions: indices in q where the gap is that of a coordinate alone; None elsewhere.
        groups: equal numbers for equal rows.
        levers: (k, nv) typical magnitudes of the elements of E.
        stops, frictions: the elements, None where there is none.
        bounds: (k, 1) lower limits, then upper ones; zero where there is none.
        has_lower, has_upper, has_friction: (k, 1) 1 where there is one.
        has_gap: (k, 1) 1 where a stop has a gap, 0 where it holds in one way alone.
        restitution, rest_speed: (k, 1) of the stops, zero where there is none.
        anchors: (k) positions of which the velocities are the rates, of `q`; None for a row that
            has none.
        q, v: symbols of `state` and `anchors`.
        state: the contacts at these symbols.
    """

    names: tuple[str, ...]
    velocities: tuple[int | None, ...]
    positions: tuple[int | None, ...]
    groups: tuple[int, ...]
    levers: Array
    stops: tuple[ContactElement | None, ...]
    frictions: tuple[ContactElement | None, ...]
    bounds: tuple[SX, SX]
    has_lower: DM
    has_upper: DM
    has_friction: DM
    has_gap: DM
    restitution: SX
    rest_speed: SX
    anchors: tuple[SX | None, ...]
    q: SX
    v: SX
    state: ContactState

    def __len__(self) -> int:
        return len(self.names)

    def at(self, q: SX, v: SX) -> ContactState:
        """The contacts at other positions (nq, 1) and velocities (nv, 1)."""
        names = [field.name for field in fields(ContactState)]
        values = [getattr(self.state, name) for name in names]
        put = casadi.substitute(values, [self.q, self.v], [casadi.densify(q), casadi.densify(v)])
        return ContactState(**dict(zip(names, put, strict=True)))

    def rows(self, q: SX) -> SX:
        """(k, nv) E."""
        (E,) = casadi.substitute([self.state.rows], [self.q], [casadi.densify(q)])
        return SX(E)

    @property
    def sizes(self) -> DM:
        """(k, 1) typical lengths of the rows, 1 for those of coordinates.

        Equations that weigh rows take them in these units, however short a lever is. They are
        constants, so that a row whose lever vanishes in some configuration vanishes there.
        """
        return DM(np.linalg.norm(self.levers, axis=1))

    def scaled_rows(self, q: SX) -> SX:
        """(k, nv) E, each row divided by its typical length."""
        return casadi.mtimes(casadi.diag(1 / self.sizes), self.rows(q))

    def velocity(self, q: SX, v: SX) -> SX:
        """(k, 1) velocities of slip and of gaps."""
        return self.at(q, v).velocity

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
            (2 k, 1) modes; (2 k, 1) how far the gaps are below their lower limits, then above the
            upper ones, by more than rounding where positive.
        """
        state = self.at(q, v)
        x, speed = state.measure, state.velocity
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
        """(k, 1) how far a gap is from the limit that it is at, zero between limits."""
        if not any(stop is not None for stop in self.stops):
            return SX.zeros(len(self))
        gap = self.has_gap * self.at(q, SX.zeros(self.v.numel())).measure
        return casadi.if_else(limit == 0, 0, gap - casadi.if_else(limit < 0, *self.bounds))

    def efforts(self, state: ContactState, modes: Modes, y: SX) -> tuple[SX, SX]:
        """(k, 1) efforts of stops and of friction where y holds the rows.

        Friction takes what it can: how a stop and friction share an effort is not determined for
        rigid bodies.
        """
        taken = casadi.fmax(casadi.fmin(y, state.sticking), -state.sticking)
        friction = casadi.if_else(modes.stuck, taken, -modes.slide * state.sliding)
        return modes.stuck * (y - taken), friction

    def indicators(self, state: ContactState, modes: Modes, y: SX, inertia: SX) -> SX:
        """(5 k, 1) in the order of KINDS, positive between events.

        Args:
            state: the contacts now.
            modes: present.
            y: (k, 1) efforts that hold the rows.
            inertia: (k, 1) what the rows have against them.
        """
        x, limit = state.measure, modes.limit
        bears = state.sticking + _ADHESION * inertia
        free, stuck = limit == 0, modes.stuck
        return casadi.vertcat(
            casadi.if_else(free * self.has_lower, x - self.bounds[0], 1),
            casadi.if_else(free * self.has_upper, self.bounds[1] - x, 1),
            casadi.if_else(stuck * (limit < 1), bears + y, 1),
            casadi.if_else(stuck * (limit > -1), bears - y, 1),
            casadi.if_else(modes.slide != 0, modes.slide * state.velocity + CREEP, 1),
        )


def contacts_of(system: System) -> Contacts:
    """The rows of a system with rigid stops and dry friction.

    Raises:
        ModelError: two stops act on one coordinate, or a sensor reads forces that frictions and
            stops between points change.
    """
    found: Contacts = system.cached("contacts", lambda: _contacts(system))
    return found


def require_no_contacts(system: System, what: str) -> None:
    """Refuse a system with rigid stops, Coulomb friction or events, for what does not know them.

    Raises:
        ModelError: names the element, and what to use instead.
    """
    for force in system.parts:
        if force.element.switches:
            kind = type(force.element).__name__
            smooth = "JointStop" if force.element.has("stops") else "JointFriction"
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
        if number is not None and number in driven:
            raise ModelError(
                f"{system.name}: motion prescribes {name}, on which a rigid stop or Coulomb"
                " friction"
                " acts; leave out one of the two"
            )
    for j, name in enumerate(contacts.names):
        if driven and not _is_independent(system, contacts, driven, j):
            through = " through the loops" if system.is_closed else ""
            raise ModelError(
                f"{system.name}: the motions that are prescribed move {name}{through}, on"
                " which a rigid stop or Coulomb friction acts; use a JointStop or JointFriction"
                " there"
            )


def _is_independent(system: System, contacts: Contacts, driven: Sequence[int], j: int) -> bool:
    """Whether prescribed motions leave the row of a contact free, as assembled."""
    number = contacts.velocities[j]
    if number is not None:
        return are_independent(system, (*driven, number))
    E = Function("E", [contacts.q, system.p], [contacts.state.rows[j, :]])
    row = np.array(E(np.array(system.configuration), system.p_default)).reshape(1, -1)
    return are_independent(system, tuple(driven), row)


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


@dataclass(slots=True, eq=False)
class _ContactRow:
    """One row of contacts while they are collected; the attributes are as of `Contacts`."""

    velocity: SX
    E: SX
    key: tuple[Any, ...]
    number: int | None
    stop: ContactElement | None = None
    friction: ContactElement | None = None

    @property
    def element(self) -> ContactElement:
        found = self.stop or self.friction
        assert found is not None
        return found


def _contacts(system: System) -> Contacts:
    q, v = SX.sym("q", system.nq), SX.sym("v", system.nv)
    at = PartsAt(system, q, v)
    found = list[_ContactRow]()
    for part in system.parts:
        if part.element.switches and part.name not in system.node_frictions:
            seen = at.at(part)
            laws = [*part.element.stops(seen).items(), *part.element.frictions(seen).items()]
            for label, law in laws:
                _require_unread(system, part)
                element = ContactElement(part, label, law, effort_unit(part, law))
                _collect(system, found, element, q, v)
    found.sort(key=lambda row: system.nv if row.number is None else row.number)
    stops, frictions = (tuple(getattr(row, x) for row in found) for x in ("stop", "friction"))
    measures = [_measure(row) for row in found]
    rows = SX(casadi.vertcat(SX(0, system.nv), *(row.E for row in found)))
    velocity = _stack(row.velocity for row in found)
    return Contacts(
        names=tuple(
            row.element.name if row.number is None else system.speeds[row.number].name
            for row in found
        ),
        velocities=tuple(row.number for row in found),
        positions=tuple(_index(measure, q) for measure in measures),
        groups=tuple([row.key for row in found].index(row.key) for row in found),
        levers=_levers(system, found, rows, q),
        stops=stops,
        frictions=frictions,
        bounds=(_column(stops, "lower"), _column(stops, "upper")),
        has_lower=DM([float(x is not None and x.sides[0]) for x in stops]),
        has_upper=DM([float(x is not None and x.sides[1]) for x in stops]),
        has_friction=DM([float(x is not None) for x in frictions]),
        has_gap=DM([float(x is not None and isinstance(x.law, Stop)) for x in stops]),
        restitution=_column(stops, "restitution"),
        rest_speed=_column(stops, "rest_speed"),
        anchors=tuple(_anchor(system, row, q, v) for row in found),
        q=q,
        v=v,
        state=ContactState(
            rows=rows,
            velocity=velocity,
            bias=SX(casadi.densify(casadi.jtimes(velocity, q, position_rate(system.tree, q, v)))),
            measure=_stack(SX(0) if x is None else x for x in measures),
            sliding=_column(frictions, "limit"),
            sticking=_column(frictions, "sticking", "limit"),
        ),
    )


def effort_unit(part: AttachedPart, law: Friction | Stop | OneWay) -> str:
    """The unit of the effort of a friction or stop."""
    if law.unit is not None:
        return law.unit
    return EFFORT_UNIT[part.levers[0].unit] if part.levers and not part.frames else "N"


def _collect(
    system: System, rows: list[_ContactRow], element: ContactElement, q: SX, v: SX
) -> None:
    """Put an element on the row that has no element of its kind yet, or on a new one."""
    w = contact_velocity(system, element.law, q, v)
    E = SX(casadi.sparsify(casadi.jacobian(w, v)))
    at_rest = casadi.simplify(casadi.substitute(w, v, SX.zeros(system.nv)))
    if not E.nnz():
        kind = type(element.part.element).__name__
        raise ModelError(
            f"{system.name}: nothing moves what {element.name} ({kind}) holds; let it act between"
            " bodies or shafts that move against each other"
        )
    number, key = None, tuple[Any, ...]((element.name, "of its own"))
    if at_rest.is_zero() and E.is_constant():
        columns, factors = E.sparsity().get_triplet()[1], DM(E).nonzeros()
        key = (*columns, *factors)
        number = int(columns[0]) if factors == [1.0] else None
    kind = "friction" if isinstance(element.law, Friction) else "stop"
    row = next((row for row in rows if row.key == key and getattr(row, kind) is None), None)
    if row is None:
        other = next((row for row in rows if row.key == key and number is not None), None)
        if other is not None and other.stop and isinstance(element.law, Stop):
            same, what = type(other.stop.part.element), type(element.part.element)
            word = what.__name__ if same is what else "stop"
            raise ModelError(
                f"{system.name}: {other.stop.name} and {element.name} act both on"
                f" {system.speeds[number or 0].name}; give one {word} for a coordinate"
            )
        row = _ContactRow(w, E, key, number)
        rows.append(row)
    setattr(row, kind, element)


def contact_velocity(system: System, law: Friction | Stop | OneWay, q: SX, v: SX) -> SX:
    """(1, 1) the velocity on which a friction or stop acts."""
    if isinstance(law, Stop):
        return SX(casadi.jtimes(SX(law.gap), q, position_rate(system.tree, q, v)))
    return SX(law.slip if isinstance(law, Friction) else law.velocity)


def _levers(system: System, found: Sequence[_ContactRow], rows: SX, q: SX) -> Array:
    """(k, nv) the largest magnitudes of E as assembled and in some random configurations."""
    rng = np.random.default_rng(_SEED)
    p = [1.0 if x.default is None else x.default for x in system.parameters]
    E = Function("E", [q, system.p], [casadi.densify(rows)])
    configurations = [np.array(system.configuration)]
    for _ in range(_CONFIGURATIONS):
        other = rng.uniform(-1.0, 1.0, system.nq)
        for part in quaternion_slices(system.tree):
            other[part] /= np.linalg.norm(other[part])
        configurations.append(other)
    every = np.abs([np.array(E(x, p)) for x in configurations])
    levers: Array = np.max(np.where(np.isfinite(every), every, 0.0), axis=0)
    for j, row in enumerate(found):
        if row.number is None and not levers[j].any():
            levers[j] = 1.0  # nothing is known of it
    return levers


def _measure(row: _ContactRow) -> SX | None:
    """What the indicators of a stop watch."""
    if row.stop is None:
        return None
    law = row.stop.law
    return SX(law.gap) if isinstance(law, Stop) else row.velocity


def _index(value: SX | None, q: SX) -> int | None:
    """Which of the positions an expression is; None where it is none of them."""
    if value is None:
        return None
    elements = casadi.vertsplit(q) if q.numel() else []
    return next((k for k, x in enumerate(elements) if casadi.is_equal(x, value)), None)


def _anchor(system: System, row: _ContactRow, q: SX, v: SX) -> SX | None:
    """What the velocity of a row is the rate of; None where that is not known."""
    if row.stop is not None and isinstance(row.stop.law, Stop):
        return SX(row.stop.law.gap)
    at_rest = casadi.simplify(casadi.substitute(row.velocity, v, SX.zeros(system.nv)))
    columns = row.E.sparsity().get_triplet()[1]
    links = [x for k in columns for x in system.tree.links if x.v.start <= k < x.v.stop]
    simple = all(x.q.stop - x.q.start == x.v.stop - x.v.start for x in links)
    if not at_rest.is_zero() or casadi.depends_on(row.E, q) or not simple:
        return None
    moved = zip(columns, links, strict=True)
    return sum((row.E[0, k] * q[x.q.start + k - x.v.start] for k, x in moved), SX(0))


def _require_unread(system: System, part: AttachedPart) -> None:
    """Refuse sensors that read wrenches of joints where contacts act between points."""
    for attached in system.sensors if part.frames else ():
        if attached.joint is not None:
            raise ModelError(
                f"{system.name}: sensor {attached.sensor.name} reads the forces in a joint, which"
                f" do not know yet what {type(part.element).__name__} {part.name} does at its"
                " points; let it act on coordinates, or leave the sensor out"
            )


def _stack(values: Iterable[SX]) -> SX:
    return SX(casadi.densify(casadi.vertcat(SX(0, 1), *values)))


def _column(elements: Sequence[ContactElement | None], *names: str) -> SX:
    """(k, 1) the first of some fields that the elements have, zero where there is none."""
    values = []
    for element in elements:
        found = [getattr(element.law, name, None) for name in names] if element else []
        values.append(SX(next((x for x in found if x is not None), 0)))
    return _stack(values)


# Accelerations of a system some of whose coordinates contacts constrain.


def switched_dynamics(system: System, driven: tuple[int, ...]) -> Function:
    """``switched_dynamics(q, v, tau, a_p, acting) -> a, tau_p, inertia``: hybrid, with switches.

    Args:
        system: open or closed, with contacts; all coordinates are those of the tree.
        driven: indices of the velocities that drives move.

    Returns:
        Function of q (nq, 1), v and tau (nv, 1), the accelerations a_p (m + k, 1) of drives and of
        the rows of contacts, and acting (m + k, 1), 1 where a_p is given and 0 where the row is
        free; a (nv, 1), the efforts tau_p (m + k, 1) that make a_p, and the inertia (k, 1) that
        rows of contacts have against them: of a coordinate its diagonal element of the matrix.
    """
    contacts = contacts_of(system)

    def build() -> tuple[Named, Named]:
        s, k = symbols_of(system, "tree"), len(driven) + len(contacts)
        tau, a_p, acting = SX.sym("tau", system.nv), SX.sym("a_p", k), SX.sym("acting", k)
        rows = contacts.scaled_rows(s.q)
        E = casadi.vertcat(unit_rows(system, driven), rows)
        every = casadi.vertcat(DM.ones(len(driven)), contacts.sizes)
        a, _, tau_p = constrained_accelerations(
            system, s, tau, surroundings(system), E, a_p / every, acting
        )
        A = inertia_matrix(system.tree, s.poses)
        # a limited link may be massless: what a stop then counts on is a millionth of the others'
        least = SX(1e-6 * inertia_size(system, A, s))
        own = [
            _row_inertia(A, rows[j, :]) / contacts.sizes[j] ** 2 if n is None else A[n, n]
            for j, n in enumerate(contacts.velocities)
        ]
        inertia = casadi.vertcat(*(casadi.fmax(x, least) for x in own))
        inputs: Named = [("q", s.q), ("v", s.v), ("tau", tau), ("a_p", a_p), ("acting", acting)]
        return inputs, [("a", a), ("tau_p", tau_p / every), ("inertia", inertia)]

    return model_function(system, ("switched_dynamics", driven), build)


def _row_inertia(A: SX, row: SX) -> SX:
    """What moves along a row of about unit length at a unit velocity."""
    return SX(casadi.mtimes(row, casadi.mtimes(A, row.T)))


@dataclass(frozen=True, slots=True, eq=False)
class ContactEquations:
    """What contacts make of the equations of motion.

    Attributes:
        contacts: the rows that they act on.
        state: the same in this state.
        values: (2 k, 1) symbols of their modes.
        modes: the same by name.
        a: (nv, 1) accelerations.
        driven: indices of the m velocities that drives move.
        drives: (m, 1) efforts that do so, in their order.
        tau: (nv, 1) joint efforts, those of drives included and those of contacts left out.
        efforts: (2 k, 1) of the stops, then of friction.
        pushes: (nv, 1) the same as joint efforts.
        indicators: (5 k, 1) as of `Contacts.indicators`.
    """

    contacts: Contacts
    state: ContactState
    values: SX
    modes: Modes
    a: SX
    driven: tuple[int, ...]
    drives: SX
    tau: SX
    efforts: SX
    pushes: SX
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
    modes, state = contacts.modes(values), contacts.at(q, v)
    every = SX(tau)
    braked = SX(tau) - casadi.mtimes(state.rows.T, modes.slide * state.sliding)
    m = len(driven)
    given = casadi.vertcat(*driven.values(), -state.bias)
    acting = casadi.vertcat(SX.ones(m), modes.stuck)
    a, made, inertia = outputs_of(
        system, switched_dynamics(system, tuple(driven)), q, v, braked, given, acting
    )
    for row, number in enumerate(driven):
        every[number] += made[row]
    y = made[m:]
    efforts = contacts.efforts(state, modes, y)
    return ContactEquations(
        contacts=contacts,
        state=state,
        values=values,
        modes=modes,
        a=a,
        driven=tuple(driven),
        drives=made[:m],
        tau=every,
        efforts=casadi.vertcat(*efforts),
        pushes=casadi.densify(casadi.mtimes(state.rows.T, efforts[0] + efforts[1])),
        indicators=contacts.indicators(state, modes, y, inertia),
    )


# Impacts on rigid stops, and what else the modes of contacts do at events.


_PULL = 1e-9
"""Part of all impulses below which a pull is rounding."""
_ROUNDS = 8
"""How often at most a wall that pulls is left out, or another one taken in."""


def impact(system: System, driven: tuple[int, ...]) -> Function:
    """``impact(q, dv_p, acting) -> dv, P``: velocities after impulses that change some by dv_p.

    A dv = J' Lambda + E' P with J dv = 0, and dv as given where `acting` is 1.

    Source: Pfeiffer and Glocker 1996, section 6.2.

    Args:
        system: open or closed, with contacts.
        driven: indices of the velocities that drives move.

    Returns:
        Function of q (nq, 1), dv_p and acting (m + k, 1), of drives and of the rows of contacts;
        dv (nv, 1) and P (m + k, 1) [N m s or N s].
    """
    contacts = contacts_of(system)

    def build() -> tuple[Named, Named]:
        s, k = symbols_of(system, "tree"), len(driven) + len(contacts)
        change, acting = SX.sym("dv_p", k), SX.sym("acting", k)
        E = casadi.vertcat(unit_rows(system, driven), contacts.scaled_rows(s.q))
        every = casadi.vertcat(DM.ones(len(driven)), contacts.sizes)
        A, (J, psi) = inertia_matrix(system.tree, s.poses), loop_rows(system, s)
        right = SX.zeros(system.nv), SX.zeros(psi.numel()), change / every
        dv, _, P = constrained(system, s, (A, J, E), right, acting)
        return [("q", s.q), ("dv_p", change), ("acting", acting)], [("dv", dv), ("P", P / every)]

    return model_function(system, ("impact", driven), build)


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
    w = contacts.velocity(q, v)
    speed = wall * w
    met = wall**2 * (speed >= 0)
    back = contacts.restitution * speed
    back = casadi.if_else(back > contacts.rest_speed, back, 0)
    wall = casadi.if_else(met, wall, modes.limit)
    change = casadi.if_else(met, -wall * back, 0) - w
    dv, touches = _unilateral(system, contacts, (q, v), (wall, change), driven)
    impact_now = casadi.mmax(met)
    after = v + impact_now * dv
    left = contacts.velocity(q, after)
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
    function, E = impact(system, driven), contacts.rows(q)

    def after(acting: SX) -> tuple[SX, SX]:
        given = casadi.vertcat(SX.zeros(m), change), casadi.vertcat(SX.ones(m), acting)
        dv, P = outputs_of(system, function, q, *given)
        return dv, P[m:]

    part = there = wall**2
    stops = sum(stop is not None for stop in contacts.stops)
    for _ in range(min(2 * (stops - 1), _ROUNDS)):
        dv, P = after(part)
        pulls = part * (wall * P > _PULL * casadi.sum1(casadi.fabs(P)))
        enters = (there - part) * (wall * (casadi.mtimes(E, dv) - change) > CREEP)
        wrong = pulls + enters
        first = wrong * (casadi.cumsum(wrong) == 1)
        part = part + first * (1 - 2 * part)
    leaving = -wall * contacts.velocity(q, v + after(part)[0])
    part = casadi.fmax(part, there * (leaving <= contacts.rest_speed))
    return after(part)[0], part
