"""Tables of a system from which robot files are written.

A table of frames has Khalil parameters as expressions (.par, TOML). A table of links has numbers
(URDF, SDF, MJCF).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import casadi
import numpy as np
from casadi import DM, SX, Function

from mbs.assembly import System
from mbs.assembly.component_instances import ComponentInstance
from mbs.assembly.khalil_frames import Cut
from mbs.assembly.tree import Frame, Link, quaternion_slices, zero_position
from mbs.components import Damper, FixedTendon, Revolute, Rod, Spring
from mbs.components.description import OUTER_WORLD
from mbs.components.joints import Motion
from mbs.errors import ModelError
from mbs.expressions import to_sx
from mbs.formats import CutRow, FrameRow, InertiaRow, RobotTable
from mbs.formats.link_table import (
    Array,
    FileCoupling,
    FileForce,
    FileFrame,
    FileLink,
    FileLoop,
    LinkTable,
    Place,
)
from mbs.formats.mjcf.writer import is_identity
from mbs.formats.rotations import inverse
from mbs.formats.table import BODY_SCALARS, GEOMETRY, POSE, base_pose_texts
from mbs.formats.urdf.shared import GRAVITY
from mbs.operations.graph import graph_of
from mbs.recursions.link_motions import link_poses
from mbs.recursions.route import relative_pose
from mbs.spatial import Khalil, Pose, align_z, frames_to, origin
from mbs.spatial.inertia import TEN_PARAMETERS
from mbs.spatial.rotation import quaternion_rotation
from mbs.text import listed, quoted

# Pose of the base.


def base_pose(system: System) -> Array | None:
    """Return the pose (4, 4) of the base in the outer world, symbols at their default values.

    None without a mount, or if one of its symbols has no value.

    Args:
        system: mechanism to write.
    """
    if OUTER_WORLD not in system.frames:
        return None
    _, pose = system.frames[OUTER_WORLD]
    matrix = Function("base", [system.p], [casadi.densify(pose.inverse().matrix)])
    found = np.array(matrix(system.p_default))
    return found if np.isfinite(found).all() else None


# Table of frames.


Text = Callable[[SX], str]
"""Function that writes a scalar expression in the grammar of the file."""

_SIGMA = {Motion.REVOLUTE: 0, Motion.PRISMATIC: 1}
_OF_THE_JOINT = [name for name in BODY_SCALARS if name not in TEN_PARAMETERS]
"""Joint quantities of a body row, such as Fv. They have the same names as attributes of a link."""


def robot_table(system: System, file: str = ".par") -> RobotTable:
    """Return the table of frames of a system: link j is frame j with joint variable q<j>.

    Fixed frames on the path to a link come before it and increase its index. Cut joints are last.

    Args:
        system: mechanism as for `mbs.export.par`.
        file: file extension, for error messages.

    Raises:
        ModelError: the format does not support a motion, coupling or force element.
    """
    _check_frames(system, file)
    text = text_function(system)
    size = max(map(_length, _shifts(system)), default=0.0) or 1.0
    frames: list[FrameRow] = []
    number = {-1: 0}  # link index to frame index in the file; the base is frame 0
    for j, link in enumerate(system.tree.links):
        before = number[link.antecedent]
        for frame in link.via:
            frames.append(FrameRow(before, 2, None, **_geometry(frame, text)))
            before = len(frames)
        motor = system.velocity_coordinates[j].actuated
        kind = _SIGMA[link.motion]
        frames.append(FrameRow(before, kind, motor, **_geometry(link.placement, text)))
        number[j] = len(frames)
    moving, fixed = list[FrameRow](), list[FrameRow]()
    for cut in system.cuts:
        for link_number, pose, rows in (
            (cut.link_a, cut.pose_a, moving),
            (cut.link_b, cut.pose_b, fixed),
        ):
            axis = cut.edge.joint.freedoms[0].axis
            *via, own = frames_to(pose @ Pose.rotation(align_z(axis)), size)
            before = number[link_number]
            for frame in via:
                frames.append(FrameRow(before, 2, None, **_geometry(frame, text)))
                before = len(frames)
            sigma = _SIGMA[cut.edge.joint.freedoms[0].motion] if rows is moving else 2
            motor_of_cut = False if rows is moving else None
            rows.append(FrameRow(before, sigma, motor_of_cut, **_geometry(own, text)))
    first, count = len(frames) + 1, len(system.cuts)
    loops = [
        CutRow((first + k, first + count + k), cut.edge.joint.freedoms[0].motion.value)
        for k, cut in enumerate(system.cuts)
    ]
    names = [f"q{number[j]}" for j in range(len(system.tree.links))]
    configuration = dict(zip(names, system.configuration, strict=True)) if system.cuts else {}
    base = base_pose(system)
    table = RobotTable(
        name=system.name,
        frames=(*frames, *moving, *fixed),
        bodies=tuple(_body(number[j], link, text) for j, link in enumerate(system.tree.links)),
        loops=tuple(loops),
        gravity=tuple(text(system.tree.gravity[k]) for k in range(3)),
        source=system.source,
        guess={name: value for name, value in configuration.items() if value},
        extras={} if base is None else {POSE: base_pose_texts(base)},
    )
    # symbols may have cancelled, such as a length along the axis of the last link
    defaults = {p.name: p.default for p in system.parameters if p.name in table.symbols}
    values = {name: value for name, value in defaults.items() if value is not None}
    return replace(table, parameters=values)


def _shifts(system: System) -> Iterator[SX]:
    """Yield the origins (3, 1) [m] of links and cut joints in the frames of their antecedents."""
    defaults = SX(DM(system.p_default))
    for p in (
        *(link.pose().p for link in system.tree.links),
        *(pose.p for cut in system.cuts for _, pose in cut.frames),
    ):
        yield SX(casadi.substitute(p, system.p, defaults)) if casadi.symvar(p) else p


def _length(p: SX) -> float:
    """Return the length [m] of a vector, or zero if it contains NaN of a symbol without value."""
    length = float(casadi.norm_2(DM(p)))
    return length if length == length else 0.0


def _check_frames(system: System, file: str) -> None:
    """Raise a ModelError if a table of frames does not support a part of the system."""
    if system.parts:
        raise ModelError(
            f"{system.name}: force element {system.parts[0].name!r} cannot be said in a"
            f" {file} file; take it out"
        )
    for link in system.tree.links:
        if link.motion not in _SIGMA:
            raise ModelError(
                f"{system.name}/{link.name}: a {file} file has no {link.motion.value} joint; use"
                " revolute and prismatic joints"
            )
        if link.rotor is not None:
            raise ModelError(
                f"{system.name}/{link.name}: no rotor is written to a {file} file; give its inertia"
                " seen at the joint as Ia"
            )
    if system.couplings:
        raise ModelError(
            f"{system.name}/{system.couplings[0].name}: a {file} file has no couplings; remove it"
        )
    for cut in system.cuts:
        freedoms = cut.edge.joint.freedoms
        if cut.welded or len(freedoms) != 1 or freedoms[0].motion not in _SIGMA:
            raise ModelError(
                f"{system.name}/{cut.edge.joint.name}: loops are written to a {file} file cut at"
                " revolute or prismatic joints without friction, rotor and motor; cut the loop"
                " elsewhere"
            )


def _geometry(placement: Khalil, text: Text) -> dict[str, Any]:
    """Return the six Khalil parameters of a frame as texts, by name."""
    return dict(zip(GEOMETRY, map(text, placement.parameters), strict=True))


def _body(j: int, link: Link, text: Text) -> InertiaRow:
    """Return the body row of frame j; inertia that no body can have is marked as grouped."""
    ten = link.inertia.parameters
    values: dict[str, Any] = {name: text(ten[k]) for k, name in enumerate(TEN_PARAMETERS)}
    values |= {name: text(getattr(link, name)) for name in _OF_THE_JOINT}
    row = InertiaRow(j, grouped=True, **values)
    return replace(row, grouped=False) if row.is_body else row


def text_function(system: System) -> Text:
    """Return the function that writes a scalar expression of the symbols as text.

    The text is in the grammar of mechanism files.

    Args:
        system: mechanism whose symbols the expressions contain.
    """
    names = [parameter.name for parameter in system.parameters]

    def text(value: SX) -> str:
        if value.is_constant():
            return repr(float(value))
        from mbs.export.languages.one_line import one_line  # with sympy, which is slow to load

        return one_line(graph_of(Function("value", [system.p], [value])), names)

    return text


# Tables of links.


_ON_AXIS = 1e-14
"""Largest distance [m] of the origin of a body from its joint axis: only rounding."""
_SAME = 1e-12
"""Difference of gravity [m/s^2] or of a transform [m] that counts as rounding (below 1e-14)."""
_APART = 0.1
"""Distance [m] between the two connect points of a revolute joint that closes a loop."""


class Numbers:
    """Function that evaluates expressions of a system at values of its symbols.

    Args:
        system: mechanism to write.
        parameters: values of symbols. Other symbols have their default values.
    """

    def __init__(self, system: System, parameters: Mapping[str, float] | None = None) -> None:
        self.p = system.p
        self.values = DM(system.parameter_values(parameters)) if system.parameters else DM(0, 1)

    def __call__(self, value: SX) -> Array:
        """Return the numeric value of an expression as an array of its shape."""
        expression = casadi.densify(SX(value))
        if expression.is_constant():
            return np.array(DM(expression), dtype=float)
        return np.array(Function("value", [self.p], [expression])(self.values), dtype=float)

    def scalar(self, value: SX) -> float:
        """Return the numeric value of a scalar expression.

        Args:
            value: expression of the symbols of the system.
        """
        return float(self(value).item())


def numbers_without_symbols(system: System, file: str) -> Numbers:
    """Return the function that evaluates expressions at the default values of all symbols.

    Args:
        system: mechanism to write.
        file: kind of file, for error messages.

    Raises:
        ModelError: a symbol has no value.
    """
    missing = [p.name for p in system.parameters if p.default is None]
    if missing:
        has = "has no value" if len(missing) == 1 else "have no value"
        raise ModelError(
            f"{system.name}: {listed(missing)} {has}, and {file} files have no symbols; give"
            f" values, such as Mechanism(parameters={{{missing[0]!r}: 1.0}})"
        )
    return Numbers(system)


class _Tables:
    """Collector of the table of links of a system; a subclass for each format.

    The formats differ in the frames of links (`body_of`), in the pose of the base and in the drawn
    positions.

    Attributes:
        system: mechanism to write.
        number: function that evaluates expressions.
        drawn: (nq,) joint positions at which the robot is drawn.
        frames: pose of the frame of each link in the file relative to its frame in the tree, by
            index (-1 for the base).
    """

    def __init__(self, system: System, number: Numbers, drawn: Sequence[float]) -> None:
        self.system, self.number = system, number
        self.drawn: Array = np.array(drawn, dtype=float)
        self.frames: dict[int, Any] = {-1: self.pose(Pose.identity())}

    def table(self, hidden: Sequence[str] = ()) -> LinkTable:
        """Return the table of links.

        Args:
            hidden: names of frames that are left out.
        """
        system, number = self.system, self.number
        links = tuple(self._link(j, link) for j, link in enumerate(system.tree.links))
        return LinkTable(
            name=system.name,
            gravity=number(system.tree.gravity).ravel(),
            links=links,
            frames={
                name: self._frame(name, place)
                for name, place in system.frames.items()
                if name not in ("base", "world", *hidden)
            },
            positions=tuple(coordinate.name for coordinate in system.coordinates),
            drawn=self.drawn,
            couplings=tuple(
                FileCoupling(
                    coupling.name,
                    coupling.driven,
                    coupling.driver,
                    tuple(number.scalar(c) for c in coupling.coefficients),
                    tuple((k, number.scalar(factor)) for k, factor in coupling.others),
                )
                for coupling in system.couplings
            ),
            loops=tuple(self.loop(cut) for cut in system.cuts),
            forces=tuple(self._force(part) for part in system.parts),
        )

    # Rules of a format. Transforms are matrices (4, 4) of numbers, multiplied by NumPy.

    def pose(self, pose: Pose) -> Any:
        """Return a pose as a transform (4, 4)."""
        return self.number(pose.matrix)

    def inverse(self, T: Any) -> Any:
        """Return the inverse of a transform (4, 4)."""
        return inverse(T)

    def matrix(self, T: Any) -> Array:
        """Return a transform as a matrix (4, 4) of numbers."""
        return np.asarray(T)

    def body_of(self, j: int, link: Link) -> str:
        """Return the name of the body whose frame is the frame of link j in the file.

        Empty if the link has its frame in the tree. Subclasses implement it.
        """
        raise NotImplementedError

    def displacement(self, j: int, link: Link) -> Any:
        """Return the transform of link j relative to its antecedent at the drawn positions.

        Both frames are those in the tree.
        """
        return self.pose(link.pose())

    def loop(self, cut: Cut) -> FileLoop:
        """Return the row of a joint that closes a loop."""
        return FileLoop(cut.edge.joint, cut.welded, (self._pair(*cut.frames),))

    # Rows of the table.

    def _link(self, j: int, link: Link) -> FileLink:
        """Return the row of link j."""
        system, number = self.system, self.number
        body = self.body_of(j, link)
        own = self.pose(system.frames[body][1] if body else Pose.identity())
        self.frames[j] = own
        speed = system.velocity_coordinates[link.v.start]
        before = self.frames[link.antecedent]
        return FileLink(
            name=link.name,
            motion=link.motion,
            antecedent=link.antecedent,
            body=body,
            bodies=tuple(self._bodies(j)),
            frame=self.matrix(own),
            placement=self.matrix(self.inverse(before) @ self.displacement(j, link) @ own),
            joint_frame=self.matrix(self.inverse(own)),
            joint_pose=self.matrix(self.pose(link.pose())),
            inertia=number(link.inertia.parameters).ravel(),
            Fv=number.scalar(link.Fv),
            Fs=number.scalar(link.Fs),
            Ia=number.scalar(link.Ia),
            stiffness=number.scalar(link.stiffness),
            rest=number.scalar(link.rest),
            limits=system.coordinates[link.q.start].limits,
            velocity=speed.limits,
            effort=speed.effort,
            actuated=speed.actuated,
            position=link.q.start,
        )

    def _bodies(self, j: int) -> list[str]:
        """Return the names of the bodies on a link."""
        return [row.name for row in self.system.bodies if row.link == j + 1]

    def _place(self, frame: Frame) -> Place:
        """Return a frame as link index and pose (4, 4) relative to the file frame of the link."""
        number, pose = frame
        return number, self.matrix(self.inverse(self.frames[number]) @ self.pose(pose))

    def _pair(self, one: Frame, other: Frame) -> tuple[Place, Place]:
        """Return the two coinciding frames of a loop as in `_place`."""
        return self._place(one), self._place(other)

    def _frame(self, name: str, place: Frame) -> FileFrame:
        """Return the row of a frame with a name."""
        system = self.system
        number, pose = self._place(place)
        if name in system.named_frames:
            return FileFrame(name, number, pose, "named")
        if name in {row.name for row in system.bodies}:
            return FileFrame(name, number, pose, "body")
        of_joint = name in {row.name for row in system.joints}
        return FileFrame(name, number, pose, "joint" if of_joint else "fixed")

    def _force(self, part: ComponentInstance) -> FileForce:
        """Return the row of a force element with its numeric values."""
        element = part.element
        quantities: dict[str, tuple[Any, ...]] = {}
        levers: dict[str, float] = {}
        if isinstance(element, (Spring, Damper, FixedTendon)):
            quantities["damping"] = (element.damping,)
        if isinstance(element, (Spring, FixedTendon)):
            quantities["stiffness"] = (element.stiffness,)
        if isinstance(element, Spring):
            quantities["length"] = (element.length,)
        if isinstance(element, FixedTendon):
            quantities |= {"length": tuple(element.length), "friction": (element.friction,)}
            names = [speed.name for speed in self.system.velocity_coordinates]
            levers = {
                names[lever.velocity]: self.number.scalar(lever.factor) for lever in part.levers
            }
        values = {
            name: tuple(self.number.scalar(to_sx(value, part.symbols)) for value in given)
            for name, given in quantities.items()
        }
        return FileForce(element, values, tuple(map(self._place, part.frames)), levers)


class UrdfTables(_Tables):
    """Collector for URDF: the frame of a link is that of a body with its origin on the joint axis.

    The robot is drawn at position zero.
    """

    def __init__(self, system: System, number: Numbers) -> None:
        super().__init__(system, number, [0.0] * system.nq)
        gravity = number(system.tree.gravity).ravel()
        if not np.array_equal(gravity, GRAVITY):
            self._mount(gravity)

    def _mount(self, gravity: Array) -> None:
        """Make the outer world of a mounted robot, with gravity along -z, the world of the file.

        Raises:
            ModelError: no mount rotates gravity to that of URDF, or the robot has a free joint,
                whose coordinates are relative to the base.
        """
        system = self.system
        pose = base_pose(system)
        R = np.eye(3) if pose is None else pose[:3, :3]
        if pose is None or np.max(np.abs(R @ gravity - GRAVITY)) > _SAME:
            raise ModelError(
                f"{system.name}: gravity is {quoted(gravity.tolist())}, but that of URDF is"
                f" {GRAVITY}; give the robot a mount instead"
            )
        for link in system.tree.links:
            if link.motion is Motion.FREE and link.antecedent < 0:
                raise ModelError(
                    f"{system.name}/{link.name}: a free joint on a rotated base has other"
                    " coordinates in a URDF file; write the robot without its mount"
                )
        self.frames[-1] = inverse(pose)

    def table(self, hidden: Sequence[str] = ()) -> LinkTable:
        """Return the table of links, without the outer world if it is the world of the file."""
        found = self.system.frames.get(OUTER_WORLD)
        if found is not None and found[0] < 0:
            pose = self.pose(found[1])
            if np.allclose(pose, self.frames[-1], rtol=0, atol=_SAME):
                hidden = (*hidden, OUTER_WORLD)
        return super().table(hidden)

    def body_of(self, j: int, link: Link) -> str:
        """Return the first body of link j with its origin on the joint axis.

        Empty without such a body.

        For a free joint, the frame of the body must be that of the link in the tree.
        """
        bodies = self._bodies(j)
        for name, (number, frame) in self.system.frames.items():
            if number == j and name in bodies:
                pose = self.pose(frame)
                away = pose[:2, 3] if link.motion is Motion.REVOLUTE else np.zeros(2)
                if link.motion is Motion.FREE:
                    away = (pose - np.eye(4)).ravel()
                if np.all(np.abs(away) <= _ON_AXIS):
                    return name
        return ""


class SdfTables(_Tables):
    """Collector for SDF: the frame of a link is that of its first body.

    Mechanisms with loops and free links are drawn in the configuration of the system, others at
    position zero.
    """

    def __init__(self, system: System, number: Numbers) -> None:
        drawn = np.array(system.configuration if system.cuts else zero_position(system.tree))
        for link in system.tree.links:
            if link.motion is Motion.FREE:
                drawn[link.q] = system.configuration[link.q]
        super().__init__(system, number, drawn.tolist())
        self.in_world: dict[int, Array] = {-1: np.eye(4)}

    def body_of(self, j: int, link: Link) -> str:
        """Return the first body of link j; empty if it has no body."""
        bodies = [name for name in self._bodies(j) if name in self.system.frames]
        return bodies[0] if bodies else ""

    def displacement(self, j: int, link: Link) -> Array:
        """Return the transform (4, 4) of link j relative to its antecedent, as drawn."""
        relative: Array = self.pose(link.pose()) @ self._motion(link)
        self.in_world[j] = self.in_world[link.antecedent] @ relative
        return relative

    def _motion(self, link: Link) -> Array:
        """Return the joint displacement (4, 4) of a link in the drawn configuration."""
        T, q = np.eye(4), self.drawn[link.q]
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

    def loop(self, cut: Cut) -> FileLoop:
        """Return the row of a joint that closes a loop; its second frame is not on the base."""
        turned = cut.frames[1][0] < 0
        (a, pose_a), (b, pose_b) = cut.frames[::-1] if turned else cut.frames
        at_a, at_b = self.pose(pose_a), self.pose(pose_b)
        opening = inverse(self.in_world[a] @ at_a) @ self.in_world[b] @ at_b
        pair = self._pair((a, pose_a), (b, pose_b))
        return FileLoop(cut.edge.joint, cut.welded, (pair,), turned, opening)


class MjcfTables(_Tables):
    """Collector for MJCF: the frame of a link is that of its first body.

    It is the frame of the joint if that of the body of a spherical or free joint differs. The drawn
    positions are the configuration of the system, in the coordinates of the file. Transforms are
    poses of expressions, whose products keep exact zeros and ones.
    """

    def __init__(self, system: System, number: Numbers) -> None:
        super().__init__(system, number, child_positions(system, system.configuration))
        names = (parameter.name for parameter in system.parameters)
        self.symbols = dict(zip(names, casadi.vertsplit(system.p), strict=True))

    def pose(self, pose: Pose) -> Pose:
        """Return the pose itself, which is the transform of this class."""
        return pose

    def inverse(self, T: Pose) -> Pose:
        """Return the inverse of a pose."""
        return T.inverse()

    def matrix(self, T: Pose) -> Array:
        """Return a pose as a matrix (4, 4) of numbers."""
        found = np.eye(4)
        found[:3, :3], found[:3, 3] = self.number(T.R), self.number(T.p).ravel()
        return found

    def body_of(self, j: int, link: Link) -> str:
        """Return the first body of link j if its frame may be that of the link; empty otherwise.

        The frame of a spherical or free joint must be the frame of the link in the tree.
        """
        for name in self._bodies(j)[:1]:
            one_axis = link.motion in (Motion.REVOLUTE, Motion.PRISMATIC)
            if one_axis or is_identity(self.matrix(self.system.frames[name][1])):
                return name
        return ""

    def loop(self, cut: Cut) -> FileLoop:
        """Return the row of a joint that closes a loop.

        A revolute joint has two pairs of points on its axis.
        """
        joint, (frame_a, frame_b) = cut.edge.joint, cut.frames
        if cut.welded:
            return super().loop(cut)
        if isinstance(joint, Rod):
            at_zero = relative_pose(self.system.tree, self._zero(), frame_a, frame_b).p
            excess = casadi.SX(to_sx(joint.length, self.symbols)) - casadi.norm_2(at_zero)
            pair = self._pair(frame_a, frame_b)
            return FileLoop(joint, False, (pair,), excess=self.number.scalar(excess))
        if isinstance(joint, Revolute):
            pairs = []
            for along in (-_APART / 2, _APART / 2):
                shift = Pose.translation(SX(DM(along * np.array(joint.axis))))
                one, other = ((number, pose @ shift) for number, pose in (frame_a, frame_b))
                pairs.append(self._pair(one, other))
            return FileLoop(joint, False, tuple(pairs))
        return super().loop(cut)

    def _zero(self) -> SX:
        """Return the configuration (nq, 1) that is qpos0 in the file: zero, or unit quaternions."""
        q = SX.zeros(self.system.nq)
        for part in quaternion_slices(self.system.tree):
            q[part.start] = 1
        return q


def child_positions(system: System, q: Sequence[float]) -> list[float]:
    """Return the positions of a system in the coordinates of robot files.

    In a robot file the quaternion of a joint is the orientation of the child body relative to the
    parent body. In a system it is the orientation of frame_b relative to frame_a. Both differ if a
    spherical or free joint has the child body on its frame_a.

    Args:
        system: mechanism to write.
        q: (nq,) positions [rad or m].
    """
    found = [float(value) for value in q]
    for link, pose in zip(system.tree.links, link_poses(system.tree, SX(DM(found))), strict=True):
        if link.backward:
            p = np.array(DM(origin(pose.motion))).ravel() if link.motion is Motion.FREE else ()
            w, x, y, z = found[link.q.stop - 4 : link.q.stop]
            found[link.q] = [*p, w, -x, -y, -z]
    return found
