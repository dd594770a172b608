"""Drive lines: flanges, shafts and gears, what drives them, elastic parts between them.

A flange has an angle, which is the same for all flanges that are connected, and a torque, and the
torques of connected flanges add up to zero.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from casadi import SX

from mbs.components.component import Component, SymbolTable
from mbs.components.forces import CoordinateForce
from mbs.errors import DescriptionError
from mbs.expressions import Expression, Number, Scalar, expression, to_float, to_sx
from mbs.text import quoted


@dataclass(frozen=True, slots=True)
class Flange:
    """An end of a shaft that another one can be connected to.

    Attributes:
        owner: the component that it belongs to: a part of a drive line, or a joint.
        port: which flange of it, "a" or "b"; nothing where there is only one.
    """

    owner: Component
    port: str = ""

    @property
    def key(self) -> tuple[str, str]:
        """The name of its component, and which flange of it."""
        return self.owner.name, self.port

    def __str__(self) -> str:
        return f"{self.owner.name}.flange{'_' if self.port else ''}{self.port}"


@dataclass(frozen=True, slots=True)
class Flanged(Component):
    """A part of a drive line: it turns, or acts on what turns, but has no place in space."""

    @property
    def flanges(self) -> tuple[Flange, ...]:
        """All its flanges."""
        raise NotImplementedError

    @property
    def own_inertia(self) -> Expression:
        """Inertia that it adds to its shaft [kg m^2]."""
        return Number(0.0)


@dataclass(frozen=True, slots=True)
class OneFlange(Flanged):
    """A part at one place of a shaft."""

    @property
    def flange(self) -> Flange:
        """Its flange."""
        return Flange(self)

    @property
    def flanges(self) -> tuple[Flange, ...]:
        """The flange alone."""
        return (self.flange,)


@dataclass(frozen=True, slots=True)
class TwoFlanges(Flanged):
    """A part between two shafts, or between the ends of one."""

    @property
    def flange_a(self) -> Flange:
        """One flange; of a gear the one that turns `ratio` times as much."""
        return Flange(self, "a")

    @property
    def flange_b(self) -> Flange:
        """The other flange."""
        return Flange(self, "b")

    @property
    def flanges(self) -> tuple[Flange, ...]:
        """The two."""
        return self.flange_a, self.flange_b


def flange_pair(where: str, *given: Any) -> tuple[Flange, Flange]:
    """The two flanges that a user connects.

    Raises:
        DescriptionError: one of them is no flange, or there are not two.
    """
    flanges = [value for value in given if isinstance(value, Flange)]
    others = [value for value in given if value is not None and not isinstance(value, Flange)]
    if len(flanges) != 2 or others:
        what = f"{quoted(others[0])} is no flange" if others else f"{len(flanges)} are given"
        raise DescriptionError(
            f"{where}: a flange is connected to one other flange, but {what}; write"
            " connect(flange, flange), such as connect(motor.flange, gear.flange_a)"
        )
    if flanges[0].key == flanges[1].key:
        raise DescriptionError(
            f"{where}: {flanges[0]} cannot be connected to itself; name two flanges"
        )
    return flanges[0], flanges[1]


# Rigid parts of a drive line: inertias on shafts, gears without play.


@dataclass(frozen=True, slots=True)
class ShaftInertia(TwoFlanges):
    """A rotating inertia; its two flanges are the two ends of one rigid shaft.

    Attributes:
        inertia: about the axis of the shaft [kg m^2].
    """

    inertia: Scalar

    def __post_init__(self) -> None:
        Component.__post_init__(self)
        self._normalise("inertia")
        check_inertia(self.name, self.inertia)

    @property
    def own_inertia(self) -> Expression:
        """All of it."""
        return expression(self.inertia)


@dataclass(frozen=True, slots=True)
class IdealGear(TwoFlanges):
    """A rigid gear without losses: angle_a = ratio * angle_b, and torque_b = -ratio * torque_a.

    Attributes:
        ratio: turns of flange_a for a turn of flange_b, or rad for 1 m where flange_b is on a
            prismatic joint; less than zero when they turn in opposite ways.
    """

    ratio: Scalar

    def __post_init__(self) -> None:
        Component.__post_init__(self)
        self._normalise("ratio")
        check_ratio(self.name, self.ratio)


def check_inertia(name: str, inertia: Scalar) -> None:
    """Refuse an inertia that is a negative number."""
    value = to_float(inertia)
    if value is not None and value < 0:
        raise DescriptionError(f"{name}: inertia is {value:g} kg m^2; give zero or more")


def check_ratio(name: str, ratio: Scalar) -> None:
    """Refuse a gear that ties nothing."""
    if to_float(ratio) == 0:
        raise DescriptionError(
            f"{name}: ratio is 0, which ties nothing; give the turns of flange_a for a turn of"
            " flange_b, less than zero where they turn in opposite ways"
        )


# What drives a drive line: torques that follow from an input and from states of their own.


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


# Elastic and damping parts of a drive line: forces on the coordinates of its shafts.


@dataclass(frozen=True, slots=True)
class ShaftForce(CoordinateForce):
    """A spring and a damper on x, the sum of the angles of its flanges, each times a share.

    Attributes:
        levers: the coordinates that x is made of; the assembly knows them, leave them out.
    """

    levers: tuple[tuple[str, Scalar], ...] = field(default=(), kw_only=True, repr=False)

    @property
    def shares(self) -> Iterable[tuple[Flange, Expression]]:
        """What every flange contributes to x for a unit of its angle."""
        raise NotImplementedError

    @property
    def needs_position(self) -> bool:
        """A twist is one of positions."""
        return True


@dataclass(frozen=True, slots=True)
class ElasticShaft(ShaftForce, TwoFlanges):
    """A massless elastic shaft: torque = stiffness * twist + damping * its rate.

    The twist is the angle of flange_a less that of flange_b.

    Attributes:
        stiffness: [N m/rad].
        damping: [N m s/rad].
    """

    stiffness: Scalar
    damping: Scalar = 0.0

    def __post_init__(self) -> None:
        Component.__post_init__(self)
        self._normalise("stiffness", "damping")
        self._require_magnitudes("stiffness", "damping")
        self._require_effect("stiffness", "damping")

    @property
    def shares(self) -> Iterable[tuple[Flange, Expression]]:
        """The difference of the two angles."""
        return (self.flange_a, Number(1.0)), (self.flange_b, Number(-1.0))

    def effort(self, x: SX | None, rate: SX, symbols: SymbolTable) -> SX:
        """The torque that twists it."""
        assert x is not None
        return to_sx(self.stiffness, symbols) * x + to_sx(self.damping, symbols) * rate

    def energy(self, x: SX | None, symbols: SymbolTable) -> SX:
        """What its twist stores."""
        assert x is not None
        return 0.5 * to_sx(self.stiffness, symbols) * x**2


@dataclass(frozen=True, slots=True, kw_only=True)
class ElasticGear(ElasticShaft):
    """A gear with an elastic transmission, its twist and its stiffness taken at flange_b.

    twist = angle_a / ratio - angle_b; flange_b gets the torque stiffness * twist + damping * rate
    and flange_a the opposite of this divided by ratio.

    Attributes:
        ratio: turns of flange_a for a turn of flange_b, or rad for 1 m where flange_b is on a
            prismatic joint, whose stiffness is then in N/m; less than zero when they turn in
            opposite ways.
    """

    ratio: Scalar

    def __post_init__(self) -> None:
        ElasticShaft.__post_init__(self)
        self._normalise("ratio")
        check_ratio(self.name, self.ratio)

    @property
    def shares(self) -> Iterable[tuple[Flange, Expression]]:
        """What flange_a is at the other side of the gear, less the angle of flange_b."""
        return (self.flange_a, 1 / expression(self.ratio)), (self.flange_b, Number(-1.0))


@dataclass(frozen=True, slots=True)
class ShaftDamper(ShaftForce, OneFlange):
    """Viscous friction of a bearing between a shaft and the housing.

    Attributes:
        damping: [N m s/rad].
    """

    damping: Scalar

    def __post_init__(self) -> None:
        Component.__post_init__(self)
        self._normalise("damping")
        self._require_magnitudes("damping")
        self._require_effect("damping")

    @property
    def shares(self) -> Iterable[tuple[Flange, Expression]]:
        """The angle of its flange."""
        return ((self.flange, Number(1.0)),)

    def effort(self, x: SX | None, rate: SX, symbols: SymbolTable) -> SX:
        """The torque that the bearing takes."""
        return to_sx(self.damping, symbols) * rate

    def energy(self, x: SX | None, symbols: SymbolTable) -> SX:
        """A bearing stores nothing."""
        return SX(0)
