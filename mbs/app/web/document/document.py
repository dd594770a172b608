"""Description of a robot in the app, as typed or opened, with its errors and its System."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from mbs.app.tasks.exporting import toml
from mbs.app.web.document import rows as document_rows
from mbs.app.web.document.reading import read_upload, shown_tables, table_of
from mbs.app.web.document.tables import (
    COLUMNS,
    GRAVITY_ROWS,
    LONGEST_CELL,
    MOUNT_ROW,
    Cell,
    CellProblem,
    Tables,
    mount,
    number,
    place_of,
    reader_of,
    require_cell,
    robot_table,
    scalar,
    tables_of,
)
from mbs.assembly import System
from mbs.errors import DescriptionError, MbsError
from mbs.expressions import Parameter
from mbs.formats import RobotTable, to_mechanism, write_par, write_toml
from mbs.mechanism import Mechanism
from mbs.robots import catalogue
from mbs.text import did_you_mean

# Errors in the tables of a robot, and the cells that they are about.


_ROW = re.compile(r"(?:^|/)(frame|body|loop) (\d+)\b")
_SHEET = {"frame": "geometry", "body": "inertia", "loop": "loops"}
_WORD = re.compile(r"[A-Za-z_]+")
_ALIASES = {"sigma": "joint", "cut": "frame", "motor": "actuated"}


def cell_problems(tables: Tables) -> Iterator[CellProblem]:
    """Yield a problem for every cell whose text cannot be read.

    Args:
        tables: cells of a robot.
    """
    for cell, text in tables.cells():
        try:
            reader_of(*cell)(text, place_of(*cell))
        except MbsError as error:
            yield CellProblem(*cell, str(error))


def problem_of(tables: Tables, error: MbsError) -> CellProblem:
    """Return an error of a robot as a problem of the cell that its message names.

    The problem is that of the robot as a whole if the message names no cell.

    Args:
        tables: cells of the robot.
        error: error of its assembly.
    """
    sentence = str(error)
    return (
        _by_number(tables, sentence)
        or _by_name(tables, sentence)
        or _by_symbol(tables, sentence)
        or CellProblem("", 0, "", sentence)
    )


def _by_number(tables: Tables, sentence: str) -> CellProblem | None:
    """Return the problem of the row that a message names by number, such as "frame 3".

    Else None.
    """
    found = _ROW.search(sentence)
    if found is None:
        return None
    sheet, row = _SHEET[found[1]], int(found[2]) - 1
    if not 0 <= row < len(tables.rows(sheet)):
        return None
    return CellProblem(sheet, row, _column(sheet, sentence[found.end() :]), sentence)


def _by_name(tables: Tables, sentence: str) -> CellProblem | None:
    """Return the problem of the row whose joint or body name a message quotes or begins with.

    If several rows match, a row that the user named is preferred, then the last row. None if no row
    matches.
    """
    by_hand = [
        bool(g[-1].strip() or b[-1].strip())
        for g, b in zip(tables.geometry, tables.inertia, strict=True)
    ]
    for row in sorted(range(len(by_hand)), key=lambda k: (by_hand[k], k), reverse=True):
        joint, body = tables.joint_name(row), tables.body_name(row)
        if _is_about(sentence, body):
            column = _column("inertia", _after(sentence, body)) or "M"
            return CellProblem("inertia", row, column, sentence)
        if _is_about(sentence, joint):
            rest = _after(sentence, joint)
            column = _column("geometry", rest)
            other = "" if column else _column("inertia", rest)
            if other:
                return CellProblem("inertia", row, other, sentence)
            return CellProblem("geometry", row, column or "name", sentence)
    return None


def _by_symbol(tables: Tables, sentence: str) -> CellProblem | None:
    """Return the problem of the symbol that a message names; else None."""
    for k, name in enumerate(tables.symbols):
        if re.search(rf"\bparameter '?{re.escape(name)}'?(?![\w.])", sentence):
            return CellProblem("symbols", k, "value", sentence)
    return None


def _is_about(sentence: str, name: str) -> bool:
    """Whether a message begins with a name or quotes it."""
    return sentence.startswith((f"{name}:", f"{name},")) or f"'{name}'" in sentence


def _after(sentence: str, name: str) -> str:
    """Return the part of a message after a name."""
    return sentence.partition(name)[2]


def _column(sheet: str, words: str) -> str:
    """Return the first word of a text that is a column of the table `sheet`.

    Empty if there is none.
    """
    columns: Any = COLUMNS[sheet]
    for word in _WORD.findall(words):
        if (known := _ALIASES.get(word, word)) in columns:
            return str(known)
    return ""


_UNSAFE = re.compile(r"[^A-Za-z0-9_-]+")
_KEPT = 24
"""Number of assembled systems that are cached for all visitors."""


@dataclass(frozen=True, slots=True)
class DocumentOrigin:
    """Source of a mechanism that a table of frames cannot express.

    Attributes:
        name: name in the catalogue, or "" for a file.
        content: content of the file.
        suffix: suffix of the file name, such as ".urdf".
        reason: reason why a table of frames cannot express it.
    """

    name: str
    content: bytes = b""
    suffix: str = ""
    reason: str = ""

    def mechanism(self) -> Mechanism:
        """Return the mechanism, built from its source.

        Raise a DescriptionError if the file is invalid.
        """
        if self.name:
            return catalogue()[self.name]()
        made = read_upload(self.content, self.suffix)
        return made if isinstance(made, Mechanism) else to_mechanism(made)


@dataclass(frozen=True, slots=True)
class Document:
    """Description of a robot as text cells; immutable, hashable and picklable.

    Attributes:
        tables: the cells. For a mechanism with an `origin` only name, gravity, mount, source and
            the values of symbols.
        origin: source of a mechanism that a table of frames cannot express; else None.
    """

    tables: Tables
    origin: DocumentOrigin | None = None

    @staticmethod
    def of(table: RobotTable) -> Document:
        """Return the document of a table of frames.

        Args:
            table: table of frames.
        """
        return Document(tables_of(table))

    @staticmethod
    def blank() -> Document:
        """Return a new robot with a single joint."""
        return Document(document_rows.blank())

    @staticmethod
    def of_name(name: str) -> Document:
        """Return the document of a mechanism of the catalogue.

        Args:
            name: name in the catalogue.

        Raises:
            DescriptionError: the catalogue has no robot with this name.
        """
        if name not in catalogue():
            raise DescriptionError(
                f"there is no robot {name!r} in the catalogue; {did_you_mean(name, catalogue())}"
            )
        return _of_mechanism(catalogue()[name](), DocumentOrigin(name))

    @staticmethod
    def of_upload(content: bytes, suffix: str) -> Document:
        """Return the document of a robot file: .toml, .par, .urdf, .sdf, .world or .xml (MJCF).

        Args:
            content: content of the file.
            suffix: suffix of the file name.

        Raises:
            DescriptionError: the file is too large, of another type, or malformed.
        """
        made = read_upload(content, suffix)
        if isinstance(made, RobotTable):
            return Document.of(made)
        return _of_mechanism(made, DocumentOrigin("", content, suffix.lower()))

    @property
    def name(self) -> str:
        """Name of the robot."""
        return self.tables.general[0].strip() or "robot"

    @property
    def is_table(self) -> bool:
        """Whether the cells describe the robot completely, so that they can be edited."""
        return self.origin is None

    @property
    def symbols(self) -> tuple[str, ...]:
        """Names of the symbols of the robot."""
        if self.origin is None:
            return self.tables.symbols
        return tuple(name for name, _ in self.tables.values)

    def changed(self, cell: Cell, text: str) -> Document:
        """Return the document with another text in a cell.

        Args:
            cell: position of the cell.
            text: new text.

        Raises:
            DescriptionError: the cell does not exist, or cannot be changed.
        """
        if self.origin is not None:
            if cell.sheet == "general" and cell.row in (*GRAVITY_ROWS, MOUNT_ROW):
                require_cell(self.tables, cell)
                return replace(self, tables=self.tables.changed(cell, text[: LONGEST_CELL + 1]))
            if cell.sheet != "symbols" or not 0 <= cell.row < len(self.symbols):
                raise DescriptionError(f"this cell cannot be changed: {self.origin.reason}")
            values = {**dict(self.tables.values), self.symbols[cell.row]: text}
            return replace(self, tables=replace(self.tables, values=tuple(values.items())))
        require_cell(self.tables, cell)
        return replace(self, tables=self.tables.changed(cell, text[: LONGEST_CELL + 1]))

    def with_frame(self) -> Document:
        """Return the document with an additional frame at the end.

        Raises:
            DescriptionError: rows of this robot cannot be changed, or the table is full.
        """
        return self._edit(document_rows.with_frame)

    def without_frame(self, row: int) -> Document:
        """Return the document without a frame; the numbers of later frames decrease by one.

        Args:
            row: row index of the frame (its number minus one).

        Raises:
            DescriptionError: rows of this robot cannot be changed, or it is the only frame.
        """
        return self._edit(lambda tables: document_rows.without_frame(tables, row))

    def with_loop(self) -> Document:
        """Return the document with an additional loop.

        Raises:
            DescriptionError: rows of this robot cannot be changed.
        """
        return self._edit(document_rows.with_loop)

    def without_loop(self, row: int) -> Document:
        """Return the document without a loop.

        Args:
            row: row index of the loop, from 0.

        Raises:
            DescriptionError: rows of this robot cannot be changed, or there is no such loop.
        """
        return self._edit(lambda tables: document_rows.without_loop(tables, row))

    @property
    def problems(self) -> tuple[CellProblem, ...]:
        """Errors in the tables by cell, without errors that only assembly can find."""
        return _problems(self)

    @property
    def file_name(self) -> str:
        """Name of the robot in safe characters, for file names."""
        return _UNSAFE.sub("_", self.name)[:60].strip("_") or "robot"

    def as_table(self) -> Document:
        """Return the document as a table of frames, made from the links of the assembled mechanism.

        A document that is a table already is returned unchanged.

        Raises:
            MbsError: a table of frames cannot express it, or it cannot be assembled.
        """
        return self if self.origin is None else Document.of_upload(toml(self.system()), ".toml")

    def table(self) -> RobotTable:
        """Return the table of frames that the cells describe.

        Raises:
            DescriptionError: the cells are not a valid table, or a table cannot express the
                mechanism.
        """
        if self.origin is not None:
            raise DescriptionError(self.origin.reason)
        return _table(self)

    def mechanism(self) -> Mechanism:
        """Return the mechanism, with the values of symbols as typed.

        Raises:
            MbsError: a cell has an error.
        """
        if self.origin is None:
            mechanism = to_mechanism(self.table())
            mechanism.mount = self.tables.mount()
            self._set_values(mechanism, {p.name for p in mechanism.parameters()})
            return mechanism
        mechanism = self.origin.mechanism()
        self._change_gravity(mechanism)
        self._set_values(mechanism, {name for name, _ in self.tables.values})
        return mechanism

    def _set_values(self, mechanism: Mechanism, names: Collection[str]) -> None:
        """Set the values of the symbols with these names, if they have a value."""
        for name, text in self.tables.values:
            if name in names and text.strip():
                mechanism.values[name] = Parameter(name, number(text, f"symbol {name}"))

    def _change_gravity(self, mechanism: Mechanism) -> None:
        """Set gravity and mount of a mechanism from the cells, if they differ."""
        cells = [Cell("general", k, "value") for k in GRAVITY_ROWS]
        texts = [self.tables.text(cell) for cell in cells]
        gravity = None
        if texts != [str(value) for value in mechanism.world.gravity]:
            gravity = [scalar(text, place_of(*c)) for c, text in zip(cells, texts, strict=True)]
        mounted = mount(self.tables.general[MOUNT_ROW], "mount")
        if gravity is not None or mounted:
            mechanism.change_gravity(gravity, mounted or None)

    def system(self) -> System:
        """Return the assembled mechanism; equal documents share the same System.

        Raises:
            MbsError: a cell has an error, or the mechanism cannot be assembled.
        """
        return _system(self)

    def shown(self) -> Tables:
        """Return the tables to display: the cells, or the links of an assembled mechanism.

        Raises:
            MbsError: the mechanism cannot be assembled.
        """
        return self.tables if self.origin is None else _shown(self)

    def toml(self) -> str:
        """Return the text of a TOML file of the table.

        Raises:
            DescriptionError: see `table`.
        """
        return self._write(write_toml, "robot.toml")

    def par(self) -> str:
        """Return the text of a .par file of the table.

        Raises:
            DescriptionError: see `table`, or the format cannot express the table.
        """
        return self._write(write_par, "robot.par")

    def _edit(self, edit: Callable[[Tables], Tables]) -> Document:
        """Return the document with changed tables.

        Raise a DescriptionError if rows cannot be changed.
        """
        if self.origin is not None:
            raise DescriptionError(f"rows cannot be changed: {self.origin.reason}")
        return replace(self, tables=edit(self.tables))

    def _write(self, write: Callable[[RobotTable, Path], None], name: str) -> str:
        """Return the text that the callable `write` writes to a file with this name."""
        table = self.table()
        with tempfile.TemporaryDirectory(prefix="mbs-app-") as folder:
            path = Path(folder) / name
            write(table, path)
            return path.read_text(encoding="utf-8")


def _of_mechanism(mechanism: Mechanism, origin: DocumentOrigin) -> Document:
    """Return the document of a mechanism: a table of frames if possible, else with its origin."""
    try:
        return Document.of(table_of(mechanism))
    except DescriptionError as error:
        reason = str(error)
    values = tuple(
        (p.name, "" if p.default is None else f"{p.default!r}") for p in mechanism.parameters()
    )
    general = (mechanism.name, *map(str, mechanism.world.gravity), mechanism.source, "")
    tables = Tables((), (), general=general, values=values)
    return Document(tables, replace(origin, reason=reason))


@lru_cache(maxsize=_KEPT)
def _table(document: Document) -> RobotTable:
    """Return the table of frames of a document (cached)."""
    return robot_table(document.tables)


@lru_cache(maxsize=_KEPT)
def _system(document: Document) -> System:
    """Return the assembled system of a document (cached)."""
    return document.mechanism().assemble()


@lru_cache(maxsize=_KEPT)
def _shown(document: Document) -> Tables:
    """Return the tables that show the links of an assembled document (cached)."""
    return shown_tables(document.system(), document.tables)


@lru_cache(maxsize=_KEPT)
def _problems(document: Document) -> tuple[CellProblem, ...]:
    """Return the problems of the cells of a document (cached)."""
    if document.origin is not None:
        return tuple(_value_problems(document))
    found = tuple(cell_problems(document.tables))
    if found:
        return found
    try:
        document.mechanism()
    except MbsError as error:
        return (problem_of(document.tables, error),)
    return ()


def _value_problems(document: Document) -> list[CellProblem]:
    """Return the problems of symbols, gravity and mount of a document that has an origin."""
    problems = []
    for row, (name, text) in enumerate(document.tables.values):
        try:
            if text.strip():
                number(text, f"symbol {name}")
        except MbsError as error:
            problems.append(CellProblem("symbols", row, "value", str(error)))
    for row in (*GRAVITY_ROWS, MOUNT_ROW):
        cell = Cell("general", row, "value")
        try:
            reader_of(*cell)(document.tables.text(cell), place_of(*cell))
        except MbsError as error:
            problems.append(CellProblem(*cell, str(error)))
    return problems
