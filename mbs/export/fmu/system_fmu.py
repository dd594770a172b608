"""Export of a mechanism as an FMU."""

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

    Inputs are the efforts `name.tau` of the actuated joints. A joint that a drive line with its own
    motor drives has the input of the motor instead, such as `motor.voltage`. Outputs are the
    positions `name.q`, velocities `name.v` and accelerations `name.a` of all joints. Further
    outputs are the pose of the terminal frame in the base (origin `tool.x`, `tool.y`, `tool.z`,
    rotation matrix `tool.R11` .. `tool.R33`), and the efforts and modes of rigid stops and Coulomb
    friction, `stop.effort`, `stop.mode`. States are the independent joints. In a closed system the
    other joints are solved for at every evaluation, so that loops cannot drift. Every symbol of the
    system is a parameter. The FMU contains a solver for Co-Simulation. Directional derivatives, and
    adjoint derivatives in FMI 3.0, are exact also for closed loops.

    Args:
        system: assembled mechanism, open or closed.
        path: file to write.
        fmi: version of FMI, "2.0" or "3.0".
        inputs: names of further inputs. "j1.a": acceleration of a joint. "j1.q": position of a
            joint, with its derivatives as inputs `j1.v` and `j1.a`. Both replace the effort, which
            becomes an output. "tool.wrench": force and moment on a frame at its origin, expressed
            in the base, `tool.fx` .. `tool.mz`.
        outputs: names of further outputs. "sensors": values of the sensors, such as `tip.p.x`.
            "energy": `energy.kinetic` and `energy.potential`. "closure": largest closure residual.
            "poses": frames of all bodies. "cut_forces": wrenches that joints transmit, `j1.f.x` ..
            `j1.m.z`. Single outputs: "sensor:tip", "pose:arm", "motion:arm", "wrench:j2".
        parameters: numeric values to convert to parameters, as in `mbs.assembly.symbolic`:
            "masses", "inertias", "lengths", "friction", "M3", "d4".
        fixed: names of parameters that are constant after the initialization. All other parameters
            are tunable.
        flanges: names of frames at which another part of a mechanism is coupled. Their poses,
            velocities and accelerations are outputs, and the wrenches on them are inputs. In FMI
            3.0 each flange is a terminal.
        controller: control law that computes the efforts, which are then no inputs. Either a
            function of (t, q, v) as in `mbs.simulate.run`, or a casadi.Function, whose further
            inputs become inputs of the FMU, or a C function of `sources` by its name or as a
            `CController`.
        sources: C files and headers of the controller, which are compiled with the FMU.
        platforms: names of target platforms, such as ["x86_64-linux", "x86_64-windows"], compiled
            with ziglang. By default this computer, with its own compiler.
        stop_time: default end of a simulation [s].
        step_size: default communication step [s].
        tolerance: default relative tolerance.
        solver: solver of Co-Simulation: "dopri5", the explicit pair of Dormand and Prince; "rodas",
            the linearly implicit RODAS5P for stiff systems; "rk4", with a fixed step, for real
            time.
        internal_step: step of "rk4" [s].
        max_step: longest step of "dopri5" and "rodas" [s]. By default only the error and events
            limit the step.
        target: "hosted", or "bare" for systems without an operating system: Co-Simulation only,
            with solver="rk4" and no events, in C99 that uses no heap, files or global variables. In
            FMI 2.0 the callbacks of the importer allocate its memory, in FMI 3.0 two functions in
            memory.c, which may be replaced. Results are bit-identical to target="hosted".
        reference: whether to include the results of the default experiment.
        arrays: whether positions, velocities, accelerations and efforts of the joints are the
            arrays q, v, a and tau of FMI 3.0. Dependent joints are in `q_dependent` and so on.
        description: one-line description. By default the first line of the report of the system.
        author: person or organisation, for the model description.
        version: version of the model.
        copyright: copyright notice, such as "(c) 2026 Example Ltd.".
        license: name, text or address of the licence.

    Returns:
        Path of the file.

    Raises:
        ExportError: the file cannot be written, the FMI version is unknown, the controller
            does not fit the system, a text has characters that are not printable, or the target
            does not support the solver, the events or the controller.
        ModelError: a parameter has no value, an input, output, parameter or frame is unknown or
            given twice, or the system has no minimal state.
        CompilerError: no C compiler is installed, the sources do not compile, or the platform is
            unknown.
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
    """Contents of an FMU in addition to the defaults. The attributes are arguments of `fmu`."""

    inputs: Sequence[str] = ()
    outputs: Sequence[str] = ()
    parameters: Sequence[str] = ()
    fixed: Sequence[str] = ()
    flanges: Sequence[str] = ()
    controller: Law = None
    sources: Sequence[PathLike] = ()


@dataclass(frozen=True, slots=True)
class Settings:
    """Default experiment and solver of an FMU. The attributes are arguments of `fmu`."""

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
    """Return the description of the FMU of a mechanism.

    Args:
        system: assembled mechanism, open or closed.
        wished: contents in addition to the defaults.
        settings: default experiment and solver.
        words: one-line description (empty for that of the report), and author of the model.
        arrays: whether q, v, a and tau are arrays of FMI 3.0.

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
    # a solver with fixed steps cannot locate events
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
    """Return conditions: unit quaternions at the start, and bounds on parameter expressions."""
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
    """Return `FmuModel.sines`, or None if the state has no dependent positions."""
    if state.closure is None or system.closure is None:
        return None
    x, z, p = (SX.sym(name, state.closure.size1_in(k)) for k, name in enumerate("xzp"))
    q = SX.zeros(system.nq)
    q[list(state.positions)] = x[: len(state.positions)]
    q[list(state.dependents)] = z
    leads = configuration_health(system)(q, p)[1]
    return Function("sines", [x, z, p], [casadi.vertcat(leads, row_independence(system)(q, p))])


def _arrays(state: MinimalState) -> tuple[Group, ...]:
    """Return the arrays of consecutive joint variables, in the order of x, u, y and z."""
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
    """Return the first index in y of velocities and of accelerations of dependent joints, and n."""
    first, count = len(state.accelerations) + len(state.shown), len(state.passive)
    return first, first + count, count
