"""Rigid parts of a drive line: inertias on shafts, gears without play."""

from __future__ import annotations

from dataclasses import dataclass

from mbs.components.component import Component
from mbs.components.drive_flange import TwoFlanges
from mbs.errors import DescriptionError
from mbs.expressions import Expression, Scalar, expression, to_float


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
