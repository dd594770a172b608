"""Conversion of arguments to numbers, a substitute for zero divisors, and Functions of arrays."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from casadi import Function
from numpy.typing import NDArray

from mbs.text import quoted

Array = NDArray[np.float64]
OnArrays = Callable[..., list[Array]]
"""Callable with an array per input, which returns a new array (rows, columns) per output."""

NONZERO = 1e-300
"""Substitute for a divisor of zero: zero divided by it is zero, numbers up to 1e8 divided by it are
finite, and it is below the square of every physical length and speed."""


def doubles(value: Any) -> NDArray[np.float64] | str:
    """Return the numbers in a value as an array of doubles, or an error text.

    Args:
        value: any value. Integers, booleans and shorter floats are converted.

    Returns:
        array, which is the value itself if it is an array of doubles. If the value is not numeric:
        end of an error message, with the remedy.
    """
    if isinstance(value, np.ma.MaskedArray):
        return "has a mask, which would be passed over; give array.filled(value)"
    try:
        array = np.asarray(value)
    except (ValueError, TypeError, NotImplementedError):  # last two: CasADi symbols
        return f"is {quoted(value)}; give numbers"
    if array.dtype.kind not in "biuf":
        what = f"an array of {array.dtype}" if isinstance(value, np.ndarray) else quoted(value)
        return f"is {what}; give numbers"
    return array.astype(float, copy=False)


def numbers_given(value: Any) -> NDArray[np.float64] | str:
    """Return the numbers in a value as `doubles` does, but with an error text for True and False.

    Args:
        value: positions, velocities, efforts, parameters or limits that a user gives.

    Returns:
        array of doubles, or the end of an error message.
    """
    if has_boolean(value):
        return f"is {quoted(value)}; give numbers instead of True or False"
    return doubles(value)


def has_boolean(value: Any) -> bool:
    """Return whether a value is True or False, or contains one of them (array, nested list)."""
    if isinstance(value, (list, tuple)):
        return any(map(has_boolean, value))
    if isinstance(value, np.ndarray):
        return bool(value.dtype.kind == "b")
    return isinstance(value, (bool, np.bool_))


def is_vector(shape: tuple[int, ...]) -> bool:
    """Return whether an array of a shape is one number, a row or a column.

    The elements of a matrix have two orders, by rows in NumPy and by columns in CasADi.
    """
    return sum(length != 1 for length in shape) <= 1


def on_arrays(function: Function) -> OnArrays:
    """Return a callable that evaluates a Function on arrays, for many evaluations.

    A call by CasADi checks the type of every argument and copies every result twice, which takes as
    long as a thousand operations. The returned callable reads and writes the arrays directly. Each
    call has its own memory, so that threads may share the callable.

    Args:
        function: any Function. Structural zeros of its outputs become zeros in the arrays.

    Returns:
        callable with an array per input, whose elements are column by column, that returns a new
        array (rows, columns) per output.

    Raises:
        ValueError: the callable gets an array of another size than its input.
        RuntimeError: machine code within the Function returns no value.
    """
    sizes = [function.nnz_in(k) for k in range(function.n_in())]
    patterns = [function.sparsity_out(k) for k in range(function.n_out())]
    places = [None if one.is_dense() else one.get_triplet() for one in patterns]
    counts = [one.nnz() for one in patterns]
    shapes = [(one.size1(), one.size2()) for one in patterns]

    def evaluated(*arguments: Array) -> list[Array]:
        made: Any = function.buffer()
        buffer, run = made
        given = [np.ascontiguousarray(value, dtype=float) for value in arguments]
        if [array.size for array in given] != sizes:
            raise ValueError(f"{function.name()} takes arrays of {sizes} elements")
        found = [np.empty(count) for count in counts]
        for k, array in enumerate(given):
            buffer.set_arg(k, array.reshape(-1).data)
        for k, array in enumerate(found):
            buffer.set_res(k, array.data)
        run()
        if buffer.ret():
            raise RuntimeError(f"{function.name()} has no value there")
        return list(map(_filled, found, shapes, places))

    return evaluated


def _filled(
    values: Array, shape: tuple[int, int], places: tuple[list[int], list[int]] | None
) -> Array:
    """Return the matrix of the shape `shape` with the elements `values`, zero elsewhere.

    `places` are row and column indices of the elements. None means all places, column by column.
    """
    if places is None:
        return np.ascontiguousarray(values.reshape(shape[::-1]).T)
    full = np.zeros(shape)
    full[places] = values
    return full
