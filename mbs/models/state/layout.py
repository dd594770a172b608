"""Layout of states, inputs and outputs of state equations whose inputs are arguments."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate

import casadi
from casadi import SX

from mbs.assembly import System
from mbs.assembly.tree import Frame
from mbs.models.contacts import contacts_of, require_lasting_rows
from mbs.models.geometry import terminal_frame
from mbs.models.state.drive import (
    DriveInputs,
    InputMotion,
    frames_of,
    further_inputs,
    input_motions,
    motions_of,
)
from mbs.models.state.equations import Actions, EquationsOfMotion, Observe, observed
from mbs.models.state.events import ContactEffort, contact_efforts
from mbs.models.state.orientations import Orientation, orientations_of
from mbs.models.symbols import state_count
from mbs.recursions.route import relative_pose


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
    others = [k for k in range(system.nv) if k not in system.independent]
    taken = [*prescribed, *(device.velocity for device in system.devices)]
    return tuple(
        k
        for k in (*system.independent, *others)
        if system.velocity_coordinates[k].actuated and k not in taken
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
        velocities=tuple(k for k in system.independent if k not in without_states),
        dependents=tuple(k for k in range(system.nq) if k not in free or k in solved),
        shown=tuple(k for k in range(system.nq) if k not in free),
        inputs=() if drive.effort else motors,
        devices=() if drive.device else tuple(range(system.u.numel())),
        wrenches=drive.wrenches,
        frames=frames_of(system, drive),
        motions=motions,
        extra=extra,
        accelerations=tuple(k for k in system.independent if k not in prescribed),
        passive=system.closure.passive if system.closure else (),
        efforts=(*(motors if drive.effort else ()), *prescribed),
        contacts=contact_efforts(contacts_of(system)),
    )


def _free_positions(system: System, orientations: Sequence[Orientation]) -> tuple[int, ...]:
    """Return the indices in q of the independent positions; quaternion joints count as a whole."""
    if not system.is_closed:
        return tuple(range(system.nq))
    numbers = {coordinate.name: k for k, coordinate in enumerate(system.coordinates)}
    joints = {k: joint.positions for joint in orientations for k in joint.free}
    found = (
        joints.get(k) or (numbers[system.velocity_coordinates[k].name],)
        for k in system.chosen_coordinates
    )
    return tuple(dict.fromkeys(position for part in found for position in part))


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

    @property
    def sizes(self) -> tuple[int, int, int]:
        """Sizes of the parts of u: efforts, inputs of components, remaining inputs."""
        first = self.efforts.numel(), self.inputs.numel()
        return (*first, self.u.numel() - sum(first))


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
    x = casadi.vertcat(SX.sym("x", sum(in_x[:2])), system.component_states)
    u = casadi.vertcat(SX.sym("u", in_u[0]), system.u, SX.sym("w", sum(in_u[2:])))
    parts = (*_split(x, in_x), *_split(u, in_u))
    return StatePoint(SX.sym("t"), x, SX.sym("z", len(layout.dependents)), u, *parts)


def _split(values: SX, sizes: Sequence[int]) -> list[SX]:
    return list(casadi.vertsplit(values, [0, *accumulate(sizes)]))


@dataclass(frozen=True, slots=True, eq=False)
class StateInputs:
    """Inputs and outputs of a state equation, which are the same in every form of the state.

    Attributes:
        system: open or closed system.
        drive: additional inputs, and control laws.
        layout: layout of states, inputs and outputs.
        symbols: symbols of the state equation of the independent joints. The values of a control
            law are at their place in u, and w is not.
    """

    system: System
    drive: DriveInputs
    layout: MinimalLayout
    symbols: StatePoint

    def actions(self) -> Actions:
        """Return the efforts, wrenches and accelerations that the inputs u prescribe."""
        system, layout, s = self.system, self.layout, self.symbols
        efforts = SX.zeros(system.nv)
        efforts[list(_efforts_in_u(system, layout, self.drive))] = s.efforts
        laws = input_motions(layout.motions, s.motions)
        given = {m.velocity: law[2] for m, law in zip(layout.motions, laws, strict=True)}
        return Actions(efforts, given, layout.frames, s.wrenches)

    def outputs(self, at: EquationsOfMotion, observe: Observe | None) -> SX:
        """Return the outputs y.

        Args:
            at: equations of motion.
            observe: function that returns the additional outputs at the end of y, or None.
        """
        layout, motion, response = self.layout, at.motion, at.response
        efforts = response.contact.efforts if response.contact else SX(0, 1)
        return casadi.vertcat(
            rows_of(response.a, layout.accelerations),
            rows_of(motion.q, layout.shown),
            rows_of(motion.v, layout.passive),
            rows_of(response.a, layout.passive),
            _terminal_pose(self.system, motion.q),
            at.shown,
            rows_of(response.tau, layout.efforts),
            rows_of(efforts, [effort.row for effort in layout.contacts]),
            *observed(self.system, self.symbols.t, at, observe),
        )


def state_inputs(system: System, drive: DriveInputs | None = None) -> StateInputs:
    """Return the inputs and outputs of the state equations of a system.

    Args:
        system: open or closed system.
        drive: additional inputs, and control laws that replace the efforts of motors or the inputs
            of components.

    Raises:
        ModelError: `drive` is inconsistent with the system, or the independent rows of the loops
            change with the configuration, which contacts do not support.
    """
    require_lasting_rows(system, contacts_of(system))
    drive = DriveInputs() if drive is None else drive
    layout = minimal_layout(system, drive)
    efforts = _efforts_in_u(system, layout, drive)
    return StateInputs(system, drive, layout, point_of(system, layout, efforts))


def _efforts_in_u(system: System, layout: MinimalLayout, drive: DriveInputs) -> tuple[int, ...]:
    """Return the indices in v of the efforts that are inputs or values of a control law."""
    return layout.inputs if drive.effort is None else tuple(range(system.nv))


def rows_of(vector: SX, numbers: Sequence[int]) -> SX:
    """Return elements of a column vector; (0, 1) for no elements, unlike [] on a (1, 1) vector."""
    return vector[list(numbers)] if numbers else SX(0, 1)


def _terminal_pose(system: System, q: SX) -> SX:
    """Return (12, 1) origin and orientation (by rows) of the terminal frame in the base."""
    base, tool = system.frame("base"), system.frame(terminal_frame(system))
    T = relative_pose(system.tree, q, base, tool)
    return casadi.vertcat(T.p, casadi.reshape(T.R.T, 9, 1))
