"""Inputs, outputs on request and terminals of the FMU of a mechanism."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import casadi
from casadi import SX, Function

from mbs.assembly import System
from mbs.assembly.tree import Frame
from mbs.errors import ModelError
from mbs.export.fmu.controller import Controller
from mbs.export.fmu.description import FmuVariable, Member, Terminal, once, structured_name
from mbs.export.fmu.variables import POSE, WRENCH, frame_text, pose
from mbs.models._energy import energy
from mbs.models._joint_wrenches import wrenches_of_joints
from mbs.models._measurements import readings
from mbs.models.geometry import terminal_frame
from mbs.models.state.drive import DriveInputs
from mbs.models.state.equations import OutputContext, largest_closure_residual
from mbs.models.symbols import ExternalForces, ModelSymbols, outputs_of, symbols_of
from mbs.recursions.link_motions import (
    link_accelerations,
    link_poses,
    link_velocities,
    resting_base,
)
from mbs.recursions.route import BASE, relative_acceleration, relative_motion, relative_pose
from mbs.spatial import zeros
from mbs.text import did_you_mean, quoted

MOTION = tuple(f"{kind}{axis}" for kind in ("v", "w", "a", "wd") for axis in "xyz")
"""Names of the elements of a frame's velocity, angular velocity and their time derivatives."""


@dataclass(frozen=True, slots=True)
class Interface:
    """Inputs of an FMU in addition to the motor efforts.

    Attributes:
        wrenches: names of the frames on which external wrenches act.
        motions: pairs of a velocity name and "q" or "a": position or acceleration is an input.
        flanges: names of the frames at which another part of a mechanism is coupled.
    """

    wrenches: tuple[str, ...]
    motions: tuple[tuple[str, Literal["q", "a"]], ...]
    flanges: tuple[str, ...]

    def drive(self, system: System, controller: Controller) -> DriveInputs:
        """Return the inputs of the state equation of a system with this controller."""
        frames = tuple(frame_of(system, label) for label in self.wrenches)
        return DriveInputs(
            wrenches=frames,
            motions=self.motions,
            effort=controller.effort,
            device=controller.device,
        )


def frame_of(system: System, label: str) -> str | int:
    """Return the frame with a name. "tool" is the terminal frame.

    Raises:
        ModelError: no frame has that name.
    """
    if label == "tool":
        return terminal_frame(system)
    if not isinstance(label, str) or label not in system.frames:
        raise ModelError(
            f"{system.name}: there is no frame {quoted(label)};"
            f" {did_you_mean(label, ['tool', *system.frames])}"
        )
    return label


def interface_of(system: System, inputs: Sequence[str], flanges: Sequence[str]) -> Interface:
    """Convert names of inputs and flanges to an Interface.

    Args:
        system: assembled mechanism, open or closed.
        inputs: names of inputs, such as "j1.q", "j1.a", "tool.wrench".
        flanges: names of frames.

    Raises:
        ModelError: a name is unknown or given twice, or a frame cannot move.
    """
    given, frames = once(system, "inputs", inputs), once(system, "flanges", flanges)
    wrenches, motions = list(frames), list[tuple[str, Literal["q", "a"]]]()
    for text in given:
        stem, _, end = text.rpartition(".")
        if end == "wrench":
            wrenches.append(stem)
        elif end in ("q", "a") and stem in [speed.name for speed in system.velocity_coordinates]:
            motions.append((stem, "q" if end == "q" else "a"))
        else:
            raise ModelError(
                f"{system.name}: the FMU has no input {text!r};"
                f" {did_you_mean(text, _possible(system))}"
            )
    for label in wrenches:
        if system.frame(frame_of(system, label))[0] < 0:
            raise ModelError(f"{system.name}: the frame {label} does not move; name another one")
    once(system, "wrenches of inputs and flanges", wrenches)
    once(system, "motions in inputs", [name for name, _ in motions])
    return Interface(tuple(wrenches), tuple(motions), tuple(frames))


def _possible(system: System) -> Iterator[str]:
    positions = [coordinate.name for coordinate in system.coordinates]
    for name in (system.velocity_coordinates[k].name for k in system.independent):
        yield f"{name}.a"
        if name in positions and not system.is_closed:
            yield f"{name}.q"
    moving = [label for label, (link, _) in system.frames.items() if link >= 0]
    yield from (f"{label}.wrench" for label in dict.fromkeys(("tool", *moving)))


def terminals(
    system: System, interface: Interface, variables: Sequence[FmuVariable]
) -> tuple[Terminal, ...]:
    """Return a terminal for every driven joint and every flange.

    Args:
        system: assembled mechanism, open or closed.
        interface: wrenches, prescribed motions and flanges.
        variables: states, inputs and outputs of the FMU.
    """
    names = {variable.name for variable in variables}
    driven = {name for name, _ in interface.motions}
    joints = (
        _joint(speed.name, speed.unit, names)
        for speed in system.velocity_coordinates
        if structured_name(f"{speed.name}.tau") in names
        and (speed.actuated or speed.name in driven)
    )
    return (*joints, *(_flange(label) for label in interface.flanges))


def _joint(name: str, unit: str, names: set[str]) -> Terminal:
    is_rotational = unit == "rad/s"
    suffixes = {
        "angle" if is_rotational else "position": "q",
        "velocity": "v",
        "acceleration": "a",
        "torque" if is_rotational else "force": "tau",
    }
    members = tuple(
        Member(member, f"{name}.{suffix}", "inflow" if suffix == "tau" else "signal")
        for member, suffix in suffixes.items()
        if structured_name(f"{name}.{suffix}") in names
    )
    kind = "mbs.revolute" if is_rotational else "mbs.prismatic"
    return Terminal(name, kind, members, description=f"drive of {name}")


def _flange(label: str) -> Terminal:
    signals = (Member(name, f"{label}.{name}") for name in (*POSE, *MOTION))
    flows = (Member(name, f"{label}.{name}", "inflow") for name in WRENCH)
    text = f"motion of {label} in the base frame, and the wrench on it"
    return Terminal(label, "mbs.flange", (*signals, *flows), description=text)


# Outputs on request: sensors, energies, poses, joint wrenches, closure residuals.


Labels = Sequence[str]


@dataclass(frozen=True, slots=True)
class OutputKind:
    """Kind of outputs on request. Each output group has a label, such as the name of a frame.

    Attributes:
        labels: function (system) -> all labels of this kind.
        variables: function (system, label) -> variables of a label.
        values: function (system, seen, labels) -> expressions of the variables of these labels.
        group: name that requests all labels of this kind, empty if there is no such name.
    """

    labels: Callable[[System], list[str]]
    variables: Callable[[System, str], Iterator[FmuVariable]]
    values: Callable[[System, OutputContext, Labels], list[SX]]
    group: str = ""


Request = Mapping[str, Labels]
"""Requested labels of each kind of `KINDS`, without duplicates."""


def make_request(system: System, names: Sequence[str], flanges: Labels = ()) -> Request:
    """Convert names of outputs to labels by kind, without duplicates.

    Args:
        system: assembled mechanism, open or closed.
        names: names of groups such as "poses", or of single outputs such as "pose:tool".
        flanges: names of frames whose pose and motion are outputs.

    Raises:
        ModelError: a name is unknown or given twice.
    """
    labels_by_kind: dict[str, dict[str, None]] = {kind: {} for kind in KINDS}
    groups = {shown.group: kind for kind, shown in KINDS.items() if shown.group}
    for name in once(system, "outputs", names):
        kind, _, label = name.partition(":")
        if name in groups:
            labels_by_kind[groups[name]] |= dict.fromkeys(_all(system, groups[name]))
        elif label and kind in KINDS and _has(system, kind, label):
            labels_by_kind[kind][label] = None
        else:
            raise ModelError(
                f"{system.name}: the FMU has no outputs {name!r};"
                f" {did_you_mean(name, [*groups, *_single(system)])}"
            )
    for kind in ("pose", "motion"):
        labels_by_kind[kind] |= dict.fromkeys(flanges)
    labels_by_kind["pose"].pop("tool", None)  # always shown
    return {kind: list(labels) for kind, labels in labels_by_kind.items() if labels}


def observed_variables(system: System, request: Request) -> tuple[FmuVariable, ...]:
    """Return the variables of the requested outputs."""
    return tuple(
        variable
        for kind, labels in request.items()
        for label in labels
        for variable in KINDS[kind].variables(system, label)
    )


def observed_values(system: System, request: Request, seen: OutputContext) -> list[SX]:
    """Return the expressions of the requested outputs, in the order of `observed_variables`."""
    return [
        value
        for kind, labels in request.items()
        for value in KINDS[kind].values(system, seen, labels)
    ]


def _all(system: System, kind: str) -> list[str]:
    labels = KINDS[kind].labels(system)
    if kind == "sensor" and not labels:
        raise ModelError(
            f"{system.name}: there is no sensor to show; add one to the mechanism, such as"
            " AbsoluteSensor('tip', body)"
        )
    return labels


def _has(system: System, kind: str, label: str) -> bool:
    frames = ("tool", *system.frames) if kind in _OF_FRAMES else ()
    return label in KINDS[kind].labels(system) or label in frames


def _single(system: System) -> Iterator[str]:
    for kind, shown in KINDS.items():
        yield from (f"{kind}:{label}" for label in shown.labels(system) if label)


def _sensors(system: System) -> list[str]:
    return [attached.sensor.name for attached in system.sensors]


def _sensor_variables(system: System, label: str) -> Iterator[FmuVariable]:
    for attached in system.sensors:
        if attached.sensor.name == label:
            for name, unit in attached.columns:
                yield FmuVariable(name=name, unit=unit, description=f"read by {label}")


def _sensor_values(system: System, seen: OutputContext, labels: Labels) -> list[SX]:
    for attached in system.sensors:
        if attached.joint is not None and attached.sensor.name in labels:
            _check_weld(system, seen, attached.joint)

    def read(s: ModelSymbols, a: SX, tau: SX, around: ExternalForces) -> list[SX]:
        every = iter(readings(system, s, a, tau, around))
        found = {
            attached.sensor.name: [next(every)[1] for _ in attached.outputs]
            for attached in system.sensors
        }
        return [value for label in labels for value in found[label]]

    return _load(system, seen, read)


def _energy_variables(system: System, label: str) -> Iterator[FmuVariable]:
    yield FmuVariable(name=f"energy.{label}", unit="J", description=f"{label} energy")


def _energy_values(system: System, seen: OutputContext, labels: Labels) -> list[SX]:
    values = outputs_of(system, energy(system, "tree"), seen.q, seen.v)
    return [dict(zip(_ENERGIES, values, strict=True))[label] for label in labels]


_ENERGIES = ("kinetic", "potential")


def _closure_variables(system: System, label: str) -> Iterator[FmuVariable]:
    text = "largest closure row of the loops, lengths in m and angles in rad"
    yield FmuVariable(name="closure", description=text)


def _closure_values(system: System, seen: OutputContext, labels: Labels) -> list[SX]:
    return [largest_closure_residual(system, seen.q)]


def _bodies(system: System) -> list[str]:
    return [body.name for body in system.bodies]


def _pose_variables(system: System, label: str) -> Iterator[FmuVariable]:
    return pose(label, frame_text(frame_of(system, label)))


def _pose_values(system: System, seen: OutputContext, labels: Labels) -> list[SX]:
    values = []
    for label in labels:
        T = relative_pose(system.tree, seen.q, BASE, _frame(system, label))
        values += [T.p, casadi.reshape(T.R.T, 9, 1)]
    return values


def _motion_variables(system: System, label: str) -> Iterator[FmuVariable]:
    kinds = {
        "v": ("m/s", "velocity"),
        "w": ("rad/s", "angular velocity"),
        "a": ("m/s2", "acceleration"),
        "wd": ("rad/s2", "angular acceleration"),
    }
    for element in MOTION:
        unit, noun = kinds[element[:-1]]
        text = f"{noun} of {label} along {element[-1]} of the base"
        yield FmuVariable(name=f"{label}.{element}", unit=unit, description=text)


def _motion_values(system: System, seen: OutputContext, labels: Labels) -> list[SX]:
    tree, poses = system.tree, link_poses(system.tree, seen.q)
    moving = link_velocities(tree, poses, seen.v)
    rates = link_accelerations(tree, poses, seen.v, seen.a, resting_base(zeros()))
    values = []
    for label in labels:
        frame = _frame(system, label)
        motion = relative_motion(tree, BASE, frame, seen.q, moving)
        rate = relative_acceleration(motion, BASE, frame, rates)
        values += [motion.V, motion.w, rate.A, rate.wd]
    return values


def _frame(system: System, label: str) -> Frame:
    return system.frame(frame_of(system, label))


def _joints(system: System) -> list[str]:
    return [joint.name for joint in system.joints]


def _wrench_variables(system: System, label: str) -> Iterator[FmuVariable]:
    for kind, unit, noun in (("f", "N", "force"), ("m", "N.m", "moment")):
        for axis in "xyz":
            text = f"{noun} that {label} transmits, along {axis} of its frame_b"
            yield FmuVariable(name=f"{label}.{kind}.{axis}", unit=unit, description=text)


def _wrench_values(system: System, seen: OutputContext, labels: Labels) -> list[SX]:
    numbers = [_joints(system).index(label) for label in labels]
    for number in numbers:
        _check_weld(system, seen, number)

    def between(s: ModelSymbols, a: SX, tau: SX, around: ExternalForces) -> list[SX]:
        wrenches = wrenches_of_joints(system, s, a, tau, around)
        return [casadi.vertcat(*wrenches[number]) for number in numbers]

    return _load(system, seen, between)


def _check_weld(system: System, seen: OutputContext, number: int) -> None:
    """Raise if the wrench of a Fixed joint is ambiguous.

    An external wrench on its rigid link may act on either side of the joint.
    """
    joint = system.joints[number]
    if joint.part is not None and joint.frame_b[0] in seen.external:
        raise ModelError(
            f"{system.name}: what {joint.name} transmits cannot be shown, since a wrench from"
            " outside acts on the link that it is part of; leave out one of the two"
        )


def _load(
    system: System,
    seen: OutputContext,
    make: Callable[[ModelSymbols, SX, SX, ExternalForces], list[SX]],
) -> list[SX]:
    """Evaluate make(symbols, a, tau, surroundings) at the motion, efforts and wrenches of seen."""
    s = symbols_of(system, "tree")
    a, tau = SX.sym("a", system.nv), SX.sym("tau", system.nv)
    pushes = {link: (SX.sym("f", 3), SX.sym("m", 3)) for link in seen.external}
    around = ExternalForces(resting_base(system.tree.gravity), dict(pushes), [])
    values = [casadi.vec(value) for value in make(s, a, tau, around)]
    symbols = [s.q, s.v, a, tau, *(x for push in pushes.values() for x in push), system.p]
    given = [seen.q, seen.v, seen.a, seen.tau, *(x for w in seen.external.values() for x in w)]
    model = Function("loaded", symbols, [casadi.vertcat(*values)])
    return [SX(model(*given, seen.p))]


_OF_FRAMES = ("pose", "motion")

KINDS = {
    "sensor": OutputKind(_sensors, _sensor_variables, _sensor_values, "sensors"),
    "energies": OutputKind(lambda _: list(_ENERGIES), _energy_variables, _energy_values, "energy"),
    "loops": OutputKind(lambda _: [""], _closure_variables, _closure_values, "closure"),
    "pose": OutputKind(_bodies, _pose_variables, _pose_values, "poses"),
    "motion": OutputKind(_bodies, _motion_variables, _motion_values),
    "wrench": OutputKind(_joints, _wrench_variables, _wrench_values, "cut_forces"),
}
