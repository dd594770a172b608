"""Writer of SDFormat robot files from tables of numbers, including closed loops."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass, field
from typing import Any
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from mbs.components import Fixed, Joint, Prismatic, Revolute, Spherical, Universal
from mbs.components.joints import Motion
from mbs.errors import ModelError
from mbs.formats.link_table import (
    Array,
    FileLink,
    FileLoop,
    LinkTable,
    Range,
    inertial_of,
    largest_of,
)
from mbs.formats.rotations import angles_of, inverse
from mbs.formats.sdf.shared import MODEL_GRAVITY, ROTOR_INERTIA
from mbs.formats.urdf.shared import MOMENTS, UNLIMITED
from mbs.formats.xml import text_of, write_xml

_NAMESPACE = "http://drake.mit.edu"
_GROUND = "ground"
_TYPES = {
    Motion.REVOLUTE: "revolute",
    Motion.PRISMATIC: "prismatic",
    Motion.SPHERICAL: "ball",
}
CLOSING: dict[type[Joint], str] = {
    Fixed: "fixed",
    Revolute: "revolute",
    Prismatic: "prismatic",
    Spherical: "ball",
    Universal: "universal",
}
"""Joints that may close a loop, and their types in the format."""


def write_sdf(table: LinkTable, path: str | os.PathLike[str], note: str = "") -> None:
    """Write a robot as an SDFormat file, with joint positions zero as drawn.

    Args:
        table: tables of the robot. The second place of a loop joint is not on the base.
        path: path of the .sdf file.
        note: text of a comment at the beginning of the file.

    Raises:
        ModelError: a link has first moments but no mass, a limit differs by direction, or a joint
            that closes a loop has limits which the format does not support.
        ExportError: the file cannot be written.
    """
    write_xml(_SdfWriter(table).file(), path, note)


def refusal(name: str, what: str) -> ModelError:
    """Return the error about a part of a robot that the SDF format does not support.

    Args:
        name: name of the robot.
        what: the part that is not supported.
    """
    return ModelError(f"{name}: {what}, which SDF cannot say; take it away first")


@dataclass(slots=True)
class _SdfWriter:
    """Writer of the XML elements of an SDF file.

    Attributes:
        table: tables of the robot.
        links: name of each link in the file, by index (-1 for the world).
        joints: XML element of each revolute or prismatic joint, by index of its position.
        names: names in the file, by name in the tables.
    """

    table: LinkTable
    links: dict[int, str] = field(default_factory=lambda: {-1: "world"})
    joints: dict[int, Element] = field(default_factory=dict)
    names: dict[str, str] = field(default_factory=dict)

    def file(self) -> Element:
        """Return the root element of the file; call it once.

        Raise a ModelError if the format does not support a part of the robot.
        """
        table = self.table
        root = Element("sdf", {"version": "1.11", "xmlns:drake": _NAMESPACE})
        place = root
        if not np.array_equal(table.gravity, MODEL_GRAVITY):
            place = SubElement(root, "world", name="default")
            _append(place, "gravity", text_of(table.gravity))
        model = SubElement(place, "model", name=self._name(table.name))
        self.names.clear()
        for j, link in enumerate(table.links):
            self._add_link(model, j, link)
        for loop in table.loops:
            self._close(model, loop)
        self._couple()
        self._add_frames(model)
        return root

    def _name(self, name: str) -> str:
        """Return the name in the file for a name of the tables: valid and unique."""
        if name not in self.names:
            plain = name.replace("::", "_").replace(".", "_")
            while plain in self.names.values() or plain in ("world", "__model__"):
                plain += "_"
            self.names[name] = plain
        return self.names[name]

    def _unused_name(self, name: str) -> str:
        """Return an unused name in the file: `name` with underscores appended if necessary."""
        known = {*self.table.frames, "base", "world"}
        while name in self.names or name in known or name in self.names.values():
            name += "_"
        return self._name(name)

    # Links and the joints that move them.

    def _add_link(self, model: Element, j: int, link: FileLink) -> None:
        """Append link j and the joint to its parent; free joints have no element in the format."""
        if link.body:
            name = self._name(link.body)
        else:
            name = self._unused_name(f"{link.name.replace('.', '_')}_link")
        self.links[j], parent = name, self.links[link.antecedent]
        element = SubElement(model, "link", name=name)
        above = {} if parent == "world" else {"relative_to": parent}
        _pose(element, link.placement, above)
        _inertial(element, *inertial_of(self.table, link))
        if link.motion is Motion.FREE:
            return
        joint = _joint(model, self._name(link.name), _TYPES[link.motion], parent, name)
        _pose(joint, link.joint_frame, {})
        if link.motion is Motion.SPHERICAL:
            return
        self.joints[link.position] = joint
        self._drive(joint, link)

    def _drive(self, joint: Element, link: FileLink) -> None:
        """Append axis, dynamics, limits and motor of a revolute or prismatic joint."""
        zero = float(self.table.drawn[link.position])
        axis = SubElement(joint, "axis")
        _append(axis, "xyz", "0 0 1")
        dynamics = {
            "damping": link.Fv,
            "friction": link.Fs,
            "spring_reference": link.rest - zero,
            "spring_stiffness": link.stiffness,
        }
        element = SubElement(axis, "dynamics")
        for tag, value in dynamics.items():
            _append(element, tag, value)
        velocity, effort = largest_of(self.table, link, "SDF", UNLIMITED)
        limit = self._limit(axis, link.limits, zero)
        for tag, most in (("effort", effort if link.actuated else 0.0), ("velocity", velocity)):
            _append(limit, tag, math.inf if most >= UNLIMITED else most)
        if link.Ia:
            _append(joint, ROTOR_INERTIA, link.Ia)

    def _limit(self, axis: Element, limits: Range | None, zero: float) -> Element:
        """Append <limit> with limits relative to the position `zero`, and return the element."""
        limit = SubElement(axis, "limit")
        for tag, value in zip(("lower", "upper"), limits or (-math.inf, math.inf), strict=True):
            _append(limit, tag, value - zero)
        return limit

    # Loops, couplings, named frames.

    def _close(self, model: Element, loop: FileLoop) -> None:
        """Append a loop-closing joint, with position zero in the drawn configuration."""
        joint, opening = loop.joint, loop.opening
        (((a, _), (b, at_b)),) = loop.ends
        kind = "fixed" if loop.welded else CLOSING[type(joint)]
        name = self._unused_name(f"{joint.name}_weld") if loop.welded else self._name(joint.name)
        element = _joint(model, name, kind, self.links[a], self.links[b])
        _pose(element, at_b, {})
        if loop.welded or kind in ("fixed", "ball"):
            if not loop.welded and joint.limits:
                raise refusal(self.table.name, f"{joint.name} has limits")
        elif isinstance(joint, Universal):
            # the first axis is fixed on frame_a, the second on frame_b
            first, second = (np.array(axis, dtype=float) for axis in joint.axes)
            if loop.turned:
                first, second = second, first
            if joint.limits:
                raise refusal(self.table.name, f"{joint.name} has limits and closes a loop")
            _append(SubElement(element, "axis"), "xyz", text_of(opening[:3, :3].T @ first))
            _append(SubElement(element, "axis2"), "xyz", text_of(second))
        else:
            assert isinstance(joint, (Revolute, Prismatic))
            u = np.array(joint.axis, dtype=float)
            axis = SubElement(element, "axis")
            _append(axis, "xyz", text_of(-u if loop.turned else u))
            if joint.limits:
                forward = inverse(opening) if loop.turned else opening
                self._limit(axis, joint.limits[0][1], _position(forward, u, kind))
        simbody = SubElement(SubElement(element, "physics"), "simbody")
        _append(simbody, "must_be_loop_joint", "true")

    def _couple(self) -> None:
        """Append the couplings as mimics of the driven joints, for positions zero as drawn."""
        drawn = self.table.drawn
        for coupling in self.table.couplings:
            offset, factor = (*coupling.coefficients, 0.0, 0.0)[:2]
            offset += factor * drawn[coupling.driver] - drawn[coupling.driven]
            axis = self.joints[coupling.driven].find("axis")
            assert axis is not None
            leader = self.joints[coupling.driver].get("name", "")
            mimic = SubElement(axis, "mimic", joint=leader, axis="axis")
            for tag, value in (("multiplier", factor), ("offset", offset), ("reference", 0.0)):
                _append(mimic, tag, value)

    def _add_frames(self, model: Element) -> None:
        """Append frames for named frames and for the bodies that are not links of the file."""
        written = set(self.links.values())
        ground = ""
        for frame in self.table.frames.values():
            if self._name(frame.name) in written:
                continue
            carrier = self.links[frame.link]
            if frame.link < 0:  # a frame of a model is attached to the world through a link
                if not ground:
                    ground = self._unused_name(_GROUND)
                    _inertial(SubElement(model, "link", name=ground), 1.0, np.zeros(3), np.eye(3))
                    _joint(model, self._unused_name(f"{_GROUND}_joint"), "fixed", "world", ground)
                carrier = ground
            element = SubElement(model, "frame", name=self._name(frame.name), attached_to=carrier)
            _pose(element, frame.pose, {})


def _position(T: Array, axis: Array, kind: str) -> float:
    """Return the position of a revolute [rad] or prismatic [m] joint.

    Args:
        T: (4, 4) pose of the second frame of the joint relative to the first.
        axis: unit axis (3,) of the joint.
        kind: "prismatic", or another text for a revolute joint.
    """
    if kind == "prismatic":
        return float(axis @ T[:3, 3])
    R = T[:3, :3]
    twice = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    return math.atan2(float(twice @ axis), float(np.trace(R)) - 1)


def _append(element: Element, tag: str, value: Any) -> None:
    """Append a child element `tag` with a text or number."""
    SubElement(element, tag).text = value if isinstance(value, str) else repr(float(value) + 0.0)


def _pose(element: Element, T: Array, attributes: dict[str, str]) -> None:
    """Append <pose> of a transform T (4, 4) with XML attributes."""
    pose = SubElement(element, "pose", attributes)
    pose.text = text_of([*T[:3, 3], *angles_of(T[:3, :3])])


def _joint(model: Element, name: str, kind: str, parent: str, child: str) -> Element:
    """Append <joint> with a name and type (`kind`) between a parent and a child link; return it."""
    joint = SubElement(model, "joint", name=name, type=kind)
    _append(joint, "parent", parent)
    _append(joint, "child", child)
    return joint


def _inertial(link: Element, mass: float, com: Array, tensor: Array) -> None:
    """Append <inertial> to a link.

    `mass` in [kg], centre of mass `com` (3,) in [m], and inertia `tensor` (3, 3) about it in [kg
    m^2], all in the link frame.
    """
    inertial = SubElement(link, "inertial")
    _append(inertial, "pose", text_of([*com, 0.0, 0.0, 0.0]))
    _append(inertial, "mass", mass)
    inertia = SubElement(inertial, "inertia")
    for name, at in MOMENTS.items():
        _append(inertia, name, tensor[at])
