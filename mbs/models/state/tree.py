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
from mbs.loops.closure_equations import closure_rows
from mbs.loops.velocity import scales
from mbs.models._direct_dynamics import direct_dynamics, hybrid_dynamics
from mbs.models._energy import energy
from mbs.models._joint_wrenches import shown_outputs
from mbs.models._measurements import with_readings
from mbs.models.contacts import ContactEquations, contact_equations, tree_jump
from mbs.models.state.crossings import (
    drive_crossings,
    held_by,
    with_more_modes,
    with_part_crossings,
)
from mbs.models.state.drive import DriveInputs, TreeMotion, load_of, wrenches_of
from mbs.models.state.events import MinimalEvents, few_modes, join_part_events, minimal_events
from mbs.models.state.independent import (
    Accelerations,
    Observe,
    OutputContext,
    StateEquations,
    minimal_layout,
    motion_of,
    outputs_vector,
    point_of,
    with_laws,
)
from mbs.models.state.laws import TimeLaws, conditions_of, distinct, time_laws
from mbs.models.state.projection import project_step
from mbs.models.state.signals import GivenInput, Prescribed, with_inputs
from mbs.models.state.singular_configurations import passage, without_passages
from mbs.models.symbols import dense_function, outputs_of, part_equations, state_count
from mbs.recursions.parts import PartsAt, after_events
from mbs.solvers.problem import Passage


def _moved(contact: ContactEquations | None, tau: SX) -> tuple[SX | None, SX]:
    """Return accelerations under contacts (None without contacts), and efforts incl. contacts."""
    return (None, tau) if contact is None else (contact.a, tau + contact.pushes)


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
    events: MinimalEvents | None
    rate: Function
    states: tuple[int, ...]
    dependents: tuple[int, ...]
    passive: tuple[int, ...]
    independent: tuple[int, ...]
    units: tuple[float, ...]


def tree_state(
    system: System,
    observe: Observe | None = None,
    drive: DriveInputs | None = None,
    *,
    crossings: bool = False,
) -> TreeState | None:
    """Return the state equation of the tree with the inputs and outputs of `minimal_state`.

    The result is None if motions are inputs, if there are neither dependent positions nor
    nonholonomic constraints, or if `passage` is None for holonomic loops.

    Args:
        system: open or closed system.
        observe: argument of `minimal_state`.
        drive: argument of `minimal_state`.
        crossings: argument of `minimal_state`.
    """
    drive = DriveInputs() if drive is None else drive
    layout = minimal_layout(system, drive)
    slips = system.closure is not None and bool(system.closure.slips)
    if layout.motions or not (layout.dependents or slips):
        return None
    motors = layout.inputs if drive.effort is None else tuple(range(system.nv))
    s = point_of(system, layout, motors)
    nq, nv = system.nq, system.nv
    n = nq + nv
    X, none = casadi.vertcat(SX.sym("X", n), system.z), SX.sym("z", 0)
    q, v = X[:nq], X[nq:n]
    tau, rates, parts = part_equations(system, q, v)
    for column, number in enumerate(motors):
        tau[number] += s.efforts[column]
    external = wrenches_of(system, q, layout.frames, s.wrenches)
    load = load_of(system, q, external)
    contact = contact_equations(system, q, v, tau + load, {})
    point = [s.t, X, none, s.u, system.p]
    known = (q, v, *_moved(contact, tau + load))
    (rates,) = with_readings(system, [rates], known, s.wrenches)
    through = passage(
        system, (s.t, X, system.p), SX(tau + load), rates, contact=contact, inputs=s.u
    )
    whole = [*point[:4], casadi.vertcat(system.p, contact.values) if contact else system.p]
    passes = through is not None
    if through is None and slips:
        through = without_passages(system, whole)
    if through is None:
        return None
    if contact is None:
        (a, _) = outputs_of(system, direct_dynamics(system, coordinates="tree"), q, v, tau + load)
    else:
        a = contact.a
    active = list(system.active)
    response = Accelerations(a[active], a, tau, contact)
    shown = shown_outputs(system, parts, a, response.every_effort + load)
    known = (q, v, a, response.every_effort + load)
    (shown,) = with_readings(system, [shown], known, s.wrenches)
    motion = TreeMotion(q, q, v[active], v, None, SX.zeros(nv))
    y = outputs_vector(system, layout, motion, response, shown)
    if observe is not None:
        seen = (q, v, a, v[active], a[active], response.every_effort)
        y = casadi.vertcat(y, *observe(OutputContext(s.t, system.p, *seen, external)))
    rate = casadi.vertcat(position_rate(system.tree, q, v), a, rates)
    projected = project_step(system, q, v, (), s.t, contact)

    def written(name: str, at: Sequence[SX], outputs: Sequence[SX]) -> Function:
        few, values = few_modes(contact, system.p, outputs)
        return dense_function(name, [*at, few], values)

    rhs = written("tree_rhs", point[:4], [rate, y])
    forces = written("forces", point[:4], through.forces.call(whole))
    events = None
    if contact:
        events = minimal_events(
            contact, motion, point, lambda fired: tree_jump(system, contact, X, fired)
        )
    events = join_part_events(system, events, parts.events(), point)
    few = _mode_count(events)
    events, values = with_part_crossings(system, events, (q, v), point, wanted=crossings)
    rhs, forces = (held_by(function, values, point) for function in (rhs, forces))
    if drive.effort is not None or drive.device is not None:
        at = dense_function("motion", point, [q, v])
        sizes = (len(motors), system.u.numel())
        sizes3 = (*sizes, s.u.numel() - sum(sizes))
        of_drive = drive_crossings(system, drive, layout.extra) if crossings else None
        pushed = with_laws(StateEquations(forces, at, None, sizes3), drive, layout.extra, of_drive)
        moving = with_laws(StateEquations(rhs, at, events, sizes3), drive, layout.extra, of_drive)
        rhs, forces, events = moving.rhs, pushed.rhs, moving.events
    more = _mode_count(events) - few
    inputs = SX.sym("u", rhs.numel_in(3))
    free = [s.t, X, none, inputs]
    first = motion_of(system, layout, s, [])
    start = casadi.vertcat(first.q, first.v, s.states)
    rows, regularity = (
        with_more_modes(written(function.name(), free, function.call(whole)), more)
        for function in (through.rows, through.regularity)
    )
    project = written(
        "tree_project", free, [casadi.vertcat(projected.q, projected.v, X[n:]), projected.residual]
    )
    begin = written("tree_start", [s.t, s.x, s.z, inputs], [start])
    return TreeState(
        rhs=rhs,
        project=with_more_modes(project, more),
        start=with_more_modes(begin, more),
        passage=replace(
            through,
            rows=rows,
            forces=forces,
            regularity=regularity,
        ),
        passes=passes,
        events=events,
        states=(
            *layout.positions,
            *(nq + k for k in layout.velocities),
            *range(n, n + state_count(system)),
        ),
        rate=Function("tree_rate", [X], [casadi.densify(position_rate(system.tree, q, v))]),
        dependents=layout.dependents,
        passive=tuple(nq + k for k in layout.passive),
        independent=layout.velocities,
        units=tuple(scales(system).columns([speed.unit for speed in system.speeds])),
    )


def _mode_count(events: MinimalEvents | None) -> int:
    return 0 if events is None else len(events.modes)


# State equation of the whole tree, with a projection that keeps its loops closed.
#
# Every position and velocity of the tree is a state, so the motion can pass configurations at which
# a choice of independent joints is invalid.


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
        events: `indicators(t, x, p) -> g` and `jump(t, x, p, fired) -> (x, modes)` of rigid stops,
            Coulomb friction and components, or None. Contact modes are the last elements of p.
        passage: functions for steps through singular configurations of the loops, or None.
        crossings: `crossings(t, x, p)`, a column of event indicators; None if the system has
            none. The indicators of the k contacts come first, then the sides, then the counts. A
            law jumps or bends if a side changes its sign, or a count its integer part.
        approaches: `approaches(t, x, p)`, (k, 2), the speeds and paces of the contacts, as
            in `Approach`; None if there are no contacts.
        sides: number of the crossings that may stay at zero or cross it infinitely often, such as
            the velocity in a law of dry friction.
        counts: number of the last crossings, at whose integer values laws jump.
        short: whether a smooth law may act only briefly after a crossing.
        timing: time-dependent parts of efforts, inputs and prescribed motions, or None.
        prepared: cache of the integrator between runs.
    """

    rhs: Function
    project: Function | None
    observe: Function
    events: tuple[Function, Function] | None = None
    passage: Passage | None = None
    crossings: Function | None = None
    approaches: Function | None = None
    sides: int = 0
    counts: int = 0
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
    t, x = SX.sym("t"), casadi.vertcat(SX.sym("x", n), system.z)
    q, v, z, p = x[:nq], x[nq:n], x[n:], system.p
    tau = SX.zeros(system.nv) if effort is None else casadi.densify(effort(t, q, v, p))
    u = SX(DM(system.u_default)) if inputs is None else casadi.densify(SX(inputs(t, q, v, p)))
    for one in given:
        symbol = SX.sym(one.name)
        (tau if one.is_effort else u)[one.index] = symbol
        p = casadi.vertcat(p, symbol)
    delivered, z_rate, parts = part_equations(system, q, v)
    tau += delivered
    known = SX(tau)
    driven = {one.velocity: one.law(t, system.z, system.p)[2] for one in motions}
    contact = contact_equations(system, q, v, tau, driven)
    a, tau = (contact.a, contact.tau) if contact else _accelerations(system, q, v, tau, motions, t)
    every = Accelerations(a, a, tau, contact).every_effort
    y = shown_outputs(system, parts, a, every)
    z_rate, y = with_readings(system, [z_rate, y], (q, v, a, every))
    rate = casadi.vertcat(position_rate(system.tree, q, v), a, z_rate)
    through = passage(system, (t, x, p), known, z_rate, motions, contact, given_inputs=u)
    projected = project_step(system, q, v, motions, t, contact)
    rows = closure_rows(system, q)
    openness = casadi.mmax(casadi.fabs(rows)) if rows.numel() else SX(0)
    E, U = outputs_of(system, energy(system, "tree"), q, v)
    contact_efforts = contact.efforts if contact else SX(0, 1)
    observed = [a, tau, u, y, contact_efforts, E, U, openness]
    has_constraints = system.is_closed or motions or contact or quaternion_slices(system.tree)
    corrected = [casadi.vertcat(projected.q, projected.v, z), projected.residual]
    p = casadi.vertcat(p, contact.values) if contact else p
    signals = effort, inputs
    timing, sides, counts, short = _law_conditions(system, (t, q, v), u, signals, motions, parts)
    given_crossings = parts.crossings()
    contacts = [one for one in given_crossings if not one.pace.is_zero()]
    bends = [one.value for one in given_crossings if one.pace.is_zero()]
    sides = casadi.vertcat(SX(0, 1), *bends, sides)
    crossed = casadi.vertcat(SX(0, 1), *(one.value for one in contacts), sides, counts)
    approaches = parts.approaches(contacts)
    rate, *observed = with_inputs(system, [rate, *observed], u)
    return FullState(
        rhs=dense_function("rhs", [t, x, p], [rate]),
        project=dense_function("project", [t, x, p], corrected) if has_constraints else None,
        observe=dense_function("observe", [t, x, p], observed),
        events=_events(system, contact, parts, [t, x, p], u),
        passage=through,
        crossings=dense_function("crossings", [t, x, p], [crossed]) if crossed.numel() else None,
        sides=sides.numel(),
        counts=counts.numel(),
        approaches=(
            None
            if approaches.is_zero() or not approaches.numel()
            else dense_function("approaches", [t, x, p], [with_inputs(system, [approaches], u)[0]])
        ),
        short=short or len(given_crossings) > 0,
        timing=timing,
    )


def _law_conditions(
    system: System,
    point: tuple[SX, SX, SX],
    u: SX,
    signals: Sequence[Function | None],
    motions: Sequence[Prescribed],
    parts: PartsAt,
) -> tuple[TimeLaws | None, SX, SX, bool]:
    """Return purely time-dependent laws, sides, counts, and the flag `short` of `FullState`.

    Laws jump or bend at sign changes of the sides and at integer values of the counts.

    Args:
        system: open or closed system.
        point: symbols t, q and v.
        u: (nu, 1) values of the inputs of components.
        signals: functions of (t, q, v, p), or None.
        motions: coordinates with prescribed motions.
        parts: equations of all components.
    """
    t, q, v = point
    values = [signal(t, q, v, system.p) for signal in signals if signal is not None]
    values += [law for one in motions for law in one.law(t, system.z, system.p)]
    constants = casadi.vertcat(system.p, parts.modes())
    found = conditions_of(casadi.vertcat(SX(0, 1), *values), t, q, constants)
    own = conditions_of(parts.laws(), SX(0, 1), q, constants)
    crossings, counts = with_inputs(system, own.crossings, u), with_inputs(system, own.counts, u)
    known = [one.value for one in parts.crossings()]
    states = casadi.vertcat(q, v, system.z)
    results = []
    for every, others, of_time in (
        ([*found.crossings, *crossings], known, found.zeros),
        ([*found.counts, *counts], [], found.wholes),
    ):
        kept = list[SX]()
        for value in distinct(every, others):
            if casadi.depends_on(value, states):
                kept.append(value)
            elif casadi.depends_on(value, t):
                of_time.append(value)
        results.append(casadi.vertcat(SX(0, 1), *kept))
    short = bool(found.short or own.short)
    return time_laws(found, t, system.p), results[0], results[1], short


def _events(
    system: System,
    contact: ContactEquations | None,
    parts: PartsAt,
    txp: list[SX],
    u: SX,
) -> tuple[Function, Function] | None:
    """Return the functions of `FullState.events`: events of contacts, then of components."""
    own = parts.events()
    if contact is None and not own:
        return None
    x = txp[1]
    count = contact.indicators.numel() if contact else 0
    fired = SX.sym("fired", count + len(own))
    indicators, after, modes = [SX(0, 1)], x, SX(0, 1)
    if contact:
        indicators.append(contact.indicators)
        after, modes = tree_jump(system, contact, x, fired[:count])
        if own:  # without a contact event, the jump of contacts must not change the state
            jumps = casadi.mmax(fired[:count])
            after = casadi.if_else(jumps, after, x)
            modes = casadi.if_else(jumps, modes, contact.values)
    indicators += [event.when for event in own]
    if own:
        n = x.numel() - system.z.numel()
        after = casadi.vertcat(after[:n], after_events(system, own, fired[count:]))
    watched, after, modes = with_inputs(
        system, [casadi.vertcat(*indicators), SX(after), SX(modes)], u
    )
    outputs = [after, modes] if contact else [after]
    return (
        dense_function("indicators", txp, [watched]),
        dense_function("jump", [*txp, fired], outputs),
    )


def _accelerations(
    system: System, q: SX, v: SX, tau: SX, motions: Sequence[Prescribed], t: SX
) -> tuple[SX, SX]:
    """Return accelerations (nv, 1) of the tree and efforts (nv, 1) including prescribed motions."""
    if not motions:
        ddm = direct_dynamics(system, coordinates="tree")
        return outputs_of(system, ddm, q, v, tau)[0], tau
    hybrid = hybrid_dynamics(system, [motion.name for motion in motions])
    given = casadi.vertcat(*(motion.law(t, system.z, system.p)[2] for motion in motions))
    a, drives, *_ = outputs_of(system, hybrid, q, v, tau, given)
    every = SX(tau)
    for row, motion in enumerate(motions):
        every[motion.velocity] += drives[row]
    return a, every
