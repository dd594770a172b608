"""Equation-based components in a system: links of their points, coordinates, states, signals."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass

import casadi
from casadi import SX

from mbs.assembly.tables import EFFORT_UNIT, AttachedSensor, Coordinate, Places, require_part
from mbs.assembly.tree import Frame
from mbs.components import Custom, Description, JointSensor, Prismatic, Revolute
from mbs.components.bodies import Mount
from mbs.components.custom import EFFORT, port_of_flange
from mbs.errors import AssemblyError
from mbs.expressions import Expression, Scalar, to_sx
from mbs.text import did_you_mean, listed
from mbs.units import UNITS

_Rows = Sequence[Coordinate]
Quantity = tuple[str, str]
"""Pair of full name and unit."""


@dataclass(frozen=True, slots=True)
class FlangeTurn:
    """Rotation of a flange relative to its housing.

    Attributes:
        coordinate: name of the coordinate to which the rotation is proportional; empty for a fixed
            flange.
        factor: rotation of the flange per unit of the coordinate.
    """

    coordinate: str
    factor: Expression


@dataclass(frozen=True, slots=True, eq=False)
class MomentArm:
    """Moment arm of a component on a coordinate: weight of the coordinate in a port.

    Attributes:
        position: index of the coordinate in q. None if it is no position.
        velocity: index of the coordinate in v.
        factor: derivative of the port's value with respect to the coordinate.
        name: name of the coordinate.
        unit: unit of its velocity.
    """

    position: int | None
    velocity: int
    factor: SX
    name: str
    unit: str


@dataclass(frozen=True, slots=True)
class WireSource:
    """Source of a wired input: an output of a component, or a reading of a sensor.

    Attributes:
        owner: name of the component.
        signal: output or state of the component, or the reading without the name of the sensor,
            such as "q" or "p.x".
    """

    owner: str
    signal: str

    def __str__(self) -> str:
        return f"{self.owner}.{self.signal}"


@dataclass(frozen=True, slots=True, eq=False)
class ComponentInstance:
    """A component in a system, with the links, coordinates and symbols that it uses.

    Attributes:
        element: description of the component.
        frames: link (-1 for the base) and pose in the link's frame, of each of its points.
        coordinates: moment arms of each of its ports on coordinates and shafts, and of each
            unknown.
        states: symbols of its states, by name in the component.
        inputs: symbols of its inputs, or the sources to which they are wired.
        symbols: CasADi symbol of every parameter.
        where: components that it acts on, as text.
    """

    element: Custom
    frames: tuple[Frame, ...]
    coordinates: Mapping[str, tuple[MomentArm, ...]]
    states: Mapping[str, SX]
    inputs: Mapping[str, SX | WireSource]
    symbols: Mapping[str, SX]
    where: str

    @property
    def name(self) -> str:
        """Name of the component."""
        return self.element.name

    @property
    def levers(self) -> tuple[MomentArm, ...]:
        """Moment arms on all its coordinates; empty if it acts on points only."""
        return tuple(lever for levers in self.coordinates.values() for lever in levers)

    @property
    def state_quantities(self) -> tuple[Quantity, ...]:
        """Full name and unit of every state."""
        return tuple((f"{self.name}.{n}", self._unit(n)) for n in self.states)

    @property
    def input_quantities(self) -> tuple[Quantity, ...]:
        """Full name and unit of every input that is not wired."""
        free = (n for n, given in self.inputs.items() if isinstance(given, SX))
        return tuple((f"{self.name}.{n}", self._unit(n)) for n in free)

    @property
    def output_quantities(self) -> tuple[Quantity, ...]:
        """Full name and unit of every output."""
        return tuple((f"{self.name}.{n}", self._unit(n)) for n in self.element.output_names)

    @property
    def velocity(self) -> int:
        """Index in v of the coordinate that a motor drives."""
        return self.levers[0].velocity

    @property
    def factor(self) -> SX:
        """Speed of the flange of a motor per velocity of its coordinate."""
        return self.levers[0].factor

    @property
    def binds_alone(self) -> bool:
        """Whether the component has constraint rows only."""
        others = self.element.acts or self.element.switches or self.inputs or self.states
        return self.element.binds and not others

    def _unit(self, name: str) -> str:
        """Return the unit of the declared quantity `name`; an effort has the unit of its joint."""
        unit = self.element.declared[name].unit
        return EFFORT_UNIT[self.levers[0].unit] if unit == EFFORT else unit

    @property
    def sentence(self) -> str:
        """Description in a report: kind, name, ports and signals."""
        kind, name = type(self.element).__name__, self.name
        signals = [f"input {n} [{u}]" for n, u in self.input_quantities]
        signals += [
            f"input {name}.{n} from {given}"
            for n, given in self.inputs.items()
            if isinstance(given, WireSource)
        ]
        signals += [f"state {n} [{u}]" for n, u in self.state_quantities]
        if self.element.drives:
            turns = as_fast(number_or_sx(self.factor), self.levers[0].name)
            does = f"drives {self.levers[0].name} and turns {turns}"
        else:
            acts = self.element.acts or (self.element.switches and not self.element.binds)
            verb = "acts" if acts else "binds what is" if self.element.binds else "is"
            does = f"{verb} {self.where}" if self.where else "works on signals alone"
            does += self.element.scope
        return f"{kind} {name} {does}{': ' if signals else ''}{', '.join(signals)}."


def number_or_sx(factor: SX) -> float | SX:
    """Return a constant expression as a float, and other expressions unchanged.

    Args:
        factor: scalar expression.
    """
    return float(factor) if factor.is_constant() else factor


def as_fast(factor: float | SX, coordinate: str) -> str:
    """Return text on the speed of a shaft relative to a coordinate.

    For example "2 times as fast as j1".

    Args:
        factor: speed of the shaft per speed of the coordinate.
        coordinate: name of the coordinate; empty for a fixed shaft.
    """
    if not coordinate:
        return "not at all, since its shaft is fixed"
    if isinstance(factor, float) and factor == 1:
        return f"with {coordinate}"
    text = format(factor, "g") if isinstance(factor, float) else str(factor)
    return f"{text} times as fast as {coordinate}"


def parts_of(mechanism: Description) -> list[Custom]:
    """Return all equation-based components of a mechanism, in the order of their addition.

    Args:
        mechanism: components and connections.
    """
    return [c for c in mechanism.components.values() if isinstance(c, Custom) and c.has_equations]


def with_unknowns(mechanism: Description) -> Description:
    """Return the mechanism with a massless joint for every unknown of a component.

    The coordinate of the joint is the unknown. The mechanism itself is returned without unknowns.

    Args:
        mechanism: components and connections.
    """
    unknowns = [
        (f"{part.name}.{name}", part.declared[name].unit)
        for part in parts_of(mechanism)
        for name in part.names_of("unknown")
    ]
    if not unknowns:
        return mechanism
    result = copy(mechanism)
    result.components = dict(mechanism.components)
    result.connections = list(mechanism.connections)
    for name, unit in unknowns:
        joint = Prismatic if unit == "m" else Revolute
        carried = result.add(Mount(f"{name}.value"))
        result.connect(result.world, joint(name, axis="z", actuated=False), carried)
    return result


def guesses_of_unknowns(mechanism: Description) -> dict[str, float]:
    """Return the initial guesses of the unknowns of components, by coordinate name.

    Args:
        mechanism: components and connections.
    """
    return {
        f"{part.name}.{name}": float(getattr(part, name))
        for part in parts_of(mechanism)
        for name in part.names_of("unknown")
    }


def coordinates_needed(
    mechanism: Description, turns: Mapping[tuple[str, str], FlangeTurn]
) -> list[str]:
    """Return the names of the coordinates to which equation-based components refer.

    Args:
        mechanism: mechanism without flanges.
        turns: rotation of each flange, by its key.
    """
    found = list(guesses_of_unknowns(mechanism))
    for part in parts_of(mechanism):
        found += [name for levers in part.coordinates.values() for name, _ in levers]
        shafts = [turns[part.name, port_of_flange(port)] for port in part.shaft_ports]
        found += [turn.coordinate for turn in shafts if turn.coordinate]
    # a wire from a joint sensor needs the sensor's coordinate in the tree
    sensors = [c for c in mechanism.components.values() if isinstance(c, JointSensor)]
    sources = [str(source) for source, _ in mechanism.wires]
    found += [s.joint for s in sensors if any(one.startswith(f"{s.name}.") for one in sources)]
    return found


def attached_parts(
    mechanism: Description,
    places: Places,
    tables: tuple[_Rows, _Rows, _Rows],
    symbols: Mapping[str, SX],
    turns: Mapping[tuple[str, str], FlangeTurn],
    sensors: Sequence[AttachedSensor],
) -> tuple[ComponentInstance, ...]:
    """Return every equation-based component with the links of its points and its coordinates.

    Args:
        mechanism: components and connections.
        places: link and pose of bodies and joint frames.
        tables: coordinates of q, of v, and of cut joints.
        symbols: CasADi symbol of every parameter.
        turns: rotation of each flange, by its key.
        sensors: sensors that may be sources of wires.

    Raises:
        AssemblyError: a component acts on an unknown or immovable part, or the source of a wire is
            unknown.
    """
    wires = _wires(mechanism, sensors)
    return tuple(
        _attached(mechanism, part, places, tables, symbols, turns, wires)
        for part in parts_of(mechanism)
    )


def _attached(
    mechanism: Description,
    part: Custom,
    places: Places,
    tables: tuple[_Rows, _Rows, _Rows],
    symbols: Mapping[str, SX],
    turns: Mapping[tuple[str, str], FlangeTurn],
    wires: Mapping[tuple[str, str], WireSource],
) -> ComponentInstance:
    """Return one equation-based component with the links of its points and its coordinates.

    The arguments are those of `attached_parts`; `wires` are the sources of wired inputs.
    """
    # links and poses of its points
    frames = []
    for point in part.points:
        require_part(mechanism, part, point, "acts on")
        link, pose = places[point.owner.name, point.port]
        frames.append((link, pose @ point.placement.pose(symbols)))
    # coordinates of its other ports
    given: dict[str, Iterable[tuple[str, Scalar]]] = dict(part.coordinates)
    for name in part.shaft_ports:
        turn = turns[part.name, port_of_flange(name)]
        given[name] = ((turn.coordinate, turn.factor),) if turn.coordinate else ()
    given |= {name: ((f"{part.name}.{name}", 1.0),) for name in part.names_of("unknown")}
    coordinates = {
        port: tuple(
            _moment_arm(part, name, to_sx(factor, symbols), tables) for name, factor in levers
        )
        for port, levers in given.items()
    }
    names = [point.owner.name for point in part.points]
    names += [lever.name for port in given for lever in coordinates[port]]
    _require_moving(part, frames, coordinates, names)
    return ComponentInstance(
        element=part,
        frames=tuple(frames),
        coordinates=coordinates,
        states={name: SX.sym(f"{part.name}.{name}") for name in part.state_names},
        inputs={
            name: wires.get((part.name, name), SX.sym(f"{part.name}.{name}"))
            for name in part.input_names
        },
        symbols=symbols,
        where=_place_text(names) if names else "",
    )


def _require_moving(
    part: Custom,
    frames: Sequence[Frame],
    coordinates: Mapping[str, tuple[MomentArm, ...]],
    names: Sequence[str],
) -> None:
    """Raise AssemblyError if a component with forces or rows acts on bodies that cannot move.

    `names` are the components that it acts on.

    `frames` are the links and poses of its points, `coordinates` its moment arms by name.
    """
    links = {link for link, _ in frames}
    bodiless = not frames and not coordinates  # such as a capacitor, which has no ports
    if not (part.acts or part.binds or part.switches) or bodiless or any(coordinates.values()):
        return
    if links <= {-1} or (len(links) == 1 and len(frames) > 1):
        still = "does not move" if links <= {-1} else "is one rigid body"
        where = listed(names or ["a FixedFlange"])
        raise AssemblyError(
            f"{part.name}: what it acts on, {where}, {still}, so that the"
            f" {type(part).__name__} does nothing; let it act on another body"
        )


def _place_text(names: Sequence[str]) -> str:
    """Return text on where a component acts: "on a" or "between a and b", for component `names`."""
    return f"between {listed(names)}" if len(names) > 1 else f"on {names[0]}"


def _moment_arm(
    part: Custom, name: str, factor: SX, tables: tuple[_Rows, _Rows, _Rows]
) -> MomentArm:
    """Return the moment arm of a component on the coordinate `name`.

    `factor` is the derivative of the port's value; `tables` are the coordinates of q, of v, and of
    cut joints. Raises AssemblyError if the coordinate is unknown.

    `part` is the component.
    """
    coordinates, speeds, cut = tables
    q, v = ([row.name for row in table] for table in (coordinates, speeds))
    known = [speed for speed in v if speed in q or not part.needs_position]
    if name not in known and name in [coordinate.name for coordinate in cut]:
        raise AssemblyError(
            f"{part.name}: the joint of {name!r} is cut to open a loop, so that a"
            f" {type(part).__name__} cannot act on it; give that joint some friction Fv of its"
            " own, which keeps it in the tree"
        )
    if name not in known:
        raise AssemblyError(
            f"{part.name}: there is no coordinate {name!r} in the tree that a"
            f" {type(part).__name__} can act on; {did_you_mean(name, known)}"
        )
    position = q.index(name) if name in q else None
    return MomentArm(position, v.index(name), factor, name, speeds[v.index(name)].unit)


# Wires: sources of the inputs of components.


def _wires(
    mechanism: Description, sensors: Sequence[AttachedSensor]
) -> dict[tuple[str, str], WireSource]:
    """Return the source of every wired input, a dict with keys (component, input).

    Raises:
        AssemblyError: the source of a wire is no signal, or its ends have different units.
    """
    outputs = {
        f"{part.name}.{name}": (WireSource(part.name, name), part.declared[name].unit)
        for part in parts_of(mechanism)
        for name in (*part.output_names, *part.state_names)
    }
    for attached in sensors:
        for column, unit in attached.columns:
            name = attached.sensor.name
            outputs[column] = WireSource(name, column.removeprefix(f"{name}.")), unit
    found: dict[tuple[str, str], WireSource] = {}
    for source, target in mechanism.wires:
        if str(source) not in outputs:
            raise AssemblyError(
                f"{mechanism.name}: {target} is wired to {str(source)!r}, which gives no signal;"
                f" {did_you_mean(str(source), outputs)}"
            )
        known = mechanism.components.get(target.owner.name)
        if not isinstance(known, Custom):
            raise AssemblyError(
                f"{mechanism.name}: {str(source)!r} is wired to {target}, whose component is not in"
                " the mechanism; add it, or take the wire away"
            )
        if target.name not in known.input_names:
            raise AssemblyError(
                f"{mechanism.name}: {str(source)!r} is wired to {target}, which is no input;"
                f" {did_you_mean(target.name, known.input_names)}"
            )
        if (known.name, target.name) in found:
            raise AssemblyError(
                f"{mechanism.name}: {target} is wired to {found[known.name, target.name]} and to"
                f" {source}; an input has one source, so take one wire away"
            )
        found[known.name, target.name], unit = outputs[str(source)]
        wanted = known.declared[target.name].unit
        if not _may_be_wired(unit, wanted):
            raise AssemblyError(
                f"{mechanism.name}: {str(source)!r} [{unit}] is wired to {target} [{wanted}], which"
                " is another quantity; put a block between them, such as a Gain"
            )
    return found


def _may_be_wired(source: str, target: str) -> bool:
    """Whether the units of source and target of a wire agree; "1" agrees with all units."""
    free = ("1", EFFORT)
    if source in free or target in free:
        return True
    one, other = (
        {base: n for base, n in UNITS[unit].exponents.items() if base != "rad"}
        for unit in (source, target)
    )
    return one == other


def symbols_in_order(symbols: Iterable[SX]) -> SX:
    """Return symbols as one column (n, 1).

    Args:
        symbols: n symbols.
    """
    every = list(symbols)
    return casadi.vertcat(*every) if every else SX(0, 1)
