"""What a language must say about itself so that functions can be written in it."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from mbs.text import in_line_comment

# A function ready to be written in a language: its arguments and its lines, names chosen.


Expr = Any
"""An expression of sympy."""


@dataclass(frozen=True, slots=True)
class Argument:
    """An input or output.

    Attributes:
        name: in the text.
        rows, columns: its shape.
        scalar: whether it is one number, and not a vector that has one element.
    """

    name: str
    rows: int
    columns: int
    scalar: bool

    @property
    def size(self) -> int:
        """Number of elements."""
        return self.rows * self.columns

    @property
    def is_vector(self) -> bool:
        """Whether it has one column."""
        return self.columns == 1


@dataclass(frozen=True, slots=True)
class Load:
    """An element of an input that gets a name."""

    name: str
    argument: Argument
    row: int
    column: int


@dataclass(frozen=True, slots=True)
class Store:
    """An element of an output and the name or constant that is its value.

    Attributes:
        argument: the output.
        row, column: of the element.
        value: a name or a constant.
        label: what the element is called where outputs are no arrays.
    """

    argument: Argument
    row: int
    column: int
    value: Expr
    label: str


@dataclass(frozen=True, slots=True)
class CodeLine:
    """name = value, or, under a condition, value where it holds and otherwise the other one."""

    name: str
    value: Expr
    condition: Expr = None
    otherwise: Expr = None


@dataclass(frozen=True, slots=True)
class CodeUnit:
    """A function in lines.

    Attributes:
        name: of the function in the text.
        header: what to say about it, line by line.
        tables: what the classic output lists before its equations.
        inputs, outputs: its arguments.
        loads: the elements of inputs that are used.
        fixed: lines that depend on parameters alone.
        changing: the other lines.
        stores: the elements of outputs that are not zero, column by column.
    """

    name: str
    header: tuple[str, ...]
    tables: tuple[str, ...]
    inputs: tuple[Argument, ...]
    outputs: tuple[Argument, ...]
    loads: tuple[Load, ...]
    fixed: tuple[CodeLine, ...]
    changing: tuple[CodeLine, ...]
    stores: tuple[Store, ...]

    @property
    def locals(self) -> list[str]:
        """The names that lines and elements of inputs give, arguments left out."""
        arguments = {argument.name for argument in (*self.inputs, *self.outputs)}
        named: list[Load | CodeLine] = [*self.loads, *self.fixed, *self.changing]
        return [item.name for item in named if item.name not in arguments]

    def stores_of(self, argument: Argument) -> Sequence[Store]:
        """The elements of one output."""
        return [store for store in self.stores if store.argument is argument]

    def has_zeros(self, argument: Argument) -> bool:
        """Whether some element of an output is always zero."""
        return len(self.stores_of(argument)) < argument.size

    def grid(self, argument: Argument) -> list[list[Expr]]:
        """The elements of an output row by row, None where it is zero."""
        grid: list[list[Expr]] = [[None] * argument.columns for _ in range(argument.rows)]
        for store in self.stores_of(argument):
            grid[store.row][store.column] = store.value
        return grid


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
        return self._fold(name) in self.reserved

    def distinct(self, names: Iterable[str]) -> list[str]:
        """The names as the language takes them, no two the same; the first keep theirs."""
        used: set[str] = set()
        result = []
        for wanted in names:
            for name in self._spellings(self.legal(wanted)):
                if self._fold(name) not in used and not self.is_reserved(name):
                    break
            used.add(self._fold(name))
            result.append(name)
        return result

    def _fold(self, name: str) -> str:
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


def wrap(text: str, indent: str = "", mark: str = "", width: int = WIDTH) -> list[str]:
    """A statement broken after operators, its continuation indented.

    Args:
        text: the statement.
        indent: before its first line.
        mark: what the language needs at the end of a line that goes on.
        width: columns.
    """
    lines, line = [], indent
    for piece in _BREAK.split(text):
        if len(line) + len(piece) + len(mark) > width and line.strip():
            lines.append(line.rstrip() + mark)
            line = indent + "    "
        line += piece + " "
    return [*lines, line.rstrip()]


def comment_lines(header: Sequence[str], mark: str) -> Iterator[str]:
    """A header as comments to the end of the line."""
    yield from (f"{mark} {line}".rstrip() for line in kept_inside(header, in_line_comment))


def kept_inside(header: Sequence[str], rule: Callable[[str], str]) -> Iterator[str]:
    """The lines of a header, indented as they are, for a comment.

    Args:
        header: what to say.
        rule: of `mbs.text`, for the syntax of the comment.
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


# Lines that depend on a condition, in languages that need statements for it.


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
