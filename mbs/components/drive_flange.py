"""Flanges: where the parts of a drive line are connected.

A flange has an angle, which is the same for all flanges that are connected, and a torque, and the
torques of connected flanges add up to zero.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from mbs.components.component import Component
from mbs.errors import DescriptionError
from mbs.expressions import Expression, Number
from mbs.messages import quoted


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
