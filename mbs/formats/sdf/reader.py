"""Reader of SDFormat robot files (.sdf, .world), including closed loops.

Versions 1.4 to 1.12. The reader uses the elements that affect the motion: links, inertials, frames,
joints, and their limits, friction, springs, gears and mimics. Incomplete or invalid data are read
as far as possible, with a note in the mechanism. Unsupported elements that would change the motion
raise an error.

Source: the specification at sdformat.org; rotor inertias and joints without motors as in Drake.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import islice
from pathlib import Path
from typing import NoReturn
from xml.etree.ElementTree import Element

import numpy as np
from numpy.typing import NDArray

from mbs.components import (
    Body,
    Coupling,
    Fixed,
    Force,
    Free,
    Joint,
    Point,
    Prismatic,
    Revolute,
    Screw,
    Spherical,
    Universal,
)
from mbs.components.component import component_name
from mbs.components.locking import FREE_JOINT, Base
from mbs.errors import DescriptionError
from mbs.formats.files import Notes
from mbs.formats.rotations import inverse, matrix_of_angles, quaternion_of, transform
from mbs.formats.sdf.shared import MODEL_GRAVITY, ROTOR_INERTIA
from mbs.formats.urdf.reader import (
    Inertial,
    Reader,
    UniqueNames,
    Vector,
    body_of,
    limits_of,
    not_negative,
    robot_name,
)
from mbs.formats.xml import line_of, parse_xml
from mbs.mechanism import Mechanism
from mbs.text import did_you_mean, quoted

Array = NDArray[np.float64]

UNLIMITED = 1e16
"""Magnitude from which a limit counts as infinite: the largest value in versions without
infinity."""

WORLD_GRAVITY = (0.0, 0.0, -9.8)
"""Default gravity of a world [m/s^2]. A model without a world has the default gravity of mbs."""

_NEWEST = (1, 12)
_OLDEST = (1, 4)
_SAME = 1e-15
"""Difference between a rotation matrix and the identity that is a rounding error of one product."""
_SHORT = 16
"""Maximum number of frame transforms that are multiplied directly. Longer chains go through the
world frame, so that the time is linear in the size of the file."""
_PARALLEL = 1e-6
"""Tolerance of parallel and perpendicular unit vectors: axes of gears and universal joints are
written with six digits or more."""


# Numbers and words of elements, stored as texts of child elements.


@dataclass(frozen=True, slots=True)
class SdfReader(Reader):
    """Reader of the numbers and words in child elements of one SDF element, with notes about it."""

    def values(self, parent: Element | None, tag: str, default: Vector) -> Vector:
        """Return the numbers in a child element, or the default if it is missing or empty.

        Args:
            parent: element that contains the child element; None counts as empty.
            tag: name of the child element.
            default: values by default, which give the required number of values.

        Raises:
            DescriptionError: the element has another number of values, or a value is not a number.
        """
        element = None if parent is None else parent.find(tag)
        text = "" if element is None else (element.text or "").strip()
        return self.numbers(element, tag, text, len(default)) if text else default

    def value(self, parent: Element | None, tag: str, default: float) -> float:
        """Return the number in a child element, or the default if it is missing or empty.

        Args:
            parent: element that contains the child element; None counts as empty.
            tag: name of the child element.
            default: value by default.

        Raises:
            DescriptionError: the text is not a number.
        """
        return self.values(parent, tag, (default,))[0]

    def limit(self, parent: Element | None, tag: str, default: float) -> float:
        """Return a number that may be NaN or infinite, or the default if it is missing or empty.

        Magnitudes from `UNLIMITED` (1e16) count as infinite.

        Args:
            parent: element that contains the child element; None counts as empty.
            tag: name of the child element.
            default: value by default.

        Raises:
            DescriptionError: the text is not a number.
        """
        element = None if parent is None else parent.find(tag)
        text = "" if element is None else (element.text or "").strip()
        if not text:
            return default
        try:
            value = float(text)
        except ValueError:
            value = self.numbers(element, tag, text, 1, math.inf)[0]
        return value if not abs(value) >= UNLIMITED else math.copysign(math.inf, value)

    def flag(self, parent: Element | None, tag: str, default: bool = False) -> bool:
        """Return the truth value of a child element, or the default if it is missing or empty.

        Args:
            parent: element that contains the child element; None counts as empty.
            tag: name of the child element.
            default: value by default.

        Raises:
            DescriptionError: the text is not true, false, 1 or 0.
        """
        word = self.word(parent, tag).lower()
        if word in ("true", "1"):
            return True
        if word in ("false", "0"):
            return False
        if word:
            self.fail(f"{tag} is {quoted(word)}; write true or false")
        return default

    def word(self, parent: Element | None, tag: str) -> str:
        """Return the text of a child element; empty if there is none.

        Args:
            parent: element that contains the child element; None counts as empty.
            tag: name of the child element.
        """
        element = None if parent is None else parent.find(tag)
        return "" if element is None else (element.text or "").strip()

    def pose(self, element: Element) -> tuple[str, Array]:
        """Return the reference frame and the matrix (4, 4) of the <pose> of an element.

        The name of the reference frame is "" if it is not given. Without a <pose>, the matrix is
        the identity.

        Args:
            element: element that contains <pose>.

        Raises:
            DescriptionError: the format of the rotation is unknown, or a number cannot be read.
        """
        pose = element.find("pose")
        if pose is None:
            return "", np.eye(4)
        form = pose.get("rotation_format", "euler_rpy")
        if form not in ("euler_rpy", "quat_xyzw"):
            self.fail(f"rotation_format is {quoted(form)}; write euler_rpy or quat_xyzw")
        count = 6 if form == "euler_rpy" else 7
        text = (pose.text or "").strip()
        numbers = self.numbers(pose, "pose", text, count) if text else (*(0.0,) * (count - 1), 1.0)
        if form == "euler_rpy":
            angles = numbers[3:] if text else (0.0, 0.0, 0.0)
            if pose.get("degrees", "false").strip().lower() in ("true", "1"):
                angles = tuple(map(math.radians, angles))
            R = matrix_of_angles(*angles)
        else:
            R = self._of_quaternion(numbers[3:])
        relative = pose.get("relative_to", pose.get("frame", "")).strip()
        return relative, transform(R, numbers[:3])

    def _of_quaternion(self, quaternion: Vector) -> Array:
        """Return the rotation matrix (3, 3) of a quaternion (x, y, z, w).

        Raise a DescriptionError if its length differs from 1 by more than 1e-3.
        """
        x, y, z, w = quaternion
        # 1e-3: quaternions are written with four digits or more
        if not abs(math.hypot(*quaternion) - 1) < 1e-3:
            self.fail(f"its quaternion {quoted(list(quaternion))} has not length 1; normalise it")
        v, n = np.array([x, y, z]), x * x + y * y + z * z + w * w
        K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        return np.array(np.eye(3) * (w * w - v @ v) + 2 * np.outer(v, v) + 2 * w * K) / n


# Frames of a file, each placed relative to another frame.


@dataclass(slots=True)
class _Frames:
    """Poses of frames by their full names. Links, joints, frames and models each have a frame.

    Attributes:
        path: path of the file.
        places: reference frame of each frame, and its pose (4, 4) relative to the reference frame.
        attached: for each frame that is not a link, the frame or link to which it is rigidly
            attached.
        known: cache of poses in the world.
    """

    path: str
    places: dict[str, tuple[str, Array]] = field(default_factory=dict)
    attached: dict[str, str] = field(default_factory=dict)
    known: dict[str, Array] = field(default_factory=lambda: {"world": np.eye(4)})

    def in_world(self, frame: str) -> Array:
        """Return the pose (4, 4) of a frame in the world.

        Raise a DescriptionError for cyclic references.
        """
        chain, met = [frame], {frame}
        while chain[-1] not in self.known:
            before = self.places[chain[-1]][0]
            if before in met:
                self._cycle(before, "placed in")
            chain.append(before)
            met.add(before)
        T = self.known[chain.pop()]
        for name in reversed(chain):
            T = self.known[name] = T @ self.places[name][1]
        return T

    def relative_pose(self, other: str, frame: str) -> Array:
        """Return the pose (4, 4) of a frame relative to another frame.

        It is the exact product of poses if the frame is placed in the other frame.
        """
        wanted = self.in_world(frame)  # raises an error if there is a cycle
        T, name = np.eye(4), frame
        for _ in range(_SHORT):
            if name in (other, "world"):
                break
            name, step = self.places[name]
            T = step @ T
        return T if name == other else inverse(self.in_world(other)) @ wanted

    def carrier(self, frame: str) -> str:
        """Return the name of the link to which a frame is rigidly attached, or "world".

        Raise a DescriptionError for cyclic references.
        """
        name, met = frame, set[str]()
        while name in self.attached:
            if name in met:
                self._cycle(name, "attached to")
            met.add(name)
            name = self.attached[name]
        self.attached.update(dict.fromkeys(met, name))  # long chains are followed once
        return name

    def _cycle(self, name: str, how: str) -> NoReturn:
        """Raise a DescriptionError: frame `name` is placed in, or attached to (`how`), itself."""
        raise DescriptionError(
            f"{self.path}: frame {quoted(name)} is {how} itself through others; break the cycle"
        )


# Elements of a model and of its nested models.


@dataclass(frozen=True, slots=True)
class _Scope:
    """Model in which names are resolved (scope of names).

    Attributes:
        key: full name of the frame of the model.
        prefix: prefix of the full names of its elements, such as "arm::".
    """

    key: str
    prefix: str


@dataclass(frozen=True, slots=True)
class _Part:
    """Link, joint or frame of a model.

    Attributes:
        key: unique key of its frame; differs from the name for some joints of old files.
        name: full name of the element, with the names of enclosing models.
        scope: model that contains it.
        element: XML element.
    """

    key: str
    name: str
    scope: _Scope
    element: Element


_ONE_AXIS = ("revolute", "continuous", "prismatic")
_KINDS = (*_ONE_AXIS, "ball", "universal", "revolute2", "screw", "gearbox", "fixed")
_SILENT: Mapping[str, set[str]] = {
    "world": {
        *("gravity", "model", "frame", "physics", "scene", "light", "gui"),
        *("atmosphere", "magnetic_field", "audio", "road"),
        *("spherical_coordinates", "wind", "joint", "include"),
    },
    "model": {
        *("link", "joint", "frame", "model", "pose", "static", "self_collide"),
        *("allow_auto_disable", "enable_wind", "include", "gripper"),
    },
    "link": {
        *("inertial", "pose", "visual", "collision", "sensor", "light"),
        *("audio_source", "audio_sink", "projector", "gravity", "self_collide"),
        *("enable_wind", "kinematic", "velocity_decay", "must_be_base_link"),
        *("particle_emitter", "battery"),
    },
    "joint": {
        *("parent", "child", "pose", "axis", "axis2", "physics", "sensor"),
        *("gearbox_ratio", "gearbox_reference_body", "thread_pitch"),
        *("screw_thread_pitch", ROTOR_INERTIA, "drake:gear_ratio"),
    },
    "frame": {"pose"},
}
"""Elements that are read, have a note of their own, or have no effect on the equations."""

_LONGEST_NOTE = 8
"""Maximum number of link names in one note. Further names are counted, since some files have
hundreds."""

_MOVING = {
    *("joint", "mimic", "ball_constraint", "distance_constraint"),
    *("linear_bushing_rpy", "linear_spring_damper", "prismatic_spring"),
    *("tendon_constraint",),
}
"""Elements of other tools (without prefix) that would change the motion."""


@dataclass(slots=True)
class _SdfFile:
    """Parsed content of a file, before the mechanism is built.

    Attributes:
        notes: notes of the file.
        version: version of the format, such as (1, 7).
        frames: frames of links, joints, frames and models.
        links, joints, named: links, joints and named frames, by the keys of their frames.
        scopes: elements of each model, by the key of the model.
    """

    notes: Notes
    version: tuple[int, ...]
    frames: _Frames
    links: dict[str, _Part] = field(default_factory=dict)
    joints: dict[str, _Part] = field(default_factory=dict)
    named: dict[str, _Part] = field(default_factory=dict)
    scopes: dict[str, list[_Part]] = field(default_factory=dict)

    def reader(self, part: _Part) -> SdfReader:
        """Return a reader of the numbers of a link, joint or frame."""
        return SdfReader(f"{part.element.tag} {quoted(part.name)}", part.element, self.notes)

    def add_model(self, element: Element, name: str, outer: _Scope | None) -> None:
        """Register links, joints and frames of a model and its nested models, without poses.

        Args:
            element: XML element of the model.
            name: full name of the model.
            outer: model that contains it; None for the outermost model.

        Raises:
            DescriptionError: a name is missing or used twice, or an unsupported element changes the
                motion.
        """
        prefix = "" if outer is None else f"{name}::"
        scope = _Scope("__model__" if outer is None else name, prefix)
        reader = SdfReader(f"model {quoted(name)}", element, self.notes)
        self._note_unread(reader)
        if outer is not None and reader.flag(element, "static"):
            reader.fail("a model in a model is static; give joints to the world instead")
        self.frames.places[scope.key] = "", np.eye(4)
        before = len(self.links)
        self.scopes[scope.key] = []
        for tag, parts in (("link", self.links), ("joint", self.joints), ("frame", self.named)):
            for child in element.findall(tag):
                self._add(child, scope, parts)
        for child in element.findall("model"):
            inner = self._name(child)
            if prefix + inner in self.frames.places:
                reader.fail(f"two parts are named {quoted(inner)}; rename one")
            self.add_model(child, prefix + inner, scope)
        first = next(islice(self.links, before, None), "world")
        canonical = element.get("canonical_link", "").strip()
        self.frames.attached[scope.key] = (
            self.resolved(reader, scope, canonical, "canonical_link") if canonical else first
        )

    def place_model(self, element: Element, name: str, outer: _Scope | None) -> None:
        """Set the poses of a model, its parts and nested models, after all names are registered.

        Args:
            element: XML element of the model.
            name: full name of the model.
            outer: model that contains it; None for the outermost model.

        Raises:
            DescriptionError: a pose cannot be read or refers to an unknown frame.
        """
        reader = SdfReader(f"model {quoted(name)}", element, self.notes)
        scope = _Scope("__model__", "") if outer is None else _Scope(name, f"{name}::")
        relative, T = reader.pose(element)
        if outer is not None:
            reference = self.resolved(reader, outer, relative or "__model__", "relative_to")
        elif relative in ("", "world", "__root__"):
            reference = "world"
        else:
            reference = f"world::{relative}"
            if reference not in self.frames.places:
                reader.fail(f"relative_to is {quoted(relative)}, a frame that the world has not")
        self.frames.places[scope.key] = reference, T
        for part in self.scopes[scope.key]:
            self._place(part)
        for child in element.findall("model"):
            self.place_model(child, scope.prefix + self._name(child), scope)
        if outer is None:
            self._apply_placement_frames(element, name, scope)

    def _apply_placement_frames(self, element: Element, name: str, scope: _Scope) -> None:
        """Set the poses of models with a placement_frame, which is a frame inside the model.

        Nested models are placed first. `name` is the full name of the model, `scope` its scope of
        names.
        """
        for child in element.findall("model"):
            inner = scope.prefix + self._name(child)
            self._apply_placement_frames(child, inner, _Scope(inner, f"{inner}::"))
        placement = element.get("placement_frame", "").strip()
        if placement:
            reader = SdfReader(f"model {quoted(name)}", element, self.notes)
            at = self.resolved(reader, scope, placement, "placement_frame")
            reference, T = self.frames.places[scope.key]
            T = T @ inverse(self.frames.relative_pose(scope.key, at))
            self.frames.places[scope.key] = reference, T
            self.frames.known = {"world": np.eye(4)}

    def cuts(self, joint: _Part) -> bool:
        """Whether the file requires that a loop is cut at this joint (must_be_loop_joint)."""
        simbody = joint.element.find("physics/simbody")
        return simbody is not None and self.reader(joint).flag(simbody, "must_be_loop_joint")

    def resolved(self, reader: SdfReader, scope: _Scope, name: str, what: str) -> str:
        """Return the full name of a frame that an element refers to.

        Args:
            reader: reader of the element.
            scope: model that contains the element.
            name: name of the frame in the file.
            what: attribute or child element that contains the name, such as "relative_to".

        Raises:
            DescriptionError: there is no such frame.
        """
        if name == "__model__":
            return scope.key
        if name == "world" and what in ("parent", "child", "gearbox_reference_body"):
            return name
        full = scope.prefix + name
        if full not in self.frames.places or not name:
            inside = (k for k in self.frames.places if k.startswith(scope.prefix))
            near = did_you_mean(name, (k[len(scope.prefix) :] for k in inside))
            reader.fail(f"{what} is {quoted(name)}, which does not exist; {near}")
        return full

    def _name(self, element: Element) -> str:
        """Return the name of an element; raise a DescriptionError if it is empty or "world"."""
        name = (element.get("name") or "").strip()
        if not name or name == "world":
            raise DescriptionError(
                f"{self.notes.path}: line {line_of(element)}: a <{element.tag}> is named"
                f" {quoted(name)}; give it a name of its own"
            )
        return name

    def _add(self, element: Element, scope: _Scope, parts: dict[str, _Part]) -> None:
        """Register a link, joint or frame of the model `scope` in `parts`.

        Raise a DescriptionError if its name is missing or used.
        """
        name = scope.prefix + self._name(element)
        key = name
        if parts is self.joints and name in self.links and self.version < (1, 7):
            key = f"joint {name}"  # before version 1.7, a link and a joint may have the same name
        if key in self.frames.places:
            raise DescriptionError(
                f"{self.notes.path}: line {line_of(element)}: {element.tag} {quoted(name)}: another"
                " part of the model has this name; rename one"
            )
        parts[key] = _Part(key, name, scope, element)
        self.scopes[scope.key].append(parts[key])
        self.frames.places[key] = "", np.eye(4)
        self._note_unread(self.reader(parts[key]))

    def _place(self, part: _Part) -> None:
        """Set the pose of a link, joint or frame, and the frame to which it is attached."""
        reader, scope = self.reader(part), part.scope
        default = scope.key
        if part.key in self.joints:
            default = self.resolved(reader, scope, reader.word(part.element, "child"), "child")
            self.frames.attached[part.key] = default
        elif part.key in self.named:
            to = part.element.get("attached_to", "").strip()
            default = self.resolved(reader, scope, to, "attached_to") if to else scope.key
            self.frames.attached[part.key] = default
        relative, T = reader.pose(part.element)
        if relative:
            default = self.resolved(reader, scope, relative, "relative_to")
        self.frames.places[part.key] = default, T

    def _note_unread(self, reader: SdfReader) -> None:
        """Add notes about unknown child elements.

        Raise a DescriptionError if one changes the motion.
        """
        tag = reader.element.tag
        for child in reader.element:
            if child.tag in _SILENT[tag]:
                continue
            prefix, _, local = child.tag.rpartition(":")
            said = quoted(child.tag)[1:-1]
            if prefix and local in _MOVING:
                reader.fail(f"<{said}> would change the motion and is not read; take it out")
            text = f"<{said}> is not read"
            if child.tag == "plugin":
                text = "a <plugin> is not read; what it does is missing here"
            reader.note("ignored", text, child)


# Construction of the mechanism.


@dataclass(slots=True)
class _SdfBuilder:
    """Builder of a mechanism from the links and joints of a file.

    Attributes:
        mechanism: mechanism under construction.
        file: parsed content of the file.
        base: "free", "fixed" or None, as for `read_sdf`.
        static: whether all links are fixed to the world.
        gravity: acceleration of gravity [m/s^2].
        names: names of the components.
        points: frame of each link and of the world, by full name.
        coordinates: names of joint coordinates, by joint and "axis" or "axis2".
        kept: parent and child link of each joint of the mechanism, by joint.
        between: joints that connect two links, by the set of the two links.
    """

    mechanism: Mechanism
    file: _SdfFile
    base: Base | None
    static: bool
    gravity: Vector
    names: UniqueNames
    points: dict[str, Point] = field(default_factory=dict)
    coordinates: dict[tuple[str, str], str] = field(default_factory=dict)
    kept: dict[str, tuple[str, str]] = field(default_factory=dict)
    between: dict[frozenset[str], list[str]] = field(default_factory=dict)

    def build(self) -> None:
        """Add all bodies, joints, couplings, frames and start positions to the mechanism.

        Raise a DescriptionError if a part of the file is invalid or not supported.
        """
        file, mechanism = self.file, self.mechanism
        self.points["world"] = mechanism.world.frame
        groups = self._groups()
        joints = [file.joints[key] for key in self.kept]
        named = {
            joint.key: self._name(joint, "joint")
            for joint in joints
            if self._kind(joint) not in ("fixed", "gearbox") or groups.closes(joint.key)
        }
        for key, link in file.links.items():
            self.points[key] = self._body(link).frame
        self._add_roots(groups)
        for joint in joints:
            self._connect(joint, named.get(joint.key, ""), groups.closes(joint.key))
        for (key, tag), coordinate in self.coordinates.items():
            joint = file.joints[key]
            start = file.reader(joint).value(joint.element.find(tag), "initial_position", 0.0)
            if start:
                mechanism.guess[coordinate] = start
        for joint in joints:
            if self._kind(joint) == "gearbox":
                self._add_gears(joint)
            for tag in ("axis", "axis2"):
                self._add_mimic(joint, tag)
        for key, frame in file.named.items():
            carrier = file.frames.carrier(key)
            pose = file.frames.relative_pose(carrier, key)
            mechanism.add_frame(self._name(frame, "frame"), _at(self.points[carrier], pose))

    def _name(self, part: _Part, suffix: str) -> str:
        """Return a valid and unique component name for a part, with a note if it is changed.

        `suffix` is appended to a name that is already used.
        """
        why = "another part, the world or the base of all models has this name"
        return self.names.assign(self.file.reader(part), part.name, suffix, why)

    def _unused(self, name: str) -> str:
        """Return `name` with underscores appended until it is unused, and mark it as used."""
        while name in self.names.taken or name in self.names.wanted:
            name += "_"
        self.names.taken.add(name)
        return name

    def _kind(self, joint: _Part) -> str:
        """Return the type of a joint; raise a DescriptionError if it is unknown."""
        kind = joint.element.get("type", "").strip()
        if kind not in _KINDS:
            reader = self.file.reader(joint)
            reader.fail(f"type {quoted(kind)} is unknown; {did_you_mean(kind, _KINDS)}")
        return kind

    # Connected groups of links, and their connection to the world.

    def _groups(self) -> _Groups:
        """Return the groups of connected links, and record the links of each joint in `kept`.

        Fixed joints are processed first and joints marked as loop joints last; the remaining joints
        that connect links of one group close loops. Raise a DescriptionError if a joint refers to
        an unknown link or connects a link with itself.
        """
        file = self.file
        groups = _Groups({key: key for key in ("world", *file.links)})
        fixed: list[_Part] = []
        moving: list[_Part] = []
        last: list[_Part] = []
        for joint in file.joints.values():
            reader = file.reader(joint)
            ends: list[str] = []
            for side in ("parent", "child"):
                name = reader.word(joint.element, side)
                ends.append(file.frames.carrier(file.resolved(reader, joint.scope, name, side)))
            kind = self._kind(joint)
            if ends[0] == ends[1]:
                reader.fail("its parent and its child are one link; connect two")
            if self.static or (self.base == "free" and kind == "fixed" and "world" in ends):
                continue
            self.kept[joint.key] = ends[0], ends[1]
            self.between.setdefault(frozenset(ends), []).append(joint.key)
            if kind != "gearbox":
                (fixed if kind == "fixed" else moving).append(joint)
        # joints that the file marks as loop joints come last
        for joint in (*fixed, *moving):
            if file.cuts(joint):
                last.append(joint)
            else:
                groups.join(joint.key, *self.kept[joint.key])
        for joint in last:
            groups.join(joint.key, *self.kept[joint.key])
        return groups

    def _add_roots(self, groups: _Groups) -> None:
        """Connect each group of links without a joint to the world by a free or fixed joint."""
        file, mechanism = self.file, self.mechanism
        children = {child for _, child in self.kept.values()}
        canonical = file.frames.carrier("__model__")
        found: dict[str, list[str]] = {}
        number = 1
        for key in file.links:
            found.setdefault(groups.root(key), []).append(key)
        for root, links in found.items():
            if root == groups.root("world"):
                continue
            tops = [key for key in links if key not in children] or links
            top = canonical if canonical in links else tops[0]
            T = file.frames.in_world(top)
            if self.static or self.base == "fixed":
                mechanism.connect(_at(mechanism.world.frame, T), self.points[top])
                continue
            name = f"{FREE_JOINT}{number}" if number > 1 else FREE_JOINT
            while name in self.names.taken or name in self.names.wanted:
                number += 1
                name = f"{FREE_JOINT}{number}"
            self.names.taken.add(name)
            mechanism.connect(mechanism.world, Free(name, actuated=False), self.points[top])
            drawn = [*T[:3, 3], *quaternion_of(T[:3, :3])]
            suffixes = ("x", "y", "z", "qw", "qx", "qy", "qz")
            mechanism.guess |= {
                f"{name}.{k}": float(v) for k, v in zip(suffixes, drawn, strict=True)
            }

    # Bodies.

    def _body(self, link: _Part) -> Body:
        """Add the body of a link, and a force against gravity if the file disables gravity for it.

        Raise a DescriptionError if the link is kinematic or has a velocity decay.
        """
        reader, element = self.file.reader(link), link.element
        if reader.flag(element, "kinematic"):
            reader.fail("it is kinematic, moved from outside; take <kinematic> out")
        decay = element.find("velocity_decay")
        if decay is not None and (
            reader.value(decay, "linear", 0) or reader.value(decay, "angular", 0)
        ):
            reader.fail("its velocity_decay is not read; give damping to its joint instead")
        inertial = self._inertial(reader, element.find("inertial"))
        name = self._name(link, "link")
        body = self.mechanism.add(body_of(reader, name, inertial, element.find("inertial")))
        if not reader.flag(element, "gravity", True) and inertial.mass:
            weight = tuple(-inertial.mass * g for g in self.gravity)
            if any(weight):
                own = self._unused(f"{name}_gravity")
                self.mechanism.add(Force(own, body.at(*inertial.com), force=weight))
        return body

    def _inertial(self, reader: SdfReader, inertial: Element | None) -> Inertial:
        """Return mass and inertia of a link; missing values are 1 kg and 1 kg m^2, with a note.

        `inertial` is its XML element. Raise a DescriptionError if it needs shapes or fluids.
        """
        if inertial is None:
            text = "it has no <inertial>; of 1 kg and 1 kg m^2, as the format has it"
            reader.note("completed", text)
            return Inertial(1.0, (0.0, 0.0, 0.0), np.eye(3).tolist())
        if inertial.get("auto", "false").strip().lower() in ("true", "1"):
            reader.fail("its inertia is to be computed from its collisions; write it in numbers")
        if inertial.find("fluid_added_mass") is not None:
            reader.fail("it has fluid_added_mass, which mbs does not model; take it out")
        inertia = inertial.find("inertia")
        moments = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
        missing = [tag for tag in moments[:3] if not reader.word(inertia, tag)]
        missing += [] if reader.word(inertial, "mass") else ["mass"]
        if missing:
            text = f"its inertial has no {', '.join(missing)}; taken as 1, as the format has it"
            reader.note("completed", text, inertial)
        Ixx, Iyy, Izz = (reader.value(inertia, tag, 1.0) for tag in moments[:3])
        Ixy, Ixz, Iyz = (reader.value(inertia, tag, 0.0) for tag in moments[3:])
        relative, T = reader.pose(inertial)
        if relative:
            reader.fail(
                "the pose of its inertial is relative to another frame; give it in the link"
            )
        R = T[:3, :3]
        J = R @ np.array([[Ixx, Ixy, Ixz], [Ixy, Iyy, Iyz], [Ixz, Iyz, Izz]]) @ R.T
        com = tuple(float(x) for x in T[:3, 3])
        return Inertial(reader.value(inertial, "mass", 1.0), com, ((J + J.T) / 2).tolist())

    # Joints.

    def _connect(self, joint: _Part, name: str, closes: bool) -> None:
        """Connect the links of a joint by a component `name`, and cut loops there if required.

        `closes` is True if the joint closes a loop. A fixed joint without a name becomes a rigid
        connection.
        """
        kind, reader = self._kind(joint), self.file.reader(joint)
        if kind == "gearbox":
            return
        a, b = (
            _at(self.points[end], self.file.frames.relative_pose(end, joint.key))
            for end in self.kept[joint.key]
        )
        connect = self.mechanism.connect
        if kind == "fixed" and not name:
            connect(a, b)
        elif kind in ("fixed", "ball", *_ONE_AXIS):
            made: Joint = Fixed(name) if kind == "fixed" else Spherical(name)
            if kind in _ONE_AXIS:
                made = self._one_axis(joint, reader, name, kind)
                self.coordinates[joint.key, "axis"] = name
            connect(a, made, b)
            if closes and (kind == "fixed" or self.file.cuts(joint)):
                self.mechanism.cut(made)
        elif kind == "screw":
            between = self.mechanism.add(Body(self._unused(f"{name}_nut"), mass=0))
            turn = self._one_axis(joint, reader, name, "revolute")
            slide = Prismatic(self._unused(f"{name}_slide"), axis=turn.axis, actuated=False)
            connect(a, turn, between)
            connect(between, slide, b)
            pitch = self._pitch(reader, joint.element)
            thread = self._unused(f"{name}_thread")
            self.mechanism.add(Screw(thread, slide.name, name, pitch=pitch))
            self.coordinates[joint.key, "axis"] = name
        else:
            made = self._connect_two(joint, reader, name, (a, b))
            if closes and self.file.cuts(joint):
                self.mechanism.cut(made)

    def _connect_two(
        self, joint: _Part, reader: SdfReader, name: str, ends: tuple[Point, Point]
    ) -> Joint:
        """Connect a universal joint, or two revolute joints in series; return the last joint.

        `ends` are the joint frames on the parent and the child link.
        """
        a, b = ends
        first = self._one_axis(joint, reader, f"{name}_1", "revolute")
        second = self._one_axis(joint, reader, f"{name}_2", "revolute", "axis2")
        plain = [
            replace(one, name=name, axis="z", limits=None, actuated=None) for one in (first, second)
        ]
        bare = plain[0] == plain[1] == Revolute(name, Fv=first.Fv, Fs=first.Fs)
        straight = abs(np.dot(first.axis, second.axis)) < _PARALLEL and (
            first.actuated == second.actuated
        )
        if joint.element.get("type", "").strip() == "universal" and bare and straight:
            u = np.array(first.axis)
            v = np.array(second.axis) - np.dot(first.axis, second.axis) * u
            limits = {
                suffix: one.limits[0][1]
                for suffix, one in (("phi_a", first), ("phi_b", second))
                if one.limits
            }
            cross: Joint = Universal(
                name,
                axes=(tuple(u.tolist()), tuple((v / np.linalg.norm(v)).tolist())),
                limits=limits or None,
                Fv=first.Fv,
                Fs=first.Fs,
                actuated=first.actuated,
            )
            self.mechanism.connect(a, cross, b)
            names, last = (f"{name}.phi_a", f"{name}.phi_b"), cross
        else:
            between = self.mechanism.add(Body(self._unused(f"{name}_between"), mass=0))
            first, second = (replace(one, name=self._unused(one.name)) for one in (first, second))
            self.mechanism.connect(a, first, between)
            self.mechanism.connect(between, second, b)
            names, last = (first.name, second.name), second
        for tag, coordinate in zip(("axis", "axis2"), names, strict=True):
            self.coordinates[joint.key, tag] = coordinate
        return last

    def _pitch(self, reader: SdfReader, element: Element) -> float:
        """Return the advance of a screw per revolution [m], positive for a right-hand thread.

        Raise a DescriptionError if thread_pitch is zero.
        """
        if reader.word(element, "screw_thread_pitch") or not reader.word(element, "thread_pitch"):
            return reader.value(element, "screw_thread_pitch", 1.0)
        turns = reader.value(element, "thread_pitch", 1.0)  # rad/m of a left-hand thread
        if turns == 0:
            reader.fail("thread_pitch is 0; give another number")
        return -2 * math.pi / turns

    def _axis(self, joint: _Part, reader: SdfReader, tag: str) -> tuple[float, float, float]:
        """Return the unit vector (x, y, z) of a joint axis in the frame of the joint.

        `tag` is "axis" or "axis2". Raise a DescriptionError if the axis has zero length.
        """
        file, element = self.file, joint.element.find(tag)
        if element is None:
            reader.note("completed", f"it has no <{tag}>; taken as 0 0 1")
        xyz = np.array(reader.values(element, "xyz", (0.0, 0.0, 1.0)))
        length = float(np.linalg.norm(xyz))
        if not length > 0:
            reader.fail(f"its {tag} has zero length; give a direction")
        direction = None if element is None else element.find("xyz")
        within = "" if direction is None else direction.get("expressed_in", "").strip()
        old = element is not None and file.version < (1, 7)
        if old and reader.flag(element, "use_parent_model_frame", file.version <= _OLDEST):
            within = "__model__"
        if within:
            key = file.resolved(reader, joint.scope, within, "expressed_in")
            xyz = file.frames.relative_pose(joint.key, key)[:3, :3] @ xyz
        x, y, z = (float(value) for value in xyz / length)
        return x, y, z

    def _one_axis(
        self, joint: _Part, reader: SdfReader, name: str, kind: str, tag: str = "axis"
    ) -> Revolute | Prismatic:
        """Return the revolute or prismatic component `name` of the joint axis `tag`.

        `kind` is the type of the joint; a "continuous" joint has no limits.
        """
        element = joint.element.find(tag)
        dynamics = None if element is None else element.find("dynamics")
        limit = None if element is None else element.find("limit")
        limits = None
        if kind != "continuous":
            limits = self._limits(reader, limit)
        effort = reader.limit(limit, "effort", -1.0)
        follows = element is not None and element.find("mimic") is not None
        # an effort limit of zero means a passive joint, a positive limit an actuated joint
        actuated = False if follows or effort == 0 else True if effort > 0 else None
        one = Prismatic if kind == "prismatic" else Revolute
        n = reader.value(joint.element, "drake:gear_ratio", 1.0)
        velocity = reader.limit(limit, "velocity", -1.0)
        return one(
            name,
            axis=self._axis(joint, reader, tag),
            actuated=actuated,
            limits=limits,
            velocity=velocity if 0 < velocity < math.inf else None,
            effort=effort if 0 < effort < math.inf else None,
            Fv=self._positive(reader, dynamics, "damping"),
            Fs=self._positive(reader, dynamics, "friction"),
            stiffness=self._positive(reader, dynamics, "spring_stiffness"),
            rest=reader.value(dynamics, "spring_reference", 0.0),
            Ia=n * n * self._positive(reader, joint.element, ROTOR_INERTIA),
        )

    def _positive(self, reader: SdfReader, parent: Element | None, tag: str) -> float:
        """Return the number in the child element `tag`.

        A negative number counts as 0, with a note.
        """
        return not_negative(reader, parent, tag, reader.value(parent, tag, 0.0))

    def _limits(self, reader: SdfReader, limit: Element | None) -> tuple[float, float] | None:
        """Return the position limits (lower, upper) of a joint from its <limit> element.

        None unless both are finite and ordered; see `limits_of`.
        """
        low = reader.limit(limit, "lower", -math.inf)
        return limits_of(reader, limit, low, reader.limit(limit, "upper", math.inf))

    # Gears and mimics.

    def _add_gears(self, gears: _Part) -> None:
        """Add theta_2 = -ratio theta_1, for angles of child and parent relative to a third link.

        Raise a DescriptionError if the ratio is zero or an angle is not that of a revolute joint.
        """
        reader, file = self.file.reader(gears), self.file
        word = reader.word(gears.element, "gearbox_reference_body")
        third = file.frames.carrier(
            file.resolved(reader, gears.scope, word, "gearbox_reference_body")
        )
        ratio = reader.value(gears.element, "gearbox_ratio", 1.0)
        found = []
        for end, tag in zip(self.kept[gears.key], ("axis", "axis2"), strict=True):
            own = file.frames.in_world(gears.key)[:3, :3] @ self._axis(gears, reader, tag)
            found.append(self._angle(reader, third, end, own))
        (driver, one), (driven, other) = found
        if ratio == 0:
            reader.fail("gearbox_ratio is 0; give another number")
        name = self._name(gears, "gears")
        factor = -ratio * one * other
        self.mechanism.add(Coupling(name, driven, driver, (0.0, factor)))

    def _angle(self, reader: SdfReader, third: str, link: str, axis: Array) -> tuple[str, float]:
        """Return the coordinate of the revolute joint between two links, and its sign.

        The sign is +1 if the coordinate is the rotation of `link` relative to the link `third`
        about `axis` (3,), a unit vector in world axes; it is -1 for the opposite rotation. Raise a
        DescriptionError if no revolute joint about this axis connects them.
        """
        file = self.file
        for key in self.between.get(frozenset((third, link)), ()):
            joint, ends = file.joints[key], self.kept[key]
            if self._kind(joint) in ("revolute", "continuous"):
                found = np.array(self._axis(joint, file.reader(joint), "axis"))
                along = float((file.frames.in_world(key)[:3, :3] @ found) @ axis)
                if abs(abs(along) - 1) < _PARALLEL:
                    sign = 1.0 if ends == (third, link) else -1.0
                    return self.coordinates[key, "axis"], math.copysign(sign, sign * along)
        reader.fail(
            f"no revolute joint about its axis connects {quoted(link)} with its"
            " gearbox_reference_body; add one"
        )

    def _add_mimic(self, joint: _Part, tag: str) -> None:
        """Add the mimic of a joint axis (`tag` "axis" or "axis2") as a coupling, if it has one.

        Raise a DescriptionError if the joint that it follows is unknown or the multiplier is
        missing.
        """
        element = joint.element.find(f"{tag}/mimic")
        if element is None:
            return
        reader, file = self.file.reader(joint), self.file
        leader, of = element.get("joint", "").strip(), element.get("axis", "axis").strip()
        key = joint.scope.prefix + leader
        key = key if key in file.joints else f"joint {key}"
        driven, driver = self.coordinates.get((joint.key, tag)), self.coordinates.get((key, of))
        if driven is None or driver is None or driven == driver:
            reader.fail(f"it mimics {quoted(leader)}, {of}; give another joint with this axis")
        if not reader.word(element, "multiplier"):
            reader.fail("its mimic has no multiplier; give a number")
        factor = reader.value(element, "multiplier", 1.0)
        offset = reader.value(element, "offset", 0.0)
        offset -= factor * reader.value(element, "reference", 0.0)
        name = self._unused(f"{driven.replace('.', '_')}_mimic")
        self.mechanism.add(Coupling(name, driven, driver, (offset, factor)))


class _Groups:
    """Groups of connected links, stored as a disjoint-set forest.

    Each group has a representative link, its root.

    Attributes:
        above: parent of each link in the forest; a root is its own parent.
        closing: joints that connect two links of the same group, and so close a loop.
    """

    def __init__(self, above: dict[str, str]) -> None:
        self.above = above
        self.closing: set[str] = set()

    def root(self, key: str) -> str:
        """Return the link that represents the group of a link."""
        while self.above[key] != key:
            self.above[key] = self.above[self.above[key]]
            key = self.above[key]
        return key

    def join(self, joint: str, one: str, other: str) -> None:
        """Connect the links `one` and `other` by a joint.

        If they were already connected, the joint is recorded in `closing`.
        """
        a, b = self.root(one), self.root(other)
        if a == b:
            self.closing.add(joint)
        self.above[a] = b

    def closes(self, joint: str) -> bool:
        """Whether a joint connected links that were already connected when `join` was called."""
        return joint in self.closing


def _at(point: Point, T: Array) -> Point:
    """Return the frame with the pose T (4, 4) relative to the frame `point`."""
    R = T[:3, :3]
    x, y, z = (float(value) for value in T[:3, 3])
    turned = None if np.abs(R - np.eye(3)).max() <= _SAME else R.tolist()
    return point.at(x, y, z, rotation=turned)


# Reader of complete files.


def read_sdf(path: str | Path, *, base: Base | None = None, strict: bool = False) -> Mechanism:
    """Read an SDFormat file with one model, including closed loops, as a mechanism.

    Links, joints and frames keep their names; names in nested models have the prefix `model::`.
    Invalid names are changed, with a note. A link with several parents closes loops; the assembly
    selects the joints at which they are cut. A joint is actuated if its effort limit is positive
    and passive if it is zero; without a limit, the assembly decides.

    Args:
        path: path of the file.
        base: None follows the format: links that no joint connects to the world are free, on the
            joint "root_joint", and start at the pose in the file. "fixed" fixes them to the world
            at this pose. "free" ignores fixed joints to the world. A static model is fixed if this
            is None, and moves otherwise.
        strict: whether to raise an error instead of adding a note.

    Returns:
        The mechanism. Its `notes` list ignored, changed and completed elements.

    Raises:
        DescriptionError: the file is missing or malformed, has several models that move, or
            contains an unsupported element that changes the motion. In strict mode, also for each
            note.
    """
    if base not in (None, "fixed", "free"):
        raise DescriptionError(f"{path}: base is {quoted(base)}; give 'fixed', 'free' or None")
    notes = Notes(str(path), strict)
    root = parse_xml(path, notes)
    if root.tag != "sdf":
        raise DescriptionError(
            f"{path}: the root element is <{quoted(root.tag)[1:-1]}>, not <sdf>; give an SDF file"
        )
    file = _SdfFile(notes, _version(root, notes), _Frames(str(path)))
    world, model = _choose(root, notes)
    name = robot_name(model, notes)
    gravity: Vector = MODEL_GRAVITY
    if world is not None:
        gravity = _read_world(file, world)
    mechanism = Mechanism(name, gravity=gravity, source=f"SDF file {Path(path).name}")
    mechanism.notes = notes.taken
    file.add_model(model, name, None)
    if not file.links:
        raise DescriptionError(f"{path}: model {quoted(name)} has no <link>; give it links")
    file.place_model(model, name, None)
    reader = SdfReader(f"model {quoted(name)}", model, notes)
    _refuse_parts(reader, model)
    static = reader.flag(model, "static")
    if static:
        still = "its links are welded to the world" if base is None else "its base was given"
        reader.note("ignored", f"it is static; {still}")
    parts = (*file.links.values(), *file.joints.values(), *file.named.values())
    names = UniqueNames({"world", "base"}, {component_name(part.name) for part in parts})
    _SdfBuilder(mechanism, file, base, static and base is None, gravity, names).build()
    _note_visuals(file)
    return mechanism


def _note_visuals(file: _SdfFile) -> None:
    """Add one note about the visuals of all links, which are not read."""
    counts = {link.name: len(link.element.findall("visual")) for link in file.links.values()}
    drawn = [quoted(name) for name, count in counts.items() if count]
    if drawn:
        first = ", ".join(drawn[:_LONGEST_NOTE])
        more = f" and {len(drawn) - _LONGEST_NOTE} more" if len(drawn) > _LONGEST_NOTE else ""
        text = f"the {sum(counts.values())} visuals of {first}{more} are not read, nor drawn"
        file.notes.add("ignored", "<visual>", text)


def _version(root: Element, notes: Notes) -> tuple[int, ...]:
    """Return (major, minor) version of a file, limited to the supported versions with a note.

    Raise a DescriptionError if the version is not of the form 1.4.
    """
    text = root.get("version", "").strip()
    words = text.split(".")
    if not text:
        notes.add("completed", "<sdf>", "it has no version; read as 1.12", line_of(root))
        return _NEWEST
    if not all(word.isdecimal() and len(word) < 4 for word in words) or len(words) < 2:
        raise DescriptionError(
            f"{notes.path}: version {quoted(text)} is none of SDF; write 1.4 to 1.12"
        )
    version = tuple(map(int, words[:2]))
    if not _OLDEST <= version <= _NEWEST:
        near = _OLDEST if version < _OLDEST else _NEWEST
        said = ".".join(map(str, near))
        notes.add("doubted", "<sdf>", f"its version is {text}; read as {said}", line_of(root))
        return near
    return version


def _choose(root: Element, notes: Notes) -> tuple[Element | None, Element]:
    """Return the world element (None if there is none) and the model element to read.

    It is the only model that moves, or else the only model. Raise a DescriptionError if there is
    none or more than one.
    """
    worlds = root.findall("world")
    if len(worlds) > 1:
        raise DescriptionError(f"{notes.path}: there are {len(worlds)} worlds; give a file of one")
    world = worlds[0] if worlds else None
    home = root if world is None else world
    models = home.findall("model")
    if not models:
        said = "but <include>; give the file of the model itself"
        what = said if home.find("include") is not None else "in it; give an SDF file with one"
        raise DescriptionError(f"{notes.path}: there is no <model> {what}")
    moving = [model for model in models if not _is_static(model)]
    some = moving or models
    if len(some) > 1:
        few = ", ".join(quoted(model.get("name", "")) for model in some[:5])
        raise DescriptionError(
            f"{notes.path}: there are {len(some)} models ({few}); give a file with one that moves"
        )
    for model in models:
        if model is not some[0]:
            text = "it is static, and left out"
            notes.add("ignored", f"model {quoted(model.get('name', ''))}", text, line_of(model))
    return world, some[0]


def _is_static(model: Element) -> bool:
    """Whether a <model> element is marked as static."""
    return (model.findtext("static") or "").strip().lower() in ("true", "1")


def _read_world(file: _SdfFile, world: Element) -> Vector:
    """Return the gravity (3,) of a world element [m/s^2].

    Its frames are registered in `file`, and unread elements are noted. Raise a DescriptionError if
    the world has joints.
    """
    reader = SdfReader(f"world {quoted(world.get('name', ''))}", world, file.notes)
    if world.find("joint") is not None:
        reader.fail("it has joints of its own, between models; write them in the model")
    for child in world.findall("include"):
        uri = quoted((child.findtext("uri") or "").strip())
        reader.note("ignored", f"it includes {uri}, which is not read", child)
    file._note_unread(reader)
    frames = {(child.get("name") or "").strip(): child for child in world.findall("frame")}
    for name, child in frames.items():
        own = SdfReader(f"frame {quoted(name)}", child, file.notes)
        relative, T = own.pose(child)
        relative = relative or child.get("attached_to", "").strip()
        if relative not in ("", "world", *frames):
            own.fail(f"it stands on {quoted(relative)}, which is no frame of the world")
        within = f"world::{relative}" if relative in frames else "world"
        file.frames.places[f"world::{name}"] = within, T
    x, y, z = reader.values(world, "gravity", WORLD_GRAVITY)
    return x, y, z


def _refuse_parts(reader: SdfReader, model: Element) -> None:
    """Raise a DescriptionError if the model includes parts from other files."""
    for element in model.iter("include"):
        uri = quoted((element.findtext("uri") or "").strip())
        reader.fail(f"it includes {uri}, which is not read; put the whole model in one file")
