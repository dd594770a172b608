"""Path of poses: an array, or a function of a parameter between 0 and 1."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from mbs.assembly import System
from mbs.closed_forms.arm import Array, gap_to
from mbs.errors import ModelError
from mbs.loops.pose import pose_numbers
from mbs.models.inverse_geometry.chain import target_pose, target_poses
from mbs.text import quoted


@dataclass(frozen=True, slots=True, eq=False)
class Path:
    """Sequence of poses with an interpolation between them.

    Attributes:
        poses: (N, 4, 4) poses [m].
        function: pose (4, 4) as a function of the parameter in [0, 1], or None. Without it, poses
            are interpolated by straight lines.
    """

    poses: Array
    function: Callable[[float], Array] | None = None

    @property
    def count(self) -> int:
        """Number of poses."""
        return len(self.poses)

    def curve(self, first: Array) -> Callable[[float], Array]:
        """Return the pose as a function of a real pose index u in [-1, count - 1].

        u = -1 is the pose `first` (4, 4), an integer u is a pose of the path.
        """
        lines = dict[int, Callable[[float], Array]]()

        def pose(u: float) -> Array:
            number = math.ceil(u)
            if number == u and number >= 0:
                return np.asarray(self.poses[number])
            if self.function is not None and number > 0:
                return self.function(u / (self.count - 1))
            if number not in lines:
                lines.clear()
                before = self.poses[number - 1] if number > 0 else first
                lines[number] = straight(before, self.poses[max(number, 0)])
            return lines[number](u - number + 1)

        return pose


def path_of(system: System, path: Any, samples: int) -> Path:
    """Convert the `path` argument of `follow` to a Path.

    Raises:
        ModelError: the path is empty, or neither an array of poses nor a function of poses.
    """
    if not callable(path):
        poses = target_poses(system, path)
        if not len(poses):
            raise ModelError(f"{system.name}: the path has no pose; give one at least")
        return Path(poses)
    if not (isinstance(samples, int) and samples >= 2):
        raise ModelError(
            f"{system.name}: samples is {quoted(samples)}; give a whole number above 1"
        )

    def function(s: float) -> Array:
        return target_pose(system, path(s))

    numbers = np.linspace(0.0, 1.0, samples).tolist()
    return Path(_sampled(system, path, numbers), function)


def _sampled(system: System, path: Callable[[float], Any], numbers: list[float]) -> Array:
    """Evaluate a pose function at N parameters and return the poses (N, 4, 4)."""
    poses = np.empty((len(numbers), 4, 4))
    for k, s in enumerate(numbers):
        given = path(s)
        T = given if isinstance(given, np.ndarray) else pose_numbers(given)
        if T is None or T.shape != (4, 4) or T.dtype != poses.dtype:
            T = target_pose(system, given)
        poses[k] = T  # a copy: the function may write the next pose over it
    return target_poses(system, poses)


def straight(before: Array, after: Array) -> Callable[[float], Array]:
    """Interpolate two poses (4, 4) by a straight line and a rotation about a fixed axis.

    The result is a function of a parameter in [0, 1].
    """
    gap = gap_to(after, before)

    return lambda s: after if s == 1.0 else moved(before, s * gap)


def moved(T: Array, gap: Array) -> Array:
    """Return the pose T (4, 4) displaced by `gap` (6,), in base axes.

    `gap` contains a translation of the origin [m] and a rotation vector [rad].
    """
    pose = T.copy()
    pose[:3, :3] = _turn(gap[3:]) @ T[:3, :3]
    pose[:3, 3] += gap[:3]
    return pose


def _turn(vector: Array) -> Array:
    """Return the rotation matrix (3, 3) of a rotation vector (3,) [rad].

    Source: Rodrigues 1840.
    """
    angle = float(np.linalg.norm(vector))
    x, y, z = vector / angle if angle > 0 else vector
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    turned: Array = np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K
    return turned


def curve_segment(curve: Callable[[float], Array], u: float, to: float) -> Callable[[float], Array]:
    """Return the pose curve from pose index u to `to`, as a function of [0, 1]."""
    return lambda s: curve(to if s == 1.0 else u + s * (to - u))
