"""The mechanism that a table of frames describes."""

from __future__ import annotations

from typing import Any

from mbs.components import (
    Cylindrical,
    Fixed,
    Joint,
    KhalilBody,
    Mechanism,
    Planar,
    Prismatic,
    Revolute,
    RigidBody,
    Spherical,
    Universal,
)
from mbs.errors import DescriptionError
from mbs.expressions import expression, to_float
from mbs.formats.files import component_name
from mbs.formats.rows import DRIVE, CutRow, FrameRow, InertiaRow
from mbs.formats.table import RobotTable, require_table
from mbs.spatial.inertia import TEN_PARAMETERS

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
    """The bodies and joints of a table, numbered as its frames are.

    Joint j is named q<j> and body j link<j>, unless the rows name them. A fixed frame is a body
    that is welded to its antecedent. The two frames of a cut become one passive joint, between
    the links that carry them, where the loop is then opened.

    Raises:
        DescriptionError: a body is impossible, two names are equal, or the base moves.
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
    rows = {row.frame: row for row in table.bodies}
    links: dict[int, RigidBody] = {0: mechanism.world}
    for j, frame in enumerate(table.frames, 1):
        if j in table.cut_frames:
            continue
        row = rows.get(j, InertiaRow(j))
        links[j] = mechanism.add(_body(j, row))
        point = links[frame.antecedent].at_khalil(**frame.geometry)
        if frame.sigma == 2:
            mechanism.connect(point, links[j])
        else:
            joint = _MOVING[frame.sigma](**_joint(table, j, row, _actuated(table, frame)))
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
    moving, fixed = (table.frames[k - 1] for k in loop.cut)
    scalars = _joint(table, loop.cut[0], row, bool(moving.actuated))
    joint = _CLOSING[loop.joint](**scalars)
    mechanism.connect(
        links[moving.antecedent].at_khalil(**moving.geometry),
        joint,
        links[fixed.antecedent].at_khalil(**fixed.geometry),
    )
    mechanism.cut(joint)


def _actuated(table: RobotTable, frame: FrameRow) -> bool | None:
    return True if frame.actuated is None and not table.loops else frame.actuated


def _joint(table: RobotTable, j: int, row: InertiaRow, actuated: bool | None) -> dict[str, Any]:
    return {
        "name": table.joint_name(j),
        "actuated": actuated,
        **{name: getattr(table.frames[j - 1], name) for name in ("limits", "velocity", "effort")},
        **{name: getattr(row, name) for name in (*DRIVE, "Fs_width", "rest", "rotor")},
    }


def _body(j: int, row: InertiaRow) -> KhalilBody:
    ten: dict[str, Any] = {name: getattr(row, name) for name in TEN_PARAMETERS}
    return KhalilBody(row.name or f"link{j}", grouped=row.grouped, **ten)


def _check_base(table: RobotTable) -> None:
    for key in _BASE_MOTION:
        if any(to_float(expression(text)) != 0 for text in table.extras.get(key, ())):
            raise DescriptionError(
                f"{table.name}: {key} is {list(table.extras[key])}, but the base of a table does"
                " not move; set it to zero and put a free joint under the robot instead"
            )
