"""Base class of output languages, and the parts of a function that is written in a language."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from mbs.text import in_line_comment

# Parts of a function with names that are valid in the language: arguments and lines.


Expr = Any
"""Expression of sympy."""


@dataclass(frozen=True, slots=True)
class Argument:
    """Input or output of a function.

    Attributes:
        name: name in the text.
        rows, columns: shape.
        scalar: whether it is a scalar, in contrast to a vector with a single element.
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
        """Whether the argument has a single column."""
        return self.columns == 1


@dataclass(frozen=True, slots=True)
class Load:
    """Assignment of an input element to a name.

    Attributes:
        name: name in the text.
        argument: input.
        row, column: position of the element, 0-based.
    """

    name: str
    argument: Argument
    row: int
    column: int


@dataclass(frozen=True, slots=True)
class Store:
    """Assignment of a name or constant to an output element.

    Attributes:
        argument: output.
        row, column: position of the element, 0-based.
        value: name (sympy symbol) or constant.
        label: name of the element in languages in which outputs are not arrays.
    """

    argument: Argument
    row: int
    column: int
    value: Expr
    label: str


@dataclass(frozen=True, slots=True)
class CodeLine:
    """Assignment of an expression, or of one of two expressions, to a name.

    Attributes:
        name: assigned name.
        value: expression; with a condition, the expression if the condition holds.
        condition: condition, or None.
        otherwise: expression if the condition does not hold.
    """

    name: str
    value: Expr
    condition: Expr = None
    otherwise: Expr = None


@dataclass(frozen=True, slots=True)
class CodeUnit:
    """Function as a sequence of lines, independent of the syntax of the language.

    Attributes:
        name: name of the function in the text.
        header: lines of the header comment.
        tables: lines of the table of geometric parameters, for SYMORO listings.
        inputs, outputs: arguments.
        loads: assignments of the input elements that are used.
        fixed: lines that depend only on parameters.
        changing: all other lines.
        stores: assignments of the output elements that are not zero, column by column.
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
        """Names of local variables: assigned names that are not arguments."""
        arguments = {argument.name for argument in (*self.inputs, *self.outputs)}
        named: list[Load | CodeLine] = [*self.loads, *self.fixed, *self.changing]
        return [item.name for item in named if item.name not in arguments]

    def stores_of(self, argument: Argument) -> Sequence[Store]:
        """Return the assignments of the nonzero elements of an output.

        Args:
            argument: output.
        """
        return [store for store in self.stores if store.argument is argument]

    def has_zeros(self, argument: Argument) -> bool:
        """Whether an element of an output is structurally zero.

        Args:
            argument: output.
        """
        return len(self.stores_of(argument)) < argument.size

    def grid(self, argument: Argument) -> list[list[Expr]]:
        """Return the values of an output as a list of rows, with None for zeros.

        Args:
            argument: output.
        """
        grid: list[list[Expr]] = [[None] * argument.columns for _ in range(argument.rows)]
        for store in self.stores_of(argument):
            grid[store.row][store.column] = store.value
        return grid


WIDTH = 100
"""Largest line length in characters, if the language has no other limit."""

_BREAK = re.compile(r"(?<=[-+*/,&|<>=]) ")
"""Blank after an operator. A line break there cannot end a statement."""


class Language(ABC):
    """Base class of an output language: reserved words, names, numbers and frame of a function.

    Attributes:
        title: name of the language, for messages and headers.
        suffix: file extension.
        reserved: reserved names.
        folds_case: whether names are case-insensitive.
        longest_name: greatest length of a name in characters, or None.
        tail: suffix that makes a name differ from a reserved or used name.
        scalars_by_name: whether a scalar input or output is a variable, in contrast to an array
            with a single element.
        squares_as_products: whether x^2 is written x*x.
        by_columns: whether an argument is an array of its elements column by column, with indices
            from 0.
        brackets: brackets around the indices of an element.
        first: index of the first row and column.
    """

    title: str
    suffix = ".txt"
    reserved: frozenset[str] = frozenset()
    folds_case = False
    longest_name: int | None = None
    tail = "_"
    scalars_by_name = True
    squares_as_products = False
    by_columns = False
    brackets = "(", ")"
    first = 1

    @abstractmethod
    def printer(self) -> Any:
        """Return a printer that writes sympy expressions in this language."""

    @abstractmethod
    def lines(self, unit: CodeUnit, printer: Any) -> Iterator[str]:
        """Yield the lines of the text of a function.

        Args:
            unit: function to write.
            printer: printer of sympy expressions from `printer`.
        """

    def text(self, unit: CodeUnit) -> str:
        """Return the complete text of a function.

        Args:
            unit: function to write.
        """
        return "\n".join(self.lines(unit, self.printer())) + "\n"

    def place(self, argument: Argument, row: int, column: int) -> str:
        """Return the text of an element of an input or output, such as "q(2)".

        Args:
            argument: input or output.
            row: row of the element, 0-based.
            column: column of the element, 0-based.
        """
        if argument.scalar and self.scalars_by_name:
            return argument.name
        if self.by_columns:
            return f"{argument.name}[{row + argument.rows * column}]"
        row, column = row + self.first, column + self.first
        inside = f"{row}" if argument.is_vector else f"{row}, {column}"
        return inside.join((argument.name + self.brackets[0], self.brackets[1]))

    def loads(self, unit: CodeUnit) -> Iterator[str]:
        """Yield statements `name = element` for the input elements that are used.

        Args:
            unit: function to write.
        """
        for load in unit.loads:
            place = self.place(load.argument, load.row, load.column)
            if place != load.name:
                yield f"{load.name} = {place}"

    def stores(self, unit: CodeUnit, out: Argument, printer: Any) -> Iterator[str]:
        """Yield statements `element = value` for the elements of an output that are not zero.

        Args:
            unit: function to write.
            out: output.
            printer: printer of sympy expressions from `printer`.
        """
        for store in unit.stores_of(out):
            place, value = self.place(out, store.row, store.column), printer.text(store.value)
            if place != value:
                yield f"{place} = {value}"

    def legal(self, name: str) -> str:
        """Return the name with characters replaced that the language does not allow."""
        name = re.sub(r"\W", "_", name, flags=re.ASCII).lstrip("_")
        return name if name[:1].isalpha() else f"x{name}"

    def is_reserved(self, name: str) -> bool:
        """Whether the language reserves a name."""
        return self._fold(name) in self.reserved

    def distinct(self, names: Iterable[str]) -> list[str]:
        """Return valid, distinct names.

        Of equal names the first is kept, others get the suffix `tail`.

        Args:
            names: desired names.
        """
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
        """Return the name in lower case if the language ignores case."""
        return name.lower() if self.folds_case else name

    def _spellings(self, name: str) -> Iterator[str]:
        """Yield a name and variants of it with suffixes, each short enough for the language."""
        longest = self.longest_name or len(name) + 9
        yield name[:longest]
        count = 1
        while True:
            ending = self.tail + (str(count) if count > 1 else "")
            yield name[: longest - len(ending)] + ending
            count += 1


def plain_number(value: float) -> str:
    """Return a constant with all digits, and whole numbers without a decimal point.

    Args:
        value: finite number.
    """
    return repr(value).removesuffix(".0")


def wrap(text: str, indent: str = "", mark: str = "", width: int = WIDTH) -> list[str]:
    """Return a statement broken after operators into indented lines.

    Args:
        text: statement.
        indent: indentation of the first line.
        mark: continuation mark of the language at the end of a line.
        width: largest line length in characters.
    """
    lines, line = [], indent
    for piece in _BREAK.split(text):
        if len(line) + len(piece) + len(mark) > width and line.strip():
            lines.append(line.rstrip() + mark)
            line = indent + "    "
        line += piece + " "
    return [*lines, line.rstrip()]


def comment_lines(header: Sequence[str], mark: str) -> Iterator[str]:
    """Yield header lines as line comments.

    Args:
        header: lines of the header.
        mark: beginning of a line comment in the language.
    """
    yield from (f"{mark} {line}".rstrip() for line in kept_inside(header, in_line_comment))


def kept_inside(header: Sequence[str], rule: Callable[[str], str]) -> Iterator[str]:
    """Yield header lines that are safe inside a comment, with their indentation.

    Args:
        header: lines of the header.
        rule: function of `mbs.text` that escapes text for this kind of comment.
    """
    for line in header:
        text = line.lstrip(" ")
        yield " " * (len(line) - len(text)) + rule(text)


def value_text(line: CodeLine, printer: Any, choice: str) -> str:
    """Return the text of the value that a line assigns.

    Args:
        line: line to write.
        printer: printer of expressions.
        choice: format of a conditional expression: `{0}` is the condition, `{1}` the value if it
            holds, `{2}` the other value.
    """
    value = str(printer.text(line.value))
    if line.condition is None:
        return value
    return choice.format(printer.text(line.condition), value, printer.text(line.otherwise))


def sections(unit: CodeUnit) -> Iterator[tuple[str, Sequence[CodeLine]]]:
    """Yield pairs of comment and lines: lines that depend only on parameters, then all others.

    The comment is empty if no line depends only on parameters.

    Args:
        unit: function to write.
    """
    if unit.fixed:
        yield "Parameters only: these may be computed once.", unit.fixed
        yield "The model.", unit.changing
    else:
        yield "", unit.changing


def section_lines(
    unit: CodeUnit, comment: str, statement: Callable[[CodeLine], Iterable[str]]
) -> Iterator[str]:
    """Yield the text lines of all lines of code, with a comment before each section.

    Args:
        unit: function to write.
        comment: format of a comment, with `{}` for its text.
        statement: function that returns the text lines of a line of code.
    """
    for title, lines in sections(unit):
        if title:
            yield comment.format(title)
        for line in lines:
            yield from statement(line)


def grid_texts(unit: CodeUnit, out: Argument, printer: Any, zero: str) -> list[list[str]]:
    """Return the texts of the elements of an output as a list of rows.

    Args:
        unit: function to write.
        out: output.
        printer: printer of expressions.
        zero: text of elements that are zero.
    """
    return [[zero if e is None else printer.text(e) for e in row] for row in unit.grid(out)]


# Conditional lines in languages that need if statements.


def branches(
    line: CodeLine,
    printer: Any,
    words: tuple[str, str, str],
    statement: Callable[[str, str], list[str]],
    end: str = "",
) -> Iterator[str]:
    """Yield the lines of an assignment, or of an if statement with two assignments.

    Args:
        line: line to write.
        printer: printer of expressions.
        words: lines that begin, separate and end the two branches. `{0}` in the first is the
            condition.
        statement: function (statement, indentation) that breaks a statement into lines.
        end: text at the end of a statement.
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
