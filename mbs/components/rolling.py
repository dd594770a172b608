"""Rolling without slip: a constraint on velocities that no constraint on positions implies."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from mbs.components.axes import unit_axis
from mbs.components.constraints import Constraint
from mbs.errors import DescriptionError
from mbs.expressions import Scalar, to_float


@dataclass(frozen=True, slots=True)
class RollingDisc(Constraint):
    """A thin disc that touches a plane with its rim and rolls on it without slipping.

    One row of positions, the rim stays on the plane, and two of velocities: the point of the disc
    that touches the plane does not move in it. Frame_a lies in the plane; the origin of frame_b
    is the centre of the disc. The wheel itself, its mass and its axle are bodies and joints.

    Attributes:
        radius: of the rim [m].
        normal: of the plane, on the side where the disc is, in frame_a.
        axis: about which the disc spins, in frame_b.
    """

    radius: Scalar = field(kw_only=True)
    normal: Any = "z"
    axis: Any = "y"

    def __post_init__(self) -> None:
        self._normalise("radius")
        radius = to_float(self.radius)
        if radius is not None and radius <= 0:
            raise DescriptionError(f"{self.name}: radius is {radius:g} m; give more than zero")
        for name in ("normal", "axis"):
            object.__setattr__(self, name, unit_axis(self.name, getattr(self, name)))
        Constraint.__post_init__(self)
