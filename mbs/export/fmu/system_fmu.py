"""Export of a mechanism as an FMU."""

from __future__ import annotations

import os
from pathlib import Path

import casadi
from casadi import SX, Function

from mbs.assembly import System, symbolic
from mbs.assembly.model_function import require_system
from mbs.assembly.tree import quaternion_slices
from mbs.assembly.validity import field_rows, quaternion_rows
from mbs.export.fmu.arrays import Group, in_arrays
from mbs.export.fmu.controller import controller_of, read_sources
from mbs.export.fmu.description import Experiment, FmuModel, Origin, Rules
from mbs.export.fmu.documentation import about
from mbs.export.fmu.interface import (
    interface_of,
    make_request,
    observed_values,
    observed_variables,
    terminals,
)
from mbs.export.fmu.options import FmuOptions
from mbs.export.fmu.pack import require_writable, write_fmu
from mbs.export.fmu.variables import (
    dependents,
    inputs,
    jumps,
    loop_size,
    outputs,
    parameters,
    states,
)
from mbs.files import path_of
from mbs.loops.examination import configuration_health, row_independence
from mbs.models.state.forms import state_equations
from mbs.models.state.independent import MinimalState, consistent_start
from mbs.options import group_values, keywords_of


@keywords_of(FmuOptions)
def fmu(system: System, path: str | os.PathLike[str], *, options: FmuOptions) -> Path:
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
        options: see `FmuOptions`.

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
    options.check(system.name)
    require_writable(path_of(path))
    return write_fmu(
        fmu_model(system, options),
        path,
        fmi=options.fmi,
        platforms=options.platforms,
        reference=options.reference,
    )


def fmu_model(system: System, options: FmuOptions | None = None) -> FmuModel:
    """Return the description of the FMU of a mechanism.

    Args:
        system: assembled mechanism, open or closed.
        options: options of the FMU.

    Raises:
        ExportError, ModelError, CompilerError: as for `fmu`.
    """
    options = options or FmuOptions()
    given = options.parameters
    if given is not None and (not isinstance(given, list | tuple) or given):
        system = symbolic(system, given)
    system.parameter_values()
    interface = interface_of(system, options.inputs, options.flanges)
    request = make_request(system, options.outputs, interface.flanges)
    controller = controller_of(system, options.controller, read_sources(options.sources))
    locates_events = options.solver != "rk4"  # a solver with fixed steps cannot
    equations = state_equations(
        system,
        lambda seen: observed_values(system, request, seen),
        interface.drive(system, controller),
        crossings=locates_events and options.target != "bare",
        tree=options.target != "bare",
        events=locates_events,
    )
    state, tree = equations.independent, equations.tree
    x, z = consistent_start(system, state)
    x_variables = states(system, state, x)
    u_variables = (*inputs(system, state, interface.wrenches), *controller.inputs)
    shown = outputs(system, state, branches=tree is not None)
    y_variables = (*shown, *observed_variables(system, request))
    model = FmuModel(
        name=system.name,
        description=options.description or system.report().splitlines()[0],
        origin=Origin(**group_values(options, Origin)),
        states=x_variables,
        inputs=u_variables,
        outputs=y_variables,
        parameters=tuple(parameters(system, options.fixed)),
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
        **group_values(options, Experiment),
        documentation="\n\n".join([system.report(), system.source]),
        terminals=terminals(system, interface, (*x_variables, *u_variables, *y_variables)),
        sources=controller.sources,
        about=about(system),
    )
    return in_arrays(model, _arrays(state)) if options.arrays else model


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
