"""Texts of the cells of a robot's tables: which columns there are, and what each may hold."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

from mbs.errors import DescriptionError
from mbs.expressions import Number, Scalar, expression
from mbs.expressions import number as number_of
from mbs.formats.rows import BODY_SCALARS, GEOMETRY, JOINTS, LOOP_JOINTS
from mbs.messages import did_you_mean, quoted

LONGEST_CELL = 2000
"""Characters that a cell may hold."""

RANGES = ("velocity", "effort")
"""Columns of a motor's ranges: lower, upper, or one number for both directions."""

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
"""The columns that can be changed, by sheet."""

GENERAL_ROWS = ("name", "gravity x", "gravity y", "gravity z", "source")
"""What the rows of the sheet "general" hold."""

ACTUATED: Mapping[str, bool | None] = MappingProxyType({"": None, "yes": True, "no": False})
CHOICES: Mapping[tuple[str, str], tuple[str, ...]] = MappingProxyType(
    {
        ("geometry", "joint"): JOINTS,
        ("geometry", "actuated"): tuple(ACTUATED),
        ("loops", "joint"): LOOP_JOINTS,
    }
)
"""Cells that hold one of some words."""

_INTEGER = re.compile(r"\d{1,6}")
_PAIR = re.compile(r"\s*\[?([^,;]*)[,;]([^,;]*?)\]?\s*")
_TURNS = tuple((n, d) for d in (1, 2, 3, 4, 6) for n in range(-2 * d, 2 * d + 1) if n)


class Cell(NamedTuple):
    """A place in the tables.

    Attributes:
        sheet: "geometry", "inertia", "loops", "symbols" or "general".
        row: from 0; in the first two sheets that of frame row + 1.
        column: one of `COLUMNS[sheet]`.
    """

    sheet: str
    row: int
    column: str


class CellProblem(NamedTuple):
    """What is wrong, and where; the column is "" for a whole row, the sheet "" for the robot."""

    sheet: str
    row: int
    column: str
    sentence: str


def written(value: Scalar) -> str:
    """The text of a scalar, multiples of pi by their name."""
    known = expression(value)
    if not isinstance(known, Number):
        return str(known)
    return _PI.get(known.value) or str(known)


def _turns() -> dict[float, str]:
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
    """The expression in a cell; an empty one is zero.

    Raises:
        DescriptionError: it is not of the grammar, or too long.
    """
    if len(text) > LONGEST_CELL:
        raise DescriptionError(
            f"{where}: the text has {len(text)} characters; write at most {LONGEST_CELL}"
        )
    return expression(text, where) if text.strip() else 0.0


def number(text: str, where: str) -> float:
    """The value of a cell that holds no symbols.

    Raises:
        DescriptionError: it does.
    """
    return number_of(scalar(text, where), where)


def integer(text: str, where: str) -> int:
    """The number of a frame in a cell.

    Raises:
        DescriptionError: it is none.
    """
    if not _INTEGER.fullmatch(text.strip()):
        raise DescriptionError(f"{where}: {quoted(text)} is not the number of a frame; write one")
    return int(text)


def pair(text: str, where: str) -> tuple[float, float] | None:
    """The limits in a cell, None in an empty one.

    Raises:
        DescriptionError: they are not two numbers.
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
    """The range in a cell: lower, upper, or one number for both directions.

    Raises:
        DescriptionError: it is neither.
    """
    plain = text.strip().strip("[]")
    return number(plain, where) if plain and _PAIR.fullmatch(plain) is None else pair(text, where)


def written_span(value: tuple[float, float] | float | None) -> str:
    """The text of limits or of a range."""
    if value is None:
        return ""
    if isinstance(value, (int, float)):
        return written(value)
    low, high = value
    return f"{written(low)}, {written(high)}"


def word(text: str, where: str, known: Sequence[str]) -> str:
    """One of the known words.

    Raises:
        DescriptionError: it is another one.
    """
    if text.strip() not in known:
        words = [one for one in known if one]
        raise DescriptionError(f"{where} {quoted(text)} is unknown; {did_you_mean(text, words)}")
    return text.strip()


def reader_of(sheet: str, row: int, column: str) -> Callable[[str, str], Any]:
    """What reads the text of a cell and refuses a wrong one; its arguments are text and place."""
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
    if column == "name" or (sheet == "general" and GENERAL_ROWS[row] in ("name", "source")):
        return _short
    return scalar


def _short(text: str, where: str) -> str:
    if len(text) > LONGEST_CELL:
        raise DescriptionError(
            f"{where}: the text has {len(text)} characters; write at most {LONGEST_CELL}"
        )
    return text.strip()


def place_of(sheet: str, row: int, column: str) -> str:
    """The cell in the words of a message."""
    if sheet == "general":
        return GENERAL_ROWS[row]
    if sheet == "symbols":
        return f"symbol {row + 1}"
    kind = {"geometry": "frame", "inertia": "body", "loops": "loop"}[sheet]
    return f"{kind} {row + 1}, {column}"
