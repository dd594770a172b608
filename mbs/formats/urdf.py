"""URDF robot files, read as mechanisms.

Only what moves is read: links, inertials, joints, limits, friction and mimics. Visuals and
collisions, and the meshes that they name, are not looked at.

The reader is our own, without MuJoCo's: see "URDF without MuJoCo" in docs/decisions.md.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np

from mbs.components import (
    Body,
    Coupling,
    Free,
    Joint,
    Mechanism,
    Planar,
    Point,
    Prismatic,
    Revolute,
)
from mbs.errors import DescriptionError
from mbs.expressions import plain_numbers
from mbs.formats.files import component_name, read_text
from mbs.text import did_you_mean

# Numbers in URDF elements: vectors, origins and inertials.


Vector = tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Reader:
    """Reads the numbers of one link or joint; `where` says which in the messages."""

    where: str

    def fail(self, message: str) -> NoReturn:
        """Refuse the element."""
        raise DescriptionError(f"{self.where}: {message}")

    def number(self, element: Element | None, key: str, default: float) -> float:
        """One number of an element that may be missing."""
        return self.vector(element, key, (default,))[0]

    def vector(self, element: Element | None, key: str, default: Vector) -> Vector:
        """As many numbers as the default has."""
        text = None if element is None else element.get(key)
        if text is None:
            return default
        return plain_numbers(text, len(default), f"{self.where}: {key}")


@dataclass(frozen=True, slots=True)
class Inertial:
    """Mass [kg], centre of mass [m] and (3, 3) inertia about it [kg m^2], in the link's frame."""

    mass: float = 0.0
    com: Vector = (0.0, 0.0, 0.0)
    tensor: Any = (0.0, 0.0, 0.0)


def origin_of(reader: Reader, element: Element) -> tuple[Vector, list[tuple[str, float]]]:
    """Position [m] and the turns about z, y, x [rad] of the <origin> of an element."""
    origin = element.find("origin")
    xyz = reader.vector(origin, "xyz", (0.0, 0.0, 0.0))
    roll, pitch, yaw = reader.vector(origin, "rpy", (0.0, 0.0, 0.0))
    turns = [(axis, angle) for axis, angle in (("z", yaw), ("y", pitch), ("x", roll)) if angle]
    return xyz, turns


def read_inertial(reader: Reader, link: Element) -> Inertial:
    """The inertial of a link, without mass if it has none.

    Raises:
        DescriptionError: a number is missing or cannot be read.
    """
    inertial = link.find("inertial")
    if inertial is None:
        return Inertial()
    mass, inertia = inertial.find("mass"), inertial.find("inertia")
    if mass is None or mass.get("value") is None:
        reader.fail("its inertial has no mass; give <mass value='...'/>")
    keys = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    Ixx, Ixy, Ixz, Iyy, Iyz, Izz = (reader.number(inertia, key, 0.0) for key in keys)
    com, turns = origin_of(reader, inertial)
    tensor = np.array([[Ixx, Ixy, Ixz], [Ixy, Iyy, Iyz], [Ixz, Iyz, Izz]])
    for axis, angle in reversed(turns):
        R = _turn(axis, angle)
        tensor = np.einsum("ij,jk,lk->il", R, tensor, R)
    tensor = (tensor + tensor.T) / 2
    return Inertial(reader.number(mass, "value", 0.0), com, tensor.tolist())


def _turn(axis: str, angle: float) -> Any:
    k = "xyz".index(axis)
    c, s = math.cos(angle), math.sin(angle)
    R = np.eye(3)
    i, j = (k + 1) % 3, (k + 2) % 3
    R[i, i] = R[j, j] = c
    R[i, j], R[j, i] = -s, s
    return R


# Which links and joints a URDF file has, and how they hang together.


@dataclass(frozen=True, slots=True)
class JointElement:
    """A joint and the links on either side."""

    name: str
    parent: str
    child: str
    element: Element

    @property
    def kind(self) -> str:
        """Its type."""
        return self.element.get("type", "")


@dataclass(frozen=True, slots=True)
class UrdfTree:
    """The links by name, and the joints in an order in which parents come first."""

    path: str
    root: str
    links: Mapping[str, Element]
    joints: tuple[JointElement, ...]

    def reader(self, what: str) -> Reader:
        """A reader of numbers whose messages name the file and the element."""
        return Reader(f"{self.path}: {what}")

    def body_name(self, link: str) -> str:
        """The name of the body of a link; joints, and the base of all models, keep theirs."""
        name = component_name(link)
        taken = {component_name(joint.name) for joint in self.joints if joint.kind != "fixed"}
        if link != self.root:
            taken.add("base")
        return f"{name}_link" if name in taken else name


def read_tree(path: str, root: Element) -> UrdfTree:
    """The links and joints of a <robot>, checked to be a tree.

    Raises:
        DescriptionError: a name is missing, unknown or used twice, or there is not one root.
    """
    _check_elements(path, root)
    links = _named(path, root, "link")
    if not links:
        raise DescriptionError(f"{path}: there is no <link>; give a URDF file with links")
    joints = [
        _joint_element(path, name, element, links)
        for name, element in _named(path, root, "joint").items()
    ]
    parents: dict[str, str] = {}
    for joint in joints:
        if joint.child in parents:
            raise DescriptionError(
                f"{path}: link {joint.child!r} is the child of joints {parents[joint.child]!r} and"
                f" {joint.name!r}; a link has one parent, so close loops with mbs components"
            )
        parents[joint.child] = joint.name
    roots = [name for name in links if name not in parents]
    if len(roots) != 1:
        found = f"the roots {', '.join(map(repr, roots))}" if roots else "no root but a cycle"
        raise DescriptionError(f"{path}: the links have {found}; connect them as one tree")
    return UrdfTree(path, roots[0], links, _ordered(path, roots[0], links, joints))


def _check_elements(path: str, root: Element) -> None:
    for element in root.iter():
        if "xacro" in element.tag:
            raise DescriptionError(
                f"{path}: the file holds xacro macros; expand it with xacro first"
            )
    if root.find("constraint") is not None:
        raise DescriptionError(
            f"{path}: <constraint> is not read; close the loop with mbs components instead"
        )


def _named(path: str, root: Element, tag: str) -> dict[str, Element]:
    named: dict[str, Element] = {}
    for element in root.findall(tag):
        name = (element.get("name") or "").strip()
        if not name:
            raise DescriptionError(f"{path}: a <{tag}> has no name; give it one")
        if name in named:
            raise DescriptionError(f"{path}: two {tag}s are named {name!r}; rename one")
        named[name] = element
    return named


def _joint_element(path: str, name: str, element: Element, links: Iterable[str]) -> JointElement:
    ends = []
    for side in ("parent", "child"):
        end = element.find(side)
        link = "" if end is None else (end.get("link") or "").strip()
        if link not in links:
            raise DescriptionError(
                f"{path}: joint {name!r}: {side} link {link!r} does not exist;"
                f" {did_you_mean(link, links)}"
            )
        ends.append(link)
    return JointElement(name, ends[0], ends[1], element)


def _ordered(
    path: str, root: str, links: Iterable[str], joints: Iterable[JointElement]
) -> tuple[JointElement, ...]:
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
            f"{path}: link {missing[0]!r} is in a cycle of joints; connect the links as one tree"
        )
    return tuple(ordered)


_KINDS = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")
_ONE_AXIS = {"revolute": Revolute, "continuous": Revolute, "prismatic": Prismatic}


def read_urdf(path: str | Path) -> Mechanism:
    """The mechanism in a URDF file.

    Every link becomes a body of its name, fixed ones as well, and every joint that moves a joint
    of its name; blanks, dots and quotes in names become underscores, and a link that is named as
    a joint gets `_link` appended. The root link is the world when it is named "world" or has no
    mass; otherwise it is a body welded to the world. One-axis joints are actuated unless they
    mimic another one; floating ones are not.

    Raises:
        DescriptionError: the file is missing or malformed, or its links and joints form no tree.
    """
    root = parse_xml(path)
    if root.tag != "robot":
        raise DescriptionError(
            f"{path}: the root element is <{root.tag}>, not <robot>; give a URDF file"
        )
    tree = read_tree(str(path), root)
    name = component_name(root.get("name") or Path(path).stem)
    mechanism = Mechanism(name or "robot", source=f"URDF file {Path(path).name}")
    points = {tree.root: _root_point(mechanism, tree)}
    for joint in tree.joints:
        points[joint.child] = _add(mechanism, tree, joint, points[joint.parent])
    for joint in tree.joints:
        _add_mimic(mechanism, tree, joint)
    return mechanism


def parse_xml(path: str | Path) -> Element:
    """The root element of an XML file.

    Raises:
        DescriptionError: the file is missing or is not XML.
    """
    text = read_text(path)
    try:
        return ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError) as error:
        raise DescriptionError(f"{path}: the file is not XML: {error}; correct it") from None


def _root_point(mechanism: Mechanism, tree: UrdfTree) -> Point:
    inertial = read_inertial(tree.reader(f"link {tree.root!r}"), tree.links[tree.root])
    world = mechanism.world.frame
    name = tree.body_name(tree.root)
    if tree.root != "world" and inertial.mass != 0:
        body = mechanism.add(_body(name, inertial))
        mechanism.connect(world, body)
        return body.frame
    if name not in ("world", "base"):
        mechanism.add_frame(name, world)
    return world


def _body(name: str, inertial: Inertial) -> Body:
    return Body(name, mass=inertial.mass, com=inertial.com, inertia=inertial.tensor)


def _add(mechanism: Mechanism, tree: UrdfTree, joint: JointElement, parent: Point) -> Point:
    link = tree.links[joint.child]
    inertial = read_inertial(tree.reader(f"link {joint.child!r}"), link)
    body = mechanism.add(_body(tree.body_name(joint.child), inertial))
    reader = tree.reader(f"joint {joint.name!r}")
    xyz, turns = origin_of(reader, joint.element)
    point = parent.at(*xyz, rotation=turns or None)
    kind = joint.element.get("type", "")
    if kind not in _KINDS:
        reader.fail(f"type {kind!r} is unknown; {did_you_mean(kind, _KINDS)}")
    if kind == "fixed":
        mechanism.connect(point, body)
    else:
        mechanism.connect(point, _joint(reader, joint, kind), body)
    return body.frame


def _joint(reader: Reader, joint: JointElement, kind: str) -> Joint:
    name = component_name(joint.name)
    dynamics = joint.element.find("dynamics")
    Fv = reader.number(dynamics, "damping", 0.0)
    Fs = reader.number(dynamics, "friction", 0.0)
    if kind == "floating":
        return Free(name, actuated=False, Fv=Fv, Fs=Fs)
    axis = reader.vector(joint.element.find("axis"), "xyz", (1.0, 0.0, 0.0))
    if kind == "planar":
        return Planar(name, axis=axis, Fv=Fv, Fs=Fs)
    return _ONE_AXIS[kind](
        name,
        axis=axis,
        actuated=joint.element.find("mimic") is None,
        limits=None if kind == "continuous" else _limits(reader, joint.element),
        velocity=_largest(reader, joint.element, "velocity"),
        effort=_largest(reader, joint.element, "effort"),
        Fv=Fv,
        Fs=Fs,
    )


def _limits(reader: Reader, element: Element) -> tuple[float, float] | None:
    limit = element.find("limit")
    low, high = (reader.number(limit, key, 0.0) for key in ("lower", "upper"))
    return None if low == high == 0 else (low, high)


def _largest(reader: Reader, element: Element, key: str) -> float | None:
    """The largest velocity or effort; files write zero where it is not known."""
    return reader.number(element.find("limit"), key, 0.0) or None


def _add_mimic(mechanism: Mechanism, tree: UrdfTree, joint: JointElement) -> None:
    mimic = joint.element.find("mimic")
    if mimic is None:
        return
    reader = tree.reader(f"joint {joint.name!r}")
    axes = {j.name: component_name(j.name) for j in tree.joints if j.kind in _ONE_AXIS}
    driver = mimic.get("joint", "")
    if joint.name not in axes:
        reader.fail(f"it mimics {driver!r} but is {joint.kind}; only one-axis joints can mimic")
    if driver not in axes:
        reader.fail(
            f"it mimics {driver!r}, which is not a one-axis joint; {did_you_mean(driver, axes)}"
        )
    offset = reader.number(mimic, "offset", 0.0)
    factor = reader.number(mimic, "multiplier", 1.0)
    mechanism.add(
        Coupling(f"{axes[joint.name]}_mimic", axes[joint.name], axes[driver], (offset, factor))
    )
