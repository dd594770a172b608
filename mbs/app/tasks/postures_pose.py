"""Poses as people write them: numbers of a matrix, or a place and three angles."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.errors import ModelError
from mbs.expressions import Scalar, number
from mbs.messages import quoted
from mbs.models import transform
from mbs.models.geometry import terminal_frame

Array = NDArray[np.float64]

_LONGEST = 2000
_UPRIGHT = 1e-9
_FORMS = (
    "write x y z roll pitch yaw, or the 12 or 16 numbers of the matrix row by row, with blanks or"
    " commas between them"
)


def pose_of(
    system: System,
    q: Sequence[float] | Mapping[str, float] | None,
    frame: str | int | None = None,
    parameters: Mapping[str, float] | None = None,
) -> Array:
    """The pose of a frame seen from the base, (4, 4) [m].

    Args:
        system: the mechanism.
        q: positions, (nq,) or by name [rad or m].
        frame: a body, a named frame, the number of a link, or None for the terminal frame.
        parameters: values of symbols, the others at their defaults.

    Raises:
        ModelError: no such frame or coordinate, or a symbol has no value.
    """
    function = transform(system, terminal_frame(system) if frame is None else frame)
    p = [system.parameter_values(parameters)] if system.parameters else []
    return np.array(function(system.position(q), *p), dtype=float)


def pose_from(xyz: Sequence[Scalar], rpy: Sequence[Scalar]) -> Array:
    """The pose (4, 4) of a place and of turns about the fixed axes x, then y, then z.

    R = Rz(yaw) Ry(pitch) Rx(roll).

    Args:
        xyz: (3,) origin [m].
        rpy: (3,) roll, pitch and yaw [rad].

    Raises:
        ModelError: there are not three of each, or one has no value.
    """
    if len(xyz) != 3 or len(rpy) != 3:
        raise ModelError(
            f"a pose has three places and three angles, {len(xyz)} and {len(rpy)} were given;"
            " write x y z roll pitch yaw"
        )
    T = np.eye(4)
    T[:3, 3] = [number(value, "pose") for value in xyz]
    roll, pitch, yaw = (number(value, "pose") for value in rpy)
    T[:3, :3] = _turn(2, yaw) @ _turn(1, pitch) @ _turn(0, roll)
    return T


def rpy_of(T: Array) -> tuple[float, float, float]:
    """Roll, pitch and yaw [rad] of a pose (4, 4); roll is 0 where the x axis stands upright."""
    R = np.asarray(T, dtype=float)[:3, :3]
    level = math.hypot(R[0, 0], R[1, 0])
    pitch = math.atan2(-R[2, 0], level)
    if level < _UPRIGHT:
        return 0.0, pitch, math.atan2(-R[0, 1], R[1, 1])
    return math.atan2(R[2, 1], R[2, 2]), pitch, math.atan2(R[1, 0], R[0, 0])


def pose_from_text(text: str) -> Array:
    """The pose (4, 4) that a text writes.

    Args:
        text: "x y z roll pitch yaw", or 12 or 16 numbers of the matrix row by row, with blanks,
            commas, semicolons or new lines between them; each may be an expression without
            blanks, such as pi/2.

    Raises:
        ModelError: there are not as many numbers, or one has no value.
    """
    if len(text) > _LONGEST:
        raise ModelError(f"the text of the pose has {len(text)} characters; {_FORMS}")
    parts = [part for part in re.split(r"[\s,;\[\]]+", text) if part]
    if len(parts) == 6:
        return pose_from(parts[:3], parts[3:])
    if len(parts) not in (12, 16):
        raise ModelError(f"the pose {quoted(text)} has {len(parts)} numbers; {_FORMS}")
    T = np.eye(4)
    T[: len(parts) // 4] = np.array([number(part, "pose") for part in parts]).reshape(-1, 4)
    return T


def _turn(axis: int, angle: float) -> Array:
    k, h = (axis + 1) % 3, (axis + 2) % 3
    R = np.eye(3)
    R[k, k] = R[h, h] = math.cos(angle)
    R[h, k] = math.sin(angle)
    R[k, h] = -R[h, k]
    return R
