"""A path of poses: given one by one, or as a function of a number between 0 and 1."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.errors import ModelError
from mbs.messages import quoted
from mbs.models.inverse_geometry.arm import gap_to
from mbs.models.inverse_geometry.pose_input import wanted_pose, wanted_poses

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Path:
    """Poses one after the other, and how one leads to the next.

    Attributes:
        poses: (N, 4, 4).
        function: that gave them, or None.
    """

    poses: Array
    function: Callable[[float], Array] | None = None

    @property
    def count(self) -> int:
        """How many poses."""
        return len(self.poses)

    def way(self, number: int, before: Array) -> Callable[[float], Array]:
        """The pose, of a number from 0 to 1, from the pose before (4, 4) to that of the number."""
        after, function = self.poses[number], self.function
        if function is None or number == 0:
            return straight(before, after)
        return lambda s: after if s == 1.0 else function((number - 1 + s) / (self.count - 1))


def path_of(system: System, path: Any, samples: int) -> Path:
    """A path as a user gives it.

    Raises:
        ModelError: it is neither poses nor a function that gives poses, or there are none.
    """
    if not callable(path):
        poses = wanted_poses(system, path)
        if not len(poses):
            raise ModelError(f"{system.name}: the path has no pose; give one at least")
        return Path(poses)
    if not (isinstance(samples, int) and samples >= 2):
        raise ModelError(
            f"{system.name}: samples is {quoted(samples)}; give a whole number above 1"
        )

    def function(s: float) -> Array:
        return wanted_pose(system, path(s))

    numbers = np.linspace(0.0, 1.0, samples)
    return Path(np.array([function(float(s)) for s in numbers]), function)


def straight(before: Array, after: Array) -> Callable[[float], Array]:
    """The pose moved along a straight line and turned about a fixed axis, of a number 0 to 1."""
    gap = gap_to(after, before)

    def pose(s: float) -> Array:
        if s == 1.0:
            return after
        T = before.copy()
        T[:3, :3] = _turn(s * gap[3:]) @ before[:3, :3]
        T[:3, 3] = before[:3, 3] + s * gap[:3]
        return T

    return pose


def _turn(vector: Array) -> Array:
    """(3, 3) the turn about a vector by its length [rad].

    Source: Rodrigues 1840.
    """
    angle = float(np.linalg.norm(vector))
    x, y, z = vector / angle if angle > 0 else vector
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    turned: Array = np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K
    return turned
