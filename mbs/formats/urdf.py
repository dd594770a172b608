"""URDF robot files, read as mechanisms.

Only what moves is read: links, inertials, joints, limits, friction and mimics. Visuals and
collisions, and the meshes that they name, are not looked at.

The reader is our own, without MuJoCo's: see "URDF without MuJoCo" in docs/decisions.md.
"""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

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
from mbs.formats.files import component_name, read_text
from mbs.formats.urdf_tree import JointElement, UrdfTree, read_tree
from mbs.formats.urdf_values import Inertial, Reader, origin_of, read_inertial
from mbs.messages import did_you_mean

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
