"""Reader of URDF robot files, and of xacro files after expansion by `xacrodoc`.

The reader uses the elements that affect the motion (links, inertials, joints, limits, friction,
mimics and rotors of transmissions) and the shapes of links for pictures. Incomplete or invalid data
are read as far as possible, with a note in the mechanism.

The reader does not use MuJoCo; see "URDF without MuJoCo" in docs/decisions.
"""

from __future__ import annotations

import contextlib
import io
import math
import re
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NoReturn
from xml.etree.ElementTree import Element, tostring

import numpy as np

from mbs.components import (
    Body,
    Coupling,
    Free,
    Joint,
    Planar,
    Point,
    Prismatic,
    Revolute,
    Shape,
)
from mbs.components.component import component_name
from mbs.components.locking import FREE_JOINT, Base
from mbs.components.notes import NoteKind
from mbs.errors import DescriptionError
from mbs.expressions import plain_numbers
from mbs.formats.files import Notes, read_bytes
from mbs.formats.meshes import MeshFiles
from mbs.formats.rotations import axis_rotation
from mbs.formats.urdf.shared import MOMENTS, REDUCTION, ROTOR, UNLIMITED
from mbs.formats.xml import line_of, parse_content
from mbs.mechanism import Mechanism
from mbs.text import did_you_mean, install_command, quoted

# Numbers in URDF elements: vectors, origins and inertials.


Vector = tuple[float, ...]

_LARGEST = 1e30
"""Largest length, mass and other number in SI units: products stay finite in double precision."""


@dataclass(frozen=True, slots=True)
class Reader:
    """Reader of the numbers of one link or joint, which adds notes about it.

    Attributes:
        what: name of the element in messages, such as "joint 'j1'".
        element: XML element.
        notes: notes of the file.
    """

    what: str
    element: Element
    notes: Notes

    def fail(self, message: str) -> NoReturn:
        """Raise a DescriptionError with the file, the element and a message."""
        raise DescriptionError(f"{self.where}: {message}")

    def note(self, kind: NoteKind, text: str, element: Element | None = None) -> None:
        """Add a note about the element with its line number.

        Args:
            kind: kind of the note.
            text: text of the note.
            element: element inside it whose line number is given; by default the element itself.
        """
        line = line_of(self.element if element is None else element)
        self.notes.add(kind, self.what, text, line)

    @property
    def where(self) -> str:
        """File and element, for error messages."""
        return f"{self.notes.path}: {self.what}"

    def number(
        self, element: Element | None, key: str, default: float, largest: float = _LARGEST
    ) -> float:
        """Return the number in an attribute of an element, or the default if it is missing.

        Args:
            element: XML element; None counts as an element without attributes.
            key: name of the attribute.
            default: value by default.
            largest: largest allowed magnitude.

        Raises:
            DescriptionError: the text is not a number, or the number is too large.
        """
        return self.vector(element, key, (default,), largest)[0]

    def vector(
        self, element: Element | None, key: str, default: Vector, largest: float = _LARGEST
    ) -> Vector:
        """Return the numbers in an attribute of an element, or the default if it is missing.

        Args:
            element: XML element; None counts as an element without attributes.
            key: name of the attribute.
            default: values by default, which give the required number of values.
            largest: largest allowed magnitude.

        Raises:
            DescriptionError: the attribute has another number of values, or a value is not a number
                or too large.
        """
        text = None if element is None else element.get(key)
        if text is None:
            return default
        return self.numbers(element, key, text, len(default), largest)

    def numbers(
        self, element: Element | None, key: str, text: str, count: int, largest: float = _LARGEST
    ) -> Vector:
        """Return the `count` numbers in a text.

        Args:
            element: element that contains the text, for notes.
            key: name of the quantity, for error messages.
            text: text in the file.
            count: required number of values.
            largest: largest allowed magnitude.

        Raises:
            DescriptionError: the text has another number of values, or a value is not a number or
                too large.
        """
        if "${" in text or "$(" in text:
            self.fail(f"{key} is {quoted(text)}, which xacro has not expanded; {_EXPAND}")
        if "," in text:
            text = self._without_commas(element, key, text)
        values = plain_numbers(text, count, f"{self.where}: {key}")
        if not max(map(abs, values)) <= largest:
            self.fail(f"{key} is {quoted(text)}; give numbers of at most {largest:g}")
        return values

    def _without_commas(self, element: Element | None, key: str, text: str) -> str:
        """Return a text with blanks in place of commas between numbers; a note reports them.

        Commas inside numbers remain. `key` is the name of the quantity.
        """
        bare = len(text.split()) == 1 and text.count(",") > 1  # "1,2,3" is three numbers
        spaced = text.replace(",", " ") if bare else _COMMA.sub(" ", text)
        if spaced != text:
            self.note(
                "doubted", f"{key} is {quoted(text)}, with commas between its numbers", element
            )
        return spaced


_COMMA = re.compile(r",(?=\s)")
_EXPAND = "load the .xacro file itself, or expand it first"


@dataclass(frozen=True, slots=True)
class Inertial:
    """Mass and inertia of a link, expressed in the link frame.

    Attributes:
        mass: mass [kg].
        com: centre of mass [m].
        tensor: inertia (3, 3) about the centre of mass [kg m^2].
    """

    mass: float = 0.0
    com: Vector = (0.0, 0.0, 0.0)
    tensor: Any = ((0.0, 0.0, 0.0),) * 3

    @property
    def is_zero(self) -> bool:
        """Whether mass and inertia are zero."""
        return self.mass == 0 and not np.any(self.tensor)


def origin_of(reader: Reader, element: Element) -> tuple[Vector, list[tuple[str, float]]]:
    """Return the <origin> of an element: position and rotations relative to the parent frame.

    Args:
        reader: reader of the element or of an enclosing element, for error messages.
        element: element that contains <origin>.

    Returns:
        Position (x, y, z) [m], and the nonzero rotations as (axis name, angle [rad]) in the order
        z, y, x; each rotation is about an axis of the rotated frame.

    Raises:
        DescriptionError: a number cannot be read.
    """
    origin = element.find("origin")
    xyz = reader.vector(origin, "xyz", (0.0, 0.0, 0.0))
    roll, pitch, yaw = reader.vector(origin, "rpy", (0.0, 0.0, 0.0))
    turns = [(axis, angle) for axis, angle in (("z", yaw), ("y", pitch), ("x", roll)) if angle]
    return xyz, turns


def read_inertial(reader: Reader) -> Inertial:
    """Return mass and inertia of a link, zero if it has no <inertial> or no mass.

    Missing moments count as 0. A note reports incomplete data.

    Args:
        reader: reader of the link.

    Raises:
        DescriptionError: a number cannot be read.
    """
    inertial = reader.element.find("inertial")
    if inertial is None:
        return Inertial()
    mass, inertia = inertial.find("mass"), inertial.find("inertia")
    if mass is None or mass.get("value") is None:
        reader.note("ignored", "its inertial has no mass and was left out", inertial)
        return Inertial()
    missing = [key for key in MOMENTS if inertia is None or inertia.get(key) is None]
    if missing:
        reader.note("completed", f"its inertia has no {', '.join(missing)}; taken as 0", inertial)
    Ixx, Ixy, Ixz, Iyy, Iyz, Izz = (reader.number(inertia, key, 0.0) for key in MOMENTS)
    com, turns = origin_of(reader, inertial)
    tensor = np.array([[Ixx, Ixy, Ixz], [Ixy, Iyy, Iyz], [Ixz, Iyz, Izz]])
    for axis, angle in reversed(turns):
        R = axis_rotation("xyz".index(axis), angle)
        tensor = np.einsum("ij,jk,lk->il", R, tensor, R)
    tensor = (tensor + tensor.T) / 2
    return Inertial(reader.number(mass, "value", 0.0), com, tensor.tolist())


# Links and joints of a URDF file, and their tree.


_ONE_AXIS: Mapping[str, type[Revolute] | type[Prismatic]] = {
    "revolute": Revolute,
    "continuous": Revolute,
    "prismatic": Prismatic,
}
_KINDS = (*_ONE_AXIS, "fixed", "floating", "planar")


@dataclass(frozen=True, slots=True)
class JointElement:
    """Joint of a URDF file.

    Attributes:
        name: name of the joint, completed or changed if it is missing or used twice.
        parent, child: names of its parent and child link.
        element: XML element.
    """

    name: str
    parent: str
    child: str
    element: Element

    @property
    def kind(self) -> str:
        """Joint type, as in the file."""
        return self.element.get("type", "").strip()


@dataclass(frozen=True, slots=True)
class UrdfTree:
    """Links and joints of a URDF file, which form a tree.

    Attributes:
        notes: notes of the file.
        root: name of the root link.
        links: XML elements of the links, by name.
        joints: joints in an order in which parents precede children.
    """

    notes: Notes
    root: str
    links: Mapping[str, Element]
    joints: tuple[JointElement, ...]

    def link(self, name: str) -> Reader:
        """Return a reader of the numbers of a link.

        Args:
            name: name of the link in the file.
        """
        return Reader(f"link {quoted(name)}", self.links[name], self.notes)

    def joint(self, joint: JointElement) -> Reader:
        """Return a reader of the numbers of a joint."""
        return Reader(f"joint {quoted(joint.name)}", joint.element, self.notes)


def read_tree(root: Element, notes: Notes) -> UrdfTree:
    """Return the links and joints of a <robot>, after a check that they form a tree.

    Args:
        root: XML element <robot>.
        notes: notes of the file.

    Raises:
        DescriptionError: a joint refers to an unknown link, two different links have the same name,
            a link has two parents, or there is not exactly one root.
    """
    path = notes.path
    links = _links(root, notes)
    joints = [
        _joint_element(notes, name, element, links)
        for name, element in _joints(root, notes).items()
    ]
    parents: dict[str, str] = {}
    for joint in joints:
        if joint.child in parents:
            raise DescriptionError(
                f"{path}: link {quoted(joint.child)} is the child of joints"
                f" {quoted(parents[joint.child])} and {quoted(joint.name)}; a link has one parent,"
                " so close loops with mbs components"
            )
        parents[joint.child] = joint.name
    roots = [name for name in links if name not in parents]
    if len(roots) != 1:
        few = ", ".join(map(quoted, roots[:5])) + (" ..." if len(roots) > 5 else "")
        found = f"the roots {few}" if roots else "no root but a cycle"
        raise DescriptionError(f"{path}: the links have {found}; connect them as one tree")
    return UrdfTree(notes, roots[0], links, _order(path, roots[0], links, joints))


def _links(root: Element, notes: Notes) -> dict[str, Element]:
    """Return the <link> elements by name; repeated and unnamed links are left out with a note.

    Raise a DescriptionError if there is no link, or two different links have the same name.
    """
    links: dict[str, Element] = {}
    texts = _Texts()
    for element in root.findall("link"):
        name = (element.get("name") or "").strip()
        if not name:
            notes.add(
                "ignored", "a <link>", "it has no name, so nothing holds it", line_of(element)
            )
        elif name not in links:
            links[name] = element
        elif texts.same(links[name], element):
            notes.add("ignored", f"link {quoted(name)}", "it stands twice, alike", line_of(element))
        else:
            raise DescriptionError(
                f"{notes.path}: two links are named {quoted(name)} and differ; rename one"
            )
    if not links:
        if any(element.tag.startswith("xacro:") for element in root):
            raise DescriptionError(
                f"{notes.path}: there is no <link> but macros of xacro; load it with xacro={{}}"
            )
        raise DescriptionError(f"{notes.path}: there is no <link>; give a URDF file with links")
    return links


def _joints(root: Element, notes: Notes) -> dict[str, Element]:
    """Return the <joint> elements by name; missing and repeated names are changed with a note."""
    joints: dict[str, Element] = {}
    count: dict[str, int] = {}
    texts = _Texts()
    for element in root.findall("joint"):
        given = (element.get("name") or "").strip()
        ends = ((element.find(side), side) for side in ("parent", "child"))
        names = [(end.get("link") or side) if end is not None else side for end, side in ends]
        name = given or f"{names[0]}_to_{names[1]}"
        if name in joints and texts.same(joints[name], element):
            notes.add(
                "ignored", f"joint {quoted(name)}", "it stands twice, alike", line_of(element)
            )
            continue
        while name in joints:
            count[given] = count.get(given, 1) + 1
            name = f"{given}_{count[given]}"
        if not given:
            notes.add(
                "completed", "a <joint>", f"it has no name; named {quoted(name)}", line_of(element)
            )
        elif name != given:
            notes.add(
                "renamed",
                f"joint {quoted(given)}",
                f"a joint before it has this name; named {quoted(name)}",
                line_of(element),
            )
        joints[name] = element
    return joints


class _Texts(dict[Element, str]):
    """Cache of the XML texts of elements, by element."""

    def same(self, one: Element, other: Element) -> bool:
        """Whether two elements have the same content, apart from white space."""
        if one not in self:
            self[one] = self._text(one)
        return self[one] == self._text(other)

    def _text(self, element: Element) -> str:
        """Return the XML text of an element with single blanks as white space."""
        return " ".join(tostring(element, encoding="unicode").split())


def _joint_element(
    notes: Notes, name: str, element: Element, links: Collection[str]
) -> JointElement:
    """Return a joint with its links; raise a DescriptionError if a link does not exist."""
    ends = []
    for side in ("parent", "child"):
        end = element.find(side)
        link = "" if end is None else (end.get("link") or "").strip()
        if link not in links:
            raise DescriptionError(
                f"{notes.path}: joint {quoted(name)}: {side} link {quoted(link)} does not exist;"
                f" {did_you_mean(link, links)}"
            )
        ends.append(link)
    return JointElement(name, ends[0], ends[1], element)


def _order(
    path: str, root: str, links: Iterable[str], joints: Iterable[JointElement]
) -> tuple[JointElement, ...]:
    """Return the joints, parents before children; raise a DescriptionError if there is a cycle.

    `root` is the name of the root link, `path` the file for error messages.
    """
    children: dict[str, list[JointElement]] = {name: [] for name in links}
    for joint in joints:
        children[joint.parent].append(joint)
    ordered: list[JointElement] = []
    pending = list(reversed(children[root]))
    while pending:
        joint = pending.pop()
        ordered.append(joint)
        pending.extend(reversed(children[joint.child]))
    reached = {root, *(joint.child for joint in ordered)}
    missing = [name for name in links if name not in reached]
    if missing:
        raise DescriptionError(
            f"{path}: link {quoted(missing[0])} is in a cycle of joints; connect the links as one"
            " tree"
        )
    return tuple(ordered)


# Unique and valid component names.


@dataclass(slots=True)
class UniqueNames:
    """Assign a unique name to every element: the name in the file, changed if it is not allowed.

    Attributes:
        taken: names that are already assigned.
        wanted: names of elements in the file, which changed names must avoid.
        number: last counter for each changed name.
    """

    taken: set[str]
    wanted: set[str]
    number: dict[str, int] = field(default_factory=dict)

    def assign(self, reader: Reader, text: str, suffix: str, why: str) -> str:
        """Return the component name of an element, and mark it as assigned.

        It is the name in the file with invalid characters replaced. If that is assigned already, a
        suffix and a number are appended. A note reports each change.

        Args:
            reader: reader of the element, which receives the note.
            text: name of the element in the file.
            suffix: suffix, and name of elements without a usable name.
            why: reason why the name is not free, for the note.
        """
        name = component_name(text) or suffix
        if name not in self.taken:
            self.taken.add(name)
            if name != text:
                reader.note("renamed", f"it is {quoted(name)} here, for the letters of its name")
            return name
        free = f"{name}_{suffix}"
        while free in self.taken or free in self.wanted:
            self.number[name] = self.number.get(name, 1) + 1
            free = f"{name}_{suffix}_{self.number[name]}"
        self.taken.add(free)
        reader.note("renamed", f"it is {quoted(free)} here, for {why}")
        return free


@dataclass(frozen=True, slots=True)
class ElementNames:
    """Component names of links, moving joints and the free root joint.

    Attributes:
        links: component name by name of the link in the file.
        joints: component name by name of the joint in the file, without fixed joints.
        free: name of the joint of a free base.
    """

    links: Mapping[str, str]
    joints: Mapping[str, str]
    free: str


def element_names(tree: UrdfTree, base: Base | None) -> ElementNames:
    """Return the component names of links and joints, with a note for each changed name.

    Args:
        tree: links and joints of the file.
        base: "free" if the root gets a free joint, otherwise None.
    """
    moving = [joint for joint in tree.joints if joint.kind != "fixed"]
    wanted = {component_name(name) for name in (*tree.links, *(j.name for j in moving))}
    names = UniqueNames({"world"}, wanted)
    of_joint = {
        joint.name: names.assign(
            tree.joint(joint),
            joint.name,
            "joint",
            "another joint or the world has this name",
        )
        for joint in moving
    }
    free = FREE_JOINT
    if base == "free":
        free = names.assign(
            tree.link(tree.root),
            FREE_JOINT,
            "free",
            "a joint of the file has this name",
        )
    at_world = set() if base == "free" else _at_world(tree)
    of_link = {}
    for link in tree.links:
        if link == tree.root == "world" and base != "free":
            of_link[link] = link  # the world frame itself
            continue
        reserved = component_name(link) == "base" and link not in at_world
        if reserved:
            names.taken.add("base")
        why = (
            "the base of all models has this name, and the link is not there"
            if reserved
            else "a joint, another link or the world has this name"
        )
        of_link[link] = names.assign(tree.link(link), link, "link", why)
    return ElementNames(of_link, of_joint, free)


def _has_floating_base(tree: UrdfTree) -> bool:
    """Whether the file itself has a floating base.

    This is so if the root and all links fixed to it have no inertial and a floating joint starts
    there.
    """
    held = {tree.root}
    for joint in tree.joints:
        if joint.parent in held and joint.kind == "fixed":
            held.add(joint.child)
    massless = all(tree.links[link].find("inertial") is None for link in held)
    return massless and any(j.parent in held and j.kind == "floating" for j in tree.joints)


def _at_world(tree: UrdfTree) -> set[str]:
    """Return the links whose frame coincides with the root frame by fixed joints without offset."""
    found = {tree.root}
    for joint in tree.joints:
        if joint.kind == "fixed" and joint.parent in found:
            xyz, turns = origin_of(tree.joint(joint), joint.element)
            if not any(xyz) and not turns:
                found.add(joint.child)
    return found


def read_urdf(
    path: str | Path,
    *,
    base: Base | None = None,
    strict: bool = False,
    xacro: Mapping[str, object] | None = None,
    packages: Mapping[str, str | Path] | None = None,
    other_files: bool = True,
) -> Mechanism:
    """Read a URDF or xacro file as a mechanism.

    Every link becomes a body of the same name, including links on fixed joints, and every moving
    joint a joint of the same name. Names that are not allowed are changed, with a note. The root
    link is the world if it is named "world" or has no mass; otherwise it is a body fixed to the
    world. With a free base, the root is always a body on the Free joint "root_joint". One-axis
    joints are actuated unless they mimic another joint; floating joints are passive. Pictures show
    the visuals of links, or the collision shapes of links without visuals.

    Args:
        path: path of the file; a file with the suffix .xacro is expanded by the library `xacrodoc`.
        base: "free" for a floating base; otherwise the root is fixed to the world.
        strict: whether to raise an error instead of adding a note.
        xacro: values of the arguments of a xacro file.
        packages: folders of the packages in a xacro file or in `package://` names.
        other_files: whether to read the mesh files; set to False for files from untrusted sources.

    Returns:
        The mechanism. Its `notes` list ignored, changed and completed elements.

    Raises:
        DescriptionError: the file is missing or malformed, or its links and joints do not form a
            tree. In strict mode, also for each note.
    """
    notes = Notes(str(path), strict)
    content = read_bytes(path)
    if Path(path).suffix.lower() == ".xacro" or xacro is not None:
        content, notes.lines = expanded(path, xacro or {}, packages or {}), False
    root = parse_content(str(path), content, notes)
    if root.tag != "robot":
        raise DescriptionError(
            f"{path}: the root element is <{quoted(root.tag)[1:-1]}>, not <robot>; give a URDF file"
        )
    _note_unread(root, notes)
    tree = read_tree(root, notes)
    name = robot_name(root, notes)
    mechanism = Mechanism(name, source=f"URDF file {Path(path).name}")
    mechanism.notes = notes.taken
    base = "free" if base == "free" and not _has_floating_base(tree) else None
    building = _UrdfBuilder(mechanism, tree, element_names(tree, base), _rotors(root, tree))
    building.build(base)
    folder = Path(path).resolve().parent if other_files else None
    meshes = MeshFiles(folder, dict(packages or {}))
    add_shapes(mechanism, tree, building.points, material_colours(root), meshes)
    meshes.note(notes)
    return mechanism


def robot_name(element: Element, notes: Notes) -> str:
    """Return the component name of a robot: its attribute `name`, or else the file name.

    Args:
        element: XML element of the robot.
        notes: notes of the file, which receive a note if the element has no name.
    """
    name = component_name(element.get("name") or "")
    if name:
        return name
    name = component_name(Path(notes.path).stem) or "robot"
    text = f"it has no name; named {quoted(name)}"
    notes.add("completed", f"<{element.tag}>", text, line_of(element))
    return name


def expanded(
    path: str | Path, arguments: Mapping[str, object], packages: Mapping[str, str | Path]
) -> bytes:
    """Expand a xacro file to URDF text.

    xacro evaluates Python expressions, so only expand files from trusted sources.

    Args:
        path: path of the file; packages are also searched in its parent folders.
        arguments: arguments of the file by name; True and False are converted to true and false.
        packages: folder of each package that is not found elsewhere.

    Raises:
        DescriptionError: the library is not installed, or the file cannot be expanded.
    """
    try:
        import xacrodoc
    except ImportError:
        raise DescriptionError(
            f"{path}: xacro files are expanded by xacrodoc, which is not installed; run: "
            + install_command("xacro")
        ) from None
    given = {k: str(v).lower() if isinstance(v, bool) else str(v) for k, v in arguments.items()}
    said = io.StringIO()
    try:
        with contextlib.redirect_stderr(said):  # xacro prints the errors that it raises
            xacrodoc.packages.update_package_cache(dict(packages))
            document = xacrodoc.XacroDoc.from_file(
                Path(path).resolve(), subargs=given, resolve_packages=False
            )
            return str(document.to_urdf_string()).encode()
    except (Exception, SystemExit) as error:  # macros raise any exception of their expressions
        reason = quoted(str(error) or type(error).__name__)
        raise DescriptionError(
            f"{path}: xacro cannot expand it: {reason}; give its arguments as xacro={{...}} and the"
            " folders of its packages as packages={...}"
        ) from None


# Elements of a file other than links and joints.


_SILENT = {
    "robot": {
        *("link", "joint", "transmission", "gazebo", "material"),
        *("sensor", "ros2_control", "loop", "constraint", "loop_joint"),
    },
    "link": {"inertial", "visual", "collision", "sensor", "contact"},
    "joint": {
        *("origin", "parent", "child", "axis", "limit", "dynamics", "mimic"),
        *("safety_controller", "calibration"),
    },
}
"""Elements that are read, have a note of their own, or have no effect on the equations."""

_LOOPS = ("loop", "constraint", "loop_joint")
_WITH_EFFECT = {"springStiffness", "springReference", "turnGravityOff", "kinematic"}


def _note_unread(root: Element, notes: Notes) -> None:
    """Add one note for each kind of element of a <robot> that is not read."""
    unread: dict[tuple[str, str], list[Element]] = {}
    for parent in (root, *root.findall("link"), *root.findall("joint")):
        for child in parent:
            if child.tag not in _SILENT[parent.tag]:
                unread.setdefault((parent.tag, child.tag), []).append(child)
    for (tag, kind), found in unread.items():
        text = f"it is not known in a <{tag}> and was left out"
        if kind.startswith("xacro:"):
            text = f"it was left by xacro and has no meaning in URDF; {_EXPAND}"
        if len(found) > 1:
            text += f" ({len(found)} of them)"
        notes.add("ignored", f"<{quoted(kind)[1:-1]}>", text, line_of(found[0]))
    _note_effects(root, notes)


def _note_effects(root: Element, notes: Notes) -> None:
    """Add notes about unread elements of a <robot> that would change the motion, such as loops."""
    for element in root:
        local = element.tag.rpartition(":")[2]
        if local in _LOOPS:
            text = "the loop that it closes stays open; close it with mbs components"
            notes.add("ignored", f"<{quoted(element.tag)[1:-1]}>", text, line_of(element))
        elif element.tag == "gazebo":
            for inner in _effects(element):
                of = quoted(element.get("reference", ""))
                text = f"<{inner.tag}> would change the motion and is not read"
                notes.add("ignored", f"<gazebo> of {of}", text, line_of(inner))


def _effects(gazebo: Element) -> Iterator[Element]:
    """Yield the children of a <gazebo> element that would change the motion."""
    for inner in gazebo:
        text = (inner.text or "").strip().lower()
        off = text in ("", "0", "false") or _is_zero(text)
        held = inner.tag == "gravity" and text in ("0", "false")
        if (inner.tag in _WITH_EFFECT and not off) or held or inner.tag in ("joint", "link"):
            yield inner


def _is_zero(text: str) -> bool:
    """Whether a text is the number zero; False if it is not a number."""
    try:
        return float(text) == 0
    except ValueError:
        return False


def _rotors(root: Element, tree: UrdfTree) -> dict[str, float]:
    """Return the rotor inertias of transmissions, referred to their joints, Ia [kg m^2 or kg].

    A rotor inertia J with reduction n is n^2 J at the joint. A reduction without rotor inertia has
    no effect, since the inputs of the models are joint efforts. `root` is the <robot> element.

    Returns:
        Rotor inertia by joint name in the file.
    """
    found: dict[str, float] = {}
    # the format has no other element for the armature of free joints
    moving = {joint.name for joint in tree.joints if joint.kind in (*_ONE_AXIS, "floating")}
    for element in root.findall("transmission"):
        name = quoted((element.get("name") or "").strip())
        reader = Reader(f"transmission {name}", element, tree.notes)
        joints = [j.get("name", "").strip() for j in element.iter("joint")]
        n, inertia = _scalar_in(element, REDUCTION), _scalar_in(element, ROTOR)
        if inertia is None:
            if n not in (None, 0.0, 1.0):
                reader.note("ignored", f"a reduction of {n:g} without the inertia of a rotor")
            continue
        if len(joints) != 1 or joints[0] not in moving or inertia < 0:
            reader.note("ignored", "its rotor is not that of one joint")
            continue
        found[joints[0]] = found.get(joints[0], 0.0) + (1.0 if n is None else n) ** 2 * inertia
    return found


def _scalar_in(element: Element, tags: Collection[str]) -> float | None:
    """Return the first finite number in a descendant element with one of the names `tags`.

    Prefixes of names are ignored. None if there is no such number.
    """
    for inner in element.iter():
        if inner.tag.rpartition(":")[2] in tags:
            try:
                value = float(inner.get("value") or inner.text or "")
            except ValueError:
                continue
            if math.isfinite(value):
                return value
    return None


# Bodies and joints.


@dataclass(slots=True)
class _UrdfBuilder:
    """Builder of a mechanism from the links and joints of a tree.

    Attributes:
        mechanism: mechanism under construction.
        tree: tree of the file.
        names: names of the elements in the mechanism.
        rotors: rotor inertia Ia by joint name in the file.
        inertials: mass and inertia of each link.
        leaders: for each mimic joint, the joint that it follows.
        points: frame of each link in the mechanism.
    """

    mechanism: Mechanism
    tree: UrdfTree
    names: ElementNames
    rotors: Mapping[str, float]
    inertials: dict[str, Inertial] = field(default_factory=dict)
    leaders: dict[str, str] = field(default_factory=dict)
    points: dict[str, Point] = field(default_factory=dict)

    def build(self, base: Base | None) -> None:
        """Add all bodies, joints and couplings to the mechanism; `base` is "free" or None (fixed).

        Raise a DescriptionError if a number or joint type of the file is invalid.
        """
        tree = self.tree
        for link in tree.links:
            self.inertials[link] = read_inertial(tree.link(link))
        self.leaders = _leaders(tree)
        points = self.points
        points[tree.root] = self._root(base)
        for joint in tree.joints:
            points[joint.child] = self._add(joint, points[joint.parent])
        self._note_massless(base)
        self._add_mimics()

    def _root(self, base: Base | None) -> Point:
        """Add the root link and connect it to the world; return its frame.

        A fixed root that is named "world" or has no mass is the world itself.
        """
        mechanism, link = self.mechanism, self.tree.root
        world, name = mechanism.world.frame, self.names.links[link]
        if base == "free":
            body = mechanism.add(self._body(link))
            mechanism.connect(world, Free(self.names.free, actuated=False), body)
            return body.frame
        if link != "world" and self.inertials[link].mass != 0:
            body = mechanism.add(self._body(link))
            mechanism.connect(world, body)
            return body.frame
        if name not in ("world", "base"):
            mechanism.add_frame(name, world)
        return world

    def _body(self, link: str) -> Body:
        """Return the body of a link with its inertia."""
        inertial = self.tree.links[link].find("inertial")
        return body_of(self.tree.link(link), self.names.links[link], self.inertials[link], inertial)

    def _add(self, joint: JointElement, parent: Point) -> Point:
        """Add a joint and its child link; return the frame of the child.

        `parent` is the frame of the parent link. Raise a DescriptionError for an unknown type.
        """
        body = self.mechanism.add(self._body(joint.child))
        reader = self.tree.joint(joint)
        xyz, turns = origin_of(reader, joint.element)
        point = parent.at(*xyz, rotation=turns or None)
        if joint.kind not in _KINDS:
            reader.fail(f"type {quoted(joint.kind)} is unknown; {did_you_mean(joint.kind, _KINDS)}")
        if joint.kind == "fixed":
            self.mechanism.connect(point, body)
        else:
            self.mechanism.connect(point, self._joint(reader, joint), body)
        return body.frame

    def _joint(self, reader: Reader, joint: JointElement) -> Joint:
        """Return a moving joint as a component with axis, limits, friction and rotor inertia.

        Raise a DescriptionError if its axis has zero length.
        """
        name, kind = self.names.joints[joint.name], joint.kind
        dynamics = joint.element.find("dynamics")
        Fv, Fs = (
            not_negative(reader, dynamics, key, reader.number(dynamics, key, 0.0))
            for key in ("damping", "friction")
        )
        if kind == "floating":
            return Free(name, actuated=False, Fv=Fv, Fs=Fs, Ia=self.rotors.get(joint.name, 0.0))
        axis = reader.vector(joint.element.find("axis"), "xyz", (1.0, 0.0, 0.0))
        if not any(axis):
            reader.fail("its axis has zero length; give a direction")
        if kind == "planar":
            return Planar(name, axis=axis, Fv=Fv, Fs=Fs)
        return _ONE_AXIS[kind](
            name,
            axis=axis,
            actuated=joint.name not in self.leaders,
            limits=None if kind == "continuous" else _limits(reader),
            velocity=_largest(reader, "velocity"),
            effort=_largest(reader, "effort"),
            Fv=Fv,
            Fs=Fs,
            Ia=self.rotors.get(joint.name, 0.0),
        )

    def _note_massless(self, base: Base | None) -> None:
        """Add notes about joints whose descendants have no inertia."""
        tree = self.tree
        moves = {link: not self.inertials[link].is_zero for link in tree.links}
        for joint in reversed(tree.joints):
            moves[joint.parent] |= moves[joint.child]
        text = "it moves nothing that has inertia, so its acceleration is not determined"
        for joint in tree.joints:
            if joint.kind != "fixed" and not moves[joint.child] and joint.name not in self.rotors:
                tree.joint(joint).note("doubted", text)
        if base == "free" and not moves[tree.root]:
            tree.link(tree.root).note("doubted", "nothing of the free robot has inertia")

    def _add_mimics(self) -> None:
        """Add the mimics as couplings: position = offset + multiplier times leading position."""
        taken = {*self.mechanism.components, *self.mechanism.frames}
        for joint in self.tree.joints:
            mimic = joint.element.find("mimic")
            if mimic is None or joint.name not in self.leaders:
                continue
            reader = self.tree.joint(joint)
            offset = reader.number(mimic, "offset", 0.0)
            factor = reader.number(mimic, "multiplier", 1.0)
            driven, driver = (self.names.joints[n] for n in (joint.name, self.leaders[joint.name]))
            name = f"{driven}_mimic"
            while name in taken:
                name += "_"
            taken.add(name)
            self.mechanism.add(Coupling(name, driven, driver, (offset, factor)))


def body_of(reader: Reader, name: str, inertial: Inertial, element: Element | None) -> Body:
    """Return a body with the inertia of the file, with a note if it is physically inconsistent.

    Args:
        reader: reader of the link.
        name: name of the body.
        inertial: inertial of the link.
        element: XML element of the inertial.
    """
    numbers = {"mass": inertial.mass, "com": inertial.com, "inertia": inertial.tensor}
    try:
        body = Body(name, **numbers)
        reason = body.inertia_fault
    except DescriptionError as error:
        reason = str(error).removeprefix(f"{name}: ").partition(";")[0]
    if not reason:
        return body
    reader.note("doubted", f"{reason}, which no body has; taken as it is", element)
    return Body(name, **numbers, checked=False)


def _leaders(tree: UrdfTree) -> dict[str, str]:
    """Return the name of the joint that each mimic joint follows; a note reports invalid mimics."""
    found: dict[str, str] = {}
    last: dict[str, str] = {}
    kinds = {joint.name: joint.kind for joint in tree.joints}
    for joint in tree.joints:
        mimic = joint.element.find("mimic")
        if mimic is not None:
            leader = (mimic.get("joint") or "").strip()
            wrong = _mimic_fault(joint, leader, kinds, last)
            if wrong:
                text = f"it mimics {quoted(leader)}, {wrong}; left out"
                tree.joint(joint).note("ignored", text, mimic)
            else:
                found[joint.name] = last[joint.name] = leader
    return found


def _mimic_fault(
    joint: JointElement, leader: str, kinds: Mapping[str, str], leaders: dict[str, str]
) -> str:
    """Return the reason why a joint cannot follow another joint; empty if it can.

    Args:
        joint: mimic joint.
        leader: name of the joint to follow.
        kinds: types of all joints.
        leaders: joint that each earlier mimic joint follows; long chains are shortened in place.
    """
    if joint.kind not in _ONE_AXIS:
        return f"but is {joint.kind} and has not one position"
    if leader not in kinds:
        return "which does not exist"
    if kinds[leader] not in _ONE_AXIS:
        return f"which is {kinds[leader]} and has not one position"
    passed = []
    while leader in leaders:
        passed.append(leader)
        leader = leaders[leader]
    leaders.update(dict.fromkeys(passed, leader))  # long chains are followed once
    return "which follows it" if leader == joint.name else ""


def not_negative(reader: Reader, element: Element | None, key: str, value: float) -> float:
    """Return a value, or 0 with a note if it is negative.

    Args:
        reader: reader of the joint, which receives the note.
        element: XML element of the value, for the note.
        key: name of the value.
        value: number in the file.
    """
    if value >= 0:
        return value
    reader.note("ignored", f"{key} is {value:g}, less than zero; taken as 0", element)
    return 0.0


_INFINITE = {"inf": math.inf, "infinity": math.inf, "nan": math.nan}


def _limit(reader: Reader, limit: Element | None, key: str) -> float:
    """Return the number in the attribute `key` of a <limit>, which may be infinite or NaN.

    Zero if it is missing.
    """
    text = ("" if limit is None else limit.get(key, "")).strip().lower()
    if text.lstrip("+-") in _INFINITE:
        return _INFINITE[text.lstrip("+-")] * (-1 if text.startswith("-") else 1)
    value = reader.number(limit, key, 0.0, math.inf)
    return value if abs(value) < UNLIMITED else math.copysign(math.inf, value)


def _limits(reader: Reader) -> tuple[float, float] | None:
    """Return the position limits (lower, upper) of a joint from its <limit> element.

    None, with a note, without this element. None unless both are finite and ordered; see
    `limits_of`.
    """
    limit = reader.element.find("limit")
    if limit is None:
        reader.note("completed", "it has no <limit>; taken as unlimited")
        return None
    return limits_of(reader, limit, *(_limit(reader, limit, key) for key in ("lower", "upper")))


def limits_of(
    reader: Reader, limit: Element | None, low: float, high: float
) -> tuple[float, float] | None:
    """Return position limits, or None for limits that are not both finite and ordered.

    Args:
        reader: reader of the joint, which receives a note if limits are given but not usable.
        limit: XML element of the limits, for the note.
        low: lower limit, minus infinity if there is none [rad or m].
        high: upper limit, infinity if there is none [rad or m].
    """
    if low < high and math.isfinite(low) and math.isfinite(high):
        return low, high
    if (low, high) != (-math.inf, math.inf):
        how = "have one end" if low < high else "leave it no range"
        text = f"its limits ({low:g}, {high:g}) {how}; taken as unlimited"
        reader.note("doubted", text, limit)
    return None


def _largest(reader: Reader, key: str) -> float | None:
    """Return the limit of the magnitude of velocity or effort (`key`), None if it is unlimited.

    Zero counts as unlimited, since files contain zero if the limit is unknown. A note reports
    negative values and NaN.
    """
    limit = reader.element.find("limit")
    value = _limit(reader, limit, key)
    if value < 0 or math.isnan(value):
        reader.note("ignored", f"its largest {key} is {value:g}; taken as unlimited", limit)
    return value if 0 < value < math.inf else None


# Shapes of links for pictures: visuals, or else collision shapes.


_PRIMITIVES = {"box": ("size",), "sphere": ("radius",)} | dict.fromkeys(
    ("cylinder", "capsule"), ("radius", "length")
)
"""Attributes of the primitive shapes."""


def material_colours(root: Element) -> dict[str, Vector]:
    """Return the colours (red, green, blue, opacity) of materials, each between 0 and 1, by name.

    The first definition of a name counts.

    Args:
        root: XML element <robot>.
    """
    found: dict[str, Vector] = {}
    own = (m for tag in ("visual", "collision") for v in root.iter(tag) for m in v.iter("material"))
    for material in (*root.findall("material"), *own):
        colour = _rgba(material)
        if colour is not None:
            found.setdefault((material.get("name") or "").strip(), colour)
    return found


def _rgba(material: Element) -> Vector | None:
    """Return the colour (red, green, blue, opacity) in a <material>.

    None if it has no valid one.
    """
    colour = material.find("color")
    text = "" if colour is None else colour.get("rgba", "")
    try:
        values = tuple(min(max(float(part), 0.0), 1.0) for part in text.split())
    except ValueError:
        return None
    return values if len(values) == 4 and not any(map(math.isnan, values)) else None


def add_shapes(
    mechanism: Mechanism,
    tree: UrdfTree,
    points: Mapping[str, Point],
    colours: Mapping[str, Vector],
    meshes: MeshFiles,
) -> None:
    """Add the visuals of the links, or their collision shapes if no visual can be drawn.

    If any link of the file has a visual, links without visuals get no shape.

    Args:
        mechanism: mechanism that receives the shapes.
        tree: tree of the file.
        points: frames of the links, by name.
        colours: colours of materials by name; see `material_colours`.
        meshes: search for the mesh files.
    """
    seen = any(element.find("visual") is not None for element in tree.links.values())
    for link, element in tree.links.items():
        if seen and element.find("visual") is None:
            continue
        for tag in ("visual", "collision"):
            found = []
            for number, part in enumerate(element.findall(tag), start=1):
                reader = Reader(f"{tag} {number} of link {quoted(link)}", part, tree.notes)
                shape = _shape(reader, points[link], colours, meshes)
                if shape is not None:
                    found.append(shape)
            mechanism.shapes.extend(found)
            if found:
                break


def _shape(
    reader: Reader, frame: Point, colours: Mapping[str, Vector], meshes: MeshFiles
) -> tuple[Point, Shape] | None:
    """Return a visual or collision of a link as (frame, shape); None if it cannot be drawn.

    `frame` is that of the link, `colours` are those of materials by name, `meshes` searches mesh
    files.
    """
    element = reader.element
    colour = None
    material = element.find("material")
    if material is not None:
        colour = _rgba(material) or colours.get((material.get("name") or "").strip())
    if colour is not None and colour[3] == 0:
        return None  # it is intentionally invisible
    geometry = element.find("geometry")
    kinds = {} if geometry is None else {inner.tag: inner for inner in geometry}
    kind = next((tag for tag in kinds if tag in _PRIMITIVES or tag == "mesh"), None)
    if kind is None:
        reader.note("ignored", "it has no geometry that is known; not drawn")
        return None
    path = None
    if kind == "mesh":
        path = meshes.find((kinds[kind].get("filename") or "").strip(), line_of(kinds[kind]))
        if path is None:
            return None
    fault = ""
    try:
        xyz, turns = origin_of(reader, element)
        if kind == "mesh":
            size = reader.vector(kinds[kind], "scale", (1.0, 1.0, 1.0))
        elif kind == "box":
            size = reader.vector(kinds[kind], "size", (0.0, 0.0, 0.0))
        else:
            size = tuple(reader.number(kinds[kind], key, 0.0) for key in _PRIMITIVES[kind])
        rgb = None if colour is None else (colour[0], colour[1], colour[2])
        shape = Shape(kind, size, rgb, path)  # type: ignore[arg-type]
        return frame.at(*xyz, rotation=turns or None), shape
    except DescriptionError as error:
        fault = str(error).removeprefix(f"{reader.where}: ").partition(";")[0]
    reader.note("ignored", f"{fault}; not drawn")
    return None
