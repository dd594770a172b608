"""Rotors of motors that turn with a joint, faster than it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from mbs.components.axes import unit_axis
from mbs.expressions import Scalar, expression


@dataclass(frozen=True, slots=True, kw_only=True)
class Rotor:
    """A balanced rotor on the link of a joint's frame_a, which a gear ties to the joint.

    Relative to that link it spins at `ratio` times the velocity of the joint. The mass of the
    rotor and its whole inertia, locked, belong to the body that carries it.

    Attributes:
        inertia: about its own axis [kg m^2].
        ratio: turns of the rotor for a turn of the joint, or rad for 1 m of a prismatic one; less
            than zero when it turns the other way.
        axis: of the rotor, in frame_a, as a letter or three numbers; that of the joint when None.
    """

    inertia: Scalar
    ratio: Scalar = 1.0
    axis: Any = None

    def __post_init__(self) -> None:
        for name in ("inertia", "ratio"):
            value = expression(getattr(self, name), f"rotor, {name}")
            object.__setattr__(self, name, value)
        if self.axis is not None:
            object.__setattr__(self, "axis", unit_axis("rotor", self.axis))
