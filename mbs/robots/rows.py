"""Rows of tables for the catalogue, from masses and centres of mass as they are published."""

from __future__ import annotations

from collections.abc import Sequence
from math import radians
from typing import Any

import numpy as np

from mbs.formats import from_dict, to_mechanism
from mbs.mechanism import Mechanism

Row = dict[str, Any]


def frame(antecedent: int, joint: str = "revolute", **values: Any) -> Row:
    """Return a frame row of a table (see `FrameRow`).

    Args:
        antecedent: number of the antecedent frame, 0 for the base.
        joint: "revolute", "prismatic" or "fixed".
        **values: Khalil parameters [rad, m], limits [rad or m], velocity, effort, actuated, name.
    """
    return {"antecedent": antecedent, "joint": joint, **values}


def body(
    number: int,
    mass: float,
    com: Sequence[float],
    about_com: Sequence[float],
    **values: Any,
) -> Row:
    """Return the row of a body from its principal moments of inertia about the centre of mass.

    Args:
        number: number of the frame on which the body is fixed.
        mass: mass [kg].
        com: centre of mass in that frame [m].
        about_com: moments of inertia about the centre of mass, in the frame's axes [kg m^2].
        **values: further entries of the row: Ia, Fv, Fs, name.

    Returns:
        The row with the ten parameters about the origin of the frame.
    """
    c = np.array(com, dtype=float)
    square = float(np.sum(c * c))  # the last digit of c @ c depends on the processor
    J = np.diag(about_com) + mass * (square * np.eye(3) - np.outer(c, c))
    return about_origin(number, mass, com, J, **values)


def about_origin(number: int, mass: float, com: Sequence[float], J: Any, **values: Any) -> Row:
    """Return the row of a body from its inertia about the origin of its frame.

    Args:
        number: number of the frame on which the body is fixed.
        mass: mass [kg].
        com: centre of mass in that frame [m].
        J: inertia (3, 3) about the origin of the frame, in its axes [kg m^2].
        **values: further entries of the row: Ia, Fv, Fs, name.
    """
    keys = ("XX", "XY", "XZ", "YY", "YZ", "ZZ", "MX", "MY", "MZ", "M")
    elements = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))
    ten = [*(float(J[k, m]) for k, m in elements), *(mass * float(x) for x in com), mass]
    return {"frame": number, **dict(zip(keys, ten, strict=True)), **values}


def cuboid(
    number: int, mass: float, sides: Sequence[float], com: Sequence[float], **values: Any
) -> Row:
    """Return the row of a homogeneous cuboid whose sides are parallel to the axes of its frame.

    Args:
        number: number of the frame on which the body is fixed.
        mass: mass [kg].
        sides: lengths along x, y, z [m].
        com: centre of the cuboid in the frame [m].
        **values: further entries of the row: Ia, Fv, Fs, name.
    """
    x, y, z = (side * side for side in sides)
    about_com = [mass * (y + z) / 12, mass * (x + z) / 12, mass * (x + y) / 12]
    return body(number, mass, com, about_com, **values)


def robot(name: str, source: str, frames: list[Row], bodies: list[Row], **values: Any) -> Mechanism:
    """Return the mechanism of a table of frames.

    Args:
        name: name of the robot.
        source: origin of the data.
        frames: rows of the frames 1, 2, ...; see `frame`.
        bodies: rows of the bodies; see `body`.
        **values: further entries of the table: loop, guess, gravity.
    """
    table = {"name": name, "source": source, "frame": frames, "body": bodies, **values}
    return to_mechanism(from_dict(table))


def degrees(low: float, high: float) -> list[float]:
    """Return the limits (low, high) of a revolute joint in radians, from degrees."""
    return [radians(low), radians(high)]
