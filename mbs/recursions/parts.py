"""Equations of components evaluated in a tree: loads, energy, rates, constraint rows, signals.

Methods of a component receive an `At`: motion of its ports at positions q and velocities v, and the
values of its parameters, states and inputs. Wires connect outputs to inputs.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import casadi
from casadi import DM, SX

from mbs.assembly import System
from mbs.assembly.component_instances import ComponentInstance, WireSource
from mbs.assembly.tables import AttachedSensor
from mbs.assembly.tree import Frame, position_rate
from mbs.components.contact import Contact
from mbs.components.custom import (
    Approach,
    At,
    CoordinateAt,
    FlangeAt,
    FrameAt,
    FrameLoad,
    Load,
    RelativeMotion,
    Row,
)
from mbs.errors import AssemblyError
from mbs.expressions import to_sx
from mbs.recursions.link_motions import Velocity, link_poses, link_velocities
from mbs.recursions.readings import Readings, coordinate_readings, frame_readings
from mbs.recursions.route import BASE, relative_motion
from mbs.spatial import Pose, cross, skew

UNBOUNDED = 1e100
"""Speed bound of a crossing without a bound: far above all speeds, and a finite number in C."""
_MOST_READINGS = 1000
"""Number of sensor symbols that a system caches: more than a mechanism has wires."""
_ENDING = ("mbs.components.sources",)
"""Modules of discontinuous laws, whose crossings end integration steps also in FMUs."""


def later_signal(system: System, source: WireSource) -> SX:
    """Return the symbol of a sensor signal that depends on accelerations or forces.

    `with_readings` of `mbs.models._measurements` substitutes its value in rates and outputs.

    Args:
        system: system that caches the symbol.
        source: sensor and signal.
    """
    symbol: SX = system.memoised("readings", source, lambda: SX.sym(str(source)), _MOST_READINGS)
    return symbol


def later_sources(system: System) -> list[WireSource]:
    """Return the sensor signals of accelerations or forces that are wired to component inputs.

    Args:
        system: system with the components and sensors.
    """
    sensors = {attached.sensor.name: attached for attached in system.sensors}
    wired = [s for part in system.parts for s in part.inputs.values() if isinstance(s, WireSource)]
    return [
        source
        for source in dict.fromkeys(wired)
        if source.owner in sensors
        and _is_later(sensors[source.owner], source.signal.partition(".")[0])
    ]


def _is_later(attached: AttachedSensor, name: str) -> bool:
    """Return whether the signal `name` of a sensor depends on accelerations or forces.

    These are computed after the signals of positions and velocities.
    """
    if attached.sensor.reads in ("absolute", "relative"):
        return name in ("a", "wd")
    return name == "a" if attached.sensor.reads == "coordinate" else attached.joint is not None


class PartsAt:
    """Components of a system, evaluated at positions and velocities of its tree.

    Args:
        system: system with the components.
        q: (nq, 1) positions.
        v: (nv, 1) velocities; zero by default.
        shifts: additional displacements of ports on coordinates, by port; zero by default.
        twists: (6, 1) additional velocities of frames, by port, in their own axes; zero by default.
    """

    def __init__(
        self,
        system: System,
        q: SX,
        v: SX | None = None,
        *,
        shifts: Mapping[str, SX] | None = None,
        twists: Mapping[str, SX] | None = None,
    ) -> None:
        self.system, self.q, self.v = system, q, v
        self.tree, self.parts = system.tree, system.parts
        self._shifts, self._twists = shifts or {}, twists or {}
        self._moving: list[Velocity] | None = None
        # caches by component name: arguments, loads, symbols of row efforts, outputs
        self._found: dict[str, At] = {}
        self._loads: dict[str, Mapping[str, Load]] = {}
        self._efforts: dict[str, dict[str, SX]] | None = None
        self._outputs: dict[str, tuple[Mapping[str, SX], Mapping[str, SX]]] = {}
        # cache by source of a wire; None during evaluation, to detect cycles
        self._signals: dict[WireSource, SX | None] = {}

    @property
    def moving(self) -> list[Velocity] | None:
        """Velocity of each link in its frame; None if no velocities are given."""
        if self._moving is None and self.v is not None:
            self._moving = link_velocities(self.tree, link_poses(self.tree, self.q), self.v)
        return self._moving

    # Arguments of the methods of components.

    def at(self, part: ComponentInstance) -> At:
        """Return the argument `at` of the methods of a component, with inputs from its wires.

        Args:
            part: component of the system.
        """
        if part.name not in self._found:
            self._found[part.name] = self._values_at(part, self._inputs_of(part))
        return self._found[part.name]

    def with_inputs(self, part: ComponentInstance, inputs: Mapping[str, SX]) -> At:
        """Return the argument `at` of the methods of a component, with given input values.

        Args:
            part: component of the system.
            inputs: value of each input, by name.
        """
        return self._values_at(
            part, {name: partial(_identity, value) for name, value in inputs.items()}
        )

    def _inputs_of(self, part: ComponentInstance) -> Mapping[str, Callable[[], SX]]:
        """Return a function that evaluates the wired signal of each input, by input name."""
        return {name: partial(self._input, part, name) for name in part.inputs}

    def _values_at(self, part: ComponentInstance, inputs: Mapping[str, Callable[[], Any]]) -> At:
        """Return the argument `at` of the methods of a component.

        `inputs` are functions that evaluate its inputs, by name.
        """
        element, values = part.element, dict[str, Callable[[], Any]](inputs)
        # ports on points of bodies
        frames = dict(zip(element.frames, part.frames, strict=True))
        for port in frames:
            values[port] = partial(self._frame, port, frames)
        # ports on coordinates, and unknowns
        for port in part.coordinates:
            values[port] = partial(self._coordinate, part, port)
        # numbers
        for name in element.names_of("parameter"):
            given = getattr(element, name)
            values[name] = (
                partial(_identity, None) if given is None else partial(to_sx, given, part.symbols)
            )
        for name, symbol in part.states.items():
            values[name] = partial(_identity, symbol)
        return At(part.name, part.symbols, values)

    def _frame(self, port: str, frames: Mapping[str, Frame]) -> FrameAt:
        """Return the motion of the frame of a port.

        `frames` are all frames of the component by port.
        """
        return FrameAt(port, lambda seen_from: self._relative(seen_from, port, frames))

    def _relative(
        self, seen_from: FrameAt | None, port: str, frames: Mapping[str, Frame]
    ) -> RelativeMotion:
        """Return the motion of the frame of a port relative to that of another port.

        The other port is `seen_from`, or the base. `frames` are all frames of the component by
        port.
        """
        a = BASE if seen_from is None else frames[seen_from.port]
        motion = relative_motion(self.tree, a, frames[port], self.q, self.moving)
        if not self._twists:
            return motion
        zero = SX.zeros(6)
        t_a = zero if seen_from is None else self._twists[seen_from.port]
        t_b, R = self._twists[port], motion.R
        V = motion.V + casadi.mtimes(R, t_b[:3]) - t_a[:3] - cross(t_a[3:], motion.p)
        return RelativeMotion(motion.p, R, V, motion.w + casadi.mtimes(R, t_b[3:]) - t_a[3:])

    def _coordinate(self, part: ComponentInstance, port: str) -> CoordinateAt | FlangeAt | SX:
        """Return position and velocity of the coordinate that a port of a component acts on.

        For an unknown, return its position only.
        """
        levers = part.coordinates[port]
        q: SX | None = self._shifts.get(port, SX(0))
        for lever in levers:
            if q is not None:
                at = lever.position
                q = None if at is None else q + lever.factor * self.q[at]
        v = SX(0)
        if self.v is not None:
            v = sum((lever.factor * self.v[lever.velocity] for lever in levers), SX(0))
        kind = part.element.declared[port].kind if port in part.element.declared else "coordinate"
        if kind == "flange":
            assert q is not None
            return FlangeAt(q, v)
        if kind == "unknown":
            assert q is not None
            return q
        return CoordinateAt(q, v, levers[0].unit.removesuffix("/s") if levers else "rad")

    # Signals.

    def _input(self, part: ComponentInstance, name: str) -> SX:
        """Return the signal or constant (1, 1) that is wired to an input of a component."""
        given = part.inputs[name]
        return given if isinstance(given, SX) else self.signal(given)

    def signal(self, source: WireSource) -> SX:
        """Return the signal of a wire: a state or output of a component, or a sensor signal.

        Args:
            source: component or sensor, and its signal.

        Raises:
            AssemblyError: the signal depends on itself, or on forces that the equations of motion
                determine.
        """
        for attached in self.system.sensors:
            if attached.sensor.name == source.owner:
                return self._sensor_signal(attached, source)
        if source in self._signals:
            found = self._signals[source]
            if found is None:
                ring = [str(one) for one, value in self._signals.items() if value is None]
                ring = ring[ring.index(str(source)) :]
                raise AssemblyError(
                    f"wires form the ring {' -> '.join([*ring, str(source)])}, in which a signal"
                    " follows from itself; put a component into it whose output is made of states"
                    " alone, or take a wire away"
                )
            return found
        part = next(part for part in self.parts if part.name == source.owner)
        if source.signal in part.states:
            return part.states[source.signal]
        self._signals[source] = None
        outputs, placeholders = self._with_placeholders(part)
        value = outputs[source.signal]
        if part.element.binds and casadi.depends_on(value, self.effort_symbols):
            raise AssemblyError(
                f"a wire comes from {source}, which follows from the forces that the motion itself"
                " determines; wire what positions, velocities and states give"
            )
        for name, symbol in placeholders.items():
            if casadi.depends_on(value, symbol):
                value = casadi.substitute(value, symbol, self._input(part, name))
        self._signals[source] = value
        return value

    def _with_placeholders(
        self, part: ComponentInstance
    ) -> tuple[Mapping[str, SX], Mapping[str, SX]]:
        """Return the outputs of a component in symbols of its inputs, and these symbols.

        By name.
        """
        if part.name not in self._outputs:
            symbols = {name: SX.sym(name) for name in part.inputs}
            seen = self.with_inputs(part, symbols)
            seen.__dict__["lam"] = self.row_efforts().get(part.name, {})
            self._outputs[part.name] = part.element.outputs(seen), symbols
        return self._outputs[part.name]

    def _sensor_signal(self, attached: AttachedSensor, source: WireSource) -> SX:
        """Return a sensor signal (1, 1); a symbol if it depends on accelerations or forces.

        Raise AssemblyError if the sensor measures a joint at which a loop is cut open.
        """
        sensor = attached.sensor
        name, _, element = source.signal.partition(".")
        readings: Readings = {}
        if sensor.reads == "coordinate":
            tables = self.system.coordinates, self.system.velocity_coordinates
            readings = coordinate_readings(attached.coordinate, tables, self.q, self.v)
        elif sensor.reads in ("absolute", "relative", "distance"):
            readings = frame_readings(self.tree, attached, self.q, self.moving)
        cut = [row.name for row in self.system.cut_coordinates]
        if attached.coordinate in cut or (attached.coordinate and attached.frames):
            raise AssemblyError(
                f"a wire comes from {source}, whose joint {attached.coordinate!r} is cut to open a"
                " loop; cut another joint, or wire from a sensor on one of the others"
            )
        if name not in readings:
            return later_signal(self.system, source)
        quantity = next(q for q in attached.quantities if q.name == name)
        number = quantity.elements.index(element)
        return casadi.vec(readings[name])[number]

    # Loads, energy, rates, events and outputs.

    def loads(self, part: ComponentInstance) -> Mapping[str, Load]:
        """Return the loads of a component on its ports, by port.

        They are returned by its method `loads`, or are minus the derivatives of its energy.

        Args:
            part: component of the system.
        """
        if part.name not in self._loads:
            element = part.element
            if element.has("loads"):
                self._loads[part.name] = element.loads(self.at(part))
            elif element.has("energy"):
                self._loads[part.name] = self.slopes(part, lambda at: -SX(element.energy(at)))
            else:
                self._loads[part.name] = {}
        return self._loads[part.name]

    def slopes(
        self,
        part: ComponentInstance,
        value: Callable[[At], SX],
        inputs: Mapping[str, SX] | None = None,
    ) -> Mapping[str, Load]:
        """Return the derivatives of a scalar by small displacements of the ports, as loads by port.

        Frames are translated and rotated in their own axes, coordinates are displaced; the
        derivatives are forces, moments and efforts. Inputs are constant.

        Source: Haug 1989, the principle of virtual work.

        Args:
            part: component.
            value: callable that returns the scalar (1, 1) as a function of positions.
            inputs: values of the inputs; by default the wired values.
        """
        small = [SX.sym("d", 6) for _ in part.frames]
        frames = tuple(
            (link, pose @ Pose(SX(DM.eye(3)) + skew(d[3:]), d[:3]))
            for (link, pose), d in zip(part.frames, small, strict=True)
        )
        shifts = {port: SX.sym("s") for port in part.coordinates}
        every = casadi.vertcat(SX(0, 1), *small, *shifts.values())
        moved = replace(part, frames=frames)
        nearby = PartsAt(self.system, self.q, shifts=shifts)
        if inputs is None:
            found = value(nearby._values_at(moved, self._inputs_of(part)))
        else:
            found = value(nearby.with_inputs(moved, inputs))
        slopes = casadi.gradient(found, every)
        slopes = casadi.densify(casadi.substitute(slopes, every, SX.zeros(every.numel())))
        result: dict[str, Load] = {}
        for number, port in enumerate(part.element.frames):
            d = slopes[6 * number : 6 * number + 6]
            result[port] = FrameLoad(d[:3], d[3:], own_axes=True)
        first = 6 * len(part.frames)
        return {**result, **{port: slopes[first + k] for k, port in enumerate(shifts)}}

    def loads_of_rows(
        self, part: ComponentInstance, lam: SX, *, velocities: bool = False
    ) -> list[FrameLoad]:
        """Return the loads of constraint rows on the frames of a component.

        Each load is in the axes of the frame, about its origin.

        Args:
            part: component.
            lam: (k, 1) efforts of the rows.
            velocities: whether the rows are velocity constraints (`velocity_rows`).
        """

        def work(at: At) -> SX:
            method = part.element.velocity_rows if velocities else part.element.rows
            return casadi.dot(lam, casadi.vertcat(*(as_row(r).value for r in method(at).values())))

        if not velocities:
            loads = self.slopes(part, work)
            return [self._own_load(loads[port]) for port in part.element.frames]
        # gradient of the power of velocity rows by additional twists of the frames
        twists = {port: SX.sym("t", 6) for port in part.element.frames}
        moved = PartsAt(self.system, self.q, self.v, twists=twists)
        every = casadi.vertcat(*twists.values())
        slopes = casadi.densify(casadi.gradient(work(moved.at(part)), every))
        return [FrameLoad(t[:3], t[3:], own_axes=True) for t in casadi.vertsplit(slopes, 6)]

    @staticmethod
    def _own_load(load: Load) -> FrameLoad:
        """Return the load of a frame port, which the type of `Load` does not distinguish."""
        assert isinstance(load, FrameLoad)
        return load

    def efforts(self) -> SX:
        """Return the joint efforts (nv, 1) that balance the components on coordinates [N m or N].

        Drives are not included.
        """
        total = SX.zeros(self.tree.nv)
        for part in self.parts:
            if part.coordinates and not part.element.drives:
                self._add_efforts(total, part, -1)
        return total

    def delivered(self) -> SX:
        """Return the joint efforts (nv, 1) that drives exert on the coordinates [N m or N]."""
        total = SX.zeros(self.tree.nv)
        for part in self.parts:
            if part.element.drives:
                self._add_efforts(total, part, 1)
        return total

    def _add_efforts(self, total: SX, part: ComponentInstance, sign: int) -> None:
        """Add the efforts of a component on coordinates to `total` (nv, 1) in place, times `sign`.

        `sign` is 1 or -1.
        """
        loads = self.loads(part)
        for port, levers in part.coordinates.items():
            if port in loads:
                load = loads[port]
                assert not isinstance(load, FrameLoad)  # checked at assembly
                own = sign * SX(load)
                for lever in levers:
                    total[lever.velocity] += lever.factor * own

    def energy(self) -> SX:
        """Return the energy [J] that the components store."""
        total = SX(0)
        for part in self.parts:
            if part.element.has("energy"):
                total += part.element.energy(self.at(part))
        return total

    def frame_loads(self, part: ComponentInstance) -> list[tuple[str, Frame, FrameLoad]]:
        """Return (port, frame, load) for each load of a component on a frame.

        Loads are in axes of the frame, about its origin.

        Args:
            part: component of the system.
        """
        loads, result = self.loads(part), []
        for port, frame in zip(part.element.frames, part.frames, strict=True):
            load = loads.get(port)
            if isinstance(load, FrameLoad):
                if not load.own_axes:
                    R = getattr(self.at(part), port).R
                    force, moment = (casadi.mtimes(R.T, x) for x in (load.force, load.moment))
                    load = FrameLoad(force, moment, own_axes=True)
                result.append((port, frame, load))
        return result

    def rates(self) -> SX:
        """Return the rates (nz, 1) of the states of all components; zero for modes."""
        rates = [SX(0, 1)]
        for part in self.parts:
            if part.states:
                found = part.element.rates(self.at(part))
                modes = part.element.names_of("mode")
                rates += [SX(0) if name in modes else SX(found[name]) for name in part.states]
        return casadi.vertcat(*rates)

    def events(self) -> list[PartEvent]:
        """Return the events of all components, in the order of components and labels."""
        found, first = list[PartEvent](), 0
        for part in self.parts:
            if part.element.has("events"):
                index = {name: first + k for k, name in enumerate(part.states)}
                for label, event in part.element.events(self.at(part)).items():
                    then = {index[name]: SX(value) for name, value in event.then.items()}
                    found.append(PartEvent(part.name, label, SX(event.when), then))
            first += len(part.states)
        return found

    def crossings(self, *, of_bends: bool = True) -> list[Approach]:
        """Return indicators of the points at which the laws of components are not smooth.

        The sign of an indicator changes there. An indicator that is given as an expression gets the
        speed 0 and pace 0.

        Args:
            of_bends: whether to include continuous laws of this package with discontinuous
                derivatives, such as curves. Contacts are always included.
        """
        found = list[Approach]()
        for part in self.parts:
            own = type(part.element).__module__
            is_bend = own.startswith("mbs.") and own not in _ENDING
            is_bend = is_bend and not isinstance(part.element, Contact)
            if part.element.has("crossings") and (of_bends or not is_bend):
                for given in part.element.crossings(self.at(part)).values():
                    if not isinstance(given, Approach):
                        given = Approach(SX(given), SX(0), SX(0))
                    found.append(given)
        return found

    def approaches(self, found: Sequence[Approach]) -> SX:
        """Return speed and pace (nc, 2) of each event indicator, see `Approach`.

        A rotating path may return to an obstacle. So the norm of the angular velocities on which
        the rate of an indicator depends is added to its pace.

        Args:
            found: event indicators of `crossings`.
        """
        assert self.v is not None
        rate_q = position_rate(self.tree, self.q, self.v)
        turning = [
            k for k, speed in enumerate(self.system.velocity_coordinates) if speed.unit == "rad/s"
        ]
        rows = [SX(0, 2)]
        for one in found:
            if one.pace.is_zero():
                rows.append(SX.zeros(1, 2))
                continue
            changes = casadi.which_depends(casadi.jtimes(one.value, self.q, rate_q), self.v, 1)
            square = sum((self.v[k] ** 2 for k in turning if changes[k]), SX(0))
            speed = SX(UNBOUNDED) if one.speed is None else one.speed
            rows.append(casadi.horzcat(speed, one.pace + casadi.sqrt(square)))
        return casadi.vertcat(*rows)

    def modes(self) -> SX:
        """Return the symbols (nm, 1) of the modes (discrete states) of all components."""
        found = [SX(0, 1)]
        for part in self.parts:
            found += [part.states[name] for name in part.element.names_of("mode")]
        return casadi.vertcat(*found)

    def laws(self) -> SX:
        """Return the values (n, 1) of user-defined components whose discontinuities are unknown.

        They are the loads, rates and wired signals of components without `crossings`.

        Components of this package are continuous or define `crossings`. Outputs of user-defined
        components affect the motion only through wires.
        """
        found, by_user = [SX(0, 1)], dict[str, bool]()
        for part in self.parts:
            element = part.element
            own = type(element).__module__.startswith("mbs.") or element.has("crossings")
            by_user[part.name] = not own
            if own:
                continue
            for load in self.loads(part).values() if element.acts else ():
                if isinstance(load, FrameLoad):
                    found += [load.force, load.moment]
                else:
                    found.append(SX(load))
            if element.has("rates"):
                found += map(SX, element.rates(self.at(part)).values())
        for part in self.parts:
            for source in part.inputs.values():
                if isinstance(source, WireSource) and by_user.get(source.owner, False):
                    found.append(self.signal(source))
        return casadi.vertcat(*map(casadi.vec, found))

    def outputs(self, lam: SX | None = None) -> SX:
        """Return the outputs (ny, 1) of all components.

        Args:
            lam: (r, 1) efforts of the rows of components in the order of `effort_symbols`; by
                default the outputs contain the symbols.
        """
        efforts = self.row_efforts()
        values = [SX(0, 1)]
        for part in self.parts:
            names = part.element.output_names
            if names:
                at = self.at(part)
                at.__dict__["lam"] = efforts.get(part.name, {})
                found = part.element.outputs(at)
                values += [SX(found[name]) for name in names]
        every = casadi.vertcat(*values)
        return every if lam is None else casadi.substitute(every, self.effort_symbols, lam)

    def row_efforts(self) -> Mapping[str, Mapping[str, SX]]:
        """Return the symbols of the efforts (multipliers) of rows, by component and label."""
        if self._efforts is None:
            self._efforts = {}
            for velocities in (False, True):
                for name, rows in part_rows(self, velocities=velocities):
                    own = self._efforts.setdefault(name, {})
                    own |= {label: SX.sym(f"{name}.lam.{label}") for label, _ in rows}
        return self._efforts

    @property
    def effort_symbols(self) -> SX:
        """(r, 1) symbols of all row efforts: position rows by component, then velocity rows."""
        found = self.row_efforts()
        order = [
            found[name][label]
            for velocities in (False, True)
            for name, rows in part_rows(self, velocities=velocities)
            for label, _ in rows
        ]
        return casadi.vertcat(SX(0, 1), *order)


def _identity(value: Any) -> Any:
    """Return the value unchanged."""
    return value


@dataclass(frozen=True, slots=True, eq=False)
class PartEvent:
    """Event of a component.

    Attributes:
        name: name of the component.
        label: name of the event within the component.
        when: (1, 1) event indicator, positive before the event.
        then: new values of elements of z, by index.
    """

    name: str
    label: str
    when: SX
    then: Mapping[int, SX]


def part_event_names(system: System) -> tuple[tuple[str, str], ...]:
    """Return (component name, label) of each event of the components of a system, in order."""

    def names() -> tuple[tuple[str, str], ...]:
        q, v = SX.sym("q", system.nq), SX.sym("v", system.nv)
        return tuple((event.name, event.label) for event in PartsAt(system, q, v).events())

    found: tuple[tuple[str, str], ...] = system.cached("names of events", names)
    return found


def after_events(system: System, events: Sequence[PartEvent], fired: SX) -> SX:
    """Return the component states (nz, 1) after events.

    Args:
        system: system with the components.
        events: events of all components.
        fired: 1 for each event that occurs, else 0.
    """
    after = SX(system.component_states)
    for k, event in enumerate(events):
        for index, value in event.then.items():
            after[index] = casadi.if_else(fired[k], value, after[index])
    return after


# Constraint rows of components on positions, unknowns and velocities.


def part_rows(at: PartsAt, *, velocities: bool = False) -> list[tuple[str, list[tuple[str, Row]]]]:
    """Return (component name, labelled constraint rows) of each component that has rows.

    Components with position rows come first.

    Args:
        at: evaluated components.
        velocities: whether to return velocity constraints instead of position constraints.
    """
    method = "velocity_rows" if velocities else "rows"
    result = []
    for part in sorted(at.parts, key=lambda part: not part.element.has("rows")):
        if part.element.has(method):
            rows = getattr(part.element, method)(at.at(part))
            result.append((part.name, [(label, as_row(row)) for label, row in rows.items()]))
    return result


def as_row(row: Row | SX) -> Row:
    """Return an expression as a Row with the default unit, m; a Row is returned unchanged.

    Args:
        row: constraint of a component.
    """
    return row if isinstance(row, Row) else Row(SX(row))
