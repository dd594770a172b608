"""Sensor readings of positions, velocities and accelerations, for models and signal wires."""

from __future__ import annotations

from collections.abc import Sequence

import casadi
from casadi import SX

from mbs.assembly.tables import AttachedSensor, Coordinate
from mbs.assembly.tree import Frame, Tree
from mbs.components.custom import regular_length
from mbs.recursions.link_motions import Acceleration, Velocity
from mbs.recursions.route import BASE, relative_acceleration, relative_motion, relative_pose

Readings = dict[str, SX]
"""Readings of a sensor by the name of the quantity."""


def frame_readings(
    tree: Tree,
    attached: AttachedSensor,
    q: SX,
    velocities: list[Velocity] | None,
    accelerations: list[Acceleration] | None = None,
) -> Readings:
    """Return the readings of a sensor on frames of links, by name of the quantity.

    A distance sensor reads L [m] and its rate Ld [m/s]. Other sensors read position p [m], velocity
    v [m/s] and angular velocity w [rad/s] of a frame b relative to a frame a (3, 1), its
    orientation R (3, 3), and with accelerations a [m/s^2] and wd [rad/s^2].

    Args:
        tree: the links.
        attached: sensor of the kind "absolute", "relative" or "distance".
        q: (nq, 1) positions.
        velocities: velocities of the links, each in its frame. None means at rest.
        accelerations: accelerations of the links without gravity, each in its frame. If None, no
            acceleration is returned.
    """
    frames = attached.frames
    a, b = frames if len(frames) == 2 else (BASE, *frames)
    motion = relative_motion(tree, a, b, q, velocities)
    if attached.sensor.reads == "distance":
        L = regular_length(motion.p)
        return {"L": L, "Ld": casadi.dot(motion.p, motion.V) / L}
    vectors = {"p": motion.p, "v": motion.V, "w": motion.w}
    if accelerations is not None:
        rates = relative_acceleration(motion, a, b, accelerations)
        vectors |= {"a": rates.A, "wd": rates.wd}
    return {**in_axes(tree, q, vectors, axes_of(attached), a), "R": motion.R}


def axes_of(attached: AttachedSensor) -> Frame:
    """Return the frame in whose axes a sensor expresses its vectors: the base, or frame a or b.

    Args:
        attached: sensor of a system.
    """
    frames = attached.frames
    a, b = frames if len(frames) == 2 else (BASE, *frames)
    return {"world": BASE, "body": b, "a": a, "b": b}[getattr(attached.sensor, "axes", "b")]


def in_axes(tree: Tree, q: SX, vectors: Readings, axes: Frame, home: Frame) -> Readings:
    """Express vectors of one frame in the axes of another frame.

    Args:
        tree: the links.
        q: (nq, 1) positions.
        vectors: vectors (3, 1) in axes of `home`, by name.
        axes: frame of the new axes.
        home: frame of the present axes.
    """
    if axes is home:
        return vectors
    R = relative_pose(tree, q, axes, home).R
    return {name: casadi.mtimes(R, vector) for name, vector in vectors.items()}


def coordinate_readings(
    name: str,
    tables: tuple[Sequence[Coordinate], Sequence[Coordinate]],
    q: SX,
    v: SX | None,
    a: SX | None = None,
) -> Readings:
    """Return position "q", velocity "v" and acceleration "a" of a coordinate, as far as they exist.

    Args:
        name: name of the coordinate.
        tables: the coordinates of q and of v.
        q: (nq, 1) positions.
        v: (nv, 1) velocities. If None, no velocity is returned.
        a: (nv, 1) accelerations. If None, no acceleration is returned.
    """
    read: Readings = {}
    positions, speeds = tables
    for quantity, rows, values in (("q", positions, q), ("v", speeds, v), ("a", speeds, a)):
        number = next((k for k, row in enumerate(rows) if row.name == name), None)
        if values is not None and number is not None:
            read[quantity] = values[number]
    return read
