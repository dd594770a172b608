"""Constant placements: the pose of one frame seen from another."""

from __future__ import annotations

from dataclasses import dataclass

import casadi
from casadi import DM, SX

from mbs.spatial.vectors import snapped, zeros


@dataclass(frozen=True, slots=True)
class Pose:
    """Pose of a frame j seen from a frame i.

    Attributes:
        R: (3, 3) orientation; its columns are the axes of j in frame i.
        p: (3, 1) origin of j in frame i [m].
    """

    R: SX
    p: SX

    @staticmethod
    def identity() -> Pose:
        """The frame itself."""
        return Pose(casadi.densify(SX(DM.eye(3))), zeros())

    @staticmethod
    def turned(R: SX) -> Pose:
        """A frame with the same origin and the orientation R."""
        return Pose(casadi.densify(R), zeros())

    @staticmethod
    def moved(p: SX) -> Pose:
        """A frame with the same orientation and the origin p."""
        return Pose(Pose.identity().R, casadi.densify(p))

    def __matmul__(self, other: Pose) -> Pose:
        """T_ik from T_ij and T_jk."""
        return Pose(
            snapped(casadi.mtimes(self.R, other.R)),
            snapped(self.p + casadi.mtimes(self.R, other.p)),
        )

    def inverse(self) -> Pose:
        """T_ji from T_ij."""
        return Pose(self.R.T, snapped(-casadi.mtimes(self.R.T, self.p)))

    @property
    def matrix(self) -> SX:
        """(4, 4) homogeneous transform."""
        return casadi.vertcat(
            casadi.horzcat(self.R, self.p), casadi.horzcat(SX(DM([[0, 0, 0]])), SX(1))
        )

    def is_identity(self) -> bool:
        """Whether it is the constant identity."""
        return bool(casadi.is_equal(self.matrix, casadi.densify(SX(DM.eye(4))), 1))
