"""A pose as a user gives it: a rigid transform, or the row or axis that keeps it from being one."""

from __future__ import annotations

from itertools import combinations
from typing import Any

import numpy as np
from casadi import DM, SX
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.errors import ModelError
from mbs.messages import quoted
from mbs.spatial import Pose

Array = NDArray[np.float64]

SKEWED = 1e-6
"""By how much an element may miss a rigid transform and is still rounded to one."""

_ROUNDINGS = 2
_LAST = np.array([0.0, 0.0, 0.0, 1.0])
_WANTED = (
    "give a pose, (4, 4) with an orthonormal right-handed orientation and the last row 0, 0, 0, 1"
)


def wanted_pose(system: System, T: Any) -> Array:
    """The pose that is wanted, its orientation exactly orthonormal.

    Args:
        system: named in messages.
        T: (4, 4) homogeneous transform [m], as an array, nested lists, a casadi matrix of numbers
            or a Pose; where it is orthonormal but for 1e-6 it is rounded to the nearest rotation.

    Returns:
        (4, 4) numbers.

    Raises:
        ModelError: T is no rigid transform; the message names the row or the axis.
    """
    matrix = pose_numbers(T)
    if matrix is None or matrix.shape != (4, 4):
        shape = "" if matrix is None else f" of shape {matrix.shape}"
        raise ModelError(f"{system.name}: T is {quoted(T)}{shape}; {_WANTED}")
    pose, good = rounded(matrix)
    if not good:
        raise ModelError(f"{system.name}: {defect(matrix)}; {_WANTED}")
    return pose


def pose_numbers(T: Any) -> Array | None:
    """T as an array of numbers of any shape; None where it is none."""
    try:
        if isinstance(T, Pose):
            T = T.matrix
        if isinstance(T, SX | DM):
            return np.array(DM(T)) if SX(T).is_constant() else None
        numbers = np.asarray(T)
        return None if np.iscomplexobj(numbers) else numbers.astype(float)
    except (RuntimeError, TypeError, ValueError, NotImplementedError):
        return None


def rounded(T: Array) -> tuple[Array, NDArray[np.bool_]]:
    """(..., 4, 4) rigid transforms nearest to T, and (...) whether T is one but for 1e-6.

    Source: Higham 2008, chapter 8, the Newton-Schulz iteration for the polar factor.
    """
    with np.errstate(all="ignore"):
        R = T[..., :3, :3]
        skew = np.max(np.abs(np.swapaxes(R, -1, -2) @ R - np.eye(3)), axis=(-1, -2))
        for _ in range(_ROUNDINGS):
            R = 1.5 * R - 0.5 * R @ np.swapaxes(R, -1, -2) @ R
        pose = np.array(T)
        pose[..., :3, :3], pose[..., 3, :] = R, _LAST
        near = np.max(np.abs(pose - T), axis=(-1, -2)) < SKEWED
        right = np.linalg.det(T[..., :3, :3]) > 0
    return pose, near & right & (skew < 10 * SKEWED)


def defect(T: Array, name: str = "T") -> str:
    """What keeps a matrix (4, 4) from being a rigid transform."""
    open_places = np.argwhere(~np.isfinite(T))
    if len(open_places):
        r, c = (int(k) for k in open_places[0])
        return f"{name}[{r}, {c}] is {T[r, c]} (row {r + 1}, column {c + 1})"
    if np.any(np.abs(T[3] - _LAST) >= SKEWED):
        return f"the last row of {name} is {', '.join(f'{x:.6g}' for x in T[3])}"
    return _skewed_axes(T[:3, :3], name)


def _skewed_axes(R: Array, name: str) -> str:
    """The axis that misses a unit length most, or the two that miss a right angle most."""
    with np.errstate(over="ignore"):
        lengths = np.linalg.norm(R, axis=0)
    faults = {
        abs(length - 1): f"the {axis} axis of {name}, column {k + 1}, has length {length:.9g}"
        for k, (axis, length) in enumerate(zip("xyz", lengths.tolist(), strict=True))
    }
    units = R / np.where(lengths > 0, lengths, 1.0)
    for k, m in combinations(range(3), 2):
        cosine = float(units[:, k] @ units[:, m])
        faults[abs(cosine)] = (
            f"the {'xyz'[k]} and {'xyz'[m]} axes of {name} are not perpendicular, the cosine"
            f" between them is {cosine:.3g}"
        )
    worst = max(faults)
    if worst < SKEWED / 2:
        return f"the axes of {name} are left-handed, z points against x times y"
    return faults[worst]
