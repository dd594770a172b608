"""Motions that are prescribed as functions of time."""

from __future__ import annotations

from dataclasses import dataclass

import casadi
from casadi import SX


@dataclass(frozen=True, slots=True, eq=False)
class Prescribed:
    """A coordinate that a drive moves along a law.

    Attributes:
        name: of the velocity.
        velocity: its number in v.
        position: number in q where the position is prescribed, None where it is free.
        holds_speed: whether the velocity is prescribed; an acceleration alone leaves it free.
        time: symbol of the time in the laws [s].
        laws: position, velocity and acceleration as functions of it; what is free is zero.
    """

    name: str
    velocity: int
    position: int | None
    holds_speed: bool
    time: SX
    laws: tuple[SX, SX, SX]

    def law(self, t: SX) -> tuple[SX, SX, SX]:
        """Position, velocity and acceleration at a time."""
        values = casadi.substitute(list(self.laws), [self.time], [t])
        return SX(values[0]), SX(values[1]), SX(values[2])
