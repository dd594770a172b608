"""Couplings of coordinates: polynomials, gears, racks and screws."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import ClassVar

from mbs.components.component import Component, named_scalars
from mbs.components.joints import Cylindrical, Motion
from mbs.errors import DescriptionError
from mbs.expressions import Expression, Scalar, expression, to_float
from mbs.text import quoted


@dataclass(frozen=True, slots=True)
class Coupling(Component):
    """A relation between joint positions: driven = sum of c_k driver^k.

    It represents gears, mimic joints and joint equalities by one constraint row. Further
    coordinates may be added, each times a factor, as in a planetary gear.

    Attributes:
        driven: name of the driven coordinate.
        driver: name of the driving coordinate.
        coefficients: c_0, c_1, ... of the polynomial.
        others: name and factor of each further coordinate that is added to the polynomial.
    """

    driven: str = ""
    driver: str = ""
    coefficients: tuple[Scalar, ...] = (0.0, 1.0)
    others: tuple[tuple[str, Scalar], ...] = field(default=(), kw_only=True)

    def __post_init__(self) -> None:
        Component.__post_init__(self)
        if isinstance(self.coefficients, str) or not hasattr(self.coefficients, "__iter__"):
            raise DescriptionError(
                f"{self.name}: coefficients {quoted(self.coefficients)} are not a sequence;"
                " give c_0, c_1, ..., such as (0, ratio) for a gear"
            )
        terms = tuple(expression(c, f"{self.name}, coefficients") for c in self.coefficients)
        object.__setattr__(self, "coefficients", terms)
        object.__setattr__(self, "others", self._checked_others())
        if self.driven in self.coordinates[1:]:
            raise DescriptionError(
                f"{self.name}: the coordinate {self.driven!r} cannot follow itself; name two"
            )
        if len(set(self.coordinates)) < len(self.coordinates):
            raise DescriptionError(
                f"{self.name}: {self.driven!r} follows a coordinate of"
                f" {quoted(self.coordinates[1:])} twice; name each of them once"
            )

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of all coordinates of the relation: driven, driver, then the names in `others`."""
        return (self.driven, self.driver, *(name for name, _ in self.others))

    def _checked_others(self) -> tuple[tuple[str, Expression], ...]:
        """Return `others` as pairs (coordinate name, factor).

        Raise DescriptionError for other forms.
        """
        pairs = named_scalars(self.others)
        if pairs is None:
            raise DescriptionError(
                f"{self.name}: others {quoted(self.others)} are not pairs of a coordinate and a"
                " factor; give them such as (('j3', -0.5),)"
            )
        return tuple((n, expression(c, f"{self.name}, factor of {n}")) for n, c in pairs)

    def scoped(self, prefix: str) -> Coupling:
        """Return a copy whose name, coordinates and parameters have the prefix "`prefix`.".

        Args:
            prefix: text before the names, without the dot.
        """
        inner = Component.scoped(self, prefix)
        return replace(
            inner,
            driven=f"{prefix}.{self.driven}",
            driver=f"{prefix}.{self.driver}",
            others=tuple((f"{prefix}.{name}", factor) for name, factor in inner.others),
        )


# Gears, racks and screws: couplings with one ratio.


@dataclass(frozen=True, slots=True)
class Transmission(Coupling):
    """driven = offset + k driver, between coordinates of required kinds.

    Attributes:
        offset: position of driven at the zero position of the driver [rad or m].
    """

    kinds: ClassVar[tuple[Motion, Motion]]
    """Required motions of driven and driver."""

    coefficients: tuple[Scalar, ...] = field(init=False, default=(0.0, 1.0))
    offset: Scalar = field(kw_only=True, default=0.0)

    def _set_factor(self, given: str, factor: Expression) -> None:
        """Set the coefficients to (offset, factor), in place.

        Raise DescriptionError if the factor is 0. `given` is the name of the field that the factor
        is computed from.
        """
        if to_float(factor) == 0:
            raise DescriptionError(
                f"{self.name}: {given} is 0, which ties nothing; give another number, less than"
                " zero where the two turn in opposite ways"
            )
        object.__setattr__(self, "coefficients", (self.offset, factor))
        Coupling.__post_init__(self)


@dataclass(frozen=True, slots=True)
class Gear(Transmission):
    """A pair of gears: the driven angle is `ratio` times the driving angle.

    Attributes:
        ratio: revolutions of driven per revolution of the driver; negative for external gears with
            parallel axes.
    """

    kinds = (Motion.REVOLUTE, Motion.REVOLUTE)
    ratio: Scalar = field(kw_only=True)

    def __post_init__(self) -> None:
        self._normalise("ratio", "offset")
        self._set_factor("ratio", expression(self.ratio))


@dataclass(frozen=True, slots=True)
class RackAndPinion(Transmission):
    """A rack, the driven displacement, that a pinion moves by `radius` times its angle.

    A wheel that rolls along a straight line has the same relation.

    Attributes:
        radius: radius of the pitch circle of the pinion [m]; negative for the opposite direction.
    """

    kinds = (Motion.PRISMATIC, Motion.REVOLUTE)
    radius: Scalar = field(kw_only=True)

    def __post_init__(self) -> None:
        self._normalise("radius", "offset")
        self._set_factor("radius", expression(self.radius))


@dataclass(frozen=True, slots=True)
class Screw(Transmission):
    """A nut, the driven displacement, that moves by `pitch` per revolution of the driving angle.

    On the coordinates `.s` and `.phi` of one Cylindrical joint it makes a screw joint.

    Attributes:
        pitch: advance per revolution [m]; negative for a left-hand thread.
    """

    kinds = (Motion.PRISMATIC, Motion.REVOLUTE)
    pitch: Scalar = field(kw_only=True)

    def __post_init__(self) -> None:
        self._normalise("pitch", "offset")
        self._set_factor("pitch", expression(self.pitch) / (2 * math.pi))


@dataclass(frozen=True, slots=True)
class Helical(Cylindrical):
    """A screw joint: rotation `phi` about the axis with a proportional advance `s` along it.

    Connecting it adds the `Screw` NAME.thread between its two coordinates.

    Attributes:
        pitch: advance per revolution [m]; negative for a left-hand thread.
    """

    pitch: Scalar = field(kw_only=True)

    def __post_init__(self) -> None:
        self._normalise("pitch")
        if to_float(self.pitch) == 0:
            raise DescriptionError(
                f"{self.name}: pitch is 0, with which nothing advances; give the advance for a"
                " turn, or take a Revolute joint"
            )
        Cylindrical.__post_init__(self)

    @property
    def companions(self) -> tuple[Component, ...]:
        """The `Screw` NAME.thread that couples the coordinates NAME.s and NAME.phi."""
        name = self.name
        return (Screw(f"{name}.thread", f"{name}.s", f"{name}.phi", pitch=self.pitch),)
