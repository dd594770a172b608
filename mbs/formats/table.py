"""Robot as a table of frames: description of Khalil & Kleinfinger 1986 as plain data.

Frames are numbered from 1 in the order of the rows; antecedent 0 is the base. Rows contain the
given expressions without evaluation.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

import numpy as np
from casadi import DM, SX
from numpy.typing import NDArray

from mbs.components import (
    Cylindrical,
    Fixed,
    Joint,
    KhalilBody,
    Planar,
    Point,
    Prismatic,
    Revolute,
    RigidBody,
    Rotor,
    Spherical,
    Universal,
)
from mbs.components.bodies import mount_of
from mbs.components.component import Placement, component_name
from mbs.components.joints import motor_range
from mbs.components.notes import ImportNote
from mbs.errors import DescriptionError
from mbs.expressions import Expression, Number, Scalar, expression, number, parameters_of, to_float
from mbs.mechanism import Mechanism
from mbs.spatial.inertia import TEN_PARAMETERS
from mbs.text import did_you_mean, quoted

# Rows of a table of frames: plain data, checked by `mbs.formats.table.RobotTable`.


GEOMETRY = ("gamma", "b", "alpha", "d", "theta", "r")
"""Six geometric parameters of a frame, in the order of the transformations."""

DRIVE = ("Ia", "Fv", "Fs", "stiffness")
"""Rotor inertia, friction and spring of the joint of a body row; zero by default."""

BODY_SCALARS = (*TEN_PARAMETERS, *DRIVE, "Fs_width", "rest")
"""Scalar fields of a body row."""

JOINTS = ("revolute", "prismatic", "fixed")
"""Names of the joint types sigma = 0, 1, 2."""

LOOP_JOINTS = (*JOINTS, "cylindrical", "universal", "spherical", "planar")
"""Names of the joint types at which a loop may be cut."""


@dataclass(frozen=True, slots=True)
class FrameRow:
    """Frame j and its joint, which moves it relative to its antecedent.

    Attributes:
        antecedent: number of the antecedent frame, 0 for the base.
        sigma: 0 revolute, 1 prismatic, 2 fixed.
        actuated: whether the joint is actuated (mu); None if the assembly decides.
        gamma, b, alpha, d, theta, r: Khalil parameters [rad, m]. The joint variable is added to
            theta of a revolute joint and to r of a prismatic joint.
        limits: (lower, upper) limits of the joint variable [rad or m].
        name: name of the joint; q<j> if empty.
        velocity: (lower, upper) limits of the joint velocity, or one limit for both directions
            [rad/s or m/s].
        effort: (lower, upper) limits of the motor effort, or one limit for both directions [N m or
            N].
    """

    antecedent: int
    sigma: int = 0
    actuated: bool | None = None
    gamma: Scalar = 0.0
    b: Scalar = 0.0
    alpha: Scalar = 0.0
    d: Scalar = 0.0
    theta: Scalar = 0.0
    r: Scalar = 0.0
    limits: tuple[float, float] | None = None
    name: str = ""
    velocity: tuple[float, float] | float | None = None
    effort: tuple[float, float] | float | None = None

    @property
    def geometry(self) -> dict[str, Scalar]:
        """The six Khalil parameters by name."""
        return {key: getattr(self, key) for key in GEOMETRY}


@dataclass(frozen=True, slots=True)
class InertiaRow:
    """Body of frame j and drive of joint j.

    Attributes:
        frame: number of the frame.
        XX, XY, XZ, YY, YZ, ZZ: inertia about the origin of the frame, in its axes [kg m^2].
        MX, MY, MZ: first moments [kg m].
        M: mass [kg].
        Ia: rotor inertia, referred to the joint [kg m^2 or kg].
        Fv, Fs: viscous [N m s/rad or N s/m] and Coulomb friction [N m or N].
        Fs_width: velocity over which Coulomb friction changes sign [rad/s or m/s], 0 for a step.
        stiffness: stiffness of the joint spring [N m/rad or N/m].
        rest: rest position of the joint spring [rad or m].
        rotor: rotor that is driven by the joint and mounted on the antecedent of the frame. Its
            axis, if given, is in the axes of frame j at the zero position.
        name: name of the body; link<j> if empty.
        grouped: whether the values are base parameters, which may not belong to a physical body.
    """

    frame: int
    XX: Scalar = 0.0
    XY: Scalar = 0.0
    XZ: Scalar = 0.0
    YY: Scalar = 0.0
    YZ: Scalar = 0.0
    ZZ: Scalar = 0.0
    MX: Scalar = 0.0
    MY: Scalar = 0.0
    MZ: Scalar = 0.0
    M: Scalar = 0.0
    Ia: Scalar = 0.0
    Fv: Scalar = 0.0
    Fs: Scalar = 0.0
    Fs_width: Scalar = 1e-3
    stiffness: Scalar = 0.0
    rest: Scalar = 0.0
    rotor: Rotor | None = None
    name: str = ""
    grouped: bool = False

    @property
    def is_body(self) -> bool:
        """Whether the inertial parameters are numeric and physically consistent."""
        values: dict[str, Any] = {name: expression(getattr(self, name)) for name in TEN_PARAMETERS}
        if not all(isinstance(value, Number) for value in values.values()):
            return False
        try:
            KhalilBody("body", **values)
        except DescriptionError:
            return False
        return True

    @property
    def drive(self) -> list[str]:
        """Names of the nonzero drive parameters of the joint."""
        given = [name for name in DRIVE if to_float(expression(getattr(self, name))) != 0]
        return [*given, *(["rotor"] if self.rotor is not None else [])]


@dataclass(frozen=True, slots=True)
class CutRow:
    """Loop that is cut at a joint, with one frame on each side of the joint.

    Attributes:
        cut: (k, k+B): frame k moves with the variable of the cut joint, frame k+B is fixed on the
            other side. They coincide if the loop is closed. Frame k+B may be the antecedent of
            other frames.
        joint: type of the cut joint.
    """

    cut: tuple[int, int]
    joint: str = "revolute"


@dataclass(frozen=True, slots=True)
class RobotTable:
    """Robot as a table of frames, bodies and loops.

    Attributes:
        name: name of the robot.
        frames: rows 1 .. N.
        bodies: at most one row per frame; frames without a row have no mass.
        loops: cuts of the closed loops.
        gravity: acceleration of gravity in the base frame [m/s^2].
        parameters: values of the symbols in the rows.
        source: origin of the data.
        guess: joint positions near which the loops are closed, by joint name of `joint_name` [rad
            or m].
        extras: further data of a file as texts, kept for writing. "Z" has the 16 elements, row by
            row, of the pose of the base in the world (mount).

    Raises:
        DescriptionError: rows are inconsistent; the message names the row.
    """

    name: str
    frames: tuple[FrameRow, ...]
    bodies: tuple[InertiaRow, ...] = ()
    loops: tuple[CutRow, ...] = ()
    gravity: tuple[Scalar, ...] = (0.0, 0.0, -9.81)
    parameters: Mapping[str, float] = field(default_factory=dict)
    source: str = ""
    guess: Mapping[str, float] = field(default_factory=dict)
    extras: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check the rows and convert their values.

        Raise a DescriptionError if they are inconsistent.
        """
        if not isinstance(self.name, str) or not self.name.strip():
            raise DescriptionError(f"robot {self.name!r}: the name is not a text; give it a name")
        if not self.frames:
            raise DescriptionError(f"{self.name}: there is no frame; give at least one")
        frames = tuple(
            _checked_frame(f"{self.name}/frame {j}", j, row) for j, row in enumerate(self.frames, 1)
        )
        bodies = tuple(
            _with_scalars(f"{self.name}/body {b.frame}", b, BODY_SCALARS) for b in self.bodies
        )
        gravity = _gravity(self.name, self.gravity)
        values = _values(self.name, self.parameters, (frames, bodies, gravity))
        checked = {
            "frames": tuple(_bare(row, GEOMETRY) for row in frames),
            "loops": tuple(map(_plain_cut, self.loops)),
            "bodies": tuple(_bare(row, BODY_SCALARS) for row in bodies),
            "gravity": tuple(expression(str(g)) for g in gravity),
            "parameters": values,
        }
        for name, value in checked.items():
            object.__setattr__(self, name, value)
        _check_bodies(self)
        _check_loops(self)
        object.__setattr__(self, "guess", _guess(self))

    @property
    def cut_frames(self) -> frozenset[int]:
        """Numbers of the frames on both sides of the cut joints."""
        return frozenset(frame for loop in self.loops for frame in loop.cut)

    @property
    def symbols(self) -> frozenset[str]:
        """Names of the symbols in the rows."""
        scalars = _scalars((self.frames, self.bodies, self.gravity))
        return frozenset(symbol.name for scalar in scalars for symbol in parameters_of(scalar))

    def joint_name(self, j: int) -> str:
        """Return the name of a joint: the name in its row, or q<j>.

        Args:
            j: number of the frame that the joint moves, from 1.
        """
        return self.frames[j - 1].name or f"q{j}"


def require_table(table: object) -> None:
    """Raise if the argument is not a table of frames (`RobotTable`).

    Args:
        table: argument of a function.

    Raises:
        DescriptionError: the argument is a mechanism, a system or another object.
    """
    if not isinstance(table, RobotTable):
        raise DescriptionError(
            f"table of frames {quoted(table)}: it is a {type(table).__name__}; give a RobotTable,"
            " which from_dict, read_toml and read_par make"
        )


Row = TypeVar("Row", FrameRow, InertiaRow)


def _with_scalars(where: str, row: Row, names: tuple[str, ...]) -> Row:
    """Return the row with the fields `names` as expressions; `where` is for error messages."""
    values: dict[str, Any] = {n: expression(getattr(row, n), f"{where}, {n}") for n in names}
    return replace(row, **values)


def _bare(row: Row, names: tuple[str, ...]) -> Row:
    """Return the row with symbols without default values, which are stored in the table.

    `names` are the scalar fields of the row.
    """
    values: dict[str, Any] = {n: expression(str(getattr(row, n))) for n in names}
    if isinstance(row, InertiaRow):
        values["frame"] = int(row.frame) if _is_int(row.frame) else row.frame
        if row.rotor is not None:
            scalars: dict[str, Any] = {
                n: expression(str(getattr(row.rotor, n))) for n in ("inertia", "ratio")
            }
            values["rotor"] = replace(row.rotor, **scalars)
    return replace(row, **values)


def _plain_cut(loop: CutRow) -> CutRow:
    """Return the row with frame numbers as Python integers."""
    cut: Any = tuple(int(k) if _is_int(k) else k for k in loop.cut)
    return replace(loop, cut=cut)


def _checked_frame(where: str, j: int, row: FrameRow) -> FrameRow:
    """Return row j with its values as expressions and numbers.

    Raise a DescriptionError that begins with `where` if the row is inconsistent.
    """
    if not _is_int(row.sigma) or row.sigma not in (0, 1, 2):
        raise DescriptionError(
            f"{where}: sigma is {row.sigma!r}; use 0 (revolute), 1 (prismatic) or 2 (fixed)"
        )
    if not _is_int(row.antecedent) or not 0 <= row.antecedent < j:
        raise DescriptionError(
            f"{where}: antecedent {row.antecedent!r} must be 0 (base) or an earlier frame"
        )
    limited = any(given is not None for given in (row.limits, row.velocity, row.effort))
    if row.sigma == 2 and (row.actuated or limited):
        raise DescriptionError(
            f"{where}: a fixed frame has a motor or limits; remove them or give it a joint"
        )
    row = _with_scalars(where, row, GEOMETRY)
    return replace(
        row,
        antecedent=int(row.antecedent),
        sigma=int(row.sigma),
        actuated=None if row.sigma == 2 else row.actuated,
        limits=None if row.limits is None else _limits(where, row.limits),
        velocity=motor_range(where, "velocity", row.velocity),
        effort=motor_range(where, "effort", row.effort),
    )


def _limits(where: str, limits: Any) -> tuple[float, float]:
    """Return (lower, upper) of joint limits; raise a DescriptionError if they are not ordered."""
    pair = list(limits) if isinstance(limits, (list, tuple, np.ndarray)) else []
    numbers = [number(value, f"{where}: limits") for value in pair]
    if len(numbers) != 2 or not numbers[0] < numbers[1]:
        raise DescriptionError(
            f"{where}: limits {limits!r} are not [lower, upper]; give two numbers in order"
        )
    return numbers[0], numbers[1]


def _gravity(name: str, gravity: Any) -> tuple[Expression, ...]:
    """Return the three components of gravity as expressions; raise a DescriptionError otherwise.

    `name` is the name of the robot.
    """
    if not isinstance(gravity, (list, tuple, np.ndarray)) or len(gravity) != 3:
        raise DescriptionError(f"{name}: gravity {gravity!r} has not three values; give [x, y, z]")
    return tuple(expression(g, f"{name}, gravity") for g in gravity)


def _values(name: str, given: Mapping[str, float], rows: Any) -> dict[str, float]:
    """Return the values of the symbols: given values, and else defaults of Parameters in the rows.

    `rows` are (frames, bodies, gravity). Raise a DescriptionError for a value of an unused symbol.
    """
    used: dict[str, float | None] = {}
    for scalar in _scalars(rows):
        for symbol in parameters_of(scalar):
            if symbol.default is not None or symbol.name not in used:
                used[symbol.name] = symbol.default
    values = {symbol: value for symbol, value in used.items() if value is not None}
    for key, value in given.items():
        if key not in used:
            raise DescriptionError(
                f"{name}: parameter {key!r} is used by no row; {did_you_mean(key, used)}"
            )
        values[key] = number(value, f"{name}, parameter {key}")
    return values


def _guess(table: RobotTable) -> dict[str, float]:
    """Return the guess of a table as numbers by joint.

    Raise a DescriptionError for unknown joints.
    """
    where = f"{table.name}, guess"
    known = [table.joint_name(j) for j in range(1, len(table.frames) + 1) if _has_joint(table, j)]
    values: dict[str, float] = {}
    for joint, value in table.guess.items():
        if joint not in known and joint.rpartition(".")[0] not in known:
            raise DescriptionError(
                f"{where}: there is no joint {joint!r}; {did_you_mean(joint, known)}"
            )
        values[joint] = number(value, f"{where} of {joint}")
    return values


def _scalars(rows: Any) -> Iterator[Expression]:
    """Yield all scalar expressions of (frames, bodies, gravity)."""
    frames, bodies, gravity = rows
    for row in frames:
        yield from (getattr(row, key) for key in GEOMETRY)
    for row in bodies:
        yield from (getattr(row, key) for key in BODY_SCALARS)
        yield from (row.rotor.inertia, row.rotor.ratio) if row.rotor is not None else ()
    yield from gravity


def _check_bodies(table: RobotTable) -> None:
    """Raise a DescriptionError if a body row has no frame of its own, or drives a fixed frame."""
    seen: set[int] = set()
    for body in table.bodies:
        where = f"{table.name}/body {body.frame}"
        if not _is_int(body.frame) or not 1 <= body.frame <= len(table.frames):
            raise DescriptionError(f"{where}: there is no such frame; use 1 to {len(table.frames)}")
        if body.frame in seen:
            raise DescriptionError(f"{where}: two bodies are on this frame; give their sum once")
        seen.add(body.frame)
        if table.frames[body.frame - 1].sigma == 2 and body.drive:
            raise DescriptionError(
                f"{where}: the frame is fixed but {body.drive[0]} is given; take it out"
            )


def _check_loops(table: RobotTable) -> None:
    """Raise a DescriptionError if cuts share frames, or a cut frame has a body or descendants."""
    used: set[int] = set()
    for k, loop in enumerate(table.loops, 1):
        where = f"{table.name}/loop {k}"
        _check_loop(where, loop, table.frames)
        if used & set(loop.cut):
            raise DescriptionError(
                f"{where}: a frame of cut {list(loop.cut)} is in another loop too"
            )
        used |= set(loop.cut)
    for j, row in enumerate(table.frames, 1):
        for loop in table.loops:
            if row.antecedent == loop.cut[0]:
                raise DescriptionError(
                    f"{table.name}/frame {j}: antecedent {row.antecedent} moves with a cut joint;"
                    f" place the frame on a link, or on the other frame of the cut, {loop.cut[1]}"
                )
    for body in table.bodies:
        driven = body.drive and not _is_moving(table, body.frame)
        has_inertia = any(to_float(getattr(body, name)) != 0 for name in TEN_PARAMETERS)
        if body.frame in table.cut_frames and (driven or has_inertia):
            raise DescriptionError(
                f"{table.name}/body {body.frame}: the frame belongs to a cut joint, which has no"
                " body; give the inertia to the link it is placed on"
            )


def _is_moving(table: RobotTable, frame: int) -> bool:
    """Whether the frame with this number moves with the variable of a cut joint."""
    return any(loop.cut[0] == frame for loop in table.loops)


def _has_joint(table: RobotTable, frame: int) -> bool:
    """Whether the frame with this number has a joint: sigma is 0 or 1, or it is cut."""
    return table.frames[frame - 1].sigma != 2 or _is_moving(table, frame)


def _check_loop(where: str, loop: CutRow, frames: tuple[FrameRow, ...]) -> None:
    """Raise a DescriptionError if a cut has an unknown joint, wrong frames or a wrong sigma."""
    if loop.joint not in LOOP_JOINTS:
        raise DescriptionError(
            f"{where}: joint {loop.joint!r} is unknown;"
            f" {did_you_mean(str(loop.joint), LOOP_JOINTS)}"
        )
    valid = len(loop.cut) == 2 and all(_is_int(k) and 1 <= k <= len(frames) for k in loop.cut)
    if not valid or loop.cut[0] == loop.cut[1]:
        raise DescriptionError(
            f"{where}: cut {list(loop.cut)} does not name two frames; use numbers from 1 to"
            f" {len(frames)}"
        )
    moving, fixed = (frames[k - 1].sigma for k in loop.cut)
    expected = {"revolute": 0, "prismatic": 1}.get(loop.joint, 2)
    if moving != expected or fixed != 2:
        raise DescriptionError(
            f"{where}: frames {list(loop.cut)} of a {loop.joint} cut joint have sigma {moving} and"
            f" {fixed}; they must be {expected} and 2"
        )


def _is_int(value: object) -> bool:
    """Whether a value is a Python or numpy integer; booleans are not."""
    return isinstance(value, (int, np.integer)) and not isinstance(value, bool)


# Conversion of a table of frames to a mechanism.


_MOVING = (Revolute, Prismatic)
_CLOSING: dict[str, type[Joint]] = {
    "revolute": Revolute,
    "prismatic": Prismatic,
    "fixed": Fixed,
    "cylindrical": Cylindrical,
    "universal": Universal,
    "spherical": Spherical,
    "planar": Planar,
}
_BASE_MOTION = ("W0", "WP0", "V0", "VP0")


def to_mechanism(table: RobotTable) -> Mechanism:
    """Convert a table to a mechanism, with the numbering of its frames.

    Joint j is named q<j> and body j link<j>, unless the rows have names. A fixed frame becomes a
    body fixed to its antecedent. The two frames of a cut become one joint between their links, at
    which the loop is cut. It is passive unless the row of its moving frame is actuated.

    Args:
        table: table of frames.

    Raises:
        DescriptionError: the argument is not a table, a body is physically inconsistent, two names
            are equal, or the base moves.
    """
    require_table(table)
    _check_base(table)
    mechanism = Mechanism(
        component_name(table.name),
        gravity=table.gravity,
        parameters=table.parameters,
        source=table.source,
        keep_order=True,
        guess=table.guess,
    )
    mechanism.mount, notes = base_placement(table.extras)
    mechanism.notes.extend(notes)
    rows = {row.frame: row for row in table.bodies}
    links: dict[int, RigidBody] = {0: mechanism.world}
    for j, frame in enumerate(table.frames, 1):
        if j in table.cut_frames:
            continue
        row = rows.get(j, InertiaRow(j))
        links[j] = mechanism.add(_body(j, row))
        mechanism.numbered[j] = links[j].name
        point = _place(table, j, links)
        if frame.sigma == 2:
            mechanism.connect(point, links[j])
        else:
            actuated = True if frame.actuated is None and not table.loops else frame.actuated
            joint = _MOVING[frame.sigma](**_joint(table, j, row, actuated))
            mechanism.connect(point, joint, links[j])
    for loop in table.loops:
        _close(mechanism, table, loop, links, rows.get(loop.cut[0], InertiaRow(loop.cut[0])))
    return mechanism


def _close(
    mechanism: Mechanism,
    table: RobotTable,
    loop: CutRow,
    links: dict[int, RigidBody],
    row: InertiaRow,
) -> None:
    """Add the cut joint of a loop between two links; `row` is the body row with its drive."""
    moving, fixed = loop.cut
    scalars = _joint(table, moving, row, bool(table.frames[moving - 1].actuated))
    joint = _CLOSING[loop.joint](**scalars)
    mechanism.connect(_place(table, moving, links), joint, _place(table, fixed, links))
    mechanism.cut(joint)


def _place(table: RobotTable, j: int, links: Mapping[int, RigidBody]) -> Point:
    """Return frame j at joint position zero, relative to an existing link.

    The antecedent may be the fixed frame of a cut, which is itself fixed to a link. `links` are the
    bodies by frame number.
    """
    rows = [table.frames[j - 1]]
    while rows[-1].antecedent not in links:
        rows.append(table.frames[rows[-1].antecedent - 1])
    point = links[rows[-1].antecedent].at_khalil(**rows[-1].geometry)
    for row in reversed(rows[:-1]):
        point = point.at_khalil(**row.geometry)
    return point


def _joint(table: RobotTable, j: int, row: InertiaRow, actuated: bool | None) -> dict[str, Any]:
    """Return the keyword arguments of the joint component of frame j.

    They are its name, its limits, and the drive from the body row.
    """
    return {
        "name": table.joint_name(j),
        "actuated": actuated,
        **{name: getattr(table.frames[j - 1], name) for name in ("limits", "velocity", "effort")},
        **{name: getattr(row, name) for name in (*DRIVE, "Fs_width", "rest", "rotor")},
    }


def _body(j: int, row: InertiaRow) -> KhalilBody:
    """Return the body of frame j with the inertial parameters of its row."""
    ten: dict[str, Any] = {name: getattr(row, name) for name in TEN_PARAMETERS}
    return KhalilBody(row.name or f"link{j}", grouped=row.grouped, **ten)


def _check_base(table: RobotTable) -> None:
    """Raise a DescriptionError if the table contains a motion of the base."""
    for key in _BASE_MOTION:
        if any(to_float(expression(text)) != 0 for text in table.extras.get(key, ())):
            raise DescriptionError(
                f"{table.name}: {key} is {list(table.extras[key])}, but the base of a table does"
                " not move; set it to zero and put a free joint under the robot instead"
            )


# Pose of the base in the world, as the vector Z of robot files of SYMORO and of tables.


Array = NDArray[np.float64]

POSE = "Z"
"""Name of the vector: the elements of a (4, 4) homogeneous matrix, row by row."""


def base_pose_texts(pose: Array) -> tuple[str, ...]:
    """Return the vector Z of a base pose as 16 texts.

    Args:
        pose: (4, 4) homogeneous matrix of the base in the world; its elements are written row by
            row.
    """
    return tuple(repr(float(value) + 0.0) for value in np.ravel(pose))


def placement_pose(placement: Placement, values: Mapping[str, float]) -> Array | None:
    """Return the base pose in the world as a numeric matrix (4, 4).

    None if a symbol of the placement has no value, or if an element is not finite.

    Args:
        placement: mount of the base on the world, which may contain symbols.
        values: numeric values of the symbols, by name.
    """
    names = {symbol.name for value in placement.expressions() for symbol in parameters_of(value)}
    if not names <= set(values):
        return None
    found = placement.pose({name: SX(float(values[name])) for name in names}).matrix
    pose = np.array(DM(found))
    return pose if np.isfinite(pose).all() else None


def base_placement(extras: Mapping[str, Sequence[str]]) -> tuple[Placement, list[ImportNote]]:
    """Return the mount of the base on the world from the extra data of a table of frames.

    Args:
        extras: extra vectors of the table as texts; the vector "Z" has the 16 elements of the pose.

    Returns:
        The mount and the import notes. The mount is the identity if there is no vector "Z". If the
        vector is not a numeric pose, the mount is the identity as well, and there is one note.
    """
    texts = extras.get(POSE, ())
    values = [to_float(expression(text)) for text in texts]
    if not texts or values == np.eye(4).ravel().tolist():
        return Placement(), []
    try:
        T: Any = np.reshape(np.array(values, dtype=float), (4, 4))
        if not np.array_equal(T[3], [0, 0, 0, 1]):
            raise ValueError
        mount = {"position": T[:3, 3].tolist(), "rotation": T[:3, :3].tolist()}
        return Placement(mount_of(mount, POSE)[0]), []
    except (ValueError, TypeError, DescriptionError):
        what = "is no pose of the base in numbers; the base has no mount"
        return Placement(), [ImportNote("ignored", f"vector {POSE}", what)]
