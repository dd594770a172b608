"""Columns of numbers from tables and text files."""

from __future__ import annotations

import csv
import os
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from mbs.errors import ModelError
from mbs.messages import did_you_mean, quoted

Array = npt.NDArray[np.float64]


def column(table: Any, name: str) -> Array:
    """(n,) a column of a DataFrame, a `mbs.Result` or a dict.

    Raises:
        ModelError: there is none of this name, or it holds what is no number.
    """
    known = [str(key) for key in table.keys()] if hasattr(table, "keys") else list(table.names)  # noqa: SIM118
    if name not in known:
        if name == "time" and hasattr(table, "index") and not isinstance(table, dict):
            return np.asarray(table.index, dtype=float)
        raise ModelError(f"record: there is no column {name!r}; {did_you_mean(name, known)}")
    try:
        return np.asarray(table[name], dtype=float)
    except (TypeError, ValueError):
        raise ModelError(
            f"record: the column {name!r} does not hold numbers alone; it starts with"
            f" {quoted(list(table[name])[:3])}"
        ) from None


def columns(table: Any, what: str, names: Sequence[str]) -> Array:
    """(n, k) some columns of a table side by side.

    Args:
        table: as for `column`.
        what: they are, for messages.
        names: of the columns, one or more.

    Raises:
        ModelError: there are no names, or as for `column`.
    """
    if isinstance(names, str) or not len(names):
        raise ModelError(
            f"record: the columns of {what} are {quoted(names)}; give a list of one name or more"
        )
    return np.column_stack([column(table, name) for name in names])


def csv_table(path: str | os.PathLike[str]) -> dict[str, Array]:
    """The columns of a text file by the names in its first row.

    Args:
        path: file with commas between the columns.

    Raises:
        ModelError: it cannot be read, a row has not the length of the header, or a field is no
            number; the line is named.
    """
    try:
        with open(path, newline="", encoding="utf-8-sig") as stream:
            rows = [row for row in csv.reader(stream) if row]
    except (OSError, TypeError, UnicodeDecodeError, csv.Error) as error:
        raise ModelError(f"record: {quoted(str(path))} cannot be read ({error})") from error
    if len(rows) < 2:
        raise ModelError(f"record: {quoted(str(path))} has no rows; it needs names, then numbers")
    header = [name.strip() for name in rows[0]]
    _check_header(path, header)
    values = np.empty((len(rows) - 1, len(header)))
    for number, row in enumerate(rows[1:], start=2):
        if len(row) != len(header):
            raise ModelError(
                f"record: row {number} of {quoted(str(path))} has {len(row)} fields, the header has"
                f" {len(header)}; write one number for each name"
            )
        try:
            values[number - 2] = [float(field) for field in row]
        except ValueError:
            raise ModelError(
                f"record: row {number} of {quoted(str(path))} holds {quoted(row)};"
                " write numbers alone"
            ) from None
    return {name: values[:, k] for k, name in enumerate(header)}


def _check_header(path: str | os.PathLike[str], header: Sequence[str]) -> None:
    """Refuse other separators than commas, and numbers in the place of names."""
    for mark in (";", "\t"):
        if len(header) == 1 and mark in header[0]:
            raise ModelError(
                f"record: {quoted(str(path))} has {quoted(mark)} between its columns; write"
                " commas, and points in the numbers"
            )
    if all(_is_number(name) for name in header):
        raise ModelError(
            f"record: the first row of {quoted(str(path))} is {quoted(list(header))}, which are"
            " numbers; write the names of the columns above them"
        )


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
