"""Elementary motions of a frame, of which every joint is made."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class Motion(Enum):
    """An elementary motion of a frame: about or along its z axis, or free."""

    REVOLUTE = "revolute"
    PRISMATIC = "prismatic"
    SPHERICAL = "spherical"
    FREE = "free"

    @property
    def nq(self) -> int:
        """Number of position coordinates."""
        return {"spherical": 4, "free": 7}.get(self.value, 1)

    @property
    def nv(self) -> int:
        """Number of velocities."""
        return {"spherical": 3, "free": 6}.get(self.value, 1)


@dataclass(frozen=True, slots=True)
class Freedom:
    """One elementary motion of a joint.

    Attributes:
        motion: what moves.
        axis: unit vector of the axis in frame_a at the zero posture (z where none is special).
        suffix: what distinguishes its coordinates from the others of the same joint.
    """

    motion: Motion
    axis: tuple[float, float, float] = (0.0, 0.0, 1.0)
    suffix: str = ""

    def coordinate_of(self, joint: str) -> str:
        """Name of its coordinate in a joint of this name, which has a suffix beside others."""
        return f"{joint}.{self.suffix}" if self.suffix else joint
