"""A mechanism at one posture: where its links are, and its skeleton seen from them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import casadi
import numpy as np
from casadi import SX, Function
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.assembly.model_function import Named, model_function
from mbs.assembly.rates import normalised
from mbs.models.skeleton import Skeleton, skeleton
from mbs.recursions.poses import base_poses, link_poses
from mbs.view.primitives import Rows, Vector

Array = NDArray[np.float64]
Values = Mapping[str, float] | Sequence[float] | None


@dataclass(frozen=True, slots=True, eq=False)
class PosedLinks:
    """A system whose links have places.

    Attributes:
        system: the mechanism.
        parameters: value of every symbol.
        parts: its skeleton.
        points: (n, 3) of the skeleton, in the base frame [m].
        directions: (m, 3) of the skeleton, in the base frame.
        poses: (links + 1, 3, 4) R|p of the base and every link.
        up: unit vector against gravity; z where there is none.
    """

    system: System
    parameters: Mapping[str, float]
    parts: Skeleton
    points: Array
    directions: Array
    poses: Array
    up: Array

    def local(self, link: int, point: Array) -> Vector:
        """A point of the base frame in the frame of a link."""
        R, p = self.poses[link, :, :3], self.poses[link, :, 3]
        return three(R.T @ (point - p))

    def local_direction(self, link: int, direction: Array) -> Vector:
        """A direction of the base frame in the frame of a link."""
        return three(self.poses[link, :, :3].T @ direction)

    def local_pose(self, link: int, R: Array, p: Array) -> Rows:
        """The pose (R, p) in the base frame, seen from a link."""
        turned = self.poses[link, :, :3].T @ R
        place = np.array(self.local(link, p)).reshape(3, 1)
        return rows(np.hstack([turned, place]))


def three(values: Array) -> Vector:
    """The elements of a vector."""
    x, y, z = (float(value) for value in values)
    return x, y, z


def rows(pose: Array) -> Rows:
    """The elements of R|p, row by row."""
    return tuple(float(value) for value in np.ravel(pose))


def posed(system: System, q: Sequence[float], parameters: Mapping[str, float] | None) -> PosedLinks:
    """The links and the skeleton at positions q.

    Args:
        system: open or closed; every symbol in its geometry has a value.
        q: (nq,) [rad or m].
        parameters: values of symbols, the others at their defaults.

    Raises:
        ModelError: a symbol has no value, or a place is no number.
    """
    p = system.parameter_values(parameters)
    parts = skeleton(system)
    given = (list(q), p) if system.parameters else (list(q),)
    points, directions = (np.array(m).T.reshape(-1, 3) for m in parts.function(*given))
    poses = pose_rows(system, np.array(given[0]).reshape(-1, 1), p)[:, 0]
    gravity = Function("gravity", [system.p], [casadi.densify(system.tree.gravity)])
    names = [parameter.name for parameter in system.parameters]
    return PosedLinks(
        system,
        dict(zip(names, p, strict=True)),
        parts,
        points,
        directions,
        poses.reshape(-1, 3, 4),
        _up(np.array(gravity(p)).ravel()),
    )


def _up(gravity: Array) -> Array:
    size = float(np.linalg.norm(gravity))
    return -gravity / size if size > 0 else np.array([0.0, 0.0, 1.0])


def pose_rows(system: System, q: Array, p: Sequence[float]) -> Array:
    """(12 (links + 1), n) rows of R|p of the base and every link at the columns of q (nq, n).

    Raises:
        ModelError: a symbol has no value, or a place is no number.
    """
    function = _pose_function(system)
    if not system.parameters:
        return np.array(function(q))
    return np.array(function(q, np.repeat(np.array(p).reshape(-1, 1), q.shape[1], axis=1)))


def _pose_function(system: System) -> Function:
    def build() -> tuple[Named, Named]:
        q = SX.sym("q", system.nq)
        chain = link_poses(system.tree, normalised(system.tree, q))
        moved = [
            casadi.vec(casadi.horzcat(pose.R, pose.p).T) for pose in base_poses(system.tree, chain)
        ]
        base = SX([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0])
        return [("q", q)], [("poses", casadi.vertcat(base, *moved))]

    return model_function(system, ("link_poses",), build)


def position_of(system: System, q: Values) -> list[float]:
    """(nq,) positions from a sequence, or from names, the others as in the assembled posture.

    Raises:
        ModelError: a name is unknown, or the numbers do not fit.
    """
    values = system.position(q)
    return values
