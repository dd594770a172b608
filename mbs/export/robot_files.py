"""Common functions of the writers of robot files: assembly, coordinates, notes, files."""

from __future__ import annotations

import os
from collections.abc import Sequence
from xml.etree.ElementTree import Comment, Element, indent, tostring

import casadi
import numpy as np
from casadi import DM, SX, Function
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.components.description import OUTER_WORLD
from mbs.components.joints import Motion
from mbs.errors import ModelError
from mbs.files import path_of, write_bytes
from mbs.mechanism import Mechanism
from mbs.recursions.poses import link_poses
from mbs.spatial import origin
from mbs.text import quoted

Array = NDArray[np.float64]


def system_of(system: object) -> System:
    """Return the argument of a user as a System. A Mechanism is assembled.

    Raises:
        ModelError: the argument has another type.
    """
    if isinstance(system, Mechanism):
        return system.assemble()
    if not isinstance(system, System):
        raise ModelError(
            f"{quoted(system)} is a {type(system).__name__}; give a System or a Mechanism"
        )
    return system


def child_positions(system: System, q: Sequence[float]) -> list[float]:
    """Return the positions q in the coordinates of robot files.

    In a robot file the quaternion of a joint is the orientation of the child body in the parent
    body. In a system it is the orientation of frame_b in frame_a. Both differ if a spherical or
    free joint has the child body on its frame_a.
    """
    found = [float(value) for value in q]
    for link, pose in zip(system.tree.links, link_poses(system.tree, SX(DM(found))), strict=True):
        if link.backward:
            p = np.array(DM(origin(pose.motion))).ravel() if link.motion is Motion.FREE else ()
            w, x, y, z = found[link.q.stop - 4 : link.q.stop]
            found[link.q] = [*p, w, -x, -y, -z]
    return found


def check_backward_drives(system: System, file: str) -> None:
    """Check free and spherical joints with the child body on frame_a for drives and friction.

    Raises:
        ModelError: friction or rotor inertia acts on velocities that the file does not have.
    """
    for link in system.tree.links:
        acting = (link.Fv, link.Fs, link.Ia) if link.motion is Motion.FREE else (link.Fs,)
        if link.backward and not all(value.is_zero() for value in acting):
            raise ModelError(
                f"{system.name}/{link.name}: its friction or rotor inertia acts on velocities of"
                f" the inner body relative to the outer one, which {file} files do not have;"
                " connect the inner body first"
            )


def shapes_left_out(system: System) -> str:
    """Return the note about shapes, which no writer of robot files keeps; empty without shapes."""
    if not system.shapes:
        return ""
    names = {-1: "the base", **{j: link.name for j, link in enumerate(system.tree.links)}}
    owners = ", ".join(dict.fromkeys(names[row.link] for row in system.shapes))
    return f"Shapes that are not in this file: {len(system.shapes)}, on {owners}."


def base_pose(system: System) -> Array | None:
    """Return the pose (4, 4) of the base in the outer world, symbols at their defaults.

    None without a mount, and if one of its symbols has no value.
    """
    if OUTER_WORLD not in system.frames:
        return None
    _, pose = system.frames[OUTER_WORLD]
    matrix = Function("base", [system.p], [casadi.densify(pose.inverse().matrix)])
    found = np.array(matrix(system.p_default))
    return found if np.isfinite(found).all() else None


def mount_left_out(system: System) -> str:
    """Return the note about a mount that a file in numbers cannot have; empty if it has it."""
    lost = OUTER_WORLD in system.frames and base_pose(system) is None
    return (
        "The mount of the base has symbols without a value; it is not in this file." if lost else ""
    )


def write_xml(root: Element, path: str | os.PathLike[str], note: str = "") -> None:
    """Write an indented XML file as a whole or not at all.

    Args:
        root: element of the robot.
        path: path of the file.
        note: text of a comment at the beginning of the file.

    Raises:
        ExportError: the file cannot be written.
    """
    if note:
        root.insert(0, Comment(f" {note.replace('--', '- -')} "))
    indent(root)
    content = tostring(root, encoding="utf-8", xml_declaration=True) + b"\n"
    write_bytes(content, path_of(path))
