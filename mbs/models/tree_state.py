"""The state equation of the whole tree with the inputs and outputs of the independent one.

What integrates it passes configurations in which the independent joints determine nothing, and
shows the same outputs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import casadi
from casadi import SX, Function

from mbs.assembly import System
from mbs.assembly.rates import position_rate
from mbs.loops.scales import scales
from mbs.models.composition import dense_function, outputs_of
from mbs.models.contact_dynamics import contact_equations
from mbs.models.devices import device_equations, state_count
from mbs.models.direct_dynamics import direct_dynamics
from mbs.models.impacts import tree_jump
from mbs.models.minimal_accelerations import Accelerations
from mbs.models.minimal_contacts import MinimalEvents, few_modes, minimal_events
from mbs.models.minimal_controller import StateEquations, controlled
from mbs.models.minimal_drive import DriveInputs
from mbs.models.minimal_layout import minimal_layout
from mbs.models.minimal_motion import TreeMotion, load_of, wrenches_of
from mbs.models.minimal_state import Observe, Seen, motion_of, outputs_vector, point_of
from mbs.models.passage import passage
from mbs.models.projection import projected
from mbs.solvers.passage import Passage


@dataclass(frozen=True, slots=True, eq=False)
class TreeState:
    """A state equation of X = [q; v; states of devices]; functions take (t, X, z, u, p), z empty.

    Where rigid stops or dry friction act, p has their modes behind the parameters.

    Attributes:
        rhs: `rhs(t, X, z, u, p) -> (Xdot, y)`, y the outputs of the independent state equation.
        project: `project(t, X, z, u, p) -> (X, residual)`, one Newton step onto the loops.
        start: `start(t, x, z, u, p) -> X` of states x and dependents z of the independent one.
        passage: of rows, forces and regularity.
        events: of rigid stops and dry friction; None where there are none.
        rate: `rate(X) -> q'`, the rates of the positions in X.
        states: numbers in X of the states x.
        dependents: numbers in X of the dependents z.
        passive: numbers in X of the velocities of the dependent joints.
        held: numbers in v of the independent velocities.
        units: (nv,) typical velocities, of one size for all joints.
    """

    rhs: Function
    project: Function
    start: Function
    passage: Passage
    events: MinimalEvents | None
    rate: Function
    states: tuple[int, ...]
    dependents: tuple[int, ...]
    passive: tuple[int, ...]
    held: tuple[int, ...]
    units: tuple[float, ...]


def tree_state(
    system: System, observe: Observe | None = None, drive: DriveInputs | None = None
) -> TreeState | None:
    """The state equation of the tree; None where it has no advantage, or is not known.

    Args:
        system: open or closed.
        observe: as of `minimal_state`, likewise the next one.
        drive: motions that are inputs are left to the independent state equation.
    """
    drive = DriveInputs() if drive is None else drive
    layout = minimal_layout(system, drive)
    if not layout.dependents or layout.motions:
        return None
    motors = layout.inputs if drive.effort is None else tuple(range(system.nv))
    s = point_of(system, layout, motors)
    nq, nv = system.nq, system.nv
    n = nq + nv
    X, none = SX.sym("X", n + state_count(system)), SX.sym("z", 0)
    q, v = X[:nq], X[nq:n]
    tau, rates, shown = device_equations(system, v, X[n:], s.inputs)
    for column, number in enumerate(motors):
        tau[number] += s.efforts[column]
    external = wrenches_of(system, q, layout.frames, s.wrenches)
    load = load_of(system, q, external)
    contact = contact_equations(system, q, v, tau + load, {})
    point = [s.t, X, none, s.u, system.p]
    through = passage(
        system, (s.t, X, system.p), SX(tau + load), rates, contact=contact, inputs=s.u
    )
    if through is None:
        return None
    if contact is None:
        (a, _) = outputs_of(system, direct_dynamics(system, coordinates="tree"), q, v, tau + load)
    else:
        a = contact.a
    active = list(system.active)
    moved = Accelerations(a[active], a, tau, contact)
    motion = TreeMotion(q, q, v[active], v, None, SX.zeros(nv))
    y = outputs_vector(system, layout, motion, moved, shown)
    if observe is not None:
        seen = (q, v, a, v[active], a[active], moved.every_effort)
        y = casadi.vertcat(y, *observe(Seen(s.t, system.p, *seen, external)))
    rate = casadi.vertcat(position_rate(system.tree, q, v), a, rates)
    touch = (contact.contacts, contact.modes) if contact else None
    *kept, residual = projected(system, q, v, (), s.t, touch)

    def written(name: str, at: Sequence[SX], outputs: Sequence[SX]) -> Function:
        few, values = few_modes(contact, system.p, outputs)
        return dense_function(name, [*at, few], values)

    whole = [*point[:4], casadi.vertcat(system.p, contact.values) if contact else system.p]
    rhs = written("tree_rhs", point[:4], [rate, y])
    forces = written("forces", point[:4], through.forces.call(whole))
    events = None
    if contact:
        events = minimal_events(
            contact, motion, point, lambda fired: tree_jump(system, contact, X, fired)
        )
    if drive.effort is not None or drive.device is not None:
        at = dense_function("motion", point, [q, v])
        sizes = (len(motors), len(system.devices))
        sizes3 = (*sizes, s.u.numel() - sum(sizes))
        pushed = controlled(StateEquations(forces, at, None, sizes3), drive, layout.extra)
        moving = controlled(StateEquations(rhs, at, events, sizes3), drive, layout.extra)
        rhs, forces, events = moving.rhs, pushed.rhs, moving.events
    inputs = SX.sym("u", rhs.numel_in(3))
    free = [s.t, X, none, inputs]
    first = motion_of(system, layout, s, [])
    start = casadi.vertcat(first.q, first.v, s.states)
    rows, regularity = (
        written(function.name(), free, function.call(whole))
        for function in (through.rows, through.regularity)
    )
    return TreeState(
        rhs=rhs,
        project=written("tree_project", free, [casadi.vertcat(*kept, X[n:]), residual]),
        start=written("tree_start", [s.t, s.x, s.z, inputs], [start]),
        passage=replace(through, rows=rows, forces=forces, regularity=regularity),
        events=events,
        states=(
            *layout.positions,
            *(nq + k for k in layout.velocities),
            *range(n, n + state_count(system)),
        ),
        rate=Function("tree_rate", [X], [casadi.densify(position_rate(system.tree, q, v))]),
        dependents=layout.dependents,
        passive=tuple(nq + k for k in layout.passive),
        held=layout.velocities,
        units=tuple(scales(system).columns([speed.unit for speed in system.speeds])),
    )
