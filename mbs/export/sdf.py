"""Export of mechanisms, including closed loops, as SDFormat robot files."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any
from xml.etree.ElementTree import Element, SubElement

import casadi
import numpy as np
from casadi import DM
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.assembly.khalil_frames import Cut
from mbs.assembly.tree import Link, zero_position
from mbs.components import (
    Fixed,
    Prismatic,
    Revolute,
    Spherical,
    Universal,
)
from mbs.components.joints import Motion
from mbs.errors import ModelError
from mbs.export.robot_files import shapes_left_out, system_of, write_xml
from mbs.export.urdf import Numbers, angles, inertia_of, inverse, limits_of, text_of
from mbs.formats.urdf.reader import UNLIMITED
from mbs.mechanism import Mechanism
from mbs.spatial.rotation import quaternion_rotation

Array = NDArray[np.float64]

_DOWN = (0.0, 0.0, -9.81)  # gravity [m/s^2] that SDF readers assume for a file without a world
_NAMESPACE = "http://drake.mit.edu"
_GROUND = "ground"
_TYPES = {
    Motion.REVOLUTE: "revolute",
    Motion.PRISMATIC: "prismatic",
    Motion.SPHERICAL: "ball",
}
_CLOSING = {
    Fixed: "fixed",
    Revolute: "revolute",
    Prismatic: "prismatic",
    Spherical: "ball",
    Universal: "universal",
}


def sdf(system: System | Mechanism, path: str | os.PathLike[str]) -> None:
    """Write a mechanism as an SDFormat file, symbols at their default values.

    Every link of the tree becomes a link with the name and frame of its first body and the total
    inertia of its bodies. Other bodies and named frames become frames. Joints that close loops are
    joints whose child link has a second parent. In an SDF file all joint positions are zero in the
    drawn configuration. Mechanisms with loops are drawn in `system.configuration`, and their joint
    positions are relative to it. Other mechanisms are drawn at zero positions. Free links start in
    `system.configuration`; `mbs.load` gives them the free joint `root_joint`. Couplings of degree
    one become mimics, and Ia becomes the rotor inertia of Drake. A joint without a motor has an
    effort limit of zero.

    Args:
        system: mechanism with revolute, prismatic, spherical and free motions. A Mechanism is
            assembled first.
        path: path of the .sdf file.

    Raises:
        ModelError: system has another type, rotors, force elements, a drive line, a free joint that
            is not on the world, couplings of a higher degree, or a loop closed by a joint other
            than fixed, revolute, prismatic, spherical or universal. A symbol has no value.
        ExportError: the file cannot be written.
    """
    system = system_of(system)
    _check(system)
    root = _SdfWriting(system, Numbers(system, "SDF")).file()
    write_xml(root, path, shapes_left_out(system))


def _refusal(system: System, what: str) -> ModelError:
    return ModelError(f"{system.name}: {what}, which SDF cannot say; take it away first")


def _check(system: System) -> None:
    """Raise ModelError if the format does not support a part of the system."""
    if system.parts or system.shafts:
        raise _refusal(system, "it has force elements or a drive line")
    for link in system.tree.links:
        if link.motion is Motion.FREE and link.antecedent >= 0:
            raise _refusal(system, f"{link.name} is a free joint that is not on the world")
        if link.rotor is not None:
            raise _refusal(system, f"{link.name} has a rotor with an axis of its own")
        acts = (link.Fv, link.Fs, link.Ia)
        if link.motion.nv > 1 and not all(value.is_zero() for value in acts):
            raise _refusal(system, f"{link.name} has friction or a rotor about several axes")
    _check_loops(system)


def _check_loops(system: System) -> None:
    driven = set()
    for coupling in system.couplings:
        if len(coupling.coefficients) > 2 or coupling.others:
            raise _refusal(system, f"{coupling.name} is not a line between two joints")
        if coupling.driven in driven:
            raise _refusal(system, f"{coupling.name} drives a joint that another coupling drives")
        driven.add(coupling.driven)
    for cut in system.cuts:
        joint = cut.edge.joint
        if not cut.welded and type(joint) not in _CLOSING:
            raise _refusal(system, f"a {type(joint).__name__} closes the loop at {joint.name}")


@dataclass(slots=True)
class _SdfWriting:
    """Writer of the XML elements of an SDF file.

    Attributes:
        system: mechanism to write.
        number: function that evaluates expressions at the default values of symbols.
        start: joint positions q (nq,) of the drawn configuration.
        frame: dict from link index (-1 for the world) to the name of the link in the file and the
            pose (4, 4) of its frame in the link frame of the tree.
        drawn: dict from link index to the pose (4, 4) of the link frame in the world, as drawn.
        joints: dict from the index of a joint position in q to the XML element of the joint.
        names: dict from names in the system to names in the file.
    """

    system: System
    number: Numbers
    start: Array = field(init=False)
    frame: dict[int, tuple[str, Array]] = field(default_factory=dict)
    drawn: dict[int, Array] = field(default_factory=dict)
    joints: dict[int, Element] = field(default_factory=dict)
    names: dict[str, str] = field(default_factory=dict)

    def file(self) -> Element:
        system = self.system
        self.start = np.array(system.configuration if system.cuts else zero_position(system.tree))
        for link in system.tree.links:
            if link.motion is Motion.FREE:
                self.start[link.q] = system.configuration[link.q]
        root = Element("sdf", {"version": "1.11", "xmlns:drake": _NAMESPACE})
        gravity = self.number(system.tree.gravity).ravel()
        place = root
        if not np.array_equal(gravity, _DOWN):
            place = SubElement(root, "world", name="default")
            _say(place, "gravity", text_of(gravity))
        model = SubElement(place, "model", name=self._name(system.name))
        self.names.clear()
        self.frame[-1], self.drawn[-1] = ("world", np.eye(4)), np.eye(4)
        frames_by_name = {
            name: (link, self.number(pose.matrix))
            for name, (link, pose) in system.frames.items()
            if name not in ("base", "world")
        }
        for j, link in enumerate(system.tree.links):
            self._add_link(model, j, link, frames_by_name)
        for cut in system.cuts:
            self._close(model, cut)
        self._couple()
        self._add_frames(model, frames_by_name)
        return root

    def _name(self, name: str) -> str:
        """Return the name in the file for a name of the system: valid and unique."""
        if name not in self.names:
            plain = name.replace("::", "_").replace(".", "_")
            while plain in self.names.values() or plain in ("world", "__model__"):
                plain += "_"
            self.names[name] = plain
        return self.names[name]

    def _unused_name(self, name: str) -> str:
        """Return a name in the file, based on `name`, that no part of the system has."""
        system = self.system
        while name in self.names or name in system.frames or name in self.names.values():
            name += "_"
        return self._name(name)

    # Links and the joints that move them.

    def _add_link(
        self, model: Element, j: int, link: Link, frames_by_name: Mapping[str, tuple[int, Array]]
    ) -> None:
        system = self.system
        bodies = [
            row.name for row in system.bodies if row.link == j + 1 and row.name in frames_by_name
        ]
        if bodies:
            name, pose = self._name(bodies[0]), frames_by_name[bodies[0]][1]
        else:
            name, pose = self._unused_name(f"{link.name.replace('.', '_')}_link"), np.eye(4)
        parent, before = self.frame[link.antecedent]
        relative = self.number(link.pose().matrix) @ self._motion(link)
        self.frame[j], self.drawn[j] = (name, pose), self.drawn[link.antecedent] @ relative
        element = SubElement(model, "link", name=name)
        above = {} if parent == "world" else {"relative_to": parent}
        _pose(element, inverse(before) @ relative @ pose, above)
        _inertial(element, *inertia_of(system.name, link, pose, self.number))
        if link.motion is Motion.FREE:
            return
        joint = _joint(model, self._name(link.name), _TYPES[link.motion], parent, name)
        _pose(joint, inverse(pose), {})
        if link.motion is Motion.SPHERICAL:
            return
        self.joints[link.q.start] = joint
        self._drive(joint, link)

    def _motion(self, link: Link) -> Array:
        """Return the joint displacement (4, 4) of a link in the drawn configuration."""
        T, q = np.eye(4), self.start[link.q]
        if link.motion is Motion.REVOLUTE:
            c, s = math.cos(q[0]), math.sin(q[0])
            T[:2, :2] = [[c, -s], [s, c]]
        elif link.motion is Motion.PRISMATIC:
            T[2, 3] = q[0]
        else:
            T[:3, :3] = np.array(DM(quaternion_rotation(casadi.SX(DM(q[-4:])))))
            if link.motion is Motion.FREE:
                T[:3, 3] = q[:3]
        return inverse(T) if link.backward else T

    def _drive(self, joint: Element, link: Link) -> None:
        """Append axis, dynamics, limits and motor of a revolute or prismatic joint."""
        system, zero = self.system, float(self.start[link.q.start])
        axis = SubElement(joint, "axis")
        _say(axis, "xyz", "0 0 1")
        dynamics = {
            "damping": link.Fv,
            "friction": link.Fs,
            "spring_reference": link.rest,
            "spring_stiffness": link.stiffness,
        }
        element = SubElement(axis, "dynamics")
        for tag, value in dynamics.items():
            said = float(self.number(value).item())
            _say(element, tag, said - zero if tag == "spring_reference" else said)
        limits, velocity, effort = limits_of(system, link, "SDF")
        self._limit(axis, limits, zero)
        limit = axis.find("limit")
        assert limit is not None
        motor = system.speeds[link.v.start].actuated
        for tag, most in (("effort", effort if motor else 0.0), ("velocity", velocity)):
            _say(limit, tag, math.inf if most >= UNLIMITED else most)
        Ia = float(self.number(link.Ia).item())
        if Ia:
            _say(joint, "drake:rotor_inertia", Ia)

    def _limit(self, axis: Element, limits: tuple[float, float] | None, zero: float) -> None:
        limit = SubElement(axis, "limit")
        for tag, value in zip(("lower", "upper"), limits or (-math.inf, math.inf), strict=True):
            _say(limit, tag, value - zero)

    # Loops, couplings, named frames.

    def _close(self, model: Element, cut: Cut) -> None:
        """Append a loop-closing joint, with position zero in the drawn configuration."""
        joint = cut.edge.joint
        ends = [(number, self.number(pose.matrix)) for number, pose in cut.frames]
        # the world cannot be the child link
        (a, at_a), (b, at_b) = ends if ends[1][0] >= 0 else ends[::-1]
        parent, child = self.frame[a][0], self.frame[b][0]
        kind = "fixed" if cut.welded else _CLOSING[type(joint)]
        name = self._unused_name(f"{joint.name}_weld") if cut.welded else self._name(joint.name)
        element = _joint(model, name, kind, parent, child)
        _pose(element, inverse(self.frame[b][1]) @ at_b, {})
        opening = inverse(self.drawn[a] @ at_a) @ self.drawn[b] @ at_b
        if cut.welded or kind in ("fixed", "ball"):
            if not cut.welded and joint.limits:
                raise _refusal(self.system, f"{joint.name} has limits")
        elif isinstance(joint, Universal):
            # the first axis is fixed on frame_a, the second on frame_b
            first, second = (np.array(axis, dtype=float) for axis in joint.axes)
            if ends[1][0] < 0:
                first, second = second, first
            if joint.limits:
                raise _refusal(self.system, f"{joint.name} has limits and closes a loop")
            _say(SubElement(element, "axis"), "xyz", text_of(opening[:3, :3].T @ first))
            _say(SubElement(element, "axis2"), "xyz", text_of(second))
        else:
            assert isinstance(joint, (Revolute, Prismatic))
            u = np.array(joint.axis, dtype=float)
            axis = SubElement(element, "axis")
            _say(axis, "xyz", text_of(u if ends[1][0] >= 0 else -u))
            if joint.limits:
                forward = opening if ends[1][0] >= 0 else inverse(opening)
                self._limit(axis, joint.limits[0][1], _position(forward, u, kind))
        simbody = SubElement(SubElement(element, "physics"), "simbody")
        _say(simbody, "must_be_loop_joint", "true")

    def _couple(self) -> None:
        for coupling in self.system.couplings:
            terms = [float(self.number(c).item()) for c in coupling.coefficients]
            offset, factor = (*terms, 0.0, 0.0)[:2]
            offset += factor * self.start[coupling.driver] - self.start[coupling.driven]
            axis = self.joints[coupling.driven].find("axis")
            assert axis is not None
            leader = self.joints[coupling.driver].get("name", "")
            mimic = SubElement(axis, "mimic", joint=leader, axis="axis")
            for tag, value in (("multiplier", factor), ("offset", offset), ("reference", 0.0)):
                _say(mimic, tag, value)

    def _add_frames(self, model: Element, frames_by_name: Mapping[str, tuple[int, Array]]) -> None:
        """Append frames for named frames and for the bodies that are not links of the file."""
        written = {name for name, _ in self.frame.values()}
        ground = ""
        for name, (number, pose) in frames_by_name.items():
            if self._name(name) in written:
                continue
            carrier, before = self.frame[number]
            if number < 0:  # a frame of a model can only be attached to the world through a link
                if not ground:
                    ground = self._unused_name(_GROUND)
                    _inertial(SubElement(model, "link", name=ground), 1.0, np.zeros(3), np.eye(3))
                    _joint(model, self._unused_name(f"{_GROUND}_joint"), "fixed", "world", ground)
                carrier = ground
            frame = SubElement(model, "frame", name=self._name(name), attached_to=carrier)
            _pose(frame, inverse(before) @ pose, {})


def _position(T: Array, axis: Array, kind: str) -> float:
    """Return the position of a revolute or prismatic joint from the pose T (4, 4) of its frames.

    axis: unit axis (3,) of the joint.
    """
    if kind == "prismatic":
        return float(axis @ T[:3, 3])
    R = T[:3, :3]
    twice = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    return math.atan2(float(twice @ axis), float(np.trace(R)) - 1)


def _say(element: Element, tag: str, value: Any) -> None:
    SubElement(element, tag).text = value if isinstance(value, str) else repr(float(value) + 0.0)


def _pose(element: Element, T: Array, attributes: dict[str, str]) -> None:
    pose = SubElement(element, "pose", attributes)
    pose.text = text_of([*T[:3, 3], *angles(T[:3, :3])])


def _joint(model: Element, name: str, kind: str, parent: str, child: str) -> Element:
    joint = SubElement(model, "joint", name=name, type=kind)
    _say(joint, "parent", parent)
    _say(joint, "child", child)
    return joint


def _inertial(link: Element, mass: float, com: Array, tensor: Array) -> None:
    inertial = SubElement(link, "inertial")
    _say(inertial, "pose", text_of([*com, 0.0, 0.0, 0.0]))
    _say(inertial, "mass", mass)
    inertia = SubElement(inertial, "inertia")
    for i, row in enumerate("xyz"):
        for k, column in enumerate("xyz"):
            if i <= k:
                _say(inertia, f"i{row}{column}", tensor[i, k])
