"""Drive lines: flanges, shafts, gears, motors, and elastic parts between them.

Connected flanges have the same angle, and their torques add up to zero.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Self

from casadi import SX

from mbs.components import custom
from mbs.components.component import Component
from mbs.components.custom import At, Custom, Flange, Load
from mbs.components.forces import CoordinateForce
from mbs.errors import DescriptionError
from mbs.expressions import Expression, Number, Scalar, expression, to_float, to_sx
from mbs.text import quoted


@dataclass(frozen=True, slots=True)
class OneFlange(Custom):
    """Base of parts at one point of a shaft."""

    flange = custom.flange()


@dataclass(frozen=True, slots=True)
class TwoFlanges(Custom):
    """Base of parts with two flanges: between two shafts, or a shaft with two ends."""

    flange_a = custom.flange()
    flange_b = custom.flange()


def flange_pair(where: str, *given: Any) -> tuple[Flange, Flange]:
    """Return the two flanges in the arguments of a connection.

    Args:
        where: name of the mechanism, for the message.
        given: arguments; None is ignored.

    Raises:
        DescriptionError: an argument is no flange, or there are not exactly two.
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
class RigidPart(TwoFlanges):
    """Base of inertias and masses: one rigid part with flange_a and flange_b at its two ends.

    The assembly adds `own_inertia` to the joint or shaft that its flanges are connected to.
    """

    lowered = True


@dataclass(frozen=True, slots=True)
class ShaftInertia(RigidPart):
    """A rotating inertia on a rigid shaft with a flange at each end.

    Attributes:
        inertia: moment of inertia about the axis of the shaft [kg m^2].
    """

    inertia: Scalar

    def __post_init__(self) -> None:
        Component.__post_init__(self)
        self._normalise("inertia")
        check_inertia(self.name, self.inertia)

    @property
    def own_inertia(self) -> Expression:
        """The moment of inertia [kg m^2], which the assembly adds to the shaft."""
        return expression(self.inertia)


@dataclass(frozen=True, slots=True)
class IdealGear(TwoFlanges):
    """A rigid gear without losses: angle_a = ratio * angle_b, and torque_b = -ratio * torque_a.

    Attributes:
        ratio: revolutions of flange_a per revolution of flange_b, or rad per m if flange_b is on a
            prismatic joint; negative for opposite directions.
    """

    lowered = True

    flange_b = custom.flange(slides=None)

    ratio: Scalar

    def __post_init__(self) -> None:
        Component.__post_init__(self)
        self._normalise("ratio")
        check_ratio(self.name, self.ratio)


class FixedFlange(OneFlange):
    """A fixed flange: the housing, for shafts and for sliding parts.

    It locks connected flanges at zero: the end of a spring, the ring of a planetary gear.
    """

    fixed = True
    lowered = True

    flange = custom.flange(slides=None)


def check_inertia(name: str, inertia: Scalar) -> None:
    """Raise DescriptionError if an inertia [kg m^2] is a negative number; symbols pass.

    Args:
        name: name of the component, for the message.
        inertia: moment of inertia.
    """
    value = to_float(inertia)
    if value is not None and value < 0:
        raise DescriptionError(f"{name}: inertia is {value:g} kg m^2; give zero or more")


def check_ratio(name: str, ratio: Scalar) -> None:
    """Raise DescriptionError if a gear ratio is zero; symbols pass.

    Args:
        name: name of the component, for the message.
        ratio: gear ratio.
    """
    if to_float(ratio) == 0:
        raise DescriptionError(
            f"{name}: ratio is 0, which ties nothing; give the revolutions of flange_a per"
            " revolution of flange_b, less than zero where they rotate in opposite directions"
        )


# Drives: torques that follow from an input and from states of the drive.


@dataclass(frozen=True, slots=True)
class Device(OneFlange):
    """Base of motors: the torque on the shaft is part of the efforts tau of models.

    A user-defined motor derives from this class. Its `loads` returns {"flange": torque [N m]}.
    """

    drives = True


class TorqueSource(Device):
    """An imposed torque on a shaft: the input `tau` [N m]."""

    tau = custom.input("N.m")
    w = custom.output("rad/s")

    def loads(self, at: At) -> Mapping[str, Load]:
        """Return {"flange": torque ON the shaft [N m]}, equal to the input `tau`.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return {"flange": at.tau}

    def outputs(self, at: At) -> Mapping[str, SX]:
        """Return {"w": speed of the shaft [rad/s]}.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return {"w": at.flange.speed}


class DCMotor(Device):
    """A permanent-magnet DC motor with the voltage as input.

    inductance * di/dt = voltage - resistance * i - constant * w, and torque = constant * i. Without
    inductance the current follows the voltage instantly and is no state.

    Attributes:
        resistance: resistance of the armature [ohm].
        inductance: inductance of the armature [H].
        constant: torque per current [N m/A], equal to the voltage per speed [V s/rad].
        inertia: moment of inertia of the rotor [kg m^2].
    """

    resistance = custom.parameter("ohm", positive=True)
    inductance = custom.parameter("H", min=0)
    constant = custom.parameter("N.m/A", positive=True)
    inertia = custom.parameter("kg.m2", 0.0, min=0)
    voltage = custom.input("V")
    i = custom.state("A")
    tau = custom.output("N.m")
    w = custom.output("rad/s")

    def check_values(self, values: Mapping[str, float]) -> Self:
        """Return the motor with numeric values of its parameters, checked as in `__init__`.

        Args:
            values: value by parameter name.

        Raises:
            DescriptionError: a symbolic inductance has the value 0, but the current is a state.
        """
        checked = Component.check_values(self, values)
        if "i" in self.state_names and to_float(self.inductance, values) == 0:
            raise DescriptionError(
                f"{self.name}: inductance is {self.inductance}, which has the value 0, but a"
                " current that is a state needs more; give it one, or write the number 0 for none"
            )
        return checked

    @property
    def own_inertia(self) -> Expression:
        """Moment of inertia of the rotor [kg m^2], which the assembly adds to the shaft."""
        return expression(self.inertia)

    @property
    def state_names(self) -> tuple[str, ...]:
        """("i",) if the inductance is not the number 0, plus states of subclasses."""
        every = self.names_of("state", "mode")
        return tuple(name for name in every if name != "i" or self.inductance != Number(0.0))

    @property
    def output_names(self) -> tuple[str, ...]:
        """Names of outputs: "tau" and "w", preceded by "i" if the current is not a state."""
        own = self.names_of("output")
        return own if "i" in self.state_names else ("i", *own)

    def rates(self, at: At) -> Mapping[str, SX]:
        """Return {"i": di/dt [A/s]}; empty if the inductance is the number 0.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        left = at.voltage - at.constant * at.flange.speed - at.resistance * at.i
        return {"i": left / at.inductance} if "i" in self.state_names else {}

    def loads(self, at: At) -> Mapping[str, Load]:
        """Return {"flange": torque ON the shaft, constant times current [N m]}.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return {"flange": at.constant * self._current(at)}

    def outputs(self, at: At) -> Mapping[str, SX]:
        """Return "tau": torque ON the shaft [N m] and "w": its speed [rad/s].

        The current "i" [A] is a third output if it is no state.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        i = self._current(at)
        values = {"tau": at.constant * i, "w": at.flange.speed}
        return values if "i" in self.state_names else {"i": i, **values}

    def _current(self, at: At) -> SX:
        """Return the current [A], a state or, without inductance, a function of voltage and speed.

        Without inductance it is (voltage - constant w) / resistance.
        """
        if "i" in self.state_names:
            return SX(at.i)
        return SX((at.voltage - at.constant * at.flange.speed) / at.resistance)


class BLDCMotor(Device):
    """A brushless motor with permanent magnets (synchronous, sinusoidal) in dq coordinates.

    With pole pairs P and the speed w of the shaft,

        L_d di_d/dt = v_d - R i_d + P w L_q i_q
        L_q di_q/dt = v_q - R i_q - P w (L_d i_d + psi)
        torque = 3/2 P (psi i_q + (L_d - L_q) i_d i_q)

    for voltages and currents equal to the amplitudes of the phases. The electrical power is
    3/2 (v_d i_d + v_q i_q): the copper loss 3/2 R (i_d^2 + i_q^2), the rate of the magnetic energy
    3/4 (L_d i_d^2 + L_q i_q^2), and the mechanical power torque w.

    Source: Krause et al. 2013.

    Attributes:
        pole_pairs: P, electrical revolutions per revolution of the shaft.
        resistance: R, resistance of a phase [ohm].
        inductance_d: L_d, inductance along the magnets [H].
        inductance_q: L_q, inductance across the magnets [H]. The default is L_d.
        flux: psi, flux linkage of the magnets [Wb].
        inertia: moment of inertia of the rotor [kg m^2].
    """

    pole_pairs = custom.parameter("1", positive=True)
    resistance = custom.parameter("ohm", positive=True)
    inductance_d = custom.parameter("H", positive=True)
    flux = custom.parameter("Wb", positive=True)
    inductance_q = custom.parameter("H", None, positive=True)
    inertia = custom.parameter("kg.m2", 0.0, min=0)
    v_d = custom.input("V")
    v_q = custom.input("V")
    i_d = custom.state("A")
    i_q = custom.state("A")
    tau = custom.output("N.m")
    w = custom.output("rad/s")
    power = custom.output("W")

    @property
    def own_inertia(self) -> Expression:
        """Moment of inertia of the rotor [kg m^2], which the assembly adds to the shaft."""
        return expression(self.inertia)

    def rates(self, at: At) -> Mapping[str, SX]:
        """Return the rates of the currents i_d and i_q [A/s].

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        L_d, L_q = self._inductances(at)
        w = at.pole_pairs * at.flange.speed
        return {
            "i_d": (at.v_d - at.resistance * at.i_d + w * L_q * at.i_q) / L_d,
            "i_q": (at.v_q - at.resistance * at.i_q - w * (L_d * at.i_d + at.flux)) / L_q,
        }

    def loads(self, at: At) -> Mapping[str, Load]:
        """Return {"flange": torque ON the shaft [N m]}: the torque of the class docstring.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return {"flange": self._torque(at)}

    def outputs(self, at: At) -> Mapping[str, SX]:
        """Return "tau": torque ON the shaft [N m], "w": its speed [rad/s], and "power".

        "power" is the electrical input power [W].

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        power = 1.5 * (at.v_d * at.i_d + at.v_q * at.i_q)
        return {"tau": self._torque(at), "w": at.flange.speed, "power": power}

    def _torque(self, at: At) -> SX:
        """Return the torque on the shaft, 3/2 P (psi i_q + (L_d - L_q) i_d i_q) [N m]."""
        L_d, L_q = self._inductances(at)
        return SX(1.5 * at.pole_pairs * (at.flux * at.i_q + (L_d - L_q) * at.i_d * at.i_q))

    @staticmethod
    def _inductances(at: At) -> tuple[SX, SX]:
        """Return (L_d, L_q) [H]; L_q is L_d if it is not given."""
        return at.inductance_d, at.inductance_d if at.inductance_q is None else at.inductance_q


# Elastic and damping parts of a drive line: forces on coordinates of shafts.


@dataclass(frozen=True, slots=True)
class ShaftForce(CoordinateForce):
    """Base of springs and dampers on x, a weighted sum of the angles of its flanges.

    Attributes:
        levers: pairs of coordinate and weight in x, set by the assembly. Leave them out.
    """

    levers: tuple[tuple[str, Scalar], ...] = field(default=(), kw_only=True, repr=False)

    torque = custom.output("N.m")

    @property
    def shares(self) -> Iterable[tuple[Flange, Expression]]:
        """Pairs (flange, weight): x is the sum of weight times flange angle [rad]."""
        raise NotImplementedError

    @property
    def shaft_ports(self) -> tuple[str, ...]:
        """Empty: the law uses x only, not the flanges."""
        return ()

    @property
    def needs_position(self) -> bool:
        """True: the twist x is a sum of angles, not only of speeds."""
        return True

    def outputs(self, at: At) -> Mapping[str, SX]:
        """Return {"torque": `resistance` [N m]}, against which x is moved by the shafts.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return {"torque": self.resistance(at)}


@dataclass(frozen=True, slots=True)
class ElasticShaft(ShaftForce, TwoFlanges):
    """A massless elastic shaft: torque = stiffness * twist + damping * its rate.

    The twist is the angle of flange_a less that of flange_b.

    Attributes:
        stiffness: torsional stiffness [N m/rad].
        damping: torsional damping [N m s/rad].
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
        """(flange_a, 1) and (flange_b, -1): the twist x is angle_a - angle_b [rad]."""
        return (self.flange_a, Number(1.0)), (self.flange_b, Number(-1.0))

    def resistance(self, at: At) -> SX:
        """Return the torque stiffness x + damping dx/dt [N m] from flange_a to flange_b.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        stiffness, damping = to_sx(self.stiffness, at.symbols), to_sx(self.damping, at.symbols)
        return SX(stiffness * at.x.q + damping * at.x.v)

    def energy(self, at: At) -> SX:
        """Return stiffness x^2 / 2 of the twist x [J].

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return SX(0.5 * to_sx(self.stiffness, at.symbols) * at.x.q**2)


@dataclass(frozen=True, slots=True, kw_only=True)
class ElasticGear(ElasticShaft):
    """A gear with an elastic transmission; its twist and stiffness refer to flange_b.

    twist = angle_a / ratio - angle_b. flange_b gets the torque stiffness * twist + damping * rate
    and flange_a the opposite of this torque divided by ratio.

    Attributes:
        ratio: revolutions of flange_a per revolution of flange_b, or rad per m if flange_b is on a
            prismatic joint, with the stiffness then in N/m; negative for opposite directions.
    """

    flange_b = custom.flange(slides=None)

    ratio: Scalar

    def __post_init__(self) -> None:
        ElasticShaft.__post_init__(self)
        self._normalise("ratio")
        check_ratio(self.name, self.ratio)

    @property
    def shares(self) -> Iterable[tuple[Flange, Expression]]:
        """(flange_a, 1 / ratio) and (flange_b, -1): the twist x is angle_a / ratio - angle_b."""
        return (self.flange_a, 1 / expression(self.ratio)), (self.flange_b, Number(-1.0))


@dataclass(frozen=True, slots=True)
class ShaftDamper(ShaftForce, OneFlange):
    """Viscous friction of a bearing between a shaft and the housing.

    Attributes:
        damping: viscous friction [N m s/rad].
    """

    damping: Scalar

    def __post_init__(self) -> None:
        Component.__post_init__(self)
        self._normalise("damping")
        self._require_magnitudes("damping")
        self._require_effect("damping")

    @property
    def shares(self) -> Iterable[tuple[Flange, Expression]]:
        """(flange, 1): x is the angle of the flange [rad]."""
        return ((self.flange, Number(1.0)),)

    def resistance(self, at: At) -> SX:
        """Return damping times shaft speed [N m]. The shaft gets the negative of this torque.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return SX(to_sx(self.damping, at.symbols) * at.x.v)

    def dissipation(self, at: At) -> SX:
        """Return the friction torque times the speed of the shaft [W].

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return SX(self.resistance(at) * at.x.v)
