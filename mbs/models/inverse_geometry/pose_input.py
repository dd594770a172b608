"""Poses as a user gives them: one, or many at once."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.errors import ModelError
from mbs.loops.wanted import defect, pose_numbers, rounded, wanted_pose
from mbs.messages import quoted

__all__ = ["wanted_pose", "wanted_poses"]


def wanted_poses(system: System, T: Any) -> NDArray[np.float64]:
    """The poses that are wanted, their orientations exactly orthonormal.

    Args:
        system: named in messages.
        T: (N, 4, 4) homogeneous transforms [m], as one array or a sequence of poses; rounded as
            `wanted_pose` does.

    Returns:
        (N, 4, 4) numbers.

    Raises:
        ModelError: one of them is no rigid transform; the message tells which, counted from 0.
    """
    matrices = _stacked(system, T)
    if matrices is None or matrices.ndim != 3 or matrices.shape[1:] != (4, 4):
        shape = "" if matrices is None else f" of shape {matrices.shape}"
        raise ModelError(f"{system.name}: the poses are {quoted(T)}{shape}; give them as (N, 4, 4)")
    poses, good = rounded(matrices)
    if not np.all(good):
        number = int(np.argmin(good))
        raise ModelError(
            f"{_title(system, number, len(good))} {defect(matrices[number])}; give rigid"
            " transforms, orthonormal and right-handed"
        )
    return poses


def _stacked(system: System, T: Any) -> NDArray[np.float64] | None:
    """The numbers in an array of whatever shape; None where there is more than numbers."""
    if not isinstance(T, list | tuple):
        return pose_numbers(T)
    parts = list[NDArray[np.float64]]()
    for number, part in enumerate(T):
        matrix = pose_numbers(part)
        if matrix is None or matrix.shape != (4, 4):
            raise ModelError(
                f"{_title(system, number, len(T))} it is {quoted(part)}; give (4, 4) numbers"
            )
        parts.append(matrix)
    return np.array(parts).reshape(-1, 4, 4)


def _title(system: System, number: int, count: int) -> str:
    return f"{system.name}: pose {number} of {count}, counted from 0:"
