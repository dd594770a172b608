"""Output of commands: tables for people, JSON for programs."""

from __future__ import annotations

import json
import math
import shutil
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import typer

_WIDEST = 10_000
"""Width of the output in characters if it is no terminal, so that nothing wraps."""
_GAP = 3
_NARROWEST = 20


@dataclass(frozen=True, slots=True)
class PrintedTable:
    """Rows under a heading.

    Attributes:
        title: title above the table, or "".
        columns: names of the columns.
        rows: texts of the columns, for each row.
        right: names of the right-aligned columns of numbers.
        soft: names of the columns that wrap on a narrow terminal; other columns do not wrap.
        cut: whether to truncate the last column on a narrow terminal.
    """

    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence[str]]
    right: Sequence[str] = ()
    soft: Sequence[str] = ()
    cut: bool = False


def print_tables(tables: Iterable[PrintedTable]) -> None:
    """Print tables with an empty line between them; tables without rows are omitted.

    Args:
        tables: tables to print.
    """
    from rich.console import Console
    from rich.text import Text

    for number_of, table in enumerate(table for table in tables if table.rows):
        narrow = sys.stdout.isatty() and table.soft
        console = Console(file=sys.stdout, highlight=False, width=None if narrow else _WIDEST)
        if number_of:
            console.print()
        if table.title:
            console.print(Text(table.title, style="bold"))
        console.print(_draw(table, _widths(table)))


def _widths(table: PrintedTable) -> list[int]:
    """Return the width of each column in characters."""
    widths = [max(map(len, column)) for column in zip(table.columns, *table.rows, strict=True)]
    if table.cut and sys.stdout.isatty():
        left = shutil.get_terminal_size().columns - sum(widths[:-1]) - _GAP * len(widths[:-1])
        widths[-1] = max(_NARROWEST, min(widths[-1], left))
    return widths


def _draw(table: PrintedTable, widths: Sequence[int]) -> Any:
    """Return a rich table with the given column widths [characters]."""
    from rich import box
    from rich.table import Table as Rich
    from rich.text import Text

    drawn = Rich(box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False)
    for name, width in zip(table.columns, widths, strict=True):
        drawn.add_column(
            name,
            justify="right" if name in table.right else "left",
            min_width=None if name in table.soft else width,
            max_width=width,
            no_wrap=name not in table.soft,
        )
    for row in table.rows:
        drawn.add_row(*(Text(cell) for cell in row))
    return drawn


def print_json(data: Any) -> None:
    """Print data as JSON; infinite and NaN values become null.

    Args:
        data: data that `plain` accepts.
    """
    typer.echo(json.dumps(plain(data), indent=2, ensure_ascii=False, allow_nan=False))


def note(text: str) -> None:
    """Print a message on standard error, so that the standard output contains only results.

    Args:
        text: message.
    """
    typer.echo(text, err=True)


def plain(data: Any) -> Any:
    """Convert data to dicts, lists, texts, finite numbers, booleans and None only.

    Infinite and NaN values become None, arrays become lists, and other objects become texts.

    Args:
        data: any data.
    """
    if isinstance(data, Mapping):
        return {str(key): plain(value) for key, value in data.items()}
    if isinstance(data, str | bool | int | None):
        return data
    if hasattr(data, "tolist"):
        return plain(data.tolist())
    if isinstance(data, float):
        return data if math.isfinite(data) else None
    if isinstance(data, Iterable):
        return [plain(value) for value in data]
    return str(data)


def number(value: float | None) -> str:
    """Return a number as text with at most six digits; a dash for NaN or None.

    Args:
        value: number.
    """
    return "-" if value is None or math.isnan(value) else f"{value:.6g}"
