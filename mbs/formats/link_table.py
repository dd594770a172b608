"""Robot as tables of numbers, from which URDF, SDF and MJCF files are written.

All numbers are in SI units and radians. Every link of a file has a frame. It is the frame of one of
its bodies or else the frame of the link in the tree, with the joint axis along z.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mbs.components import Custom, Joint
from mbs.components.joints import Motion
from mbs.errors import ModelError

Array = NDArray[np.float64]

Range = tuple[float, float]
"""Lower and upper limit."""

Place = tuple[int, Array]
"""Index of a link (-1 for the base) and pose (4, 4) of a frame in the frame of the link."""


@dataclass(frozen=True, slots=True, eq=False)
class FileLink:
    """Link with its inertia, and the joint that moves it.

    Attributes:
        name: name of the joint.
        motion: motion of the joint.
        antecedent: index of the link that carries the joint, -1 for the base.
        body: name of the body whose frame is the frame of the link; empty for the frame in the
            tree.
        bodies: names of all bodies on the link.
        frame: (4, 4) pose of the frame of the link in the frame in the tree.
        placement: (4, 4) pose of the frame of the link in the frame of the antecedent, at the drawn
            joint positions.
        joint_frame: (4, 4) pose of the frame of the joint in the frame of the link.
        joint_pose: (4, 4) pose of the frame in the tree in that of the antecedent, at position
            zero.
        inertia: (10,) inertial parameters XX XY XZ YY YZ ZZ MX MY MZ M in the frame in the tree.
        Fv, Fs: viscous and Coulomb friction of the joint.
        Ia: rotor inertia, referred to the joint.
        stiffness, rest: stiffness and rest position of the spring of the joint.
        limits, velocity, effort: limits of position, velocity and motor effort; None if unlimited.
        actuated: whether a motor drives the joint.
        position: index of the first position of the joint.
    """

    name: str
    motion: Motion
    antecedent: int
    body: str
    bodies: tuple[str, ...]
    frame: Array
    placement: Array
    joint_frame: Array
    joint_pose: Array
    inertia: Array
    Fv: float
    Fs: float
    Ia: float
    stiffness: float
    rest: float
    limits: Range | None
    velocity: Range | None
    effort: Range | None
    actuated: bool
    position: int


@dataclass(frozen=True, slots=True, eq=False)
class FileFrame:
    """Frame on a link: a named frame, a body, a frame of a joint, or a body fixed to the base.

    Attributes:
        name: name of the frame.
        link: index of the link, -1 for the base.
        pose: (4, 4) pose in the frame of the link.
        kind: "named", "body", "joint" or "fixed".
    """

    name: str
    link: int
    pose: Array
    kind: Literal["named", "body", "joint", "fixed"]


@dataclass(frozen=True, slots=True, eq=False)
class FileCoupling:
    """Relation driven = sum of c_k driver^k + sum of further positions times factors.

    Attributes:
        name: name of the coupling.
        driven, driver: indices of positions.
        coefficients: c_0, c_1, ...
        others: index and factor of each further position.
    """

    name: str
    driven: int
    driver: int
    coefficients: tuple[float, ...]
    others: tuple[tuple[int, float], ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class FileLoop:
    """Joint that closes a loop.

    Attributes:
        joint: description of the joint.
        welded: whether the joint itself is in the tree, and a weld closes the loop.
        ends: pairs of places that coincide in a closed loop; for a rod its ends.
        turned: whether the first place of a pair is that of frame_b of the joint.
        opening: (4, 4) pose of the second place relative to the first one, as drawn.
        excess: length of a rod minus the distance of its ends at position zero [m].
    """

    joint: Joint
    welded: bool
    ends: tuple[tuple[Place, Place], ...]
    turned: bool = False
    opening: Array = field(default_factory=lambda: np.eye(4))
    excess: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class FileForce:
    """Force element.

    Attributes:
        element: description of the element.
        values: its quantities in numbers, by name.
        places: places of its points.
        levers: names of the velocities on which it acts, and its moment arms.
    """

    element: Custom
    values: Mapping[str, tuple[float, ...]]
    places: tuple[Place, ...]
    levers: Mapping[str, float]


@dataclass(frozen=True, slots=True, eq=False)
class LinkTable:
    """Robot as tables of numbers.

    Attributes:
        name: name of the robot.
        gravity: (3,) acceleration of gravity in the base frame [m/s^2].
        links: links in an order in which antecedents precede their descendants.
        frames: frames on the links and on the base, by name.
        positions: names of the joint positions.
        drawn: (nq,) joint positions at which the robot is drawn.
        couplings: relations between joint positions.
        loops: joints that close loops.
        forces: force elements.
    """

    name: str
    gravity: Array
    links: tuple[FileLink, ...]
    frames: Mapping[str, FileFrame]
    positions: tuple[str, ...]
    drawn: Array
    couplings: tuple[FileCoupling, ...] = ()
    loops: tuple[FileLoop, ...] = ()
    forces: tuple[FileForce, ...] = ()


# Rules of the formats with one inertia about the centre of mass and one limit per direction.


def inertial_of(table: LinkTable, link: FileLink) -> tuple[float, Array, Array]:
    """Return mass, centre of mass (3,) and inertia about it (3, 3), in the frame of a link.

    Raises:
        ModelError: the link has first moments but no mass.
    """
    ten = link.inertia
    J = ten[[0, 1, 2, 1, 3, 4, 2, 4, 5]].reshape(3, 3)
    mass, moment = float(ten[9]), ten[6:9]
    if mass == 0 and np.any(moment):
        raise ModelError(
            f"{table.name}: what {link.name} carries has first moments but no mass, which no robot"
            " file can say; give it a mass"
        )
    c = moment / mass if mass else np.zeros(3)
    J = J - mass * (c @ c * np.eye(3) - np.outer(c, c))
    R, p = link.frame[:3, :3], link.frame[:3, 3]
    return mass, R.T @ (c - p), R.T @ J @ R


def largest_of(
    table: LinkTable, link: FileLink, file: str, unlimited: float
) -> tuple[float, float]:
    """Return the limits of the velocity and of the effort of a joint, for both directions.

    Args:
        table: tables of the robot.
        link: link that the joint moves.
        file: kind of file, for error messages.
        unlimited: number for a limit that does not exist.

    Raises:
        ModelError: a velocity or effort limit differs by direction.
    """
    if link.motion in (Motion.FREE, Motion.SPHERICAL):
        return unlimited, unlimited
    largest = []
    for what, pair in (("velocity", link.velocity), ("effort", link.effort)):
        low, high = pair or (-unlimited, unlimited)
        if low != -high:
            raise ModelError(
                f"{table.name}: {what} of {link.name} is between {low:g} and {high:g},"
                f" but {file} has one number for both directions; give it one"
            )
        largest.append(float(high))
    return largest[0], largest[1]
