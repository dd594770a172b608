"""The tables of drive lines: what every rigid part turns with, and the devices that drive."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import casadi
from casadi import SX

from mbs.assembly.drive_line import DriveLine
from mbs.assembly.tables import Coordinate
from mbs.components import IdealGear, ShaftInertia
from mbs.components.drive_motor import Device, Quantity
from mbs.expressions import to_sx


@dataclass(frozen=True, slots=True)
class ShaftRow:
    """An inertia or a rigid gear of a drive line, and what it turns with.

    Attributes:
        name: of the component.
        kind: ShaftInertia, IdealGear, or DCMotor where its rotor has a coordinate of its own.
        coordinate: the coordinate that it turns with.
        own: whether this coordinate is its own, and not that of a joint or another inertia.
        factor: its angle, of a gear that of flange_a, is factor times the coordinate; a number,
            or an expression where a symbol is in it.
    """

    name: str
    kind: str
    coordinate: str
    own: bool
    factor: float | SX

    @property
    def sentence(self) -> str:
        """What it is and how it turns."""
        if self.own:
            return f"{self.kind} {self.name} has a coordinate of its own, {self.coordinate}."
        turns = f"turns {_as_fast(self.factor, self.coordinate)}"
        if self.kind == IdealGear.__name__:
            return f"{self.kind} {self.name} is rigid: its flange_a {turns}."
        return f"{self.kind} {self.name} {turns}, which has its inertia."


@dataclass(frozen=True, slots=True, eq=False)
class AttachedDevice:
    """A device that drives a shaft; z (n, 1) are its states, u (1, 1) its input.

    Attributes:
        device: its description.
        coordinate: the coordinate that it turns.
        velocity: number in v of this coordinate.
        factor: speed of its flange for a unit velocity of the coordinate.
        symbols: CasADi symbol of every parameter.
    """

    device: Device
    coordinate: str
    velocity: int
    factor: SX
    symbols: Mapping[str, SX]

    @property
    def name(self) -> str:
        """The name of the component."""
        return self.device.name

    @property
    def states(self) -> tuple[Quantity, ...]:
        """Full name and unit of every state."""
        return tuple((f"{self.name}.{state}", unit) for state, unit in self.device.states)

    @property
    def input(self) -> Quantity:
        """Full name and unit of its input."""
        name, unit = self.device.input
        return f"{self.name}.{name}", unit

    @property
    def outputs(self) -> tuple[Quantity, ...]:
        """Full name and unit of what else a result shows of it."""
        z, u = SX.sym("z", len(self.states)), SX.sym("u")
        shown = self.device.shown(z, u, SX.sym("w"), self.symbols)
        return tuple((f"{self.name}.{name}", unit) for name, unit in shown)

    def rate(self, z: SX, u: SX, v: SX) -> SX:
        """(n, 1) time derivatives of its states; v (nv, 1) are the velocities."""
        return self.device.rate(z, u, self._speed(v), self.symbols)

    def effort(self, z: SX, u: SX, v: SX) -> SX:
        """What it delivers at its coordinate [N m or N]."""
        return self.factor * self.device.torque(z, u, self._speed(v), self.symbols)

    def shown(self, z: SX, u: SX, v: SX) -> SX:
        """The values of its outputs."""
        return casadi.vertcat(*self.device.shown(z, u, self._speed(v), self.symbols).values())

    @property
    def sentence(self) -> str:
        """What it is, what it drives and by which input."""
        states = "".join(f", state {name} [{unit}]" for name, unit in self.states)
        name, unit = self.input
        turns = _as_fast(_number(self.factor), self.coordinate)
        return (
            f"{type(self.device).__name__} {self.name} drives {self.coordinate} and turns {turns}:"
            f" input {name} [{unit}]{states}."
        )

    def _speed(self, v: SX) -> SX:
        return self.factor * v[self.velocity]


def shaft_rows(line: DriveLine, symbols: Mapping[str, SX]) -> tuple[ShaftRow, ...]:
    """Every inertia and rigid gear, and motors whose rotor is a link, in the order added."""
    rows = []
    for part in line.parts:
        turn = line.turns[part.flanges[0].key]
        own = line.links.get(turn.coordinate) == part.name
        if own or isinstance(part, (ShaftInertia, IdealGear)):
            factor = _number(to_sx(turn.factor, symbols))
            rows.append(ShaftRow(part.name, type(part).__name__, turn.coordinate, own, factor))
    return tuple(rows)


def attached_devices(
    line: DriveLine, speeds: Sequence[Coordinate], symbols: Mapping[str, SX]
) -> tuple[AttachedDevice, ...]:
    """Every device with the coordinate that it turns, in the order added."""
    numbers = {speed.name: number for number, speed in enumerate(speeds)}
    rows = []
    for part in line.parts:
        if isinstance(part, Device):
            turn = line.turns[part.flange.key]
            where = turn.coordinate, numbers[turn.coordinate]
            rows.append(AttachedDevice(part, *where, to_sx(turn.factor, symbols), symbols))
    return tuple(rows)


def _number(factor: SX) -> float | SX:
    return float(factor) if factor.is_constant() else factor


def _as_fast(factor: float | SX, coordinate: str) -> str:
    if isinstance(factor, float) and factor == 1:
        return f"with {coordinate}"
    text = format(factor, "g") if isinstance(factor, float) else str(factor)
    return f"{text} times as fast as {coordinate}"
