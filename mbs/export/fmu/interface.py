"""What drives a mechanism's FMU from outside, and the terminals that group its variables."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

from mbs.assembly import System
from mbs.errors import ModelError
from mbs.export.fmu.controller import Controller
from mbs.export.fmu.description import FmuVariable, Member, Terminal
from mbs.export.fmu.names import once, structured
from mbs.export.fmu.variables import POSE, WRENCH
from mbs.messages import did_you_mean, quoted
from mbs.models.geometry import terminal_frame
from mbs.models.minimal_state import DriveInputs

MOTION = tuple(f"{kind}{axis}" for kind in ("v", "w", "a", "wd") for axis in "xyz")
"""Elements of velocity, angular velocity and accelerations of a frame."""


@dataclass(frozen=True, slots=True)
class Interface:
    """What is asked for beside the efforts of motors.

    Attributes:
        wrenches: names of the frames on which wrenches act.
        motions: names of velocities, and whether position or acceleration is given.
        flanges: names of frames where another part of a mechanism is coupled.
    """

    wrenches: tuple[str, ...]
    motions: tuple[tuple[str, Literal["q", "a"]], ...]
    flanges: tuple[str, ...]

    def drive(self, system: System, controller: Controller) -> DriveInputs:
        """What drives the state equation."""
        frames = tuple(frame_of(system, label) for label in self.wrenches)
        return DriveInputs(
            wrenches=frames,
            motions=self.motions,
            effort=controller.effort,
            device=controller.device,
        )


def frame_of(system: System, label: str) -> str | int:
    """The frame that a label names: "tool" is the terminal frame.

    Raises:
        ModelError: there is none of that name.
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
    """The interface that a user names.

    Args:
        system: open or closed.
        inputs: such as "j1.q", "j1.a", "tool.wrench".
        flanges: names of frames.

    Raises:
        ModelError: something is unknown, does not move, or is given twice.
    """
    given, frames = once(system, "inputs", inputs), once(system, "flanges", flanges)
    wrenches, motions = list(frames), list[tuple[str, Literal["q", "a"]]]()
    for text in given:
        stem, _, end = text.rpartition(".")
        if end == "wrench":
            wrenches.append(stem)
        elif end in ("q", "a") and stem in [speed.name for speed in system.speeds]:
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
    for name in (system.speeds[k].name for k in system.active):
        yield f"{name}.a"
        if name in positions and not system.is_closed:
            yield f"{name}.q"
    moving = [label for label, (link, _) in system.frames.items() if link >= 0]
    yield from (f"{label}.wrench" for label in dict.fromkeys(("tool", *moving)))


def terminals(
    system: System, interface: Interface, variables: Sequence[FmuVariable]
) -> tuple[Terminal, ...]:
    """A terminal for every joint with a drive, and for every flange.

    Args:
        system: open or closed.
        interface: what drives it.
        variables: states, inputs and outputs of the FMU.
    """
    names = {variable.name for variable in variables}
    driven = {name for name, _ in interface.motions}
    joints = (
        _joint(speed.name, speed.unit, names)
        for speed in system.speeds
        if structured(f"{speed.name}.tau") in names and (speed.actuated or speed.name in driven)
    )
    return (*joints, *(_flange(label) for label in interface.flanges))


def _joint(name: str, unit: str, names: set[str]) -> Terminal:
    turns = unit == "rad/s"
    suffixes = {
        "angle" if turns else "position": "q",
        "velocity": "v",
        "acceleration": "a",
        "torque" if turns else "force": "tau",
    }
    members = tuple(
        Member(member, f"{name}.{suffix}", "inflow" if suffix == "tau" else "signal")
        for member, suffix in suffixes.items()
        if structured(f"{name}.{suffix}") in names
    )
    kind = "mbs.revolute" if turns else "mbs.prismatic"
    return Terminal(name, kind, members, description=f"drive of {name}")


def _flange(label: str) -> Terminal:
    signals = (Member(name, f"{label}.{name}") for name in (*POSE, *MOTION))
    flows = (Member(name, f"{label}.{name}", "inflow") for name in WRENCH)
    text = f"motion of {label} in the base frame, and the wrench on it"
    return Terminal(label, "mbs.flange", (*signals, *flows), description=text)
