"""Joints: relative motion of frame_b and frame_a, with rotors, friction and limits.

A joint is described by its freedoms, a sequence of elementary motions from frame_a to frame_b. The
constraint rows of a cut joint, which close a loop, follow from the same description
(`mbs.loops.closure_residual`).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any

import casadi
import numpy as np
from casadi import DM, SX

from mbs.components.component import Component, Point, SymbolTable, in_plane, unit_axis
from mbs.components.custom import Flange
from mbs.errors import DescriptionError
from mbs.expressions import Number, Scalar, expression, to_float
from mbs.numbers import has_boolean
from mbs.spatial import Pose, align_z
from mbs.text import quoted

# Elementary motions, of which every joint is made.


class Motion(Enum):
    """Elementary motion of a frame: revolute about z, prismatic along z, spherical, or free."""

    REVOLUTE = "revolute"
    PRISMATIC = "prismatic"
    SPHERICAL = "spherical"
    FREE = "free"

    @property
    def nq(self) -> int:
        """Number of position coordinates: 1, 4 (unit quaternion) or 7 (position and quaternion)."""
        return {"spherical": 4, "free": 7}.get(self.value, 1)

    @property
    def nv(self) -> int:
        """Number of velocities: 1, 3 (angular velocity) or 6 (linear and angular velocity)."""
        return {"spherical": 3, "free": 6}.get(self.value, 1)


@dataclass(frozen=True, slots=True)
class Freedom:
    """One elementary motion of a joint.

    Attributes:
        motion: type of the motion.
        axis: unit vector of the axis in frame_a at the zero configuration; z for motions without
            an axis.
        suffix: suffix that distinguishes its coordinates from others of the same joint.
    """

    motion: Motion
    axis: tuple[float, float, float] = (0.0, 0.0, 1.0)
    suffix: str = ""

    def coordinate_of(self, joint: str) -> str:
        """Return the name of its coordinate: "JOINT", or "JOINT.SUFFIX" if it has a suffix.

        Args:
            joint: name of the joint.
        """
        return f"{joint}.{self.suffix}" if self.suffix else joint


# Constraint rows that close a loop at a cut joint, as functions of the pose of frame_b in frame_a.
#
# Lengths are in metres and directions are cosines. Each row is zero if the loop is closed.
#
# Source: Haug 1989, chapter 9, for the rows of each type of joint.


Rows = list[tuple[str, SX]]
"""Pairs of label and value of constraint rows."""


def position_rows(pose: Pose, axes: str) -> Rows:
    """Return constraint rows "force AXIS": coordinates of the origin of frame_b in frame_a [m].

    Args:
        pose: pose of frame_b relative to frame_a.
        axes: letters x, y or z of the axes of frame_a, one row each.
    """
    return [(f"force {axis}", pose.p["xyz".index(axis)]) for axis in axes]


def tilt_rows(pose: Pose) -> Rows:
    """Return the rows "moment y" and "moment x" of parallel z axes.

    They are the cosines of z of frame_b with x and with y of frame_a.

    Both are zero if the z axes of the two frames are parallel or opposed.

    Args:
        pose: pose of frame_b relative to frame_a.
    """
    return [("moment y", pose.R[0, 2]), ("moment x", pose.R[1, 2])]


def orientation_rows(pose: Pose) -> Rows:
    """Return rows "moment x", "moment y", "moment z" that are zero if the frames are parallel.

    The values are sin(theta) u, in axes of frame_a, for the rotation of frame_b by theta about u.

    Args:
        pose: pose of frame_b relative to frame_a.
    """
    R = pose.R
    return [
        ("moment x", 0.5 * (R[2, 1] - R[1, 2])),
        ("moment y", 0.5 * (R[0, 2] - R[2, 0])),
        ("moment z", 0.5 * (R[1, 0] - R[0, 1])),
    ]


def weld_rows(pose: Pose) -> Rows:
    """Return the six rows "force x" .. "moment z" that are zero if the frames coincide.

    Args:
        pose: pose of frame_b relative to frame_a.
    """
    return [*position_rows(pose, "xyz"), *orientation_rows(pose)]


def along_z(pose: Pose, axis: Sequence[float]) -> Pose:
    """Return the pose of frame_b in frame_a after both frames are rotated so that z is `axis`.

    Args:
        pose: pose of frame_b relative to frame_a.
        axis: three numbers, the direction of the new z axis in each frame.
    """
    inside = Pose.rotation(align_z(axis))
    return inside.inverse() @ pose @ inside


def cosine(pose: Pose, axis: Sequence[float]) -> SX:
    """Return the cosine between a vector fixed in frame_b and the same vector in frame_a.

    The value is 1 for parallel and -1 for opposed vectors.

    Args:
        pose: pose of frame_b relative to frame_a.
        axis: unit vector, three numbers.
    """
    z = SX(DM(list(axis)))
    return casadi.dot(z, casadi.mtimes(pose.R, z))


def diagonal(pose: Pose) -> list[SX]:
    """Return the cosines x-x, y-y and z-z between equal axes of frame_b and frame_a.

    Args:
        pose: pose of frame_b relative to frame_a.
    """
    return [pose.R[k, k] for k in range(3)]


# Rotors of motors, geared to a joint.


@dataclass(frozen=True, slots=True, kw_only=True)
class Rotor:
    """A balanced rotor on the link of a joint's frame_a, geared to the joint.

    Relative to that link it spins at `ratio` times the velocity of the joint. The mass and the
    inertia of the locked rotor are part of the body that carries it.

    Attributes:
        inertia: moment of inertia about its own axis [kg m^2].
        ratio: revolutions of the rotor per revolution of the joint, or rad per m of a prismatic
            joint; negative for opposite directions.
        axis: axis of the rotor in frame_a, as a letter or three numbers. None for the joint axis.
    """

    inertia: Scalar
    ratio: Scalar = 1.0
    axis: Any = None

    def __post_init__(self) -> None:
        for name in ("inertia", "ratio"):
            value = expression(getattr(self, name), f"rotor, {name}")
            object.__setattr__(self, name, value)
        if self.axis is not None:
            object.__setattr__(self, "axis", unit_axis("rotor", self.axis))


# Limits of joints: ranges of the position, the velocity and the effort of the motor.


Range = tuple[float, float]


def limits_by_suffix(
    name: str, suffixes: Iterable[str], limits: Any
) -> tuple[tuple[str, Range], ...]:
    """Return the position ranges of a joint, as pairs of coordinate suffix and range.

    Args:
        name: name of the joint, for error messages.
        suffixes: suffixes of its coordinates of one number.
        limits: None, a pair for a joint with one coordinate, or a mapping from suffixes to pairs.

    Raises:
        DescriptionError: a range refers to no coordinate, or is not (lower, upper).
    """
    if limits is None:
        return ()
    known = set(suffixes)
    items: list[tuple[Any, Any]] = [("" if known == {""} else None, limits)]
    if isinstance(limits, Mapping):
        items = list(limits.items())
    elif isinstance(limits, tuple) and all(_is_named_interval(item) for item in limits):
        items = list(limits)
    return tuple((suffix, _interval(name, suffix, pair, known)) for suffix, pair in items)


def motor_range(where: str, quantity: str, given: Any) -> Range | None:
    """Return the range of a velocity or an effort. A single number x means (-x, x).

    Args:
        where: name of the joint, for error messages.
        quantity: "velocity" or "effort".
        given: None, a number above zero, or (lower, upper) with zero between them.

    Raises:
        DescriptionError: the value has another form.
    """
    if given is None:
        return None
    lower, upper = _as_pair(given) if np.ndim(given) else _symmetric_range(given)
    if not lower < upper or lower > 0 or upper < 0:
        raise DescriptionError(
            f"{where}: {quantity} is {quoted(given)}; give the largest one, above zero, or"
            " (lower, upper) with zero between them"
        )
    return lower, upper


def _symmetric_range(given: Any) -> Range:
    """Return (-given, given) as floats; (NaN, NaN) if it is not a number."""
    largest = _as_pair((given, given))[0]
    return -largest, largest


def _as_pair(pair: Any) -> Range:
    """Return (low, high) as floats; (NaN, NaN) if the value is not a pair of numbers."""
    if has_boolean(pair):
        return math.nan, math.nan
    try:
        low, high = (float(value) for value in pair)
    except (TypeError, ValueError):
        return math.nan, math.nan
    return low, high


def _interval(name: str, suffix: Any, pair: Any, known: set[str]) -> Range:
    """Return the range `pair` as (lower, upper) floats.

    Raise DescriptionError if it is not in order, or if `suffix` is not in `known`, the suffixes of
    the coordinates of the joint `name`.
    """
    if suffix not in known:
        raise DescriptionError(
            f"{name}: limits {quoted(pair)} name no coordinate of one number; "
            + (f"give a mapping from {sorted(known)}" if known else "leave them out")
        )
    low, high = _as_pair(pair)
    if not low < high:
        raise DescriptionError(
            f"{name}: limits {quoted(pair)} are not (lower, upper); give two numbers in order"
        )
    return low, high


def _is_named_interval(item: Any) -> bool:
    """Return whether an entry of limits is a pair of a coordinate suffix and a range."""
    return isinstance(item, tuple) and len(item) == 2 and isinstance(item[0], str)


@dataclass(frozen=True, slots=True, kw_only=True)
class Joint(Component):
    """Base of all joints.

    Attributes:
        actuated: Whether a motor drives the joint. None lets the assembly choose: joints of an open
            chain are actuated, joints of a loop and Free joints are passive.
        limits: (lower, upper) of its position, or a mapping from coordinate suffix to such pairs.
        velocity: largest velocity in both directions, or (lower, upper), of a joint of one
            degree of freedom [rad/s or m/s]. It is stored as the pair.
        effort: largest effort of its motor in both directions, or (lower, upper) [N m or N]. It is
            stored as the pair.
        Fv: viscous friction [N m s/rad or N s/m].
        Fs: Coulomb friction [N m or N], with the effort Fs tanh(v / Fs_width).
        Fs_width: velocity over which Coulomb friction changes sign [rad/s or m/s]. Zero gives the
            step Fs sign(v), which is for identification and unsuitable for integrators.
        Ia: rotor inertia reflected to the joint [kg m^2 or kg]. `rotor` also models the gyroscopic
            effect of the spin on the link that carries the rotor.
        stiffness: stiffness of a spring between its two frames [N m/rad or N/m], for a joint of one
            degree of freedom.
        rest: position at which the spring is relaxed [rad or m].
        rotor: `Rotor` that spins with a joint of one degree of freedom, with its gyroscopic
            effects. It acts in addition to Ia.
    """

    actuated: bool | None = None
    limits: Any = None
    velocity: Any = None
    effort: Any = None
    Fv: Scalar = 0.0
    Fs: Scalar = 0.0
    Fs_width: Scalar = 1e-3
    Ia: Scalar = 0.0
    stiffness: Scalar = 0.0
    rest: Scalar = 0.0
    rotor: Rotor | None = None

    def __post_init__(self) -> None:
        Component.__post_init__(self)
        if self.actuated not in (None, True, False):
            raise DescriptionError(
                f"{self.name}: actuated is {self.actuated!r}; give True, False or None"
            )
        self._normalise("Fv", "Fs", "Fs_width", "Ia", "stiffness", "rest")
        if self.rotor is not None and not isinstance(self.rotor, Rotor):
            raise DescriptionError(
                f"{self.name}: rotor is {quoted(self.rotor)}; give Rotor(inertia=..., ratio=...)"
            )
        for name, scalar in self._magnitudes():
            value = to_float(scalar)
            if value is not None and value < 0:
                raise DescriptionError(f"{self.name}: {name} is {value:g}; give zero or more")
        if self.nv != 1 or len(self.freedoms) != 1:
            self._refuse_drive()
        known = [f.suffix for f in self.freedoms if f.motion.nq == 1]
        object.__setattr__(self, "limits", limits_by_suffix(self.name, known, self.limits))
        for name in ("velocity", "effort"):
            pair = motor_range(self.name, name, getattr(self, name))
            object.__setattr__(self, name, pair)

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super(Joint, cls).__init_subclass__(**kwargs)
        # rows and freedoms describe the same motion: a class with new freedoms must not inherit old
        # rows
        if "freedoms" in vars(cls) and "closing_rows" not in vars(cls):
            cls.closing_rows = Joint.closing_rows  # type: ignore[method-assign]

    @property
    def freedoms(self) -> tuple[Freedom, ...]:
        """Elementary motions of the joint, in order from frame_a to frame_b; empty if fixed."""
        raise NotImplementedError

    def closing_rows(self, pose: Pose, symbols: SymbolTable) -> Rows | None:
        """Return label and value of the constraint rows of the cut joint; None if it cannot be cut.

        All rows are zero if the loop is closed. A joint without rows stays in the tree, and its
        free end is welded.

        Args:
            pose: pose of frame_b relative to frame_a.
            symbols: CasADi symbol of each parameter, by name.
        """
        return None

    def facing(self, pose: Pose) -> list[SX]:
        """Return cosines that must be positive in a closed loop, in addition to the zero rows.

        The constraint rows are also zero if an axis of frame_b is opposed to that of frame_a.
        Positive cosines exclude these configurations. The list is empty if none exist.

        Args:
            pose: pose of frame_b in frame_a.
        """
        return []

    @property
    def closes(self) -> bool:
        """Whether a loop can be cut at the joint: its class defines `closing_rows`."""
        return type(self).closing_rows is not Joint.closing_rows

    @property
    def companions(self) -> tuple[Component, ...]:
        """Components, such as a Coupling, that `connect` adds to the mechanism with the joint."""
        return ()

    @property
    def places(self) -> bool:
        """Whether the coordinates determine the pose of frame_b in frame_a.

        False for constraints.
        """
        return True

    @property
    def frame_a(self) -> Point:
        """Frame of the joint on the first body, relative to which frame_b moves."""
        return Point(self, "a")

    @property
    def frame_b(self) -> Point:
        """Frame of the joint on the second body, at the end of its motions."""
        return Point(self, "b")

    @property
    def flange(self) -> Flange:
        """Flange on the joint coordinate, to connect motors, gears and shafts.

        A drive line exerts a torque there, or a force if the joint is prismatic. It acts on the
        body of frame_b, with the reaction on the body of frame_a.

        Raises:
            DescriptionError: the joint has not exactly one degree of freedom.
        """
        if self.nv != 1 or len(self.freedoms) != 1:
            raise DescriptionError(
                f"{self.name}: a {type(self).__name__} joint has no flange, since it has not one"
                " position that a drive line could move; take one of a Revolute or Prismatic joint"
            )
        return Flange(self)

    @property
    def nv(self) -> int:
        """Number of degrees of freedom: velocities of the joint."""
        return sum(freedom.motion.nv for freedom in self.freedoms)

    @property
    def carries_effort(self) -> bool:
        """Whether the joint is actuated, or has friction, rotor inertia, a spring or a rotor.

        `actuated` must be True; None counts as not actuated.
        """
        efforts = (expression(value) for value in (self.Fv, self.Fs, self.Ia, self.stiffness))
        acts = self.rotor is not None or any(effort != Number(0.0) for effort in efforts)
        return bool(self.actuated) or acts

    def _magnitudes(self) -> Iterator[tuple[str, Scalar]]:
        """Yield (name, value) of each quantity that must not be negative, such as Fv and Ia."""
        for name in ("Fv", "Fs", "Fs_width", "Ia", "stiffness"):
            yield name, getattr(self, name)
        if self.rotor is not None:
            yield "inertia of the rotor", self.rotor.inertia

    def _refuse_drive(self) -> None:
        """Raise DescriptionError if a spring, rotor or motor limits need one coordinate."""
        given = [name for name in ("stiffness", "rest") if getattr(self, name) != Number(0.0)]
        given += [n for n in ("rotor", "velocity", "effort") if getattr(self, n) is not None]
        for name in given:
            raise DescriptionError(
                f"{self.name}: {name} is given, but a {type(self).__name__} joint has not one"
                " position that it could act on; give it to Revolute or Prismatic joints"
            )


@dataclass(frozen=True, slots=True)
class _AxisJoint(Joint):
    """Base of joints with an axis.

    Attributes:
        axis: axis in frame_a: "x", "y", "z", "-x", "-y", "-z", or three numbers.
    """

    axis: Any = "z"

    def __post_init__(self) -> None:
        object.__setattr__(self, "axis", unit_axis(self.name, self.axis))
        Joint.__post_init__(self)


@dataclass(frozen=True, slots=True)
class Revolute(_AxisJoint):
    """Revolute joint: a rotation about the axis. It closes a loop with 5 rows."""

    @property
    def freedoms(self) -> tuple[Freedom, ...]:
        """One rotation about `axis`; coordinate NAME [rad]."""
        return (Freedom(Motion.REVOLUTE, self.axis),)

    def closing_rows(self, pose: Pose, symbols: SymbolTable) -> Rows:
        """Return five rows: coincident origins, and parallel joint axes of frame_a and frame_b.

        Args:
            pose: pose of frame_b relative to frame_a.
            symbols: CasADi symbol of each parameter, by name.
        """
        pose = along_z(pose, self.axis)
        return [*position_rows(pose, "xyz"), *tilt_rows(pose)]

    def facing(self, pose: Pose) -> list[SX]:
        """Return the cosine between the joint axes of both frames, positive if not opposed.

        Args:
            pose: pose of frame_b relative to frame_a.
        """
        return [cosine(pose, self.axis)]


@dataclass(frozen=True, slots=True)
class Prismatic(_AxisJoint):
    """Prismatic joint: a translation along the axis. It closes a loop with 5 rows."""

    @property
    def freedoms(self) -> tuple[Freedom, ...]:
        """One displacement along `axis`; coordinate NAME [m]."""
        return (Freedom(Motion.PRISMATIC, self.axis),)

    def closing_rows(self, pose: Pose, symbols: SymbolTable) -> Rows:
        """Return five rows: no displacement across the axis, and no rotation.

        Args:
            pose: pose of frame_b relative to frame_a.
            symbols: CasADi symbol of each parameter, by name.
        """
        pose = along_z(pose, self.axis)
        return [*position_rows(pose, "xy"), *orientation_rows(pose)]

    def facing(self, pose: Pose) -> list[SX]:
        """Return the cosines x-x, y-y, z-z of both frames, positive if the axes are not opposed.

        Args:
            pose: pose of frame_b relative to frame_a.
        """
        return diagonal(pose)


@dataclass(frozen=True, slots=True)
class Cylindrical(_AxisJoint):
    """Cylindrical joint: displacement `s` along and rotation `phi` about the axis; 4 rows."""

    @property
    def freedoms(self) -> tuple[Freedom, ...]:
        """Displacement NAME.s [m] along `axis`, then rotation NAME.phi [rad] about it."""
        return (
            Freedom(Motion.PRISMATIC, self.axis, "s"),
            Freedom(Motion.REVOLUTE, self.axis, "phi"),
        )

    def closing_rows(self, pose: Pose, symbols: SymbolTable) -> Rows:
        """Return four rows: no displacement across the axis, and parallel axes of both frames.

        Args:
            pose: pose of frame_b relative to frame_a.
            symbols: CasADi symbol of each parameter, by name.
        """
        pose = along_z(pose, self.axis)
        return [*position_rows(pose, "xy"), *tilt_rows(pose)]

    def facing(self, pose: Pose) -> list[SX]:
        """Return the cosine between the joint axes of both frames, positive if not opposed.

        Args:
            pose: pose of frame_b relative to frame_a.
        """
        return [cosine(pose, self.axis)]


@dataclass(frozen=True, slots=True)
class Planar(_AxisJoint):
    """Planar joint: displacements `s_x`, `s_y` normal to the axis, rotation `phi` about it; 3 rows.

    For the axis z the displacements are along x and y of frame_a.
    """

    @property
    def freedoms(self) -> tuple[Freedom, ...]:
        """Displacements NAME.s_x and NAME.s_y [m] in the plane, then rotation NAME.phi [rad]."""
        u, v = in_plane(self.axis)
        return (
            Freedom(Motion.PRISMATIC, u, "s_x"),
            Freedom(Motion.PRISMATIC, v, "s_y"),
            Freedom(Motion.REVOLUTE, self.axis, "phi"),
        )

    def closing_rows(self, pose: Pose, symbols: SymbolTable) -> Rows:
        """Return three rows: no displacement along the normal `axis`, and parallel normals.

        Args:
            pose: pose of frame_b relative to frame_a.
            symbols: CasADi symbol of each parameter, by name.
        """
        pose = along_z(pose, self.axis)
        return [*position_rows(pose, "z"), *tilt_rows(pose)]

    def facing(self, pose: Pose) -> list[SX]:
        """Return the cosine between the normals of both frames, positive if not opposed.

        Args:
            pose: pose of frame_b relative to frame_a.
        """
        return [cosine(pose, self.axis)]


@dataclass(frozen=True, slots=True)
class Cartesian(Joint):
    """Translations `x`, `y`, `z` along the axes of frame_a, without rotation.

    The joint stays in the tree: a loop through it is closed by a weld at its frame_b.
    """

    @property
    def freedoms(self) -> tuple[Freedom, ...]:
        """Displacements NAME.x, NAME.y, NAME.z [m] along the axes of frame_a."""
        axes = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
        return tuple(Freedom(Motion.PRISMATIC, axis, name) for name, axis in axes.items())


@dataclass(frozen=True, slots=True)
class Gimbal(Joint):
    """Three successive rotations, `phi_1` about the first axis, and so on.

    It is singular if the first and the last axis are aligned; `Spherical` is never singular. The
    joint stays in the tree: a loop through it is closed by a weld at its frame_b.

    Attributes:
        axes: three axes in frame_a at the zero configuration, each orthogonal to the next.
    """

    axes: tuple[Any, Any, Any] = ("z", "y", "x")

    def __post_init__(self) -> None:
        given = tuple(self.axes) if hasattr(self.axes, "__iter__") else ()
        if len(given) != 3:
            raise DescriptionError(
                f"{self.name}: axes {quoted(self.axes)} are not three; give three axes"
            )
        axes = tuple(unit_axis(self.name, axis) for axis in given)
        for first, second in ((axes[0], axes[1]), (axes[1], axes[2])):
            if abs(np.dot(first, second)) > 1e-9:  # unit vectors: more than rounding of digits
                raise DescriptionError(
                    f"{self.name}: axes {quoted(self.axes)} are not orthogonal one to the next;"
                    " give such as ('z', 'y', 'x')"
                )
        object.__setattr__(self, "axes", axes)
        Joint.__post_init__(self)

    @property
    def freedoms(self) -> tuple[Freedom, ...]:
        """Rotations NAME.phi_1, NAME.phi_2, NAME.phi_3 [rad] about the three `axes`, in order.

        Each axis rotates with the rotations before it.
        """
        return tuple(
            Freedom(Motion.REVOLUTE, axis, f"phi_{k}") for k, axis in enumerate(self.axes, start=1)
        )


@dataclass(frozen=True, slots=True)
class PinSlot(_AxisJoint):
    """A pin in a straight slot: displacement `s` along the slot, rotation `phi` about the axis.

    The joint stays in the tree: a loop through it is closed by a weld at its frame_b.

    Attributes:
        axis: axis of the pin in frame_a.
        slot: direction of the slot in frame_a, orthogonal to the axis.
    """

    slot: Any = "x"

    def __post_init__(self) -> None:
        object.__setattr__(self, "slot", unit_axis(self.name, self.slot))
        _AxisJoint.__post_init__(self)
        if abs(np.dot(self.axis, self.slot)) > 1e-9:  # unit vectors: above rounding
            raise DescriptionError(
                f"{self.name}: slot {quoted(self.slot)} is not orthogonal to the axis"
                f" {quoted(self.axis)}; give two orthogonal directions"
            )

    @property
    def freedoms(self) -> tuple[Freedom, ...]:
        """Displacement NAME.s [m] along `slot`, then rotation NAME.phi [rad] about `axis`."""
        return (
            Freedom(Motion.PRISMATIC, self.slot, "s"),
            Freedom(Motion.REVOLUTE, self.axis, "phi"),
        )


@dataclass(frozen=True, slots=True)
class Universal(Joint):
    """Universal joint: rotations `phi_a`, then `phi_b` about orthogonal axes that meet; 4 rows.

    Attributes:
        axes: the two axes in frame_a at the zero configuration.
    """

    axes: tuple[Any, Any] = ("x", "y")

    def __post_init__(self) -> None:
        try:
            first, second = self.axes
        except (TypeError, ValueError):
            raise DescriptionError(
                f"{self.name}: axes {quoted(self.axes)} are not two; give two orthogonal axes"
            ) from None
        first, second = unit_axis(self.name, first), unit_axis(self.name, second)
        if abs(np.dot(first, second)) > 1e-9:  # unit vectors: tolerance above decimal rounding
            raise DescriptionError(
                f"{self.name}: axes {quoted(self.axes)} are not orthogonal;"
                " give two orthogonal axes"
            )
        object.__setattr__(self, "axes", (first, second))
        Joint.__post_init__(self)

    @property
    def freedoms(self) -> tuple[Freedom, ...]:
        """Rotations NAME.phi_a about the first axis, then NAME.phi_b about the second [rad]."""
        first, second = self.axes
        return (
            Freedom(Motion.REVOLUTE, first, "phi_a"),
            Freedom(Motion.REVOLUTE, second, "phi_b"),
        )

    def closing_rows(self, pose: Pose, symbols: SymbolTable) -> Rows:
        """Return four rows: coincident origins and orthogonal axes.

        "moment across" is the cosine between the first axis in frame_a and the second axis in
        frame_b.

        Args:
            pose: pose of frame_b relative to frame_a.
            symbols: CasADi symbol of each parameter, by name.
        """
        first, second = (SX(DM(list(axis))) for axis in self.axes)
        across = casadi.dot(first, casadi.mtimes(pose.R, second))
        return [*position_rows(along_z(pose, (0.0, 0.0, 1.0)), "xyz"), ("moment across", across)]


@dataclass(frozen=True, slots=True)
class Spherical(Joint):
    """Spherical joint: the orientation of frame_b in frame_a, a unit quaternion; 3 rows.

    The velocity is the angular velocity of frame_b relative to frame_a, in the axes of frame_b.
    """

    @property
    def freedoms(self) -> tuple[Freedom, ...]:
        """One spherical motion: unit quaternion of frame_b in frame_a, three velocities."""
        return (Freedom(Motion.SPHERICAL),)

    def closing_rows(self, pose: Pose, symbols: SymbolTable) -> Rows:
        """Return three rows: position of the origin of frame_b in frame_a [m].

        Args:
            pose: pose of frame_b relative to frame_a.
            symbols: CasADi symbol of each parameter, by name.
        """
        return position_rows(along_z(pose, (0.0, 0.0, 1.0)), "xyz")


@dataclass(frozen=True, slots=True)
class Free(Joint):
    """Free joint without constraint: position and unit quaternion of frame_b in frame_a.

    The velocity is the [linear; angular] velocity of frame_b relative to frame_a, in the axes of
    frame_b.
    """

    @property
    def freedoms(self) -> tuple[Freedom, ...]:
        """One free motion: position [m], unit quaternion of frame_b in frame_a, six velocities."""
        return (Freedom(Motion.FREE),)

    def closing_rows(self, pose: Pose, symbols: SymbolTable) -> Rows:
        """Return no rows: a free joint constrains nothing.

        Args:
            pose: pose of frame_b relative to frame_a.
            symbols: CasADi symbol of each parameter, by name.
        """
        return []


@dataclass(frozen=True, slots=True)
class Fixed(Joint):
    """Fixed joint (weld). It closes a loop with 6 rows."""

    @property
    def freedoms(self) -> tuple[Freedom, ...]:
        """Empty: frame_b does not move relative to frame_a."""
        return ()

    def closing_rows(self, pose: Pose, symbols: SymbolTable) -> Rows:
        """Return six rows: coincident origins and no rotation.

        Args:
            pose: pose of frame_b relative to frame_a.
            symbols: CasADi symbol of each parameter, by name.
        """
        return weld_rows(pose)

    def facing(self, pose: Pose) -> list[SX]:
        """Return the cosines x-x, y-y, z-z of both frames, positive if the axes are not opposed.

        Args:
            pose: pose of frame_b relative to frame_a.
        """
        return diagonal(pose)


# Smoothed sign of a velocity, for all laws of Coulomb friction without events.


def smooth_sign(v: SX, width: SX) -> SX:
    """Return the sign of velocities, smoothed as tanh(v / width), elementwise.

    For a width of zero it is sign(v).

    Args:
        v: velocities [rad/s or m/s].
        width: (1, 1) velocity over which the sign changes, a number or an expression. Its value may
            be zero: derivatives stay finite.
    """
    if width.is_zero():
        return casadi.sign(v)
    if width.is_constant():
        return casadi.tanh(v / width)
    vanishes = width == 0
    return casadi.if_else(vanishes, casadi.sign(v), casadi.tanh(v / (width + vanishes)))
