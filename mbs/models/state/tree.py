"""State equations of the whole tree: all positions and velocities of the tree are states.

The integration can cross configurations at which the independent joints do not determine the
dependent joints. Inputs and outputs are as in the state equation of the independent joints.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import casadi
from casadi import DM, SX, Function

from mbs.assembly import System
from mbs.assembly.tree import position_rate, quaternion_slices
from mbs.loops.velocity import scales
from mbs.models._energy import energy
from mbs.models.contacts import tree_jump
from mbs.models.state.arguments import Point, StateArguments, state_arguments
from mbs.models.state.control_laws import with_laws_and_crossings
from mbs.models.state.crossing_modes import with_more_modes
from mbs.models.state.crossings import crossings_function, simulation_crossings
from mbs.models.state.drive import TreeMotion
from mbs.models.state.equations import (
    Actions,
    EquationsOfMotion,
    Observe,
    equations_of_motion,
    largest_closure_residual,
    tree_accelerations,
)
from mbs.models.state.events import StateEvents, contact_events, join_part_events
from mbs.models.state.independent import motion_of
from mbs.models.state.laws import TimeLaws
from mbs.models.state.layout import StateInputs
from mbs.models.state.projection import project_step
from mbs.models.state.signals import GivenInput, Prescribed
from mbs.models.state.singular_configurations import passage, without_passages
from mbs.models.symbols import outputs_of, state_count
from mbs.solvers.problem import Passage


@dataclass(frozen=True, slots=True, eq=False)
class TreeEquations:
    """State equation of the tree, in simulations and in FMUs.

    Attributes:
        arguments: arguments of its functions, with the state x = [q; v; states of components].
        at: equations of motion.
        rate: (nx, 1) rate of the state.
        projected: state after one Newton step onto the constraints, and the largest residual
            before.
        events: events of rigid stops, Coulomb friction and components, or None.
        passage: functions for steps through singular configurations of the loops, or None.
    """

    arguments: StateArguments
    at: EquationsOfMotion
    rate: SX
    projected: tuple[SX, SX]
    events: StateEvents | None
    passage: Passage | None


def tree_equations(
    system: System,
    point: Point,
    actions: Actions,
    motions: Sequence[Prescribed] = (),
    inputs: SX | None = None,
    *,
    every_mode: bool = False,
) -> TreeEquations:
    """Return the state equation of the tree.

    Args:
        system: open or closed system.
        point: symbols of the arguments, with the state x = [q; v; states of components].
        actions: efforts, wrenches and prescribed accelerations.
        motions: coordinates with prescribed motions, onto which the state is projected.
        inputs: (nu, 1) values of the inputs of components; None if the inputs are arguments.
        every_mode: attribute of `StateArguments`.
    """
    t, x, *_ = point
    q, v, states = casadi.vertsplit(x, [0, system.nq, system.nq + system.nv, x.numel()])
    motion = TreeMotion(q, q, v[list(system.independent)], v, None, SX.zeros(system.nv))
    at = equations_of_motion(system, motion, actions, tree_accelerations)
    contact = at.response.contact
    arguments = state_arguments(system, point, contact, inputs, every_mode=every_mode)
    projected = project_step(system, q, v, motions, t, contact)
    events = None
    if contact:
        events = contact_events(
            arguments, contact, motion, lambda fired: tree_jump(system, contact, x, fired)
        )
    return TreeEquations(
        arguments=arguments,
        at=at,
        rate=casadi.vertcat(position_rate(system.tree, q, v), at.response.a, at.rates),
        projected=(casadi.vertcat(projected.q, projected.v, states), projected.residual),
        events=join_part_events(system, arguments, events, at.parts.events()),
        passage=passage(system, arguments, at.tau, at.rates, motions, contact),
    )


# State equation of the tree whose inputs are arguments, for FMUs.


@dataclass(frozen=True, slots=True, eq=False)
class TreeState:
    """State equation with state X = [q; v; states of components]; functions have empty z.

    With rigid stops or Coulomb friction, p contains the parameters followed by the modes.

    Attributes:
        rhs: `rhs(t, X, z, u, p) -> (Xdot, y)`; y are the outputs of `MinimalState`.
        project: `project(t, X, z, u, p) -> (X, residual)`, one Newton step onto the loops.
        start: `start(t, x, z, u, p) -> X` from the states x and dependents z of `MinimalState`.
        passage: constraint rows, forces and regularity for steps through singular configurations.
        passes: whether such steps are possible; see `passage`.
        events: events of rigid stops, Coulomb friction and components, or None.
        rate: `rate(X) -> q'`, rates of the positions in X.
        states: indices in X of the states x of `MinimalState`.
        dependents: indices in X of the dependents z of `MinimalState`.
        passive: indices in X of the velocities of the dependent joints.
        independent: indices in v of the independent velocities.
        units: (nv,) typical velocities, comparable for all joints.
    """

    rhs: Function
    project: Function
    start: Function
    passage: Passage
    passes: bool
    events: StateEvents | None
    rate: Function
    states: tuple[int, ...]
    dependents: tuple[int, ...]
    passive: tuple[int, ...]
    independent: tuple[int, ...]
    units: tuple[float, ...]


def tree_state(
    inputs: StateInputs, observe: Observe | None = None, *, crossings: bool = False
) -> TreeState | None:
    """Return the state equation of the tree with the inputs and outputs of `minimal_state`.

    The result is None if motions are inputs, if there are neither dependent positions nor
    nonholonomic constraints, or if `passage` is None for holonomic loops.

    Args:
        inputs: inputs and outputs.
        observe: argument of `minimal_state`.
        crossings: argument of `minimal_state`.
    """
    system, layout, s = inputs.system, inputs.layout, inputs.symbols
    slips = system.closure is not None and bool(system.closure.slips)
    if layout.motions or not (layout.dependents or slips):
        return None
    nq, n = system.nq, system.nq + system.nv
    X, none = casadi.vertcat(SX.sym("X", n), system.component_states), SX.sym("z", 0)
    tree = tree_equations(system, (s.t, X, none, s.u, system.p), inputs.actions())
    arguments, through = tree.arguments, tree.passage
    passes = through is not None
    if through is None and slips:
        through = without_passages(system, arguments)
    if through is None:
        return None
    y = inputs.outputs(tree.at, observe)
    (rhs, forces), events = with_laws_and_crossings(
        inputs,
        arguments,
        tree.at.motion,
        [arguments.function("tree_rhs", [tree.rate, y]), through.forces],
        tree.events,
        crossings=crossings,
    )
    more = _mode_count(events) - _mode_count(tree.events)
    # the other functions do not depend on the inputs, which may be fewer now
    free = replace(arguments, point=(s.t, X, none, SX.sym("u", rhs.numel_in(3)), system.p))

    def idle(name: str, outputs: Sequence[SX]) -> Function:
        return with_more_modes(free.function(name, outputs), more)

    first = motion_of(system, layout, s)
    start = replace(free, point=(s.t, s.x, s.z, free.point[3], system.p))
    begin = start.function("tree_start", [casadi.vertcat(first.q, first.v, s.states)])
    return TreeState(
        rhs=rhs,
        project=idle("tree_project", tree.projected),
        start=with_more_modes(begin, more),
        passage=replace(
            through,
            rows=idle("rows", through.rows.call(arguments.symbols)),
            forces=forces,
            regularity=idle("regularity", through.regularity.call(arguments.symbols)),
        ),
        passes=passes,
        events=events,
        states=(
            *layout.positions,
            *(nq + k for k in layout.velocities),
            *range(n, n + state_count(system)),
        ),
        rate=Function("tree_rate", [X], [casadi.densify(tree.rate[:nq])]),
        dependents=layout.dependents,
        passive=tuple(nq + k for k in layout.passive),
        independent=layout.velocities,
        units=tuple(scales(system).columns([speed.unit for speed in system.velocity_coordinates])),
    )


def _mode_count(events: StateEvents | None) -> int:
    return 0 if events is None else len(events.modes)


# State equation of the tree whose efforts and inputs are laws, for simulations.


@dataclass(frozen=True, slots=True, eq=False)
class FullState:
    """State equation of the whole tree with state x = [q; v; z], z the states of components.

    Attributes:
        rhs: `rhs(t, x, p) -> xdot`.
        project: `project(t, x, p) -> (x, residual)`, one Newton step onto loop closure, unit
            quaternions and prescribed motions, or None without such constraints.
        observe: `observe(t, x, p) -> a, tau, u, y, contacts, E, U, openness`, the quantities of a
            result in addition to x. u and y are inputs and outputs of the components, `contacts`
            the efforts of rigid stops and Coulomb friction, E and U kinetic and potential energy,
            `openness` the largest closure residual.
        events: events of rigid stops, Coulomb friction and components, or None. Contact modes are
            the last elements of p.
        passage: functions for steps through singular configurations of the loops, or None.
        crossings: `crossings(t, x, p)` with the outputs of `WatchedCrossings`, or None if the
            system has none. Sides may stay at zero or cross it infinitely often, such as the
            velocity in a law of dry friction.
        short: whether a smooth law may act only briefly after a crossing.
        timing: time-dependent parts of efforts, inputs and prescribed motions, or None.
        prepared: cache of the integrator between runs.
    """

    rhs: Function
    project: Function | None
    observe: Function
    events: StateEvents | None = None
    passage: Passage | None = None
    crossings: Function | None = None
    short: bool = False
    timing: TimeLaws | None = None
    prepared: dict[Any, Any] = field(default_factory=dict)


def full_state(
    system: System,
    effort: Function | None = None,
    inputs: Function | None = None,
    motions: Sequence[Prescribed] = (),
    given: Sequence[GivenInput] = (),
) -> FullState:
    """Return the state equation of the whole tree for given joint efforts and component inputs.

    Args:
        system: open or closed system.
        effort: `effort(t, q, v, p) -> tau`, (nv, 1) joint efforts in addition to the efforts of
            components; None for zero.
        inputs: `inputs(t, q, v, p) -> u`, (nu, 1) inputs of components; None for default values.
        motions: coordinates with prescribed motions; their drive efforts are added to tau.
        given: efforts and inputs that are constants of a simulation run. They are the last elements
            of p and replace the values of `effort` and `inputs`.
    """
    nq, n = system.nq, system.nq + system.nv
    t, x = SX.sym("t"), casadi.vertcat(SX.sym("x", n), system.component_states)
    q, v, p = x[:nq], x[nq:n], system.p
    tau = SX.zeros(system.nv) if effort is None else casadi.densify(effort(t, q, v, p))
    u = SX(DM(system.u_default)) if inputs is None else casadi.densify(SX(inputs(t, q, v, p)))
    for one in given:
        symbol = SX.sym(one.name)
        (tau if one.is_effort else u)[one.index] = symbol
        p = casadi.vertcat(p, symbol)
    driven = {one.velocity: one.law(t, system.component_states, system.p)[2] for one in motions}
    tree = tree_equations(system, (t, x, p), Actions(tau, driven), motions, u, every_mode=True)
    arguments, response, parts = tree.arguments, tree.at.response, tree.at.parts
    contact = response.contact
    openness = largest_closure_residual(system, q)
    E, U = outputs_of(system, energy(system, "tree"), q, v)
    contact_efforts = contact.efforts if contact else SX(0, 1)
    shown = [response.a, response.tau, u, tree.at.shown, contact_efforts, E, U, openness]
    has_constraints = system.is_closed or motions or contact or quaternion_slices(system.tree)
    laws = [law(t, q, v, system.p) for law in (effort, inputs) if law is not None]
    laws += [law for one in motions for law in one.law(t, system.component_states, system.p)]
    found = simulation_crossings(system, (t, q, v), u, laws, parts)
    return FullState(
        rhs=arguments.function("rhs", [tree.rate]),
        project=arguments.function("project", tree.projected) if has_constraints else None,
        observe=arguments.function("observe", shown),
        events=tree.events,
        passage=tree.passage,
        crossings=crossings_function(arguments, found.crossings),
        short=found.short,
        timing=found.timing,
    )
