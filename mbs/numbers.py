"""What counts as numbers in a call, what stands for zero, and Functions of arrays."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from casadi import Function
from numpy.typing import NDArray

from mbs.text import quoted

Array = NDArray[np.float64]
OnArrays = Callable[..., list[Array]]
"""A Function of arrays: an array for each input, a new one (rows, columns) for each output."""

NONZERO = 1e-300
"""Stands for zero where one divides: zero over it is zero, numbers up to 1e8 over it are finite,
and it is below the square of every length and speed that means anything."""


def doubles(value: Any) -> NDArray[np.float64] | str:
    """The numbers in a value as doubles; integers, booleans and shorter floats become doubles.

    Args:
        value: anything.

    Returns:
        an array, the value itself where it is one of doubles already; or, of what holds no
        numbers, what is wrong and what to do, the end of a sentence.
    """
    if isinstance(value, np.ma.MaskedArray):
        return "has a mask, which would be passed over; give array.filled(value)"
    try:
        array = np.asarray(value)
    except (ValueError, TypeError, NotImplementedError):  # the last two for symbols of CasADi
        return f"is {quoted(value)}; give numbers"
    if array.dtype.kind not in "biuf":
        what = f"an array of {array.dtype}" if isinstance(value, np.ndarray) else quoted(value)
        return f"is {what}; give numbers"
    return array.astype(float, copy=False)


def numbers_given(value: Any) -> NDArray[np.float64] | str:
    """Return the numbers in a value as `doubles` does, except that True and False are no numbers.

    Args:
        value: positions, velocities, efforts, parameters or limits that a user gives.

    Returns:
        array of doubles, or the end of an error message.
    """
    if has_boolean(value):
        return f"is {quoted(value)}; give numbers instead of True or False"
    return doubles(value)


def has_boolean(value: Any) -> bool:
    """Return whether a value is True or False, or an array or a nested list with one of them."""
    if isinstance(value, (list, tuple)):
        return any(map(has_boolean, value))
    if isinstance(value, np.ndarray):
        return bool(value.dtype.kind == "b")
    return isinstance(value, (bool, np.bool_))


def is_vector(shape: tuple[int, ...]) -> bool:
    """Return whether an array of this shape is one number, a row or a column.

    The elements of a matrix have two orders, by rows in NumPy and by columns in CasADi.
    """
    return sum(length != 1 for length in shape) <= 1


def on_arrays(function: Function) -> OnArrays:
    """A Function of arrays, for where it is evaluated many times.

    In a call CasADi looks through its types for every argument and copies every result twice,
    which takes as long as a thousand operations; here it reads and writes the arrays themselves.
    Each call has memory of its own: threads may share what is returned.

    Args:
        function: any; what is zero by structure in its outputs is zero in the arrays.

    Returns:
        what takes an array for each input, of as many elements column by column, and gives a new
        array (rows, columns) for each output.

    Raises:
        ValueError: in a call, an array has another size than its input.
        RuntimeError: in a call, machine code within it gives no value.
    """
    sizes = [function.nnz_in(k) for k in range(function.n_in())]
    patterns = [function.sparsity_out(k) for k in range(function.n_out())]
    places = [None if one.is_dense() else one.get_triplet() for one in patterns]

    def evaluated(*arguments: Array) -> list[Array]:
        made: Any = function.buffer()
        buffer, run = made
        given = [np.ascontiguousarray(value, dtype=float) for value in arguments]
        if [array.size for array in given] != sizes:
            raise ValueError(f"{function.name()} takes arrays of {sizes} elements")
        found = [np.empty(one.nnz()) for one in patterns]
        for k, array in enumerate(given):
            buffer.set_arg(k, array.reshape(-1).data)
        for k, array in enumerate(found):
            buffer.set_res(k, array.data)
        run()
        if buffer.ret():
            raise RuntimeError(f"{function.name()} has no value there")
        return list(map(_filled, found, patterns, places))

    return evaluated


def _filled(values: Array, pattern: Any, places: tuple[list[int], list[int]] | None) -> Array:
    """The matrix of these elements, zero where the pattern has none."""
    if places is None:
        rows, columns = pattern.shape
        return np.ascontiguousarray(values.reshape(columns, rows).T)
    full = np.zeros(pattern.shape)
    full[places] = values
    return full
