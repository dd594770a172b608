"""State equation of the independent joints, with dependent joints solved from loop closure.

The states can be set freely and there is no constraint drift, as importers of FMUs require.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from itertools import accumulate
from typing import Any

import casadi
import numpy as np
from casadi import MX, SX, Function

from mbs.assembly import System
from mbs.assembly.tree import Frame, Link, position_rate, quaternion_slices
from mbs.loops.closing import relative_rows
from mbs.loops.closure_equations import facing, square_closure
from mbs.models._direct_dynamics import hybrid_dynamics, independent_dynamics, inertia_matrix
from mbs.models._inverse_dynamics import bias
from mbs.models._joint_wrenches import shown_outputs
from mbs.models._measurements import with_readings
from mbs.models.contacts import (
    ContactEquations,
    contact_equations,
    contacts_of,
    require_lasting_rows,
)
from mbs.models.geometry import terminal_frame
from mbs.models.state.crossings import (
    WatchedCrossings,
    drive_crossings,
    held_by,
    join_crossings,
    with_part_crossings,
)
from mbs.models.state.drive import (
    DriveInputs,
    InputMotion,
    TreeMotion,
    frames_of,
    further_inputs,
    input_motions,
    load_of,
    motions_of,
    tree_motion,
    wrenches_of,
)
from mbs.models.state.events import (
    RETURN_RATE,
    ContactEffort,
    MinimalEvents,
    at_limits,
    contact_efforts,
    few_modes,
    join_part_events,
    minimal_events,
    minimal_jump,
    standstill,
)
from mbs.models.symbols import dense_function, outputs_of, part_equations, state_count
from mbs.recursions.route import relative_pose
from mbs.solvers.linear import newton_step
from mbs.spatial import Wrench, quaternion_rate, quaternion_rotation

# Quaternion joints in loops with independent rotations, all or some of them.
#
# A rod between two spherical joints spins freely about its own axis, and no element of the
# quaternion of a spherical joint is the angle of that spin. The whole quaternion is then a state. A
# second quaternion, which closes the loops, is solved with the other dependent positions. It is the
# one that is not rotated relative to the state about the independent axes.
#
# The state rotates with the same angular velocity in space as the solved quaternion and decays to
# it, so the solved quaternion moves exactly with the velocities of the joint.


NORM_RATE = 10.0
"""Rate at which a quaternion state decays to unit length and to the loops [1/s]. An integration
error decays within one second, and steps of a mechanism at 1 Hz or faster are not shortened."""


@dataclass(frozen=True, slots=True, eq=False)
class Orientation:
    """Quaternion joint in a loop with at least one independent velocity.

    Attributes:
        link: link that the joint moves.
        free: indices in v of the velocities of the joint that are independent.
    """

    link: Link
    free: tuple[int, ...]

    @property
    def whole(self) -> bool:
        """Whether all velocities are independent; then all positions are states, none solved."""
        return len(self.free) == self.link.motion.nv

    @property
    def positions(self) -> tuple[int, ...]:
        """Indices in q of the positions of the joint."""
        return tuple(range(self.link.q.start, self.link.q.stop))

    @property
    def quaternion(self) -> slice:
        """Index range in q of the quaternion of the joint."""
        return slice(self.link.q.stop - 4, self.link.q.stop)


def orientations_of(system: System) -> tuple[Orientation, ...]:
    """Return the quaternion joints of a closed system with at least one independent velocity."""
    free = set(system.free)
    found = (
        Orientation(link, tuple(k for k in range(link.v.start, link.v.stop) if k in free))
        for link in system.tree.links
        if link.motion.nq > link.motion.nv
    )
    return tuple(joint for joint in found if joint.free)


def with_unit_length(joints: Sequence[Orientation], q: SX) -> SX:
    """Normalise the quaternions in q (nq, 1) of the joints whose positions are all states."""
    result = SX(q)
    for joint in joints:
        if joint.whole:
            part = joint.quaternion
            result[part] = q[part] / casadi.norm_2(q[part])
    return result


def tie_orientations(system: System, joints: Sequence[Orientation], raw: SX, q: SX) -> SX:
    """Return the orientation residual (k, 1) of independent quaternion joints.

    It is the projection of q - raw on the independent velocities, and zero at the solution.

    Args:
        system: system with closed loops.
        joints: independent quaternion joints of the system.
        raw: (nq, 1) positions with the quaternions of the state.
        q: (nq, 1) positions that are solved for.
    """
    u = SX.sym("u", system.nv)
    N = casadi.jacobian(position_rate(system.tree, raw, u), u)
    rows = [SX(0, 1)]
    for joint in joints:
        if not joint.whole:
            size = SX.ones(system.nq)
            size[joint.quaternion] = 4  # compensates the columns of N, which have length 1/2 there
            part = list(joint.positions)
            along = N[part, list(joint.free)]
            rows.append(casadi.mtimes(along.T, (size * (q - raw))[part]))
    return casadi.vertcat(*rows)


def state_rates(system: System, joints: Sequence[Orientation], motion: tuple[SX, SX, SX]) -> SX:
    """Return the rates (nq, 1) of the positions of the state.

    Args:
        system: system with closed loops.
        joints: independent quaternion joints of the system.
        motion: positions of the state (nq, 1), positions that close the loops (nq, 1), and
            velocities of the tree (nv, 1).
    """
    raw, q, v = motion
    rate = position_rate(system.tree, q, v)
    for joint in joints:
        part = joint.quaternion
        w = v[joint.link.v.stop - 3 : joint.link.v.stop]
        if joint.whole:
            left = (1 - casadi.sumsqr(raw[part])) * raw[part]
            rate[part] = quaternion_rate(raw[part], w) + NORM_RATE * left
            continue
        every = list(joint.positions)
        unit = raw[part] / casadi.norm_2(raw[part])
        spin = casadi.mtimes(quaternion_rotation(q[part]), w)
        left = q[every] - raw[every]
        rate[part] = quaternion_rate(raw[part], casadi.mtimes(quaternion_rotation(unit).T, spin))
        if len(every) > 4:
            rate[every[:3]] -= casadi.cross(spin, left[:3])
        rate[every] += NORM_RATE * left
    return rate


# Layout of states, inputs and outputs of the state equation of the independent joints.


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class MinimalLayout:
    """Layout of states x, dependent positions z, inputs u and outputs y of a state equation.

    x = [positions; velocities; states of components]; u = [efforts of motors; inputs of
    components; wrenches; motions; w]; y = [accelerations; positions of z that are not in x,
    velocities and accelerations of the dependent joints; origin (3) and orientation (9, by rows) of
    the terminal frame; outputs of components; efforts; efforts of contacts; observed quantities].

    Attributes:
        positions: indices in q of the positions in x.
        orientations: quaternion joints of loops with positions in x.
        velocities: indices in v of the velocities in x.
        dependents: indices in q of z. Positions of `orientations` that are solved are in x too.
        shown: indices in q of the positions of z that are in y and not in x.
        inputs: indices in v of the efforts of motors in u.
        devices: indices of the component inputs in u.
        wrenches: names of the frames with wrenches in u. Each wrench has six elements: force and
            moment about the origin of the frame, in axes of the base.
        frames: frames of `wrenches`.
        motions: joints whose accelerations, or positions, velocities and accelerations, are in u.
        extra: size of the further inputs w of control laws.
        accelerations: indices in v of the accelerations at the start of y.
        passive: indices in v of the velocities and accelerations of dependent joints in y.
        efforts: indices in v of the efforts in y: the total effort of a joint without contacts.
        contacts: efforts of rigid stops and Coulomb friction in y.
    """

    positions: tuple[int, ...]
    orientations: tuple[Orientation, ...]
    velocities: tuple[int, ...]
    dependents: tuple[int, ...]
    shown: tuple[int, ...]
    inputs: tuple[int, ...]
    devices: tuple[int, ...]
    wrenches: tuple[str | int, ...]
    frames: tuple[Frame, ...]
    motions: tuple[InputMotion, ...]
    extra: int
    accelerations: tuple[int, ...]
    passive: tuple[int, ...]
    efforts: tuple[int, ...]
    contacts: tuple[ContactEffort, ...]


def motors_of(system: System, prescribed: Sequence[int] = ()) -> tuple[int, ...]:
    """Return the indices in v of the velocities driven by motors, independent velocities first.

    Velocities driven by components are excluded.

    Args:
        system: open or closed system.
        prescribed: indices of velocities with prescribed motion, which are excluded.
    """
    others = [k for k in range(system.nv) if k not in system.active]
    taken = [*prescribed, *(device.velocity for device in system.devices)]
    return tuple(
        k for k in (*system.active, *others) if system.speeds[k].actuated and k not in taken
    )


def minimal_layout(system: System, drive: DriveInputs) -> MinimalLayout:
    """Return the layout of the state equation of a system.

    Args:
        system: open or closed system.
        drive: additional inputs and control laws.

    Raises:
        ModelError: `drive` is inconsistent with the system.
    """
    motions, extra = motions_of(system, drive), further_inputs(system, drive)
    inputs_q = [motion.position for motion in motions]
    prescribed = [motion.velocity for motion in motions]
    without_states = [motion.velocity for motion in motions if motion.kind == "q"]
    orientations = orientations_of(system) if system.is_closed else ()
    solved = [k for joint in orientations if not joint.whole for k in joint.positions]
    free = _free_positions(system, orientations)
    motors = motors_of(system, prescribed)
    return MinimalLayout(
        positions=tuple(k for k in free if k not in inputs_q),
        orientations=orientations,
        velocities=tuple(k for k in system.active if k not in without_states),
        dependents=tuple(k for k in range(system.nq) if k not in free or k in solved),
        shown=tuple(k for k in range(system.nq) if k not in free),
        inputs=() if drive.effort else motors,
        devices=() if drive.device else tuple(range(system.u.numel())),
        wrenches=drive.wrenches,
        frames=frames_of(system, drive),
        motions=motions,
        extra=extra,
        accelerations=tuple(k for k in system.active if k not in prescribed),
        passive=system.closure.passive if system.closure else (),
        efforts=(*(motors if drive.effort else ()), *prescribed),
        contacts=contact_efforts(system, contacts_of(system)),
    )


def _free_positions(system: System, orientations: Sequence[Orientation]) -> tuple[int, ...]:
    """Return the indices in q of the independent positions; quaternion joints count as a whole."""
    if not system.is_closed:
        return tuple(range(system.nq))
    numbers = {coordinate.name: k for k, coordinate in enumerate(system.coordinates)}
    joints = {k: joint.positions for joint in orientations for k in joint.free}
    found = (joints.get(k) or (numbers[system.speeds[k].name],) for k in system.free)
    return tuple(dict.fromkeys(position for part in found for position in part))


# Accelerations of the independent joints with contacts, prescribed motions and wrenches.


@dataclass(frozen=True, slots=True, eq=False)
class Accelerations:
    """Accelerations and efforts of a tree.

    Attributes:
        a_a: (m, 1) accelerations of the independent joints.
        a: (nv, 1) accelerations of the tree.
        tau: (nv, 1) joint efforts, including prescribed motions, without contacts.
        contact: equations of the contacts, or None.
    """

    a_a: SX
    a: SX
    tau: SX
    contact: ContactEquations | None

    @property
    def every_effort(self) -> SX:
        """Joint efforts (nv, 1) including contacts."""
        total = SX(self.tau)
        return total if self.contact is None else total + self.contact.pushes


def minimal_accelerations(
    system: System, motion: TreeMotion, tau: SX, load: SX, given: Mapping[int, SX]
) -> Accelerations:
    """Compute the accelerations of a tree whose loops stay closed.

    Prescribed accelerations and contact constraints are exact in a_a, because the motion is not
    projected later.

    Args:
        system: open or closed system.
        motion: positions and velocities of the tree.
        tau: (nv, 1) joint efforts.
        load: (nv, 1) joint efforts equivalent to external wrenches.
        given: prescribed accelerations by index in v.
    """
    contact = contact_equations(system, motion.q, motion.v, tau + load, given)
    if contact is None and not given:
        pushed = motion.reduced_effort(tau + load)
        (a_a,) = outputs_of(system, independent_dynamics(system), motion.q, motion.v_a, pushed)
        return Accelerations(a_a, motion.tree_acceleration(a_a), tau, None)
    if contact is not None:
        a, drives = _stuck_accelerations(system, contact, motion), contact.drives
    elif system.is_closed:
        a, drives = _reduced_hybrid(system, motion, motion.reduced_effort(tau + load), given)
    else:
        hybrid = hybrid_dynamics(system, [system.speeds[k].name for k in given])
        prescribed = casadi.vertcat(*given.values())
        a, drives = outputs_of(system, hybrid, motion.q, motion.v, tau + load, prescribed)
    every = SX(tau)
    for row, (number, value) in enumerate(given.items()):
        a[number] = value
        every[number] += drives[row]
    a_a = a[list(system.active)]
    return Accelerations(a_a, motion.tree_acceleration(a_a), every, contact)


def _stuck_accelerations(system: System, contact: ContactEquations, motion: TreeMotion) -> SX:
    """Return the accelerations (nv, 1) with contacts, exact for stuck independent joints."""
    a, contacts, stuck = SX(contact.a), contact.contacts, contact.modes.stuck
    back = -RETURN_RATE * contact.state.velocity
    a[list(system.active)] += standstill(system, contacts, motion, (stuck, back), contact.driven)
    for j, number in enumerate(contacts.velocities):
        if number is not None:
            a[number] = casadi.if_else(stuck[j], back[j], a[number])
    return a


def _reduced_hybrid(
    system: System, motion: TreeMotion, tau: SX, given: Mapping[int, SX]
) -> tuple[SX, SX]:
    """Hybrid dynamics in the independent joints with efforts tau (m, 1).

    Source: Featherstone 2008, section 9.2, for the inertia matrix G' A G.

    Returns:
        Accelerations (nv, 1), zero for dependent joints, and efforts of the prescribed joints.
    """
    (A,) = outputs_of(system, inertia_matrix(system), motion.q)
    (H,) = outputs_of(system, bias(system), motion.q, motion.v_a)
    driven = [system.active.index(k) for k in given]
    free = [k for k in range(len(system.active)) if k not in driven]
    a = SX.zeros(len(system.active))
    a[driven] = casadi.vertcat(*given.values())
    if free:
        left = tau - H - casadi.mtimes(A, a)
        D, LT, order = casadi.ldl(casadi.densify(A[free, free]))
        a[free] = casadi.ldl_solve(left[free], D, LT, order)
    needed = casadi.mtimes(A, a) + H - tau
    every = SX.zeros(system.nv)
    every[list(system.active)] = a
    return every, needed[driven]


# State equation whose motor efforts and component inputs are computed by control laws.


@dataclass(frozen=True, slots=True, eq=False)
class StateEquations:
    """Functions of a state equation.

    Attributes:
        rhs: `rhs(t, x, z, u, p) -> (xdot, y)`.
        motion: `motion(t, x, z, u, p) -> (q, v)`, positions and velocities of the tree; p contains
            the parameters without modes.
        events: events of contacts and components, or None.
        sizes: sizes of the parts of u: efforts, inputs of components, remaining inputs.
    """

    rhs: Function
    motion: Function
    events: MinimalEvents | None
    sizes: tuple[int, int, int]


def with_laws(
    equations: StateEquations, drive: DriveInputs, extra: int, crossings: Function | None = None
) -> StateEquations:
    """Replace efforts and component inputs of a state equation by the control laws of a drive.

    The functions are SX if the laws are. Otherwise they contain calls of the laws, which may be
    external functions.

    Args:
        equations: state equation whose u starts with the values of the laws.
        drive: drive with at least one law.
        extra: number of the inputs w of the laws, the last elements of the new u.
        crossings: Function from `drive_crossings`, or None.
    """
    tau, u, rest = equations.sizes
    wiring = _Wiring(
        equations, drive, (0 if drive.effort else tau, 0 if drive.device else u, rest, extra)
    )
    rhs, events = _driven(wiring, equations.rhs), _events(wiring, equations.events)
    if crossings is not None:
        point = _symbols(wiring, equations.motion, SX)
        t, x, z, inputs, p = point
        _, _, others, w = _parts(inputs, wiring.sizes)
        q, v = equations.motion.call([t, x, z, _fill(wiring, SX, others), p])
        values = WatchedCrossings(*crossings.call([t, q, v, w, p]))
        events = join_crossings(events, values, point, "controller")
        rhs = held_by(rhs, values, point)
    return StateEquations(rhs=rhs, motion=equations.motion, events=events, sizes=wiring.sizes[:3])


@dataclass(frozen=True, slots=True, eq=False)
class _Wiring:
    """State equation, its control laws, and the sizes of the parts of the remaining u."""

    equations: StateEquations
    drive: DriveInputs
    sizes: tuple[int, int, int, int]


def _events(wiring: _Wiring, events: MinimalEvents | None) -> MinimalEvents | None:
    if events is None:
        return None
    return replace(
        events,
        first=_idle(wiring, events.first),
        indicators=_driven(wiring, events.indicators),
        jump=_driven(wiring, events.jump),
        approaches=None if events.approaches is None else _driven(wiring, events.approaches),
    )


def _driven(wiring: _Wiring, function: Function) -> Function:
    """Return the function with efforts and component inputs from the laws."""
    drive, motion = wiring.drive, wiring.equations.motion
    laws = [law for law in (drive.effort, drive.device) if law is not None]
    kind: Any = SX if all(law.is_a("SXFunction") for law in laws) else MX
    symbols = _symbols(wiring, function, kind)
    t, x, z, u, p = symbols[:5]
    pushes, inputs, others, w = _parts(u, wiring.sizes)
    p = _parts(p, (motion.numel_in(4), p.numel() - motion.numel_in(4)))[0]
    q, v = motion.call([t, x, z, _fill(wiring, kind, others), p])
    if drive.effort is not None:
        pushes = casadi.densify(casadi.vec(drive.effort.call([t, q, v, w, p])[0]))
    if drive.device is not None:
        inputs = casadi.densify(casadi.vec(drive.device.call([t, q, v, w, p])[0]))
    given = casadi.vertcat(pushes, inputs, others)
    return _write(function, symbols, given, kind)


def _idle(wiring: _Wiring, function: Function) -> Function:
    """Return a function that does not depend on efforts, with the remaining inputs only."""
    symbols = _symbols(wiring, function, SX)
    others = _parts(symbols[3], wiring.sizes)[2]
    return _write(function, symbols, _fill(wiring, SX, others), SX)


def _symbols(wiring: _Wiring, function: Function, kind: Any) -> list[Any]:
    sizes = [function.numel_in(k) for k in range(function.n_in())]
    sizes[3] = sum(wiring.sizes)
    names = ("t", "x", "z", "u", "p", "fired")
    return [kind.sym(name, size) for name, size in zip(names, sizes, strict=False)]


def _fill(wiring: _Wiring, kind: Any, others: Any) -> Any:
    """Return the inputs u of a function, with zeros for the values of laws."""
    tau, u, _ = wiring.equations.sizes
    return casadi.vertcat(kind.zeros(tau), kind.zeros(u), others)


def _parts(u: Any, sizes: tuple[int, ...]) -> list[Any]:
    parts: list[Any] = casadi.vertsplit(u, [0, *accumulate(sizes)])
    return parts


def _write(function: Function, symbols: list[Any], u: Any, kind: Any) -> Function:
    options = {"cse": True} if kind is SX else {}
    values = function.call([*symbols[:3], u, *symbols[4:]])
    return Function(function.name(), symbols, values, options)


__all__ = [
    "DriveInputs",
    "MinimalState",
    "Observe",
    "OutputContext",
    "consistent_start",
    "minimal_state",
]


@dataclass(frozen=True, slots=True, eq=False)
class OutputContext:
    """Values of a motion from which outputs are computed.

    Attributes:
        t: time [s].
        p: (np, 1) parameters of the system.
        q: (nq, 1) positions, quaternions of unit length.
        v: (nv, 1) velocities of the tree.
        a: (nv, 1) accelerations of the tree.
        v_a: (m, 1) velocities of the independent joints.
        a_a: (m, 1) accelerations of the independent joints.
        tau: (nv, 1) joint efforts: motors, devices, prescribed motions and contacts.
        external: wrench that a link exerts on its environment, by link index, about the origin and
            in axes of the link frame.
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


Observe = Callable[[OutputContext], Sequence[SX]]
"""Function that returns additional outputs of a motion."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class MinimalState(MinimalLayout):
    """State equation of the independent joints; `MinimalLayout` defines x, z, u and y.

    Attributes:
        rhs: `rhs(t, x, z, u, p) -> (xdot, y)`. Here and in `events`, p contains the parameters
            followed by the modes.
        closure: `closure(x, z, p) -> (z_next, residual)`, one Newton step; None in open chains.
        slopes: `slopes(x, z, p) -> J`, Jacobian (nz, nz) of the closure equations with respect to
            z. None in open chains, and for least-squares equations, whose determinant has no
            meaningful sign.
        events: events of rigid stops, Coulomb friction and components, or None.
    """

    rhs: Function
    closure: Function | None
    slopes: Function | None
    events: MinimalEvents | None


def minimal_state(
    system: System,
    observe: Observe | None = None,
    drive: DriveInputs | None = None,
    *,
    crossings: bool = False,
) -> MinimalState:
    """Return the state equation of the independent joints.

    Args:
        system: open or closed system.
        observe: function that returns additional outputs at the end of y.
        drive: additional inputs, and control laws that replace the efforts of motors or the inputs
            of components.
        crossings: whether events end steps at discontinuities of laws.

    Raises:
        ModelError: `drive` is inconsistent with the system, or the independent rows of the loops
            change with the configuration, which contacts do not support.
    """
    require_lasting_rows(system, contacts_of(system))
    drive = DriveInputs() if drive is None else drive
    layout = minimal_layout(system, drive)
    equations = _equations(system, observe, layout, drive, crossings=crossings)
    if drive.effort is not None or drive.device is not None:
        found = drive_crossings(system, drive, layout.extra) if crossings else None
        equations = with_laws(equations, drive, layout.extra, found)
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
    """Symbols of a state equation (t, x, z, u), and the parts of x and u."""

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
    """Create the symbols of a state equation.

    Args:
        system: open or closed system.
        layout: index ranges of positions, velocities and inputs in x and u.
        motors: indices in v of the efforts in u.
    """
    in_x = [len(layout.positions), len(layout.velocities), state_count(system)]
    in_u = [len(motors), system.u.numel(), 6 * len(layout.frames)]
    in_u.append(sum(motion.size for motion in layout.motions))
    x = casadi.vertcat(SX.sym("x", sum(in_x[:2])), system.z)
    u = casadi.vertcat(SX.sym("u", in_u[0]), system.u, SX.sym("w", sum(in_u[2:])))
    parts = (*_split(x, in_x), *_split(u, in_u))
    return StatePoint(SX.sym("t"), x, SX.sym("z", len(layout.dependents)), u, *parts)


def _split(values: SX, sizes: Sequence[int]) -> list[SX]:
    return list(casadi.vertsplit(values, [0, *accumulate(sizes)]))


def _equations(
    system: System,
    observe: Observe | None,
    layout: MinimalLayout,
    drive: DriveInputs,
    *,
    crossings: bool,
) -> StateEquations:
    """Return the functions without laws: u contains the values of the laws, and no w."""
    motors = layout.inputs if drive.effort is None else tuple(range(system.nv))
    s = point_of(system, layout, motors)
    laws = input_motions(layout.motions, s.motions)
    motion = motion_of(system, layout, s, laws)
    tau, rates, parts = part_equations(system, motion.q, motion.v)
    for column, number in enumerate(motors):
        tau[number] += s.efforts[column]
    external = wrenches_of(system, motion.q, layout.frames, s.wrenches)
    given = {m.velocity: law[2] for m, law in zip(layout.motions, laws, strict=True)}
    load = load_of(system, motion.q, external)
    response = minimal_accelerations(system, motion, tau, load, given)
    shown = shown_outputs(system, parts, response.a, response.every_effort + load)
    known = (motion.q, motion.v, response.a, response.every_effort + load)
    rates, shown = with_readings(system, [rates, shown], known, s.wrenches)
    rate = _rate(system, layout, motion, response, rates)
    y = outputs_vector(system, layout, motion, response, shown)
    if observe is not None:
        vectors = motion.q, motion.v, response.a, motion.v_a, response.a_a, response.every_effort
        y = casadi.vertcat(y, *observe(OutputContext(s.t, system.p, *vectors, external)))
    point = [s.t, s.x, s.z, s.u, system.p]
    contact, states = response.contact, (layout.positions, layout.velocities)
    events = None
    if contact:
        events = minimal_events(
            contact,
            motion,
            point,
            lambda fired: minimal_jump(system, contact, motion, (s.x, fired), states),
        )
    events = join_part_events(system, events, parts.events(), point)
    at = (motion.q, motion.v)
    events, values = with_part_crossings(system, events, at, point, wanted=crossings)
    p, (rate, y) = few_modes(contact, system.p, [rate, y])
    return StateEquations(
        rhs=held_by(dense_function("rhs", [*point[:4], p], [rate, y]), values, point),
        motion=dense_function("motion", [s.t, s.x, s.z, s.u, system.p], [motion.q, motion.v]),
        events=events,
        sizes=(len(motors), system.u.numel(), s.u.numel() - len(motors) - system.u.numel()),
    )


def motion_of(
    system: System, layout: MinimalLayout, s: StatePoint, laws: Sequence[tuple[SX, SX, SX]]
) -> TreeMotion:
    """Return the motion of the tree from states, dependent positions and prescribed motions."""
    raw, q = positions_of(system, layout, s)
    v = SX.zeros(system.nv)
    v[list(layout.velocities)] = s.v
    for motion, law in zip(layout.motions, laws, strict=True):
        if motion.position is not None:
            raw[motion.position], v[motion.velocity] = law[0], law[1]
    return tree_motion(system, raw, q, v[list(system.active)])


def positions_of(system: System, layout: MinimalLayout, s: StatePoint) -> tuple[SX, SX]:
    """Return the positions (nq, 1) of the state, and the positions (nq, 1) on the loops."""
    raw = SX.zeros(system.nq)
    raw[list(layout.dependents)] = s.z
    raw[list(layout.positions)] = s.q
    q = with_unit_length(layout.orientations, raw)
    q[list(layout.dependents)] = s.z
    return raw, q


def _rate(
    system: System, layout: MinimalLayout, motion: TreeMotion, response: Accelerations, devices: SX
) -> SX:
    """Return the rate of x, with decay of quaternions to unit length."""
    v = SX(motion.v)
    v[list(system.active)] += at_limits(system, response.contact, motion)
    if system.is_closed:
        rate = state_rates(system, layout.orientations, (motion.raw, motion.q, v))
    else:
        rate = _steadied_rate(system, replace(motion, v=v))
    return casadi.vertcat(
        _rows(rate, layout.positions), _rows(response.a, layout.velocities), devices
    )


def _steadied_rate(system: System, motion: TreeMotion) -> SX:
    raw = position_rate(system.tree, motion.raw, motion.v)
    rate = position_rate(system.tree, motion.q, motion.v)
    for part in quaternion_slices(system.tree):
        q = motion.raw[part]
        rate[part] = raw[part] + NORM_RATE * (1 - casadi.sumsqr(q)) * q
    return rate


def outputs_vector(
    system: System, layout: MinimalLayout, motion: TreeMotion, response: Accelerations, shown: SX
) -> SX:
    """Return the outputs y of a state equation without the observed quantities."""
    efforts = response.contact.efforts if response.contact else SX(0, 1)
    return casadi.vertcat(
        _rows(response.a, layout.accelerations),
        _rows(motion.q, layout.shown),
        _rows(motion.v, layout.passive),
        _rows(response.a, layout.passive),
        _terminal_pose(system, motion.q),
        shown,
        _rows(response.tau, layout.efforts),
        _rows(efforts, [effort.row for effort in layout.contacts]),
    )


def _rows(vector: SX, numbers: Sequence[int]) -> SX:
    """Return elements of a column vector; (0, 1) for no elements, unlike [] on a (1, 1) vector."""
    return vector[list(numbers)] if numbers else SX(0, 1)


def _terminal_pose(system: System, q: SX) -> SX:
    """Return (12, 1) origin and orientation (by rows) of the terminal frame in the base."""
    base, tool = system.frame("base"), system.frame(terminal_frame(system))
    T = relative_pose(system.tree, q, base, tool)
    return casadi.vertcat(T.p, casadi.reshape(T.R.T, 9, 1))


def _closure_step(system: System, layout: MinimalLayout) -> tuple[Function, Function | None]:
    """Return the functions `closure` and `slopes` of `MinimalState`."""
    dependents, s = list(layout.dependents), point_of(system, layout, ())
    symbols, z = SX.sym("q", system.nq), s.z
    raw, q = positions_of(system, layout, s)
    ties = tie_orientations(system, layout.orientations, raw, symbols)
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
    """Return state x and dependents z of the assembled configuration at rest."""
    configuration = np.array(system.configuration)
    rest = [0.0] * len(state.velocities)
    x = [*configuration[list(state.positions)], *rest, *system.z_start]
    return [float(value) for value in x], [
        float(value) for value in configuration[list(state.dependents)]
    ]
