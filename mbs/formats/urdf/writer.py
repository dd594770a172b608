"""Writer of URDF robot files from tables of numbers."""

from __future__ import annotations

import os
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from mbs.components.joints import Motion
from mbs.formats.link_table import Array, FileFrame, FileLink, LinkTable, inertial_of, largest_of
from mbs.formats.rotations import angles_of
from mbs.formats.urdf.shared import MOMENTS, REDUCTION, ROTOR, UNLIMITED
from mbs.formats.xml import text_of, write_xml


def write_urdf(table: LinkTable, path: str | os.PathLike[str], note: str = "") -> None:
    """Write a robot without loops as a URDF file.

    Args:
        table: tables of the robot at position zero; its joints are revolute, prismatic or free.
        path: path of the .urdf file.
        note: text of a comment at the beginning of the file.

    Raises:
        ModelError: a link has first moments but no mass, or a limit differs by direction.
        ExportError: the file cannot be written.
    """
    root = Element("robot", name=table.name)
    SubElement(root, "link", name="world")
    names = {-1: "world"}
    for j, link in enumerate(table.links):
        names[j] = link.body or _axis_name(table, link)
        _add_link(root, table, link, names[link.antecedent], names[j])
    written = set(names.values())
    for frame in table.frames.values():
        if frame.name not in written:
            _add_fixed_joint(root, frame, names[frame.link])
    write_xml(root, path, note)


def _axis_name(table: LinkTable, link: FileLink) -> str:
    """Return an unused name for a link that has no body and so uses the joint frame of the tree."""
    name = f"{link.name}_axis"
    while name in table.frames:
        name += "_"
    return name


def _add_link(root: Element, table: LinkTable, link: FileLink, parent: str, name: str) -> None:
    """Append the link `name`, the joint to its parent link, and the transmission with its rotor."""
    _inertial(SubElement(root, "link", name=name), *inertial_of(table, link))
    kind = {Motion.FREE: "floating", Motion.PRISMATIC: "prismatic"}.get(link.motion, "revolute")
    velocity, effort = largest_of(table, link, "URDF", UNLIMITED)
    if kind == "revolute" and link.limits is None:
        kind = "continuous"
    joint = SubElement(root, "joint", name=link.name, type=kind)
    SubElement(joint, "parent", link=parent)
    SubElement(joint, "child", link=name)
    _origin(joint, link.placement)
    if link.Fv or link.Fs:
        SubElement(joint, "dynamics", damping=repr(link.Fv), friction=repr(link.Fs))
    if kind != "floating":
        SubElement(joint, "axis", xyz=text_of(link.joint_frame[:3, 2]))
        low, high = link.limits or (-UNLIMITED, UNLIMITED)
        given = {"effort": repr(effort), "velocity": repr(velocity)}
        if kind != "continuous":
            given |= {"lower": repr(low), "upper": repr(high)}
        SubElement(joint, "limit", given)
        _mimic(joint, table, link)
    if link.Ia:
        _transmission(root, link)


def _transmission(root: Element, link: FileLink) -> None:
    """Append the rotor inertia of a joint as a transmission with reduction 1."""
    transmission = SubElement(root, "transmission", name=f"{link.name}_transmission")
    SubElement(transmission, "joint", name=link.name)
    actuator = SubElement(transmission, "actuator", name=f"{link.name}_motor")
    SubElement(actuator, REDUCTION[0]).text = "1"
    SubElement(actuator, ROTOR[0]).text = repr(link.Ia)


def _mimic(joint: Element, table: LinkTable, link: FileLink) -> None:
    """Append <mimic> to a joint if a linear coupling drives it."""
    for coupling in table.couplings:
        if coupling.driven == link.position:
            offset, factor = (*coupling.coefficients, 0.0, 0.0)[:2]
            SubElement(
                joint,
                "mimic",
                joint=table.positions[coupling.driver],
                multiplier=repr(factor),
                offset=repr(offset),
            )


def _add_fixed_joint(root: Element, frame: FileFrame, parent: str) -> None:
    """Append a massless link for a body or named frame, fixed to the link `parent`."""
    SubElement(root, "link", name=frame.name)
    joint = SubElement(root, "joint", name=f"{frame.name}_fixed", type="fixed")
    SubElement(joint, "parent", link=parent)
    SubElement(joint, "child", link=frame.name)
    _origin(joint, frame.pose)


def _origin(element: Element, pose: Array) -> None:
    """Append <origin> with the position and the roll-pitch-yaw angles of a pose (4, 4)."""
    SubElement(element, "origin", xyz=text_of(pose[:3, 3]), rpy=text_of(angles_of(pose[:3, :3])))


def _inertial(link: Element, mass: float, com: Array, tensor: Array) -> None:
    """Append <inertial>, unless it is zero: mass [kg], centre of mass (3,) [m] and inertia.

    `tensor` is the inertia (3, 3) about the centre of mass [kg m^2].
    """
    if mass == 0 and not np.any(tensor):
        return
    inertial = SubElement(link, "inertial")
    SubElement(inertial, "origin", xyz=text_of(com), rpy="0 0 0")
    SubElement(inertial, "mass", value=repr(mass))
    SubElement(inertial, "inertia", {name: repr(float(tensor[at])) for name, at in MOMENTS.items()})
