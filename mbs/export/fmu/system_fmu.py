"""A mechanism as an FMU."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import casadi
from casadi import SX, Function

from mbs.assembly import System, symbolic
from mbs.assembly.model_function import require_system
from mbs.assembly.tree import quaternion_slices
from mbs.assembly.validity import field_rows, quaternion_rows
from mbs.errors import ExportError
from mbs.export.fmu.arrays import Group, in_arrays
from mbs.export.fmu.controller import Law, controller_of, read_sources
from mbs.export.fmu.description import FmuModel, Origin, Rules, Solver
from mbs.export.fmu.documentation import about
from mbs.export.fmu.interface import (
    interface_of,
    make_request,
    observed_values,
    observed_variables,
    terminals,
)
from mbs.export.fmu.pack import require_version, require_writable, write_fmu
from mbs.export.fmu.variables import (
    dependents,
    inputs,
    jumps,
    loop_size,
    outputs,
    parameters,
    states,
)
from mbs.files import PathLike, path_of
from mbs.loops.examine import configuration_health, row_independence
from mbs.models.state.independent import MinimalState, consistent_start, minimal_state
from mbs.models.state.tree import tree_state
from mbs.native.scalar_source import Target


def fmu(
    system: System,
    path: str | os.PathLike[str],
    *,
    fmi: str = "2.0",
    inputs: Sequence[str] = (),
    outputs: Sequence[str] = (),
    parameters: Sequence[str] = (),
    fixed: Sequence[str] = (),
    flanges: Sequence[str] = (),
    controller: Law = None,
    sources: Sequence[PathLike] = (),
    platforms: Sequence[str] | None = None,
    stop_time: float = 10.0,
    step_size: float = 0.01,
    tolerance: float = 1e-8,
    solver: Solver = "dopri5",
    internal_step: float = 0.001,
    max_step: float | None = None,
    target: Target = "hosted",
    reference: bool = False,
    arrays: bool = False,
    description: str = "",
    author: str = "",
    version: str = "",
    copyright: str = "",
    license: str = "",
) -> Path:
    """Write a mechanism as an FMU for Model Exchange and Co-Simulation.

    Inputs are the efforts of the actuated joints, `name.tau`, or where the motor or torque of a
    drive line drives one its own input, such as `motor.voltage`. Outputs are positions, velocities
    and accelerations of all joints, `name.q`, `name.v`, `name.a`, the terminal frame in the base,
    `tool.x`, `tool.y`, `tool.z` and the rotation matrix `tool.R11` .. `tool.R33`, and efforts and
    modes of rigid stops and Coulomb friction, `stop.effort`, `stop.mode`. States are the
    independent joints; in a closed system the others are solved for at every evaluation, so that
    loops cannot drift. Every symbol of the system is a parameter. A solver for Co-Simulation is
    inside. Directional derivatives, and in FMI 3.0 adjoint ones, are exact through closed loops.

    Args:
        system: open or closed.
        path: of the file to write.
        fmi: "2.0" or "3.0".
        inputs: what else drives it: "j1.a" for the acceleration of a joint, "j1.q" for its
            position, with the rates as inputs `j1.v` and `j1.a`, in place of the effort, which
            becomes an output; "tool.wrench" for a force and a moment on a frame at its origin, in
            axes of the base, `tool.fx` .. `tool.mz`.
        outputs: what else to show: "sensors" for what they read, such as `tip.p.x`; "energy" for
            `energy.kinetic` and `energy.potential`; "closure" for the largest closure row; "poses"
            for the frames of all bodies; "cut_forces" for the wrenches that joints transmit,
            `j1.f.x` .. `j1.m.z`; or single ones, such as "sensor:tip", "pose:arm", "motion:arm",
            "wrench:j2".
        parameters: numbers that are to be parameters too, as `mbs.assembly.symbolic` takes them:
            "masses", "inertias", "lengths", "friction", "M3", "d4".
        fixed: names of parameters that keep their values once the motion has begun; all others may
            be tuned.
        flanges: frames where another part of a mechanism is coupled: their poses, velocities and
            accelerations are outputs, the wrenches on them inputs; in FMI 3.0 a terminal holds
            them.
        controller: law that gives the efforts in place of the inputs: a function of (t, q, v) as
            `mbs.simulate.run` takes it, a casadi.Function with further inputs, which become
            inputs of the FMU, or a C function of `sources` by its name or as a `CController`.
        sources: C files and headers that the controller needs; they are compiled with the FMU.
        platforms: what computers it is for, such as ["x86_64-linux", "x86_64-windows"], made with
            ziglang; this computer when left out, with its own compiler.
        stop_time: default end of a simulation [s].
        step_size: default communication step [s].
        tolerance: default relative tolerance.
        solver: of co-simulation: "dopri5", Dormand and Prince's explicit pair; "rodas", the
            linearly implicit RODAS5P for stiff systems; "rk4", with a fixed step, for real time.
        internal_step: length of the steps of "rk4" [s].
        max_step: the longest step of "dopri5" and "rodas" [s]; only the error and events limit it
            by default.
        target: "hosted", or "bare" for what has no operating system: co-simulation alone, with
            solver="rk4", of a system without events, by C99 without heap, files and variables that
            change outside of functions. In FMI 2.0 its memory comes from the callbacks of the
            importer; in FMI 3.0 from two functions in memory.c, which may be replaced. The numbers
            are those of the same FMU with target="hosted", to the last bit.
        reference: whether to put in the results of the default experiment.
        arrays: whether positions, velocities, accelerations and efforts of the joints are arrays
            q, v, a and tau, in FMI 3.0; what loops determine is `q_dependent` and so on.
        description: one line about the model; by default what the report of the system begins with.
        author: person or organisation, as the model description is to name it.
        version: of the model.
        copyright: such as "(c) 2026 Example Ltd.".
        license: its name, text or address.

    Returns:
        The path written.

    Raises:
        ExportError: the file cannot be written, another FMI version was asked for, the controller
            does not fit the system, a text is no line of printable characters, or the target cannot
            have the solver, the events or the controller.
        ModelError: a parameter has no value, an input, output, parameter or frame is unknown or
            named twice, or the system has no minimal state.
        CompilerError: there is no C compiler, it refused the sources, or there is no such
            platform.
    """
    require_system(system)
    require_version(system.name, fmi)
    require_writable(path_of(path))
    wished = Contents(inputs, outputs, parameters, fixed, flanges, controller, sources)
    settings = Settings(stop_time, step_size, tolerance, solver, internal_step, target, max_step)
    if arrays and fmi != "3.0":
        raise ExportError(
            f"{system.name}: arrays are variables of FMI 3.0, and fmi is {fmi!r}; use fmi='3.0' or"
            " leave arrays out"
        )
    origin = Origin(author=author, version=version, copyright=copyright, license=license)
    model = fmu_model(system, wished, settings, (description, origin), arrays=arrays)
    return write_fmu(model, path, fmi=fmi, platforms=platforms, reference=reference)


@dataclass(frozen=True, slots=True)
class Contents:
    """What an FMU is to hold beside the defaults; attributes as the arguments of `fmu`."""

    inputs: Sequence[str] = ()
    outputs: Sequence[str] = ()
    parameters: Sequence[str] = ()
    fixed: Sequence[str] = ()
    flanges: Sequence[str] = ()
    controller: Law = None
    sources: Sequence[PathLike] = ()


@dataclass(frozen=True, slots=True)
class Settings:
    """How an FMU is simulated by default; attributes as the arguments of `fmu`."""

    stop_time: float = 10.0
    step_size: float = 0.01
    tolerance: float = 1e-8
    solver: Solver = "dopri5"
    internal_step: float = 0.001
    target: Target = "hosted"
    max_step: float | None = None


def fmu_model(
    system: System,
    wished: Contents | None = None,
    settings: Settings | None = None,
    words: tuple[str, Origin] = ("", Origin()),
    *,
    arrays: bool = False,
) -> FmuModel:
    """The description of a mechanism's FMU.

    Args:
        system: open or closed.
        wished: what it holds.
        settings: how it is simulated.
        words: a description in place of that of the report, and whose the model is.
        arrays: q, v, a and tau are arrays.

    Raises:
        ExportError, ModelError, CompilerError: as for `fmu`.
    """
    wished, settings = wished or Contents(), settings or Settings()
    given = wished.parameters
    if given is not None and (not isinstance(given, list | tuple) or given):
        system = symbolic(system, given)
    system.parameter_values()
    interface = interface_of(system, wished.inputs, wished.flanges)
    request = make_request(system, wished.outputs, interface.flanges)
    controller = controller_of(system, wished.controller, read_sources(wished.sources))
    # a solver with fixed steps meets no events
    crossings = settings.solver != "rk4" and settings.target != "bare"
    state = minimal_state(
        system,
        lambda seen: observed_values(system, request, seen),
        interface.drive(system, controller),
        crossings=crossings,
    )
    tree = None
    followed = state.events is None or settings.solver != "rk4"
    if followed and settings.target != "bare":
        tree = tree_state(
            system,
            lambda seen: observed_values(system, request, seen),
            interface.drive(system, controller),
            crossings=crossings,
        )
    x, z = consistent_start(system, state)
    x_variables = states(system, state, x)
    u_variables = (*inputs(system, state, interface.wrenches), *controller.inputs)
    shown = outputs(system, state, branches=tree is not None)
    y_variables = (*shown, *observed_variables(system, request))
    model = FmuModel(
        name=system.name,
        description=words[0] or system.report().splitlines()[0],
        origin=words[1],
        states=x_variables,
        inputs=u_variables,
        outputs=y_variables,
        parameters=tuple(parameters(system, wished.fixed)),
        dependents=dependents(system, state, z),
        loop_size=loop_size(system),
        rhs=state.rhs,
        closure=state.closure,
        slopes=state.slopes,
        sines=_sines(system, state),
        passive=_passive(state),
        tree=tree,
        jumps=jumps(system, state),
        rules=_rules(system, state),
        **asdict(settings),
        documentation="\n\n".join([system.report(), system.source]),
        terminals=terminals(system, interface, (*x_variables, *u_variables, *y_variables)),
        sources=controller.sources,
        about=about(system),
    )
    return in_arrays(model, _arrays(state)) if arrays else model


def _rules(system: System, state: MinimalState) -> Rules | None:
    """Quaternions of unit length at the start, and bounds of what parameters make together."""
    x, q = SX.sym("x", state.rhs.size1_in(1)), SX.sym("q", system.nq)
    q[list(state.positions)] = x[: len(state.positions)]
    own = [part for part in quaternion_slices(system.tree) if part.start in state.positions]
    starts, fields = quaternion_rows(system, q, own), field_rows(system)
    rows = [*starts, *fields]
    if not rows:
        return None
    excess = casadi.vertcat(*(row.residual - row.bound for row in rows))
    return Rules(
        excess=Function("excess", [x, system.p], [excess]),
        sentences=tuple(row.sentence for row in rows),
        at_start=len(starts),
    )


def _sines(system: System, state: MinimalState) -> Function | None:
    """`FmuModel.sines` of a closed system; None if its state has no dependent positions."""
    if state.closure is None or system.closure is None:
        return None
    x, z, p = (SX.sym(name, state.closure.size1_in(k)) for k, name in enumerate("xzp"))
    q = SX.zeros(system.nq)
    q[list(state.positions)] = x[: len(state.positions)]
    q[list(state.dependents)] = z
    leads = configuration_health(system)(q, p)[1]
    return Function("sines", [x, z, p], [casadi.vertcat(leads, row_independence(system)(q, p))])


def _arrays(state: MinimalState) -> tuple[Group, ...]:
    """The variables of joints that follow each other, in the order of x, u, y and z."""
    m, k, n = len(state.accelerations), len(state.dependents), len(state.passive)
    return (
        Group("q", "state", 0, len(state.positions), "positions of"),
        Group("v", "state", len(state.positions), len(state.velocities), "velocities of"),
        Group("tau", "input", 0, len(state.inputs), "efforts of the motors of"),
        Group("a", "output", 0, m, "accelerations of"),
        Group("q_dependent", "output", m, k, "positions, which loops determine, of"),
        Group("v_dependent", "output", m + k, n, "velocities, which loops determine, of"),
        Group("a_dependent", "output", m + k + n, n, "accelerations, which loops determine, of"),
        Group("q_solved", "dependent", 0, k, "positions, whose starts choose the branch, of"),
    )


def _passive(state: MinimalState) -> tuple[int, int, int]:
    """Where velocities and accelerations of dependent joints stand in y, and their number."""
    first, count = len(state.accelerations) + len(state.shown), len(state.passive)
    return first, first + count, count
