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
    """Link with its inertia, and the joint that connects it to its antecedent (parent link).

    The link has two frames. The tree frame is the frame of the link in the assembled tree, with the
    joint axis along z. The file frame is the frame of the link in the file.

    Attributes:
        name: name of the joint.
        motion: motion of the joint.
        antecedent: index of the parent link, -1 for the base.
        body: name of the body whose frame is the file frame; empty if the file frame is the tree
            frame.
        bodies: names of all bodies on the link.
        frame: (4, 4) pose of the file frame relative to the tree frame.
        placement: (4, 4) pose of the file frame relative to the file frame of the antecedent, at
            the drawn joint positions.
        joint_frame: (4, 4) pose of the joint frame relative to the file frame.
        joint_pose: (4, 4) pose of the tree frame relative to the tree frame of the antecedent, at
            position zero.
        inertia: (10,) inertial parameters XX XY XZ YY YZ ZZ MX MY MZ M in the tree frame.
        Fv, Fs: viscous and Coulomb friction of the joint.
        Ia: rotor inertia, referred to the joint.
        stiffness, rest: stiffness and rest position of the spring of the joint.
        limits, velocity, effort: limits (lower, upper) of position, velocity and motor effort; None
            if unlimited.
        actuated: whether a motor drives the joint.
        position: index of the first position of the joint in the vector of joint positions.
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
        pose: (4, 4) pose relative to the file frame of the link.
        kind: origin of the frame: "named" (frame named by the user), "body", "joint", or "fixed"
            (body fixed to the base).
    """

    name: str
    link: int
    pose: Array
    kind: Literal["named", "body", "joint", "fixed"]


@dataclass(frozen=True, slots=True, eq=False)
class FileCoupling:
    """Coupling of joint positions: driven = c_0 + c_1 driver + c_2 driver^2 + ... + linear terms.

    Attributes:
        name: name of the coupling.
        driven, driver: indices of the driven and the driving joint position.
        coefficients: c_0, c_1, ... of the polynomial in the driving position.
        others: index and factor of each further joint position that is added.
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
        welded: whether the joint itself is in the tree and a weld closes the loop instead.
        ends: pairs of frames, given by link index and pose, that coincide if the loop is closed;
            for a rod the frames of its two ends.
        turned: whether the first frame of a pair belongs to frame_b of the joint instead of
            frame_a.
        opening: (4, 4) pose of the second frame relative to the first frame at the drawn positions.
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
    """Force element of the robot, such as a spring, a damper or a fixed tendon.

    Attributes:
        element: description of the element.
        values: numeric values of its quantities, by name.
        places: frames of its attachment points, given by link index and pose.
        levers: moment arms of the element, by the name of the joint velocity on which it acts.
    """

    element: Custom
    values: Mapping[str, tuple[float, ...]]
    places: tuple[Place, ...]
    levers: Mapping[str, float]


@dataclass(frozen=True, slots=True, eq=False)
class LinkTable:
    """Robot as tables of numbers, from which URDF, SDF and MJCF files are written.

    Attributes:
        name: name of the robot.
        gravity: (3,) acceleration of gravity in the base frame [m/s^2].
        links: links in an order in which antecedents precede their descendants.
        frames: frames on the links and on the base, by name.
        positions: names of the joint positions.
        drawn: (nq,) joint positions of the pictures, at which `FileLink.placement` is evaluated
            [rad or m].
        couplings: couplings of joint positions.
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


def central_inertia(inertia: Array) -> tuple[float, Array, Array]:
    """Return mass, centre of mass (3,) and inertia about it (3, 3) from inertial parameters.

    The centre of mass of a massless body is the origin.

    Args:
        inertia: (10,) inertial parameters XX XY XZ YY YZ ZZ MX MY MZ M about the origin.
    """
    J = inertia[[0, 1, 2, 1, 3, 4, 2, 4, 5]].reshape(3, 3)
    mass = float(inertia[9])
    c = inertia[6:9] / mass if mass else np.zeros(3)
    return mass, c, J - mass * (c @ c * np.eye(3) - np.outer(c, c))


def inertial_of(table: LinkTable, link: FileLink) -> tuple[float, Array, Array]:
    """Return mass [kg], centre of mass (3,) [m] and inertia about it (3, 3) [kg m^2] of a link.

    Centre of mass and inertia are expressed in the file frame of the link (see `FileLink`).

    Args:
        table: tables of the robot; only its name is used, for the error message.
        link: link of the tables.

    Raises:
        ModelError: the link has first moments but no mass.
    """
    mass, c, J = central_inertia(link.inertia)
    if mass == 0 and np.any(link.inertia[6:9]):
        raise ModelError(
            f"{table.name}: what {link.name} carries has first moments but no mass, which no robot"
            " file can say; give it a mass"
        )
    R, p = link.frame[:3, :3], link.frame[:3, 3]
    return mass, R.T @ (c - p), R.T @ J @ R


def largest_of(
    table: LinkTable, link: FileLink, file: str, unlimited: float
) -> tuple[float, float]:
    """Return the velocity limit and the effort limit of a joint, each valid for both directions.

    Args:
        table: tables of the robot; only its name is used, for the error message.
        link: link that the joint moves.
        file: name of the file format, for the error message.
        unlimited: number that the format uses for a missing limit.

    Returns:
        (velocity, effort) in [rad/s or m/s] and [N m or N]. Both are `unlimited` for spherical and
        free joints.

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
