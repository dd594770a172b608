"""Reading of uploaded files, and conversion of mechanisms to tables of frames."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from casadi import SX, Function

from mbs.app.web.document.tables import GEOMETRY_COLUMNS, INERTIA_COLUMNS, Tables, Texts, written
from mbs.assembly import System
from mbs.assembly.tables import LinkRow
from mbs.components import (
    Joint,
    KhalilBody,
    Point,
    Prismatic,
    Revolute,
    RigidBody,
)
from mbs.components.component import KhalilStep
from mbs.errors import DescriptionError
from mbs.formats import (
    CutRow,
    FrameRow,
    InertiaRow,
    RobotTable,
    read_mjcf,
    read_par,
    read_sdf,
    read_toml,
    read_urdf,
    to_mechanism,
)
from mbs.formats.table import DRIVE, GEOMETRY, LOOP_JOINTS, POSE, base_pose_texts, placement_pose
from mbs.formats.xml import parse_xml
from mbs.mechanism import Mechanism
from mbs.spatial.inertia import TEN_PARAMETERS
from mbs.text import did_you_mean, quoted

# Uploaded MJCF files: references to other files, which MuJoCo would read, are rejected first.


_PARTS = ("include", "model", "attach")
"""Elements that insert parts of the model from another file."""


def close_mjcf(path: Path) -> None:
    """Check that an MJCF file refers to no other location, and rewrite the file as parsed.

    The XML parser of MuJoCo differs from the parser of the check, so MuJoCo reads the rewritten
    file. Meshes with plain relative paths are permitted: they are not needed for bodies
    with given inertia.

    Args:
        path: path of the file, which must be alone in its folder.

    Raises:
        DescriptionError: the file is not XML, or refers to files at other locations.
    """
    root = parse_xml(path)
    for element in root.iter():
        _check(path, element)
    path.write_bytes(ElementTree.tostring(root, encoding="utf-8"))


def _check(path: Path, element: Element) -> None:
    """Raise a DescriptionError if an element refers to files at other locations."""
    for name, value in element.attrib.items():
        is_path = name.startswith("file") or name.endswith("dir")
        if is_path and (element.tag in _PARTS or not _is_inside(value)):
            raise DescriptionError(
                f"{path}: <{element.tag}> names other files, {quoted(value)}, which were not sent"
                " with it; put the whole model in one file, with the inertias of its bodies"
            )


def _is_inside(value: str) -> bool:
    """Whether a path is relative and stays in the folder of the file."""
    plain = value.replace("\\", "/")
    return not plain.startswith("/") and ":" not in plain and ".." not in plain.split("/")


LARGEST_UPLOAD = 5_000_000
"""Maximum size of an uploaded file in bytes."""

READERS: Mapping[str, Callable[[Path], RobotTable | Mechanism]] = MappingProxyType(
    {
        ".toml": read_toml,
        ".par": read_par,
        ".urdf": partial(read_urdf, other_files=False),
        ".sdf": read_sdf,
        ".world": read_sdf,
        ".xml": partial(read_mjcf, other_files=False),
    }
)
"""Readers by file name suffix."""

_DRIVE = (*DRIVE, "Fs_width", "rest", "rotor")
_SIGMA: Mapping[type[Joint], int] = MappingProxyType({Revolute: 0, Prismatic: 1})


def read_upload(content: bytes, suffix: str) -> RobotTable | Mechanism:
    """Read a robot from the content of an uploaded file.

    The file is stored under a fixed name in its own temporary folder, without other files.

    Args:
        content: content of the file.
        suffix: suffix of the file name, such as ".par", which selects the reader.

    Raises:
        DescriptionError: the file is too large, of another type, or malformed.
    """
    kind = suffix.lower()
    if kind not in READERS:
        raise DescriptionError(f"files {suffix!r} are not read; {did_you_mean(kind, READERS)}")
    if len(content) > LARGEST_UPLOAD:
        raise DescriptionError(
            f"the file has {len(content)} bytes; the app reads at most {LARGEST_UPLOAD}"
        )
    with tempfile.TemporaryDirectory(prefix="mbs-upload-") as folder:
        path = Path(folder) / f"robot{kind}"
        path.write_bytes(content)
        try:
            if kind == ".xml":
                close_mjcf(path)
            return READERS[kind](path)
        except DescriptionError as error:
            raise DescriptionError(str(error).replace(f"{folder}/", "")) from None


def table_of(mechanism: Mechanism) -> RobotTable:
    """Return the table of frames from which a mechanism was made.

    Args:
        mechanism: mechanism before its assembly.

    Raises:
        DescriptionError: the mechanism was made in another way; the message names the part that a
            table cannot express.
    """
    _require_plain(mechanism)
    table = _table(mechanism)
    again = to_mechanism(table)
    for name in ("components", "connections", "cuts", "values", "guess"):
        if getattr(again, name) != getattr(mechanism, name):
            raise DescriptionError(
                f"{mechanism.name}: its {name} are not those of a table of frames"
            )
    return table


def _require_plain(mechanism: Mechanism) -> None:
    """Raise a DescriptionError if a mechanism has a component or frame that no table expresses."""
    for component in mechanism.components.values():
        if component is mechanism.world or isinstance(component, KhalilBody):
            continue
        if not isinstance(component, Joint):
            raise DescriptionError(
                f"{mechanism.name}: a table of frames cannot say {type(component).__name__}"
                f" {component.name!r}"
            )
        if type(component) not in _SIGMA and component.name not in mechanism.cuts:
            raise DescriptionError(
                f"{mechanism.name}: a table of frames has no {type(component).__name__.lower()}"
                f" joint {component.name!r} in its tree"
            )
    if mechanism.frames:
        raise DescriptionError(
            f"{mechanism.name}: a table of frames cannot say the named frame"
            f" {next(iter(mechanism.frames))!r}"
        )
    if not mechanism.keep_order:
        raise DescriptionError(f"{mechanism.name}: it was composed of components, not of frames")


def _table(mechanism: Mechanism) -> RobotTable:
    """Return the table of frames of a mechanism.

    Rows are in the order of the bodies; cut joints are last.
    """
    bodies = [body for body in mechanism.bodies() if isinstance(body, KhalilBody)]
    numbers = {mechanism.world.name: 0, **{body.name: j for j, body in enumerate(bodies, 1)}}
    placed: dict[str, tuple[Point, Joint | None]] = {}
    cuts: dict[str, list[Point]] = {name: [] for name in mechanism.cuts}
    for a, b in mechanism.connections:
        _record_connection(a, b, placed, cuts)
    frames = [_frame(j, *placed[body.name], numbers) for j, body in enumerate(bodies, 1)]
    rows = [_body(j, body, placed[body.name][1]) for j, body in enumerate(bodies, 1)]
    first, B = len(frames) + 1, len(cuts)
    loops = []
    joints = {joint.name: joint for joint in mechanism.joints()}
    for k, (name, points) in enumerate(cuts.items()):
        joint, j = joints[name], first + k
        frames.append(_cut_frame(j, points[0], joint, numbers))
        drive = {key: getattr(joint, key) for key in _DRIVE}
        rows.append(InertiaRow(j, **drive))
        loops.append(CutRow((j, j + B), _cut_kind(joint)))
    frames += [
        FrameRow(numbers[points[1].owner.name], 2, **_step(points[1])) for points in cuts.values()
    ]
    known = {n: p.default for n, p in mechanism.given_values().items() if p.default is not None}
    pose = placement_pose(mechanism.mount, known) if mechanism.mount.steps else None
    return RobotTable(
        name=mechanism.name,
        frames=tuple(frames),
        bodies=tuple(rows),
        loops=tuple(loops),
        gravity=mechanism.world.gravity,
        parameters=known,
        source=mechanism.source,
        guess=mechanism.guess,
        extras={} if pose is None else {POSE: base_pose_texts(pose)},
    )


def _record_connection(
    a: Point,
    b: Point,
    placed: dict[str, tuple[Point, Joint | None]],
    cuts: dict[str, list[Point]],
) -> None:
    """Record a connection of the points a and b in `placed` or `cuts`, which are changed.

    `placed` gives for each body the point and the joint before it, `cuts` the points of each cut
    joint.
    """
    for joint, other in ((a.owner, b), (b.owner, a)):
        if isinstance(joint, Joint) and joint.name in cuts:
            cuts[joint.name].append(other)
            return
    if isinstance(b.owner, Joint):
        placed[b.owner.name] = (a, b.owner)
    elif isinstance(a.owner, Joint):
        placed[b.owner.name] = placed.pop(a.owner.name)
    else:
        placed[b.owner.name] = (a, None)


def _frame(j: int, point: Point, joint: Joint | None, numbers: Mapping[str, int]) -> FrameRow:
    """Return the row of frame j, which the joint connects to the point; fixed without a joint.

    `numbers` are the frame numbers by body name.
    """
    antecedent = numbers[point.owner.name]
    if joint is None:
        return FrameRow(antecedent, 2, **_step(point))
    return FrameRow(
        antecedent,
        _SIGMA[type(joint)],
        joint.actuated,
        **_ranges(joint),
        name="" if joint.name == f"q{j}" else joint.name,
        **_step(point),
    )


def _cut_frame(j: int, point: Point, joint: Joint, numbers: Mapping[str, int]) -> FrameRow:
    """Return the row of frame j, which moves with a cut joint at a point."""
    sigma = _SIGMA.get(type(joint), 2)
    return FrameRow(
        numbers[point.owner.name],
        sigma,
        None if sigma == 2 else joint.actuated,
        **({} if sigma == 2 else _ranges(joint)),
        name="" if joint.name == f"q{j}" else joint.name,
        **_step(point),
    )


def _body(j: int, body: RigidBody, joint: Joint | None) -> InertiaRow:
    """Return the body row of frame j with the drive of its joint."""
    assert isinstance(body, KhalilBody)
    values: dict[str, Any] = {name: getattr(body, name) for name in TEN_PARAMETERS}
    if joint is not None:
        values |= {name: getattr(joint, name) for name in _DRIVE}
    name = "" if body.name == f"link{j}" else body.name
    return InertiaRow(j, name=name, grouped=body.grouped, **values)


def _step(point: Point) -> dict[str, Any]:
    """Return the six Khalil parameters of a point.

    Raise a DescriptionError for other placements.
    """
    steps = point.placement.steps
    if len(steps) != 1 or not isinstance(steps[0], KhalilStep):
        raise DescriptionError(
            f"{point.owner.name}: a point is not placed by the parameters of a frame"
        )
    return {key: getattr(steps[0], key) for key in GEOMETRY}


def _ranges(joint: Joint) -> dict[str, Any]:
    """Return the limits of position, velocity and effort of a joint."""
    limits = joint.limits[0][1] if joint.limits else None
    return {"limits": limits, "velocity": joint.velocity, "effort": joint.effort}


def _cut_kind(joint: Joint) -> str:
    """Return the type of a cut joint; raise a DescriptionError if a table does not have it."""
    kind = type(joint).__name__.lower()
    if kind not in LOOP_JOINTS:
        raise DescriptionError(f"{joint.name}: a table of frames closes no loop with a {kind}")
    return kind


# Tables of a composed mechanism: they show the links into which it was assembled.


_DIGITS = 9


def shown_tables(system: System, tables: Tables) -> Tables:
    """Return tables with frames and inertias of the links, and the loops, for display only.

    Args:
        system: assembled mechanism.
        tables: tables with its name and the values of its symbols.
    """
    return Tables(
        geometry=tuple(_geometry(system, row) for row in system.links),
        inertia=tuple(_inertia(system, j) for j in range(len(system.links))),
        loops=tuple((loop.name, "", loop.closing) for loop in system.loops),
        general=tables.general,
        values=tables.values,
        attached=((None, False),) * len(system.links),
    )


def _geometry(system: System, row: LinkRow) -> Texts:
    """Return the cells that show the frame of a link of an assembled mechanism."""
    speeds = system.velocity_coordinates[system.tree.links[row.number - 1].v]
    places = system.coordinates[system.tree.links[row.number - 1].q]
    cells = dict.fromkeys(GEOMETRY_COLUMNS, "")
    cells |= {key: _text(getattr(row, key)) for key in GEOMETRY}
    cells |= {
        "antecedent": " + ".join((str(row.antecedent), *map(_fixed_frame, row.via))),
        "joint": row.motion,
        "actuated": "yes" if any(speed.actuated for speed in speeds) else "no",
        "name": row.name,
    }
    if len(places) == 1 and places[0].limits is not None:
        cells["limits"] = ", ".join(map(_text, places[0].limits))
    return tuple(cells[column] for column in GEOMETRY_COLUMNS)


def _fixed_frame(six: tuple[float | SX, ...]) -> str:
    """Return the text of a fixed frame before a link, with its nonzero parameters.

    `six` are its Khalil parameters.
    """
    values = (f"{k} {_text(x)}" for k, x in zip(GEOMETRY, six, strict=True) if not _is_zero(x))
    return f"fixed frame ({', '.join(values)})"


def _is_zero(value: float | SX) -> bool:
    """Whether a parameter is the number zero."""
    return not isinstance(value, SX) and value == 0


def _inertia(system: System, j: int) -> Texts:
    """Return the cells that show the inertial parameters of link j (from 0)."""
    link = system.tree.links[j]
    values = dict(zip(TEN_PARAMETERS, (link.inertia.parameters[k] for k in range(10)), strict=True))
    cells = dict.fromkeys(INERTIA_COLUMNS, "")
    cells |= {name: _number(system, value) for name, value in values.items()}
    bodies = [body.name for body in system.bodies if body.link == j + 1]
    cells["name"] = ", ".join(bodies)
    return tuple(cells[column] for column in INERTIA_COLUMNS)


def _number(system: System, value: SX) -> str:
    """Return the text of a value with default symbols, or its expression if a symbol has none."""
    at = float(Function("value", [system.p], [value])(system.p_default))
    return str(value) if at != at else _text(at)


def _text(value: float | SX) -> str:
    """Return a number with nine digits, or as a multiple of pi, and an expression as it is."""
    if isinstance(value, SX):
        return str(value)
    exact = written(float(value))
    return exact if "pi" in exact else f"{float(value):.{_DIGITS}g}"
