"""Export of mechanisms as SYMORO robot files (.par)."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import casadi
from casadi import DM, SX, Function

from mbs.assembly import System
from mbs.assembly.khalil_frames import Cut
from mbs.assembly.tree import Link
from mbs.components.joints import Motion
from mbs.errors import ModelError
from mbs.export.robot_files import base_pose, mount_left_out, shapes_left_out, system_of
from mbs.files import path_of
from mbs.formats import CutRow, FrameRow, InertiaRow, RobotTable, write_par
from mbs.formats.base_pose import POSE, base_pose_texts
from mbs.formats.table import BODY_SCALARS, GEOMETRY
from mbs.mechanism import Mechanism
from mbs.operations.graph import graph_of
from mbs.spatial import Khalil, Pose, align_z, frames_to
from mbs.spatial.inertia import TEN_PARAMETERS

Text = Callable[[SX], str]
"""Function that writes a scalar expression in the grammar of the file."""

_SIGMA = {Motion.REVOLUTE: 0, Motion.PRISMATIC: 1}
_OF_THE_JOINT = [name for name in BODY_SCALARS if name not in TEN_PARAMETERS]
"""Joint quantities of a body row, such as Fv. They have the same names as attributes of a link."""


def par(system: System | Mechanism, path: str | os.PathLike[str]) -> None:
    """Write a mechanism as a robot file of SYMORO.

    Link j of the system becomes frame j of the file, with joint variable q<j>. Fixed frames on the
    path to a link come before it and increase its index. Bodies that are fixed to each other are
    one link. Symbols are kept; their values are in comments that `mbs.load` reads. Names of joints
    and bodies, and limits, are not in the file. A mount becomes the vector Z, with symbols at their
    default values.

    Args:
        system: mechanism with revolute and prismatic motions, also of the cut joints. A Mechanism
            is assembled first.
        path: path of the .par file.

    Raises:
        ModelError: system has another type, or the format does not support a motion or coupling.
        DescriptionError: a symbol has the name of a joint variable of the format.
        ExportError: the file cannot be written.
    """
    system = system_of(system)
    note = " ".join(filter(None, (shapes_left_out(system), mount_left_out(system))))
    write_par(robot_table(system), path_of(path), note=note)


def robot_table(system: System, file: str = ".par") -> RobotTable:
    """Return the table of frames of a system: link j is frame j with joint variable q<j>.

    Fixed frames on the path to a link come before it and increase its index. Cut joints are last.

    Args:
        system: mechanism as for `par`.
        file: file extension, for error messages.

    Raises:
        ModelError: the format does not support a motion, coupling or force element.
    """
    _check(system, file)
    text = _text_of(system)
    size = max(map(_length, _shifts(system)), default=0.0) or 1.0
    frames: list[FrameRow] = []
    number = {-1: 0}  # link index to frame index in the file; the base is frame 0
    for j, link in enumerate(system.tree.links):
        before = number[link.antecedent]
        for frame in link.via:
            frames.append(FrameRow(before, 2, None, **_geometry(frame, text)))
            before = len(frames)
        motor = system.speeds[j].actuated
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
        CutRow((first + k, first + count + k), _kind(cut)) for k, cut in enumerate(system.cuts)
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
    """Yield the origins [m] of links and cut joints in the frames of their antecedents."""
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


def _check(system: System, file: str) -> None:
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
    return dict(zip(GEOMETRY, map(text, placement.parameters), strict=True))


def _kind(cut: Cut) -> str:
    return cut.edge.joint.freedoms[0].motion.value


def _body(j: int, link: Link, text: Text) -> InertiaRow:
    ten = link.inertia.parameters
    values: dict[str, Any] = {name: text(ten[k]) for k, name in enumerate(TEN_PARAMETERS)}
    values |= {name: text(getattr(link, name)) for name in _OF_THE_JOINT}
    row = InertiaRow(j, grouped=True, **values)
    return replace(row, grouped=False) if row.is_body else row


def _text_of(system: System) -> Text:
    names = [parameter.name for parameter in system.parameters]

    def text(value: SX) -> str:
        if value.is_constant():
            return repr(float(value))
        from mbs.export.languages.one_line import one_line  # with sympy, which is slow to load

        return one_line(graph_of(Function("value", [system.p], [value])), names)

    return text
