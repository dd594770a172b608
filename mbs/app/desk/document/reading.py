"""The table of frames of a mechanism that was made from one, and uploaded files."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

from mbs.app.desk.document.mjcf import close_mjcf
from mbs.components import (
    Joint,
    KhalilBody,
    Mechanism,
    Point,
    Prismatic,
    Revolute,
    RigidBody,
)
from mbs.components.placement import KhalilStep
from mbs.errors import DescriptionError
from mbs.formats import (
    CutRow,
    FrameRow,
    InertiaRow,
    RobotTable,
    read_mjcf,
    read_par,
    read_toml,
    read_urdf,
    to_mechanism,
)
from mbs.formats.rows import DRIVE, GEOMETRY, LOOP_JOINTS
from mbs.messages import did_you_mean
from mbs.spatial.inertia import TEN_PARAMETERS

LARGEST_UPLOAD = 5_000_000
"""Bytes that an uploaded file may have."""

READERS: Mapping[str, Callable[[Path], RobotTable | Mechanism]] = MappingProxyType(
    {".toml": read_toml, ".par": read_par, ".urdf": read_urdf, ".xml": read_mjcf}
)
"""Suffixes of files that are read."""

_DRIVE = (*DRIVE, "Fs_width", "rest", "rotor")
_SIGMA: Mapping[type[Joint], int] = MappingProxyType({Revolute: 0, Prismatic: 1})


def read_upload(content: bytes, suffix: str) -> RobotTable | Mechanism:
    """What a file says that somebody sent.

    It is read under a name of our own in a folder of its own, where no other file is.

    Args:
        content: of the file.
        suffix: the end of its name, such as ".par", which chooses the reader.

    Raises:
        DescriptionError: the file is too large, of another kind, or malformed.
    """
    kind = suffix.lower()
    if kind not in READERS:
        raise DescriptionError(f"files {suffix!r} are not read; {did_you_mean(kind, READERS)}")
    if len(content) > LARGEST_UPLOAD:
        raise DescriptionError(
            f"the file has {len(content)} bytes; the desk reads at most {LARGEST_UPLOAD}"
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
    """The table of frames that a mechanism was made from.

    Raises:
        DescriptionError: it was made otherwise; the sentence names what no table can say.
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
    """The rows in the order of the bodies, the frames of cut joints last."""
    bodies = [body for body in mechanism.bodies() if isinstance(body, KhalilBody)]
    numbers = {mechanism.world.name: 0, **{body.name: j for j, body in enumerate(bodies, 1)}}
    placed: dict[str, tuple[Point, Joint | None]] = {}
    cuts: dict[str, list[Point]] = {name: [] for name in mechanism.cuts}
    for a, b in mechanism.connections:
        _sort(a, b, placed, cuts)
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
    return RobotTable(
        name=mechanism.name,
        frames=tuple(frames),
        bodies=tuple(rows),
        loops=tuple(loops),
        gravity=mechanism.world.gravity,
        parameters={
            name: value.default
            for name, value in mechanism.values.items()
            if value.default is not None
        },
        source=mechanism.source,
        guess=mechanism.guess,
    )


def _sort(
    a: Point,
    b: Point,
    placed: dict[str, tuple[Point, Joint | None]],
    cuts: dict[str, list[Point]],
) -> None:
    """Put one weld to what it belongs to: a body, a joint before a body, or a cut joint."""
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
    assert isinstance(body, KhalilBody)
    values: dict[str, Any] = {name: getattr(body, name) for name in TEN_PARAMETERS}
    if joint is not None:
        values |= {name: getattr(joint, name) for name in _DRIVE}
    name = "" if body.name == f"link{j}" else body.name
    return InertiaRow(j, name=name, grouped=body.grouped, **values)


def _step(point: Point) -> dict[str, Any]:
    steps = point.placement.steps
    if len(steps) != 1 or not isinstance(steps[0], KhalilStep):
        raise DescriptionError(
            f"{point.owner.name}: a point is not placed by the parameters of a frame"
        )
    return {key: getattr(steps[0], key) for key in GEOMETRY}


def _ranges(joint: Joint) -> dict[str, Any]:
    limits = joint.limits[0][1] if joint.limits else None
    return {"limits": limits, "velocity": joint.velocity, "effort": joint.effort}


def _cut_kind(joint: Joint) -> str:
    kind = type(joint).__name__.lower()
    if kind not in LOOP_JOINTS:
        raise DescriptionError(f"{joint.name}: a table of frames closes no loop with a {kind}")
    return kind
