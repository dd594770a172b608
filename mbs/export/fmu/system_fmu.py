"""Export of a mechanism as an FMU."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import casadi
from casadi import SX, Function

from mbs.assembly import System, symbolic
from mbs.assembly.model_function import require_system
from mbs.assembly.tree import quaternion_slices
from mbs.assembly.validity import field_rows, quaternion_rows
from mbs.export.fmu.controller import controller_of, read_sources
from mbs.export.fmu.description import (
    Array,
    Experiment,
    FmuModel,
    FmuState,
    FmuVariable,
    Kind,
    Origin,
    Rules,
)
from mbs.export.fmu.documentation import about
from mbs.export.fmu.interface import (
    interface_of,
    make_request,
    observed_values,
    observed_variables,
    terminals,
)
from mbs.export.fmu.options import FmuArguments, FmuOptions
from mbs.export.fmu.pack import require_writable, write_fmu
from mbs.export.fmu.variables import (
    cuts,
    dependents,
    inputs,
    jumps,
    loop_size,
    outputs,
    parameters,
    states,
)
from mbs.files import path_of
from mbs.loops.cut_positions import cut_positions
from mbs.loops.examination import configuration_health, row_independence
from mbs.models.state.forms import state_equations
from mbs.models.state.independent import MinimalState, consistent_start
from mbs.options import arguments_of, group_values


@arguments_of(FmuArguments)
def fmu(options: FmuArguments) -> Path:
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
        options: see `FmuArguments`.

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
    require_system(options.system)
    options.check(options.system.name)
    require_writable(path_of(options.path))
    return write_fmu(
        fmu_model(options.system, options),
        options.path,
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
    positions = _cut_positions(system, state)
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
        cuts=() if positions is None else cuts(system),
        cut_positions=positions,
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
    return _in_arrays(model, _arrays(state)) if options.arrays else model


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
    q = _positions(system, state, x, z)
    leads = configuration_health(system)(q, p)[1]
    return Function("sines", [x, z, p], [casadi.vertcat(leads, row_independence(system)(q, p))])


def _cut_positions(system: System, state: MinimalState) -> Function | None:
    """Return `FmuModel.cut_positions`, or None if no position of a cut joint can be guessed."""
    if state.closure is None or not system.cut_coordinates:
        return None
    x, z, p = (SX.sym(name, state.closure.size1_in(k)) for k, name in enumerate("xzp"))
    found = cut_positions(system)(_positions(system, state, x, z), p)
    return Function("cuts", [x, z, p], [casadi.densify(found)])


def _positions(system: System, state: MinimalState, x: SX, z: SX) -> SX:
    """Return the positions q (nq, 1) at states x and dependent positions z."""
    q = SX.zeros(system.nq)
    q[list(state.positions)] = x[: len(state.positions)]
    q[list(state.dependents)] = z
    return q


def _passive(state: MinimalState) -> tuple[int, int, int]:
    """Return the first index in y of velocities and of accelerations of dependent joints, and n."""
    first, count = len(state.accelerations) + len(state.shown), len(state.passive)
    return first, first + count, count


# Arrays of FMI 3.0: q, v, a and tau instead of scalar variables for each joint.


@dataclass(frozen=True, slots=True)
class _Group:
    """Request to combine consecutive variables of the same kind into an array.

    Attributes:
        name: name of the array.
        kind: kind of its elements.
        first: index of its first element among the variables of that kind, 0-based.
        size: number of elements. A group of size 0 is skipped.
        text: beginning of the description, before the names of the joints.
    """

    name: str
    kind: Kind
    first: int
    size: int
    text: str


def _arrays(state: MinimalState) -> tuple[_Group, ...]:
    """Return the arrays of consecutive joint variables, in the order of x, u, y and z."""
    m, k, n = len(state.accelerations), len(state.dependents), len(state.passive)
    return (
        _Group("q", "state", 0, len(state.positions), "positions of"),
        _Group("v", "state", len(state.positions), len(state.velocities), "velocities of"),
        _Group("tau", "input", 0, len(state.inputs), "efforts of the motors of"),
        _Group("a", "output", 0, m, "accelerations of"),
        _Group("q_dependent", "output", m, k, "positions, which loops determine, of"),
        _Group("v_dependent", "output", m + k, n, "velocities, which loops determine, of"),
        _Group("a_dependent", "output", m + k + n, n, "accelerations, which loops determine, of"),
        _Group("q_solved", "dependent", 0, k, "positions, whose starts choose the branch, of"),
    )


def _in_arrays(model: FmuModel, groups: Iterable[_Group]) -> FmuModel:
    """Return a copy of a model in which groups of variables are arrays.

    Elements are renamed to `q[1]`, `q[2]`, .... Terminals with a renamed member are dropped.

    Args:
        model: model without arrays.
        groups: arrays to form. An array of states also makes an array of their derivatives.
    """
    changed: dict[Kind, list[FmuVariable]] = {
        "state": list(model.states),
        "input": list(model.inputs),
        "output": list(model.outputs),
        "dependent": list(model.dependents),
    }
    arrays = []
    for group in groups:
        if not group.size:
            continue
        variables, indices = changed[group.kind], range(group.first, group.first + group.size)
        owners = ", ".join(variables[k].name.rpartition(".")[0] for k in indices)
        words, first = f"{group.text} {owners}", model.first(group.kind) + group.first
        arrays.append(Array(group.name, first, group.size, words))
        if group.kind == "state":
            rates = model.first("derivative") + group.first
            words = f"derivatives of the {words}"
            arrays.append(Array(f"der({group.name})", rates, group.size, words))
        for number, k in enumerate(indices, 1):
            variables[k] = replace(variables[k], name=f"{group.name}[{number}]")
    if model.slots:
        n, text = len(model.slots), "states of the model"
        arrays.append(Array("state", model.first("slot"), n, text))
        arrays.append(Array("der(state)", model.first("rate"), n, f"derivatives of the {text}"))
    names = {variable.name for variables in changed.values() for variable in variables}
    return replace(
        model,
        states=tuple(v for v in changed["state"] if isinstance(v, FmuState)),
        inputs=tuple(changed["input"]),
        outputs=tuple(changed["output"]),
        dependents=tuple(changed["dependent"]),
        arrays=tuple(arrays),
        terminals=tuple(t for t in model.terminals if {m.variable for m in t.members} <= names),
    )
