"""Arrays of many states: shapes, where their elements are, and messages about what does not fit."""

from __future__ import annotations

import ctypes
import math
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from mbs.errors import ModelError
from mbs.messages import quoted
from mbs.numbers import doubles

Array: TypeAlias = np.ndarray[Any, Any]

_DOUBLE = 8  # bytes
_MOST_PAST = 500  # elements of a row whose lanes fit on any stack
_LINE = 64  # bytes of a cache line
_SEARCH = 1000  # steps that looking for common memory may take


class CPort(ctypes.Structure):
    """An array as `mbs_port` in rows.h."""

    _fields_ = (
        ("at", ctypes.c_void_p),
        *((name, ctypes.c_longlong) for name in ("row", "column", "stream")),
    )


@dataclass(frozen=True, slots=True)
class ArrayPort:
    """An input or output of one state: its name and shape, of one or two lengths."""

    name: str
    shape: tuple[int, ...]

    def __str__(self) -> str:
        """As in a heading, `q[6]`."""
        return f"{self.name}[{'x'.join(map(str, self.shape))}]"

    @property
    def size(self) -> int:
        """Elements of one state."""
        return math.prod(self.shape)

    def is_many(self, array: Array) -> bool:
        """Whether an array that fits has a row for each state."""
        return array.ndim > len(self.shape)

    def taken(self, value: Any, owner: str) -> Array:
        """The doubles of an input; only arrays of doubles, evenly spaced, are not copied.

        Args:
            value: anything.
            owner: who takes it, to begin a message.

        Raises:
            ModelError: it holds no numbers, or not of this shape, or of many; says what to give.
        """
        array = doubles(value)
        fault = array if isinstance(array, str) else self._fault(array)
        if isinstance(array, str) or fault:
            raise ModelError(f"{owner}: input {self.name} {fault}")
        return array if self._steps(array) else np.array(array, order="C")

    def require_out(self, array: Any, owner: str) -> None:
        """Refuse what cannot take this output, of one state or of many, as it is.

        Args:
            array: anything.
            owner: who fills it, to begin a message.

        Raises:
            ModelError: says what to give.
        """
        fault = ""
        if not isinstance(array, np.ndarray) or array.dtype != np.float64:
            kind = f"an array of {array.dtype}" if isinstance(array, np.ndarray) else quoted(array)
            fault = f"is {kind}; give a numpy array of float64"
        elif isinstance(array, np.ma.MaskedArray):
            fault = "has a mask, which would be passed over; give an array without"
        elif not (fault := self._fault(array)) and self._steps(array) is None:
            fault = "has elements that are not evenly spaced in memory, in steps of 8 bytes"
        if fault:
            raise ModelError(f"{owner}: out for {self.name} {fault}")

    def _fault(self, array: Array) -> str:
        """What is wrong with the shape of an array and what to give; empty where it fits."""
        lengths = len(self.shape)
        if array.shape[-lengths:] == self.shape and array.ndim <= lengths + 1:
            return ""
        many = f"(N, {', '.join(map(str, self.shape))})"
        return (
            f"has the shape {array.shape}; give {many}, or {self.shape} that is the same for"
            " all states"
        )

    def c_port(self, array: Array, past_caches: bool) -> CPort:
        """Where C finds the array.

        Args:
            array: one that fits.
            past_caches: store it past the caches if that is possible.
        """
        row, column = self._steps(array) or (0, 0)
        address = array.ctypes.data
        if past_caches:
            lines = (row == self.size and column == 1) or (row == 1 and column % _DOUBLE == 0)
            past_caches = lines and self.size <= _MOST_PAST and address % _LINE == 0
        return CPort(address, row, column, past_caches)

    def empty(self, states: int | None) -> Array:
        """A new array whose rows follow each other; of one state alone when `states` is None."""
        shape = self.shape if states is None else (states, *self.shape)
        count = math.prod(shape)
        memory = np.empty(count + _LINE // _DOUBLE)
        first = -memory.ctypes.data % _LINE // _DOUBLE
        return memory[first : first + count].reshape(shape)

    def _steps(self, array: Array) -> tuple[int, int] | None:
        """Doubles from state to state and from element to element; None when they vary."""
        if array.flags.c_contiguous and array.flags.aligned:
            return (self.size if self.is_many(array) else 0), 1
        steps = array.strides
        if any(step % _DOUBLE for step in steps) or not array.flags.aligned:
            return None
        own = [
            (length, step // _DOUBLE)
            for length, step in zip(self.shape, steps[-len(self.shape) :], strict=True)
            if length != 1
        ]
        row = steps[0] // _DOUBLE if self.is_many(array) else 0
        if len(own) == 2 and own[0][1] != own[1][0] * own[1][1]:
            return None
        return row, own[-1][1] if own else 1


def same_place(one: Array, other: Array) -> bool:
    """Whether two arrays have each element in the same place."""
    first, second = ((x.ctypes.data, x.shape, x.strides) for x in (one, other))
    return first == second


def overlap(one: Array, other: Array) -> bool:
    """Whether two arrays have some element in one place, as far as that is found out soon."""
    try:
        return np.shares_memory(one, other, max_work=_SEARCH)  # type: ignore[arg-type]
    except np.exceptions.TooHardError:
        return False


def spread(array: Array) -> bool:
    """Whether every element has a place of its own, of an array whose strides do not interlace."""
    return all(step or length < 2 for length, step in zip(array.shape, array.strides, strict=True))
