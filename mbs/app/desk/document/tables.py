"""A robot as tables of texts, and the table of frames that they say."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from mbs.app.desk.document.cells import (
    ACTUATED,
    COLUMNS,
    GENERAL_ROWS,
    GEOMETRY_COLUMNS,
    INERTIA_COLUMNS,
    LOOP_COLUMNS,
    RANGES,
    Cell,
    place_of,
    reader_of,
    written,
    written_span,
)
from mbs.components import Rotor
from mbs.errors import DescriptionError, ExpressionError
from mbs.expressions import Expression, expression, parameters_of
from mbs.formats import CutRow, FrameRow, InertiaRow, RobotTable
from mbs.formats.rows import BODY_SCALARS, GEOMETRY, JOINTS

Texts = tuple[str, ...]
Named = tuple[tuple[str, str], ...]

_NO_BODY = (*(written(getattr(InertiaRow(1), name)) for name in BODY_SCALARS), "")
"""The cells of a frame without a body."""


@dataclass(frozen=True, slots=True)
class Tables:
    """The cells of a robot, as they were typed.

    Attributes:
        geometry: a row for each frame, in the order of `GEOMETRY_COLUMNS`.
        inertia: a row for each frame, in the order of `INERTIA_COLUMNS`.
        loops: a row for each loop, in the order of `LOOP_COLUMNS`.
        general: name, gravity and source, in the order of `GENERAL_ROWS`.
        values: of symbols, by name; those of symbols that no cell uses are kept as well.
        attached: for each frame a rotor, and whether its inertia is that of several bodies.
        guess: further positions near which loops are closed, by the names of coordinates.
        extras: what a file says beyond the mechanism.
    """

    geometry: tuple[Texts, ...]
    inertia: tuple[Texts, ...]
    loops: tuple[Texts, ...] = ()
    general: Texts = ("robot", "0", "0", "-9.81", "")
    values: Named = ()
    attached: tuple[tuple[Rotor | None, bool], ...] = ()
    guess: tuple[tuple[str, float], ...] = ()
    extras: tuple[tuple[str, Texts], ...] = field(default=())

    @property
    def symbols(self) -> Texts:
        """Names of the symbols in cells that can be read, in the order of their first use."""
        return tuple(dict.fromkeys(name for value in self._scalars() for name in _names(value)))

    def rows(self, sheet: str) -> tuple[Texts, ...]:
        """The rows of a sheet, each in the order of `COLUMNS[sheet]`."""
        if sheet == "symbols":
            known = dict(self.values)
            return tuple((known.get(name, ""),) for name in self.symbols)
        if sheet == "general":
            return tuple((text,) for text in self.general)
        answer: tuple[Texts, ...] = getattr(self, sheet)
        return answer

    def text(self, cell: Cell) -> str:
        """What a cell holds."""
        return self.rows(cell.sheet)[cell.row][COLUMNS[cell.sheet].index(cell.column)]

    def changed(self, cell: Cell, text: str) -> Tables:
        """The tables with another text in a cell."""
        if cell.sheet == "symbols":
            return self._with_value(self.symbols[cell.row], text)
        if cell.sheet == "general":
            return replace(self, general=_put(self.general, cell.row, text))
        rows = getattr(self, cell.sheet)
        row = _put(rows[cell.row], COLUMNS[cell.sheet].index(cell.column), text)
        changes: dict[str, Any] = {cell.sheet: _put(rows, cell.row, row)}
        return replace(self, **changes)

    def cells(self) -> Iterator[tuple[Cell, str]]:
        """Every cell and its text."""
        for sheet, columns in COLUMNS.items():
            for k, row in enumerate(self.rows(sheet)):
                for column, text in zip(columns, row, strict=True):
                    yield Cell(sheet, k, column), text

    def joint_name(self, row: int) -> str:
        """The name of the joint of frame row + 1."""
        return self.geometry[row][-1].strip() or f"q{row + 1}"

    def body_name(self, row: int) -> str:
        """The name of the body of frame row + 1."""
        return self.inertia[row][-1].strip() or f"link{row + 1}"

    def _with_value(self, name: str, text: str) -> Tables:
        return replace(self, values=tuple({**dict(self.values), name: text}.items()))

    def _scalars(self) -> Iterator[Expression]:
        for row in self.geometry:
            yield from map(_expression, row[3:9])
        for row in self.inertia:
            yield from map(_expression, row[: len(BODY_SCALARS)])
        for rotor, _ in self.attached:
            yield from () if rotor is None else map(expression, (rotor.inertia, rotor.ratio))
        yield from map(_expression, self.general[1:4])


def tables_of(table: RobotTable) -> Tables:
    """The cells that say a table of frames."""
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
        general=(table.name, *map(written, table.gravity), table.source),
        values=tuple((name, written(value)) for name, value in table.parameters.items()),
        attached=tuple((b.rotor, b.grouped) for b in rows),
        guess=tuple((name, value) for name, value in table.guess.items() if name not in names),
        extras=tuple(table.extras.items()),
    )


def robot_table(tables: Tables) -> RobotTable:
    """The table of frames that the cells say.

    Raises:
        DescriptionError: a cell cannot be read, or rows contradict each other.
    """
    read = {cell: _read(cell, text) for cell, text in tables.cells()}
    frames, bodies, guess = [], [], dict(tables.guess)
    for k in range(len(tables.geometry)):
        g = {column: read[Cell("geometry", k, column)] for column in GEOMETRY_COLUMNS}
        position = g.pop("guess")
        if position is not None:
            guess[tables.joint_name(k)] = position
        frames.append(_frame(g))
        if _says_something(tables, k):
            body = {column: read[Cell("inertia", k, column)] for column in INERTIA_COLUMNS}
            rotor, grouped = tables.attached[k]
            bodies.append(InertiaRow(k + 1, rotor=rotor, grouped=grouped, **body))
    symbols = zip(tables.symbols, range(len(tables.symbols)), strict=True)
    values = {name: read[Cell("symbols", k, "value")] for name, k in symbols}
    general = [read[Cell("general", k, "value")] for k in range(len(GENERAL_ROWS))]
    return RobotTable(
        name=general[0],
        frames=tuple(frames),
        bodies=tuple(bodies),
        loops=tuple(_loop(tables, read, k) for k in range(len(tables.loops))),
        gravity=tuple(general[1:4]),
        parameters={name: value for name, value in values.items() if value is not None},
        source=general[4],
        guess=guess,
        extras=dict(tables.extras),
    )


def _read(cell: Cell, text: str) -> Any:
    return reader_of(*cell)(text, place_of(*cell))


def _frame(values: dict[str, Any]) -> FrameRow:
    sigma = JOINTS.index(values.pop("joint"))
    return FrameRow(sigma=sigma, actuated=ACTUATED[values.pop("actuated")], **values)


def _says_something(tables: Tables, k: int) -> bool:
    """Whether the body row of frame k + 1 is other than that of a frame without a body."""
    texts = zip(tables.inertia[k], _NO_BODY, strict=True)
    given = any(text.strip() not in ("", usual) for text, usual in texts)
    return given or tables.attached[k] != (None, False)


def _loop(tables: Tables, read: Mapping[Cell, Any], k: int) -> CutRow:
    moving, fixed, joint = (read[Cell("loops", k, column)] for column in LOOP_COLUMNS)
    return CutRow((moving, fixed), joint)


def _geometry(row: FrameRow, guess: float | None) -> Texts:
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
    """One number where the range is the same in both directions."""
    even = isinstance(value, tuple) and value[0] == -value[1]
    return written_span(value[1] if even and isinstance(value, tuple) else value)


def _expression(text: str) -> Expression:
    try:
        return expression(text if text.strip() else 0.0)
    except (ExpressionError, RecursionError):
        return expression(0.0)


def _names(value: Expression) -> Iterator[str]:
    return (parameter.name for parameter in parameters_of(value))


def _put(values: tuple[Any, ...], place: int, value: Any) -> tuple[Any, ...]:
    return (*values[:place], value, *values[place + 1 :])


def require_cell(tables: Tables, cell: Cell) -> None:
    """Refuse a place that is not in the tables.

    Raises:
        DescriptionError: there is no such sheet, row or column.
    """
    known = cell.sheet in COLUMNS and cell.column in COLUMNS[cell.sheet]
    if not known or not 0 <= cell.row < len(tables.rows(cell.sheet)):
        raise DescriptionError(f"there is no cell {tuple(cell)}; reload the page")
