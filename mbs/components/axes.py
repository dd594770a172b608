"""Axes as users write them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mbs.errors import DescriptionError
from mbs.messages import quoted
from mbs.spatial import align_z

_NAMED_AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


def unit_axis(name: str, axis: Any) -> tuple[float, float, float]:
    """The unit vector of an axis that a user wrote as a letter or as three numbers."""
    if isinstance(axis, str):
        sign, letter = (-1.0, axis[1:]) if axis.startswith("-") else (1.0, axis)
        if letter not in _NAMED_AXES:
            raise DescriptionError(
                f"{name}: axis {axis!r} is unknown; give 'x', 'y', 'z', '-x' .. or three numbers"
            )
        x, y, z = _NAMED_AXES[letter]
        return sign * x, sign * y, sign * z
    try:
        values: NDArray[np.float64] = np.array([float(v) for v in axis])
    except (TypeError, ValueError):
        values = np.zeros(0)
    if values.shape != (3,) or not np.all(np.isfinite(values)):
        raise DescriptionError(
            f"{name}: axis {quoted(axis)} is not a direction; give three numbers"
        )
    length = math.hypot(*values)
    if length < 1e-9:
        raise DescriptionError(f"{name}: axis {quoted(axis)} has zero length; give a direction")
    x, y, z = (float(v) for v in values / length)
    return x, y, z


def in_plane(
    axis: tuple[float, float, float],
) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """Two unit vectors u, v with u x v = axis; x and y for the axis z."""
    R = align_z(np.array(axis))
    u, v = ([float(R[k, column]) for k in range(3)] for column in (0, 1))
    return (u[0], u[1], u[2]), (v[0], v[1], v[2])
