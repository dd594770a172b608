"""What an FMU shows of a mechanism: joint torques in, motions and the tool's pose out."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from mbs.assembly import System
from mbs.assembly.model_function import require_system
from mbs.assembly.tables import ACCELERATION_UNIT, EFFORT_UNIT, Coordinate
from mbs.errors import ModelError
from mbs.export.fmu.description import FmuModel, Solver, State, Variable
from mbs.export.fmu.faces import require_version
from mbs.export.fmu.observed import chosen
from mbs.export.fmu.pack import write_fmu
from mbs.models.contacts import require_no_contacts
from mbs.models.geometry import terminal_frame
from mbs.models.minimal_state import MinimalState, consistent_start, minimal_state


def fmu(
    system: System,
    path: str | os.PathLike[str],
    *,
    fmi: str = "2.0",
    outputs: Sequence[str] = (),
    platforms: Sequence[str] | None = None,
    stop_time: float = 10.0,
    step_size: float = 0.01,
    tolerance: float = 1e-8,
    solver: Solver = "dopri5",
    internal_step: float = 0.001,
) -> Path:
    """Write a mechanism as an FMU for Model Exchange and Co-Simulation.

    Inputs are the efforts of the actuated joints, `name.tau`, or where the motor or torque of a
    drive line turns one its own input, such as `motor.voltage`. Outputs are positions, velocities
    and accelerations of all joints, `name.q`, `name.v`, `name.a`, and the terminal frame in the
    base: `tool.x`, `tool.y`, `tool.z` and the rotation matrix `tool.R11` .. `tool.R33`. States are
    the independent joints; in a closed system the others are solved for at every evaluation, so
    that loops cannot drift. Every symbol of the system is a tunable parameter. A solver for
    Co-Simulation is inside. Directional derivatives, and in FMI 3.0
    adjoint ones, are exact through closed loops.

    Args:
        system: open or closed.
        path: of the file to write.
        fmi: "2.0" or "3.0".
        outputs: what else to show: "sensors" for what they read, such as `tip.p.x`; "energy" for
            `energy.kinetic` and `energy.potential`; "closure" for the largest closure row.
        platforms: what computers it is for, such as ["x86_64-linux", "x86_64-windows"], made with
            ziglang; this computer when left out, with its own compiler.
        stop_time: default end of a simulation [s].
        step_size: default communication step [s].
        tolerance: default relative tolerance.
        solver: of co-simulation: "dopri5", Dormand and Prince's explicit pair; "rodas", the
            linearly implicit RODAS5P for stiff systems; "rk4", with a fixed step, for real time.
        internal_step: length of the steps of "rk4" [s].

    Returns:
        The path written.

    Raises:
        ExportError: the file cannot be written, or another FMI version was asked for.
        ModelError: a parameter has no value, there are no such outputs, or the system has no
            minimal state.
        CompilerError: there is no C compiler, or no such platform.
    """
    require_system(system)
    require_version(system.name, fmi)
    model = fmu_model(
        system,
        outputs,
        stop_time=stop_time,
        step_size=step_size,
        tolerance=tolerance,
        solver=solver,
        internal_step=internal_step,
    )
    return write_fmu(model, path, fmi=fmi, platforms=platforms)


def fmu_model(
    system: System,
    outputs: Sequence[str] = (),
    *,
    stop_time: float = 10.0,
    step_size: float = 0.01,
    tolerance: float = 1e-8,
    solver: Solver = "dopri5",
    internal_step: float = 0.001,
) -> FmuModel:
    """The description of a mechanism's FMU; arguments as for `fmu`."""
    require_no_contacts(system, "the FMU")
    system.parameter_values()
    extra = chosen(system, outputs)
    state = minimal_state(
        system, lambda *motion: [x for o in extra for x in o.values(system, *motion)]
    )
    x, z = consistent_start(system, state)
    return FmuModel(
        name=system.name,
        description=system.report().splitlines()[0],
        states=_states(system, state, x),
        inputs=(*(_effort(system.speeds[k]) for k in state.inputs), *_device_inputs(system)),
        outputs=(*_outputs(system, state), *(v for o in extra for v in o.variables(system))),
        parameters=_parameters(system),
        dependents=tuple(
            _position(system.coordinates[k], f"{system.coordinates[k].name}.solved", start)
            for k, start in zip(state.dependents, z, strict=True)
        ),
        rhs=state.rhs,
        closure=state.closure,
        stop_time=stop_time,
        step_size=step_size,
        tolerance=tolerance,
        solver=solver,
        internal_step=internal_step,
        documentation="\n\n".join([system.report(), system.source]),
    )


def _states(system: System, state: MinimalState, start: list[float]) -> tuple[State, ...]:
    speeds = {speed.name: speed for speed in system.speeds}
    positions = []
    for k, value in zip(state.positions, start, strict=False):
        coordinate = system.coordinates[k]
        rate = speeds[coordinate.name].unit if coordinate.name in speeds else _rate(coordinate)
        positions.append(
            State(
                name=f"{coordinate.name}.q",
                unit=coordinate.unit,
                start=value,
                description=f"position of {coordinate.name}{_limits(coordinate)}",
                derivative_unit=rate,
                output=True,
            )
        )
    velocities = [
        State(
            name=f"{speed.name}.v",
            unit=speed.unit,
            description=f"velocity of {speed.name}",
            derivative_unit=ACCELERATION_UNIT[speed.unit],
            output=True,
        )
        for speed in (system.speeds[k] for k in system.active)
    ]
    return (*positions, *velocities, *_device_states(system))


def _device_states(system: System) -> list[State]:
    return [
        State(
            name=name,
            unit=unit,
            description=f"state of {device.name}",
            derivative_unit=f"{unit}/s",
            output=True,
        )
        for device in system.devices
        for name, unit in device.states
    ]


def _device_inputs(system: System) -> list[Variable]:
    return [
        Variable(name=name, unit=unit, description=f"input of {device.name}")
        for device in system.devices
        for name, unit in [device.input]
    ]


def _limits(coordinate: Coordinate) -> str:
    """The limits in words: nothing in the model enforces them, so they are no min and max."""
    if coordinate.limits is None:
        return ""
    low, high = coordinate.limits
    return f", whose joint is limited to {low:g} .. {high:g} {coordinate.unit}"


def _rate(coordinate: Coordinate) -> str:
    return {"rad": "rad/s", "m": "m/s"}.get(coordinate.unit, "1/s")


def _effort(speed: Coordinate) -> Variable:
    return Variable(
        name=f"{speed.name}.tau",
        unit=EFFORT_UNIT[speed.unit],
        description=f"effort of the motor of {speed.name}",
    )


def _position(coordinate: Coordinate, name: str, start: float = 0.0) -> Variable:
    return Variable(
        name=name, unit=coordinate.unit, start=start, description=f"position of {coordinate.name}"
    )


def _outputs(system: System, state: MinimalState) -> tuple[Variable, ...]:
    """The elements of y, in the order in which the state equation gives them."""
    passive = list(system.closure.passive) if system.closure else []
    rows = [_acceleration(system.speeds[k]) for k in system.active]
    rows += [
        _position(system.coordinates[k], f"{system.coordinates[k].name}.q")
        for k in state.dependents
    ]
    rows += [
        Variable(
            name=f"{system.speeds[k].name}.v",
            unit=system.speeds[k].unit,
            description=f"velocity of {system.speeds[k].name}",
        )
        for k in passive
    ]
    rows += [_acceleration(system.speeds[k]) for k in passive]
    frame = terminal_frame(system)
    where = f"link {frame}" if isinstance(frame, int) else frame
    rows += [
        Variable(name=f"tool.{axis}", unit="m", description=f"{axis} of {where} in the base frame")
        for axis in "xyz"
    ]
    rows += [
        Variable(
            name=f"tool.R{row}{column}", description=f"orientation of {where} in the base frame"
        )
        for row in (1, 2, 3)
        for column in (1, 2, 3)
    ]
    rows += [
        Variable(name=name, unit=unit, description=f"of {device.name}")
        for device in system.devices
        for name, unit in device.outputs
    ]
    return tuple(rows)


def _acceleration(speed: Coordinate) -> Variable:
    return Variable(
        name=f"{speed.name}.a",
        unit=ACCELERATION_UNIT[speed.unit],
        description=f"acceleration of {speed.name}",
    )


def _parameters(system: System) -> tuple[Variable, ...]:
    rows = []
    for parameter in system.parameters:
        if parameter.default is None:
            raise ModelError(
                f"{system.name}: parameter {parameter.name!r} has no value; give it a default"
            )
        rows.append(
            Variable(
                name=parameter.name,
                unit=parameter.unit,
                start=parameter.default,
                description=parameter.description or f"parameter {parameter.name}",
            )
        )
    return tuple(rows)
