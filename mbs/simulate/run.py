"""Simulation of a system, compiled where there is a compiler, loops kept closed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.assembly.model_function import require_system
from mbs.assembly.tables import ACCELERATION_UNIT, EFFORT_UNIT
from mbs.loops.start import Values, start
from mbs.models.effort import Effort, effort_function
from mbs.models.full_state import full_state
from mbs.progress import progress
from mbs.result import Result
from mbs.simulate.arguments import count_steps, positive
from mbs.simulate.contacts import contact_columns, every_effort, require_contacts_possible, told
from mbs.simulate.inputs import device_columns, device_states, input_function
from mbs.simulate.legs import Leg, Stop, integrated
from mbs.simulate.motion import Motion, prescribed_motions, started
from mbs.simulate.sensor_columns import sensor_columns

Array = NDArray[np.float64]

_SCALARS = (("kinetic_energy", "J"), ("potential_energy", "J"), ("closure_residual", "1"))


def run(
    system: System,
    duration: float,
    *,
    q0: Values = None,
    v0: Values = None,
    tau: Effort = None,
    motion: Motion = None,
    u: Effort = None,
    z0: Values = None,
    parameters: Mapping[str, float] | None = None,
    step: float = 0.01,
    tolerance: float = 1e-8,
    method: str = "dopri5",
    quiet: bool = False,
) -> Result:
    """The motion of a system from given positions and velocities under given joint efforts.

    A one-step method with error control. After every step positions and velocities are
    projected onto the independent closure rows, so that loops do not drift; the step is accepted
    when all closure rows hold.

    What stops a motion, an error or control-C, is raised with what was reached as its `result`: a
    `Result` of the rows before the stop, whose `stopped` has the time and the sentence.

    Args:
        system: open or closed.
        duration: [s].
        q0: positions at the start by coordinate name [rad or m], the others as in the assembled
            posture; in a closed system the loops are closed with the independent ones as given.
        v0: velocities at the start by name [rad/s or m/s], the others zero; in a closed system
            they may be of any joints, and the others follow.
        tau: joint efforts [N m or N]: constants of motors by name, or a function of (t, q, v) made
            of CasADi operations, or a casadi.Function, that returns (nv, 1) efforts, zero where
            there is no motor; or a dict that names joints, also such as have no motor.
        motion: laws of time for coordinates that drives move: by name such as "j1.q" a position,
            "j1.v" a velocity, "j1.a" an acceleration, each a number or a smooth function of t made
            of CasADi operations. The column `j1.tau` is the whole effort, the drive's included.
        u: inputs of the devices of drive lines, such as voltages: constants by the name of the
            device, or a function of (t, q, v) as for tau; zero when left out. What the devices
            deliver is added to tau.
        z0: states of devices at the start by name, such as `motor.i`, the others zero.
        parameters: values of symbols, the others at their defaults.
        step: time between the rows of the result [s]; it does not change the accuracy.
        tolerance: what the error of the motion should stay near [rad, m, rad/s or m/s]. A step
            may err by a twenty-fifth of it, and by a thousandth relative to large coordinates.
        method: "dopri5", Dormand and Prince's explicit pair, or "rodas", the linearly implicit
            RODAS5P for stiff systems.
        quiet: no progress bar.

    Returns:
        A `Result` with, for every coordinate, `name.q`, `name.v`, `name.a`, `name.tau`, and
        `kinetic_energy`, `potential_energy`, `closure_residual`; for every device its input, its
        states and its outputs, such as `motor.voltage`, `motor.i`, `motor.tau`, `motor.w`; and
        what every sensor reads, such as `tip.p.x`. A rigid stop or dry friction has `name.mode`
        and `name.effort`, and `events` tells when they change.

    Raises:
        ModelError: `system` is no System, a name is unknown or has no motor, or an argument has the
            wrong type or size.
        CompilerError: the compiler that CC names does not start.
        Unclosable: the loops cannot be closed at these positions.
        SolverError: the integration cannot go on; the message says when and why, `result` has
            what was reached.
        Interrupted: control-C was pressed; a KeyboardInterrupt whose `result` has what was reached.
    """
    require_system(system)
    duration = positive(duration, "duration [s]", system.name)
    tolerance = positive(tolerance, "tolerance", system.name)
    steps = count_steps(duration, positive(step, "step [s]", system.name), system.name)
    p = system.parameter_values(parameters)
    motions = prescribed_motions(system, motion)
    require_contacts_possible(system, motions)
    effort, inputs = effort_function(system, tau), input_function(system, u)
    given = started(system, motions, q0, v0)
    x0 = np.concatenate([*start(system, *given, parameters), device_states(system, z0)])
    times = np.linspace(0.0, duration, steps + 1)
    rtol, atol = step_tolerances(tolerance)
    with progress(f"simulating {system.name}", 0.0, duration, quiet=quiet) as reached:
        legs, stop = integrated(
            system,
            lambda like: full_state(like, effort, inputs, motions),
            x0,
            times,
            p,
            method=method,
            rtol=rtol,
            atol=atol,
            progress=reached,
        )
    result = _result(system, legs, p, stop)
    if stop is not None:
        stop.result = result
        raise stop
    return result


def step_tolerances(tolerance: float) -> tuple[float, float]:
    """Relative and absolute tolerance of a step for that of a motion, kept above rounding."""
    return max(1e-3 * tolerance, 1e-14), max(0.04 * tolerance, 1e-13)


def _result(system: System, legs: Sequence[Leg], p: Sequence[float], stop: Stop) -> Result:
    times, x = np.concatenate([leg.times for leg in legs]), np.vstack([leg.x for leg in legs])
    every = np.repeat(np.array(p, dtype=float).reshape(-1, 1), len(times), axis=1)
    parts = [leg.observed(p) for leg in legs]
    a, tau, u, y, held, *scalars = (np.vstack(rows) for rows in zip(*parts, strict=True))
    units: dict[str, str] = {}
    columns: list[Array] = []

    def column(name: str, unit: str, values: Array) -> None:
        units[name] = unit
        columns.append(np.ravel(values))

    for k, coordinate in enumerate(system.coordinates):
        column(f"{coordinate.name}.q", coordinate.unit, x[:, k])
    for k, speed in enumerate(system.speeds):
        column(f"{speed.name}.v", speed.unit, x[:, system.nq + k])
        column(f"{speed.name}.a", ACCELERATION_UNIT[speed.unit], a[:, k])
        column(f"{speed.name}.tau", EFFORT_UNIT[speed.unit], tau[:, k])
    for (name, unit), values in zip(_SCALARS, scalars, strict=True):
        column(name, unit, values)
    for name, unit, values in device_columns(system, u, x[:, system.nq + system.nv :], y):
        column(name, unit, values)
    motion = {"q": x[:, : system.nq].T, "v": x[:, system.nq : system.nq + system.nv].T}
    for name, unit, values in sensor_columns(
        system, {**motion, "a": a.T, "tau": every_effort(system, tau, held).T, "p": every}
    ):
        column(name, unit, values)
    contact = legs[0].contact
    for name, unit, values in contact_columns(system, contact, held):
        column(name, unit, values)
    values = np.column_stack(columns)
    events = told(system, contact)
    stopped = None if stop is None or stop.time is None else (stop.time, str(stop))
    return Result(
        times, values, units, name=system.name, events=events, system=system, stopped=stopped
    )
