"""A robot on the desk: what was typed or opened, what is wrong in it, and its System."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

from mbs.app.desk.document import rows as document_rows
from mbs.app.desk.document.cells import LONGEST_CELL, Cell, CellProblem, number
from mbs.app.desk.document.problems import placed, unread
from mbs.app.desk.document.reading import read_upload, table_of
from mbs.app.desk.document.shown import shown_tables
from mbs.app.desk.document.tables import Tables, require_cell, robot_table, tables_of
from mbs.app.tasks.exporting import toml
from mbs.assembly import System
from mbs.components import Mechanism
from mbs.errors import DescriptionError, MbsError
from mbs.expressions import Parameter
from mbs.formats import RobotTable, to_mechanism, write_par, write_toml
from mbs.messages import did_you_mean
from mbs.robots import catalogue

_UNSAFE = re.compile(r"[^A-Za-z0-9_-]+")
_KEPT = 24
"""Assembled systems that are kept; they are the same for every visitor."""


@dataclass(frozen=True, slots=True)
class DocumentOrigin:
    """Where a mechanism comes from that its tables do not say.

    Attributes:
        name: in the catalogue, or "" for a file.
        content: of the file.
        suffix: of the file's name.
        reason: why no table of frames says it.
    """

    name: str
    content: bytes = b""
    suffix: str = ""
    reason: str = ""

    def mechanism(self) -> Mechanism:
        """The mechanism, made anew."""
        if self.name:
            return catalogue()[self.name]()
        made = read_upload(self.content, self.suffix)
        return made if isinstance(made, Mechanism) else to_mechanism(made)


@dataclass(frozen=True, slots=True)
class Document:
    """A robot as texts: hashable, picklable, never changed.

    Attributes:
        tables: the cells; of a mechanism with an `origin` only its name, its source and the
            values of its symbols.
        origin: where a mechanism comes from that no table of frames can say; None for the others.
    """

    tables: Tables
    origin: DocumentOrigin | None = None

    @staticmethod
    def of(table: RobotTable) -> Document:
        """The document of a table of frames."""
        return Document(tables_of(table))

    @staticmethod
    def blank() -> Document:
        """A robot of one joint, to begin with."""
        return Document(document_rows.blank())

    @staticmethod
    def of_name(name: str) -> Document:
        """A mechanism of the catalogue.

        Raises:
            DescriptionError: there is none of this name.
        """
        if name not in catalogue():
            raise DescriptionError(
                f"there is no robot {name!r} in the catalogue; {did_you_mean(name, catalogue())}"
            )
        return _of_mechanism(catalogue()[name](), DocumentOrigin(name))

    @staticmethod
    def of_upload(content: bytes, suffix: str) -> Document:
        """The robot in a file: .toml, .par, .urdf or .xml (MJCF).

        Raises:
            DescriptionError: the file is too large, of another kind, or malformed.
        """
        made = read_upload(content, suffix)
        if isinstance(made, RobotTable):
            return Document.of(made)
        return _of_mechanism(made, DocumentOrigin("", content, suffix.lower()))

    @property
    def name(self) -> str:
        """Of the robot."""
        return self.tables.general[0].strip() or "robot"

    @property
    def is_table(self) -> bool:
        """Whether the cells say the whole robot, so that they can be changed."""
        return self.origin is None

    @property
    def symbols(self) -> tuple[str, ...]:
        """Names of its symbols."""
        if self.origin is None:
            return self.tables.symbols
        return tuple(name for name, _ in self.tables.values)

    def changed(self, cell: Cell, text: str) -> Document:
        """The document with another text in a cell.

        Raises:
            DescriptionError: there is no such cell, or it cannot be changed.
        """
        if self.origin is not None:
            if cell.sheet != "symbols" or not 0 <= cell.row < len(self.symbols):
                raise DescriptionError(f"this cell cannot be changed: {self.origin.reason}")
            values = {**dict(self.tables.values), self.symbols[cell.row]: text}
            return replace(self, tables=replace(self.tables, values=tuple(values.items())))
        require_cell(self.tables, cell)
        return replace(self, tables=self.tables.changed(cell, text[: LONGEST_CELL + 1]))

    def with_frame(self) -> Document:
        """One more frame at the end."""
        return self._edited(document_rows.with_frame)

    def without_frame(self, row: int) -> Document:
        """Frame row + 1 taken out; numbers of the others follow."""
        return self._edited(lambda tables: document_rows.without_frame(tables, row))

    def with_loop(self) -> Document:
        """One more loop."""
        return self._edited(document_rows.with_loop)

    def without_loop(self, row: int) -> Document:
        """Loop row + 1 taken out."""
        return self._edited(lambda tables: document_rows.without_loop(tables, row))

    @property
    def problems(self) -> tuple[CellProblem, ...]:
        """What is wrong in the tables, cell by cell; what only assembly finds is not among it."""
        return _problems(self)

    @property
    def file_name(self) -> str:
        """The name in safe characters, for files."""
        return _UNSAFE.sub("_", self.name)[:60].strip("_") or "robot"

    def as_table(self) -> Document:
        """The table of frames with the links of the mechanism, for one that was composed.

        Raises:
            MbsError: no table of frames says it, or it cannot be assembled.
        """
        return self if self.origin is None else Document.of_upload(toml(self.system()), ".toml")

    def table(self) -> RobotTable:
        """The table of frames.

        Raises:
            DescriptionError: the cells do not say one, or the mechanism cannot be said by one.
        """
        if self.origin is not None:
            raise DescriptionError(self.origin.reason)
        return _table(self)

    def mechanism(self) -> Mechanism:
        """The mechanism, with the values of symbols as typed.

        Raises:
            MbsError: something is wrong in a cell.
        """
        if self.origin is None:
            return to_mechanism(self.table())
        mechanism = self.origin.mechanism()
        for name, text in self.tables.values:
            if text.strip():
                mechanism.values[name] = Parameter(name, number(text, f"symbol {name}"))
        return mechanism

    def system(self) -> System:
        """The assembled mechanism; the same System for equal documents.

        Raises:
            MbsError: a cell is wrong, or the mechanism cannot be assembled.
        """
        return _system(self)

    def shown(self) -> Tables:
        """The tables to look at: the cells, or what a composed mechanism was assembled into.

        Raises:
            MbsError: it cannot be assembled.
        """
        return self.tables if self.origin is None else _shown(self)

    def toml(self) -> str:
        """The text of a TOML file of the table.

        Raises:
            DescriptionError: as in `table`.
        """
        return self._written(write_toml, "robot.toml")

    def par(self) -> str:
        """The text of a .par file of the table.

        Raises:
            DescriptionError: as in `table`, or the format cannot say it.
        """
        return self._written(write_par, "robot.par")

    def _edited(self, edit: Callable[[Tables], Tables]) -> Document:
        if self.origin is not None:
            raise DescriptionError(f"rows cannot be changed: {self.origin.reason}")
        return replace(self, tables=edit(self.tables))

    def _written(self, write: Callable[[RobotTable, Path], None], name: str) -> str:
        table = self.table()
        with tempfile.TemporaryDirectory(prefix="mbs-desk-") as folder:
            path = Path(folder) / name
            write(table, path)
            return path.read_text(encoding="utf-8")


def _of_mechanism(mechanism: Mechanism, origin: DocumentOrigin) -> Document:
    try:
        return Document.of(table_of(mechanism))
    except DescriptionError as error:
        reason = str(error)
    values = tuple(
        (p.name, "" if p.default is None else f"{p.default!r}") for p in mechanism.parameters()
    )
    general = (mechanism.name, *map(str, mechanism.world.gravity), mechanism.source)
    tables = Tables((), (), general=general, values=values)
    return Document(tables, replace(origin, reason=reason))


@lru_cache(maxsize=_KEPT)
def _table(document: Document) -> RobotTable:
    return robot_table(document.tables)


@lru_cache(maxsize=_KEPT)
def _system(document: Document) -> System:
    return document.mechanism().assemble()


@lru_cache(maxsize=_KEPT)
def _shown(document: Document) -> Tables:
    return shown_tables(document.system(), document.tables)


@lru_cache(maxsize=_KEPT)
def _problems(document: Document) -> tuple[CellProblem, ...]:
    if document.origin is not None:
        return tuple(_value_problems(document))
    found = tuple(unread(document.tables))
    if found:
        return found
    try:
        document.mechanism()
    except MbsError as error:
        return (placed(document.tables, error),)
    return ()


def _value_problems(document: Document) -> list[CellProblem]:
    problems = []
    for row, (name, text) in enumerate(document.tables.values):
        try:
            if text.strip():
                number(text, f"symbol {name}")
        except MbsError as error:
            problems.append(CellProblem("symbols", row, "value", str(error)))
    return problems
