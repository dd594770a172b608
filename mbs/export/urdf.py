"""Export of mechanisms without loops as URDF robot files."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any
from xml.etree.ElementTree import Element, SubElement

import casadi
import numpy as np
from casadi import SX, Function
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.assembly.tree import Link
from mbs.components.description import OUTER_WORLD
from mbs.components.joints import Motion
from mbs.errors import ModelError
from mbs.export.robot_files import (
    base_pose,
    check_backward_drives,
    shapes_left_out,
    system_of,
    write_xml,
)
from mbs.formats.urdf.reader import UNLIMITED
from mbs.mechanism import Mechanism
from mbs.text import listed, quoted

Array = NDArray[np.float64]

_ON_AXIS = 1e-14
"""Largest distance [m] of the origin of a body from its joint axis: only rounding."""
_SAME = 1e-12
"""Difference of gravity [m/s^2] or of a transform [m] that counts as rounding (below 1e-14)."""
_DOWN = (0.0, 0.0, -9.81)  # gravity [m/s^2] that readers assume, because URDF cannot specify it


def urdf(system: System | Mechanism, path: str | os.PathLike[str]) -> None:
    """Write a mechanism without loops as a URDF file, with symbols at their default values.

    Every body becomes a link of the same name, every named frame a link without mass, and every
    motion a joint. Of bodies that are fixed to each other, one body has the total inertia.
    Couplings of degree one become mimics, and rotor inertia Ia becomes the motor inertia of a
    transmission of ratio one. The format does not contain the actuated joints and the width of
    Coulomb friction. If a mount rotates the base, the frame "outer_world" is the world of the file.

    Args:
        system: mechanism with revolute, prismatic and free motions. A Mechanism is assembled first.
        path: path of the .urdf file.

    Raises:
        ModelError: system has another type, loops, a spherical joint, springs, rotors, force
            elements, effort or velocity limits that differ by direction, a gravity other than
            9.81 m/s^2 along -z, or a symbol without value.
        ExportError: the file cannot be written.
    """
    system = system_of(system)
    _check(system)
    root = _Writing(system, Numbers(system, "URDF")).robot()
    write_xml(root, path, shapes_left_out(system))


class Numbers:
    """Function that evaluates expressions of a system at the default values of its symbols.

    Args:
        system: mechanism to write.
        file: kind of file, for error messages.
    """

    def __init__(self, system: System, file: str) -> None:
        missing = [p.name for p in system.parameters if p.default is None]
        if missing:
            has = "has no value" if len(missing) == 1 else "have no value"
            raise ModelError(
                f"{system.name}: {listed(missing)} {has}, and {file} files have no symbols; give"
                f" values, such as Mechanism(parameters={{{missing[0]!r}: 1.0}})"
            )
        self.p, self.values = system.p, system.p_default

    def __call__(self, value: SX) -> Array:
        """Evaluate an expression. Returns an array of its shape."""
        function = Function("value", [self.p], [casadi.densify(SX(value))])
        return np.array(function(self.values), dtype=float)


def _check(system: System) -> None:
    """Raise ModelError if URDF does not support a part of the system."""

    def fail(what: str) -> None:
        raise ModelError(f"{system.name}: {what}, which URDF cannot say; take it away first")

    if system.cuts:
        fail(f"{system.cuts[0].edge.joint.name} closes a loop")
    if system.parts or system.shafts:
        fail("it has force elements or a drive line")
    check_backward_drives(system, "URDF")
    for link in system.tree.links:
        if link.motion is Motion.SPHERICAL:
            fail(f"{link.name} is a spherical joint")
        if link.rotor is not None or not (link.stiffness.is_zero() and link.rest.is_zero()):
            fail(f"{link.name} has a rotor or a spring")
    for coupling in system.couplings:
        if len(coupling.coefficients) > 2:
            fail(f"{coupling.name} is a coupling of a higher degree than one")
        if coupling.others:
            fail(f"{coupling.name} is a coupling of more than two joints")


@dataclass(slots=True)
class _Writing:
    """Writer of the XML elements of a URDF file.

    Attributes:
        system: mechanism to write.
        number: function that evaluates expressions at the default values of symbols.
        frame: dict from link index (-1 for the world) to the name of the link in the file and the
            pose (4, 4) of its frame in the link frame of the tree.
    """

    system: System
    number: Numbers
    frame: dict[int, tuple[str, Array]] = field(default_factory=dict)

    def robot(self) -> Element:
        system = self.system
        gravity = self.number(system.tree.gravity).ravel()
        root = Element("robot", name=system.name)
        SubElement(root, "link", name="world")
        self.frame[-1] = "world", np.eye(4)
        if not np.array_equal(gravity, _DOWN):
            self._mount(gravity)
        frames_by_name = {
            name: (link, self.number(pose.matrix))
            for name, (link, pose) in system.frames.items()
            if name not in ("base", "world")
        }
        for j, link in enumerate(system.tree.links):
            self._link(root, j, link, frames_by_name)
        written = {name for name, _ in self.frame.values()}
        for name, (number, pose) in frames_by_name.items():
            is_world = number < 0 and np.allclose(pose, self.frame[-1][1], rtol=0, atol=_SAME)
            if name not in written and not (name == OUTER_WORLD and is_world):
                self._add_fixed_joint(root, name, number, pose)
        return root

    def _mount(self, gravity: Array) -> None:
        """Make the outer world of a mounted robot, with gravity along -z, the world of the file.

        Raises:
            ModelError: no mount rotates gravity to that of URDF, or the robot has a free joint,
                whose coordinates are relative to the base.
        """
        system = self.system
        pose = base_pose(system)
        R = np.eye(3) if pose is None else pose[:3, :3]
        if pose is None or np.max(np.abs(R @ gravity - _DOWN)) > _SAME:
            raise ModelError(
                f"{system.name}: gravity is {quoted(gravity.tolist())}, but that of URDF is"
                f" {_DOWN}; give the robot a mount instead"
            )
        for link in system.tree.links:
            if link.motion is Motion.FREE and link.antecedent < 0:
                raise ModelError(
                    f"{system.name}/{link.name}: a free joint on a rotated base has other"
                    " coordinates in a URDF file; write the robot without its mount"
                )
        self.frame[-1] = "world", inverse(pose)

    def _link(
        self, root: Element, j: int, link: Link, frames_by_name: Mapping[str, tuple[int, Array]]
    ) -> None:
        name, pose = self._carrier(j, link, frames_by_name)
        self.frame[j] = name, pose
        _inertial(
            SubElement(root, "link", name=name),
            *inertia_of(self.system.name, link, pose, self.number),
        )
        parent, before = self.frame[link.antecedent]
        kind = {Motion.FREE: "floating", Motion.PRISMATIC: "prismatic"}.get(link.motion, "revolute")
        limits, velocity, effort = limits_of(self.system, link, "URDF")
        if kind == "revolute" and limits is None:
            kind = "continuous"
        joint = SubElement(root, "joint", name=link.name, type=kind)
        SubElement(joint, "parent", link=parent)
        SubElement(joint, "child", link=name)
        _origin(joint, inverse(before) @ self.number(link.pose().matrix) @ pose)
        friction = [float(self.number(value).item()) for value in (link.Fv, link.Fs)]
        if any(friction):
            damping, coulomb = map(repr, friction)
            SubElement(joint, "dynamics", damping=damping, friction=coulomb)
        if kind == "floating":
            self._rotor(root, link)
            return
        SubElement(joint, "axis", xyz=text_of(pose[2, :3]))
        low, high = limits or (-UNLIMITED, UNLIMITED)
        given = {"effort": repr(effort), "velocity": repr(velocity)}
        if kind != "continuous":
            given |= {"lower": repr(low), "upper": repr(high)}
        SubElement(joint, "limit", given)
        self._mimic(joint, link)
        self._rotor(root, link)

    def _rotor(self, root: Element, link: Link) -> None:
        """Append the rotor inertia of a joint as a transmission with reduction 1."""
        inertia = float(self.number(link.Ia).item())
        if not inertia:
            return
        transmission = SubElement(root, "transmission", name=f"{link.name}_transmission")
        SubElement(transmission, "joint", name=link.name)
        actuator = SubElement(transmission, "actuator", name=f"{link.name}_motor")
        SubElement(actuator, "mechanicalReduction").text = "1"
        SubElement(actuator, "motorInertia").text = repr(inertia)

    def _carrier(
        self, j: int, link: Link, frames_by_name: Mapping[str, tuple[int, Array]]
    ) -> tuple[str, Array]:
        """Return name and pose (4, 4) of the link frame in the file.

        It is the frame of a body with its origin on the joint axis, or else the link frame itself.
        """
        bodies = [body.name for body in self.system.bodies]
        for name, (number, pose) in frames_by_name.items():
            away = pose[:2, 3] if link.motion is Motion.REVOLUTE else np.zeros(2)
            if link.motion is Motion.FREE:
                away = (pose - np.eye(4)).ravel()
            if number == j and name in bodies and np.all(np.abs(away) <= _ON_AXIS):
                return name, pose
        own = f"{link.name}_axis"
        while own in frames_by_name:
            own += "_"
        return own, np.eye(4)

    def _mimic(self, joint: Element, link: Link) -> None:
        for coupling in self.system.couplings:
            if coupling.driven == link.q.start:
                terms = [float(self.number(c).item()) for c in coupling.coefficients]
                offset, factor = (*terms, 0.0, 0.0)[:2]
                SubElement(
                    joint,
                    "mimic",
                    joint=self.system.coordinates[coupling.driver].name,
                    multiplier=repr(factor),
                    offset=repr(offset),
                )

    def _add_fixed_joint(self, root: Element, name: str, number: int, pose: Array) -> None:
        """Append a link with a fixed joint for a body or named frame on link `number`."""
        parent, before = self.frame[number]
        SubElement(root, "link", name=name)
        joint = SubElement(root, "joint", name=f"{name}_fixed", type="fixed")
        SubElement(joint, "parent", link=parent)
        SubElement(joint, "child", link=name)
        _origin(joint, inverse(before) @ pose)


def inertia_of(system: str, link: Link, pose: Array, number: Numbers) -> tuple[float, Array, Array]:
    """Return mass, centre of mass (3,) and inertia about it (3, 3), in a frame on a link.

    Args:
        system: name of the system, for error messages.
        link: link of the tree.
        pose: pose (4, 4) of the frame in the link frame.
        number: function that evaluates expressions.

    Raises:
        ModelError: the link has first moments but no mass.
    """
    ten = number(link.inertia.parameters).ravel()
    J = ten[[0, 1, 2, 1, 3, 4, 2, 4, 5]].reshape(3, 3)
    mass, moment = float(ten[9]), ten[6:9]
    if mass == 0 and np.any(moment):
        raise ModelError(
            f"{system}: what {link.name} carries has first moments but no mass, which no robot file"
            " can say; give it a mass"
        )
    c = moment / mass if mass else np.zeros(3)
    J = J - mass * (c @ c * np.eye(3) - np.outer(c, c))
    R, p = pose[:3, :3], pose[:3, 3]
    return mass, R.T @ (c - p), R.T @ J @ R


def limits_of(
    system: System, link: Link, file: str
) -> tuple[tuple[float, float] | None, float, float]:
    """Return position limits (or None), velocity limit and effort limit of the joint of a link.

    Args:
        system: mechanism to write.
        link: link of the tree.
        file: kind of file, for error messages.

    Raises:
        ModelError: a velocity or effort limit differs by direction.
    """
    if link.motion in (Motion.FREE, Motion.SPHERICAL):
        return None, UNLIMITED, UNLIMITED
    speed = system.speeds[link.v.start]
    largest = []
    for what, pair in (("velocity", speed.limits), ("effort", speed.effort)):
        low, high = pair or (-UNLIMITED, UNLIMITED)
        if low != -high:
            raise ModelError(
                f"{system.name}: {what} of {link.name} is between {low:g} and {high:g},"
                f" but {file} has one number for both directions; give it one"
            )
        largest.append(float(high))
    return system.coordinates[link.q.start].limits, largest[0], largest[1]


def text_of(values: Any) -> str:
    """Format values separated by blanks, with all digits of a double."""
    return " ".join(repr(float(value) + 0.0) for value in values)


def inverse(pose: Array) -> Array:
    """Return the inverse of a homogeneous transform (4, 4)."""
    R, p = pose[:3, :3], pose[:3, 3]
    return np.block([[R.T, -(R.T @ p)[:, None]], [np.zeros((1, 3)), np.ones((1, 1))]])


def _origin(element: Element, pose: Array) -> None:
    SubElement(element, "origin", xyz=text_of(pose[:3, 3]), rpy=text_of(angles(pose[:3, :3])))


def angles(R: Array) -> tuple[float, float, float]:
    """Return roll, pitch and yaw [rad] of a rotation matrix, accurate also at pitch +-pi/2.

    Yaw is arbitrary at pitch +-pi/2; roll and pitch are computed for the chosen yaw.
    """
    yaw = math.atan2(R[1, 0], R[0, 0])
    c, s = math.cos(yaw), math.sin(yaw)
    pitch = math.atan2(-R[2, 0], c * R[0, 0] + s * R[1, 0])
    roll = math.atan2(s * R[0, 2] - c * R[1, 2], c * R[1, 1] - s * R[0, 1])
    return roll, pitch, yaw


def _inertial(link: Element, mass: float, com: Array, tensor: Array) -> None:
    if mass == 0 and not np.any(tensor):
        return
    inertial = SubElement(link, "inertial")
    SubElement(inertial, "origin", xyz=text_of(com), rpy="0 0 0")
    SubElement(inertial, "mass", value=repr(mass))
    rows = {
        "ixx": (0, 0),
        "ixy": (0, 1),
        "ixz": (0, 2),
        "iyy": (1, 1),
        "iyz": (1, 2),
        "izz": (2, 2),
    }
    SubElement(inertial, "inertia", {name: repr(float(tensor[at])) for name, at in rows.items()})
