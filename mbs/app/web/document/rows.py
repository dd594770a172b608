"""Insertion and removal of rows in the tables of a robot, with frame numbers updated."""

from __future__ import annotations

from dataclasses import replace

from mbs.app.web.document.tables import GEOMETRY_COLUMNS, RANGES, Tables, Texts
from mbs.errors import DescriptionError
from mbs.formats.table import BODY_SCALARS, InertiaRow

_LAST = 200
"""Maximum number of frames in a table."""

_NEW_FRAME = dict.fromkeys(GEOMETRY_COLUMNS, "0") | {
    "joint": "revolute",
    "actuated": "",
    **dict.fromkeys(("limits", *RANGES, "guess", "name"), ""),
}


def with_frame(tables: Tables) -> Tables:
    """Return the tables with an additional frame, placed on the last frame that no loop is cut at.

    Args:
        tables: cells of a robot.

    Raises:
        DescriptionError: the table is full.
    """
    count = len(tables.geometry)
    if count >= _LAST:
        raise DescriptionError(f"the table has {count} frames; the app takes no more")
    cut = {text.strip() for row in tables.loops for text in row[:2]}
    free = [str(j) for j in range(1, count + 1) if str(j) not in cut]
    row = {**_NEW_FRAME, "antecedent": free[-1] if free else "0"}
    usual = InertiaRow(count + 1)
    body = (*(f"{getattr(usual, name):g}" for name in BODY_SCALARS), "")
    return replace(
        tables,
        geometry=(*tables.geometry, tuple(row[column] for column in GEOMETRY_COLUMNS)),
        inertia=(*tables.inertia, body),
        attached=(*tables.attached, (None, False)),
    )


def without_frame(tables: Tables, row: int) -> Tables:
    """Return the tables without a frame; frames that were placed on it move to its antecedent.

    Args:
        tables: cells of a robot.
        row: row index of the frame (its number minus one).

    Raises:
        DescriptionError: the frame does not exist, or it is the only frame.
    """
    _require_row(tables.geometry, row, "frame")
    if len(tables.geometry) < 2:
        raise DescriptionError("a robot has at least one frame; change this one instead")
    gone, below = str(row + 1), tables.geometry[row][0].strip()
    if not below.isdecimal() or int(below) > row:
        below = "0"

    def renumbered(text: str) -> str:
        number = below if text.strip() == gone else text.strip()
        return str(int(number) - 1) if number.isdecimal() and int(number) > row + 1 else number

    return replace(
        tables,
        geometry=tuple((renumbered(r[0]), *r[1:]) for r in _without(tables.geometry, row)),
        inertia=_without(tables.inertia, row),
        attached=tables.attached[:row] + tables.attached[row + 1 :],
        loops=tuple(
            (renumbered(a), renumbered(b), joint)
            for a, b, joint in tables.loops
            if gone not in (a.strip(), b.strip())
        ),
    )


def with_loop(tables: Tables) -> Tables:
    """Return the tables with an additional loop, cut at the last two frames.

    Args:
        tables: cells of a robot.
    """
    count = len(tables.geometry)
    return replace(tables, loops=(*tables.loops, (str(max(count - 1, 1)), str(count), "revolute")))


def without_loop(tables: Tables, row: int) -> Tables:
    """Return the tables without a loop; its frames remain.

    Args:
        tables: cells of a robot.
        row: row index of the loop, from 0.

    Raises:
        DescriptionError: the loop does not exist.
    """
    _require_row(tables.loops, row, "loop")
    return replace(tables, loops=_without(tables.loops, row))


def _require_row(rows: tuple[Texts, ...], row: int, what: str) -> None:
    """Raise a DescriptionError if there is no row with this index; `what` names the kind of row."""
    if not 0 <= row < len(rows):
        raise DescriptionError(f"there is no {what} {row + 1} to remove; reload the page")


def _without(rows: tuple[Texts, ...], row: int) -> tuple[Texts, ...]:
    """Return the rows without the row of this index."""
    return rows[:row] + rows[row + 1 :]


def blank() -> Tables:
    """Return the tables of a robot with a single revolute joint."""
    empty = Tables((), (), general=("robot", "0", "0", "-9.81", "", ""))
    return with_frame(empty)
