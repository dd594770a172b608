"""Elastic and damping parts of a drive line: forces on the coordinates of its shafts."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

from casadi import SX

from mbs.components.component import Component
from mbs.components.drive_flange import Flange, OneFlange, TwoFlanges
from mbs.components.drive_shafts import check_ratio
from mbs.components.forces import CoordinateForce
from mbs.components.placement import SymbolTable
from mbs.expressions import Expression, Number, Scalar, expression, to_sx


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
