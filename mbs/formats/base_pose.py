"""Pose of the base in the world, as the vector Z of robot files of SYMORO and of tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from casadi import DM, SX
from numpy.typing import NDArray

from mbs.components.component import Placement
from mbs.components.mounting import mount_of
from mbs.components.notes import ImportNote
from mbs.errors import DescriptionError
from mbs.expressions import expression, parameters_of, to_float

Array = NDArray[np.float64]

POSE = "Z"
"""Name of the vector: the elements of a (4, 4) homogeneous matrix, row by row."""


def base_pose_texts(pose: Array) -> tuple[str, ...]:
    """Return the vector Z of a base pose as 16 texts.

    Args:
        pose: (4, 4) homogeneous matrix of the base in the world; its elements are written row by
            row.
    """
    return tuple(repr(float(value) + 0.0) for value in np.ravel(pose))


def placement_pose(placement: Placement, values: Mapping[str, float]) -> Array | None:
    """Return the base pose in the world as a numeric matrix (4, 4).

    None if a symbol of the placement has no value, or if an element is not finite.

    Args:
        placement: mount of the base on the world, which may contain symbols.
        values: numeric values of the symbols, by name.
    """
    names = {symbol.name for value in placement.expressions() for symbol in parameters_of(value)}
    if not names <= set(values):
        return None
    found = placement.pose({name: SX(float(values[name])) for name in names}).matrix
    pose = np.array(DM(found))
    return pose if np.isfinite(pose).all() else None


def base_placement(extras: Mapping[str, Sequence[str]]) -> tuple[Placement, list[ImportNote]]:
    """Return the mount of the base on the world from the extra data of a table of frames.

    Args:
        extras: extra vectors of the table as texts; the vector "Z" has the 16 elements of the pose.

    Returns:
        The mount and the import notes. The mount is the identity if there is no vector "Z". If the
        vector is not a numeric pose, the mount is the identity as well, and there is one note.
    """
    texts = extras.get(POSE, ())
    values = [to_float(expression(text)) for text in texts]
    if not texts or values == np.eye(4).ravel().tolist():
        return Placement(), []
    try:
        T: Any = np.reshape(np.array(values, dtype=float), (4, 4))
        if not np.array_equal(T[3], [0, 0, 0, 1]):
            raise ValueError
        mount = {"position": T[:3, 3].tolist(), "rotation": T[:3, :3].tolist()}
        return Placement(mount_of(mount, POSE)[0]), []
    except (ValueError, TypeError, DescriptionError):
        what = "is no pose of the base in numbers; the base has no mount"
        return Placement(), [ImportNote("ignored", f"vector {POSE}", what)]
