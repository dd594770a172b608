"""URDF robot files from mechanisms without loops."""

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
from mbs.formats.urdf import UNLIMITED
from mbs.mechanism import Mechanism
from mbs.text import listed, quoted

Array = NDArray[np.float64]

_ON_AXIS = 1e-14
"""How far a body may be from the axis that its joint is written on [m]: rounding, no more."""
_SAME = 1e-12
"""Difference of gravity [m/s^2] or of a transform [m] that is rounding, which is below 1e-14."""
_DOWN = (0.0, 0.0, -9.81)  # [m/s^2] what readers of URDF files suppose, which cannot say it


def urdf(system: System | Mechanism, path: str | os.PathLike[str]) -> None:
    """Write a mechanism without loops as a URDF file, symbols at their default values.

    Every body is a link of its name, every named frame a link without mass, and every motion a
    joint. Of bodies that are welded together one has the whole inertia. Couplings of degree one
    are mimics, rotor inertia Ia is that of a transmission of ratio one. Which joints have motors,
    the width of Coulomb friction and one-sided ranges of a motor the format cannot say; they are
    lost, the last are refused. A rotated mount makes the frame "outer_world" the world of the file.

    Args:
        system: of revolute, prismatic and free motions; a Mechanism is assembled first.
        path: of the .urdf file.

    Raises:
        ModelError: it is neither, it has loops, a spherical joint, springs, rotors, force elements
            or other gravity than 9.81 m/s^2 along -z, or a symbol has no value.
        ExportError: the file cannot be written.
    """
    system = system_of(system)
    _check(system)
    root = _Writing(system, Numbers(system, "URDF")).robot()
    write_xml(root, path, shapes_left_out(system))


class Numbers:
    """Numbers of a system, its symbols at their defaults.

    Args:
        system: that is written.
        file: its kind, for messages.
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
        """The numbers of an expression, as an array of its shape."""
        function = Function("value", [self.p], [casadi.densify(SX(value))])
        return np.array(function(self.values), dtype=float)


def _check(system: System) -> None:
    """Refuse what URDF cannot say."""

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
    """Writes the elements of one robot.

    Attributes:
        system: that is written.
        number: numbers of its expressions.
        frame: of each link (-1 for the world): its name, and its (4, 4) pose in that of the tree.
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
        """Make the world of the file the one in which the gravity of a mounted robot is given.

        Raises:
            ModelError: the robot has no mount that makes its gravity that of URDF, or it has a
                free joint, whose coordinates are relative to the base.
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
        """The rotor inertia of a joint, as that of a motor with the ratio 1."""
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
        """The frame of a link of the file: a body on the axis of its joint, or one of its own."""
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
        """A body or a named frame that is fixed on a link."""
        parent, before = self.frame[number]
        SubElement(root, "link", name=name)
        joint = SubElement(root, "joint", name=f"{name}_fixed", type="fixed")
        SubElement(joint, "parent", link=parent)
        SubElement(joint, "child", link=name)
        _origin(joint, inverse(before) @ pose)


def inertia_of(system: str, link: Link, pose: Array, number: Numbers) -> tuple[float, Array, Array]:
    """Mass, centre of mass, and inertia about it, in a frame on a link.

    Args:
        system: its name, for messages.
        link: that has the inertia.
        pose: (4, 4) of the frame, in that of the link.
        number: numbers of the system.
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
    """Range of the position, largest velocity and largest effort of the motion of a link.

    Args:
        system: that is written.
        link: of it.
        file: its kind, for messages.
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
    """Numbers that are read again to the last bit."""
    return " ".join(repr(float(value) + 0.0) for value in values)


def inverse(pose: Array) -> Array:
    """The (4, 4) transform of the other direction."""
    R, p = pose[:3, :3], pose[:3, 3]
    return np.block([[R.T, -(R.T @ p)[:, None]], [np.zeros((1, 3)), np.ones((1, 1))]])


def _origin(element: Element, pose: Array) -> None:
    SubElement(element, "origin", xyz=text_of(pose[:3, 3]), rpy=text_of(angles(pose[:3, :3])))


def angles(R: Array) -> tuple[float, float, float]:
    """Roll, pitch and yaw of a rotation, to the last digits also where the pitch is +-pi/2.

    Any yaw is right where the other two are taken for it.
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
