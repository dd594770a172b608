"""Rigid stops and Coulomb friction as contacts: modes, accelerations, impacts.

Modes are constant between events. Every contact has two modes: its limit (-1 at the lower limit, 1
at the upper limit, 0 between) and its direction of sliding (-1 or 1, 0 for sticking).

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
from mbs.assembly.component_instances import ComponentInstance
from mbs.assembly.model_function import Named, model_function
from mbs.assembly.tables import EFFORT_UNIT
from mbs.assembly.tree import position_rate, quaternion_slices
from mbs.components.custom import Friction, OneWay, Stop
from mbs.errors import ModelError
from mbs.models._direct_dynamics import are_independent
from mbs.models.constrained_accelerations import (
    constrained,
    constrained_accelerations,
    inertia_size,
    loop_rows,
    unit_rows,
)
from mbs.models.symbols import outputs_of, surroundings, symbols_of
from mbs.recursions.composite_body import inertia_matrix
from mbs.recursions.parts import PartsAt

Array = NDArray[np.float64]

CREEP = 1e-10
"""Velocity below which a contact counts as being at rest [rad/s or m/s]."""
_BEYOND = 1e-9
"""Rounding tolerance on a start beyond a limit [rad or m]; relative if the limit exceeds 1."""
_ADHESION = 1e-9
"""Tolerance on the acceleration by which a contact pulls before it opens [rad/s^2 or m/s^2]."""
_CONFIGURATIONS, _SEED = 4, 20261124
"""Number and seed of random configurations at which typical moment arms of a row are sampled: an
arm that vanishes at one configuration is found at another."""
KINDS = ("lower", "upper", "pulled", "pushed", "stopped")
"""Event indicators of a contact: it reaches its lower or upper limit, the effort that holds it is
too negative or too positive, or sliding stops."""


@dataclass(frozen=True, slots=True, eq=False)
class Modes:
    """Contact modes of the k rows of `Contacts`.

    Attributes:
        limit: (k, 1) -1 at the lower limit, 1 at the upper limit, 0 between.
        slide: (k, 1) direction of sliding against Coulomb friction (-1 or 1), 0 for no sliding.
        stuck: (k, 1) 1 if the row is held, at a limit or by friction; 0 if it moves freely.
    """

    limit: SX
    slide: SX
    stuck: SX


@dataclass(frozen=True, slots=True, eq=False)
class ContactElement:
    """Dry friction, rigid stop or freewheel of a component.

    Attributes:
        part: component that has the element.
        label: name of the element within the component, or an empty text.
        law: contact law.
        unit: unit of the contact effort.
    """

    part: ComponentInstance
    label: str
    law: Friction | Stop | OneWay
    unit: str

    @property
    def name(self) -> str:
        """Name of the component, followed by the label if it is not empty."""
        return f"{self.part.name}.{self.label}" if self.label else self.part.name

    @property
    def sides(self) -> tuple[bool, bool]:
        """Whether the element has a lower limit, and whether it has an upper limit."""
        if isinstance(self.law, Stop):
            return self.law.lower is not None, self.law.upper is not None
        return isinstance(self.law, OneWay), False


@dataclass(frozen=True, slots=True, eq=False)
class ContactState:
    """Kinematics and friction limits of the k contact rows at positions q and velocities v.

    Attributes:
        rows: (k, nv) Jacobian E of the contact velocities.
        velocity: (k, 1) slip velocities and gap rates, w = E v + w0; w0 is for instance the speed
            of a belt.
        bias: (k, 1) acceleration terms without a: dw/dt = E a + bias.
        measure: (k, 1) quantity that the stop limits: gap, or velocity of a freewheel. Zero for a
            row with friction only.
        sliding, sticking: (k, 1) friction effort during sliding, and largest effort of sticking.
    """

    rows: SX
    velocity: SX
    bias: SX
    measure: SX
    sliding: SX
    sticking: SX


@dataclass(frozen=True, slots=True, eq=False)
class Contacts:
    """Contact rows of a system: k velocities on each of which friction, a stop or both act.

    Rows of single coordinates come first, in the order of v. Other rows follow by component.

    Attributes:
        names: name of the coordinate or of the contact element of each row.
        velocities: index in v if the row is a single coordinate, else None.
        positions: index in q if the gap of the row is a single coordinate, else None.
        groups: group index of each row; rows with equal E share it.
        levers: (k, nv) typical magnitudes of the elements of E.
        stops, frictions: stop and friction of each row, None if the row has none.
        bounds: lower limits (k, 1) and upper limits (k, 1); zero if not set.
        has_lower, has_upper, has_friction: (k, 1) 1 if the row has this limit or friction, else 0.
        has_gap: (k, 1) 1 for a stop with a gap, 0 for a freewheel or no stop.
        restitution, rest_speed: (k, 1) parameters of the stops; zero without a stop.
        anchors: for each row an expression in `q` whose time derivative is the contact velocity;
            None if no such expression is known.
        q, v: symbols of `state` and `anchors`.
        state: contact state at these symbols.
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

    @property
    def elements(self) -> tuple[tuple[int, ContactElement], ...]:
        """Index (among the 2 k modes, or the 2 k efforts) of each stop, then of each friction."""
        every = enumerate((*self.stops, *self.frictions))
        return tuple((k, element) for k, element in every if element is not None)

    def at(self, q: SX, v: SX) -> ContactState:
        """Return the contact state at positions and velocities.

        Args:
            q: (nq, 1) positions.
            v: (nv, 1) velocities.
        """
        names = [field.name for field in fields(ContactState)]
        values = [getattr(self.state, name) for name in names]
        put = casadi.substitute(values, [self.q, self.v], [casadi.densify(q), casadi.densify(v)])
        return ContactState(**dict(zip(names, put, strict=True)))

    def rows(self, q: SX) -> SX:
        """Return the Jacobian E (k, nv) of the contact velocities at positions q (nq, 1)."""
        (E,) = casadi.substitute([self.state.rows], [self.q], [casadi.densify(q)])
        return SX(E)

    @property
    def sizes(self) -> DM:
        """(k, 1) typical norms of the rows of E; 1 for a row of a single coordinate.

        Equations that compare rows scale them by these constants. Because they do not depend on q,
        a scaled row still vanishes in a configuration in which its moment arm vanishes.
        """
        return DM(np.linalg.norm(self.levers, axis=1))

    def scaled_rows(self, q: SX) -> SX:
        """Return the Jacobian E (k, nv) at positions q (nq, 1), with scaled rows.

        Each row is divided by its typical norm in `sizes`.
        """
        return casadi.mtimes(casadi.diag(1 / self.sizes), self.rows(q))

    def velocity(self, q: SX, v: SX) -> SX:
        """Return the slip velocities and gap rates (k, 1) at positions q and velocities v."""
        return self.at(q, v).velocity

    def modes(self, values: SX) -> Modes:
        """Return the modes in a vector (2 k, 1): k limits, then k sliding directions.

        `stuck` follows from them.

        Args:
            values: (2 k, 1) mode vector.
        """
        limit, slide = values[: len(self)], values[len(self) :]
        sticks = self.has_friction * (slide == 0)
        return Modes(limit, slide, casadi.fmax(limit**2, sticks))

    def first(self, q: SX, v: SX) -> tuple[SX, SX]:
        """Return the initial modes: rows at rest at a limit are in contact, moving rows slide.

        Only rows with friction slide.

        Args:
            q: (nq, 1) positions.
            v: (nv, 1) velocities.

        Returns:
            modes (2 k, 1); then penetrations (2 k, 1) below the lower and above the upper limits,
            less the rounding tolerance. A positive value means that the start violates a limit.
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
        """Return the difference (k, 1) between each gap and its active limit; zero between limits.

        Args:
            q: (nq, 1) positions.
            limit: (k, 1) active limit of each row: -1 lower, 1 upper, 0 none.
        """
        if not any(stop is not None for stop in self.stops):
            return SX.zeros(len(self))
        gap = self.has_gap * self.at(q, SX.zeros(self.v.numel())).measure
        return casadi.if_else(limit == 0, 0, gap - casadi.if_else(limit < 0, *self.bounds))

    def efforts(self, state: ContactState, modes: Modes, y: SX) -> tuple[SX, SX]:
        """Return the efforts of stops and of friction, (k, 1) each.

        Friction gets the holding effort up to its sticking limit, the stop the remainder: rigid
        bodies leave this split undetermined.

        Args:
            state: current contact state.
            modes: current modes.
            y: (k, 1) efforts that hold the rows.
        """
        taken = casadi.fmax(casadi.fmin(y, state.sticking), -state.sticking)
        friction = casadi.if_else(modes.stuck, taken, -modes.slide * state.sliding)
        return modes.stuck * (y - taken), friction

    def indicators(self, state: ContactState, modes: Modes, y: SX, inertia: SX) -> SX:
        """Return the event indicators (5 k, 1) of k contact rows, positive between events.

        They are k indicators each of: lower limit, upper limit, holding effort too negative, too
        positive, end of sliding (`KINDS`).

        Args:
            state: current contact state.
            modes: current modes.
            y: (k, 1) efforts that hold the rows.
            inertia: (k, 1) effective inertia of each row against y.
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
    """Return the contact rows of the rigid stops and dry frictions of a system (cached).

    Raises:
        ModelError: two stops act on one coordinate, or a sensor measures a force that contact
            efforts between points change.
    """
    found: Contacts = system.cached("contacts", lambda: _contacts(system))
    return found


def require_no_contacts(system: System, what: str) -> None:
    """Raise if a system has rigid stops, Coulomb friction or events.

    Args:
        system: open or closed mechanism.
        what: name of the function that does not support them, for the error message.

    Raises:
        ModelError: the message names the element and the remedy.
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
    """Raise if a prescribed motion determines the velocity of a contact row.

    Args:
        system: open or closed mechanism.
        contacts: contact rows of the system.
        driven: indices of the velocities whose motion is prescribed.

    Raises:
        ModelError: the message names the contact and the remedy.
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
    """Return whether contact row j is independent of the prescribed velocities `driven`.

    The rank is tested at the assembled configuration.
    """
    number = contacts.velocities[j]
    if number is not None:
        return are_independent(system, (*driven, number))
    E = Function("E", [contacts.q, system.p], [contacts.state.rows[j, :]])
    row = np.array(E(np.array(system.configuration), system.p_default)).reshape(1, -1)
    return are_independent(system, tuple(driven), row)


def require_lasting_rows(system: System, contacts: Contacts) -> None:
    """Raise if there are contacts and the independent closure rows vary with the configuration.

    Args:
        system: open or closed mechanism.
        contacts: contact rows of the system.

    Raises:
        ModelError: the message names the contact and the remedy.
    """
    if len(contacts) and system.closure is not None and system.closure.varies:
        raise ModelError(
            f"{system.name}: the independent rows of its loops change with the configuration, which"
            f" the contact on {contacts.names[0]} does not follow; use a JointStop or"
            " JointFriction there"
        )


@dataclass(slots=True, eq=False)
class _ContactRow:
    """Contact row under construction.

    Attributes:
        velocity: (1, 1) contact velocity.
        E: (1, nv) its Jacobian.
        key: identifies equal rows; rows with equal constant E share one.
        number: index in v if the row is a single coordinate, else None.
        stop, friction: elements on this row.
    """

    velocity: SX
    E: SX
    key: tuple[Any, ...]
    number: int | None
    stop: ContactElement | None = None
    friction: ContactElement | None = None

    @property
    def element(self) -> ContactElement:
        """Stop of the row, or else its friction."""
        found = self.stop or self.friction
        assert found is not None
        return found


def _contacts(system: System) -> Contacts:
    """Return the stops, freewheels and dry frictions of all components as contact rows."""
    q, v = SX.sym("q", system.nq), SX.sym("v", system.nv)
    at = PartsAt(system, q, v)
    found = list[_ContactRow]()
    for part in system.parts:
        if part.element.switches and part.name not in system.node_frictions:
            seen = at.at(part)
            laws = [*part.element.stops(seen).items(), *part.element.frictions(seen).items()]
            for label, law in laws:
                _require_no_wrench_sensor(system, part)
                element = ContactElement(part, label, law, effort_unit(part, law))
                _collect(system, found, element, q, v)
    found.sort(key=lambda row: system.nv if row.number is None else row.number)
    stops, frictions = (tuple(getattr(row, x) for row in found) for x in ("stop", "friction"))
    measures = [_gap_or_velocity(row) for row in found]
    rows = SX(casadi.vertcat(SX(0, system.nv), *(row.E for row in found)))
    velocity = _stack(row.velocity for row in found)
    return Contacts(
        names=tuple(
            row.element.name if row.number is None else system.velocity_coordinates[row.number].name
            for row in found
        ),
        velocities=tuple(row.number for row in found),
        positions=tuple(_index(measure, q) for measure in measures),
        groups=tuple([row.key for row in found].index(row.key) for row in found),
        levers=_largest_jacobian(system, found, rows, q),
        stops=stops,
        frictions=frictions,
        bounds=(_law_column(stops, "lower"), _law_column(stops, "upper")),
        has_lower=DM([float(x is not None and x.sides[0]) for x in stops]),
        has_upper=DM([float(x is not None and x.sides[1]) for x in stops]),
        has_friction=DM([float(x is not None) for x in frictions]),
        has_gap=DM([float(x is not None and isinstance(x.law, Stop)) for x in stops]),
        restitution=_law_column(stops, "restitution"),
        rest_speed=_law_column(stops, "rest_speed"),
        anchors=tuple(_row_integral(system, row, q, v) for row in found),
        q=q,
        v=v,
        state=ContactState(
            rows=rows,
            velocity=velocity,
            bias=SX(casadi.densify(casadi.jtimes(velocity, q, position_rate(system.tree, q, v)))),
            measure=_stack(SX(0) if x is None else x for x in measures),
            sliding=_law_column(frictions, "limit"),
            sticking=_law_column(frictions, "sticking", "limit"),
        ),
    )


def effort_unit(part: ComponentInstance, law: Friction | Stop | OneWay) -> str:
    """Return the unit of a contact effort: that of the law, else of the coordinate, else N.

    Args:
        part: component that has the contact.
        law: contact law.
    """
    if law.unit is not None:
        return law.unit
    return EFFORT_UNIT[part.levers[0].unit] if part.levers and not part.frames else "N"


def _collect(
    system: System, rows: list[_ContactRow], element: ContactElement, q: SX, v: SX
) -> None:
    """Add a contact element to a row in `rows` with equal Jacobian, or append a row, in place.

    `q` and `v` are the symbols. A row has at most one stop and one friction. Raise ModelError if
    nothing moves the element, or two stops act on one coordinate.
    """
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
                f" {system.velocity_coordinates[number or 0].name}; give one {word} for a"
                " coordinate"
            )
        row = _ContactRow(w, E, key, number)
        rows.append(row)
    setattr(row, kind, element)


def contact_velocity(system: System, law: Friction | Stop | OneWay, q: SX, v: SX) -> SX:
    """Return the contact velocity (1, 1): slip of a friction, gap rate, or freewheel velocity.

    Args:
        system: open or closed mechanism.
        law: contact law.
        q: (nq, 1) symbols of positions.
        v: (nv, 1) symbols of velocities.
    """
    if isinstance(law, Stop):
        return SX(casadi.jtimes(SX(law.gap), q, position_rate(system.tree, q, v)))
    return SX(law.slip if isinstance(law, Friction) else law.velocity)


def _largest_jacobian(system: System, found: Sequence[_ContactRow], rows: SX, q: SX) -> Array:
    """Return the largest absolute elements (k, nv) of the contact rows over configurations.

    These are the assembled configuration and random ones. `rows` are the rows at the symbols q.
    """
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
            levers[j] = 1.0  # no sample is finite and nonzero: assume unit moment arms
    return levers


def _gap_or_velocity(row: _ContactRow) -> SX | None:
    """Return the gap of a stop or the velocity of a freewheel in a row; None without either."""
    if row.stop is None:
        return None
    law = row.stop.law
    return SX(law.gap) if isinstance(law, Stop) else row.velocity


def _index(value: SX | None, q: SX) -> int | None:
    """Return the index in q of an expression that is a single position; None for any other."""
    if value is None:
        return None
    elements = casadi.vertsplit(q) if q.numel() else []
    return next((k for k, x in enumerate(elements) if casadi.is_equal(x, value)), None)


def _row_integral(system: System, row: _ContactRow, q: SX, v: SX) -> SX | None:
    """Return an expression (1, 1) of q whose rate is the velocity of a contact row.

    For a rigid stop it is the gap. None if no such expression is known. `q` and `v` are the symbols
    of the row.
    """
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


def _require_no_wrench_sensor(system: System, part: ComponentInstance) -> None:
    """Raise ModelError if a sensor measures joint wrenches and `part` has contacts on points."""
    for attached in system.sensors if part.frames else ():
        if attached.joint is not None:
            raise ModelError(
                f"{system.name}: sensor {attached.sensor.name} reads the forces in a joint, which"
                f" do not know yet what {type(part.element).__name__} {part.name} does at its"
                " points; let it act on coordinates, or leave the sensor out"
            )


def _stack(values: Iterable[SX]) -> SX:
    """Return values as one dense column (k, 1)."""
    return SX(casadi.densify(casadi.vertcat(SX(0, 1), *values)))


def _law_column(elements: Sequence[ContactElement | None], *names: str) -> SX:
    """Return one value (k, 1) per contact element: the first field in `names` that is not None.

    The field is that of the law of the element. The value is 0 if there is none, or if the entry of
    `elements` is None.
    """
    values = []
    for element in elements:
        found = [getattr(element.law, name, None) for name in names] if element else []
        values.append(SX(next((x for x in found if x is not None), 0)))
    return _stack(values)


# Accelerations of a system with closed contacts.


def switched_dynamics(system: System, driven: tuple[int, ...]) -> Function:
    """Return the hybrid dynamics with contact rows that can be switched on and off.

    It is ``switched_dynamics(q, v, tau, a_p, acting) -> a, tau_p, inertia``.

    The m prescribed velocities and the k contact rows are constraints that inputs switch on or off.

    Args:
        system: open or closed, with contacts; all coordinates are tree coordinates.
        driven: indices of the m velocities with prescribed motion.

    Returns:
        Function of q (nq, 1), v and tau (nv, 1), accelerations a_p (m + k, 1) of the prescribed
        velocities and contact rows, and acting (m + k, 1): 1 if a_p is imposed, 0 if the row is
        free. Outputs: a (nv, 1), efforts tau_p (m + k, 1) that impose a_p, and the effective
        inertia (k, 1) of the contact rows. For a coordinate: diagonal element of the mass matrix.
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
        # lower bound of the effective inertia, for stops on massless links: 1e-6 of the mean
        # diagonal element of the mass matrix
        least = SX(1e-6 * inertia_size(system, A, s))
        own = [
            A[n, n]
            if n is not None
            else casadi.mtimes(rows[j, :], casadi.mtimes(A, rows[j, :].T)) / contacts.sizes[j] ** 2
            for j, n in enumerate(contacts.velocities)
        ]
        inertia = casadi.vertcat(*(casadi.fmax(x, least) for x in own))
        inputs: Named = [("q", s.q), ("v", s.v), ("tau", tau), ("a_p", a_p), ("acting", acting)]
        return inputs, [("a", a), ("tau_p", tau_p / every), ("inertia", inertia)]

    return model_function(system, ("switched_dynamics", driven), build)


@dataclass(frozen=True, slots=True, eq=False)
class ContactEquations:
    """Equations of motion with contacts, as expressions in the state and in mode symbols.

    Attributes:
        contacts: contact rows.
        state: contact state at the positions and velocities of the equations.
        values: (2 k, 1) symbols of the modes.
        modes: the modes as named vectors.
        a: (nv, 1) accelerations.
        driven: indices of the m velocities with prescribed motion.
        drives: (m, 1) efforts that impose this motion, in the order of `driven`.
        tau: (nv, 1) joint efforts including `drives`, without contact efforts.
        efforts: (2 k, 1) efforts of the stops, then of friction.
        pushes: (nv, 1) joint efforts equivalent to `efforts`.
        indicators: (5 k, 1) event indicators, see `Contacts.indicators`.
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
    """Return accelerations, efforts and event indicators under contacts; None without contacts.

    Args:
        system: open or closed mechanism.
        q: (nq, 1) positions.
        v: (nv, 1) velocities of the tree.
        tau: (nv, 1) joint efforts.
        driven: prescribed accelerations, by index of the velocity.

    Raises:
        ModelError: a contact is not supported, see `contacts_of`.
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


# Impacts on rigid stops, and mode changes at events.


_PULL = 1e-9
"""Fraction of the sum of all impulses below which a pulling impulse counts as rounding error."""
_ROUNDS = 8
"""Maximum number of pivots, each of which releases a pulling stop or adds a penetrated stop."""


def impact(system: System, driven: tuple[int, ...]) -> Function:
    """Return the velocity jump by impulses on chosen velocities.

    It is ``impact(q, dv_p, acting) -> dv, P``.

    Solves A dv = J' Lambda + E' P with J dv = 0, and with E dv = dv_p on the rows whose `acting` is
    1. A is the mass matrix, J the closure Jacobian, E the rows of prescribed and contact
    velocities.

    Source: Pfeiffer and Glocker 1996, section 6.2.

    Args:
        system: open or closed, with contacts.
        driven: indices of the m velocities with prescribed motion.

    Returns:
        Function of q (nq, 1), dv_p and acting (m + k, 1), for the prescribed velocities and the
        contact rows; dv (nv, 1) and impulses P (m + k, 1) [N m s or N s].
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
    """Return the state of the tree and the modes after an event; see `jump`.

    Args:
        system: open or closed mechanism.
        contact: contact equations; their prescribed velocities do not jump.
        x: state [q; v; z] before the event, z the component states.
        fired: (5 k, 1) 1 for each event indicator that is not positive, else 0.

    Returns:
        x and modes (2 k, 1) after the event.
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
    """Return the velocities and modes after an event.

    An impact has priority. Each stop that is reached reverses its velocity by the restitution, and
    closed stops stay closed, unless the impulse would have to pull. Friction has no impulse; a row
    that moves after the impact slides. Without an impact, the fired indicators make contacts open,
    stick or slide.

    Args:
        system: open or closed mechanism.
        contacts: contact rows of the system.
        modes: modes before the event.
        motion: q (nq, 1) and v (nv, 1) before the event, and fired (5 k, 1): 1 for each event
            indicator that is not positive, else 0.
        driven: indices of prescribed velocities, which do not jump.

    Returns:
        v (nv, 1) and modes (2 k, 1) after the event.
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
    """Return the velocity jump by impulses of stops that only push, and the stops that act.

    A stop that would have to pull is released, unless the row would separate more slowly than the
    slowest rebound: several contacts could otherwise push each other off without end. With very
    many coupled stops, a row that still approaches its stop causes another impact.

    Source: Murty 1974 (least-index pivoting), for the next stop to release or add.

    Args:
        system: open or closed mechanism.
        contacts: contact rows of the system.
        motion: q (nq, 1) and v (nv, 1) before the impact.
        targets: sides (k, 1): -1 for a lower stop, 1 for an upper stop, 0 for none; and required
            velocity changes (k, 1) at the stops.
        driven: indices of prescribed velocities, which do not jump.

    Returns:
        dv (nv, 1), and flags (k, 1) that are 1 for each stop that acts.
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
