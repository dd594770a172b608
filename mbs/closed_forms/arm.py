"""Numeric serial arm: pose and Jacobian, for one configuration or many at once."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TypeVar

import casadi
import numpy as np
from casadi import DM, SX, Function
from numpy.typing import NDArray

from mbs.numbers import NONZERO
from mbs.recursions.chain import Chain, transforms

Array = NDArray[np.float64]
Field = TypeVar("Field", NDArray[np.float64], NDArray[np.complex128])
"""Real or complex array."""


@dataclass(frozen=True, slots=True, eq=False)
class Arm:
    """Numeric serial arm of revolute and prismatic joints, made from a `Chain` by `arm_of`.

    `mbs/core/source/arm.c` uses the same numbers. All joints have positive signs.

    Attributes:
        names: names of the joints.
        prismatic: (n,) whether each joint is prismatic.
        gaps: (n + 1, 4, 4) constant transforms before, between and after the joints.
        length: typical length of the arm [m]; 1 if all transforms are pure rotations.
        units: (n,) unit of each joint: 1 rad, or the length of the arm [m].
    """

    names: tuple[str, ...]
    prismatic: NDArray[np.bool_]
    gaps: Array
    length: float = field(init=False)
    units: Array = field(init=False)

    def __post_init__(self) -> None:
        total = float(np.sum(np.linalg.norm(self.gaps[:, :3, 3], axis=1)))
        length = total if total > 0 else 1.0
        object.__setattr__(self, "length", length)
        object.__setattr__(self, "units", np.where(self.prismatic, length, 1.0))

    @property
    def size(self) -> int:
        """Number of joints."""
        return len(self.prismatic)

    @property
    def between(self) -> list[Array]:
        """Constant transforms `gaps` as a list, under the name that `transforms` uses."""
        return list(self.gaps)

    def displacements(self, q: Array) -> list[Array]:
        """Return the displacement (..., 4, 4) of each joint about or along its own z axis.

        Args:
            q: (..., n) positions of the joints [rad or m].
        """
        return [motion(q[..., k], bool(self.prismatic[k])) for k in range(self.size)]

    def wrapped(self, way: Array) -> Array:
        """Return differences of configurations with angles in [-pi, pi).

        Args:
            way: (..., n) differences of positions [rad or m].
        """
        return np.where(self.prismatic, way, np.mod(way + np.pi, 2 * np.pi) - np.pi)

    def residual(self, q: Array, T: Array) -> Array:
        """Return the largest element of |pose(q) - T| (...) [m or 1].

        Args:
            q: (..., n) positions of the joints [rad or m].
            T: (..., 4, 4) target poses of the end frame in the base [m].
        """
        error: Array = np.max(np.abs(self.pose(q) - T), axis=(-2, -1))
        return error

    def pose(self, q: Array) -> Array:
        """Return the poses (..., 4, 4) of the end frame in the base frame [m].

        Args:
            q: (..., n) positions of the joints [rad or m].
        """
        return transforms(self, np.asarray(q, dtype=float))[-1]

    def pose_and_jacobian(self, q: Array) -> tuple[Array, Array]:
        """Return poses (..., 4, 4) and Jacobians (..., 6, n) of the end frame.

        The Jacobian maps joint velocities to [V; w]: velocity of the end-frame origin and angular
        velocity, in base axes.

        Args:
            q: (..., n) positions of the joints [rad or m].
        """
        T, axes, origins = self._frames(q)
        arms = T[..., None, :3, 3] - origins
        turning = np.where(self.prismatic[:, None], 0.0, axes)
        linear = np.where(self.prismatic[:, None], axes, np.cross(axes, arms))
        return T, np.swapaxes(np.concatenate([linear, turning], axis=-1), -1, -2)

    def lines(self, q: Array) -> tuple[Array, Array]:
        """Return the unit direction (..., n, 3) of each joint axis and a point on it, in the base.

        Args:
            q: (..., n) positions of the joints [rad or m].
        """
        return self._frames(q)[1:]

    def _frames(self, q: Array) -> tuple[Array, Array, Array]:
        """Return end poses, and axes and origins (..., n, 3) of all joints in the base frame.

        q (..., n) are positions of the joints; the poses are (..., 4, 4).
        """
        q = np.asarray(q, dtype=float)
        *frames, T = transforms(self, q)
        axes, origins = np.empty((*q.shape, 3)), np.empty((*q.shape, 3))
        for k, frame in enumerate(frames):
            axes[..., k, :], origins[..., k, :] = frame[..., :3, 2], frame[..., :3, 3]
        return T, axes, origins


def arm_of(chain: Chain, symbols: SX, p: Array) -> Arm:
    """Return the numeric arm of a chain for values of its symbols.

    Args:
        chain: chain of revolute and prismatic joints with positive signs, without pivots.
        symbols: (np, 1) symbols in its transforms.
        p: (np,) values of the symbols.
    """
    stacked = casadi.vertcat(*(pose.matrix for pose in chain.between))
    function = Function("gaps", [symbols], [casadi.densify(stacked)])
    gaps = np.array(DM(function(p))).reshape(len(chain.gaps), 4, 4)
    prismatic = np.array([not joint.is_rotational for joint in chain.joints], dtype=bool)
    return Arm(tuple(joint.name for joint in chain.joints), prismatic, gaps)


def motion(q: Field, prismatic: bool) -> Field:
    """Return the displacement (..., 4, 4) of a joint along or about its z axis.

    Args:
        q: (...) translations [m] for a prismatic joint, rotations [rad] otherwise.
        prismatic: whether the joint is prismatic.
    """
    T = np.empty((*np.shape(q), 4, 4), np.result_type(q, float))
    T[...] = np.eye(4)
    if prismatic:
        T[..., 2, 3] = q
        return T
    c, s = np.cos(q), np.sin(q)
    T[..., 0, 0], T[..., 0, 1], T[..., 1, 0], T[..., 1, 1] = c, -s, s, c
    return T


def inverse(T: Field) -> Field:
    """Return the inverses of rigid transforms.

    Args:
        T: (..., 4, 4) rigid transforms.
    """
    back = np.zeros_like(T)
    R = np.swapaxes(T[..., :3, :3], -1, -2)
    back[..., :3, :3], back[..., 3, 3] = R, 1.0
    back[..., :3, 3] = -(R @ T[..., :3, 3:])[..., 0]
    return back


_STRAIGHT = 1e-9
"""Sine of an angle below which it counts as zero or half a rotation. At zero, angle / sine is then
1 up to 1e-18. At half a rotation, the differences that determine the axis have rounding of 1e-16,
so that only seven digits remain."""


def gap_to(target: Array, T: Array) -> Array:
    """Return the displacement (..., 6) from poses to a target: translation, rotation vector.

    Both are in base axes [m, rad]. To first order it is the [V; w] that reaches the target in unit
    time. It is zero at the target pose only.

    Args:
        target: (..., 4, 4) target poses.
        T: (..., 4, 4) poses.
    """
    R = target[..., :3, :3] @ np.swapaxes(T[..., :3, :3], -1, -2)
    vector = np.stack(
        [R[..., 2, 1] - R[..., 1, 2], R[..., 0, 2] - R[..., 2, 0], R[..., 1, 0] - R[..., 0, 1]],
        axis=-1,
    )
    s = 0.5 * np.linalg.norm(vector, axis=-1)
    angle = np.arctan2(s, 0.5 * (np.trace(R, axis1=-2, axis2=-1) - 1))
    scale = np.where(s > _STRAIGHT, angle / np.maximum(2 * s, NONZERO), 0.5)
    rotation = scale[..., None] * vector
    half_turn = (s <= _STRAIGHT) & (angle > 1)
    if np.any(half_turn):
        turn = np.where(half_turn, angle, 0.0)
        rotation = rotation + turn[..., None] * _half_turn_axis(R)
    return np.concatenate([target[..., :3, 3] - T[..., :3, 3], rotation], axis=-1)


def _half_turn_axis(R: Array) -> Array:
    """Return the unit axes (..., 3) of rotation matrices R (..., 3, 3) of angle pi."""
    B = 0.5 * (R + np.eye(3))
    column = np.argmax(B[..., range(3), range(3)], axis=-1)
    axis: Array = np.take_along_axis(B, column[..., None, None], axis=-1)[..., 0]
    length: Array = np.maximum(np.linalg.norm(axis, axis=-1, keepdims=True), NONZERO)
    return axis / length
