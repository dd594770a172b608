"""Transforms and rotations in numbers: matrices, roll-pitch-yaw angles and quaternions."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def transform(R: Any, p: Any) -> Array:
    """Return the homogeneous transform (4, 4) of a rotation R (3, 3) and a displacement p (3,)."""
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = R, p
    return T


def inverse(T: Array) -> Array:
    """Return the inverse of a homogeneous transform (4, 4)."""
    R, p = T[:3, :3], T[:3, 3]
    return np.block([[R.T, -(R.T @ p)[:, None]], [np.zeros((1, 3)), np.ones((1, 1))]])


def axis_rotation(axis: int, angle: float) -> Array:
    """Return the rotation matrix (3, 3) about coordinate axis 0, 1 or 2 by an angle [rad]."""
    i, j = (axis + 1) % 3, (axis + 2) % 3
    R = np.eye(3)
    R[i, i] = R[j, j] = math.cos(angle)
    R[j, i] = math.sin(angle)
    R[i, j] = -R[j, i]
    return R


def matrix_of_angles(roll: float, pitch: float, yaw: float) -> Array:
    """Return the rotation matrix Rz(yaw) Ry(pitch) Rx(roll) (3, 3); angles in [rad]."""
    (a, b, c), (x, y, z) = map(math.cos, (roll, pitch, yaw)), map(math.sin, (roll, pitch, yaw))
    return np.array(
        [
            [c * b, c * y * x - z * a, c * y * a + z * x],
            [z * b, z * y * x + c * a, z * y * a - c * x],
            [-y, b * x, b * a],
        ]
    )


def angles_of(R: Array) -> tuple[float, float, float]:
    """Return (roll, pitch, yaw) [rad] of a rotation matrix R = Rz(yaw) Ry(pitch) Rx(roll) (3, 3).

    The angles are accurate also at pitch +-pi/2, where yaw is arbitrary; roll and pitch are
    computed for the chosen yaw.
    """
    yaw = math.atan2(R[1, 0], R[0, 0])
    c, s = math.cos(yaw), math.sin(yaw)
    pitch = math.atan2(-R[2, 0], c * R[0, 0] + s * R[1, 0])
    roll = math.atan2(s * R[0, 2] - c * R[1, 2], c * R[1, 1] - s * R[0, 1])
    return roll, pitch, yaw


def matrix_of_quaternion(quaternion: Sequence[float]) -> Array:
    """Return the rotation matrix (3, 3) of a nonzero quaternion (w, x, y, z)."""
    w, x, y, z = np.asarray(quaternion, dtype=float) / math.hypot(*quaternion)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def quaternion_of(R: Array) -> Array:
    """Return the unit quaternion (w, x, y, z) of a rotation matrix (3, 3).

    It is computed from its element of largest magnitude. Source: Shepperd 1978.
    """
    trace = float(np.trace(R))
    squares = np.array([trace, R[0, 0], R[1, 1], R[2, 2]])
    k = int(np.argmax(squares))
    if k == 0:
        q = np.array(
            [1 + trace, R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]], dtype=float
        )
    else:
        x, y, z = k - 1, k % 3, (k + 1) % 3
        q = np.zeros(4)
        q[0] = R[z, y] - R[y, z]
        q[1 + x] = 1 + 2 * R[x, x] - trace
        q[1 + y] = R[y, x] + R[x, y]
        q[1 + z] = R[z, x] + R[x, z]
    return np.array(q / np.linalg.norm(q))
