"""What a language must say about itself so that functions can be written in it."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any

from mbs.comments import in_line_comment
from mbs.export.languages.unit import Argument, CodeLine, CodeUnit

WIDTH = 100
"""Columns of a line of text where the language sets no other limit."""

_BREAK = re.compile(r"(?<=[-+*/,&|<>=]) ")
"""A blank after an operator: what comes before it cannot end a statement."""


class Language(ABC):
    """A language: its words, its names, its numbers and the frame of a function.

    Attributes:
        title: for messages and headers.
        suffix: the end of the name of a file.
        reserved: names that mean something else.
        folds_case: whether names that differ in case only are the same.
        longest_name: in characters, or None.
        tail: what makes a name differ from a reserved one.
        scalars_by_name: whether an input or output that is one number is a variable, and not an
            array with one element.
        squares_as_products: whether x^2 is written x*x.
        brackets: around the place of an element.
        first: number of the first row and column.
    """

    title: str
    suffix = ".txt"
    reserved: frozenset[str] = frozenset()
    folds_case = False
    longest_name: int | None = None
    tail = "_"
    scalars_by_name = True
    squares_as_products = False
    brackets = "(", ")"
    first = 1

    @abstractmethod
    def printer(self) -> Any:
        """A printer of sympy."""

    @abstractmethod
    def lines(self, unit: CodeUnit, printer: Any) -> Iterator[str]:
        """The text of a function, line by line."""

    def text(self, unit: CodeUnit) -> str:
        """The text of a function."""
        return "\n".join(self.lines(unit, self.printer())) + "\n"

    def place(self, argument: Argument, row: int, column: int) -> str:
        """An element of an input or output in the text."""
        if argument.scalar and self.scalars_by_name:
            return argument.name
        row, column = row + self.first, column + self.first
        inside = f"{row}" if argument.is_vector else f"{row}, {column}"
        return inside.join((argument.name + self.brackets[0], self.brackets[1]))

    def loads(self, unit: CodeUnit) -> Iterator[str]:
        """`name = element` for the elements of inputs that are used."""
        for load in unit.loads:
            place = self.place(load.argument, load.row, load.column)
            if place != load.name:
                yield f"{load.name} = {place}"

    def stores(self, unit: CodeUnit, out: Argument, printer: Any) -> Iterator[str]:
        """`element = value` for the elements of an output that are not zero."""
        for store in unit.stores_of(out):
            place, value = self.place(out, store.row, store.column), printer.text(store.value)
            if place != value:
                yield f"{place} = {value}"

    def legal(self, name: str) -> str:
        """The name with what the language does not take replaced."""
        name = re.sub(r"\W", "_", name, flags=re.ASCII).lstrip("_")
        return name if name[:1].isalpha() else f"x{name}"

    def is_reserved(self, name: str) -> bool:
        """Whether the name means something else."""
        return self._folded(name) in self.reserved

    def distinct(self, names: Iterable[str]) -> list[str]:
        """The names as the language takes them, no two the same; the first keep theirs."""
        used: set[str] = set()
        result = []
        for wanted in names:
            for name in self._spellings(self.legal(wanted)):
                if self._folded(name) not in used and not self.is_reserved(name):
                    break
            used.add(self._folded(name))
            result.append(name)
        return result

    def _folded(self, name: str) -> str:
        return name.lower() if self.folds_case else name

    def _spellings(self, name: str) -> Iterator[str]:
        longest = self.longest_name or len(name) + 9
        yield name[:longest]
        count = 1
        while True:
            ending = self.tail + (str(count) if count > 1 else "")
            yield name[: longest - len(ending)] + ending
            count += 1


def plain_number(value: float) -> str:
    """A constant in all its digits; whole numbers without a point."""
    return repr(value).removesuffix(".0")


def wrapped(text: str, indent: str = "", mark: str = "", width: int = WIDTH) -> list[str]:
    """A statement broken after operators, its continuation indented.

    Args:
        text: the statement.
        indent: before its first line.
        mark: what the language wants at the end of a line that goes on.
        width: columns.
    """
    lines, line = [], indent
    for piece in _BREAK.split(text):
        if len(line) + len(piece) + len(mark) > width and line.strip():
            lines.append(line.rstrip() + mark)
            line = indent + "    "
        line += piece + " "
    return [*lines, line.rstrip()]


def commented(header: Sequence[str], mark: str) -> Iterator[str]:
    """A header as comments to the end of the line."""
    yield from (f"{mark} {line}".rstrip() for line in kept_inside(header, in_line_comment))


def kept_inside(header: Sequence[str], rule: Callable[[str], str]) -> Iterator[str]:
    """The lines of a header, indented as they are, for a comment.

    Args:
        header: what to say.
        rule: of `mbs.comments`, for the syntax of the comment.
    """
    for line in header:
        text = line.lstrip(" ")
        yield " " * (len(line) - len(text)) + rule(text)


def value_text(line: CodeLine, printer: Any, choice: str) -> str:
    """What a line assigns.

    Args:
        line: what to write.
        printer: of its expressions.
        choice: how the language chooses, `{0}` being the condition, `{1}` and `{2}` the values.
    """
    value = str(printer.text(line.value))
    if line.condition is None:
        return value
    return choice.format(printer.text(line.condition), value, printer.text(line.otherwise))


def sections(unit: CodeUnit) -> Iterator[tuple[str, Sequence[CodeLine]]]:
    """The lines in two groups, each with what to say about it."""
    if unit.fixed:
        yield "Parameters only: these may be computed once.", unit.fixed
        yield "The model.", unit.changing
    else:
        yield "", unit.changing


def grid_texts(unit: CodeUnit, out: Argument, printer: Any, zero: str) -> list[list[str]]:
    """The elements of an output as texts, row by row."""
    return [[zero if e is None else printer.text(e) for e in row] for row in unit.grid(out)]
