"""Variables of the FMU of a mechanism: names, units, start values, nominal values and bounds."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

from mbs.assembly import System
from mbs.assembly.tables import ACCELERATION_UNIT, EFFORT_UNIT, RATE_UNIT, Coordinate
from mbs.components.contact import Contact
from mbs.components.custom import Friction, OneWay
from mbs.errors import ModelError
from mbs.export.fmu.description import FmuState, FmuVariable, Jumps, once
from mbs.loops.closing import Closing, closure_parameters
from mbs.loops.cut_positions import cut_positions
from mbs.models.contacts import contacts_of
from mbs.models.geometry import terminal_frame
from mbs.models.state.crossing_modes import CONTACTS
from mbs.models.state.drive import InputMotion
from mbs.models.state.independent import MinimalState
from mbs.text import did_you_mean
from mbs.units import rate_unit

POSE = ("x", "y", "z", *(f"R{row}{column}" for row in (1, 2, 3) for column in (1, 2, 3)))
"""Names of the elements of a frame's pose in the base: origin, and rotation matrix by rows."""

WRENCH = ("fx", "fy", "fz", "mx", "my", "mz")
"""Names of the elements of a wrench: force, then moment."""


def states(system: System, state: MinimalState, start: Sequence[float]) -> tuple[FmuState, ...]:
    """Return the states: positions and velocities of independent joints, and component states.

    start: start values of the positions [rad or m].
    """
    rates = {speed.name: speed.unit for speed in system.velocity_coordinates}
    positions = [
        FmuState(
            name=f"{coordinate.name}.q",
            unit=coordinate.unit,
            start=value,
            nominal=_size(coordinate),
            description=f"position of {coordinate.name}{_limits(coordinate)}",
            derivative_unit=rates.get(coordinate.name, RATE_UNIT[coordinate.unit]),
            output=True,
        )
        for coordinate, value in zip(
            (system.coordinates[k] for k in state.positions), start, strict=False
        )
    ]
    sizes = {coordinate.name: _size(coordinate) for coordinate in system.coordinates}
    velocities = [
        FmuState(
            name=f"{speed.name}.v",
            unit=speed.unit,
            nominal=sizes.get(speed.name, 1.0),
            description=f"velocity of {speed.name}",
            derivative_unit=ACCELERATION_UNIT[speed.unit],
            output=True,
        )
        for speed in (system.velocity_coordinates[k] for k in state.velocities)
    ]
    own = [
        FmuState(
            name=name,
            unit=unit,
            description=f"state of {name.rpartition('.')[0]}",
            derivative_unit=rate_unit(unit),
            start=value,
            output=True,
        )
        for (name, unit), value in zip(system.states, system.component_start, strict=True)
    ]
    return (*positions, *velocities, *own)


def dependents(
    system: System, state: MinimalState, start: Sequence[float]
) -> tuple[FmuVariable, ...]:
    """Return the positions that closed loops determine. Their start values are guesses."""
    return tuple(
        _position(system.coordinates[k], f"{system.coordinates[k].name}.solved", value)
        for k, value in zip(state.dependents, start, strict=True)
    )


def cuts(system: System) -> tuple[FmuVariable, ...]:
    """Return the positions of joints that are cut. Their start values are guesses."""
    start = cut_positions(system)(system.configuration, system.parameter_values())
    return tuple(
        _position(coordinate, f"{coordinate.name}.solved", float(value))
        for coordinate, value in zip(system.cut_coordinates, start.nonzeros(), strict=True)
    )


def loop_size(system: System) -> float:
    """Return the size of the mechanism [m] at the default values of its parameters, 1 if open."""
    if not system.is_closed:
        return 1.0
    return Closing(system, closure_parameters(system)).size


def inputs(system: System, state: MinimalState, labels: Sequence[str]) -> Iterator[FmuVariable]:
    """Yield the variables of u, except inputs of a controller.

    labels: names of the frames on which external wrenches act.
    """
    for k in state.inputs:
        name = system.velocity_coordinates[k].name
        yield _effort(system.velocity_coordinates[k], f"effort of the motor of {name}")
    for k in state.devices:
        name, unit = system.inputs[k]
        text = f"input of {name.rpartition('.')[0]}"
        yield FmuVariable(name=name, unit=unit, start=system.u_default[k], description=text)
    for label in labels:
        for element in WRENCH:
            unit, noun = ("N", "force") if element[0] == "f" else ("N.m", "torque")
            text = f"{noun} on {label} along {element[1]} of the base"
            yield FmuVariable(name=f"{label}.{element}", unit=unit, description=text)
    for motion in state.motions:
        yield from _prescribe(system, motion)


def _prescribe(system: System, motion: InputMotion) -> Iterator[FmuVariable]:
    speed = system.velocity_coordinates[motion.velocity]
    if motion.position is not None:
        position, start = system.coordinates[motion.position], system.configuration[motion.position]
        yield _position(position, f"{position.name}.q", start, "prescribed ")
        yield _velocity(speed, "prescribed ")
    yield _acceleration(speed, "prescribed ")


def outputs(
    system: System, state: MinimalState, *, branches: bool = False
) -> Iterator[FmuVariable]:
    """Yield the variables of y, except outputs on request.

    Args:
        system: assembled mechanism, open or closed.
        state: state equation of the mechanism.
        branches: whether start velocities of dependent joints select a branch of motion in a
            singular configuration.
    """
    speeds = system.velocity_coordinates
    yield from (_acceleration(speeds[k]) for k in state.accelerations)
    for k in state.shown:
        yield _position(system.coordinates[k], f"{system.coordinates[k].name}.q")
    for k in state.passive:
        velocity = _velocity(speeds[k])
        if branches:
            text = f"{velocity.description}; a start of it chooses where branches of motion meet"
            velocity = replace(velocity, description=text, guess=True)
        yield velocity
    yield from (_acceleration(speeds[k]) for k in state.passive)
    yield from pose("tool", frame_text(terminal_frame(system)))
    for name, unit in system.outputs:
        yield FmuVariable(name=name, unit=unit, description=f"of {name.rpartition('.')[0]}")
    for k in state.efforts:
        yield _effort(speeds[k], f"effort that drives {speeds[k].name}")
    for contact in state.contacts:
        text = f"effort of {contact.name.removesuffix('.effort')}"
        yield FmuVariable(name=contact.name, unit=contact.unit, description=text)


def pose(label: str, where: str) -> Iterator[FmuVariable]:
    """Yield the variables of a frame's pose in the base: origin, and rotation matrix by rows."""
    for name in POSE:
        text = f"{name} of {where} in the base frame"
        if name.startswith("R"):
            text = f"orientation of {where} in the base frame"
        yield FmuVariable(
            name=f"{label}.{name}", unit="1" if name.startswith("R") else "m", description=text
        )


def frame_text(frame: str | int) -> str:
    """Return the name of a frame for descriptions, such as "link 3"."""
    return f"link {frame}" if isinstance(frame, int) else frame


def parameters(system: System, fixed: Sequence[str] = ()) -> Iterator[FmuVariable]:
    """Yield a parameter for every symbol of the system, with its value as start value.

    Args:
        system: assembled mechanism, open or closed.
        fixed: names of parameters that are constant after the initialization.

    Raises:
        ModelError: a name in `fixed` is unknown or given twice, or a symbol has no value.
    """
    kept = once(system, "fixed", fixed)
    _check_known(system, kept)
    for parameter, start in zip(system.parameters, system.parameter_values(), strict=True):
        low, high = system.bounds.get(parameter.name, (None, None))
        yield FmuVariable(
            name=parameter.name,
            unit=parameter.unit,
            start=start,
            nominal=abs(start) or 1.0,
            min=None if low is None or start < low else low,
            max=None if high is None or start > high else high,
            description=parameter.description or f"parameter {parameter.name}",
            fixed=parameter.name in kept,
        )


def _check_known(system: System, fixed: Sequence[str]) -> None:
    known = [parameter.name for parameter in system.parameters]
    for name in fixed:
        if name not in known:
            raise ModelError(
                f"{system.name}: fixed names {name!r}, which is no parameter;"
                f" {did_you_mean(name, known)}"
            )


def _size(coordinate: Coordinate) -> float:
    """Return the nominal value of a position: the larger joint limit, or 1 without limits."""
    largest = max(map(abs, coordinate.limits or (1.0,)))
    return largest if largest > 0 and math.isfinite(largest) else 1.0


def _limits(coordinate: Coordinate) -> str:
    """Return the joint limits as text. The model does not enforce them as min and max."""
    if coordinate.limits is None:
        return ""
    low, high = coordinate.limits
    return f", whose joint is limited to {low:g} .. {high:g} {coordinate.unit}"


def _position(coordinate: Coordinate, name: str, start: float = 0.0, how: str = "") -> FmuVariable:
    return FmuVariable(
        name=name,
        unit=coordinate.unit,
        start=start,
        nominal=_size(coordinate),
        description=f"{how}position of {coordinate.name}",
    )


def _velocity(speed: Coordinate, how: str = "") -> FmuVariable:
    text = f"{how}velocity of {speed.name}"
    return FmuVariable(name=f"{speed.name}.v", unit=speed.unit, description=text)


def _acceleration(speed: Coordinate, how: str = "") -> FmuVariable:
    return FmuVariable(
        name=f"{speed.name}.a",
        unit=ACCELERATION_UNIT[speed.unit],
        description=f"{how}acceleration of {speed.name}",
    )


def _effort(speed: Coordinate, text: str) -> FmuVariable:
    return FmuVariable(name=f"{speed.name}.tau", unit=EFFORT_UNIT[speed.unit], description=text)


# Events of the FMU of a mechanism: rigid stops, Coulomb friction and other crossings.


_CROSSING = {
    "place": "side, -1 or 1, or 0 at zero; or whole number",
    "asleep": "1 while it is not watched, since it has changed many times in a row",
    "row": "number of changes in a row",
    "time": "time of the last change in units of 10 us",
}
"""Descriptions of the modes of crossings, by the last part of their name."""


def jumps(system: System, state: MinimalState) -> Jumps | None:
    """Return modes, indicators and jumps of a state equation, or None without events.

    Args:
        system: assembled mechanism, open or closed.
        state: state equation of the mechanism.
    """
    events = state.events
    if events is None:
        return None
    modes = []
    for _, element in contacts_of(system).elements:
        text = "place: -1 at the lower limit, 1 at the upper one, 0 between them"
        if isinstance(element.law, OneWay):
            text = "-1 where it is locked, 0 where it is free"
        elif isinstance(element.law, Friction):
            text = "direction of sliding, -1 or 1, and 0 where it sticks"
        described = f"of {element.name}, {text}"
        modes.append(FmuVariable(name=f"{element.name}.mode", min=-1, max=1, description=described))
    for name in events.modes[len(modes) :]:
        text = f"of a law that jumps: {_CROSSING[name.rpartition('.')[2]]}"
        modes.append(FmuVariable(name=name, description=text))
    # user-defined laws with crossings may be discontinuous
    smooth = all(
        isinstance(part.element, Contact) or not part.element.has("crossings")
        for part in system.parts
    )
    return Jumps(
        modes=tuple(modes),
        first=events.first,
        indicators=events.indicators,
        jump=events.jump,
        names=events.names,
        approaches=events.approaches,
        optional=smooth and all(name.startswith(f"{CONTACTS}.") for name in events.modes),
    )
