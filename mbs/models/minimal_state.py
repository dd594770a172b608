"""The state equation of the independent joints, the others solved for.

It is what an importer of an FMU expects: states that may be set freely, and no drift.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from itertools import accumulate

import casadi
import numpy as np
from casadi import SX, Function

from mbs.assembly import System
from mbs.assembly.rates import position_rate, quaternion_slices
from mbs.loops.closure import facing, square_closure
from mbs.loops.sizes import relative_rows
from mbs.models.composition import dense_function
from mbs.models.contacts import contacts_of, require_lasting_rows
from mbs.models.devices import device_equations, state_count
from mbs.models.geometry import terminal_frame
from mbs.models.minimal_accelerations import Accelerations, minimal_accelerations
from mbs.models.minimal_contacts import MinimalEvents, at_limits, few_modes, minimal_events
from mbs.models.minimal_controller import StateEquations, controlled
from mbs.models.minimal_drive import DriveInputs
from mbs.models.minimal_jump import minimal_jump
from mbs.models.minimal_layout import MinimalLayout, minimal_layout
from mbs.models.minimal_motion import (
    TreeMotion,
    input_motions,
    load_of,
    tree_motion,
    wrenches_of,
)
from mbs.models.minimal_orientation import NORM_RATE, state_rates, tied, with_unit_length
from mbs.recursions.route import relative_pose
from mbs.solvers.newton_step import newton_step
from mbs.spatial import Wrench

__all__ = ["DriveInputs", "MinimalState", "Observe", "Seen", "consistent_start", "minimal_state"]


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """A motion and what makes it, for outputs.

    Attributes:
        t: time [s].
        p: (np, 1) parameters of the system.
        q: (nq, 1) positions, quaternions of unit length.
        v: (nv, 1) velocities of the tree.
        a: (nv, 1) accelerations of the tree.
        v_a: (m, 1) velocities of the independent joints.
        a_a: (m, 1) accelerations of the independent joints.
        tau: (nv, 1) joint efforts: motors, devices, prescribed motions and contacts.
        external: for some links the wrench that they exert on what pushes them, about and in their
            frames.
    """

    t: SX
    p: SX
    q: SX
    v: SX
    a: SX
    v_a: SX
    a_a: SX
    tau: SX
    external: dict[int, Wrench]


Observe = Callable[[Seen], Sequence[SX]]
"""What else is seen of a motion."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class MinimalState(MinimalLayout):
    """A state equation; what stands where in x, z, u and y tells `MinimalLayout`.

    Attributes:
        rhs: `rhs(t, x, z, u, p) -> (xdot, y)`; p are the parameters, here and in `events` with the
            modes behind them.
        closure: `closure(x, z, p) -> (z_next, residual)`, one Newton step; None in open chains.
        slopes: `slopes(x, z, p) -> J`, how the equations that the Newton step solves change with z,
            (nz, nz); None in open chains, and where they are of least squares, whose determinant
            has no sign.
        events: of rigid stops and dry friction; None where there are none.
    """

    rhs: Function
    closure: Function | None
    slopes: Function | None
    events: MinimalEvents | None


def minimal_state(
    system: System, observe: Observe | None = None, drive: DriveInputs | None = None
) -> MinimalState:
    """The state equation of the independent joints.

    Args:
        system: open or closed.
        observe: what else the outputs end with.
        drive: what drives it beside, or in place of, the efforts of motors and the inputs of
            devices.

    Raises:
        ModelError: a drive does not fit the system, or the independent rows of the loops change
            with the posture, which contacts do not follow.
    """
    require_lasting_rows(system, contacts_of(system))
    drive = DriveInputs() if drive is None else drive
    layout = minimal_layout(system, drive)
    equations = _equations(system, observe, layout, drive)
    if drive.effort is not None or drive.device is not None:
        equations = controlled(equations, drive, layout.extra)
    closure, slopes = _closure_step(system, layout) if layout.dependents else (None, None)
    return MinimalState(
        **{field.name: getattr(layout, field.name) for field in fields(layout)},
        rhs=equations.rhs,
        closure=closure,
        slopes=slopes,
        events=equations.events,
    )


@dataclass(frozen=True, slots=True, eq=False)
class StatePoint:
    """Symbols, and the parts of x and u."""

    t: SX
    x: SX
    z: SX
    u: SX
    q: SX
    v: SX
    states: SX
    efforts: SX
    inputs: SX
    wrenches: SX
    motions: SX


def point_of(system: System, layout: MinimalLayout, motors: Sequence[int]) -> StatePoint:
    """Symbols of a state equation.

    Args:
        system: open or closed.
        layout: what stands where.
        motors: numbers in v of the efforts in u.
    """
    in_x = [len(layout.positions), len(layout.velocities), state_count(system)]
    in_u = [len(motors), len(system.devices), 6 * len(layout.frames)]
    in_u.append(sum(motion.size for motion in layout.motions))
    x, u = SX.sym("x", sum(in_x)), SX.sym("u", sum(in_u))
    parts = (*_split(x, in_x), *_split(u, in_u))
    return StatePoint(SX.sym("t"), x, SX.sym("z", len(layout.dependents)), u, *parts)


def _split(values: SX, sizes: Sequence[int]) -> list[SX]:
    return list(casadi.vertsplit(values, [0, *accumulate(sizes)]))


def _equations(
    system: System, observe: Observe | None, layout: MinimalLayout, drive: DriveInputs
) -> StateEquations:
    """The functions, where u has no w, and all efforts and inputs of devices that laws give."""
    motors = layout.inputs if drive.effort is None else tuple(range(system.nv))
    s = point_of(system, layout, motors)
    laws = input_motions(layout.motions, s.motions)
    motion = motion_of(system, layout, s, laws)
    tau, rates, shown = device_equations(system, motion.v, s.states, s.inputs)
    for column, number in enumerate(motors):
        tau[number] += s.efforts[column]
    external = wrenches_of(system, motion.q, layout.frames, s.wrenches)
    given = {m.velocity: law[2] for m, law in zip(layout.motions, laws, strict=True)}
    load = load_of(system, motion.q, external)
    moved = minimal_accelerations(system, motion, tau, load, given)
    rate = _rate(system, layout, motion, moved, rates)
    y = outputs_vector(system, layout, motion, moved, shown)
    if observe is not None:
        vectors = motion.q, motion.v, moved.a, motion.v_a, moved.a_a, moved.every_effort
        y = casadi.vertcat(y, *observe(Seen(s.t, system.p, *vectors, external)))
    point = [s.t, s.x, s.z, s.u, system.p]
    contact, states = moved.contact, (layout.positions, layout.velocities)
    events = None
    if contact:
        events = minimal_events(
            contact,
            motion,
            point,
            lambda fired: minimal_jump(system, contact, motion, (s.x, fired), states),
        )
    point[4], (rate, y) = few_modes(contact, system.p, [rate, y])
    return StateEquations(
        rhs=dense_function("rhs", point, [rate, y]),
        motion=dense_function("motion", [s.t, s.x, s.z, s.u, system.p], [motion.q, motion.v]),
        events=events,
        sizes=(len(motors), len(system.devices), s.u.numel() - len(motors) - len(system.devices)),
    )


def motion_of(
    system: System, layout: MinimalLayout, s: StatePoint, laws: Sequence[tuple[SX, SX, SX]]
) -> TreeMotion:
    """The motion of the tree, from states, dependent positions and prescribed motions."""
    raw, q = positions_of(system, layout, s)
    v = SX.zeros(system.nv)
    v[list(layout.velocities)] = s.v
    for motion, law in zip(layout.motions, laws, strict=True):
        if motion.position is not None:
            raw[motion.position], v[motion.velocity] = law[0], law[1]
    return tree_motion(system, raw, q, v[list(system.active)])


def positions_of(system: System, layout: MinimalLayout, s: StatePoint) -> tuple[SX, SX]:
    """(nq, 1) positions as in the state, and on the loops."""
    raw = SX.zeros(system.nq)
    raw[list(layout.dependents)] = s.z
    raw[list(layout.positions)] = s.q
    q = with_unit_length(layout.orientations, raw)
    q[list(layout.dependents)] = s.z
    return raw, q


def _rate(
    system: System, layout: MinimalLayout, motion: TreeMotion, moved: Accelerations, devices: SX
) -> SX:
    """The rate of x; quaternions are drawn back to unit length."""
    if system.is_closed:
        v = SX(motion.v)
        v[list(system.active)] += at_limits(system, moved.contact, motion)
        rate = state_rates(system, layout.orientations, (motion.raw, motion.q, v))
    else:
        rate = _steadied_rate(system, motion)
    return casadi.vertcat(_rows(rate, layout.positions), _rows(moved.a, layout.velocities), devices)


def _steadied_rate(system: System, motion: TreeMotion) -> SX:
    raw = position_rate(system.tree, motion.raw, motion.v)
    rate = position_rate(system.tree, motion.q, motion.v)
    for part in quaternion_slices(system.tree):
        q = motion.raw[part]
        rate[part] = raw[part] + NORM_RATE * (1 - casadi.sumsqr(q)) * q
    return rate


def outputs_vector(
    system: System, layout: MinimalLayout, motion: TreeMotion, moved: Accelerations, shown: SX
) -> SX:
    """The outputs y that every state equation has."""
    efforts = moved.contact.efforts if moved.contact else SX(0, 1)
    return casadi.vertcat(
        _rows(moved.a, layout.accelerations),
        _rows(motion.q, layout.shown),
        _rows(motion.v, layout.passive),
        _rows(moved.a, layout.passive),
        _terminal_pose(system, motion.q),
        shown,
        _rows(moved.tau, layout.efforts),
        _rows(efforts, [effort.row for effort in layout.contacts]),
    )


def _rows(vector: SX, numbers: Sequence[int]) -> SX:
    """Some elements of a vector; none of a vector (1, 1) are (1, 0), which would count as a row."""
    return vector[list(numbers)] if numbers else SX(0, 1)


def _terminal_pose(system: System, q: SX) -> SX:
    """(12, 1) origin, and orientation by rows, of the terminal frame in the base."""
    base, tool = system.frame("base"), system.frame(terminal_frame(system))
    T = relative_pose(system.tree, q, base, tool)
    return casadi.vertcat(T.p, casadi.reshape(T.R.T, 9, 1))


def _closure_step(system: System, layout: MinimalLayout) -> tuple[Function, Function | None]:
    """`closure` and `slopes` of the state equation."""
    dependents, s = list(layout.dependents), point_of(system, layout, ())
    symbols, z = SX.sym("q", system.nq), s.z
    raw, q = positions_of(system, layout, s)
    ties = tied(system, layout.orientations, raw, symbols)
    kept = square_closure(system, symbols, dependents, ties)
    every = relative_rows(system, symbols)
    kept, every = casadi.substitute([kept, every], [symbols], [q])
    cosines = casadi.substitute(facing(system, symbols), symbols, q)
    opposed = casadi.mmin(cosines) <= 0 if cosines.numel() else SX(0)
    residual = casadi.mmax(casadi.fabs(casadi.vertcat(every, opposed)))
    point = [s.x, z, system.p]
    slopes = Function("slopes", point, [casadi.jacobian(kept, z)], {"cse": True})
    step = newton_step(dense_function("rows", point, [kept, residual]), slopes)
    varies = system.closure is not None and system.closure.varies
    return step, None if varies else slopes


def consistent_start(system: System, state: MinimalLayout) -> tuple[list[float], list[float]]:
    """State x and dependents z of the assembled posture at rest."""
    posture = np.array(system.posture)
    rest = [0.0] * (len(state.velocities) + state_count(system))
    x = [*posture[list(state.positions)], *rest]
    return [float(value) for value in x], [
        float(value) for value in posture[list(state.dependents)]
    ]
