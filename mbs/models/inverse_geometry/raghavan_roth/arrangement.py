"""A loop of six joints, begun at any of them and walked either way.

The wanted pose T closes the arm to the loop Z_1 C_1 Z_2 C_2 .. Z_6 C_6 = 1: Z_k is the motion of
joint k, C_k the way to the next joint, and the pose is in one of the ways.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mbs.models.inverse_geometry.arm import Arm, inverse, motion
from mbs.models.inverse_geometry.raghavan_roth.pairs import Array

_TINY = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class Arrangement:
    """The loop of an arm as the elimination takes it, lengths in units of its own.

    Attributes:
        order: (6,) numbers of the arm's joints in the order of the loop.
        sign: +1 or -1, of the arm's joint order[k] by the loop's joint k.
        prismatic: (6,) whether each joint of the loop slides.
        offsets: (6,) angles from which the loop's joints are counted [rad]; zero for slides.
        ways: (6, 4, 4) constant ways; the one at `place` ends where the pose begins.
        place: number of the way with the pose.
        after: (4, 4) what comes after the pose in its way.
        length: the unit [m].
    """

    order: NDArray[np.int64]
    sign: int
    prismatic: NDArray[np.bool_]
    offsets: Array
    ways: Array
    place: int
    after: Array
    length: float

    def all_ways(self, T: Array) -> Array:
        """(N, 6, 4, 4) the ways for wanted poses T, (N, 4, 4) [m]."""
        T = _scaled(T, self.length)
        ways = np.broadcast_to(self.ways, (len(T), 6, 4, 4)).copy()
        ways[:, self.place] = ways[:, self.place] @ self._pose(T) @ self.after
        return ways

    def _pose(self, T: Array) -> Array:
        return inverse(T) if self.sign > 0 else T

    def postures(self, u: Array) -> Array:
        """(..., 6) postures of the arm, angles in [-pi, pi), for the loop's joints at u."""
        u = self.sign * (u + self.offsets)
        wrapped = (u + np.pi) % (2 * np.pi) - np.pi
        q = np.empty_like(u)
        q[..., self.order] = np.where(self.prismatic, u * self.length, wrapped)
        return q


def arrangements(arm: Arm, offsets: Array) -> list[Arrangement]:
    """All loops of an arm whose last joint turns: up to twelve.

    Args:
        arm: of six joints.
        offsets: (6,) angles from which the joints of the loop are counted [rad].
    """
    length = loop_length(arm)
    G = _scaled(arm.gaps, length)
    back = inverse(G)
    ways = {1: np.array([*G[1:6], G[6]]), -1: np.array([*back[5:0:-1], back[0]])}
    after = {1: G[0], -1: back[6]}
    found = []
    for sign in (1, -1):
        for first in range(6):
            order = np.roll(np.arange(6)[::sign], -first)
            prismatic = arm.prismatic[order]
            if prismatic[5]:
                continue
            own = np.where(prismatic, 0.0, offsets)
            C = motion(own, prismatic=False) @ np.roll(ways[sign], -first, axis=0)
            found.append(
                Arrangement(order, sign, prismatic, own, C, 5 - first, after[sign], length)
            )
    return found


def loop_length(arm: Arm) -> float:
    """A length of the size of an arm [m], wherever its base stands and whatever its tool is."""
    inner = float(np.sum(np.linalg.norm(arm.gaps[1:6, :3, 3], axis=1)))
    return inner if inner > _TINY * arm.length else arm.length


def _scaled(T: Array, length: float) -> Array:
    T = np.array(T, dtype=float)
    T[..., :3, 3] /= length
    return T
