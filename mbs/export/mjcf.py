"""Export of mechanisms as MuJoCo model files (MJCF): links as bodies, loops as equalities."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from typing import Any
from xml.etree.ElementTree import Element, SubElement

import casadi
import numpy as np
from casadi import DM, SX, Function
from numpy.typing import NDArray

from mbs.assembly import System
from mbs.assembly.khalil_frames import Cut
from mbs.assembly.parts import AttachedPart
from mbs.assembly.tree import Frame, Link, quaternion_slices
from mbs.components import (
    Damper,
    Fixed,
    FixedTendon,
    Revolute,
    Rod,
    Spherical,
    Spring,
)
from mbs.components.joints import Motion
from mbs.errors import ModelError
from mbs.export.robot_files import (
    check_backward_drives,
    child_positions,
    shapes_left_out,
    system_of,
    write_xml,
)
from mbs.expressions import to_sx
from mbs.mechanism import Mechanism
from mbs.recursions.route import relative_pose
from mbs.spatial import Pose

Vector = NDArray[np.float64]

_LEAST = 2e-15
"""Smallest mass [kg] and principal moment [kg m^2] of moving bodies; MuJoCo requires more than
1e-15."""
_SAME = 1e-12
"""Deviation from the identity [m or 1] below which two frames are equal except for rounding."""
_APART = 0.1
"""Distance [m] between the two connect points of a revolute joint that closes a loop."""
_TYPES = {
    Motion.REVOLUTE: "hinge",
    Motion.PRISMATIC: "slide",
    Motion.SPHERICAL: "ball",
    Motion.FREE: "free",
}
_LONGEST_POLYNOMIAL = 5


def mjcf(
    system: System | Mechanism,
    path: str | os.PathLike[str],
    parameters: Mapping[str, float] | None = None,
) -> None:
    """Write a mechanism as a model file of MuJoCo.

    Every link becomes a body, a child of its antecedent. The body has the name of the first body on
    the link and the total inertia. Other bodies become massless child bodies. q equals qpos of
    MuJoCo, and the assembled configuration is the keyframe `home`. Only spherical and free joints
    with the
    child body on frame_a differ: their qpos is the pose of the child body in the parent body. A
    loop becomes a connect or weld constraint, which is soft in MuJoCo. Couplings become equalities
    of joints or fixed tendons, and springs and dampers between points become spatial tendons.
    Actuated joints have motors of gear 1.

    The file does not contain symbols (only their values), velocity limits, and the width of Coulomb
    friction, which is a constraint in MuJoCo. Zero masses and moments of moving bodies become
    2e-15, because MuJoCo requires positive values. The moments of the first link across its
    revolute axis have no effect, and robot tables omit them. They are increased to values that a
    rigid body can have.

    Args:
        system: any mechanism. A Mechanism is assembled first.
        path: path of the .xml file.
        parameters: dict of values of symbols. Other symbols have their default values.

    Raises:
        ModelError: system has another type, or the format does not support a part of it.
        ExportError: the file cannot be written.
    """
    system = system_of(system)
    root = _Writer(system, parameters).model()
    write_xml(root, path, shapes_left_out(system))


class _Writer:
    """Writer of the XML elements of an MJCF file.

    Attributes:
        system: mechanism to write.
        bodies: XML element of the body of each link, the base first, and the pose of the body frame
            in the link frame.
        sites: number of sites that were added.
    """

    def __init__(self, system: System, parameters: Mapping[str, float] | None) -> None:
        self.system = system
        self._p = DM(system.parameter_values(parameters)) if system.parameters else DM(0, 1)
        self.bodies: list[tuple[Element, Pose]] = []
        self.tendons = Element("tendon")
        self.sites = 0
        self._symbols = dict(
            zip((p.name for p in system.parameters), casadi.vertsplit(system.p), strict=True)
        )
        self._names = {row.name for row in system.bodies} | {
            link.name for link in system.tree.links
        }

    def model(self) -> Element:
        """Return the root element of the file."""
        system = self.system
        self._check()
        root = Element("mujoco", model=system.name)
        SubElement(root, "compiler", angle="radian", autolimits="true")
        SubElement(root, "option", gravity=self._text(system.tree.gravity))
        world = SubElement(root, "worldbody")
        self.bodies.append((world, Pose.identity()))
        for number, link in enumerate(system.tree.links, start=1):
            self._add_link(number, link)
        for name, (number, pose) in system.frames.items():
            if name in system.named_frames:
                self._add_site(name, (number, pose))
        self._add_static_bodies()
        equalities = Element("equality")
        for cut in system.cuts:
            self._close(equalities, cut)
        self._couple(equalities)
        for force in system.parts:
            self._add_force(force)
        root.extend(part for part in (self.tendons, equalities, self._motors()) if len(part))
        qpos = child_positions(system, system.configuration)
        frame = SubElement(root, "keyframe")
        SubElement(frame, "key", name="home", qpos=self._text(DM(qpos)))
        return root

    def _refuse(self, what: str, remedy: str) -> ModelError:
        return ModelError(f"{self.system.name}/{what}; {remedy}")

    def _check(self) -> None:
        """Raise ModelError if the format does not support a part of the system."""
        system = self.system
        check_backward_drives(system, "MJCF")
        for part in [*(row.name for row in system.shafts), *(row.name for row in system.devices)]:
            raise self._refuse(
                f"{part}: an MJCF file has no drive lines", "give Ia and effort to the joint"
            )
        for link in system.tree.links:
            if link.rotor is not None:
                raise self._refuse(
                    f"{link.name}: an MJCF file has no rotor about an axis of its own",
                    "give its inertia seen at the joint as Ia",
                )
            if link.motion is Motion.FREE and link.antecedent >= 0:
                raise self._refuse(
                    f"{link.name}: in an MJCF file a free joint is on the world",
                    "connect it from the world",
                )

    def _zero(self) -> SX:
        """Return the configuration (nq, 1) that is qpos0 in the file: zero, or unit quaternions."""
        q = SX.zeros(self.system.nq)
        for part in quaternion_slices(self.system.tree):
            q[part.start] = 1
        return q

    # Numeric values of expressions.

    def _number(self, value: Any) -> Vector:
        """Evaluate an expression at the values of the symbols. Returns an array of its shape."""
        expression = SX(value)
        if expression.is_constant():
            return np.array(DM(expression))
        return np.array(Function("value", [self.system.p], [expression])(self._p))

    def _float(self, value: Any) -> float:
        return float(self._number(value).item())

    def _text(self, values: Any) -> str:
        """Format values separated by blanks, with all digits of a double."""
        flat = self._number(values).ravel(order="F")
        if not np.all(np.isfinite(flat)):
            raise self._refuse("a number of the file is not finite", "give every parameter a value")
        return " ".join(repr(float(value) + 0.0) for value in flat)

    def _place(self, pose: Pose) -> dict[str, str]:
        """Return the attributes pos and quat of a frame, omitted if they are the identity."""
        p, R = self._number(pose.p).ravel(), self._number(pose.R)
        found = {}
        if np.max(np.abs(p)) > 0:
            found["pos"] = self._text(p)
        if np.max(np.abs(R - np.eye(3))) > _SAME:
            found["quat"] = self._text(_quaternion(R))
        return found

    # Bodies and their joints.

    def _add_link(self, number: int, link: Link) -> None:
        system = self.system
        bodies = [row.name for row in system.bodies if row.link == number]
        above, frame_above = self.bodies[link.antecedent + 1]
        is_free = link.motion is Motion.FREE
        # the MJCF body has the frame of the first body; for quaternion joints that of the link
        own = Pose.identity()
        main = bodies[0] if bodies else None
        if main is not None:
            pose = system.frames[main][1]
            if link.motion in (Motion.REVOLUTE, Motion.PRISMATIC) or self._is_identity(pose):
                own = pose
            else:
                main = None
        at = frame_above.inverse() @ link.pose() @ own
        if is_free and not self._is_identity(link.pose()):
            raise self._refuse(
                f"{link.name}: in an MJCF file the position of a free joint is that in the world",
                "connect the joint from the world's own frame",
            )
        body = SubElement(above, "body", name=main or self._unused_name(f"{link.name}_link"))
        body.attrib |= {} if is_free else self._place(at)
        self._add_inertia(body, link, own)
        self._add_joint(body, link, own)
        self.bodies.append((body, own))
        for name in bodies:
            if name != main:
                pose = own.inverse() @ system.frames[name][1]
                SubElement(body, "body", {"name": name, **self._place(pose)})

    def _is_identity(self, pose: Pose) -> bool:
        p, R = self._number(pose.p), self._number(pose.R)
        return bool(np.max(np.abs(p)) < _SAME and np.max(np.abs(R - np.eye(3))) < _SAME)

    def _unused_name(self, name: str) -> str:
        found, number = name, 2
        while found in self._names:
            found, number = f"{name}{number}", number + 1
        self._names.add(found)
        return found

    def _add_inertia(self, body: Element, link: Link, own: Pose) -> None:
        """Append <inertial>: mass, centre of mass, principal moments about it and their axes."""
        R, p = self._number(own.R), self._number(own.p).ravel()
        ten = self._number(link.inertia.parameters).ravel()
        XX, XY, XZ, YY, YZ, ZZ, *first, mass = (float(value) for value in ten)
        J = np.array([[XX, XY, XZ], [XY, YY, YZ], [XZ, YZ, ZZ]])
        com = np.array(first) / mass if mass else np.zeros(3)
        if not mass and np.any(first):
            raise self._refuse(
                f"{body.get('name')}: it has first moments and no mass, which MuJoCo refuses",
                "give it the inertia of a body",
            )
        J = J - mass * (com @ com * np.eye(3) - np.outer(com, com))
        if link.motion is Motion.REVOLUTE and link.antecedent < 0:
            # moments across an axis that does not move have no effect; robot tables omit them
            J[:2, :2] += max(0.0, J[2, 2] - J[0, 0] - J[1, 1]) / 2 * np.eye(2)
        J = R.T @ J @ R
        moments, axes = np.linalg.eigh((J + J.T) / 2)
        if np.linalg.det(axes) < 0:
            axes[:, 0] = -axes[:, 0]
        scale = max(float(np.max(np.abs(ten))), _LEAST)
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
        if not np.allclose(axes, np.eye(3), rtol=0, atol=_SAME):
            given["quat"] = self._text(_quaternion(axes))
        SubElement(body, "inertial", given)

    def _add_joint(self, body: Element, link: Link, own: Pose) -> None:
        system, motion = self.system, link.motion
        speed = system.speeds[link.v.start]
        coordinate = system.coordinates[link.q.start]
        back = own.inverse()
        given: dict[str, str] = {"name": link.name, "type": _TYPES[motion]}
        if motion is not Motion.FREE:
            given |= {"pos": self._text(back.p)}
        if motion in (Motion.REVOLUTE, Motion.PRISMATIC):
            given |= {"axis": self._text(back.R[:, 2])}
        for name, value in (
            ("damping", link.Fv),
            ("frictionloss", link.Fs),
            ("armature", link.Ia),
            ("stiffness", link.stiffness),
            ("springref", link.rest),
        ):
            if self._float(value):
                given[name] = self._text(value)
        if coordinate.limits is not None:
            given["range"] = self._text(DM(coordinate.limits))
        if speed.effort is not None and all(map(math.isfinite, speed.effort)):
            given["actuatorfrcrange"] = self._text(DM(speed.effort))
        SubElement(body, "joint", given)

    def _add_static_bodies(self) -> None:
        """Append the bodies that are fixed to the world."""
        moving = {row.name for row in self.system.bodies}
        world, _ = self.bodies[0]
        for name, (number, pose) in self.system.frames.items():
            known = name in moving or name in self.system.named_frames or name == "base"
            if number < 0 and not known and name not in self._joint_names:
                SubElement(world, "body", {"name": name, **self._place(pose)})

    @property
    def _joint_names(self) -> set[str]:
        return {"world", *(row.name for row in self.system.joints)}

    def _add_site(self, name: str, frame: Frame) -> str:
        number, pose = frame
        body, own = self.bodies[number + 1]
        SubElement(body, "site", {"name": name, **self._place(own.inverse() @ pose)})
        return name

    def _new_site(self, frame: Frame) -> str:
        self.sites += 1
        return self._add_site(self._unused_name(f"point{self.sites}"), frame)

    # Loops and couplings.

    def _close(self, equalities: Element, cut: Cut) -> None:
        joint = cut.edge.joint
        frame_a, frame_b = cut.frames
        if cut.welded or isinstance(joint, Fixed):
            self._equality(equalities, "weld", joint.name, frame_a, frame_b)
        elif isinstance(joint, Spherical):
            self._equality(equalities, "connect", joint.name, frame_a, frame_b)
        elif isinstance(joint, Rod):
            tendon = SubElement(
                self.tendons, "spatial", name=self._unused_name(f"{joint.name}_line")
            )
            for frame in cut.frames:
                SubElement(tendon, "site", site=self._new_site(frame))
            # the equality of MuJoCo is relative to the length at qpos0
            at_zero = relative_pose(self.system.tree, self._zero(), *cut.frames).p
            longer = casadi.SX(to_sx(joint.length, self._symbols)) - casadi.norm_2(at_zero)
            SubElement(
                equalities,
                "tendon",
                name=joint.name,
                tendon1=tendon.get("name", ""),
                polycoef=self._text(casadi.vertcat(longer, SX.zeros(4))),
            )
        elif isinstance(joint, Revolute):
            # connect constraints at two points of the axis
            for k, along in enumerate((-_APART / 2, _APART / 2)):
                shift = Pose.translation(SX(DM(along * np.array(joint.axis))))
                ends = [(number, pose @ shift) for number, pose in (frame_a, frame_b)]
                name = joint.name if not k else self._unused_name(f"{joint.name}_axis")
                self._equality(equalities, "connect", name, *ends)
        else:
            raise self._refuse(
                f"{joint.name}: in an MJCF file a loop is closed by a fixed, spherical or revolute"
                f" joint or by a rod, not by a {type(joint).__name__}",
                "cut the loop at another joint with m.cut(joint)",
            )

    def _equality(
        self, equalities: Element, kind: str, name: str, frame_a: Frame, frame_b: Frame
    ) -> None:
        one, two = self._new_site(frame_a), self._new_site(frame_b)
        SubElement(equalities, kind, name=name, site1=one, site2=two)

    def _couple(self, equalities: Element) -> None:
        names = [coordinate.name for coordinate in self.system.coordinates]
        for coupling in self.system.couplings:
            terms = [self._float(c) for c in coupling.coefficients]
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
                    polycoef=self._text(DM(terms + [0.0] * (_LONGEST_POLYNOMIAL - len(terms)))),
                )
                continue
            constant, slope = (*terms, 0.0, 0.0)[:2]
            others = {number: -self._float(factor) for number, factor in coupling.others}
            levers = {coupling.driven: 1.0, coupling.driver: -slope, **others}
            tendon = self._unused_name(f"{coupling.name}_sum")
            self._fixed_tendon(tendon, {names[k]: c for k, c in levers.items()}, {})
            SubElement(
                equalities,
                "tendon",
                name=coupling.name,
                tendon1=tendon,
                polycoef=self._text(DM([constant, 0, 0, 0, 0])),
            )

    def _fixed_tendon(self, name: str, levers: Mapping[str, float], given: dict[str, str]) -> None:
        tendon = SubElement(self.tendons, "fixed", {"name": name, **given})
        for joint, factor in levers.items():
            if factor:
                SubElement(tendon, "joint", joint=joint, coef=repr(factor))

    # Forces and motors.

    def _add_force(self, force: AttachedPart) -> None:
        element = force.element

        def text(*values: Any) -> str:
            return self._text(casadi.vertcat(*(to_sx(value, force.symbols) for value in values)))

        if isinstance(element, (Spring, Damper)):
            given = {"damping": text(element.damping)}
            if isinstance(element, Spring):
                given |= {"stiffness": text(element.stiffness)}
                given |= {"springlength": text(element.length)}
            tendon = SubElement(self.tendons, "spatial", {"name": element.name, **given})
            for frame in force.frames:
                SubElement(tendon, "site", site=self._new_site(frame))
        elif isinstance(element, FixedTendon):
            names = [speed.name for speed in self.system.speeds]
            levers = {names[lever.velocity]: self._float(lever.factor) for lever in force.levers}
            given = {
                "stiffness": text(element.stiffness),
                "springlength": text(*element.length),
                "damping": text(element.damping),
                "frictionloss": text(element.friction),
            }
            self._fixed_tendon(element.name, levers, given)
        else:
            raise self._refuse(
                f"{element.name}: an MJCF file has no {type(element).__name__}",
                "take it out; springs, dampers and fixed tendons are written",
            )

    def _motors(self) -> Element:
        actuators = Element("actuator")
        for link in self.system.tree.links:
            if not self.system.speeds[link.v.start].actuated:
                continue
            size = link.motion.nv
            for k in range(size):
                own = link.name if size == 1 else f"{link.name}_{k + 1}"
                gear = " ".join("1" if i == k else "0" for i in range(size))
                SubElement(actuators, "motor", name=own, joint=link.name, gear=gear)
        return actuators


def _quaternion(R: Vector) -> Vector:
    """Return the unit quaternion (w, x, y, z) of a rotation matrix (3, 3).

    It is computed from its largest element. Source: Shepperd 1978.
    """
    trace = float(np.trace(R))
    squares = np.array([trace, R[0, 0], R[1, 1], R[2, 2]])
    k = int(np.argmax(squares))
    if k == 0:
        q = np.array(
            [1 + trace, R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]], dtype=float
        )
    else:
        x, y, z = k - 1, k % 3, (k + 1) % 3
        q = np.zeros(4)
        q[0] = R[z, y] - R[y, z]
        q[1 + x] = 1 + 2 * R[x, x] - trace
        q[1 + y] = R[y, x] + R[x, y]
        q[1 + z] = R[z, x] + R[x, z]
    unit: Vector = q / np.linalg.norm(q)
    return unit
