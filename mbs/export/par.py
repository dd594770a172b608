"""Robot files of SYMORO (.par) from mechanisms that were composed, or read from other formats."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from casadi import SX, Function

from mbs.assembly import System
from mbs.assembly.khalil_frames import Cut
from mbs.assembly.tree import Link
from mbs.components import Mechanism
from mbs.components.motion import Motion
from mbs.errors import ModelError
from mbs.files import path_of
from mbs.formats import CutRow, FrameRow, InertiaRow, RobotTable, write_par
from mbs.formats.rows import BODY_SCALARS, GEOMETRY
from mbs.messages import quoted
from mbs.operations.graph import graph_of
from mbs.spatial import Khalil, Pose, align_z
from mbs.spatial.inertia import TEN_PARAMETERS

Text = Callable[[SX], str]
"""What writes a scalar of numbers and symbols in the grammar of expressions."""

_SIGMA = {Motion.REVOLUTE: 0, Motion.PRISMATIC: 1}
_OF_THE_JOINT = [name for name in BODY_SCALARS if name not in TEN_PARAMETERS]
"""What acts on the joint of a body row, such as Fv; links call it the same."""


def par(system: System | Mechanism, path: str | os.PathLike[str]) -> None:
    """Write a mechanism as a robot file of SYMORO.

    Link j of the system is frame j of the file, its joint variable q<j>; bodies that are welded
    together are one link. Symbols stay symbols, and their values are in comments that
    `mbs.load` reads. Names of joints and bodies and limits are lost.

    Args:
        system: of revolute and prismatic motions; cut joints are one of the two. A Mechanism is
            assembled first.
        path: of the .par file.

    Raises:
        ModelError: it is neither, or it has a motion or a coupling that the format cannot say.
        DescriptionError: a symbol is named like a joint variable of the format.
        ExportError: the file cannot be written.
    """
    if isinstance(system, Mechanism):
        system = system.assemble()
    if not isinstance(system, System):
        raise ModelError(
            f"{quoted(system)} is a {type(system).__name__}; give a System or a Mechanism"
        )
    write_par(robot_table(system), path_of(path))


def robot_table(system: System, file: str = ".par") -> RobotTable:
    """The table of frames of a system; link j is frame j, its joint q<j>.

    Args:
        system: as for `par`.
        file: ending of the file that it is for, in messages.

    Raises:
        ModelError: it has a motion or a coupling that a table cannot say.
    """
    _check(system, file)
    text = _text_of(system)
    links, cuts = system.tree.links, system.cuts
    frames = [_frame(system, j, text) for j in range(len(links))]
    moving = [_cut_frame(cut, cut.link_a, cut.pose_a, text) for cut in cuts]
    fixed = [_cut_frame(cut, cut.link_b, cut.pose_b, text, sigma=2) for cut in cuts]
    first = len(links) + 1
    loops = [CutRow((first + k, first + len(cuts) + k), _kind(cut)) for k, cut in enumerate(cuts)]
    names = [f"q{j}" for j in range(1, len(links) + 1)]
    posture = dict(zip(names, system.posture, strict=True)) if cuts else {}
    table = RobotTable(
        name=system.name,
        frames=(*frames, *moving, *fixed),
        bodies=tuple(_body(j, link, text) for j, link in enumerate(links, 1)),
        loops=tuple(loops),
        gravity=tuple(text(system.tree.gravity[k]) for k in range(3)),
        source=system.source,
        guess={name: value for name, value in posture.items() if value},
    )
    # symbols may have cancelled, such as a length along the axis of the last link
    defaults = {p.name: p.default for p in system.parameters if p.name in table.symbols}
    values = {name: value for name, value in defaults.items() if value is not None}
    return replace(table, parameters=values)


def _check(system: System, file: str) -> None:
    if system.forces:
        raise ModelError(
            f"{system.name}: force element {system.forces[0].element.name!r} cannot be said in a"
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


def _frame(system: System, j: int, text: Text) -> FrameRow:
    link = system.tree.links[j]
    return FrameRow(
        link.antecedent + 1,
        _SIGMA[link.motion],
        system.speeds[j].actuated,
        **_geometry(link.placement, text),
    )


def _cut_frame(cut: Cut, link: int, pose: Pose, text: Text, sigma: int | None = None) -> FrameRow:
    freedom = cut.edge.joint.freedoms[0]
    along = pose @ Pose.turned(align_z(np.array(freedom.axis)))
    placement = _geometry(Khalil.of_pose(along), text)
    kind = _SIGMA[freedom.motion] if sigma is None else sigma
    return FrameRow(link + 1, kind, None if kind == 2 else False, **placement)


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
