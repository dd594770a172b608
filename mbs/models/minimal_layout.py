"""What stands where in the state equation of the independent joints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from mbs.assembly import System
from mbs.assembly.tree import Frame
from mbs.models.contacts import contacts_of
from mbs.models.minimal_contacts import ContactEffort, contact_efforts
from mbs.models.minimal_drive import DriveInputs, InputMotion, frames_of, further_inputs, motions_of
from mbs.models.minimal_orientation import Orientation, orientations_of


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class MinimalLayout:
    """The elements of states x, dependent positions z, inputs u and outputs y.

    x = [positions; velocities; states of devices]; u = [efforts of motors; inputs of devices;
    wrenches; motions; w]; y = [accelerations; positions of z that are not in x, velocities and
    accelerations of the dependent joints; origin (3) and orientation (9, by rows) of the terminal
    frame; outputs of devices; efforts; efforts of contacts; what is observed].

    Attributes:
        positions: numbers in q of the first part of x.
        orientations: quaternion joints of loops that are among them.
        velocities: numbers in v of the second part of x.
        dependents: numbers in q of z, some of them in x too: see `minimal_orientation`.
        shown: those of them that are in y, which are not in x.
        inputs: numbers in v of the efforts of motors.
        devices: numbers of the devices whose inputs are in u.
        wrenches: names of the frames on which wrenches act, six numbers each: force and moment
            about the origin, in axes of the base.
        frames: these frames.
        motions: joints whose accelerations, or positions, velocities and accelerations, are in u.
        extra: size of w.
        accelerations: numbers in v of the first part of y.
        passive: numbers in v of the velocities and accelerations of dependent joints in y.
        efforts: numbers in v of the efforts in y, each all that drives the joint but contacts.
        contacts: efforts of rigid stops and dry friction in y.
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


def motors_of(system: System, moved: Sequence[int] = ()) -> tuple[int, ...]:
    """Numbers of the velocities that motors drive, the independent ones first.

    Args:
        system: open or closed.
        moved: velocities whose motion is prescribed; they and those of devices are left out.
    """
    others = [k for k in range(system.nv) if k not in system.active]
    taken = [*moved, *(device.velocity for device in system.devices)]
    return tuple(
        k for k in (*system.active, *others) if system.speeds[k].actuated and k not in taken
    )


def minimal_layout(system: System, drive: DriveInputs) -> MinimalLayout:
    """The elements of the state equation of a system.

    Args:
        system: open or closed.
        drive: what drives it.

    Raises:
        ModelError: a drive does not fit the system.
    """
    motions, extra = motions_of(system, drive), further_inputs(system, drive)
    inputs_q = [motion.position for motion in motions]
    moved = [motion.velocity for motion in motions]
    without_states = [motion.velocity for motion in motions if motion.kind == "q"]
    orientations = orientations_of(system) if system.is_closed else ()
    solved = [k for joint in orientations if not joint.whole for k in joint.positions]
    free = _free_positions(system, orientations)
    motors = motors_of(system, moved)
    return MinimalLayout(
        positions=tuple(k for k in free if k not in inputs_q),
        orientations=orientations,
        velocities=tuple(k for k in system.active if k not in without_states),
        dependents=tuple(k for k in range(system.nq) if k not in free or k in solved),
        shown=tuple(k for k in range(system.nq) if k not in free),
        inputs=() if drive.effort else motors,
        devices=() if drive.device else tuple(range(len(system.devices))),
        wrenches=drive.wrenches,
        frames=frames_of(system, drive),
        motions=motions,
        extra=extra,
        accelerations=tuple(k for k in system.active if k not in moved),
        passive=system.closure.passive if system.closure else (),
        efforts=(*(motors if drive.effort else ()), *moved),
        contacts=contact_efforts(system, contacts_of(system)),
    )


def _free_positions(system: System, orientations: Sequence[Orientation]) -> tuple[int, ...]:
    """Numbers in q of the positions that are independent, those of quaternion joints as a whole."""
    if not system.is_closed:
        return tuple(range(system.nq))
    numbers = {coordinate.name: k for k, coordinate in enumerate(system.coordinates)}
    joints = {k: joint.positions for joint in orientations for k in joint.free}
    found = (joints.get(k) or (numbers[system.speeds[k].name],) for k in system.free)
    return tuple(dict.fromkeys(position for part in found for position in part))
