"""Writer of MuJoCo model files (MJCF) from tables of numbers."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from mbs.components import Damper, Fixed, FixedTendon, Revolute, Rod, Spherical, Spring
from mbs.components.joints import Motion
from mbs.errors import ModelError
from mbs.formats.link_table import (
    Array,
    FileCoupling,
    FileForce,
    FileLink,
    FileLoop,
    LinkTable,
    Place,
    central_inertia,
)
from mbs.formats.mjcf.shared import numbered_name
from mbs.formats.rotations import quaternion_of
from mbs.formats.xml import text_of, write_xml

SAME = 1e-12
"""Deviation from the identity [m or 1] below which two frames are equal except for rounding."""

_LEAST = 2e-15
"""Smallest mass [kg] and principal moment [kg m^2] of moving bodies; MuJoCo requires more than
1e-15."""
_TYPES = {
    Motion.REVOLUTE: "hinge",
    Motion.PRISMATIC: "slide",
    Motion.SPHERICAL: "ball",
    Motion.FREE: "free",
}
_LONGEST_POLYNOMIAL = 5


def write_mjcf(table: LinkTable, path: str | os.PathLike[str], note: str = "") -> None:
    """Write a robot as a model file of MuJoCo.

    Args:
        table: tables of the robot; the drawn positions are the keyframe `home`.
        path: path of the .xml file.
        note: text of a comment at the beginning of the file.

    Raises:
        ModelError: the format does not support a part of the robot, or a number is not finite.
        ExportError: the file cannot be written.
    """
    write_xml(_MjcfWriter(table).model(), path, note)


def refusal(name: str, what: str, remedy: str) -> ModelError:
    """Return the error about a part of a robot that the MJCF format does not support.

    Args:
        name: name of the robot.
        what: the part and the reason.
        remedy: what the user can do.
    """
    return ModelError(f"{name}/{what}; {remedy}")


def is_identity(T: Array) -> bool:
    """Whether a transform is the identity, except for rounding (`SAME` [m or 1]).

    Args:
        T: homogeneous matrix (4, 4).
    """
    return bool(np.max(np.abs(T[:3, 3])) < SAME and np.max(np.abs(T[:3, :3] - np.eye(3))) < SAME)


@dataclass(slots=True)
class _MjcfWriter:
    """Writer of the XML elements of an MJCF file.

    Attributes:
        table: tables of the robot.
        bodies: XML element of the body of each link, by index (-1 for the world).
        tendons: XML element of the tendons.
        sites: number of sites that were added.
        names: names of bodies, joints and elements that are already used.
    """

    table: LinkTable
    bodies: dict[int, Element] = field(default_factory=dict)
    tendons: Element = field(default_factory=lambda: Element("tendon"))
    sites: int = 0
    names: set[str] = field(default_factory=set)

    def model(self) -> Element:
        """Return the root element of the file; call it once.

        Raises:
            ModelError: the format does not support a part of the robot, or a number is not finite.
        """
        table = self.table
        for link in table.links:
            self.names |= {link.name, *link.bodies}
        root = Element("mujoco", model=table.name)
        SubElement(root, "compiler", angle="radian", autolimits="true")
        SubElement(root, "option", gravity=self._text(table.gravity))
        self.bodies[-1] = SubElement(root, "worldbody")
        for j, link in enumerate(table.links):
            self.bodies[j] = self._add_link(link)
        for frame in table.frames.values():
            if frame.kind == "named":
                self._add_site(frame.name, (frame.link, frame.pose))
        for frame in table.frames.values():
            if frame.kind == "fixed" and frame.link < 0:
                given = {"name": frame.name, **self._place(frame.pose)}
                SubElement(self.bodies[-1], "body", given)
        equalities = Element("equality")
        for loop in table.loops:
            self._close(equalities, loop)
        for coupling in table.couplings:
            self._couple(equalities, coupling)
        for force in table.forces:
            self._add_force(force)
        root.extend(part for part in (self.tendons, equalities, self._motors()) if len(part))
        keyframe = SubElement(root, "keyframe")
        SubElement(keyframe, "key", name="home", qpos=self._text(table.drawn))
        return root

    def _refuse(self, what: str, remedy: str) -> ModelError:
        """Return the error for the unsupported part `what` of this robot."""
        return refusal(self.table.name, what, remedy)

    def _text(self, values: Iterable[float]) -> str:
        """Format values separated by blanks, with all digits of a double.

        Raise a ModelError if a value is not finite.
        """
        flat = list(values)
        if not np.all(np.isfinite(flat)):
            raise self._refuse("a number of the file is not finite", "give every parameter a value")
        return text_of(flat)

    def _place(self, T: Array) -> dict[str, str]:
        """Return the XML attributes pos and quat of a pose (4, 4); identity parts are omitted."""
        p, R = T[:3, 3], T[:3, :3]
        found = {}
        if np.max(np.abs(p)) > 0:
            found["pos"] = self._text(p)
        if np.max(np.abs(R - np.eye(3))) > SAME:
            found["quat"] = self._text(quaternion_of(R))
        return found

    # Bodies and their joints.

    def _add_link(self, link: FileLink) -> Element:
        """Append the body of a link, with inertia, joint and further bodies; return its element."""
        is_free = link.motion is Motion.FREE
        if is_free and not is_identity(link.joint_pose):
            raise self._refuse(
                f"{link.name}: in an MJCF file the position of a free joint is that in the world",
                "connect the joint from the world's own frame",
            )
        name = link.body or self._unused_name(f"{link.name}_link")
        body = SubElement(self.bodies[link.antecedent], "body", name=name)
        body.attrib |= {} if is_free else self._place(link.placement)
        self._add_inertia(body, link)
        self._add_joint(body, link)
        for other in link.bodies:
            if other != link.body:
                pose = self.table.frames[other].pose
                SubElement(body, "body", {"name": other, **self._place(pose)})
        return body

    def _unused_name(self, name: str) -> str:
        """Return a name that is not used in the file yet, based on `name`, and mark it as used."""
        found = numbered_name(name, self.names)
        self.names.add(found)
        return found

    def _add_inertia(self, body: Element, link: FileLink) -> None:
        """Append <inertial>: mass, centre of mass, principal moments about it and their axes."""
        R, p = link.frame[:3, :3].copy(), link.frame[:3, 3].copy()
        mass, com, J = central_inertia(link.inertia)
        if not mass and np.any(link.inertia[6:9]):
            raise self._refuse(
                f"{body.get('name')}: it has first moments and no mass, which MuJoCo refuses",
                "give it the inertia of a body",
            )
        if link.motion is Motion.REVOLUTE and link.antecedent < 0:
            # moments across an axis that does not move have no effect; robot tables omit them
            J[:2, :2] += max(0.0, J[2, 2] - J[0, 0] - J[1, 1]) / 2 * np.eye(2)
        J = R.T @ J @ R
        moments, axes = np.linalg.eigh((J + J.T) / 2)
        if np.linalg.det(axes) < 0:
            axes[:, 0] = -axes[:, 0]
        scale = max(float(np.max(np.abs(link.inertia))), _LEAST)
        rounding = 1e-9 * scale  # rounding error of the moments after the shift to the centre
        possible = moments[0] > -rounding and moments[0] + moments[1] > moments[2] - rounding
        if mass < 0 or not possible:
            raise self._refuse(
                f"{body.get('name')}: mass {mass:g} kg and principal moments"
                f" {moments[0]:g}, {moments[1]:g}, {moments[2]:g} kg m^2 are of no body, which"
                " MuJoCo refuses",
                "give it the inertia of a body",
            )
        moments = np.maximum(moments, _LEAST)
        # rounding may violate the triangle inequality of a flat body; MuJoCo has no tolerance
        moments[2] = min(moments[2], moments[0] + moments[1])
        given = {
            "pos": self._text(R.T @ (com - p)),
            "mass": repr(max(mass, _LEAST)),
            "diaginertia": self._text(moments),
        }
        if not np.allclose(axes, np.eye(3), rtol=0, atol=SAME):
            given["quat"] = self._text(quaternion_of(axes))
        SubElement(body, "inertial", given)

    def _add_joint(self, body: Element, link: FileLink) -> None:
        """Append the joint of a link with its friction, spring, limits and rotor inertia."""
        given: dict[str, str] = {"name": link.name, "type": _TYPES[link.motion]}
        if link.motion is not Motion.FREE:
            given |= {"pos": self._text(link.joint_frame[:3, 3])}
        if link.motion in (Motion.REVOLUTE, Motion.PRISMATIC):
            given |= {"axis": self._text(link.joint_frame[:3, 2])}
        for name, value in (
            ("damping", link.Fv),
            ("frictionloss", link.Fs),
            ("armature", link.Ia),
            ("stiffness", link.stiffness),
            ("springref", link.rest),
        ):
            if value:
                given[name] = self._text([value])
        if link.limits is not None:
            given["range"] = self._text(link.limits)
        if link.effort is not None and all(map(math.isfinite, link.effort)):
            given["actuatorfrcrange"] = self._text(link.effort)
        SubElement(body, "joint", given)

    def _add_site(self, name: str, place: Place) -> str:
        """Append a site to the body at `place` (link index and pose), and return its name."""
        number, pose = place
        SubElement(self.bodies[number], "site", {"name": name, **self._place(pose)})
        return name

    def _new_site(self, place: Place) -> str:
        """Append a site at `place` (link index and pose), and return its generated name."""
        self.sites += 1
        return self._add_site(self._unused_name(f"point{self.sites}"), place)

    # Loops and couplings.

    def _close(self, equalities: Element, loop: FileLoop) -> None:
        """Append the equalities that close a loop to the element `equalities`."""
        joint = loop.joint
        if loop.welded or isinstance(joint, Fixed):
            self._equality(equalities, "weld", joint.name, loop.ends[0])
        elif isinstance(joint, Spherical):
            self._equality(equalities, "connect", joint.name, loop.ends[0])
        elif isinstance(joint, Rod):
            name = self._unused_name(f"{joint.name}_line")
            tendon = SubElement(self.tendons, "spatial", name=name)
            for place in loop.ends[0]:
                SubElement(tendon, "site", site=self._new_site(place))
            # the equality of MuJoCo is relative to the length at qpos0
            self._tendon_equality(equalities, joint.name, name, loop.excess)
        elif isinstance(joint, Revolute):
            # connect constraints at two points of the axis
            for k, pair in enumerate(loop.ends):
                name = joint.name if not k else self._unused_name(f"{joint.name}_axis")
                self._equality(equalities, "connect", name, pair)
        else:
            raise self._refuse(
                f"{joint.name}: in an MJCF file a loop is closed by a fixed, spherical or revolute"
                f" joint or by a rod, not by a {type(joint).__name__}",
                "cut the loop at another joint with m.cut(joint)",
            )

    def _equality(
        self, equalities: Element, kind: str, name: str, pair: tuple[Place, Place]
    ) -> None:
        """Append an equality of the given kind between two new sites at the frames of `pair`."""
        one, two = self._new_site(pair[0]), self._new_site(pair[1])
        SubElement(equalities, kind, name=name, site1=one, site2=two)

    def _tendon_equality(
        self, equalities: Element, name: str, tendon: str, constant: float
    ) -> None:
        """Append the equality: length of a tendon = its length at qpos0 + constant [m or rad]."""
        polynomial = self._text([constant, 0.0, 0.0, 0.0, 0.0])
        SubElement(equalities, "tendon", name=name, tendon1=tendon, polycoef=polynomial)

    def _couple(self, equalities: Element, coupling: FileCoupling) -> None:
        """Append a coupling as a joint equality, or as a fixed tendon for more than two joints."""
        names, terms = self.table.positions, coupling.coefficients
        if len(terms) > (2 if coupling.others else _LONGEST_POLYNOMIAL):
            raise self._refuse(
                f"{coupling.name}: an equality of an MJCF file is a polynomial of degree 4,"
                " and of degree 1 between more than two joints",
                "take another coupling",
            )
        if not coupling.others:
            SubElement(
                equalities,
                "joint",
                name=coupling.name,
                joint1=names[coupling.driven],
                joint2=names[coupling.driver],
                polycoef=self._text((*terms, *(0.0,) * (_LONGEST_POLYNOMIAL - len(terms)))),
            )
            return
        constant, slope = (*terms, 0.0, 0.0)[:2]
        others = {number: -factor for number, factor in coupling.others}
        levers = {coupling.driven: 1.0, coupling.driver: -slope, **others}
        tendon = self._unused_name(f"{coupling.name}_sum")
        self._fixed_tendon(tendon, {names[k]: c for k, c in levers.items()}, {})
        self._tendon_equality(equalities, coupling.name, tendon, constant)

    def _fixed_tendon(self, name: str, levers: Mapping[str, float], given: dict[str, str]) -> None:
        """Append a fixed tendon: sum of factors times joint positions.

        `levers` are the factors by joint name, `given` further XML attributes.
        """
        tendon = SubElement(self.tendons, "fixed", {"name": name, **given})
        for joint, factor in levers.items():
            if factor:
                SubElement(tendon, "joint", joint=joint, coef=repr(factor))

    # Forces and motors.

    def _add_force(self, force: FileForce) -> None:
        """Append a spring, damper or fixed tendon; raise a ModelError for other force elements."""
        element = force.element

        def text(name: str) -> str:
            return self._text(force.values[name])

        if isinstance(element, (Spring, Damper)):
            given = {"damping": text("damping")}
            if isinstance(element, Spring):
                given |= {"stiffness": text("stiffness"), "springlength": text("length")}
            tendon = SubElement(self.tendons, "spatial", {"name": element.name, **given})
            for place in force.places:
                SubElement(tendon, "site", site=self._new_site(place))
        elif isinstance(element, FixedTendon):
            given = {
                "stiffness": text("stiffness"),
                "springlength": text("length"),
                "damping": text("damping"),
                "frictionloss": text("friction"),
            }
            self._fixed_tendon(element.name, force.levers, given)
        else:
            raise self._refuse(
                f"{element.name}: an MJCF file has no {type(element).__name__}",
                "take it out; springs, dampers and fixed tendons are written",
            )

    def _motors(self) -> Element:
        """Return an element with one motor per degree of freedom of the actuated joints."""
        actuators = Element("actuator")
        for link in self.table.links:
            if not link.actuated:
                continue
            size = link.motion.nv
            for k in range(size):
                own = link.name if size == 1 else f"{link.name}_{k + 1}"
                gear = " ".join("1" if i == k else "0" for i in range(size))
                SubElement(actuators, "motor", name=own, joint=link.name, gear=gear)
        return actuators
