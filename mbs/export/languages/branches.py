"""Lines that depend on a condition, in languages that need statements for it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from mbs.export.languages.unit import CodeLine


def branches(
    line: CodeLine,
    printer: Any,
    words: tuple[str, str, str],
    statement: Callable[[str, str], list[str]],
    end: str = "",
) -> Iterator[str]:
    """`name = value`, or the two of them between if, else and end.

    Args:
        line: what to write.
        printer: of its expressions.
        words: how the branches begin and end, the first with `{0}` for the condition.
        statement: breaks a statement, given with its indentation, into lines.
        end: of a statement.
    """
    value = f"{line.name} = {printer.text(line.value)}{end}"
    if line.condition is None:
        yield from statement(value, "  ")
        return
    opening, between, closing = words
    yield from statement(opening.format(printer.text(line.condition)), "  ")
    yield from statement(value, "    ")
    yield f"  {between}"
    yield from statement(f"{line.name} = {printer.text(line.otherwise)}{end}", "    ")
    yield f"  {closing}"
