"""What is wrong in a robot's tables, and in which cell."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from mbs.app.desk.document.cells import (
    COLUMNS,
    CellProblem,
    place_of,
    reader_of,
)
from mbs.app.desk.document.tables import Tables, Texts
from mbs.errors import MbsError

_ROW = re.compile(r"(?:^|/)(frame|body|loop) (\d+)\b")
_SHEET = {"frame": "geometry", "body": "inertia", "loop": "loops"}
_WORD = re.compile(r"[A-Za-z_]+")
_ALIASES = {"sigma": "joint", "cut": "frame", "motor": "actuated"}


def unread(tables: Tables) -> Iterator[CellProblem]:
    """Every cell whose text cannot be read."""
    for cell, text in tables.cells():
        try:
            reader_of(*cell)(text, place_of(*cell))
        except MbsError as error:
            yield CellProblem(*cell, str(error))


def placed(tables: Tables, error: MbsError) -> CellProblem:
    """The cell that an error is about, as far as its sentence tells."""
    sentence = str(error)
    return (
        _by_number(tables, sentence)
        or _by_name(tables, sentence)
        or _by_symbol(tables, sentence)
        or CellProblem("", 0, "", sentence)
    )


def _by_number(tables: Tables, sentence: str) -> CellProblem | None:
    found = _ROW.search(sentence)
    if found is None:
        return None
    sheet, row = _SHEET[found[1]], int(found[2]) - 1
    if not 0 <= row < len(tables.rows(sheet)):
        return None
    return CellProblem(sheet, row, _column(sheet, sentence[found.end() :]), sentence)


def _by_name(tables: Tables, sentence: str) -> CellProblem | None:
    """The row whose joint or body has the name that the sentence quotes or begins with.

    Where there are two, it is the one that was named by hand, or the last one.
    """
    by_hand = [bool(g[-1].strip() or b[-1].strip()) for g, b in _pairs(tables)]
    for row in sorted(range(len(by_hand)), key=lambda k: (by_hand[k], k), reverse=True):
        joint, body = tables.joint_name(row), tables.body_name(row)
        if _names(sentence, body):
            column = _column("inertia", _after(sentence, body)) or "M"
            return CellProblem("inertia", row, column, sentence)
        if _names(sentence, joint):
            rest = _after(sentence, joint)
            column = _column("geometry", rest)
            other = "" if column else _column("inertia", rest)
            if other:
                return CellProblem("inertia", row, other, sentence)
            return CellProblem("geometry", row, column or "name", sentence)
    return None


def _pairs(tables: Tables) -> zip[tuple[Texts, Texts]]:
    return zip(tables.geometry, tables.inertia, strict=True)


def _by_symbol(tables: Tables, sentence: str) -> CellProblem | None:
    for k, name in enumerate(tables.symbols):
        if re.search(rf"\bparameter '?{re.escape(name)}'?(?![\w.])", sentence):
            return CellProblem("symbols", k, "value", sentence)
    return None


def _names(sentence: str, name: str) -> bool:
    return sentence.startswith((f"{name}:", f"{name},")) or f"'{name}'" in sentence


def _after(sentence: str, name: str) -> str:
    return sentence.partition(name)[2]


def _column(sheet: str, words: str) -> str:
    """The first word that is the name of a column."""
    columns: Any = COLUMNS[sheet]
    for word in _WORD.findall(words):
        if (known := _ALIASES.get(word, word)) in columns:
            return str(known)
    return ""
