"""State equations of the whole tree: all positions and velocities of the tree are states.

The integration can cross configurations at which the independent joints do not determine the
dependent joints. Inputs and outputs are as in the state equation of the independent joints.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import casadi
import numpy as np
from casadi import DM, SX, Function
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.assembly.tree import norm_rows, normalised, position_rate, quaternion_slices
from mbs.loops.closing import constraint_sizes, relative_rows
from mbs.loops.closure import closure_rows, independent_closure
from mbs.loops.velocity import (
    acceleration_bias,
    constraint_rows,
    independent_constraint_rows,
    independent_drift,
    kept_rows,
    scales,
)
from mbs.models.contacts import ContactEquations, Contacts, Modes, contact_equations, tree_jump
from mbs.models.direct_dynamics import direct_dynamics, hybrid_dynamics, inertia_matrix
from mbs.models.energy import energy
from mbs.models.inverse_dynamics import bias
from mbs.models.joint_wrenches import shown_outputs
from mbs.models.measurements import with_readings
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
    Seen,
    StateEquations,
    minimal_layout,
    motion_of,
    outputs_vector,
    point_of,
    with_laws,
)
from mbs.models.state.laws import TimeLaws, conditions_of, distinct, time_laws
from mbs.models.state.signals import GivenInput, Prescribed
from mbs.models.symbols import dense_function, outputs_of, part_equations, state_count
from mbs.recursions.parts import PartsAt, after_events
from mbs.solvers.linear import partial_ldl
from mbs.solvers.problem import Passage

# One Newton step of a state of the whole tree onto its constraints.


Array = NDArray[np.float64]

_NEARLY_DEPENDENT = 1e-6
"""Squared sine between a row and the span of the rows before, below which the row is skipped."""
_ASLEEP = 1e-6
"""Weight of the residual while a row is skipped."""
_SHARED = 1e-4
"""Regularisation that is added to the squares of contact rows, which may depend on other rows.
Convergence is as fast as without it."""
_NEVER = 1e300
"""Pivot of a skipped row: division by it makes its correction zero."""


def project_step(
    system: System,
    q: SX,
    v: SX,
    motions: Sequence[Prescribed],
    t: SX,
    touch: tuple[Contacts, Modes] | None = None,
) -> tuple[SX, SX, SX]:
    """Project positions and velocities by one Newton step onto the constraints.

    The constraints are loop closure, unit quaternions, prescribed motions and contacts. The step
    uses the independent rows of the loops, because a dependent row is only nearly dependent off
    the loops and would amplify rounding. Near a singular configuration, a row that nearly depends
    on the others is skipped, and the residual is weighted by 1e-6 meanwhile.

    Args:
        system: open or closed system.
        q: (nq, 1) positions.
        v: (nv, 1) velocities.
        motions: prescribed motions.
        t: time [s].
        touch: contacts and their modes, or None.

    Returns:
        q (nq, 1) and v (nv, 1) after the step, and the largest residual before it, over all rows,
        with lengths relative to the size of the mechanism.
    """
    if not system.is_closed and not motions and touch is None:
        return normalised(system.tree, q), v, SX(0)
    symbols = SX.sym("q", system.nq)
    norms = norm_rows(system.tree, symbols)
    laws = [motion.law(t, system.z, system.p) for motion in motions]
    positions = [
        symbols[motion.position] - law[0]
        for motion, law in zip(motions, laws, strict=True)
        if motion.position is not None
    ]
    loops, measures, drift = SX(0, 1), SX(0, 1), None
    J = SX(0, system.nv)
    if system.is_closed:
        loops = independent_closure(system, symbols)
        measures = constraint_sizes(system)[kept_rows(system), :]  # (0, 1) if no row is kept
        J = independent_constraint_rows(system, symbols)
        drift = independent_drift(system, symbols)
    found = scales(system)
    q_scales, v_scales = (
        found.columns([row.unit for row in table]) for table in (system.coordinates, system.speeds)
    )
    distance, limit_off, still, slide_off, sizes = _touch(system, symbols, v, touch, v_scales)
    r = casadi.vertcat(loops, norms, *positions, distance)
    J_q = casadi.jacobian(r, symbols)
    prescribed = [
        (m.velocity, law[1]) for m, law in zip(motions, laws, strict=True) if m.holds_speed
    ]
    E = SX(DM.eye(system.nv))[[k for k, _ in prescribed], :]
    first_target = SX(J.shape[0], 1) if drift is None else -drift
    J = casadi.vertcat(J, E)
    target = casadi.vertcat(first_target, *(v_p for _, v_p in prescribed))
    J = casadi.vertcat(J, casadi.jacobian(still, v))
    speed = casadi.vertcat(casadi.mtimes(J[: target.numel(), :], v) - target, still)
    first = found.rows[kept_rows(system)]
    step_q, _ = _shortest(J_q, r, limit_off, first[: loops.numel()], q_scales, sizes)
    step_v, awake = _shortest(J, speed, slide_off, first, v_scales, sizes)
    relative = casadi.vertcat(speed[: measures.numel(), 0] / measures, speed[measures.numel() :, 0])
    rows = casadi.vertcat(relative_rows(system, symbols), *positions, distance, relative)
    residual = casadi.if_else(awake, 1, _ASLEEP) * casadi.mmax(casadi.fabs(rows))
    values = casadi.substitute([*map(casadi.densify, (step_q, step_v)), residual], [symbols], [q])
    return q - values[0], v - values[1], values[2]


def _touch(
    system: System, q: SX, v: SX, touch: tuple[Contacts, Modes] | None, columns: Array
) -> tuple[SX, SX, SX, SX, SX]:
    """Return position rows of stops and velocity rows of stuck contacts, with their switches.

    Order: position rows, their `_switch`, velocity rows, their `_switch`, and the factors that
    scale velocity rows to unit length. `columns` are the scales of v.
    """
    if touch is None:
        return SX(0, 1), SX(0, 1), SX(0, 1), SX(0, 1), SX(0, 1)
    contacts, modes = touch
    sizes = DM(1 / np.linalg.norm(contacts.levers * columns, axis=1))
    return (
        contacts.distance(q, modes.limit),
        _switch(modes.limit**2),
        modes.stuck * contacts.velocity(q, v),
        _switch(modes.stuck),
        SX(sizes),
    )


def _switch(acting: SX) -> SX:
    """Return the addition to the squared norms of rows: 1 for an inactive row, which is zero."""
    return casadi.if_else(acting, _SHARED, 1)


def _shortest(J: SX, r: SX, off: SX, first: Array, columns: Array, last: SX) -> tuple[SX, SX]:
    """Solve J x = r for the minimum-norm x, skipping nearly dependent rows.

    Return x, and 1 if all rows are independent, else 0.

    Args:
        J: rows of loops, then rows on one coordinate each, then switched rows of contacts.
        r: right-hand side.
        off: additions to the squared norms of the switched rows, from `_switch`.
        first: scales of the rows of the loops; all other rows are scaled to unit length.
        columns: scales of the columns.
        last: scales of the switched rows.
    """
    if J.shape[0] == 0:
        return SX.zeros(J.shape[1]), SX(1)
    middle = range(len(first), J.shape[0] - last.numel())
    rows: Any = DM([*first, *(_unit(J[k, :], columns) for k in middle)])
    if last.numel():
        rows = casadi.vertcat(rows, last)
    B = rows * casadi.mtimes(J, casadi.diag(DM(columns)))
    every = casadi.vertcat(SX(J.shape[0] - off.numel(), 1), off)
    S = casadi.sparsify(casadi.mtimes(B, B.T)) + casadi.diag(every)
    squares = casadi.fmax(casadi.densify(casadi.diag(S)), 1)
    D, LT, order, independent = partial_ldl(S, _NEARLY_DEPENDENT * squares)
    x = casadi.ldl_solve(rows * r, casadi.if_else(independent, D, _NEVER), LT, order)
    return DM(columns) * casadi.mtimes(B.T, casadi.densify(x)), casadi.mmin(independent)


def _unit(row: SX, columns: Array) -> float:
    """Return the scale of a row on one coordinate or on one quaternion."""
    columns_of_row = casadi.sparsify(row).sparsity().get_triplet()[1]
    return 1 / float(columns[columns_of_row[0]]) if columns_of_row else 1.0


# Functions for steps in local tangent coordinates: constraint rows, inertia and forces.
#
# Dependent rows of the loops are included, because the rows that are independent in the assembled
# configuration may become dependent later. The rank is that of the assembly, not from a threshold.


def passage(
    system: System,
    point: tuple[SX, SX, SX],
    tau: SX,
    rates: SX,
    motions: Sequence[Prescribed] = (),
    contact: ContactEquations | None = None,
    inputs: SX | None = None,
    given_inputs: SX | None = None,
) -> Passage | None:
    """Return the functions for steps through singular configurations of the loops, or None.

    None for open chains and for nonholonomic constraints. While a contact sticks on a velocity
    without a corresponding position, every configuration counts as regular.

    Args:
        system: open or closed system.
        point: symbols t, x = [q; v; z] and p, without modes.
        tau: (nv, 1) joint efforts, without prescribed motions and contacts.
        rates: (nz, 1) rates of the states z of components.
        motions: coordinates with prescribed motions.
        contact: equations of rigid stops and Coulomb friction, or None.
        inputs: inputs u. If given, the functions take (t, x, z, u, p) with empty z.
        given_inputs: (nu, 1) values that replace the inputs of components, or None.
    """
    closure = system.closure
    if closure is None or closure.slips:
        return None
    driven = [motion.position for motion in motions if motion.position is not None]
    if len(driven) < len(motions):
        return None
    t, x, p = point
    nq, nv = system.nq, system.nv
    q, v = SX.sym("q", nq), SX.sym("v", nv)
    J = casadi.sparsify(constraint_rows(system, q))
    moving = sorted(set(J.sparsity().row()))  # structurally zero rows are dropped
    if not moving:
        return None
    J = J[moving, :]
    scale = DM(scales(system).rows[moving])
    bend = acceleration_bias(system, q, v, J)
    loops = (
        scale * closure_rows(system, q)[moving],
        casadi.mtimes(casadi.diag(scale), J),
        -scale * bend,
    )
    count, held = loops[0].numel(), list[int]()
    laws = [motion.law(t, system.z, system.p) for motion in motions]
    unit = SX(DM.eye(nv))
    drives = [m.velocity for m in motions]
    driven_rows = [q[number] - law[0] for number, law in zip(driven, laws, strict=True)]
    braked = SX(tau)
    anchors: list[SX] = []
    E, bends, loose = SX(0, nv), SX(0, 1), list[int]()
    if contact is not None:
        modes, contacts = contact.modes, contact.contacts
        places = {j: x for j, x in enumerate(contacts.anchors) if x is not None}
        held, stuck, state = list(places), modes.stuck[list(places)], contact.state
        loose = [j for j in range(len(contacts)) if j not in places]
        p = casadi.vertcat(p, contact.values)
        braked -= casadi.mtimes(state.rows.T, modes.slide * state.sliding)
        own = [contacts.state.rows[held, :], contacts.state.bias[held], *places.values()]
        known: list[SX] = casadi.substitute(own, [contacts.q, contacts.v], [q, v])
        anchors = [stuck[j] * anchor for j, anchor in enumerate(known[2:])]
        E = casadi.mtimes(casadi.diag(stuck), known[0])
        bends = -stuck * known[1]
    norms = norm_rows(system.tree, q)
    positions = casadi.vertcat(loops[0], *driven_rows, *anchors, norms)
    speeds = casadi.vertcat(loops[1], unit[drives, :], E)
    still = SX.zeros(len(anchors))
    b = casadi.vertcat(SX.zeros(count), *(law[1] for law in laws), still)
    c = casadi.vertcat(loops[2], *(law[2] for law in laws), bends)
    has_quaternions = nq > nv  # otherwise q' = v, and the Jacobian of `positions` is sufficient
    rate = position_rate(system.tree, q, v)
    rank = len(closure.rows) + len(motions) + (_count_stuck(contact, held) if contact else 0)
    rows = [
        positions,
        casadi.jacobian(positions, q),
        speeds if has_quaternions else SX(0, nv),
        b,
        c,
        casadi.jacobian(rate, v) if has_quaternions else SX(0, nv),
        casadi.jtimes(rate, q, rate) if has_quaternions else SX(0, 1),
        SX(rank),
    ]
    at = [x[:nq], x[nq : nq + nv]]
    rows = casadi.substitute([casadi.densify(row) for row in rows], [q, v], at)
    (M,) = outputs_of(system, inertia_matrix(system, "tree"), at[0])
    (H,) = outputs_of(system, bias(system, "tree"), *at)
    forces = [M, braked - H, rates]
    if given_inputs is not None:
        forces = with_inputs(system, forces, given_inputs)
    measure = _regularity(system, q, unit[drives, :])
    regularity = casadi.substitute(measure, q, at[0])
    typical = _typical(system, q, measure)
    if contact is not None and loose:  # contacts that stick without a position need full steps
        sticks = casadi.mmax(contact.modes.stuck[loose])
        regularity = casadi.if_else(sticks, max(typical, 1.0), regularity)
    txp = [t, x, p] if inputs is None else [t, x, SX.sym("z", 0), inputs, p]
    sizes = (nq, nv, rates.numel(), positions.numel(), len(anchors))
    return Passage(
        rows=_mostly_dense("rows", txp, rows),
        forces=_mostly_dense("forces", txp, forces),
        regularity=dense_function("regularity", txp, [regularity]),
        size=(*sizes, speeds.shape[0], int(bool(laws))),
        typical=typical,
    )


def _moved(contact: ContactEquations | None, tau: SX) -> tuple[SX | None, SX]:
    """Return accelerations under contacts (None without contacts), and efforts incl. contacts."""
    return (None, tau) if contact is None else (contact.a, tau + contact.pushes)


def _without_passages(system: System, point: tuple[SX, SX, SX, SX]) -> Passage:
    """Return placeholder functions without constraints; every configuration counts as regular."""
    t, X, u, p = point
    nq, nv = system.nq, system.nv
    at = [t, X, SX.sym("z", 0), u, p]
    wide = nq > nv
    rows = [
        *(SX(0, 1), SX(0, nq), SX(0, nv), SX(0, 1), SX(0, 1)),
        SX.zeros(nq, nv) if wide else SX(0, nv),
        SX.zeros(nq) if wide else SX(0, 1),
        SX(0),
    ]
    forces = [SX.zeros(nv, nv), SX.zeros(nv), SX.zeros(system.z.numel())]
    return Passage(
        rows=dense_function("rows", at, rows),
        forces=dense_function("forces", at, forces),
        regularity=dense_function("regularity", at, [SX(1)]),
        size=(nq, nv, system.z.numel(), 0, 0, 0, 0),
        typical=1.0,
    )


_LARGE = 100
"""Largest number of elements of an output whose zeros are stored. Each zero is a line of C code,
and the compile time grows more than linearly. Steps in tangent coordinates skip zeros."""


def _mostly_dense(name: str, inputs: Sequence[SX], outputs: Sequence[SX]) -> Function:
    """Return a Function with dense outputs, except for large outputs that are mostly zero."""
    values = [casadi.densify(value) for value in outputs]
    for k, value in enumerate(values):
        if value.numel() > _LARGE and 2 * (few := casadi.sparsify(value)).nnz() < value.numel():
            values[k] = few
    return Function(name, list(inputs), values, {"cse": True})


def _count_stuck(contact: ContactEquations, rows: Sequence[int]) -> SX:
    """Return the number of stuck contact rows, equal rows counted once."""
    groups, stuck = contact.contacts.groups, contact.modes.stuck
    kept = dict.fromkeys(groups[j] for j in rows)
    same = [[j for j in rows if groups[j] == k] for k in kept]
    return sum((casadi.mmax(stuck[rows]) for rows in same), SX(0))


def _regularity(system: System, q: SX, drives: SX) -> SX:
    """Return the smallest sine between a kept constraint row and the span of the rows before.

    The measure is zero at a singular configuration, and linear in the path nearby.
    """
    found = scales(system)
    columns = DM(found.columns([speed.unit for speed in system.speeds]))
    J = casadi.vertcat(
        DM(found.rows[kept_rows(system)]) * independent_constraint_rows(system, q), drives
    )
    if J.shape[0] == 0:  # no independent constraint
        return SX(1)
    B = casadi.mtimes(J, casadi.diag(columns))
    squares = casadi.fmax(casadi.sum2(B * B), 1)  # a single row may become zero as well
    D, _, order = casadi.ldl(casadi.sparsify(casadi.mtimes(B, B.T)))
    return casadi.sqrt(casadi.fmax(casadi.mmin(D / squares[order]), 0))


def _typical(system: System, q: SX, measure: SX) -> float:
    """Return the regularity at the assembled configuration, 0 if parameters have no value."""
    found = Function("typical", [q, system.p], [measure])
    value = float(found(np.array(system.configuration), system.p_default))
    return value if np.isfinite(value) else 0.0


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
        through = _without_passages(system, (s.t, X, s.u, whole[4]))
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
        y = casadi.vertcat(y, *observe(Seen(s.t, system.p, *seen, external)))
    rate = casadi.vertcat(position_rate(system.tree, q, v), a, rates)
    touch = (contact.contacts, contact.modes) if contact else None
    *kept, residual = project_step(system, q, v, (), s.t, touch)

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
    project = written("tree_project", free, [casadi.vertcat(*kept, X[n:]), residual])
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
    touch = (contact.contacts, contact.modes) if contact else None
    *kept, residual = project_step(system, q, v, motions, t, touch)
    rows = closure_rows(system, q)
    openness = casadi.mmax(casadi.fabs(rows)) if rows.numel() else SX(0)
    E, U = outputs_of(system, energy(system, "tree"), q, v)
    contact_efforts = contact.efforts if contact else SX(0, 1)
    observed = [a, tau, u, y, contact_efforts, E, U, openness]
    keeps = system.is_closed or motions or touch or quaternion_slices(system.tree)
    corrected = [casadi.vertcat(*kept, z), residual]
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
        project=dense_function("project", [t, x, p], corrected) if keeps else None,
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


def with_inputs(system: System, values: Sequence[SX], u: SX) -> list[SX]:
    """Substitute values u (nu, 1) for the input symbols of components in expressions."""
    if not system.u.numel():
        return [SX(value) for value in values]
    dense = [casadi.densify(SX(value)) for value in values]
    return [SX(value) for value in casadi.substitute(dense, [system.u], [casadi.densify(u)])]


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
