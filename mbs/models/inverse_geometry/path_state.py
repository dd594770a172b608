"""State of the tracking of a path: reached poses, current configuration and step size."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mbs.closed_forms.arm import Array
from mbs.models.inverse_geometry.path_branches import BranchBlock
from mbs.models.inverse_geometry.path_equations import (
    PathJoints,
    PathPoint,
    point_at,
)
from mbs.models.inverse_geometry.path_poses import Path

_AFTER_CROSSING = 1e-2
"""First step past a singular configuration, as a fraction of the next segment: steps are short
there."""


@dataclass(frozen=True, slots=True, eq=False)
class SingularityCrossing:
    """Crossing of a singular configuration.

    Attributes:
        x: (k, n) scaled configurations at the next k poses.
        u: pose index at which the crossing ends; fractional between two poses.
        end: (n,) scaled configuration at u.
    """

    x: Array
    u: float
    end: Array


@dataclass(slots=True, eq=False)
class PathState:
    """State of the tracking of a path. `path_state` creates it at the start.

    Attributes:
        joints: joints that track the path.
        poses: path.
        curve: pose as a function of the real pose index u, -1 at the start.
        start: (nq,) configuration at u = -1.
        found: (N, n) scaled configurations; the rows below `number` are set.
        residual: (N,) pose errors; the elements below `number` are set.
        number: index of the next pose.
        u: current pose index; fractional between two poses.
        point: configuration at u.
        trail: last configurations on the path, each with its pose index.
        step: next step size, as a fraction of the segment to the next pose.
        block: branches of the closed form at the current block of poses, or None.
    """

    joints: PathJoints
    poses: Path
    curve: Callable[[float], Array]
    start: Array
    found: Array
    residual: Array
    number: int
    u: float
    point: PathPoint
    trail: list[tuple[float, PathPoint]]
    step: float = 1.0
    block: BranchBlock | None = None

    def arrive(self, x: Array, residual: Array | list[float]) -> None:
        """Store configurations x (k, n) and pose errors of the next k poses, and move there."""
        first, self.number = self.number, self.number + len(x)
        self.found[first : self.number], self.residual[first : self.number] = x, residual
        self.u, self.trail = self.number - 1.0, self.last_poses()
        self.point = self.trail[-1][1]

    def last_poses(self) -> list[tuple[float, PathPoint]]:
        """Return the last three reached poses as a trail."""
        numbers = range(max(0, self.number - 3), self.number)
        found, T = self.found, self.poses.poses
        return [(float(k), point_at(self.joints, found[k], T[k])) for k in numbers]

    def land(self, crossing: SingularityCrossing) -> None:
        """Store the configurations of a crossing and move to its end."""
        passed = slice(self.number, self.number + len(crossing.x))
        self.found[passed] = crossing.x
        self.residual[passed] = [
            self.joints.residual(self.joints.whole(self.start, x), T)
            for x, T in zip(crossing.x, self.poses.poses[passed], strict=True)
        ]
        self.number, self.u, self.step = self.number + len(crossing.x), crossing.u, _AFTER_CROSSING
        self.point = point_at(self.joints, crossing.end, self.curve(self.u))
        at_pose = self.u == self.number - 1
        self.trail = self.last_poses() if at_pose else [(self.u, self.point)]


def path_state(joints: PathJoints, poses: Path, q: Array) -> PathState:
    """Return the initial tracking state at a configuration q (nq,), before the first pose."""
    x, curve = joints.scaled(q), poses.curve(joints.pose(q))
    point = point_at(joints, x, curve(-1.0))
    found, residual = np.empty((poses.count, x.size)), np.empty(poses.count)
    return PathState(joints, poses, curve, q, found, residual, 0, -1.0, point, [(-1.0, point)])
