"""Tables of a system: coordinates, links, joints, bodies, loops, couplings and sensors."""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from casadi import SX

from mbs.assembly.graph import Port, is_weld
from mbs.assembly.khalil_frames import Cut
from mbs.assembly.tree import Frame, Tree
from mbs.components import (
    Box,
    Component,
    Cylinder,
    Description,
    Joint,
    Point,
    RigidBody,
)
from mbs.components.joints import Motion
from mbs.components.sensors import (
    AbsoluteSensor,
    JointSensor,
    OnJoint,
    Quantity,
    RelativeSensor,
    Sensor,
)
from mbs.components.shapes import Shape
from mbs.errors import AssemblyError
from mbs.spatial import Inertia, MatrixRotation, Pose
from mbs.text import did_you_mean

Places = Mapping[tuple[str, str], tuple[int, Pose]]
"""Link and pose of every body, by (name, ""), and of the frames "a" and "b" of every joint."""

QUATERNION = ("qw", "qx", "qy", "qz")
"""Elements of the quaternion of a joint."""

ANGULAR = ("wx", "wy", "wz")
"""Elements of the angular velocity of a joint."""

_POSITIONS = {
    Motion.REVOLUTE: (("", "revolute", "rad"),),
    Motion.PRISMATIC: (("", "prismatic", "m"),),
    Motion.SPHERICAL: tuple((k, "quaternion", "1") for k in QUATERNION),
    Motion.FREE: (
        *((k, "translation", "m") for k in "xyz"),
        *((k, "quaternion", "1") for k in QUATERNION),
    ),
}
_VELOCITIES = {
    Motion.REVOLUTE: (("", "revolute", "rad/s"),),
    Motion.PRISMATIC: (("", "prismatic", "m/s"),),
    Motion.SPHERICAL: tuple((k, "rotation", "rad/s") for k in ANGULAR),
    Motion.FREE: (
        *((k, "translation", "m/s") for k in ("vx", "vy", "vz")),
        *((k, "rotation", "rad/s") for k in ANGULAR),
    ),
}
EFFORT_UNIT = {"rad/s": "N.m", "m/s": "N"}
"""Unit of the effort that does work with a velocity, by unit of the velocity."""

RATE_UNIT = {"m": "m/s", "rad": "rad/s", "1": "1/s"}
"""Unit of the rate of a position, by unit of the position."""

ACCELERATION_UNIT = {"rad/s": "rad/s2", "m/s": "m/s2"}
"""Unit of the rate of a velocity, by unit of the velocity."""


@dataclass(frozen=True, slots=True)
class Coordinate:
    """One element of q or of v.

    Attributes:
        name: name of the joint, with a suffix if the joint has several coordinates.
        kind: revolute, prismatic, translation, rotation or quaternion.
        unit: unit of its value.
        joint: name of its joint.
        actuated: Whether a motor drives it.
        cut: Whether its joint is cut, so that it is not in q.
        limits: (lower, upper), or None.
        effort: (lower, upper) limit of the motor effort of an element of v, or None.
    """

    name: str
    kind: str
    unit: str
    joint: str
    actuated: bool
    cut: bool = False
    limits: tuple[float, float] | None = None
    effort: tuple[float, float] | None = None


@dataclass(frozen=True, slots=True)
class LinkRow:
    """A link of the tree and the Khalil parameters of its frame.

    Attributes:
        number: number of the link, from 1.
        name: name of the motion of the link.
        antecedent: number of the antecedent link, 0 for the base.
        motion: revolute, prismatic, spherical or free.
        gamma, b, alpha, d, theta, r: placement at the zero position [rad, m]; numbers, or
            expressions if they contain symbols.
        via: Khalil parameters of fixed frames between the antecedent and the placement. The link is
            placed on the last of these frames. Empty if one frame is sufficient.
    """

    number: int
    name: str
    antecedent: int
    motion: str
    gamma: float | SX
    b: float | SX
    alpha: float | SX
    d: float | SX
    theta: float | SX
    r: float | SX
    via: tuple[tuple[float | SX, ...], ...] = ()


@dataclass(frozen=True, slots=True)
class ShapeRow:
    """A shape on a link, for pictures.

    Attributes:
        link: index of the link that carries the shape, -1 for the base.
        pose: pose of the shape in the frame of the link.
        shape: the shape.
    """

    link: int
    pose: Pose
    shape: Shape


@dataclass(frozen=True, slots=True)
class BodyRow:
    """A body of the description and its link.

    Attributes:
        name: name of the body.
        link: number of the link that carries the body, from 1.
        mass: mass [kg]. None if it contains a symbol without value.
        solid: the body itself if it is described by its dimensions.
    """

    name: str
    link: int
    mass: float | None
    solid: Box | Cylinder | None = None


@dataclass(frozen=True, slots=True)
class LoopRow:
    """A closed loop, or a coupling of coordinates.

    Attributes:
        name: name of the cut joint, or of the coupling.
        closing: kind of the closing joint in lower case, or "coupling".
        joints: joints of the loop that remain in the tree.
        rows: label of every closure row, such as "j3: force x".
        dropped: labels of the rows that depend on the other rows.
    """

    name: str
    closing: str
    joints: tuple[str, ...]
    rows: tuple[str, ...]
    dropped: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Balance:
    """Force balance of a massless node.

    Attributes:
        velocity: index in v of the node.
        size: divisor of the force: a typical stiffness [N/m or N m/rad], or damping
            [N s/m or N m s/rad].
        is_damped: Whether dampers act on the node, so that the balance determines a velocity.
        frictions: names of the components whose dry friction acts on the node.
    """

    velocity: int
    size: float
    is_damped: bool
    frictions: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Closure:
    """Constraints of the loops of a system on its velocities.

    Attributes:
        rows: indices of the independent closure rows.
        slips: indices of the independent rows on velocities only, such as those of rolling discs.
        independent: indices of the independent velocities.
        passive: indices of the dependent velocities.
        motors: indices of the velocities whose efforts drive the mechanism: the independent
            velocities, or the motors if there are more motors, or others.
        chosen_coordinates: indices of the velocities whose positions may be chosen: the
            independent velocities, and velocities that only rolling without slip constrains.
        varies: Whether the relation between dropped and kept rows changes with the configuration,
            so that other rows may be independent in other configurations.
        gruebler: mobility by the Gruebler-Kutzbach count of rows.
        residual: largest closure residual at the assembled configuration.
        guess: approximate positions by name from the user [rad or m].
        at_cut: positions by name of guessed joints that are cut, as assembled [rad or m].
        others: further configurations with the same locked or independent positions, (nq,) each.
        meets: Whether the configuration nearest to the guess is singular, so that branches of
            motion meet there.
        dead: Whether the independent joints are at a dead centre in the assembled configuration.
    """

    rows: tuple[int, ...]
    slips: tuple[int, ...]
    independent: tuple[int, ...]
    passive: tuple[int, ...]
    motors: tuple[int, ...]
    chosen_coordinates: tuple[int, ...]
    varies: bool
    gruebler: int
    residual: float
    guess: tuple[tuple[str, float], ...] = ()
    at_cut: tuple[tuple[str, float], ...] = ()
    others: tuple[tuple[float, ...], ...] = ()
    meets: bool = False
    dead: bool = False

    @property
    def mobility(self) -> int:
        """Number of independent velocities."""
        return len(self.independent)


def link_rows(tree: Tree) -> tuple[LinkRow, ...]:
    """Return the links of a tree and the Khalil parameters of their frames.

    Args:
        tree: the links.
    """
    rows = []
    for number, link in enumerate(tree.links, start=1):
        *via, (gamma, b, alpha, d, theta, r) = (
            tuple(float(x) if x.is_constant() else x for x in frame.parameters)
            for frame in link.frames
        )
        before, motion = link.antecedent + 1, link.motion.value
        rows.append(
            LinkRow(number, link.name, before, motion, gamma, b, alpha, d, theta, r, tuple(via))
        )
    return tuple(rows)


def position_coordinates(
    links: Sequence[tuple[Motion, str, Joint]], actuated: Sequence[bool], *, cut: bool = False
) -> tuple[Coordinate, ...]:
    """Return the elements of q of some joint motions.

    Args:
        links: motion, name of the motion and joint, in order.
        actuated: whether each motion has a motor.
        cut: whether the joints are cut, so that the coordinates are not in q.
    """
    return _coordinates(_POSITIONS, links, actuated, cut)


def velocity_coordinates(
    links: Sequence[tuple[Motion, str, Joint]], actuated: Sequence[bool]
) -> tuple[Coordinate, ...]:
    """Return the elements of v of some joint motions.

    Args:
        links: motion, name of the motion and joint, in order.
        actuated: whether each motion has a motor.
    """
    rows = _coordinates(_VELOCITIES, links, actuated, False)
    described = {joint.name: joint for _, _, joint in links}
    return tuple(
        replace(row, limits=described[row.joint].velocity, effort=described[row.joint].effort)
        for row in rows
    )


def _coordinates(
    table: dict[Motion, tuple[tuple[str, str, str], ...]],
    links: Sequence[tuple[Motion, str, Joint]],
    actuated: Sequence[bool],
    cut: bool,
) -> tuple[Coordinate, ...]:
    """Return the coordinates of joint motions; see `position_coordinates`.

    `table` lists suffix, kind and unit of the coordinates of each type of motion.
    """
    rows = []
    for (motion, name, joint), driven in zip(links, actuated, strict=True):
        limits = dict(joint.limits or ())
        for suffix, kind, unit in table[motion]:
            full = f"{name}.{suffix}" if suffix else name
            interval = limits.get(name.removeprefix(joint.name).removeprefix("."))
            bounded = interval if unit in ("rad", "m") and not suffix else None
            rows.append(Coordinate(full, kind, unit, joint.name, driven, cut, bounded))
    return tuple(rows)


# Joints of a system: joints of the tree, cut joints and welds.


@dataclass(frozen=True, slots=True, eq=False)
class WeldedPart:
    """Bodies that a Fixed joint carries: the bodies of a link on one side of the joint.

    Attributes:
        ports: bodies, as (name, ""), and the frames "a" and "b" of joints on them.
        inertia: inertia of the bodies, about the origin of the link's frame and in its axes.
        sign: 1 if the bodies are on the side of the joint's frame_b, -1 on the side of frame_a.
    """

    ports: frozenset[Port]
    inertia: Inertia
    sign: int


@dataclass(frozen=True, slots=True, eq=False)
class JointRow:
    """A joint or constraint between two bodies.

    Attributes:
        name: name of the joint.
        kind: kind of joint, in lower case.
        cut: Whether the joint is cut to open a loop.
        frame_a, frame_b: link (-1 for the base) that carries the frame, and pose in the link's
            frame.
        part: bodies on one side of a weld within a link. None for all other joints.
    """

    name: str
    kind: str
    cut: bool
    frame_a: Frame
    frame_b: Frame
    part: WeldedPart | None


def joint_rows(
    mechanism: Description, places: Places, cuts: Sequence[Cut], symbols: Mapping[str, SX]
) -> tuple[JointRow, ...]:
    """Return every joint in order of addition, except welds that close a ring of welds.

    In such a ring the constraint wrenches of the welds are not determined.

    Args:
        mechanism: components and connections.
        places: link and pose of bodies and joint frames.
        cuts: cut joints.
        symbols: CasADi symbol of every parameter.
    """
    cut = {row.edge.joint.name for row in cuts}
    rows = []
    for joint in mechanism.joints():
        part = _part(mechanism, joint, places, symbols) if is_weld(mechanism, joint) else None
        if is_weld(mechanism, joint) and part is None:
            continue
        frames = places[joint.name, "a"], places[joint.name, "b"]
        kind = type(joint).__name__.lower()
        rows.append(JointRow(joint.name, kind, joint.name in cut, *frames, part))
    return tuple(rows)


def _part(
    mechanism: Description, joint: Joint, places: Places, symbols: Mapping[str, SX]
) -> WeldedPart | None:
    """Return the bodies on the side of a Fixed joint that does not contain the world.

    None if other Fixed joints connect both sides as well.

    `places` are link and pose of the frames, `symbols` those of the parameters.
    """
    sides = {port: _weld(mechanism, joint, port) for port in "ab"}
    if (joint.name, "a") in sides["b"]:
        return None
    side, sign = ("a", -1) if (mechanism.world.name, "") in sides["b"] else ("b", 1)
    inertia = Inertia.zero()
    for name, _ in sides[side]:
        component = mechanism.components[name]
        if isinstance(component, RigidBody):
            pose = places[name, ""][1]
            inertia = inertia + component.inertial(symbols).seen_from(
                MatrixRotation(pose.R), pose.p
            )
    return WeldedPart(frozenset(sides[side]), inertia, sign)


def _weld(mechanism: Description, joint: Joint, port: str) -> list[Port]:
    """Return the ports welded to the frame `port` of a joint, except through the joint itself."""
    found: dict[Port, None] = {(joint.name, port): None}
    queue = deque(found)
    while queue:
        here = queue.popleft()
        for there in _neighbours(mechanism, joint, here):
            if there not in found:
                found[there] = None
                queue.append(there)
    return list(found)


def _neighbours(mechanism: Description, without: Joint, port: Port) -> Iterator[Port]:
    """Yield the ports that are welded directly to a port, except through the joint `without`."""
    for a, b in mechanism.connections:
        ends = (a.owner.name, a.port), (b.owner.name, b.port)
        if port in ends:
            yield ends[0] if port == ends[1] else ends[1]
    joint = mechanism.components[port[0]]
    if isinstance(joint, Joint) and joint.name != without.name and is_weld(mechanism, joint):
        yield joint.name, "b" if port[1] == "a" else "a"


# Relations between coordinates, such as gears.


@dataclass(frozen=True, slots=True, eq=False)
class CoordinateCoupling:
    """driven = sum of c_k driver^k + sum of further coordinates times factors, in elements of q.

    Attributes:
        name: name of the coupling.
        driven, driver: indices in q.
        coefficients: c_0, c_1, ...
        others: index in q and factor of each further coordinate.
    """

    name: str
    driven: int
    driver: int
    coefficients: tuple[SX, ...]
    others: tuple[tuple[int, SX], ...] = ()

    @property
    def coordinates(self) -> tuple[int, ...]:
        """Indices of all coordinates of the relation, the driven coordinate first."""
        return (self.driven, self.driver, *(number for number, _ in self.others))

    def value(self, q: SX) -> SX:
        """Return the value of the driven coordinate, (1, 1).

        Args:
            q: (nq, 1) positions; the driven position is not used.
        """
        driver = q[self.driver]
        value = sum((c * driver**k for k, c in enumerate(self.coefficients)), SX(0))
        return value + self.shift(q)

    def shift(self, q: SX) -> SX:
        """Return the sum of the further coordinates times their factors, (1, 1).

        Args:
            q: (nq, 1) positions.
        """
        return sum((factor * q[number] for number, factor in self.others), SX(0))


# Positions of sensors, and names of their readings.


def require_part(mechanism: Description, component: Component, point: Point, does: str) -> None:
    """Raise if a component refers to a point that is not in the mechanism.

    Args:
        mechanism: components and connections.
        component: component that refers to the point.
        point: the point.
        does: verb of the message, such as "acts on".

    Raises:
        AssemblyError: the owner of the point is not in the mechanism.
    """
    known, is_nested = mechanism.components.get(point.owner.name), type(point.owner) is Component
    if known is None or not (is_nested or known is point.owner):
        raise AssemblyError(
            f"{component.name}: it {does} {point.owner.name!r}, which is not part of"
            f" {mechanism.name}; add that component, or take a point of one that is in it"
        )


_INPUTS = ("q_a", "v_a", "a_a", "tau_a")
"""Names of inputs of models that the outputs of sensors must not have."""


@dataclass(frozen=True, slots=True, eq=False)
class AttachedSensor:
    """A sensor and its position.

    Attributes:
        sensor: description of the sensor.
        frames: link (-1 for the base) and pose in the link's frame, of each of its points, or of
            frame_a and frame_b of its joint. Empty for a coordinate, except that of a cut
            spherical joint.
        coordinate: name of the measured coordinate, or an empty text.
        joint: index of its joint in `system.joints`. None if it is not on a joint.
        quantities: measured quantities.
        where: components that it is on, as text.
    """

    sensor: Sensor
    frames: tuple[Frame, ...]
    coordinate: str
    joint: int | None
    quantities: tuple[Quantity, ...]
    where: str

    @property
    def sentence(self) -> str:
        """Description of the sensor in a report: kind, name, quantities and position."""
        names = ", ".join(quantity.name for quantity in self.quantities)
        return f"{type(self.sensor).__name__} {self.sensor.name} reads {names} of {self.where}."

    @property
    def outputs(self) -> tuple[tuple[str, Quantity], ...]:
        """Name of each quantity as an output of a Function: tip_p of the sensor tip.

        Characters that CasADi does not allow in names, such as the dot in arm.tip, become
        underscores.
        """
        stem = re.sub(r"[^A-Za-z0-9]+", "_", self.sensor.name).strip("_")
        stem = stem if stem[:1].isalpha() else f"sensor_{stem}".rstrip("_")
        return tuple((f"{stem}_{quantity.name}", quantity) for quantity in self.quantities)

    @property
    def columns(self) -> tuple[tuple[str, str], ...]:
        """Name and unit of every element in a result: tip.p.x of the sensor tip."""
        return tuple(
            (".".join(filter(None, (self.sensor.name, quantity.name, element))), quantity.unit)
            for quantity in self.quantities
            for element in quantity.elements
        )


def sensors_of(mechanism: Description) -> Iterator[Sensor]:
    """Yield all sensors of a mechanism, in the order of their addition.

    Args:
        mechanism: components and connections.
    """
    return (c for c in mechanism.components.values() if isinstance(c, Sensor))


def attached_sensors(
    mechanism: Description,
    places: Places,
    joints: Sequence[JointRow],
    tables: tuple[Sequence[Coordinate], ...],
    symbols: Mapping[str, SX],
) -> tuple[AttachedSensor, ...]:
    """Return every sensor with the links of its points, or with its joint.

    Args:
        mechanism: components and connections.
        places: link and pose of bodies and joint frames.
        joints: joints of the system.
        tables: coordinates of q, of v, and of cut joints.
        symbols: CasADi symbol of every parameter.

    Raises:
        AssemblyError: a sensor refers to an unknown part, or two readings have the same name.
    """
    found: list[AttachedSensor] = []
    for sensor in sensors_of(mechanism):
        if isinstance(sensor, JointSensor):
            found.append(_on_coordinate(sensor, tables, joints))
        elif isinstance(sensor, OnJoint):
            found.append(_on_joint(mechanism, sensor, joints))
        else:
            found.append(_on_points(mechanism, sensor, places, symbols))
    _require_names(found, tables)
    return tuple(found)


def _on_points(
    mechanism: Description, sensor: Sensor, places: Places, symbols: Mapping[str, SX]
) -> AttachedSensor:
    """Return a sensor with the links and poses of its points.

    `places` are link and pose of bodies and joint frames.
    """
    frames = []
    for point in sensor.points:
        require_part(mechanism, sensor, point, "is on")
        link, pose = places[point.owner.name, point.port]
        frames.append((link, pose @ point.placement.pose(symbols)))
    names = [point.owner.name for point in sensor.points]
    if isinstance(sensor, AbsoluteSensor):
        where = names[0]
    elif isinstance(sensor, RelativeSensor):
        where = f"{names[1]} seen from {names[0]}"
    else:
        where = " and ".join(names)
    return AttachedSensor(sensor, tuple(frames), "", None, sensor.measured, where)


def _on_joint(
    mechanism: Description, sensor: OnJoint, joints: Sequence[JointRow]
) -> AttachedSensor:
    """Return a sensor with its joint and the frames of this joint, from the table `joints`.

    Raises AssemblyError if the joint is unknown or not in the table.
    """
    names = [row.name for row in joints]
    if sensor.joint not in names:
        known = {joint.name for joint in mechanism.joints()}
        if sensor.joint in known:
            raise AssemblyError(
                f"{sensor.name}: joint {sensor.joint!r} closes a ring of welds, where rigid bodies"
                " do not say what it transmits; take another weld of the ring away"
            )
        raise AssemblyError(
            f"{sensor.name}: there is no joint {sensor.joint!r};"
            f" {did_you_mean(sensor.joint, names)}"
        )
    number = names.index(sensor.joint)
    frames = joints[number].frame_a, joints[number].frame_b
    return AttachedSensor(sensor, frames, "", number, sensor.measured, sensor.joint)


def _on_coordinate(
    sensor: JointSensor, tables: tuple[Sequence[Coordinate], ...], joints: Sequence[JointRow]
) -> AttachedSensor:
    """Return a sensor with the coordinate that it measures; AssemblyError if it is unknown.

    `tables` are the coordinates of q, of v, and of cut joints.
    """
    q, v, cut = ({row.name: row for row in table} for table in tables)
    name = sensor.joint
    balls = {row.name: row for row in joints if row.cut and row.kind == "spherical"}
    joint, _, element = name.rpartition(".")
    if joint in balls and element in QUATERNION + ANGULAR:
        ball = balls[joint]
        quantities = [Quantity("q", "1")]
        if element in ANGULAR:
            quantities = [Quantity("v", "rad/s"), Quantity("a", ACCELERATION_UNIT["rad/s"])]
        frames = ball.frame_a, ball.frame_b
        return AttachedSensor(sensor, frames, name, None, tuple(quantities), name)
    if not any(name in table for table in (q, v, cut)):
        angular = [f"{ball}.{element}" for ball in balls for element in ANGULAR]
        known = dict.fromkeys([*q, *v, *cut, *angular])
        raise AssemblyError(
            f"{sensor.name}: there is no coordinate {name!r}; {did_you_mean(name, known)}"
        )
    quantities = [Quantity("q", table[name].unit) for table in (q, cut) if name in table]
    rates = [v[name].unit] if name in v else [RATE_UNIT[cut[name].unit]] if name in cut else []
    for unit in rates:
        quantities += [Quantity("v", unit), Quantity("a", ACCELERATION_UNIT[unit])]
    return AttachedSensor(sensor, (), name, None, tuple(quantities), name)


def _require_names(
    sensors: Sequence[AttachedSensor], tables: tuple[Sequence[Coordinate], ...]
) -> None:
    """Raise AssemblyError if two readings have the same name, in Functions or in results.

    `tables` are the coordinates of q, of v, and of cut joints.
    """
    owners = dict.fromkeys(_INPUTS, "an input of the models")
    columns = {
        f"{row.name}.{kind}": f"coordinate {row.name}"
        for table, kinds in zip(tables, (("q",), ("v", "a"), ()), strict=True)
        for row in table
        for kind in kinds
    }
    for attached in sensors:
        name = attached.sensor.name
        for known, names in (
            (owners, [output for output, _ in attached.outputs]),
            (columns, [column for column, _ in attached.columns]),
        ):
            taken = next((n for n in names if n in known), None)
            if taken is not None:
                raise AssemblyError(
                    f"{name}: what it reads would be named {taken!r}, which is the name of"
                    f" {known[taken]}; rename the {type(attached.sensor).__name__}"
                )
            known.update(dict.fromkeys(names, f"a reading of {name}"))
