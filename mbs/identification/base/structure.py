"""Which axes of a tree are parallel, perpendicular or on one line, and where gravity points.

The answers come from numbers: poses at the zero position for some values of the symbols. What
holds within 1e-9 for all of them holds by structure.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi
import numpy as np
from casadi import SX, Function
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.assembly.tree import Tree
from mbs.components.motion import Motion
from mbs.identification.base.samples import parameter_samples
from mbs.spatial import Pose

Array = NDArray[np.float64]

_SAME = 1e-9
_TURNING = (Motion.REVOLUTE, Motion.SPHERICAL, Motion.FREE)


@dataclass(frozen=True, slots=True, eq=False)
class Structure:
    """Axes of a tree at its zero position.

    Attributes:
        tree: the links.
        orientations: (samples, links, 3, 3) of each frame seen from the base.
        origins: (samples, links, 3) origin of each frame in the base [m].
        gravity: (samples, 3) in the base [m/s^2].
        base_moves: whether the base has a motion of its own, so that nothing is known of it.
    """

    tree: Tree
    orientations: Array
    origins: Array
    gravity: Array
    base_moves: bool

    @property
    def axes(self) -> Array:
        """(samples, links, 3) z axis of each frame in the base."""
        return self.orientations[..., 2]

    def turning(self, links: list[int]) -> list[int]:
        """Those of the links whose joints turn."""
        return [k for k in links if self.tree.links[k].motion in _TURNING]

    def sliding(self, links: list[int]) -> list[int]:
        """Those of the links whose joints slide."""
        return [k for k in links if self.tree.links[k].motion is Motion.PRISMATIC]

    def before(self, j: int) -> list[int]:
        """The links between the base and link j, itself left out."""
        return self.tree.path(j)[:-1]

    def rests(self, links: list[int]) -> bool:
        """Whether a chain of these links never turns."""
        return not self.base_moves and not self.turning(links)

    def one_direction(self, links: list[int]) -> bool:
        """Whether a chain of these links turns about one direction at most."""
        turning = self.turning(links)
        if self.base_moves:
            return False
        if any(self.tree.links[k].motion is not Motion.REVOLUTE for k in turning):
            return False
        return all(self.parallel(turning[0], k) for k in turning)

    def parallel(self, j: int, k: int) -> bool:
        """Whether two axes have the same direction at the zero position."""
        return _vanishes(np.cross(self.axes[:, j], self.axes[:, k]))

    def never_parallel(self, j: int, k: int) -> bool:
        """Whether two axes have different directions at the zero position, for every sample."""
        normal = np.cross(self.axes[:, j], self.axes[:, k])
        return bool(np.min(np.linalg.norm(normal, axis=1)) > _SAME)

    def perpendicular(self, j: int, k: int) -> bool:
        """Whether two axes are at right angles at the zero position."""
        return _vanishes(np.sum(self.axes[:, j] * self.axes[:, k], axis=1))

    def coaxial(self, j: int, k: int) -> bool:
        """Whether two axes are on one line at the zero position."""
        between = np.cross(self.origins[:, k] - self.origins[:, j], self.axes[:, j])
        return self.parallel(j, k) and _vanishes(between)

    def axes_in(self, k: int, j: int) -> Array:
        """(samples, 3) the axis of link k in the axes of frame j at the zero position."""
        seen: Array = np.einsum("sab,sa->sb", self.orientations[:, j], self.axes[:, k])
        return seen

    def point_rests(self, j: int, points: Array) -> bool:
        """Whether all joints before link j leave points (samples, 3) of its axis in place."""
        before = self.before(j)
        return not self.base_moves and all(self._holds(k, points) for k in before)

    def _holds(self, k: int, points: Array) -> bool:
        match self.tree.links[k].motion:
            case Motion.REVOLUTE:
                return self.on_axis(points, k)
            case Motion.SPHERICAL:
                return _vanishes(points - self.origins[:, k])
        return False

    def on_axis(self, points: Array, k: int) -> bool:
        """Whether points (samples, 3) of the base lie on the axis of link k."""
        return _vanishes(np.cross(points - self.origins[:, k], self.axes[:, k]))

    @property
    def weightless(self) -> bool:
        """Whether gravity is zero and the base at rest."""
        return not self.base_moves and _vanishes(self.gravity)

    def gravity_along(self, j: int) -> bool:
        """Whether gravity is zero or parallel to an axis at the zero position."""
        return not self.base_moves and _vanishes(np.cross(self.gravity, self.axes[:, j]))

    def gravity_across(self, j: int) -> bool:
        """Whether gravity is zero or at right angles to an axis at the zero position."""
        return not self.base_moves and _vanishes(np.sum(self.gravity * self.axes[:, j], axis=1))

    def seen_from_link(self, k: int, j: int) -> Pose:
        """The frame of link k of the path of j in the frame of link j, at the zero position."""
        pose = Pose.identity()
        path = self.tree.path(j)
        for link in path[path.index(k) + 1 :]:
            pose = pose @ self.tree.links[link].pose()
        return pose.inverse()


def structure_of(system: System, *, base_moves: bool = False) -> Structure:
    """The structure of the tree of a system."""
    tree = system.tree
    poses: list[Pose] = []
    for link in tree.links:
        own = link.pose()
        poses.append(own if link.antecedent < 0 else poses[link.antecedent] @ own)
    turns = casadi.horzcat(SX(3, 0), *(pose.R for pose in poses))
    origins = casadi.horzcat(SX(3, 0), *(pose.p for pose in poses))
    sampled = parameter_samples(
        system, casadi.vertcat(casadi.vec(turns), casadi.vec(origins), tree.gravity)
    )
    outputs = [casadi.densify(x) for x in (turns, origins, tree.gravity)]
    at = Function("structure", [system.p], outputs)
    numbers = [[np.array(x) for x in at(p)] for p in sampled]
    return Structure(
        tree,
        np.array([x[0].T.reshape(-1, 3, 3).transpose(0, 2, 1) for x in numbers]),
        np.array([x[1].T for x in numbers]),
        np.array([x[2].ravel() for x in numbers]),
        base_moves,
    )


def _vanishes(values: Array) -> bool:
    return bool(np.max(np.abs(values), initial=0.0) < _SAME)
