"""A function ready to be written in a language: its arguments and its lines, names chosen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

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
