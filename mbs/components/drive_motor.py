"""What drives a drive line: torques that follow from an input and from states of their own."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from casadi import SX

from mbs.components.component import Component
from mbs.components.drive_flange import OneFlange
from mbs.components.drive_shafts import check_inertia
from mbs.components.placement import SymbolTable
from mbs.errors import DescriptionError
from mbs.expressions import Expression, Number, Scalar, expression, to_float, to_sx

Quantity = tuple[str, str]
"""A name inside the device, and its unit."""


@dataclass(frozen=True, slots=True)
class Device(OneFlange):
    """A device that turns a shaft; z are its states, u its input, w the speed of the shaft."""

    @property
    def input(self) -> Quantity:
        """What it is driven by."""
        raise NotImplementedError

    @property
    def states(self) -> tuple[Quantity, ...]:
        """Its own states, such as a current."""
        return ()

    def rate(self, z: SX, u: SX, w: SX, symbols: SymbolTable) -> SX:
        """Time derivatives of its states, as many as there are."""
        return SX(0, 1)

    def torque(self, z: SX, u: SX, w: SX, symbols: SymbolTable) -> SX:
        """What it turns the shaft with [N m]."""
        raise NotImplementedError

    def shown(self, z: SX, u: SX, w: SX, symbols: SymbolTable) -> dict[Quantity, SX]:
        """What a result has of it, beside its input and its states."""
        return {("w", "rad/s"): w}


@dataclass(frozen=True, slots=True)
class TorqueSource(Device):
    """A given torque on a shaft: the input `tau` [N m]."""

    @property
    def input(self) -> Quantity:
        """The torque."""
        return "tau", "N.m"

    def torque(self, z: SX, u: SX, w: SX, symbols: SymbolTable) -> SX:
        """The input."""
        return u


@dataclass(frozen=True, slots=True)
class DCMotor(Device):
    """A motor with permanent magnets: the input is its voltage, its torque follows the current.

    inductance * di/dt = voltage - resistance * i - constant * w, and torque = constant * i. With
    no inductance the current follows the voltage at once, and there is no state.

    Attributes:
        resistance: of the armature [ohm].
        inductance: of the armature [H].
        constant: torque for a unit of current [N m/A], which is the voltage for a unit of speed
            [V s/rad] too.
        inertia: of the rotor [kg m^2].
    """

    resistance: Scalar
    inductance: Scalar
    constant: Scalar
    inertia: Scalar = 0.0

    def __post_init__(self) -> None:
        Component.__post_init__(self)
        self._normalise("resistance", "inductance", "constant", "inertia")
        for name in ("resistance", "constant"):
            value = to_float(getattr(self, name))
            if value is not None and value <= 0:
                raise DescriptionError(f"{self.name}: {name} is {value:g}; give more than zero")
        value = to_float(self.inductance)
        if value is not None and value < 0:
            raise DescriptionError(f"{self.name}: inductance is {value:g} H; give zero or more")
        check_inertia(self.name, self.inertia)

    def check_values(self, values: Mapping[str, float]) -> None:
        """Refuse values that the motor itself would refuse, and a symbol of no inductance."""
        Component.check_values(self, values)
        if self.states and to_float(self.inductance, values) == 0:
            raise DescriptionError(
                f"{self.name}: inductance is {self.inductance}, which has the value 0, but a"
                " current that is a state needs more; give it one, or write the number 0 for none"
            )

    @property
    def input(self) -> Quantity:
        """The voltage at its terminals."""
        return "voltage", "V"

    @property
    def states(self) -> tuple[Quantity, ...]:
        """The current, unless there is no inductance."""
        return () if self.inductance == Number(0.0) else (("i", "A"),)

    @property
    def own_inertia(self) -> Expression:
        """That of the rotor."""
        return expression(self.inertia)

    def rate(self, z: SX, u: SX, w: SX, symbols: SymbolTable) -> SX:
        """Of the current."""
        if not self.states:
            return SX(0, 1)
        left = self._left(u, w, symbols) - to_sx(self.resistance, symbols) * z
        return left / to_sx(self.inductance, symbols)

    def torque(self, z: SX, u: SX, w: SX, symbols: SymbolTable) -> SX:
        """In proportion to the current."""
        return to_sx(self.constant, symbols) * self._current(z, u, w, symbols)

    def shown(self, z: SX, u: SX, w: SX, symbols: SymbolTable) -> dict[Quantity, SX]:
        """Torque and speed, and the current where it is no state."""
        current = {} if self.states else {("i", "A"): self._current(z, u, w, symbols)}
        return {
            **current,
            ("tau", "N.m"): self.torque(z, u, w, symbols),
            ("w", "rad/s"): w,
        }

    def _current(self, z: SX, u: SX, w: SX, symbols: SymbolTable) -> SX:
        return z if self.states else self._left(u, w, symbols) / to_sx(self.resistance, symbols)

    def _left(self, u: SX, w: SX, symbols: SymbolTable) -> SX:
        """What the induced voltage leaves of the voltage."""
        return u - to_sx(self.constant, symbols) * w
