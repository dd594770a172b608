"""A robot as tables of texts, and their conversion to and from a table of frames."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from mbs.app.tasks.mounting import mounting_of
from mbs.components import Rotor
from mbs.components.bodies import mount_of
from mbs.components.component import Placement, in_rotated_axes
from mbs.errors import DescriptionError, ExpressionError, MbsError
from mbs.expressions import Expression, Number, Scalar, expression, parameters_of, to_float
from mbs.expressions import number as number_of
from mbs.formats import CutRow, FrameRow, RobotTable
from mbs.formats.rotations import angles_of
from mbs.formats.table import (
    BODY_SCALARS,
    GEOMETRY,
    JOINTS,
    LOOP_JOINTS,
    POSE,
    InertiaRow,
    base_placement,
    base_pose_texts,
    placement_pose,
)
from mbs.text import did_you_mean, quoted

# Columns of the tables of a robot, and readers of the texts in their cells.


LONGEST_CELL = 2000
"""Maximum number of characters in a cell."""

RANGES = ("velocity", "effort")
"""Columns of actuator ranges: lower, upper, or a single number for both directions."""

GEOMETRY_COLUMNS = (
    "antecedent",
    "joint",
    "actuated",
    *GEOMETRY,
    "limits",
    *RANGES,
    "guess",
    "name",
)
INERTIA_COLUMNS = (*BODY_SCALARS, "name")
LOOP_COLUMNS = ("frame", "other", "joint")
SYMBOL_COLUMNS = ("value",)
GENERAL_COLUMNS = ("value",)

COLUMNS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "geometry": GEOMETRY_COLUMNS,
        "inertia": INERTIA_COLUMNS,
        "loops": LOOP_COLUMNS,
        "symbols": SYMBOL_COLUMNS,
        "general": GENERAL_COLUMNS,
    }
)
"""Editable columns, by table."""

GENERAL_ROWS = ("name", "gravity x", "gravity y", "gravity z", "source", "mount")
"""Rows of the table "general". The mount is a list of steps such as x=pi; position=0,0,2.5."""
GRAVITY_ROWS, MOUNT_ROW = range(1, 4), 5
"""Row indices of gravity and of the mount in the table "general"."""

ACTUATED: Mapping[str, bool | None] = MappingProxyType({"": None, "yes": True, "no": False})
CHOICES: Mapping[tuple[str, str], tuple[str, ...]] = MappingProxyType(
    {
        ("geometry", "joint"): JOINTS,
        ("geometry", "actuated"): tuple(ACTUATED),
        ("loops", "joint"): LOOP_JOINTS,
    }
)
"""Permitted words of columns that accept only certain words."""

_INTEGER = re.compile(r"\d{1,6}")
_PAIR = re.compile(r"\s*\[?([^,;]*)[,;]([^,;]*?)\]?\s*")
_TURNS = tuple((n, d) for d in (1, 2, 3, 4, 6) for n in range(-2 * d, 2 * d + 1) if n)


class Cell(NamedTuple):
    """Position of a cell.

    Attributes:
        sheet: table: "geometry", "inertia", "loops", "symbols" or "general".
        row: 0-based row index; in "geometry" and "inertia" it is the row of frame row + 1.
        column: name in `COLUMNS[sheet]`.
    """

    sheet: str
    row: int
    column: str


class CellProblem(NamedTuple):
    """Error message of a cell.

    Attributes:
        sheet: table, as in `Cell`; "" if the error is that of the robot as a whole.
        row: row index, from 0.
        column: column; "" for the whole row.
        sentence: error message.
    """

    sheet: str
    row: int
    column: str
    sentence: str


def written(value: Scalar) -> str:
    """Return the text of a number or expression, with multiples of pi by name.

    Args:
        value: number or expression.
    """
    known = expression(value)
    if not isinstance(known, Number):
        return str(known)
    return _PI.get(known.value) or str(known)


def _turns() -> dict[float, str]:
    """Return the names of simple multiples of pi, such as "-pi/2", by value."""
    names: dict[float, str] = {}
    for n, d in _TURNS:
        text = ("-" if n < 0 else "") + ("" if abs(n) == 1 else f"{abs(n)}*") + "pi"
        text += "" if d == 1 else f"/{d}"
        value = expression(text)
        assert isinstance(value, Number)
        names.setdefault(value.value, text)
    return names


_PI = _turns()


def scalar(text: str, where: str) -> Scalar:
    """Return the expression in a cell; zero if the cell is empty.

    Args:
        text: text of the cell.
        where: description of the cell, for error messages.

    Raises:
        DescriptionError: the text is not in the grammar, or too long.
    """
    return expression(text, where) if _short(text, where) else 0.0


def number(text: str, where: str) -> float:
    """Return the numeric value of a cell without symbols; zero if the cell is empty.

    Args:
        text: text of the cell.
        where: description of the cell, for error messages.

    Raises:
        DescriptionError: the text contains symbols or is invalid.
    """
    return number_of(scalar(text, where), where)


def integer(text: str, where: str) -> int:
    """Return the frame number in a cell.

    Args:
        text: text of the cell.
        where: description of the cell, for error messages.

    Raises:
        DescriptionError: the text is not a frame number.
    """
    if not _INTEGER.fullmatch(text.strip()):
        raise DescriptionError(f"{where}: {quoted(text)} is not the number of a frame; write one")
    return int(text)


def pair(text: str, where: str) -> tuple[float, float] | None:
    """Return the limits (lower, upper) in a cell; None if the cell is empty.

    Args:
        text: text of the cell.
        where: description of the cell, for error messages.

    Raises:
        DescriptionError: the text is not two numbers.
    """
    if not text.strip():
        return None
    parts = _PAIR.fullmatch(text) if len(text) <= LONGEST_CELL else None
    if parts is None or not (parts[1].strip() and parts[2].strip()):
        raise DescriptionError(
            f"{where}: {quoted(text)} is not lower, upper; write two numbers, such as -pi, pi"
        )
    return number(parts[1], where), number(parts[2], where)


def span(text: str, where: str) -> tuple[float, float] | float | None:
    """Return the range in a cell: (lower, upper), or a single number for both directions.

    None if the cell is empty.

    Args:
        text: text of the cell.
        where: description of the cell, for error messages.

    Raises:
        DescriptionError: the text is neither of these.
    """
    plain = text.strip().strip("[]")
    return number(plain, where) if plain and _PAIR.fullmatch(plain) is None else pair(text, where)


def written_span(value: tuple[float, float] | float | None) -> str:
    """Return the text of limits or of a range; empty for None.

    Args:
        value: (lower, upper), a single number for both directions, or None.
    """
    if value is None:
        return ""
    if isinstance(value, (int, float)):
        return written(value)
    low, high = value
    return f"{written(low)}, {written(high)}"


def word(text: str, where: str, known: Sequence[str]) -> str:
    """Return the word in a cell, without blanks around it.

    Args:
        text: text of the cell.
        where: description of the cell, for error messages.
        known: allowed words.

    Raises:
        DescriptionError: the word is not allowed.
    """
    if text.strip() not in known:
        words = [one for one in known if one]
        raise DescriptionError(f"{where} {quoted(text)} is unknown; {did_you_mean(text, words)}")
    return text.strip()


def reader_of(sheet: str, row: int, column: str) -> Callable[[str, str], Any]:
    """Return the reader of a cell: a callable (text, description of the cell) -> value.

    The callable raises a DescriptionError if the text is invalid.

    Args:
        sheet: table, as in `Cell`.
        row: row index, from 0.
        column: name of the column.
    """
    if (sheet, column) in CHOICES:
        return lambda text, where: word(text, where, CHOICES[sheet, column])
    if column in ("antecedent", "frame", "other"):
        return integer
    if column == "limits":
        return pair
    if column in RANGES:
        return span
    if column == "guess" or sheet == "symbols":
        return lambda text, where: number(text, where) if text.strip() else None
    if sheet == "general" and row == MOUNT_ROW:
        return mount
    if column == "name" or (sheet == "general" and GENERAL_ROWS[row] in ("name", "source")):
        return _short
    return scalar


def mount(text: str, where: str) -> dict[str, Any]:
    """Return the mount in a cell, in the form of `mbs.load`; empty if the cell is empty.

    Args:
        text: steps separated by semicolons, such as "x=pi; position=0,0,2.5".
        where: description of the cell, for error messages.

    Raises:
        DescriptionError: the text is not a mount.
    """
    steps = [step for step in _short(text, where).split(";") if step.strip()]
    found: dict[str, Any] = mounting_of(mount=steps).get("mount", {})
    if found:
        mount_of(found, where)
    return found


def _short(text: str, where: str) -> str:
    """Return a text without blanks around it; raise a DescriptionError if it is too long."""
    if len(text) > LONGEST_CELL:
        raise DescriptionError(
            f"{where}: the text has {len(text)} characters; write at most {LONGEST_CELL}"
        )
    return text.strip()


def place_of(sheet: str, row: int, column: str) -> str:
    """Return the description of a cell for error messages, such as "frame 3, alpha".

    Args:
        sheet: table, as in `Cell`.
        row: row index, from 0.
        column: name of the column.
    """
    if sheet == "general":
        return GENERAL_ROWS[row]
    if sheet == "symbols":
        return f"symbol {row + 1}"
    kind = {"geometry": "frame", "inertia": "body", "loops": "loop"}[sheet]
    return f"{kind} {row + 1}, {column}"


Texts = tuple[str, ...]
Named = tuple[tuple[str, str], ...]

_NO_BODY = (*(written(getattr(InertiaRow(1), name)) for name in BODY_SCALARS), "")
"""Cells of a frame without a body."""


@dataclass(frozen=True, slots=True)
class Tables:
    """Cells of a robot, as the user typed them.

    Attributes:
        geometry: a row for each frame, in the order of `GEOMETRY_COLUMNS`.
        inertia: a row for each frame, in the order of `INERTIA_COLUMNS`.
        loops: a row for each loop, in the order of `LOOP_COLUMNS`.
        general: name, gravity, source and mount, in the order of `GENERAL_ROWS`.
        values: values of symbols, by name, including symbols that no cell uses.
        attached: for each frame a rotor, and whether its inertia is that of several bodies.
        guess: further initial positions for closing loops, by names of coordinates.
        extras: data of a file beyond the mechanism.
    """

    geometry: tuple[Texts, ...]
    inertia: tuple[Texts, ...]
    loops: tuple[Texts, ...] = ()
    general: Texts = ("robot", "0", "0", "-9.81", "", "")
    values: Named = ()
    attached: tuple[tuple[Rotor | None, bool], ...] = ()
    guess: tuple[tuple[str, float], ...] = ()
    extras: tuple[tuple[str, Texts], ...] = field(default=())

    @property
    def symbols(self) -> Texts:
        """Names of the symbols in readable cells, in the order of their first use."""
        return tuple(
            dict.fromkeys(p.name for value in self._scalars() for p in parameters_of(value))
        )

    def rows(self, sheet: str) -> tuple[Texts, ...]:
        """Return the rows of a table as texts, each in the order of `COLUMNS[sheet]`.

        Args:
            sheet: table, as in `Cell`.
        """
        if sheet == "symbols":
            known = dict(self.values)
            return tuple((known.get(name, ""),) for name in self.symbols)
        if sheet == "general":
            return tuple((text,) for text in self.general)
        answer: tuple[Texts, ...] = getattr(self, sheet)
        return answer

    def text(self, cell: Cell) -> str:
        """Return the text of a cell.

        Args:
            cell: position of the cell.
        """
        return self.rows(cell.sheet)[cell.row][COLUMNS[cell.sheet].index(cell.column)]

    def changed(self, cell: Cell, text: str) -> Tables:
        """Return the tables with another text in a cell.

        Args:
            cell: position of an existing cell.
            text: new text.
        """
        if cell.sheet == "symbols":
            values = {**dict(self.values), self.symbols[cell.row]: text}
            return replace(self, values=tuple(values.items()))
        if cell.sheet == "general":
            return replace(self, general=_put(self.general, cell.row, text))
        rows = getattr(self, cell.sheet)
        row = _put(rows[cell.row], COLUMNS[cell.sheet].index(cell.column), text)
        changes: dict[str, Any] = {cell.sheet: _put(rows, cell.row, row)}
        return replace(self, **changes)

    def cells(self) -> Iterator[tuple[Cell, str]]:
        """Yield every cell and its text."""
        for sheet, columns in COLUMNS.items():
            for k, row in enumerate(self.rows(sheet)):
                for column, text in zip(columns, row, strict=True):
                    yield Cell(sheet, k, column), text

    def joint_name(self, row: int) -> str:
        """Return the name of the joint in a row: as typed, else q<j>.

        Args:
            row: row index of the frame (its number j minus one).
        """
        return self.geometry[row][-1].strip() or f"q{row + 1}"

    def body_name(self, row: int) -> str:
        """Return the name of the body in a row: as typed, else link<j>.

        Args:
            row: row index of the frame (its number j minus one).
        """
        return self.inertia[row][-1].strip() or f"link{row + 1}"

    def _scalars(self) -> Iterator[Expression]:
        """Yield the expressions in all cells; zero for cells that cannot be read."""
        for row in self.geometry:
            yield from map(_expression, row[3:9])
        for row in self.inertia:
            yield from map(_expression, row[: len(BODY_SCALARS)])
        for rotor, _ in self.attached:
            yield from () if rotor is None else map(expression, (rotor.inertia, rotor.ratio))
        yield from map(_expression, self.general[1:4])
        yield from self.mount().expressions()

    def mount(self) -> Placement:
        """Return the pose of the base in the world.

        The identity if its cell is empty or invalid.
        """
        try:
            given = mount(self.general[MOUNT_ROW], "mount")
        except MbsError:
            return Placement()
        return Placement(mount_of(given, "mount")[0] if given else ())


def _mounted_cells(table: RobotTable) -> tuple[Texts, tuple[tuple[str, Texts], ...]]:
    """Return the cells of gravity, source and mount, and the extra data without the mount.

    Gravity of a table is in the axes of the base, gravity in the cells in the axes of the world.
    """
    placement, notes = base_placement(table.extras)
    pose = placement_pose(placement, {})
    kept = tuple((k, v) for k, v in table.extras.items() if notes or k != POSE)
    if pose is None or not placement.steps:
        return (*map(written, table.gravity), table.source, ""), tuple(table.extras.items())
    roll, pitch, yaw = angles_of(pose[:3, :3])
    turns = [(a, v) for a, v in zip("zyx", (yaw, pitch, roll), strict=True) if v]
    back: Any = [(axis, -value) for axis, value in reversed(turns)]
    gravity = table.gravity
    if turns:
        gravity = in_rotated_axes(tuple(map(expression, gravity)), back, "mount")
    size = max([abs(g) for g in map(to_float, gravity) if g is not None], default=0.0)
    texts = [
        # rounding error of the rotation, about 1e-16 of the acceleration
        "0" if (g := to_float(value)) is not None and abs(g) < 1e-15 * size else written(value)
        for value in gravity
    ]
    steps = [f"{axis}={written(value)}" for axis, value in turns]
    if np.any(pose[:3, 3]):
        steps.append(f"position={','.join(written(float(x)) for x in pose[:3, 3])}")
    return (*texts, table.source, "; ".join(steps)), kept


def tables_of(table: RobotTable) -> Tables:
    """Return the cells of a table of frames.

    Args:
        table: table of frames.
    """
    general, extras = _mounted_cells(table)
    bodies = {body.frame: body for body in table.bodies}
    count = len(table.frames)
    rows = [bodies.get(j, InertiaRow(j)) for j in range(1, count + 1)]
    names = [table.joint_name(j) for j in range(1, count + 1)]
    return Tables(
        geometry=tuple(
            _geometry(row, table.guess.get(name))
            for row, name in zip(table.frames, names, strict=True)
        ),
        inertia=tuple((*(written(getattr(b, s)) for s in BODY_SCALARS), b.name) for b in rows),
        loops=tuple((str(loop.cut[0]), str(loop.cut[1]), loop.joint) for loop in table.loops),
        general=(table.name, *general),
        values=tuple((name, written(value)) for name, value in table.parameters.items()),
        attached=tuple((b.rotor, b.grouped) for b in rows),
        guess=tuple((name, value) for name, value in table.guess.items() if name not in names),
        extras=extras,
    )


def robot_table(tables: Tables) -> RobotTable:
    """Return the table of frames that the cells describe.

    Args:
        tables: cells of a robot.

    Raises:
        DescriptionError: a cell cannot be read, or rows contradict each other.
    """
    read = {c: reader_of(*c)(text, place_of(*c)) for c, text in tables.cells()}
    frames, bodies, guess = [], [], dict(tables.guess)
    for k in range(len(tables.geometry)):
        g = {column: read[Cell("geometry", k, column)] for column in GEOMETRY_COLUMNS}
        position = g.pop("guess")
        if position is not None:
            guess[tables.joint_name(k)] = position
        frames.append(_frame(g))
        if _has_body_data(tables, k):
            body = {column: read[Cell("inertia", k, column)] for column in INERTIA_COLUMNS}
            rotor, grouped = tables.attached[k]
            bodies.append(InertiaRow(k + 1, rotor=rotor, grouped=grouped, **body))
    symbols = zip(tables.symbols, range(len(tables.symbols)), strict=True)
    values = {name: read[Cell("symbols", k, "value")] for name, k in symbols}
    general = [read[Cell("general", k, "value")] for k in range(len(GENERAL_ROWS))]
    extras = dict(tables.extras)
    known = {name: value for name, value in values.items() if value is not None}
    pose = placement_pose(tables.mount(), known)
    if tables.mount().steps and pose is not None:
        extras[POSE] = base_pose_texts(pose)
    table = RobotTable(
        name=general[0],
        frames=tuple(frames),
        bodies=tuple(bodies),
        loops=tuple(_loop(tables, read, k) for k in range(len(tables.loops))),
        gravity=_rotated(general[1:4], general[5]),
        source=general[4],
        guess=guess,
        extras=extras,
    )
    # symbols that only the position of the mount contains are in no row of the table
    return replace(table, parameters={k: v for k, v in known.items() if k in table.symbols})


def _rotated(gravity: Sequence[Scalar], mounted: Mapping[str, Any]) -> tuple[Scalar, ...]:
    """Return gravity expressed in the axes of the mounted base.

    `gravity` is in the axes of the world, `mounted` the mount in the form of `mbs.load`.
    """
    rotation = mounted.get("rotation")
    vector = tuple(map(expression, gravity))
    return vector if rotation is None else in_rotated_axes(vector, rotation, "mount")


def _frame(values: dict[str, Any]) -> FrameRow:
    """Return a frame row from the values of its cells, by column."""
    sigma = JOINTS.index(values.pop("joint"))
    return FrameRow(sigma=sigma, actuated=ACTUATED[values.pop("actuated")], **values)


def _has_body_data(tables: Tables, k: int) -> bool:
    """Whether the body row of frame k + 1 differs from that of a frame without a body."""
    texts = zip(tables.inertia[k], _NO_BODY, strict=True)
    given = any(text.strip() not in ("", usual) for text, usual in texts)
    return given or tables.attached[k] != (None, False)


def _loop(tables: Tables, read: Mapping[Cell, Any], k: int) -> CutRow:
    """Return the cut of loop k (from 0) from the values of the cells."""
    moving, fixed, joint = (read[Cell("loops", k, column)] for column in LOOP_COLUMNS)
    return CutRow((moving, fixed), joint)


def _geometry(row: FrameRow, guess: float | None) -> Texts:
    """Return the cells of a frame row; `guess` is its initial position for closing loops."""
    actuated = next(text for text, value in ACTUATED.items() if value is row.actuated)
    return (
        str(row.antecedent),
        JOINTS[row.sigma],
        actuated,
        *(written(getattr(row, key)) for key in GEOMETRY),
        written_span(row.limits),
        *(_motor_span(getattr(row, key)) for key in RANGES),
        "" if guess is None else written(guess),
        row.name,
    )


def _motor_span(value: tuple[float, float] | float | None) -> str:
    """Return the text of a motor range; a single number if it is equal in both directions."""
    even = isinstance(value, tuple) and value[0] == -value[1]
    return written_span(value[1] if even and isinstance(value, tuple) else value)


def _expression(text: str) -> Expression:
    """Return the expression in a cell; zero if it cannot be read."""
    try:
        return expression(text if text.strip() else 0.0)
    except (ExpressionError, RecursionError):
        return expression(0.0)


def _put(values: tuple[Any, ...], place: int, value: Any) -> tuple[Any, ...]:
    """Return the tuple `values` with another value at the index `place`."""
    return (*values[:place], value, *values[place + 1 :])


def require_cell(tables: Tables, cell: Cell) -> None:
    """Raise if a cell does not exist.

    Args:
        tables: cells of a robot.
        cell: position of the cell.

    Raises:
        DescriptionError: the table, row or column does not exist.
    """
    known = cell.sheet in COLUMNS and cell.column in COLUMNS[cell.sheet]
    if not known or not 0 <= cell.row < len(tables.rows(cell.sheet)):
        raise DescriptionError(f"there is no cell {tuple(cell)}; reload the page")
